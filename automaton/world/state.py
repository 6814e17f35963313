"""The state of the world: nested structs of arrays, and nothing hidden beside them.

n robots of K types, m orders, s slots (cells that hold loads), C cells with the border, A actions.
A robot is stored at an index but referred to by its *identity*, so that a permutation of the
storage changes nothing that is stored. NIL (-1) means none. The same classes serve as the world
(writable) and as the view that strategies get (the same memory, read-only).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from numpy.typing import NDArray

from automaton.struct import Struct
from automaton.world.partition import Design, Partition
from automaton.world.places import Chargers, Slots, Stations
from automaton.world.places import Grid as Grid
from automaton.world.route_space import RouteSpace

if TYPE_CHECKING:
    from automaton.zoning.negotiation import Parts
    from automaton.zoning.space import ZoneSpace

Array = NDArray[Any]

NIL: Final = -1
KEEP: Final = -(2**31)  # what every answer starts as: go on as before

# Actions of a robot, and what its ticks are counted as.
IDLE: Final = 0
MOVE: Final = 1
TURN: Final = 2
PICK: Final = 3
DROP: Final = 4
TRY_DROP: Final = 5
WAIT: Final = 6  # a wait drawn by right of way before a held cell
CHARGE: Final = 7
BLOCKED: Final = 8  # a tick lost to a refused move that started no wait
WITHDRAW: Final = 9  # the tick in which a withdrawal is decided
BAY_BLOCKED: Final = 10  # a tick in the bay because the home cell is held
ILLEGAL: Final = 11  # a tick lost to an illegal answer
IN_LINE: Final = 12  # a tick in the line before a charger
OUT_OF_ORDER: Final = 13  # a tick on the floor with an empty battery or a fault
ACTIONS: Final = 14
ACTION_NAMES: Final = (
    *("idle", "move", "turn", "pick", "drop", "try_drop", "wait", "charge"),
    *("blocked", "withdraw", "bay_blocked", "illegal", "in_line", "out_of_order"),
)

# Goals: what a robot drives to its stand for.
GOAL_NONE: Final = 0
GOAL_PICK: Final = 1
GOAL_DROP: Final = 2
GOAL_PARK: Final = 3
GOAL_CHARGE: Final = 4

# States of an order.
WAITING: Final = 0  # on a slot, to be picked up
CARRIED: Final = 1
DELIVERED: Final = 2
UNRELEASED: Final = 3  # it will be known in a later tick
NEVER: Final = 2**31 - 1  # released: not before a station is done with its part

ORDER_LIST: Final = -2  # rules.radius: strategies see the order list and neighbouring cells

# Layers, in the order in which a tick asks them.
ZONING: Final = 0
CHARGING: Final = 1
ALLOCATION: Final = 2
ROUTING: Final = 3
RIGHT_OF_WAY: Final = 4
LAYERS: Final = ("zoning", "charging", "allocation", "routing", "right_of_way")

# In which sequence they are asked: charging once more, about orders taken and robots left without one.
SEQUENCE: Final = (ZONING, CHARGING, ALLOCATION, CHARGING, ROUTING, RIGHT_OF_WAY)
CHARGING_AGAIN: Final = 3  # its entry

# Why a robot is in a batch.
FREE: Final = 0  # it has nothing to do
PICKED: Final = 1  # its pick has begun: where does the load go?
RELEASED: Final = 2  # it gave its order back before a withdrawal: decide again, around robots
REPLAN: Final = 3  # it drives home or nowhere, and its plan is made anew
PERIODIC: Final = 4  # the strategy asked for every k-th tick
PLAN: Final = 5  # routing: a new goal
AROUND: Final = 6  # routing: plan around the robots, a withdrawal is over
STUCK: Final = 7  # right of way: the retries are used up
WITHDRAWING: Final = 8  # right of way: the next step of a withdrawal
TOOK: Final = 9  # charging: it has taken an order
NEWS: Final = 11  # zoning: an order is in no queue yet, or a robot went out of order or came back
IDLE_NOW: Final = 10  # charging: allocation has nothing for it

# The machine that runs waits and retries: robots.hold.
HOLD_NONE: Final = 0
HOLD_WAITED: Final = 1
HOLD_ASK: Final = 2

# Needs: bits of robots.need.
NEED_ALLOCATION: Final = 1
NEED_ROUTE: Final = 2
NEED_WAY: Final = 4
NEED_CHARGING: Final = 8

NO_STEP: Final = 4  # robots.step when right of way asked for none

# Entries of world.clock.
TICK: Final = 0  # ticks executed
UNTIL: Final = 1  # the loop pauses after this tick
UNDELIVERED: Final = 2
UNPARKED: Final = 3
CHANGES: Final = 4  # grows with every change of an order or a reservation
SEEN_CHANGES: Final = 5  # CHANGES when allocation last looked
FRESH_ALLOCATION: Final = 6  # robots that need allocation and are not just waiting for a change
NEEDING_ROUTE: Final = 7
NEEDING_WAY: Final = 8
FINISHED: Final = 9
RECORDING: Final = 10
RECORDED: Final = 11  # ticks in the record's buffers
CHANGED: Final = 12  # rows of record.changes in use
DECIDED: Final = 13  # words of record.decisions in use
DIGEST_EVERY: Final = 14  # a recording holds the digests of every so many ticks
OBSERVING: Final = 15
NEXT_ORDER: Final = 16  # entry of orders.coming that becomes known next
NEEDING_CHARGING: Final = 17
TICKETS: Final = 18  # tickets given out for lines before chargers
NEXT_FAULT: Final = 19  # row of rules.faults that comes next
OUT: Final = 20  # robots that are out of order or going to be
PHASE: Final = 21  # entry of SEQUENCE that is being asked
UNWORKED: Final = 22  # work at stations that is not done
NEXT_PART: Final = 23  # entry of stations.entering that comes next
UNQUEUED: Final = 24  # orders that became known or were set down since zoning was last asked
HALTED: Final = 25  # the last tick for which zoning made a robot stand still
WAKING: Final = 26  # the first tick in which zoning asked to be woken, or NIL
REDESIGNED: Final = 27  # the last tick in which the design of the zones changed
CLOCK_SIZE: Final = 28

STOP_PARKED: Final = 0
STOP_DELIVERED: Final = 1
STOP_NEVER: Final = 2


class Rules(Struct):
    """The scenario's constants."""

    seed: Any  # uint64
    following: int  # 1: a robot may enter a cell that its holder gives up in the same tick
    stop: int  # STOP_PARKED, STOP_DELIVERED, STOP_NEVER
    leave: int  # 1: a robot with nothing to do leaves the floor where it stands
    radius: int  # how far strategies see, cells; NIL everything, or ORDER_LIST
    circle: int  # 1: the radius is Euclid's, 0: Chebyshev's
    in_system: int  # orders that a closed loop keeps open; 0: it is none
    own_zones: int  # 1: only orders and stations in zones of robots that are seen
    tick_us: int  # a tick in millionths of a second; 0: the scenario does not say
    cell_milli: int  # a cell's side in thousandths of the scenario's unit of length; 0: none
    duration: Array  # (K, A) int32, ticks of each action, by type of robot
    payload: Array  # (K,) int32: the heaviest order that robots of a type carry
    wait: Array  # (5,) int32: empty from, to; loaded from, to; retries before right of way is asked
    every: Array  # (5,) int32: a layer is asked every so many ticks; 0 never
    holders: Array  # (5,) uint8: 1 = a layer's strategy reads traffic.holder
    slowdown: int  # 1: a move takes as many times longer as its zone has robots
    extra_tick: int  # of 2**32 moves, how many take a tick more
    delay: int  # a pick or drop takes up to so many ticks more
    battery: int  # 1: robots run on batteries
    drain: Array  # (A, 2) int32: units of charge that a tick of each action takes; [.., 1] loaded
    curve: Array  # (K, 2) int32: from this charge on, units that a tick at a charger gives
    reserve: int  # charge that plans never go below
    tow_after: int  # ticks that a robot stands out of order before it is towed; NIL: it stays
    repair: int  # ticks from towing until it comes back; NIL: never
    repaired: int  # charge with which it comes back; NIL: its own, or the reserve if it ran empty
    may_fail: int  # 1: robots may go out of order
    faults: Array  # (f, 2) int64: tick, identity; by tick
    breakdown: int  # of 2**32 ticks on the floor, how many end in a fault


