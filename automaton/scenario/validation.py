"""Convert data to the structs of the schema; errors say what was expected and found.

Texts with units become numbers, and names of cells become cells: "20 s" is 40 ticks, and `packing` is
[4, 2]. Each conversion is recorded with its exact value, so `check` can report the rounding error.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeVar

import msgspec

from automaton.errors import InputError, InvalidValueError, Keys, alternatives, nearest
from automaton.scenario.changing_floor import Cell, cell_named
from automaton.scenario.quantities import (
    PLACE_KEY,
    QUANTITY_KEY,
    TIME,
    Dimension,
    Quantity,
    Scale,
    has_date,
    is_clock_time,
    is_of_three_parts,
    read_amount,
    rounded,
    seconds_after,
)
from automaton.scenario.schema import INSTEAD, MEMORY_PATTERN, TICK_PATTERN
from automaton.units import Unit, number, ticks_and_time

T = TypeVar("T")

TIME_PATTERN: Final = r"^\s*[-+]?[0-9.]"  # read as a quantity later, when the tick is known
MSER_OR_TIME: Final = rf"^mser-5$|{TIME_PATTERN}"

AT: Final = re.compile(r"^(?P<what>.*?)(?: - at `\$(?P<path>[^`]*)`)?$", re.DOTALL)
PART: Final = re.compile(r"\.(\w+)|\[(\d+)\]|\[\.\.\.\]")
FIELD: Final = re.compile(r"field `(.*)`")

_MAY_BE_A_NUMBER: Final = re.compile(r"\s*[-+]?[0-9.]")
_OVER_TIME: Final = (
    Dimension.SPEED,
    Dimension.CELL_SPEED,
    Dimension.ANGLE_SPEED,
    Dimension.RATE,
)


def validated(value: Any, wanted: type[T], at: Keys = ()) -> T:
    """`value`, found at the keys `at`, as a struct. Raises InvalidValueError."""
    try:
        return msgspec.convert(value, wanted)
    except msgspec.ValidationError as error:
        match = AT.match(str(error))
        assert match is not None, "every text matches"
        inner = _keys(value, wanted, match["path"] or "")
        raise _explained(value, wanted, at, inner, match["what"]) from None


def _keys(value: Any, wanted: Any, path: str) -> Keys:
    """The keys of a path of msgspec, which writes [...] for any key of a mapping."""
    keys: Keys = ()
    for name, index in PART.findall(path):
        if name or index:
            keys = (*keys, int(index) if index else name)
        elif isinstance(entries := _value_at(value, keys), dict):
            bad = (key for key in entries if not _fits(_with_one(value, keys, key), wanted))
            keys = (*keys, next(bad, ""))
    return keys


def _with_one(value: Any, keys: Keys, key: str) -> Any:
    """The value with a single entry in the mapping at some keys."""
    if not keys:
        return {key: value[key]}
    if isinstance(value, dict):
        return {**value, keys[0]: _with_one(value[keys[0]], keys[1:], key)}
    return [_with_one(one, keys[1:], key) if k == keys[0] else one for k, one in enumerate(value)]


def _fits(value: Any, wanted: Any) -> bool:
    try:
        msgspec.convert(value, wanted)
    except msgspec.ValidationError:
        return False
    return True


def _explained(value: Any, wanted: Any, at: Keys, inner: Keys, what: str) -> InvalidValueError:
    keys = at + inner
    expected = _type_at(inspected(wanted), inner)
    found = _value_at(value, inner)
    field = FIELD.search(what)
    if field and what.startswith("Object contains unknown"):
        names = _names(expected)
        refusals = [getattr(getattr(one, "cls", None), "refused", {}) for one in _options(expected)]
        if any(field[1] in one for one in refusals):
            said = next(one[field[1]] for one in refusals if field[1] in one)
            return InvalidValueError((*keys, field[1]), f"{dotted((*keys, field[1]))}: {said}")
        return InvalidValueError(
            (*keys, field[1]),
            f"unknown key '{field[1]}'{_inside(keys)}{nearest(field[1], names)}; "
            + (f"allowed: {', '.join(names)}" if names else "no keys are allowed"),
        )
    if field and what.startswith("Object missing"):
        return InvalidValueError(keys, f"the key '{field[1]}' is missing{_inside(keys)}")
    if what.startswith(("Expected", "Invalid", "Integer value")):
        hint = nearest(found, _words(expected)) if isinstance(found, str) else ""
        if isinstance(found, bool):
            hint = _now_written(expected, found)
        sentence = f"{dotted(keys) or 'it'} must be {described(expected)}, found {shown(found)}"
        return InvalidValueError(keys, sentence + hint)
    # An error of a struct begins with the wrong key, if it is one key.
    first = what.split(" ", 1)[0]
    if isinstance(found, dict) and first in found:
        return InvalidValueError((*keys, first), f"{dotted((*keys, first))}{what[len(first) :]}")
    missing = what.startswith("the key '") and what.endswith("is missing")
    return InvalidValueError(keys, what + (_inside(keys) if missing else ""))


def _now_written(expected: Any, value: bool) -> str:
    """The new name of a renamed value, or ""."""
    word = (getattr(expected, "extra", None) or {}).get(INSTEAD, {}).get(value)
    return f"; {shown(value)} is now {word}" if word else ""


def described(expected: Any) -> str:
    """The values that a type of `msgspec.inspect` accepts, in words."""
    from msgspec import inspect

    if isinstance(expected, inspect.Metadata):
        quantity = (expected.extra or {}).get(QUANTITY_KEY)
        return described(expected.type) + ("" if quantity is None else f", or {quantity.described}")
    if isinstance(expected, inspect.UnionType):
        kinds = [kind for kind in expected.types if not isinstance(kind, inspect.NoneType)]
        return ", or ".join(described(kind) for kind in kinds)
    if isinstance(expected, inspect.LiteralType):
        return alternatives(str(value) for value in expected.values)
    if isinstance(expected, inspect.IntType | inspect.FloatType):
        return ("a whole number" if isinstance(expected, inspect.IntType) else "a number") + _range(
            expected
        )
    if isinstance(expected, inspect.BoolType):
        return "true or false"
    if isinstance(expected, inspect.StrType):
        return _text(expected.pattern)
    if isinstance(expected, inspect.TupleType):
        items = [described(item) for item in expected.item_types]
        return "a cell [x, y]" if items == ["a whole number"] * 2 else f"[{', '.join(items)}]"
    if isinstance(expected, inspect.VarTupleType | inspect.ListType):
        least = expected.min_length or 0
        many = f" of at least {least}" if least > 1 else ""
        return f"a list{many} (each {described(expected.item_type)})"
    if isinstance(expected, inspect.StructType):
        names = ", ".join(field.encode_name for field in expected.fields)
        return f"a mapping with the keys {names}" if "," in names else f"{{{names}: ...}}"
    return "a mapping"


def shown(value: Any) -> str:
    """A value in the short form of errors."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a mapping"
    text = repr(value)
    if isinstance(value, list):
        if len(text) > 40:
            return f"a list of {len(value)}"
        text = f"[{', '.join('null' if one is None else shown(one) for one in value)}]"
    return text if len(text) <= 60 else text[:57] + "..."


