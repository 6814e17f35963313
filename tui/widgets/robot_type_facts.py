"""The types of robots, as the viewer tells of them."""

from __future__ import annotations

import msgspec

from automaton.scenario.fleet import FleetType
from tui.playback.panel_view import View


def has_types(view: View) -> bool:
    """Whether robots are of several types, or of one that has a name."""
    return bool(view.run.resolved.scenario.fleet.types)


def type_of(view: View, robot: int) -> FleetType | None:
    """The type of a robot; None where all are alike."""
    types = view.run.resolved.scenario.fleet.types
    return types[view.run.resolved.fleet.type_of[robot]] if types else None


def closed_to(view: View, cell: int) -> list[str]:
    """To whom a cell is closed: types of robots, all, or those without a load or with one."""
    x, y = view.run.resolved.floor_plan.xy(cell)
    areas = view.run.resolved.scenario.areas.values()
    return list(dict.fromkeys(who for area in areas if area.holds(x, y) for who in area.closed_to))


def own_durations(kind: FleetType) -> str:
    """What operations take that take robots of a type otherwise than others: "move 2, turn 1 / 3"."""
    stated = msgspec.to_builtins(kind.durations)
    ticks = {name: value for name, value in stated.items() if value is not None}
    return ", ".join(
        f"{name} {' / '.join(map(str, value.values())) if isinstance(value, dict) else value}"
        for name, value in ticks.items()
    )