class Robots(Struct):
    """The fleet, indexed by storage."""

    identity: Array  # (n,) int32, a permutation of 0..n-1
    at_index: Array  # (n,) int32: the storage index of an identity
    type: Array  # (n,) uint8
    cell: Array  # (n,) int32: where it stands, or the cell left by a long move; NIL: off the floor
    claim: Array  # (n,) int32: the cell that a long move enters, else NIL
    heading: Array  # (n,) uint8: rail axis 0/1, differential direction 0..3, omni 0
    travel: Array  # (n,) uint8: direction in which it entered its cell: its lane at capacity 2
    action: Array  # (n,) uint8: what it does
    busy: Array  # (n,) uint16: ticks until it is free
    priority: Array  # (n,) int16: set by right of way, higher goes first
    load: Array  # (n,) int32: the order it carries, or NIL
    order: Array  # (n,) int32: the order it works on, or NIL
    slot: Array  # (n,) int32: where it will set the load down, or NIL
    goal: Array  # (n,) uint8
    stand: Array  # (n,) int32: the cell in which the goal is done, or NIL
    level: Array  # (n,) int32: charge at which it leaves its charger
    yields: Array  # (n,) uint8: 1 = while it charges it may get an order
    try_drop: Array  # (n,) uint8: 1 = a TRY_DROP follows the pick
    route: Array  # (n, R) uint8: directions to drive; turns are implied
    length: Array  # (n,) int32: steps in the route
    at: Array  # (n,) int32: steps driven
    route_sum: Array  # (n,) int64: hash of the route, for the digest
    withdrawing: Array  # (n,) int16: moves left of a withdrawal
    blocked: Array  # (n,) uint8: failed retries since the last executed operation
    hold: Array  # (n,) uint8: HOLD_*
    home: Array  # (n,) int32: cell in which it parks, through which it enters its bay, or has left
    bay: Array  # (n,) int32: its bay's cell, or NIL: it parks on the floor, or leaves it
    parked: Array  # (n,) uint8
    zone: Array  # (n,) int32: the zone it serves, set by zoning
    charge: Array  # (n,) int32: units left in its battery
    status: Array  # (n,) uint8: RUNNING, ... GONE
    until: Array  # (n,) int64: tick in which it is towed, or comes back
    ticket: Array  # (n,) int64: its place in the line before its charger, 0 outside
    plan: Array  # (n, L) int32: orders that it is to do, one after another
    planned: Array  # (n,) int32: how many those are
    charging_reason: Array  # (n,) uint8: why charging is asked
    need: Array  # (n,) uint8: NEED_* bits
    reason: Array  # (n,) uint8: why allocation is asked
    route_reason: Array  # (n,) uint8: PLAN or AROUND
    asked_at: Array  # (n,) int64: CHANGES when allocation last let it park
    step: Array  # (n,) uint8: direction that right of way asks for this tick, or NO_STEP
    did: Array  # (n,) uint8: what was committed this tick (automaton.recording.codes)


