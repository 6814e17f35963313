"""Read a CSV file, or a sheet of a workbook (.xlsx), as columns in which equal texts are stored once.

Spreadsheets and warehouse systems write `;`, tabs or `,`, quotes around values, line ends within quotes
and a byte order mark. Most columns of a file of a million rows hold few different texts. So a column is
stored as the list of these texts and, for each row, an index into it.

In a sheet, dates become ISO 8601 texts; numbers and times of day become texts as a user would type them.
Formulas have the values that the writing program stored in the file; openpyxl (extra `excel`) computes
none.
"""

from __future__ import annotations

import csv
import datetime
import itertools
import lzma
import os
import re
import zipfile
import zlib
from array import array
from collections.abc import Callable, Container, Hashable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError, InputErrors, nearest
from automaton.units import count

MAX_KINDS: Final = 5  # of mistakes in an error message
MAX_NAMED_LINES: Final = 10  # of further rows with the same mistake

Array = NDArray[np.int32]
Choice = Callable[[Sequence[str], int], Mapping[str, str]]
SEPARATORS: Final = (";", "\t", ",")  # the first of these in the header wins
MAX_FILE_BYTES: Final = 512_000_000
MAX_TABLE_ROWS: Final = 1_000_000
ROWS_AT_A_TIME: Final = 10_000  # rows held as separate texts
ENCODINGS: Final = {"utf-8": "utf-8-sig", "cp1252": "cp1252"}
UTF8_MARK: Final = b"\xef\xbb\xbf"
_QUOTED: Final = re.compile(r'"[^"]*"')
_SEPARATOR_LINE: Final = re.compile(r"sep=(.)\r?\n?")
WORKBOOK_SUFFIXES: Final = (".xlsx", ".xlsm")
MAX_UNPACKED_BYTES: Final = 4_000_000_000  # read in pieces, except
MAX_TEXT_BYTES: Final = 256_000_000  # the texts of all cells, which stay in memory
SHARED_TEXTS: Final = "xl/sharedStrings.xml"
SHEETS: Final = "xl/worksheets/"  # the folder of sheets in a workbook
FORMULA: Final = b"<f"  # begins each formula in a sheet
READ_BYTES: Final = 1 << 20
Row = Sequence[Any]
Pair = tuple[Row, Row]  # values, and formulas or values
DAMAGE: Final = (  # raised by damaged archives
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError),
    *(EOFError, NotImplementedError, RuntimeError),
)


class TextColumn(NamedTuple):
    """A column of texts."""

    texts: list[str]  # each different text once, stripped
    codes: Array  # (n,) index of the text of each row


class CsvColumns(NamedTuple):
    """The requested columns of a file."""

    head: tuple[str, ...]  # the names of all columns
    lines: Array  # (n,) where each row begins, from 1
    columns: dict[str, TextColumn]  # by the names that were chosen
    # Numbers may have decimal commas: semicolons separate the values.
    has_decimal_commas: bool = False


def read_csv_columns(path: Path, encoding: str, choose: Choice, errors: RowErrors) -> CsvColumns:
    """Read some columns of a CSV file; rows without any value are skipped.

    `choose(header, line)` returns the column of each field that the caller needs; it may raise
    InputError. Rows with too many or too few values are added to `errors`. Raises InputError for a file
    that is not CSV text in this encoding.
    """
    _check_file(path, encoding)
    try:
        with path.open(encoding=ENCODINGS[encoding], newline="") as stream:
            return _read_csv(iter(stream), str(path), choose, errors)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read: {reason}", str(path)) from None
    except UnicodeDecodeError:
        raise _decoding_error(path, encoding) from None


