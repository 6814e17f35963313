"""Numbers in the reader's units: a scenario says what a tick stands for, reports translate.

SECONDS_PER_UNIT is the one table of units of time, BYTES_PER_UNIT that of memory.
"""

from __future__ import annotations

import re
from typing import Final, NamedTuple

SECONDS_PER_UNIT: Final = {"ms": 0.001, "s": 1.0, "min": 60.0, "h": 3600.0}  # in a unit of time
SPELLED: Final = {  # other names of the same
    "ms": ("millisecond", "milliseconds"),
    "s": ("sec", "second", "seconds"),
    "min": ("minute", "minutes"),
    "h": ("hour", "hours"),
}
BYTES_PER_UNIT: Final = {"KiB": 2**10, "MiB": 2**20, "GiB": 2**30, "TiB": 2**40}
NUMBER_AND_NAME = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(\S.*)")


class Unit(NamedTuple):
    """What one tick stands for: `size` times `name`."""

    size: float
    name: str

    def of(self, ticks: float) -> float:
        """Ticks in this unit."""
        return ticks * self.size

    @property
    def seconds(self) -> float | None:
        """How many it is in seconds; None: it is not an unit of time."""
        symbol = symbol_of(self.name)
        return None if symbol is None else self.size * SECONDS_PER_UNIT[symbol]

    @property
    def plural(self) -> str:
        """The name for several: words get an s, symbols such as "min" stay."""
        return self.name if len(self.name) < 4 or self.name.endswith("s") else f"{self.name}s"


def unit(text: str) -> Unit:
    """The unit that a scenario writes as "1 cycle" or "0.5 s"; without a number it counts as 1."""
    found = NUMBER_AND_NAME.fullmatch(text)
    if found is None or float(found[1]) == 0:
        return Unit(1.0, text.strip() or "tick")
    return Unit(float(found[1]), found[2].strip())


def symbol_of(name: str) -> str | None:
    """The symbol of a unit of time, in whichever way it is written; None: it is none."""
    return next((key for key, names in SPELLED.items() if name in (key, *names)), None)


def bytes_of(text: str) -> int:
    """Bytes that a scenario writes as "512 MiB"."""
    number, name = text.split()
    return int(float(number) * BYTES_PER_UNIT[name])


def memory(size: int) -> str:
    """Bytes as a scenario writes them, rounded up to a tenth: "1.5 MiB"."""
    name = next((name for name, unit in reversed(BYTES_PER_UNIT.items()) if size >= unit), "KiB")
    return f"{-(-10 * size // BYTES_PER_UNIT[name]) / 10:g} {name}"


LONG_MINUTES = 2 * SECONDS_PER_UNIT["min"]  # seconds from which a duration is told in minutes
LONG_HOURS = 2 * SECONDS_PER_UNIT["h"]  # and in hours


def duration(ticks: float, tick: Unit) -> tuple[float, str]:
    """Ticks in the unit in which they are told: long ones in minutes or hours, if in seconds."""
    value = tick.of(ticks)
    if symbol_of(tick.name) != "s" or value < LONG_MINUTES:
        return value, tick.plural
    symbol = "h" if value >= LONG_HOURS else "min"
    return value / SECONDS_PER_UNIT[symbol], symbol


def number(value: float) -> str:
    """A number for a table: whole ones with thousands separators, others to four digits."""
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
    """Numbers as text: "1, 2 and 5"; beyond `most` only the first ones."""
    texts = [str(item) for item in items[:most]]
    if len(items) > most:
        return f"{', '.join(texts)} ... ({len(items):,} in all)"
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"
