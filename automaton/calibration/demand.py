"""Fit the rates of a week and the sizes of batches to a file of orders.

    rate of an hour of the week    mean number of orders in it, over all such hours that the file covers
    batch                          orders with one release time
    dispersion                     variance / mean of the orders in an hour; 1 for Poisson arrivals

The result runs as `orders.arrivals: {profile: week.csv, batch: ...}`. Orders come singly if rounded
release times alone explain the equal ones.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Mapping
from pathlib import Path
from statistics import NormalDist
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.errors import InputError
from automaton.scenario.arrivals import HOURS_OF_DAY, HOURS_OF_WEEK, SECONDS_OF_HOUR
from automaton.scenario.file_times import MICRO, TICKS, read_time
from automaton.scenario.quantities import Scale
from automaton.scenario.table_fields import ReleaseField, TableOptions, TextField
from automaton.scenario.table_reader import read_columns
from automaton.units import count

Array = np.ndarray[Any, Any]
Batch = int | dict[str, Any]  # as in `orders.arrivals.batch`

MIN_WEEKS: Final = 4
DAYS_OF_WEEK: Final = 7
SECOND_TICKS: Final = Scale("1 s")
POISSON_ERROR: Final = 0.05
POISSON_DISPERSION: Final = (0.8, 1.25)  # within it, arrivals may be called Poisson in any case
MIN_HOUR_MEAN: Final = 1.0  # orders in an hour; rarer ones say nothing about dispersion
SIZES: Final = 100  # of an empirical distribution
SIZE_SHARES: Final = (0.5, 0.75, 0.9, 0.95, 0.99)
SIZE_ERROR: Final = 0.05  # of a share of sizes that a distribution may be off; an order in any case
TIES_SIGMA: Final = 3.0
TIES_SHARE: Final = 0.01  # of all orders: so few in batches need none


class Releases(NamedTuple):
    """The release times of orders."""

    first: datetime.datetime  # of the earliest order, in the time of the site
    seconds: Array  # (n,) int64 seconds after the first, ascending


class Dispersion(NamedTuple):
    """Variance / mean of counts in an hour, over the hours of the week with enough of them."""

    value: float  # nan: not known
    degrees: int
    p: float  # two-sided; null hypothesis: Poisson

    @property
    def is_poisson(self) -> bool | None:
        """Whether Poisson arrivals would do; None: the counts are too few to say."""
        if not self.degrees:
            return None
        low, high = POISSON_DISPERSION
        return self.p >= POISSON_ERROR or low <= self.value <= high


class WeeklyDemand(NamedTuple):
    """The demand of a file of orders."""

    first: datetime.datetime  # of the earliest order
    days: int  # calendar days from the first order to the last
    weeks: Array  # (w, 168) orders in each hour from Monday 0:00 on; nan before the first, after the last
    rates: Array  # (168,) mean orders in each hour of the week
    orders: Dispersion
    batches: Dispersion
    sizes: Array  # (b,) orders of each batch
    batch: Batch
    zero_gaps: float  # share of the times between two orders that are 0
    gap_variation: float  # standard deviation / mean of these times
    fitted_dispersion: float  # of hours of the profile with its batches

    @property
    def orders_of_batch(self) -> float:
        """The mean size of the fitted batches."""
        return float(np.mean(batch_sizes(self.batch)))

    @property
    def total(self) -> int:
        """The number of orders."""
        return int(self.sizes.sum())

    @property
    def weekly(self) -> list[float]:
        """The mean number of orders an hour in each week that is covered for the most part."""
        is_known = ~np.isnan(self.weeks)
        weeks = np.where(is_known, self.weeks, self.rates)[is_known.mean(axis=1) > 0.5]
        means: list[float] = weeks.mean(axis=1).tolist()
        return means


def read_releases(
    path: Path, columns: Mapping[str, str] | None = None, time: str | None = None
) -> Releases:
    """Read the release times of a file of orders; `columns`, `time`: as in `orders.transports`.

    Raises InputError for a file without dates.
    """
    options = TableOptions(file=str(path), time=time)
    name = (columns or {}).get("released", "released")
    names = {"released": name, "text": name}
    fields = ReleaseField(), TextField("text")
    table = read_columns(path, fields, options, names, SECOND_TICKS, (), False)
    table.errors.raise_any()
    text = table.counts.tick_zero
    earliest = read_time(text, time, SECOND_TICKS)
    if not text or earliest.form == TICKS or earliest.value < 400 * 86_400 * MICRO:
        column = table.column_of["released"]
        example = "such as 2026-03-02 06:30"
        raise InputError(f"{column} needs a date in each row, {example}", str(path))
    since = datetime.timedelta(microseconds=earliest.value)
    utc = datetime.datetime.fromordinal(1) + since - datetime.timedelta(days=1)
    # Daylight saving changes the offset within a file.
    offsets = [_offset_of(one, time).total_seconds() for one in table.names["text"]]
    shifts = np.array(offsets, np.int64)[table.values["text"]]
    seconds = np.sort(table.values["released"] + shifts)
    return Releases(utc + datetime.timedelta(seconds=int(seconds[0])), seconds - seconds[0])


def releases_at(moments: Array) -> Releases:
    """Releases at milliseconds since 1970, (n,) in the time of the site, at least one."""
    first = int(moments.min())
    begin = datetime.datetime(1970, 1, 1) + datetime.timedelta(milliseconds=first)
    return Releases(begin, np.sort((moments - first) // 1000))


def _offset_of(text: str, time: str | None) -> datetime.timedelta:
    """The offset from UTC that a time says, so that hours are those of the site."""
    try:
        moment = (
            datetime.datetime.strptime(text, time)
            if time
            else datetime.datetime.fromisoformat(text)
        )
    except ValueError:
        return datetime.timedelta()
    return moment.utcoffset() or datetime.timedelta()


def fit_demand(releases: Releases) -> WeeklyDemand:
    """Fit the rates of a week and the sizes of batches."""
    monday = datetime.datetime.combine(releases.first.date(), datetime.time())
    monday -= datetime.timedelta(days=releases.first.weekday())
    at = releases.seconds + round((releases.first - monday).total_seconds())
    times, sizes = np.unique(at, return_counts=True)
    weeks, batches = (orders_by_hour(some, int(at[0]), int(at[-1])) for some in (at, times))
    gaps = np.diff(at)
    batch = 1 if ties_are_rounded(times, sizes, weeks) else fitted_batch(sizes)
    drawn = np.array(batch_sizes(batch), float)
    mean_gap = float(gaps.mean()) if len(gaps) else 0.0
    covered = ~np.isnan(weeks)
    return WeeklyDemand(
        first=releases.first,
        days=int(np.ptp(at[[0, -1]] // (HOURS_OF_DAY * SECONDS_OF_HOUR))) + 1,
        weeks=weeks,
        rates=np.nansum(weeks, axis=0) / np.maximum(covered.sum(axis=0), 1),
        orders=dispersion(weeks),
        batches=dispersion(batches),
        sizes=sizes,
        batch=batch,
        zero_gaps=float((gaps == 0).mean()) if len(gaps) else 0.0,
        gap_variation=float(gaps.std()) / mean_gap if mean_gap else 0.0,
        fitted_dispersion=float((drawn**2).mean() / drawn.mean()),
    )


def orders_by_hour(seconds: Array, first: int, last: int) -> Array:
    """(w, 168) how many of the times, in seconds from a Monday 0:00 on, are in each hour; nan outside of
    the hours from that of `first` to that of `last`."""
    begin, end = first // SECONDS_OF_HOUR, last // SECONDS_OF_HOUR + 1
    hours = np.full(-(-end // HOURS_OF_WEEK) * HOURS_OF_WEEK, np.nan)
    hours[begin:end] = np.bincount(seconds // SECONDS_OF_HOUR, minlength=end)[begin:]
    return hours.reshape(-1, HOURS_OF_WEEK)


def check_weeks(demand: WeeklyDemand, file: str) -> None:
    """The file covers enough weeks for rates by hour of the week. Raises InputError."""
    if demand.days < MIN_WEEKS * DAYS_OF_WEEK:
        text = f"rates by hour of the week need at least {MIN_WEEKS} weeks"
        raise InputError(f"covers {count(demand.days, 'day')}; {text}", file)


def dispersion(weeks: Array) -> Dispersion:
    """Variance / mean of counts, from hours of the week that are there twice at least.

    The test is that of Fisher for the sum of all hours; its chi-square is transformed to a normal
    variable (Wilson & Hilferty 1931), which is exact enough from 30 degrees of freedom on.
    """
    many = (~np.isnan(weeks)).sum(axis=0)
    mean = np.nansum(weeks, axis=0) / np.maximum(many, 1)
    used = (many > 1) & (mean >= MIN_HOUR_MEAN)
    chi_square = float((np.nansum((weeks - mean) ** 2, axis=0)[used] / mean[used]).sum())
    degrees = int((many[used] - 1).sum())
    if not degrees:
        return Dispersion(math.nan, 0, math.nan)
    spread = 2 / (9 * degrees)
    z = ((chi_square / degrees) ** (1 / 3) - (1 - spread)) / math.sqrt(spread)
    return Dispersion(chi_square / degrees, degrees, 2 * NormalDist().cdf(-abs(z)))


def ties_are_rounded(times: Array, sizes: Array, weeks: Array) -> bool:
    """Whether as many orders have equal times as rounding the times of single orders would cause."""
    unit = int(np.gcd.reduce(np.diff(times))) if len(times) > 1 else 1
    slots = max(SECONDS_OF_HOUR // max(unit, 1), 1)
    busy = weeks[weeks > 0]
    expected = float((busy - slots * (1 - (1 - 1 / slots) ** busy)).sum())
    ties = int((sizes - 1).sum())
    return ties <= expected + max(TIES_SIGMA * math.sqrt(expected), TIES_SHARE * float(sizes.sum()))


def fitted_batch(sizes: Array) -> Batch:
    """The sizes of batches as the key `batch`: a number, geometric, or SIZES equally likely sizes."""
    mean = round(float(sizes.mean()), 4)
    if (sizes == sizes[0]).all():
        return int(sizes[0])
    geometric: Batch = {"exponential": mean}
    if all(
        abs(fitted - real) <= max(1.0, SIZE_ERROR * real)
        for fitted, real in zip(quantiles_of(geometric), size_quantiles(sizes), strict=True)
    ):
        return geometric
    # The mean size of each hundredth: it keeps the rare large ones.
    parts = np.array_split(np.sort(sizes), min(SIZES, len(sizes)))
    levels = [max(1, round(float(part.mean()))) for part in parts]
    common = math.gcd(*np.unique(levels, return_counts=True)[1].tolist())
    return {"empirical": levels[::common]}


def batch_sizes(batch: Batch) -> list[int]:
    """Equally likely sizes of a batch."""
    if isinstance(batch, int):
        return [batch]
    if "empirical" in batch:
        return list(batch["empirical"])
    shares = (np.arange(10 * SIZES) + 0.5) / (10 * SIZES)
    chance = min(1 / batch["exponential"], 1 - 1e-12)
    sizes: list[int] = np.ceil(np.log1p(-shares) / math.log1p(-chance)).astype(int).tolist()
    return sizes


def quantiles_of(batch: Batch) -> list[int]:
    """The sizes of a batch at SIZE_SHARES."""
    return size_quantiles(np.array(batch_sizes(batch)))


def size_quantiles(sizes: Array) -> list[int]:
    """The size that each of SIZE_SHARES has at most."""
    at_most: list[int] = np.quantile(sizes, SIZE_SHARES, method="inverted_cdf").tolist()
    return at_most


def week_rows(rates: Array) -> list[dict[str, float]]:
    """Rates as the rows of a profile; days without orders have no rows."""
    return [
        {"weekday": day, "hour": hour, "orders": round(rate, 4)}
        for day, of_day in enumerate(rates.reshape(DAYS_OF_WEEK, HOURS_OF_DAY).tolist(), 1)
        for hour, rate in enumerate(of_day if any(of_day) else ())
    ]


def week_csv(rates: Array) -> str:
    """Rates as the file of a profile."""
    rows = [",".join(f"{value:.10g}" for value in row.values()) for row in week_rows(rates)]
    return "\n".join(["weekday,hour,orders", *rows, ""])


def arrival_settings(demand: WeeklyDemand, orders: Mapping[str, Any]) -> dict[str, Any]:
    """The demand as settings of `orders`, which has other arrivals now."""
    arrivals = {"profile": week_rows(demand.rates), "batch": demand.batch}
    settings: dict[str, Any] = {"arrivals": arrivals}
    settings |= {"mean_interarrival_time": 0} if orders.get("mean_interarrival_time") else {}
    settings |= {"count": None} if orders.get("count") else {}
    lines = orders.get("lines")
    if isinstance(lines, Mapping):  # rows of a file are lines, and batches have those of an order
        own = {
            key: lines[key] for key in lines if key not in ("mean_interarrival_time", "per_order")
        }
        settings |= {"lines": own}
    return settings
