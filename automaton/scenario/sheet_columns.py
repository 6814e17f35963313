"""Read a sheet of a workbook (.xlsx) as columns, as `csv_columns` reads a CSV file.

Cells of type date become texts of ISO 8601, numbers and times of the day texts as they would be typed.
Values of formulas are those that the program that wrote the file has left in it; openpyxl (extra
`excel`) computes none.
"""

from __future__ import annotations

import datetime
import lzma
import zipfile
import zlib
from array import array
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final

import numpy as np

from automaton.errors import InputError, nearest
from automaton.scenario.csv_columns import (
    MAX_FILE_BYTES,
    MAX_ROWS,
    Choice,
    CsvColumns,
    TextCodes,
    stripped,
)
from automaton.scenario.row_errors import RowErrors
from automaton.units import count

SUFFIXES: Final = (".xlsx", ".xlsm")
MAX_UNPACKED_BYTES: Final = 4_000_000_000  # read piece by piece, but for
MAX_TEXT_BYTES: Final = 256_000_000  # the different texts of all cells, which stay in memory
TEXTS: Final = "xl/sharedStrings.xml"
SHEETS: Final = "xl/worksheets/"  # the folder of sheets in a workbook
FORMULA: Final = b"<f"  # what each formula in a sheet begins with
READ_BYTES: Final = 1 << 20

Row = Sequence[Any]
Pair = tuple[Row, Row]  # values, and formulas or values


def is_workbook(path: Path) -> bool:
    """Whether the name of a file says that it is a workbook."""
    return path.suffix.lower() in SUFFIXES


def read_sheet_columns(
    path: Path, sheet: str | None, time: str | None, choose: Choice, errors: RowErrors
) -> CsvColumns:
    """Read some columns of a sheet; rows without a value are left out.

    `sheet`: its name, None for the only one; `time`: the format of times, which dates get, too.
    `choose`: as of `read_csv_columns`. Later errors of rows name the sheet. Raises InputError for a file
    that is not a workbook, and for a formula in these columns whose value is not there.
    """
    has_formulas = _has_formulas(path)
    with closing(_Book(path, sheet, is_computed=True)) as book:
        errors.file = book.place
        if not has_formulas:
            pairs: Iterator[Pair] = ((row, ()) for row in book.rows())
            return _read(pairs, book.place, time, choose)
        with closing(_Book(path, sheet, is_computed=False)) as written:
            pairs = zip(book.rows(), written.rows(), strict=False)
            return _read(pairs, book.place, time, choose)


DAMAGE: Final = (  # what the parts of an archive raise
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError),
    *(EOFError, NotImplementedError, RuntimeError),
)


def _has_formulas(path: Path) -> bool:
    """Whether a workbook has formulas. Raises InputError for what is not a workbook, or too large."""
    file = str(path)
    try:
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            limit = MAX_FILE_BYTES // 1_000_000
            raise InputError(f"has {size / 1e6:,.1f} MB, at most {limit} MB are possible", file)
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            texts = sum(member.file_size for member in members if member.filename == TEXTS)
            unpacked = sum(member.file_size for member in members)
            if texts > MAX_TEXT_BYTES or unpacked > MAX_UNPACKED_BYTES:
                what = f"{unpacked // 1_000_000:,} MB, {texts // 1_000_000:,} MB of them texts"
                raise InputError(f"is too large to be read: {what}; save the sheet as CSV", file)
            sheets = [member for member in members if member.filename.startswith(SHEETS)]
            return any(_has_formula(archive, sheet) for sheet in sheets)
    except DAMAGE as error:
        raise InputError(f"is not a workbook (.xlsx): {error}", file) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read: {reason}", file) from None


def _has_formula(archive: zipfile.ZipFile, sheet: zipfile.ZipInfo) -> bool:
    """Whether there is one in a sheet; `<f` also begins the names of rarer things."""
    last = b""
    with archive.open(sheet) as stream:
        while block := stream.read(READ_BYTES):
            if any(FORMULA + end in last + block for end in (b">", b" ", b"/")):
                return True
            last = block[-2:]
    return False


