"""Distance tables: what it costs to drive to a goal cell from every pose on the empty floor.

A table belongs to a goal cell and a set of costs: the exits and the ticks of a robot type, or weights
of a strategy. It has one entry for each of the F cells that robots drive on, in the narrowest of four
encodings that its costs and those of the tables beside it fit:

    JOINT    2 bytes  cost * patterns + pattern: of robots with four headings that turn cheaply
    SPLIT    3 bytes  cost in 2 bytes, pattern in 1
    POSE16   2 bytes  for each heading
    POSE32   4 bytes  for each heading

The cost is the least of the four headings. Turning costs the same in each cell, so headings next to
each other differ by a turn at most, and the whole cell is one of 19, 85 or 231 patterns of differences
for turns of 1, 2 or 3 ticks: [0 0 1 1], say, where east and south are equally good. Ticks are counted
in the largest unit that all steps and turns are a multiple of.
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

UNREACHABLE: Final = 1 << 30  # cost of what cannot be reached
STOP_NO_ROOM: Final = 2  # tables.stop: one tick needs more tables than the budget holds

JOINT: Final = 0  # encodings
SPLIT: Final = 1
POSE16: Final = 2
POSE32: Final = 3
FAR_WORD: Final = 65_535  # the word of a cell or pose from which there is no way
FAR_PAIR: Final = (1 << 32) - 1
MAX_PATTERNS: Final = 256
MAX_NARROW_TURN: Final = 3  # cost of a turn up to which a cell is one of so many patterns
BYTES_PER_WORD: Final = 2


class TablesStatus(NamedNumbers):
    """How much of the memory of the tables is in use."""

    encoding: int = number("JOINT, SPLIT, POSE16 or POSE32")
    words: int = number("of a table, 2 bytes each; 0: none was asked for yet")
    rows: int = number("tables that fit the pool")
    taken: int = number("rows that were in use at some time: the memory that is taken")
    hand: int = number("the row at which the clock hand is")
    refused: int = number("1 = there was no room for a table")


class DistanceTables(Struct, role=SCRATCH):
    """Tables for S sets of costs on the F drivable ones of C cells, with H headings."""

    headings: int = field("int64", "distinguished headings, as of the grid", role=STATIC)
    first_encoding: int = field("int64", "the narrowest that costs may fit", role=STATIC)
    unit: int = field("int64", "what all costs are a multiple of; tables count in it", role=STATIC)
    is_narrow: int = field("int64", "1: JOINT, and SPLIT if costs are larger", role=STATIC)
    patterns: int = field("int64", "differences of four headings that occur", role=STATIC)
    reciprocal: int = field("int64", "2**32 / patterns, rounded up", role=STATIC)
    offset: Array = field("(4,) int64", "from a cell to its neighbour E, S, W, N", role=CONSTANT)
    drivable: Array = field("(F,) int32", "the cells that tables have, in Z-order", role=CONSTANT)
    number: Array = field("(C,) int32", "their entry in a table, or NIL", role=CONSTANT)
    entries: Array = field(
        "(S, C) uint8",
        "bits 0-3: a step in this direction leads here from the cell before; 4: robots may turn",
        role=CONSTANT,
    )
    goal_entries: Array = field(
        "(G, C) uint8",
        "the same for a goal, where ways lead to cells but not through; G = 0: nowhere",
        role=CONSTANT,
    )
    cost: Array = field(
        "(S, Q) int64", "the distinct costs of a step or a turn, in units", role=CONSTANT
    )
    queue_count: Array = field("(S,) int64", "how many those are", role=CONSTANT)
    turn_queue: Array = field("(S,) int64", "the entry of cost that a turn has", role=CONSTANT)
    step_queue: Array = field(
        "(W, 4C) uint8",
        "the entry of cost of a step from cell c in direction d: [s, 4 c + d]; W = 0: the first one",
        role=CONSTANT,
    )
    excess: Array = field(
        f"({4 * MAX_PATTERNS},) uint8", "what heading h costs more: [4 pattern + h]", role=CONSTANT
    )
    pattern_of: Array = field(
        "(4096,) uint8", "the pattern of differences, 3 bits each", role=CONSTANT
    )
    pool: Array = field("(words,) uint16", "the tables, one after another")
    row_of: Array = field("(S C,) int32", "the row of set s to a goal: [s C + goal]", default=NIL)
    owner: Array = field("(R,) int32", "which entry of row_of a row has, or NIL", default=NIL)
    kept_in: Array = field("(R,) int64", "the tick in which a row must stay", default=NIL)
    used: Array = field("(R,) uint8", "1 = looked at since the clock hand came by")
    status: TablesStatus = field(TablesStatus)
    reached: Array = field("(C,) uint8", "of a search: headings whose cost is known, bit h")
    least: Array = field("(C,) int32", "of a search: the cost of the best heading")
    turns: Array = field("(C,) uint16", "of a search: what each heading costs more, 3 bits each")
    costs: Array = field("(P,) int32", "of a search: the cost of each pose, where not narrow")
    queue: Array = field("(Q, L) int64", "of a search: automaton.engine.table_rows")
    head: Array = field("(Q,) int64", "of a search: the next entry of each queue")
    end: Array = field("(Q,) int64", "of a search: entries of each queue so far")
    stop: Array = field("(1,) int64", "not 0 = the run is given up, searches end", role=STOP)
    set_headings: Array = field("(S,) int64", "headings that set s distinguishes", role=CONSTANT)
    alike: Array = field(
        "(S,) int64", "of set s, those that are as good as heading 0: bit h", role=CONSTANT
    )


class Workspace(Struct):
    """Scratch of the searches, and the distance tables; contents never decide anything."""

    cost: Array = field("(P,) int32", "per pose = cell * headings + heading")
    stamp: Array = field("(P,) int64", "search in which `cost` was written")
    parent: Array = field("(P,) uint8")
    mark: Array = field("(C,) int32")
    mark_stamp: Array = field("(C,) int64")
    heap: Array = field("(H,) int64")
    generation: Array = field("(2,) int64", "searches so far; poses expanded")
    stop: Array = field(
        "(1,) int64", "not 0 = the run is given up in mid-tick, what searches find is worthless"
    )
    steps: Array = field("(R,) uint8", "a route that only needs to exist")
    tables: DistanceTables


def is_narrow_for(headings: int, turn: int) -> bool:
    """Whether the headings of a cell are one of a few patterns."""
    return headings == 4 and turn <= MAX_NARROW_TURN


def least_table_bytes(cells: int, headings: int, turn: int) -> int:
    """Bytes of a table of so many drivable cells in its narrowest encoding."""
    return BYTES_PER_WORD * cells * (1 if is_narrow_for(headings, turn) else headings)
