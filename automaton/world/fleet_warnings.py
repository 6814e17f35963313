"""Warn about fleets that will not get through: dead ends, crowds, a right of way that jams there."""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.floor.cells import CHARGER, STATION, STORAGE
from automaton.floor.dead_ends import DeadEnds, dead_ends_of
from automaton.scenario.schema import ROUTE_FOLLOWERS
from automaton.scenario.unavailable_metrics import carries_pods
from automaton.units import count
from automaton.world.default_right_of_way import (
    default_right_of_way,
    has_ringless_part,
    why_not_steered,
)
from automaton.world.resolve import Resolved

# Both by `automaton sweep crowds`, shares of the cells for one robot each.
JAM_SHARE: Final = 0.06  # half of 12 %, where retreat does 23 to 36 % of pibt's orders
# By `automaton sweep goods-fleet`: of the cells outside storage, 3 % under retreat, 4 % under wait.
POD_JAM_SHARE: Final = 0.03
CROWD_SHARE: Final = 0.9  # at 98 % pibt and epibt do fewer orders than at 50 %, on all floors
FEW_ROBOTS: Final = 10
MOST_NAMED: Final = 3


def fleet_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence for each warning about the size of a fleet and its right of way."""
    ends = dead_ends_of(resolved.floor_plan)
    if resolved.scenario.fleet.robots < 2:
        return []
    sentences = (
        has_stations_in_dead_ends(resolved, ends),
        has_homes_behind_others(resolved, ends),
        is_crowded(resolved, ends),
        jams_under_retreat(resolved),
        has_no_ring(resolved),
    )
    return [sentence for sentence in sentences if sentence]


def has_stations_in_dead_ends(resolved: Resolved, ends: DeadEnds) -> str:
    """Warn about stations and chargers out of which a robot comes as it went in."""
    kinds = resolved.floor_plan.kind.reshape(-1)
    inside = np.flatnonzero((ends.number >= 0) & ((kinds == STATION) | (kinds == CHARGER)))
    if not len(inside) or resolved.scenario.fleet.robots <= FEW_ROBOTS:
        return ""
    named = ", ".join(str(list(resolved.floor_plan.xy(int(c)))) for c in inside[:MOST_NAMED])
    more = f" and {len(inside) - MOST_NAMED} more" if len(inside) > MOST_NAMED else ""
    return (
        f"stations or chargers in dead ends ({named}{more}): one robot at a time goes in, and comes out "
        "again before the next; a second way out lets robots pass through"
    )


def has_homes_behind_others(resolved: Resolved, ends: DeadEnds) -> str:
    """Warn about homes in dead ends on the way to which another robot is to park.

    Homes that are drawn differ from seed to seed, and parking bays are off the floor.
    """
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    if not ends.total or scenario.stop.when != "parked" or scenario.fleet.when_idle == "leave":
        return ""
    if isinstance(resolved.start, str):
        return ""
    taken = set(resolved.start)
    walked: set[int] = set()
    blocking = []
    for home in sorted(cell for cell in taken if ends.number[cell] >= 0):
        cell = home
        while ends.number[cell] >= 0 and cell not in walked:
            walked.add(cell)
            cell += floor_plan.offsets[ends.way_out[cell]]
            if cell in taken and ends.number[cell] >= 0:
                blocking.append(cell)
                break
    if not blocking:
        return ""
    named = ", ".join(str(list(floor_plan.xy(cell))) for cell in blocking[:MOST_NAMED])
    return (
        f"homes of robots on the way into dead ends ({named}): robots whose homes lie deeper cannot get "
        "past one that is parked there; give each dead end one home at most"
    )


def is_crowded(resolved: Resolved, ends: DeadEnds) -> str:
    """Warn about more robots than have room to move."""
    floor_plan, robots = resolved.floor_plan, resolved.scenario.fleet.robots
    drivable = floor_plan.drivable.reshape(-1)
    if (floor_plan.capacity.reshape(-1)[drivable] != 1).any():
        return ""
    cells = int((drivable & (ends.number < 0)).sum())
    if robots <= CROWD_SHARE * cells or resolved.start == "parking-bays":
        return ""
    return (
        f"{count(robots, 'robot')} on {count(cells, 'cell')} for one robot each (dead ends aside) have "
        "hardly room to move; fewer orders may get done than with half as many robots (study crowds)"
    )


def jams_under_retreat(resolved: Resolved) -> str:
    """Warn about a right of way that follows routes where many robots share cells for one."""
    floor_plan, robots = resolved.floor_plan, resolved.scenario.fleet.robots
    name = resolved.strategies["right_of_way"].name
    drivable = floor_plan.drivable & (floor_plan.kind != STORAGE)  # no way leads through that
    share = POD_JAM_SHARE if carries_pods(resolved.scenario, resolved.floor_plan) else JAM_SHARE
    cells = int(drivable.sum())
    single = int((floor_plan.capacity[drivable] == 1).sum())
    if (
        name not in ROUTE_FOLLOWERS
        or 2 * single < cells
        or robots <= max(FEW_ROBOTS, share * cells)
    ):
        return ""
    way_out = ""  # where robots cannot be steered
    if not why_not_steered(resolved.scenario, resolved.fleet):
        better = default_right_of_way(resolved.scenario, resolved.fleet).name
        way_out = f"; right_of_way {better} gets such fleets through"
    return (
        f"right_of_way {name} jams with {count(robots, 'robot')} on {count(cells, 'cell')}, most of them "
        f"for one robot{way_out}"
    )


def has_no_ring(resolved: Resolved) -> str:
    """Warn about a right of way that steers where robots cannot pass each other."""
    name = resolved.strategies["right_of_way"].name
    if name in ROUTE_FOLLOWERS or not has_ringless_part(resolved.fleet):
        return ""
    return (
        "the floor has no ring of cells, so two robots that meet cannot pass each other, and "
        f"right_of_way {name} jams there; choose retreat, or join the ends of the tracks"
    )