class _Book:
    """A workbook that is read row by row, and the sheet of it that is wanted."""

    def __init__(self, path: Path, sheet: str | None, is_computed: bool) -> None:
        try:
            import openpyxl
        except ImportError as error:
            raise InputError(
                f"workbooks are read with openpyxl, which cannot be imported ({error}): "
                "pip install 'fleet-automaton[excel]', or save the sheet as CSV",
                str(path),
            ) from None
        try:
            self._book = openpyxl.load_workbook(path, read_only=True, data_only=is_computed)
        except Exception as error:  # openpyxl raises whatever the parts of a broken file lead to
            raise _broken(str(path), error) from None
        names = [one.title for one in self._book.worksheets]
        try:
            name = _chosen(names, sheet, str(path))
        except InputError:
            self.close()
            raise
        self.place = f"{path}!{name}"
        self._sheet = self._book[name]

    def rows(self) -> Iterator[Row]:
        """The values of each row, the first one first, up to its last cell."""
        self._sheet.reset_dimensions()  # what a file says of them may be wrong
        try:
            yield from self._sheet.iter_rows(values_only=True)
        except InputError:
            raise
        except Exception as error:
            raise _broken(self.place, error) from None

    def close(self) -> None:
        """Close the file."""
        self._book.close()


def _broken(place: str, error: Exception) -> InputError:
    what = " ".join(str(error).split())[:100]
    return InputError(f"the workbook cannot be read: {what or type(error).__name__}", place)


def _chosen(names: Sequence[str], sheet: str | None, file: str) -> str:
    sheets = f"the sheets are {', '.join(names)}"
    if sheet is None:
        if len(names) != 1:
            raise InputError(f"has {count(len(names), 'sheet')}; set sheet: {sheets}", file)
        return names[0]
    if sheet not in names:
        raise InputError(f"there is no sheet '{sheet}'{nearest(sheet, names)}; {sheets}", file)
    return sheet


def _letters(column: int) -> str:
    """The name of a column: A, B, ..., Z, AA."""
    text = ""
    while column >= 0:
        column, letter = divmod(column, 26)
        text, column = chr(ord("A") + letter) + text, column - 1
    return text


def _read(pairs: Iterator[Pair], place: str, time: str | None, choose: Choice) -> CsvColumns:
    """Read rows of values, each beside its formulas, if there are any in the file."""
    numbered = (
        (number, row, formulas)
        for number, (row, formulas) in enumerate(pairs, 1)
        if any(value not in (None, "") for value in (*row, *formulas))
    )
    first = next(numbered, None)
    if first is None:
        raise InputError("is empty; its first row must name the columns", place)
    line, cells, _ = first
    head = [_text(value, None).strip() for value in cells]
    chosen = choose(head, line)
    places = {name: head.index(column) for name, column in chosen.items()}
    codes = {name: TextCodes() for name in chosen}
    numbers = {name: array("i") for name in chosen}
    lines = array("i")
    for number, row, formulas in numbered:
        if len(lines) == MAX_ROWS:
            raise InputError(f"has more than {MAX_ROWS:,} rows", place, number)
        lines.append(number)
        for name, at in places.items():
            value = row[at] if at < len(row) else None
            if value is None and at < len(formulas) and formulas[at] is not None:
                raise _no_value(f"{place}!{_letters(at)}{number}")
            numbers[name].append(codes[name][_text(value, time)])
    return CsvColumns(
        tuple(head),
        np.array(lines, np.int32),
        {name: stripped(list(codes[name]), np.array(numbers[name], np.int32)) for name in chosen},
    )


def _no_value(cell: str) -> InputError:
    return InputError(
        "is a formula whose value is not in the file; open the file in the program that made it, and "
        "save it again",
        cell,
    )


def _text(value: Any, time: str | None) -> str:
    """The value of a cell as the text that would stand in a CSV file."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if isinstance(value, datetime.datetime):
        return _date_text(value, time)
    if isinstance(value, datetime.timedelta):
        return f"{value / datetime.timedelta(seconds=1):g} s"
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)


def _date_text(moment: datetime.datetime, time: str | None) -> str:
    """A date by a format, if it loses nothing by that; else of ISO 8601."""
    if time is not None:
        text = moment.strftime(time)
        if datetime.datetime.strptime(text, time) == moment:
            return text
    return moment.isoformat(" ")
