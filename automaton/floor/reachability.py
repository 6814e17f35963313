"""Reachability on an empty floor: cells, ticks, and dead ends, where two robots cannot pass each other.

Robots with a load drive into storage and out of it, but not through it. A pose is a cell with a heading:
pose = cell * headings + heading.

A dead end is a part of the floor with one way out in which two robots cannot pass each other. To find
dead ends, cells with one neighbour are peeled off until none is left; each connected part of peeled
cells is a dead end. A floor that peels away completely (a tree of tracks) has none: no rule about dead
ends would let robots through. Nothing here is compiled.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.floor.floor_plan import (
    ABOVE_OR_BELOW,
    CELL_KINDS,
    EAST,
    NIL,
    NORTH,
    ON_IT,
    RACK,
    SOUTH,
    STORAGE,
    WEST,
    Cells,
    FloorPlan,
    may_turn,
)

Mask = npt.NDArray[np.bool_]  # (cells,) flat

STANDS: Final = np.array([kind.stand for kind in CELL_KINDS])  # (kinds,) str
NO_WAY: Final = 2**30
Ticks = npt.NDArray[np.int64]
Numbers = npt.NDArray[Any]
NO_WAY_OUT: Final = 4


@lru_cache(maxsize=64)
def backward_exits(floor_plan: FloorPlan) -> npt.NDArray[np.uint8]:
    """(cells,) flat: bit d is set if a robot may come from the neighbour in direction d."""
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
    """(2, cells) as `reached`, by axis of travel; `starts`: start cells along each axis."""
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
    """The first closed step on a way with the fewest closed steps: from, to, direction.

    The way leads over drivable cells; None without a way, or if nothing is closed on it.
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
    """(cells,) moves from the nearest start to each cell, or backwards; NIL: no way.

    Turns are free here, so this is a lower bound on moves.
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


@lru_cache(maxsize=16)
def slot_access(floor_plan: FloorPlan) -> npt.NDArray[np.int32]:
    """(s, 4) the cells east, south, west and north from which each slot is served, or NIL.

    For a slot that robots drive onto, its own cell is the only one.
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
    """A drivable cell in front of each rack that has one, preferably above it, in table order."""
    racks = slot_access(floor_plan)[floor_plan.kind.reshape(-1)[floor_plan.slots] == RACK]
    stands = np.where(racks[:, NORTH] != NIL, racks[:, NORTH], racks[:, SOUTH])
    found: Cells = stands[stands != NIL]
    return found


def slots_beside(floor_plan: FloorPlan, mask: Mask) -> Cells:
    """Flat cells of the slots that are served only from cells of the mask, in table order."""
    slots = floor_plan.slots
    around = [mask[slots + offset] for offset in floor_plan.offsets]
    entered = STANDS[floor_plan.kind.reshape(-1)[slots]] == ON_IT
    beside: Cells = slots[np.where(entered, mask[slots], np.logical_and.reduce(around))]
    return beside


