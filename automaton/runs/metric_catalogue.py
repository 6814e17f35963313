"""The metrics of a run: their units and meanings, and values in the units of a scenario.

Importing this needs no Numba.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from automaton.units import Unit, duration, unit

if TYPE_CHECKING:
    from automaton.world.resolve import Resolved

PER_1000_TICKS: Final = "orders/1000 ticks"  # of every throughput, here and in targets

# Name, unit and meaning of every metric of a run, in the order in which they are shown.
METRIC_CATALOGUE: dict[str, tuple[str, str]] = {
    "makespan": (
        "ticks",
        "ticks of the run: until all orders are delivered and all robots parked, or until it stops",
    ),
    "operations_per_robot": ("operations", "operations per robot"),
    "operations": ("operations", "operations of all robots"),
    "empty_moves_share": ("share", "moves without load / moves"),
    "empty_operations_share": ("share", "moves, turns and waits without load / operations"),
    "empty_ticks_share": ("share", "ticks of moves, turns and waits without load / active ticks"),
    "delivered": ("orders", "orders at their targets"),
    "throughput": (PER_1000_TICKS, "deliveries per time"),
    "ticks_per_operation": ("ticks", "active ticks per operation"),
    "lines_done": ("lines", "lines that were served at their stations"),
    "visits": ("visits", "stops of pods at stations that were done"),
    "lines_per_visit": ("lines", "lines that were served at a visit"),
    "trips": ("trips", "pods that were lifted, served and stored again"),
    "pod_moves": ("pods", "pods that were stored in another cell than they were lifted from"),
    "legs_per_order": ("pick-ups", "times that a delivered load was picked up"),
    "utilization": ("share", "active ticks / all robot ticks"),
    "blocked_share": (
        "share",
        "robot ticks lost to other robots and to illegal decisions / these and active ticks",
    ),
    "task_time": ("ticks", "time from taking an order to its delivery, both ticks included"),
    "delay": ("ticks", "time by which the task would be shorter on an empty floor"),
    "delay_p95": ("ticks", "95 % of the tasks of the run have this delay or less"),
    "throughput_per_robot": (
        f"{PER_1000_TICKS} and robot",
        "deliveries per time and robot, after the warm-up",
    ),
    "lost_waiting": ("ticks", "waits before a held cell"),
    "lost_refused": ("ticks", "retries and refused steps"),
    "lost_retreating": ("ticks", "decisions to retreat"),
    "lost_leaving_bay": ("ticks", "waits in the parking bay because the home cell was held"),
    "lost_queueing": ("ticks", "waits in the queue before a charger"),
    "lost_station_queue": ("ticks", "waits in the queue of a station"),
    "lost_illegal": ("ticks", "standstill after illegal decisions of a strategy"),
    "lost_held_back": ("ticks", "standstill because a right of way that steers held robots back"),
    "lost_at_gates": ("ticks", "waits before closed cells, doors, blocks and lifts"),
    "lost_following": ("ticks", "moves that last longer because of the robot ahead"),
    "slowdown_ticks": (
        "ticks",
        "reduced speed, not waiting: what moves take longer because of slow zones, "
        "speed limits and by chance; no part of blocked_share",
    ),
    "retreats": ("times", "retreats begun"),
    "lead_time": ("ticks", "time from the release of an order to its delivery"),
    "lead_time_p95": ("ticks", "95 % of the delivered orders have this lead time or less"),
    "lead_time_p99": ("ticks", "99 % of the delivered orders have this lead time or less"),
    "lead_time_max": ("ticks", "the longest lead time, or age of an order that is open at the end"),
    "late_share": (
        "share",
        "orders done after they were due, or open at the end and past it / those with a due time, but "
        "for not_yet_due",
    ),
    "not_yet_due": (
        "orders",
        "orders that are open at the end and due later; no part of late_share",
    ),
    "tardiness": (
        "ticks",
        "time from when an order was due until it was done, 0 if that was in time; open ones count as "
        "done at the end",
    ),
    "tardiness_p95": ("ticks", "95 % of the orders with a due time have this tardiness or less"),
    "tardiness_p99": ("ticks", "99 % of the orders with a due time have this tardiness or less"),
    "oldest_order": (
        "ticks",
        "age of the oldest order that is not done at the end, taken or waiting",
    ),
    "starved_robots": (
        "robots",
        "robots that have had something to do and finished nothing for 500 ticks, or for four times "
        "the drive over width and height of the floor if that is more",
    ),
    "energy": ("batteries", "energy used, in full batteries"),
    "charging_share": ("share", "ticks at chargers / all robot ticks"),
    "min_charge": ("share", "lowest battery charge at the end"),
    "repair_energy": ("batteries", "charge that repairs gave robots, in full batteries"),
    "battery_depletions": ("times", "a robot stopped with an empty battery"),
    "breakdowns": ("times", "a robot broke down"),
    "towed": ("times", "a robot was towed"),
    "downtime": ("ticks", "robots on the floor were down, failed or without charge"),
    "delayed_share": ("share", "robot ticks in which the robot was delayed / all robot ticks"),
    "distance": ("cells", "way that all robots drove"),
    "parts_finished": ("parts", "parts that were worked on at the last station of their routes"),
    "part_flow_time": (
        "ticks",
        "time from a part's arrival at its first station until it is finished",
    ),
    "busiest_station": ("number", "number of the station that works most"),
    "busiest_station_utilization": (
        "share",
        "ticks in which the busiest station works / ticks of the run",
    ),
    "redesigns": ("times", "new service zones took effect"),
    "balanced_share": ("share", "time in which service zones counted as balanced / monitored time"),
    "shared_orders": (
        "orders",
        "orders passed to the robot of another service zone because zones were unbalanced",
    ),
    "messages": ("messages", "messages that robots sent each other: bids, loads, turns"),
    "alternative_routes": ("times", "traffic avoidance chose another route than plain A*"),
    "deadlocks_resolved": (
        "times",
        "a robot stepped aside out of a wait cycle that had outlasted deadlock_patience",
    ),
    "illegal_answers": ("times", "decisions of strategies that broke a rule"),
}


def units_of(resolved: Resolved) -> tuple[Unit, Unit | None]:
    """What a tick and a cell's side stand for; None: the scenario does not say what a cell is."""
    units = resolved.scenario.units
    return unit(units.tick), None if units.cell is None else unit(units.cell)


def in_coarse_ticks(metrics: Mapping[str, Any], refinement: int) -> dict[str, Any]:
    """Return the metrics of a refined run in the ticks of its scenario, to be set beside others."""
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
    """Return the metrics in ticks and in cells with the scenario's units; nothing if a tick is just
    a tick.
    """
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
