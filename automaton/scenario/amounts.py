"""Numbers with a unit as text, read exactly: "20 s", "1.5 m/s", "120/h", "9 %/h", "0:10:00"."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from enum import Enum
from fractions import Fraction
from typing import Final, NamedTuple

from automaton.errors import InputError, alternatives, nearest
from automaton.units import LENGTH_UNITS, SPELLED, TIME_UNITS

MAX_CHARACTERS: Final = 60
NUMBER: Final = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,2})?"
_AMOUNT: Final = re.compile(rf"\s*({NUMBER})\s*(.*?)\s*", re.DOTALL)
_PARTS: Final = re.compile(r"\s*([0-9]{1,9}):([0-9]{2}):([0-9]{2}(?:\.[0-9]+)?)\s*")
_TWO_PARTS: Final = re.compile(r"\s*([0-9]{1,9}):([0-9]{2})\s*")
_COMMA: Final = re.compile(r"[0-9]\s*[,_'\u2009\u00a0]\s*[0-9]|[0-9] [0-9]")
_COUNTS: Final = {"cell": "cell", "cells": "cell", "deg": "deg", "°": "deg", "%": "%"}


class Dimension(Enum):
    """What kinds of amounts there are, as errors call them."""

    TIME = "a time"
    LENGTH = "a length"
    CELLS = "a number of cells"
    SPEED = "a speed"
    CELL_SPEED = "a speed in cells"
    ANGLE_SPEED = "a speed of turning"
    RATE = "a rate"
    PERCENT_RATE = "percent in a time"
    ANGLE = "an angle"
    PERCENT = "percent"
    NUMBER = "a number without a unit"


_OVER_TIME: Final = {
    Dimension.LENGTH: Dimension.SPEED,
    Dimension.CELLS: Dimension.CELL_SPEED,
    Dimension.ANGLE: Dimension.ANGLE_SPEED,
    Dimension.PERCENT: Dimension.PERCENT_RATE,
    Dimension.NUMBER: Dimension.RATE,
}
_OF_COUNTS: Final = {"cell": Dimension.CELLS, "deg": Dimension.ANGLE, "%": Dimension.PERCENT}


class Amount(NamedTuple):
    """A number with its unit; seconds, metres, cells, degrees and percent are the units of `value`."""

    text: str
    value: Fraction
    dimension: Dimension


def read_amount(text: str, wanted: Iterable[Dimension]) -> Amount:
    """An amount of any dimension; errors name the units of those that are wanted. Raises InputError."""
    if len(text) > MAX_CHARACTERS:
        raise InputError(f"has {len(text):,} characters; expected a number with a unit")
    if match := _PARTS.fullmatch(text):
        return Amount(text.strip(), _hours_minutes_seconds(text, *match.groups()), Dimension.TIME)
    if match := _TWO_PARTS.fullmatch(text):
        raise InputError(_both_readings(text, *match.groups()))
    match = _AMOUNT.fullmatch(text)
    if match is None or _COMMA.search(text):
        raise InputError(_not_a_number(text))
    value, name = Fraction(match[1]), match[2]
    if not name:
        raise InputError(
            f"'{text}' is text without a unit; write the unit, or a plain number without quotes"
        )
    known = _unit(name)
    if known is None:
        raise InputError(_unknown_unit(text, name, wanted))
    factor, dimension = known
    return Amount(text.strip(), value * factor, dimension)


def _hours_minutes_seconds(text: str, hours: str, minutes: str, seconds: str) -> Fraction:
    if int(minutes) > 59 or Fraction(seconds) >= 60:
        raise InputError(f"'{text}': minutes and seconds of H:MM:SS go up to 59")
    return 3600 * int(hours) + 60 * int(minutes) + Fraction(seconds)


def _both_readings(text: str, first: str, last: str) -> str:
    minutes = f"{int(first) // 60}:{int(first) % 60:02}:{last}"
    return (
        f"'{text}' has two parts, which may be hours and minutes or minutes and seconds; write "
        f"three: '{first}:{last}:00' or '{minutes}'"
    )


def _not_a_number(text: str) -> str:
    if re.match(r"\s*-", text):
        return f"'{text}' must not be below 0"
    if _COMMA.search(text):
        return (
            f"'{text}' is not one number with a unit; write it with a decimal point and nothing between "
            "the digits, such as 1.5 s or 1000 s"
        )
    return f"'{text}' is not a number with a unit, such as 20 s"


def _unit(name: str) -> tuple[Fraction, Dimension] | None:
    """What one of a unit is, and of which dimension; None: there is no such unit."""
    above, slash, below = (part.strip() for part in name.partition("/"))
    if not slash:
        return _simple_unit(above)
    time = _simple_unit(below)
    if time is None or time[1] != Dimension.TIME:
        return None
    one = _simple_unit(above) if above else (Fraction(1), Dimension.NUMBER)
    if one is None or one[1] not in _OVER_TIME:
        return None
    return one[0] / time[0], _OVER_TIME[one[1]]


def _simple_unit(name: str) -> tuple[Fraction, Dimension] | None:
    if name in _COUNTS:
        return Fraction(1), _OF_COUNTS[_COUNTS[name]]
    for table, dimension in ((TIME_UNITS, Dimension.TIME), (LENGTH_UNITS, Dimension.LENGTH)):
        for symbol, size in table.items():
            if name in (symbol, *SPELLED.get(symbol, ())):
                return size, dimension
    return None


def _unknown_unit(text: str, name: str, wanted: Iterable[Dimension]) -> str:
    names = list(unit_names(wanted))
    spelled = [long for one in names for long in SPELLED.get(one, ())]
    hint = nearest(name, [*names, *spelled])
    if re.search(r"[0-9]", name):
        return f"'{text}' is not one number with one unit; the units are {alternatives(names)}"
    return f"'{text}': there is no unit '{name}' here{hint}; the units are {alternatives(names)}"


def unit_names(dimensions: Iterable[Dimension]) -> Iterator[str]:
    """The units of some dimensions, in short: "ms", ..., "m/s", "km/h"."""
    for dimension in dimensions:
        if dimension == Dimension.TIME:
            yield from TIME_UNITS
        elif dimension == Dimension.LENGTH:
            yield from LENGTH_UNITS
        elif dimension == Dimension.CELLS:
            yield "cells"
        elif dimension == Dimension.SPEED:
            yield from (f"{name}/s" for name in LENGTH_UNITS)
            yield "km/h"
        else:
            above = {"CELL_SPEED": "cells", "ANGLE_SPEED": "deg", "PERCENT_RATE": "%"}
            name = above.get(dimension.name, "")
            yield from (f"{name}/{time}" for time in TIME_UNITS)
