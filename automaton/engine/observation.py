"""Why a robot makes no progress: the causes of lost time, and the events of a run.

A robot waits in a tick in which it neither works nor drives. The cause tells why, the blocker is
the robot that blocks it, and `wanted` is the cell that it tries to enter. CAUSE_REDUCED_SPEED is
not a wait: it is the cause of the ticks that a move takes beyond its duration.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from automaton.engine.jit.structs import MEASURED, NIL, SCRATCH, NamedNumbers, Struct, field, number
from automaton.engine.state import Array


class Cause(NamedTuple):
    """A cause of lost time."""

    name: str
    text: str  # a sentence about {robot}; {cell} is the wanted cell, {blocker} the robot that blocks it
    rule: str  # the rule behind it
    blocked: bool  # another robot blocks it: the time counts as blocked

    @property
    def meaning(self) -> str:
        """The sentence, about robots in general."""
        return self.text.format(robot="the robot", blocker="another robot", cell="the next cell")


CAUSE_NOT_WAITING: Final = 0
CAUSE_QUEUE: Final = 1
CAUSE_HEAD_ON: Final = 2
CAUSE_WORKING_AHEAD: Final = 3
CAUSE_DRIVING_AHEAD: Final = 4
CAUSE_IDLE_AHEAD: Final = 5
CAUSE_VERTEX_CONFLICT: Final = 6
CAUSE_LANE: Final = 7
CAUSE_BAY_HELD: Final = 8
CAUSE_RANDOM_WAIT: Final = 9
CAUSE_FOLLOWING_CONFLICT: Final = 10
CAUSE_RETREAT: Final = 11
CAUSE_NO_ORDER: Final = 12
CAUSE_NO_DROP_OFF_SLOT: Final = 13
CAUSE_NO_ROUTE: Final = 14
CAUSE_ILLEGAL_DECISION: Final = 15
CAUSE_CHARGER_QUEUE: Final = 16
CAUSE_NO_ENERGY: Final = 17
CAUSE_FAULT: Final = 18
CAUSE_REDUCED_SPEED: Final = 19  # only in observation.lost: such a robot does not wait
CAUSE_REDESIGN: Final = 20
CAUSE_HELD_BACK: Final = 21
CAUSE_STATION_QUEUE: Final = 22
CAUSE_POD_AHEAD: Final = 23
CAUSE_STATION_BREAK: Final = 24
CAUSE_DELAYED: Final = 25
CAUSE_CLOSED: Final = 26  # and the other kinds of gates after it, in the sequence of GATE_KINDS
CAUSE_DOOR: Final = 27
CAUSE_BLOCK: Final = 28
CAUSE_LIFT: Final = 29
CAUSE_STANDING: Final = 30  # only in observed runs
CAUSE_UNDECIDED: Final = 255  # within a tick: waits for a cell; the cause depends on its holder

_HELD = "rule of occupancy: a cell holds no more robots than its capacity"
CAUSES: Final = (
    Cause("none", "{robot} does not wait", "", False),
    Cause("queue", "{blocker} holds {cell} and is waiting itself", _HELD, True),
    Cause(
        "head-on",
        "{blocker} holds {cell} and wants to come the other way",
        "two robots cannot swap over one edge",
        True,
    ),
    Cause("working ahead", "{blocker} holds {cell} while it works there", _HELD, True),
    Cause("driving ahead", "{blocker} holds {cell} and is driving on", _HELD, True),
    Cause("idle ahead", "{blocker} holds {cell} and is idle", _HELD, True),
    Cause(
        "vertex conflict",
        "{blocker} won {cell} in this tick",
        "the claimant with the highest priority wins; a hash breaks ties",
        True,
    ),
    Cause(
        "lane",
        "{robot} must turn, and {blocker} is in the other lane of its cell",
        "a robot that turns in a passing aisle needs both lanes",
        True,
    ),
    Cause(
        "bay",
        "{blocker} holds {cell}, so {robot} cannot leave its parking bay",
        "a robot may leave its parking bay only if its home cell was empty",
        True,
    ),
    Cause(
        "random wait",
        "{cell} is free; a random wait set by right of way is not over",
        "after a refused move a robot waits before it tries again",
        False,
    ),
    Cause(
        "following conflict",
        "the robot ahead left {cell} only at the end of this tick",
        "a cell may be entered only if it is empty or `world.following` lets the robot follow",
        True,
    ),
    Cause(
        "retreat",
        "{robot} decided to retreat",
        "right of way: the decision to retreat costs the tick in which it is made",
        True,
    ),
    Cause("no order", "{robot} has no order", "allocation assigned no order to the robot", False),
    Cause(
        "no drop-off slot",
        "{robot} holds a load and has no slot to drop it at",
        "allocation named no slot",
        False,
    ),
    Cause("no route", "{robot} has a goal but no route to it", "routing found no route", False),
    Cause(
        "illegal decision",
        "a decision of a strategy about {robot} broke a rule",
        "an illegal decision costs a tick",
        False,
    ),
    Cause(
        "charger",
        "{robot} is queueing: {blocker} is charging at {cell} or arrived before it",
        "chargers serve robots first come, first served",
        True,
    ),
    Cause(
        "empty battery",
        "the battery of {robot} lacks the charge for its next operation",
        "a robot without energy stays in its cell until it is towed",
        False,
    ),
    Cause(
        "broken down",
        "{robot} has broken down",
        "a broken robot stays in its cell until it is towed or repaired",
        False,
    ),
    Cause(
        "reduced speed",
        "{robot} drives, but slow zones, speed limits or random delays extend its moves",
        "a move begun in a zone with m robots takes m times as long",
        False,
    ),
    Cause(
        "redesign",
        "{robot} stands still while the service zones are redesigned",
        "zoning halts robots while it decides which robots serve which stations",
        False,
    ),
    Cause(
        "held back",
        "right of way tells {robot} to wait: others go first",
        "right of way steers the robots: in each tick it decides which ones move and which ones wait",
        False,
    ),
    Cause(
        "station queue",
        "{robot} is queueing before its station: {blocker} holds {cell}",
        "stations serve robots in the order of their queue",
        True,
    ),
    Cause(
        "pod ahead",
        "a pod stands in {cell}, and {robot} carries a load",
        "robots with a load do not drive under pods",
        False,
    ),
    Cause(
        "station break",
        "{robot} stands at its station, which has a break",
        "no visit begins during a break of its station",
        False,
    ),
    Cause(
        "delayed",
        "{robot} is delayed",
        "a delayed robot begins no operation; the delay extends a move or a turn under way",
        False,
    ),
    Cause(
        "closed",
        "{cell} is closed temporarily",
        "no robot may enter a closed cell; a robot inside continues and may leave",
        False,
    ),
    Cause(
        "door",
        "{cell} is a door that is shut",
        "a door opens when a robot requests it",
        False,
    ),
    Cause(
        "block",
        "{cell} is in a block with no room for {robot}",
        "a block holds no more robots than its max_robots",
        False,
    ),
    Cause(
        "lift",
        "{cell} is in a lift whose cabin is not ready for {robot}",
        "a lift takes one robot at a time, and comes when it is called",
        False,
    ),
    Cause(
        "standing",
        "{robot} stands, and no robot is ahead",
        "a log of real robots does not show why",
        False,
    ),
)
CAUSE_COUNT: Final = len(CAUSES)

# Events: rows (tick, code, robot, subject, value); parts and stations are counted from 0.
EVENT_ORDER_TAKEN: Final = 1  # robot, order
EVENT_PICKED: Final = 2  # robot, order, the robot's cell
EVENT_DROPPED: Final = 3  # robot, order, the robot's cell: on the way, for another leg
EVENT_DELIVERED: Final = 4  # robot, order, the robot's cell
EVENT_LEFT_BAY: Final = 5  # robot
EVENT_PARKED: Final = 6  # robot
EVENT_RETREATED: Final = 7  # robot, none, moves
EVENT_ORDER_RETURNED: Final = 8  # robot, order
EVENT_CHARGING: Final = 9  # robot, none, its charge: a stay at a charger begins
EVENT_ILLEGAL_DECISION: Final = 10  # robot or none, rule, value (automaton.engine.refusals)
EVENT_WAIT_CYCLE: Final = 11  # robot of least number in a cycle that has just closed, none, members
EVENT_DEADLOCK: Final = 12  # as above, once the cycle has lasted DEADLOCK_TICKS
EVENT_DEPLETED: Final = 13  # robot, none, its cell
EVENT_FAILED: Final = 14  # robot, none, its cell
EVENT_TOWED: Final = 15  # robot
EVENT_BACK: Final = 16  # robot
EVENT_JOB_DONE: Final = 17  # none, part, station: the part goes on to its next station
EVENT_PART_FINISHED: Final = 18  # none, part, its last station
EVENT_ZONES_REDESIGNED: Final = 19  # none, none, stations that are in another zone now
EVENT_VISITED: Final = 20  # robot, order, the robot's cell: a stop is done
EVENT_NAMES: Final = (
    *(
        "",
        "order taken",
        "picked up",
        "dropped",
        "delivered",
        "left parking bay",
        "parked",
        "retreated",
    ),
    *("order returned", "charges", "illegal decision", "wait cycle", "deadlock"),
    *("battery empty", "broken down", "towed", "back"),
    *("job done", "part finished", "zones redesigned", "visited"),
)
DEADLOCK_TICKS: Final = 64  # most wait cycles are two robots that meet head-on and soon retreat

# Bits of scratch.marks.
IS_WAITING: Final = 1  # waits for anything except an order
IS_EVENTFUL: Final = 2

# Columns of observation.curve.
WAITING_ROBOTS: Final = 0
WORKING_ROBOTS: Final = 1
DELIVERED_ORDERS: Final = 2
CURVE_COLUMNS: Final = 3

# Columns of observation.lost_ticks_by_cell: in one array, since each waiting robot needs all of
# them.
LOST_EVER: Final = 0  # robot ticks
LOST_LATELY: Final = 1  # robot ticks, halved every MEMORY_TICKS
COUNTED_AT: Final = 2  # tick of the last entry in LOST_LATELY
DELAY_COLUMNS: Final = 4  # a power of two: no cell spans two cache lines

MEMORY_TICKS: Final = 128  # ticks after which the congestion of a cell halves


class ObservationCounts(NamedNumbers):
    """Rows used in the buffers of an observation."""

    events: int = number("rows of observation.events in use")
    curve_rows: int = number("rows of observation.curve in use")


class WaiterCounts(NamedNumbers):
    """Robots in the lists of a tick."""

    waiters: int = number("entries of scratch.waiters in use")
    eventful: int = number("entries of scratch.eventful in use")


class ObservationScratch(Struct, role=SCRATCH):
    """Scratch of the kernels that observe a tick; n robots, C cells.

    `marks` and `words` share memory, so one word reads eight marks.
    """

    count: WaiterCounts = field(WaiterCounts)
    entry: Array = field(
        "(n,) int32",
        "the entry of `holder` for the resource that a waiting robot needs, or NIL",
        default=NIL,
    )
    holder: Array = field(
        "(2C,) int32",
        "storage index of the holder of a wanted resource; NIL between ticks",
        default=NIL,
    )
    sieve: Array = field("(power of two,) uint8", "whether a wanted cell has this remainder")
    marks: Array = field("(n rounded up to eights,) uint8", "by identity; zero between ticks")
    words: Array = field("(ceil(n / 8),) uint64")
    waiters: Array = field("(n,) int32", "waiting robots: storage indices in order of identity")
    eventful: Array = field("(n,) int32", "robots with possible events: likewise")
    color: Array = field("(n,) int32", "in the search for cycles")


class Observation(Struct, role=MEASURED):
    """The observation of a run; nothing in the world depends on it.

    n robots by storage, C cells, E events and T ticks between two pauses; k stations that work on
    parts, S stations and P zones of a partition. Everything except scratch and buffers continues
    from the previous tick.
    """

    cause: Array = field("(n,) uint8", "why it waits: an index of CAUSES")
    blocker: Array = field(
        "(n,) int32", "identity of the robot that blocks it, or NIL", default=NIL
    )
    wanted: Array = field("(n,) int32", "the cell that it tries to enter, or NIL", default=NIL)
    # Of a robot that is down: what it waited for when it went down.
    blocker_before: Array = field("(n,) int32", "identity of its blocker, or NIL", default=NIL)
    wanted_before: Array = field("(n,) int32", "the cell that it tried to enter", default=NIL)
    since: Array = field(
        "(n,) int64", "tick in which its wait began; meaningful while cause is not 0"
    )
    slow_zone: Array = field("(n,) int32", "zone that slows its current move, or NIL", default=NIL)
    slow_zone_occupancy: Array = field(
        "(n,) int32", "robots in that zone when the move began; valid only with a slow_zone"
    )
    wait_cycle_ticks: Array = field("(n,) int32", "duration of its wait cycle in ticks")
    lost: Array = field(f"(n, {CAUSE_COUNT}) int64", "ticks lost by cause")
    lost_in_zone: Array = field(
        "(Z,) int64", "lost ticks of CAUSE_REDUCED_SPEED in moves slowed by a zone"
    )
    busy_before: Array = field("(n,) uint16", "robots.busy after the previous tick")
    dropped: Array = field(
        "(n,) int32", "the load that it dropped in this tick, or NIL", default=NIL
    )
    load_before: Array = field("(n,) int32", default=NIL)
    order_before: Array = field("(n,) int32", default=NIL)
    visits_before: Array = field("(n,) int64", "tally.visits after the previous tick")
    stays: Array = field("(n,) int64", "stays at chargers already reported as events")
    status_before: Array = field("(n,) uint8")
    working: Array = field("(k,) int32", "stations.in_service after the previous tick", default=NIL)
    zone_before: Array = field("(S,) int32", "service_zones.design.zone after the previous tick")
    reshaped: Array = field(
        "(P,) int64", "the last tick in which a zone gained or lost stations, or NIL", default=NIL
    )
    redesigns: int = field("() int64", "number of ticks in which stations changed zones")
    lost_ticks_by_cell: Array = field(f"(C, {DELAY_COLUMNS}) int32", "robot ticks lost in a cell")
    flow: Array = field("(C, 4) int32", "moves out of a cell, E S W N")
    count: ObservationCounts = field(ObservationCounts, role=SCRATCH)
    events: Array = field("(E, 5) int64", role=SCRATCH)
    curve: Array = field(f"(T, {CURVE_COLUMNS}) int32", "one row per tick", role=SCRATCH)
    scratch: ObservationScratch


def is_waiting(cause: Array) -> Array:
    """(n,) bool: robots kept from making progress; a robot without an order does not count."""
    kept: Array = (cause != CAUSE_NOT_WAITING) & (cause != CAUSE_NO_ORDER)
    return kept


def waited_ticks(cause: Array, since: Array, tick: int) -> Array:
    """(n,) int64: how long each robot has waited at a tick, for any cause; 0 if it does not wait.

    A wait continues when its cause changes, but a wait for an order is a separate wait. The first
    lost tick counts.
    """
    waited: Array = np.where(cause != CAUSE_NOT_WAITING, tick - since, 0)
    return waited


def visits_of(flow: Array, offset: Array) -> Array:
    """(C,) int32: robots that entered a cell, from the moves out of its neighbours.

    `offset`: (4,) from a cell to its neighbours E S W N. No robot leaves the cells of the border.
    """
    visits = np.zeros(len(flow), np.int32)
    for direction, step in enumerate(offset):
        visits += np.roll(flow[:, direction], int(step))
    return visits


def congestion_of(delay: Array, tick: int) -> Array:
    """(C,) int32: recently lost robot ticks, weighted as of this tick."""
    halvings = np.minimum((tick - delay[:, COUNTED_AT]) // MEMORY_TICKS, 31)
    faded: Array = delay[:, LOST_LATELY] >> halvings
    return faded
