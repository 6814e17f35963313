"""Gates: what lets robots into some cells at some times only. Closings, doors, blocks and lifts.

A gate has cells, and a cell may have several gates. All of them are numbered together, in the order of
their kinds. NIL (-1) means none.
"""

from __future__ import annotations

from typing import Any, Final

from numpy.typing import NDArray

from automaton.engine.jit.fields import NIL, SCRATCH, STATIC, field
from automaton.engine.jit.structs import Struct

Array = NDArray[Any]

GATE_CLOSING: Final = 0  # no robot may enter for some time
GATE_DOOR: Final = 1  # it opens to a robot that asks, and shuts
GATE_BLOCK: Final = 2  # it holds so many robots, or robots of one direction
GATE_LIFT: Final = 3  # a block of one robot, whose cabin comes when it is called
GATE_KINDS: Final = ("closed", "door", "block", "lift")


class Gates(Struct, role=STATIC):
    """g gates of cells; without gates all sizes are 0.

    What they are stays; what has a digest number changes from tick to tick.
    """

    kind: Array = field("(g,) uint8", "GATE_*")
    cell_first: Array = field(
        "(c + 1,) int32", "cell_gate[cell_first[k]: cell_first[k + 1]] are the gates of cell k"
    )
    cell_gate: Array = field("(e,) int32", "gates by cell, each cell's in ascending order")
    cell_index: Array = field(
        "(e,) int32", "the last mouth of its lift up to the cell, by path; else NIL", default=NIL
    )
    first_closing: Array = field(
        "(g + 1,) int32",
        "closings[first_closing[k]: first_closing[k + 1]] are those of gate k",
        header=True,
    )
    closings: Array = field(
        "(x, 2) int64",
        "first tick of a closing, tick after the last; by gate and tick",
        header=True,
    )
    known: Array = field("(g,) uint8", "1 = routing may know how long a closing lasts")
    replan_after: Array = field(
        "(a,) int64", "lost ticks after which a robot is planned around a closing; empty: never"
    )
    max_robots: Array = field("(g,) int32", "that a block holds")
    same_way: Array = field("(g,) uint8", "1 = robots enter a block after each other over one cell")
    opening_ticks: Array = field("(g,) int64", "that a door takes to open, or the doors of a lift")
    hold_ticks: Array = field("(g,) int64", "without use after which a door shuts")
    travel_ticks: Array = field("(g,) int64", "of a cabin from one mouth to the next")
    cabin_ticks: Array = field(
        "(c, 4) int32", "ticks of a move in a lift, by direction E S W N; 0: the usual ones"
    )
    closing: Array = field(
        "(g,) int32", "which closing of a gate comes or lasts, from 0", digest=75
    )
    open_from: Array = field(
        "(g,) int64", "tick from which a door, or a lift at its mouth, lets robots in", digest=76
    )
    used: Array = field("(g,) int64", "tick in which a door was last used or asked for", digest=77)
    mouth: Array = field(
        "(g,) int32", "a block: the cell last entered; a lift: where its cabin is", digest=78
    )
    caller: Array = field(
        "(g,) int32", "identity of the robot that called a lift, or NIL", default=NIL, digest=79
    )
    waited: Array = field(
        "(r,) int64", "ticks that a robot has lost before one closing, by identity", digest=80
    )
    waited_for: Array = field(
        "(r,) int32", "that row of closings, by identity, or NIL", default=NIL, digest=81
    )
    robots: Array = field("(g,) int32", "in it when the tick began", role=SCRATCH)
    held: Array = field(
        "(n,) int32", "the gate that kept a robot in this tick, or NIL", default=NIL, role=SCRATCH
    )
    first_entrant: Array = field(
        "(g,) int32", "entry of those that want into it", default=NIL, role=SCRATCH
    )
    entrant: Array = field("(y,) int32", "storage index of a robot", role=SCRATCH)
    entrant_cell: Array = field("(y,) int32", "the cell that it would enter", role=SCRATCH)
    next_entrant: Array = field("(y,) int32", "the next one of the same gate", role=SCRATCH)
