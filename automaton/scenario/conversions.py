"""Texts with units as the numbers that structs of a scenario hold, and names as their cells.

"20 s" is 40 ticks, and `packing` is [4, 2]. Each conversion is kept with what was wanted exactly, so
that `check` can say what it costs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.scenario.amounts import Dimension, read_amount
from automaton.scenario.cell_names import Cell, cell_named
from automaton.scenario.clock_times import has_date, is_clock_time, is_of_three_parts, seconds_after
from automaton.scenario.document import Document, Keys
from automaton.scenario.quantities import KEY, PLACE_KEY, Quantity, Scale
from automaton.scenario.validation import dotted
from automaton.units import Unit, number, ticks_and_time

_MAY_BE_A_NUMBER: Final = re.compile(r"\s*[-+]?[0-9.]")
_OVER_TIME: Final = (
    Dimension.SPEED,
    Dimension.CELL_SPEED,
    Dimension.ANGLE_SPEED,
    Dimension.RATE,
)


@dataclass(frozen=True)
class Bounds:
    """Which numbers a field allows."""

    is_whole: bool
    ge: float | None = None
    gt: float | None = None
    le: float | None = None

    def hold(self, value: float) -> bool:
        """Whether a number lies within them."""
        return (
            (self.ge is None or value >= self.ge)
            and (self.gt is None or value > self.gt)
            and (self.le is None or value <= self.le)
        )


@dataclass(frozen=True)
class Place:
    """A quantity that a struct holds somewhere."""

    quantity: Quantity
    bounds: Bounds


class Conversion(NamedTuple):
    """A text that was read as a number."""

    key: str  # "durations.move"
    text: str  # as written
    dimension: Dimension | None  # of the text; None: a clock time
    exact: Fraction
    value: float  # what the field holds: whole where it must be
    counted: str  # what the value counts, for one: "tick"
    bounds: Bounds
    is_moment: bool  # a point in time, which is early or late, and neither long nor short
    after_release: bool = False  # unless it is a clock time

    @property
    def is_over_time(self) -> bool:
        """Whether the text says how much in a time: more ticks are slower."""
        return self.dimension in _OVER_TIME

    @property
    def held(self) -> float | dict[str, float]:
        """What stands for the text in the document; clock times differ from times after release."""
        return {"at": self.value} if self.after_release and self.is_moment else self.value


@dataclass
class Plan:
    """Where values of a type hold quantities, and cells that have names."""

    place: Place | None = None
    is_cell: bool = False  # a cell that may be written by its name
    literals: set[str] = field(default_factory=set)  # texts that stand for themselves
    fields: dict[str, Plan] = field(default_factory=dict)
    items: tuple[Plan, ...] = ()  # of a list; the last one of all further ones
    values: Plan | None = None  # of a mapping with any keys

    @property
    def is_empty(self) -> bool:
        """Whether they hold neither a quantity nor a cell."""
        return not (self.place or self.is_cell or self.fields or self.items or self.values)

    def takes(self, text: str) -> bool:
        """Whether a text is read as a quantity here; the schema refuses what is not a number."""
        if self.place is None or text in self.literals:
            return False
        return _MAY_BE_A_NUMBER.match(text) is not None


@lru_cache(maxsize=256)
def plan_of(wanted: Any) -> Plan:
    """Where a struct holds quantities, and cells that have names."""
    from msgspec.inspect import type_info

    plan = Plan()
    _add(plan, type_info(wanted), None)
    return plan


def _add(plan: Plan, described: Any, quantity: Quantity | None) -> None:
    from msgspec import inspect

    if isinstance(described, inspect.Metadata):
        extra = described.extra or {}
        plan.is_cell |= extra.get(PLACE_KEY, False)
        _add(plan, described.type, extra.get(KEY, quantity))
    elif isinstance(described, inspect.UnionType):
        for option in described.types:
            _add(plan, option, quantity)
    elif isinstance(described, inspect.IntType | inspect.FloatType) and quantity is not None:
        is_whole = isinstance(described, inspect.IntType)
        bounds = Bounds(is_whole, described.ge, described.gt, described.le)
        plan.place = Place(quantity, bounds)
    elif isinstance(described, inspect.LiteralType):
        plan.literals |= {value for value in described.values if isinstance(value, str)}
    elif isinstance(described, inspect.StructType):
        for part in described.fields:
            _add_to(plan.fields, part.encode_name, part.type)
    elif isinstance(described, inspect.VarTupleType | inspect.ListType):
        plan.items = _items([described.item_type])
    elif isinstance(described, inspect.TupleType):
        plan.items = _items(described.item_types)
    elif isinstance(described, inspect.DictType):
        values = Plan()
        _add(values, described.value_type, None)
        plan.values = None if values.is_empty else values


def _add_to(fields: dict[str, Plan], name: str, described: Any) -> None:
    plan = fields.get(name, Plan())
    _add(plan, described, None)
    if not plan.is_empty:
        fields[name] = plan


def _items(described: Any) -> tuple[Plan, ...]:
    plans = []
    for one in described:
        plan = Plan()
        _add(plan, one, None)
        plans.append(plan)
    return () if all(plan.is_empty for plan in plans) else tuple(plans)


def with_numbers(
    document: Document,
    value: Any,
    wanted: Any,
    scale: Scale,
    at: Keys = (),
    names: Mapping[str, Cell] = MappingProxyType({}),
) -> tuple[Any, tuple[Conversion, ...]]:
    """A value, found at the keys `at`, with numbers and cells for its texts.

    `names`: of cells. Raises InputError with the line.
    """
    try:
        msgspec.convert(value, wanted)
    except msgspec.ValidationError:
        reader = _Reader(document, scale, names, [])
        return reader.read(value, plan_of(wanted), at), tuple(reader.conversions)
    # Without texts nothing is inspected: `automaton check tabletop-1` takes 30 ms less.
    return value, ()


@dataclass
class _Reader:
    document: Document
    scale: Scale
    names: Mapping[str, Cell]
    conversions: list[Conversion]

    def read(self, value: Any, plan: Plan, keys: Keys) -> Any:
        """The value with numbers and cells for the texts that stand where quantities and cells may."""
        if isinstance(value, str) and plan.is_cell:
            return self.cell(value, keys)
        if isinstance(value, str):
            return self.number(value, plan.place, keys) if plan.takes(value) else value
        if isinstance(value, dict) and (plan.fields or plan.values):
            inner = ((name, plan.fields.get(name, plan.values)) for name in value)
            return {
                name: value[name] if one is None else self.read(value[name], one, (*keys, name))
                for name, one in inner
            }
        if isinstance(value, list | tuple) and plan.items:
            last = len(plan.items) - 1
            return [
                self.read(one, plan.items[min(index, last)], (*keys, index))
                for index, one in enumerate(value)
            ]
        return value

    def cell(self, name: str, keys: Keys) -> list[int]:
        try:
            return list(cell_named(name, self.names))
        except InputError as error:
            raise self.document.error(keys, f"{dotted(keys)}: {error.message}") from None

    def number(self, text: str, place: Place | None, keys: Keys) -> float | dict[str, float]:
        assert place is not None, "only such a plan takes a text"
        try:
            conversion = convert(dotted(keys), text, place, self.scale)
        except InputError as error:
            raise self.document.error(keys, error.message) from None
        self.conversions.append(conversion)
        return conversion.held


def convert(key: str, text: str, place: Place, scale: Scale) -> Conversion:
    """A text as a number. Raises InputError with the key."""
    try:
        dimension, exact = _exact(text, place.quantity, scale)
        value = rounded(exact) if place.bounds.is_whole else float(exact)
        quantity, bounds = place.quantity, place.bounds
        is_moment = quantity.by_clock and (dimension is None or not quantity.after_release)
        if quantity.after_release and is_moment:
            bounds = replace(bounds, ge=None if bounds.le is None else -bounds.le)
        of_place = (quantity.counted, bounds, is_moment, quantity.after_release)
        conversion = Conversion(key, text.strip(), dimension, exact, value, *of_place)
        _check_bounds(conversion, scale)
    except InputError as error:
        raise InputError(f"{key}: {error.message}") from None
    return conversion


def rounded(exact: Fraction) -> int:
    """The nearest whole number; halves go up."""
    return math.floor(exact + Fraction(1, 2))


def _exact(text: str, quantity: Quantity, scale: Scale) -> tuple[Dimension | None, Fraction]:
    if quantity.by_clock and scale.clock is not None and is_of_three_parts(text):
        begin = "release" if quantity.after_release else "start"
        raise InputError(
            f"'{text}' may be a time of the day or a time after the {begin}; write the former as "
            "'06:30' or with its date, the latter with a unit, such as 6.5 h"
        )
    if quantity.by_clock and is_clock_time(text):
        seconds = seconds_after(scale.clock, text, may_precede=quantity.after_release)
        return None, seconds / scale.tick_seconds
    if has_date(text):
        raise InputError(f"'{text}' is a clock time, expected {quantity.described}")
    amount = read_amount(text, quantity.rules)
    return amount.dimension, quantity.number(amount, scale)


def _check_bounds(conversion: Conversion, scale: Scale) -> None:
    text, counted, bounds = conversion.text, conversion.counted, conversion.bounds
    if bounds.is_whole and conversion.exact > 0 and conversion.value == 0:
        if conversion.is_moment and bounds.hold(0):
            return
        size = scale.tick if counted == "tick" else scale.cell
        raise InputError(
            f"'{text}' is less than half a {counted} of {size}, so it would be 0 {counted}s"
        )
    if bounds.hold(conversion.value):
        return
    limits = [("from", bounds.ge), ("above", bounds.gt), ("to", bounds.le)]
    allowed = " ".join(
        f"{word} {_in_words(limit, counted, scale.unit)}"
        for word, limit in limits
        if limit is not None
    )
    number_read = _in_words(float(conversion.exact), counted, scale.unit)
    raise InputError(f"'{text}' is {number_read}; allowed is {allowed}")


def _in_words(value: float, counted: str, tick: Unit) -> str:
    if counted == "tick":
        return ticks_and_time(value, tick)
    return (
        f"{number(value)} {counted + 's' if counted == 'cell' and value != 1 else counted}".strip()
    )
