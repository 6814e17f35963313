"""The cells along the segments of a zone design."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from automaton.engine.facilities import Design, Roads

Cells = NDArray[Any]


def ways_of(roads: Roads, design: Design, stride: int) -> tuple[Cells, Cells]:
    """(k,) each: flat cells on the straight ways between the points of segments, and their zones.

    A cell comes as often as segments lead through it; it is in one zone, as points are.
    """
    used = int(design.segments[0])
    path, follows = design.path[:used], np.arange(1, design.path.shape[1])
    ways = follows < design.points[:used, None]
    here, there = roads.cell[path[:, :-1][ways]], roads.cell[path[:, 1:][ways]]
    zone = np.broadcast_to(design.owner[:used, None], ways.shape)[ways]
    step = np.where(here // stride == there // stride, 1, stride) * np.sign(there - here)
    count = np.abs((there - here) // np.where(step == 0, 1, step)) + 1
    nth = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.repeat(here, count) + nth * np.repeat(step, count), np.repeat(zone, count)


def stations_of(roads: Roads, design: Design) -> tuple[Cells, Cells, Cells]:
    """(S,) each: the cell of a station, its zone or NIL, and whether it is a transfer station."""
    shared: Cells = np.any(design.transfer, axis=(0, 1))
    return roads.cell[roads.point], design.zone, shared
