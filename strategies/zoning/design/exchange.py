"""Giving a station from one zone to another: what is left is joined again by shortest paths.

These kernels change a design in place and return 1, or 0 when it cannot be done; the design is then
spoiled, so callers work on a copy.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from automaton.strategy.kernels import copy_segment
from strategies.zoning.design.tip_stations import passes
from strategies.zoning.design.zone_paths import (
    add_segment,
    block_others,
    hold,
    size,
    spread,
    whole_cells,
)
from strategies.zoning.design.zone_workspace import INF_COST


@kernel
def give(roads, design, workspace, s, through, limit, smallest):
    """Give s to the zone of station `through`, joined to it by a path of at most `limit` cells.

    Refused when fewer than `smallest` stations would be left behind.
    """
    if size(design, design.zone[s]) <= smallest:
        return 0
    if remove(roads, design, workspace, s, design.zone[through]) == 0:
        return 0
    return connect(roads, design, workspace, s, through, limit)


@kernel
def remove(roads, design, workspace, s, to):
    """Take s out of its zone into zone `to` (or NIL) without a segment, and join what is left."""
    zone = np.int64(design.zone[s])
    point = np.int64(roads.point[s])
    drop_segments(design, zone, point)
    design.zone[s] = to
    hold(roads, design)
    return join(roads, design, workspace, zone, point)


@kernel
def drop_segments(design, zone, p):
    """Remove the segments of a zone that have the point; the others keep their order."""
    kept = np.int64(0)
    for m in range(design.segments[0]):
        if design.owner[m] == zone and passes(design, m, p) == 1:
            continue
        if kept < m:
            copy_segment(design, m, design, kept)
        kept += 1
    design.segments[0] = kept


@kernel
def join(roads, design, workspace, zone, closed):
    """Add shortest feasible paths between pieces of a zone until it is one (minimum spanning join).

    closed: a point that may not be used, or NIL. Ties: the lowest stations.
    """
    pieces = label_parts(design, workspace, zone)
    while pieces > 1:
        block_others(design, workspace, zone, zone)
        if closed != NIL:
            workspace.blocked[closed] = 1
        best = np.int64(INF_COST)
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
        spread(roads, workspace, roads.point[first], roads.point[last], INF_COST)
        add_segment(roads, design, workspace, zone, first, last)
        merge(design, workspace, zone, first, last)
        pieces -= 1
    return 1


@kernel
def label_parts(design, workspace, zone):
    """workspace.part from the segments; returns how many pieces the zone has."""
    pieces = np.int64(0)
    for s in range(design.zone.shape[0]):
        workspace.part[s] = s
        if design.zone[s] == zone:
            pieces += 1
    for m in range(design.segments[0]):
        a, b = np.int64(design.ends[m, 0]), np.int64(design.ends[m, 1])
        if design.owner[m] == zone and workspace.part[a] != workspace.part[b]:
            merge(design, workspace, zone, a, b)
            pieces -= 1
    return pieces


@kernel
def merge(design, workspace, zone, a, b):
    """Two pieces become one."""
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
    if workspace.distance[roads.point[s]] == INF_COST:
        return 0
    design.zone[s] = zone
    add_segment(roads, design, workspace, zone, through, s)
    return 1
