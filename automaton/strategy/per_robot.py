"""Strategies for one robot at a time: write `decide(me, view)` and return a decision.

A scenario names the class made by `per_robot` "module:name". The robots of a batch are asked in
order of identity, and later robots see earlier decisions. With `information: orders` or a radius,
`view` holds only what that robot may know: for teaching, and for true decentralization.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from automaton.engine.decisions import (
    CMD_DROP_AT,
    CMD_PARK,
    CMD_RETREAT,
    CMD_STEP,
    CMD_TAKE_ORDER,
    CMD_WAIT,
    AllocationDecisions,
)
from automaton.engine.jit.structs import Struct, field
from automaton.engine.state import NIL, Array, Workspace, World
from automaton.strategy import orders, paths
from automaton.strategy.contract import Strategy


@dataclass(frozen=True)
class Order:
    """A waiting order."""

    index: int  # number of the order
    slot: int  # slot of the load; NIL: the order has no load
    target: int  # destination slot, or NIL
    stop: int = NIL  # flat cell of the next stop, if the order has no load


@dataclass(frozen=True)
class Decision:
    """The decision for a robot, made by the functions below."""

    command: int
    value: Any = None
    return_order: bool = False


def take(order: Order | int) -> Decision:
    """Allocation: reserve an order and pick it up."""
    return Decision(CMD_TAKE_ORDER, order.index if isinstance(order, Order) else order)


def drop_at(slot: int) -> Decision:
    """Allocation: drop the load at a slot."""
    return Decision(CMD_DROP_AT, slot)


def deliver() -> Decision:
    """Allocation: drop the load at its order's target, or a pod at its initial storage cell."""
    return Decision(CMD_DROP_AT)


def park() -> Decision:
    """Allocation: drive home."""
    return Decision(CMD_PARK)


def step(direction: int) -> Decision:
    """Right of way: one move (or the turn before it), 0 east, 1 south, 2 west, 3 north."""
    return Decision(CMD_STEP, direction)


def wait(ticks: int) -> Decision:
    """Right of way: wait for some ticks."""
    return Decision(CMD_WAIT, ticks)


def retreat(moves: int, return_order: bool = True) -> Decision:
    """Right of way: retreat by up to `moves` moves; an empty robot may return its order.

    With 0 moves: plan again where the robot stands.
    """
    return Decision(CMD_RETREAT, moves, return_order)


def drive(directions: Sequence[int]) -> Decision:
    """Routing: the moves to the robot's goal cell; turns are implied."""
    return Decision(CMD_STEP, list(directions))


def next_stop(view: World, order: int) -> int:
    """Return the flat cell of the next stop of an order, NIL if it has none."""
    orders = view.orders
    stop = int(orders.first_stop[order]) + int(orders.stops_done[order])
    return int(view.stops.cell[stop]) if stop < orders.first_stop[order + 1] else NIL


