"""Metrics that not every run has."""

from __future__ import annotations

from automaton.tasks import TASK_METRICS

# Shown where tasks are measured, moves may take longer, a strategy counts them, orders come later,
# robots run on batteries or may fail, stations work on parts, cells have a side.
OF_OTHER_RUNS = (
    *(*TASK_METRICS, "slowed", "alternatives", "lead_time", "lead_time_p95"),
    *("lost_in_line", "energy", "charging", "least_charge", "repair_energy", "ran_empty"),
    *("breakdowns", "towed", "out_of_order"),
    *("parts", "part_time", "busiest_station", "busiest", "travel"),
    *("redesigns", "in_balance", "load_shares", "messages"),
)
