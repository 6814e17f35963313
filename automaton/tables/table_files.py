"""Destinations of tables: memory, a folder of CSV or Parquet files, or a workbook."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final, Protocol

from automaton.documents.workbook import openpyxl, sheet_cell
from automaton.errors import InputError, alternatives
from automaton.printable import FORMULA_SIGNS
from automaton.tables.columns import TABLES, Form, arrow
from automaton.units import count

if TYPE_CHECKING:
    import pyarrow as pa

MAX_ROWS_IN_MEMORY: Final = 20_000_000
MAX_SHEET_ROWS: Final = 1_048_576  # of an Excel sheet, including its header
METRICS_FILE: Final = "metrics.json"
SCENARIO_FILE: Final = "scenario.yaml"
WORKBOOK: Final = "tables.xlsx"
CSV, PARQUET, XLSX = "csv", "parquet", "xlsx"
FORMATS: Final = (CSV, PARQUET, XLSX)
BEGINS_AS_FORMULA: Final = f"^([{re.escape(''.join(FORMULA_SIGNS))}])"
HINT_TO_OBSERVE: Final = "; events=True and states=PERIOD record events and states"


class Tables:
    """The tables of a run as pyarrow tables: `tables.lines`, `tables.states`."""

    def __init__(self, readers: Mapping[str, Callable[[], pa.Table]], why_not: str = "") -> None:
        self._readers = {name: readers[name] for name in TABLES if name in readers}
        self._why_not = why_not

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the existing tables."""
        return tuple(self._readers)

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __getattr__(self, name: str) -> pa.Table:
        if name in TABLES and name in self._readers:
            return self._readers[name]()
        if name in TABLES:
            raise AttributeError(f"this run has no table '{name}'{self._why_not}")
        raise AttributeError(name)

    def __getitem__(self, name: str) -> pa.Table:
        return getattr(self, name)


class Sink(Protocol):
    """A destination of tables."""

    def write(self, form: Form, table: pa.Table) -> None:
        """Append a group of rows to a table. Raises InputError."""

    def describe(self, metrics: dict[str, Any], scenario: Iterable[str]) -> None:
        """Write metrics and scenario of a finished run."""

    def close(self) -> None:
        """Close all files; the rows written so far stay."""

    def tables(self) -> Tables:
        """The tables written."""


class MemorySink:
    """Keeps tables in memory."""

    def __init__(self) -> None:
        self._groups: dict[str, list[pa.Table]] = {}
        self._rows = 0

    def write(self, form: Form, table: pa.Table) -> None:
        self._rows += len(table)
        if self._rows > MAX_ROWS_IN_MEMORY:
            raise too_many_in_memory(self._rows)
        self._groups.setdefault(form.name, []).append(table)

    def describe(self, metrics: dict[str, Any], scenario: Iterable[str]) -> None:
        pass  # the outcome of the run contains them

    def close(self) -> None:
        pass

    def tables(self) -> Tables:
        pa = arrow()
        tables = {name: pa.concat_tables(groups) for name, groups in self._groups.items()}
        readers = {name: (lambda table=table: table) for name, table in tables.items()}
        return Tables(readers, HINT_TO_OBSERVE)


def too_many_in_memory(rows: int) -> InputError:
    """The error about tables that do not fit in memory."""
    return InputError(
        f"tables of {rows:,} rows are expected, but the limit in memory is {MAX_ROWS_IN_MEMORY:,}; "
        "set folder= to write them to files, or a longer period of states"
    )


class FolderSink:
    """Writes a file for each table into a folder, group by group."""

    def __init__(self, folder: Path, form: str) -> None:
        self.folder, self._format = folder, form
        prepare(folder)
        self._open: dict[str, tuple[Any, BinaryIO]] = {}

    def write(self, form: Form, table: pa.Table) -> None:
        if self._format == CSV:
            table = without_formulas(table)
        try:
            if form.name not in self._open:
                self._open[form.name] = self._begin(form.name, table.schema)
            writer, file = self._open[form.name]
            writer.write_table(table)
            file.flush()
        except OSError as error:
            raise _cannot_write(self.folder, error) from error

    def _begin(self, name: str, schema: pa.Schema) -> tuple[Any, BinaryIO]:
        file = (self.folder / f"{name}.{self._format}").open("wb")
        if self._format == CSV:
            from pyarrow.csv import CSVWriter

            return CSVWriter(file, schema), file
        from pyarrow.parquet import ParquetWriter

        # No dictionaries of numbers: they would take 0.3 of 0.5 s for 500,000 orders.
        texts = [field.name for field in schema if arrow().types.is_dictionary(field.type)]
        return ParquetWriter(file, schema, use_dictionary=texts or False), file

    def describe(self, metrics: dict[str, Any], scenario: Iterable[str]) -> None:
        describe(self.folder, metrics, scenario)

    def close(self) -> None:
        for writer, file in self._open.values():
            try:
                writer.close()
                file.close()
            except OSError as error:
                raise _cannot_write(self.folder, error) from error

    def tables(self) -> Tables:
        if self._format == CSV:
            return Tables({}, f": they are files in {self.folder}")
        from pyarrow.parquet import read_table

        readers = {
            name: (lambda path=self.folder / f"{name}.{self._format}": read_table(path))
            for name in self._open
        }
        return Tables(readers, HINT_TO_OBSERVE)


