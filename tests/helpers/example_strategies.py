"""Strategies that tests name as "example_strategies:Class": good ones, and every kind of bad one."""

from __future__ import annotations

import numpy as np

from automaton.floor.floor_plan import CHARGER
from automaton.strategy.api import (
    BATTERY_FULL,
    CMD_DROP_AT,
    CMD_PARK,
    CMD_RETREAT,
    CMD_STEP,
    CMD_TAKE_ORDER,
    CMD_WAIT,
    GOAL_NONE,
    KEEP,
    NIL,
    REASON_IDLE,
    REASON_PICKED,
    REASON_RETREATING,
    Array,
    Strategy,
    Struct,
    field,
    kernel,
)
from automaton.strategy.per_robot import deliver, drop_at, park, per_robot, take


class HalfAndHalf(Strategy):
    """Zoning: robots with even identities serve zone 0, the others zone 1."""

    layer = "zoning"
    period = 5

    def decide(self, view, batch, decisions, memory, workspace):
        for k in range(batch.count):
            decisions.zoning.service_zone[k] = view.robots.identity[batch.robot[k]] % 2


class Halts(Strategy):
    """Zoning: in every tenth tick, all robots are told to stand still for six ticks."""

    layer = "zoning"
    period = 10

    def decide(self, view, batch, decisions, memory, workspace):
        if view.clock.tick % 10 == 0:
            decisions.zoning.halt[: batch.count] = 6


class HasCharged(Struct):
    """Who was sent to a charger."""

    sent: Array = field("(n,) uint8")


class ChargeFirst(Strategy):
    """Charging: a robot without an order goes once to the first charger, until it is full."""

    layer = "charging"
    period = 1

    def reset(self, view):
        return HasCharged.sized({"n": len(view.robots.cell)})

    def decide(self, view, batch, decisions, memory, workspace):
        state = HasCharged.of(memory)
        charger = int(np.flatnonzero(view.grid.kind == CHARGER)[0])
        for k in range(batch.count):
            robot = batch.robot[k]
            idle = view.robots.order[robot] == NIL and view.robots.goal_type[robot] == GOAL_NONE
            if idle and view.robots.busy[robot] == 0 and not state.sent[robot]:
                state.sent[robot] = 1
                decisions.charging.goal_cell[k], decisions.charging.charge_target[k] = (
                    charger,
                    BATTERY_FULL,
                )


class Greedy(Strategy):
    """Allocation: takes orders that are reserved, sets loads down anywhere: all illegal."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        out = decisions.allocation
        for k in range(batch.count):
            out.command[k] = CMD_DROP_AT if batch.reason[k] == REASON_IDLE else CMD_TAKE_ORDER
            out.order[k] = 10_000
            out.slot[k] = -5


class Nowhere(Strategy):
    """Routing: a route whose third step has no direction."""

    layer = "routing"

    def decide(self, view, batch, decisions, memory, workspace):
        for k in range(batch.count):
            decisions.routing.route_length[k] = 3
            decisions.routing.steps[k, :3] = [0, 0, 5]


class Idle(Strategy):
    """Allocation: everybody stays home."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        decisions.allocation.command[: batch.count] = CMD_PARK


class Writes(Strategy):
    """Allocation: tries to move a robot by writing to the view."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        view.robots.cell[0] = 0


class Raises(Strategy):
    """Allocation: fails."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        raise RuntimeError("the strategy's own mistake")


@kernel
def write_to_view(view, batch, decisions, memory, workspace):
    view.robots.cell[0] = 0


class CompiledWrites(Strategy):
    """Allocation: a kernel that writes to the view does not compile."""

    layer = "allocation"
    compiled = write_to_view


@kernel
def copy_of_batch(view, batch, decisions, memory, workspace):
    robots = np.empty(batch.count)
    for k in range(batch.count):
        robots[k] = batch.robot[k]


class Allocates(Strategy):
    """Allocation: a kernel that makes an array."""

    layer = "allocation"
    compiled = copy_of_batch


@kernel
def four_arguments(view, batch, decisions, memory):
    pass


class WrongArity(Strategy):
    """Allocation: a kernel with a missing argument."""

    layer = "allocation"
    compiled = four_arguments


class Asked(Struct):
    """How often somebody was asked."""

    robot: Array = field("(n,) int64")
    anybody: Array = field("(1,) int64")


class Watcher(Strategy):
    """Right of way: notes which other robots it can see, and whether it may know their memory."""

    layer = "right_of_way"
    period = 1
    sightings: list[tuple[int, frozenset[int]]] = []  # noqa: RUF012
    memories: list[int] = []  # noqa: RUF012

    def reset(self, view):
        return Asked.sized({"n": len(view.robots.cell)})

    def decide(self, view, batch, decisions, memory, workspace):
        robots, state = view.robots, Asked.of(memory)
        for k in range(batch.count):
            i = int(batch.robot[k])
            seen = {int(robots.identity[j]) for j in (robots.cell != NIL).nonzero()[0]}
            self.sightings.append((int(robots.identity[i]), frozenset(seen)))
            self.memories.append(int(state.robot.sum() - state.robot[i] + state.anybody[0]))
            state.robot[i] += 1
            state.anybody[0] += 1
            decisions.right_of_way.command[k] = KEEP


@per_robot("allocation")
def eager(me, view):
    """Takes the open order that is nearest."""
    if me.load is not None:
        return deliver()
    orders = view.open_orders()
    return take(min(orders, key=me.ticks_to)) if orders else park()


@per_robot("allocation", memory=1)
def counting(me, view):
    """Takes orders in turn, and counts in its own memory how often it was asked."""
    me.memory[0] += 1
    if me.reason == REASON_PICKED:
        return drop_at(view.target_of(me.load))
    orders = view.open_orders()
    return take(orders[0]) if orders else park()


class RetreatsLate(Strategy):
    """Right of way that lets robots wait for 2,000 ticks after its first call, and then retreat."""

    layer = "right_of_way"
    first = None

    def decide(self, view, batch, decisions, memory, workspace):
        tick = int(view.clock.tick)
        self.first = tick if self.first is None else self.first
        out = decisions.right_of_way
        for k in range(batch.count):
            step = batch.reason[k] == REASON_RETREATING
            late = CMD_STEP if step else CMD_RETREAT
            out.command[k] = late if tick > self.first + 2000 else CMD_WAIT
            out.value[k] = (tick + k) % 4 if step else 3


class FailsLater(Strategy):
    """Right of way that fails in tick 50, in the middle of its answers."""

    layer = "right_of_way"
    period = 1

    def decide(self, view, batch, decisions, memory, workspace):
        if view.clock.tick == 50:
            raise ZeroDivisionError("own mistake")
