"""Metrics as quotients of sums that a run accumulates, so that any stretch can be measured alone.

    throughput = 1000 deliveries / ticks
    blocked_share = ticks lost in traffic / ticks with something to do

The sums of consecutive stretches add up to the sums of the whole. Other metrics, such as quantiles
of orders and the busiest station, cannot be computed by stretch once the run is over.
This module imports without Numba and NumPy.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from automaton.engine.state import BATTERY_FULL

# Robot time lost in traffic: to other robots, to closed ways, and to right of way.
TRAFFIC_SUMS: Final = (
    *("lost_waiting", "lost_refused", "lost_retreating", "lost_leaving_bay", "lost_held_back"),
    *("lost_at_gates", "lost_following", "lost_making_way"),
)
LOST_TICK_SUMS: Final = (
    *TRAFFIC_SUMS,
    *("lost_station_queue", "lost_charger_queue", "lost_illegal"),
)
COUNTED_BY_STRATEGIES: Final = (
    *(
        "redesigns",
        "shared_orders",
        "messages",
        "alternative_routes",
        "deadlocks_resolved",
        "ticks_in_balance",
        "ticks_watched",
    ),
)
# Sums that steady-state rows store for each stretch. "charge" is in battery units; "taken" counts tasks.
SUMS: Final = (
    *("ticks", "robot_ticks"),
    *("operations", "moves", "empty_moves", "empty_driving", "empty_driving_ticks", "active"),
    *("engaged", "on_orders", "driving_to_chargers", "driving_aside"),
    *LOST_TICK_SUMS,
    *("deadlocks", "deadlock_time"),
    *("retreats", "illegal_answers", "slowdown_ticks", "distance"),
    *("charge", "charging", "battery_depletions", "repaired", "breakdowns", "towed", "downtime"),
    "delayed",
    *("delivered", "legs", "timed", "lead_times"),
    *("lines_done", "visits", "trips", "pod_moves"),
    *("due_orders", "late_orders", "not_yet_due", "tardiness_ticks"),
    *("taken", "task_times", "delays"),
    *("detour_ticks", "shortest_ticks"),
    *("parts_finished", "part_flow_times"),
    *COUNTED_BY_STRATEGIES,
)
# What rows store of each period of a run: fields of Period; "stations" and "chargers" are means.
PERIOD_COLUMNS: Final = (
    *("begin", "end", "done", "backlog", "late", "on_orders", "in_traffic", "in_station_queues"),
    *("charging", "to_chargers", "for_chargers", "aside", "down", "delayed", "refused", "idle"),
    *("stations", "chargers"),
)
TASK_SUMS: Final = {*SUMS, "robots", "completed", "watched_robot_ticks"} - {*COUNTED_BY_STRATEGIES}


class Quotient(NamedTuple):
    """A metric: times * part / whole."""

    part: str | tuple[str, ...]  # a sum, or several; sums that are absent are ignored
    whole: str | tuple[str, ...] | int = 1  # likewise, or a number
    times: int = 1
    measured: bool = True  # where the whole is 0 the metric is 0 if True, absent if False


QUOTIENTS: Final = {
    "operations_per_robot": Quotient("operations", "robots"),
    "operations": Quotient("operations"),
    "empty_moves_share": Quotient("empty_moves", "moves"),
    "empty_operations_share": Quotient("empty_driving", "operations"),
    "empty_ticks_share": Quotient("empty_driving_ticks", "active"),
    "delivered": Quotient("delivered"),
    "throughput": Quotient("delivered", "ticks", 1000),
    "ticks_per_operation": Quotient("active", "operations"),
    "legs_per_order": Quotient("legs", "delivered", measured=False),
    "utilization": Quotient("on_orders", "robot_ticks"),
    "busy_share": Quotient("active", "robot_ticks"),
    "blocked_share": Quotient(TRAFFIC_SUMS, "engaged"),
    "station_queue_share": Quotient("lost_station_queue", "engaged"),
    "charger_queue_share": Quotient("lost_charger_queue", "engaged"),
    "task_time": Quotient("task_times", "taken", measured=False),
    "delay": Quotient("delays", "taken", measured=False),
    "detour_share": Quotient("detour_ticks", "shortest_ticks", measured=False),
    "throughput_per_robot": Quotient("completed", "watched_robot_ticks", 1000),
    "lines_per_visit": Quotient("lines_done", "visits", measured=False),
    "lead_time": Quotient("lead_times", "timed", measured=False),
    "late_share": Quotient("late_orders", "due_orders", measured=False),
    "tardiness": Quotient("tardiness_ticks", ("due_orders", "not_yet_due"), measured=False),
    "energy": Quotient("charge", BATTERY_FULL),
    "repair_energy": Quotient("repaired", BATTERY_FULL),
    "charging_share": Quotient("charging", "robot_ticks"),
    "delayed_share": Quotient("delayed", "robot_ticks"),
    "part_flow_time": Quotient("part_flow_times", "parts_finished", measured=False),
    "balanced_share": Quotient("ticks_in_balance", "ticks_watched", measured=False),
}


def metric(name: str, sums: Mapping[str, int]) -> float | int | None:
    """Compute a metric of a stretch from its sums; None if the sums do not determine it.

    `sums` holds SUMS and `robots`, and if tasks are measured also `completed` and
    `watched_robot_ticks`. A metric without a quotient is itself one of these sums.
    """
    quotient = QUOTIENTS.get(name, Quotient(name))
    parts = [sums[part] for part in _names(quotient.part) if part in sums]
    if not parts:
        return None
    value, whole = quotient.times * sum(parts), quotient.whole
    if whole == 1:
        return value
    if not isinstance(whole, int):
        whole = sum(sums.get(name, 0) for name in _names(whole))
    if not whole:
        return 0.0 if quotient.measured else None
    return float(value) / float(whole)


def _names(sums: str | tuple[str, ...]) -> tuple[str, ...]:
    return (sums,) if isinstance(sums, str) else sums
