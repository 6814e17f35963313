"""The complete state of the world: nested structs of arrays.

n robots of K types, m orders, s slots (cells that hold loads), C cells with the border, A actions.
A robot is stored at an index but referenced by its *identity*, so a permutation of the storage
changes no stored reference. NIL (-1) means none. The same classes serve as the world (writable) and
as the view that strategies get (the same memory, read-only).
"""

from __future__ import annotations

from typing import Final

from automaton.engine.distance_tables import Workspace as Workspace
from automaton.engine.facilities import ACTION_COUNT as ACTION_COUNT
from automaton.engine.facilities import STRATEGY_COUNT as STRATEGY_COUNT
from automaton.engine.facilities import (
    Chargers,
    Delays,
    Gates,
    Lines,
    Pods,
    PodStations,
    Rules,
    ServiceZones,
    Slots,
    Stations,
    Stops,
    Trips,
)
from automaton.engine.facilities import Grid as Grid
from automaton.engine.jit.structs import (
    BY_ENTRY,
    CONSTANT,
    DERIVED,
    MEASURED,
    SCRATCH,
    STATIC,
    NamedNumbers,
    Struct,
    field,
    number,
)
from automaton.engine.jit.structs import NIL as NIL
from automaton.engine.jit.structs import Array as Array
from automaton.engine.refusals import Refusals

KEEP: Final = -(2**31)  # default of every decision: continue as before

# Actions of a robot, and what its ticks are counted as.
ACTION_IDLE: Final = 0
ACTION_MOVE: Final = 1
ACTION_TURN: Final = 2
ACTION_PICK: Final = 3
ACTION_DROP: Final = 4
ACTION_TRY_DROP: Final = 5
ACTION_WAIT: Final = 6  # a random wait set by right of way, before a held cell
ACTION_CHARGE: Final = 7
ACTION_BLOCKED: Final = 8  # a tick lost to a refused move that started no wait
ACTION_RETREAT: Final = 9  # the tick in which a retreat is decided
ACTION_BAY_BLOCKED: Final = 10  # a tick in the parking bay because the home cell is held
ACTION_ILLEGAL: Final = 11  # a tick lost to an illegal decision
ACTION_QUEUE: Final = 12  # a tick in the queue of a charger
ACTION_DOWN: Final = 13  # a tick on the floor with an empty battery or a fault
ACTION_HELD_BACK: Final = 14  # a tick in which right of way tells it to wait
ACTION_SERVE: Final = 15  # a tick at a stop of its order that takes time
ACTION_STATION_QUEUE: Final = 16  # a tick in the queue of a station
ACTION_DELAYED: Final = 17  # a tick on the floor in a delay, with nothing under way
ACTION_GATE: Final = 18  # a tick before a closed cell, a door, a block or a lift
ACTION_FOLLOWING: Final = 19  # a tick by which a robot ahead extends a move
ACTION_NAMES: Final = (
    *("idle", "move", "turn", "pick", "drop", "try_drop", "wait", "charge"),
    *("blocked", "retreat", "bay_blocked", "illegal", "queueing", "down", "held_back"),
    *("serve", "station_queue", "delayed", "gate", "following"),
)

# Actions in which a robot loses time, as bits.
LOST_ACTIONS: Final = sum(
    1 << action
    for action in (
        *(ACTION_WAIT, ACTION_BLOCKED, ACTION_RETREAT, ACTION_BAY_BLOCKED, ACTION_ILLEGAL),
        *(ACTION_QUEUE, ACTION_HELD_BACK, ACTION_STATION_QUEUE, ACTION_GATE),
    )
)
# States of a robot: robots.status.
STATUS_UP: Final = 0
STATUS_FAILING: Final = 1  # it breaks down as soon as its current operation ends
STATUS_EXHAUSTED: Final = 2  # its battery lacks the charge for its next operation
STATUS_DEPLETED: Final = 3  # down on the floor, without charge
STATUS_FAILED: Final = 4  # down on the floor because of a fault
STATUS_TOWED: Final = 5  # off the floor, until it returns
STATUS_REMOVED: Final = 6  # off the floor for good

