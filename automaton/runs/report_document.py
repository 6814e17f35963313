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


@dataclass(frozen=True)
class Text:
    """A paragraph, or with `code` lines that are kept as they are."""

    text: str
    code: bool = False


@dataclass(frozen=True)
class Listed:
    """Sentences, one below the other."""

    items: Sequence[str]


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
class Line:
    """One curve: for each x the value and the ends of its interval."""

    name: str
    x: Sequence[float]
    value: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]


@dataclass(frozen=True)
class Curves:
    """Curves with intervals over a number, such as that of robots."""

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]

    @property
    def x(self) -> list[float]:
        """All x, each once, in order."""
        return sorted({x for line in self.lines for x in line.x})

    @property
    def values(self) -> list[float]:
        """All values and ends of intervals that are numbers: what a scale must hold."""
        ends = (end for line in self.lines for end in (line.low, line.high, line.value))
        return [value for several in ends for value in several if math.isfinite(value)]


@dataclass(frozen=True)
class HeatMap:
    """A number for each cell of a floor; walls have none (NaN)."""

    title: str
    unit: str
    field: npt.NDArray[Any]  # (height, width) float
    note: str = ""


Block = Heading | Text | Listed | Table | Curves | HeatMap


@dataclass
class Document:
    """A report."""

    title: str
    blocks: list[Block] = field(default_factory=list)

    def add(self, *blocks: Block) -> None:
        """Go on with these."""
        self.blocks += blocks
