"""The rows of a folder for pandas, polars or DuckDB: as CSV, and as one Parquet file."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any, Final

from automaton.atomic_write import atomic_writer
from automaton.errors import InputError
from automaton.studies.sweeps.result_columns import SUMS_COLUMN

CSV_BEGINS: Final = b"key,"  # the first column
PARQUET_BEGINS: Final = b"PAR1"


def check_replaced(path: Path, begins: bytes) -> None:
    """Raises InputError for a file that is not a table of ours: a scenario, say, is not replaced."""
    try:
        with path.open("rb") as file:
            found = file.read(len(begins))
    except OSError:
        return  # there is none, or writing will tell
    if found and found != begins:
        raise InputError("is not a table of results, so it is not replaced by one", str(path))


def write_csv(table: Any, path: Path) -> None:
    """All rows of an Arrow table; lists as JSON, what is absent as nothing. Raises InputError.

    Without the sums by stretches of time, which no spreadsheet reads.
    """
    names = [name for name in table.column_names if name != SUMS_COLUMN]
    columns = {name: table.column(name).to_pylist() for name in names}
    with atomic_writer(path) as file:
        text = io.TextIOWrapper(file, encoding="utf-8", newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow([json.dumps(cell) if isinstance(cell, list) else cell for cell in row])
        text.flush()
        text.detach()


def write_parquet(table: Any, path: Path) -> None:
    """All rows of an Arrow table. Raises InputError."""
    import pyarrow.parquet

    with atomic_writer(path) as file:
        pyarrow.parquet.write_table(table, file, write_page_checksum=True)
