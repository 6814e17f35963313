"""Curves and maps of a report as SVG, with scales and legends."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from html import escape
from typing import Final

import numpy as np

from automaton.runs.report_document import Curves, HeatMap, Line, span
from automaton.studies.reports.line_styles import LineStyle, line_style
from automaton.studies.reports.text_output import coarse
from automaton.units import number

WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 640, 320, 70, 14, 14, 44
LEGEND_LINE: Final = 18  # pixels
MAP_WIDTH, MAP_HEIGHT = 960, 720  # pixels at most: the width of the page, and what a screen shows
WIDEST_CELL: Final = 40  # pixels
WIDEST_MAP: Final = 200  # cells; larger floors by the means of blocks
MAX_NAME: Final = 90  # pixels of WIDTH that a name below the x axis has at least
SCALE_STEPS: Final = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)  # of the most, in the scale of a map
SWATCH: Final = 18  # pixels


def curves_svg(curves: Curves) -> str:
    """Curves with bars for their intervals, and a legend below."""
    if not curves.values:
        return f"<p>{escape(curves.title)}: no metrics</p>"
    low, high = curves.span
    left, right = span(curves.x)
    margin = 30 if curves.x_names or len(curves.x) > 1 else 0  # marks do not lie on the axis

    def x_at(value: float) -> float:
        part = (value - left) / (right - left)
        return LEFT + margin + part * (WIDTH - LEFT - RIGHT - 2 * margin)

    def y_at(value: float) -> float:
        return HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - TOP - BOTTOM)

    parts = [svg_open(WIDTH, HEIGHT + LEGEND_LINE * len(curves.lines), curves.title)]
    for value in round_marks(low, high):
        y = y_at(value)
        colour = "#888" if value == low else "#ddd"
        parts.append(
            f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="{colour}"/>'
        )
        parts.append(svg_text(LEFT - 6, y + 4, number(value), "end"))
    parts += x_labels(curves, x_at)
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(svg_text(middle, HEIGHT - BOTTOM + 34, curves.x_label, "middle"))
    for index, line in enumerate(curves.lines):
        style, y = line_style(index), HEIGHT + LEGEND_LINE * index + 2
        parts += line_parts(line, x_at, y_at, style, bool(curves.x_names))
        parts.append(
            f'<line x1="{LEFT}" x2="{LEFT + 34}" y1="{y}" y2="{y}" {stroke(style)}/>'
            f'<path d="{style.path}" transform="translate({LEFT + 17},{y})" fill="{style.colour}"/>'
        )
        parts.append(svg_text(LEFT + 42, y + 4, line.name or curves.y_label, "start"))
    title = f"{curves.title} ({curves.y_label})"
    return f"<h4>{escape(title)}</h4>\n{''.join(parts)}</svg>"


def round_marks(low: float, high: float) -> list[float]:
    """Four to nine round numbers on a scale: multiples of 1, 2 or 5 times a power of ten."""
    power = 10 ** math.floor(math.log10((high - low) / 4))
    step = power * max(one for one in (1, 2, 5) if one * power <= (high - low) / 4)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [step * place for place in range(first, last + 1)]


def x_labels(curves: Curves, x_at: Callable[[float], float]) -> Iterator[str]:
    """The numbers or names below the x axis that have room."""
    free = 0.0
    for x in curves.x:
        text = curves.x_names[int(x)] if curves.x_names else number(x)
        room = (WIDTH - LEFT - RIGHT) / max(1, len(curves.x))
        shown = text if len(text) * 6.5 <= max(room, MAX_NAME) else text[: int(room / 6.5)] + "…"
        half = len(shown) * 3.3
        if x_at(x) - half >= free:
            yield svg_text(x_at(x), HEIGHT - BOTTOM + 16, shown, "middle")
            free = x_at(x) + half + 4


def line_parts(
    line: Line,
    x_at: Callable[[float], float],
    y_at: Callable[[float], float],
    style: LineStyle,
    is_named: bool,
) -> Iterator[str]:
    """One curve; between things with names there is no line."""
    points = [
        (x_at(x), y_at(value))
        for x, value in zip(line.x, line.value, strict=True)
        if math.isfinite(value)
    ]
    if not is_named:
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        yield f'<polyline points="{path}" fill="none" {stroke(style)}/>'
    for x, low, high in zip(line.x, line.low, line.high, strict=True):
        if math.isfinite(low) and math.isfinite(high):
            yield (
                f'<line x1="{x_at(x):.1f}" x2="{x_at(x):.1f}" y1="{y_at(low):.1f}" '
                f'y2="{y_at(high):.1f}" stroke="{style.colour}"/>'
            )
    for x, y in points:
        yield f'<path d="{style.path}" transform="translate({x:.1f},{y:.1f})" fill="{style.colour}"/>'


def stroke(style: LineStyle) -> str:
    """The attributes of a line."""
    dashes = f' stroke-dasharray="{" ".join(f"{one:g}" for one in style.dashes)}"'
    return f'stroke="{style.colour}" stroke-width="2"{dashes if style.dashes else ""}'


def map_svg(heat: HeatMap) -> str:
    """A floor of coloured cells, and a scale with numbers below."""
    field = coarse(heat.field, max(1, math.ceil(heat.field.shape[1] / WIDEST_MAP)))
    high, wide = field.shape
    most = float(field[np.isfinite(field)].max(initial=0))
    cell = max(3, min(WIDEST_CELL, MAP_WIDTH // wide, MAP_HEIGHT // high))
    width = max(wide * cell, 90 * len(SCALE_STEPS))
    parts = [svg_open(width, high * cell + 2 * SWATCH, heat.title)]
    for (row, column), value in np.ndenumerate(field):
        parts.append(
            f'<rect x="{column * cell}" y="{row * cell}" width="{cell}" height="{cell}" '
            f'fill="{heat_colour(float(value), most)}"/>'
        )
    for place, part in enumerate(SCALE_STEPS if most else ()):
        x, y = 90 * place, high * cell + SWATCH / 2
        parts.append(
            f'<rect x="{x}" y="{y}" width="{SWATCH}" height="{SWATCH}" stroke="#888" '
            f'fill="{heat_colour(part * most, most)}"/>'
        )
        parts.append(svg_text(x + SWATCH + 4, y + 13, number(part * most), "start"))
    caption = f"{heat.title} (most: {number(most)} {heat.unit}). {heat.note}".strip()
    return f"<h4>{escape(caption)}</h4>\n{''.join(parts)}</svg>"


def heat_colour(value: float, most: float) -> str:
    """From light to dark red; walls are grey."""
    if not math.isfinite(value):
        return "#8c8c8c"
    if value <= 0 or most <= 0:
        return "#f5f5f0"
    part = math.sqrt(value / most)  # so that little is seen beside much
    return (
        f"#{round(250 - 90 * part):02x}{round(225 * (1 - part)):02x}{round(190 * (1 - part)):02x}"
    )


def svg_open(width: float, height: float, title: str) -> str:
    return (
        f'<svg viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" '
        f'xmlns="http://www.w3.org/2000/svg"><title>{escape(title)}</title>'
    )


def svg_text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
