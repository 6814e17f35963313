"""Times in files of other systems, and their ticks.

    2026-03-02 06:00:05     ISO 8601, with an offset such as +01:00 in all times or in none
    06:00 or 06:00:05       on the day of units.clock
    240, 20 s               ticks, or a time, after tick 0
    02.03.2026 06:00        by a format such as "%d.%m.%Y %H:%M"
    46083.25                with "serial": days, as spreadsheets store dates; below 1 a time of the day

Without units.clock the earliest time is tick 0. For times without an offset every day has 24 hours. Rows
released before tick 0 are known from the start; rows due before their release are late from the start.
Where a run has one of several files, the day of its earliest release is taken for that of units.clock.
Files of running warehouses have both, so both are counted.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.scenario.columns import TextColumn
from automaton.scenario.quantities import (
    LAST_TICK,
    SECONDS_OF_DAY,
    TIME,
    ClockTime,
    Dimension,
    Scale,
    read_amount,
    rounded,
)
from automaton.scenario.table_fields import DATE_CODES, NO_DUE, SERIAL
from automaton.scenario.text_files import quoted
from automaton.units import ticks_and_time

MICRO: Final = 1_000_000
EMPTY, TICKS, DATED, BARE, OFFSET = range(5)  # forms of a time
_TICKS: Final = re.compile(r"[0-9]{1,10}")
_DATED: Final = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}[T ].*[0-9:](Z|[-+][0-9:]{2,6})?")
_BARE: Final = re.compile(r"([0-9]{1,2}):([0-9]{2})(?::([0-9]{2})(?:[.,]([0-9]{1,6}))?)?")
_SHORT_HOUR: Final = re.compile(r"([T ])([0-9]:)")
_SHORT_DATE: Final = re.compile(r"-([0-9])(?=[-T ])")
_SERIAL: Final = re.compile(r"[0-9]{5}[.,][0-9]+")
_DAYS: Final = re.compile(r"([0-9]{1,6})(?:[.,]([0-9]{1,20}))?")
SERIAL_DAY_0: Final = datetime.date(1899, 12, 30).toordinal()

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
    """The time that a text says."""

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
    return Time(TICKS, rounded(TIME.number(amount, scale)))


def _iso(text: str) -> Time:
    try:
        moment = datetime.datetime.fromisoformat(text)
    except ValueError:
        try:  # spreadsheets write 2026-3-2 6:30
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
    if DATE_CODES.search(of_format):
        return _dated(moment)
    return Time(BARE, _microseconds(moment) - _microseconds(datetime.datetime(1900, 1, 1)))


def _of_days(days: int, fraction: str) -> Time:
    """Days with a decimal fraction, rounded to the second: files seldom have more than six digits."""
    seconds = rounded(Fraction(int(fraction) * SECONDS_OF_DAY, 10 ** len(fraction)))
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


def unreadable(
    text: str, of_format: str | None, others: Sequence[str], good: str | None = None
) -> str:
    """Describe a text that is not a time, and suggest a format.

    `others`: further texts of the column that are not times; `good`: a text that is a time.
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
        offers = f"; other rows are such as {good!r}: use this format"
    elif of_format is not None and _DATED.fullmatch(text):
        offers = "; leave out time to read it as ISO 8601"
    return f"{text[:40]!r} is not a time; expected {expected}{offers}"


def _example(of_format: str) -> str:
    return datetime.datetime(2026, 3, 2, 6, 30, tzinfo=datetime.UTC).strftime(of_format)


def fitting_formats(texts: Sequence[str]) -> list[str]:
    """Return the well-known formats that all texts match, the likeliest first; a few at most."""
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
    """The time of tick 0 in microseconds, in each form in which it is known."""

    of_form: dict[int, int]