def _range(expected: Any) -> str:
    if expected.ge is not None and expected.le is not None:
        return f" from {expected.ge} to {expected.le}"
    if expected.gt is not None and expected.le is not None:
        return f" above {expected.gt} and at most {expected.le}"
    if expected.ge is not None:
        return f" of at least {expected.ge}"
    if expected.gt is not None:
        return f" above {expected.gt}"
    return f" of at most {expected.le}" if expected.le is not None else ""


def _options(expected: Any) -> list[Any]:
    """The alternatives of a type, with annotations and unions expanded."""
    from msgspec import inspect

    if isinstance(expected, inspect.Metadata):
        return _options(expected.type)
    if isinstance(expected, inspect.UnionType):
        return [option for kind in expected.types for option in _options(kind)]
    return [expected]


def _type_at(expected: Any, inner: Keys) -> Any:
    from msgspec import inspect

    for key in inner:
        following = None
        for option in _options(expected):
            if isinstance(option, inspect.StructType):
                fields = {field.encode_name: field.type for field in option.fields}
                following = fields.get(str(key), following)
            elif isinstance(option, inspect.VarTupleType | inspect.ListType):
                following = option.item_type if isinstance(key, int) else following
            elif isinstance(option, inspect.DictType):
                following = option.value_type
            elif isinstance(option, inspect.TupleType) and isinstance(key, int):
                following = option.item_types[min(key, len(option.item_types) - 1)]
        expected = following
    return expected


def _value_at(value: Any, inner: Keys) -> Any:
    for key in inner:
        try:
            value = value[key]
        except (KeyError, IndexError, TypeError):
            return None
    return value


def _names(expected: Any) -> list[str]:
    options = _options(expected)
    return [field.encode_name for option in options for field in getattr(option, "fields", ())]


def _words(expected: Any) -> list[str]:
    options = _options(expected)
    return [str(value) for option in options for value in getattr(option, "values", ())]


def dotted(keys: Keys) -> str:
    """The keys that lead to a value as text: "orders.list[3].release"."""
    text = ""
    for key in keys:
        text += f"[{key}]" if isinstance(key, int) else f".{key}"
    return text.removeprefix(".")


def _inside(keys: Keys) -> str:
    return f" in {dotted(keys)}" if keys else ""


