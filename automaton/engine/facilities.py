"""The floor, and what stands on it: slots for loads, stations that work on parts, chargers.

C cells with the border, s slots, m orders, K types of robots. NIL (-1) means none.
"""

from __future__ import annotations

from typing import Any, Final

from numpy.typing import NDArray

from automaton.engine.jit.structs import Struct

Array = NDArray[Any]

NIL: Final = -1  # none
MAY_TURN: Final = 16  # bit of a cell's flags: robots may turn in it


class Grid(Struct):
    """The floor, static; flat index c = y * width + x, one cell of border wall all round."""

    width: int  # cells in a row, border included
    headings: int  # distinguished headings: 1 omni, 2 rail (axes), 4 differential
    kind: Array  # (C,) uint8, automaton.floor.cells
    cell_flags: Array  # (C,) uint8: bits 0-3 exits E S W N, 4 may turn, 5-6 capacity (0 unlimited)
    type_cell_flags: Array  # (K, C) uint8: the same for robots of type k, with their exits
    offset: Array  # (4,) int64: from a cell to its neighbour E, S, W, N
    slot: Array  # (C,) int32: the slot in this cell, or NIL
    traffic_zone: Array  # (C, 2) int32: of a robot that travels in direction d: [c, d >> 1], or NIL
    traffic_zone_count: int  # automaton.floor.traffic_zones


class Slots(Struct):
    """Cells that hold loads: shelves one each; destinations, racks, docks and stations any number.

    Where robots may fail, the last n are spare ones: a load that a robot had to leave lies in one.
    """

    cell: Array  # (s,) int32; NIL: a spare one without a load
    unbounded: Array  # (s,) uint8: 1 = any number of loads: no shelf
    content: Array  # (s,) int32: the order on a shelf, or NIL
    reserved_by: Array  # (s,) int32: identity of the robot that reserved it for its load, or NIL
    access: Array  # (s, 4) int32: drivable neighbours E, S, W, N, or NIL; a station: itself
    accessible: Array  # (K, s) uint8: 1 = robots of type k get to an access cell of the slot
    first_spare: int  # the first spare slot, or s
    reachable: Array  # (K, C) uint8: 1 = robots of type k get there and back home


class Chargers(Struct):
    """Cells where robots charge; k of them."""

    cell: Array  # (k,) int32
    charger_at: Array  # (C,) int32: the charger in a cell, or NIL
    exit_cell: Array  # (k,) int32: scratch: the cell into which its holder wants to move, or NIL
    first_ticket: Array  # (k,) int64: scratch: the lowest ticket at its door


class Stations(Struct):
    """Stations that process parts: k of them, one part at a time each, first in, first out; j jobs.

    A job is one part at one station.
    """

    at: Array  # (s,) int32: the station that a slot is, or NIL
    slot: Array  # (k,) int32
    in_service: Array  # (k,) int32: the job under way, or NIL
    queue_tail: Array  # (k,) int32: the job at the end of the queue, or NIL
    job_done_tick: Array  # (k,) int64: tick in which the job under way is done
    part_arrivals: Array  # (p,) int32: the jobs with which parts begin, by tick
    station: Array  # (j,) int32
    processing_time: Array  # (j,) int32: how long it takes
    part: Array  # (j,) int32: the part's number
    releases_order: Array  # (j,) int32: the order that is released when it is done; NIL: none
    next_in_queue: Array  # (j,) int32: the next job in the queue, or NIL
    arrival_tick: Array  # (j,) int32: tick in which the part came, or comes; NIL: unknown
    completion_tick: Array  # (j,) int32: tick in which it was done, or NIL
    job_of_order: Array  # (m,) int32: the job that begins when an order is delivered, or NIL
