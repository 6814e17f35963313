"""Traffic zones of a floor, and its roads: the straight stretches between crossings.

    #######    Two cells are neighbours when a robot may drive from one to the other. A cell with
    #a+bbb#    a horizontal and a vertical neighbour is an intersection (+). A segment is a longest
    #.c#.##    straight run of other cells, dead ends included: here a, b and c, numbered in reading
    #######    order of their first cells.

A critical point of the roads is a station, or a drivable cell whose links to other cells are not exactly
two opposite ones: a crossing, a corner or a dead end. Points are numbered in reading order.

Source of the zones: Bhattathiri, Li & Kuhl.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.floor.floor_plan import (
    DIRECTION_VECTORS,
    EAST,
    NIL,
    NORTH,
    SOUTH,
    WEST,
    FloorPlan,
)

Mask = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.int32]

ZONE_MODES = ("undirected", "directed", "with-intersections")

MAX_ZONE_POINTS: Final = 3000  # hop and distances take 8 bytes for each pair of points
NO_ROAD: Final = 1 << 29


@dataclass(frozen=True, eq=False)
class TrafficZones:
    """The zones of a floor; arrays are read-only, C includes the border."""

    mode: str  # of ZONE_MODES
    of: Numbers  # (C, 2) zone of a robot in a flat cell that travels in direction d: of[c, d >> 1]
    count: int
    intersection: Mask  # (C,)


@lru_cache(maxsize=16)
def traffic_zones_of(floor_plan: FloorPlan, mode: str = "undirected") -> TrafficZones:
    """The zones of a floor, NIL in cells without a zone.

    undirected: one zone for each segment, none for intersections. directed: two for each segment, east
    and south first. with-intersections: each intersection is a zone of its own, after the segments.
    Raises ValueError for another mode.
    """
    if mode not in ZONE_MODES:
        raise ValueError(f"unknown mode of zones {mode!r}; there are {', '.join(ZONE_MODES)}")
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

    # np.roll wraps around only through the border, which has no exits.
    beside = leads(EAST) | np.roll(leads(WEST), -1, 1)
    below = leads(SOUTH) | np.roll(leads(NORTH), -1, 0)
    return beside, below


def segments(drivable: Mask, beside: Mask, below: Mask, intersection: Mask) -> tuple[Numbers, int]:
    """The segment of each cell or NIL, shaped like the masks, and the number of segments."""
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
    """Each number copied along its row to the cells that follow."""
    follow = follows[part]
    # Each cell follows its predecessor in the list, so the list consists of runs.
    begin = np.maximum.accumulate(np.where(follow, 0, np.arange(len(follow))))
    carried = np.full(number.shape, NIL, np.int32)
    carried[part] = number[part][begin]
    return carried


# Roads: critical points, the straight ways between them, and distances of stations.


class RoadNetwork(NamedTuple):
    """P critical points and the straight ways between them, for S stations; NIL: none."""

    cell: Numbers  # (P,) flat cell
    next: Numbers  # (P, 4) the point that driving E, S, W, N leads to, or NIL
    step: Numbers  # (P, 4) cells to it
    station: Numbers  # (P,) the station at the point, or NIL
    point: Numbers  # (S,) the point of each station
    hop: Numbers  # (P, P) the next point on the shortest way to another one, or NIL
    between: Numbers  # (S, S) cells of the shortest way


def road_network(floor_plan: FloorPlan, station_cells: Sequence[int] | NDArray[Any]) -> RoadNetwork:
    """station_cells: the drivable flat cell of each station. Raises InputError."""
    stations = [int(cell) for cell in station_cells]
    _check(floor_plan, stations)
    cells = np.union1d(_junctions(floor_plan), np.array(stations, np.int64)).astype(np.int32)
    if len(cells) > MAX_ZONE_POINTS:
        raise InputError(
            f"the floor has {len(cells)} crossings, corners and dead ends; "
            f"zones can be made of at most {MAX_ZONE_POINTS}"
        )
    ahead, step = _ways(floor_plan, cells)
    distance = _distances(ahead, step)
    point = np.searchsorted(cells, stations).astype(np.int32)
    at = np.full(len(cells), NIL, np.int32)
    at[point] = np.arange(len(stations), dtype=np.int32)
    between = np.ascontiguousarray(distance[np.ix_(point, point)])
    _check_reachable(floor_plan, stations, between)
    return RoadNetwork(
        cell=cells,
        next=ahead,
        step=step,
        station=at,
        point=point,
        hop=_hops(ahead, step, distance),
        between=between,
    )


def _check(floor_plan: FloorPlan, stations: list[int]) -> None:
    drivable = floor_plan.drivable.reshape(-1)
    first: dict[int, int] = {}
    for number, cell in enumerate(stations, 1):
        where = f"station {number} at {floor_plan.xy(cell)}"
        if not drivable[cell]:
            raise InputError(f"{where} is not on a drivable cell")
        if cell in first:
            raise InputError(f"{where} is in the cell of station {first[cell]}")
        first[cell] = number


def _check_reachable(floor_plan: FloorPlan, stations: list[int], between: Numbers) -> None:
    apart = np.argwhere(between >= NO_ROAD)
    if len(apart):
        a, b = (int(number) for number in apart[0])
        raise InputError(
            f"no route leads from station {a + 1} at {floor_plan.xy(stations[a])} "
            f"to station {b + 1} at {floor_plan.xy(stations[b])}"
        )


def _junctions(floor_plan: FloorPlan) -> NDArray[np.int64]:
    """Flat cells whose links are not exactly two opposite ones."""
    beside, below = links(floor_plan)
    east, west = beside, np.roll(beside, 1, 1)
    south, north = below, np.roll(below, 1, 0)
    along_x = east & west & ~south & ~north
    along_y = south & north & ~east & ~west
    return np.flatnonzero(floor_plan.drivable & ~along_x & ~along_y)


def _ways(floor_plan: FloorPlan, cells: Numbers) -> tuple[Numbers, Numbers]:
    """(P, 4) each: the point in a direction, and its distance in cells."""
    exits = floor_plan.exits.reshape(-1).tolist()
    number = {int(cell): index for index, cell in enumerate(cells)}
    ahead, step = np.full((len(cells), 4), NIL, np.int32), np.zeros((len(cells), 4), np.int32)
    for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
        offset = dx + dy * floor_plan.stride
        for cell, index in number.items():
            here, steps = cell, 0
            while exits[here] >> direction & 1:
                here, steps = here + offset, steps + 1
                if here in number:
                    ahead[index, direction], step[index, direction] = number[here], steps
                    break
    return ahead, step


def _distances(ahead: Numbers, step: Numbers) -> Numbers:
    """(P, P) cells of shortest ways, NO_ROAD between points without a way."""
    count = len(ahead)
    distance = np.full((count, count), NO_ROAD, np.int32)
    np.fill_diagonal(distance, 0)
    changed = True
    while changed:
        before = distance.copy()
        for direction in range(4):
            here = np.flatnonzero(ahead[:, direction] != NIL)
            via = distance[ahead[here, direction]] + step[here, direction, None]
            distance[here] = np.minimum(distance[here], via)
        changed = not np.array_equal(before, distance)
    return np.minimum(distance, NO_ROAD, out=distance)


def _hops(ahead: Numbers, step: Numbers, distance: Numbers) -> Numbers:
    """(P, P) the next point on a shortest way; the lowest number if there are several."""
    count = len(ahead)
    hop = np.full((count, count), count, np.int32)
    for direction in range(4):
        here = np.flatnonzero(ahead[:, direction] != NIL)
        then = ahead[here, direction, None]
        on_way = distance[then[:, 0]] + step[here, direction, None] == distance[here]
        hop[here] = np.where(on_way, np.minimum(hop[here], then), hop[here])
    hop[(hop == count) | (distance >= NO_ROAD)] = NIL
    np.fill_diagonal(hop, NIL)
    return hop
