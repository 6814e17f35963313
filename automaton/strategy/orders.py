"""Orders for strategies written in Python, by the kernels that compiled ones call.

`out` is `decisions.allocation`, and k the place of a robot in the batch.
"""

from __future__ import annotations

import numpy as np

from automaton.engine.state import (
    NIL,
    ORDER_WAITING,
    AllocationDecisions,
    Workspace,
    World,
)
from automaton.strategy import placing
from automaton.strategy.paths import position


def list_open(view: World, out: AllocationDecisions, robot: int) -> list[int]:
    """The orders that a robot may take and can do, by number.

    They wait, are reserved for no other robot, nor taken earlier in this batch.
    """
    known = slice(int(view.clock.first_open), int(view.clock.known_orders))
    waiting = known.start + np.flatnonzero(view.orders.state[known] == ORDER_WAITING)
    return [
        order
        for order in waiting.tolist()
        if placing.is_open(view, out, robot, order) and can_do(view, robot, order)
    ]


def can_do(view: World, robot: int, order: int) -> bool:
    """Whether a robot carries an order, and gets to where it lies and to its target."""
    return bool(placing.can_do(view, robot, int(order)))


def begin_cell(view: World, robot: int, order: int) -> int | None:
    """The cell where a robot begins an order: picks its load up, or its next stop if it has none."""
    robot_type, here = int(view.robots.type[robot]), position(view, robot)
    cell = int(placing.begin_cell(view, robot_type, int(order), here))
    return None if cell == NIL else cell


def take(view: World, out: AllocationDecisions, k: int, robot: int, order: int) -> None:
    """Decision k: a robot takes an order and drives to where it begins."""
    placing.take_order(view, out, k, robot, int(order))


def asks_for_place(reason: int) -> bool:
    """Whether allocation is asked where the load of a robot goes."""
    return bool(placing.places_load(int(reason)))


def place_load(
    view: World,
    out: AllocationDecisions,
    workspace: Workspace,
    k: int,
    robot: int,
    storage: str = "fixed",
) -> None:
    """Decision k: a robot brings its load to its target, or its pod into storage.

    `storage`: one of automaton.strategy.placing.STORAGE_POLICIES.
    """
    placing.place_load(view, out, workspace, k, robot, placing.STORAGE_POLICIES.index(storage))
