"""Shortest ways that a zone may use, and what a design holds.

Feasible path of a zone: over points that no other zone holds. Union path of two zones: over points
that no third zone holds. A zone holds the points of its segments and of its stations (the authors'
code forgets the station of a zone that has only one).
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from automaton.strategy.kernels import copy_segment
from strategies.zoning.design.zone_workspace import INF_COST


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
