"""The metrics of tasks, of due times and of stations.

A task is an order that one robot carries all the way. It lasts from the tick in which the robot
takes the order to the tick of its delivery, both included. Its delay is its time minus its least
time. The least time of an order with a load consists of its legs, driven as fast as the empty floor
allows with the turns needed from the initial heading, the pick, and the tick in which the load is
dropped. The least time of an order without a load consists of the legs between its stops: each takes
at least one tick, and each but the first begins with the best heading.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from automaton.engine.state import (
    ACTION_DROP,
    ACTION_PICK,
    NEVER,
    NIL,
    ORDER_DELIVERED,
    Array,
    Workspace,
    World,
)
from automaton.runs.interruption import interruptible
from automaton.runs.progress import AskedOrders, asked_orders, has_lines
from automaton.runs.task_lower_bounds import guided_way_ticks, min_drive_ticks
from automaton.scenario.order_lines import classes_of_orders
from automaton.scenario.table_fields import NOTHING
from automaton.world.resolved import Resolved


class Measured(Protocol):
    """What the metrics of tasks need of a simulation."""

    @property
    def world(self) -> World: ...
    @property
    def view(self) -> World: ...
    @property
    def workspace(self) -> Workspace: ...
    @property
    def resolved(self) -> Resolved: ...
    @property
    def least(self) -> Array: ...
    @property
    def guided(self) -> Array: ...
    @property
    def counted(self) -> Mapping[str, int]: ...


class FinishedTasks(NamedTuple):
    """Finished tasks: the tick in which each was taken, its duration, and its delay."""

    begun: Array  # (k,) ticks; the other arrays likewise
    times: Array
    delays: Array

    @property
    def sums(self) -> dict[str, Array]:
        """The values of each task that automaton.runs.metric_sums adds up."""
        return {
            "taken": np.ones(len(self.begun), np.int64),
            "task_times": self.times,
            "delays": self.delays,
        }


def tasks_after(run: Measured, tick: int) -> FinishedTasks:
    """The tasks that were taken after a tick and are done."""
    world = run.world
    orders = world.orders
    whole = (orders.state == ORDER_DELIVERED) & (orders.legs == 1)
    tasks = np.flatnonzero(whole & (orders.dispatched > tick))
    times = task_times(world, tasks)
    return FinishedTasks(orders.dispatched[tasks], times, times - least_times(run, tasks))


def summed(ticks: Array, values: Array, borders: Array) -> Array:
    """(borders - 1,) int64: sums of values by the stretch that contains their ticks.

    A stretch begins after a border and includes the next one; borders ascend. Values up to the first
    border are ignored; values after the last one belong to the last stretch.
    """
    stretch = np.minimum(np.searchsorted(borders, ticks) - 1, len(borders) - 2)
    inside = stretch >= 0
    found = np.bincount(stretch[inside], values[inside], len(borders) - 1)
    return found.astype(np.int64)  # exact below 2^53


def quantile(values: Array, share: int) -> float:
    """The percentile `share` of at least one value: the least value that `share` percent do not exceed.

    It describes one run only, since the orders of a run are not independent of each other.
    """
    return float(np.sort(values)[-(-share * len(values) // 100) - 1])


def task_times(world: World, tasks: Array) -> Array:
    """(k,) ticks from taking each of these delivered orders to its delivery."""
    orders = world.orders
    times: Array = orders.delivered[tasks].astype(np.int64) - orders.dispatched[tasks] + 1
    return times


def least_times(run: Measured, tasks: Array) -> Array:
    """(k,) the least ticks that each of these delivered orders could have taken."""
    unknown = tasks[run.least[tasks] == NIL]
    if len(unknown):
        with interruptible(run.workspace.stop):
            min_drive_ticks(run.view, run.workspace, unknown, run.least)
    duration = run.world.rules.duration[run.world.orders.dispatched_type[tasks]]
    handling = duration[:, ACTION_PICK].astype(np.int64) + np.minimum(1, duration[:, ACTION_DROP])
    has_load = run.world.orders.source[tasks] != NIL
    times: Array = run.least[tasks] + handling * has_load
    return times


def sums_of_detours(run: Measured, borders: Array) -> dict[str, Array]:
    """Driving ticks of the tasks that were done in each stretch between borders, on the empty floor.

    Those of the shortest ways, and the extra ticks of the ways that the weights of streets choose. Empty
    without streets.
    """
    if run.resolved.scenario.streets is None:
        return {}
    orders, guided = run.world.orders, run.guided
    tasks = np.flatnonzero((orders.state == ORDER_DELIVERED) & (orders.legs == 1))
    tasks = tasks[orders.delivered[tasks] > borders[0]]
    unknown = tasks[guided[tasks, 0] == NIL]
    if len(unknown):
        ticks = np.zeros((len(unknown), 2), np.int32)
        with interruptible(run.workspace.stop), np.errstate(over="ignore"):
            guided_way_ticks(run.view, run.workspace, unknown, ticks)
        guided[unknown] = ticks
    ways, shortest = guided[tasks].astype(np.int64).T
    ends = np.maximum(orders.delivered[tasks], 1)  # ticks count from 1
    return {
        "detour_ticks": summed(ends, ways - shortest, borders),
        "shortest_ticks": summed(ends, shortest, borders),
    }


# Orders with due times: how many are late, and by how many ticks.
#
# An order counts from its release on. An order still open at the end is late if its due time has
# passed, with its tardiness up to the end; otherwise only `not_yet_due` counts it.


class DueOrders(NamedTuple):
    """The released orders with a due time; each array is (k,)."""

    ends: Array  # int64: tick of delivery, or the present tick if open
    tardiness: Array  # int64: ticks from the due time to `ends`; 0 if the order is not late
    is_open: Array  # bool

    def after(self, tick: int) -> DueOrders:
        """The orders that were done after a tick or are open."""
        later = self.is_open | (self.ends > tick)
        return DueOrders(self.ends[later], self.tardiness[later], self.is_open[later])


def has_due_times(world: World) -> bool:
    """Whether any order has a due time."""
    due = world.lines.due if has_lines(world) else world.orders.due
    return bool((due != NEVER).any())


def due_orders(world: World) -> DueOrders:
    """The released orders of a world that have a due time."""
    orders = asked_orders(world)
    known = np.flatnonzero((orders.due != NEVER) & orders.is_known)
    is_open = orders.is_open[known]
    ends = np.where(is_open, world.clock.tick, orders.done[known])
    return DueOrders(ends, np.maximum(0, ends - orders.due[known]), is_open)


def sums_of_due_times(world: World, borders: Array) -> dict[str, Array]:
    """Sums of orders with a due time in each stretch between borders, for automaton.runs.metric_sums.

    Open orders belong to the last stretch. Empty if no order has a due time.
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
    """Percentiles of the tardiness of orders that were done after a tick or are open."""
    values = due_orders(world).after(since).tardiness
    if not len(values):
        return {}
    return {f"tardiness_p{share}": quantile(values, share) for share in (95, 99)}


