"""Scratch of the route searches (strategies.routing), sized for a floor and kinematics."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from automaton.engine.jit.fields import SCRATCH, STOP, field
from automaton.engine.jit.structs import Struct
from automaton.engine.state import Grid

Array = NDArray[Any]

IN_DEGREE = 4  # ways into a pose: each may find it again


class RouteSpace(Struct, role=SCRATCH):
    """What A*, replays and avoidance work in, for P poses and Z zones; it never decides anything."""

    label: Array = field("(P,) int64", "stamp << 32 | cost of the best way found to a pose")
    came: Array = field("(P,) uint8", "how it came there: a direction, a turn, or the start")
    key: Array = field("(4P + 1,) int64", "heap: f << 32 | tie")
    item: Array = field("(4P + 1,) int64", "heap: number << 32 | pose")
    lane: Array = field("(4P + 1,) int64", "row << 32 | pose of the level that is expanded")
    state: Array = field("(8,) int64", "strategies.routing.astar.frontier")
    stop: Array = field("(1,) int64", "not 0 = searches find nothing any more", role=STOP)
    closed: Array = field("(Z,) uint8", "1 = no robot may enter")
    count: Array = field("(Z,) int32", "others that are predicted in each zone")


class MonteCarloWorkspace(Struct):
    """What a Monte Carlo trial of r robots works in (strategies.routing.traffic_avoidance.monte_carlo).

    R steps of the longest task; Z zones.
    """

    task: Array = field("(r, 3) int32", "start, pick-up and drop-off cell")
    route: Array = field("(r, R) uint8", "directions of both legs")
    plain: Array = field("(R,) uint8", "robot 0's by plain A*")
    length: Array = field("(r,) int32")
    at: Array = field("(r,) int32", "steps driven")
    cell: Array = field("(r,) int32")
    busy: Array = field("(r,) int32", "ticks until it arrives")
    zone: Array = field("(r,) int32", "the zone it is in")
    met: Array = field("(r,) int32", "the zone in which robot 0 is together with it")
    used: Array = field("(words,) int64", "zones of one path, a bit for each")
    actual: Array = field("(Z,) int32", "others with a path through each zone")


def route_space(grid: Grid) -> RouteSpace:
    """Scratch for searches on a floor; pages that no search uses cost nothing."""
    return RouteSpace.sized({"P": grid.kind.size * grid.headings, "Z": grid.traffic_zone_count})


def monte_carlo_workspace(robots: int, steps: int, zones: int) -> MonteCarloWorkspace:
    """Room for trials of so many robots whose two legs have at most so many steps together."""
    return MonteCarloWorkspace.sized({"r": robots, "R": steps, "Z": zones, "words": words(zones)})


def words(zones: int) -> int:
    """int64 words of a set of zones, a bit for each."""
    return -(-zones // 64)
