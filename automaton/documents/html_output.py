"""A report as one self-contained HTML file, and its drawings as PNG and SVG files.

The file contains tables, curves and maps, the latter as SVG with scales and legends. Curves differ by
colour, dashes and marks, so they are distinct without colour, too. Printed pages are A4: cells wrap, a
table that is still too wide goes on landscape pages, and no drawing is split.
"""

from __future__ import annotations

import io
import math
import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.atomic_write import atomic_writer
from automaton.documents.report_document import (
    Block,
    CharacterPicture,
    Curves,
    Folded,
    Heading,
    HeatMap,
    Listed,
    PageBreak,
    Panels,
    ReportCurve,
    ReportDocument,
    ShareBars,
    SvgDrawing,
    Table,
    Text,
    has_no_line,
    span,
)
from automaton.documents.text_output import coarse
from automaton.errors import InputError
from automaton.units import number, percent

LEGEND_LINE: Final = 18  # pixels
SHARE_BAR_HEIGHT: Final = 28  # pixels
SHARE_LEGEND_COLUMNS: Final = 4
MOST_SMALL_MARKS: Final = 12  # points of a line with marks in a small chart
MAP_WIDTH, MAP_HEIGHT = 960, 720  # maximum pixels: width of the page, height of a screen
WIDEST_CELL: Final = 40  # pixels
WIDEST_MAP, TALLEST_MAP = 200, 150  # cells; larger floors are drawn by means of blocks
MAP_LEFT, SCALE_STEP = 46, 90  # pixels: of the axis, and between steps of the scale
MIN_NAME_WIDTH: Final = 90  # pixels; minimum width of a name below the x axis
SCALE_STEPS: Final = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)  # of the maximum, in the scale of a map
SWATCH: Final = 18  # pixels
WIDEST_UPRIGHT: Final = 105  # characters of the widest table on an upright page
WIDEST_TEXT_CELL: Final = 16  # characters of the widest text cell that does not wrap
MOST_ROWS_KEPT: Final = 15  # rows of the longest table that is not split between pages
PLOT_FORMATS = ("png", "svg")
DPI = 300  # for print
SIZE = (6.5, 4.2)  # inches: the text width of an A4 page, or half a slide
FONT_SIZES = {  # points; suit the text of half a slide
    "font.size": 10,
    "axes.labelsize": 11,
    "axes.titlesize": 11,
    "legend.fontsize": 9,
}
WIDEST_TITLE = 50
MARK_STEP: Final = 9  # px between curves at a name
PLOT_STEP: Final = 0.06  # of the distance between two names
WIDEST_LEGEND = 60  # characters in a line of the legend


class LineStyle(NamedTuple):
    """The style of a curve."""

    colour: str
    dashes: tuple[float, ...]  # lengths of strokes and gaps in points; (): a solid line
    marker: str  # matplotlib's name of the marker
    path: str  # the marker as an SVG path about 0, 0


_CIRCLE: Final = "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0z"
LINE_STYLES: Final = (
    LineStyle("#1f6fb4", (), "o", _CIRCLE),
    LineStyle("#d1602b", (6, 3), "s", "M-3.5,-3.5h7v7h-7z"),
    LineStyle("#2f8f4e", (2, 2.5), "^", "M0,-4.5L4.2,3.3H-4.2z"),
    LineStyle("#8a4fa3", (8, 3, 2, 3), "D", "M0,-4.7L4.7,0L0,4.7L-4.7,0z"),
    LineStyle("#b08900", (12, 4), "v", "M0,4.5L4.2,-3.3H-4.2z"),
    LineStyle("#0f8f8f", (4, 2, 1, 2, 1, 2), "P", "M-1.5,-4.5h3v3h3v3h-3v3h-3v-3h-3v-3h3z"),
    LineStyle("#b43a5b", (1, 2), "<", "M-4.5,0L3.3,-4.2V4.2z"),
    LineStyle("#5a5a5a", (10, 2, 4, 2), ">", "M4.5,0L-3.3,-4.2V4.2z"),
)


def line_style(index: int) -> LineStyle:
    """The style of curve number `index`."""
    return LINE_STYLES[index % len(LINE_STYLES)]


# Curves and maps as SVG.


class Frame(NamedTuple):
    """The size of a chart in pixels."""

    width: int
    height: int
    left: int
    top: int
    right: int
    bottom: int

    @property
    def inner(self) -> int:
        """The width of the plot area."""
        return self.width - self.left - self.right


