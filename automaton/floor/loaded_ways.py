"""Where robots with a load get on a floor with storage: into and out of it, never through."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from automaton.floor.cells import NIL, STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.reachability import Mask, backward_exits, reached, reached_along


def has_storage(floor_plan: FloorPlan) -> bool:
    """Whether the floor has cells through which loads are not carried."""
    return bool((floor_plan.kind == STORAGE).any())


@lru_cache(maxsize=64)
def to_and_from(floor_plan: FloorPlan, cell: int, rail: bool) -> Mask:
    """(cells,) those from which a robot gets to a cell, through no storage, and to which it comes back.

    One that begins in storage leaves it first.
    """
    storage = floor_plan.kind == STORAGE
    if not storage.any():
        return _in_both_directions(floor_plan, cell, rail)
    flat = storage.reshape(-1)
    into = np.zeros_like(floor_plan.exits)  # exits that lead into storage
    for direction, offset in enumerate(floor_plan.offsets):
        ahead = np.roll(flat, -offset).reshape(storage.shape)
        into |= np.where(ahead, np.uint8(1 << direction), np.uint8(0)).astype(np.uint8)
    aisles = floor_plan.with_exits(np.where(storage, 0, floor_plan.exits & ~into).astype(np.uint8))
    exits, entries = floor_plan.exits.reshape(-1), backward_exits(floor_plan)
    from_it = reached_along(aisles, _aisles_beside(floor_plan, cell, exits), rail)
    to_it = reached_along(aisles, _aisles_beside(floor_plan, cell, entries), rail, backwards=True)
    leaves, enters = (np.zeros(flat.size, np.bool_) for _ in range(2))
    for direction, offset in enumerate(floor_plan.offsets):
        bit, axis = np.uint8(1 << direction), direction % 2
        leaves |= (exits & bit != 0) & np.roll(to_it[axis] & ~flat, -offset)
        enters |= (entries & bit != 0) & np.roll(from_it[axis] & ~flat, -offset)
    mask: Mask = np.where(flat, leaves & enters, from_it.any(axis=0) & to_it.any(axis=0))
    mask.setflags(write=False)
    return mask


def _in_both_directions(floor_plan: FloorPlan, cell: int, rail: bool) -> Mask:
    """As `to_and_from`, on a floor without storage.

    Off rails this is the same from each cell within it. So each part of a floor is searched once,
    wherever the robots of a run begin.
    """
    part_of = np.full(floor_plan.kind.size, NIL) if rail else _part_of(floor_plan)
    if part_of[cell] == NIL:
        ways = (reached(floor_plan, [cell], rail, backwards) for backwards in (False, True))
        part_of[np.logical_and(*ways)] = cell
    mask: Mask = part_of == part_of[cell]
    return mask


@lru_cache(maxsize=64)
def _part_of(floor_plan: FloorPlan) -> npt.NDArray[np.int64]:
    """(cells,) from which cell the part of each was searched; NIL: not yet, which is noted here."""
    return np.full(floor_plan.kind.size, NIL)


def _aisles_beside(
    floor_plan: FloorPlan, cell: int, sides: npt.NDArray[np.uint8]
) -> tuple[list[int], list[int]]:
    """By axis: a cell outside storage itself; of one in storage those beside it, over these sides."""
    storage = floor_plan.kind.reshape(-1) == STORAGE
    if not storage[cell]:
        return [cell], [cell]
    beside: tuple[list[int], list[int]] = ([], [])
    for direction, offset in enumerate(floor_plan.offsets):
        if sides[cell] >> direction & 1 and not storage[cell + offset]:
            beside[direction % 2].append(cell + offset)
    return beside
