"""Read the tables of warehouse systems that a scenario names, as columns of numbers.

    table = read_table(path, PodColumns, pods.options, pods.columns)
    table.refuse("unknown", "class", ~is_known, lambda row: f"... is not a class of pods")
    table.errors.raise_any()
    table.values["weight"]                              # (n,) int32
    table.names["class"][table.values["class"][0]]      # the class of the first row

Errors in the rows are collected, so that the caller can add its own before raising. A row takes four
bytes per field, plus the texts that no other row has.
"""

from __future__ import annotations

import dataclasses
import glob
import math
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError, InvalidValueError, Keys, alternatives, nearest
from automaton.scenario.columns import (
    CsvColumns,
    QuarantinedRows,
    RowErrors,
    TextColumn,
    is_workbook,
    read_csv_columns,
    read_sheet_columns,
)
from automaton.scenario.document import Document
from automaton.scenario.file_times import ReadingCounts, TimeReader
from automaton.scenario.quantities import Scale
from automaton.scenario.table_fields import (
    NO_DUE,
    NOTHING,
    ColumnGroups,
    ColumnNames,
    DueField,
    Field,
    NameField,
    NumberField,
    ReleaseField,
    TableOptions,
    TextField,
    fields_of,
    is_pattern,
)
from automaton.scenario.text_files import ListFile, content_hash, quoted
from automaton.units import count, number

SELECTING: Final = "where "  # prefix for the names of columns that only select rows
PLAIN_WHOLE: Final = re.compile(r"[-+]?[0-9]{1,10}")
ZERO_FRACTION: Final = re.compile(r"(?<=[0-9])\.0+$")
THOUSANDS: Final = re.compile(r"[-+]?[0-9]{1,3}(\.[0-9]{3})+")  # thousands or decimals: ambiguous
DECIMAL_COMMA: Final = re.compile(r"([-+]?[0-9]+),([0-9]+)(?=[^0-9,.:]*$)")
DECIMAL: Final = re.compile(r"\+?[0-9]{1,10}\.[0-9]+")
ZERO_AMOUNT: Final = re.compile(r"[-+]?0+([.,]0*)?")
LONE_COMMA: Final = re.compile(r"(\+?[0-9]{1,10}),([0-9]{1,2}|[0-9]{4,})")  # a decimal one
NOT_OF_ROWS: Final = ("tick",)  # mistakes of the scenario that rows bring to light
CALLED: Final = {"from": "location", "to": "location", "sku": "SKU"}  # fields, in mistakes
MAX_SHOWN_VALUES: Final = 5  # of a column, in an error or a note
MAX_SHOWN_NAMES: Final = 8  # of known names, in an error
MAX_KEPT_ROWS: Final = 5_000_000  # of tables that were read, at some 40 bytes a row
NO_TIMES: Final = Scale("1 tick")  # for tables without times

Array = NDArray[np.int32]