# Goals: the task of a robot at its goal cell.
GOAL_NONE: Final = 0
GOAL_PICK: Final = 1
GOAL_DROP: Final = 2
GOAL_PARK: Final = 3
GOAL_CHARGE: Final = 4
GOAL_STOP: Final = 5  # the next stop of its order

# Columns of tally.failures.
FAILURE_DEPLETED: Final = 0
FAILURE_FAULT: Final = 1
FAILURE_TOWED: Final = 2

# States of an order.
ORDER_WAITING: Final = 0  # in a slot, to be picked up; without a load, to be begun
ORDER_CARRIED: Final = 1
ORDER_DELIVERED: Final = 2
ORDER_UNRELEASED: Final = 3  # to be released in a later tick
ORDER_STARTED: Final = 4  # without a load: a stop is begun, and its robot does the remaining ones
NEVER: Final = 2**31 - 1  # not released before a station is done with its part

ORDER_LIST: Final = -2  # rules.radius: strategies see the order list and neighbouring cells

# Layers, in the order in which a tick asks them.
LAYER_ZONING: Final = 0
LAYER_CHARGING: Final = 1
LAYER_ALLOCATION: Final = 2
LAYER_ROUTING: Final = 3
LAYER_RIGHT_OF_WAY: Final = 4
LAYER_NAMES: Final = ("zoning", "charging", "allocation", "routing", "right_of_way")

# The order of the calls in a tick: charging is asked twice, at last about orders taken and robots
# without one.
LAYER_SEQUENCE: Final = (
    LAYER_ZONING,
    LAYER_CHARGING,
    LAYER_ALLOCATION,
    LAYER_CHARGING,
    LAYER_ROUTING,
    LAYER_RIGHT_OF_WAY,
)
PHASE_CHARGING_AGAIN: Final = 3  # the second entry of charging

# Why a robot is in a batch.
REASON_IDLE: Final = 0  # the robot has nothing to do
REASON_PICKED: Final = 1  # the pick of an order without stops has begun: where does the load go?
REASON_ORDER_RETURNED: Final = 2  # the robot was blocked and returned its order: plan around robots
REASON_REPLAN: Final = 3  # the robot drives home, charges or has no goal, and may get an order
REASON_PERIODIC: Final = 4  # a periodic call, in every k-th tick
REASON_NEW_GOAL: Final = 5  # routing: the robot has a new goal
REASON_AROUND_ROBOTS: Final = 6  # routing: blocked, or a retreat is over: plan around robots
REASON_RETRIES_EXHAUSTED: Final = 7  # right of way: the robot's retries are used up
REASON_RETREATING: Final = 8  # right of way: a retreat needs its next step
REASON_ORDER_TAKEN: Final = 9  # charging: the robot has taken an order
REASON_NO_ORDER: Final = 10  # charging: allocation has no order for the robot
REASON_ZONE_EVENT: Final = 11  # zoning: an order has no queue, or a robot went down or came back
REASON_SERVED: Final = 12  # the last stop of the order is done: where does the load go?
REASON_AROUND_CLOSED: Final = 13  # routing: the robot has waited long in front of a closed cell

# The state machine of waits and retries: robots.retry_state.
RETRY_NONE: Final = 0
RETRY_WAITED: Final = 1
RETRY_EXHAUSTED: Final = 2

# Needs: bits of robots.need.
NEED_ALLOCATION: Final = 1
NEED_ROUTE: Final = 2
NEED_RIGHT_OF_WAY: Final = 4
NEED_CHARGING: Final = 8

NO_STEP: Final = 4  # robots.step if right of way asked for none
HOLD: Final = 8  # robots.step, beside a direction or NO_STEP: it must wait
MAX_BUSY: Final = 65_535  # most ticks that robots.busy can hold
BATTERY_FULL: Final = 1_000_000_000  # units of charge in a full battery: one unit is 0.0000001 %
BATTERY_PERCENT: Final = BATTERY_FULL // 100

