"""Strategies for one robot at a time: write `decide(me, sees)` and return an answer.

    @per_robot("allocation")
    def eager(me, sees):
        if me.load is not None:
            return set_down(sees.target_of(me.load))
        orders = sees.open_orders()
        return take(min(orders, key=lambda order: me.ticks_to(order.slot))) if orders else park()

A scenario names it "module:eager". The robots of a batch are asked in the order of their identities
and each answer counts as given for those after it. With `information: orders` or a radius, `sees`
holds what that robot may know, and nothing else: for teaching, and for honest decentralization.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from automaton.strategy import paths
from automaton.strategy.layer import Strategy
from automaton.world import state
from automaton.world.state import NIL, Workspace, World


@dataclass(frozen=True)
class Order:
    """An order that waits to be picked up."""

    index: int
    slot: int  # where it lies
    target: int  # slot to which it must go


@dataclass(frozen=True)
class Answer:
    """What a robot wants; made by the functions below."""

    verb: int
    value: Any = None
    release: bool = False


def take(order: Order | int) -> Answer:
    """Allocation: reserve an order and pick it up."""
    return Answer(state.TAKE, order.index if isinstance(order, Order) else order)


def set_down(slot: int) -> Answer:
    """Allocation: set the load down on a slot."""
    return Answer(state.SET_DOWN, slot)


def park() -> Answer:
    """Allocation: drive home."""
    return Answer(state.PARK)


def step(direction: int) -> Answer:
    """Right of way: one move (or the turn before it), 0 east, 1 south, 2 west, 3 north."""
    return Answer(state.STEP, direction)


def wait(ticks: int) -> Answer:
    """Right of way: wait."""
    return Answer(state.PAUSE, ticks)


def withdraw(moves: int, release: bool = True) -> Answer:
    """Right of way: make room by so many moves; an empty robot may give its order back."""
    return Answer(state.RETREAT, moves, release)


def drive(directions: Sequence[int]) -> Answer:
    """Routing: the moves to the robot's stand; turns are implied."""
    return Answer(state.STEP, list(directions))


class Sees:
    """What one robot knows: the order list, and the robots in its sight."""

    def __init__(self, view: World, taken: Any, robot: int) -> None:
        self.view = view  # all that is visible, as arrays
        self._taken = taken
        self._robot = robot

    @property
    def tick(self) -> int:
        return int(self.view.clock[state.TICK])

    def open_orders(self) -> list[Order]:
        """Orders that wait and that nobody reserved, of those that the robot can do, by index."""
        orders = self.view.orders
        is_open = (orders.state == state.WAITING) & (orders.by == NIL) & (self._taken == 0)
        return [
            Order(int(index), int(orders.place[index]), int(orders.target[index]))
            for index in is_open.nonzero()[0]
            if paths.can_do(self.view, self._robot, index)
        ]

    def target_of(self, order: int) -> int:
        """The slot to which an order must go."""
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


class Me:
    """The robot that decides."""

    def __init__(self, view: World, space: Workspace, robot: int, reason: int, row: Any) -> None:
        self._view, self._space, self._robot = view, space, robot
        self.reason = reason  # automaton.world.state: FREE, PICKED, STUCK, ...
        self.memory = row  # int64 numbers that are kept for this robot

    @property
    def identity(self) -> int:
        return int(self._view.robots.identity[self._robot])

    @property
    def cell(self) -> tuple[int, int]:
        """(x, y); in a long move the cell that it enters, in a bay its home cell."""
        width = self._view.grid.width
        place = paths.position(self._view, self._robot)
        return place % width - 1, place // width - 1

    @property
    def load(self) -> int | None:
        """The order that it carries."""
        load = int(self._view.robots.load[self._robot])
        return None if load == NIL else load

    def stand_for(self, slot: int) -> int:
        """The flat cell from which it serves a slot with the fewest ticks; NIL: from none."""
        cells = paths.stands_of(self._view, self._robot, slot)
        found = paths.nearest(self._view, self._space, self._robot, cells)
        return cells[found or 0] if cells else NIL

    def ticks_to(self, slot: int) -> int:
        """Ticks to the nearest cell from which it serves a slot, on the empty floor."""
        stand = self.stand_for(slot)
        if stand == NIL:
            return paths.UNREACHABLE
        return paths.distance(self._view, self._space, self._robot, stand)

    def route(self, around: bool = False) -> list[int] | None:
        """Directions to its stand; `around`: avoiding the robots in sight."""
        stand = int(self._view.robots.stand[self._robot])
        return paths.route(self._view, self._space, self._robot, stand, around)


def per_robot(layer: str, memory: int = 0) -> Callable[[Callable[[Me, Sees], Answer | None]], Any]:
    """Make a strategy class from decide(me, sees) -> answer or None (keep on).

    `memory`: how many numbers each robot keeps in me.memory. Layers: allocation, routing,
    right_of_way.
    """
    if layer not in _ENTER:
        raise ValueError(f"per_robot serves the layers {', '.join(_ENTER)}, not {layer!r}")

    def make(decide_one: Callable[[Me, Sees], Answer | None]) -> Any:
        def decide(self: Any, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
            for k in range(asked.count[0]):
                robot = int(asked.robot[k])
                me = Me(view, space, robot, int(asked.reason[k]), memory.own[robot])
                answer = decide_one(me, Sees(view, answers.allocation.order_taken, robot))
                if answer is not None and not isinstance(answer, Answer):
                    raise TypeError(f"{decide_one.__name__} must return an answer, not {answer!r}")
                if answer is not None:
                    _ENTER[layer](answers, k, answer, me, view)

        def reset(self: Any, view: World) -> Any:
            from automaton.strategy.layer import memory_of

            return memory_of(view, own=memory)

        body = {"layer": layer, "decide": decide, "reset": reset, "__doc__": decide_one.__doc__}
        return type(decide_one.__name__, (Strategy,), body | {"__module__": decide_one.__module__})

    return make


def _enter_allocation(answers: Any, k: int, answer: Answer, me: Me, view: World) -> None:
    given = answers.allocation
    given.verb[k] = answer.verb
    if answer.verb == state.TAKE:
        given.order[k] = answer.value
        if 0 <= answer.value < len(view.orders.place) and view.orders.place[answer.value] != NIL:
            given.stand[k] = me.stand_for(view.orders.place[answer.value])
            given.order_taken[answer.value] = 1
    elif answer.verb == state.SET_DOWN:
        given.slot[k] = answer.value
        if 0 <= answer.value < len(view.slots.cell):
            given.stand[k] = me.stand_for(answer.value)
            given.slot_taken[answer.value] = 1


def _enter_routing(answers: Any, k: int, answer: Answer, me: Me, view: World) -> None:
    length = len(answer.value)
    if length <= answers.routing.steps.shape[1]:
        answers.routing.steps[k, :length] = answer.value
    answers.routing.length[k] = length


def _enter_right_of_way(answers: Any, k: int, answer: Answer, me: Me, view: World) -> None:
    given = answers.right_of_way
    given.verb[k] = answer.verb
    given.value[k] = answer.value
    given.release[k] = int(answer.release)


_ENTER = {
    "allocation": _enter_allocation,
    "routing": _enter_routing,
    "right_of_way": _enter_right_of_way,
}