def _check_file(path: Path, encoding: str) -> None:
    file = str(path)
    if not os.path.isfile(path):
        raise InputError("is not a regular file" if os.path.exists(path) else "no such file", file)
    size = path.stat().st_size
    if size > MAX_FILE_BYTES:
        limit = MAX_FILE_BYTES // 1_000_000
        raise InputError(f"has {size / 1e6:,.1f} MB, at most {limit} MB are possible", file)
    with path.open("rb") as stream:
        start = stream.read(4096)
    if start.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise InputError("is a spreadsheet or an archive; save the sheet as CSV, or as .xlsx", file)
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("is UTF-16 text; save it as UTF-8", file)
    if b"\0" in start:
        raise InputError("is not a text file (it holds zero bytes)", file)
    if encoding != "utf-8" and start.startswith(UTF8_MARK):
        raise InputError(
            f"begins with a UTF-8 byte order mark: leave out encoding: {encoding}", file
        )


def _decoding_error(path: Path, encoding: str) -> InputError:
    with path.open("rb") as stream:
        for line, content in enumerate(stream, 1):
            try:
                content.decode(encoding)
            except UnicodeDecodeError as error:
                text = f"is not {encoding} text (byte {content[error.start]:#04x})"
                if encoding == "utf-8":
                    text += "; if it comes from Excel on Windows, set encoding: cp1252"
                return InputError(text, str(path), line)
    return InputError(f"is not {encoding} text", str(path))


class TextCodes(dict[str, int]):
    """Numbers texts in order of their first occurrence."""

    def __missing__(self, text: str) -> int:
        code = self[text] = len(self)
        return code


def _read_csv(stream: Iterator[str], file: str, choose: Choice, errors: RowErrors) -> CsvColumns:
    skipped, separator, first = _begin(stream, file)
    reader = csv.reader(itertools.chain([first], stream), delimiter=separator, strict=True)
    rows = _rows(reader, skipped, file)
    line, head = next(rows)
    head = [name.strip() for name in head]
    chosen = choose(head, line)
    codes = {name: TextCodes() for name in chosen}
    numbers = {name: array("i") for name in chosen}
    lines = array("i")
    for chunk in _chunks(rows, len(head), lines, errors):
        columns = list(zip(*chunk, strict=True))
        for name, column in chosen.items():
            numbers[name].extend(map(codes[name].__getitem__, columns[head.index(column)]))
    return CsvColumns(
        tuple(head),
        _as_array(lines),
        {name: stripped(list(codes[name]), _as_array(numbers[name])) for name in chosen},
        separator == ";",
    )


def _begin(stream: Iterator[str], file: str) -> tuple[int, str, str]:
    """The number of lines before the header, the separator, and the first line of the header."""
    separator = ""
    for skipped, line in enumerate(stream):
        if match := _SEPARATOR_LINE.fullmatch(line):  # as Excel reads and writes it
            separator = match[1]
        elif line.strip():
            plain = _QUOTED.sub("", line)
            default = next((sign for sign in SEPARATORS if sign in plain), ",")
            return skipped, separator or default, line
    raise InputError("is empty; its first line must name the columns", file)


def _rows(reader: Any, skipped: int, file: str) -> Iterator[tuple[int, list[str]]]:
    """Each row that holds a value, with its first line in the file."""
    line = skipped + 1
    try:
        for row in reader:
            if any(row):
                yield line, row
            line = skipped + reader.line_num + 1
    except csv.Error as error:
        raise InputError(_what_is_wrong(str(error)), file, line) from None


def _what_is_wrong(error: str) -> str:
    if "unexpected end" in error or "field larger" in error:
        return "a quoted value begins in this row and is not closed"
    if "expected after" in error:
        return "text follows the closing quote of a value; double quotes inside quoted values"
    return f"is not CSV: {error}"


