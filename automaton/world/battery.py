"""Batteries and faults: what their numbers mean, and a scenario's constants in these units.

A battery holds FULL units when it is full. What an operation takes is paid when it begins, all of
it, so that no robot stops between two cells: one that lacks it is out of order where it stands.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from automaton.kernels import draws
from automaton.world.state import ACTION_NAMES, ACTIONS, MOVE, NIL, WAIT, Array

if TYPE_CHECKING:
    from automaton.scenario.schema import Battery, Faults, Scenario

FULL: Final = 1_000_000  # units of charge in a full battery: one is 0.0001 %
PERCENT: Final = FULL // 100

# States of a robot: robots.status.
RUNNING: Final = 0
FAILING: Final = 1  # a fault takes it out as soon as what it does is over
EXHAUSTED: Final = 2  # its battery lacks what its next operation takes
EMPTY: Final = 3  # out of order on the floor, for want of energy
BROKEN: Final = 4  # out of order on the floor, for a fault
TOWED: Final = 5  # off the floor, until it comes back
GONE: Final = 6  # off the floor for good
STATUS_NAMES: Final = (
    *("running", "failing", "exhausted", "empty battery", "broken down", "towed", "gone"),
)

# Columns of tally.out.
RAN_EMPTY: Final = 0
BROKE_DOWN: Final = 1
WAS_TOWED: Final = 2


def units(percent: float) -> int:
    """Units of charge in so many percent of a battery."""
    return round(percent * PERCENT)


def drain_table(battery: Battery | None) -> Array:
    """(A, 2) int32: units that a tick of each action takes, without load and with one."""
    table = np.zeros((ACTIONS, 2), np.int32)
    if battery is None:
        return table
    given = battery.drain
    for action, name in enumerate(ACTION_NAMES):
        percent = getattr(given, name, given.wait)
        table[action] = units(percent), units(percent * given.loaded)
    for name in ("charge", "bay_blocked", "out_of_order"):
        table[ACTION_NAMES.index(name)] = 0
    return table


def charging_curve(battery: Battery | None) -> Array:
    """(K, 2) int32: from this charge on, units that a tick at a charger gives."""
    if battery is None:
        return np.zeros((1, 2), np.int32)
    steps = battery.charge if isinstance(battery.charge, tuple) else ((0.0, battery.charge),)
    return np.array([(units(since), units(rate)) for since, rate in steps], np.int32)


def first_charges(scenario: Scenario, seed: int) -> Array:
    """(n,) int32 by identity: what is in the batteries at the start."""
    n = scenario.fleet.robots
    charges = np.full(n, FULL, np.int32)
    if scenario.battery is None:
        return charges
    start = scenario.battery.start
    if isinstance(start, tuple):
        return np.array([units(percent) for percent in start], np.int32)
    if isinstance(start, float):
        charges[:] = units(start)
        return charges
    low, high = units(start.least), units(start.most)
    with np.errstate(over="ignore"):
        draws.draw_many(charges, high - low + 1, np.uint64(seed), draws.CHARGES, 0)
    drawn: Array = charges + np.int32(low)
    return drawn


def fault_table(faults: Faults) -> Array:
    """(f, 2) int64: tick and identity of the faults that a scenario lists, by tick."""
    rows = sorted((fault.at, fault.robot) for fault in faults.listed)
    return np.array(rows, np.int64).reshape(-1, 2)


def ticks_or_never(ticks: int | None) -> int:
    return NIL if ticks is None else ticks


def may_fail(scenario: Scenario) -> bool:
    """Whether robots of this scenario may go out of order."""
    faults = scenario.faults
    return scenario.battery is not None or bool(faults.listed) or faults.rate > 0


def waiting_is_free(drain: Array) -> bool:
    """Whether robots that stand still use no energy."""
    return not drain[WAIT].any()


def most_per_move(drain: Array) -> int:
    """Units that a tick of driving takes at most."""
    return int(drain[MOVE].max())