class Orders(Struct):
    """Transport orders; the load of an order has the order's number."""

    state: Array  # (m,) uint8: WAITING, CARRIED, DELIVERED, UNRELEASED
    place: Array  # (m,) int32: slot in which it lies, or NIL
    source: Array  # (m,) int32: slot in which it lay first
    target: Array  # (m,) int32: slot to which it must go
    by: Array  # (m,) int32: identity of the robot that reserved or carries it, or NIL
    released: Array  # (m,) int32: tick from which it is known
    weight: Array  # (m,) int32: what a robot must be able to carry
    coming: Array  # (m,) int32: the orders, in the sequence in which they become known
    dispatched: Array  # (m,) int32: tick in which a robot last took it, or NIL
    dispatched_from: Array  # (m,) int32: the cell where that robot was then, or NIL
    dispatched_heading: Array  # (m,) uint8: its heading then
    dispatched_type: Array  # (m,) uint8: its type
    delivered: Array  # (m,) int32: tick of delivery, or NIL
    legs: Array  # (m,) int32: times it was picked up


class Traffic(Struct):
    """Occupancy and the intents of the current tick."""

    occupancy: Array  # (C,) uint16: claims, room and the rule of a cell (automaton.kernels.motion)
    want: Array  # (n,) uint8: the intent before motion, its outcome after
    span: Array  # (n,) uint16: ticks that the wanted move takes
    crowd: Array  # (Z,) int32: robots in each zone as the tick began, where zones slow moves down
    # (C, 2) int32: identity of the robot that stands in a limited cell or enters it, or NIL; the
    # second column is for travel W or N through a cell for two. Entered while a strategy that says
    # `holders` is asked (automaton.kernels.holders), else NIL; so is a cell without limit.
    holder: Array
    pending: Array  # (n, 8) int32: intents that the second pass could not decide
    dirty: Array  # (n,) int32: cells whose claims are wiped at the end; first, robots that arrive
    release: Array  # (4n,) int32: cell and direction of travel given up at the end of the tick
    contest: Array  # (T,) int32: best claimant of a resource; NIL between ticks
    key: Array  # (T,) int32: resources of a hash table, or (0,): every resource has its entry