# Bits of a cell's flags.
MAY_TURN: Final = 16  # robots may turn in the cell
NO_WAY_THROUGH: Final = 128  # by type: paths begin and end there, but none crosses the cell

# Kinds of gates: closings, doors, blocks and lifts.
GATE_CLOSING: Final = 0  # closed at times: no robot may enter
GATE_DOOR: Final = 1  # opens when a robot requests it, and shuts
GATE_BLOCK: Final = 2  # limits the number of robots, or admits robots of one direction
GATE_LIFT: Final = 3  # a block for one robot, with a cabin that comes when called
GATE_KINDS: Final = ("closed", "door", "block", "lift")

# When a robot may begin to move into a cell.
FOLLOWING_NONE: Final = 0  # if it was empty when the tick began
FOLLOWING_HANDOVER: Final = 1  # also if its holder leaves it in this tick
FOLLOWING_CONVOY: Final = 2  # also if its holder is on its way out
FOLLOWING_NAMES: Final = ("none", "handover", "convoy")

STOP_PARKED: Final = 0
STOP_DELIVERED: Final = 1
STOP_NEVER: Final = 2
STOP_ON_TARGETS: Final = 3


class Robots(Struct):
    """The fleet, indexed by storage."""

    identity: Array = field("(n,) int32", "number of the robot, from 0 to n - 1", role=STATIC)
    at_index: Array = field(
        "(n,) int32", "entry k: storage index of the robot with identity k", role=STATIC
    )
    type: Array = field(
        "(n,) uint8", "type of the robot; with a load, plus rules.loaded_types", role=DERIVED
    )
    cell: Array = field(
        "(n,) int32",
        "cell where the robot stands, or that a long move leaves; NIL: off the floor",
        hidden=NIL,
        digest=0,
        by="code_of_cell",
        header=True,
    )
    claim: Array = field("(n,) int32", "cell entered by a long move, or NIL", default=NIL, digest=1)
    heading: Array = field(
        "(n,) uint8", "rail: axis 0 or 1; differential: 0 to 3; omni: 0", digest=2, header=True
    )
    travel: Array = field(
        "(n,) uint8", "direction of travel into the cell: the lane at capacity 2", digest=3
    )
    action: Array = field("(n,) uint8", "current action: ACTION_*", digest=4)
    busy: Array = field("(n,) uint16", "ticks until the robot is free", digest=5)
    priority: Array = field(
        "(n,) int16", "priority set by right of way; the highest goes first", digest=6
    )
    load: Array = field("(n,) int32", "order of the carried load, or NIL", default=NIL, digest=7)
    order: Array = field("(n,) int32", "order the robot works on, or NIL", default=NIL, digest=8)
    slot: Array = field(
        "(n,) int32", "slot where the robot will drop its load, or NIL", default=NIL, digest=9
    )
    goal_type: Array = field("(n,) uint8", "kind of the goal: GOAL_*", digest=10)
    goal_cell: Array = field("(n,) int32", "cell of the goal, or NIL", default=NIL, digest=11)
    charge_target: Array = field("(n,) int32", "charge at which charging ends", digest=12)
    charging_interruptible: Array = field(
        "(n,) uint8", "1 = the robot may get an order while it charges", digest=26, recorded=False
    )
    try_drop: Array = field("(n,) uint8", "1 = a TRY_DROP follows the pick", digest=13)
    route: Array = field(
        "(n, R) uint8",
        "directions of the moves of the route; turns are implied",
        used="route_length",
        digest=25,
        by="code_of_route",
    )
    route_length: Array = field(
        "(n,) int32", "number of steps in the route", digest=14, recorded=False
    )
    route_index: Array = field("(n,) int32", "number of steps driven", digest=15, recorded=False)
    route_hash: Array = field("(n,) int64", "hash of the route, for the digest", role=DERIVED)
    retreat_moves: Array = field("(n,) int16", "number of moves left of a retreat", digest=16)
    failed_retries: Array = field(
        "(n,) uint8", "number of failed retries since the last executed operation", digest=17
    )
    retry_state: Array = field("(n,) uint8", "state of waits and retries: RETRY_*", digest=18)
    home: Array = field(
        "(n,) int32",
        "cell where it parks (stop on-targets: its target), enters its parking bay, or left the floor",
        role=DERIVED,
        hidden=NIL,
        header=True,
    )
    bay: Array = field(
        "(n,) int32",
        "cell of the parking bay; NIL: the robot parks on the floor, or leaves the floor",
        role=DERIVED,
        hidden=NIL,
        header=True,
    )
    parked: Array = field("(n,) uint8", "1 = the robot is parked", default=1, hidden=0, digest=19)
    service_zone: Array = field(
        "(n,) int32", "service zone of the robot, set by zoning", default=NIL, digest=20
    )
    charge: Array = field("(n,) int32", "units of charge in the battery", digest=27, header=True)
    status: Array = field("(n,) uint8", "status of the robot: STATUS_*", digest=28)
    status_until: Array = field(
        "(n,) int64", "tick in which the robot is towed, or returns", digest=29, recorded=False
    )
    ticket: Array = field(
        "(n,) int64", "ticket in the queue of a charger, or 0", digest=30, recorded=False
    )
    order_queue: Array = field(
        "(n, L) int32",
        "planned orders of the robot, in sequence",
        used="order_queue_length",
        digest=31,
        by="hash_of_order_queue",
    )
    order_queue_length: Array = field("(n,) int32", "number of planned orders", role=DERIVED)
    charging_reason: Array = field(
        "(n,) uint8", "why charging is asked: REASON_*", digest=32, recorded=False
    )
    need: Array = field(
        "(n,) uint8", "requested layers: NEED_* bits", default=NEED_ALLOCATION, hidden=0, digest=21
    )
    reason: Array = field("(n,) uint8", "why allocation is asked: REASON_*", digest=22)
    route_reason: Array = field(
        "(n,) uint8", "why routing is asked: REASON_*", digest=23, recorded=False
    )
    seen_revision: Array = field(
        "(n,) int64",
        "clock.revision when allocation last let the robot park",
        default=NIL,
        digest=24,
        recorded=False,
    )
    step: Array = field(
        "(n,) uint8",
        "right of way in this tick: a direction or NO_STEP, plus HOLD if the robot must wait",
        default=NO_STEP,
        role=DERIVED,
    )
    executed: Array = field(
        "(n,) uint16", "action committed in this tick (automaton.engine.record_codes)", role=DERIVED
    )


