"""A report as terminal text and as Markdown, curves and maps included.

3000 |  o
     |      +            o  one sign for each curve, : its interval
2000 |  :       *
     +------------
        1   2   3
"""

from __future__ import annotations

import html
import math
import textwrap
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from automaton.runs.report_document import (
    Block,
    Curves,
    Folded,
    Heading,
    HeatMap,
    Listed,
    PageBreak,
    ReportDocument,
    Table,
    Text,
    span,
)
from automaton.units import number

COLUMN_GAP = "  "
SIGNS = "\\|*_`<"  # of Markdown
HTML_SIGNS = "\\<"  # in titles, where names stand as they are
CURVE_MARKS = "ox+*#%@&"
INTERVAL_MARK = ":"
CHART_HEIGHT, CHART_COLUMNS = 14, 60
SHADES = ".:-=+*%@"  # from a little to the most
WALL_MARK, EMPTY_MARK = " ", "·"


def as_text(document: ReportDocument, width: int = 100) -> str:
    """For a terminal."""
    lines: list[str] = []
    for block in document.blocks:
        if not isinstance(block, PageBreak):
            lines += [*text_lines(block, width), ""]
    return "\n".join(lines).rstrip() + "\n"


def text_lines(block: Block, width: int) -> Iterator[str]:
    """One block."""
    if isinstance(block, Heading):
        yield block.text
        yield ("=" if block.level == 1 else "-") * len(block.text)
    elif isinstance(block, Text):
        yield from block.text.splitlines() if block.code else textwrap.wrap(block.text, width)
    elif isinstance(block, Listed):
        for item in block.items:
            yield from textwrap.wrap(f"- {item}", width, subsequent_indent="  ")
    elif isinstance(block, Table):
        yield from table_lines(block)
    elif isinstance(block, Curves):
        yield from chart(block)
    elif isinstance(block, HeatMap):
        yield from shaded(block, width)
    elif isinstance(block, Folded):
        yield f"{block.title}:"
        for inner in block.blocks:
            yield ""
            yield from text_lines(inner, width)


def table_lines(table: Table) -> Iterator[str]:
    """A table in columns, a rule below its head."""
    widths = [max(map(len, column)) for column in zip(table.head, *table.rows, strict=True)]

    def line(cells: Sequence[str]) -> str:
        padded = (
            cell.ljust(width) if table.is_left(index) else cell.rjust(width)
            for index, (cell, width) in enumerate(zip(cells, widths, strict=True))
        )
        return COLUMN_GAP.join(padded).rstrip()

    yield line(table.head)
    yield COLUMN_GAP.join("-" * width for width in widths)
    yield from map(line, table.rows)


def as_markdown(document: ReportDocument) -> str:
    """For a repository or an editor; charts are text, kept as they are."""
    lines: list[str] = []
    for block in document.blocks:
        if not isinstance(block, PageBreak):
            lines += [*markdown_lines(block), ""]
    return "\n".join(lines).rstrip() + "\n"


def markdown_lines(block: Block) -> Iterator[str]:
    """One block."""
    if isinstance(block, Heading):
        yield f"{'#' * block.level} {escaped(block.text, HTML_SIGNS)}"
    elif isinstance(block, Text) and not block.code:
        yield f"**{escaped(block.text)}**" if block.strong else escaped(block.text)
    elif isinstance(block, Folded):
        yield f"<details><summary>{html.escape(block.title)}</summary>"
        for inner in block.blocks:
            yield ""
            yield from markdown_lines(inner)
        yield from ("", "</details>")
    elif isinstance(block, Listed):
        yield from (f"- {escaped(item)}" for item in block.items)
    elif isinstance(block, Table):
        yield from markdown_table(block)
    else:
        yield from fenced(text_lines(block, 100))


def markdown_table(table: Table) -> Iterator[str]:
    """A table with pipes."""

    def line(cells: Sequence[str]) -> str:
        return f"| {' | '.join(escaped(cell) for cell in cells)} |"

    yield line(table.head)
    rules = ["---" if table.is_left(index) else "---:" for index in range(len(table.head))]
    yield f"|{'|'.join(rules)}|"
    yield from map(line, table.rows)


def escaped(text: str, signs: str = SIGNS) -> str:
    """Text in which Markdown finds no signs of its own."""
    for sign in signs:
        text = text.replace(sign, f"\\{sign}")
    return text


def fenced(lines: Iterator[str]) -> Iterator[str]:
    """Lines kept as they are; the fence is longer than any within."""
    kept = list(lines)
    fence = "```"
    while any(fence in line for line in kept):
        fence += "`"
    yield from (fence, *kept, fence)


