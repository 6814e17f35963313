"""Orders that are done after they are due, or not yet: how many they are, and by how many ticks.

An order counts from its release on. One that is open at the end counts as done then: it is late if it
is due before, else nothing is known of it, and only `not_yet_due` counts it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.engine.state import (
    CLOCK_TICK,
    NEVER,
    NIL,
    Array,
    World,
)
from automaton.runs.asked_orders import asked_orders, has_lines
from automaton.runs.task_metrics import quantile, summed


class DueOrders(NamedTuple):
    """The orders with a due time that were released: (k,) each."""

    ends: Array  # int64: tick of delivery, or the present one
    tardiness: Array  # int64: ticks from then on back to when it was due; 0: it is not late
    is_open: Array  # bool

    def after(self, tick: int) -> DueOrders:
        """Those that were done after a tick, or are open."""
        later = self.is_open | (self.ends > tick)
        return DueOrders(self.ends[later], self.tardiness[later], self.is_open[later])


def has_due_times(world: World) -> bool:
    """Whether any order has a due time."""
    due = world.lines.due if has_lines(world) else world.orders.due
    return bool((due != NEVER).any())


def due_orders(world: World) -> DueOrders:
    """The orders of a world that have a due time and were released."""
    orders = asked_orders(world)
    known = np.flatnonzero((orders.due != NEVER) & orders.is_known)
    is_open = orders.is_open[known]
    ends = np.where(is_open, world.clock[CLOCK_TICK], orders.done[known])
    return DueOrders(ends, np.maximum(0, ends - orders.due[known]), is_open)


def sums_of_due_times(world: World, borders: Array) -> dict[str, Array]:
    """What automaton.runs.metric_sums adds up of orders with a due time, in each stretch between borders.

    Those that are open belong to the last stretch. Nothing where no order has a due time.
    """
    if not has_due_times(world):
        return {}
    orders = due_orders(world)
    late = orders.tardiness > 0
    waits = orders.is_open & ~late
    ends = np.maximum(orders.ends, 1)  # ticks count from 1
    values = {
        "due_orders": ~waits,
        "late_orders": late,
        "not_yet_due": waits,
        "tardiness_ticks": orders.tardiness,
    }
    return {name: summed(ends, value, borders) for name, value in values.items()}


def tardiness_quantiles(world: World, since: int) -> dict[str, float]:
    """The quantiles of the tardiness of orders that were done after a tick, or are open."""
    values = due_orders(world).after(since).tardiness
    if not len(values):
        return {}
    return {f"tardiness_p{share}": quantile(values, share) for share in (95, 99)}


def lead_times(world: World, since: int) -> dict[str, float | int]:
    """Quantiles of the lead times of orders that were delivered after a tick, and the longest one.

    The longest one may be the age of an order that is open.
    """
    orders, now = asked_orders(world).after(since), int(world.clock[CLOCK_TICK])
    times = (orders.done - orders.release)[~orders.is_open]
    ages = now - orders.release[orders.is_open]
    figures: dict[str, float | int] = {}
    if len(times):
        figures |= {f"lead_time_p{share}": quantile(times, share) for share in (95, 99)}
    if len(times) or len(ages):
        figures["lead_time_max"] = int(max(times.max(initial=NIL), ages.max(initial=NIL)))
    return figures