class Orders(Struct):
    """Orders. A transport order has a load with the same number; an order without a load has only
    stops.

    An order without a load has neither source nor target: NIL. One with a load may have stops, too:
    its robot visits them between pick and drop.
    """

    state: Array = field("(m,) uint8", "state: ORDER_*", hidden=ORDER_UNRELEASED, digest=33)
    current_slot: Array = field("(m,) int32", "slot of the load, or NIL", hidden=NIL, digest=34)
    source: Array = field(
        "(m,) int32",
        "slot where the load was at the start, or NIL",
        hidden=NIL,
        digest=35,
        recorded=False,
        header=True,
    )
    target: Array = field(
        "(m,) int32",
        "destination slot; NIL: no load, or any storage",
        role=STATIC,
        hidden=NIL,
        digest=36,
        header=True,
    )
    reserved_by: Array = field(
        "(m,) int32",
        "identity of the robot that reserved the order or carries its load, or NIL",
        default=NIL,
        digest=37,
    )
    release_tick: Array = field(
        "(m,) int32", "tick from which the order is known", hidden=NEVER, digest=38, header=True
    )
    weight: Array = field(
        "(m,) int32",
        "weight; a robot must be able to carry it",
        role=DERIVED,
        hidden=0,
        header=True,
    )
    priority: Array = field(
        "(m,) int16", "priority: the largest comes first", role=DERIVED, hidden=0, header=True
    )
    due: Array = field(
        "(m,) int32",
        "due tick, may be negative; of a trip of a pod, the earliest of its lines; NEVER: none",
        default=NEVER,
        role=DERIVED,
        hidden=NEVER,
        header=True,
    )
    release_sequence: Array = field(
        "(releases,) int32", "the orders, in sequence of release", role=DERIVED, header=True
    )
    dispatched: Array = field(
        "(m,) int32", "tick in which a robot last took the order, or NIL", default=NIL, role=DERIVED
    )
    dispatched_from: Array = field(
        "(m,) int32", "cell in which the order was last taken, or NIL", default=NIL, role=MEASURED
    )
    dispatched_heading: Array = field(
        "(m,) uint8", "heading of the robot when it last took the order", role=MEASURED
    )
    dispatched_type: Array = field(
        "(m,) uint8", "type of the robot that last took the order", role=MEASURED
    )
    delivered: Array = field("(m,) int32", "tick of the delivery, or NIL", default=NIL, digest=39)
    legs: Array = field("(m,) int32", "number of times picked up or begun", digest=40)
    first_stop: Array = field(
        "(m + 1,) int32",
        "stops of order k: stops[first_stop[k]: first_stop[k + 1]]",
        role=STATIC,
        header=True,
    )
    stops_done: Array = field("(m,) int32", "number of completed stops", role=DERIVED)
    dispatched_to: Array = field(
        "(m,) int32", "robot that last took the order: identity, or NIL", default=NIL, role=MEASURED
    )
    picked: Array = field("(m,) int32", "last pick-up tick, or NIL", default=NIL, role=MEASURED)
    moves: Array = field("(m,) int32", "moves of robots in completed legs", role=MEASURED)
    driven: Array = field("(m,) int32", "ticks of moves and turns in completed legs", role=MEASURED)
    queued: Array = field("(m,) int32", "ticks in station queues in completed legs", role=MEASURED)


