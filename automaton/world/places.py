"""The floor, and what stands on it: slots for loads, stations that work on parts, chargers.

C cells with the border, s slots, m orders, K types of robots. NIL (-1) means none.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from automaton.struct import Struct

Array = NDArray[Any]


class Grid(Struct):
    """The floor, static; flat index c = y * width + x, one cell of border wall all round."""

    width: int  # cells in a row, border included
    headings: int  # distinguished headings: 1 omni, 2 rail (axes), 4 differential
    kind: Array  # (C,) uint8, automaton.world.cells
    rule: (
        Array  # (C,) uint8: bits 0-3 exits E S W N, bit 4 may turn, bits 5-6 capacity (0 unlimited)
    )
    ways: Array  # (K, C) uint8: the rule for robots of type k, with the exits that it may take
    offset: Array  # (4,) int64: from a cell to its neighbour E, S, W, N
    slot: Array  # (C,) int32: the slot in this cell, or NIL
    zone: Array  # (C, 2) int32: zone of a robot that travels in direction d: [c, d >> 1], or NIL
    zones: int  # how many there are (automaton.world.zones)


class Slots(Struct):
    """Cells that hold loads: shelves one each; destinations, racks, docks and stations any number.

    Where robots may fail, the last n are spare ones: a load that a robot had to leave lies in one.
    """

    cell: Array  # (s,) int32; NIL: a spare one without a load
    endless: Array  # (s,) uint8: 1 = any number of loads: no shelf
    content: Array  # (s,) int32: the order on a shelf, or NIL
    by: Array  # (s,) int32: identity of the robot that reserved it for its load, or NIL
    access: Array  # (s, 4) int32: drivable neighbours E, S, W, N, or NIL; a station: itself
    serves: Array  # (K, s) uint8: 1 = robots of type k get to a cell from which the slot is served
    spare: int  # the first spare slot, or s
    within: Array  # (K, C) uint8: 1 = robots of type k get there and back home


class Chargers(Struct):
    """Cells where robots charge; k of them."""

    cell: Array  # (k,) int32
    at: Array  # (C,) int32: the charger in a cell, or NIL
    way_out: Array  # (k,) int32: scratch: the cell into which its holder wants to move, or NIL
    first: Array  # (k,) int64: scratch: the lowest ticket at its door


class Stations(Struct):
    """Work on parts: k stations, one part at a time each, in the sequence of their coming; j works.

    A work is what one station does to one part.
    """

    at: Array  # (s,) int32: the station that a slot is, or NIL
    slot: Array  # (k,) int32
    first: Array  # (k,) int32: the work under way, or NIL
    last: Array  # (k,) int32: the work at the end of the line, or NIL
    until: Array  # (k,) int64: tick in which the work under way is done
    entering: Array  # (p,) int32: the works with which parts begin, by tick
    station: Array  # (j,) int32
    ticks: Array  # (j,) int32: how long it takes
    part: Array  # (j,) int32: the part's number
    frees: (
        Array  # (j,) int32: the order that becomes known when it is done; NIL: the part is finished
    )
    behind: Array  # (j,) int32: the next work in the line, or NIL
    came: Array  # (j,) int32: tick in which the part came, or comes; NIL: unknown
    done: Array  # (j,) int32: tick in which it was done, or NIL
    arrives: Array  # (m,) int32: the work that begins when an order is delivered, or NIL
