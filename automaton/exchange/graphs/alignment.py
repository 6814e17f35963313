"""Put the nodes of a graph on a grid: turned so that most edges run along it, and snapped to it.

angle   of all angles mod 90 degrees, in steps of 0.1, the one that most edge length has
snap    coordinates of an axis that differ by at most a quarter of a cell become their mean
column  floor((x - least x) / cell + 1/2); rows likewise, from above
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.exchange.graphs.graph import Graph

STEPS: Final = 10  # in a degree
SNAP: Final = 0.25  # of a cell
CLOSE: Final = 1e-9  # of a cell: what rounding of the coordinates may make

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Placement(NamedTuple):
    """The nodes of a graph turned along the axes; metres, y upwards."""

    x: Floats  # (nodes,)
    y: Floats
    degrees: float  # by which the layout was turned clockwise


class GridPlaces(NamedTuple):
    """The cells of the nodes for one size of cells."""

    column: Integers  # (nodes,) from 0
    row: Integers  # (nodes,) from 0 at the top
    width: int
    height: int


def turned(graph: Graph) -> Placement:
    """Return the nodes turned by the angle that most edge length has."""
    x, y = np.array([(node.x, node.y) for node in graph.nodes]).T
    ends = np.array([(edge.start, edge.end) for edge in graph.edges])
    dx, dy = (c[ends[:, 1]] - c[ends[:, 0]] for c in (x, y))
    steps = np.rint(np.degrees(np.arctan2(dy, dx)) * STEPS).astype(np.int64) % (90 * STEPS)
    angle = int(np.bincount(steps, np.hypot(dx, dy)).argmax()) / STEPS
    degrees = angle - 90 if angle > 45 else angle
    if degrees == 0:
        return Placement(x, y, 0.0)
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return Placement(x * cos + y * sin, y * cos - x * sin, degrees)


def on_grid(placement: Placement, cell: float) -> GridPlaces:
    """Return the cell of each node; numbers that are too large for a floor are cut."""
    column, up = (_indices(_snapped(c, cell), cell) for c in (placement.x, placement.y))
    return GridPlaces(column, up.max() - up, int(column.max()) + 1, int(up.max()) + 1)


def _indices(coordinates: Floats, cell: float) -> Integers:
    steps = (coordinates - coordinates.min()) / cell
    cells: Integers = np.floor(np.minimum(steps, 1e12) + 0.5 + CLOSE).astype(np.int64)
    return cells


def _snapped(coordinates: Floats, cell: float) -> Floats:
    """Return coordinates in which those that are close together are one, their mean."""
    order = np.argsort(coordinates, kind="stable")
    ordered = coordinates[order]
    near = SNAP * cell * (1 + CLOSE)
    group, first = np.zeros(len(ordered), np.int64), 0
    starts = np.flatnonzero(np.diff(ordered, prepend=-np.inf) > 0)  # different values alone
    number = -1
    for place in starts.tolist():
        if number < 0 or ordered[place] - ordered[first] > near:
            number, first = number + 1, place
        group[place] = number
    group = np.maximum.accumulate(group)
    mean = np.bincount(group, ordered) / np.bincount(group)
    single = np.bincount(group) == 1
    out = np.empty_like(coordinates)
    out[order] = np.where(single[group], ordered, mean[group])
    return out
