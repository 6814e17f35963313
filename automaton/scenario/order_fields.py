"""Times as files of other systems write them, and the ticks that they are.

    2026-03-02 06:00:05     ISO 8601, with an offset such as +01:00 in all times or in none
    06:00 or 06:00:05       on the day of units.clock
    240, 20 s               ticks, or a time, after tick 0
    02.03.2026 06:00        by a format such as "%d.%m.%Y %H:%M"
    46083.25                with "serial": days, as spreadsheets store dates; below 1 a time of the day

Without units.clock the earliest of the times is tick 0. Times without an offset are counted as if
every day had 24 hours.
"""

from __future__ import annotations

import dataclasses
import datetime
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta, field
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.scenario.columns import RowErrors, TextColumn, is_workbook
from automaton.scenario.document import quoted
from automaton.scenario.quantities import (
    SECONDS_OF_DAY,
    TIME,
    ConfigSection,
    Dimension,
    Moment,
    NonEmptyText,
    Scale,
    SingleLine,
    read_amount,
)
from automaton.units import count, ticks_and_time

MICRO: Final = 1_000_000
EMPTY, TICKS, DATED, BARE, OFFSET = range(5)  # forms of a time
_TICKS: Final = re.compile(r"[0-9]{1,10}")
_DATED: Final = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}[T ].*[0-9:](Z|[-+][0-9:]{2,6})?")
_BARE: Final = re.compile(r"([0-9]{1,2}):([0-9]{2})(?::([0-9]{2})(?:[.,]([0-9]{1,6}))?)?")
_SHORT_HOUR: Final = re.compile(r"([T ])([0-9]:)")
_SHORT_DATE: Final = re.compile(r"-([0-9])(?=[-T ])")
_SERIAL: Final = re.compile(r"[0-9]{5}[.,][0-9]+")
_DAYS: Final = re.compile(r"([0-9]{1,6})(?:[.,]([0-9]{1,20}))?")
SERIAL: Final = "serial"  # instead of a format
SERIAL_DAY_0: Final = datetime.date(1899, 12, 30).toordinal()
_OF_DATES: Final = re.compile(r"%[dmyYjbBcGuVxUW]")
_OF_YEARS: Final = re.compile(r"%[yYcGx]")

DATE_FORMATS: Final = (
    *("%d.%m.%Y", "%d.%m.%y", "%m/%d/%Y", "%d/%m/%Y", "%m/%d/%y", "%d/%m/%y"),
    *("%Y/%m/%d", "%Y-%m-%d", "%d-%m-%Y", "%d-%b-%Y", "%d %b %Y", "%Y%m%d"),
)
TIME_FORMATS: Final = (
    *(" %H:%M", " %H:%M:%S", " %I:%M %p", " %I:%M:%S %p", " %H:%M:%S.%f", " %H.%M", ""),
    *("T%H%M%S", " %H%M%S", "%H%M%S", "%H%M", " %H:%M:%S%z", " %H:%M%z"),
)
TEXTS_TRIED: Final = 1000  # with each of these formats
OFFERED: Final = 2


class Time(NamedTuple):
    """What a text says."""

    form: int
    value: int  # ticks; microseconds since the year 1 (of UTC where it has an offset), or midnight


NO_TIME: Final = Time(EMPTY, 0)


class UnreadableError(ValueError):
    """A text is not a time."""


def read_time(text: str, of_format: str | None, scale: Scale) -> Time:
    """Read a text, by a format of `strptime` if there is one. Raises UnreadableError, InputError."""
    if not text:
        return NO_TIME
    if of_format == SERIAL and (match := _DAYS.fullmatch(text)):
        return _of_days(int(match[1]), match[2] or "0")
    if of_format is not None and of_format != SERIAL:
        return _by_format(text, of_format)
    if _TICKS.fullmatch(text):
        return Time(TICKS, int(text))
    if _DATED.fullmatch(text):
        return _iso(text)
    if match := _BARE.fullmatch(text):
        return _of_day(*match.groups())
    try:
        amount = read_amount(text, (Dimension.TIME,))
    except InputError:
        raise UnreadableError from None
    if amount.dimension != Dimension.TIME:
        raise UnreadableError
    return Time(TICKS, _rounded(TIME.number(amount, scale)))


