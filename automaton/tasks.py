"""The figures of tasks after a warm-up: how long they take, and by how much too long.

A task is an order carried by one robot all the way. It begins in the tick in which the robot takes
the order and ends in the tick of its delivery, both included. Its delay is what it takes beyond the
least time: each leg driven as fast as the empty floor allows, with the turns that it needs from the
heading in which it begins, the pick, and the tick in which the load is set down.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from automaton.interruption import interruptible
from automaton.kernels.tasks import least_drives
from automaton.scenario.measures import TASK_METRICS as TASK_METRICS
from automaton.scenario.resolve import Resolved
from automaton.world.state import DELIVERED, DROP, NIL, PICK, TICK, Array, Workspace, World


class Measured(Protocol):
    """What the figures of tasks need of a simulation."""

    @property
    def world(self) -> World: ...
    @property
    def view(self) -> World: ...
    @property
    def space(self) -> Workspace: ...
    @property
    def resolved(self) -> Resolved: ...
    @property
    def least(self) -> Array: ...
    @property
    def counted(self) -> Mapping[str, int]: ...


def task_figures(run: Measured) -> dict[str, float]:
    """The metrics of TASK_METRICS, or none if the scenario does not measure tasks.

    Where no task has ended nothing is known of the time that tasks take: `completions` stands alone.
    """
    measure = run.resolved.scenario.measure
    if measure is None:
        return {}
    world, warm_up = run.world, measure.warm_up
    orders, robots = world.orders, len(world.robots.cell)
    done = orders.state == DELIVERED
    tasks = np.flatnonzero(done & (orders.dispatched > warm_up) & (orders.legs == 1))
    after = max(0, int(world.clock[TICK]) - warm_up)
    completed = int(np.count_nonzero(done & (orders.delivered > warm_up)))
    found = {"completions": 1000 * completed / (robots * after) if after else 0.0}
    if not len(tasks):
        return found
    times = task_times(world, tasks)
    delays = times - least_times(run, tasks)
    return {
        **found,
        "task_time": float(times.mean()),
        "delay": float(delays.mean()),
        "delay_p95": quantile_95(delays),
    }


def quantile_95(values: Array) -> float:
    """The least of some values, one at least, that 95 % of them do not exceed.

    Within one run: orders of several runs, or of one, are not independent of each other.
    """
    return float(np.sort(values)[-(-95 * len(values) // 100) - 1])


def task_times(world: World, tasks: Array) -> Array:
    """(k,) ticks from taking each of these delivered orders to its delivery."""
    orders = world.orders
    times: Array = orders.delivered[tasks].astype(np.int64) - orders.dispatched[tasks] + 1
    return times


def least_times(run: Measured, tasks: Array) -> Array:
    """(k,) the least ticks that each of these delivered orders could have taken."""
    unknown = tasks[run.least[tasks] == NIL]
    if len(unknown):
        with interruptible(run.space.stop):
            least_drives(run.view, run.space, unknown, run.least)
    duration = run.world.rules.duration[0]  # types differ in their moves alone
    times: Array = run.least[tasks] + int(duration[PICK]) + min(1, int(duration[DROP]))
    return times
