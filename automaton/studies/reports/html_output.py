"""A report as one HTML file that needs nothing else: tables, curves and maps as SVG inside."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from html import escape

import numpy as np

from automaton.runs.report_document import (
    Block,
    Curves,
    Document,
    Heading,
    HeatMap,
    Line,
    Listed,
    Table,
    Text,
)
from automaton.studies.reports.text_output import coarse, scale
from automaton.units import number

COLOURS = ("#1f6fb4", "#d1602b", "#2f8f4e", "#8a4fa3", "#b08900", "#0f8f8f", "#b43a5b", "#5a5a5a")
WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 640, 320, 70, 14, 14, 44
WIDEST_MAP = 200  # cells; larger floors by the means of blocks
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
  color: #1b1b1b; background: #fff }
table { border-collapse: collapse; margin: .8rem 0; font-variant-numeric: tabular-nums }
th, td { padding: .15rem .7rem .15rem 0; text-align: right; white-space: nowrap }
th { border-bottom: 1px solid #888 }
.l { text-align: left }
.wide { overflow-x: auto }
pre { background: #f4f4f2; padding: .7rem; overflow-x: auto }
svg text { font: 12px system-ui, sans-serif; fill: #333 }
"""


def as_html(document: Document) -> str:
    """The whole page."""
    parts = "\n".join(part for block in document.blocks for part in html_parts(block))
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width">\n'
        f"<title>{escape(document.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        f"{parts}\n</body>\n</html>\n"
    )


def html_parts(block: Block) -> Iterator[str]:
    """One block."""
    if isinstance(block, Heading):
        yield f"<h{block.level}>{escape(block.text)}</h{block.level}>"
    elif isinstance(block, Text):
        tag = "pre" if block.code else "p"
        yield f"<{tag}>{escape(block.text)}</{tag}>"
    elif isinstance(block, Listed):
        items = "".join(f"<li>{escape(item)}</li>" for item in block.items)
        yield f"<ul>{items}</ul>"
    elif isinstance(block, Table):
        yield from table_parts(block)
    elif isinstance(block, Curves):
        yield curves_svg(block)
    elif isinstance(block, HeatMap):
        yield map_svg(block)


def table_parts(table: Table) -> Iterator[str]:
    """A table that scrolls where it is too wide."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "".join(
            f"<{tag}{' class=l' if table.is_left(index) else ''}>{escape(cell)}</{tag}>"
            for index, cell in enumerate(cells)
        )

    yield '<div class="wide"><table>'
    yield f"<thead><tr>{line(table.head, 'th')}</tr></thead><tbody>"
    yield from (f"<tr>{line(row, 'td')}</tr>" for row in table.rows)
    yield "</tbody></table></div>"


def curves_svg(curves: Curves) -> str:
    """Curves with bars for their intervals."""
    if not curves.values:
        return f"<p>{escape(curves.title)}: no metrics</p>"
    y_span, x_span = scale(curves.values), scale(curves.x)

    def x_at(value: float) -> float:
        return LEFT + (value - x_span[0]) / (x_span[1] - x_span[0]) * (WIDTH - LEFT - RIGHT)

    def y_at(value: float) -> float:
        part = (value - y_span[0]) / (y_span[1] - y_span[0])
        return HEIGHT - BOTTOM - part * (HEIGHT - TOP - BOTTOM)

    parts = [svg_open(WIDTH, HEIGHT + 18 * len(curves.lines), curves.title)]
    for step in range(5):
        value = y_span[0] + step / 4 * (y_span[1] - y_span[0])
        y = y_at(value)
        parts.append(
            f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>'
        )
        parts.append(svg_text(LEFT - 6, y + 4, number(value), "end"))
    for x in curves.x:
        parts.append(svg_text(x_at(x), HEIGHT - BOTTOM + 16, number(x), "middle"))
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(svg_text(middle, HEIGHT - BOTTOM + 34, curves.x_label, "middle"))
    for index, line in enumerate(curves.lines):
        colour = COLOURS[index % len(COLOURS)]
        parts += line_parts(line, x_at, y_at, colour)
        y = HEIGHT + 18 * index + 6
        parts.append(f'<rect x="{LEFT}" y="{y - 9}" width="14" height="4" fill="{colour}"/>')
        parts.append(svg_text(LEFT + 20, y - 2, line.name or curves.y_label, "start"))
    return (
        f"<h4>{escape(curves.title)} ({escape(curves.y_label)})</h4>\n" + "".join(parts) + "</svg>"
    )


def line_parts(
    line: Line, x_at: Callable[[float], float], y_at: Callable[[float], float], colour: str
) -> Iterator[str]:
    """One curve."""
    points = [
        (x_at(x), y_at(value))
        for x, value in zip(line.x, line.value, strict=True)
        if math.isfinite(value)
    ]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    yield f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>'
    for x, y in points:
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>'
    for x, low, high in zip(line.x, line.low, line.high, strict=True):
        if math.isfinite(low) and math.isfinite(high):
            yield (
                f'<line x1="{x_at(x):.1f}" x2="{x_at(x):.1f}" y1="{y_at(low):.1f}" '
                f'y2="{y_at(high):.1f}" stroke="{colour}"/>'
            )


def map_svg(heat: HeatMap) -> str:
    """A floor of coloured cells."""
    field = coarse(heat.field, max(1, math.ceil(heat.field.shape[1] / WIDEST_MAP)))
    high, wide = field.shape
    most = float(field[np.isfinite(field)].max(initial=0))
    cell = max(3, min(16, WIDTH // wide))
    parts = [svg_open(wide * cell, high * cell, heat.title)]
    for (row, column), value in np.ndenumerate(field):
        parts.append(
            f'<rect x="{column * cell}" y="{row * cell}" width="{cell}" height="{cell}" '
            f'fill="{heat_colour(float(value), most)}"/>'
        )
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


def svg_open(width: int, height: int, title: str) -> str:
    return (
        f'<svg viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" '
        f'style="max-width:100%" xmlns="http://www.w3.org/2000/svg"><title>{escape(title)}</title>'
    )


def svg_text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
