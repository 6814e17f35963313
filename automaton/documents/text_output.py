"""A document as text and as Markdown, including curves and maps.

Text wraps at the width of the terminal, only at blanks. A table that is too wide loses its empty
columns; then its headings wrap, then its cells. A table that is still too wide is printed in parts that
begin with the same columns. Colours and emphasis are used on terminals only.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import sys
import textwrap
import unicodedata
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Final, NamedTuple, TextIO

from automaton.documents.report_document import (
    INDENT,
    Block,
    CharacterPicture,
    Curves,
    Folded,
    Heading,
    HeatMap,
    Listed,
    PageBreak,
    Panels,
    ReportDocument,
    ShareBars,
    StyledText,
    SvgDrawing,
    Table,
    Text,
    has_no_line,
    span,
)
from automaton.units import number, percent

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

Fragment = tuple[str, str]  # text, style
Line = list[Fragment]
Cells = list[tuple[str, ...]]  # of a table, by column, starting with the heading

DEFAULT_WIDTH: Final = 100  # columns, for files and pipes
MIN_WIDTH: Final = 20  # columns; assumed if a terminal reports fewer
MIN_ATTACHED_LEVEL: Final = 3  # headings from this level on have no blank line after them
MIN_CELL_WIDTH: Final = 12  # least columns of a cell that wraps
GAPS: Final = (2, 1)  # blanks between columns: normal, and if space is short
ABSENT: Final = ("", "-")  # empty cells
NO_BREAK: Final = "\xa0"  # replaces blanks at which text does not wrap
HELD_SIGN: Final = "\0%"  # replaces " %" while text wraps, to keep it with its number
HEAD_STYLE: Final = "bold underline"
SGR: Final = {"bold": "1", "underline": "4", "reverse": "7"}  # terminal codes
COLOURS: Final = {"red": "31", "green": "32", "yellow": "33", "cyan": "36"}
SIGNS = "\\|*_`<["  # special characters of Markdown
HTML_SIGNS = "\\<["  # characters escaped in titles, which contain names
BLOCK_SIGN = re.compile(
    r"\s*(?=[-+>#=~])|\s*\d+(?=[.)]\s)"
)  # begins a list, a title or a quotation
CURVE_MARKS: Final = "ox+*#%@&"
INTERVAL_MARK: Final = ":"
ZERO_MARK: Final = ":"  # in a list of intervals
INTERVAL_DASH: Final = "-"  # likewise
CHART_HEIGHT: Final = 14
MIN_CHART_WIDTH, WIDEST_CHART = 9, 60  # columns
SHADES: Final = ".:-=+*%@"  # from low to high
PART_MARKS: Final = "█▓▒"  # of neighbouring parts of a bar
WALL_MARK, EMPTY_MARK = " ", "·"


# On a terminal, or as plain text.


def print_document(document: ReportDocument, stream: TextIO | None = None) -> None:
    """Print to stdout or to a stream, in the width of the terminal; emphasis only on a terminal."""
    print_blocks(document.blocks, stream)


def print_blocks(blocks: Sequence[Block], stream: TextIO | None = None) -> None:
    """Print a part of a document."""
    out = stream or sys.stdout
    is_styled = out.isatty() and os.environ.get("TERM", "") not in ("", "dumb")
    for line in document_lines(blocks, terminal_width(), is_styled):
        out.write((styled(line) if is_styled else plain(line)) + "\n")


def terminal_width() -> int:
    """The number of columns of the terminal; DEFAULT_WIDTH in a pipe, unless COLUMNS is set."""
    return max(MIN_WIDTH, shutil.get_terminal_size((DEFAULT_WIDTH, 24)).columns)


def as_text(document: ReportDocument, width: int = DEFAULT_WIDTH) -> str:
    """The document without emphasis, for a file or a pipe."""
    return "".join(f"{plain(line)}\n" for line in document_lines(document.blocks, width, False))


def plain(line: Line) -> str:
    """A line without its styles."""
    return "".join(text for text, _ in line).rstrip()


def styled(line: Line) -> str:
    """A line with the terminal codes of its styles."""
    parts = []
    for text, style in line:
        codes = ";".join(filter(None, map(sgr, style.split())))
        parts.append(f"\x1b[{codes}m{text}\x1b[0m" if codes and text else text)
    return "".join(parts).rstrip()


def sgr(word: str) -> str:
    """The terminal code of a word of a style; "" for a colour if NO_COLOR is set."""
    if word in SGR:
        return SGR[word]
    if os.environ.get("NO_COLOR"):
        return ""
    if word in COLOURS:
        return COLOURS[word]
    red, green, blue = (int(word[at : at + 2], 16) for at in (1, 3, 5))
    if os.environ.get("COLORTERM", "") in ("truecolor", "24bit"):
        return f"38;2;{red};{green};{blue}"
    cube = [round(one / 51) for one in (red, green, blue)]
    return f"38;5;{16 + 36 * cube[0] + 6 * cube[1] + cube[2]}"


# Blocks as lines.


def document_lines(blocks: Sequence[Block], width: int, is_styled: bool) -> Iterator[Line]:
    """The lines of all blocks, with blank lines between blocks that do not belong together."""
    before: Block | None = None
    for block in blocks:
        lines = list(block_lines(block, width, is_styled))
        if lines:
            yield from [] if before is None or is_attached(before, block) else [[]]
            yield from lines
            before = block


def is_attached(before: Block, block: Block) -> bool:
    """Whether a block follows the one before without a blank line."""
    if isinstance(before, Heading):
        return before.level >= MIN_ATTACHED_LEVEL
    if not isinstance(block, Listed) or block.mark.strip():
        return False
    return block.mark == INDENT or (isinstance(before, Listed) and not before.mark.strip())


def block_lines(block: Block, width: int, is_styled: bool) -> Iterator[Line]:
    """The lines of one block."""
    if isinstance(block, Heading):
        yield from heading_lines(block, width, is_styled)
    elif isinstance(block, Text):
        lines = block.text.splitlines() if block.code else wrapped(block.text, width)
        yield from ([(line, "bold" if block.strong else "")] for line in lines)
    elif isinstance(block, Listed):
        for item in block.items:
            rest = " " * len(block.mark) + ("" if block.mark.strip() else INDENT)
            lines = wrapped(item, width, block.mark, rest)
            yield from ([(line, "bold" if block.strong else "")] for line in lines)
    elif isinstance(block, SvgDrawing):
        yield from ([(line, "")] for line in wrapped(block.caption, width))
    elif isinstance(block, CharacterPicture):
        yield from ([*row] for row in block.rows)
    elif isinstance(block, Table):
        yield from table_lines(block, width, is_styled)
    elif isinstance(block, ShareBars):
        yield from share_lines(block, width) if is_styled else ()
    elif isinstance(block, Curves | HeatMap):
        drawn = chart(block, width) if isinstance(block, Curves) else shaded(block, width)
        yield from ([(line, "")] for line in drawn)
    elif isinstance(block, Panels) and block.has_intervals:
        yield [(block.title, "")]
        for curves in block.charts:
            yield from ([(line, "")] for line in interval_lines(curves, width))
    elif isinstance(block, Folded):
        yield from ([(line, "")] for line in wrapped(f"{block.title}:", width))
        yield []
        yield from document_lines(block.blocks, width, is_styled)


def heading_lines(heading: Heading, width: int, is_styled: bool) -> Iterator[Line]:
    """A title; without emphasis, higher levels are underlined by a rule."""
    lines = wrapped(heading.text, width)
    yield from ([(line, HEAD_STYLE if heading.level == 1 else "bold")] for line in lines)
    if not is_styled and heading.level < MIN_ATTACHED_LEVEL:
        yield [(("=" if heading.level == 1 else "-") * max(map(len, lines)), "")]


def wrapped(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Text wrapped only at blanks, so that paths and option names stay whole.

    `first` precedes the first line, `rest` all others.
    """
    lines = textwrap.wrap(
        text.replace(" %", HELD_SIGN),
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(HELD_SIGN, " %") for line in lines] or [""]


