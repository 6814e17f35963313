"""Rows of a table that a scenario skips, written to a file as they are, each behind its mistake.

    reason;ORDER;LOCATION;UNITS
    unknown pod;100017;G99-99;2

The file has the encoding and the separator of its source; those of a workbook are UTF-8 and commas.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

from automaton.atomic_write import atomic_writer
from automaton.scenario.columns import rows_as_written
from automaton.units import count

REASON: Final = "reason"


class QuarantinedRows(NamedTuple):
    """The skipped rows of a file of orders, and the file that gets them."""

    target: Path
    source: Path
    encoding: str  # of the source
    sheet: str | None  # of a workbook
    mistakes: Mapping[int, str]  # by the first line of a row


def write_quarantine(rows: QuarantinedRows) -> str:
    """Write the file, atomically, and return a sentence about it. Raises InputError."""
    separator, head, skipped = rows_as_written(
        rows.source, rows.encoding, rows.sheet, rows.mistakes
    )
    text = io.StringIO(newline="")
    writer = csv.writer(text, delimiter=separator, lineterminator="\n")
    writer.writerow([REASON, *head])
    writer.writerows([rows.mistakes[line], *row] for line, row in skipped)
    with atomic_writer(rows.target) as file:
        file.write(text.getvalue().encode(rows.encoding))
    return f"{count(len(skipped), 'skipped row')} written to {rows.target}"
