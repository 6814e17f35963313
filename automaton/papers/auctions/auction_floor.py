"""The floor, batteries and fleets of De Ryck et al., ready for the kernels of auctions.

Places are the positions 1..17 of the paper's figure less one; one tick is a second, robots drive 1 m/s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

import numpy as np

from automaton.engine.robot_states import BATTERY_FULL
from automaton.scenario.floor_section import generator_type
from strategies.allocation.auction.market import (
    POLICY_NO_CHARGING,
    Array,
    Battery,
    Fleet,
    Scratch,
    TaskCosts,
    battery_of,
    fleet_of,
    scratch_for,
    visits,
)
from strategies.allocation.auction.quotes import settle_all

PERCENT: Final = BATTERY_FULL // 100
DEPOTS: Final = (1, 2, 3, 17, 1, 2)  # where robots 1..6 start; five and six share a depot
STATIONS: Final = tuple(range(4, 17))


@cache
def seconds(lanes: str = "full") -> Array:
    """(17, 17) int32 seconds between positions."""
    return generator_type("depots")(lanes=lanes).metres().astype(np.int32)  # type: ignore[attr-defined, no-any-return]


def place(position: int) -> int:
    """The place of a position of the paper."""
    return position - 1


def work_of(tasks: Sequence[int], between: Array, drain: int = 0) -> TaskCosts:
    """Tasks at these positions; drain: units per second of driving."""
    return visits(between, between * drain, [place(task) for task in tasks])


def rules(
    between: Array,
    drain: int,
    rate: int | Sequence[tuple[int, int]],
    chargers: Sequence[int] = (2,),
    policy: int = POLICY_NO_CHARGING,
    **settings: Any,
) -> Battery:
    """A battery; rate: units per second of charging, or the pieces of a curve."""
    curve = ((0, rate),) if isinstance(rate, int) else tuple(rate)
    places = [place(charger) for charger in chargers]
    return battery_of(between.astype(np.int64) * drain, places, curve, policy=policy, **settings)


NO_BATTERY: Final[Mapping[str, Battery]] = {
    lanes: rules(seconds(lanes), 0, 1, ()) for lanes in ("full", "comb")
}


def fleet_at(
    positions: Sequence[int], tasks: int, charge: int | Sequence[int] = BATTERY_FULL
) -> Fleet:
    """Robots at these positions with empty lists."""
    return fleet_of([place(position) for position in positions], tasks, charge)


def scratch_of(fleet: Fleet, tasks: int, chargers: int = 1) -> Scratch:
    """Scratch for auctions of so many tasks among this fleet."""
    robots, longest = fleet.order.shape
    return scratch_for(robots, tasks, longest, chargers)


def give(fleet: Fleet, robot: int, tasks: Sequence[int]) -> None:
    """Make these tasks, by number, the robot's list."""
    fleet.order[robot, : len(tasks)] = tasks
    fleet.length[robot] = len(tasks)


def empty(task_costs: TaskCosts, battery: Battery, fleet: Fleet, scratch: Scratch) -> None:
    """Take all tasks off all lists."""
    fleet.length[:] = 0
    settle_all(task_costs, battery, fleet, scratch)


def listed(fleet: Fleet, robot: int) -> list[int]:
    """The tasks of a robot by number."""
    found: list[int] = fleet.order[robot, : fleet.length[robot]].tolist()
    return found
