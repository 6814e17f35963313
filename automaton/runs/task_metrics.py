"""The metrics of tasks after a warm-up: how long they take, and by how much too long.

A task is an order carried by one robot all the way. It begins in the tick in which the robot takes
the order and ends in the tick of its delivery, both included. Its delay is what it takes beyond the
least time: each leg driven as fast as the empty floor allows, with the turns that it needs from the
heading in which it begins, the pick, and the tick in which the load is dropped. Of an order without a
load it is the legs between its stops, each in at least a tick and from the best heading but for the
first one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np

from automaton.engine.state import (
    ACTION_DROP,
    ACTION_PICK,
    NIL,
    ORDER_DELIVERED,
    Array,
    Workspace,
    World,
)
from automaton.runs.interruption import interruptible
from automaton.runs.task_lower_bounds import min_drive_ticks
from automaton.scenario.unavailable_metrics import TASK_METRICS as TASK_METRICS
from automaton.world.resolve import Resolved


class Measured(Protocol):
    """What the metrics of tasks need of a simulation."""

    @property
    def world(self) -> World: ...
    @property
    def view(self) -> World: ...
    @property
    def workspace(self) -> Workspace: ...
    @property
    def resolved(self) -> Resolved: ...
    @property
    def least(self) -> Array: ...
    @property
    def counted(self) -> Mapping[str, int]: ...


class Tasks(NamedTuple):
    """Tasks that were done: when each was taken, how long it took, and by how much too long."""

    begun: Array  # (k,) ticks
    times: Array
    delays: Array

    @property
    def sums(self) -> dict[str, Array]:
        """What automaton.runs.metric_sums adds up, by task."""
        return {
            "taken": np.ones(len(self.begun), np.int64),
            "task_times": self.times,
            "delays": self.delays,
        }


def tasks_after(run: Measured, tick: int) -> Tasks:
    """The tasks that were taken after a tick and are done."""
    world = run.world
    orders = world.orders
    whole = (orders.state == ORDER_DELIVERED) & (orders.legs == 1)
    tasks = np.flatnonzero(whole & (orders.dispatched > tick))
    times = task_times(world, tasks)
    return Tasks(orders.dispatched[tasks], times, times - least_times(run, tasks))


def summed(ticks: Array, values: Array, borders: Array) -> Array:
    """(borders - 1,) int64: values by the stretch in which their ticks lie; those before are left out.

    A stretch begins after a border, and ends with the next one; ascending.
    """
    stretch = np.minimum(np.searchsorted(borders, ticks) - 1, len(borders) - 2)
    inside = stretch >= 0
    found = np.bincount(stretch[inside], values[inside], len(borders) - 1)
    return found.astype(np.int64)  # exact below 2^53


def quantile(values: Array, share: int) -> float:
    """The least of some values, one at least, that so many percent of them do not exceed.

    Within one run: orders of several runs, or of one, are not independent of each other.
    """
    return float(np.sort(values)[-(-share * len(values) // 100) - 1])


def task_times(world: World, tasks: Array) -> Array:
    """(k,) ticks from taking each of these delivered orders to its delivery."""
    orders = world.orders
    times: Array = orders.delivered[tasks].astype(np.int64) - orders.dispatched[tasks] + 1
    return times


def least_times(run: Measured, tasks: Array) -> Array:
    """(k,) the least ticks that each of these delivered orders could have taken."""
    unknown = tasks[run.least[tasks] == NIL]
    if len(unknown):
        with interruptible(run.workspace.stop):
            min_drive_ticks(run.view, run.workspace, unknown, run.least)
    duration = run.world.rules.duration[run.world.orders.dispatched_type[tasks]]
    handling = duration[:, ACTION_PICK].astype(np.int64) + np.minimum(1, duration[:, ACTION_DROP])
    has_load = run.world.orders.source[tasks] != NIL
    times: Array = run.least[tasks] + handling * has_load
    return times
