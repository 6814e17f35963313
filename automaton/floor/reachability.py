"""Which cells robots can reach on an empty floor, and slots grouped by them as stations."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.floor.cells import (
    ABOVE_OR_BELOW,
    CELL_KINDS,
    EAST,
    NIL,
    NORTH,
    ON_IT,
    RACK,
    SOUTH,
    WEST,
)
from automaton.floor.floor_plan import Cells, FloorPlan, may_turn

Mask = npt.NDArray[np.bool_]  # (cells,) flat


@lru_cache(maxsize=64)
def backward_exits(floor_plan: FloorPlan) -> npt.NDArray[np.uint8]:
    """(cells,) flat: bit d is set where a robot may come from the neighbour in direction d."""
    exits = floor_plan.exits.reshape(-1)
    back = np.zeros_like(exits)
    for direction, offset in enumerate(floor_plan.offsets):
        leaves = np.roll(exits, -offset) >> np.uint8(direction ^ 2) & np.uint8(1)
        back |= leaves << np.uint8(direction)
    return back


def reached(
    floor_plan: FloorPlan, starts: Iterable[int], rail: bool, backwards: bool = False
) -> Mask:
    """The cells reachable from any of the starts over the exits, or from which one is reachable.

    Robots on rails change their axis on turntables only; they may start along either axis.
    """
    first = sorted(set(starts))
    either: Mask = np.logical_or.reduce(reached_along(floor_plan, (first, first), rail, backwards))
    return either


def reached_along(
    floor_plan: FloorPlan,
    starts: tuple[Sequence[int], Sequence[int]],
    rail: bool,
    backwards: bool = False,
) -> npt.NDArray[np.bool_]:
    """(2, cells) as `reached`, by the axis of travel; `starts`: where robots begin along each axis."""
    exits = backward_exits(floor_plan) if backwards else floor_plan.exits.reshape(-1)
    turns = may_turn(floor_plan.kind.reshape(-1), rail)
    offsets = floor_plan.offsets
    seen = np.zeros((2, exits.size), np.bool_)
    front = [np.array(sorted(set(first)), np.int64) for first in starts]
    for axis in (0, 1):
        seen[axis, front[axis]] = True
    while front[0].size or front[1].size:
        following = []
        for axis in (0, 1):
            cells, across = front[axis], front[1 - axis]
            ahead = [cells[exits[cells] >> d & 1 != 0] + offsets[d] for d in (axis, axis + 2)]
            new = np.sort(np.concatenate([*ahead, across[turns[across]]]))
            is_first = np.diff(new, prepend=-1) > 0
            following.append(new[is_first & ~seen[axis, new]])
        for axis in (0, 1):
            seen[axis, following[axis]] = True
        front = following
    return seen


def closed_step(
    floor_plan: FloorPlan, starts: Iterable[int], goals: Iterable[int]
) -> tuple[int, int, int] | None:
    """The first step that is closed on a way with as few of them as there can be: from, to, direction.

    The way leads over cells that robots drive on; None if there is none, or nothing is closed on it.
    """
    exits, drivable = (
        floor_plan.exits.reshape(-1).tolist(),
        floor_plan.drivable.reshape(-1).tolist(),
    )
    offsets = tuple(enumerate(floor_plan.offsets))
    closed_first: dict[int, tuple[int, int, int] | None] = dict.fromkeys(starts)
    wanted, done = set(goals), set()
    front = deque(closed_first)
    while front:
        cell = front.popleft()
        if cell in wanted:
            return closed_first[cell]
        if cell in done:
            continue
        done.add(cell)
        for direction, offset in offsets:
            to, is_open = cell + offset, exits[cell] >> direction & 1
            if not drivable[to] or to in done or (to in closed_first and not is_open):
                continue
            closed_first[to] = closed_first[cell] or (None if is_open else (cell, to, direction))
            (front.appendleft if is_open else front.append)(to)
    return None


def steps_from(
    floor_plan: FloorPlan, starts: Iterable[int], backwards: bool = False
) -> npt.NDArray[np.int32]:
    """(cells,) moves from the nearest start to each cell, or from there to it; NIL: no way.

    Turns are free here, so no robot needs fewer moves.
    """
    exits = backward_exits(floor_plan) if backwards else floor_plan.exits.reshape(-1)
    front = np.array(sorted(set(starts)), np.int64)
    found = np.full(exits.size, NIL, np.int32)
    moves = 0
    while front.size:
        found[front] = moves
        moves += 1
        offsets = enumerate(floor_plan.offsets)
        ahead = [front[exits[front] >> d & 1 != 0] + offset for d, offset in offsets]
        front = np.unique(np.concatenate(ahead))
        front = front[found[front] == NIL]
    return found


STANDS: Final = np.array([kind.stand for kind in CELL_KINDS])  # (kinds,) str


@lru_cache(maxsize=16)
def slot_access(floor_plan: FloorPlan) -> npt.NDArray[np.int32]:
    """(s, 4) the cells east, south, west and north from which each slot is served, or NIL.

    A slot that robots drive onto has itself as its only cell.
    """
    cells, drivable = floor_plan.slots.astype(np.int64), floor_plan.drivable.reshape(-1)
    around = cells[:, None] + np.array(floor_plan.offsets)
    inside = (around >= 0) & (around < drivable.size)
    around = np.where(inside, around, 0)
    access = np.where(inside & drivable[around], around, NIL).astype(np.int32)
    stand = STANDS[floor_plan.kind.reshape(-1)[cells]]
    access[np.ix_(stand == ABOVE_OR_BELOW, [EAST, WEST])] = NIL
    entered = stand == ON_IT
    access[entered] = NIL
    access[entered, EAST] = cells[entered]
    access.setflags(write=False)
    return access


def rack_stands(floor_plan: FloorPlan) -> Cells:
    """A cell in front of each rack that has one, above it if there is one, in table order."""
    racks = slot_access(floor_plan)[floor_plan.kind.reshape(-1)[floor_plan.slots] == RACK]
    stands = np.where(racks[:, NORTH] != NIL, racks[:, NORTH], racks[:, SOUTH])
    found: Cells = stands[stands != NIL]
    return found


def slots_beside(floor_plan: FloorPlan, mask: Mask) -> Cells:
    """Flat cells of the slots that are served from cells of the mask alone, in table order."""
    slots = floor_plan.slots
    around = [mask[slots + offset] for offset in floor_plan.offsets]
    entered = STANDS[floor_plan.kind.reshape(-1)[slots]] == ON_IT
    beside: Cells = slots[np.where(entered, mask[slots], np.logical_and.reduce(around))]
    return beside


@lru_cache(maxsize=8)
def grouped(floor_plan: FloorPlan, most: int) -> tuple[Cells, Cells]:
    """Slots grouped as stations: cells of the stations, and the station of each slot or NIL.

    The stations stand where slots are served from, far from each other: the first slot's cell, then
    again and again the cell that is farthest from all so far. A slot counts to the nearest station.
    """
    access = slot_access(floor_plan)
    stand = access.max(axis=1)
    served = np.flatnonzero(stand != NIL)
    chosen: list[int] = []
    best = np.full(len(served), np.iinfo(np.int32).max, np.int64)
    group = np.full(len(access), NIL, np.int32)
    while len(chosen) < most and len(served) and best.max() > 0:
        cell = int(stand[served[0 if not chosen else int(np.argmax(best))]])
        steps = steps_from(floor_plan, [cell])[stand[served]].astype(np.int64)
        steps[steps == NIL] = np.iinfo(np.int32).max
        nearer = steps < best
        best[nearer] = steps[nearer]
        group[served[nearer]] = len(chosen)
        chosen.append(cell)
    return np.array(chosen, np.int32), group
