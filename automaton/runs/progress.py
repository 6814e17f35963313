"""How far a run is: the orders that were asked for, and whether the fleet gets on.

Where pods are carried, the orders of the world are trips; those that were asked for are done with the
last of their lines.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from automaton.engine.facilities import Lines
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    GOAL_CHARGE,
    GOAL_NONE,
    GOAL_PARK,
    NEVER,
    NIL,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
    STATUS_UP,
    Array,
    Orders,
    World,
)
from automaton.floor.floor_plan import FloorPlan


class AskedOrders(NamedTuple):
    """The orders of a run: (m,) each."""

    release: Array  # int64: the tick from which it is known
    due: Array  # int64: NEVER without a due time
    done: Array  # int64: the tick in which it was done, or NIL
    is_known: Array  # bool

    @property
    def is_open(self) -> Array:
        """(m,) bool: known and not done."""
        is_open: Array = self.is_known & (self.done == NIL)
        return is_open

    def after(self, tick: int) -> AskedOrders:
        """Those that were done after a tick, or are open."""
        later = self.is_open | (self.done > tick)
        return AskedOrders(*(column[later] for column in self))


def has_lines(world: World) -> bool:
    """Whether orders consist of lines."""
    return len(world.lines.order) > 0


def asked_orders(world: World) -> AskedOrders:
    """The orders of a world that pods are carried for, or its own."""
    orders, lines = world.orders, world.lines
    if not has_lines(world):
        is_done = orders.state == ORDER_DELIVERED
        done = np.where(is_done, orders.delivered, NIL).astype(np.int64)
        known = orders.state != ORDER_UNRELEASED
        if len(world.pods.slot):  # some may wait for their pods
            known |= orders.release_tick <= world.clock.tick
        return AskedOrders(
            orders.release_tick.astype(np.int64), orders.due.astype(np.int64), done, known
        )
    release, due = (np.full(len(lines.left), NEVER, np.int64) for _ in range(2))
    np.minimum.at(release, lines.order, lines.release_tick)
    np.minimum.at(due, lines.order, lines.due)
    known = release <= world.clock.tick
    return AskedOrders(release, due, lines.order_done.astype(np.int64), known)


def asked_count(world: World) -> int:
    """How many orders there are."""
    return len(world.lines.left) if has_lines(world) else len(world.orders.state)


def done_count(orders: Orders, lines: Lines) -> int:
    """How many of them are done."""
    if len(lines.order):
        return int(np.count_nonzero(lines.order_done != NIL))
    return int(np.count_nonzero(orders.state == ORDER_DELIVERED))


# Whether a fleet gets on: robots that have finished nothing for long, and where they stand together.
#
# A robot makes progress when it picks up or drops a load, makes a visit, or charges. That robots move
# says little: in a jam they may turn and push each other for ever.


LEAST_STARVED_TICKS: Final = 500
# From side to side; the longest trip, and three times its length in traffic.
STARVED_DRIVES: Final = 4
JAM_ROBOTS: Final = 2  # fewer that stand together do not count
REACH: Final = 2  # rows and columns between two robots of one jam


class Jam(NamedTuple):
    """Robots without progress that stand together, and the cells [x, y] of the corners around them."""

    robots: tuple[int, ...]
    first: tuple[int, int]
    last: tuple[int, int]
    ticks: int  # for which they have finished nothing, at least


def starved_ticks(world: World) -> int:
    """After how many ticks in which it has finished nothing a robot counts as starved.

    Four times what the slowest type takes for the width and the height of the floor, a pick and a
    drop; 500 at least.
    """
    grid, slowest = world.grid, world.rules.duration.max(axis=0)
    width = int(grid.width) - 2  # without the border
    height = len(grid.kind) // int(grid.width) - 2
    move = max(int(slowest[ACTION_MOVE]), int(grid.min_move_ticks.max(initial=0)))
    drive = (width + height) * move
    drive += int(slowest[ACTION_PICK]) + int(slowest[ACTION_DROP])
    return max(LEAST_STARVED_TICKS * int(world.rules.refinement), STARVED_DRIVES * drive)


def starved_robots(world: World, ticks: int | None = None) -> Array:
    """Storage indices of robots with something to do that have finished nothing for long.

    `ticks`: how long; those of `starved_ticks` unless given. Robots that are down, or queue for a
    charger, are not among them.
    """
    robots = world.robots
    at_work = (robots.goal_type != GOAL_NONE) & (robots.goal_type != GOAL_PARK)
    at_work &= (robots.status == STATUS_UP) & (robots.ticket == 0)
    ticks = starved_ticks(world) if ticks is None else ticks
    stalled: Array = np.flatnonzero(
        at_work & (world.tally.progress <= int(world.clock.tick) - ticks)
    )
    return stalled


def stuck_robots(world: World, ticks: int) -> Array:
    """Storage indices of starved robots on the floor that do not wait to be served.

    Those wait for a charger that others use, or for a station that has had a break in these ticks.
    """
    stations, tick, robots = world.pod_stations, int(world.clock.tick), world.robots
    began, ended = stations.breaks[:, 1], stations.breaks[:, 2]
    lately = stations.breaks[(began <= tick) & (ended > tick - ticks), 0]
    waits = np.isin(robots.goal_cell, stations.cell[lately]) | (robots.goal_type == GOAL_CHARGE)
    starved = starved_robots(world, ticks)
    stuck: Array = starved[(robots.cell[starved] != NIL) & ~waits[starved]]
    return stuck


def oldest_order(world: World) -> int:
    """Ticks since the release of the order that has been open for longest, taken or not; 0: none is."""
    orders = asked_orders(world)
    if not orders.is_open.any():
        return 0
    return int(world.clock.tick) - int(orders.release[orders.is_open].min())


def largest_jam(world: World, floor_plan: FloorPlan) -> Jam | None:
    """Return the most robots without progress that stand near each other, ties to the first robot."""
    return max(jams(world, floor_plan), key=lambda jam: len(jam.robots), default=None)


def jams(world: World, floor_plan: FloorPlan) -> list[Jam]:
    """Return all groups of robots without progress that stand near each other, by their first robots."""
    ticks, groups = starved_ticks(world), []
    stalled = stuck_robots(world, ticks)
    stalled = stalled[np.argsort(world.robots.identity[stalled])]
    if len(stalled) < JAM_ROBOTS:
        return []
    places = np.divmod(world.robots.cell[stalled].astype(np.int64), floor_plan.stride)
    group = _groups(*places)
    for one in np.flatnonzero(np.bincount(group) >= JAM_ROBOTS):
        rows, columns = (place[group == one] for place in places)
        first, last = (
            floor_plan.xy(int(side(rows)) * floor_plan.stride + int(side(columns)))
            for side in (np.min, np.max)
        )
        robots = world.robots.identity[stalled[group == one]]
        groups.append(Jam(tuple(robots.tolist()), first, last, ticks))
    return groups


def _groups(rows: Array, columns: Array) -> Array:
    """(k,) the group of each place: places within REACH of each other, transitively.

    A group is named by the first of its places, so that of two the one whose place comes first is less.
    """
    width = int(columns.max()) + REACH + 1  # no place is near one at the other end of a row
    keys = rows * width + columns
    order = np.argsort(keys, kind="stable")
    pairs = [_pairs(keys, order, offset) for offset in _offsets(width)]
    one, other = (np.concatenate(ends) for ends in zip(*pairs, strict=True))
    group = np.arange(len(keys))
    while True:
        less = np.minimum(group[one], group[other])
        more = np.maximum(group[one], group[other])
        if (less == more).all():
            return group
        np.minimum.at(group, more, less)
        while (group != group[group]).any():
            group = group[group]


def _offsets(width: int) -> list[int]:
    """From a place to those within REACH that come later in reading order, and to itself."""
    side = range(-REACH, REACH + 1)
    return [y * width + x for y in range(REACH + 1) for x in side if y * width + x >= 0]


def _pairs(keys: Array, order: Array, offset: int) -> tuple[Array, Array]:
    """Places, and one that lies there from each; of several in a cell the first."""
    ahead = keys + offset
    place = np.minimum(np.searchsorted(keys, ahead, sorter=order), len(keys) - 1)
    near = keys[order[place]] == ahead
    return np.flatnonzero(near), order[place[near]]
