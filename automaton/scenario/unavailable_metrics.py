"""The metrics that no run of a scenario can have, known before any run.

Metrics that strategies define are not covered. Importing this needs no Numba.
"""

from __future__ import annotations

from typing import Any, Final

from automaton.scenario.order_lines import has_due_times, line_column, listed_lines
from automaton.scenario.robot_types import follows_in_convoy
from automaton.scenario.schema import Scenario
from automaton.strategy.lookup import STEERS, declares

TASK_METRICS: Final = ("task_time", "delay", "delay_p95", "throughput_per_robot")
OF_TIMES: Final = ("lead_time", "lead_time_p95", "lead_time_p99", "lead_time_max")
OF_DUE_TIMES: Final = ("late_share", "not_yet_due", "tardiness", "tardiness_p95", "tardiness_p99")
OF_BATTERIES: Final = (
    *("lost_charger_queue", "charger_queue_share", "energy", "charging_share"),
    *("min_charge", "repair_energy", "battery_depletions"),
)
OF_LINES: Final = ("lines_done", "visits", "lines_per_visit", "trips", "pod_moves")
OF_FAULTS: Final = ("breakdowns", "towed", "downtime")
OF_STATIONS: Final = (
    "parts_finished",
    "part_flow_time",
    "busiest_station",
    "busiest_station_utilization",
)


def name_of(choice: Any) -> str:
    """The name of a strategy in a scenario, with or without parameters."""
    return str(choice if isinstance(choice, str) else choice.get("name"))


def not_measured(scenario: Scenario) -> dict[str, str]:
    """The metrics that no run of a scenario can have, each with its requirement."""
    orders, world, faults = scenario.orders, scenario.world, scenario.faults
    powered = scenario.battery is not None
    later = any(order.release > 0 for order in orders.listed or ())  # lines of a file included
    later = later or bool((line_column(listed_lines(orders), "release") > 0).any())
    come_in = (
        later
        or getattr(orders.lines, "mean_interarrival_time", 0) > 0
        or orders.mean_interarrival_time > 0
        or orders.arrivals is not None
        or orders.parts is not None
        or orders.revealed is not None
        or orders.assign == "round-robin"
    )
    rules = (
        (("makespan",), scenario.stop.when != "never", "stop: {when: parked} or {when: delivered}"),
        (("sum_of_costs",), scenario.stop.when == "on-targets", "stop: {when: on-targets}"),
        (("detour_share",), scenario.streets is not None, "streets"),
        (TASK_METRICS, scenario.measure is not None, "measure: {warm_up: N}"),
        (
            OF_TIMES,
            come_in,
            "orders that arrive over time: orders.mean_interarrival_time, orders.arrivals, or "
            "orders.list with release",
        ),
        (
            OF_DUE_TIMES,
            has_due_times(orders),
            "orders with due times: due in orders.list or orders.lines, or as a column of their files",
        ),
        (OF_BATTERIES, powered, "a battery"),
        (
            OF_FAULTS,
            powered or bool(faults.listed) or faults.probability > 0,
            "faults, or a battery",
        ),
        (("delayed_share",), faults.delays is not None, "faults.delays"),
        (OF_LINES, orders.lines is not None, "orders.lines"),
        (
            ("lost_station_queue", "station_queue_share"),
            orders.lines is not None or any(one.queue for one in scenario.stations.values()),
            "orders.lines, or stations with a queue",
        ),
        (("legs_per_order",), orders.lines is None, "orders that are not lines"),
        (OF_STATIONS, orders.parts is not None, "orders.parts"),
        (
            ("lost_held_back",),
            declares("right_of_way", name_of(scenario.strategy.right_of_way), STEERS),
            "a right of way that holds robots back",
        ),
        (
            ("lost_at_gates",),
            scenario.floor.has_gates,
            "floor.closed, floor.doors, floor.blocks or floor.lifts",
        ),
        (
            ("lost_following",),
            follows_in_convoy(scenario),
            "world.following convoy, and moves of several ticks",
        ),
        (("lost_standing",), False, "a log of real robots"),
        (("distance",), scenario.units.cell is not None, "units.cell"),
        (
            ("slowdown_ticks",),
            world.slowdown != "none"
            or world.extra_tick_probability > 0
            or bool(scenario.floor.speed_limits),
            "world.slowdown, world.extra_tick_probability or floor.speed_limits",
        ),
    )
    return {name: need for names, has, need in rules if not has for name in names}


def warm_up_of(scenario: Scenario) -> int:
    """The warm-up ticks that metrics of many runs exclude.

    A run that ends with its orders has no steady state, so all of it counts.
    """
    if scenario.stop.when != "never" or scenario.measure is None:
        return 0
    return scenario.measure.warm_up
