"""Reports on a console: lines as they are, and tables without frames."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from automaton.runs.report_document import Table

ConsoleBlock = str | Text | Table  # a line, plain or in colours; "" leaves one out


class Reports(Console):
    """A console that lets it be known that nobody reads any more; rich would exit with code 1."""

    def on_broken_pipe(self) -> None:
        """The command line knows what to do."""
        raise BrokenPipeError


def console(stream: Any = None) -> Console:
    """Where reports go: no markup, no guessing at what to colour; 80 columns in a pipe."""
    return Reports(file=stream or sys.stdout, highlight=False, markup=False, emoji=False)


def print_blocks(out: Console, blocks: Iterable[ConsoleBlock]) -> None:
    """Print lines, not folded, and tables, without the blanks that rich puts at the ends of lines."""
    for block in blocks:
        if not isinstance(block, Table):
            out.print(block, soft_wrap=True)
            continue
        with out.capture() as captured:
            out.print(rich_table(block))
        for line in captured.get().splitlines():
            out.file.write(line.rstrip() + "\n")


def rich_table(table: Table) -> RichTable:
    """A table as rich lays it out."""
    found = RichTable(
        box=None, pad_edge=False, padding=(0, table.gap, 0, 0), header_style="bold underline"
    )
    for column, head in enumerate(table.head):
        if table.folded and column == len(table.head) - 1:
            found.add_column(head, overflow="fold")
        else:
            justify: Any = "left" if table.is_left(column) else "right"
            found.add_column(head, justify=justify, no_wrap=True)
    for row in table.rows:
        found.add_row(*row)
    return found
