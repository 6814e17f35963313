"""Scratch of the route searches, made once for a floor and kinematics."""

from __future__ import annotations

import numpy as np

from automaton.struct import Struct
from automaton.world.state import Array

IN_DEGREE = 4  # ways into a pose: each may find it anew


class RouteSpace(Struct):
    """What A*, replays and avoidance work in; contents never decide anything.

    P poses, Z zones, R steps of the longest route.
    """

    label: Array  # (P,) int64: stamp << 32 | cost of the best way found to a pose
    came: Array  # (P,) uint8: how it came there: a direction, a turn, or the start
    key: Array  # (4P,) int64, heap: f << 32 | tie
    item: Array  # (4P,) int64, heap: number << 32 | pose
    lane: Array  # (4P,) int64: row << 32 | pose of the level that is expanded
    state: Array  # (8,) int64, automaton.kernels.routes.frontier
    closed: Array  # (Z,) uint8: 1 = no robot may enter
    count: Array  # (Z,) int32: others that are foreseen in each zone


class TrialSpace(Struct):
    """What a Monte Carlo trial of r robots works in (automaton.kernels.routes.trial)."""

    task: Array  # (r, 3) int32: start, pick-up and drop-off cell
    route: Array  # (r, R) uint8: directions of both legs
    plain: Array  # (R,) uint8: robot 0's by plain A*
    length: Array  # (r,) int32
    at: Array  # (r,) int32: steps driven
    cell: Array  # (r,) int32
    busy: Array  # (r,) int32: ticks until it arrives
    zone: Array  # (r,) int32: the zone it is in
    met: Array  # (r,) int32: the zone in which robot 0 is together with it
    used: Array  # (words,) int64: zones of one path, a bit for each
    actual: Array  # (Z,) int32: others with a path through each zone
