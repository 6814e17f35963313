"""A scenario in ticks that are K times finer: every number of ticks times K, every rate divided by K.

A scenario is read and rounded in its own ticks, the coarse ones, and then refined. Coarse tick t begins
with fine tick K (t - 1) + 1 and ends with fine tick K t. Events of tick t happen in its first fine tick.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from fractions import Fraction
from typing import Any, Final

import msgspec
import numpy as np

from automaton.scenario.order_lines import LineTable
from automaton.scenario.orders import Line, OrderLine
from automaton.scenario.quantities import (
    CHARGE_RATE,
    DUE,
    GAP,
    LAST_TICK,
    MOMENT,
    PROBABILITY,
    STEP,
    TIME,
    TURN,
    DueAt,
    Quantity,
)
from automaton.scenario.schema import MAX_MOVE_TICKS, Scenario, Units
from automaton.scenario.table_fields import NO_DUE
from automaton.scenario.validation import Plan, plan_of
from automaton.units import NUMBER_AND_NAME

CHARGE_UNITS: Final = 10_000_000  # units of charge in a percent
COARSE: Final = "coarse-ticks"  # name of a tick without a unit


def refined(scenario: Scenario) -> Scenario:
    """The scenario in ticks that are `scenario.refine` times finer."""
    if scenario.refine == 1:
        return scenario
    fine = refined_value(scenario, scenario.refine)
    units = msgspec.structs.replace(
        scenario.units, tick=refined_tick(scenario.units, scenario.refine)
    )
    result: Scenario = _with(fine, {"units": units})
    return result


def refined_data(data: dict[str, Any]) -> Scenario:
    """The same for a scenario as plain data, as in a recording."""
    return refined(msgspec.convert(data, Scenario))


def begin_of(tick: Any, factor: int) -> Any:
    """The fine tick in which a coarse tick begins, of one or of several; 0 stays 0."""
    return np.where(np.asarray(tick) > 0, factor * (tick - 1) + 1, factor * tick)


def refined_tick(units: Units, factor: int) -> str:
    """The size of a fine tick, such as "0.25 s" for half a tick of 0.5 s."""
    match = NUMBER_AND_NAME.fullmatch(units.tick)
    assert match is not None, "checked: a number and a name"
    size = np.format_float_positional(float(Fraction(match[1]) / factor), trim="-")
    return f"{size} {COARSE if units.tick == Units().tick else match[2]}"


def refined_value(value: Any, factor: int) -> Any:
    """A struct with all numbers of ticks and all rates in ticks that are `factor` times finer."""
    kind: Any = type(value)
    return _refined(value, plan_of(kind), factor)


def _refined(value: Any, plan: Plan, factor: int) -> Any:
    if isinstance(value, LineTable):
        return _refined_table(value, factor)
    if isinstance(value, msgspec.Struct):
        names = zip(value.__struct_fields__, value.__struct_encode_fields__, strict=True)
        changes = {
            name: _refined(getattr(value, name), plan.fields[key], factor)
            for name, key in names
            if key in plan.fields
        }
        if isinstance(value, OrderLine | Line) and value.due_tick is not None:
            changes["due"] = DueAt(at=factor * value.due_tick)
        return _with(value, changes)
    if isinstance(value, dict):
        return {
            key: _refined(one, plan.fields.get(key) or plan.values or Plan(), factor)
            for key, one in value.items()
        }
    if isinstance(value, tuple) and plan.items:
        last = len(plan.items) - 1
        return tuple(_refined(one, plan.items[min(k, last)], factor) for k, one in enumerate(value))
    if isinstance(value, int | float) and plan.place is not None:
        return _scaled(value, plan.place.quantity, factor)
    return value


def _with(struct: Any, changes: dict[str, Any]) -> Any:
    """A copy with other values, unchecked: the coarse values were checked."""
    result = copy.copy(struct)
    for name, value in changes.items():
        msgspec.structs.force_setattr(result, name, value)
    return result


def _scaled(value: Any, quantity: Quantity, factor: int) -> Any:
    if quantity is PROBABILITY:
        return value / factor
    if (
        quantity is CHARGE_RATE
    ):  # rounded up, so that a battery is full no later than in coarse ticks
        return -(-round(value * CHARGE_UNITS) // factor) / CHARGE_UNITS
    if quantity is MOMENT:
        return int(begin_of(value, factor))
    return factor * value if quantity in (TIME, STEP, TURN, GAP, DUE) else value


def _refined_table(table: LineTable, factor: int) -> LineTable:
    released, due = (table.values[name].astype(np.int64) for name in ("released", "due"))
    ticks = {
        "released": np.minimum(begin_of(released, factor), LAST_TICK),
        "due": np.where(due == NO_DUE, NO_DUE, np.minimum(factor * due, NO_DUE - 1)),
    }
    columns = {name: column.astype(np.int32) for name, column in ticks.items()}
    return table.with_values({**table.values, **columns})


def too_long(scenario: Scenario) -> str:
    """An error about a refinement that is too fine, with the finest that is possible; "" if it fits."""
    factor, worst = scenario.refine, [(LAST_TICK, scenario.stop.max_duration, "stop.max_duration")]
    worst += [(MAX_MOVE_TICKS, ticks, what) for ticks, what in _durations(scenario)]
    limit, ticks, what = min(worst, key=lambda row: row[0] // max(row[1], 1))
    if factor * ticks <= limit:
        return ""
    most = limit // ticks
    fits = f"refine {most} still fits" if most > 1 else "it cannot be refined"
    return (
        f"with refine {factor} {what} takes {factor * ticks:,} ticks instead of {ticks:,}, and at most "
        f"{limit:,} are allowed; {fits}"
    )


def _durations(scenario: Scenario) -> Iterator[tuple[int, str]]:
    """The ticks of operations of robots, and their descriptions."""
    of_fleet = ("durations", 1, scenario.durations)
    of_types = (
        (
            f"type {kind.name}: durations",
            kind.move_time_factor,
            kind.durations.within(scenario.durations),
        )
        for kind in scenario.fleet.types
    )
    for key, times, one in (of_fleet, *of_types):
        yield times * max(one.moves), f"{key}.move"
        yield max(one.turns), f"{key}.turn"
        yield one.pick + one.handling_jitter, f"{key}.pick"
        yield one.drop + one.handling_jitter, f"{key}.drop"
        yield one.try_drop, f"{key}.try_drop"
    for limit in scenario.floor.speed_limits:
        yield limit.max_speed, "a move at a limit of floor.speed_limits"
    for lift in scenario.floor.lifts:
        yield lift.travel_time, "floor.lifts travel_time"
    if scenario.faults.delays is not None:
        yield scenario.faults.delays.ticks.most, "faults.delays.ticks"
    for line in scenario.orders.listed or ():
        yield max(line.stop_ticks, default=0), "a stop of orders.list"
