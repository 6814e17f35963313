"""Distance tables: the cost of driving to a goal cell from every pose on the empty floor.

A table belongs to a goal cell and a set of costs: exits and ticks of a robot type, or weights of a
strategy. It has one entry for each of the F drivable cells. All tables share the narrowest of four
encodings that fits their costs:

    JOINT    2 bytes  cost * patterns + pattern: of robots with four headings that turn cheaply
    SPLIT    3 bytes  cost in 2 bytes, pattern in 1
    POSE16   2 bytes  for each heading
    POSE32   4 bytes  for each heading

The cost is the least of the four headings. A turn costs the same in each cell, so adjacent headings
differ by at most one turn, and a cell has one of 19, 85 or 231 patterns of differences for turns of
1, 2 or 3 ticks. For example, [0 0 1 1] means that east and south are equally good. The unit of cost
is the greatest common divisor of the ticks of all steps and turns.

Where streets give moves weights, the costs of a row are followed by the ticks of the way of least
cost, 4 bytes for each heading. Of ways with equal costs they are those of the one that routes follow.
"""

from typing import Final

from automaton.engine.jit.structs import (
    CONSTANT,
    NIL,
    SCRATCH,
    STATIC,
    STOP,
    Array,
    NamedNumbers,
    Struct,
    field,
    number,
)

WEIGHT_UNIT: Final = (
    100  # weights of streets are in 1 / WEIGHT_UNIT, costs with them in 1 / 100 tick
)
UNREACHABLE: Final = 1 << 30  # cost of an unreachable goal
STOP_NO_ROOM: Final = 2  # tables.stop: one tick needs more tables than the budget holds

JOINT: Final = 0  # encodings
SPLIT: Final = 1
POSE16: Final = 2
POSE32: Final = 3
FAR_WORD: Final = 65_535  # the word of a cell or pose without a way to the goal
FAR_PAIR: Final = (1 << 32) - 1
MAX_PATTERNS: Final = 256
MAX_NARROW_TURN: Final = 3  # most expensive turn for which a cell has one of a few patterns
BYTES_PER_WORD: Final = 2


class TablesStatus(NamedNumbers):
    """Memory use of the tables."""

    encoding: int = number("JOINT, SPLIT, POSE16 or POSE32")
    words: int = number("of a table, 2 bytes each; 0: no table requested yet")
    rows: int = number("tables that fit the pool")
    taken: int = number("rows used so far: the memory that is allocated")
    hand: int = number("the row at the clock hand")
    costs: int = number("words of the costs of a table; with weights the ticks follow them")
    settled: int = number("entries settled by a search so far")
    refused: int = number("1 = there was no room for a table")


