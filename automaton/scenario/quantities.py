"""What numbers of a scenario count, and the texts with units that may be written instead of them.

    durations: {move: 1.5 m/s, pick: 20 s}      beside     durations: {move: 2, pick: 40}

A field of a struct says what it counts by `quantity(TIME, ...)` among its annotations, in a plug-in
as well. Texts are read as exact fractions; `conversions` rounds them where a whole number is wanted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final

from msgspec import Meta

from automaton.errors import InputError, alternatives
from automaton.scenario.amounts import Amount, Dimension
from automaton.scenario.clock_times import Moment, seconds_after
from automaton.units import (
    LENGTH_UNITS,
    TIME_UNITS,
    Unit,
    exact_length,
    exact_time,
    length_unit,
    unit,
)

KEY: Final = "quantity"  # of what fields say beside their types
SCHEMA_KEY: Final = "x-quantity"  # the same in a JSON Schema
PLACE_KEY: Final = "place"  # of cells that may be written by their names
PLACE_SCHEMA_KEY: Final = "x-place"
QUARTER_TURN: Final = 90  # degrees


@dataclass(frozen=True)
class Scale:
    """What a tick and a cell are, as exactly as the scenario says it."""

    tick: str  # as written
    cell: str | None = None
    clock: Moment | None = None  # the time of tick 0

    @property
    def unit(self) -> Unit:
        """What a tick stands for in reports."""
        return unit(self.tick)

    @property
    def tick_seconds(self) -> Fraction:
        """Seconds of a tick. Raises InputError where a tick is not a time."""
        seconds = exact_time(self.tick)
        if seconds is None:
            raise InputError(
                f"units.tick is '{self.tick}', which is not a time in {alternatives(TIME_UNITS)}; "
                "set it, such as units: {tick: 0.5 s}"
            )
        return seconds

    def tick_at(self, text: str) -> int:
        """The tick in which a clock time falls, such as "06:30". Raises InputError."""
        return math.floor(seconds_after(self.clock, text) / self.tick_seconds)

    @property
    def cell_metres(self) -> Fraction:
        """Metres along the side of a cell. Raises InputError where the scenario does not say so."""
        if self.cell is None:
            raise InputError(
                "units.cell does not say how large a cell is; set it, such as units: {cell: 0.8 m}"
            )
        metres = exact_length(self.cell)
        if metres is None:
            known = alternatives(LENGTH_UNITS)
            raise InputError(f"units.cell is '{self.cell}', which is not a length in {known}")
        return metres

    @property
    def cell_unit_metres(self) -> Fraction:
        """Metres of the unit in which the side of a cell is given. Raises InputError."""
        metres = length_unit(self.cell or "")
        return self.cell_metres if metres is None else metres  # the former says what is wrong


Rule = Callable[[Fraction, Scale], Fraction]  # an amount as the number that a field counts


@dataclass(frozen=True, eq=False)
class Quantity:
    """What a number counts, and which texts say the same."""

    described: str  # in errors and documents: "a time such as 20 s"
    rules: Mapping[Dimension, Rule]
    counted: str = "tick"  # what a plain number counts, for one
    by_clock: bool = False  # a clock time says it, too; and it may fall on tick 0
    # Else than a clock time, which is {at: tick} and may be before tick 0.
    after_release: bool = False

    def number(self, amount: Amount, scale: Scale) -> Fraction:
        """The exact number that a text stands for. Raises InputError."""
        rule = self.rules.get(amount.dimension)
        if rule is None:
            minutes = amount.dimension == Dimension.LENGTH and Dimension.TIME in self.rules
            hint = "; minutes are min" if minutes else ""
            dimension = amount.dimension.value
            raise InputError(f"'{amount.text}' is {dimension}, expected {self.described}{hint}")
        return rule(amount.value, scale)


def _ticks(seconds: Fraction, scale: Scale) -> Fraction:
    return seconds / scale.tick_seconds


def _seconds(seconds: Fraction, scale: Scale) -> Fraction:
    # A time means nothing in a run whose ticks are not times.
    return _ticks(seconds, scale) * scale.tick_seconds


def _ticks_of_one(rate: Fraction, scale: Scale) -> Fraction:
    if not rate:
        raise InputError("a speed or a rate must be above 0")
    return 1 / rate / scale.tick_seconds


def _ticks_of_a_cell(speed: Fraction, scale: Scale) -> Fraction:
    return _ticks_of_one(speed, scale) * scale.cell_metres


def _ticks_of_a_turn(speed: Fraction, scale: Scale) -> Fraction:
    return _ticks_of_one(speed, scale) * QUARTER_TURN


def _in_a_tick(rate: Fraction, scale: Scale) -> Fraction:
    return rate * scale.tick_seconds


def _cells(metres: Fraction, scale: Scale) -> Fraction:
    return metres / scale.cell_metres


def _lengths(metres: Fraction, scale: Scale) -> Fraction:
    return metres / scale.cell_unit_metres


TIME: Final = Quantity("a time such as 20 s", {Dimension.TIME: _ticks})
MOMENT: Final = Quantity(
    "a time such as 20 s, or a clock time such as '06:30'", {Dimension.TIME: _ticks}, by_clock=True
)
DUE: Final = Quantity(
    "a time after release such as 30 min, or a clock time such as '14:30'",
    {Dimension.TIME: _ticks},
    by_clock=True,
    after_release=True,
)
STEP: Final = Quantity(
    "a time such as 2 s, or a speed such as 1.5 m/s",
    {
        Dimension.TIME: _ticks,
        Dimension.SPEED: _ticks_of_a_cell,
        Dimension.CELL_SPEED: _ticks_of_one,
    },
)
TURN: Final = Quantity(
    "a time such as 2 s, or a speed such as 90 deg/s",
    {Dimension.TIME: _ticks, Dimension.ANGLE_SPEED: _ticks_of_a_turn},
)
GAP: Final = Quantity(
    "a time such as 30 s, or a rate such as 120/h",
    {Dimension.TIME: _ticks, Dimension.RATE: _ticks_of_one},
)
PROBABILITY: Final = Quantity("a rate such as 0.1/h", {Dimension.RATE: _in_a_tick}, "")
CHARGE_RATE: Final = Quantity(
    "percent in a time, such as 9 %/h", {Dimension.PERCENT_RATE: _in_a_tick}, "percent in a tick"
)
CELLS: Final = Quantity(
    "a length such as 5 m",
    {Dimension.LENGTH: _cells, Dimension.CELLS: lambda cells, _: cells},
    "cell",
)
LENGTH: Final = Quantity(
    "a length such as 5 m",
    {
        Dimension.LENGTH: _lengths,
        Dimension.CELLS: lambda cells, scale: _lengths(cells * scale.cell_metres, scale),
    },
    "",
)
SECONDS: Final = Quantity("a time such as 90 s", {Dimension.TIME: _seconds}, "s")
MINUTES: Final = Quantity(
    "a time such as 5 min",
    {Dimension.TIME: lambda value, scale: _seconds(value, scale) / 60},
    "min",
)


def quantity(of: Quantity, **said: Any) -> Meta:
    """The annotation of a field that holds a quantity; `said` are further arguments of Meta."""
    return Meta(extra={KEY: of}, extra_json_schema={SCHEMA_KEY: of.described}, **said)


def place() -> Meta:
    """The annotation of a field that holds a cell [x, y], which may be written by its name."""
    return Meta(extra={PLACE_KEY: True}, extra_json_schema={PLACE_SCHEMA_KEY: True})


def with_texts(schema: Any) -> Any:
    """A JSON Schema in which texts are allowed for quantities, and names for cells."""
    if isinstance(schema, list):
        return [with_texts(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    inner = {key: with_texts(value) for key, value in schema.items()}
    if inner.pop(PLACE_SCHEMA_KEY, False):
        outer = {key: inner.pop(key) for key in ("description", "default") if key in inner}
        name = {"type": "string", "description": "a name of locations"}
        return {**outer, "anyOf": [inner, name]}
    if SCHEMA_KEY not in inner:
        return inner
    described = inner.pop(SCHEMA_KEY)
    if "anyOf" in inner:
        return {**inner, "anyOf": [*inner["anyOf"], _text_schema(described)]}
    outer = {key: inner.pop(key) for key in ("description", "default") if key in inner}
    return {**outer, "anyOf": [inner, _text_schema(described)]}


def _text_schema(described: str) -> dict[str, Any]:
    return {
        "type": "string",
        "description": described,
        "pattern": r"^\s*[0-9.]",
        SCHEMA_KEY: described,
    }
