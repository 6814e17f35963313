"""What a folder holds, as files for other programs: CSV, and rows as one Parquet file.

Columns have no dots in their names, and those that are empty throughout are left out. In CSV what is
text stands in quotes: seeds are, since a spreadsheet keeps 15 digits of a number. A text that begins as
formulas do gets an apostrophe first.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from automaton.atomic_write import atomic_writer
from automaton.errors import InputError
from automaton.printable import FORMULA_SIGNS
from automaton.studies.reports.records import column_names
from automaton.studies.sweeps.result_columns import SUMS_COLUMN

ROWS_BEGIN: Final = b"key,"  # the first column
SUMMARY_BEGINS: Final = b"point,"
COMPARISONS_BEGIN: Final = b"metric,"
PARQUET_BEGINS: Final = b"PAR1"
SEED: Final = "seed"  # a number of 63 bits


def check_replaced(path: Path, begins: bytes) -> None:
    """Raises InputError for a file that is not a table of ours: a scenario, say, is not replaced."""
    try:
        with path.open("rb") as file:
            start = file.read(len(begins))
    except OSError:
        return  # there is no such file, or it cannot be written either
    if start and start != begins:
        raise InputError("is not a table of results, so it is not replaced by one", str(path))


def rows_table(table: Any) -> Any:
    """All rows of an Arrow table, for export: plain names, no empty columns."""
    used = [name for name in table.column_names if table.column(name).null_count < len(table)]
    out = table.select(used)
    return out.rename_columns(column_names(used))


def without_sums(table: Any) -> Any:
    """A table without the sums by stretches of time, which no spreadsheet reads."""
    return table.select([name for name in table.column_names if name != SUMS_COLUMN])


def columns_for_sheets(table: Any) -> dict[str, list[Any]]:
    """The columns of rows for spreadsheets: lists as JSON, seeds as text."""
    return {
        name: [cell_value(name, value) for value in table.column(name).to_pylist()]
        for name in without_sums(table).column_names
    }


def cell_value(name: str, value: Any) -> Any:
    """A value as a spreadsheet can hold it."""
    if isinstance(value, list | dict):
        return json.dumps(value, ensure_ascii=False)
    return str(value) if name == SEED and value is not None else value


def write_rows_csv(table: Any, path: Path) -> None:
    """All rows as CSV. Raises InputError."""
    columns = columns_for_sheets(rows_table(table))
    write_csv(list(columns), zip(*columns.values(), strict=True), path)


def write_records_csv(
    records: Sequence[Mapping[str, Any]], head: Sequence[str], path: Path
) -> None:
    """Records as CSV; `head`: the columns if there are no records. Raises InputError."""
    names = list(records[0]) if records else list(head)
    lines = ([cell_value(name, record[name]) for name in names] for record in records)
    write_csv(names, lines, path)


def write_csv(head: Sequence[str], lines: Iterable[Iterable[Any]], path: Path) -> None:
    """A table as CSV, written as a whole or not at all. Raises InputError."""
    with atomic_writer(path) as file:
        file.write((",".join(map(_csv_head, head)) + "\n").encode())
        for line in lines:
            file.write((",".join(map(csv_cell, line)) + "\n").encode())


def _csv_head(name: str) -> str:
    return csv_cell(name) if set(name) & set(',"\r\n') else name


def csv_cell(value: Any) -> str:
    """Text in quotes, numbers as they are, what is absent as nothing.

    Text that spreadsheets would take for a formula gets an apostrophe.
    """
    if isinstance(value, str):
        text = f"'{value}" if value.startswith(FORMULA_SIGNS) else value
        return '"' + text.replace('"', '""') + '"'
    return "" if value is None else str(value)


def write_parquet(table: Any, path: Path) -> None:
    """All rows as Parquet. Raises InputError."""
    import pyarrow.parquet

    with atomic_writer(path) as file:
        pyarrow.parquet.write_table(rows_table(table), file, write_page_checksum=True)
