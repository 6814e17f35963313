"""Parts of a scenario: what stations do to them, and the orders that carry them between."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from automaton.world.state import NEVER, NIL, Array, Stations

if TYPE_CHECKING:
    from automaton.scenario.resolve import Resolved
    from automaton.scenario.schema import Orders


def routes(orders: Orders) -> list[tuple[int, tuple[int, ...]]]:
    """The tick in which each part comes, and its stations: parts as listed, one after another."""
    return [(kind.at, kind.route) for kind in orders.parts or () for _ in range(kind.count)]


def work_ticks(orders: Orders, station: int) -> int:
    """Ticks of the work at a station, by its number."""
    return orders.work if isinstance(orders.work, int) else orders.work[station - 1]


def part_orders(resolved: Resolved, slot_of: Array) -> tuple[Array, Array, Array]:
    """(m,) each: slots where the orders of all parts begin and end, and when they become known."""
    slots = slot_of[resolved.plan.stations()]
    ways = [
        (slots[here - 1], slots[then - 1])
        for _, route in routes(resolved.scenario.orders)
        for here, then in itertools.pairwise(route)
    ]
    source, target = np.array(ways, np.int32).reshape(-1, 2).T
    return source, target, np.full(len(ways), NEVER, np.int64)


def build_stations(resolved: Resolved, slot_of: Array, slots: int, orders: int) -> Stations:
    """The stations of the floor, by number, and the works of all parts; `slots` counts spare ones."""
    scenario = resolved.scenario.orders
    cells = resolved.plan.stations()
    at = np.full(slots, NIL, np.int32)
    at[slot_of[cells]] = np.arange(len(cells), dtype=np.int32)
    works: list[tuple[int, int, int, int, int]] = []  # station, ticks, part, frees, came
    arrives = np.full(orders, NIL, np.int32)
    order = 0
    for part, (tick, route) in enumerate(routes(scenario)):
        for place, number in enumerate(route):
            last = place == len(route) - 1
            if place:
                arrives[order - 1] = len(works)
            came = NIL if place else tick
            works.append(
                (number - 1, work_ticks(scenario, number), part, NIL if last else order, came)
            )
            order += not last
    table = np.array(works, np.int32).reshape(-1, 5).T
    station, ticks, part_of, frees, comes = (column.copy() for column in table)
    entering = np.flatnonzero(comes != NIL).astype(np.int32)
    entering = entering[np.argsort(comes[entering], kind="stable")]
    k = len(cells)
    return Stations(
        at=at,
        slot=slot_of[cells].astype(np.int32),
        first=np.full(k, NIL, np.int32),
        last=np.full(k, NIL, np.int32),
        until=np.zeros(k, np.int64),
        entering=entering,
        station=station,
        ticks=ticks,
        part=part_of,
        frees=frees,
        behind=np.full(len(works), NIL, np.int32),
        came=comes,
        done=np.full(len(works), NIL, np.int32),
        arrives=arrives,
    )
