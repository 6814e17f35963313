"""What an auction works on: tasks and how far apart they lie, batteries, and the robots' lists.

A *place* is anything that a robot drives to or from: where a robot is, a stop, a charger. A task
begins at one place and ends at another (pick-up and delivery; a robot holds one load, so nothing comes
between), or begins and ends at the same one (a visit). A list is an open path: no way back.

Times are whole ticks. Energy is counted in units: BATTERY_FULL units are 100 %.
"""

from __future__ import annotations

from typing import Any, Final

from numpy.typing import NDArray

from automaton.engine.jit.structs import CONSTANT, SCRATCH, Struct, field
from automaton.engine.robot_states import BATTERY_FULL as BATTERY_FULL

Array = NDArray[Any]

INF_COST: Final = 1 << 60  # a cost or bid that stands for "not at all"
BID_SCALE: Final = 1000  # epsilon is counted in thousandths; so are bids: 1000 of them are a tick

# What a list costs beyond driving: the charging policy.
POLICY_NO_CHARGING: Final = 0  # batteries never run empty
POLICY_HIERARCHICAL: Final = 1  # insert the task where it is cheapest, then plan the charging
POLICY_JOINT: Final = 2  # insert the task where it is cheapest with its charging
POLICY_FILL_UP: Final = 3  # as hierarchical, but charge up to the target
# threshold: charge fully before a task that would end below the threshold
POLICY_THRESHOLD: Final = 4
# as POLICY_THRESHOLD, and before a task from whose end no charger could be reached
POLICY_THRESHOLD_REACHABLE: Final = 5


class TaskCosts(Struct, role=SCRATCH):
    """T tasks and P places, as robots of each of K types find them."""

    robot_type: Array = field("(1,) int64", "the robot type whose rows count")
    ticks: Array = field("(K, P, P) int32", "from place to place")
    energy: Array = field("(K, P, P) int64", "units: from place to place")
    begin: Array = field("(T,) int32", "place at which a task begins", role=CONSTANT)
    end: Array = field("(T,) int32", "place at which it ends", role=CONSTANT)
    inside: Array = field("(K, T) int32", "ticks from begin to end, all handling included")
    use: Array = field("(K, T) int64", "units from begin to end")


class Battery(Struct, role=SCRATCH):
    """The rules of energy, the same for all robots; C chargers."""

    robot_type: Array = field("(1,) int64", "the robot type whose rows count")
    charger: Array = field("(C,) int32", "its place", role=CONSTANT)
    wait: Array = field("(C,) int32", "ticks until it is free of the robots that come before")
    nearest: Array = field(
        "(K, P) int32", "the charger that takes least energy to reach; NIL: none"
    )
    reach: Array = field("(K, P) int64", "units to it; INF: none")
    curve: Array = field(
        "(K, pieces, 2) int32",
        "of each piece the level from which it holds, and units per tick",
        role=CONSTANT,
    )
    reserve: Array = field("(K,) int64", "units that are left on every arrival", role=CONSTANT)
    end_reach: int = field(
        "int64", "1: at the end of a list a charger can still be reached (never strand)"
    )
    policy: int = field("int64")
    threshold: int = field("int64", "units, of LOOK and SAFE")
    target: int = field("int64", "units, of FILL_UP")


class Fleet(Struct, role=SCRATCH):
    """R robots and their lists of at most L tasks."""

    robot_type: Array = field("(R,) uint8", "the robot's type")
    place: Array = field("(R,) int32", "where the list starts", role=CONSTANT)
    ready: Array = field("(R,) int32", "ticks until the robot is there")
    charge: Array = field("(R,) int32", "units that it has then")
    first: Array = field("(R,) int32", "1 = it drives to its first task, which stays the first")
    capacity: Array = field("(R,) int32", "most tasks in its list")
    may_bid: Array = field("(R, T) uint8", "1 = it may bid on the task")
    order: Array = field("(R, L) int32", "its tasks in sequence")
    length: Array = field("(R,) int32")
    travel: Array = field("(R,) int64", "ticks of the list without charging")
    energy: Array = field("(R,) int64", "units of the list without charging")
    cost: Array = field(
        "(R,) int64", "ticks until the list is done, charging included; INF: it cannot be"
    )


