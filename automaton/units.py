"""The table of units, and numbers in the reader's units: a scenario defines the unit of a tick.

TIME_UNITS, LENGTH_UNITS and BYTES_PER_UNIT are all units; the first two are exact.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Final, NamedTuple

TIME_UNITS: Final = {  # seconds in a unit of time
    "ms": Fraction(1, 1000),
    "s": Fraction(1),
    "min": Fraction(60),
    "h": Fraction(3600),
    "d": Fraction(86_400),
}
LENGTH_UNITS: Final = {  # metres in a unit of length
    "m": Fraction(1),
    "cm": Fraction(1, 100),
    "mm": Fraction(1, 1000),
    "km": Fraction(1000),
    "ft": Fraction(3048, 10_000),
    "in": Fraction(254, 10_000),
}
SPELLED: Final = {  # other names of these units
    "ms": ("millisecond", "milliseconds"),
    "s": ("sec", "second", "seconds"),
    "min": ("minute", "minutes"),
    "h": ("hour", "hours"),
    "d": ("day", "days"),
    "m": ("metre", "metres", "meter", "meters"),
    "ft": ("foot", "feet"),
    "in": ("inch", "inches"),
}
SECONDS_PER_UNIT: Final = {name: float(seconds) for name, seconds in TIME_UNITS.items()}
BYTES_PER_UNIT: Final = {"KiB": 2**10, "MiB": 2**20, "GiB": 2**30, "TiB": 2**40}
NUMBER_AND_NAME = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(\S.*)")


class Unit(NamedTuple):
    """The unit of a tick: `size` times `name`."""

    size: float
    name: str

    def of(self, ticks: float) -> float:
        """Ticks in this unit."""
        return ticks * self.size

    @property
    def seconds(self) -> float | None:
        """The unit in seconds; None: not a unit of time."""
        symbol = symbol_of(self.name)
        return None if symbol is None else self.size * SECONDS_PER_UNIT[symbol]

    @property
    def plural(self) -> str:
        """The plural of the name: words get an s, symbols such as "min" do not."""
        return self.name if len(self.name) < 4 or self.name.endswith("s") else f"{self.name}s"


def unit(text: str) -> Unit:
    """The unit that a scenario writes as "1 cycle" or "0.5 s"; without a number it counts as 1."""
    found = NUMBER_AND_NAME.fullmatch(text)
    if found is None or float(found[1]) == 0:
        return Unit(1.0, text.strip() or "tick")
    return Unit(float(found[1]), found[2].strip())


def shown_unit(text: str) -> str:
    """A unit as it is written, with six digits for a fraction of another unit."""
    size, name = unit(text)
    return text if len(text) <= 12 else f"{size:.6g} {name}"


def symbol_of(name: str) -> str | None:
    """The symbol of a unit of time from any of its names; None: unknown."""
    return _symbol(name, TIME_UNITS)


def exact_time(text: str) -> Fraction | None:
    """Seconds in a time such as "0.635055 s", exactly; None: its name is not a unit of time."""
    return _exact(text, TIME_UNITS)


def exact_length(text: str) -> Fraction | None:
    """Metres in a length such as "2.5 ft", exactly; None: its name is not a unit of length."""
    return _exact(text, LENGTH_UNITS)


def length_unit(text: str) -> Fraction | None:
    """Metres per unit of a length such as "2.5 ft"; None: its name is not a unit of length."""
    symbol = _symbol(unit(text).name, LENGTH_UNITS)
    return None if symbol is None else LENGTH_UNITS[symbol]


def _exact(text: str, table: dict[str, Fraction]) -> Fraction | None:
    match = NUMBER_AND_NAME.fullmatch(text)
    symbol = None if match is None else _symbol(match[2].strip(), table)
    return None if match is None or symbol is None else Fraction(match[1]) * table[symbol]


def _symbol(name: str, table: dict[str, Fraction]) -> str | None:
    return next((key for key in table if name in (key, *SPELLED.get(key, ()))), None)


def bytes_of(text: str) -> int:
    """Bytes of a text such as "512 MiB" or "4GiB"."""
    return int(float(text[:-3]) * BYTES_PER_UNIT[text[-3:]])


def memory(size: int) -> str:
    """Bytes as text, rounded up to a tenth: "1.5 MiB"."""
    name = next((name for name, unit in reversed(BYTES_PER_UNIT.items()) if size >= unit), "KiB")
    return f"{-(-10 * size // BYTES_PER_UNIT[name]) / 10:g} {name}"


LONG_MINUTES = 2 * SECONDS_PER_UNIT["min"]  # seconds from which a duration is given in minutes
LONG_HOURS = 2 * SECONDS_PER_UNIT["h"]  # and in hours


def duration(ticks: float, tick: Unit) -> tuple[float, str]:
    """Ticks in the unit of reports: long times in minutes or hours if the unit is a unit of time."""
    value = tick.of(ticks)
    if symbol_of(tick.name) != "s" or value < LONG_MINUTES:
        return value, tick.plural
    symbol = "h" if value >= LONG_HOURS else "min"
    return value / SECONDS_PER_UNIT[symbol], symbol


def ticks_and_time(ticks: float, tick: Unit) -> str:
    """Ticks as text, with the time if a tick is a time: "28,800 ticks (8 h)"."""
    text = count(int(ticks), "tick") if float(ticks).is_integer() else f"{number(ticks)} ticks"
    if tick.seconds is None:
        return text
    value, name = duration(ticks, tick)
    return f"{text} ({number(value)} {name})"


def number(value: float) -> str:
    """A number for a table: whole numbers with thousands separators, others with four digits."""
    if abs(value) >= 1000 or float(value).is_integer():
        return f"{value:,.0f}"
    return f"{value:.4g}"


def percent(share: float, digits: int = 1) -> str:
    """A share as percent."""
    return f"{100 * share:.{digits}f} %"


def count(many: int, one: str, several: str | None = None) -> str:
    """A number of things: "1 robot", "2,000 robots"."""
    return f"{many:,} {one if many == 1 else several or one + 's'}"


def listed(items: list[int], most: int = 6) -> str:
    """Numbers as text: "1, 2 and 5"; only the first ones if there are more than `most`."""
    texts = [str(item) for item in items[:most]]
    if len(items) > most:
        return f"{', '.join(texts)} ... ({len(items):,} in all)"
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"