class Tally(Struct):
    """Counters behind the metrics; [.., 0] empty, [.., 1] loaded."""

    times: Array  # (n, A, 2) int64: operations begun
    ticks: Array  # (n, A, 2) int64: ticks of the operations begun
    slowed: Array  # (n,) int64: ticks that moves take beyond those of the robot's type
    spent: Array  # (n,) int64: units of charge used
    charged: Array  # (n,) int64: units of charge taken in at chargers
    repaired: Array  # (n,) int64: units of charge that repairs added
    out: Array  # (n, 3) int64: times that it ran empty, broke down, was towed
    illegal: Array  # (5,) int64: illegal answers by layer
    asked: Array  # (5,) int64: batches that each layer was asked about


class World(Struct):
    """Everything that a tick reads and writes."""

    grid: Grid
    rules: Rules
    robots: Robots
    orders: Orders
    slots: Slots
    stations: Stations
    chargers: Chargers
    zoning: Partition
    traffic: Traffic
    tally: Tally
    clock: Array  # (CLOCK_SIZE,) int64


class Asked(Struct):
    """A batch: the robots that a layer is asked about, sorted by identity."""

    count: Array  # (1,) int64
    robot: Array  # (n,) int32 storage indices; the first `count` are valid
    reason: Array  # (n,) uint8


class ZoningAnswers(Struct):
    zone: Array  # (n,) int32: the zone that the robot serves first of all
    halt: Array  # (n,) int32: ticks that it stands still from now on
    again: Array  # (n,) int32: ticks after which zoning is asked about it again; NIL: when told to
    tells: Array  # (n,) uint8: 1 = what it says changes, to this row of
    said: Array  # (n, SAID) int64
    server: Array  # (Z,) int32, by zone: KEEP, or the identity of the robot that serves it
    redesigned: Array  # (1,) int64: 1 = the design changes, to
    design: Design
    queued: Array  # (1,) int64: how many of the next four are in use
    order: Array  # (m,) int32: this order
    queue: Array  # (m,) int32: comes into the queue of this zone
    stop: Array  # (m,) int32: and is to be set down in this slot
    direct: Array  # (m,) uint8: 1 = past transfer stations
    refused: Array  # (1,) int64: illegal answers that a recording tells of, and no strategy


