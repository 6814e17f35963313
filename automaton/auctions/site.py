"""The floor of a run as a market: where robots will be free, and how far everything is from there.

Places, in this order: one for each robot, where it is free next; the chargers; for each task the cells
where it begins and ends. Ways are those of the empty floor. A way between two tasks begins in the
worst heading, so that energy is never counted too low; every tick of it is paid as the dearest of
driving and turning.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from automaton.auctions.market import Battery, Fleet, Scratch, Work
from automaton.auctions.preparation import battery_of, deliveries, fleet_of, scratch_for
from automaton.compiled import kernel
from automaton.kernels.operations import first_cell
from automaton.kernels.search import distance
from automaton.struct import Struct
from automaton.world.state import (
    MOVE,
    NIL,
    TURN,
)

Array = NDArray[Any]

CAPPED = 1 << 29  # ticks or units of what cannot be reached: two of them still fit an int32


class Site(Struct):
    """A market over a world: R robots, T tasks, C chargers; P = R + C + 2 T places."""

    work: Work
    battery: Battery
    fleet: Fleet
    scratch: Scratch
    robot: Array  # (R,) int32: storage index of each robot
    cell: Array  # (P,) int32
    order: Array  # (T,) int32: the order of each task
    item: Array  # (T,) int32: tasks that are for sale
    queues: int  # 1: robots wait for those that were sent to a charger before


def site_for(
    view: Any, robots: int, tasks: int, longest: int, policy: dict[str, int], queues: bool = True
) -> Site:
    """Room for so many robots and tasks; `policy`: policy, end_reach, threshold and target."""
    chargers = view.chargers.cell
    places = robots + len(chargers) + 2 * tasks
    nothing, none = np.zeros((places, places), np.int32), np.zeros(tasks, np.int32)
    curve = tuple((int(since), int(rate)) for since, rate in view.rules.curve)
    battery = battery_of(
        nothing,
        np.arange(robots, robots + len(chargers)),
        curve=curve,
        reserve=int(view.rules.reserve),
        end_reach=bool(policy["end_reach"]),
        policy=policy["policy"],
        threshold=policy["threshold"],
        target=policy["target"],
    )
    cell = np.full(places, NIL, np.int32)
    cell[robots : robots + len(chargers)] = chargers
    begin = robots + len(chargers) + 2 * np.arange(tasks)
    return Site(
        work=deliveries(nothing, nothing, begin, begin + 1, none, none),
        battery=battery,
        fleet=fleet_of(np.arange(robots), tasks, longest=longest),
        scratch=scratch_for(robots, tasks, longest, len(chargers)),
        robot=np.zeros(robots, np.int32),
        cell=cell,
        order=np.zeros(tasks, np.int32),
        item=np.zeros(tasks, np.int32),
        queues=int(queues),
    )


@kernel
def longest_way(view, space, start, end):
    """Ticks from one cell to another in the worst heading at the start."""
    most = 0
    for heading in range(view.grid.headings):
        most = max(most, distance(view, space, start, heading, end))
    return min(most, CAPPED)


@kernel
def way_from(view, space, i, end):
    """Ticks from where robot i is, as it stands there."""
    robots = view.robots
    start = first_cell(robots, i)
    return min(distance(view, space, start, np.int64(robots.heading[i]), end), CAPPED)


@kernel
def rate_of_driving(rules, headings, loaded):
    """Units that a tick on the way takes at most."""
    rate = np.int64(rules.drain[MOVE, loaded])
    if headings > 1:
        rate = max(rate, np.int64(rules.drain[TURN, loaded]))
    return rate


@kernel
def stand_of(view, slot, from_right):
    """The cell from which allocation has a slot served: at its right to pick up, else at its left."""
    access = view.slots.access
    for k in range(4):
        direction = k if from_right == 0 else (2 - k if k != 3 else 3) & 3
        if access[slot, direction] != NIL:
            return np.int64(access[slot, direction])
    return np.int64(NIL)