# Tables.


class TableLayout(NamedTuple):
    """The columns of a table that are printed side by side, and their widths."""

    columns: list[int]
    widths: list[int]
    gap: int

    @property
    def total(self) -> int:
        """The width in terminal columns."""
        return sum(self.widths) + self.gap * (len(self.widths) - 1)


def table_lines(table: Table, width: int, is_styled: bool = False) -> Iterator[Line]:
    """A table in columns; without emphasis, a rule follows the headings. Without headings: indented."""
    has_head = any(table.head)
    margin: Line = [] if has_head else [(INDENT, "")]
    for place, layout in enumerate(layouts(table, width if has_head else width - len(INDENT))):
        yield from [[]] if place else []
        if has_head:
            yield from group_line(table, layout)
            yield from head_lines(table, layout, HEAD_STYLE if is_styled else "")
            if not is_styled:
                yield [((" " * layout.gap).join("-" * one for one in layout.widths), "")]
        for row in table.rows:
            yield from ([*margin, *line] for line in row_lines(table, row, layout))


def layouts(table: Table, width: int) -> list[TableLayout]:
    """The layouts of the parts of a table; one if the table can be made to fit."""
    every = list(range(len(table.head)))
    cells = [column[1:] for column in table.columns]
    speaking = [at for at in every if any(one not in ABSENT for one in cells[at])] or every
    for columns in (every, speaking):
        for gap in GAPS:
            layout = layout_of(table, columns, gap)
            if layout.total <= width:
                return [layout]
    for gap in GAPS:
        layout = narrowed(table, layout_of(table, speaking, gap), width)
        if layout.total <= width:
            return [layout]
    return divided(table, speaking, width)


