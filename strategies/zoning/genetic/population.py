"""Populations of zone designs for the genetic algorithm."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from automaton.engine.facilities import Roads
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import SCRATCH, Struct, field

Array = NDArray[Any]


class Individuals(Struct, role=SCRATCH):
    """N designs in rows; the names are those of Design."""

    zone: Array = field("(N, S) int32")
    segments: Array = field("(N,) int64")
    owner: Array = field("(N, S) int32")
    ends: Array = field("(N, S, 2) int32")
    points: Array = field("(N, S) int32")
    path: Array = field("(N, S, P) int32")
    held: Array = field("(N, P) int32")
    value: Array = field("(N,) float64", "balance; smaller is better")
    tips: Array = field("(N,) int64", "how many tips it has; of equal designs the more the better")


class Population(Struct, role=SCRATCH):
    """The last row of `now` is the best design so far."""

    now: Individuals  # N + 1 rows
    next: Individuals  # N rows
    rank: Array = field("(N,) int32", "rows from the best to the worst")
    pool: Array = field("(N + 1,) int32", "rows that zones are taken from")


def individuals_of(rows: int, points: int, stations: int) -> Individuals:
    """Room for some designs."""
    return Individuals.sized({"N": rows, "P": points, "S": stations})


def population_for(roads: Roads, individuals: int = 60) -> Population:
    """Room for a population on these roads."""
    points, stations = len(roads.cell), len(roads.point)
    return Population.sized(
        {"N": individuals},
        now=individuals_of(individuals + 1, points, stations),
        next=individuals_of(individuals, points, stations),
    )


@kernel
def keep(design, individuals, row):
    """Write a design to a row."""
    for s in range(design.zone.shape[0]):
        individuals.zone[row, s] = design.zone[s]
    for p in range(design.held.shape[0]):
        individuals.held[row, p] = design.held[p]
    individuals.segments[row] = design.segments[0]
    for m in range(design.segments[0]):
        individuals.owner[row, m] = design.owner[m]
        individuals.ends[row, m, 0] = design.ends[m, 0]
        individuals.ends[row, m, 1] = design.ends[m, 1]
        individuals.points[row, m] = design.points[m]
        for k in range(design.points[m]):
            individuals.path[row, m, k] = design.path[m, k]


@kernel
def take(individuals, row, design):
    """Make a design of a row."""
    design.transfer[:] = 0
    for s in range(design.zone.shape[0]):
        design.zone[s] = individuals.zone[row, s]
    for p in range(design.held.shape[0]):
        design.held[p] = individuals.held[row, p]
    design.segments[0] = 0
    for m in range(individuals.segments[row]):
        take_segment(individuals, row, m, design, individuals.owner[row, m])


@kernel
def take_segment(individuals, row, m, design, owner):
    """Append a segment of a row to a design."""
    at = design.segments[0]
    design.owner[at] = owner
    design.ends[at, 0] = individuals.ends[row, m, 0]
    design.ends[at, 1] = individuals.ends[row, m, 1]
    design.points[at] = individuals.points[row, m]
    for k in range(individuals.points[row, m]):
        design.path[at, k] = individuals.path[row, m, k]
    design.segments[0] = at + 1


@kernel
def fits(individuals, row, zone, design):
    """1 if a zone of a row has no station and no point that the design has already."""
    for s in range(design.zone.shape[0]):
        if individuals.zone[row, s] == zone and design.zone[s] >= 0:
            return 0
    for p in range(design.held.shape[0]):
        if individuals.held[row, p] == zone and design.held[p] >= 0:
            return 0
    return 1


@kernel
def take_zone(individuals, row, zone, design, owner):
    """Add a zone of a row to a design as its zone `owner`."""
    for s in range(design.zone.shape[0]):
        if individuals.zone[row, s] == zone:
            design.zone[s] = owner
    for p in range(design.held.shape[0]):
        if individuals.held[row, p] == zone:
            design.held[p] = owner
    for m in range(individuals.segments[row]):
        if individuals.owner[row, m] == zone:
            take_segment(individuals, row, m, design, owner)


@kernel
def move_row(source, row, individuals, to):
    """Copy a row with its value."""
    individuals.segments[to] = source.segments[row]
    individuals.value[to] = source.value[row]
    individuals.tips[to] = source.tips[row]
    for s in range(source.zone.shape[1]):
        individuals.zone[to, s] = source.zone[row, s]
    for p in range(source.held.shape[1]):
        individuals.held[to, p] = source.held[row, p]
    for m in range(source.segments[row]):
        individuals.owner[to, m] = source.owner[row, m]
        individuals.ends[to, m, 0] = source.ends[row, m, 0]
        individuals.ends[to, m, 1] = source.ends[row, m, 1]
        individuals.points[to, m] = source.points[row, m]
        for k in range(source.points[row, m]):
            individuals.path[to, m, k] = source.path[row, m, k]