@dataclass
class TableColumns:
    """The selected rows of a file."""

    path: str
    content_hash: str  # 16 hex digits
    lines: Array  # (n,) first line of each row in the file, from 1
    values: dict[str, Array]  # (n,) of each field
    names: dict[str, list[str]]  # of each TextField
    column_of: dict[str, str]  # field: its column
    errors: RowErrors
    counts: ReadingCounts
    # (n,) rows released before tick 0, and rows due before their release
    odd: dict[str, NDArray[np.bool_]] = dataclasses.field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.lines)

    def refuse(
        self, kind: str, field_name: str, rows: NDArray[np.bool_], sentence: Callable[[int], str]
    ) -> None:
        """Add a mistake to `errors` for some rows; `sentence(index)` describes a row."""
        first = int(np.argmax(rows))
        if rows[first]:
            self.errors.add((kind, field_name), self.lines[rows].tolist(), lambda: sentence(first))

    def refuse_again(
        self, field_name: str, codes: NDArray[Any], sentence: Callable[[int, int], str]
    ) -> None:
        """Refuse rows with the code of an earlier row; NOTHING may repeat.

        `sentence(index, line)` describes a row; `line`: of the first row with the code.
        """
        _, first, which = np.unique(codes, return_index=True, return_inverse=True)
        again = codes != NOTHING
        again[first] = False
        self.refuse(
            "twice", field_name, again, lambda row: sentence(row, self.lines[first[which[row]]])
        )

    def settle(self, options: TableOptions) -> dict[int, str]:
        """Raise the mistakes, or leave out the rows with mistakes if the options allow it.

        Returns the mistake of each skipped row, by line. Raises InputErrors, or InputError if too many
        rows would be skipped.
        """
        kinds = self.errors.kinds
        if options.at_most is None or any(kind[0] in NOT_OF_ROWS for kind in _pairs(kinds)):
            self.errors.raise_any()
        mistakes: dict[int, str] = {}
        for (kind, field_name), lines in zip(_pairs(kinds), kinds.values(), strict=True):
            for line in lines:
                mistakes.setdefault(line, self._mistake(kind, field_name))
        self.counts.skipped = dict(Counter(mistakes.values()).most_common())
        self.counts.selected = len(self) + len(set(mistakes) - set(self.lines.tolist()))
        if mistakes:
            self._check_share(len(mistakes), options)
            keeps = ~np.isin(self.lines, list(mistakes))
            self.lines = self.lines[keeps]
            self.values = {name: values[keeps] for name, values in self.values.items()}
            self.odd = {name: rows[keeps] for name, rows in self.odd.items()}
        return mistakes

    def _mistake(self, kind: str, field_name: str) -> str:
        """A mistake in a few words, such as "unknown pod" or "QUANTITY 0"."""
        if kind == "width":
            return "wrong number of values"
        column = self.column_of.get(field_name, field_name)
        forms = {
            "unknown": f"unknown {CALLED.get(field_name, field_name)}",
            "empty": f"{column} empty",
            "zero": f"{column} 0",
        }
        return forms.get(kind, f"{column} unreadable")

    def _check_share(self, skipped: int, options: TableOptions) -> None:
        """At most the declared share of the rows is skipped, and not all of them. Raises InputError."""
        rows, first = self.counts.selected, self.errors.first
        assert options.at_most is not None, "checked: rows may be skipped"
        said = f"{skipped:,} of {count(rows, 'row')} would be skipped ({_percent(skipped / rows)}"
        if skipped > options.at_most * rows:
            text = f"{said}, but at_most is {_percent(options.at_most)}); first: {first.message}"
            raise InputError(text, first.file, first.line)
        if skipped == rows:
            raise InputError(f"{said}); first: {first.message}", first.file, first.line)


def _pairs(kinds: Iterable[Hashable]) -> list[tuple[str, str]]:
    """Kinds of mistakes as (kind, field); the field is "" for those of whole rows."""
    return [kind if isinstance(kind, tuple) else (str(kind), "") for kind in kinds]


def _percent(share: float) -> str:
    return f"{number(100 * share)} %"


class ReadFile(NamedTuple):
    """A file that was read for a scenario, with its notes for `check`."""

    path: str  # from the root
    content_hash: str  # 16 hex digits
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    rows: int = 0  # selected ones, skipped ones included
    skipped: Mapping[str, int] = {}  # rows by the mistake in them
    quarantine: QuarantinedRows | None = None  # where `check` writes the skipped rows

    @property
    def without_rows(self) -> str:
        """Such as "shift.csv: 3 of 5,000 rows skipped: 2 unknown pod, 1 UNITS 0"; "" if none was."""
        said = skipped_in_words(self.skipped, self.rows)
        return f"{os.path.basename(self.path)}: {said}" if self.skipped else ""


def skipped_in_words(skipped: Mapping[str, int], rows: int) -> str:
    """How many rows were skipped, by the mistake in them."""
    why = ", ".join(f"{many:,} {mistake}" for mistake, many in skipped.items())
    return f"{sum(skipped.values()):,} of {count(rows, 'row')} skipped: {why}"


def named_file(document: Document, keys: Keys, rows: str, name: str) -> Path:
    """The file that a scenario names at `keys`; `rows`: the name of its rows. Raises InputError."""
    path = document.folder / name
    if not os.path.isfile(path):
        raise InvalidValueError(keys, f"there is no file of {rows} '{name}'")
    return path


