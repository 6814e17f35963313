"""Construction of designs: first designs, random designs, and moves of a station between zones.

These kernels change a design in place and return 1 on success, else 0. After a failure the design is
invalid, so callers use a copy. The rest of a zone is joined again by shortest paths.
"""

import numpy as np

from automaton.strategy.api import NIL, copy_segment, kernel
from strategies.zoning.loads_and_transfers import passes
from strategies.zoning.zone_workspace import (
    UNREACHED,
    add_segment,
    below,
    block_others,
    clear_design,
    hold,
    preference,
    size,
    spread,
    whole_cells,
)

WEIGHT = 0.5  # Wd and Wf at the start
DRIFT = 0.015  # increase of Wd and decrease of Wf per visit
PREFERRED = 1000.0  # bonus of priority in the relation of a station to a zone
RESTARTS = 100  # attempts at a random design
TRIES = 60  # random joins per station


@kernel
def give(roads, design, workspace, s, through, limit, smallest):
    """Move s to the zone of station `through`, joined to it by a path of at most `limit` cells.

    Fails if fewer than `smallest` stations would remain in its old zone.
    """
    if size(design, design.zone[s]) <= smallest:
        return 0
    if remove(roads, design, workspace, s, design.zone[through]) == 0:
        return 0
    return connect(roads, design, workspace, s, through, limit)


@kernel
def remove(roads, design, workspace, s, to):
    """Move s to zone `to` (or NIL) without a segment, and join the rest of its old zone."""
    zone = np.int64(design.zone[s])
    point = np.int64(roads.point[s])
    drop_segments(design, zone, point)
    design.zone[s] = to
    hold(roads, design)
    return join(roads, design, workspace, zone, point)


@kernel
def drop_segments(design, zone, p):
    """Remove the segments of a zone that contain the point; the others keep their order."""
    kept = np.int64(0)
    for m in range(design.segments):
        if design.owner[m] == zone and passes(design, m, p) == 1:
            continue
        if kept < m:
            copy_segment(design, m, design, kept)
        kept += 1
    design.segments = kept


@kernel
def join(roads, design, workspace, zone, closed):
    """Join the pieces of a zone by shortest feasible paths (minimum spanning tree).

    closed: a point that must not be used, or NIL. Ties: the lowest stations.
    """
    pieces = label_parts(design, workspace, zone)
    while pieces > 1:
        block_others(design, workspace, zone, zone)
        if closed != NIL:
            workspace.blocked[closed] = 1
        best = np.int64(UNREACHED)
        first, last = np.int64(NIL), np.int64(NIL)
        for a in range(design.zone.shape[0]):
            if design.zone[a] != zone:
                continue
            spread(roads, workspace, roads.point[a], NIL, best)
            for b in range(a + 1, design.zone.shape[0]):
                if design.zone[b] == zone and workspace.part[a] != workspace.part[b]:
                    far = workspace.distance[roads.point[b]]
                    if far < best:
                        best = far
                        first, last = np.int64(a), np.int64(b)
        if first == NIL:
            return 0
        spread(roads, workspace, roads.point[first], roads.point[last], UNREACHED)
        add_segment(roads, design, workspace, zone, first, last)
        merge(design, workspace, zone, first, last)
        pieces -= 1
    return 1


@kernel
def label_parts(design, workspace, zone):
    """workspace.part from the segments; return the number of pieces of the zone."""
    pieces = np.int64(0)
    for s in range(design.zone.shape[0]):
        workspace.part[s] = s
        if design.zone[s] == zone:
            pieces += 1
    for m in range(design.segments):
        a, b = np.int64(design.ends[m, 0]), np.int64(design.ends[m, 1])
        if design.owner[m] == zone and workspace.part[a] != workspace.part[b]:
            merge(design, workspace, zone, a, b)
            pieces -= 1
    return pieces


@kernel
def merge(design, workspace, zone, a, b):
    """Merge two pieces."""
    keep, lose = np.int64(workspace.part[a]), np.int64(workspace.part[b])
    if keep > lose:
        keep, lose = lose, keep
    for s in range(design.zone.shape[0]):
        if design.zone[s] == zone and workspace.part[s] == lose:
            workspace.part[s] = keep