def layout_of(table: Table, columns: list[int], gap: int) -> TableLayout:
    """A layout in which nothing wraps and the names of groups fit above their columns."""
    widths = [cells_width(table.columns[at]) for at in columns]
    for name, group in groups_of(table, columns):
        places = [columns.index(at) for at in group]
        room = sum(widths[place] for place in places) + gap * (len(places) - 1)
        widths[places[-1]] += max(0, len(name) - room)
    return TableLayout(columns, widths, gap)


def divided(table: Table, columns: list[int], width: int) -> list[TableLayout]:
    """The parts of a table that is too wide, each with the key columns; groups are not split."""
    keys = [at for at in columns if at < table.keys]
    keys = columns[:1] if keys == columns else keys
    parts: list[TableLayout] = []
    for _, group in groups_of(table, [at for at in columns if at not in keys]):
        before = parts[-1].columns if parts else keys
        layout = narrowed(table, layout_of(table, [*before, *group], GAPS[1]), width)
        if parts and layout.total <= width:
            parts[-1] = layout
        else:
            alone = layout_of(table, [*keys, *group], GAPS[1])
            parts.append(narrowed(table, alone, width))
    return parts or [narrowed(table, layout_of(table, keys, GAPS[1]), width)]


def groups_of(table: Table, columns: list[int]) -> list[tuple[str, list[int]]]:
    """The names of groups with their printed columns; without groups, each column alone."""
    if not table.groups:
        return [("", [at]) for at in columns]
    first, groups = table.keys, []
    for name, size in table.groups:
        groups.append((name, [at for at in columns if first <= at < first + size]))
        first += size
    return [one for one in groups if one[1]]


def narrowed(table: Table, layout: TableLayout, width: int) -> TableLayout:
    """Narrow a layout as far as needed: wrap first headings, then text cells, then all cells."""
    widths = list(layout.widths)
    cells = [table.columns[at] for at in layout.columns]
    words = [max(map(longest_word, column)) for column in cells]
    bodies = [max(word, cells_width(column[1:])) for word, column in zip(words, cells, strict=True)]
    shrink(widths, bodies, layout.total - width)
    for is_left in (True, False):
        least = [
            max(word, min(MIN_CELL_WIDTH, now)) if table.is_left(at) is is_left else now
            for at, word, now in zip(layout.columns, words, widths, strict=True)
        ]
        shrink(widths, least, layout._replace(widths=widths).total - width)
    return layout._replace(widths=widths)


def shrink(widths: list[int], least: Sequence[int], excess: int) -> None:
    """Narrow the widest columns step by step by a total of `excess`. Modifies `widths`."""
    for _ in range(excess):
        able = [at for at, width in enumerate(widths) if width > least[at]]
        if able:
            widths[max(able, key=widths.__getitem__)] -= 1


def group_line(table: Table, layout: TableLayout) -> Iterator[Line]:
    """The names of groups above the headings of their columns."""
    text = ""
    for name, group in groups_of(table, layout.columns) if table.groups else ():
        place = layout.columns.index(group[0])
        text = text.ljust(sum(layout.widths[:place]) + layout.gap * place) + name
    if text:
        yield [(text, "bold")]