def matching_files(document: Document, keys: Keys, rows: str, name: str) -> tuple[Path, ...]:
    """The files that a name at `keys` matches, sorted; a name without wildcards is that of one file.

    Raises InputError if no file matches.
    """
    if os.path.isfile(document.folder / name) or not is_pattern(name):
        return (named_file(document, keys, rows, name),)
    names = sorted(glob.glob(name, root_dir=document.folder))
    paths = tuple(path for path in map(document.folder.joinpath, names) if os.path.isfile(path))
    if not paths:
        raise InvalidValueError(keys, f"no file of {rows} matches '{name}'")
    return paths


def with_rows(document: Document, keys: Keys, file: str, lines: Any, **sections: Any) -> Document:
    """The document with a file for the list or mapping at `keys`; errors there name lines of the file.

    `sections`: replacements.
    """
    listed = (*document.listed, ListFile(keys, file, lines))
    return replace(document, data={**document.data, **sections}, listed=listed)


def read_table(
    path: Path,
    kind: type[ColumnNames],
    options: TableOptions,
    named: ColumnNames | None = None,
    scale: Scale = NO_TIMES,
    known: Mapping[str, Mapping[str, int]] = MappingProxyType({}),
) -> TableColumns:
    """Read a file that holds a kind of table.

    `named`: the names of its columns; None: the names of the fields. `known`: the names for each
    NameField that the scenario defines. Raises InputError for a file that cannot be read as a table.
    """
    called = None if named is None else named.of_fields
    how = (kind.__name__, options, called, scale, {name: dict(one) for name, one in known.items()})

    def read() -> TableColumns:
        fields = fields_of(kind, known)
        return read_columns(path, fields, options, called, scale, kind.needed, kind.may_rename)

    return _KEPT.table(path, repr(how), read)


class KeptTables:
    """Tables without mistakes that this process has read: a study resolves many variants of a scenario.

    The content of a file decides whether it is read again, not its time.
    """

    def __init__(self) -> None:
        self.tables: dict[tuple[str, str], TableColumns] = {}

    def table(self, path: Path, how: str, read: Callable[[], TableColumns]) -> TableColumns:
        """The table of a file that was read in this way before; otherwise the one that `read` returns."""
        content = content_hash(path)
        key = str(path), f"{content} {how}"
        table = self.tables.get(key)
        if table is None:
            table = read()
            if not content or table.errors.kinds:
                return table
            self.tables[key] = table
            while sum(map(len, self.tables.values())) > MAX_KEPT_ROWS:
                del self.tables[next(iter(self.tables))]
        return replace(  # a copy: callers change it
            table,
            values=dict(table.values),
            errors=RowErrors(table.path),
            counts=replace(table.counts),
        )


_KEPT: Final = KeptTables()


def read_columns(
    path: Path,
    fields: Sequence[Field],
    options: TableOptions,
    columns: Mapping[str, str] | None,
    scale: Scale,
    needed: Sequence[ColumnGroups] = (),
    may_rename: bool = True,
) -> TableColumns:
    """Read the fields of a file; fields without a column have their defaults in all rows.

    `columns`: field -> column, or None if columns have the names of fields. `needed`: for each entry,
    all fields of one of its groups must have columns, in addition to required fields; a group may be
    empty. `may_rename`: whether the scenario has a key that names the columns. Raises InputError for a
    file that cannot be read as a table; mistakes in its rows are in `errors` of the result.
    """
    errors = RowErrors(str(path))
    chooser = _Chooser(fields, columns, options.where, needed, str(path), may_rename)
    if is_workbook(path):
        table = read_sheet_columns(path, options.sheet, options.time, chooser, errors)
    else:
        table = read_csv_columns(path, options.encoding, chooser, errors)
    counts = ReadingCounts(rows=len(table.lines), ignored=chooser.ignored)
    table = _selected(table, options.where, counts, str(path))
    result = TableColumns(
        path=str(path),
        content_hash=content_hash(path),
        lines=table.lines,
        values={},
        names={},
        column_of=chooser.column_of,
        errors=errors,
        counts=counts,
    )
    _Reader(table, options, scale, result).read(fields)
    return result


