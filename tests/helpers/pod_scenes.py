"""Small floors with pods, and what happened to their lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from automaton.engine.state import NIL
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.world.resolve import Resolved, resolve

RING = """\
>>>>>>>>>v
^#pppp#q#v
^########v
^<<<<t<<<<"""
HANDLING = {"line": 20}


def pod_scenario(lines: Sequence[dict[str, Any]] | dict[str, Any], **parts: Any) -> dict[str, Any]:
    """The keys of a scenario on the ring, one robot and a station of three queue cells, P1."""
    given = {
        "name": "pods",
        "layout": {"picture": parts.pop("picture", RING)},
        "fleet": {"robots": 1, "kinematics": "omni", "start": [[2, 1]]},
        "durations": {"pick": 3, "drop": 3, "handling": HANDLING},
        "stations": {"P1": {"at": [5, 3], "queue": [[6, 3], [8, 3]]}},
        "orders": {"lines": lines},
        "strategy": {
            "allocation": {"name": "shortest-job", "idle": "stay"},
            "right_of_way": "wait",
        },
        "stop": {"when": "delivered", "max_duration": 10_000},
    }
    return given | parts


def pod_scene(lines: Sequence[dict[str, Any]] | dict[str, Any], **parts: Any) -> Resolved:
    """The same, checked."""
    return resolve(msgspec.convert(pod_scenario(lines, **parts), Scenario))


def played(resolved: Resolved, until: int | None = None) -> Simulation:
    run = Simulation(resolved)
    run.run(until)
    return run


def line_ticks(run: Simulation) -> list[int]:
    """The tick in which each line was done."""
    found: list[int] = run.world.lines.done.tolist()
    return found


def trips(run: Simulation) -> list[list[int]]:
    """The lines of each trip."""
    of = run.world.lines.trip.tolist()
    return [[line for line, trip in enumerate(of) if trip == k] for k in sorted(set(of) - {NIL})]
