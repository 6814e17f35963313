"""The types of robots, as the viewer tells of them."""

from __future__ import annotations

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
    """The types of robots to which a cell is closed."""
    fleet = view.run.resolved.fleet
    pairs = zip(fleet.types, fleet.closed[:, cell], strict=True)
    return [robot_type.name for robot_type, is_closed in pairs if is_closed]