def lead_times(world: World, since: int) -> dict[str, float | int]:
    """Percentiles of the lead times of orders delivered after a tick, and the longest lead time.

    The longest one may be the age of an open order.
    """
    orders, now = asked_orders(world).after(since), int(world.clock.tick)
    times = (orders.done - orders.release)[~orders.is_open]
    ages = now - orders.release[orders.is_open]
    figures: dict[str, float | int] = {}
    if len(times):
        figures |= {f"lead_time_p{share}": quantile(times, share) for share in (95, 99)}
    if len(times) or len(ages):
        figures["lead_time_max"] = int(max(times.max(initial=NIL), ages.max(initial=NIL)))
    return figures


# Stations for pods: visits, lines, and shares of the time of a run.


class Station(NamedTuple):
    """The metrics of a station up to now."""

    station: str  # its name, or its number from 1
    visits: int  # completed visits
    lines_done: int
    service_share: float  # share of time in which it served a robot
    # Share of time in which it had open lines and no break, but no robot in its cell or queue.
    starved_share: float
    mean_queue: float  # robots that lose time in its queue
    longest_queue: int


def metrics_by_station(run: Measured) -> list[dict[str, Any]]:
    """The fields of Station for each station, by number; empty if robots carry no pods."""
    world = run.world
    names = run.resolved.station_names
    stations, elapsed = world.pod_stations, max(int(world.clock.tick), 1)
    done_at = world.stops.cell[world.stops.done != NIL]
    visited = stations.station_at[done_at] if names else NO_STATIONS
    done = world.lines.served_at[world.lines.done != NIL]
    visits, lines = (
        np.bincount(of[of != NIL], minlength=len(names)).tolist() for of in (visited, done)
    )
    return [
        Station(
            name,
            visits[k],
            lines[k],
            int(stations.served_ticks[k]) / elapsed,
            int(stations.starved_ticks[k]) / elapsed,
            int(stations.queue_ticks[k]) / elapsed,
            int(stations.longest_queue[k]),
        )._asdict()
        for k, name in enumerate(names)
    ]


