"""Turn the columns of release and due times of a file into ticks.

Each different text is read once. What is released before tick 0 is known from the start; what is due
before its release is late at once: files of running warehouses have both, so they are counted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.scenario.csv_columns import TextColumn
from automaton.scenario.file_times import (
    EMPTY,
    NO_TIME,
    TICKS,
    Start,
    UnreadableError,
    misplaced,
    read_time,
    rounded_ticks,
    start_of_clock,
    unreadable,
)
from automaton.scenario.order_fields import LAST_TICK, NO_DUE, Counts
from automaton.scenario.quantities import Scale
from automaton.scenario.text_lines import quoted
from automaton.units import ticks_and_time

Mask = NDArray[np.bool_]
Refuse = Callable[[str, str, Mask, Callable[[str], str]], None]  # field, kind, of texts, sentence


@dataclass
class TimeColumn:
    """A column of which each different text is read as a time."""

    name: str  # of the field
    column: TextColumn
    forms: NDArray[np.uint8]  # of each text; EMPTY where no row has it, or it cannot be read
    values: list[int]  # as of Time

    def uses(self, form: int) -> Mask:
        """Return which texts are times of a form."""
        uses: Mask = self.forms == form
        return uses


def read_time_column(
    name: str, column: TextColumn, of_format: str | None, scale: Scale, refuse: Refuse
) -> TimeColumn:
    """Read the texts of a column that rows have."""
    count = len(column.texts)
    times, bad, message = [NO_TIME] * count, np.zeros(count, np.bool_), ""
    try:
        for code in np.flatnonzero(np.bincount(column.codes, minlength=count)).tolist():
            try:
                times[code] = read_time(column.texts[code], of_format, scale)
            except UnreadableError:
                bad[code] = True
        forms = np.array([time.form for time in times], np.uint8)
        code = int(np.argmax(forms > TICKS))
        if forms[code] > TICKS:
            scale.tick_seconds  # noqa: B018 - asks whether a tick is a time
    except InputError as error:
        message = error.message
        refuse(name, "tick", np.arange(count) == code, lambda text: f"{quoted(text)}: {message}")
        forms = np.zeros(count, np.uint8)
    others = [column.texts[code] for code in np.flatnonzero(bad).tolist()]
    readable = np.flatnonzero(forms > TICKS)
    good = column.texts[readable[0]] if len(readable) else None
    refuse(name, "time", bad, lambda text: unreadable(text, of_format, others, good))
    return TimeColumn(name, column, forms, [time.value for time in times])


def start_of(released: TimeColumn, scale: Scale, counts: Counts) -> Start:
    """Return the time of tick 0: of units.clock, else the earliest release in the form of the first."""
    if scale.clock is not None:
        return start_of_clock(scale.clock)
    form = next((form for form in released.forms[released.column.codes].tolist() if form), TICKS)
    if form == TICKS:
        return Start({})
    earliest = min(np.flatnonzero(released.uses(form)).tolist(), key=released.values.__getitem__)
    counts.tick_zero = released.column.texts[earliest]
    return Start({form: released.values[earliest]})


def ticks_of(
    times: TimeColumn, start: Start, scale: Scale, counts: Counts, refuse: Refuse
) -> NDArray[np.int64]:
    """Return the ticks of each different text: after tick 0, or as they are given.

    Counts the rows whose time falls between two ticks.
    """
    ticks = np.zeros(len(times.values), np.int64)
    for form in np.unique(times.forms[times.forms != EMPTY]).tolist():
        is_of_form = times.uses(form)
        codes = np.flatnonzero(is_of_form).tolist()
        values = [times.values[code] for code in codes]
        if form != TICKS and form not in start.of_form:
            sentence = partial(misplaced, form=form, start=start, has_clock=scale.clock is not None)
            refuse(times.name, f"form {form}", is_of_form, sentence)
            continue
        is_between = [False] * len(values)
        if form in start.of_form:
            after = [value - start.of_form[form] for value in values]
            values, is_between = rounded_ticks(after, scale.tick_seconds)
        of_rows = np.bincount(times.column.codes, minlength=len(ticks))[codes]
        counts.rounded += int(of_rows[is_between].sum())
        ticks[codes] = [max(-LAST_TICK, min(value, LAST_TICK + 1)) for value in values]
    most = ticks_and_time(LAST_TICK, scale.unit)
    refuse(times.name, "late", ticks > LAST_TICK, lambda text: f"{quoted(text)} is after {most}")
    return ticks


def release_ticks(
    released: TimeColumn, start: Start, scale: Scale, counts: Counts, refuse: Refuse
) -> NDArray[np.int64]:
    """(n,) ticks of release, below 0 before tick 0, which is counted."""
    is_empty = np.array([not text for text in released.column.texts])
    refuse(released.name, "empty", is_empty, lambda text: "is empty")
    ticks: NDArray[np.int64] = ticks_of(released, start, scale, counts, refuse)[
        released.column.codes
    ]
    counts.before_start = int(np.count_nonzero(ticks < 0))
    return ticks


def due_ticks(
    due: TimeColumn,
    release: NDArray[np.int64],
    start: Start,
    scale: Scale,
    counts: Counts,
    refuse: Refuse,
) -> NDArray[np.int64]:
    """(n,) ticks until which rows are due, NO_DUE for none; those before release are counted."""
    codes = due.column.codes
    ticks = ticks_of(due, start, scale, counts, refuse)[codes]
    ticks += np.where(due.uses(TICKS)[codes], release, 0)
    np.clip(ticks, -LAST_TICK, LAST_TICK, out=ticks)
    ticks[due.uses(EMPTY)[codes]] = NO_DUE
    counts.late_at_once = int(np.count_nonzero(ticks < release))
    return ticks
