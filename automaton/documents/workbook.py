"""Excel workbooks, by openpyxl (extra `excel`): documents as sheets, and cells with formats."""

from __future__ import annotations

import math
import re
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
    SvgDrawing,
    Table,
    Text,
)
from automaton.errors import InputError
from automaton.printable import one_line

WHOLE_TEXT: Final = re.compile(r"0|[1-9]\d{0,14}|[1-9]\d{0,2}(,\d{3}){1,4}")
PERCENT_CELL: Final = re.compile(r"[+-]?\d[\d,]*(\.\d+)? %")
WORKBOOK_BEGINS: Final = b"PK"
MAX_CELL_TEXT: Final = 32_000  # characters; Excel's limit is 32,767
WIDEST_COLUMN: Final = 40  # characters


def openpyxl(what: str) -> Any:
    """The module openpyxl. Raises InputError if it is not installed."""
    try:
        import openpyxl
    except ImportError as error:
        raise InputError(
            f"{what} with openpyxl, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[excel]'"
        ) from None
    return openpyxl


def sheet_cell(sheet: Any, value: Any) -> Any:
    """A value as a cell; text that looks like a formula stays text."""
    if not isinstance(value, str) or not value.startswith("="):
        return value
    from openpyxl.cell import WriteOnlyCell

    cell = WriteOnlyCell(sheet, value)
    cell.data_type = "s"
    return cell


def check_replaced(path: Path, begins: bytes = WORKBOOK_BEGINS) -> None:
    """Raise InputError if a file is not a table of results, so that it is not overwritten."""
    try:
        with path.open("rb") as file:
            start = file.read(len(begins))
    except OSError:
        return  # the file does not exist, or the write will fail as well
    if start and start != begins:
        raise InputError("is not a table of results, so it is not overwritten", str(path))


def write_sheet(document: ReportDocument, path: Path) -> None:
    """Write a document as a workbook with one sheet. Raises InputError, also without openpyxl."""
    book = openpyxl("workbooks are written").Workbook(write_only=True)
    fill_sheet(book, "report", (line for block in document.blocks for line in sheet_lines(block)))
    with atomic_writer(path) as file:
        book.save(file)


def fill_sheet(
    book: Any, name: str, lines: Iterable[Sequence[Any]], has_head: bool = False
) -> None:
    """Add a sheet with columns as wide as their headings and numbers.

    `has_head`: the first line is a header, which does not scroll.
    """
    sheet, rows = book.create_sheet(name), [list(line) for line in lines]
    if has_head:
        sheet.freeze_panes = "A2"
        columns = max(map(len, rows), default=1)
        sheet.auto_filter.ref = f"A1:{_letter(columns - 1)}{max(1, len(rows))}"
    decimals = []
    for column in range(max(map(len, rows), default=0)):
        cells = [
            row[column] for row in rows if len(row) > max(1, column)
        ]  # lone texts may overflow
        decimals.append(decimals_of(cells))
        shown = (text_of(cell, decimals[-1]) for cell in cells if cell is not None)
        widest = max(map(len, shown), default=8)
        letter = _letter(column)
        sheet.column_dimensions[letter].width = min(WIDEST_COLUMN, widest + 2)
    for row in rows:
        sheet.append([_cell(sheet, value, decimals[at]) for at, value in enumerate(row)])


def decimals_of(column: Sequence[Any]) -> int:
    """The number of decimals that gives the largest number of a column four digits."""
    sizes = (abs(one) for one in column if isinstance(one, float) and math.isfinite(one))
    largest = max(sizes, default=0.0)
    return 0 if largest >= 1000 or not largest else min(8, 3 - math.floor(math.log10(largest)))


def text_of(value: Any, decimals: int) -> str:
    """The text of a cell in the sheet."""
    return f"{value:,.{decimals}f}" if isinstance(value, float) else str(value)


def number_format(value: Any, decimals: int) -> str:
    """The Excel format of a number; "" for other values."""
    if isinstance(value, NumberText):  # as printed in the report
        mantissa, exponent, _ = value.partition("e")
        if exponent:
            return "0.000E+00"
        decimals = len(mantissa.rstrip(" %").partition(".")[2])
        if mantissa.endswith("%"):
            return f"0.{'0' * decimals} %" if decimals else "0 %"
    elif isinstance(value, bool) or not isinstance(value, int | float):
        return ""
    elif isinstance(value, int):
        decimals = 0
    return "#,##0." + "0" * decimals if decimals else "#,##0"


def _cell(sheet: Any, value: Any, decimals: int) -> Any:
    """A value as a cell, with a format if it is a number."""
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
    """A number, or a text without characters that cells cannot hold."""
    if isinstance(value, NumberText):
        return value.value
    return one_line(value, MAX_CELL_TEXT) if isinstance(value, str) else value


def sheet_lines(block: Block) -> list[Sequence[Any]]:
    """The lines of a block in a sheet; none for drawings."""
    if isinstance(block, Heading):
        return [[], [block.text]]
    if isinstance(block, Text | CharacterPicture):
        return [[line] for line in block.text.splitlines()]
    if isinstance(block, Listed):
        return [[item] for item in block.items]
    if isinstance(block, SvgDrawing):
        return [[block.caption]]
    if isinstance(block, Table):
        return [[], block.flat_head, *([_plain(cell) for cell in row] for row in block.rows), []]
    if isinstance(block, Folded):
        return [[block.title], *(line for one in block.blocks for line in sheet_lines(one))]
    return []


def _plain(cell: str) -> Any:
    """A cell as a number if it is one: with all its digits, a percentage, or a whole one."""
    if isinstance(cell, NumberText):
        return cell
    if PERCENT_CELL.fullmatch(cell):
        return NumberText(cell, float(cell.removesuffix(" %").replace(",", "")) / 100)
    is_whole = WHOLE_TEXT.fullmatch(cell) is not None  # 007 is a name
    return int(cell.replace(",", "")) if is_whole else cell
