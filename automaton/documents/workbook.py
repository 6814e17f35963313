"""Workbooks of Excel, by openpyxl (extra `excel`): a document as a sheet, and cells with formats."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from automaton.atomic_write import atomic_writer
from automaton.documents.report_document import (
    Block,
    CharacterPicture,
    Folded,
    Heading,
    Listed,
    NumberText,
    ReportDocument,
    Table,
    Text,
)
from automaton.errors import InputError
from automaton.printable import one_line

WORKBOOK_BEGINS: Final = b"PK"
MAX_CELL_TEXT: Final = 32_000  # characters; a cell of Excel holds few more
WIDEST_COLUMN: Final = 40  # characters


def openpyxl(what: str) -> Any:
    """The module openpyxl. Raises InputError where it is not installed."""
    try:
        import openpyxl
    except ImportError as error:
        raise InputError(
            f"{what} with openpyxl, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[excel]'"
        ) from None
    return openpyxl


def sheet_cell(sheet: Any, value: Any) -> Any:
    """A value as a cell: a text that begins as formulas do is not one."""
    if not isinstance(value, str) or not value.startswith("="):
        return value
    from openpyxl.cell import WriteOnlyCell

    cell = WriteOnlyCell(sheet, value)
    cell.data_type = "s"
    return cell


def check_replaced(path: Path, begins: bytes = WORKBOOK_BEGINS) -> None:
    """Raises InputError for a file that is not a table of ours: a scenario, say, is not replaced."""
    try:
        with path.open("rb") as file:
            start = file.read(len(begins))
    except OSError:
        return  # there is no such file, or it cannot be written either
    if start and start != begins:
        raise InputError("is not a table of results, so it is not replaced by one", str(path))


def write_sheet(document: ReportDocument, path: Path) -> None:
    """Write a document as a workbook of one sheet. Raises InputError, also without openpyxl."""
    book = openpyxl("workbooks are written").Workbook(write_only=True)
    fill_sheet(book, "report", (line for block in document.blocks for line in sheet_lines(block)))
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
    return one_line(value, MAX_CELL_TEXT) if isinstance(value, str) else value


def sheet_lines(block: Block) -> list[Sequence[Any]]:
    """The lines of a sheet for a block; drawings have none."""
    if isinstance(block, Heading):
        return [[], [block.text]]
    if isinstance(block, Text | CharacterPicture):
        return [[line] for line in block.text.splitlines()]
    if isinstance(block, Listed):
        return [[item] for item in block.items]
    if isinstance(block, Table):
        return [[], block.flat_head, *([_plain(cell) for cell in row] for row in block.rows), []]
    if isinstance(block, Folded):
        return [[block.title], *(line for one in block.blocks for line in sheet_lines(one))]
    return []


def _plain(cell: str) -> Any:
    """A whole number of a table as a number, such as that of robots or of runs."""
    digits = cell.replace(",", "")
    return int(digits) if digits.isascii() and digits.isdigit() and "." not in cell else cell
