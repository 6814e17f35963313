"""What PIBT keeps from tick to tick, and what it works with in one."""

import numpy as np

from automaton.engine.jit.structs import CONSTANT, SCRATCH, STATIC, Struct, field
from automaton.engine.state import NIL, Array
from automaton.strategy.weighted_tables import DistanceTables
from strategies.right_of_way.deadlocks import Deadlocks
from strategies.right_of_way.making_room import ServiceAreas

# Modes of a robot in a tick: state.mode.
FIXED = 0  # it stays where it is, whatever is decided here
LEAVING = 1  # it is on its way to `next`, and its cell will be free
UNDECIDED = 2
DECIDED = 3

STAY = 4  # an option beside the four directions
NO_OPTION = 7  # after the last one
OPTION_BITS = 3
U = np.uint64  # unsigned where it indexes: saves the test for a negative index
LONG = 100_000  # ticks: of a robot that stands for longer than one waits


class PibtState(Struct):
    """n robots by storage, m = n + 1, c cells, r resources (a cell, or a lane of a cell for two).

    g = c where lattice weights guide robots, else 0.
    """

    dead_ends: int = field("int64", "how many there are", role=STATIC)
    holds_back: int = field(
        "int64",
        "1: who waits for one that makes way is held back, and keeps its choice",
        role=STATIC,
    )
    rings: int = field("int64", "1: robots that push each other in a ring all move", role=STATIC)
    guided: int = field("int64", "1: costs are those of `tables`, 0: ticks", role=STATIC)
    tables: DistanceTables
    against: Array = field(
        "(g, 4) uint8", "1 = a move E, S, W, N out of the cell is against its street", role=CONSTANT
    )
    next: Array = field("(n,) int32", "the cell that it turns to or enters, or its own")
    turning: Array = field(
        "(n,) uint8", "1 + the direction that it has begun to turn to, or waits for; 0"
    )
    begun: Array = field("(n,) uint8", "the same, 0 where a robot sees no plans", role=SCRATCH)
    aim_cell: Array = field("(n,) int32", "its goal cell when it was last looked at", default=NIL)
    aim_type: Array = field("(n,) uint8", "what it was to do there")
    since: Array = field(
        "(n,) int64", "with limited sight: the tick of the last visit that it has finished"
    )
    detour_until: Array = field("(n,) int64", "until this tick it goes round another robot")
    detour_cost: Array = field("(n,) int32", "the ticks to its goal where it met that one")
    detour_goal: Array = field("(n,) int32", "its goal cell then", default=NIL)
    detour_cell: Array = field("(n,) int32", "where it is", default=NIL)
    detour_from: Array = field("(n,) int32", "and where it was before", default=NIL)
    queue: Array = field(
        "(q,) int32", "identities, by the time of the last visit that each has finished"
    )
    dead_end: Array = field("(c,) int32", "the dead end that a cell belongs to", role=CONSTANT)
    way_out: Array = field("(c,) uint8", "the direction out of it", role=CONSTANT)
    depth: Array = field("(c,) int32", "moves from a cell out of it", role=CONSTANT)
    tenants: Array = field("(e,) int32", "robots in a dead end, or on the way in", role=SCRATCH)
    drivers: Array = field("(e,) int32", "those of them that are not parked", role=SCRATCH)
    callers: Array = field("(e,) int32", "robots outside that have work in it", role=SCRATCH)
    parked_from: Array = field("(e,) int32", "the least depth of robots parked in it", role=SCRATCH)
    parks_at: Array = field(
        "(e,) int32", "the greatest depth at which robots outside will park, or 0", role=SCRATCH
    )
    service_areas: ServiceAreas
    stall: Array = field("(s,) int64", "which round of a stall it is, or 0")
    calls: Array = field("(s,) int64", "how often it has decided, one number", role=SCRATCH)
    in_sight: Array = field(
        "(n,) int64", "with limited sight: who chooses, those first in the lowest", role=SCRATCH
    )
    reserved: Array = field("(r,) int64", "call << 32 | who is in it after this move", role=SCRATCH)
    mode: Array = field("(n,) uint8", "FIXED, LEAVING, UNDECIDED, DECIDED", role=SCRATCH)
    options: Array = field(
        "(n,) uint32", "directions and STAY, best first, in OPTION_BITS each", role=SCRATCH
    )
    waits: Array = field(
        "(w,) int64", "what a step E, S, W, N of one robot costs beyond its ticks", role=SCRATCH
    )
    option_next: Array = field(
        "(n,) uint8", "the place of the option to be tried next", role=SCRATCH
    )
    departs: Array = field("(n,) uint8", "whether it begins its move (departures)", role=SCRATCH)
    asks: Array = field(
        "(n,) uint8", "1 + the direction in which it asks for a gate, or 0", role=SCRATCH
    )
    priced_cell: Array = field("(n,) int32", "the cell that its `costs` are of", role=SCRATCH)
    priced_goal: Array = field("(n,) int32", "and the goal cell, or NIL", role=SCRATCH)
    costs: Array = field("(n, 4) int32", "ticks to its goal after a step E, S, W, N", role=SCRATCH)
    unpriced: Array = field("(m,) int32", "robots that have others now", role=SCRATCH)
    table: Array = field("(n,) int32", "the distance table to its goal, or NIL", role=SCRATCH)
    holds_fixed: Array = field(
        "(c,) uint8", "1 = a robot that does not choose is there", role=SCRATCH
    )
    rank: Array = field("(q,) uint8", "by place in the queue: who chooses first", role=SCRATCH)
    stack: Array = field("(n,) int32", "a chain of robots that push each other", role=SCRATCH)
    deadlocks: Deadlocks
    finished: Array = field("(q,) int32", "who has finished a visit since", role=SCRATCH)
