"""The data of an auction: tasks with their distances, batteries, and the lists of robots.

A *place* is the start or end of a drive: the cell of a robot, a stop, a charger. A task begins at one
place and ends at another (pick-up and delivery without a stop between, since a robot holds one load),
or begins and ends at the same place (a visit). A list is an open path, without a return.

Times are whole ticks. Energy is counted in units: BATTERY_FULL units are 100 %.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from automaton.strategy.api import (
    BATTERY_FULL,
    CONSTANT,
    NIL,
    SCRATCH,
    Array,
    Struct,
    field,
    kernel,
)

INF_COST: Final = 1 << 60  # the cost or bid of an infeasible list
BID_SCALE: Final = 1000  # epsilon and bids are in thousandths: a bid of 1000 is a tick

# Charging policies: the cost of a list beyond driving.
POLICY_NO_CHARGING: Final = 0  # batteries never run empty
POLICY_HIERARCHICAL: Final = 1  # insert the task where it is cheapest, then plan the charging
POLICY_JOINT: Final = 2  # insert the task where it is cheapest with its charging
POLICY_FILL_UP: Final = 3  # as hierarchical, but charge up to the target
POLICY_THRESHOLD: Final = 4  # charge fully before a task that would end below the threshold
POLICY_THRESHOLD_REACHABLE: Final = 5  # also before one that ends out of reach


class TaskCosts(Struct, role=SCRATCH):
    """T tasks and P places, for each of K robot types."""

    robot_type: int = field("() int64", "the selected robot type")
    ticks: Array = field("(K, P, P) int32", "from place to place")
    energy: Array = field("(K, P, P) int64", "units: from place to place")
    begin: Array = field("(T,) int32", "place at which a task begins", role=CONSTANT)
    end: Array = field("(T,) int32", "place at which it ends", role=CONSTANT)
    inside: Array = field("(K, T) int32", "ticks from begin to end, all handling included")
    use: Array = field("(K, T) int64", "units from begin to end")


class BatteryRules(Struct, role=SCRATCH):
    """The rules of energy, the same for all robots; C chargers."""

    robot_type: int = field("() int64", "the selected robot type")
    charger: Array = field("(C,) int32", "its place", role=CONSTANT)
    wait: Array = field("(C,) int32", "ticks until it is free of earlier robots")
    nearest: Array = field("(K, P) int32", "the charger with the least energy to reach; NIL: none")
    reach: Array = field("(K, P) int64", "units to it; INF_COST: none")
    curve: Array = field(
        "(K, pieces, 2) int32",
        "for each piece its lowest level, and units per tick",
        role=CONSTANT,
    )
    reserve: Array = field("(K,) int64", "minimum units on every arrival", role=CONSTANT)
    end_reach: int = field(
        "int64", "1: a charger must be within reach at the end of a list (never strand)"
    )
    policy: int = field("int64")
    threshold: int = field("int64", "units, of POLICY_THRESHOLD and POLICY_THRESHOLD_REACHABLE")
    target: int = field("int64", "units, of POLICY_FILL_UP")


class FleetLists(Struct, role=SCRATCH):
    """R robots and their lists of at most L tasks."""

    robot_type: Array = field("(R,) uint8", "the robot's type")
    place: Array = field("(R,) int32", "where the list starts", role=CONSTANT)
    ready: Array = field("(R,) int32", "ticks until the robot is there")
    charge: Array = field("(R,) int32", "units of charge then")
    first: Array = field(
        "(R,) int32", "1 = it already drives to its first task, which must stay first"
    )
    capacity: Array = field("(R,) int32", "maximum tasks in its list")
    may_bid: Array = field("(R, T) uint8", "1 = it may bid on the task")
    order: Array = field("(R, L) int32", "its tasks in sequence")
    length: Array = field("(R,) int32")
    travel: Array = field("(R,) int64", "ticks of the list without charging")
    energy: Array = field("(R,) int64", "units of the list without charging")
    cost: Array = field(
        "(R,) int64", "ticks until the list is done, including charging; INF_COST: infeasible"
    )


class ChargingPlan(Struct, role=SCRATCH):
    """The charging stops of one list."""

    stops: int = field("() int64", "how many")
    position: Array = field("(S,) int32", "the task of the list before which it charges")
    charger: Array = field("(S,) int32")
    arrival: Array = field("(S,) int64", "units on arrival")
    level: Array = field("(S,) int64", "units on leaving")
    duration: Array = field("(S,) int64", "ticks of charging")
    waited: Array = field("(S,) int64", "ticks in the queue before charging")
    cost: int = field("() int64", "ticks until the list is done; INF_COST: infeasible")
    charging: int = field("() int64", "ticks of charging")
    charger_wait: int = field("() int64", "ticks at busy chargers")
    gross: int = field("() int64", "ticks to chargers, at chargers, and to the next task")
    net: int = field("() int64", "gross minus the replaced legs")
    end_charge: int = field("() int64", "units at the end")
    lowest_charge: int = field("() int64", "minimum units on any arrival")


class PathSearch(Struct, role=SCRATCH):
    """A search for the stops of a list (strategies.allocation.auction.quotes)."""

    ready: int = field("() int64", "ticks until the robot departs; set by the quote")
    nodes: int = field("() int64", "number of stops to continue from: scratch.node[:nodes]")
    last: int = field("() int64", "the last stop of the best path so far, or NIL")
    best: int = field("() int64", "its weight")
    ticks_to_stop: int = field("() int64", "ticks from the previous task to that stop")
    position: int = field("() int64", "the position of that stop")
    rest_ticks: int = field("() int64", "energy of the whole list")
    rest_energy: int = field("() int64", "energy of the path to a charger at its end")


class AuctionCounts(Struct, role=SCRATCH):
    """The effort of an auction."""

    bids: int = field("() int64", "bids computed")
    positions: int = field("() int64", "tried positions in lists")
    plans: int = field("() int64", "charging plans made")
    messages: int = field("() int64", "announcements, bids sent, awards")
    states: int = field(
        "() int64", "steps of plans: chargers before tasks, or legs for a threshold"
    )


class AuctionScratch(Struct, role=SCRATCH):
    """Scratch of bids; its contents never matter between calls, except `sold`."""

    order: Array = field("(L + 1,) int32", "a tried list")
    done_ticks: Array = field(
        "(L + 2,) int64", "from the start until task i - 1 of the list is done"
    )
    done_energy: Array = field("(L + 2,) int64")
    begun_ticks: Array = field(
        "(L + 2,) int64", "from the start until task i begins, driven directly"
    )
    begun_energy: Array = field("(L + 2,) int64")
    weight: Array = field("(L + 1, C) int64", "cost of the best path to a charger before task i")
    parent: Array = field("(L + 1, C) int32", "the previous stop, as i * C + c, or NIL")
    node: Array = field("(S,) int32", "stops from which a better path may continue")
    path: PathSearch
    bid: Array = field("(R, T) int64", "bids by robot and item")
    best: Array = field("(R,) int32", "the item of the robot's lowest bid, or NIL")
    left: Array = field("(T,) int32", "unsold items, by arrival")
    low: Array = field("(T,) int64")
    second: Array = field("(T,) int64")
    high: Array = field("(T,) int64")
    bidders: Array = field("(T,) int32", "robots with a finite bid")
    lowest_bidder: Array = field("(T,) int32", "the robot with the lowest bid")
    needs_update: Array = field("(T,) uint8", "1 = the five fields above are outdated")
    sold: Array = field("(T,) int32", "the robot that won the item, or NIL")
    count: AuctionCounts
    plan: ChargingPlan


# Construction of markets for the kernels from the data of a caller.


def visits(ticks: ArrayLike, energy: ArrayLike, places: ArrayLike) -> TaskCosts:
    """Tasks that are visits of these places."""
    at = np.asarray(places, np.int32)
    nothing = np.zeros(len(at), np.int32)
    return deliveries(ticks, energy, at, at, nothing, nothing)


def deliveries(
    ticks: ArrayLike,
    energy: ArrayLike,
    begin: ArrayLike,
    end: ArrayLike,
    inside: ArrayLike,
    use: ArrayLike,
) -> TaskCosts:
    """Tasks that begin and end at different places; ticks, energy: (P, P), or (K, P, P) by type."""

    def numbers(values: ArrayLike, by_type: int = 0, dtype: DTypeLike = np.int32) -> Array:
        found = np.array(values, dtype)
        return found if found.ndim >= by_type else found[None]

    return TaskCosts.sized(
        ticks=numbers(ticks, 3),
        energy=numbers(energy, 3, np.int64),
        begin=numbers(begin),
        end=numbers(end),
        inside=numbers(inside, 2),
        use=numbers(use, 2, np.int64),
    )


def battery_of(
    energy: ArrayLike,
    chargers: ArrayLike = (),
    curve: ArrayLike = ((0, 1),),
    reserve: ArrayLike = 0,
    end_reach: bool = False,
    policy: int = POLICY_NO_CHARGING,
    threshold: int = 0,
    target: int = BATTERY_FULL,
) -> BatteryRules:
    """energy: (P, P) units, or (K, P, P); chargers: their places; curve: (from units, units per tick).

    `curve`: (pieces, 2), or (K, pieces, 2); `reserve`: one number, or (K,).
    """
    between = np.asarray(energy, np.int64)
    between = between if between.ndim == 3 else between[None]
    at, pieces = np.asarray(chargers, np.int32), np.asarray(curve, np.int32)
    to = between[:, :, at]
    none, shape = at.size == 0, between.shape[:2]
    return BatteryRules.sized(
        charger=at,
        nearest=np.full(shape, -1, np.int32) if none else to.argmin(2).astype(np.int32),
        reach=np.full(shape, INF_COST, np.int64) if none else to.min(2),
        curve=np.broadcast_to(pieces, (len(between), *pieces.shape[-2:])).copy(),
        reserve=np.broadcast_to(np.asarray(reserve, np.int64), len(between)).copy(),
        end_reach=int(end_reach),
        policy=policy,
        threshold=threshold,
        target=target,
    )


def fleet_of(
    places: ArrayLike, tasks: int, charge: ArrayLike = BATTERY_FULL, longest: int | None = None
) -> FleetLists:
    """Robots at these places with empty lists, at most `longest` tasks in each."""
    at = np.asarray(places, np.int32).copy()
    robots = len(at)
    most = tasks if longest is None else longest
    return FleetLists.sized(
        {"L": most},
        place=at,
        charge=np.full(robots, charge, np.int32),
        capacity=np.full(robots, most, np.int32),
        may_bid=np.ones((robots, tasks), np.uint8),
    )


def scratch_for(robots: int, tasks: int, longest: int, chargers: int) -> AuctionScratch:
    """Scratch for auctions of `tasks` among `robots` with lists of at most `longest` tasks."""
    stops = (longest + 1) * max(chargers, 1) + longest + 2
    sizes = {"R": robots, "T": tasks, "L": longest, "C": chargers, "S": stops}
    return AuctionScratch.sized(
        sizes, path=PathSearch.sized(), count=AuctionCounts.sized(), plan=ChargingPlan.sized(sizes)
    )


# Cheapest insertion into an open path: the position where a task adds the fewest ticks to a list. A task
# is inserted with its inner path, since a robot carries one load.


@kernel
def place_before(costs, place, order, i):
    """The place from which a robot that starts at `place` drives to task i of its list."""
    if i == 0:
        return np.int64(place)
    return np.int64(costs.end[order[i - 1]])


@kernel
def cheapest_insertion(costs, place, order, length, task, first):
    """(position, ticks added) of `task` in order[:length]; ties: the latest position.

    Positions below `first` must not change (1: the robot already drives to its first task).
    """
    ticks = costs.ticks[costs.robot_type]
    enter, leave = np.int64(costs.begin[task]), np.int64(costs.end[task])
    before = np.int64(place)
    at, least = NIL, INF_COST
    for i in range(length):
        after = np.int64(costs.begin[order[i]])
        added = ticks[before, enter] + ticks[leave, after] - ticks[before, after]
        if i >= first and added <= least:
            at, least = i, added
        before = np.int64(costs.end[order[i]])
    added = np.int64(ticks[before, enter])
    if added <= least:
        at, least = length, added
    return at, least + costs.inside[costs.robot_type, task]


@kernel
def energy_added(costs, place, order, length, task, position):
    """Units that `task` adds to the list at this position."""
    energy, robot_type = costs.energy[costs.robot_type], costs.robot_type
    before = place_before(costs, place, order, position)
    added = np.int64(energy[before, costs.begin[task]]) + costs.use[robot_type, task]
    if position < length:
        after = costs.begin[order[position]]
        added += energy[costs.end[task], after] - energy[before, after]
    return added


@kernel
def copy_inserted(order, length, task, position, out):
    """out[:length + 1] = the list with the task at this position."""
    for i in range(position):
        out[i] = order[i]
    out[position] = task
    for i in range(position, length):
        out[i + 1] = order[i]


@kernel
def insert(order, length, task, position):
    """The same in place; order has room."""
    for i in range(length, position, -1):
        order[i] = order[i - 1]
    order[position] = task


@kernel
def remove(order, length, position):
    """Take the task at this position out of order[:length]."""
    for i in range(position, length - 1):
        order[i] = order[i + 1]


@kernel
def measure(costs, scratch, place, order, length):
    """Ticks and energy along the list, without charging, into done_* and begun_* of the scratch."""
    robot_type = costs.robot_type
    ticks_to, energy_to = costs.ticks[robot_type], costs.energy[robot_type]
    inside, use = costs.inside[robot_type], costs.use[robot_type]
    ticks, energy = np.int64(0), np.int64(0)
    before = np.int64(place)
    for i in range(length):
        task = np.int64(order[i])
        scratch.done_ticks[i] = ticks
        scratch.done_energy[i] = energy
        ticks += ticks_to[before, costs.begin[task]]
        energy += energy_to[before, costs.begin[task]]
        scratch.begun_ticks[i] = ticks
        scratch.begun_energy[i] = energy
        ticks += inside[task]
        energy += use[task]
        before = np.int64(costs.end[task])
    scratch.done_ticks[length] = ticks
    scratch.done_energy[length] = energy
