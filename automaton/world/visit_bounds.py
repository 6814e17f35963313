"""How many visits robots and stations can make at most, where pods are carried to stations.

A trip of one visit takes a robot its pick, the least drive with the pod to the station and back to the
same cell, the handling and the drop. A station whose robots leave it over another cell than they came
over is passed by a full queue every handling + turns in its cell + 2 d - 1 ticks, with moves of d.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.floor.travel_ticks import Driving, ticks_between
from automaton.scenario.durations import Distribution, Handling
from automaton.scenario.orders import line_column, listed_lines
from automaton.scenario.robot_types import RobotType, types_of
from automaton.scenario.schema import Scenario
from automaton.scenario.table_files import pod_cells
from automaton.units import count
from automaton.world.resolve import Resolved

HOUR: float = 3600.0  # seconds

Ticks = npt.NDArray[np.int64]


class VisitBounds(NamedTuple):
    """Ticks of trips and visits with one line each."""

    robots: int
    stations: int
    trip: float  # of a robot, on average over pods and stations
    visit: float  # of a station

    def visits(self, ticks: float) -> tuple[float, float]:
        """How many visits all robots and all stations can make in some time."""
        return self.robots * ticks / self.trip, self.stations * ticks / self.visit


def loaded_driving(robot_type: RobotType) -> Driving:
    """How robots of a type drive with a load."""
    return Driving(
        headings=robot_type.headings,
        move=robot_type.moves.loaded,
        turn=robot_type.turns.loaded,
        rail=robot_type.rail,
        loaded=True,
    )


def round_trips(resolved: Resolved) -> Ticks:
    """(pods, stations) least ticks with a pod to a station and back, turns included, of any type."""
    ways = dict.fromkeys(loaded_driving(one) for one in types_of(resolved.scenario))
    least: Ticks = np.min([round_trips_of(resolved, driving) for driving in ways], axis=0)
    return least


def round_trips_of(resolved: Resolved, driving: Driving) -> Ticks:
    """The same of robots that drive so."""
    floor_plan = resolved.floor_plan
    pods = pod_cells(resolved.scenario, floor_plan)
    result = np.zeros((len(pods), len(floor_plan.stations)), np.int64)
    for number, cell in enumerate(floor_plan.stations.tolist()):
        ways = [
            ticks_between(floor_plan, driving, cell, True, heading)[pods].min(axis=1)
            + ticks_between(floor_plan, driving, cell, False, heading)[pods].min(axis=1)
            for heading in range(driving.headings)
        ]
        result[:, number] = np.min(ways, axis=0)
    return result


def visit_bounds(resolved: Resolved) -> VisitBounds | None:
    """The bounds of a scenario; None where no pods are carried."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    if scenario.orders.lines is None:
        return None
    handling, fleet = mean_handling(scenario), resolved.fleet
    drive = float(round_trips(resolved).mean())
    turns = least_turns(resolved) * fleet.least_loaded_turn
    passing = handling + turns + 2 * fleet.least_loaded_move - 1
    return VisitBounds(
        scenario.fleet.robots,
        len(floor_plan.stations),
        fleet.least_pick + drive + handling + fleet.least_drop,
        passing,
    )


def least_turns(resolved: Resolved) -> int:
    """Quarter turns that a robot makes at least in the cell of a station, on its way through."""
    floor_plan = resolved.floor_plan
    least = 2
    for cell in floor_plan.stations.tolist():
        exits = int(floor_plan.exits.flat[cell])
        for way, offset in enumerate(floor_plan.offsets):
            if not int(floor_plan.exits.flat[cell - offset]) >> way & 1:
                continue  # no robot comes in this direction
            for out in range(4):
                if exits >> out & 1:
                    turns = (out - way) % 4
                    least = min(least, 1 if turns == 3 else turns)
    return least


def mean_handling(scenario: Scenario) -> float:
    """Mean ticks of a visit for one line, of durations.handling."""
    handling: Handling = scenario.durations.handling
    line = mean_of(handling.line) if isinstance(handling.line, Distribution) else handling.line
    units = 1.0
    lines = listed_lines(scenario.orders)
    if lines:
        units = float(line_column(lines, "units").mean())
    return handling.visit + line + units * handling.unit


def mean_of(distribution: Distribution) -> float:
    """The mean of a distribution, in ticks."""
    if distribution.uniform is not None:
        return (distribution.uniform.least + distribution.uniform.most) / 2
    if distribution.lognormal is not None:
        return distribution.lognormal.mean
    if distribution.exponential is not None:
        return distribution.exponential
    assert isinstance(distribution.empirical, tuple), "its file has been read"
    return float(np.mean(distribution.empirical))


def bounds_in_words(resolved: Resolved) -> list[str]:
    """What `check` says of them."""
    bounds = visit_bounds(resolved)
    if bounds is None:
        return []
    seconds = resolved.scenario.units.scale.unit.seconds
    ticks, each = (1000.0, "1,000 ticks") if seconds is None else (HOUR / seconds, "hour")
    robots, stations = bounds.visits(ticks)
    article = "in" if seconds is None else "an"
    return [
        f"{robots:,.0f} visits {article} {each} by {count(bounds.robots, 'robot')} and "
        f"{stations:,.0f} by {count(bounds.stations, 'station')} at most, if lines want all pods alike, "
        "each is a trip of its own, and pods go back to where they stood; drives without a pod are not "
        "counted"
    ]
