"""The progress of a run: its customer orders, and whether its robots make progress.

Where robots carry pods, the orders of the world are trips; a customer order is done with its last line.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from automaton.engine.facilities import Lines
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_SERVE,
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
from automaton.floor.floor_plan import FLOOR, TRACK, TURNTABLE, FloorPlan


class AskedOrders(NamedTuple):
    """The customer orders of a run; each array is (m,)."""

    release: Array  # int64: tick from which the order is known
    due: Array  # int64: due tick; NEVER without one
    done: Array  # int64: tick in which the order was done, or NIL
    is_known: Array  # bool

    @property
    def is_open(self) -> Array:
        """(m,) bool: known and not done."""
        is_open: Array = self.is_known & (self.done == NIL)
        return is_open

    def after(self, tick: int) -> AskedOrders:
        """The orders that were done after a tick or are open."""
        later = self.is_open | (self.done > tick)
        return AskedOrders(*(column[later] for column in self))


def has_lines(world: World) -> bool:
    """Whether orders consist of lines (robots carry pods)."""
    return len(world.lines.order) > 0


def asked_orders(world: World) -> AskedOrders:
    """The customer orders of a world: its orders with lines, else the orders of its robots."""
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
    """The number of customer orders."""
    return len(world.lines.left) if has_lines(world) else len(world.orders.state)


def done_count(orders: Orders, lines: Lines) -> int:
    """The number of customer orders that are done."""
    if len(lines.order):
        return int(np.count_nonzero(lines.order_done != NIL))
    return int(np.count_nonzero(orders.state == ORDER_DELIVERED))


# Robots that have made no progress for long, and the groups in which they stand.
#
# A robot makes progress when it picks up or drops a load, makes a visit, or charges. Motion alone is not
# progress: in a jam robots may turn and push each other for ever.


LEAST_STARVED_TICKS: Final = 500
# Drives across the floor: one for the longest trip, and three more for traffic.
STARVED_DRIVES: Final = 4
JAM_ROBOTS: Final = 2  # least number of robots of a jam
SERVICE: Final = (ACTION_PICK, ACTION_DROP, ACTION_SERVE)
REACH: Final = 2  # largest distance in rows and in columns between neighbours in a jam or a queue


class Jam(NamedTuple):
    """Robots without progress that stand together, and two corners [x, y] of their bounding box."""

    robots: tuple[int, ...]
    first: tuple[int, int]
    last: tuple[int, int]
    ticks: int  # least time without progress


def starved_ticks(world: World) -> int:
    """The number of ticks without progress after which a robot counts as starved.

    Four times the ticks that the slowest type takes to drive the width and the height of the floor,
    to pick and to drop, but at least 500.
    """
    grid, slowest = world.grid, world.rules.duration.max(axis=0)
    width = int(grid.width) - 2  # without the border
    height = len(grid.kind) // int(grid.width) - 2
    move = max(int(slowest[ACTION_MOVE]), int(grid.min_move_ticks.max(initial=0)))
    drive = (width + height) * move
    drive += int(slowest[ACTION_PICK]) + int(slowest[ACTION_DROP])
    return max(LEAST_STARVED_TICKS * int(world.rules.refinement), STARVED_DRIVES * drive)


def starved_robots(world: World, ticks: int | None = None) -> Array:
    """Storage indices of robots that have work but have made no progress for `ticks`.

    `ticks` defaults to `starved_ticks`. Robots that are down, that queue for a charger or that
    `wait_for_service` do not count.
    """
    robots = world.robots
    at_work = (robots.goal_type != GOAL_NONE) & (robots.goal_type != GOAL_PARK)
    at_work &= (robots.status == STATUS_UP) & (robots.ticket == 0)
    ticks = starved_ticks(world) if ticks is None else ticks
    stalled: Array = np.flatnonzero(
        at_work & (world.tally.progress <= int(world.clock.tick) - ticks)
    )
    return stalled[~wait_for_service(world, ticks)[stalled]] if len(stalled) else stalled


def wait_for_service(world: World, ticks: int) -> Array:
    """(n,) bool: robots that are served, or that queue before a place that serves.

    A place serves if a robot is in service there, or was within the last `ticks`. The queue before it
    are the robots bound for such places that form a group with it (REACH), so a place that a jam has
    cut off has a queue only until it has served no robot for `ticks`.
    """
    robots, orders, since = world.robots, world.orders, int(world.clock.tick) - ticks
    served: Array = np.isin(robots.action, SERVICE) & (robots.busy > 0) & (robots.cell != NIL)
    picked, dropped = (orders.picked > since) & (orders.source >= 0), orders.delivered > since
    slots = np.concatenate((orders.source[picked], orders.target[dropped & (orders.target >= 0)]))
    access, visited = world.slots.access[slots].ravel(), world.stops.done > since
    places = np.unique(
        np.concatenate((robots.cell[served], access[access != NIL], world.stops.cell[visited]))
    )
    bound = np.flatnonzero((robots.cell != NIL) & np.isin(robots.goal_cell, places))
    if len(bound):
        cells = np.concatenate((robots.cell[bound], places)).astype(np.int64)
        group = _groups(*np.divmod(cells, int(world.grid.width)))
        served[bound] |= np.isin(group[: len(bound)], group[len(bound) :])
    return served


def stuck_robots(world: World, ticks: int) -> Array:
    """Storage indices of starved robots on the floor, except those that wait for a charger or a break.

    These are on their way to a charger, or to a station that had a break within the last `ticks`.
    """
    stations, tick, robots = world.pod_stations, int(world.clock.tick), world.robots
    began, ended = stations.breaks[:, 1], stations.breaks[:, 2]
    lately = stations.breaks[(began <= tick) & (ended > tick - ticks), 0]
    waits = np.isin(robots.goal_cell, stations.cell[lately]) | (robots.goal_type == GOAL_CHARGE)
    starved = starved_robots(world, ticks)
    stuck: Array = starved[(robots.cell[starved] != NIL) & ~waits[starved]]
    return stuck


def oldest_order(world: World) -> int:
    """Age in ticks of the oldest open order, whether taken or not; 0 if no order is open."""
    orders = asked_orders(world)
    if not orders.is_open.any():
        return 0
    return int(world.clock.tick) - int(orders.release[orders.is_open].min())


def largest_jam(world: World, floor_plan: FloorPlan) -> Jam | None:
    """Return the jam with the most robots; ties go to the jam with the lowest robot number."""
    return max(jams(world, floor_plan), key=lambda jam: len(jam.robots), default=None)


def jams(world: World, floor_plan: FloorPlan) -> list[Jam]:
    """Return all jams, ordered by their lowest robot numbers."""
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
    """(k,) the group of each place; places within REACH of each other share a group, transitively.

    The number of a group is the index of its first place.
    """
    width = int(columns.max()) + REACH + 1  # keeps the ends of neighbouring rows apart
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
    """Key offsets from a place to itself and to places within REACH later in reading order."""
    side = range(-REACH, REACH + 1)
    return [y * width + x for y in range(REACH + 1) for x in side if y * width + x >= 0]


def _pairs(keys: Array, order: Array, offset: int) -> tuple[Array, Array]:
    """Indices of places with a neighbour at `offset`, and of its first place in that cell."""
    ahead = keys + offset
    place = np.minimum(np.searchsorted(keys, ahead, sorter=order), len(keys) - 1)
    near = keys[order[place]] == ahead
    return np.flatnonzero(near), order[place[near]]


# The places where most time is lost.


MAX_SLOW_PLACES: Final = 3
SLOW_PLACE_REACH: Final = 2  # largest distance, in rows and in columns, from the centre
MAX_CANDIDATES: Final = 500  # cells with most lost time that may be centres
MIN_AISLE: Final = 3  # cells
NAMED_REACH: Final = 3  # largest distance of a named place


class SlowPlace(NamedTuple):
    """A place where robots lose time, or a saturated station."""

    cell: int  # its centre
    ticks: int  # robot ticks lost there
    share: float  # of all lost time; of a station, of the run
    place: str  # in words
    of_total: str = "of lost time"

    @property
    def words(self) -> str:
        """The place and its share: "around (5, 0): 57 % of lost time"."""
        return f"{self.place}: {100 * self.share:.0f} % {self.of_total}"


def slow_places(
    lost: Array, floor_plan: FloorPlan, place_names: dict[int, str]
) -> tuple[SlowPlace, ...]:
    """The places that cost most time, the worst first. `lost`: (C,) robot ticks lost in each cell."""
    left, total, worst = lost.astype(np.int64), int(lost.sum()), []
    names = tuple(place_names.items())
    side = np.arange(-SLOW_PLACE_REACH, SLOW_PLACE_REACH + 1)
    around = (side[:, None] * floor_plan.stride + side).reshape(-1)
    for _ in range(MAX_SLOW_PLACES):
        cells = np.flatnonzero(left)
        if not len(cells):
            break
        if len(cells) > MAX_CANDIDATES:
            most = np.argpartition(left[cells], -MAX_CANDIDATES)[-MAX_CANDIDATES:]
            cells = np.sort(cells[most])
        near = np.clip(cells[:, None] + around, 0, len(left) - 1)
        here = near[int(np.argmax(left[near].sum(axis=1)))]
        centre = int(here[np.argmax(left[here])])
        ticks = int(left[np.unique(here)].sum())
        place = place_words(centre, floor_plan, names)
        worst.append(SlowPlace(centre, ticks, ticks / total, place))
        left[here] = 0
    return tuple(worst)


def place_words(cell: int, floor_plan: FloorPlan, names: tuple[tuple[int, str], ...]) -> str:
    """A place in words: a named place near it, else its aisle, a mouth of it, or the cell.

    names: cells with their names.
    """
    at = floor_plan.xy(cell)
    rows, columns = np.divmod(np.array([one for one, _ in names], np.int64), floor_plan.stride)
    row, column = divmod(cell, floor_plan.stride)
    distance = np.maximum(abs(rows - row), abs(columns - column))
    if len(names) and (least := int(distance.min())) <= NAMED_REACH:
        nearest = dict.fromkeys(names[place][1] for place in np.flatnonzero(distance == least))
        return f"{'before ' * bool(least)}{' and '.join([*nearest][:2])}, {at}"
    aisles = aisles_of(floor_plan)
    inside = int(aisles[cell])
    beside = aisles[[cell + 1, cell + floor_plan.stride, cell - 1, cell - floor_plan.stride]]
    if inside and (beside == inside).sum() == 2:
        return f"aisle {inside}, {at}"
    number = inside or int(beside.max())
    return f"mouth of aisle {number}, {at}" if number else f"around {at}"


@lru_cache(maxsize=4)
def aisles_of(floor_plan: FloorPlan) -> Array:
    """(C,) int32 the number of the aisle of each cell, in reading order from 1; 0: none.

    An aisle is straight and one cell wide, with at least MIN_AISLE cells.
    """
    way = np.isin(floor_plan.kind, (FLOOR, TRACK, TURNTABLE))
    number = np.zeros(way.shape, np.int64)
    for axis in (0, 1):  # along columns, along rows
        along, across = ([np.roll(way, step, one) for step in (1, -1)] for one in (axis, 1 - axis))
        inside = way & ~across[0] & ~across[1] & (along[0] | along[1])
        begins = inside & ~np.roll(inside, 1, axis)
        order = begins.T if axis == 0 else begins
        run = np.cumsum(order).reshape(order.shape)
        run = (run.T if axis == 0 else run) * inside
        long = np.bincount(run.reshape(-1)) >= MIN_AISLE
        first = np.zeros(len(long), np.int64)  # each run's first cell, plus 1
        first[run[begins]] = np.flatnonzero(begins) + 1
        number = np.where(inside & long[run], first[run], number)
    names = np.unique(number[number > 0])
    ranks = np.searchsorted(names, number) + 1
    return np.where(number, ranks, 0).astype(np.int32).reshape(-1)
