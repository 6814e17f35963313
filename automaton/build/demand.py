"""The orders of a run at tick 0, and the slots between which they are carried.

Draws are addressed by the seed and the number of an order alone, so that all fleets and strategies
face the same demand.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from automaton.build.arrivals import releases
from automaton.build.capabilities import Service, service_for
from automaton.build.parts import part_orders
from automaton.build.prepared_floor import Floor
from automaton.build.resolve import Resolved
from automaton.build.rules import may_fail
from automaton.engine import random_numbers
from automaton.engine.facilities import Slots
from automaton.engine.state import NIL, ORDER_UNRELEASED, ORDER_WAITING, Array, Orders
from automaton.floor.cells import DESTINATION, DOCK, RACK, STATION
from automaton.scenario.orders import DRAWN
from automaton.scenario.orders import Orders as OrdersGiven

DRAW_WEIGHT = 3  # what is drawn of an order, beside where it begins and ends and their sequence


def build_orders(resolved: Resolved, floor: Floor, seed: int, homes: Array) -> tuple[Orders, Slots]:
    """Orders by slot (table order), as listed, or as drawn, and the slots.

    Slots are served from the cells that robots can reach, and come back from. `homes`: (n,) where
    each robot begins, by identity.
    """
    fleet = resolved.fleet
    first = np.cumsum([0, *fleet.counts[:-1]])  # robots of each type begin in one part of the floor
    service = service_for(
        resolved.floor_plan, fleet.types, tuple(homes[first].tolist()), fleet.rail
    )
    if resolved.scenario.orders.parts is not None:
        source, target, released = part_orders(resolved, floor.grid.slot)
        coming = np.full(len(source), NIL)
    else:
        source, target = sources_and_targets(resolved, floor, service.access, seed)
        released, coming = releases(resolved.scenario, len(source), seed)
    weight = weights(resolved.scenario.orders, len(source), seed)
    slots = slots_of(resolved, floor, service, source)
    return orders_of(source, target, released, coming, weight), slots


def weights(orders: OrdersGiven, count: int, seed: int) -> Array:
    """(count,) int32: how heavy each order is."""
    if orders.listed is not None:
        return np.array([line.weight for line in orders.listed], np.int32)
    if orders.parts is not None:
        ways = [kind.count * (len(kind.route) - 1) for kind in orders.parts]
        return np.repeat(np.array([kind.weight for kind in orders.parts], np.int32), ways)
    if isinstance(orders.weight, int):
        return np.full(count, orders.weight, np.int32)
    least, most = orders.weight.least, orders.weight.most
    above = np.zeros(count, np.int32)
    with np.errstate(over="ignore"):
        random_numbers.random_integers(
            above, most - least + 1, np.uint64(seed), random_numbers.STREAM_ORDERS, DRAW_WEIGHT
        )
    heavy: Array = least + above
    return heavy


def orders_of(
    source: Array, target: Array, released: Array, coming: Array, weight: Array
) -> Orders:
    """Orders of which nothing is done yet; from, to, known from, in which sequence, how heavy.

    All of them are (m,).
    """
    return Orders.sized(
        state=np.where(released > 0, ORDER_UNRELEASED, ORDER_WAITING).astype(np.uint8),
        current_slot=source.astype(np.int32).copy(),
        source=source.astype(np.int32),
        target=target.astype(np.int32),
        release_tick=released.astype(np.int32),
        weight=weight.astype(np.int32),
        release_sequence=coming.astype(np.int32),
    )


def slots_of(resolved: Resolved, floor: Floor, service: Service, source: Array) -> Slots:
    """The slots of the floor with the loads of orders that begin at `source`, and spare ones."""
    spare = len(floor.slot_cell)
    more = resolved.scenario.fleet.robots if may_fail(resolved.scenario) else 0
    content = np.full(spare + more, NIL, np.int32)
    on_shelf = floor.slot_endless[source] == 0
    content[source[on_shelf]] = np.flatnonzero(on_shelf)
    nobody = np.zeros((len(service.reachable), more), np.uint8)
    cell = np.concatenate([floor.slot_cell, np.full(more, NIL, np.int32)])
    return Slots.sized(
        cell=cell,
        unbounded=np.concatenate([floor.slot_endless, np.ones(more, np.uint8)]),
        content=content,
        access=np.concatenate([service.access, np.full((more, 4), NIL, np.int32)]),
        accessible=np.concatenate([service.accessible, nobody], axis=1),
        first_spare=spare,
        reachable=service.reachable,
    )


def sources_and_targets(
    resolved: Resolved, floor: Floor, access: Array, seed: int
) -> tuple[Array, Array]:
    """(m,) slots where the orders begin and end."""
    orders = resolved.scenario.orders
    kinds = floor.grid.kind[floor.slot_cell]
    if orders.listed is not None:
        cell, slot_of = resolved.floor_plan.cell, floor.grid.slot
        source = slot_of[[cell(*line.source) for line in orders.listed]]
        return source, slot_of[[cell(*line.target) for line in orders.listed]]
    if orders.generator in DRAWN:
        served = (access != NIL).any(axis=1)
        count = orders.count or 0
        if orders.generator == "dock-to-rack":
            docks, racks = (np.flatnonzero((kinds == kind) & served) for kind in (DOCK, RACK))
            return drawn(docks, count, seed, 0), drawn(racks, count, seed, 1)
        return among_stations(np.flatnonzero((kinds == STATION) & served), orders, seed)
    loaded = floor.slot_endless == 0
    if orders.generator == "picture-loads":
        loaded &= resolved.floor_plan.loads.reshape(-1)[floor.slot_cell] == 1
    source = np.flatnonzero(loaded).astype(np.int32)
    return source, drawn(np.flatnonzero(kinds == DESTINATION), len(source), seed, 0)


def among_stations(stations: Array, orders: Any, seed: int) -> tuple[Array, Array]:
    """(m,) slots of visits, or of transports between two different stations."""
    source = drawn(stations, orders.count, seed, 0)
    if orders.generator == "visits":
        return source, source.copy()
    others = drawn(np.arange(len(stations) - 1), orders.count, seed, 1)
    at = np.searchsorted(stations, source)
    target: Array = stations[(at + 1 + others) % len(stations)].astype(np.int32)
    return source, target


def drawn(slots: Array, count: int, seed: int, what: int) -> Array:
    """(count,) int32: slots drawn uniformly, with replacement; `what` tells the draws apart."""
    choice = np.zeros(count, np.int32)
    with np.errstate(over="ignore"):
        random_numbers.random_integers(
            choice, len(slots), np.uint64(seed), random_numbers.STREAM_ORDERS, what
        )
    chosen: Array = slots[choice].astype(np.int32)
    return chosen
