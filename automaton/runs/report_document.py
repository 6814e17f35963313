"""What a report consists of, whatever it is written as: headings, text, tables, curves and maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy.typing as npt


@dataclass(frozen=True)
class Heading:
    """A title of a section; level 1 is that of the whole report."""

    text: str
    level: int = 2


class NumberText(str):
    """A number as a table prints it; `value` has all of its digits, in the unit of the table."""

    value: float

    def __new__(cls, text: str, value: float) -> NumberText:
        """Remember the number behind a text."""
        self = super().__new__(cls, text)
        self.value = value
        return self


@dataclass(frozen=True)
class Text:
    """A paragraph, or with `code` lines that are kept as they are; `strong`: what is to be read first."""

    text: str
    code: bool = False
    strong: bool = False


@dataclass(frozen=True)
class Listed:
    """Sentences, one below the other; `strong`: what is to be read first."""

    items: Sequence[str]
    strong: bool = False


@dataclass(frozen=True)
class Table:
    """A table of texts; the first `left` columns are aligned left.

    On a console there are `gap` blanks between columns, and the last one may be text that is folded.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    also_left: Sequence[int] = ()  # further columns
    gap: int = 2
    folded: bool = False

    def is_left(self, column: int) -> bool:
        """Whether a column is aligned left."""
        return column < self.left or column in self.also_left


@dataclass(frozen=True)
class ReportCurve:
    """One curve: for each x the value and the ends of its interval."""

    name: str
    x: Sequence[float]
    value: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]


@dataclass(frozen=True)
class Curves:
    """Curves with intervals over a number, such as that of robots, or over things with names.

    `x_names`: those of x = 0, 1, ..., if they are not numbers; there is nothing between them to draw.
    `from_zero`: of a quantity, whose scale begins at 0.
    """

    title: str
    x_label: str
    y_label: str
    lines: Sequence[ReportCurve]
    x_names: Sequence[str] = ()
    from_zero: bool = False

    @property
    def x(self) -> list[float]:
        """All x, each once, in order."""
        return sorted({x for line in self.lines for x in line.x})

    @property
    def values(self) -> list[float]:
        """All values and ends of intervals that are numbers: what a scale must hold."""
        ends = (end for line in self.lines for end in (line.low, line.high, line.value))
        return [value for several in ends for value in several if math.isfinite(value)]

    @property
    def span(self) -> tuple[float, float]:
        """The least and the most of the scale of values, apart."""
        return span([0.0, *self.values] if self.from_zero else self.values)


@dataclass(frozen=True)
class HeatMap:
    """A number for each cell of a floor; walls have none (NaN)."""

    title: str
    unit: str
    field: npt.NDArray[Any]  # (height, width) float
    note: str = ""


@dataclass(frozen=True)
class Folded:
    """What few will read: a page folds it away behind its title."""

    title: str
    blocks: Sequence[Heading | Text | Listed | Table]


@dataclass(frozen=True)
class PageBreak:
    """The end of a page, or of a sheet of a workbook."""


Block = Heading | Text | Listed | Table | Curves | HeatMap | Folded | PageBreak


def span(values: Sequence[float]) -> tuple[float, float]:
    """The least and the most of some values, apart."""
    low, high = min(values), max(values)
    if high > low:
        return low, high
    return low - (abs(low) / 10 or 1), high + (abs(high) / 10 or 1)


@dataclass
class ReportDocument:
    """A report."""

    title: str
    blocks: list[Block] = field(default_factory=list)

    def add(self, *blocks: Block) -> None:
        """Go on with these."""
        self.blocks += blocks