def _rounded(exact: Fraction) -> int:
    return math.floor(exact + Fraction(1, 2))


def _iso(text: str) -> Time:
    try:
        moment = datetime.datetime.fromisoformat(text)
    except ValueError:
        try:  # as spreadsheets write it: 2026-3-2 6:30
            padded = _SHORT_DATE.sub(r"-0\1", _SHORT_HOUR.sub(r"\g<1>0\2", text))
            moment = datetime.datetime.fromisoformat(padded)
        except ValueError:
            raise UnreadableError from None
    return _dated(moment)


def _by_format(text: str, of_format: str) -> Time:
    try:
        moment = datetime.datetime.strptime(text, of_format)
    except ValueError:
        raise UnreadableError from None
    if _OF_DATES.search(of_format):
        return _dated(moment)
    return Time(BARE, _microseconds(moment) - _microseconds(datetime.datetime(1900, 1, 1)))


def _of_days(days: int, fraction: str) -> Time:
    """Days and a decimal fraction of one, to the next second: files seldom have more than six digits."""
    seconds = _rounded(Fraction(int(fraction) * SECONDS_OF_DAY, 10 ** len(fraction)))
    if not days:
        return Time(BARE, seconds * MICRO)
    return Time(DATED, ((SERIAL_DAY_0 + days) * SECONDS_OF_DAY + seconds) * MICRO)