class _Chooser:
    """Finds the columns of fields in the header of a file."""

    def __init__(
        self,
        fields: Sequence[Field],
        columns: Mapping[str, str] | None,
        where: Mapping[str, object],
        needed: Sequence[ColumnGroups],
        file: str,
        may_rename: bool,
    ) -> None:
        self.names = [field.name for field in fields]
        of_groups = {name for one in needed for group in one for name in group}
        self.required = [
            field.name for field in fields if _needs_column(field) and field.name not in of_groups
        ]
        self.columns, self.where, self.needed, self.file = columns, where, needed, file
        self.may_rename = may_rename  # whether the scenario can name the columns
        self.column_of: dict[str, str] = {}
        self.ignored: tuple[str, ...] = ()

    def __call__(self, head: Sequence[str], line: int) -> dict[str, str]:
        """Return the column of each field that has one, and the columns that select rows."""
        if self.columns is None:
            self.column_of = {name: name for name in self.names if name in head}
        else:
            self.column_of = dict(self.columns)
        selecting = {SELECTING + name: name for name in self.where}
        chosen = self.column_of | selecting
        for column in chosen.values():
            if column not in head:
                columns = f"the columns are {', '.join(filter(None, head))}"
                text = f"there is no column '{column}'{nearest(column, head)}; {columns}"
                raise InputError(text, self.file, line)
            if head.count(column) > 1:
                raise InputError(f"the column {column} appears twice", self.file, line)
        self._check_needed(head, line)
        self.ignored = tuple(name for name in head if name and name not in chosen.values())
        return chosen

    def _check_needed(self, head: Sequence[str], line: int) -> None:
        groups = [[[name]] for name in self.required] + [
            list(map(list, one)) for one in self.needed
        ]
        for group in groups:
            if any(all(name in self.column_of for name in names) for names in group):
                continue
            wanted = alternatives(" and ".join(names) for names in group)
            others = [column for column in head if column not in self.column_of.values()]
            missing = [name for names in group for name in names if name not in self.column_of]
            like = next((hint for hint in (nearest(name, others) for name in missing) if hint), "")
            columns = f"the columns are {', '.join(filter(None, head))}"
            renames = self.columns is None and self.may_rename
            hint = "; set columns: {...} to name them" if renames else ""
            text = f"there is no column for {wanted}{like}; {columns}{hint}"
            raise InputError(text, self.file, line)


def with_decimal_point(text: str) -> str:
    """The text with a point instead of the decimal comma of a number or an amount ("1,5 min")."""
    return DECIMAL_COMMA.sub(r"\1.\2", text, count=1) if DECIMAL_COMMA.match(text) else text


def _instead(text: str, known: Collection[str]) -> str:
    """A hint: the most similar name or, if none is similar, all names if they are few."""
    like = nearest(text, known)
    return (
        like if like or not 0 < len(known) <= MAX_SHOWN_NAMES else f"; there are {', '.join(known)}"
    )


def _needs_column(field: Field) -> bool:
    return isinstance(field, ReleaseField) or getattr(field, "is_required", False)


def _selected(
    table: CsvColumns, where: Mapping[str, object], counts: ReadingCounts, file: str
) -> CsvColumns:
    """The rows with one of the given values in each column of `where`. Raises InputError."""
    if not len(table.lines):
        raise InputError("has no rows below its header", file)
    chosen = np.ones(len(table.lines), np.bool_)
    for name, values in where.items():
        texts, codes = table.columns[SELECTING + name]
        wanted = {str(one) for one in (values if isinstance(values, list | tuple) else [values])}
        keeps = np.array([text in wanted for text in texts])
        for code in np.flatnonzero(~keeps):
            rows = int(np.count_nonzero(chosen & (codes == code)))
            if rows:
                counts.left_out[f"{name} {texts[code] or 'empty'}"] = rows
        chosen &= keeps[codes]
        if not keeps.any():
            held = ", ".join(quoted(text) for text in texts[:MAX_SHOWN_VALUES])
            more = (
                f" and {len(texts) - MAX_SHOWN_VALUES:,} more"
                if len(texts) > MAX_SHOWN_VALUES
                else ""
            )
            said = alternatives(sorted(wanted))
            raise InputError(f"no row has {name} {said}; the values are {held}{more}", file)
    if chosen.all():
        return table
    if not chosen.any():
        raise InputError("no row matches all columns of where", file)
    columns = {
        name: TextColumn(one.texts, one.codes[chosen]) for name, one in table.columns.items()
    }
    return table._replace(lines=table.lines[chosen], columns=columns)