class Traffic(Struct, role=SCRATCH):
    """Occupancy and the intents of the current tick."""

    occupancy: Array = field(
        "(C,) uint16", "claims, room and flags of a cell (automaton.engine.motion)", role=DERIVED
    )
    intent: Array = field("(n,) uint8", "the intent before motion, its outcome after")
    move_ticks: Array = field("(n,) uint16", "ticks of the intended move", default=1)
    own_ticks: Array = field(
        "(n,) uint16",
        "ticks that the last move takes with no robot ahead, delays included; further ticks are "
        "spent following",
        default=1,
        role=MEASURED,
    )
    leaving: Array = field(
        "(L,) int64",
        "last move out of each resource (a cell or a lane) under convoy: 4 * its last tick + its "
        "direction; or NIL",
        default=NIL,
        role=DERIVED,
    )
    zone_occupancy: Array = field("(Z,) int32", "robots in each traffic zone when the tick began")
    # The second column is for travel W or N through a two-lane cell. Filled only while a strategy
    # with `holders` is asked (automaton.engine.holders), else NIL; also NIL in cells without limit.
    holder: Array = field(
        "(C, 2) int32",
        "identity of the robot that stands in a limited cell or enters it, or NIL",
        default=NIL,
    )
    pending: Array = field("(n, 8) int32", "intents not decided by the second pass")
    dirty: Array = field(
        "(n,) int32", "cells whose claims are cleared at the end; before that, robots that arrive"
    )
    vacated: Array = field(
        "(4n,) int32", "cell and direction of travel released at the end of the tick"
    )
    contest: Array = field(
        "(T,) int32", "best claimant of a resource; NIL between ticks", default=NIL
    )
    key: Array = field(
        "(H,) int32", "resources in the hash table; (0,) if every resource has its own entry"
    )


# What an operation is for: time_use.purpose.
PURPOSE_ORDER: Final = 0
PURPOSE_CHARGER: Final = 1  # to get to a charger
PURPOSE_ASIDE: Final = 2  # to park, or pushed aside without anything to do
PURPOSE_MAKING_WAY: Final = 3  # it undoes what was driven for an order

TRAIL_MOVES: Final = 4  # moves that may be undone; a power of two
MOST_PERIODS: Final = (
    1024  # of a report whose undone moves are counted apart; the last holds all others
)