def rounded_ticks(
    microseconds: Sequence[int], tick_seconds: Fraction
) -> tuple[list[int], list[bool]]:
    """Return times after tick 0 in ticks, halves up, and whether each falls between two ticks."""
    tick, unit = tick_seconds.numerator * MICRO, tick_seconds.denominator
    ticks = [(2 * time * unit + tick) // (2 * tick) for time in microseconds]
    return ticks, [time * unit % tick != 0 for time in microseconds]


def start_of_clock(clock: ClockTime) -> Start:
    """Return the time of units.clock."""
    since_midnight = int(clock.seconds * MICRO)
    of_form = {BARE: since_midnight}
    if clock.day is not None:
        local = clock.day * SECONDS_OF_DAY * MICRO + since_midnight
        if clock.offset is None:
            of_form[DATED] = local
        else:
            of_form[OFFSET] = local - clock.offset * MICRO
    return Start(of_form)


def start_of_day(clock: ClockTime, form: int, earliest: int) -> Start:
    """The time of units.clock on the day of the earliest time of a file; `form`: of that time."""
    day = SECONDS_OF_DAY * MICRO
    offset = MICRO * (clock.offset or 0)
    midnight = (earliest + offset) // day * day - offset
    since_midnight = int(clock.seconds * MICRO)
    return Start({BARE: since_midnight, form: midnight + since_midnight})


def misplaced(text: str, form: int, start: Start, has_clock: bool) -> str:
    """Describe a time of a form in which tick 0 is not known."""
    if form == OFFSET:
        hint = "units.clock has none" if has_clock else "the other times have none"
        return f"{text!r} has an offset from UTC, but {hint}"
    if OFFSET in start.of_form:
        hint = "units.clock has one" if has_clock else "the other times have one"
        return f"{text!r} has no offset from UTC, but {hint}"
    if has_clock:
        return f"{text!r} has a date, but units.clock has none; set it with a date"
    if not start.of_form:
        return (
            f"{text!r} is a clock time, but the clock time of tick 0 is unknown; set units.clock, "
            f"such as units: {{clock: '{text}'}}"
        )
    return f"{text!r} has {'a' if form == DATED else 'no'} date, unlike the other times"


@dataclass
class ReadingCounts:
    """The note of `check` on a file that was read as a table."""

    rows: int = 0  # rows with a value
    left_out: dict[str, int] = field(default_factory=dict)  # by "STATUS CANCELLED"
    ignored: tuple[str, ...] = ()  # columns
    tick_zero: str = ""  # the earliest release, if units.clock is not set
    rounded: int = 0  # times between two ticks
    rounded_up: dict[str, int] = field(default_factory=dict)  # decimal numbers, by column
    selected: int = 0  # rows that `where` keeps
    skipped: dict[str, int] = field(default_factory=dict)  # of these, by the mistake in them


Mask = NDArray[np.bool_]
Refuse = Callable[[str, str, Mask, Callable[[str], str]], None]  # field, kind, of texts, sentence


@dataclass
class TimeColumn:
    """A column whose different texts are read as times."""

    name: str  # of the field
    column: TextColumn
    forms: NDArray[np.uint8]  # of each text; EMPTY if no row has it, or if it cannot be read
    values: list[int]  # as in Time

    def uses(self, form: int) -> Mask:
        """The texts that are times of a form."""
        uses: Mask = self.forms == form
        return uses


@dataclass
class TimeReader:
    """Turns columns of release and due times into ticks; each different text is read once."""

    of_format: str | None
    scale: Scale
    counts: ReadingCounts
    refuse: Refuse
    has_own_day: bool = False  # the day of units.clock is that of the earliest release

    def read(self, name: str, column: TextColumn) -> TimeColumn:
        """The times of a column, from the texts in its rows."""
        count = len(column.texts)
        times, bad, message = [NO_TIME] * count, np.zeros(count, np.bool_), ""
        try:
            for code in np.flatnonzero(np.bincount(column.codes, minlength=count)).tolist():
                try:
                    times[code] = read_time(column.texts[code], self.of_format, self.scale)
                except UnreadableError:
                    bad[code] = True
            forms = np.array([time.form for time in times], np.uint8)
            code = int(np.argmax(forms > TICKS))
            if forms[code] > TICKS:
                self.scale.tick_seconds  # noqa: B018 - raises unless a tick is a time
        except InputError as error:
            message = error.message
            is_it = np.arange(count) == code
            self.refuse(name, "tick", is_it, lambda text: f"{quoted(text)}: {message}")
            forms = np.zeros(count, np.uint8)
        others = [column.texts[code] for code in np.flatnonzero(bad).tolist()]
        readable = np.flatnonzero(forms > TICKS)
        good = column.texts[readable[0]] if len(readable) else None
        self.refuse(name, "time", bad, lambda text: unreadable(text, self.of_format, others, good))
        return TimeColumn(name, column, forms, [time.value for time in times])

    def start_of(self, released: TimeColumn) -> Start:
        """The time of tick 0: of units.clock, else the earliest release in the form of the first."""
        clock = self.scale.clock
        if clock is not None:
            known = OFFSET if clock.offset is not None else DATED
            dated = np.flatnonzero(released.uses(known)).tolist()
            if self.has_own_day and dated:
                return start_of_day(clock, known, min(released.values[code] for code in dated))
            return start_of_clock(clock)
        form = next(
            (form for form in released.forms[released.column.codes].tolist() if form), TICKS
        )
        if form == TICKS:
            return Start({})
        of_form = np.flatnonzero(released.uses(form)).tolist()
        earliest = min(of_form, key=released.values.__getitem__)
        self.counts.tick_zero = released.column.texts[earliest]
        return Start({form: released.values[earliest]})

    def release_ticks(self, released: TimeColumn, start: Start) -> NDArray[np.int64]:
        """(n,) ticks of release, below 0 for rows released before tick 0."""
        is_empty = np.array([not text for text in released.column.texts])
        self.refuse(released.name, "empty", is_empty, lambda text: "is empty")
        ticks: NDArray[np.int64] = self._ticks_of(released, start)[released.column.codes]
        return ticks

    def due_ticks(
        self, due: TimeColumn, start: Start, release: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """(n,) due ticks of rows, or NO_DUE; they may be before the release."""
        codes = due.column.codes
        ticks = self._ticks_of(due, start)[codes]
        ticks += np.where(due.uses(TICKS)[codes], release, 0)
        np.clip(ticks, -LAST_TICK, LAST_TICK, out=ticks)
        ticks[due.uses(EMPTY)[codes]] = NO_DUE
        return ticks

    def _ticks_of(self, times: TimeColumn, start: Start) -> NDArray[np.int64]:
        """The ticks of each different text: counted from tick 0, or as given.

        Counts the rows whose time falls between two ticks.
        """
        ticks, has_clock = np.zeros(len(times.values), np.int64), self.scale.clock is not None
        for form in np.unique(times.forms[times.forms != EMPTY]).tolist():
            is_of_form = times.uses(form)
            codes = np.flatnonzero(is_of_form).tolist()
            values = [times.values[code] for code in codes]
            if form != TICKS and form not in start.of_form:
                sentence = partial(misplaced, form=form, start=start, has_clock=has_clock)
                self.refuse(times.name, f"form {form}", is_of_form, sentence)
                continue
            is_between = [False] * len(values)
            if form in start.of_form:
                after = [value - start.of_form[form] for value in values]
                values, is_between = rounded_ticks(after, self.scale.tick_seconds)
            of_rows = np.bincount(times.column.codes, minlength=len(ticks))[codes]
            self.counts.rounded += int(of_rows[is_between].sum())
            ticks[codes] = [max(-LAST_TICK, min(value, LAST_TICK + 1)) for value in values]
        most = ticks_and_time(LAST_TICK, self.scale.unit)
        is_late = ticks > LAST_TICK
        self.refuse(times.name, "late", is_late, lambda text: f"{quoted(text)} is after {most}")
        return ticks
