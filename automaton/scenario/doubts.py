"""What is allowed in a scenario, but hardly meant: said as a warning, and run all the same."""

from __future__ import annotations

import numpy as np

from automaton.scenario.resolve import Resolved
from automaton.world.cells import CHARGER, UNLIMITED

AVOIDS_TRAFFIC = ("traffic-avoidance", "congestion")  # routing strategies


NO_STRATEGY = "none"


def doubts(resolved: Resolved) -> list[str]:
    """A sentence for each."""
    found = (nothing_to_avoid(resolved), parks_on_charger(resolved))
    return [sentence for sentence in found if sentence]


def nothing_to_avoid(resolved: Resolved) -> str:
    """Avoiding traffic where no robot slows another."""
    world, routing = resolved.scenario.world, resolved.picks["routing"].name
    plan = resolved.plan
    crowds = bool((plan.capacity[plan.drivable()] == UNLIMITED).all())
    if routing in AVOIDS_TRAFFIC and crowds and world.slowdown == "none":
        return (
            f"routing {routing} finds no traffic to avoid: every cell holds any number of robots "
            "and world.slowdown is none, so no robot slows another; say world.slowdown: zones"
        )
    return ""


def parks_on_charger(resolved: Resolved) -> str:
    """A robot parks where it begins: on a charger it is in the way of those that must charge."""
    scenario, plan, start = resolved.scenario, resolved.plan, resolved.start
    robots, chargers = scenario.fleet.robots, int(np.count_nonzero(plan.kind == CHARGER))
    if resolved.picks["charging"].name == NO_STRATEGY or not isinstance(start, tuple):
        return ""
    if scenario.fleet.when_done != "park" or chargers >= robots:
        return ""
    for robot, cell in enumerate(start):
        if plan.kind.flat[cell] == CHARGER:
            x, y = plan.xy(cell)
            return (
                f"robot {robot} begins at [{x}, {y}], and so parks there, on a charger that others "
                f"need: {robots} robots share {chargers}; let it begin beside it"
            )
    return ""
