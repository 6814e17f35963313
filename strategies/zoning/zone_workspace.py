"""Scratch of the kernels of zoning, and the numbers by which designs are made and judged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from automaton.engine.facilities import Design, Roads, empty_design
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import CONSTANT, SCRATCH, Struct, field
from automaton.engine.state import NIL
from automaton.strategy.kernels import copy_segment, random_between, random_bits
from strategies.linear_sum_assignment import (
    INF_COST,
    Assignment,
    assignment_for,
    linear_sum_assignment,
)

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


# Shortest ways that a zone may use, and what a design holds.
#
# Feasible path of a zone: over points that no other zone holds. Union path of two zones: over points
# that no third zone holds. A zone holds the points of its segments and of its stations (the authors'
# code forgets the station of a zone that has only one).


@kernel
def block_others(design, workspace, a, b):
    """Close what a zone other than a and b holds (a = b: feasible paths of a zone)."""
    for p in range(design.held.shape[0]):
        zone = design.held[p]
        workspace.blocked[p] = 1 if zone != NIL and zone != a and zone != b else 0


@kernel
def spread(roads, workspace, start, target, bound):
    """Distances from a point over points that are not closed, up to `bound` cells (Dijkstra).

    Ends when `target` is settled (NIL: never). Writes workspace.back, and workspace.distance,
    INF_COST where it did not come to. Ties: the lowest point.
    """
    workspace.distance[:] = INF_COST
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
            if workspace.distance[there] == INF_COST:
                workspace.open[count] = there
                count += 1
            workspace.distance[there] = far
            workspace.back[there] = here


@kernel
def whole_cells(limit):
    """A limit in cells as an integer: nothing longer than it passes."""
    return np.int64(INF_COST) if limit >= 1e15 else np.int64(limit)


@kernel
def add_segment(roads, design, workspace, zone, first, last):
    """Append the path that `spread` found from station `first` to station `last`."""
    m = design.segments[0]
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
    design.segments[0] = m + 1


@kernel
def hold(roads, design):
    """design.held from the stations and segments; what is held by a robot out of sight stays so."""
    for p in range(design.held.shape[0]):
        if design.held[p] >= 0:
            design.held[p] = NIL
    for s in range(design.zone.shape[0]):
        if design.zone[s] != NIL:
            design.held[roads.point[s]] = design.zone[s]
    for m in range(design.segments[0]):
        for k in range(design.points[m]):
            design.held[design.path[m, k]] = design.owner[m]


@kernel
def clear_design(design):
    """No station has a zone."""
    design.zone[:] = NIL
    design.segments[0] = 0
    design.held[:] = NIL
    design.transfer[:] = 0


@kernel
def copy_design(source, design):
    """Copy what is in use."""
    stations = source.zone.shape[0]
    zones = source.transfer.shape[0]
    for s in range(stations):
        design.zone[s] = source.zone[s]
    design.segments[0] = source.segments[0]
    for m in range(source.segments[0]):
        copy_segment(source, m, design, m)
    for p in range(source.held.shape[0]):
        design.held[p] = source.held[p]
    for a in range(zones):
        for b in range(zones):
            for s in range(stations):
                design.transfer[a, b, s] = source.transfer[a, b, s]


@kernel
def size(design, zone):
    """How many stations a zone has."""
    count = np.int64(0)
    for s in range(design.zone.shape[0]):
        if design.zone[s] == zone:
            count += 1
    return count


# exp and ln of basic arithmetic only, so that every machine gets the same bits.


LN2 = 0.6931471805599453
EXP_UNDERFLOW = -700.0  # exp of less is 0


@kernel
def exponential(x):
    """e to the power of x, for x <= 0; relative error below 1e-14."""
    if x < EXP_UNDERFLOW:
        return 0.0
    halvings = int(-x / LN2 + 0.5)
    rest = x + halvings * LN2
    term = 1.0
    total = 1.0
    for k in range(1, 15):
        term = term * rest / k
        total += term
    for _ in range(halvings):
        total *= 0.5
    return total


@kernel
def logarithm(x):
    """The natural logarithm of x > 0."""
    doublings = 0
    while x < 0.75:
        x *= 2.0
        doublings -= 1
    while x > 1.5:
        x *= 0.5
        doublings += 1
    ratio = (x - 1.0) / (x + 1.0)
    square = ratio * ratio
    total = 0.0
    for k in range(20, -1, -1):
        total = total * square + 1.0 / (2 * k + 1)
    return 2.0 * ratio * total + doublings * LN2


@kernel
def temperature(hot, cold, steps, done):
    """Eq. 6: hot (cold / hot) ^ (done / steps)."""
    ratio = logarithm(cold / hot) * done / steps
    if ratio > 0.0:
        return hot / exponential(-ratio)
    return hot * exponential(ratio)


# Random draws of the methods of zoning, addressed by (seed, tick, method and how many came before).


STREAM_ZONES = 0  # of random draws; each stream has a number of its own

# Where the counter of each method begins.
DRAWS_ANNEALING = 1 << 40
DRAWS_GENETIC = 2 << 40
DRAWS_NEGOTIATION = 3 << 40

_11 = np.uint64(11)


@kernel
def below(workspace, count, seed, tick):
    """A uniform integer from 0 to count - 1."""
    workspace.drawn[0] += 1
    return random_between(0, count - 1, seed, STREAM_ZONES, tick, workspace.drawn[0])


@kernel
def chance(workspace, seed, tick):
    """A uniform number from 0 to below 1."""
    workspace.drawn[0] += 1
    bits = random_bits(seed, STREAM_ZONES, tick, workspace.drawn[0]) >> _11
    return np.float64(np.int64(bits)) / 9007199254740992.0


# What the robots of zones can do: stations that they serve, priority there, and how fast they are.
#
# A zone has the number of its robot. `accessible` and `has_priority` (Z, S) are given for a run: 1 =
# the robot gets to the station, and 1 = its type has priority there. Where all robots are alike, all
# robots serve everything and none has priority.


# Cost of a station in a zone whose robot has no priority there, and another one has.
MISPLACED = 1 << 30


@kernel
def may_take(workspace, a, b, s):
    """Whether zone a may give a station to zone b: its robot gets there, and loses no priority."""
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


@kernel
def are_alike(workspace):
    """Whether it does not matter which robot gets which zone."""
    for z in range(workspace.serves.shape[0]):
        if workspace.move_time_factor[z] != workspace.move_time_factor[0]:
            return False
        for s in range(workspace.serves.shape[1]):
            if workspace.serves[z, s] == 0 or workspace.first[z, s] == 1:
                return False
    return True


@kernel
def match(design, workspace):
    """Number the zones after robots that serve them, one to one; returns 0 if there is no such way.

    Of all matchings one with the fewest stations away from who has priority there; of these one that
    gives the larger zones to the faster robots (linear sum assignment).
    """
    zones = workspace.serves.shape[0]
    cost = workspace.matching.cost
    for z in range(zones):
        for robot in range(zones):
            cost[z, robot] = cost_of(design, workspace, z, robot)
    linear_sum_assignment(cost, zones, zones, workspace.matching)
    workspace.frontier[:] = NIL
    for robot in range(zones):
        z = np.int64(workspace.matching.row_of[robot])
        if z == NIL:
            return 0
        workspace.frontier[z] = robot
    rename(design, workspace.frontier)
    return 1


@kernel
def cost_of(design, workspace, zone, robot):
    """What it costs to give a zone to a robot; INF_COST: it does not serve all of it."""
    cost = np.int64(0)
    for s in range(design.zone.shape[0]):
        if design.zone[s] != zone:
            continue
        if workspace.serves[robot, s] == 0:
            return np.int64(INF_COST)
        cost += np.int64(1000 * workspace.move_time_factor[robot])
        if preference(workspace, robot, s) < 0:
            cost += MISPLACED
    return cost


@kernel
def rename(design, name):
    """Zone z becomes zone name[z]; the design has no transfer stations yet."""
    for s in range(design.zone.shape[0]):
        if design.zone[s] != NIL:
            design.zone[s] = name[design.zone[s]]
    for m in range(design.segments[0]):
        design.owner[m] = name[design.owner[m]]
    for p in range(design.held.shape[0]):
        if design.held[p] >= 0:
            design.held[p] = name[design.held[p]]
