"""The types of robots, as the viewer tells of them."""

from __future__ import annotations

from automaton.scenario.fleet import FleetType
from automaton.scenario.robot_types import closed_cells, type_of_each, types_of
from tui.playback.panel_view import View


def has_types(view: View) -> bool:
    """Whether robots are of several types, or of one that has a name."""
    return bool(view.run.resolved.scenario.fleet.types)


def type_of(view: View, robot: int) -> FleetType | None:
    """The type of a robot; None where all are alike."""
    fleet = view.run.resolved.scenario.fleet
    return fleet.types[type_of_each(fleet)[robot]] if fleet.types else None


def closed_to(view: View, cell: int) -> list[str]:
    """The types of robots to which a cell is closed."""
    types = types_of(view.run.resolved.scenario)
    return [
        robot_type.name for robot_type in types if closed_cells(view.floor_plan, robot_type)[cell]
    ]
