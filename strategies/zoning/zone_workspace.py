"""Zone designs in kernels: evaluation parameters, scratch, and shortest paths.

A feasible path of a zone uses points that no other zone holds. A union path of two zones uses points
that no third zone holds. A zone holds the points of its segments and stations (the authors' code
omits the station of a zone with a single station).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from automaton.strategy.api import (
    CONSTANT,
    NIL,
    SCRATCH,
    Array,
    Design,
    Roads,
    Struct,
    copy_segment,
    empty_design,
    field,
    kernel,
    random_between,
    random_bits,
)
from strategies.linear_sum_assignment import Assignment, assignment_for

UNREACHED = 1 << 60  # distance of a point that a search did not reach; as a limit: none

STREAM_ZONES = 0  # of random draws; each stream has a number of its own

# First counter value of each method.
DRAWS_ANNEALING = 1 << 40
DRAWS_GENETIC = 2 << 40
DRAWS_NEGOTIATION = 3 << 40


class ZoneRules(Struct):
    """Parameters for making and evaluating designs."""

    base: float = field(
        "float64", "loads of a zone in addition to its flow: 1 for SA and GA, 0 for DDZ"
    )
    speed: float = field("float64", "cells per minute")
    handling: float = field("float64", "minutes to load and to unload")
    adjacent: float = field("float64", "cells: stations nearer than this are adjacent")
    limit: float = field(
        "float64", "cells: longest path between a transfer station and the tip that fetches from it"
    )
    blocks: int = field("int64", "1: other zones must avoid these paths (SA, GA)")
    shared: int = field("int64", "1: a zone's load includes its transfer stations (DDZ)")
    all_pairs: int = field(
        "int64", "1: a moved tip may join any tip in reach, 0: only the last one"
    )


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
        limit=UNREACHED if limit is None else limit,
        blocks=blocks,
        shared=shared,
        all_pairs=all_pairs,
    )


def typical_distance(between: ArrayLike) -> float:
    """Distance in cells below which stations are adjacent; the authors' 243.64 ft on their floor.

    For n stations: the sum of the n - 2 shortest distances of each, divided by n (n - 1).
    """
    table = np.asarray(between, np.int64)
    count = len(table)
    if count < 3:
        return float(table.max(initial=0) + 1)
    others = np.sort(table[~np.eye(count, dtype=bool)].reshape(count, count - 1), axis=1)
    return float(others[:, : count - 2].sum() / (count * (count - 1)))


class ZoneSpace(Struct, role=SCRATCH):
    """P points, S stations, Z zones."""

    distance: Array = field("(P,) int64", "cells from the start of a search")
    back: Array = field("(P,) int32", "the previous point")
    open: Array = field("(P,) int32", "reached points that are not settled")
    done: Array = field("(P,) uint8", "1 = settled")
    blocked: Array = field("(P,) uint8", "1 = closed to searches")
    claimed: Array = field("(P, Z) uint8", "1 = on a path of a transfer station of the zone")
    tip: Array = field("(S,) uint8", "1 = a tip of its zone")
    part: Array = field("(S,) int32", "the lowest station of its piece")
    listed: Array = field("(S,) int32", "a list of stations")
    member: Array = field("(S,) uint8")
    via_station: Array = field(
        "(Z, Z, S) int32", "the tip of the second zone near a tip of the first, or NIL"
    )
    fresh: Array = field("(Z, Z) uint8", "1 = `via_station` is valid for the current design")
    legs: Array = field("(S, S) float64", "the flow of a load")
    leg_flow: Array = field("(Z, S, S) float64", "the legs in each robot's queue")
    into: Array = field("(S,) float64")
    out: Array = field("(S,) float64")
    load: Array = field("(Z,) float64", "minutes")
    reach: Array = field("(Z,) uint8", "1 = a zone of the negotiation")
    # Between any two stations:
    least_distance: float = field("() float64", "cells")
    largest_distance: float = field("() float64")
    least_flow: float = field("() float64", "loads")
    largest_flow: float = field("() float64")
    level: Array = field("(Z,) int32", "number of transfers to a zone, or NIL")
    frontier: Array = field("(Z,) int32")
    zones: Array = field("(Z * Z, 2) int32", "pairs of zones")
    length: Array = field("(S * S,) int64", "sort keys of pairs of stations")
    pair: Array = field("(S * S, 2) int32")
    drawn: int = field("() int64", "number of draws")
    serves: Array = field(
        "(Z, S) uint8", "1 = the robot of the zone can reach the station", default=1, role=CONSTANT
    )
    first: Array = field("(Z, S) uint8", "1 = its type has priority there", role=CONSTANT)
    move_time_factor: Array = field(
        "(Z,) float64", "duration of its moves relative to the first type", default=1
    )
    matching: Assignment  # of zones to robots
    trial: Design  # the result of an exchange
    now: Design  # state of a search
    best: Design


def space_for(roads: Roads, zones: int) -> ZoneSpace:
    """Scratch for this number of zones on these roads."""
    points, stations = len(roads.cell), len(roads.point)
    return ZoneSpace.sized(
        {"P": points, "S": stations, "Z": zones, "Z * Z": zones**2, "S * S": stations**2},
        matching=assignment_for(zones),
        trial=empty_design(points, stations, zones),
        now=empty_design(points, stations, zones),
        best=empty_design(points, stations, zones),
    )


@kernel
def block_others(design, workspace, a, b):
    """Close points that a zone other than a and b holds (a = b: feasible paths of a zone)."""
    for p in range(design.held.shape[0]):
        zone = design.held[p]
        workspace.blocked[p] = 1 if zone != NIL and zone != a and zone != b else 0


@kernel
def spread(roads, workspace, start, target, bound):
    """Distances from a point over open points, up to `bound` cells (Dijkstra).

    Ends when `target` is settled (NIL: never). Writes workspace.back and workspace.distance, which is
    UNREACHED for points that were not reached. Ties: the lowest point.
    """
    workspace.distance[:] = UNREACHED
    workspace.done[:] = 0
    workspace.distance[start] = 0
    workspace.back[start] = NIL
    workspace.open[0] = start
    count = np.int64(1)
    while count > 0:
        at = np.int64(0)
        for k in range(1, count):
            p, q = workspace.open[k], workspace.open[at]
            nearer = workspace.distance[p] < workspace.distance[q]
            if nearer or (workspace.distance[p] == workspace.distance[q] and p < q):
                at = k
        here = np.int64(workspace.open[at])
        count -= 1
        workspace.open[at] = workspace.open[count]
        workspace.done[here] = 1
        if here == target:
            return
        for d in range(4):
            there = np.int64(roads.next[here, d])
            if there == NIL or workspace.done[there] == 1 or workspace.blocked[there] == 1:
                continue
            far = workspace.distance[here] + roads.step[here, d]
            if far > bound or far >= workspace.distance[there]:
                continue
            if workspace.distance[there] == UNREACHED:
                workspace.open[count] = there
                count += 1
            workspace.distance[there] = far
            workspace.back[there] = here


@kernel
def whole_cells(limit):
    """A limit in cells, rounded down to an integer."""
    return np.int64(UNREACHED) if limit >= 1e15 else np.int64(limit)


# The points held by the zones of a design.


@kernel
def add_segment(roads, design, workspace, zone, first, last):
    """Append the path that `spread` found from station `first` to station `last`."""
    m = design.segments
    count = np.int64(1)
    p = np.int64(roads.point[last])
    while workspace.back[p] != NIL:
        p = np.int64(workspace.back[p])
        count += 1
    p = np.int64(roads.point[last])
    for k in range(count - 1, -1, -1):
        design.path[m, k] = p
        design.held[p] = zone
        p = np.int64(workspace.back[p])
    design.points[m] = count
    design.owner[m] = zone
    design.ends[m, 0] = first
    design.ends[m, 1] = last
    design.segments = m + 1


@kernel
def hold(roads, design):
    """design.held from the stations and segments; points held by robots out of sight stay held."""
    for p in range(design.held.shape[0]):
        if design.held[p] >= 0:
            design.held[p] = NIL
    for s in range(design.zone.shape[0]):
        if design.zone[s] != NIL:
            design.held[roads.point[s]] = design.zone[s]
    for m in range(design.segments):
        for k in range(design.points[m]):
            design.held[design.path[m, k]] = design.owner[m]


@kernel
def clear_design(design):
    """Clear a design."""
    design.zone[:] = NIL
    design.segments = 0
    design.held[:] = NIL
    design.transfer[:] = 0


@kernel
def copy_design(source, design):
    """Copy the used part of a design."""
    stations = source.zone.shape[0]
    zones = source.transfer.shape[0]
    for s in range(stations):
        design.zone[s] = source.zone[s]
    design.segments = source.segments
    for m in range(source.segments):
        copy_segment(source, m, design, m)
    for p in range(source.held.shape[0]):
        design.held[p] = source.held[p]
    for a in range(zones):
        for b in range(zones):
            for s in range(stations):
                design.transfer[a, b, s] = source.transfer[a, b, s]


@kernel
def size(design, zone):
    """The number of stations of a zone."""
    count = np.int64(0)
    for s in range(design.zone.shape[0]):
        if design.zone[s] == zone:
            count += 1
    return count


# Random draws of the zoning methods, addressed by (seed, tick, method and number of earlier draws).


@kernel
def below(workspace, count, seed, tick):
    """A uniform integer from 0 to count - 1."""
    workspace.drawn += 1
    return random_between(0, count - 1, seed, STREAM_ZONES, tick, workspace.drawn)


@kernel
def chance(workspace, seed, tick):
    """A uniform number in [0, 1)."""
    workspace.drawn += 1
    bits = random_bits(seed, STREAM_ZONES, tick, workspace.drawn) >> np.uint64(11)
    return np.float64(np.int64(bits)) / 9007199254740992.0


# The abilities of the robots of zones.
#
# A zone has the number of its robot. `serves` and `first` (Z, S) are constant in a run: 1 = the robot
# can reach the station, and 1 = its type has priority there. If all robots are equal, all robots serve
# all stations and none has priority.


@kernel
def may_take(workspace, a, b, s):
    """Whether zone a may give a station to zone b: b's robot can reach it, and no priority is lost."""
    return workspace.serves[b, s] == 1 and (
        workspace.first[a, s] == 0 or workspace.first[b, s] == 1
    )


@kernel
def preference(workspace, zone, s):
    """1 if the robot of a zone has priority at a station, -1 if only others have it, else 0."""
    if workspace.first[zone, s] == 1:
        return 1
    for other in range(workspace.first.shape[0]):
        if workspace.first[other, s] == 1:
            return -1
    return 0
