"""The state of the world: nested structs of arrays, and nothing hidden beside them.

n robots of K types, m orders, s slots (cells that hold loads), C cells with the border, A actions.
A robot is stored at an index but referred to by its *identity*, so that a permutation of the
storage changes nothing that is stored. NIL (-1) means none. The same classes serve as the world
(writable) and as the view that strategies get (the same memory, read-only).
"""

from __future__ import annotations

from typing import Any, Final

from automaton.engine.distance_tables import Workspace as Workspace
from automaton.engine.facilities import ACTION_COUNT as ACTION_COUNT
from automaton.engine.facilities import (
    MESSAGE_WORDS,
    Chargers,
    Delays,
    Design,
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
from automaton.engine.facilities import STRATEGY_COUNT as STRATEGY_COUNT
from automaton.engine.facilities import Grid as Grid
from automaton.engine.jit.structs import (
    BY_ENTRY,
    CALL,
    CONSTANT,
    DECISION,
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

KEEP: Final = -(2**31)  # what every decision starts as: go on as before

# Actions of a robot, and what its ticks are counted as.
ACTION_IDLE: Final = 0
ACTION_MOVE: Final = 1
ACTION_TURN: Final = 2
ACTION_PICK: Final = 3
ACTION_DROP: Final = 4
ACTION_TRY_DROP: Final = 5
ACTION_WAIT: Final = 6  # a random wait of right of way before a held cell
ACTION_CHARGE: Final = 7
ACTION_BLOCKED: Final = 8  # a tick lost to a refused move that started no wait
ACTION_RETREAT: Final = 9  # the tick in which a retreat is decided
ACTION_BAY_BLOCKED: Final = 10  # a tick in the parking bay because the home cell is held
ACTION_ILLEGAL: Final = 11  # a tick lost to an illegal decision
ACTION_QUEUE: Final = 12  # a tick in the queue of a charger
ACTION_DOWN: Final = 13  # a tick on the floor with an empty battery or a fault
ACTION_HELD_BACK: Final = 14  # a tick in which right of way holds it back
ACTION_SERVE: Final = 15  # a tick at a stop of its order that takes time
ACTION_STATION_QUEUE: Final = 16  # a tick in the queue of a station
ACTION_DELAYED: Final = 17  # a tick on the floor in a delay, with nothing under way
ACTION_GATE: Final = 18  # a tick before a closed cell, a door, a block or a lift
ACTION_FOLLOWING: Final = 19  # a tick of a move that lasts longer because of the robot ahead
ACTION_NAMES: Final = (
    *("idle", "move", "turn", "pick", "drop", "try_drop", "wait", "charge"),
    *("blocked", "retreat", "bay_blocked", "illegal", "queueing", "down", "held_back"),
    *("serve", "station_queue", "delayed", "gate", "following"),
)

# States of a robot: robots.status.
STATUS_UP: Final = 0
STATUS_FAILING: Final = 1  # a fault takes it out as soon as what it does is over
STATUS_EXHAUSTED: Final = 2  # its battery lacks what its next operation takes
STATUS_DEPLETED: Final = 3  # down on the floor, without charge
STATUS_FAILED: Final = 4  # down on the floor because of a fault
STATUS_TOWED: Final = 5  # off the floor, until it comes back
STATUS_REMOVED: Final = 6  # off the floor for good

# Goals: what a robot drives to its goal cell for.
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
ORDER_WAITING: Final = 0  # on a slot, to be picked up; without a load, to be begun
ORDER_CARRIED: Final = 1
ORDER_DELIVERED: Final = 2
ORDER_UNRELEASED: Final = 3  # it will be known in a later tick
ORDER_STARTED: Final = 4  # without a load: a stop is begun, and its robot does the others
NEVER: Final = 2**31 - 1  # released: not before a station is done with its part

ORDER_LIST: Final = -2  # rules.radius: strategies see the order list and neighbouring cells

# Layers, in the order in which a tick asks them.
LAYER_ZONING: Final = 0
LAYER_CHARGING: Final = 1
LAYER_ALLOCATION: Final = 2
LAYER_ROUTING: Final = 3
LAYER_RIGHT_OF_WAY: Final = 4
LAYER_NAMES: Final = ("zoning", "charging", "allocation", "routing", "right_of_way")

# In which sequence they are asked: charging once more, about orders taken and robots left without one.
LAYER_SEQUENCE: Final = (
    LAYER_ZONING,
    LAYER_CHARGING,
    LAYER_ALLOCATION,
    LAYER_CHARGING,
    LAYER_ROUTING,
    LAYER_RIGHT_OF_WAY,
)
PHASE_CHARGING_AGAIN: Final = 3  # its entry

# Why a robot is in a batch.
REASON_IDLE: Final = 0  # it has nothing to do
REASON_PICKED: Final = 1  # its pick has begun, and there are no stops: where does the load go?
REASON_ORDER_RETURNED: Final = 2  # it gave its order back, its way blocked: plan around robots
REASON_REPLAN: Final = 3  # it drives home or nowhere, and its plan is made again
REASON_PERIODIC: Final = 4  # the strategy asked for every k-th tick
REASON_NEW_GOAL: Final = 5  # routing: a new goal
REASON_AROUND_ROBOTS: Final = 6  # routing: plan around the robots, a retreat is over
REASON_RETRIES_EXHAUSTED: Final = 7  # right of way: the retries are used up
REASON_RETREATING: Final = 8  # right of way: the next step of a retreat
REASON_ORDER_TAKEN: Final = 9  # charging: it has taken an order
REASON_NO_ORDER: Final = 10  # charging: allocation has nothing for it
REASON_ZONE_EVENT: Final = 11  # zoning: an order has no queue yet, or a robot went down or is back
REASON_SERVED: Final = 12  # the last stop of its order is done: where does the load go?
REASON_AROUND_CLOSED: Final = 13  # routing: it has waited long before a closed cell

# The machine that runs waits and retries: robots.retry_state.
RETRY_NONE: Final = 0
RETRY_WAITED: Final = 1
RETRY_EXHAUSTED: Final = 2

# Needs: bits of robots.need.
NEED_ALLOCATION: Final = 1
NEED_ROUTE: Final = 2
NEED_RIGHT_OF_WAY: Final = 4
NEED_CHARGING: Final = 8

NO_STEP: Final = 4  # robots.step when right of way asked for none
HOLD: Final = 8  # robots.step, beside a direction or NO_STEP: it is held back
MAX_BUSY: Final = 65_535  # ticks that robots.busy can hold
BATTERY_FULL: Final = 1_000_000_000  # units of charge in a full battery: one is 0.0000001 %
BATTERY_PERCENT: Final = BATTERY_FULL // 100

# Bits of a cell's flags.
MAY_TURN: Final = 16  # robots may turn in it
NO_WAY_THROUGH: Final = 128  # by type: ways begin and end there, but lead past it

# Kinds of gates: closings, doors, blocks and lifts.
GATE_CLOSING: Final = 0  # no robot may enter for some time
GATE_DOOR: Final = 1  # it opens to a robot that asks, and shuts
GATE_BLOCK: Final = 2  # it holds so many robots, or robots of one direction
GATE_LIFT: Final = 3  # a block of one robot, whose cabin comes when it is called
GATE_KINDS: Final = ("closed", "door", "block", "lift")

# When a robot may begin to move into a cell.
FOLLOWING_NONE: Final = 0  # if it was free when the tick began
FOLLOWING_HANDOVER: Final = 1  # also if its holder gives it up in this tick
FOLLOWING_CONVOY: Final = 2  # also if its holder is on its way out
FOLLOWING_NAMES: Final = ("none", "handover", "convoy")

STOP_PARKED: Final = 0
STOP_DELIVERED: Final = 1
STOP_NEVER: Final = 2


class Robots(Struct):
    """The fleet, indexed by storage."""

    identity: Array = field("(n,) int32", "a permutation of 0..n-1", role=STATIC)
    at_index: Array = field("(n,) int32", "the storage index of an identity", role=STATIC)
    type: Array = field("(n,) uint8", "its type, with a load rules.loaded_types more", role=DERIVED)
    cell: Array = field(
        "(n,) int32",
        "where it stands, or the cell left by a long move; NIL: off the floor",
        hidden=NIL,
        digest=0,
        by="code_of_cell",
        header=True,
    )
    claim: Array = field(
        "(n,) int32", "the cell that a long move enters, else NIL", default=NIL, digest=1
    )
    heading: Array = field(
        "(n,) uint8", "rail axis 0/1, differential direction 0..3, omni 0", digest=2, header=True
    )
    travel: Array = field(
        "(n,) uint8", "direction in which it entered its cell: its lane at capacity 2", digest=3
    )
    action: Array = field("(n,) uint8", "what it does", digest=4)
    busy: Array = field("(n,) uint16", "ticks until it is free", digest=5)
    priority: Array = field("(n,) int16", "set by right of way, higher goes first", digest=6)
    load: Array = field("(n,) int32", "the order it carries, or NIL", default=NIL, digest=7)
    order: Array = field("(n,) int32", "the order it works on, or NIL", default=NIL, digest=8)
    slot: Array = field("(n,) int32", "where it will drop the load, or NIL", default=NIL, digest=9)
    goal_type: Array = field("(n,) uint8", "GOAL_*", digest=10)
    goal_cell: Array = field(
        "(n,) int32", "the cell in which the goal is done, or NIL", default=NIL, digest=11
    )
    charge_target: Array = field("(n,) int32", "charge at which it leaves its charger", digest=12)
    charging_interruptible: Array = field(
        "(n,) uint8", "1 = while it charges it may get an order", digest=26, recorded=False
    )
    try_drop: Array = field("(n,) uint8", "1 = a TRY_DROP follows the pick", digest=13)
    route: Array = field(
        "(n, R) uint8",
        "directions to drive; turns are implied",
        used="route_length",
        digest=25,
        by="code_of_route",
    )
    route_length: Array = field("(n,) int32", "steps in the route", digest=14, recorded=False)
    route_index: Array = field("(n,) int32", "steps driven", digest=15, recorded=False)
    route_hash: Array = field("(n,) int64", "hash of the route, for the digest", role=DERIVED)
    retreat_moves: Array = field("(n,) int16", "moves left of a retreat", digest=16)
    failed_retries: Array = field(
        "(n,) uint8", "failed retries since the last executed operation", digest=17
    )
    retry_state: Array = field("(n,) uint8", "RETRY_*", digest=18)
    home: Array = field(
        "(n,) int32",
        "cell in which it parks, through which it enters its parking bay, or has left",
        role=DERIVED,
        hidden=NIL,
        header=True,
    )
    bay: Array = field(
        "(n,) int32",
        "its parking bay's cell, or NIL: it parks on the floor, or leaves it",
        role=DERIVED,
        hidden=NIL,
        header=True,
    )
    parked: Array = field("(n,) uint8", "1 = it is parked", default=1, hidden=0, digest=19)
    service_zone: Array = field(
        "(n,) int32", "the service zone of the robot, set by zoning", default=NIL, digest=20
    )
    charge: Array = field("(n,) int32", "units left in its battery", digest=27, header=True)
    status: Array = field("(n,) uint8", "STATUS_*", digest=28)
    status_until: Array = field(
        "(n,) int64", "tick in which it is towed, or comes back", digest=29, recorded=False
    )
    ticket: Array = field(
        "(n,) int64", "its place in the queue of its charger, 0 outside", digest=30, recorded=False
    )
    order_queue: Array = field(
        "(n, L) int32",
        "orders that it is to do, one after another",
        used="order_queue_length",
        digest=31,
        by="hash_of_order_queue",
    )
    order_queue_length: Array = field("(n,) int32", "how many those are", role=DERIVED)
    charging_reason: Array = field("(n,) uint8", "why charging is asked", digest=32, recorded=False)
    need: Array = field("(n,) uint8", "NEED_* bits", default=NEED_ALLOCATION, hidden=0, digest=21)
    reason: Array = field("(n,) uint8", "why allocation is asked", digest=22)
    route_reason: Array = field(
        "(n,) uint8", "REASON_NEW_GOAL or REASON_AROUND_ROBOTS", digest=23, recorded=False
    )
    seen_revision: Array = field(
        "(n,) int64",
        "clock.revision when allocation last let it park",
        default=NIL,
        digest=24,
        recorded=False,
    )
    step: Array = field(
        "(n,) uint8",
        "what right of way asks for this tick: a direction or NO_STEP, HOLD",
        default=NO_STEP,
        role=DERIVED,
    )
    executed: Array = field(
        "(n,) uint16", "what was committed this tick (automaton.engine.record_codes)", role=DERIVED
    )


class Orders(Struct):
    """Orders. A transport has a load with the order's number; without one an order is its stops.

    An order without a load has neither source nor target: NIL. One with a load may have stops, too:
    its robot comes there between pick and drop.
    """

    state: Array = field(
        "(m,) uint8",
        "ORDER_WAITING, ORDER_CARRIED, ORDER_DELIVERED, ORDER_UNRELEASED, ORDER_STARTED",
        hidden=ORDER_UNRELEASED,
        digest=33,
    )
    current_slot: Array = field(
        "(m,) int32", "slot in which it lies, or NIL", hidden=NIL, digest=34
    )
    source: Array = field(
        "(m,) int32",
        "slot in which it lay first",
        hidden=NIL,
        digest=35,
        recorded=False,
        header=True,
    )
    target: Array = field(
        "(m,) int32",
        "slot to which it must go, NIL: no load, or any storage",
        role=STATIC,
        hidden=NIL,
        digest=36,
        header=True,
    )
    reserved_by: Array = field(
        "(m,) int32",
        "identity of the robot that reserved or carries it, or NIL",
        default=NIL,
        digest=37,
    )
    release_tick: Array = field(
        "(m,) int32", "tick from which it is known", hidden=NEVER, digest=38, header=True
    )
    weight: Array = field(
        "(m,) int32", "what a robot must be able to carry", role=DERIVED, hidden=0, header=True
    )
    priority: Array = field(
        "(m,) int16", "the larger one comes first", role=DERIVED, hidden=0, header=True
    )
    due: Array = field(
        "(m,) int32",
        "tick until which it is to be done, which may be before 0; NEVER: none; of a trip of a pod the "
        "earliest of its lines",
        default=NEVER,
        role=DERIVED,
        hidden=NEVER,
        header=True,
    )
    release_sequence: Array = field(
        "(releases,) int32",
        "the orders, in the sequence in which they are released",
        role=DERIVED,
        header=True,
    )
    dispatched: Array = field(
        "(m,) int32", "tick in which a robot last took it, or NIL", default=NIL, role=DERIVED
    )
    dispatched_from: Array = field(
        "(m,) int32", "the cell where that robot was then, or NIL", default=NIL, role=MEASURED
    )
    dispatched_heading: Array = field("(m,) uint8", "its heading then", role=MEASURED)
    dispatched_type: Array = field("(m,) uint8", "its type", role=MEASURED)
    delivered: Array = field("(m,) int32", "tick of delivery, or NIL", default=NIL, digest=39)
    legs: Array = field("(m,) int32", "times it was picked up, or begun", digest=40)
    first_stop: Array = field(
        "(m + 1,) int32",
        "stops[first_stop[k]: first_stop[k + 1]] are the stops of order k",
        role=STATIC,
        header=True,
    )
    stops_done: Array = field("(m,) int32", "how many of its stops are done", role=DERIVED)
    dispatched_to: Array = field(
        "(m,) int32", "identity of the robot that last took it, or NIL", default=NIL, role=MEASURED
    )
    picked: Array = field(
        "(m,) int32", "tick in which it was last picked up, or NIL", default=NIL, role=MEASURED
    )
    moves: Array = field(
        "(m,) int32", "moves of robots with it on legs that are over", role=MEASURED
    )
    driven: Array = field("(m,) int32", "ticks of the moves and turns of these legs", role=MEASURED)
    queued: Array = field(
        "(m,) int32", "ticks of these legs in the queues of stations", role=MEASURED
    )


class Traffic(Struct, role=SCRATCH):
    """Occupancy and the intents of the current tick."""

    occupancy: Array = field(
        "(C,) uint16",
        "claims, room and the flags of a cell (automaton.engine.motion)",
        role=DERIVED,
    )
    intent: Array = field("(n,) uint8", "the intent before motion, its outcome after")
    move_ticks: Array = field("(n,) uint16", "ticks that the intended move takes", default=1)
    own_ticks: Array = field(
        "(n,) uint16",
        "ticks that its last move takes by itself, delays included; the rest it follows",
        default=1,
        role=MEASURED,
    )
    leaving: Array = field(
        "(L,) int64",
        "by resource, under convoy: 4 * the last tick of the last move out of it + its direction, or NIL",
        default=NIL,
        role=DERIVED,
    )
    zone_occupancy: Array = field("(Z,) int32", "robots in each traffic zone as the tick began")
    # The second column is for travel W or N through a cell for two. Entered while a strategy that says
    # `holders` is asked (automaton.engine.holders), else NIL; so is a cell without limit.
    holder: Array = field(
        "(C, 2) int32",
        "identity of the robot that stands in a limited cell or enters it, or NIL",
        default=NIL,
    )
    pending: Array = field("(n, 8) int32", "intents that the second pass could not decide")
    dirty: Array = field(
        "(n,) int32", "cells whose claims are wiped at the end; first, robots that arrive"
    )
    vacated: Array = field(
        "(4n,) int32", "cell and direction of travel given up at the end of the tick"
    )
    contest: Array = field(
        "(T,) int32", "best claimant of a resource; NIL between ticks", default=NIL
    )
    key: Array = field(
        "(H,) int32", "resources of a hash table, or (0,): every resource has its entry"
    )


class Tally(Struct, role=MEASURED):
    """Counters behind the metrics; [.., 0] empty, [.., 1] loaded."""

    operations: Array = field(f"(n, {ACTION_COUNT}, 2) int64", "operations begun")
    ticks: Array = field(f"(n, {ACTION_COUNT}, 2) int64", "ticks of the operations begun")
    slowdown_ticks: Array = field(
        "(n,) int64", "ticks that moves take beyond those of the robot's type"
    )
    progress: Array = field(
        "(n,) int64", "tick in which it last picked up, dropped, visited, charged, or was idle"
    )
    active: Array = field(
        "(n,) int64",
        "last tick in which it moved, worked or charged, of a longer action the last one",
    )
    energy_used: Array = field("(n,) int64", "units of charge used")
    charged: Array = field("(n,) int64", "units of charge taken in at chargers")
    repaired: Array = field("(n,) int64", "units of charge that repairs added")
    failures: Array = field("(n, 3) int64", "times that it ran empty, broke down, was towed")
    illegal: Array = field("(5,) int64", "illegal decisions by layer")
    batches: Array = field("(5,) int64", "batches that each layer was asked about")
    visits: Array = field("(n,) int64", "stops that it has done")
    visited: Array = field(
        "(n,) int32",
        "the order of which it last did a stop, or to which it only had to come",
        default=NIL,
    )
    leg_moves: Array = field("(n,) int64", "its moves before the leg of an order that it is on")
    leg_driven: Array = field("(n,) int64", "its ticks of moves and turns before that leg")
    leg_queued: Array = field("(n,) int64", "its ticks in queues of stations before that leg")


# What an operation is for: time_use.purpose.
PURPOSE_ORDER: Final = 0
PURPOSE_CHARGER: Final = 1  # to get to a charger
PURPOSE_ASIDE: Final = 2  # to park, or pushed aside without anything to do
PURPOSE_MAKING_WAY: Final = 3  # it undoes what was driven for an order

# Actions in which a robot loses time, as bits.
LOST_ACTIONS: Final = sum(
    1 << action
    for action in (
        *(ACTION_WAIT, ACTION_BLOCKED, ACTION_RETREAT, ACTION_BAY_BLOCKED, ACTION_ILLEGAL),
        *(ACTION_QUEUE, ACTION_HELD_BACK, ACTION_STATION_QUEUE, ACTION_GATE),
    )
)
TRAIL_MOVES: Final = 4  # moves that may be undone; a power of two


class TimeUse(Struct, role=MEASURED):
    """What robots use their time for, besides their orders (automaton.engine.time_use)."""

    to_charger: Array = field(
        f"(n, {ACTION_COUNT}) int64", "of tally.ticks, those on the way to a charger"
    )
    aside: Array = field("(n,) int64", "ticks of moves and turns without an order or a charger")
    making_way: Array = field(
        "(n,) int64", "ticks of moves and turns for an order that were undone"
    )
    purpose: Array = field("(n,) uint8", "what its last operation is for")
    trail: Array = field(f"(n, {TRAIL_MOVES}) int32", "cells that its last moves left, as a ring")
    trail_top: Array = field("(n,) uint8", "the last of them")
    trail_depth: Array = field("(n,) uint8", "how many there are")
    turned: Array = field("(n,) int32", "ticks of turns for an order since its last move")
    turned_from: Array = field("(n,) uint8", "its heading before these")


class DeadlockCounts(NamedNumbers):
    """The deadlocks of a run."""

    found: int = number("deadlocks so far")
    robots: int = number("robots that are in one now")
    robot_ticks: int = number("robot ticks spent in deadlocks")
    longest: int = number("ticks that the longest deadlock has lasted")
    longest_begin: int = number("first tick of that deadlock")
    longest_robot: int = number("lowest identity of its robots")
    longest_cell: int = number("cell of that robot")
    next_look: int = number("no deadlock begins or ends before this tick")


class Deadlocks(Struct, role=MEASURED):
    """Wait cycles in which all robots have waited for DEADLOCK_TICKS (automaton.engine.deadlocks)."""

    count: DeadlockCounts = field(DeadlockCounts)
    number: Array = field("(n,) int64", "number from 1 of the deadlock that it is in, or 0")
    since: Array = field("(n,) int64", "first tick of that deadlock")


class Clock(NamedNumbers):
    """The tick, and counts that belong to no robot and no order."""

    tick: int = number("ticks executed")
    stop_tick: int = number("the loop pauses after this tick")
    undelivered: int = number("orders that are not delivered")
    unparked: int = number("robots that are not parked")
    revision: int = number("grows with every change of an order or a reservation")
    allocation_revision: int = number("`revision` when allocation last looked")
    fresh_allocation: int = number("robots that need allocation and do not wait for a change")
    needing_route: int = number("robots for which routing is to be asked")
    needing_right_of_way: int = number("robots for which right of way is to be asked")
    finished: int = number("1 = the stop condition holds")
    recording: int = number("1 = the run is recorded")
    recorded_ticks: int = number("ticks in the record's buffers")
    change_rows: int = number("rows of record.changes in use")
    decision_words: int = number("words of record.decisions in use")
    digest_every: int = number("a recording holds the digests of every so many ticks")
    observing: int = number("1 = the run is observed")
    next_release: int = number("entry of orders.release_sequence that is released next")
    needing_charging: int = number("robots for which charging is to be asked")
    tickets_issued: int = number("tickets issued for the queues of chargers")
    next_fault: int = number("row of rules.faults that comes next")
    robots_down: int = number("robots that are down or going to be")
    phase: int = number("entry of LAYER_SEQUENCE that is being asked")
    open_jobs: int = number("jobs at stations that are not done")
    next_part: int = number("entry of stations.part_arrivals that comes next")
    unqueued_orders: int = number("orders released or dropped since zoning was last asked")
    halted_until: int = number("the last tick for which zoning made a robot stand still")
    next_wakeup: int = number("the first tick in which zoning asked to be woken, or NIL")
    zones_redesigned: int = number("the last tick in which the design of the zones changed")
    sequenced: int = number("entries of orders.release_sequence in use, where orders are assigned")
    known_orders: int = number("all orders that were released have lower numbers")
    next_line: int = number("entry of lines.sequence that is known next")
    stored_pods: int = number("entries of pods.stored in use")
    first_open: int = number("all orders with lower numbers are delivered")
    orders_done: int = number("orders of lines that are done")
    coarse_tick: int = number("the tick as the scenario counts it: draws and ties go by it")


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
    deadlocks: Deadlocks
    delays: Delays
    clock: Clock = field(Clock, role=BY_ENTRY, digest=59, by="hash_of_tick")


class Batch(Struct):
    """A batch: the robots that a layer is asked about, sorted by identity."""

    count: int = field("() int64", "how many they are")
    robot: Array = field("(n,) int32", "storage indices; the first `count` are valid")
    reason: Array = field("(n,) uint8", "why the layer is asked about each: REASON_*")
    strategy: int = field("() uint8", "which strategy is asked: a layer, or a further allocation")


def decided(meaning: str, default: int = 0, dtype: str = "int32") -> Any:
    """A field of what is decided for each robot that is asked."""
    return field(f"(n,) {dtype}", meaning, default=default, role=DECISION)


class ZoningDecisions(Struct):
    service_zone: Array = decided("the service zone of the robot", KEEP)
    halt: Array = decided("ticks that it stands still from now on", KEEP)
    again: Array = decided(
        "ticks after which zoning is asked about it again; NIL: when told to", KEEP
    )
    sends_message: Array = decided("1 = its message changes, to this row of", dtype="uint8")
    messages: Array = field(f"(n, {MESSAGE_WORDS}) int64")
    server: Array = field(
        "(Z,) int32",
        "by zone: KEEP, or the identity of the robot that serves it",
        default=KEEP,
        role=CALL,
    )
    redesigned: int = field("() int64", "1 = the design changes, to", role=CALL)
    design: Design
    queued: int = field("() int64", "how many of the next four are in use", role=CALL)
    order: Array = field("(m,) int32", "this order")
    queue: Array = field("(m,) int32", "comes into the queue of this zone")
    next_slot: Array = field("(m,) int32", "and is to be dropped at this slot")
    skips_transfer: Array = field("(m,) uint8", "1 = past transfer stations")
    refused: int = field(
        "() int64", "illegal decisions that a recording tells of, and no strategy", role=CALL
    )


class ChargingDecisions(Struct):
    goal_cell: Array = decided("KEEP, the charger cell to drive to, or NIL: stop charging", KEEP)
    charge_target: Array = decided("charge at which to leave")
    charging_interruptible: Array = decided("1 = it may get an order while it charges")


class AllocationDecisions(Struct):
    command: Array = decided("KEEP, CMD_TAKE_ORDER, CMD_DROP_AT or CMD_PARK", KEEP)
    order: Array = decided("CMD_TAKE_ORDER: the order to pick up", NIL)
    slot: Array = decided("CMD_DROP_AT: where the load goes", NIL)
    goal_cell: Array = decided("the cell from which it is picked up or dropped", NIL)
    try_drop: Array = decided("CMD_DROP_AT: 1 = a TRY_DROP operation follows the pick")
    ask_again: Array = decided("1 = ask again next tick, whatever happens", dtype="uint8")
    order_queue_length: Array = field(
        "(n,) int32", "by storage index: KEEP, or how many orders", default=KEEP, role=CALL
    )
    order_queue: Array = field("(n, L) int32", "by storage index: orders that a robot is to do")
    order_taken: Array = field(
        "(m,) uint8",
        "reserved by an earlier decision of this batch; of orders that were released, each call "
        "begins with zeros",
        role=SCRATCH,
    )
    slot_taken: Array = field("(s,) uint8", "likewise", role=CALL)


class RoutingDecisions(Struct):
    route_length: Array = decided("KEEP or the number of steps", KEEP)
    steps: Array = field("(n, R) uint8", "directions")


class RightOfWayDecisions(Struct):
    command: Array = decided("KEEP, CMD_STEP, CMD_WAIT, CMD_RETREAT, CMD_HOLD or CMD_GO", KEEP)
    value: Array = decided(
        "direction, ticks, or moves; CMD_HOLD: the direction it would like, or NIL"
    )
    return_order: Array = decided("1 = an empty robot returns its order")
    priority: Array = decided("KEEP or the robot's new priority", KEEP)


class Decisions(Struct):
    """Preallocated outputs, indexed like the batch."""

    zoning: ZoningDecisions
    charging: ChargingDecisions
    allocation: AllocationDecisions
    routing: RoutingDecisions
    right_of_way: RightOfWayDecisions


CMD_TAKE_ORDER: Final = 1  # commands of allocation
CMD_DROP_AT: Final = 2
CMD_PARK: Final = 3
CMD_STEP: Final = 1  # commands of right of way
CMD_WAIT: Final = 2
CMD_RETREAT: Final = 3
CMD_HOLD: Final = 4  # of one that steers: stay for this tick
# Of one that steers: turn towards a direction or move in it; out of a parking bay.
CMD_GO: Final = 5


class Memory(Struct):
    """How the loop knows a strategy's state, whatever struct that is: State.of(memory)."""

    address: int = field("int64", "of the state, as the strategy sees it")
    rows: Array = field(
        "(f, 3) int64",
        "of a state that robots see their own rows of (automaton.engine.holders)",
        role=CONSTANT,
    )


class Record(Struct):
    """Buffers that a recorder empties when the loop pauses."""

    executed: Array = field("(T, n) uint16", "by identity")
    decisions: Array = field(
        "(Y,) int64", "what strategies decided (automaton.engine.decision_stream)"
    )
    changes: Array = field("(X, 4) int64", "tick, code, subject, value")
    digests: Array = field("(T, D) uint64")
