"""Whether robots on rails find tracks and turntables among robots that need none."""

from __future__ import annotations

from automaton.floor.cells import CELL_KINDS, TRACK, TURNTABLE
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.document import Document
from automaton.scenario.schema import Scenario


def check_rails(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Rail robots beside others have both tracks and turntables. Raises InputError."""
    fleet = scenario.fleet
    ways = [fleet.kinematics_of(kind) for kind in fleet.types]
    if "rail" not in ways or len(set(ways)) == 1:
        return
    missing = [
        f"{CELL_KINDS[kind].name}s"
        for kind in (TRACK, TURNTABLE)
        if not (floor_plan.kind == kind).any()
    ]
    if missing:
        number = ways.index("rail")
        raise document.error(
            ("fleet", "types", number),
            f"{fleet.types[number].name} drives on rails beside robots that do not, which takes tracks "
            f"and turntables, but the floor has no {' and no '.join(missing)}; draw them, or set "
            "kinematics of this type to differential or omni",
        )