class LocalView:
    """The knowledge of one robot: the order list, and the robots in its sight."""

    def __init__(self, view: World, out: AllocationDecisions, robot: int) -> None:
        self.view = view  # everything visible, as arrays
        self._out = out
        self._robot = robot

    @property
    def tick(self) -> int:
        """The current tick."""
        return int(self.view.clock.tick)

    def open_orders(self) -> list[Order]:
        """Waiting orders that the robot can do and no other robot has reserved, by index."""
        known = self.view.orders
        return [
            Order(
                index,
                int(known.current_slot[index]),
                int(known.target[index]),
                next_stop(self.view, index),
            )
            for index in orders.list_open(self.view, self._out, self._robot)
        ]

    def target_of(self, order: int) -> int:
        """The destination slot of an order."""
        return int(self.view.orders.target[order])

    def robots(self) -> dict[int, tuple[int, int]]:
        """Cells (x, y) of the robots in sight, by identity."""
        robots, width = self.view.robots, self.view.grid.width
        return {
            int(robots.identity[j]): (
                int(robots.cell[j] % width) - 1,
                int(robots.cell[j] // width) - 1,
            )
            for j in (robots.cell != NIL).nonzero()[0]
        }


class OwnNumbers(Struct):
    """The memory of each robot."""

    numbers: Array = field("(n, k) int64")


class Me:
    """The robot about which the strategy is asked."""

    def __init__(
        self, view: World, workspace: Workspace, robot: int, reason: int, row: Any
    ) -> None:
        self._view, self.workspace, self.index = view, workspace, robot
        self.reason = reason  # why the robot is asked: automaton.strategy.api.REASON_*
        self.memory = row  # (k,) int64 numbers remembered for this robot

    @property
    def identity(self) -> int:
        """The number of the robot, from 0."""
        return int(self._view.robots.identity[self.index])

    @property
    def cell(self) -> tuple[int, int]:
        """Cell (x, y) of the robot; in a long move the one that it enters, in a parking bay its home."""
        width = self._view.grid.width
        place = paths.position(self._view, self.index)
        return place % width - 1, place // width - 1

    @property
    def load(self) -> int | None:
        """The order whose load the robot carries."""
        load = int(self._view.robots.load[self.index])
        return None if load == NIL else load

    def access_cell_for(self, slot: int) -> int:
        """The flat cell from which the robot picks up at a slot, or drops its load there, by the
        scenario's `world.access_cell`; NIL: none."""
        cell_of = paths.pickup_cell if self.load is None else paths.dropoff_cell
        cell = cell_of(self._view, self.index, slot)
        return NIL if cell is None else cell

    def ticks_to(self, place: int | Order) -> int:
        """Ticks on the empty floor to the cell from which the robot serves a slot, or to the first
        cell of an order: the pick-up, or the next stop."""
        slot, cell = (place.slot, place.stop) if isinstance(place, Order) else (place, NIL)
        if slot != NIL:
            cell = self.access_cell_for(slot)
        if cell == NIL:
            return paths.UNREACHABLE
        return paths.distance(self._view, self.workspace, self.index, cell)

    def route(self, around: bool = False) -> list[int] | None:
        """Directions to the robot's goal cell; `around`: avoid the robots in sight."""
        goal_cell = int(self._view.robots.goal_cell[self.index])
        return paths.route(self._view, self.workspace, self.index, goal_cell, around)


def per_robot(
    layer: str, memory: int = 0
) -> Callable[[Callable[[Me, LocalView], Decision | None]], Any]:
    """Make a strategy class from decide(me, view) -> decision or None (continue).

        from automaton.strategy.per_robot import deliver, park, take


        @automaton.per_robot("allocation")
        def eager(me, view):
            if me.load is not None:
                return deliver()
            orders = view.open_orders()
            return take(min(orders, key=me.ticks_to)) if orders else park()


        automaton.simulate("tabletop-mini", strategies={"allocation": eager}).metrics["makespan"]

    `layer`: allocation, routing or right_of_way; `memory`: number of integers per robot in
    me.memory. Raises ValueError for another layer.
    """
    if layer not in _ENTER:
        raise ValueError(f"per_robot serves the layers {', '.join(_ENTER)}, not {layer!r}")

    def make(decide_one: Callable[[Me, LocalView], Decision | None]) -> Any:
        def decide(
            self: Any, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any
        ) -> None:
            own = OwnNumbers.of(memory)
            for k in range(batch.count):
                robot = int(batch.robot[k])
                me = Me(view, workspace, robot, int(batch.reason[k]), own.numbers[robot])
                decision = decide_one(me, LocalView(view, decisions.allocation, robot))
                if decision is not None and not isinstance(decision, Decision):
                    raise TypeError(
                        f"{decide_one.__name__} must return a decision, not {decision!r}"
                    )
                if decision is not None:
                    _ENTER[layer](decisions, k, decision, me, view)

        def reset(self: Any, view: World) -> Struct:
            return OwnNumbers.sized({"n": len(view.robots.cell), "k": memory})

        body = {"layer": layer, "decide": decide, "reset": reset, "__doc__": decide_one.__doc__}
        return type(decide_one.__name__, (Strategy,), body | {"__module__": decide_one.__module__})

    return make


def _enter_allocation(decisions: Any, k: int, decision: Decision, me: Me, view: World) -> None:
    out = decisions.allocation
    out.command[k] = decision.command
    if decision.command == CMD_TAKE_ORDER:
        out.order[k] = decision.value
        if not 0 <= decision.value < len(view.orders.current_slot):
            return
        slot, stop = view.orders.current_slot[decision.value], next_stop(view, decision.value)
        if slot != NIL or stop != NIL:
            orders.take(view, out, k, me.index, decision.value)
    elif decision.command == CMD_DROP_AT and decision.value is None:
        orders.place_load(view, out, me.workspace, k, me.index)
    elif decision.command == CMD_DROP_AT:
        out.slot[k] = decision.value
        if 0 <= decision.value < len(view.slots.cell):
            out.goal_cell[k] = me.access_cell_for(decision.value)
            out.slot_taken[decision.value] = 1


def _enter_routing(decisions: Any, k: int, decision: Decision, me: Me, view: World) -> None:
    length = len(decision.value)
    if length <= decisions.routing.steps.shape[1]:
        decisions.routing.steps[k, :length] = decision.value
    decisions.routing.route_length[k] = length


def _enter_right_of_way(decisions: Any, k: int, decision: Decision, me: Me, view: World) -> None:
    out = decisions.right_of_way
    out.command[k] = decision.command
    out.value[k] = decision.value
    out.return_order[k] = int(decision.return_order)


_ENTER = {
    "allocation": _enter_allocation,
    "routing": _enter_routing,
    "right_of_way": _enter_right_of_way,
}