def chart(curves: Curves, width: int = CHART_COLUMNS, height: int = CHART_HEIGHT) -> Iterator[str]:
    """Curves on a grid of characters; the scale holds all intervals."""
    yield f"{curves.title} ({curves.y_label})"
    if not curves.values:
        yield "no metrics"
        return
    x_scale, (low, high) = span(curves.x), curves.span
    grid = [[" "] * width for _ in range(height)]
    for bars in (True, False):  # signs over bars
        for index, line in enumerate(curves.lines):
            for x, value, least, most in zip(line.x, line.value, line.low, line.high, strict=True):
                column = at(x, x_scale, width)
                if bars and math.isfinite(least) and math.isfinite(most):
                    ends = (at(end, (low, high), height) for end in (least, most))
                    first, last = sorted(ends)
                    for row in range(first, last + 1):
                        grid[height - 1 - row][column] = INTERVAL_MARK
                if not bars and math.isfinite(value):
                    put(grid[height - 1 - at(value, (low, high), height)], column, index)
    labels = [""] * height
    labels[0], labels[height // 2], labels[-1] = (
        number(value) for value in (high, high - (high - low) * (height // 2) / (height - 1), low)
    )
    margin = max(map(len, labels))
    for label, cells in zip(labels, grid, strict=True):
        yield f"{label:>{margin}} |{''.join(cells)}".rstrip()
    yield f"{'':>{margin}} +{'-' * width}"
    yield f"{'':>{margin}}  {ticks(curves, x_scale, width)}".rstrip()
    yield f"{'':>{margin}}  {curves.x_label}"
    for index, line in enumerate(curves.lines):
        if len(curves.lines) > 1 or line.name:
            yield f"{'':>{margin}}  {CURVE_MARKS[index % len(CURVE_MARKS)]} {line.name}".rstrip()


def put(row: list[str], column: int, index: int) -> None:
    """The sign of a curve in a row; beside the signs of others, if there is room."""
    room = range(column, min(len(row), column + len(CURVE_MARKS)))
    free = next((one for one in room if row[one] in (" ", INTERVAL_MARK)), column)
    row[free] = CURVE_MARKS[index % len(CURVE_MARKS)]


def at(value: float, ends: tuple[float, float], cells: int) -> int:
    """The cell of a value on a scale with these ends."""
    low, high = ends
    return min(cells - 1, max(0, round((value - low) / (high - low) * (cells - 1))))


def ticks(curves: Curves, ends: tuple[float, float], width: int) -> str:
    """The x values, or their names, that have room, below their columns."""
    line = [" "] * (width + 12)
    free = 0
    for x in curves.x:
        text = curves.x_names[int(x)] if curves.x_names else number(x)
        start = max(0, at(x, ends, width) - len(text) // 2)
        if start + len(text) > len(line):
            start = max(0, len(line) - len(text))
        if start >= free:
            line[start : start + len(text)] = text
            free = start + len(text) + 1
    return "".join(line).rstrip()


def shaded(heat: HeatMap, width: int) -> Iterator[str]:
    """A floor in shades; large floors by the means of blocks of cells."""
    field = coarse(heat.field, max(1, math.ceil(heat.field.shape[1] / width)))
    known = field[np.isfinite(field)]
    most = float(known.max(initial=0))
    yield f"{heat.title} (most: {number(most)} {heat.unit})"
    for row in field:
        yield "".join(shade(value, most) for value in row).rstrip()
    steps = most / len(SHADES)
    scale_text = ", ".join(
        f"{sign} up to {number((index + 1) * steps)}" for index, sign in enumerate(SHADES)
    )
    yield f"{EMPTY_MARK} none, {scale_text}" if most else "nothing happened"
    if heat.note:
        yield heat.note


def shade(value: float, most: float) -> str:
    """One cell."""
    if not math.isfinite(value):
        return WALL_MARK
    if value <= 0 or most <= 0:
        return EMPTY_MARK
    return SHADES[min(len(SHADES) - 1, math.ceil(value / most * len(SHADES)) - 1)]


def coarse(field: npt.NDArray[np.float64], block: int) -> npt.NDArray[np.float64]:
    """Means of blocks of cells that are not walls; NaN where all are."""
    if block == 1:
        return field
    high, wide = (math.ceil(size / block) for size in field.shape)
    padded = np.full((high * block, wide * block), np.nan)
    padded[: field.shape[0], : field.shape[1]] = field
    cells = padded.reshape(high, block, wide, block).swapaxes(1, 2).reshape(high, wide, -1)
    known = np.isfinite(cells)
    sums, numbers = np.where(known, cells, 0).sum(axis=2), known.sum(axis=2)
    means: npt.NDArray[np.float64] = np.where(numbers > 0, sums / np.maximum(numbers, 1), np.nan)
    return means