def _text(pattern: str | None) -> str:
    """The form of a text."""
    if pattern == TICK_PATTERN:
        return 'a number above 0 and a name, such as "0.5 s"'
    if pattern == MEMORY_PATTERN:
        return 'a number above 0 and KiB, MiB, GiB or TiB, such as "512 MiB"'
    if pattern == TIME_PATTERN:
        return TIME.described
    if pattern == MSER_OR_TIME:
        return f"mser-5, or {TIME.described}"
    return "text in one line" if pattern else "text"


# Texts become numbers, names become cells.


@dataclass(frozen=True)
class NumberRange:
    """The numbers that a field allows."""

    is_whole: bool
    ge: float | None = None
    gt: float | None = None
    le: float | None = None

    def hold(self, value: float) -> bool:
        """Whether a number is allowed."""
        return (
            (self.ge is None or value >= self.ge)
            and (self.gt is None or value > self.gt)
            and (self.le is None or value <= self.le)
        )


@dataclass(frozen=True)
class Place:
    """A quantity in a struct."""

    quantity: Quantity
    bounds: NumberRange


class Conversion(NamedTuple):
    """A text that was read as a number."""

    key: str  # "durations.move"
    text: str  # as written
    dimension: Dimension | None  # unit of the text; None: a clock time
    exact: Fraction
    value: float  # value of the field, rounded if it must be whole
    counted: str  # unit of the value, singular: "tick"
    bounds: NumberRange
    is_moment: bool  # a point in time: early or late, not long or short
    after_release: bool = False  # unless a clock time

    @property
    def is_over_time(self) -> bool:
        """Whether the text is a rate or a speed, for which more ticks are slower."""
        return self.dimension in _OVER_TIME

    @property
    def held(self) -> float | dict[str, float]:
        """The value that replaces the text; a clock time differs from a time after release."""
        return {"at": self.value} if self.after_release and self.is_moment else self.value


@dataclass
class Plan:
    """Where values of a type hold quantities and named cells."""

    place: Place | None = None
    is_cell: bool = False  # a cell that may be written by name
    literals: set[str] = field(default_factory=set)  # plain texts
    fields: dict[str, Plan] = field(default_factory=dict)
    items: tuple[Plan, ...] = ()  # of a list; the last one for all further entries
    values: Plan | None = None  # of a mapping with any keys

    @property
    def is_empty(self) -> bool:
        """Whether the values hold neither quantities nor cells."""
        return not (self.place or self.is_cell or self.fields or self.items or self.values)

    def takes(self, text: str) -> bool:
        """Whether a text is read as a quantity here."""
        if self.place is None or text in self.literals:
            return False
        return _MAY_BE_A_NUMBER.match(text) is not None


@lru_cache(maxsize=256)
def plan_of(wanted: Any) -> Plan:
    """Where a struct holds quantities and named cells."""
    plan = Plan()
    _add(plan, inspected(wanted), None)
    return plan


@lru_cache(maxsize=64)
def inspected(wanted: Any) -> Any:
    """A type as `msgspec.inspect` describes it."""
    from msgspec.inspect import type_info  # only needed for an error, or for texts

    return type_info(wanted)


def _add(plan: Plan, described: Any, quantity: Quantity | None) -> None:
    from msgspec import inspect

    if isinstance(described, inspect.Metadata):
        extra = described.extra or {}
        plan.is_cell |= extra.get(PLACE_KEY, False)
        _add(plan, described.type, extra.get(QUANTITY_KEY, quantity))
    elif isinstance(described, inspect.UnionType):
        for option in described.types:
            _add(plan, option, quantity)
    elif isinstance(described, inspect.IntType | inspect.FloatType) and quantity is not None:
        is_whole = isinstance(described, inspect.IntType)
        bounds = NumberRange(is_whole, described.ge, described.gt, described.le)
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
    value: Any,
    wanted: Any,
    scale: Scale,
    at: Keys = (),
    names: Mapping[str, Cell] = MappingProxyType({}),
) -> tuple[Any, tuple[Conversion, ...]]:
    """A value, found at the keys `at`, with numbers and cells instead of its texts.

    `names`: cells by name. Raises InvalidValueError.
    """
    try:
        msgspec.convert(value, wanted)
    except msgspec.ValidationError:
        reader = _Reader(scale, names, [])
        return reader.read(value, plan_of(wanted), at), tuple(reader.conversions)
    # Without texts nothing is inspected, which saves `automaton check tabletop-1` 30 ms.
    return value, ()


@dataclass
class _Reader:
    scale: Scale
    names: Mapping[str, Cell]
    conversions: list[Conversion]

    def read(self, value: Any, plan: Plan, keys: Keys) -> Any:
        """The value with numbers and cells instead of texts, where a plan allows them."""
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
            raise InvalidValueError(keys, f"{dotted(keys)}: {error.message}") from None

    def number(self, text: str, place: Place | None, keys: Keys) -> float | dict[str, float]:
        assert place is not None, "only such a plan takes a text"
        try:
            conversion = convert(dotted(keys), text, place, self.scale)
        except InputError as error:
            raise InvalidValueError(keys, error.message) from None
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
