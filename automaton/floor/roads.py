"""Roads of a floor: its critical points, the straight ways between them, and how far stations are.

A critical point is a station, or a drivable cell whose links to other cells are not exactly two
opposite ones: a crossing, a corner or a dead end. Points are numbered in reading order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.floor.cells import DIRECTION_VECTORS, NIL
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.traffic_zones import Numbers, links

MAX_POINTS: Final = 3000  # hop and distances take 8 bytes for each pair of points
NO_ROAD: Final = 1 << 29


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
    if len(cells) > MAX_POINTS:
        raise InputError(
            f"the floor has {len(cells)} crossings, corners and dead ends; "
            f"zones can be made of at most {MAX_POINTS}"
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
            raise InputError(f"{where} is on no cell that robots drive on")
        if cell in first:
            raise InputError(f"{where} is in the cell of station {first[cell]}")
        first[cell] = number


def _check_reachable(floor_plan: FloorPlan, stations: list[int], between: Numbers) -> None:
    apart = np.argwhere(between >= NO_ROAD)
    if len(apart):
        a, b = (int(number) for number in apart[0])
        raise InputError(
            f"no way leads from station {a + 1} at {floor_plan.xy(stations[a])} "
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
    """(P, 4) each: the point that a direction leads to, and how many cells away it is."""
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
    """(P, P) cells of shortest ways, NO_ROAD between two that no way joins."""
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
    """(P, P) the next point on a shortest way; of several the lowest."""
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
