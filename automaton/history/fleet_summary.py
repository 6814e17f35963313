"""The state of a fleet at a moment, in a few numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from automaton.engine.facilities import Lines
from automaton.engine.observation import CAUSE_NOT_WAITING, is_waiting
from automaton.engine.state import NIL, Array, Orders
from automaton.runs.progress import done_count

if TYPE_CHECKING:  # these need Numba
    from automaton.history.snapshot import Snapshot
    from automaton.runs.simulation import Simulation


class FleetSummary(NamedTuple):
    """Numbers of robots that work, wait, and are in a wait cycle; numbers of orders and lines."""

    working: int
    waiting: int
    circling: int  # waiting robots in wait cycles
    delivered: int
    orders: int
    lines_done: int = 0
    lines: int = 0  # 0 if orders have no lines


def summarize(snapshot: Snapshot) -> FleetSummary:
    """Summarize a snapshot. Robots that are parked or have no order neither work nor wait."""
    robots = snapshot.robots
    return _summary(
        robots.cause, robots.parked, robots.wait_cycle_ticks, snapshot.orders, snapshot.lines
    )


def summary_of(simulation: Simulation) -> FleetSummary:
    """Summarize an observed simulation."""
    world, observation = simulation.world, simulation.observation
    cycle = observation.wait_cycle_ticks
    return _summary(observation.cause, world.robots.parked, cycle, world.orders, world.lines)


def _summary(
    cause: Array, parked: Array, ring: Array, orders: Orders, lines: Lines
) -> FleetSummary:
    return FleetSummary(
        working=int(np.count_nonzero((cause == CAUSE_NOT_WAITING) & (parked == 0))),
        waiting=int(np.count_nonzero(is_waiting(cause))),
        circling=int(np.count_nonzero(ring)),
        delivered=done_count(orders, lines),
        orders=len(lines.left) if len(lines.order) else len(orders.state),
        lines_done=int(np.count_nonzero(lines.done != NIL)),
        lines=len(lines.order),
    )