class _Reader:
    """Reads the columns of a table into numbers."""

    def __init__(
        self, table: CsvColumns, options: TableOptions, scale: Scale, result: TableColumns
    ) -> None:
        self.table, self.options, self.scale, self.result = table, options, scale, result

    def read(self, fields: Sequence[Field]) -> None:
        """Fill values, names and counts of the result."""
        values = self.result.values
        for field in fields:
            if isinstance(field, TextField):
                values[field.name] = self._texts(field)
            elif isinstance(field, NameField):
                values[field.name] = self._names(field)
            elif isinstance(field, NumberField):
                values[field.name] = self._numbers(field)
        releases = [field for field in fields if isinstance(field, ReleaseField)]
        dues = [field for field in fields if isinstance(field, DueField)]
        if releases:
            self._times(releases[0], dues[0] if dues else None)

    def _column(self, name: str) -> TextColumn | None:
        return self.table.columns.get(name)

    def _amounts(self, name: str) -> TextColumn | None:
        """A column of numbers and times, with decimal commas replaced by points."""
        column = self._column(name)
        if column is None or not self.table.has_decimal_commas:
            return column
        return TextColumn([with_decimal_point(text) for text in column.texts], column.codes)

    def _refuse(
        self, name: str, kind: str, is_bad: NDArray[np.bool_], sentence: Callable[[str], str]
    ) -> None:
        """Add a mistake for the rows with bad texts; `is_bad`: by different text."""
        if not is_bad.any():
            return
        texts, codes = self.table.columns[name]
        column = self.result.column_of[name]

        def of_row(row: int) -> str:
            return f"{column} {sentence(texts[codes[row]])}"

        self.result.refuse(kind, name, is_bad[codes], of_row)

    def _texts(self, field: TextField) -> Array:
        column = self._column(field.name)
        if column is None:
            self.result.names[field.name] = []
            return np.full(len(self.table.lines), NOTHING, np.int32)
        is_used = np.bincount(column.codes, minlength=len(column.texts)) > 0
        is_empty = np.array([not text for text in column.texts])
        if field.is_required:
            self._refuse(field.name, "empty", is_empty, lambda text: "is empty")
        is_used &= ~is_empty
        renumbered = np.where(is_used, np.cumsum(is_used) - 1, NOTHING).astype(np.int32)
        texts = [text for text, used in zip(column.texts, is_used.tolist(), strict=True) if used]
        self.result.names[field.name] = texts
        codes: Array = renumbered[column.codes]
        return codes

    def _names(self, field: NameField) -> Array:
        column = self._column(field.name)
        if column is None:
            return np.full(len(self.table.lines), NOTHING, np.int32)
        numbers = np.array([field.known.get(text, NOTHING) for text in column.texts], np.int32)
        is_empty = np.array([not text for text in column.texts])
        if field.is_required:
            self._refuse(field.name, "empty", is_empty, lambda text: "is empty")
        self._refuse(
            field.name,
            "unknown",
            (numbers == NOTHING) & ~is_empty,
            lambda text: f"{quoted(text)} is not a {field.what}{_instead(text, field.known)}",
        )
        codes: Array = numbers[column.codes]
        return codes

    def _numbers(self, field: NumberField) -> Array:
        column, default = self._amounts(field.name), field.default
        if column is None:
            return np.full(len(self.table.lines), default or 0, np.int32)
        numbers, is_bad = np.zeros(len(column.texts), np.int32), []
        as_written = self.table.columns[field.name].texts
        for code, text in enumerate(column.texts):
            plain = ZERO_FRACTION.sub("", text)
            if field.rounds_up:
                plain = self._rounded_up(field, text, int(np.count_nonzero(column.codes == code)))
            number = int(plain) if PLAIN_WHOLE.fullmatch(plain) else None
            if not text and default is not None:
                number = default
            if self._is_ambiguous(as_written[code]):
                number = None
            is_bad.append(number is None or not field.least <= number <= field.most)
            numbers[code] = 0 if is_bad[-1] or number is None else number
        if field.rounds_up:
            is_zero = np.array([ZERO_AMOUNT.fullmatch(text) is not None for text in column.texts])
            self._refuse(
                field.name,
                "zero",
                is_zero,
                lambda text: f"is {text}, but must be at least {field.least}",
            )
            is_bad = (np.array(is_bad) & ~is_zero).tolist()
        kind = "number" if field.rounds_up else "whole number"
        allowed = f"from {field.least:,} to {field.most:,}"
        self._refuse(
            field.name,
            "number",
            np.array(is_bad),
            lambda text: (
                f"must be a {kind} {allowed}, found {quoted(text)}"
                + ("; write it without a decimal point" if self._is_ambiguous(text) else "")
            ),
        )
        values: Array = numbers[column.codes]
        return values

    def _rounded_up(self, field: NumberField, text: str, rows: int) -> str:
        """A decimal number as the next whole one, which is counted; other texts as they are."""
        text = LONE_COMMA.sub(r"\1.\2", text) if LONE_COMMA.fullmatch(text) else text
        if not DECIMAL.fullmatch(text):
            return text
        number = math.ceil(Fraction(text))
        if number != Fraction(text):
            column, rounded_up = self.result.column_of[field.name], self.result.counts.rounded_up
            rounded_up[column] = rounded_up.get(column, 0) + rows
        return str(number)

    def _is_ambiguous(self, text: str) -> bool:
        """Whether a point may separate thousands, as in 1.000 beside decimal commas."""
        return self.table.has_decimal_commas and THOUSANDS.fullmatch(text) is not None

    def _times(self, release: ReleaseField, due: DueField | None) -> None:
        """Read the release and due ticks of rows."""
        texts = self._amounts(release.name)
        assert texts is not None, "a release is required"
        counts = self.result.counts
        has_own_day = self.options.names_several
        reader = TimeReader(self.options.time, self.scale, counts, self._refuse, has_own_day)
        released = reader.read(release.name, texts)
        start = reader.start_of(released)
        ticks = reader.release_ticks(released, start)
        self.result.values[release.name] = np.maximum(ticks, 0).astype(np.int32)
        self.result.odd["before"] = ticks < 0
        if due is None:
            return
        column = self._amounts(due.name)
        until = np.full(len(ticks), NO_DUE, np.int64)
        if column is not None:
            until = reader.due_ticks(reader.read(due.name, column), start, ticks)
            self.result.odd["late"] = until < ticks
        self.result.values[due.name] = until.astype(np.int32)


