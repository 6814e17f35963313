"""Strategies that tests name as "example_strategies:Class": good ones, and every kind of bad one."""

from __future__ import annotations

import numpy as np

from automaton.compiled import kernel
from automaton.strategy.layer import Strategy, memory_of
from automaton.strategy.per_robot import park, per_robot, set_down, take
from automaton.world.cells import CHARGER
from automaton.world.condition import FULL
from automaton.world.state import (
    FREE,
    GOAL_NONE,
    KEEP,
    NIL,
    PARK,
    PICKED,
    SET_DOWN,
    TAKE,
    TICK,
)


class HalfAndHalf(Strategy):
    """Zoning: robots with even identities serve zone 0, the others zone 1."""

    layer = "zoning"
    every = 5

    def decide(self, view, asked, answers, memory, space):
        for k in range(asked.count[0]):
            answers.zoning.zone[k] = view.robots.identity[asked.robot[k]] % 2


class Halts(Strategy):
    """Zoning: in every tenth tick, all robots are told to stand still for six ticks."""

    layer = "zoning"
    every = 10

    def decide(self, view, asked, answers, memory, space):
        if view.clock[TICK] % 10 == 0:
            answers.zoning.halt[: asked.count[0]] = 6


class ChargeFirst(Strategy):
    """Charging: a robot without an order goes once to the first charger, until it is full."""

    layer = "charging"
    every = 1

    def reset(self, view):
        return memory_of(view, own=1)

    def decide(self, view, asked, answers, memory, space):
        charger = int(np.flatnonzero(view.grid.kind == CHARGER)[0])
        for k in range(asked.count[0]):
            robot = asked.robot[k]
            idle = view.robots.order[robot] == NIL and view.robots.goal[robot] == GOAL_NONE
            if idle and view.robots.busy[robot] == 0 and not memory.own[robot, 0]:
                memory.own[robot, 0] = 1
                answers.charging.stand[k], answers.charging.level[k] = charger, FULL


class Greedy(Strategy):
    """Allocation: takes orders that are reserved, sets loads down anywhere: all illegal."""

    layer = "allocation"

    def decide(self, view, asked, answers, memory, space):
        given = answers.allocation
        for k in range(asked.count[0]):
            given.verb[k] = SET_DOWN if asked.reason[k] == FREE else TAKE
            given.order[k] = 10_000
            given.slot[k] = -5


class Idle(Strategy):
    """Allocation: everybody stays home."""

    layer = "allocation"

    def decide(self, view, asked, answers, memory, space):
        answers.allocation.verb[: asked.count[0]] = PARK


class Writes(Strategy):
    """Allocation: tries to move a robot by writing to the view."""

    layer = "allocation"

    def decide(self, view, asked, answers, memory, space):
        view.robots.cell[0] = 0


class Raises(Strategy):
    """Allocation: fails."""

    layer = "allocation"

    def decide(self, view, asked, answers, memory, space):
        raise RuntimeError("the strategy's own mistake")


@kernel
def write_to_view(view, asked, answers, memory, space):
    view.robots.cell[0] = 0


class CompiledWrites(Strategy):
    """Allocation: a kernel that writes to the view does not compile."""

    layer = "allocation"
    compiled = write_to_view


@kernel
def four_arguments(view, asked, answers, memory):
    pass


class WrongArity(Strategy):
    """Allocation: a kernel with a missing argument."""

    layer = "allocation"
    compiled = four_arguments


class Watcher(Strategy):
    """Right of way: notes which other robots it can see, and whether it may know their memory."""

    layer = "right_of_way"
    every = 1
    sightings: list[tuple[int, frozenset[int]]] = []  # noqa: RUF012
    memories: list[int] = []  # noqa: RUF012

    def reset(self, view):
        return memory_of(view, own=1, shared=1)

    def decide(self, view, asked, answers, memory, space):
        robots = view.robots
        for k in range(asked.count[0]):
            i = int(asked.robot[k])
            seen = {int(robots.identity[j]) for j in (robots.cell != NIL).nonzero()[0]}
            self.sightings.append((int(robots.identity[i]), frozenset(seen)))
            self.memories.append(int(memory.own[:, 0].sum() - memory.own[i, 0]))
            memory.own[i, 0] += 1
            memory.shared[0] += 1
            answers.right_of_way.verb[k] = KEEP


@per_robot("allocation")
def eager(me, sees):
    """Takes the open order that is nearest."""
    if me.load is not None:
        return set_down(sees.target_of(me.load))
    orders = sees.open_orders()
    return take(min(orders, key=lambda order: me.ticks_to(order.slot))) if orders else park()


@per_robot("allocation", memory=1)
def counting(me, sees):
    """Takes orders in turn, and counts in its own memory how often it was asked."""
    me.memory[0] += 1
    if me.reason == PICKED:
        return set_down(sees.target_of(me.load))
    orders = sees.open_orders()
    return take(orders[0]) if orders else park()
