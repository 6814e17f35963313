"""Clock times: "2026-03-02 06:30", or "06:30" on the day of the clock, which says when tick 0 is."""

from __future__ import annotations

import datetime
import math
import re
from fractions import Fraction
from typing import Final, NamedTuple

from automaton.errors import InputError

EXAMPLES: Final = "'2026-03-02 06:30' or '06:30'"
_TIME: Final = r"([0-9]{1,2}):([0-9]{2})(?::([0-9]{2}(?:\.[0-9]+)?))?"
_DATE: Final = r"([0-9]{4})-([0-9]{1,2})-([0-9]{1,2})"
_MOMENT: Final = re.compile(rf"\s*(?:{_DATE}(?:[Tt]|\s+))?{_TIME}\s*")
_BARE_TIME: Final = re.compile(rf"\s*{_TIME}\s*")
_LIKE_A_DATE: Final = re.compile(r"\s*([0-9]{4}-[0-9]|[0-9]{1,2}[./][0-9]{1,2}[./][0-9])")
_ZONE: Final = re.compile(r"(Z|[-+][0-9]{1,2}(:?[0-9]{2})?)\s*$")
_OFFSET: Final = re.compile(r"\s*(Z|([-+])([0-9]{2}):([0-5][0-9]))\s*$")
SECONDS_OF_DAY: Final = 86_400
NO_DATE: Final = 0  # days since 0001-01-01 begin with 1


class Moment(NamedTuple):
    """A clock time."""

    day: int | None  # days since 0001-01-01; None: of a time without a date
    seconds: Fraction  # since midnight
    offset: int | None = None  # seconds that it is ahead of UTC, where the clock says so


def is_clock_time(text: str) -> bool:
    """Whether a text is a clock time, or looks like one, rather than a duration of three parts."""
    match = _MOMENT.fullmatch(text)
    return has_date(text) or (match is not None and match[6] is None)


def has_date(text: str) -> bool:
    """Whether a text looks like a date, with a time or without."""
    match = _MOMENT.fullmatch(text)
    return _LIKE_A_DATE.match(text) is not None or (match is not None and match[1] is not None)


def is_of_three_parts(text: str) -> bool:
    """Whether a text is H:MM:SS, a duration that is also a time of the day."""
    match = _BARE_TIME.fullmatch(text)
    return match is not None and match[3] is not None


def read_moment(text: str) -> Moment:
    """A date with a time, or a time. Raises InputError."""
    match = _MOMENT.fullmatch(text)
    if match is None:
        raise InputError(_why_not(text))
    year, month, day, hours, minutes, seconds = match.groups()
    if int(hours) > 23 or int(minutes) > 59 or Fraction(seconds or 0) >= 60:
        raise InputError(f"'{text}' is not a time of the day; they go from 00:00 to 23:59")
    since_midnight = 3600 * int(hours) + 60 * int(minutes) + Fraction(seconds or 0)
    if year is None:
        return Moment(None, since_midnight)
    try:
        date = datetime.date(int(year), int(month), int(day))
    except ValueError:
        raise InputError(f"'{text}': there is no such day") from None
    return Moment(date.toordinal(), since_midnight)


def read_clock(text: str) -> Moment:
    """The time of tick 0: as other moments and, after a date, with an offset. Raises InputError."""
    match = _OFFSET.search(text)
    if match is None or not has_date(text):
        return read_moment(text)
    moment = read_moment(text[: match.start()])
    seconds = 3600 * int(match[3] or 0) + 60 * int(match[4] or 0)
    return moment._replace(offset=-seconds if match[2] == "-" else seconds)


def _why_not(text: str) -> str:
    if _ZONE.search(text) and _MOMENT.fullmatch(_ZONE.sub("", text)):
        return f"'{text}' has a time zone; write it in the time of the place, such as {EXAMPLES}"
    if _LIKE_A_DATE.match(text):
        return f"'{text}' is not a date with a time, such as '2026-03-02 06:30'"
    return f"'{text}' is not a clock time, such as {EXAMPLES}"


def clock_text(clock: Moment, seconds: Fraction) -> str:
    """The clock time so many seconds after tick 0, whole ones: "06:30"; on another day with its date.

    Where the clock has no date, its day is day 1.
    """
    days, rest = divmod(math.floor(clock.seconds + seconds), SECONDS_OF_DAY)
    time = f"{rest // 3600:02}:{rest // 60 % 60:02}"
    time += f":{rest % 60:02}" if rest % 60 else ""
    if not days:
        return time
    day = NO_DATE if clock.day is None else clock.day + days
    if not 1 <= day <= datetime.date.max.toordinal():
        return f"{time} on day {days + 1:,}"
    return f"{datetime.date.fromordinal(day)} {time}"


def seconds_after(clock: Moment | None, text: str, may_precede: bool = False) -> Fraction:
    """Seconds from tick 0 to a clock time; `may_precede`: it may be earlier. Raises InputError."""
    moment = read_moment(text)
    if clock is None:
        raise InputError(
            f"'{text}' is a clock time, and units.clock does not say what time it is in tick 0; set it, "
            f"such as units: {{clock: '{text}'}}"
        )
    days = 0
    if moment.day is not None:
        if clock.day is None:
            raise InputError(f"'{text}' has a date, and units.clock has none; set it with a date")
        days = moment.day - clock.day
    seconds = days * SECONDS_OF_DAY + moment.seconds - clock.seconds
    if seconds < 0 and not may_precede:
        bare = "" if moment.day is not None else "; a time without a date is of the clock's own day"
        raise InputError(f"'{text}' is before tick 0, which is units.clock{bare}")
    return seconds
