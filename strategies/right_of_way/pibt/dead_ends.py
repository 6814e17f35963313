"""Dead ends: parts of a floor in which two robots cannot pass each other, and that have one way out.

Cells with at most one neighbour are peeled off until none is left; what was peeled off and hangs
together is one dead end. A floor that peels away whole (a tree of tracks) has none: no rule about
them would let robots through.
"""

from __future__ import annotations

import numpy as np

from automaton.engine.state import NIL, Array, Grid

NO_WAY_OUT = 4


def dead_ends(grid: Grid) -> tuple[Array, Array, int]:
    """(C,) int32 the dead end of each cell or NIL, (C,) uint8 the direction out of it, their number.

    Cells for several robots are in none: robots pass each other there.
    """
    flags = grid.cell_flags.astype(np.int64)
    cells, single = len(flags), flags >> 5 & 3 == 1
    offsets = [int(offset) for offset in grid.offset]
    neighbours = _neighbours(flags, offsets)
    degree = (neighbours != NIL).sum(axis=1)
    out = np.full(cells, NO_WAY_OUT, np.uint8)
    peeled = np.zeros(cells, bool)
    waiting = np.flatnonzero(single & (degree == 1)).tolist()
    while waiting:
        cell = waiting.pop()
        if peeled[cell] or degree[cell] != 1:
            continue
        peeled[cell] = True
        for direction, neighbour in enumerate(neighbours[cell].tolist()):
            if neighbour != NIL and not peeled[neighbour]:
                out[cell] = direction
                degree[neighbour] -= 1
                if single[neighbour] and degree[neighbour] == 1:
                    waiting.append(neighbour)
    number, count = np.full(cells, NIL, np.int32), 0
    for mouth in np.flatnonzero(peeled).tolist():
        beyond = mouth + offsets[out[mouth]]
        if peeled[beyond] or degree[beyond] == 0:
            continue  # the way out leads on through the dead end, or all has peeled away
        _enter(number, mouth, count, peeled, neighbours)
        count += 1
    return number, np.where(number == NIL, NO_WAY_OUT, out).astype(np.uint8), count


def _neighbours(flags: Array, offsets: list[int]) -> Array:
    """(C, 4) int64: the cells beside each one to or from which robots drive, or NIL."""
    cells = len(flags)
    out = np.full((cells, 4), NIL, np.int64)
    for direction, offset in enumerate(offsets):
        leaving = np.flatnonzero(flags >> direction & 1)
        out[leaving, direction] = leaving + offset
        out[leaving + offset, direction ^ 2] = leaving
    return out


def _enter(number: Array, first: int, value: int, peeled: Array, neighbours: Array) -> None:
    """Enter a number in all peeled cells that hang together with a cell."""
    reached, waiting = {first}, [first]
    while waiting:
        cell = waiting.pop()
        number[cell] = value
        for neighbour in neighbours[cell].tolist():
            if neighbour != NIL and peeled[neighbour] and neighbour not in reached:
                reached.add(neighbour)
                waiting.append(neighbour)
