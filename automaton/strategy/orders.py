"""Orders for strategies written in Python: wrappers of the kernels that compiled strategies call.

`out` is `decisions.allocation`, and k the index of a robot in the batch.
"""

from __future__ import annotations

import numpy as np

from automaton.engine.decisions import AllocationDecisions
from automaton.engine.state import (
    NIL,
    ORDER_WAITING,
    Workspace,
    World,
)
from automaton.strategy import placing
from automaton.strategy.paths import position


def list_open(view: World, out: AllocationDecisions, robot: int) -> list[int]:
    """The orders that are open to a robot and that it can do, by number.

    They wait, are not reserved for another robot, and were not taken earlier in this batch.
    """
    known = slice(int(view.clock.first_open), int(view.clock.known_orders))
    waiting = known.start + np.flatnonzero(view.orders.state[known] == ORDER_WAITING)
    return [
        order
        for order in waiting.tolist()
        if placing.is_open(view, out, robot, order) and can_do(view, robot, order)
    ]


def can_do(view: World, robot: int, order: int) -> bool:
    """Whether a robot can carry an order, and can reach its load and its target."""
    return bool(placing.can_do(view, robot, int(order)))


def begin_cell(view: World, robot: int, order: int) -> int | None:
    """The cell where a robot begins an order: the pick-up, or the next stop if there is no load."""
    robot_type, here = int(view.robots.type[robot]), position(view, robot)
    cell = int(placing.begin_cell(view, robot_type, int(order), here))
    return None if cell == NIL else cell


def take(view: World, out: AllocationDecisions, k: int, robot: int, order: int) -> None:
    """Decision k: a robot takes an order and drives to its first cell."""
    placing.take_order(view, out, k, robot, int(order))


def asks_for_place(reason: int) -> bool:
    """Whether allocation must choose the destination of the robot's load."""
    return bool(placing.places_load(int(reason)))


def place_load(
    view: World,
    out: AllocationDecisions,
    workspace: Workspace,
    k: int,
    robot: int,
    storage: str = "fixed",
) -> None:
    """Decision k: a robot takes its load to its target, or its pod into storage.

    `storage`: one of automaton.strategy.placing.STORAGE_POLICIES.
    """
    placing.place_load(view, out, workspace, k, robot, placing.STORAGE_POLICIES.index(storage))
