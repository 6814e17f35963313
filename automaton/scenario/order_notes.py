"""Say what was read of a file of orders, what was left out, and what is odd in it."""

from __future__ import annotations

import os

from automaton.scenario.order_fields import OrderColumns
from automaton.scenario.quantities import Scale
from automaton.units import count

MAX_SHOWN = 5  # values of `where`


def reading_notes(columns: OrderColumns, scale: Scale) -> list[str]:
    """Return what `check` says of a file: the rows that count, columns that are not read, tick 0."""
    counts, name = columns.counts, os.path.basename(columns.path)
    rows = count(counts.rows, "row")
    if counts.left_out:
        left_out = [f"{rows:,} {value}" for value, rows in counts.left_out.items()]
        more = len(left_out) - MAX_SHOWN
        shown = [*left_out[:MAX_SHOWN], *([f"{more:,} more values"] if more > 0 else [])]
        rows = f"{len(columns):,} of {rows}, left out: {', '.join(shown)}"
    notes = [rows]
    if counts.ignored:
        notes.append(f"columns that are not read: {', '.join(counts.ignored)}")
    if counts.tick_zero:
        notes.append(f"tick 0 is {counts.tick_zero}, the earliest release")
    if counts.rounded:
        notes.append(f"{count(counts.rounded, 'time')} rounded to whole ticks of {scale.tick}")
    return [f"{name}: {note}" for note in notes]


def file_warnings(columns: OrderColumns) -> list[str]:
    """Warn of rows that come before tick 0, or are due before they come, as real files have them."""
    counts, name = columns.counts, os.path.basename(columns.path)
    warnings = []
    if counts.before_start:
        rows = count(counts.before_start, "row")
        warnings.append(f"{name}: {rows} released before tick 0, so known from the start")
    if counts.late_at_once:
        what = "due before it is released, and so late at once"
        if counts.late_at_once > 1:
            rows = count(counts.late_at_once, "row")
            what = f"the first of {rows} due before they are released, and so late at once"
        warnings.append(f"{name}:{counts.first_late_line}: {what}")
    return warnings