class Tally(Struct, role=MEASURED):
    """Counters for the metrics; [.., 0] empty, [.., 1] loaded."""

    operations: Array = field(f"(n, {ACTION_COUNT}, 2) int64", "operations begun")
    ticks: Array = field(f"(n, {ACTION_COUNT}, 2) int64", "ticks of these operations")
    slowdown_ticks: Array = field(
        "(n,) int64", "ticks of moves beyond the usual ticks of the robot's type"
    )
    progress: Array = field(
        "(n,) int64", "tick in which it last picked up, dropped, visited, charged, or was idle"
    )
    active: Array = field(
        "(n,) int64",
        "last tick in which it moved, worked or charged, of a longer action the last one",
    )
    energy_used: Array = field("(n,) int64", "units of charge used")
    charged: Array = field("(n,) int64", "units of charge gained at chargers")
    repaired: Array = field("(n,) int64", "units of charge gained in repairs")
    failures: Array = field("(n, 3) int64", "number of times it ran empty, broke down, was towed")
    illegal: Array = field("(5,) int64", "illegal decisions by layer")
    batches: Array = field("(5,) int64", "number of batches by layer")
    visits: Array = field("(n,) int64", "number of completed stops")
    visited: Array = field(
        "(n,) int32",
        "the order of its last completed stop, or of its last pick-up that completed an order",
        default=NIL,
    )
    settled: Array = field(
        "(n,) int64",
        "tick since which it stands on its target, or NIL (stop: on-targets)",
        default=NIL,
    )
    leg_moves: Array = field("(n,) int64", "its moves before its current leg of an order")
    leg_driven: Array = field("(n,) int64", "its ticks of moves and turns before that leg")
    leg_queued: Array = field("(n,) int64", "its ticks in queues of stations before that leg")


class TimeUse(Struct, role=MEASURED):
    """What robots use their time for, besides their orders (automaton.engine.operations)."""

    to_charger: Array = field(
        f"(n, {ACTION_COUNT}) int64", "of tally.ticks, those on the way to a charger"
    )
    aside: Array = field("(n,) int64", "ticks of moves and turns without an order or a charger")
    making_way: Array = field(
        "(n,) int64", "ticks of moves and turns for an order that were undone"
    )
    purpose: Array = field("(n,) uint8", "what its last operation is for")
    trail: Array = field(f"(n, {TRAIL_MOVES}) int32", "cells that its last moves left, as a ring")
    trail_ticks: Array = field(f"(n, {TRAIL_MOVES}) uint16", "ticks of these moves")
    trail_period: Array = field(f"(n, {TRAIL_MOVES}) uint16", "time_use.period in which they began")
    trail_top: Array = field("(n,) uint8", "the last of them")
    trail_depth: Array = field("(n,) uint8", "how many there are")
    turned: Array = field("(n,) int32", "ticks of turns for an order since its last move")
    turned_from: Array = field("(n,) uint8", "its heading before these")
    period: Array = field("(1,) uint16", "number of the current period of a report")
    undone: Array = field(
        f"({MOST_PERIODS},) int64", "by period: ticks of moves that were undone later"
    )


class DeadlockCounts(NamedNumbers):
    """The deadlocks of a run."""

    total: int = number("deadlocks so far")
    robots: int = number("robots that are in one now")
    robot_ticks: int = number("robot ticks spent in deadlocks")
    longest: int = number("ticks that the longest deadlock has lasted")
    longest_begin: int = number("first tick of that deadlock")
    longest_robot: int = number("lowest identity of its robots")
    longest_cell: int = number("cell of that robot")
    next_look: int = number("no deadlock begins or ends before this tick")


class DeadlockTally(Struct, role=MEASURED):
    """Wait cycles in which all robots have waited for DEADLOCK_TICKS (automaton.engine.events)."""

    count: DeadlockCounts = field(DeadlockCounts)
    number: Array = field("(n,) int64", "number from 1 of the deadlock that it is in, or 0")
    since: Array = field("(n,) int64", "first tick of that deadlock")
    found_at: Array = field("(n,) int64", "tick in which it was found to be one")


