"""The floor, and what stands on it: slots for loads, stations that work on parts, chargers.

C cells with the border, s slots, m orders, K types of robots. NIL (-1) means none.
"""

from __future__ import annotations

from typing import Any, Final

from numpy.typing import NDArray

from automaton.engine.jit.fields import CONSTANT, DERIVED, SCRATCH, STATIC, field
from automaton.engine.jit.fields import NIL as NIL
from automaton.engine.jit.structs import Struct

Array = NDArray[Any]

MAY_TURN: Final = 16  # bit of a cell's flags: robots may turn in it
NO_WAY_THROUGH: Final = 128  # bit, by type: ways begin and end there, but lead past it


class Grid(Struct, role=CONSTANT):
    """The floor, static; flat index c = y * width + x, one cell of border wall all round."""

    width: int = field("int64", "cells in a row, border included")
    headings: int = field("int64", "headings of the robots that distinguish most: poses of a cell")
    kind: Array = field("(C,) uint8", "automaton.floor.cells")
    cell_flags: Array = field(
        "(C,) uint8", "bits 0-3 exits E S W N, 4 may turn, 5-6 capacity (0 unlimited)"
    )
    type_cell_flags: Array = field(
        "(K, C) uint8",
        "the same for robots of type k, with their exits; 7 no way leads through",
        role=CONSTANT,
    )
    drivable: Array = field("(F,) int32", "the cells that robots drive on, ascending")
    offset: Array = field("(4,) int64", "from a cell to its neighbour E, S, W, N")
    slot: Array = field("(C,) int32", "the slot in this cell, or NIL")
    traffic_zone: Array = field(
        "(C, 2) int32", "of a robot that travels in direction d: [c, d >> 1], or NIL", role=CONSTANT
    )
    traffic_zone_count: int = field("int64", "automaton.floor.traffic_zones")
    min_move_ticks: Array = field(
        "(M,) uint16",
        "ticks that a move from cell c in direction d takes at least: [4 c + d]; M = 0: no limits",
        role=CONSTANT,
    )
    type_headings: Array = field(
        "(K,) int64",
        "that robots of type k distinguish: 1 omni, 2 rail (axes), 4 differential",
        role=CONSTANT,
    )


class Slots(Struct, role=DERIVED):
    """Cells that hold loads: shelves one each; destinations, racks, docks and stations any number.

    Where robots may fail, the last n are spare ones: a load that a robot had to leave lies in one.
    """

    cell: Array = field("(s,) int32", "NIL: a spare one without a load", digest=43, header=True)
    unbounded: Array = field("(s,) uint8", "1 = any number of loads: no shelf")
    content: Array = field("(s,) int32", "the order on a shelf, or NIL", digest=41)
    reserved_by: Array = field(
        "(s,) int32",
        "identity of the robot that reserved it for its load, or NIL",
        default=NIL,
        digest=42,
    )
    access: Array = field(
        "(s, 4) int32", "drivable neighbours E, S, W, N, or NIL; a station: itself"
    )
    accessible: Array = field(
        "(K, s) uint8", "1 = robots of this type get to an access cell of the slot"
    )
    first_spare: int = field("int64", "the first spare slot, or s", role=STATIC)
    reachable: Array = field(
        "(K, C) uint8", "1 = robots of this type get there and back home", role=CONSTANT
    )


class Chargers(Struct, role=STATIC):
    """Cells where robots charge; k of them."""

    cell: Array = field("(k,) int32", "where it is")
    charger_at: Array = field("(C,) int32", "the charger in a cell, or NIL")
    places: Array = field("(k,) int32", "robots that charge there at once")
    exit_cell: Array = field(
        "(k,) int32",
        "scratch: the cell into which its holder wants to move, or NIL",
        default=NIL,
        role=SCRATCH,
    )
    first_ticket: Array = field(
        "(k,) int64", "scratch: the lowest ticket at its door", role=SCRATCH
    )


class Stations(Struct, role=STATIC):
    """Stations that process parts: k of them, one part at a time each, first in, first out; j jobs.

    A job is one part at one station.
    """

    at: Array = field("(s,) int32", "the station that a slot is, or NIL")
    slot: Array = field("(k,) int32")
    in_service: Array = field("(k,) int32", "the job under way, or NIL", default=NIL, digest=44)
    queue_tail: Array = field(
        "(k,) int32",
        "the job at the end of the queue, or NIL",
        default=NIL,
        digest=45,
        recorded=False,
    )
    job_done_tick: Array = field("(k,) int64", "tick in which the job under way is done", digest=46)
    part_arrivals: Array = field("(p,) int32", "the jobs with which parts begin, by tick")
    station: Array = field("(j,) int32")
    processing_time: Array = field("(j,) int32", "how long it takes", header=True)
    part: Array = field("(j,) int32", "the part's number")
    releases_order: Array = field(
        "(j,) int32", "the order that is released when it is done; NIL: none"
    )
    next_in_queue: Array = field(
        "(j,) int32", "the next job in the queue, or NIL", default=NIL, digest=47, recorded=False
    )
    arrival_tick: Array = field(
        "(j,) int32",
        "tick in which the part came, or comes; NIL: unknown",
        hidden=NIL,
        digest=48,
        header=True,
    )
    completion_tick: Array = field(
        "(j,) int32", "tick in which it was done, or NIL", default=NIL, digest=49
    )
    job_of_order: Array = field(
        "(m,) int32", "the job that begins when an order is delivered, or NIL"
    )
