"""Strategies that each break one promise of a strategy: sixteen in Python, two compiled."""

from __future__ import annotations

import os
import signal
import sys
import time
from typing import Any

from automaton.strategy import orders
from automaton.strategy.api import (
    CMD_PARK,
    CMD_TAKE_ORDER,
    FIXED,
    REASON_PERIODIC,
    SCRATCH,
    Array,
    Strategy,
    Struct,
    can_do,
    field,
    highest_priority,
    is_open,
    kernel,
    place_load,
    places_load,
    take_order,
)


class Sound(Strategy):
    """Takes the first open order; the others change one thing."""

    layer = "allocation"

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        out = decisions.allocation
        for k in range(batch.count):
            robot, reason = batch.robot[k], batch.reason[k]
            if orders.asks_for_place(reason):
                orders.place_load(view, out, workspace, k, robot)
            elif reason != REASON_PERIODIC:
                self.choose(view, out, workspace, k, robot)

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        open_orders = self.ranked(view, orders.list_open(view, out, robot), robot)
        most = max((int(view.orders.priority[one]) for one in open_orders), default=0)
        for order in open_orders:
            if view.orders.priority[order] == most:
                orders.take(view, out, k, robot, order)
                return
        out.command[k] = CMD_PARK

    def ranked(self, view: Any, open_orders: list[int], robot: int) -> list[int]:
        return open_orders


class NoDocstring(Sound):
    pass


class WrongPeriod(Sound):
    """contract: its period is not a number of ticks."""

    period = -1


class WrongState(Sound):
    """contract: reset returns a dictionary."""

    def reset(self, view: Any) -> Any:
        return {}


class Illegal(Sound):
    """legality: it takes orders that others have."""

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        out.command[k], out.order[k] = CMD_TAKE_ORDER, 0
        out.goal_cell[k] = view.robots.cell[robot]


class Raises(Sound):
    """survival: it raises when no order is open."""

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        orders.take(view, out, k, robot, orders.list_open(view, out, robot)[0])


class NeverAnswers(Sound):
    """survival: it raises in each decision."""

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        raise RuntimeError("no answer")


class Dies(Sound):
    """survival: the process dies."""

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class DiesLater(Sound):
    """survival: like a kernel that breaks memory, it ends the process of its second case."""

    cases = 0

    def reset(self, view: Any) -> Any:
        DiesLater.cases += 1
        return super().reset(view)

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        if DiesLater.cases == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        super().choose(view, out, workspace, k, robot)


class Endless(Sound):
    """survival: a decision never ends."""

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        while True:
            time.sleep(0.01)


class Chance(Sound):
    """repeats: it decides by the clock."""

    def ranked(self, view: Any, open_orders: list[int], robot: int) -> list[int]:
        return sorted(open_orders, key=lambda _: time.perf_counter_ns() % 97)


class HashOrder(Sound):
    """repeats: it decides by the hash of a text, which differs between processes."""

    def ranked(self, view: Any, open_orders: list[int], robot: int) -> list[int]:
        return sorted(open_orders, key=lambda one: hash(f"order {one}"))


class ByStorage(Sound):
    """storage: it decides by the index at which a robot is stored."""

    def ranked(self, view: Any, open_orders: list[int], robot: int) -> list[int]:
        return open_orders[::-1] if robot % 2 else open_orders


class WritesWorld(Sound):
    """writes: it changes the world behind its read-only view."""

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        simulation_in_a_frame().world.robots.charge[robot] -= 1
        super().choose(view, out, workspace, k, robot)


class WritesOtherLayers(Sound):
    """writes: it decides for another layer."""

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        super().decide(view, batch, decisions, memory, workspace)
        decisions.right_of_way.command[:] = 3


class Grows(Sound):
    """memory: it remembers every call."""

    def __init__(self, parameters: Any = None) -> None:
        super().__init__(parameters)
        self.period, self.calls = 1, []

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        self.calls.append(bytes(1_000))
        super().decide(view, batch, decisions, memory, workspace)


class Peeks(Sound):
    """information: it looks at robots out of sight."""

    def ranked(self, view: Any, open_orders: list[int], robot: int) -> list[int]:
        world = simulation_in_a_frame().world
        return open_orders[:: -1 if int(world.robots.cell.sum()) % 2 else 1]


class Gossips(Sound):
    """information: a robot knows what others have been asked."""

    def __init__(self, parameters: Any = None) -> None:
        super().__init__(parameters)
        self.calls = 0

    def ranked(self, view: Any, open_orders: list[int], robot: int) -> list[int]:
        self.calls += 1
        return open_orders[:: -1 if self.calls % 2 else 1]


class Idle(Sound):
    """delivery: it takes no order."""

    def choose(self, view: Any, out: Any, workspace: Any, k: int, robot: int) -> None:
        out.command[k] = CMD_PARK


def simulation_in_a_frame() -> Any:
    """The simulation, from the frames of its callers."""
    frame: Any = sys._getframe(1)
    while frame is not None:
        owner = frame.f_locals.get("self")
        run = getattr(owner, "run", None)
        for one in (owner, run):
            if hasattr(one, "visible_world"):
                return one
        frame = frame.f_back
    raise LookupError("no simulation")


# Compiled; conformance_trials.py checks them.


class Marks(Struct):
    """What the kernels remember."""

    last: Array = field("(2,) int64", "calls so far")
    calls: Array = field("(1,) int64", "calls so far, not copied to branches", role=SCRATCH)


@kernel
def take_some_order(view, batch, out, workspace, is_last):  # type: ignore[no-untyped-def]
    """Every robot takes the first open order, or the last one."""
    for k in range(batch.count):
        i = batch.robot[k]
        if places_load(batch.reason[k]):
            place_load(view, out, workspace, k, i, FIXED)
        elif batch.reason[k] != REASON_PERIODIC:
            chosen, least = -1, highest_priority(view, out, i)
            for order in range(view.clock.first_open, view.clock.known_orders):
                if (chosen >= 0 and not is_last) or view.orders.priority[order] < least:
                    continue
                if is_open(view, out, i, order) and can_do(view, i, order):
                    chosen = order
            if chosen < 0:
                out.command[k] = CMD_PARK
            else:
                take_order(view, out, k, i, chosen)


@kernel
def count_outside(view, batch, decisions, memory, workspace):  # type: ignore[no-untyped-def]
    state = Marks.of(memory)
    state.last[-1] += 1
    take_some_order(view, batch, decisions.allocation, workspace, False)


@kernel
def alternate(view, batch, decisions, memory, workspace):  # type: ignore[no-untyped-def]
    state = Marks.of(memory)
    state.calls[0] += 1
    take_some_order(view, batch, decisions.allocation, workspace, state.calls[0] % 2 == 0)


class OutsideIndex(Strategy):
    """jit: an index below 0."""

    layer = "allocation"
    compiled = count_outside

    def reset(self, view: Any) -> Struct:
        return Marks.sized()


class ScratchMemory(OutsideIndex):
    """branches: it remembers in scratch, which is not copied."""

    compiled = alternate