class Clock(NamedNumbers):
    """The tick, and counts that belong to no robot and no order."""

    tick: int = number("number of executed ticks")
    stop_tick: int = number("tick after which the loop pauses")
    undelivered: int = number("number of undelivered orders")
    unparked: int = number("number of robots that are not parked")
    revision: int = number("number that increases with every change of an order or a reservation")
    allocation_revision: int = number("`revision` when allocation was last asked")
    fresh_allocation: int = number(
        "number of robots that need allocation and do not wait for a change"
    )
    needing_route: int = number("number of robots with a request to routing")
    needing_right_of_way: int = number("number of robots with a request to right of way")
    finished: int = number("1 = the stop condition holds")
    recording: int = number("1 = the run is recorded")
    recorded_ticks: int = number("number of ticks in the record's buffers")
    change_rows: int = number("rows of record.changes in use")
    decision_words: int = number("words of record.decisions in use")
    digest_every: int = number("ticks between digests in a recording")
    observing: int = number("1 = the run is observed")
    next_release: int = number("next entry of orders.release_sequence to be released")
    needing_charging: int = number("number of robots with a request to charging")
    tickets_issued: int = number("tickets issued for the queues of chargers")
    next_fault: int = number("next row of rules.faults")
    robots_down: int = number("number of robots that are down or about to go down")
    phase: int = number("current entry of LAYER_SEQUENCE")
    open_jobs: int = number("number of unfinished jobs at stations")
    next_part: int = number("next entry of stations.part_arrivals")
    unqueued_orders: int = number("orders released or dropped since zoning was last asked")
    halted_until: int = number("the last tick of the halts ordered by zoning")
    next_wakeup: int = number("the first tick in which zoning asked to be called, or NIL")
    zones_redesigned: int = number("last tick in which the design of the zones changed")
    sequenced: int = number("entries of orders.release_sequence in use, where orders are assigned")
    known_orders: int = number("end of the numbers of released orders: each is below")
    next_line: int = number("next entry of lines.sequence to be released")
    stored_pods: int = number("entries of pods.stored in use")
    first_open: int = number("lowest number of an order that may be undelivered")
    orders_done: int = number("number of orders with all lines done")
    coarse_tick: int = number("the tick in units of the scenario, used for draws and ties")


class World(Struct):
    """Everything that a tick reads and writes."""

    grid: Grid
    rules: Rules
    robots: Robots
    orders: Orders
    stops: Stops
    slots: Slots
    stations: Stations
    pods: Pods
    lines: Lines
    trips: Trips
    pod_stations: PodStations
    gates: Gates
    chargers: Chargers
    service_zones: ServiceZones
    traffic: Traffic
    tally: Tally
    time_use: TimeUse
    deadlocks: DeadlockTally
    refusals: Refusals
    delays: Delays
    clock: Clock = field(Clock, role=BY_ENTRY, digest=59, by="hash_of_tick")


class Batch(Struct):
    """A batch: the robots that a layer is asked about, sorted by identity."""

    count: int = field("() int64", "number of robots")
    robot: Array = field("(n,) int32", "storage indices; the first `count` are valid")
    reason: Array = field("(n,) uint8", "why the layer is asked about each robot: REASON_*")
    strategy: int = field("() uint8", "number of the strategy: a layer, or a further allocation")


class Memory(Struct):
    """How the loop refers to a strategy's state, whatever its struct: State.of(memory)."""

    address: int = field("int64", "of the state that the strategy sees")
    rows: Array = field(
        "(f, 3) int64",
        "rows of a state of which each robot sees its own (automaton.engine.holders)",
        role=CONSTANT,
    )


class Record(Struct):
    """Buffers, which a recorder empties when the loop pauses."""

    executed: Array = field("(T, n) uint16", "by identity")
    decisions: Array = field(
        "(Y,) int64", "decisions of strategies (automaton.engine.decision_stream)"
    )
    changes: Array = field("(X, 4) int64", "tick, code, subject, value")
    digests: Array = field("(T, D) uint64")