class DistanceTables(Struct, role=SCRATCH):
    """Tables for S sets of costs on F drivable cells out of C, with H headings."""

    headings: int = field("int64", "distinguished headings, as of the grid", role=STATIC)
    first_encoding: int = field("int64", "the narrowest encoding to try", role=STATIC)
    unit: int = field(
        "int64", "unit of the costs in tables: all costs are multiples of it", role=STATIC
    )
    is_narrow: int = field("int64", "1: JOINT, and SPLIT if costs are larger", role=STATIC)
    patterns: int = field(
        "int64", "number of patterns of differences between four headings", role=STATIC
    )
    reciprocal: int = field("int64", "2**32 / patterns, rounded up", role=STATIC)
    offset: Array = field("(4,) int64", "from a cell to its neighbour E, S, W, N", role=CONSTANT)
    drivable: Array = field(
        "(F,) int32", "cells with an entry in the tables, in Z-order", role=CONSTANT
    )
    number: Array = field("(C,) int32", "their entry in a table, or NIL", role=CONSTANT)
    entries: Array = field(
        "(S, C) uint8",
        "bits 0-3: a step in this direction leads here from the cell before; 4: robots may turn",
        role=CONSTANT,
    )
    goal_entries: Array = field(
        "(G, C) uint8",
        "the same for goals in cells that no path crosses; G = 0: no such cells",
        role=CONSTANT,
    )
    cost: Array = field(
        "(S, Q) int64", "the distinct costs of a step or a turn, in units", role=CONSTANT
    )
    queue_count: Array = field("(S,) int64", "number of these costs", role=CONSTANT)
    turn_queue: Array = field("(S,) int64", "the entry of `cost` for a turn", role=CONSTANT)
    step_queue: Array = field(
        "(W, 4C) uint8",
        "the entry of `cost` for a step from cell c in direction d: [s, 4 c + d]; W = 0: the first one",
        role=CONSTANT,
    )
    step: Array = field(
        "(V, 4C) int32",
        "the cost of each step, in units: [s, 4 c + d]; V = 0: few distinct costs, see `cost`",
        role=CONSTANT,
    )
    step_ticks: Array = field(
        "(T, 4C) int32",
        "the ticks of each step: [s, 4 c + d]; T = 0: tables have no ticks beside their costs",
        role=CONSTANT,
    )
    turn_ticks: Array = field("(T,) int64", "the ticks of a turn", role=CONSTANT)
    excess: Array = field(
        f"({4 * MAX_PATTERNS},) uint8", "extra cost of heading h: [4 pattern + h]", role=CONSTANT
    )
    pattern_of: Array = field(
        "(4096,) uint8", "the pattern of differences, 3 bits each", role=CONSTANT
    )
    pool: Array = field("(words,) uint16", "the tables, one after another")
    row_of: Array = field(
        "(S C,) int32", "the row of the table of set s to a goal: [s C + goal]", default=NIL
    )
    owner: Array = field("(R,) int32", "the entry of row_of that names a row, or NIL", default=NIL)
    kept_in: Array = field("(R,) int64", "the last tick in which a row must be kept", default=NIL)
    used: Array = field("(R,) uint8", "1 = used since the clock hand passed")
    status: TablesStatus = field(TablesStatus)
    reached: Array = field("(C,) uint8", "in a search: headings whose cost is known, bit h")
    least: Array = field("(C,) int32", "in a search: the cost of the best heading")
    turns: Array = field("(C,) uint16", "in a search: the extra cost of each heading, 3 bits each")
    costs: Array = field("(P,) int32", "in a search: the cost of each pose, if not narrow")
    queue: Array = field("(Q, L) int64", "in a search: queues, see automaton.engine.table_search")
    head: Array = field("(Q,) int64", "in a search: the next entry of each queue")
    end: Array = field("(Q,) int64", "in a search: entries added to each queue so far")
    entry: Array = field("(E,) int64", "in a search with V > 0: entries, see table_rows")
    following: Array = field("(E,) int32", "the next entry of the same bucket, or NIL")
    bucket: Array = field("(B,) int32", "the first entry of each bucket, or NIL")
    settled: Array = field("(N,) int64", "in a search with T > 0: settled entries, in order")
    ticks: Array = field("(M,) int32", "in a search with T > 0: the ticks from each pose")
    stop: Array = field("(1,) int64", "not 0 = the run is aborted, searches end", role=STOP)
    set_headings: Array = field(
        "(S,) int64", "number of headings that set s distinguishes", role=CONSTANT
    )
    alike: Array = field(
        "(S,) int64", "headings that set s treats as heading 0: bit h", role=CONSTANT
    )


class Workspace(Struct):
    """Scratch of the searches, and the distance tables; results do not depend on old contents."""

    cost: Array = field("(P,) int32", "per pose = cell * headings + heading")
    stamp: Array = field("(P,) int64", "search in which `cost` was written")
    parent: Array = field("(P,) uint8")
    mark: Array = field("(C,) int32")
    mark_stamp: Array = field("(C,) int64")
    heap: Array = field("(H,) int64")
    generation: Array = field("(2,) int64", "searches so far; poses expanded")
    stop: Array = field(
        "(1,) int64", "not 0 = the run is aborted in mid-tick, results of searches are invalid"
    )
    steps: Array = field("(R,) uint8", "a route of which only the existence matters")
    tables: DistanceTables
    streets: DistanceTables  # by the weights of streets, in 1/100 tick; empty without streets


def is_narrow_for(headings: int, turn: int) -> bool:
    """Whether the headings of a cell always match one of a few patterns."""
    return headings == 4 and turn <= MAX_NARROW_TURN


def least_table_bytes(cells: int, headings: int, turn: int) -> int:
    """Bytes of a table in its narrowest encoding, by number of drivable cells."""
    return BYTES_PER_WORD * cells * (1 if is_narrow_for(headings, turn) else headings)
