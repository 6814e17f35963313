"""First designs: phase 1 of Ho & Liao, and random ones.

Relation of two stations: RC = Wd (far - d) / (far - near) + Wf (F - least) / (most - least).
The stations that are least related to all others are the seeds; then the zones take turns to
connect the free station with the best relation to one of theirs, while Wd grows and Wf shrinks.
The authors' code takes the largest indices instead of the best relation; this is the true maximum.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.zoning.design.exchange import connect
from strategies.zoning.design.zone_capabilities import preference
from strategies.zoning.design.zone_paths import block_others, clear_design, hold, spread
from strategies.zoning.design.zone_workspace import INF_COST
from strategies.zoning.design.zoning_draws import below

WEIGHT = 0.5  # Wd and Wf at the start
DRIFT = 0.015  # what Wd gains and Wf loses by each visit
PREFERRED = 1000.0  # what priority adds to the relation of a station to a zone
RESTARTS = 100  # random designs that may fail
TRIES = 60  # random joins for each station


@kernel
def first_design(roads, flow, design, workspace):
    """Phase 1; returns 0 if there are more zones than stations, or no zone can reach one left over."""
    stations = design.zone.shape[0]
    zones = design.transfer.shape[0]
    clear_design(design)
    if zones > stations:
        return 0
    find_extent(roads, flow, workspace)
    if plant(roads, flow, design, workspace) == 0:
        return 0
    left = stations - zones
    visit, idle = np.int64(0), np.int64(0)
    while left > 0 and idle < zones:
        shift = DRIFT * visit
        if connect_best(
            roads, flow, design, workspace, visit % zones, WEIGHT + shift, WEIGHT - shift
        ):
            left -= 1
            idle = np.int64(0)
        else:
            idle += 1
        visit += 1
    return 1 if left == 0 else 0


@kernel
def plant(roads, flow, design, workspace):
    """One seed for each zone: the station least related to the others, of those that its robot serves.

    Stations where only others have priority come last. Returns 0 if a zone finds none.
    """
    stations = design.zone.shape[0]
    for z in range(design.transfer.shape[0]):
        seed = np.int64(NIL)
        lowest = 0.0
        for j in range(stations):
            if design.zone[j] != NIL or workspace.serves[z, j] == 0:
                continue
            sum_of = PREFERRED if preference(workspace, z, j) < 0 else 0.0
            for i in range(stations):
                if i != j:
                    sum_of += relation(workspace, flow[i, j], roads.between[i, j], WEIGHT, WEIGHT)
            if seed == NIL or sum_of < lowest:
                seed = np.int64(j)
                lowest = sum_of
        if seed == NIL:
            return 0
        design.zone[seed] = z
    hold(roads, design)
    return 1


@kernel
def find_extent(roads, flow, workspace):
    """The least and the largest distance and flow between two stations."""
    found = False
    for a in range(flow.shape[0]):
        for b in range(flow.shape[0]):
            if a == b:
                continue
            far, loads = roads.between[a, b], flow[a, b]
            if not found or far < workspace.least_distance[0]:
                workspace.least_distance[0] = far
            if not found or far > workspace.largest_distance[0]:
                workspace.largest_distance[0] = far
            if not found or loads < workspace.least_flow[0]:
                workspace.least_flow[0] = loads
            if not found or loads > workspace.largest_flow[0]:
                workspace.largest_flow[0] = loads
            found = True


@kernel
def relation(workspace, loads, far, by_distance, by_flow):
    """RC of two stations that are `far` cells apart with so many loads between them."""
    value = 0.0
    apart = workspace.largest_distance[0] - workspace.least_distance[0]
    if apart > 0.0:
        value += by_distance * (workspace.largest_distance[0] - far) / apart
    spread_of_loads = workspace.largest_flow[0] - workspace.least_flow[0]
    if spread_of_loads > 0.0:
        value += by_flow * (loads - workspace.least_flow[0]) / spread_of_loads
    return value


@kernel
def connect_best(roads, flow, design, workspace, zone, by_distance, by_flow):
    """Connect the free station with the best relation to one of the zone; 0 if it reaches none."""
    block_others(design, workspace, zone, zone)
    inside, free = np.int64(NIL), np.int64(NIL)
    best = 0.0
    for i in range(design.zone.shape[0]):
        if design.zone[i] != zone:
            continue
        spread(roads, workspace, roads.point[i], NIL, INF_COST)
        for j in range(design.zone.shape[0]):
            far = workspace.distance[roads.point[j]]
            if design.zone[j] != NIL or far == INF_COST or workspace.serves[zone, j] == 0:
                continue
            value = relation(workspace, flow[i, j], far, by_distance, by_flow)
            value += PREFERRED * preference(workspace, zone, j)
            if free == NIL or value > best:
                best = value
                inside, free = np.int64(i), np.int64(j)
    if free == NIL:
        return 0
    return connect(roads, design, workspace, free, inside, INF_COST)


@kernel
def random_design(roads, rules, design, workspace, seed, tick):
    """Random seeds, and random joins of adjacent stations; returns 0 if no try succeeds.

    Nor does any with more zones than stations: there is no seed for each. Robots serve their
    stations. In the first half of the tries no zone takes stations where only others have priority.
    """
    stations = design.zone.shape[0]
    zones = design.transfer.shape[0]
    if zones > stations:
        return 0
    for restart in range(RESTARTS):
        strict = 2 * restart < RESTARTS
        clear_design(design)
        if random_seeds(design, workspace, strict, seed, tick) == 0:
            continue
        hold(roads, design)
        left = stations - zones
        for _ in range(TRIES * stations):
            if left == 0:
                return 1
            left -= random_join(roads, rules, design, workspace, strict, seed, tick)
    return 0


@kernel
def random_seeds(design, workspace, strict, seed, tick):
    """A random station for each zone; 0 if one finds none."""
    stations = design.zone.shape[0]
    for z in range(design.transfer.shape[0]):
        s = below(workspace, stations, seed, tick)
        tries = 0
        while design.zone[s] != NIL or not is_wanted(workspace, z, s, strict):
            tries += 1
            if tries == TRIES * stations:
                return 0
            s = below(workspace, stations, seed, tick)
        design.zone[s] = z
    return 1


@kernel
def is_wanted(workspace, zone, s, strict):
    """Whether a zone may have a station; strict: without taking it from who has priority there."""
    return workspace.serves[zone, s] == 1 and not (strict and preference(workspace, zone, s) < 0)


@kernel
def random_join(roads, rules, design, workspace, strict, seed, tick):
    """A random zone takes a random free station adjacent to one of its own; 1 if it can."""
    zone = below(workspace, design.transfer.shape[0], seed, tick)
    count = np.int64(0)
    for s in range(design.zone.shape[0]):
        if design.zone[s] == zone:
            workspace.listed[count] = s
            count += 1
    inside = np.int64(workspace.listed[below(workspace, count, seed, tick)])
    count = np.int64(0)
    for s in range(design.zone.shape[0]):
        near = roads.between[inside, s] < rules.adjacent
        if design.zone[s] == NIL and near and is_wanted(workspace, zone, s, strict):
            workspace.listed[count] = s
            count += 1
    if count == 0:
        return 0
    free = np.int64(workspace.listed[below(workspace, count, seed, tick)])
    return connect(roads, design, workspace, free, inside, rules.adjacent)