def _chunks(
    rows: Iterator[tuple[int, list[str]]], width: int, lines: array[int], errors: RowErrors
) -> Iterator[list[list[str]]]:
    """Rows with as many values as the header, in batches; the line of each is added to `lines`."""
    chunk: list[list[str]] = []
    for line, row in rows:
        if len(row) != width:
            errors.add("width", [line], partial(_width_sentence, len(row), width))
            continue
        if len(lines) == MAX_TABLE_ROWS:
            raise InputError(f"has more than {MAX_TABLE_ROWS:,} rows", errors.file, line)
        lines.append(line)
        chunk.append(row)
        if len(chunk) == ROWS_AT_A_TIME:
            yield chunk
            chunk = []
    if chunk:
        yield chunk


def _width_sentence(values: int, width: int) -> str:
    return f"the row has {count(values, 'value')}, but the header has {count(width, 'column')}"


def _as_array(numbers: array[int]) -> Array:
    return np.frombuffer(numbers, np.int32) if numbers else np.zeros(0, np.int32)


def stripped(texts: list[str], codes: Array) -> TextColumn:
    """A column of stripped texts, of which some may become equal."""
    again = TextCodes()
    renumbered = np.array([again[text.strip()] for text in texts], np.int32)
    return TextColumn(list(again), codes if len(again) == len(texts) else renumbered[codes])


# Workbooks.


def is_workbook(path: Path) -> bool:
    """Whether the name of a file has the suffix of a workbook."""
    return path.suffix.lower() in WORKBOOK_SUFFIXES


def read_sheet_columns(
    path: Path, sheet: str | None, time: str | None, choose: Choice, errors: RowErrors
) -> CsvColumns:
    """Read some columns of a sheet; rows without any value are skipped.

    `sheet`: its name, None for the only one; `time`: the format of times, also used for dates. `choose`:
    as in `read_csv_columns`. Errors in rows name the sheet. Raises InputError for a file that is not a
    workbook, and for a formula in these columns without a stored value.
    """
    has_formulas = _has_formulas(path)
    with closing(_Book(path, sheet, is_computed=True)) as book:
        errors.file = book.place
        if not has_formulas:
            pairs: Iterator[Pair] = ((row, ()) for row in book.rows())
            return _read_sheet(pairs, book.place, time, choose)
        with closing(_Book(path, sheet, is_computed=False)) as written:
            pairs = zip(book.rows(), written.rows(), strict=False)
            return _read_sheet(pairs, book.place, time, choose)


def _has_formulas(path: Path) -> bool:
    """Whether a workbook has formulas. Raises InputError if it is not a workbook, or too large."""
    file = str(path)
    try:
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            limit = MAX_FILE_BYTES // 1_000_000
            raise InputError(f"has {size / 1e6:,.1f} MB, at most {limit} MB are possible", file)
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            texts = sum(member.file_size for member in members if member.filename == SHARED_TEXTS)
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
    """Whether a sheet has a formula; `<f` also begins the names of rarer elements."""
    last = b""
    with archive.open(sheet) as stream:
        while block := stream.read(READ_BYTES):
            if any(FORMULA + end in last + block for end in (b">", b" ", b"/")):
                return True
            last = block[-2:]
    return False


class _Book:
    """A workbook that is read row by row, and the requested sheet of it."""

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
        except Exception as error:  # openpyxl raises any exception for a broken file
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
        """The values of each row, up to its last cell."""
        self._sheet.reset_dimensions()  # the dimensions in the file may be wrong
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


def _read_sheet(pairs: Iterator[Pair], place: str, time: str | None, choose: Choice) -> CsvColumns:
    """Read rows of values, each with its formulas if the file has any."""
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
        if len(lines) == MAX_TABLE_ROWS:
            raise InputError(f"has more than {MAX_TABLE_ROWS:,} rows", place, number)
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
    """The value of a cell as the text of a CSV file."""
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
    """A date in a format if that loses nothing, else in ISO 8601."""
    if time is not None:
        text = moment.strftime(time)
        if datetime.datetime.strptime(text, time) == moment:
            return text
    return moment.isoformat(" ")


