"""What the answer of a command consists of: headings, text, tables, curves and maps.

It is the same whether it is then written as text, Markdown, HTML or a workbook.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import numpy.typing as npt

INDENT: Final = "  "


@dataclass(frozen=True)
class Heading:
    """A title of a section; level 1 is that of the whole report.

    From level 3 on it stands right above what it names.
    """

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


class StyledText(str):
    """Text that is emphasised on a terminal; `style`: words such as "bold" or "red"."""

    style: str

    def __new__(cls, text: str, style: str) -> StyledText:
        """Remember the style of a text."""
        self = super().__new__(cls, text)
        self.style = style
        return self


@dataclass(frozen=True)
class Text:
    """A paragraph, or with `code` lines that are kept as they are; `strong`: what is to be read first."""

    text: str
    code: bool = False
    strong: bool = False


@dataclass(frozen=True)
class Listed:
    """Sentences, one below the other; `strong`: what is to be read first.

    `mark` stands before each in text. Those without one, or with INDENT, are lines that follow each
    other even from block to block.
    """

    items: Sequence[str]
    strong: bool = False
    mark: str = "- "


@dataclass(frozen=True)
class CharacterPicture:
    """Lines that are kept as they are, each of parts with a style such as "bold #009e73"."""

    rows: Sequence[Sequence[tuple[str, str]]]  # (text, style)

    @property
    def text(self) -> str:
        """The lines without their styles."""
        return "\n".join("".join(part for part, _ in row).rstrip() for row in self.rows)


@dataclass(frozen=True)
class Table:
    """A table of texts; the first `left` columns are aligned left.

    A row without cells separates groups of rows. `groups`: names above the last columns, each with
    the number of its columns.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    also_left: Sequence[int] = ()  # further columns
    groups: Sequence[tuple[str, int]] = ()

    def is_left(self, column: int) -> bool:
        """Whether a column is aligned left."""
        return column < self.left or column in self.also_left

    @property
    def keys(self) -> int:
        """How many columns say what a row is of: those before groups, or those on the left."""
        grouped = sum(size for _, size in self.groups)
        return len(self.head) - grouped if grouped else max(1, self.left)

    @property
    def columns(self) -> list[tuple[str, ...]]:
        """The cells of each column, its head first."""
        return list(zip(self.head, *(row for row in self.rows if row), strict=True))

    @property
    def flat_head(self) -> list[str]:
        """The heads, those of a group below its name."""
        names = [""] * (self.keys if self.groups else len(self.head))
        for name, size in self.groups:
            names += [name, *[""] * (size - 1)]
        return [" ".join(filter(None, pair)) for pair in zip(names, self.head, strict=True)]


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


Block = Heading | Text | Listed | CharacterPicture | Table | Curves | HeatMap | Folded | PageBreak


def has_no_line(block: Block) -> bool:
    """Whether a block has no line, as a list that is made of what may not be there."""
    if isinstance(block, Listed):
        return not block.items
    return isinstance(block, CharacterPicture) and not block.rows


def span(values: Sequence[float]) -> tuple[float, float]:
    """The least and the most of some values, apart."""
    low, high = min(values), max(values)
    if high > low:
        return low, high
    return low - (abs(low) / 10 or 1), high + (abs(high) / 10 or 1)


@dataclass
class ReportDocument:
    """The answer of a command."""

    title: str
    blocks: list[Block] = field(default_factory=list)

    def add(self, *blocks: Block) -> None:
        """Go on with these."""
        self.blocks += blocks
