"""Scratch of the route searches (strategies.routing), sized for a floor and kinematics."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from automaton.engine.jit.structs import SCRATCH, STOP, Struct, field
from automaton.engine.state import Grid

Array = NDArray[Any]


class RouteSpace(Struct, role=SCRATCH):
    """What A*, replays and avoidance work in, for P poses and Z zones; it never decides anything."""

    label: Array = field("(P,) int64", "stamp << 32 | cost of the best way found to a pose")
    came: Array = field("(P,) uint8", "how it came there: a direction, a turn, or the start")
    # Each of the four ways into a pose may find it again.
    key: Array = field("(4P + 1,) int64", "heap: f << 32 | tie")
    item: Array = field("(4P + 1,) int64", "heap: number << 32 | pose")
    lane: Array = field("(4P + 1,) int64", "row << 32 | pose of the level that is expanded")
    state: Array = field("(8,) int64", "strategies.routing.astar.frontier")
    stop: Array = field("(1,) int64", "not 0 = searches find nothing any more", role=STOP)
    closed: Array = field("(Z,) uint8", "1 = no robot may enter")
    count: Array = field("(Z,) int32", "others that are predicted in each zone")


def route_space(grid: Grid) -> RouteSpace:
    """Scratch for searches on a floor; pages that no search uses cost nothing."""
    return RouteSpace.sized({"P": grid.kind.size * grid.headings, "Z": grid.traffic_zone_count})
