"""Zones of a floor: the straight stretches between its intersections (Bhattathiri, Li & Kuhl).

#######    Two cells are neighbours when a robot may drive from one to the other. A cell with
#a+bbb#    a horizontal and a vertical neighbour is an intersection (+). A segment is a longest
#.c#.##    straight run of other cells, dead ends included: here a, b and c, numbered in reading
#######    order of their first cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from automaton.floor.cells import EAST, NIL, NORTH, SOUTH, WEST
from automaton.floor.floor_plan import FloorPlan

Mask = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.int32]

MODES = ("undirected", "directed", "with-intersections")


@dataclass(frozen=True, eq=False)
class TrafficZones:
    """The zones of a floor; arrays are read-only, C counts the border too."""

    mode: str  # of MODES
    of: Numbers  # (C, 2) zone of a robot in a flat cell that travels in direction d: of[c, d >> 1]
    count: int
    intersection: Mask  # (C,)


@lru_cache(maxsize=16)
def traffic_zones_of(floor_plan: FloorPlan, mode: str = "undirected") -> TrafficZones:
    """The zones of a floor, NIL in cells that are part of none.

    undirected: one zone for each segment, intersections are none. directed: two for each segment,
    east and south first. with-intersections: each intersection is a zone of its own, after the
    segments. Raises ValueError for another mode.
    """
    if mode not in MODES:
        raise ValueError(f"no mode of zones is called {mode!r}; there are {', '.join(MODES)}")
    beside, below = links(floor_plan)
    horizontal = beside | np.roll(beside, 1, 1)
    vertical = below | np.roll(below, 1, 0)
    intersection = horizontal & vertical
    segment, count = segments(floor_plan.drivable, beside, below, intersection)
    of = np.repeat(segment.reshape(-1, 1), 2, axis=1)
    if mode == "directed":
        of = np.where(of == NIL, NIL, 2 * of + np.arange(2, dtype=np.int32)).astype(np.int32)
        count *= 2
    elif mode == "with-intersections":
        crossings = np.flatnonzero(intersection)
        of[crossings] = count + np.arange(len(crossings), dtype=np.int32)[:, None]
        count += len(crossings)
    flat = intersection.reshape(-1)
    of.setflags(write=False)
    flat.setflags(write=False)
    return TrafficZones(mode, of, count, flat)


def links(floor_plan: FloorPlan) -> tuple[Mask, Mask]:
    """(height + 2, width + 2) each: a way leads between a cell and its east, its south neighbour."""

    def leads(direction: int) -> Mask:
        mask: Mask = floor_plan.exits >> np.uint8(direction) & np.uint8(1) != 0
        return mask

    # np.roll wraps round, but only through the border, which has no exits.
    beside = leads(EAST) | np.roll(leads(WEST), -1, 1)
    below = leads(SOUTH) | np.roll(leads(NORTH), -1, 0)
    return beside, below


def segments(drivable: Mask, beside: Mask, below: Mask, intersection: Mask) -> tuple[Numbers, int]:
    """The segment of each cell or NIL, shaped like the masks, and how many there are."""
    part = drivable & ~intersection
    follows_left = part & np.roll(beside & ~intersection, 1, 1)
    follows_above = part & np.roll(below & ~intersection, 1, 0)
    first = part & ~follows_left & ~follows_above
    number = np.full(drivable.shape, NIL, np.int32)
    number[first] = np.arange(np.count_nonzero(first), dtype=np.int32)
    across = _carried(number, part, follows_left)
    down = _carried(number.T, part.T, follows_above.T).T
    return np.maximum(across, down), int(np.count_nonzero(first))


def _carried(number: Numbers, part: Mask, follows: Mask) -> Numbers:
    """Each number carried along its row over the cells that follow on it."""
    follow = follows[part]
    # What a cell of a segment follows comes right before it, so that the list falls into runs.
    begin = np.maximum.accumulate(np.where(follow, 0, np.arange(len(follow))))
    carried = np.full(number.shape, NIL, np.int32)
    carried[part] = number[part][begin]
    return carried
