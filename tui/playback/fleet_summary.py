"""How a fleet does at a moment, in five numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from automaton.engine.observation import CAUSE_NOT_WAITING, is_waiting
from automaton.engine.state import ORDER_DELIVERED, Array

if TYPE_CHECKING:  # it needs Numba
    from automaton.evidence.history.snapshot import Snapshot
    from automaton.runs.simulation import Simulation


class FleetSummary(NamedTuple):
    """Robots that work, are held up, and form a wait cycle; orders."""

    working: int
    waiting: int
    circling: int  # some of those who wait
    delivered: int
    orders: int


def summarize(snapshot: Snapshot) -> FleetSummary:
    """Count them. Who is parked or has no order neither works nor waits."""
    robots = snapshot.robots
    return _summary(robots.cause, robots.parked, robots.wait_cycle_ticks, snapshot.orders.state)


def summary_of(simulation: Simulation) -> FleetSummary:
    """The same of an observed simulation."""
    world, observation = simulation.world, simulation.observation
    return _summary(
        observation.cause, world.robots.parked, observation.wait_cycle_ticks, world.orders.state
    )


def _summary(cause: Array, parked: Array, ring: Array, orders: Array) -> FleetSummary:
    return FleetSummary(
        working=int(np.count_nonzero((cause == CAUSE_NOT_WAITING) & (parked == 0))),
        waiting=int(np.count_nonzero(is_waiting(cause))),
        circling=int(np.count_nonzero(ring)),
        delivered=int(np.count_nonzero(orders == ORDER_DELIVERED)),
        orders=len(orders),
    )