def reading_notes(columns: TableColumns, scale: Scale) -> list[str]:
    """The note of `check` on a file: selected rows, ignored columns, tick 0."""
    counts, name = columns.counts, os.path.basename(columns.path)
    rows = count(counts.rows, "row")
    if counts.skipped and not counts.left_out:
        rows = f"{len(columns):,} of {rows} read"
    if counts.left_out:
        left_out = [f"{rows:,} {value}" for value, rows in counts.left_out.items()]
        more = len(left_out) - MAX_SHOWN_VALUES
        shown = [*left_out[:MAX_SHOWN_VALUES], *([f"{more:,} more values"] if more > 0 else [])]
        rows = f"{len(columns):,} of {rows} read; left out: {', '.join(shown)}"
    notes = [rows]
    if counts.ignored:
        notes.append(f"ignored columns: {', '.join(counts.ignored)}")
    if counts.tick_zero:
        notes.append(f"tick 0 is {counts.tick_zero}, the earliest release")
    if counts.skipped:
        notes.append(skipped_in_words(counts.skipped, counts.selected))
    for of_column, rows_up in counts.rounded_up.items():
        notes.append(f"{of_column} rounded up to a whole number in {count(rows_up, 'row')}")
    if counts.rounded:
        notes.append(f"{count(counts.rounded, 'time')} rounded to whole ticks of {scale.tick}")
    return [f"{name}: {note}" for note in notes]


def file_warnings(columns: TableColumns) -> list[str]:
    """Warn about rows released before tick 0 or due before their release; both occur in real files."""
    name, warnings = os.path.basename(columns.path), []
    before, late = (columns.odd.get(kind, np.zeros(0, np.bool_)) for kind in ("before", "late"))
    if before.any():
        rows = count(int(before.sum()), "row")
        warnings.append(f"{name}: {rows} released before tick 0, so known from the start")
    if late.any():
        what = "due before it is released, and therefore late from the start"
        if late.sum() > 1:
            rows = count(int(late.sum()), "row")
            what = (
                f"the first of {rows} due before they are released, and therefore late from "
                "the start"
            )
        warnings.append(f"{name}:{columns.lines[int(np.argmax(late))]}: {what}")
    return warnings