def head_lines(table: Table, layout: TableLayout, style: str) -> Iterator[Line]:
    """The headings of columns, aligned at the bottom."""
    texts = texts_of(table.head, layout)
    height = max(map(len, texts))
    yield from side_by_side(
        table,
        layout,
        [[""] * (height - len(lines)) + lines for lines in texts],
        [style] * len(texts),
    )


def row_lines(table: Table, row: Sequence[str], layout: TableLayout) -> Iterator[Line]:
    """The cells of a row, in as many lines as the longest cell needs."""
    if row:
        cells = (row[at] for at in layout.columns)
        styles = [cell.style if isinstance(cell, StyledText) else "" for cell in cells]
        yield from side_by_side(table, layout, texts_of(row, layout), styles)
    else:
        yield []


def texts_of(row: Sequence[str], layout: TableLayout) -> list[list[str]]:
    """The lines of each printed cell."""
    places = zip(layout.columns, layout.widths, strict=True)
    return [cell_lines(row[at], width) for at, width in places]


def side_by_side(
    table: Table, layout: TableLayout, texts: list[list[str]], styles: Sequence[str]
) -> Iterator[Line]:
    """The lines of cells side by side."""
    for parts in zip_longest(*texts, fillvalue=""):
        line: Line = []
        for at, width, text, style in zip(
            layout.columns, layout.widths, parts, styles, strict=True
        ):
            blanks = " " * (width - cell_width(text))
            padded = text + blanks if table.is_left(at) else blanks + text
            line += [(" " * layout.gap if line else "", ""), (padded, style)]
        yield line


def cell_lines(cell: str, width: int) -> list[str]:
    """The lines of a cell, not wider than `width` unless a word is longer."""
    lines = []
    for part in cell.split("\n"):
        lines += [part] if cell_width(part) <= width else wrapped(part, width)
    return lines


def cells_width(column: Sequence[str]) -> int:
    """The width of a column in which nothing wraps."""
    return max((cell_width(line) for cell in column for line in cell.split("\n")), default=0)


def cell_width(text: str) -> int:
    """The width of a text in terminal columns; East Asian characters take two."""
    if text.isascii():
        return len(text)
    wide = sum(unicodedata.east_asian_width(sign) in "WF" for sign in text)
    return len(text) + wide - sum(unicodedata.combining(sign) > 0 for sign in text)


def longest_word(text: str) -> int:
    """The width of the longest word in a text; " %" belongs to the word before it."""
    return max(map(cell_width, text.replace(" %", HELD_SIGN).split()), default=0)


# Bars, curves and maps of floors in characters.


def share_lines(block: ShareBars, width: int) -> Iterator[Line]:
    """Bars of coloured parts, each beside or below its name, and the legend."""
    marks = {name: PART_MARKS[at % len(PART_MARKS)] for at, name in enumerate(block.legend)}
    margin = max(len(name) + 2 if name else 0 for name, _ in block.bars)
    margin = margin if margin <= width // 2 else 0
    columns = min(width - margin, WIDEST_CHART)
    yield from () if block.is_named else ([(block.title, "bold")],)
    for name, parts in block.bars:
        yield from ([(line, "")] for line in wrapped(name, width) if name and not margin)
        drawn: Line = [(name.ljust(margin), "")]
        share_before, begin = 0.0, 0
        for part, share, colour in parts:
            share_before += share
            end = round(share_before * columns)
            drawn.append((marks[part] * (end - begin), colour))
            begin = end
        yield drawn if margin else drawn[1:]
    legend: list[Line] = [[]]
    for name, (colour, of_it) in block.legend.items():
        text = f" {name}" if of_it is None else f" {name} {percent(of_it, 0)}"
        used = sum(len(part) for part, _ in legend[-1])
        if used and used + len(text) + 3 > width:
            legend.append([])
        legend[-1] += [("  " if legend[-1] else "", ""), (marks[name], colour), (text, "")]
    yield from legend