@lru_cache(maxsize=8)
def grouped(floor_plan: FloorPlan, most: int) -> tuple[Cells, Cells]:
    """Slots grouped as stations: cells of the stations, and the station of each slot or NIL.

    Stations are cells that serve slots, far from each other: the first slot's cell, then repeatedly the
    cell farthest from all previous ones. A slot belongs to the nearest station.
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


# With a load.


def has_storage(floor_plan: FloorPlan) -> bool:
    """Whether the floor has cells through which loads are not carried."""
    return bool((floor_plan.kind == STORAGE).any())


@lru_cache(maxsize=64)
def to_and_from(floor_plan: FloorPlan, cell: int, rail: bool) -> Mask:
    """(cells,) the cells from which a robot reaches a cell, not through storage, and to which it
    returns.

    A robot that begins in storage leaves it first.
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

    Off rails the result is the same for each of its cells. So each part of a floor is searched once for
    all runs. On rails a turntable decides: a cell that a robot reaches only along the axis in which it
    cannot leave a row of straight tracks does not belong to the part.
    """
    if rail:
        mask = _there_and_back(floor_plan, cell, rail)
        turntables = np.flatnonzero(mask & may_turn(floor_plan.kind.reshape(-1), rail))
        part = _there_and_back(floor_plan, int(turntables[0]), rail) if turntables.size else mask
        return part if part[cell] else mask
    part_of = _part_of(floor_plan)
    if part_of[cell] == NIL:
        part_of[_there_and_back(floor_plan, cell, rail)] = cell
    same: Mask = part_of == part_of[cell]
    return same


def _there_and_back(floor_plan: FloorPlan, cell: int, rail: bool) -> Mask:
    """(cells,) the cells that a robot reaches from a cell, and from which it reaches that cell."""
    there, back = (reached(floor_plan, [cell], rail, backwards) for backwards in (False, True))
    return there & back


@lru_cache(maxsize=64)
def _part_of(floor_plan: FloorPlan) -> npt.NDArray[np.int64]:
    """(cells,) the cell from which the part of each was searched; NIL: not yet. Callers update it."""
    return np.full(floor_plan.kind.size, NIL)


def _aisles_beside(
    floor_plan: FloorPlan, cell: int, sides: npt.NDArray[np.uint8]
) -> tuple[list[int], list[int]]:
    """By axis: the cell itself outside storage; in storage, its neighbours over these sides."""
    storage = floor_plan.kind.reshape(-1) == STORAGE
    if not storage[cell]:
        return [cell], [cell]
    beside: tuple[list[int], list[int]] = ([], [])
    for direction, offset in enumerate(floor_plan.offsets):
        if sides[cell] >> direction & 1 and not storage[cell + offset]:
            beside[direction % 2].append(cell + offset)
    return beside


# Least ticks of a drive, turns included.


class Driving(NamedTuple):
    """The driving of robots."""

    headings: int  # distinguished: 1 omni, 2 rail, 4 differential
    move: int  # ticks
    turn: int
    rail: bool = False  # they turn only on turntables
    loaded: bool = False  # they do not pass through storage


def ticks_between(
    floor_plan: FloorPlan,
    driving: Driving,
    cell: int,
    backwards: bool,
    heading_there: int | None = None,
) -> Ticks:
    """(cells, headings) ticks to a cell if `backwards`, else from it; or NO_WAY.

    With this heading in the cell, or with any.
    """
    headings, cells = driving.headings, floor_plan.kind.size
    kind = floor_plan.kind.reshape(-1)
    exits = backward_exits(floor_plan) if backwards else floor_plan.exits.reshape(-1)
    turns = may_turn(kind, driving.rail)
    through = np.ones(cells, np.bool_) if not driving.loaded else kind != STORAGE
    through[cell] = True
    result = np.full(cells * headings, NO_WAY, np.int64)
    waiting: dict[int, list[npt.NDArray[np.int64]]] = {
        0: [cell * headings + np.arange(headings, dtype=np.int64)]
    }
    if heading_there is not None:
        waiting[0] = [np.array([cell * headings + heading_there], np.int64)]
    while waiting:
        now = min(waiting)
        poses = np.unique(np.concatenate(waiting.pop(now)))
        poses = poses[result[poses] > now]
        result[poses] = now
        at, heading = poses // headings, poses % headings
        on = through[at]
        for direction, offset in enumerate(floor_plan.offsets):
            # Backwards, the bit names the side from which the robot comes, opposite to the heading.
            travels = (direction ^ 2 if backwards else direction) % headings
            goes = on & (exits[at] >> np.uint8(direction) & 1 != 0) & (heading == travels)
            further = poses[goes] + offset * headings
            if not len(floor_plan.min_move_ticks):
                _add(waiting, now + driving.move, further)
                continue
            # Backwards, the move begins in the next cell of the search.
            before, way = (at + offset, direction ^ 2) if backwards else (at, direction)
            ticks = move_ticks(floor_plan, driving, before[goes], way)
            for each in np.unique(ticks).tolist():
                _add(waiting, now + each, further[ticks == each])
        if headings > 1:
            base = poses[turns[at]]
            for way in (1, headings - 1):
                turned = base - base % headings + (base % headings + way) % headings
                _add(waiting, now + driving.turn, turned)
    return result.reshape(cells, headings)


def move_ticks(floor_plan: FloorPlan, driving: Driving, cells: Ticks, direction: int) -> Ticks:
    """Ticks of moves out of some cells in a direction."""
    ticks = np.full(len(cells), driving.move, np.int64)
    if len(floor_plan.min_move_ticks):
        np.maximum(ticks, floor_plan.min_move_ticks[cells, direction], out=ticks)
    return ticks


def _add(
    waiting: dict[int, list[npt.NDArray[np.int64]]], ticks: int, poses: npt.NDArray[np.int64]
) -> None:
    if poses.size:
        waiting.setdefault(ticks, []).append(poses)


# Dead ends.


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

    `offsets`: (4,) from a cell to its neighbours. Cells for several robots belong to no dead end: robots
    pass each other there.
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
            continue  # the way out continues in the dead end
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
    """The dead ends of all types of robots; `exits`: (k, C) uint8, by type, without closed areas.

    A dead end for one type counts for all types. If two overlap, the one that contains the other
    remains, else the one of the earlier type.
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
    """Enter a number in all peeled cells that are connected with a cell."""
    reached, waiting = {first}, [first]
    while waiting:
        cell = waiting.pop()
        number[cell] = value
        for neighbour in neighbours[cell].tolist():
            if neighbour != NIL and peeled[neighbour] and neighbour not in reached:
                reached.add(neighbour)
                waiting.append(neighbour)
