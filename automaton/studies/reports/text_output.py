"""A report as terminal text and as Markdown."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from automaton.studies.reports.report_document import (
    Block,
    Curves,
    Document,
    Heading,
    HeatMap,
    Listed,
    Table,
    Text,
)
from automaton.studies.reports.text_charts import chart, shaded

GAP = "  "


def as_text(document: Document, width: int = 100) -> str:
    """For a terminal."""
    lines: list[str] = []
    for block in document.blocks:
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


def table_lines(table: Table) -> Iterator[str]:
    """A table in columns, a rule below its head."""
    widths = [max(map(len, column)) for column in zip(table.head, *table.rows, strict=True)]

    def line(cells: Sequence[str]) -> str:
        padded = (
            cell.ljust(width) if index < table.left else cell.rjust(width)
            for index, (cell, width) in enumerate(zip(cells, widths, strict=True))
        )
        return GAP.join(padded).rstrip()

    yield line(table.head)
    yield GAP.join("-" * width for width in widths)
    yield from map(line, table.rows)


def as_markdown(document: Document) -> str:
    """For a repository or an editor; charts are text, kept as they are."""
    lines: list[str] = []
    for block in document.blocks:
        lines += [*markdown_lines(block), ""]
    return "\n".join(lines).rstrip() + "\n"


def markdown_lines(block: Block) -> Iterator[str]:
    """One block."""
    if isinstance(block, Heading):
        yield f"{'#' * block.level} {block.text}"
    elif isinstance(block, Text) and not block.code:
        yield escaped(block.text)
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
    rules = ["---" if index < table.left else "---:" for index in range(len(table.head))]
    yield f"|{'|'.join(rules)}|"
    yield from map(line, table.rows)


def escaped(text: str) -> str:
    """Text in which Markdown finds no signs of its own."""
    for sign in "\\|*_`<":
        text = text.replace(sign, f"\\{sign}")
    return text


def fenced(lines: Iterator[str]) -> Iterator[str]:
    """Lines kept as they are; the fence is longer than any within."""
    kept = list(lines)
    fence = "```"
    while any(fence in line for line in kept):
        fence += "`"
    yield from (fence, *kept, fence)
