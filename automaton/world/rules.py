"""The constants of a world from its scenario, with batteries and faults in the units of the world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from automaton.engine.facilities import Rules
from automaton.engine.state import (
    ACTION_COUNT,
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_NAMES,
    ACTION_PICK,
    ACTION_TRY_DROP,
    ACTION_TURN,
    BATTERY_FULL,
    BATTERY_PERCENT,
    FOLLOWING_HANDOVER,
    FOLLOWING_NAMES,
    LAYER_ALLOCATION,
    LAYER_RIGHT_OF_WAY,
    NIL,
    ORDER_LIST,
    STRATEGY_COUNT,
    Array,
)
from automaton.scenario.order_lines import priorities_of
from automaton.scenario.robot_types import RobotType, follows_in_convoy, types_of
from automaton.scenario.schema import Battery, Faults, Scenario
from automaton.units import bytes_of, unit
from automaton.world.draws import repair_ticks

STOP_CODES = {"parked": 0, "delivered": 1, "never": 2, "on-targets": 3}


def rules_for(
    scenario: Scenario,
    seed: int,
    loaded_differ: bool = False,
    in_convoy: bool = False,
    allocations: Sequence[int] = (),
) -> Rules:
    """The scenario's constants; those that strategies set are entered when they are admitted.

    `loaded_differ`: robots with a load drive differently, as separate types; `in_convoy`: some may be in
    moves of several ticks; `allocations`: for each type, the number of the strategy that allocates
    orders to its robots, 0 for the common one.
    """
    rules, types = scenario.world, types_of(scenario)
    numbers = [LAYER_RIGHT_OF_WAY + k if k else LAYER_ALLOCATION for k in allocations]
    numbers = numbers or [LAYER_ALLOCATION] * len(types)
    rows = [(one, loaded) for loaded in (False, True)[: 1 + loaded_differ] for one in types]
    return Rules(
        seed=np.uint64(seed),
        following=following_of(scenario, in_convoy),
        nearest_access=int(rules.access_cell == "nearest"),
        stop=STOP_CODES[scenario.stop.when],
        leave=int(scenario.fleet.when_idle == "leave"),
        radius=radius_of(scenario.information),
        circle=int(getattr(scenario.information, "shape", "square") == "circle"),
        in_system=scenario.orders.in_system(scenario.fleet.robots),
        assigned=int(scenario.orders.assign == "round-robin"),
        skip_reached=int(scenario.orders.skip_reached),
        priorities=np.array(priorities_of(scenario.orders), np.int16),
        join=int(scenario.pods.join),
        under=int(scenario.pods.under == "empty"),
        loaded_types=len(types) if loaded_differ else 0,
        own_zones=int(getattr(scenario.information, "orders", "all") == "zones"),
        refinement=scenario.refine,
        stride=scenario.refine if scenario.decide == "coarse" else 1,
        tick_us=tick_length(scenario.units.tick),
        cell_milli=0
        if scenario.units.cell is None
        else round(1000 * unit(scenario.units.cell).size),
        duration=np.stack([duration_table(one, loaded) for one, loaded in rows]),
        payload=np.array([one.payload for one, _ in rows], np.int32),
        wait=np.ones(5, np.int32),
        period=np.zeros(STRATEGY_COUNT, np.int32),
        holders=np.zeros(STRATEGY_COUNT, np.uint8),
        allocations=1 + max(allocations, default=0),
        allocation=np.array(numbers * (1 + loaded_differ), np.uint8),
        steered=np.zeros(1, np.uint8),
        watches_chargers=np.zeros(1, np.uint8),
        table_bytes=bytes_of(rules.distance_tables),
        slowdown=int(rules.slowdown == "zones"),
        extra_tick=round(rules.extra_tick_probability * 2**32),
        handling_jitter=scenario.durations.handling_jitter,
        battery=int(scenario.battery is not None),
        drain=np.stack([drain_table(one.battery) for one, _ in rows]),
        curve=charging_curves([one.battery for one, _ in rows]),
        reserve=np.array([reserve_units(one.battery) for one, _ in rows], np.int64),
        tow_after=ticks_or_never(scenario.faults.tow_after),
        repair=ticks_or_never(scenario.faults.repair_time),
        repaired=NIL if scenario.faults.charge == "kept" else charge_units(scenario.faults.charge),
        may_fail=int(may_fail(scenario)),
        faults=fault_table(scenario.faults),
        breakdown=round(scenario.faults.probability * 2**32),
        repair_in_place=repair_ticks(scenario.faults),
    )


def following_of(scenario: Scenario, in_convoy: bool) -> int:
    """The rule of following; handover replaces convoy where both are equal, because it is faster."""
    following = scenario.world.following
    if following == "convoy" and not (in_convoy or follows_in_convoy(scenario)):
        return FOLLOWING_HANDOVER
    return FOLLOWING_NAMES.index(following)


def radius_of(information: Any) -> int:
    if isinstance(information, str):
        return NIL if information == "everything" else ORDER_LIST
    return int(information.radius)


def tick_length(text: str) -> int:
    """A tick in millionths of a second, 0 if its name is not a unit of time."""
    seconds = unit(text).seconds
    return 0 if seconds is None else max(1, round(1_000_000 * seconds))


def duration_table(robot_type: RobotType, loaded: bool = False) -> Array:
    """(A,) int32: ticks of each action of a robot; actions without a duration take 1."""
    durations, table = robot_type.durations, np.ones(ACTION_COUNT, np.int32)
    table[ACTION_MOVE] = robot_type.moves[loaded]
    table[ACTION_TURN] = durations.turns[loaded]
    table[ACTION_PICK], table[ACTION_DROP] = durations.pick, durations.drop
    table[ACTION_TRY_DROP] = durations.try_drop
    return table


def charge_units(percent: float) -> int:
    """Units of charge in some percent of a battery."""
    return round(percent * BATTERY_PERCENT)


def drain_table(battery: Battery | None) -> Array:
    """(A, 2) int64: units of charge that a tick of each action takes, without a load and with one."""
    table = np.zeros((ACTION_COUNT, 2), np.int64)
    if battery is None:
        return table
    drain = battery.drain
    for action, name in enumerate(ACTION_NAMES):
        percent = getattr(drain, name, drain.wait)
        table[action] = charge_units(percent), charge_units(percent * drain.loaded_factor)
    for name in ("charge", "bay_blocked", "down"):
        table[ACTION_NAMES.index(name)] = 0
    return table


def charging_curve(battery: Battery | None) -> Array:
    """(pieces, 2) int32: a charge, and the units that a tick at a charger gives from it on."""
    if battery is None:
        return np.zeros((1, 2), np.int32)
    steps = (
        battery.charge_rate
        if isinstance(battery.charge_rate, tuple)
        else ((0.0, battery.charge_rate),)
    )
    return np.array([(charge_units(since), charge_units(rate)) for since, rate in steps], np.int32)


def charging_curves(batteries: list[Battery | None]) -> Array:
    """(K, pieces, 2) int32: the curves of all types; shorter ones are padded above a full battery."""
    curves = [charging_curve(battery) for battery in batteries]
    most = max(len(curve) for curve in curves)
    beyond = [np.array([[BATTERY_FULL + 1, curve[-1, 1]]], np.int32) for curve in curves]
    return np.stack(
        [
            np.concatenate([curve, np.repeat(last, most - len(curve), axis=0)])
            for curve, last in zip(curves, beyond, strict=True)
        ]
    )


def reserve_units(battery: Battery | None) -> int:
    return 0 if battery is None else charge_units(battery.reserve)


def fault_table(faults: Faults) -> Array:
    """(f, 2) int64: tick and identity of the faults that a scenario lists, by tick."""
    rows = sorted((fault.at, fault.robot) for fault in faults.listed)
    return np.array(rows, np.int64).reshape(-1, 2)


def ticks_or_never(ticks: int | None) -> int:
    return NIL if ticks is None else ticks


def may_fail(scenario: Scenario) -> bool:
    """Whether robots of this scenario can break down or run out of charge."""
    faults = scenario.faults
    return scenario.battery is not None or bool(faults.listed) or faults.probability > 0
