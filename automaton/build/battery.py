"""Batteries and faults of a scenario, in the units of the world."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from automaton.engine import random_numbers
from automaton.engine.robot_status import BATTERY_FULL, BATTERY_PERCENT
from automaton.engine.state import ACTION_COUNT, ACTION_NAMES, NIL, Array

if TYPE_CHECKING:
    from automaton.scenario.schema import Battery, Faults, Scenario


def units(percent: float) -> int:
    """Units of charge in so many percent of a battery."""
    return round(percent * BATTERY_PERCENT)


def drain_table(battery: Battery | None) -> Array:
    """(A, 2) int32: units that a tick of each action takes, without load and with one."""
    table = np.zeros((ACTION_COUNT, 2), np.int32)
    if battery is None:
        return table
    given = battery.drain
    for action, name in enumerate(ACTION_NAMES):
        percent = getattr(given, name, given.wait)
        table[action] = units(percent), units(percent * given.loaded_factor)
    for name in ("charge", "bay_blocked", "down"):
        table[ACTION_NAMES.index(name)] = 0
    return table


def charging_curve(battery: Battery | None) -> Array:
    """(K, 2) int32: from this charge on, units that a tick at a charger gives."""
    if battery is None:
        return np.zeros((1, 2), np.int32)
    steps = (
        battery.charge_rate
        if isinstance(battery.charge_rate, tuple)
        else ((0.0, battery.charge_rate),)
    )
    return np.array([(units(since), units(rate)) for since, rate in steps], np.int32)


def first_charges(scenario: Scenario, seed: int) -> Array:
    """(n,) int32 by identity: what is in the batteries at the start."""
    n = scenario.fleet.robots
    charges = np.full(n, BATTERY_FULL, np.int32)
    if scenario.battery is None:
        return charges
    start = scenario.battery.initial_charge
    if isinstance(start, tuple):
        return np.array([units(percent) for percent in start], np.int32)
    if isinstance(start, float):
        charges[:] = units(start)
        return charges
    low, high = units(start.least), units(start.most)
    with np.errstate(over="ignore"):
        random_numbers.random_integers(
            charges, high - low + 1, np.uint64(seed), random_numbers.STREAM_CHARGES, 0
        )
    drawn: Array = charges + np.int32(low)
    return drawn


def fault_table(faults: Faults) -> Array:
    """(f, 2) int64: tick and identity of the faults that a scenario lists, by tick."""
    rows = sorted((fault.at, fault.robot) for fault in faults.listed)
    return np.array(rows, np.int64).reshape(-1, 2)


def ticks_or_never(ticks: int | None) -> int:
    return NIL if ticks is None else ticks


def may_fail(scenario: Scenario) -> bool:
    """Whether robots of this scenario may go down."""
    faults = scenario.faults
    return scenario.battery is not None or bool(faults.listed) or faults.failure_probability > 0
