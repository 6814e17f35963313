"""The parts of a document: headings, text, tables, curves and maps.

They are independent of the format: text, Markdown, HTML or workbook.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import numpy.typing as npt

INDENT: Final = "  "


@dataclass(frozen=True)
class Heading:
    """The title of a section; level 1 is the title of the document.

    From level 3 on, no blank line follows it.
    """

    text: str
    level: int = 2


class NumberText(str):
    """A number as printed in a table; `value` has all digits, in the unit of the table."""

    value: float

    def __new__(cls, text: str, value: float) -> NumberText:
        """Create a text with its number."""
        self = super().__new__(cls, text)
        self.value = value
        return self


class StyledText(str):
    """Text that is emphasised on a terminal; `style`: words such as "bold" or "red"."""

    style: str

    def __new__(cls, text: str, style: str) -> StyledText:
        """Create a text with its style."""
        self = super().__new__(cls, text)
        self.style = style
        return self


@dataclass(frozen=True)
class Text:
    """A paragraph, or preformatted lines if `code`; `strong`: emphasised, to be read first."""

    text: str
    code: bool = False
    strong: bool = False


@dataclass(frozen=True)
class Listed:
    """A list of sentences; `strong`: emphasised, to be read first.

    In text, `mark` precedes each sentence. Lists without a mark, or with INDENT, follow each other
    without blank lines.
    """

    items: Sequence[str]
    strong: bool = False
    mark: str = "- "


@dataclass(frozen=True)
class CharacterPicture:
    """Preformatted lines, each of parts with a style such as "bold #009e73"."""

    rows: Sequence[Sequence[tuple[str, str]]]  # (text, style)

    @property
    def text(self) -> str:
        """The lines without their styles."""
        return "\n".join("".join(part for part, _ in row).rstrip() for row in self.rows)


@dataclass(frozen=True)
class Table:
    """A table of texts; the first `left` columns are aligned left.

    A row without cells separates groups of rows. `groups`: names above groups of the last columns,
    each with the number of its columns.
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
        """The number of columns that identify a row: those before groups, or those on the left."""
        grouped = sum(size for _, size in self.groups)
        return len(self.head) - grouped if grouped else max(1, self.left)

    @cached_property
    def columns(self) -> list[tuple[str, ...]]:
        """The cells of each column, starting with its heading."""
        return list(zip(self.head, *(row for row in self.rows if row), strict=True))

    @property
    def flat_head(self) -> list[str]:
        """The headings in one line, with the name of a group before its first heading."""
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
    """Curves with intervals over a number, such as the number of robots, or over names.

    `x_names`: names of x = 0, 1, ..., which are not connected by lines unless they are in order, such
    as hours. `from_zero`: start the scale of values at 0.
    """

    title: str
    x_label: str
    y_label: str
    lines: Sequence[ReportCurve]
    x_names: Sequence[str] = ()
    from_zero: bool = False
    is_in_order: bool = False

    @property
    def x(self) -> list[float]:
        """All distinct x in ascending order."""
        return sorted({x for line in self.lines for x in line.x})

    def shift(self, line: int) -> float:
        """The place of a curve beside its x, in steps from the middle; 0 where x are numbers."""
        is_beside = self.x_names and not self.is_in_order
        return line - (len(self.lines) - 1) / 2 if is_beside else 0.0

    @property
    def values(self) -> list[float]:
        """All finite values and ends of intervals, which the scale must contain."""
        ends = (end for line in self.lines for end in (line.low, line.high, line.value))
        return [value for several in ends for value in several if math.isfinite(value)]

    @property
    def span(self) -> tuple[float, float]:
        """The distinct ends of the scale of values."""
        if self.from_zero and not any(self.values):
            return 0.0, 1.0
        return span([0.0, *self.values] if self.from_zero else self.values)


@dataclass(frozen=True)
class Panels:
    """Small charts with the same lines, side by side on pages.

    As text, tables have their values; `has_intervals`: or each chart is a list of intervals, as its
    lines have a single point.
    """

    title: str
    charts: Sequence[Curves]
    has_intervals: bool = False


Shares = Sequence[tuple[str, float, str]]  # name, share, and colour as #rrggbb of each part


@dataclass(frozen=True)
class ShareBars:
    """Shares of a whole as bars with one legend; only terminals and HTML show them.

    A single bar without a name has its title above it, and its shares in the legend; bars with names
    follow a heading, and a table has their shares.
    """

    title: str
    bars: Sequence[tuple[str, Shares]]  # name, parts

    @property
    def is_named(self) -> bool:
        """Whether bars have names."""
        return any(name for name, _ in self.bars)

    @property
    def legend(self) -> dict[str, tuple[str, float | None]]:
        """Colour, and of a bar without a name the share, of each part."""
        return {
            name: (colour, None if self.is_named else share)
            for _, parts in self.bars
            for name, share, colour in parts
        }

    @property
    def table(self) -> Table:
        """The shares of each bar as numbers."""
        shares = [{name: share for name, share, _ in parts} for _, parts in self.bars]
        rows = [
            [name, *(f"{100 * one.get(part, 0.0):.1f} %" for part in self.legend)]
            for (name, _), one in zip(self.bars, shares, strict=True)
        ]
        return Table(("", *self.legend), rows)


@dataclass(frozen=True)
class SvgDrawing:
    """An SVG on pages; as text only its caption."""

    svg: str
    caption: str


@dataclass(frozen=True)
class HeatMap:
    """A number for each cell of a floor; NaN for walls. A cell is `side` long, in the unit `axis`."""

    title: str
    unit: str
    field: npt.NDArray[Any]  # (height, width) float
    note: str = ""
    axis: str = "cells"
    side: float = 1.0


@dataclass(frozen=True)
class Folded:
    """Details that an HTML page folds behind their title."""

    title: str
    blocks: Sequence[Heading | Text | Listed | Table]


@dataclass(frozen=True)
class PageBreak:
    """The end of a page, or of a sheet of a workbook."""


Block = (
    Heading
    | Text
    | Listed
    | CharacterPicture
    | Table
    | Curves
    | Panels
    | ShareBars
    | SvgDrawing
    | HeatMap
    | Folded
    | PageBreak
)


def has_no_line(block: Block) -> bool:
    """Whether a block is empty, such as a list whose sentences are all optional."""
    if isinstance(block, Listed):
        return not block.items
    if isinstance(block, ShareBars):
        return not block.legend
    return isinstance(block, CharacterPicture) and not block.rows


def span(values: Sequence[float]) -> tuple[float, float]:
    """The least and the largest value; widened if they are equal."""
    low, high = min(values), max(values)
    if high > low:
        return low, high
    return low - (abs(low) / 10 or 1), high + (abs(high) / 10 or 1)


@dataclass
class ReportDocument:
    """The output of a command as a document."""

    title: str
    blocks: list[Block] = field(default_factory=list)

    def add(self, *blocks: Block) -> None:
        """Append blocks."""
        self.blocks += blocks