def without_formulas(table: pa.Table) -> pa.Table:
    """A table for CSV, with an apostrophe before each text that looks like a formula."""
    import pyarrow.compute

    pa = arrow()
    for index, field in enumerate(table.schema):
        is_coded = pa.types.is_dictionary(field.type)
        if is_coded and not pa.types.is_string(field.type.value_type):
            continue
        if is_coded or pa.types.is_string(field.type):
            texts = table.column(index).cast(pa.string())
            harmless = pyarrow.compute.replace_substring_regex(texts, BEGINS_AS_FORMULA, r"'\1")
            table = table.set_column(index, field.name, harmless)
    return table


class WorkbookSink:
    """Writes a workbook with a sheet for each table; openpyxl stores rows in temporary files."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._book = openpyxl("workbooks are written").Workbook(write_only=True)
        prepare(folder)
        self._sheets: dict[str, Any] = {}
        self._rows: dict[str, int] = {}

    def write(self, form: Form, table: pa.Table) -> None:
        name = form.name
        rows = self._rows[name] = self._rows.get(name, 0) + len(table)
        if rows >= MAX_SHEET_ROWS:
            raise too_many_in_sheet(name, rows)
        if name not in self._sheets:
            self._sheets[name] = self._book.create_sheet(name)
            self._sheets[name].append(table.column_names)
        sheet = self._sheets[name]
        for batch in table.to_batches(max_chunksize=4096):
            for row in zip(*(column.to_pylist() for column in batch.columns), strict=True):
                sheet.append([sheet_cell(sheet, value) for value in row])

    def describe(self, metrics: dict[str, Any], scenario: Iterable[str]) -> None:
        describe(self.folder, metrics, scenario)

    def close(self) -> None:
        if not self._sheets:
            return
        try:
            self._book.save(self.folder / WORKBOOK)
        except OSError as error:
            raise _cannot_write(self.folder, error) from error

    def tables(self) -> Tables:
        return Tables({}, f": they are sheets of {self.folder / WORKBOOK}")


def too_many_in_sheet(name: str, rows: int) -> InputError:
    """The error about a table that does not fit in a sheet."""
    return InputError(
        f"the table {name} may have {count(rows, 'row')}, but a sheet holds only "
        f"{MAX_SHEET_ROWS - 1:,}; use parquet or csv, or a longer period of states"
    )


def sink_for(folder: Path | None, form: str, expected: Mapping[str, int]) -> Sink:
    """The destination of tables; `folder` None: memory; `expected`: expected rows by table.

    Raises InputError if the tables cannot be written there.
    """
    arrow()
    if form not in FORMATS:
        raise InputError(f"the format of tables must be {alternatives(FORMATS)}, not {form!r}")
    if folder is None:
        if sum(expected.values()) > MAX_ROWS_IN_MEMORY:
            raise too_many_in_memory(sum(expected.values()))
        return MemorySink()
    if form != XLSX:
        return FolderSink(folder, form)
    for name, rows in expected.items():
        if rows >= MAX_SHEET_ROWS:
            raise too_many_in_sheet(name, rows)
    return WorkbookSink(folder)


def prepare(folder: Path) -> None:
    """Create a folder for the tables of a run. Raises InputError if it holds another run."""
    names = {METRICS_FILE, SCENARIO_FILE, WORKBOOK}
    names |= {f"{table}.{form}" for table in TABLES for form in (CSV, PARQUET)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        known = sorted(names & {path.name for path in folder.iterdir()})
    except OSError as error:
        raise _cannot_write(folder, error) from error
    if known:
        raise InputError(
            f"already holds another run ({known[0]}); use a new folder, or empty it", str(folder)
        )


def describe(folder: Path, metrics: dict[str, Any], scenario: Iterable[str]) -> None:
    """Write the metrics and the scenario of a finished run."""
    try:
        with (folder / SCENARIO_FILE).open("w", encoding="utf-8") as file:
            file.writelines(scenario)
        text = json.dumps(metrics, indent=2, ensure_ascii=False)
        (folder / METRICS_FILE).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise _cannot_write(folder, error) from error


def _cannot_write(folder: Path, error: OSError) -> InputError:
    return InputError(f"cannot write tables: {error.strerror or error}", str(folder))
