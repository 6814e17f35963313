"""Why a robot does not get on: the causes of lost time, and the events of a run.

A robot waits when it neither works nor drives in a tick. Its cause says what keeps it, its blocker
which robot does, and `wanted` names the cell that it wants to enter.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from automaton.struct import Struct
from automaton.world.state import Array


class Cause(NamedTuple):
    """One cause."""

    name: str
    text: str  # a sentence about {robot}; {cell} is the wanted cell, {blocker} who keeps it
    rule: str  # the rule behind it
    blocked: bool  # another robot keeps it: the time counts as blocked

    @property
    def meaning(self) -> str:
        """The sentence about any robot."""
        return self.text.format(robot="the robot", blocker="another robot", cell="the next cell")


NOT_WAITING: Final = 0
QUEUE: Final = 1
HEAD_ON: Final = 2
AT_WORK: Final = 3
PASSING: Final = 4
IN_THE_WAY: Final = 5
LOST_CONTEST: Final = 6
LANE: Final = 7
BAY_HELD: Final = 8
WAIT_DRAWN: Final = 9
JUST_FREED: Final = 10
WITHDRAWAL: Final = 11
NO_ORDER: Final = 12
NO_PLACE: Final = 13
NO_ROUTE: Final = 14
ILLEGAL_ANSWER: Final = 15

_HELD = "rule of occupancy: a cell holds no more robots than its capacity"
CAUSES: Final = (
    Cause("none", "{robot} does not wait", "", False),
    Cause("queue", "{blocker} holds {cell} and waits itself", _HELD, True),
    Cause(
        "head-on",
        "{blocker} holds {cell} and wants to come the other way",
        "two robots never swap over one edge",
        True,
    ),
    Cause("worker ahead", "{blocker} holds {cell} while it works there", _HELD, True),
    Cause("driver ahead", "{blocker} holds {cell} and is driving on", _HELD, True),
    Cause("idle ahead", "{blocker} holds {cell} and has nothing to do", _HELD, True),
    Cause(
        "lost contest",
        "{blocker} won {cell} in this tick",
        "of several claimants the higher priority wins, ties by a hash",
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
        "{blocker} holds {cell}, so {robot} cannot leave its bay",
        "a robot leaves its bay when its home cell was empty",
        True,
    ),
    Cause(
        "wait drawn",
        "{cell} is free; right of way drew a wait that is not over",
        "after a refused move a robot waits before it tries again",
        False,
    ),
    Cause(
        "just freed",
        "{cell} was given up only at the end of this tick",
        "a cell is entered only when its holder gives it up in the same tick",
        True,
    ),
    Cause(
        "withdrawal",
        "{robot} decided to withdraw",
        "right of way: a withdrawal takes the tick in which it is decided",
        True,
    ),
    Cause("no order", "{robot} has no order", "allocation gave it nothing to do", False),
    Cause(
        "no place", "{robot} holds a load and has no place for it", "allocation named none", False
    ),
    Cause("no route", "{robot} has a goal but no route to it", "routing gave none", False),
    Cause(
        "illegal answer",
        "a strategy's answer about {robot} broke a rule",
        "an illegal answer costs a tick",
        False,
    ),
)
CAUSE_COUNT: Final = len(CAUSES)

# Events: rows (tick, code, robot, subject, value).
TOOK: Final = 1  # robot, order
PICKED_UP: Final = 2  # robot, order, the robot's cell
SET_DOWN: Final = 3  # robot, order, the robot's cell: on the way, for another leg
DELIVERED_AT: Final = 4  # robot, order, the robot's cell
OUT_OF_BAY: Final = 5  # robot
PARKED: Final = 6  # robot
WITHDREW: Final = 7  # robot, none, moves
GAVE_BACK: Final = 8  # robot, order
CHARGED: Final = 9  # robot, none, ticks
REFUSED_ANSWER: Final = 10  # robot
CYCLE: Final = 11  # robot of least number in a cycle that has just closed, none, members
DEADLOCK: Final = 12  # the same, when the cycle has lasted DEADLOCK_TICKS
EVENT_NAMES: Final = (
    *("", "took", "picked up", "set down", "delivered", "left bay", "parked", "withdrew"),
    *("gave back", "charges", "illegal answer", "circular wait", "deadlock"),
)
DEADLOCK_TICKS: Final = 64  # most cycles are two robots head-on that soon withdraw

# Entries of observation.count.
EVENTS: Final = 0  # rows of observation.events in use
ROWS: Final = 1  # rows of observation.curve in use
HOLDINGS: Final = 2  # entries of observation.holdings in use
COUNTS: Final = 3

# Columns of observation.curve.
WAITING_ROBOTS: Final = 0
WORKING_ROBOTS: Final = 1
DELIVERED_ORDERS: Final = 2
CURVE_COLUMNS: Final = 3

MEMORY_TICKS: Final = 128  # in which the congestion of a cell halves


class Observation(Struct):
    """What is watched while a run goes on; nothing in the world depends on it.

    n robots by storage, C cells, E events and T ticks between two pauses.
    """

    count: Array  # (COUNTS,) int64
    cause: Array  # (n,) uint8: why it waits, of CAUSES
    blocker: Array  # (n,) int32: identity of the robot that keeps it, or NIL
    wanted: Array  # (n,) int32: the cell that it wants, or NIL
    since: Array  # (n,) int64: tick in which its wait began; meaningful while cause is not 0
    slow_zone: Array  # (n,) int32: zone that slows the move that it is in, or NIL
    crowd: (
        Array  # (n,) int32: robots in that zone when the move began; meaningful beside a slow_zone
    )
    ring: Array  # (n,) int32: ticks that its cycle of robots that wait for each other has lasted
    lost: Array  # (n, CAUSE_COUNT) int64: ticks lost by cause
    busy_before: Array  # (n,) uint16: robots.busy after the tick before
    cause_before: Array  # (n,) uint8
    set_down: Array  # (n,) int32: the load that it set down in this tick, or NIL
    load_before: Array  # (n,) int32
    order_before: Array  # (n,) int32
    color: Array  # (n,) int32: scratch of the search for cycles
    visits: Array  # (C,) int32: robots that entered a cell
    waits: Array  # (C,) int32: robot ticks lost in a cell
    recent: Array  # (C,) int32: the same, halved every MEMORY_TICKS
    recent_at: Array  # (C,) int32: tick of the last entry in `recent`
    flow: Array  # (C, 4) int32: moves out of a cell, E S W N
    holder: (
        Array  # (2C,) int32: storage index of who holds a resource, or NIL; as it was built last
    )
    holdings: Array  # (4n,) int32: the entries of `holder` that are not NIL
    events: Array  # (E, 5) int64
    curve: Array  # (T, CURVE_COLUMNS) int32: one row for each tick