def chart(
    curves: Curves, columns: int = DEFAULT_WIDTH, height: int = CHART_HEIGHT
) -> Iterator[str]:
    """Curves on a grid of characters; the scale contains all intervals."""
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
    edge = len(curves.lines) - 1 if curves.x_names else 0  # columns for curves beside each other
    grid = [[" "] * width for _ in range(height)]
    for bars in (True, False):  # draws marks over bars
        for index, line in enumerate(curves.lines):
            for x, value, least, most in zip(line.x, line.value, line.low, line.high, strict=True):
                column = edge + at(x, x_scale, width - 2 * edge) + int(2 * curves.shift(index))
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
    yield f"{'':>{margin}}  {ticks(curves, x_scale, width - 2 * edge, edge)}".rstrip()
    yield f"{'':>{margin}}  {curves.x_label}"
    for index, line in enumerate(curves.lines):
        if len(curves.lines) > 1 or line.name:
            yield f"{'':>{margin}}  {CURVE_MARKS[index % len(CURVE_MARKS)]} {line.name}".rstrip()


def interval_lines(curves: Curves, columns: int) -> Iterator[str]:
    """The value of each curve at its only x, with its interval, as a line; all on one scale."""
    low, high = ends = curves.span
    margin = max(len(line.name) for line in curves.lines)
    width = max(MIN_CHART_WIDTH, min(WIDEST_CHART, columns - margin - 4))
    yield f"{curves.title} ({curves.y_label})"
    for line in curves.lines:
        cells = [" "] * width
        cells[at(0.0, ends, width)] = ZERO_MARK
        least, most = line.low[0], line.high[0]
        if math.isfinite(least) and math.isfinite(most):
            first, last = at(least, ends, width), at(most, ends, width)
            cells[first : last + 1] = INTERVAL_DASH * (last + 1 - first)
        if math.isfinite(line.value[0]):
            cells[at(line.value[0], ends, width)] = CURVE_MARKS[0]
        yield f"  {line.name:>{margin}} {''.join(cells)}".rstrip()
    left, right = number(low), number(high)
    yield f"  {'':>{margin}} {left}{right:>{width - len(left)}}"


def put(row: list[str], column: int, index: int) -> None:
    """Put the mark of a curve into a row, beside the marks of others if a cell is free."""
    room = range(column, min(len(row), column + len(CURVE_MARKS)))
    free = next((one for one in room if row[one] in (" ", INTERVAL_MARK)), column)
    row[free] = CURVE_MARKS[index % len(CURVE_MARKS)]


def at(value: float, ends: tuple[float, float], cells: int) -> int:
    """The cell of a value on a scale with these ends."""
    low, high = ends
    return min(cells - 1, max(0, round((value - low) / (high - low) * (cells - 1))))