class ChargingAnswers(Struct):
    stand: Array  # (n,) int32: charger cell to drive to; NIL: stop charging
    level: Array  # (n,) int32: charge at which to leave
    yields: Array  # (n,) int32: 1 = it may get an order while it charges


class AllocationAnswers(Struct):
    verb: Array  # (n,) int32: KEEP, TAKE, SET_DOWN or PARK
    order: Array  # (n,) int32: TAKE: the order to pick up
    slot: Array  # (n,) int32: SET_DOWN: where the load goes
    stand: Array  # (n,) int32: the cell from which it is picked up or set down
    try_drop: Array  # (n,) int32: SET_DOWN: 1 = a TRY_DROP operation follows the pick
    ask_again: Array  # (n,) uint8: 1 = ask again next tick, whatever happens
    planned: Array  # (n,) int32, by storage index: KEEP, or how many orders a robot is to do
    plan: Array  # (n, L) int32, by storage index: these orders
    order_taken: Array  # (m,) uint8: scratch: reserved by an earlier answer of this batch
    slot_taken: Array  # (s,) uint8


class RoutingAnswers(Struct):
    length: Array  # (n,) int32: KEEP or the number of steps
    steps: Array  # (n, R) uint8: directions


class RightOfWayAnswers(Struct):
    verb: Array  # (n,) int32: KEEP, STEP, PAUSE or RETREAT
    value: Array  # (n,) int32: direction, ticks, or moves
    release: Array  # (n,) int32: 1 = an empty robot gives its order back
    priority: Array  # (n,) int32: KEEP or the robot's new priority


class Answers(Struct):
    """Preallocated outputs, indexed like the batch."""

    zoning: ZoningAnswers
    charging: ChargingAnswers
    allocation: AllocationAnswers
    routing: RoutingAnswers
    right_of_way: RightOfWayAnswers


TAKE: Final = 1  # verbs of allocation
SET_DOWN: Final = 2
PARK: Final = 3
STEP: Final = 1
PAUSE: Final = 2
RETREAT: Final = 3


class Memory(Struct):
    """A strategy's private state."""

    own: Array  # (n, k) int64: one row per robot
    shared: Array  # (q,) int64
    parameters: Array  # (p,) int64, read-only


class Workspace(Struct):
    """Scratch of the searches, and the cached distance fields; contents never decide anything."""

    cost: Array  # (P,) int32, per pose = cell * headings + heading
    stamp: Array  # (P,) int64: search in which `cost` was written
    parent: Array  # (P,) uint8
    mark: Array  # (C,) int32
    mark_stamp: Array  # (C,) int64
    heap: Array  # (H,) int64
    generation: Array  # (2,) int64: searches so far; poses expanded
    stop: Array  # (1,) int64: not 0 = the run is given up in mid-tick, what searches find is worthless
    steps: Array  # (R,) uint8: a route that only needs to exist
    field: Array  # (F, P) int32: cost from a pose to the field's target
    field_of: Array  # (K C,) int32: the field of robots of type k to a cell, [k C + c], or NIL
    field_owner: Array  # (F,) int32: which entry of field_of a field has, or NIL
    field_next: Array  # (1,) int64: the field to overwrite next
    routes: RouteSpace
    zoning: ZoneSpace
    parts: Parts


class Record(Struct):
    """Buffers that a recorder empties when the loop pauses."""

    did: Array  # (T, n) uint8, by identity
    decisions: Array  # (Y,) int64: what strategies answered (automaton.kernels.decisions)
    changes: Array  # (X, 4) int64: tick, code, subject, value
    digests: Array  # (T, D) uint64
    values: Array  # (D,) int64, scratch
