"""Read a CSV file as columns in which equal texts are stored once.

Spreadsheets and warehouse systems write `;`, tabs or `,`, quotes around values, line ends within
quotes and a byte order mark. A file of a million rows has few different texts in most of its columns:
a column is the list of these texts and, for each row, which of them stands there.
"""

from __future__ import annotations

import csv
import itertools
import os
import re
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.scenario.row_errors import RowErrors
from automaton.units import count

Array = NDArray[np.int32]
Choice = Callable[[Sequence[str], int], Mapping[str, str]]

SEPARATORS: Final = (";", "\t", ",")  # the first that occurs in the head
MAX_FILE_BYTES: Final = 512_000_000
MAX_ROWS: Final = 1_000_000
ROWS_AT_A_TIME: Final = 10_000  # as texts of their own
ENCODINGS: Final = {"utf-8": "utf-8-sig", "cp1252": "cp1252"}
UTF8_MARK: Final = b"\xef\xbb\xbf"
_QUOTED: Final = re.compile(r'"[^"]*"')
_SEPARATOR_LINE: Final = re.compile(r"sep=(.)\r?\n?")


class TextColumn(NamedTuple):
    """A column of texts."""

    texts: list[str]  # the different ones, without blanks at their ends
    codes: Array  # (n,) which of them stands in each row


class CsvColumns(NamedTuple):
    """The columns of a file that were asked for."""

    head: tuple[str, ...]  # the names of all columns
    lines: Array  # (n,) where each row begins, from 1
    columns: dict[str, TextColumn]  # by the names that were chosen
    # Its numbers may have them, as values stand between semicolons.
    has_decimal_commas: bool = False


def read_csv_columns(path: Path, encoding: str, choose: Choice, errors: RowErrors) -> CsvColumns:
    """Read some columns of a CSV file; rows without a value are left out.

    `choose`: from the names in the head and its line, the column of each name that the caller wants;
    it raises InputError. Rows with too many or too few values are added to `errors`. Raises InputError
    for a file that is not CSV text in this encoding.
    """
    _check_file(path, encoding)
    try:
        with path.open(encoding=ENCODINGS[encoding], newline="") as stream:
            return _read(iter(stream), str(path), choose, errors)
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
        raise InputError(f"begins with the mark of UTF-8: leave out encoding: {encoding}", file)


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
    """Texts with their numbers, in order of their first occurrence."""

    def __missing__(self, text: str) -> int:
        code = self[text] = len(self)
        return code


def _read(stream: Iterator[str], file: str, choose: Choice, errors: RowErrors) -> CsvColumns:
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
    """How many lines come before the head, the separator, and the first line of the head."""
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
    """Each row that holds a value, with the line of the file at which it begins."""
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
        return "a quote begins in this row and does not end"
    if "expected after" in error:
        return "a quoted value goes on behind its quote; a quote within one is written twice"
    return f"is not CSV: {error}"


def _chunks(
    rows: Iterator[tuple[int, list[str]]], width: int, lines: array[int], errors: RowErrors
) -> Iterator[list[list[str]]]:
    """Rows as long as the head, many at a time; the line of each is added to `lines`."""
    chunk: list[list[str]] = []
    for line, row in rows:
        if len(row) != width:
            errors.add("width", [line], partial(_width_sentence, len(row), width))
            continue
        if len(lines) == MAX_ROWS:
            raise InputError(f"has more than {MAX_ROWS:,} rows", errors.file, line)
        lines.append(line)
        chunk.append(row)
        if len(chunk) == ROWS_AT_A_TIME:
            yield chunk
            chunk = []
    if chunk:
        yield chunk


def _width_sentence(values: int, width: int) -> str:
    return f"the row has {count(values, 'value')}, the head names {count(width, 'column')}"


def _as_array(numbers: array[int]) -> Array:
    return np.frombuffer(numbers, np.int32) if numbers else np.zeros(0, np.int32)


def stripped(texts: list[str], codes: Array) -> TextColumn:
    """A column without blanks at the ends of its texts, of which some may be the same then."""
    again = TextCodes()
    renumbered = np.array([again[text.strip()] for text in texts], np.int32)
    return TextColumn(list(again), codes if len(again) == len(texts) else renumbered[codes])
