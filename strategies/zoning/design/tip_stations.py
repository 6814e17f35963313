"""Tip workstations: those that a single way joins to the rest of their zone.

A station at point p is a tip if exactly one neighbour of p shares a segment of the zone with p (by
membership, as in the authors' code, not by following the segment), or if it is alone in its zone.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL


@kernel
def find_tips(roads, design, workspace):
    """workspace.tip of all stations."""
    for s in range(design.zone.shape[0]):
        workspace.tip[s] = is_tip(roads, design, s)


@kernel
def is_tip(roads, design, s):
    """1 if a station is a tip of its zone."""
    p = np.int64(roads.point[s])
    only = np.int64(NIL)
    for m in range(design.segments[0]):
        if design.owner[m] != design.zone[s] or passes(design, m, p) == 0:
            continue
        for k in range(design.points[m]):
            q = np.int64(design.path[m, k])
            if q == p or q == only or linked(roads, p, q) == 0:
                continue
            if only != NIL:
                return 0
            only = q
    return 1


@kernel
def passes(design, m, p):
    """1 if a segment has a point."""
    for k in range(design.points[m]):
        if design.path[m, k] == p:
            return 1
    return 0


@kernel
def linked(roads, p, q):
    """1 if a straight way leads from one point to the other, in either direction."""
    for d in range(4):
        if roads.next[p, d] == q or roads.next[q, d] == p:
            return 1
    return 0
