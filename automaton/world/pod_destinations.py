"""Whether the pods of a list of orders come to stay in cells of their own.

A cell of storage holds one pod. Where two would stay at the end, the robot with the second one would
wait for ever before the cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.changing_floor import Cell
from automaton.scenario.document import Document
from automaton.scenario.orders import OrderLine
from automaton.scenario.schema import Scenario
from automaton.scenario.table_files import pod_cells, pod_names

NO_ORDER: Final = -1


def check_destinations(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """No two pods come to stay in one cell. Raises InputError.

    Orders begin in cells in which pods stand. Where a pod goes whose last order has no `to` is not known.
    """
    cells = pod_cells(scenario, floor_plan).tolist()
    names = pod_names(scenario, len(cells))
    pod_at = {floor_plan.xy(cell): f"pod {name}" for cell, name in zip(cells, names, strict=True)}
    orders = scenario.orders.listed or ()
    last = last_orders(orders)
    stays = {at: (name, NO_ORDER) for at, name in pod_at.items() if at not in last}
    for index, order in enumerate(orders):
        at, target = order.source, order.target
        if at is None or target is None:
            continue
        is_last = last[at] == index
        if target in stays and (is_last or stays[target][1] == NO_ORDER):
            raise _taken(document, index, target, pod_at[at], stays[target])
        if is_last:
            stays[target] = pod_at[at], index


def last_orders(orders: Sequence[OrderLine]) -> dict[Cell, int]:
    """By the cell in which a pod stands at first, the place of its last order in the list."""
    last: dict[Cell, int] = {}
    for index, order in enumerate(orders):
        if order.source is None:
            continue
        known = last.get(order.source)
        if known is None or orders[known].release <= order.release:
            last[order.source] = index
    return last


def _taken(
    document: Document, index: int, target: Cell, name: str, stays: tuple[str, int]
) -> InputError:
    """`stays`: the pod that stays at the target, and the order that brings it there."""
    other, earlier = stays
    text = f"order {index} brings {name} to {list(target)}, where {other} stays"
    why = f"order {earlier} brings it there" if earlier != NO_ORDER else "no order carries it away"
    return document.error(("orders", "list", index, "to"), f"{text}: {why}; choose another cell")
