"""Which orders of a scenario carry pods: lines, and those of a list that begin in storage."""

from __future__ import annotations

from collections.abc import Iterator

from automaton.floor.cells import STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.loaded_ways import has_storage
from automaton.scenario.orders import OrderLine
from automaton.scenario.schema import Scenario


def is_of_pod(order: OrderLine, floor_plan: FloorPlan) -> bool:
    """Whether an order of a list begins in storage, and so carries the pod that stands there."""
    if order.source is None or not floor_plan.holds(*order.source):
        return False
    return bool(floor_plan.kind.flat[floor_plan.cell(*order.source)] == STORAGE)


def lists_pods(scenario: Scenario, floor_plan: FloorPlan) -> bool:
    """Whether an order of a list carries a pod."""
    if scenario.orders.listed is None or not has_storage(floor_plan):
        return False
    return any(is_of_pod(order, floor_plan) for order in scenario.orders.listed)


def carries_pods(scenario: Scenario, floor_plan: FloorPlan) -> bool:
    """Whether robots carry pods."""
    return scenario.orders.lines is not None or lists_pods(scenario, floor_plan)


def transports_of(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[tuple[int, OrderLine]]:
    """The orders of a list that bring a load from one slot to another, with their places in it."""
    for index, order in enumerate(scenario.orders.listed or ()):
        if order.has_load and not is_of_pod(order, floor_plan):
            yield index, order
