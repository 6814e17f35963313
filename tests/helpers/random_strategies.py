"""Strategies that decide at random, legally or not: what no rule of the world may depend on.

Every decision follows from the seed, the layer, the tick and the robot's identity alone.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
from reference_motion import splitmix64

from automaton.engine.state import LAYER_NAMES
from automaton.floor.floor_plan import CHARGER
from automaton.strategy import paths
from automaton.strategy.api import (
    BATTERY_FULL,
    CMD_DROP_AT,
    CMD_GO,
    CMD_HOLD,
    CMD_PARK,
    CMD_RETREAT,
    CMD_STEP,
    CMD_TAKE_ORDER,
    CMD_WAIT,
    GOAL_CHARGE,
    NIL,
    ORDER_WAITING,
    REASON_PICKED,
    Strategy,
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
            self.state = splitmix64(self.state ^ (number + 1) * 0x9E3779B97F4A7C15 & 2**64 - 1)

    def below(self, count: int) -> int:
        self.state = splitmix64(self.state + 1 & 2**64 - 1)
        return self.state % count

    def among(self, things: Any) -> Any:
        return things[self.below(len(things))]


class RandomStrategy(Strategy):
    """Rolls for every robot asked: an illegal answer, a legal one, or KEEP."""

    Parameters = Mood

    def __init__(self, parameters: Mood | None = None) -> None:
        super().__init__(parameters)
        self.period = self.parameters.every

    def wait_ranges(self) -> Any:
        return self.parameters.waits

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        layer = LAYER_NAMES.index(self.layer)
        mood = self.parameters
        for k in range(batch.count):
            i = int(batch.robot[k])
            who = int(view.robots.identity[i])
            dice = Dice(mood.seed, layer, int(view.clock.tick), who)
            roll = dice.below(256)
            if roll < mood.illegal:
                self.offend(view, dice, i, k, getattr(decisions, self.layer))
            elif roll < mood.illegal + mood.active:
                out = getattr(decisions, self.layer)
                self.act(view, dice, i, k, out, int(batch.reason[k]), workspace)

    def offend(self, view: Any, dice: Dice, i: int, k: int, out: Any) -> None:
        raise NotImplementedError

    def act(
        self, view: Any, dice: Dice, i: int, k: int, out: Any, reason: int, workspace: Any
    ) -> None:
        raise NotImplementedError


def floor_cells(view: Any) -> Any:
    return (view.grid.cell_flags & 15).nonzero()[0].tolist()


class RandomZoning(RandomStrategy):
    """Halts robots, hands zones and orders to anybody, and puts stations into any zone."""

    layer = "zoning"

    def offend(self, view, dice, i, k, out):
        out.halt[k] = dice.among([-1, 60_001, 2**31 - 1])
        out.server[dice.below(len(out.server))] = dice.among([-1, len(out.server)])

    def act(self, view, dice, i, k, out, reason, workspace):
        zones = len(out.server)
        out.service_zone[k] = dice.below(zones)
        out.again[k] = dice.among([NIL, 1, 3])
        if dice.below(3) == 0:
            out.halt[k] = dice.below(6)
        out.sends_message[k] = dice.below(2)
        out.messages[k] = dice.below(100)
        out.server[dice.below(zones)] = dice.below(zones)
        if dice.below(4) == 0:
            design = out.design
            design.segments = 0
            design.transfer[:] = 0
            design.zone[:] = [dice.below(zones) for _ in design.zone]
            out.redesigned = 1
        row = int(out.queued)
        if row < len(view.orders.state):
            out.queued = row + 1
            out.order[row] = order = dice.below(len(view.orders.state))
            out.queue[row], out.next_slot[row] = dice.below(zones), view.orders.target[order]
            out.skips_transfer[row] = dice.below(2)


class RandomCharging(RandomStrategy):
    """Sends robots to any charger, whether they are free or not."""

    layer = "charging"

    def offend(self, view, dice, i, k, out):
        out.goal_cell[k] = dice.among([0, -5, len(view.grid.cell_flags), *floor_cells(view)[:1]])
        out.charge_target[k] = dice.among([0, -1, BATTERY_FULL + 1])

    def act(self, view, dice, i, k, out, reason, workspace):
        eager = view.robots.parked[i] or dice.below(6) == 0
        chargers = np.flatnonzero(view.grid.kind == CHARGER).tolist()
        if eager and view.robots.order[i] == NIL and chargers and view.rules.battery:
            out.goal_cell[k] = dice.among(chargers)
            out.charge_target[k] = 1 + dice.below(BATTERY_FULL)
            out.charging_interruptible[k] = dice.below(2)
        elif view.robots.goal_type[i] == GOAL_CHARGE and dice.below(4) == 0:
            out.goal_cell[k] = NIL


class RandomAllocation(RandomStrategy):
    """Takes any order, sets loads down on any shelf, parks."""

    layer = "allocation"

    def offend(self, view, dice, i, k, out):
        out.command[k] = dice.among([CMD_TAKE_ORDER, CMD_DROP_AT, CMD_PARK, 7, -1])
        out.order[k] = dice.below(len(view.orders.state) + 4) - 2
        out.slot[k] = dice.below(len(view.slots.cell) + 4) - 2
        out.goal_cell[k] = dice.below(len(view.grid.cell_flags))

    def act(self, view, dice, i, k, out, reason, workspace):
        if reason == REASON_PICKED or view.robots.load[i] != NIL:
            target = int(view.orders.target[view.robots.load[i]])
            empty = (
                (view.slots.content == NIL)
                & (view.slots.reserved_by == NIL)
                & (view.slots.unbounded == 0)
            )
            slot = dice.among([target, target, *empty.nonzero()[0].tolist()])
            self.send(view, dice, k, out, CMD_DROP_AT, slot)
            out.slot[k] = slot
            out.try_drop[k] = dice.below(4) == 0
        elif dice.below(3) == 0 and view.robots.order[i] == NIL:
            out.command[k] = CMD_PARK
        else:
            waiting = (view.orders.state == ORDER_WAITING) & (view.orders.reserved_by == NIL)
            for order in [dice.among(waiting.nonzero()[0])] if waiting.any() else []:
                self.send(view, dice, k, out, CMD_TAKE_ORDER, int(view.orders.current_slot[order]))
                out.order[k] = order
        out.ask_again[k] = dice.below(2)

    def send(self, view, dice, k, out, command, slot):
        stands = [cell for cell in view.slots.access[slot].tolist() if cell != NIL]
        if stands:
            out.command[k] = command
            out.goal_cell[k] = dice.among(stands)


class RandomRouting(RandomStrategy):
    """Shortest paths, detours, and routes that no robot can drive."""

    layer = "routing"

    def offend(self, view, dice, i, k, out):
        out.route_length[k] = dice.among([-1, 1, 3, out.steps.shape[1] + 1])
        out.steps[k, :3] = [dice.below(6) for _ in range(3)]

    def act(self, view, dice, i, k, out, reason, workspace):
        goal = int(view.robots.goal_cell[i])
        if goal == NIL or dice.below(8) == 0:
            goal = dice.among(floor_cells(view) or [goal])
        route = paths.route(view, workspace, i, goal, around=bool(dice.below(2)))
        if route is not None and len(route) <= out.steps.shape[1]:
            out.route_length[k] = len(route)
            out.steps[k, : len(route)] = route


class RandomSteering(RandomStrategy):
    """Says in each tick who goes where, as it happens."""

    layer = "right_of_way"
    steers = True

    def offend(self, view, dice, i, k, out):
        out.command[k], out.value[k] = dice.among(
            [(CMD_GO, 4), (CMD_GO, -1), (CMD_HOLD, 4), (CMD_STEP, 1), (CMD_RETREAT, 3), (9, 1)]
        )

    def act(self, view, dice, i, k, out, reason, workspace):
        cell, goal = int(view.robots.cell[i]), int(view.robots.goal_cell[i])
        if cell == goal and goal != NIL and dice.below(4):
            return  # it does what it came for
        out.command[k] = dice.among([CMD_GO] * 12 + [CMD_HOLD, CMD_WAIT])
        out.value[k] = dice.below(4)
        if cell != NIL and out.command[k] == CMD_GO:
            ways = [d for d in range(4) if int(view.grid.cell_flags[cell]) >> d & 1]
            out.value[k] = (
                self.towards(view, workspace, i, goal, dice)
                if dice.below(4)
                else (dice.among(ways or [0]))
            )

    def towards(self, view, workspace, i, goal, dice):
        """The first step to the goal, or any."""
        route = paths.route(view, workspace, i, goal) if goal != NIL else None
        return int(route[0]) if route is not None and len(route) else dice.below(4)


class RandomRightOfWay(RandomStrategy):
    """Steps, pauses, retreats and priorities, asked for at any time."""

    layer = "right_of_way"

    def offend(self, view, dice, i, k, out):
        steps = ((CMD_STEP, 4), (CMD_STEP, -1), (CMD_STEP, dice.below(4)))
        others = (
            (CMD_WAIT, 0),
            (CMD_WAIT, 20_000),
            (CMD_RETREAT, 20_000),
            (CMD_RETREAT, -3),
            (9, 1),
            (-7, 1),
        )
        out.command[k], out.value[k] = dice.among(steps + others)
        out.priority[k] = dice.among([40_000, -40_000, 3, -3])

    def act(self, view, dice, i, k, out, reason, workspace):
        if view.robots.parked[i] and dice.below(32):
            return
        out.command[k] = dice.among([CMD_STEP] * 12 + [CMD_WAIT, CMD_RETREAT])
        out.value[k] = 1 + dice.below(3)
        out.return_order[k] = dice.below(2)
        if dice.below(4) == 0:
            out.priority[k] = dice.below(5) - 2
        if out.command[k] == CMD_STEP:
            out.value[k] = self.direction(view, dice, i)

    def direction(self, view, dice, i):
        """A direction that leads somewhere; rather straight on, as robots do that want to go."""
        cell, heading = int(view.robots.cell[i]), int(view.robots.heading[i])
        rule = int(view.grid.cell_flags[cell]) if cell != NIL else 0
        ways = [d for d in range(4) if rule >> d & 1]
        apart = int(view.grid.type_headings[view.robots.type[i]])
        straight = [d for d in ways if d % apart == heading]
        if not rule & 16 or dice.below(2):
            ways = straight or ways
        return dice.among(ways or [0])
