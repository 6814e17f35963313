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

import datetime
import math
import re
from collections.abc import Sequence
from fractions import Fraction
from typing import Final, NamedTuple

from automaton.errors import InputError
from automaton.scenario.amounts import Dimension, read_amount
from automaton.scenario.clock_times import SECONDS_OF_DAY, Moment
from automaton.scenario.quantities import TIME, Scale

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
