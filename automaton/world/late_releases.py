"""Warn about orders and parts that are released when the run is over."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from automaton.floor.cells import SHELF
from automaton.scenario.orders import Mean, MeanTime, line_column, listed_lines
from automaton.units import count, ticks_and_time, unit
from automaton.world.resolve import Resolved


class Stream(NamedTuple):
    """Orders or parts that come one after another."""

    what: str  # "200 orders"
    first: int  # tick
    last: float  # tick; of random ones, by the mean


def late_releases(resolved: Resolved) -> list[str]:
    """Return a sentence for each list or stream that goes on when the run is over.

    A stream may go on where a run does not end with its orders.
    """
    stop, tick = resolved.scenario.stop, unit(resolved.scenario.units.tick)
    end, ends_with_orders = stop.max_duration, stop.when != "never"
    over = f"when the run is over (stop.max_duration {ticks_and_time(end, tick)})"
    orders, lines = resolved.scenario.orders, listed_lines(resolved.scenario.orders)
    releases = [line.release for line in orders.listed or ()]
    if lines:
        releases = line_column(lines, "release").tolist()
    late = [release for release in releases if release >= end]
    if late:
        what = count(len(releases), "line" if lines else "order")
        which = f"{len(late):,} of {what} in the {'file' if resolved.orders_of_file else 'list'}"
        comes = "comes" if len(late) == 1 else "come"
        unfinished = ", so it will not finish" if ends_with_orders else ""
        return [
            f"{which} {comes} after {ticks_and_time(min(late), tick)} or later, {over}{unfinished}"
        ]
    return [
        f"the last of {stream.what} comes after about {ticks_and_time(stream.last, tick)}, {over}"
        + (", so it may not finish" if ends_with_orders else "")
        for stream in streams(resolved)
        if stream.first >= end or (stream.last >= end and ends_with_orders)
    ]


def streams(resolved: Resolved) -> Iterator[Stream]:
    """What comes with time, and not from a list or in a closed loop."""
    orders = resolved.scenario.orders
    for kind in orders.parts or ():
        after = (kind.count - 1) * mean_of(kind.interarrival_time)
        what = count(kind.count, "part") + (f" {kind.name}" if kind.name else "")
        yield Stream(what, kind.first_release, kind.first_release + after)
    orders_count = generated_orders(resolved)
    if orders.mean_interarrival_time:
        last = (orders_count - 1) * orders.mean_interarrival_time
        yield Stream(count(orders_count, "order"), 0, last)
    if orders.arrivals is not None and orders.arrivals.bursts is not None:
        bursts = orders.arrivals.bursts
        many = math.ceil(orders_count / mean_of(bursts.size))
        yield Stream(count(orders_count, "order"), 0, (many - 1) * mean_of(bursts.every))


def generated_orders(resolved: Resolved) -> int:
    """How many orders a generator makes."""
    orders, floor_plan = resolved.scenario.orders, resolved.floor_plan
    if orders.generator == "picture-loads":
        return int(floor_plan.loads.sum())
    if orders.generator == "full-shelves":
        return int(np.count_nonzero(floor_plan.kind == SHELF))
    return orders.count or 0


def mean_of(number: int | Mean | MeanTime) -> float:
    """A number given, or the mean of those drawn."""
    return number if isinstance(number, int) else number.mean
