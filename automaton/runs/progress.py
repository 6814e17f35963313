"""Whether a fleet gets on: robots that have finished nothing for long, and where they stand together.

A robot makes progress when it picks up or drops a load, makes a visit, or charges. That robots move
says little: in a jam they may turn and push each other for ever.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from automaton.engine.robot_status import STATUS_UP
from automaton.engine.state import (
    CLOCK_TICK,
    GOAL_NONE,
    GOAL_PARK,
    NIL,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
    Array,
    World,
)
from automaton.floor.floor_plan import FloorPlan

STARVED_TICKS: Final = 500
JAM_ROBOTS: Final = 2  # fewer that stand together do not count
REACH: Final = 2  # rows and columns between two robots of one jam


class Jam(NamedTuple):
    """Robots without progress that stand together, and the cells [x, y] of the corners around them."""

    robots: tuple[int, ...]
    first: tuple[int, int]
    last: tuple[int, int]


def starved_robots(world: World, ticks: int = STARVED_TICKS) -> Array:
    """Storage indices of robots with something to do that have finished nothing for so many ticks.

    Robots that are down, or queue for a charger, are not among them.
    """
    robots = world.robots
    at_work = (robots.goal_type != GOAL_NONE) & (robots.goal_type != GOAL_PARK)
    at_work &= (robots.status == STATUS_UP) & (robots.ticket == 0)
    stalled: Array = np.flatnonzero(
        at_work & (world.tally.progress <= int(world.clock[CLOCK_TICK]) - ticks)
    )
    return stalled


def oldest_order(world: World) -> int:
    """Ticks since the release of the order that has been open for longest; 0 if none is."""
    orders = world.orders
    is_open = (orders.state != ORDER_DELIVERED) & (orders.state != ORDER_UNRELEASED)
    if not is_open.any():
        return 0
    return int(world.clock[CLOCK_TICK]) - int(orders.release_tick[is_open].min())


def largest_jam(world: World, floor_plan: FloorPlan) -> Jam | None:
    """Return the most robots without progress that stand near each other, ties to the first robot."""
    stalled = starved_robots(world)
    stalled = stalled[world.robots.cell[stalled] != NIL]
    stalled = stalled[np.argsort(world.robots.identity[stalled])]
    places = np.array([floor_plan.xy(int(cell)) for cell in world.robots.cell[stalled]])
    groups = _groups(places) if len(stalled) else []
    largest = max(groups, key=len, default=[])
    if len(largest) < JAM_ROBOTS:
        return None
    (left, top), (right, bottom) = places[largest].min(0), places[largest].max(0)
    names = tuple(int(identity) for identity in world.robots.identity[stalled[sorted(largest)]])
    return Jam(names, (int(left), int(top)), (int(right), int(bottom)))


def _groups(places: Array) -> list[list[int]]:
    """Places within REACH of each other, transitively; each group by the place that comes first."""
    at: dict[tuple[int, int], list[int]] = {}
    for k, (x, y) in enumerate(places.tolist()):
        at.setdefault((x, y), []).append(k)
    groups, reached = [], set()
    for start in range(len(places)):
        if start in reached:
            continue
        group, waiting = [], [start]
        reached.add(start)
        while waiting:
            k = waiting.pop()
            group.append(k)
            x, y = places[k].tolist()
            near = (
                j
                for u in range(x - REACH, x + REACH + 1)
                for v in range(y - REACH, y + REACH + 1)
                for j in at.get((u, v), ())
            )
            for j in near:
                if j not in reached:
                    reached.add(j)
                    waiting.append(j)
        groups.append(group)
    return groups
