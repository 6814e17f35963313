"""Strategies that decide at random, legally or not: what no rule of the world may depend on.

Every decision follows from the seed, the layer, the tick and the robot's identity alone.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
from naive_motion import mix

from automaton.strategy import paths
from automaton.strategy.layer import Strategy
from automaton.world.cells import CHARGER
from automaton.world.condition import FULL
from automaton.world.state import (
    GOAL_CHARGE,
    LAYERS,
    NIL,
    PARK,
    PAUSE,
    PICKED,
    RETREAT,
    SET_DOWN,
    STEP,
    TAKE,
    TICK,
    WAITING,
)


class Mood(msgspec.Struct, frozen=True):
    """How a random strategy is inclined; shares are out of 256."""

    seed: int = 1
    every: int = 1  # it is also asked about all robots every so many ticks
    illegal: int = 16  # share of answers that break a rule
    active: int = 128  # share of answers that change something
    waits: tuple[int, int, int, int, int] = (1, 1, 1, 1, 1)


class Dice:
    """Random numbers of one decision."""

    def __init__(self, *address: int) -> None:
        self.state = 0
        for number in address:
            self.state = mix(self.state ^ (number + 1) * 0x9E3779B97F4A7C15 & 2**64 - 1)

    def below(self, count: int) -> int:
        self.state = mix(self.state + 1 & 2**64 - 1)
        return self.state % count

    def among(self, things: Any) -> Any:
        return things[self.below(len(things))]


class RandomStrategy(Strategy):
    """Rolls for every robot asked: an illegal answer, a legal one, or KEEP."""

    Parameters = Mood

    def __init__(self, parameters: Mood | None = None) -> None:
        super().__init__(parameters)
        self.every = self.parameters.every

    def waits(self) -> Any:
        return self.parameters.waits

    def decide(self, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
        layer = LAYERS.index(self.layer)
        mood = self.parameters
        for k in range(asked.count[0]):
            i = int(asked.robot[k])
            who = int(view.robots.identity[i])
            dice = Dice(mood.seed, layer, int(view.clock[TICK]), who)
            roll = dice.below(256)
            if roll < mood.illegal:
                self.offend(view, dice, i, k, getattr(answers, self.layer))
            elif roll < mood.illegal + mood.active:
                given = getattr(answers, self.layer)
                self.act(view, dice, i, k, given, int(asked.reason[k]), space)

    def offend(self, view: Any, dice: Dice, i: int, k: int, given: Any) -> None:
        raise NotImplementedError

    def act(
        self, view: Any, dice: Dice, i: int, k: int, given: Any, reason: int, space: Any
    ) -> None:
        raise NotImplementedError


def floor_cells(view: Any) -> Any:
    return (view.grid.rule & 15).nonzero()[0].tolist()


class RandomZoning(RandomStrategy):
    """Halts robots, hands zones and orders to anybody, and puts stations into any zone."""

    layer = "zoning"

    def offend(self, view, dice, i, k, given):
        given.halt[k] = dice.among([-1, 60_001, 2**31 - 1])
        given.server[dice.below(len(given.server))] = dice.among([-1, len(given.server)])

    def act(self, view, dice, i, k, given, reason, space):
        zones = len(given.server)
        given.zone[k] = dice.below(zones)
        given.again[k] = dice.among([NIL, 1, 3])
        if dice.below(3) == 0:
            given.halt[k] = dice.below(6)
        given.tells[k] = dice.below(2)
        given.said[k] = dice.below(100)
        given.server[dice.below(zones)] = dice.below(zones)
        if dice.below(4) == 0:
            design = given.design
            design.segments[0] = 0
            design.transfer[:] = 0
            design.zone[:] = [dice.below(zones) for _ in design.zone]
            given.redesigned[0] = 1
        row = int(given.queued[0])
        if row < len(view.orders.state):
            given.queued[0] = row + 1
            given.order[row] = order = dice.below(len(view.orders.state))
            given.queue[row], given.stop[row] = dice.below(zones), view.orders.target[order]
            given.direct[row] = dice.below(2)


class RandomCharging(RandomStrategy):
    """Sends robots to any charger, whether they are free or not."""

    layer = "charging"

    def offend(self, view, dice, i, k, given):
        given.stand[k] = dice.among([0, -5, len(view.grid.rule), *floor_cells(view)[:1]])
        given.level[k] = dice.among([0, -1, FULL + 1])

    def act(self, view, dice, i, k, given, reason, space):
        eager = view.robots.parked[i] or dice.below(6) == 0
        chargers = np.flatnonzero(view.grid.kind == CHARGER).tolist()
        if eager and view.robots.order[i] == NIL and chargers and view.rules.battery:
            given.stand[k] = dice.among(chargers)
            given.level[k] = 1 + dice.below(FULL)
            given.yields[k] = dice.below(2)
        elif view.robots.goal[i] == GOAL_CHARGE and dice.below(4) == 0:
            given.stand[k] = NIL


class RandomAllocation(RandomStrategy):
    """Takes any order, sets loads down on any shelf, parks."""

    layer = "allocation"

    def offend(self, view, dice, i, k, given):
        given.verb[k] = dice.among([TAKE, SET_DOWN, PARK, 7, -1])
        given.order[k] = dice.below(len(view.orders.state) + 4) - 2
        given.slot[k] = dice.below(len(view.slots.cell) + 4) - 2
        given.stand[k] = dice.below(len(view.grid.rule))

    def act(self, view, dice, i, k, given, reason, space):
        if reason == PICKED or view.robots.load[i] != NIL:
            target = int(view.orders.target[view.robots.load[i]])
            empty = (view.slots.content == NIL) & (view.slots.by == NIL) & (view.slots.endless == 0)
            slot = dice.among([target, target, *empty.nonzero()[0].tolist()])
            self.send(view, dice, k, given, SET_DOWN, slot)
            given.slot[k] = slot
            given.try_drop[k] = dice.below(4) == 0
        elif dice.below(3) == 0 and view.robots.order[i] == NIL:
            given.verb[k] = PARK
        else:
            waiting = (view.orders.state == WAITING) & (view.orders.by == NIL)
            for order in [dice.among(waiting.nonzero()[0])] if waiting.any() else []:
                self.send(view, dice, k, given, TAKE, int(view.orders.place[order]))
                given.order[k] = order
        given.ask_again[k] = dice.below(2)

    def send(self, view, dice, k, given, verb, slot):
        stands = [cell for cell in view.slots.access[slot].tolist() if cell != NIL]
        if stands:
            given.verb[k] = verb
            given.stand[k] = dice.among(stands)


class RandomRouting(RandomStrategy):
    """Shortest paths, detours, and routes that no robot can drive."""

    layer = "routing"

    def offend(self, view, dice, i, k, given):
        given.length[k] = dice.among([-1, 1, 3, given.steps.shape[1] + 1])
        given.steps[k, :3] = [dice.below(6) for _ in range(3)]

    def act(self, view, dice, i, k, given, reason, space):
        goal = int(view.robots.stand[i])
        if goal == NIL or dice.below(8) == 0:
            goal = dice.among(floor_cells(view) or [goal])
        route = paths.route(view, space, i, goal, around=bool(dice.below(2)))
        if route is not None and len(route) <= given.steps.shape[1]:
            given.length[k] = len(route)
            given.steps[k, : len(route)] = route


class RandomRightOfWay(RandomStrategy):
    """Steps, pauses, withdrawals and priorities, asked for at any time."""

    layer = "right_of_way"

    def offend(self, view, dice, i, k, given):
        steps = ((STEP, 4), (STEP, -1), (STEP, dice.below(4)))
        others = ((PAUSE, 0), (PAUSE, 20_000), (RETREAT, 0), (RETREAT, -3), (9, 1), (-7, 1))
        given.verb[k], given.value[k] = dice.among(steps + others)
        given.priority[k] = dice.among([40_000, -40_000, 3, -3])

    def act(self, view, dice, i, k, given, reason, space):
        if view.robots.parked[i] and dice.below(32):
            return
        given.verb[k] = dice.among([STEP] * 12 + [PAUSE, RETREAT])
        given.value[k] = 1 + dice.below(3)
        given.release[k] = dice.below(2)
        if dice.below(4) == 0:
            given.priority[k] = dice.below(5) - 2
        if given.verb[k] == STEP:
            given.value[k] = self.direction(view, dice, i)

    def direction(self, view, dice, i):
        """A direction that leads somewhere; rather straight on, as robots do that want to go."""
        cell, heading = int(view.robots.cell[i]), int(view.robots.heading[i])
        rule = int(view.grid.rule[cell]) if cell != NIL else 0
        ways = [d for d in range(4) if rule >> d & 1]
        straight = [d for d in ways if d & (view.grid.headings - 1) == heading]
        if not rule & 16 or dice.below(2):
            ways = straight or ways
        return dice.among(ways or [0])