def _dated(moment: datetime.datetime) -> Time:
    offset = moment.utcoffset()
    if offset is None:
        return Time(DATED, _microseconds(moment))
    return Time(OFFSET, _microseconds(moment) - offset // datetime.timedelta(microseconds=1))


def _microseconds(moment: datetime.datetime) -> int:
    seconds = 3600 * moment.hour + 60 * moment.minute + moment.second
    return (moment.toordinal() * SECONDS_OF_DAY + seconds) * MICRO + moment.microsecond


def _of_day(hours: str, minutes: str, seconds: str | None, fraction: str | None) -> Time:
    if int(hours) > 23 or int(minutes) > 59 or int(seconds or 0) > 59:
        raise UnreadableError
    since_midnight = 3600 * int(hours) + 60 * int(minutes) + int(seconds or 0)
    return Time(BARE, since_midnight * MICRO + int((fraction or "").ljust(6, "0")))


def check_format(of_format: str) -> None:
    """Raise ValueError with a sentence for a format that cannot be one of times."""
    if of_format == SERIAL:
        return
    sample = datetime.datetime(2026, 3, 2, 6, 30, tzinfo=datetime.UTC)
    if "%" not in of_format:
        raise ValueError(f"time must be a format such as '%d.%m.%Y %H:%M', found '{of_format}'")
    try:
        datetime.datetime.strptime(sample.strftime(of_format), of_format)
    except ValueError as error:
        raise ValueError(f"time cannot be the format '{of_format}': {error}") from None
    if _OF_DATES.search(of_format) and not _OF_YEARS.search(of_format):
        raise ValueError(f"time is the format '{of_format}', of dates without a year")


def unreadable(
    text: str, of_format: str | None, others: Sequence[str], good: str | None = None
) -> str:
    """Describe a text that is not a time, and a format for it.

    `others`: of the same column that are not, either; `good`: one that is a time.
    """
    if _SERIAL.fullmatch(text):
        days = f"{text!r} is a number of days, as spreadsheets store dates"
        return f"{days}; set time: {SERIAL}, or format it as a date"
    expected = "ISO 8601 such as 2026-03-02 06:30:00, a time of the day, or ticks"
    if of_format == SERIAL:
        expected = "a number of days such as 46083.2708333, or ISO 8601"
    elif of_format is not None:
        expected = f"the format '{of_format}', such as {_example(of_format)}"
    formats = fitting_formats([text, *others, *([good] if good is not None else [])])
    offers = "; set " + " or ".join(f'time: "{one}"' for one in formats) if formats else ""
    if good is not None and not formats:
        offers = f"; other rows are such as {good!r}: write it so"
    elif of_format is not None and _DATED.fullmatch(text):
        offers = "; leave out time, and it is read as ISO 8601"
    return f"{text[:40]!r} is not a time; expected is {expected}{offers}"


def _example(of_format: str) -> str:
    return datetime.datetime(2026, 3, 2, 6, 30, tzinfo=datetime.UTC).strftime(of_format)


def fitting_formats(texts: Sequence[str]) -> list[str]:
    """Return the well-known formats that all texts have, the likeliest first; a few at most."""
    formats = [date + time for date in DATE_FORMATS for time in TIME_FORMATS]
    for text in texts[:TEXTS_TRIED]:
        formats = [one for one in formats if _has_format(text, one)]
    return formats[:OFFERED]


def _has_format(text: str, of_format: str) -> bool:
    try:
        datetime.datetime.strptime(text, of_format)
    except ValueError:
        return False
    return True


class Start(NamedTuple):
    """The time of tick 0, in microseconds as times count them, in the forms in which it is known."""

    of_form: dict[int, int]


def rounded_ticks(
    microseconds: Sequence[int], tick_seconds: Fraction
) -> tuple[list[int], list[bool]]:
    """Return times after tick 0 in ticks, halves up, and of each whether it falls between two ticks."""
    tick, unit = tick_seconds.numerator * MICRO, tick_seconds.denominator
    ticks = [(2 * time * unit + tick) // (2 * tick) for time in microseconds]
    return ticks, [time * unit % tick != 0 for time in microseconds]


def start_of_clock(clock: Moment) -> Start:
    """Return what units.clock says."""
    since_midnight = int(clock.seconds * MICRO)
    of_form = {BARE: since_midnight}
    if clock.day is not None:
        local = clock.day * SECONDS_OF_DAY * MICRO + since_midnight
        if clock.offset is None:
            of_form[DATED] = local
        else:
            of_form[OFFSET] = local - clock.offset * MICRO
    return Start(of_form)


def misplaced(text: str, form: int, start: Start, has_clock: bool) -> str:
    """Describe a time of a form in which tick 0 is not known."""
    if form == OFFSET:
        hint = "units.clock has none" if has_clock else "the other times have none"
        return f"{text!r} has an offset from UTC, and {hint}"
    if OFFSET in start.of_form:
        hint = "units.clock has one" if has_clock else "the other times have one"
        return f"{text!r} has no offset from UTC, and {hint}"
    if has_clock:
        return f"{text!r} has a date, and units.clock has none; set it with a date"
    if not start.of_form:
        return (
            f"{text!r} is a clock time, and units.clock does not say what time it is in tick 0; set "
            f"it, such as units: {{clock: '{text}'}}"
        )
    return f"{text!r} has {'a' if form == DATED else 'no'} date, unlike the other times"


# What files of orders hold: the options by which they are read, their fields, and their columns.
#
# A field is what a scenario knows of a row; it stands in a column of the file. A row costs four bytes
# for each field, and the texts that no other row has.


Array = NDArray[np.int32]
NOTHING: Final = -1  # the code of a text field without a text
NO_DUE: Final = 2**31 - 1  # no tick is later
LAST_TICK: Final = 2_000_000_000
Values = str | int | tuple[str | int, ...]
Column = SingleLine | None


class ColumnNames(ConfigSection, frozen=True, kw_only=True):
    """What the columns of a file are called: a key for each field; other columns are not read."""

    @property
    def of_fields(self) -> dict[str, str]:
        """The column of each field that has one."""
        return {name: text for name, text in msgspec.to_builtins(self).items() if text is not None}


class OrderFile(ConfigSection, frozen=True, kw_only=True):
    """A CSV file, or a workbook, that another system has written."""

    file: Annotated[
        NonEmptyText,
        Meta(
            description="A CSV file whose first line names its columns, between semicolons, tabs or "
            "commas, or a workbook (.xlsx, extra excel); path relative to the scenario."
        ),
    ]
    sheet: Annotated[
        SingleLine | None, Meta(description="The sheet of a workbook; null: its only one.")
    ] = None
    where: Annotated[
        dict[str, Values],
        Meta(
            description="Columns and the values, one or a list, of the rows that count; all others "
            "are left out."
        ),
    ] = field(default_factory=dict)
    time: Annotated[
        SingleLine | None,
        Meta(
            description='The format of its times, as of strptime: "%d.%m.%Y %H:%M". null: ISO 8601, '
            "times of the clock's day such as 06:30, ticks, or times after tick 0 such as 20 s. serial: "
            "days such as 46083.25, as spreadsheets store dates."
        ),
    ] = None
    encoding: Annotated[
        Literal["utf-8", "cp1252"],
        Meta(description="How its text is stored; cp1252: by Windows programs in western Europe."),
    ] = "utf-8"

    def __post_init__(self) -> None:
        if self.time is not None:
            check_format(self.time)
        if self.sheet is not None and self.file and not is_workbook(Path(self.file)):
            raise ValueError(f"sheet belongs to a workbook (.xlsx), and file is '{self.file}'")


@dataclass(frozen=True)
class TextField:
    """Texts, as codes into the list of the different ones; -1 for nothing."""

    name: str
    is_required: bool = False  # in every row


@dataclass(frozen=True)
class NameField:
    """Names that are known, each with its number; -1 for nothing."""

    name: str
    known: Mapping[str, int]
    what: str  # a name is: "location"
    is_required: bool = False


@dataclass(frozen=True)
class NumberField:
    """Whole numbers."""

    name: str
    least: int
    most: int
    default: int | None = None  # where nothing stands; None: there must be a number


@dataclass(frozen=True)
class ReleaseField:
    """The tick in which a row is released; 0 for what comes before it."""

    name: str = "released"


@dataclass(frozen=True)
class DueField:
    """The tick until which a row is to be done; NO_DUE for none. Ticks and times count from release."""

    name: str = "due"


Field = TextField | NameField | NumberField | ReleaseField | DueField


@dataclass
class Counts:
    """What `check` says of a file."""

    rows: int = 0  # all that hold a value
    left_out: dict[str, int] = dataclasses.field(default_factory=dict)  # by "STATUS CANCELLED"
    ignored: tuple[str, ...] = ()  # columns
    tick_zero: str = ""  # the earliest release, where units.clock does not say what tick 0 is
    before_start: int = 0  # rows that are released before tick 0
    late_at_once: int = 0  # and that are due before their release
    first_late_line: int = 0  # of the file, from 1
    rounded: int = 0  # times between two ticks


@dataclass
class OrderColumns:
    """The rows of a file that count."""

    path: str
    content_hash: str  # 16 hex digits
    lines: Array  # (n,) where each of them begins in the file, from 1
    values: dict[str, Array]  # (n,) of each field
    names: dict[str, list[str]]  # of each TextField
    column_of: dict[str, str]  # field: the column where it stands
    errors: RowErrors
    counts: Counts

    def __len__(self) -> int:
        return len(self.lines)

    def refuse(
        self, kind: str, field_name: str, rows: NDArray[np.bool_], sentence: Callable[[int], str]
    ) -> None:
        """Add a mistake of rows to `errors`; `sentence`: of a row by its index."""
        first = int(np.argmax(rows))
        if rows[first]:
            self.errors.add((kind, field_name), self.lines[rows].tolist(), lambda: sentence(first))


# Say what was read of a file of orders, what was left out, and what is odd in it.


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


# Turn the columns of release and due times of a file into ticks.
#
# Each different text is read once. What is released before tick 0 is known from the start; what is
# due before its release is late at once: files of running warehouses have both, so they are counted.


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
