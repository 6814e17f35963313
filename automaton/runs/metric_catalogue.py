"""The metrics of a run: their units and meanings, and conversion to the units of a scenario.

This module imports without Numba.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from automaton.runs.metric_sums import TRAFFIC_SUMS
from automaton.units import Unit, duration, unit

if TYPE_CHECKING:
    from automaton.world.resolved import Resolved

PER_1000_TICKS: Final = "orders/1000 ticks"  # of every throughput, here and in targets

# Metrics that orders still open at the end do not raise: a strategy that leaves them open looks good.
OF_DELIVERED_ORDERS: Final = (
    *("lead_time", "lead_time_p95", "lead_time_p99", "delay", "delay_p95"),
    *("tardiness", "tardiness_p95", "tardiness_p99"),
)
UNEQUAL_SHARE: Final = 0.01  # difference of two shares of delivered orders that is worth a caveat

# Name, unit and meaning of every metric of a run, in the order in which they are shown.
METRIC_CATALOGUE: dict[str, tuple[str, str]] = {
    "makespan": (
        "ticks",
        "duration of a run that ends by itself: time until all orders are delivered and, if "
        "stop.when is parked, all robots are parked",
    ),
    "sum_of_costs": (
        "ticks",
        "sum over robots of the time of their last arrival on their target (one-shot path finding)",
    ),
    "operations_per_robot": ("operations", "mean number of operations of a robot"),
    "operations": ("operations", "number of operations of all robots"),
    "empty_moves_share": ("share", "share of moves without a load"),
    "empty_operations_share": (
        "share",
        "share of operations that are moves, turns or waits without a load",
    ),
    "empty_ticks_share": (
        "share",
        "share of active time spent on moves, turns and waits without a load",
    ),
    "delivered": ("orders", "number of delivered orders"),
    "throughput": (PER_1000_TICKS, "deliveries per time"),
    "ticks_per_operation": ("ticks", "mean active time per operation"),
    "lines_done": ("lines", "number of lines served at their stations"),
    "visits": ("visits", "number of completed stops of pods at stations"),
    "lines_per_visit": ("lines", "mean number of lines served per visit"),
    "trips": ("trips", "number of pods that were lifted, served and stored again"),
    "pod_moves": (
        "pods",
        "number of times that a pod was stored in another cell than the one it was lifted from",
    ),
    "legs_per_order": ("pick-ups", "mean number of pick-ups per delivered load"),
    "utilization": (
        "share",
        "share of robot time spent on orders: driving to them and with them, picks, drops and stops, "
        "without lost time",
    ),
    "busy_share": (
        "share",
        "share of robot time in which robots move, turn, handle, charge or lose time",
    ),
    "blocked_share": (
        "share",
        "time lost in traffic / time in which robots have something to do; queues of stations "
        "and chargers do not count as traffic",
    ),
    "station_queue_share": (
        "share",
        "time spent in queues of stations / time in which robots have something to do",
    ),
    "charger_queue_share": (
        "share",
        "time lost on the way to chargers / time in which robots have something to do",
    ),
    "task_time": ("ticks", "mean time from taking an order to its delivery, including both ticks"),
    "delay": ("ticks", "mean extra time of a task compared with an empty floor"),
    "delay_p95": ("ticks", "95th percentile of the delay of tasks"),
    "detour_share": (
        "share",
        "driving time on the ways that streets choose / driving time on the shortest ways - 1, for "
        "finished orders on an empty floor",
    ),
    "throughput_per_robot": (
        f"{PER_1000_TICKS} and robot",
        "deliveries per time and robot after the warm-up period",
    ),
    "lost_waiting": ("ticks", "time spent waiting before an occupied cell"),
    "lost_refused": ("ticks", "time spent on retries and on moves that the world refused"),
    "lost_retreating": ("ticks", "time spent on decisions to retreat"),
    "lost_leaving_bay": (
        "ticks",
        "time spent waiting in the parking bay because the home cell was occupied",
    ),
    "lost_charger_queue": (
        "ticks",
        "time lost by robots that have been sent to charge and cannot, wherever they wait",
    ),
    "lost_station_queue": ("ticks", "time spent in the queue of a station"),
    "lost_illegal": ("ticks", "time spent standing after an illegal decision of a strategy"),
    "lost_held_back": (
        "ticks",
        "time for which the right-of-way strategy made robots wait",
    ),
    "lost_at_gates": ("ticks", "time spent waiting before closed cells, doors, blocks and lifts"),
    "lost_following": (
        "ticks",
        "extra duration of moves that follow another robot and wait for it to leave the cell",
    ),
    "lost_making_way": (
        "ticks",
        "time that robots with orders spend on moves that later moves undo, and on turns that the "
        "next move did not need",
    ),
    "lost_standing": (
        "ticks",
        "time that real robots stand with an order and drive on later; a log does not show why",
    ),
    "slowdown_ticks": (
        "ticks",
        "extra duration of moves because of slow zones, speed limits and chance; not included in "
        "blocked_share",
    ),
    "deadlocks": (
        "times",
        "number of wait cycles in which no robot did anything else for 64 ticks",
    ),
    "deadlock_time": ("ticks", "robot time spent in deadlocks, including their first 64 ticks"),
    "longest_standstill": ("ticks", "duration of the longest deadlock"),
    "retreats": ("times", "number of retreats"),
    "lead_time": ("ticks", "mean time from the release of an order to its delivery"),
    "lead_time_p95": ("ticks", "95th percentile of the lead time of delivered orders"),
    "lead_time_p99": ("ticks", "99th percentile of the lead time of delivered orders"),
    "lead_time_max": (
        "ticks",
        "longest lead time of a delivered order, or greatest age of an order still open at the end",
    ),
    "late_share": (
        "share",
        "late orders / orders with a due time; late: delivered after the due time, or still open "
        "after it; released orders count, except those that are open and not yet due",
    ),
    "not_yet_due": (
        "orders",
        "number of orders that are open at the end but not yet due; late_share excludes them",
    ),
    "tardiness": (
        "ticks",
        "mean time by which orders with a due time were late; 0 for orders on time; an open order "
        "counts as if it were delivered at the end",
    ),
    "tardiness_p95": ("ticks", "95th percentile of the tardiness of orders with a due time"),
    "tardiness_p99": ("ticks", "99th percentile of the tardiness of orders with a due time"),
    "oldest_order": ("ticks", "age of the oldest order still open at the end"),
    "starved_robots": (
        "robots",
        "number of robots that have work at the end but completed no task in the last 500 "
        "ticks, or in the last four drives across the floor if that is longer; without robots "
        "that are served, or queue at a station that is serving",
    ),
    "energy": ("batteries", "energy used, in full batteries"),
    "charging_share": ("share", "share of robot time spent at chargers"),
    "min_charge": ("share", "lowest battery charge at the end"),
    "repair_energy": ("batteries", "energy added by repairs, in full batteries"),
    "battery_depletions": ("times", "number of times that a robot stopped with an empty battery"),
    "breakdowns": ("times", "number of breakdowns"),
    "towed": ("times", "number of times that a robot was towed"),
    "downtime": ("ticks", "time in which robots on the floor were broken down or without charge"),
    "delayed_share": ("share", "share of robot time in which the robot was delayed"),
    "distance": ("cells", "distance driven by all robots"),
    "parts_finished": ("parts", "number of parts finished at the last station of their route"),
    "part_flow_time": (
        "ticks",
        "mean time from the arrival of a part at its first station until it is finished",
    ),
    "busiest_station": ("number", "number of the station with the highest utilization"),
    "busiest_station_utilization": ("share", "share of the run in which the busiest station works"),
    "redesigns": ("times", "number of times that new service zones took effect"),
    "balanced_share": ("share", "share of monitored time in which the service zones were balanced"),
    "shared_orders": (
        "orders",
        "number of orders passed to the robot of another service zone because zones were unbalanced",
    ),
    "messages": ("messages", "number of messages between robots: bids, loads and turns"),
    "alternative_routes": (
        "times",
        "number of times that traffic avoidance chose another route than plain A*",
    ),
    "deadlocks_resolved": (
        "times",
        "number of times that a robot stepped aside to break a wait cycle older than deadlock_patience",
    ),
    "illegal_answers": ("times", "number of decisions of strategies that broke a rule"),
}


class TimePart(NamedTuple):
    """A part of the time of robots in drawings."""

    colour: str
    uses: Mapping[
        str, str
    ]  # what belongs to it, with meanings; metrics have theirs in the catalogue

    def ticks(self, uses: Mapping[str, int]) -> int:
        """Its robot ticks of those of a run."""
        return sum(uses.get(name, 0) for name in self.uses)


# What each robot tick is used for, from orders to idling: the same parts in reports, viewer and films.
TIME_USES: Final = {
    "driving loaded": TimePart("#e69f00", {"driving_loaded": "moves with a load, for an order"}),
    "driving empty": TimePart(
        "#56b4e9",
        {
            "driving_empty": "moves to an order",
            "driving_aside": "moves and turns without an order: to park, or pushed aside",
        },
    ),
    "turning": TimePart("#0072b2", {"turning": "turns for an order"}),
    "handling": TimePart("#009e73", {"handling": "picks, drops and stops"}),
    "station queue": TimePart("#cc79a7", {"lost_station_queue": ""}),
    "traffic": TimePart(
        "#d55e00", {name: "" for name in (*TRAFFIC_SUMS, "lost_illegal", "lost_standing")}
    ),
    "charger queue": TimePart("#8c510a", {"lost_charger_queue": ""}),
    "to chargers": TimePart(
        "#a39a1c", {"driving_to_chargers": "moves and turns on the way to chargers"}
    ),
    "charging": TimePart("#f0e442", {"charging": "charging"}),
    "down": TimePart(
        "#6b6b6b",
        {
            "down": "broken down or without charge, on the floor",
            "delayed": "delayed, with nothing under way",
        },
    ),
    "idle": TimePart("#bdbdbd", {"idle": "without an order, parked, or off the floor for repair"}),
}
USE_MEANINGS: Final = {
    name: meaning or METRIC_CATALOGUE[name][1]
    for part in TIME_USES.values()
    for name, meaning in part.uses.items()
}


TIME_TITLE: Final = "where the time of the robots went"


def time_shares(uses: Mapping[str, int]) -> list[tuple[str, float, str]]:
    """Name, share and colour of each part of the robots' time that is not 0."""
    total = max(sum(uses.values()), 1)
    shares = ((name, part.ticks(uses) / total, part.colour) for name, part in TIME_USES.items())
    return [one for one in shares if one[1]]