class ChargingPlan(Struct, role=SCRATCH):
    """The charging stops of one list."""

    stops: Array = field("(1,) int64", "how many")
    position: Array = field("(S,) int32", "before which task of the list")
    charger: Array = field("(S,) int32")
    arrival: Array = field("(S,) int64", "units on arrival")
    level: Array = field("(S,) int64", "units on leaving")
    duration: Array = field("(S,) int64", "ticks of charging")
    waited: Array = field("(S,) int64", "ticks in the queue before it")
    cost: Array = field("(1,) int64", "ticks until the list is done; INF_COST: no plan")
    charging: Array = field("(1,) int64", "ticks of charging")
    charger_wait: Array = field("(1,) int64", "ticks at busy chargers")
    gross: Array = field("(1,) int64", "ticks to chargers, at them, and on to the next task")
    net: Array = field("(1,) int64", "gross less the legs that were replaced")
    end_charge: Array = field("(1,) int64", "units at the end")
    lowest_charge: Array = field("(1,) int64", "units: the least on any arrival")


class PathSearch(Struct, role=SCRATCH):
    """A search for the stops of a list (strategies.allocation.auction.charge_path)."""

    ready: Array = field("(1,) int64", "ticks until the robot sets out: set by the quote")
    nodes: Array = field("(1,) int64", "stops to go on from: Scratch.node[:nodes]")
    last: Array = field("(1,) int64", "the last stop of the best path so far, or NIL")
    best: Array = field("(1,) int64", "its weight")
    ticks_to_stop: Array = field("(1,) int64", "ticks from the task before to that stop")
    position: Array = field("(1,) int64", "the position of that stop")
    rest_ticks: Array = field("(1,) int64", "of the whole list")
    rest_energy: Array = field("(1,) int64", "and of the way to a charger at its end")


class Counts(Struct, role=SCRATCH):
    """What an auction has taken."""

    bids: Array = field("(1,) int64", "bids computed")
    positions: Array = field("(1,) int64", "places in lists that were tried")
    plans: Array = field("(1,) int64", "charging plans made")
    messages: Array = field("(1,) int64", "announcements, bids sent, awards")
    states: Array = field(
        "(1,) int64", "what plans looked at: chargers before tasks, or legs for a threshold"
    )


class Scratch(Struct, role=SCRATCH):
    """What bids are computed in; contents never decide anything between calls, except `sold`."""

    order: Array = field("(L + 1,) int32", "a list that is tried")
    done_ticks: Array = field(
        "(L + 2,) int64", "from the start until task i - 1 of the list is done"
    )
    done_energy: Array = field("(L + 2,) int64")
    begun_ticks: Array = field(
        "(L + 2,) int64", "from the start until task i begins, driven directly"
    )
    begun_energy: Array = field("(L + 2,) int64")
    weight: Array = field("(L + 1, C) int64", "best way to a charger before task i")
    parent: Array = field("(L + 1, C) int32", "the stop before that one, as i * C + c, or NIL")
    node: Array = field("(S,) int32", "stops from which a better path may go on")
    path: PathSearch
    bid: Array = field("(R, T) int64", "by robot and number of the item")
    best: Array = field("(R,) int32", "the item of the robot's lowest bid, or NIL")
    left: Array = field("(T,) int32", "items that are not sold, by arrival")
    low: Array = field("(T,) int64")
    second: Array = field("(T,) int64")
    high: Array = field("(T,) int64")
    bidders: Array = field("(T,) int32", "robots with a finite bid")
    lowest_bidder: Array = field("(T,) int32", "the robot with the lowest")
    needs_update: Array = field("(T,) uint8", "1 = the five above are to be found again")
    sold: Array = field("(T,) int32", "who won the item, or NIL")
    count: Counts
    plan: ChargingPlan