def ticks(curves: Curves, ends: tuple[float, float], width: int, edge: int = 0) -> str:
    """The x values or names below their columns, which begin at `edge`, as far as they fit."""
    line = [" "] * (width + 2 * edge + 12)
    free = 0
    for x in curves.x:
        text = curves.x_names[int(x)] if curves.x_names else number(x)
        start = max(0, edge + at(x, ends, width) - len(text) // 2)
        if start + len(text) > len(line):
            start = max(0, len(line) - len(text))
        if start >= free:
            line[start : start + len(text)] = text
            free = start + len(text) + 1
    return "".join(line).rstrip()


def shaded(heat: HeatMap, width: int) -> Iterator[str]:
    """A floor in shades; large floors by means of blocks of cells."""
    import numpy as np  # slow to import, and most documents have no maps

    rows, columns = heat.field.shape
    margin = len(number(rows * heat.side)) + 2
    block = max(1, math.ceil(columns / max(1, width - margin)))
    field, step = coarse(heat.field, block), block * heat.side
    known = field[np.isfinite(field)]
    most = float(known.max(initial=0))
    yield from wrapped(f"{heat.title} (most: {number(most)} {heat.unit})", width)
    scale = "".join(f"{number(x * step):<10}" for x in range(0, field.shape[1], 10))
    yield f"{'':{margin}}{scale}{heat.axis}"
    for y, row in enumerate(field):
        label = "" if y % 5 else number(y * step)
        yield f"{label:>{margin - 1}} {''.join(shade(value, most) for value in row)}".rstrip()
    steps = most / len(SHADES)
    scale_text = ", ".join(
        f"{sign}{NO_BREAK}up{NO_BREAK}to{NO_BREAK}{number((index + 1) * steps)}"
        for index, sign in enumerate(SHADES)
    )
    scale_text = f"{EMPTY_MARK}{NO_BREAK}none, {scale_text}" if most else "all values are 0"
    yield from (line.replace(NO_BREAK, " ") for line in wrapped(scale_text, width))
    if heat.note:
        yield from wrapped(heat.note, width)


def shade(value: float, most: float) -> str:
    """The character of one cell."""
    if not math.isfinite(value):
        return WALL_MARK
    if value <= 0 or most <= 0:
        return EMPTY_MARK
    return SHADES[min(len(SHADES) - 1, math.ceil(value / most * len(SHADES)) - 1)]


def coarse(field: npt.NDArray[np.float64], block: int) -> npt.NDArray[np.float64]:
    """Means of blocks of cells without walls; NaN for blocks of walls only."""
    if block == 1:
        return field
    import numpy as np

    high, wide = (math.ceil(size / block) for size in field.shape)
    padded = np.full((high * block, wide * block), np.nan)
    padded[: field.shape[0], : field.shape[1]] = field
    cells = padded.reshape(high, block, wide, block).swapaxes(1, 2).reshape(high, wide, -1)
    known = np.isfinite(cells)
    sums, numbers = np.where(known, cells, 0).sum(axis=2), known.sum(axis=2)
    means: npt.NDArray[np.float64] = np.where(numbers > 0, sums / np.maximum(numbers, 1), np.nan)
    return means


# Markdown.


def as_markdown(document: ReportDocument) -> str:
    """The document as Markdown; charts are preformatted text."""
    lines: list[str] = []
    for block in document.blocks:
        # as SVG alone
        is_drawn = isinstance(block, ShareBars) or (
            isinstance(block, Panels) and not block.has_intervals
        )
        if not isinstance(block, PageBreak) and not is_drawn and not has_no_line(block):
            lines += [*markdown_lines(block), ""]
    return "\n".join(lines).rstrip() + "\n"


def markdown_lines(block: Block) -> Iterator[str]:
    """The Markdown lines of one block."""
    if isinstance(block, Heading):
        yield f"{'#' * block.level} {escaped(block.text, HTML_SIGNS)}"
    elif isinstance(block, Text) and not block.code:
        yield f"**{escaped(block.text)}**" if block.strong else paragraph(block.text)
    elif isinstance(block, SvgDrawing):
        yield paragraph(block.caption)
    elif isinstance(block, Folded):
        from html import escape  # slow to import: it reads a table of 2,231 names

        yield f"<details><summary>{escape(block.title)}</summary>"
        for inner in block.blocks:
            yield ""
            yield from markdown_lines(inner)
        yield from ("", "</details>")
    elif has_no_line(block):
        return
    elif isinstance(block, Listed):
        *first, last = map(paragraph, block.items)
        if block.mark:
            yield from (f"- {item}" for item in (*first, last))
        else:
            yield from (*(f"{item}\\" for item in first), last)  # line breaks
    elif isinstance(block, Table):
        yield from markdown_table(block)
    else:
        yield from fenced([plain(line) for line in block_lines(block, DEFAULT_WIDTH, False)])


def markdown_table(table: Table) -> Iterator[str]:
    """A Markdown table."""

    def line(cells: Sequence[str]) -> str:
        return f"| {' | '.join(escaped(cell).replace(chr(10), '<br>') for cell in cells)} |"

    yield line(table.flat_head)
    rules = ["---" if table.is_left(index) else "---:" for index in range(len(table.head))]
    yield f"|{'|'.join(rules)}|"
    yield from (line(row) for row in table.rows if row)


def escaped(text: str, signs: str = SIGNS) -> str:
    """Text with the special characters of Markdown escaped."""
    for sign in signs:
        text = text.replace(sign, f"\\{sign}")
    return text


def paragraph(text: str) -> str:
    """Text as a paragraph, which must not begin like another block."""
    plain_text = escaped(text)
    begin = BLOCK_SIGN.match(plain_text)
    return plain_text if begin is None else f"{begin[0]}\\{plain_text[begin.end() :]}"


def fenced(lines: Sequence[str]) -> Iterator[str]:
    """Preformatted lines in a fence that is longer than any fence within."""
    fence = "```"
    while any(fence in line for line in lines):
        fence += "`"
    yield from (fence, *lines, fence)
