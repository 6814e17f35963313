"""The orders of a run at tick 0, and the slots between which they are carried.

Draws are addressed by the seed and the number of an order alone, so that all fleets and strategies
face the same demand.
"""

from __future__ import annotations

import numpy as np

from automaton.kernels import draws
from automaton.scenario.resolve import Resolved
from automaton.world.cells import DESTINATION, DOCK, RACK
from automaton.world.floor import Floor
from automaton.world.reach import around_home
from automaton.world.state import NIL, Array, Orders, Slots


def build_orders(resolved: Resolved, floor: Floor, seed: int, home: int) -> tuple[Orders, Slots]:
    """Orders by slot (table order), as listed, or as drawn, and the slots.

    Slots are served from the cells that robots can reach from `home`, and come back from.
    """
    mask = around_home(resolved.plan, home, resolved.scenario.fleet.kinematics == "rail")
    access = np.where(mask[floor.slot_access], floor.slot_access, NIL).astype(np.int32)
    source, target = sources_and_targets(resolved, floor, access, seed)
    m = len(source)
    content = np.full(len(floor.slot_cell), NIL, np.int32)
    on_shelf = floor.slot_endless[source] == 0
    content[source[on_shelf]] = np.flatnonzero(on_shelf)
    nil = np.full(m, NIL, np.int32)
    orders = Orders(
        state=np.zeros(m, np.uint8),
        place=source.astype(np.int32).copy(),
        source=source.astype(np.int32),
        target=target.astype(np.int32),
        by=nil.copy(),
        released=np.zeros(m, np.int32),
        dispatched=nil.copy(),
        dispatched_from=nil.copy(),
        dispatched_heading=np.zeros(m, np.uint8),
        delivered=nil.copy(),
        legs=np.zeros(m, np.int32),
    )
    slots = Slots(
        cell=floor.slot_cell,
        endless=floor.slot_endless,
        content=content,
        by=np.full(len(content), NIL, np.int32),
        access=access,
    )
    return orders, slots


def sources_and_targets(
    resolved: Resolved, floor: Floor, access: Array, seed: int
) -> tuple[Array, Array]:
    """(m,) slots where the orders begin and end."""
    orders = resolved.scenario.orders
    kinds = floor.grid.kind[floor.slot_cell]
    if orders.listed is not None:
        cell, slot_of = resolved.plan.cell, floor.grid.slot
        source = slot_of[[cell(*line.source) for line in orders.listed]]
        return source, slot_of[[cell(*line.target) for line in orders.listed]]
    if orders.generator == "dock-to-rack":
        served = (access != NIL).any(axis=1)
        docks, racks = (np.flatnonzero((kinds == kind) & served) for kind in (DOCK, RACK))
        return drawn(docks, orders.count or 0, seed, 0), drawn(racks, orders.count or 0, seed, 1)
    loaded = floor.slot_endless == 0
    if orders.generator == "drawn-loads":
        loaded &= resolved.plan.loads.reshape(-1)[floor.slot_cell] == 1
    source = np.flatnonzero(loaded).astype(np.int32)
    return source, drawn(np.flatnonzero(kinds == DESTINATION), len(source), seed, 0)


def drawn(slots: Array, count: int, seed: int, what: int) -> Array:
    """(count,) int32: slots drawn uniformly, with replacement; `what` tells the draws apart."""
    choice = np.zeros(count, np.int32)
    with np.errstate(over="ignore"):
        draws.draw_many(choice, len(slots), np.uint64(seed), draws.ORDERS, what)
    chosen: Array = slots[choice].astype(np.int32)
    return chosen
