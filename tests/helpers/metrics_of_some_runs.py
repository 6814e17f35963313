"""Metrics that not every run has."""

from __future__ import annotations

from automaton.scenario.unavailable_metrics import OF_DUE_TIMES, OF_LINES, OF_TIMES, TASK_METRICS

# Shown where tasks are measured, moves may take longer, a strategy counts them, orders come later
# have due times or are lines, robots run on batteries or may fail, right of way steers, stations work
# on parts, cells have a side.
OF_OTHER_RUNS = (
    *(
        *TASK_METRICS,
        "detour_share",
        "sum_of_costs",
        "slowdown_ticks",
        "alternative_routes",
        "deadlocks_resolved",
        *OF_TIMES,
        *OF_DUE_TIMES,
        *OF_LINES,
    ),
    *(
        "lost_charger_queue",
        "charger_queue_share",
        "station_queue_share",
        "longest_standstill",
        "lost_held_back",
        "lost_station_queue",
        "lost_following",
        "lost_at_gates",
        "lost_standing",
        "energy",
        "charging_share",
        "min_charge",
        "repair_energy",
        "battery_depletions",
    ),
    *("breakdowns", "towed", "downtime", "delayed_share"),
    *(
        "parts_finished",
        "part_flow_time",
        "busiest_station",
        "busiest_station_utilization",
        "distance",
    ),
    *("redesigns", "balanced_share", "shared_orders", "messages"),
)