def rows_as_written(
    path: Path, encoding: str, sheet: str | None, lines: Container[int]
) -> tuple[str, list[str], list[tuple[int, list[str]]]]:
    """The separator of a file, the names of its columns, and the rows that begin in some lines."""
    if is_workbook(path):
        with closing(_Book(path, sheet, is_computed=True)) as book:
            texts = ((line, [_text(value, None) for value in row]) for line, row in numbered(book))
            _, head = next(texts)
            return ",", head, [row for row in texts if row[0] in lines]
    with path.open(encoding=ENCODINGS[encoding], newline="") as stream:
        skipped, separator, first = _begin(iter(stream), str(path))
        reader = csv.reader(itertools.chain([first], stream), delimiter=separator, strict=True)
        rows = _rows(reader, skipped, str(path))
        _, head = next(rows)
        return separator, head, [row for row in rows if row[0] in lines]


def numbered(book: _Book) -> Iterator[tuple[int, Row]]:
    """The rows of a sheet that have a value, with their numbers from 1."""
    for number, row in enumerate(book.rows(), 1):
        if any(value not in (None, "") for value in row):
            yield number, row


class QuarantinedRows(NamedTuple):
    """The rows of a file of orders that a scenario skips, and the file that gets them."""

    target: Path
    source: Path
    encoding: str  # of the source
    sheet: str | None  # of a workbook
    mistakes: Mapping[int, str]  # by the first line of a row


# Mistakes in the rows of a file.


@dataclass
class _Kind:
    """Mistakes of one kind."""

    lines: list[int]
    sentence: Callable[[], str]  # of the first


@dataclass
class RowErrors:
    """The mistakes in the rows of a file."""

    file: str
    _kinds: dict[Hashable, _Kind] = field(default_factory=dict)

    def add(self, kind: Hashable, lines: Sequence[int], sentence: Callable[[], str]) -> None:
        """Add mistakes of a kind, in the order of their lines.

        `sentence` describes the first mistake of the kind in the file, and is called for no other.
        """
        known = self._kinds.get(kind)
        if known is None:
            self._kinds[kind] = _Kind(list(lines), sentence)
            return
        if lines[0] < known.lines[0]:
            known.sentence = sentence
        known.lines = sorted([*known.lines, *lines])

    @property
    def kinds(self) -> dict[Hashable, list[int]]:
        """The lines of the mistakes of each kind, in ascending order, by the first line."""
        kinds = sorted(self._kinds.items(), key=lambda item: item[1].lines[0])
        return {kind: mistakes.lines for kind, mistakes in kinds}

    @property
    def first(self) -> InputError:
        """The first of the mistakes, of which there is one at least."""
        kind = min(self._kinds.values(), key=lambda kind: kind.lines[0])
        return InputError(kind.sentence(), self.file, kind.lines[0])

    def raise_any(self) -> None:
        """Raise InputErrors if any mistake was added."""
        if not self._kinds:
            return
        kinds = sorted(self._kinds.values(), key=lambda kind: kind.lines[0])
        errors = []
        for kind in kinds[:MAX_KINDS]:
            text = kind.sentence() + _more(kind.lines[1:])
            errors.append(InputError(text, self.file, kind.lines[0]))
        if len(kinds) > MAX_KINDS:
            text = f"there are mistakes of {count(len(kinds) - MAX_KINDS, 'more kind')}"
            errors.append(InputError(text, self.file))
        raise InputErrors(errors)


def _more(lines: Sequence[int]) -> str:
    """The other rows with the mistake: "; 3 more such rows, in lines 7, 9 and 12"."""
    if not lines:
        return ""
    if len(lines) == 1:
        return f"; 1 more such row, in line {lines[0]}"
    shown, rest = lines[:MAX_NAMED_LINES], len(lines) - MAX_NAMED_LINES
    if rest <= 0:
        shown, last = lines[:-1], str(lines[-1])
    else:
        last = f"{rest:,} more"
    where = f"{', '.join(map(str, shown))} and {last}"
    return f"; {len(lines):,} more such rows, in lines {where}"