WHOLE: Final = Frame(640, 320, 70, 14, 14, 44)
SMALL: Final = Frame(300, 150, 46, 8, 6, 26)


def curves_svg(curves: Curves) -> str:
    """Curves with bars for their intervals, and a legend below."""
    if not curves.values:
        return f"<p>{escape(curves.title)}: no metrics</p>"
    title = f"{curves.title} ({curves.y_label})"
    height = WHOLE.height + LEGEND_LINE * len(curves.lines)
    parts = [svg_open(WHOLE.width, height, curves.title), *plot_parts(curves, WHOLE)]
    middle = WHOLE.left + WHOLE.inner / 2
    parts.append(svg_text(middle, WHOLE.height - WHOLE.bottom + 34, curves.x_label, "middle"))
    for index, line in enumerate(curves.lines):
        y = WHOLE.height + LEGEND_LINE * index + 2
        parts += legend_parts(line.name or curves.y_label, line_style(index), WHOLE.left, y)
    return f"<h4>{escape(title)}</h4>\n{''.join(parts)}</svg>"


def share_svg(block: ShareBars) -> str:
    """Bars of coloured parts, each below its name, and the legend at the bottom."""
    named = LEGEND_LINE if block.is_named else 0
    bottom = len(block.bars) * (named + SHARE_BAR_HEIGHT + 6)
    rows = -(-len(block.legend) // SHARE_LEGEND_COLUMNS)
    out = [svg_open(WHOLE.width, bottom + LEGEND_LINE * rows, block.title)]
    for at, (bar, parts) in enumerate(block.bars):
        top, x = at * (named + SHARE_BAR_HEIGHT + 6) + named, 0.0
        out += [svg_text(0, top - 5, bar, "start")] if bar else []
        for name, share, colour in parts:
            wide = share * WHOLE.width
            out.append(
                f'<rect x="{x:.1f}" y="{top}" width="{wide:.1f}" height="{SHARE_BAR_HEIGHT}" '
                f'fill="{colour}"><title>{escape(f"{name} {percent(share)}")}</title></rect>'
            )
            x += wide
    step = WHOLE.width / SHARE_LEGEND_COLUMNS
    for at, (name, (colour, of_it)) in enumerate(block.legend.items()):
        left, y = at % SHARE_LEGEND_COLUMNS * step, bottom + at // SHARE_LEGEND_COLUMNS * 18
        text = name if of_it is None else f"{name} {percent(of_it)}"
        out.append(
            f'<rect x="{left:.1f}" y="{y}" width="12" height="12" fill="{colour}"/>'
            f"{svg_text(left + 17, y + 11, text, 'start')}"
        )
    title = "" if block.is_named else f"<h4>{escape(block.title)}</h4>\n"
    return f"{title}{''.join(out)}</svg>"


def panels_html(panels: Panels) -> str:
    """Small charts in rows below one legend."""
    names = [line.name for line in panels.charts[0].lines]
    parts = [svg_open(WHOLE.width, LEGEND_LINE * len(names), "legend")]
    for index, name in enumerate(names):
        parts += legend_parts(name, line_style(index), 2, LEGEND_LINE * (index + 0.5))
    charts = [
        f'<div class="panel"><b>{escape(chart_title(chart))}</b>'
        f"{svg_open(SMALL.width, SMALL.height, chart.title)}{''.join(plot_parts(chart, SMALL))}</svg>"
        "</div>"
        for chart in panels.charts
    ]
    title = f"<h4>{escape(panels.title)}</h4>\n" if panels.has_intervals else ""
    return f"{title}{''.join(parts)}</svg>\n{''.join(charts)}"


def chart_title(curves: Curves) -> str:
    """The title of a chart with its unit, unless it is the same."""
    same = curves.title == curves.y_label
    return curves.title if same else f"{curves.title} ({curves.y_label})"


def legend_parts(name: str, style: LineStyle, x: float, y: float) -> list[str]:
    """The line and the mark of a curve, and its name."""
    return [
        f'<line x1="{x}" x2="{x + 34}" y1="{y}" y2="{y}" {stroke(style)}/>'
        f'<path d="{style.path}" transform="translate({x + 17},{y})" fill="{style.colour}"/>',
        svg_text(x + 42, y + 4, name, "start"),
    ]


def plot_parts(curves: Curves, frame: Frame) -> Iterator[str]:
    """The axes of curves, and the curves."""
    low, high = curves.span
    left, right = span(curves.x)
    # Keeps marks off the axis.
    margin = (30 if frame is WHOLE else 8) if curves.x_names or len(curves.x) > 1 else 0

    def x_at(value: float) -> float:
        return frame.left + margin + (value - left) / (right - left) * (frame.inner - 2 * margin)

    def y_at(value: float) -> float:
        inner = frame.height - frame.top - frame.bottom
        return frame.height - frame.bottom - (value - low) / (high - low) * inner

    for value in round_marks(low, high):
        y = y_at(value)
        colour = "#888" if value == low else "#ddd"
        x2 = frame.width - frame.right
        yield f'<line x1="{frame.left}" x2="{x2}" y1="{y:.1f}" y2="{y:.1f}" stroke="{colour}"/>'
        yield svg_text(frame.left - 6, y + 4, number(value), "end")
    yield from x_labels(curves, x_at, frame)
    for index, line in enumerate(curves.lines):
        place = beside(x_at, MARK_STEP * curves.shift(index))
        has_marks = frame is WHOLE or len(line.x) <= MOST_SMALL_MARKS
        is_joined = not curves.x_names or curves.is_in_order
        yield from line_parts(line, place, y_at, line_style(index), is_joined, has_marks)


def beside(x_at: Callable[[float], float], shift: float) -> Callable[[float], float]:
    """The positions of a curve that is drawn beside others."""
    return lambda value: x_at(value) + shift


def round_marks(low: float, high: float) -> list[float]:
    """Four to nine round numbers on a scale: multiples of 1, 2 or 5 times a power of ten."""
    power = 10 ** math.floor(math.log10((high - low) / 4))
    apart = (high - low) / 4 * (1 + 1e-9)  # log10 may round up
    step = power * max((one for one in (1, 2, 5) if one * power <= apart), default=1)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [step * place for place in range(first, last + 1)]


def x_labels(curves: Curves, x_at: Callable[[float], float], frame: Frame) -> Iterator[str]:
    """The numbers or names below the x axis, as far as they fit."""
    free = 0.0
    for x in curves.x:
        text = curves.x_names[int(x)] if curves.x_names else number(x)
        room = frame.inner / max(1, len(curves.x))
        shown = (
            text if len(text) * 6.5 <= max(room, MIN_NAME_WIDTH) else text[: int(room / 6.5)] + "…"
        )
        half = len(shown) * 3.3
        middle = min(x_at(x), frame.width - half)  # inside the picture
        if middle - half >= free:
            yield svg_text(middle, frame.height - frame.bottom + 16, shown, "middle")
            free = middle + half + 4


def line_parts(
    line: ReportCurve,
    x_at: Callable[[float], float],
    y_at: Callable[[float], float],
    style: LineStyle,
    is_joined: bool,
    has_marks: bool,
) -> Iterator[str]:
    """One curve; with connecting lines if the x values have an order."""
    points = [
        (x_at(x), y_at(value))
        for x, value in zip(line.x, line.value, strict=True)
        if math.isfinite(value)
    ]
    if is_joined:
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        yield f'<polyline points="{path}" fill="none" {stroke(style)}/>'
    for x, low, high in zip(line.x, line.low, line.high, strict=True):
        if math.isfinite(low) and math.isfinite(high):
            yield (
                f'<line x1="{x_at(x):.1f}" x2="{x_at(x):.1f}" y1="{y_at(low):.1f}" '
                f'y2="{y_at(high):.1f}" stroke="{style.colour}"/>'
            )
    for x, y in points if has_marks else ():
        yield f'<path d="{style.path}" transform="translate({x:.1f},{y:.1f})" fill="{style.colour}"/>'


def stroke(style: LineStyle) -> str:
    """The SVG attributes of a line."""
    dashes = f' stroke-dasharray="{" ".join(f"{one:g}" for one in style.dashes)}"'
    return f'stroke="{style.colour}" stroke-width="2"{dashes if style.dashes else ""}'


def map_svg(heat: HeatMap) -> str:
    """A floor of coloured cells with axes, and a scale below."""
    rows, columns = heat.field.shape
    block = max(1, math.ceil(columns / WIDEST_MAP), math.ceil(rows / TALLEST_MAP))
    field = coarse(heat.field, block)
    high, wide = field.shape
    most = float(field[np.isfinite(field)].max(initial=0))
    cell = max(3, min(WIDEST_CELL, MAP_WIDTH // wide, MAP_HEIGHT // high))
    width = MAP_LEFT + max(wide * cell, SCALE_STEP * len(SCALE_STEPS)) + MAP_LEFT
    bottom = SWATCH + high * cell
    parts = [svg_open(width, bottom + 4 * SWATCH, heat.title)]
    for (row, column), value in np.ndenumerate(field):
        parts.append(
            f'<rect x="{MAP_LEFT + column * cell}" y="{SWATCH + row * cell}" width="{cell}" '
            f'height="{cell}" fill="{heat_colour(float(value), most)}"/>'
        )
    pixels = cell / (block * heat.side)  # of a unit of the axes
    for x in round_marks(0, columns * heat.side):
        parts.append(svg_text(MAP_LEFT + x * pixels, bottom + 14, number(x), "middle"))
    for y in round_marks(0, rows * heat.side):
        parts.append(svg_text(MAP_LEFT - 6, SWATCH + y * pixels + 4, number(y), "end"))
    parts.append(svg_text(MAP_LEFT + wide * cell + 14, bottom + 14, heat.axis, "start"))
    for place, part in enumerate(SCALE_STEPS if most else ()):
        at, below = MAP_LEFT + SCALE_STEP * place, bottom + 2 * SWATCH
        parts.append(
            f'<rect x="{at}" y="{below}" width="{SWATCH}" height="{SWATCH}" stroke="#888" '
            f'fill="{heat_colour(part * most, most)}"/>'
        )
        parts.append(svg_text(at + SWATCH + 4, below + 13, number(part * most), "start"))
    what = f"Colour: {heat.unit} in a cell" if block == 1 else f"Colour: mean {heat.unit} of a cell"
    caption = f"{heat.title}. {what}. {heat.note}".strip()
    return f"<h4>{escape(caption)}</h4>\n{''.join(parts)}</svg>"


def heat_colour(value: float, most: float) -> str:
    """A colour from light to dark red; grey for walls."""
    if not math.isfinite(value):
        return "#8c8c8c"
    if value <= 0 or most <= 0:
        return "#f5f5f0"
    part = math.sqrt(value / most)  # keeps small values visible
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


# The page.


STYLE: Final = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
  color: #1b1b1b; background: #fff }
h1 { margin-bottom: .2rem }
table { border-collapse: collapse; margin: .8rem 0; font-variant-numeric: tabular-nums }
th, td { padding: .15rem .7rem .15rem 0; text-align: right; vertical-align: top }
th { border-bottom: 1px solid #888; vertical-align: bottom }
td.n, th.l.n { white-space: nowrap }
.l { text-align: left }
.wide { overflow-x: auto }
.answer { font-size: 1.1rem; border-left: 4px solid #1f6fb4; padding: .4rem .9rem; background: #f3f7fb }
.answer li { margin: .4rem 0 }
pre { background: #f4f4f2; padding: .7rem; overflow-x: auto }
summary { cursor: pointer; font-weight: 600 }
.drawing { margin: .8rem 0 }
.site { float: right; width: 36%; margin: 0 0 .6rem 1.5rem; text-align: right }
.site svg { max-height: 200px }
.site p { margin: .2rem 0 0; font-size: .85rem; color: #555 }
.answer { clear: both }
.panel { display: inline-block; width: 31%; margin: .3rem 1.5% .3rem 0; vertical-align: top }
.panel b { font-size: .9rem; display: block }
.panel svg { width: 100%; height: auto; max-height: none }
svg { max-width: 100%; height: auto }
svg text { font: 12px system-ui, sans-serif; fill: #333 }
@page { size: A4; margin: 14mm 13mm }
@page turned { size: A4 landscape; margin: 13mm 14mm }
@media print {
  body { font-size: 10pt; line-height: 1.35; margin: 0; padding: 0; max-width: none }
  .answer { font-size: 10.5pt }
  table { font-size: 8.5pt }
  th, td { padding-right: .5rem }
  thead { display: table-header-group }
  tr, .drawing, svg, .answer, .short { break-inside: avoid }
  h1, h2, h3, h4, p:has(+ .wide), p:has(+ div > ul) { break-after: avoid }
  .wide { overflow-x: visible }
  .turned { page: turned }
  .turned table { font-size: 8pt; width: 100% }
  .turned td, .turned th { padding-right: .35rem }
  .page-end { break-after: page }
  svg { max-height: 70mm; width: auto }
  svg text { font-size: 13.5px }
  .page-end ~ .drawing svg { max-height: 104mm }
  .page-end ~ .drawing svg text { font-size: 12px }
  .drawing.map svg { max-height: 115mm }
  .drawing.site svg { max-height: 38mm }
  .drawing.panels { break-inside: auto }
  .panel { break-inside: avoid }
  .drawing.map svg text { font-size: 16px }
  .drawing.panel svg { max-height: none; width: 100% }
  .drawing.panels > svg { max-height: none }
  pre { white-space: pre-wrap; overflow-wrap: anywhere }
}
"""


def as_html(document: ReportDocument) -> str:
    """The document as an HTML page."""
    parts = "\n".join(page_parts(document.blocks))
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width">\n'
        f"<title>{escape(document.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        f"{parts}\n</body>\n</html>\n"
    )


def page_parts(blocks: Sequence[Block]) -> Iterator[str]:
    """All blocks; a table on landscape pages takes its heading and surrounding texts along.

    The first page is always upright.
    """
    before: list[str] = []  # parts since the last heading
    is_turned = False
    is_first_page = any(isinstance(block, PageBreak) for block in blocks)
    for block in blocks:
        parts = list(html_parts(block))
        if isinstance(block, Heading) or (isinstance(block, Text) and before):
            before += parts
            continue
        if before or not isinstance(block, (Text, Listed)):
            was_turned, is_turned = is_turned, is_too_wide(block) and not is_first_page
            yield from ["</div>"] if was_turned and not is_turned else []
            yield from ['<div class="turned">'] if is_turned and not was_turned else []
        yield from [*before, *parts]
        before = []
        is_first_page = is_first_page and not isinstance(block, PageBreak)
    yield from ["</div>"] if is_turned else []
    yield from before


def is_too_wide(block: Block) -> bool:
    """Whether a block is a table that does not fit on an upright page."""
    return isinstance(block, Table) and printed_width(block) > WIDEST_UPRIGHT


def printed_width(table: Table) -> int:
    """The width of a table in characters, if its texts wrap."""
    width = 0
    for column, (head, *body) in enumerate(table.columns):
        longest = max(map(len, body), default=0)
        words = max(len(word) for word in head.split() or [""])
        width += 2 + max(
            words, min(longest, WIDEST_TEXT_CELL) if table.is_left(column) else longest
        )
    return width


def html_parts(block: Block) -> Iterator[str]:
    """The HTML of one block."""
    if has_no_line(block):
        return
    if isinstance(block, Heading):
        yield f"<h{block.level}>{escape(block.text)}</h{block.level}>"
    elif isinstance(block, Text):
        tag = "pre" if block.code else "p"
        mark = ' class="answer"' if block.strong else ""
        yield f"<{tag}{mark}>{escape(block.text)}</{tag}>"
    elif isinstance(block, Listed):
        tag = "li" if block.mark else "p"
        items = "".join(f"<{tag}>{escape(item)}</{tag}>" for item in block.items)
        mark = ' class="answer"' if block.strong else ""
        yield f"<div{mark}>{f'<ul>{items}</ul>' if block.mark else items}</div>"
    elif isinstance(block, CharacterPicture):
        yield f"<pre>{escape(block.text)}</pre>"
    elif isinstance(block, Table):
        yield from table_parts(block)
    elif isinstance(block, Folded):
        inner = "\n".join(part for one in block.blocks for part in html_parts(one))
        yield f"<details><summary>{escape(block.title)}</summary>\n{inner}\n</details>"
    elif isinstance(block, PageBreak):
        yield '<div class="page-end"></div>'
    elif isinstance(block, Curves):
        yield f'<div class="drawing">{curves_svg(block)}</div>'
    elif isinstance(block, Panels):
        yield f'<div class="drawing panels">{panels_html(block)}</div>'
    elif isinstance(block, ShareBars):
        yield f'<div class="drawing">{share_svg(block)}</div>'
    elif isinstance(block, SvgDrawing):
        yield f'<div class="drawing site">{block.svg}<p>{escape(block.caption)}</p></div>'
    elif isinstance(block, HeatMap):
        yield f'<div class="drawing map">{map_svg(block)}</div>'


def table_parts(table: Table) -> Iterator[str]:
    """A table that scrolls if it is too wide."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "".join(
            f"<{tag}{_classes(table, index, cell)}>{escape(cell).replace(chr(10), '<br>')}</{tag}>"
            for index, cell in enumerate(cells)
        )

    short = " short" if len(table.rows) <= MOST_ROWS_KEPT else ""
    yield f'<div class="wide{short}"><table>'
    if any(table.head):
        yield f"<thead><tr>{line(table.flat_head, 'th')}</tr></thead>"
    yield "<tbody>"
    yield from (f"<tr>{line(row, 'td')}</tr>" for row in table.rows if row)
    yield "</tbody></table></div>"


def _classes(table: Table, column: int, cell: str) -> str:
    """Classes of a cell: text is aligned left and wraps if it is long; numbers do not wrap."""
    if not table.is_left(column):
        return " class=n"
    return " class=l" if len(cell) > WIDEST_TEXT_CELL else ' class="l n"'


# Files of curves and maps, by matplotlib (extra `plots`).


def figure_class() -> Any:
    """matplotlib's Figure. Raises InputError if matplotlib is not installed."""
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(
            f"plots need matplotlib, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[plots]'"
        ) from None
    matplotlib.rcParams["svg.hashsalt"] = "automaton"  # makes files reproducible
    return Figure


def write_plots(blocks: Sequence[Block], folder: Path) -> list[Path]:
    """Write each set of curves and each map as PNG and SVG; return the files. Raises InputError."""
    kind = figure_class()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot create the folder: {error.strerror}", str(folder)) from None
    return [path for block in blocks for path in _written(kind, block, folder)]


def _written(kind: Any, block: Block, folder: Path) -> Iterator[Path]:
    if isinstance(block, Panels):
        for chart in block.charts:
            yield from _written(kind, replace(chart, title=f"{block.title}, {chart.title}"), folder)
    if not isinstance(block, Curves | HeatMap):
        return
    import matplotlib

    with matplotlib.rc_context(FONT_SIZES):
        figure = kind(figsize=SIZE, layout="constrained")
        axes = figure.subplots()
        if isinstance(block, Curves):
            draw_curves(figure, axes, block)
        else:
            draw_map(figure, axes, block)
        yield from _saved(figure, block, folder)


def _saved(figure: Any, block: Curves | HeatMap, folder: Path) -> Iterator[Path]:
    for form in PLOT_FORMATS:
        path = folder / f"{file_name(block.title)}.{form}"
        content = io.BytesIO()
        figure.savefig(
            content, format=form, dpi=DPI, metadata={"Date": None} if form == "svg" else {}
        )
        with atomic_writer(path) as file:
            file.write(content.getvalue())
        yield path


def draw_curves(figure: Any, axes: Any, curves: Curves) -> None:
    """Draw lines with bars for their intervals, and the legend below the plot."""
    for index, line in enumerate(curves.lines):
        down = [value - low for value, low in zip(line.value, line.low, strict=True)]
        up = [high - value for value, high in zip(line.value, line.high, strict=True)]
        style = line_style(index)
        is_joined = not curves.x_names or curves.is_in_order
        dashes = "none" if not is_joined else (0, style.dashes) if style.dashes else "solid"
        axes.errorbar(
            [x + PLOT_STEP * curves.shift(index) for x in line.x],
            line.value,
            yerr=[down, up],
            capsize=3,
            color=style.colour,
            marker=style.marker,
            linestyle=dashes,
            label=line.name or None,
        )
    axes.set_xticks(curves.x)
    if curves.x_names:
        axes.set_xticklabels([curves.x_names[int(x)] for x in curves.x])
    if curves.from_zero and min(curves.values, default=0.0) >= 0:
        axes.set_ylim(bottom=0)
    axes.set(title=curves.title, xlabel=curves.x_label, ylabel=curves.y_label)
    axes.grid(alpha=0.3)
    names = [line.name for line in curves.lines if line.name]
    if names:
        columns = max(1, WIDEST_LEGEND // max(map(len, names)))
        rows = math.ceil(len(names) / columns)
        figure.set_figheight(SIZE[1] + 0.2 * rows)  # keeps the height of the plot area
        figure.legend(loc="outside lower center", ncols=columns, handlelength=4, frameon=False)


def draw_map(figure: Any, axes: Any, heat: HeatMap) -> None:
    """Draw a floor in colours."""
    rows, columns = heat.field.shape
    extent = (0, columns * heat.side, rows * heat.side, 0)
    image = axes.imshow(heat.field, cmap="inferno", interpolation="nearest", extent=extent)
    title = "\n".join(textwrap.wrap(heat.title, WIDEST_TITLE))
    axes.set(title=title, xlabel=f"{heat.axis}\n{heat.note}", ylabel=heat.axis)
    figure.colorbar(image, label=heat.unit)


def file_name(title: str) -> str:
    """A file name from a title."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:80] or "plot"
