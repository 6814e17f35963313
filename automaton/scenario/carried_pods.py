"""The pods that robots carry: their cells, their names, and the orders that carry them.

Lines carry pods. So do listed orders that begin in storage.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from automaton.floor.floor_plan import STORAGE, FloorPlan
from automaton.floor.reachability import has_storage
from automaton.scenario.orders import OrderLine
from automaton.scenario.schema import Scenario


def is_of_pod(order: OrderLine, floor_plan: FloorPlan) -> bool:
    """Whether a listed order begins in storage, and so carries the pod that stands there."""
    if order.source is None or not floor_plan.holds(*order.source):
        return False
    return bool(floor_plan.kind.flat[floor_plan.cell(*order.source)] == STORAGE)


def lists_pods(scenario: Scenario, floor_plan: FloorPlan) -> bool:
    """Whether a listed order carries a pod."""
    if scenario.orders.listed is None or not has_storage(floor_plan):
        return False
    return any(is_of_pod(order, floor_plan) for order in scenario.orders.listed)


def carries_pods(scenario: Scenario, floor_plan: FloorPlan) -> bool:
    """Whether robots carry pods."""
    return scenario.orders.lines is not None or lists_pods(scenario, floor_plan)


def transports_of(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[tuple[int, OrderLine]]:
    """The listed orders that bring a load from one slot to another, with their indices."""
    for index, order in enumerate(scenario.orders.listed or ()):
        if order.has_load and not is_of_pod(order, floor_plan):
            yield index, order


def pod_cells(scenario: Scenario, floor_plan: FloorPlan) -> NDArray[np.intp]:
    """Flat cells of pods 0, 1, ... at the start: as listed, or in reading order of the picture."""
    listed = scenario.pods.listed
    if listed is not None:
        return np.array([floor_plan.cell(*pod.at) for pod in listed], np.intp)
    drawn: NDArray[np.intp] = np.flatnonzero((floor_plan.kind == STORAGE) & (floor_plan.loads != 0))
    return drawn


def pod_names(scenario: Scenario, count: int) -> list[str]:
    """The name of each pod, or its number from 1 if it has no name."""
    names = [str(k + 1) for k in range(count)]
    for k, pod in enumerate(scenario.pods.listed or ()):
        names[k] = names[k] if pod.name is None else pod.name
    return names


def pod_numbers(scenario: Scenario, count: int) -> dict[str, int]:
    """The number of each pod, from 0, by its name and by its number from 1 as text."""
    numbers = {str(k + 1): k for k in range(count)}
    return numbers | {name: k for k, name in enumerate(pod_names(scenario, count))}


def skus_of(scenario: Scenario) -> dict[str, int]:
    """The number of each SKU that a pod holds, in the order of the pods."""
    listed = scenario.pods.listed or ()
    return {
        sku: k for k, sku in enumerate(dict.fromkeys(sku for pod in listed for sku in pod.skus))
    }
