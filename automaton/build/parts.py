"""Parts of a scenario: what stations do to them, and the orders that carry them between."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from automaton.build.arrivals import PARTS, gaps, geometric
from automaton.engine import random_numbers
from automaton.engine.facilities import Stations
from automaton.engine.state import NEVER, NIL, Array

if TYPE_CHECKING:
    from automaton.build.resolve import Resolved
    from automaton.scenario.orders import Orders


def routes(orders: Orders) -> list[tuple[int, ...]]:
    """The stations of each part: parts as listed, one after another."""
    return [kind.route for kind in orders.parts or () for _ in range(kind.count)]


def part_ticks(orders: Orders, seed: int) -> list[int]:
    """The tick in which each part comes."""
    ticks: list[int] = []
    for row, kind in enumerate(orders.parts or ()):
        between = gaps(kind.interarrival_time, kind.count, seed, PARTS + row)
        after = np.concatenate([[0], np.cumsum(between[:-1])])
        ticks += np.minimum(kind.first_release + after, NEVER - 1).tolist()
    return ticks


def work_ticks(orders: Orders, station: Array, part: Array, place: Array, seed: int) -> Array:
    """(j,) int64: ticks of works, by station from 0; what is drawn, by part and place in its route."""
    ticks = np.zeros(len(station), np.int64)
    times = (
        orders.processing_time
        if isinstance(orders.processing_time, tuple)
        else (orders.processing_time,)
    )
    for number, time in enumerate(times):
        here = np.flatnonzero(station == number) if len(times) > 1 else np.arange(len(ticks))
        if isinstance(time, int):
            ticks[here] = time
        else:
            ticks[here] = geometric(
                time.mean, seed, random_numbers.STREAM_PROCESSING_TIMES, part[here], place[here]
            )
    return ticks


def part_orders(resolved: Resolved, slot_of: Array) -> tuple[Array, Array, Array]:
    """(m,) each: slots where the orders of all parts begin and end, and when they are released."""
    slots = slot_of[resolved.floor_plan.stations]
    ways = [
        (slots[here - 1], slots[then - 1])
        for route in routes(resolved.scenario.orders)
        for here, then in itertools.pairwise(route)
    ]
    source, target = np.array(ways, np.int32).reshape(-1, 2).T
    return source, target, np.full(len(ways), NEVER, np.int64)


def build_stations(
    resolved: Resolved, slot_of: Array, slots: int, orders: int, seed: int
) -> Stations:
    """The stations of the floor, by number, and the works of all parts; `slots` counts spare ones."""
    scenario = resolved.scenario.orders
    cells = resolved.floor_plan.stations
    at = np.full(slots, NIL, np.int32)
    at[slot_of[cells]] = np.arange(len(cells), dtype=np.int32)
    works: list[tuple[int, int, int, int, int]] = []  # station, place, part, frees, came
    arrives = np.full(orders, NIL, np.int32)
    order = 0
    coming = part_ticks(scenario, seed)
    for part, route in enumerate(routes(scenario)):
        for place, number in enumerate(route):
            last = place == len(route) - 1
            if place:
                arrives[order - 1] = len(works)
            came = NIL if place else coming[part]
            works.append((number - 1, place, part, NIL if last else order, came))
            order += not last
    table = np.array(works, np.int32).reshape(-1, 5).T
    station, place_of, part_of, frees, comes = (column.copy() for column in table)
    entering = np.flatnonzero(comes != NIL).astype(np.int32)
    entering = entering[np.argsort(comes[entering], kind="stable")]
    return Stations.sized(
        at=at,
        slot=slot_of[cells].astype(np.int32),
        part_arrivals=entering,
        station=station,
        processing_time=work_ticks(scenario, station, part_of, place_of, seed).astype(np.int32),
        part=part_of,
        releases_order=frees,
        arrival_tick=comes,
        job_of_order=arrives,
    )
