"""Dead ends: parts of a floor in which two robots cannot pass each other, and that have one way out.

Cells with at most one neighbour are peeled off until none is left; what was peeled off and hangs
together is one dead end. A floor that peels away whole (a tree of tracks) has none: no rule about
them would let robots through.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.floor.cells import NIL
from automaton.floor.floor_plan import FloorPlan

Numbers = npt.NDArray[Any]

NO_WAY_OUT: Final = 4


class DeadEnds(NamedTuple):
    """The dead ends of a floor of C cells."""

    number: Numbers  # (C,) int32: the dead end of a cell, or NIL
    way_out: Numbers  # (C,) uint8: the direction out of it, or NO_WAY_OUT
    depth: Numbers  # (C,) int32: moves out of it, 0 outside
    total: int
    ringless: Numbers  # (C,) bool: in a part of the floor without a ring, where robots cannot pass


def dead_ends_of(floor_plan: FloorPlan) -> DeadEnds:
    """The dead ends of a floor as drawn."""
    single = floor_plan.capacity.reshape(-1) == 1
    return dead_ends(floor_plan.exits.reshape(-1), single, floor_plan.offsets)


def dead_ends(exits: Numbers, single: Numbers, offsets: Any) -> DeadEnds:
    """Find dead ends; `exits`: (C,) uint8, bits by direction; `single`: (C,) bool, cells for one robot.

    `offsets`: (4,) from a cell to its neighbours. Cells for several robots are in none: robots pass
    each other there.
    """
    steps = [int(offset) for offset in offsets]
    neighbours = _neighbours(exits, steps)
    degree = (neighbours != NIL).sum(axis=1)
    way_out = np.full(len(exits), NO_WAY_OUT, np.uint8)
    peeled = np.zeros(len(exits), bool)
    waiting = np.flatnonzero(single & (degree == 1)).tolist()
    while waiting:
        cell = waiting.pop()
        if peeled[cell] or degree[cell] != 1:
            continue
        peeled[cell] = True
        for direction, neighbour in enumerate(neighbours[cell].tolist()):
            if neighbour != NIL and not peeled[neighbour]:
                way_out[cell] = direction
                degree[neighbour] -= 1
                if single[neighbour] and degree[neighbour] == 1:
                    waiting.append(neighbour)
    number, total = np.full(len(exits), NIL, np.int32), 0
    ringless = np.zeros(len(exits), bool)
    for mouth in np.flatnonzero(peeled).tolist():
        beyond = mouth + steps[way_out[mouth]]
        if peeled[beyond]:
            continue  # the way out leads on through the dead end
        if degree[beyond] == 0 and single[beyond]:
            ringless[beyond] = True
            continue
        _enter(number, mouth, total, peeled, neighbours)
        total += 1
    way_out[number == NIL] = NO_WAY_OUT
    ringless |= peeled & (number == NIL)
    return DeadEnds(number, way_out, _depths(number, way_out, steps), total, ringless)


def _depths(number: Numbers, way_out: Numbers, steps: list[int]) -> Numbers:
    """(C,) int32: moves out of the dead end that a cell belongs to."""
    depth = np.zeros(len(number), np.int32)
    for first in np.flatnonzero(number != NIL).tolist():
        passed, cell = [], first
        while number[cell] == number[first] and depth[cell] == 0:
            passed.append(cell)
            cell += steps[way_out[cell]]
        beyond = depth[cell] if number[cell] == number[first] else 0
        for place, one in enumerate(reversed(passed)):
            depth[one] = beyond + 1 + place
    return depth


def dead_ends_of_types(exits: Numbers, single: Numbers, offsets: Any) -> DeadEnds:
    """The dead ends of all types of robots; `exits`: (k, C) uint8, by type, less closed areas.

    A cell that is in a dead end for one type counts as in one for all. Of two that overlap the one
    that holds the other remains, or the one of the earlier type.
    """
    union, *others = (dead_ends(of_type, single, offsets) for of_type in exits)
    number, way_out = union.number, union.way_out
    for ends in others:
        for one in range(ends.total):
            inside = ends.number == one
            met = np.unique(number[inside & (number != NIL)])
            if not inside[np.isin(number, met)].all():
                continue
            number[inside] = met[0] if len(met) else number.max() + 1
            way_out[inside] = ends.way_out[inside]
    _, dense = np.unique(number[number != NIL], return_inverse=True)
    number[number != NIL] = dense
    total = int(number.max(initial=NIL)) + 1
    depth = _depths(number, way_out, [int(offset) for offset in offsets])
    return DeadEnds(number, way_out, depth, total, union.ringless)


def _neighbours(exits: Numbers, steps: list[int]) -> Numbers:
    """(C, 4) int64: the cells beside each one to or from which robots drive, or NIL."""
    out = np.full((len(exits), 4), NIL, np.int64)
    for direction, step in enumerate(steps):
        leaving = np.flatnonzero(exits >> direction & 1)
        out[leaving, direction] = leaving + step
        out[leaving + step, direction ^ 2] = leaving
    return out


def _enter(number: Numbers, first: int, value: int, peeled: Numbers, neighbours: Numbers) -> None:
    """Enter a number in all peeled cells that hang together with a cell."""
    reached, waiting = {first}, [first]
    while waiting:
        cell = waiting.pop()
        number[cell] = value
        for neighbour in neighbours[cell].tolist():
            if neighbour != NIL and peeled[neighbour] and neighbour not in reached:
                reached.add(neighbour)
                waiting.append(neighbour)
