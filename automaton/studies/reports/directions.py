"""Which way a metric is better: a best point can only be named where that is known."""

from __future__ import annotations

from typing import Final, Literal

Direction = Literal["lowest", "highest"]

HIGHER_IS_BETTER: Final = frozenset(
    (
        "delivered",
        "throughput",
        "throughput_per_robot",
        "lines_done",
        "lines_per_visit",
        "parts_finished",
        "min_charge",
        "balanced_share",
        "ticks_per_second",
    )
)
LOWER_IS_BETTER: Final = frozenset(
    (
        "makespan",
        "ticks",
        "operations",
        "operations_per_robot",
        "empty_moves_share",
        "empty_operations_share",
        "empty_ticks_share",
        "ticks_per_operation",
        "legs_per_order",
        "blocked_share",
        "task_time",
        "delay",
        "delay_p95",
        "slowdown_ticks",
        "retreats",
        "lead_time",
        "lead_time_p95",
        "lead_time_p99",
        "lead_time_max",
        "late_share",
        "tardiness",
        "tardiness_p95",
        "tardiness_p99",
        "oldest_order",
        "starved_robots",
        "energy",
        "repair_energy",
        "battery_depletions",
        "breakdowns",
        "towed",
        "downtime",
        "delayed_share",
        "distance",
        "part_flow_time",
        "messages",
        "illegal_answers",
        "deadlocks_resolved",
    )
)


def direction_of(metric: str) -> Direction | None:
    """Whether the lowest or the highest mean of a metric is the best; None: neither is."""
    if metric in HIGHER_IS_BETTER:
        return "highest"
    if metric in LOWER_IS_BETTER or metric.startswith("lost_"):
        return "lowest"
    return None
