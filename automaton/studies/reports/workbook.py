"""A report as a workbook of Excel, by openpyxl (extra `excel`).

answer       the first page, in the units of the reader
summary      a line for each point and metric, in the units of the runs
tables       the tables of the report, in the units of the reader
comparisons  a line for each declared comparison, in the units of the runs
rows         a line for each run
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from automaton.atomic_write import atomic_writer
from automaton.printable import one_line
from automaton.runs.report_document import (
    Block,
    Document,
    Folded,
    Heading,
    Listed,
    NumberText,
    PageBreak,
    Table,
    Text,
)
from automaton.studies.reports.export import cell_value, columns_for_sheets, rows_table
from automaton.studies.sweeps.result_columns import SERIES
from automaton.tables.table_files import MAX_SHEET_ROWS, openpyxl, sheet_cell, too_many_in_sheet

WORKBOOK_BEGINS: Final = b"PK"
MAX_TEXT: Final = 32_000  # characters; a cell of Excel holds few more
WIDEST_COLUMN: Final = 40  # characters
Records = Sequence[Mapping[str, Any]]


def write_workbook(
    document: Document, summaries: Records, compared: Records, rows: Any, path: Path
) -> None:
    """Write a report and the table of its rows. Raises InputError, also without openpyxl."""
    book = openpyxl("workbooks are written").Workbook(write_only=True)
    if len(rows) >= MAX_SHEET_ROWS:
        raise too_many_in_sheet("rows", len(rows))
    end = next((i for i, b in enumerate(document.blocks) if isinstance(b, PageBreak)), 0)
    columns = columns_for_sheets(rows_table(rows))
    columns.pop(SERIES, None)  # a list by window, longer than a cell may be
    fill_sheet(book, "answer", (line for b in document.blocks[:end] for line in block_lines(b)))
    fill_sheet(book, "summary", record_lines(summaries), has_head=True)
    fill_sheet(book, "tables", (line for b in document.blocks[end:] for line in table_lines_of(b)))
    fill_sheet(book, "comparisons", record_lines(compared), has_head=True)
    lines = [list(columns), *zip(*columns.values(), strict=True)]
    fill_sheet(book, "rows", lines, has_head=True)
    with atomic_writer(path) as file:
        book.save(file)


def fill_sheet(
    book: Any, name: str, lines: Iterable[Sequence[Any]], has_head: bool = False
) -> None:
    """Add a sheet whose columns are as wide as their heads and numbers.

    `has_head`: the first line is the head of all others; it stays where it is when they scroll.
    """
    sheet, rows = book.create_sheet(name), [list(line) for line in lines]
    if has_head:
        sheet.freeze_panes = "A2"
    decimals = []
    for column in range(max(map(len, rows), default=0)):
        cells = [row[column] for row in rows if len(row) > max(1, column)]  # texts may run over
        decimals.append(decimals_of(cells))
        shown = (text_of(cell, decimals[-1]) for cell in cells if cell is not None)
        widest = max(map(len, shown), default=8)
        letter = _letter(column)
        sheet.column_dimensions[letter].width = min(WIDEST_COLUMN, widest + 2)
    for row in rows:
        sheet.append([_cell(sheet, value, decimals[at]) for at, value in enumerate(row)])


def decimals_of(column: Sequence[Any]) -> int:
    """Decimals with which the largest number of a column has four digits."""
    sizes = (abs(one) for one in column if isinstance(one, float) and math.isfinite(one))
    largest = max(sizes, default=0.0)
    return 0 if largest >= 1000 or not largest else min(8, 3 - math.floor(math.log10(largest)))


def text_of(value: Any, decimals: int) -> str:
    """A cell as the sheet shows it."""
    return f"{value:,.{decimals}f}" if isinstance(value, float) else str(value)


def number_format(value: Any, decimals: int) -> str:
    """The format of a cell of numbers, as Excel writes it; "" of any other."""
    if isinstance(value, NumberText):  # as the report prints it
        mantissa, exponent, _ = value.partition("e")
        if exponent:
            return "0.000E+00"
        decimals = len(mantissa.rstrip(" %").partition(".")[2])
    elif isinstance(value, bool) or not isinstance(value, int | float):
        return ""
    elif isinstance(value, int):
        decimals = 0
    return "#,##0." + "0" * decimals if decimals else "#,##0"


def _cell(sheet: Any, value: Any, decimals: int) -> Any:
    """A value as a cell, a number with its format."""
    form = number_format(value, decimals)
    if not form:
        return sheet_cell(sheet, _value(value))
    from openpyxl.cell import WriteOnlyCell

    cell = WriteOnlyCell(sheet, _value(value))
    cell.number_format = form
    return cell


def _letter(column: int) -> str:
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(column + 1))


def _value(value: Any) -> Any:
    """A number as such; a text without what no cell can hold."""
    if isinstance(value, NumberText):
        return value.value
    return one_line(value, MAX_TEXT) if isinstance(value, str) else value


def record_lines(records: Records) -> Iterable[Sequence[Any]]:
    """A head, then the records."""
    if not records:
        return [["none"]]
    names = list(records[0])
    return [names, *([cell_value(name, record[name]) for name in names] for record in records)]


def block_lines(block: Block) -> list[Sequence[Any]]:
    """The lines of a sheet for a block; there are no drawings, whose numbers are in `summary`."""
    if isinstance(block, Heading):
        return [[], [block.text]]
    if isinstance(block, Text):
        return [[line] for line in block.text.splitlines()]
    if isinstance(block, Listed):
        return [[item] for item in block.items]
    if isinstance(block, Table):
        return [[], block.head, *([_plain(cell) for cell in row] for row in block.rows), []]
    if isinstance(block, Folded):
        return [[block.title], *(line for one in block.blocks for line in block_lines(one))]
    return []


def table_lines_of(block: Block) -> list[Sequence[Any]]:
    """The lines of a block in the sheet of tables: headings, notes and tables, no files."""
    is_file = isinstance(block, Folded) or (isinstance(block, Text) and block.code)
    return [] if is_file else block_lines(block)


def _plain(cell: str) -> Any:
    """A whole number of a table as a number, such as that of robots or of runs."""
    digits = cell.replace(",", "")
    return int(digits) if digits.isascii() and digits.isdigit() and "." not in cell else cell
