"""Curves and maps of floors in characters.

3000 |  o
     |      +            o  one sign for each curve, : its interval
2000 |  :       *
     +------------
        1   2   3
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.documents.report_document import Curves, HeatMap, span
from automaton.units import number

CURVE_MARKS: Final = "ox+*#%@&"
INTERVAL_MARK: Final = ":"
CHART_HEIGHT: Final = 14
MIN_CHART_WIDTH, WIDEST_CHART = 20, 60  # columns
SHADES: Final = ".:-=+*%@"  # from a little to the most
WALL_MARK, EMPTY_MARK = " ", "·"


def chart(curves: Curves, columns: int = 100, height: int = CHART_HEIGHT) -> Iterator[str]:
    """Curves on a grid of characters; the scale holds all intervals."""
    yield f"{curves.title} ({curves.y_label})"
    if not curves.values:
        yield "no metrics"
        return
    x_scale, (low, high) = span(curves.x), curves.span
    labels = [""] * height
    labels[0], labels[height // 2], labels[-1] = (
        number(value) for value in (high, high - (high - low) * (height // 2) / (height - 1), low)
    )
    margin = max(map(len, labels))
    width = max(MIN_CHART_WIDTH, min(WIDEST_CHART, columns - margin - 2))
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
