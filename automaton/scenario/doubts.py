"""What is allowed in a scenario, but hardly meant: said as a warning, and run all the same."""

from __future__ import annotations

from automaton.scenario.resolve import Resolved
from automaton.world.cells import UNLIMITED

AVOIDS_TRAFFIC = ("traffic-avoidance", "congestion")  # routing strategies


def doubts(resolved: Resolved) -> list[str]:
    """A sentence for each."""
    world, routing = resolved.scenario.world, resolved.picks["routing"].name
    plan = resolved.plan
    crowds = bool((plan.capacity[plan.drivable()] == UNLIMITED).all())
    if routing in AVOIDS_TRAFFIC and crowds and world.slowdown == "none":
        return [
            f"routing {routing} finds no traffic to avoid: every cell holds any number of robots "
            "and world.slowdown is none, so no robot slows another; say world.slowdown: zones"
        ]
    return []
