"""A report as one HTML file that needs nothing else: tables, curves and maps as SVG inside.

On paper it is A4: cells wrap, a table that is too wide for that has pages in landscape of its own, and
no drawing is cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Final

from automaton.runs.report_document import (
    Block,
    Curves,
    Document,
    Folded,
    Heading,
    HeatMap,
    Listed,
    PageBreak,
    Table,
    Text,
)
from automaton.studies.reports.svg_drawings import curves_svg, map_svg

WIDEST_UPRIGHT: Final = 105  # characters of a table on a page that is not turned
WIDEST_TEXT: Final = 16  # characters of a cell of text that is not wrapped
MOST_ROWS_KEPT: Final = 15  # of a table that is not divided between two pages
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
  h1, h2, h3, h4, p:has(+ .wide) { break-after: avoid }
  .wide { overflow-x: visible }
  .turned { page: turned }
  .turned table { font-size: 8pt; width: 100% }
  .turned td, .turned th { padding-right: .35rem }
  .page-end { break-after: page }
  svg { max-height: 74mm; width: auto }
  svg text { font-size: 13.5px }
  .page-end ~ .drawing svg { max-height: 104mm }
  .page-end ~ .drawing svg text { font-size: 12px }
  .drawing.map svg { max-height: 115mm }
  pre { white-space: pre-wrap; overflow-wrap: anywhere }
}
"""


def as_html(document: Document) -> str:
    """The whole page."""
    parts = "\n".join(page_parts(document.blocks))
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width">\n'
        f"<title>{escape(document.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        f"{parts}\n</body>\n</html>\n"
    )


def page_parts(blocks: Sequence[Block]) -> Iterator[str]:
    """All blocks; a table on turned pages takes its heading and the texts around it along.

    The first page is not turned.
    """
    before: list[str] = []  # from a heading on
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
    """Whether it is a table that does not fit on an upright page."""
    return isinstance(block, Table) and printed_width(block) > WIDEST_UPRIGHT


def printed_width(table: Table) -> int:
    """Characters in a line of a table whose texts wrap."""
    width = 0
    for column, cells in enumerate(zip(table.head, *table.rows, strict=True)):
        head, *body = cells
        longest = max(map(len, body), default=0)
        words = max(len(word) for word in head.split() or [""])
        width += 2 + max(words, min(longest, WIDEST_TEXT) if table.is_left(column) else longest)
    return width


def html_parts(block: Block) -> Iterator[str]:
    """One block."""
    if isinstance(block, Heading):
        yield f"<h{block.level}>{escape(block.text)}</h{block.level}>"
    elif isinstance(block, Text):
        tag = "pre" if block.code else "p"
        mark = ' class="answer"' if block.strong else ""
        yield f"<{tag}{mark}>{escape(block.text)}</{tag}>"
    elif isinstance(block, Listed):
        items = "".join(f"<li>{escape(item)}</li>" for item in block.items)
        mark = ' class="answer"' if block.strong else ""
        yield f"<div{mark}><ul>{items}</ul></div>"
    elif isinstance(block, Table):
        yield from table_parts(block)
    elif isinstance(block, Folded):
        inner = "\n".join(part for one in block.blocks for part in html_parts(one))
        yield f"<details><summary>{escape(block.title)}</summary>\n{inner}\n</details>"
    elif isinstance(block, PageBreak):
        yield '<div class="page-end"></div>'
    elif isinstance(block, Curves):
        yield f'<div class="drawing">{curves_svg(block)}</div>'
    elif isinstance(block, HeatMap):
        yield f'<div class="drawing map">{map_svg(block)}</div>'


def table_parts(table: Table) -> Iterator[str]:
    """A table that scrolls where it is too wide."""

    def line(cells: Sequence[str], tag: str) -> str:
        return "".join(
            f"<{tag}{_classes(table, index, cell)}>{escape(cell)}</{tag}>"
            for index, cell in enumerate(cells)
        )

    short = " short" if len(table.rows) <= MOST_ROWS_KEPT else ""
    yield f'<div class="wide{short}"><table>'
    yield f"<thead><tr>{line(table.head, 'th')}</tr></thead><tbody>"
    yield from (f"<tr>{line(row, 'td')}</tr>" for row in table.rows)
    yield "</tbody></table></div>"


def _classes(table: Table, column: int, cell: str) -> str:
    """Texts are aligned left and wrap if they are long; numbers stay on one line."""
    if not table.is_left(column):
        return " class=n"
    return " class=l" if len(cell) > WIDEST_TEXT else ' class="l n"'
