"""The stops of orders: as listed, of tasks, or drawn for the generator tours.

Draws are addressed by the seed, the number of the order and the place of the stop in it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.engine import random_numbers
from automaton.engine.facilities import Stops
from automaton.engine.state import Array
from automaton.scenario.orders import Orders as OrdersGiven
from automaton.scenario.orders import StopRange
from automaton.world.capabilities import Service
from automaton.world.resolve import Resolved
from automaton.world.task_lists import cells_of_tasks

DRAW_STOP_COUNT: Final = 4  # what is drawn of an order (automaton.world.demand)
DRAW_STOP: Final = 16  # and above: the first stop, the second one, ...


def build_stops(
    resolved: Resolved, service: Service, orders: int, seed: int
) -> tuple[Array, Stops]:
    """(orders + 1,) int32 where the stops of each order begin among all, and all stops."""
    demand = resolved.scenario.orders
    count = np.zeros(orders, np.int64)
    cells = np.zeros(0, np.int64)
    ticks = None
    if demand.listed is not None:
        listed = [line.stop_cells for line in demand.listed]
        count = np.array([len(stops) for stops in listed], np.int64)
        cell = resolved.floor_plan.cell
        cells = np.array([cell(x, y) for stops in listed for x, y in stops], np.int64)
        ticks = np.array([one for line in demand.listed for one in line.stop_ticks], np.int32)
    elif demand.tasks is not None:
        count, cells = stops_of_tasks(resolved, orders)
    elif demand.generator == "tours":
        count = stop_counts(demand, orders, seed)
        cells = drawn_stops(cells_of_all(service), count, seed)
    first = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    if ticks is None:
        ticks = np.zeros(len(cells), np.int32)
    return first, Stops.sized({"v": len(cells)}, cell=cells.astype(np.int32), ticks=ticks)


def stops_of_tasks(resolved: Resolved, orders: int) -> tuple[Array, Array]:
    """How many stops each order has, and the cells of them all: task k is line k modulo the lines."""
    count, cells = cells_of_tasks(resolved.scenario.orders, resolved.floor_plan)
    first = np.concatenate([[0], np.cumsum(count)])
    line = np.arange(orders) % len(count)
    begins = np.repeat(first[line], count[line])
    within = np.arange(len(begins)) - np.repeat(np.cumsum(count[line]) - count[line], count[line])
    return count[line], cells[begins + within]


def cells_of_all(service: Service) -> Array:
    """The cells that robots of every type reach, and come back from."""
    cells: Array = np.flatnonzero(service.reachable.all(axis=0))
    return cells


def stop_counts(orders: OrdersGiven, count: int, seed: int) -> Array:
    """(count,) int64: how many stops each order has."""
    if not isinstance(orders.stops, StopRange):
        return np.full(count, orders.stops, np.int64)
    least, most = orders.stops.least, orders.stops.most
    counts: Array = least + _drawn(most - least + 1, count, seed, DRAW_STOP_COUNT)
    return counts


def drawn_stops(cells: Array, count: Array, seed: int) -> Array:
    """The stops of orders, one order after another: `count` of each, drawn from cells.

    The first one is any of the cells, each further one any but the one before it.
    """
    most = int(count.max(initial=0))
    places = np.zeros((len(count), most), np.int64)  # among `cells`
    for stop in range(most):
        if stop == 0:
            places[:, 0] = _drawn(len(cells), len(count), seed, DRAW_STOP)
        else:
            others = _drawn(len(cells) - 1, len(count), seed, DRAW_STOP + stop)
            places[:, stop] = (places[:, stop - 1] + 1 + others) % len(cells)
    chosen: Array = cells[places[np.arange(most) < count[:, None]]]
    return chosen


def _drawn(below: int, count: int, seed: int, what: int) -> Array:
    """(count,) int64 from 0 on, below a number; `what` tells the draws of an order apart."""
    numbers = np.zeros(count, np.int64)
    with np.errstate(over="ignore"):
        random_numbers.random_integers(
            numbers, below, np.uint64(seed), random_numbers.STREAM_ORDERS, what
        )
    return numbers
