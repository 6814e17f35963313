"""Scratch of the kernels of zoning, and the numbers by which designs are made and judged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from automaton.engine.facilities import Design, Roads, empty_design
from automaton.engine.jit.structs import CONSTANT, SCRATCH, Struct, field
from strategies.linear_sum_assignment import INF_COST, Assignment, assignment_for

Array = NDArray[Any]


class ZoneRules(Struct):
    """The numbers by which designs are made and judged."""

    base: float = field(
        "float64", "loads that a zone has besides its flow: 1 for SA and GA, 0 for DDZ"
    )
    speed: float = field("float64", "cells per minute")
    handling: float = field("float64", "minutes to load and to unload")
    adjacent: float = field("float64", "cells: stations that are nearer are adjacent")
    limit: float = field(
        "float64", "cells: the longest path between a transfer station and who fetches from it"
    )
    blocks: int = field("int64", "1: these paths are in the way of other zones (SA, GA)")
    shared: int = field(
        "int64", "1: transfer stations belong to the stations of a zone's load (DDZ)"
    )
    all_pairs: int = field(
        "int64", "1: a tip that is given is joined to any tip in reach, 0: to the last one alone"
    )


class ZoneSpace(Struct, role=SCRATCH):
    """P points, S stations, Z zones."""

    distance: Array = field("(P,) int64", "cells from where a search began")
    back: Array = field("(P,) int32", "the point before")
    open: Array = field("(P,) int32", "points reached and not settled")
    done: Array = field("(P,) uint8", "1 = settled")
    blocked: Array = field("(P,) uint8", "1 = a search may not pass")
    claimed: Array = field(
        "(P, Z) uint8", "1 = on a path from a transfer station that is the zone's"
    )
    tip: Array = field("(S,) uint8", "1 = a tip of its zone")
    part: Array = field("(S,) int32", "the lowest station that it is joined with")
    listed: Array = field("(S,) int32", "stations of some kind, the first ones")
    member: Array = field("(S,) uint8")
    via_station: Array = field(
        "(Z, Z, S) int32", "the tip of the second zone near a tip of the first, or NIL"
    )
    fresh: Array = field("(Z, Z) uint8", "1 = `via_station` holds for the present design")
    legs: Array = field("(S, S) float64", "the flow that a load is made of")
    leg_flow: Array = field("(Z, S, S) float64", "the legs in each robot's queue")
    into: Array = field("(S,) float64")
    out: Array = field("(S,) float64")
    load: Array = field("(Z,) float64", "minutes")
    reach: Array = field("(Z,) uint8", "1 = a zone that a negotiation is about")
    # Between any two stations:
    least_distance: Array = field("(1,) float64", "cells")
    largest_distance: Array = field("(1,) float64")
    least_flow: Array = field("(1,) float64", "loads")
    largest_flow: Array = field("(1,) float64")
    level: Array = field("(Z,) int32", "transfers to some zone, or NIL")
    frontier: Array = field("(Z,) int32")
    zones: Array = field("(Z * Z, 2) int32", "pairs of zones")
    length: Array = field("(S * S,) int64", "of pairs of stations")
    pair: Array = field("(S * S, 2) int32")
    drawn: Array = field("(1,) int64", "draws so far")
    serves: Array = field(
        "(Z, S) uint8", "1 = the robot of the zone gets to the station", default=1, role=CONSTANT
    )
    first: Array = field("(Z, S) uint8", "1 = its type has priority there", role=CONSTANT)
    move_time_factor: Array = field(
        "(Z,) float64", "how many times as long its moves take", default=1
    )
    matching: Assignment  # of zones to robots
    trial: Design  # what an exchange makes
    now: Design  # where a search is
    best: Design


def zone_rules(
    speed: float,
    adjacent: float,
    base: float = 1.0,
    handling: float = 0.084,
    limit: float | None = None,
    blocks: bool = True,
    shared: bool = False,
    all_pairs: bool = False,
) -> ZoneRules:
    """The defaults are those of SA and GA (DDZ: base 0, a limit, not blocks, shared).

    speed: cells per minute; adjacent, limit: cells; handling: minutes.
    """
    return ZoneRules(
        base=base,
        speed=speed,
        handling=handling,
        adjacent=adjacent,
        limit=INF_COST if limit is None else limit,
        blocks=blocks,
        shared=shared,
        all_pairs=all_pairs,
    )


def typical_distance(between: ArrayLike) -> float:
    """Cells below which stations are adjacent: for n of them, the n - 2 nearest of each, summed up,
    over n (n - 1); the authors' 243.64 ft on their floor."""
    table = np.asarray(between, np.int64)
    count = len(table)
    if count < 3:
        return float(table.max(initial=0) + 1)
    others = np.sort(table[~np.eye(count, dtype=bool)].reshape(count, count - 1), axis=1)
    return float(others[:, : count - 2].sum() / (count * (count - 1)))


def zone_space(points: int, stations: int, zones: int) -> ZoneSpace:
    """Scratch of these sizes."""
    return ZoneSpace.sized(
        {"P": points, "S": stations, "Z": zones, "Z * Z": zones**2, "S * S": stations**2},
        matching=assignment_for(zones),
        trial=empty_design(points, stations, zones),
        now=empty_design(points, stations, zones),
        best=empty_design(points, stations, zones),
    )


def space_for(roads: Roads, zones: int) -> ZoneSpace:
    """Scratch for these roads."""
    return zone_space(len(roads.cell), len(roads.point), zones)
