"""Least ticks of a drive on the empty floor, turns included, without compiled code.

A pose is a cell with a heading: pose = cell * headings + heading. Storage is left and entered, but a
robot with a load is led through none.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.floor.cells import STORAGE
from automaton.floor.floor_plan import FloorPlan, may_turn
from automaton.floor.reachability import backward_exits

NO_WAY: Final = 2**30
Ticks = npt.NDArray[np.int64]


class Driving(NamedTuple):
    """How robots drive."""

    headings: int  # distinguished: 1 omni, 2 rail, 4 differential
    move: int  # ticks
    turn: int
    rail: bool = False  # they turn on turntables alone
    loaded: bool = False  # they pass through no storage


def ticks_between(
    floor_plan: FloorPlan,
    driving: Driving,
    cell: int,
    backwards: bool,
    heading_there: int | None = None,
) -> Ticks:
    """(cells, headings) ticks to a cell, or, not `backwards`, from there; or NO_WAY.

    With this heading there, or in any.
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
            # Backwards the bit names the side from which one comes, against the heading.
            travels = (direction ^ 2 if backwards else direction) % headings
            goes = on & (exits[at] >> np.uint8(direction) & 1 != 0) & (heading == travels)
            # Backwards the move begins in the cell to which the search goes on.
            before, way = (at + offset, direction ^ 2) if backwards else (at, direction)
            ticks = move_ticks(floor_plan, driving, before, way)
            for each in np.unique(ticks[goes]).tolist():
                _add(waiting, now + each, poses[goes & (ticks == each)] + offset * headings)
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
