"""Populations of zone designs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from automaton.compiled import kernel
from automaton.struct import Struct
from automaton.world.service_zones import Roads

Array = NDArray[Any]


class Herd(Struct):
    """N designs in rows; the names are those of Design."""

    zone: Array  # (N, S) int32
    segments: Array  # (N,) int64
    owner: Array  # (N, S) int32
    ends: Array  # (N, S, 2) int32
    points: Array  # (N, S) int32
    path: Array  # (N, S, P) int32
    held: Array  # (N, P) int32
    value: Array  # (N,) float64: balance; smaller is better
    tips: Array  # (N,) int64: how many tips it has; of equal designs the more the better


class Population(Struct):
    """The last row of `now` is the best design so far."""

    now: Herd  # N + 1 rows
    next: Herd  # N rows
    rank: Array  # (N,) int32: rows from the best to the worst
    pool: Array  # (N + 1,) int32: rows that zones are taken from


def herd_of(rows: int, points: int, stations: int) -> Herd:
    """Room for some designs."""

    def numbers(*shape: int) -> Array:
        return np.zeros((rows, *shape), np.int32)

    return Herd(
        zone=numbers(stations),
        segments=np.zeros(rows, np.int64),
        owner=numbers(stations),
        ends=numbers(stations, 2),
        points=numbers(stations),
        path=numbers(stations, points),
        held=numbers(points),
        value=np.zeros(rows),
        tips=np.zeros(rows, np.int64),
    )


def population_for(roads: Roads, individuals: int = 60) -> Population:
    """Room for a population on these roads."""
    points, stations = len(roads.cell), len(roads.point)
    return Population(
        now=herd_of(individuals + 1, points, stations),
        next=herd_of(individuals, points, stations),
        rank=np.zeros(individuals, np.int32),
        pool=np.zeros(individuals + 1, np.int32),
    )


@kernel
def keep(design, herd, row):
    """Write a design to a row."""
    for s in range(design.zone.shape[0]):
        herd.zone[row, s] = design.zone[s]
    for p in range(design.held.shape[0]):
        herd.held[row, p] = design.held[p]
    herd.segments[row] = design.segments[0]
    for m in range(design.segments[0]):
        herd.owner[row, m] = design.owner[m]
        herd.ends[row, m, 0] = design.ends[m, 0]
        herd.ends[row, m, 1] = design.ends[m, 1]
        herd.points[row, m] = design.points[m]
        for k in range(design.points[m]):
            herd.path[row, m, k] = design.path[m, k]


@kernel
def take(herd, row, design):
    """Make a design of a row."""
    design.transfer[:] = 0
    for s in range(design.zone.shape[0]):
        design.zone[s] = herd.zone[row, s]
    for p in range(design.held.shape[0]):
        design.held[p] = herd.held[row, p]
    design.segments[0] = 0
    for m in range(herd.segments[row]):
        take_segment(herd, row, m, design, herd.owner[row, m])


@kernel
def take_segment(herd, row, m, design, owner):
    """Append a segment of a row to a design."""
    at = design.segments[0]
    design.owner[at] = owner
    design.ends[at, 0] = herd.ends[row, m, 0]
    design.ends[at, 1] = herd.ends[row, m, 1]
    design.points[at] = herd.points[row, m]
    for k in range(herd.points[row, m]):
        design.path[at, k] = herd.path[row, m, k]
    design.segments[0] = at + 1


@kernel
def fits(herd, row, zone, design):
    """1 if a zone of a row has no station and no point that the design has already."""
    for s in range(design.zone.shape[0]):
        if herd.zone[row, s] == zone and design.zone[s] >= 0:
            return 0
    for p in range(design.held.shape[0]):
        if herd.held[row, p] == zone and design.held[p] >= 0:
            return 0
    return 1


@kernel
def take_zone(herd, row, zone, design, owner):
    """Add a zone of a row to a design as its zone `owner`."""
    for s in range(design.zone.shape[0]):
        if herd.zone[row, s] == zone:
            design.zone[s] = owner
    for p in range(design.held.shape[0]):
        if herd.held[row, p] == zone:
            design.held[p] = owner
    for m in range(herd.segments[row]):
        if herd.owner[row, m] == zone:
            take_segment(herd, row, m, design, owner)


@kernel
def move_row(source, row, herd, to):
    """Copy a row with its value."""
    herd.segments[to] = source.segments[row]
    herd.value[to] = source.value[row]
    herd.tips[to] = source.tips[row]
    for s in range(source.zone.shape[1]):
        herd.zone[to, s] = source.zone[row, s]
    for p in range(source.held.shape[1]):
        herd.held[to, p] = source.held[row, p]
    for m in range(source.segments[row]):
        herd.owner[to, m] = source.owner[row, m]
        herd.ends[to, m, 0] = source.ends[row, m, 0]
        herd.ends[to, m, 1] = source.ends[row, m, 1]
        herd.points[to, m] = source.points[row, m]
        for k in range(source.points[row, m]):
            herd.path[to, m, k] = source.path[row, m, k]