def mean_time_shares(
    runs: Sequence[Sequence[tuple[str, float, str]]],
) -> list[tuple[str, float, str]]:
    """The mean of the `time_shares` of several runs, each of which counts alike."""
    sums = dict.fromkeys(TIME_USES, 0.0)
    for name, share, _ in (part for shares in runs for part in shares):
        sums[name] += share
    many = max(len(runs), 1)
    return [
        (name, sums[name] / many, part.colour) for name, part in TIME_USES.items() if sums[name]
    ]


def units_of(resolved: Resolved) -> tuple[Unit, Unit | None]:
    """The units of a tick and of a cell's side; None if the scenario gives cells no size."""
    units = resolved.scenario.units
    return unit(units.tick), None if units.cell is None else unit(units.cell)


def in_coarse_ticks(metrics: Mapping[str, Any], refinement: int) -> dict[str, Any]:
    """Convert the metrics of a refined run to the ticks of the unrefined scenario."""
    if refinement == 1:
        return dict(metrics)
    result = {}
    for name, value in metrics.items():
        kind = METRIC_CATALOGUE[name][0] if name in METRIC_CATALOGUE else ""
        per_ticks = kind.startswith(PER_1000_TICKS)
        result[name] = value / refinement if kind == "ticks" else value
        result[name] = value * refinement if per_ticks else result[name]
    return result


def to_scenario_units(
    metrics: Mapping[str, float], tick: Unit, cell: Unit | None
) -> dict[str, Any]:
    """Convert the metrics in ticks and in cells to the scenario's units, where it gives some."""
    in_units = {}
    for name, value in metrics.items():
        kind = METRIC_CATALOGUE[name][0] if name in METRIC_CATALOGUE else ""
        if kind == "ticks" and tick.name not in ("tick", "ticks"):
            amount, name_of_unit = duration(value, tick)
        elif kind == "cells" and cell is not None:
            amount, name_of_unit = cell.of(value), cell.name
        else:
            continue
        in_units[name] = {"value": amount, "unit": name_of_unit}
    return in_units