NO_STATIONS = np.zeros(0, np.int32)


class Charger(NamedTuple):
    """What a charger did up to now."""

    charger: int  # its number from 1, in reading order
    x: int
    y: int
    places: int  # robots that charge there at once; those of the fleet where there is no limit
    utilization: float  # share of the time of its places
    mean_queue: float  # robots sent to it that stand, wherever
    longest_queue: int


def metrics_by_charger(run: Measured) -> list[dict[str, Any]]:
    """For each charger, what Charger has; () where robots have no batteries."""
    chargers, elapsed = run.world.chargers, max(int(run.world.clock.tick), 1)
    rows = []
    for k, cell in enumerate(chargers.cell.tolist() if run.world.rules.battery else ()):
        places = int(chargers.places[k])
        busy = int(chargers.busy_ticks[k]) / elapsed / places
        rows.append(
            Charger(
                k + 1,
                *run.resolved.floor_plan.xy(cell),
                places,
                busy,
                int(chargers.queue_ticks[k]) / elapsed,
                int(chargers.longest_queue[k]),
            )._asdict()
        )
    return rows


def metrics_by_priority(run: Measured) -> list[dict[str, Any]]:
    """For each priority of orders, the highest first: how many, lead time, how many were late.

    () where all orders have one priority. Times in ticks; None: no order is done, or none was due.
    """
    world, orders = run.world, asked_orders(run.world)
    priority = world.orders.priority if not has_lines(world) else None
    if priority is None:
        priority = np.full(len(world.lines.left), np.iinfo(np.int16).min, np.int16)
        np.maximum.at(priority, world.lines.order, world.lines.priority)
    levels = np.unique(priority)[::-1]
    if len(levels) < 2:
        return []
    return [
        {"priority": level, **metrics_of_group(world, orders, priority == level)}
        for level in levels.tolist()
    ]


def metrics_by_class(run: Measured) -> list[dict[str, Any]]:
    """For each class of orders, in the order of the list or file: the same metrics.

    Orders without a class come last, as None. () where no order has a class.
    """
    world, orders = run.world, asked_orders(run.world)
    of_line, names = classes_of_orders(run.resolved.unrefined.scenario.orders)
    if not names:
        return []
    of_order = of_line
    if has_lines(world):
        of_order = np.full(len(world.lines.left), NOTHING, np.int32)
        named = np.flatnonzero(of_line != NOTHING)[::-1]  # so that the first line decides
        of_order[world.lines.order[named]] = of_line[named]
    groups = [(name, of_order == number) for number, name in enumerate(names)]
    rows = [(name, mine) for name, mine in (*groups, (None, of_order == NOTHING)) if mine.any()]
    return [{"class": name, **metrics_of_group(world, orders, mine)} for name, mine in rows]


def metrics_of_group(world: World, orders: AskedOrders, group: Array) -> dict[str, Any]:
    """How many released orders of a group there are, their lead time, and how many were late.

    `group`: (m,) bool. Times in ticks; None: no order is done, or none was due.
    """
    mine = group & orders.is_known
    done = mine & (orders.done != NIL)
    times = (orders.done - orders.release)[done]
    due = mine & (orders.due != NEVER) & ((orders.done != NIL) | (orders.due < world.clock.tick))
    ends = np.where(orders.done == NIL, world.clock.tick, orders.done)
    return {
        "orders": int(mine.sum()),
        "delivered": int(done.sum()),
        "lead_time": float(times.mean()) if len(times) else None,
        "lead_time_p95": quantile(times, 95) if len(times) else None,
        "late_share": float((ends > orders.due)[due].mean()) if due.any() else None,
    }