@kernel
def connect(roads, design, workspace, s, through, limit):
    """Join s to a station of another zone by that zone's shortest feasible path."""
    zone = np.int64(design.zone[through])
    if design.held[roads.point[s]] != NIL and design.held[roads.point[s]] != zone:
        return 0
    block_others(design, workspace, zone, zone)
    spread(roads, workspace, roads.point[through], roads.point[s], whole_cells(limit))
    if workspace.distance[roads.point[s]] == UNREACHED:
        return 0
    design.zone[s] = zone
    add_segment(roads, design, workspace, zone, through, s)
    return 1


# First designs: phase 1 of Ho & Liao, and random ones.
#
# Relation of two stations: RC = Wd (far - d) / (far - near) + Wf (F - least) / (most - least). The
# stations least related to all others are the seeds. Then the zones take turns: each connects the free
# station with the best relation to one of its own, while Wd grows and Wf shrinks. The authors' code
# takes the largest indices instead of the best relation; this code takes the true maximum.


@kernel
def first_design(roads, flow, design, workspace):
    """Phase 1; return 0 if zones outnumber stations, or if no zone can reach a free station."""
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
    """A seed for each zone: of the stations that its robot serves, the one least related to the others.

    Stations where only others have priority come last. Returns 0 if a zone finds no seed.
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
    """The minimum and maximum distance and flow between two stations."""
    found = False
    for a in range(flow.shape[0]):
        for b in range(flow.shape[0]):
            if a == b:
                continue
            far, loads = roads.between[a, b], flow[a, b]
            if not found or far < workspace.least_distance:
                workspace.least_distance = far
            if not found or far > workspace.largest_distance:
                workspace.largest_distance = far
            if not found or loads < workspace.least_flow:
                workspace.least_flow = loads
            if not found or loads > workspace.largest_flow:
                workspace.largest_flow = loads
            found = True


@kernel
def relation(workspace, loads, far, by_distance, by_flow):
    """RC of two stations for their distance `far` in cells and the loads between them."""
    value = 0.0
    apart = workspace.largest_distance - workspace.least_distance
    if apart > 0.0:
        value += by_distance * (workspace.largest_distance - far) / apart
    spread_of_loads = workspace.largest_flow - workspace.least_flow
    if spread_of_loads > 0.0:
        value += by_flow * (loads - workspace.least_flow) / spread_of_loads
    return value


@kernel
def connect_best(roads, flow, design, workspace, zone, by_distance, by_flow):
    """Connect the free station with the best relation to the zone; 0 if the zone reaches none."""
    block_others(design, workspace, zone, zone)
    inside, free = np.int64(NIL), np.int64(NIL)
    best = 0.0
    for i in range(design.zone.shape[0]):
        if design.zone[i] != zone:
            continue
        spread(roads, workspace, roads.point[i], NIL, UNREACHED)
        for j in range(design.zone.shape[0]):
            far = workspace.distance[roads.point[j]]
            if design.zone[j] != NIL or far == UNREACHED or workspace.serves[zone, j] == 0:
                continue
            value = relation(workspace, flow[i, j], far, by_distance, by_flow)
            value += PREFERRED * preference(workspace, zone, j)
            if free == NIL or value > best:
                best = value
                inside, free = np.int64(i), np.int64(j)
    if free == NIL:
        return 0
    return connect(roads, design, workspace, free, inside, UNREACHED)


@kernel
def random_design(roads, rules, design, workspace, seed, tick):
    """Random seeds, and random joins of adjacent stations; return 0 if no try succeeds.

    All tries fail if zones outnumber stations. Robots serve all stations of their zones. In the first
    half of the tries no zone takes stations where only others have priority.
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
    """A random station for each zone; 0 if a zone finds none."""
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
    """Whether a zone may take a station; strict: not a station where only others have priority."""
    return workspace.serves[zone, s] == 1 and not (strict and preference(workspace, zone, s) < 0)


@kernel
def random_join(roads, rules, design, workspace, strict, seed, tick):
    """Let a random zone take a random free station adjacent to one of its own; 1 on success."""
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
