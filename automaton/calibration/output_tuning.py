"""Tune at most two numbers of a scenario so that simulated days agree with the site.

    error      mean over the days and seeds of (simulated / site - 1), of throughput and of lead time
    loss       sum of (error / tolerance of `compare`) squared
    search     grids over the logarithms of factors, each half as wide as the one before, around the least
               loss of a quadratic fit of the errors; all values run the same days with the same seeds
    interval   Student's over days: near the optimum errors are linear in the logarithm, so the error
               of a day gives the number that this day asks for

These days cannot judge the model any more: it was made to agree with them.
"""

from __future__ import annotations

import copy
import itertools
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.agreement import DECISIVE, TOLERANCES
from automaton.calibration.compared_days import DayRuns
from automaton.calibration.site_day import ComparedSite, SiteDay, with_changes
from automaton.documents.report_document import Block, Heading, Listed, Table, Text
from automaton.errors import InputError, nearest
from automaton.studies.inference.intervals import mean_interval

Array = np.ndarray[Any, Any]

MAX_TUNED: Final = 2
LOSS_UNITS: Final = np.array([TOLERANCES[name] for name in DECISIVE])
TUNED_SECTIONS: Final = ("durations", "fleet", "battery", "faults", "floor", "stations", "strategy")
AMOUNT: Final = re.compile(r"([0-9]+(?:\.[0-9]+)?)( ?[a-z%/][^ ]*)")
HALF_WIDTHS: Final = (0.8, 0.4, 0.2, 0.1)  # of the grids
MIN_GRIDS: Final = 2
GRID_SIZE: Final = {1: 5, 2: 3}  # values of a number, by how many numbers are tuned
SEARCHED: Final = 41  # values of a number at which the fit is evaluated
DAYS_AND_SEEDS: Final = 12  # runs of a value, at least
REMAINS: Final = 0.02  # loss of a factor of e: a number that days do not determine stays as it is
MAX_LOSS_OF_STEPS: Final = 0.1
WEAK: Final = 0.05  # relative change of an output for a factor of e that is too small to tune by
ONE_VALUE: Final = 0.05  # ratio of the effects of two combinations of numbers


class TunedNumber(NamedTuple):
    """A number of a scenario."""

    key: str
    amount: float
    unit: str  # with the blank before it; "" for a plain number
    is_whole: bool

    @property
    def keys(self) -> list[Any]:
        """The keys that lead to it, and places in lists."""
        return [int(key) if key.isdecimal() else key for key in self.key.split(".")]

    def value(self, factor: float) -> Any:
        """The number times a factor, as a scenario writes it."""
        if self.is_whole:
            return max(1, round(self.amount * factor))
        amount = float(f"{self.amount * factor:.4g}")
        text = np.format_float_positional(amount, trim="-")
        return f"{text}{self.unit}" if self.unit else amount


class TunedValue(NamedTuple):
    """A number before and after tuning."""

    number: TunedNumber
    factor: float
    ends: tuple[float, float] | None  # of the 95 % interval of the factor; None: one day


class TunedOutput(NamedTuple):
    """A quantity, mean over the days."""

    site: float
    before: float  # of the runs
    after: float


class Tuning(NamedTuple):
    """The result of tuning."""

    tuned: list[TunedValue]
    outputs: dict[str, TunedOutput]
    days: list[str]
    values: int  # that were tried
    runs: int
    budget: int
    doubts: list[str]


def numbers_in(data: Any, prefix: str = "") -> Iterator[TunedNumber]:
    """Yield the numbers in the part of a scenario that tuning may change."""
    if isinstance(data, Mapping | list):
        pairs = data.items() if isinstance(data, Mapping) else enumerate(data)
        for name, value in ((str(name), value) for name, value in pairs):
            if prefix or name in TUNED_SECTIONS:
                yield from numbers_in(value, f"{prefix}.{name}" if prefix else name)
    elif isinstance(data, int | float) and not isinstance(data, bool):
        yield TunedNumber(prefix, float(data), "", isinstance(data, int))
    elif isinstance(data, str) and (match := AMOUNT.fullmatch(data)):
        yield TunedNumber(prefix, float(match[1]), match[2], False)


def tuned_numbers(keys: Sequence[str], data: Mapping[str, Any]) -> list[TunedNumber]:
    """The numbers of a scenario to tune. Raises InputError."""
    if len(keys) > MAX_TUNED:
        raise InputError(
            f"--tune names {len(keys)} numbers; use {MAX_TUNED} at most, since more would fit any site"
        )
    known = {one.key: one for one in numbers_in(data)}
    for key in keys:
        if key not in known:
            hint = nearest(key, known) or f", such as {next(iter(known), 'durations.pick')}"
            raise InputError(f"--tune: '{key}' is not a number of the scenario{hint}")
        if not known[key].amount:
            raise InputError(f"--tune: {key} is 0, and a number is tuned by factors")
    return [known[key] for key in dict.fromkeys(keys)]


def with_numbers(
    settings: dict[str, Any], data: Mapping[str, Any], tuned: Sequence[TunedValue]
) -> None:
    """Put tuned numbers into settings; the rest of their sections is that of `data`."""
    for one in tuned:
        section, name, *rest = one.number.keys
        part = settings.setdefault(section, {})
        if rest:
            inner = part[name] = copy.deepcopy(part.get(name, data[section][name]))
            for key in rest[:-1]:
                inner = inner[key]
            inner[rest[-1]] = one.number.value(one.factor)
        else:
            part[name] = one.number.value(one.factor)


class DayTrials:
    """Runs days with other numbers, and counts the runs."""

    def __init__(
        self,
        site: ComparedSite,
        days: Sequence[SiteDay],
        numbers: Sequence[TunedNumber],
        budget: int,
        runs: DayRuns,
    ) -> None:
        self.site, self.days, self.numbers, self.of_days = site, days, numbers, runs
        self.real = np.array([[real[name] for name in DECISIVE] for real in runs.real])
        if not np.isfinite(self.real).all() or not self.real.all():
            raise InputError(
                "--tune: a day has no order that is done, so its lead time is not known"
            )
        self.seeds = max(2, math.ceil(DAYS_AND_SEEDS / len(days)))
        of_grid = self.seeds * len(days) * GRID_SIZE[len(numbers)] ** len(numbers)
        self.grids = min(budget // of_grid, len(HALF_WIDTHS))
        if self.grids < MIN_GRIDS:
            need = MIN_GRIDS * of_grid
            raise InputError(f"--budget {budget:,}: days of this log need at least {need:,} runs")
        self.runs = 0
        self.tried: dict[str, Array] = {}  # (days, quantities) mean of the runs, by values
        self.points: list[tuple[Array, Array]] = []  # logarithms of factors, errors of days

    def errors(self, logs: Array, on_done: Callable[[int], None]) -> Array:
        """(days, quantities) simulated / site - 1, mean over the seeds."""
        values = [one.value(math.exp(log)) for one, log in zip(self.numbers, logs, strict=True)]
        changes = [
            f"{one.key}={json.dumps(value)}"
            for one, value in zip(self.numbers, values, strict=True)
        ]
        if repr(values) not in self.tried:
            days = [with_changes(self.site, day, changes) for day in self.days]
            done = self.of_days.of(days, self.seeds, on_done)
            self.runs += len(days) * self.seeds
            quantities = [[[run[name] for name in DECISIVE] for run in runs] for runs in done]
            self.tried[repr(values)] = np.nan_to_num(np.array(quantities)).mean(axis=1)
        errors: Array = self.tried[repr(values)] / self.real - 1
        rounded = [
            math.log(value / one.amount) if one.is_whole else log
            for one, value, log in zip(self.numbers, values, logs.tolist(), strict=True)
        ]
        self.points.append((np.array(rounded), errors))
        return errors

    def slopes_and_best(self, centre: Array, half: float) -> tuple[Array, Array]:
        """The least loss near a centre, by a quadratic fit: (quantities, numbers) slopes of the errors
        there, and the logarithms."""
        near = [one for one in self.points if np.abs(one[0] - centre).max() <= 1.5 * half]
        logs = np.array([logs for logs, _ in near]) - centre
        means = np.array([errors.mean(axis=0) for _, errors in near])
        terms = np.linalg.lstsq(quadratic(logs), means, rcond=None)[0]
        steps = np.linspace(-half, half, SEARCHED)
        grid = np.stack(np.meshgrid(*[steps] * len(centre)), axis=-1).reshape(-1, len(centre))
        loss = ((quadratic(grid) @ terms / LOSS_UNITS) ** 2).sum(axis=1)
        best = grid[np.argmin(loss + REMAINS * ((grid + centre) ** 2).sum(axis=1))]
        ahead = np.stack(
            [quadratic(best + sign * half / 10 * np.eye(len(best))) for sign in (1, -1)]
        )
        slopes: Array = ((ahead[0] - ahead[1]) @ terms / (half / 5)).T
        return slopes, centre + best


def loss_of(errors: Array) -> float:
    """The loss of errors of days."""
    return float(((errors.mean(axis=0) / LOSS_UNITS) ** 2).sum())


def quadratic(logs: Array) -> Array:
    """(n, terms) the terms of a quadratic function of each row of (n, numbers)."""
    first, second = np.triu_indices(logs.shape[1])
    return np.column_stack([np.ones(len(logs)), logs, logs[:, first] * logs[:, second]])


def tune_outputs(
    site: ComparedSite,
    days: Sequence[SiteDay],
    numbers: Sequence[TunedNumber],
    budget: int,
    workers: int | None,
    on_done: Callable[[int], None],
) -> Tuning:
    """Find the values at which throughput and lead time agree best. Raises InputError."""
    with DayRuns(days, workers) as of_days:
        trials = DayTrials(site, days, numbers, budget, of_days)
        best = np.zeros(len(numbers))
        trials.errors(best, on_done)
        for half in HALF_WIDTHS[: trials.grids]:
            steps = np.linspace(-half, half, GRID_SIZE[len(numbers)])
            for step in itertools.product(steps, repeat=len(numbers)):
                trials.errors(best + step, on_done)
            slopes, best = trials.slopes_and_best(best, half)
        errors = trials.errors(best, on_done)
        steps_off = loss_of(errors) - MAX_LOSS_OF_STEPS
        logs, others = min(trials.points, key=lambda point: loss_of(point[1]))
        if loss_of(others) < steps_off:  # whole numbers and ticks have no values in between
            best, errors = logs, others
    ends = intervals(slopes, errors / LOSS_UNITS, best)
    tuned = [
        TunedValue(number, math.exp(log), end)
        for number, log, end in zip(numbers, best.tolist(), ends, strict=True)
    ]
    before, after = (
        ((one + 1) * trials.real).mean(axis=0).tolist() for one in (trials.points[0][1], errors)
    )
    rows = zip(DECISIVE, trials.real.mean(axis=0).tolist(), before, after, strict=True)
    return Tuning(
        tuned,
        {name: TunedOutput(*values) for name, *values in rows},
        [day.name for day in days],
        len(trials.tried),
        trials.runs,
        budget,
        list(doubts_about(trials, slopes, best)),
    )


def intervals(slopes: Array, errors: Array, best: Array) -> Iterator[tuple[float, float] | None]:
    """Yield the ends of the interval of each factor; `errors`: (days, quantities), in tolerances."""
    of_days = best - errors @ np.linalg.pinv(slopes / LOSS_UNITS[:, None]).T  # (days, numbers)
    is_known = ~is_weak(slopes) & (not is_one_value(slopes))
    for log, values, known in zip(best.tolist(), of_days.T, is_known.tolist(), strict=True):
        half = mean_interval(values.tolist()).half if known else None
        yield None if half is None else (math.exp(log - half), math.exp(log + half))


def is_weak(slopes: Array) -> Array:
    """(numbers,) whether the outputs hardly depend on each number."""
    weak: Array = np.abs(slopes).max(axis=0) < WEAK
    return weak


def is_one_value(slopes: Array) -> bool:
    """Whether several numbers change the outputs in one proportion."""
    sizes = np.linalg.svd(slopes / LOSS_UNITS[:, None], compute_uv=False)
    return slopes.shape[1] > 1 and bool(sizes[-1] < ONE_VALUE * sizes[0])


def doubts_about(trials: DayTrials, slopes: Array, best: Array) -> Iterator[str]:
    """Yield reasons for which the result says little."""
    if len(trials.days) < 2:
        yield "one day has no spread, so there is no interval"
    for number, log, weak in zip(
        trials.numbers, best.tolist(), is_weak(slopes).tolist(), strict=True
    ):
        if weak:
            yield f"orders an hour and lead time hardly depend on {number.key}"
        if abs(log) > 0.9 * sum(HALF_WIDTHS[: trials.grids]):
            yield f"{number.key} is at the end of the range that was searched"
    if is_one_value(slopes):
        names = " and ".join(number.key for number in trials.numbers)
        yield f"these days determine one combination of {names}, not each"
    if trials.grids < len(HALF_WIDTHS):
        yield f"the budget allowed {trials.grids} of {len(HALF_WIDTHS)} grids"


def tuning_blocks(tuning: Tuning) -> list[Block]:
    """What was tuned, by how much, and the outputs before and after."""
    changes = " and ".join(change_words(one) for one in tuning.tuned)
    days = f"{len(tuning.days)} days" if len(tuning.days) > 1 else "the day"
    rows = [
        [
            name,
            *(f"{value:,.1f}" for value in one),
            *(f"{100 * (value / one.site - 1):+.1f} %" for value in one[1:]),
        ]
        for name, one in tuning.outputs.items()
    ]
    spent = f"{tuning.runs:,} of at most {tuning.budget:,} runs, {tuning.values} values"
    return [
        Heading("Tuned outputs"),
        Text(
            f"Outputs were tuned: {changes}, so that throughput and lead time of {days} agree with the "
            "site. These days cannot judge the model any more: `automaton compare` needs other days.",
            strong=True,
        ),
        Table(["mean of the days", "site", "before", "after", "diff. before", "after"], rows),
        Listed([*tuning.doubts, spent]),
    ]


def change_words(one: TunedValue) -> str:
    """A tuned number: "durations.pick from 8 s to 9.4 s (95 % interval 9.1 s to 9.8 s)"."""
    number = one.number
    ends = one.ends and " to ".join(str(number.value(end)) for end in one.ends)
    interval = f" (95 % interval {ends})" if ends else ""
    return f"{number.key} from {number.value(1)} to {number.value(one.factor)}{interval}"


def tuning_record(tuning: Tuning) -> dict[str, Any]:
    """The result as a JSON object."""
    return {
        "numbers": [
            {
                "key": one.number.key,
                "before": one.number.value(1),
                "after": one.number.value(one.factor),
                "low": None if one.ends is None else one.number.value(one.ends[0]),
                "high": None if one.ends is None else one.number.value(one.ends[1]),
            }
            for one in tuning.tuned
        ],
        "outputs": [{"quantity": name, **one._asdict()} for name, one in tuning.outputs.items()],
        "days": tuning.days,
        "values": tuning.values,
        "runs": tuning.runs,
        "budget": tuning.budget,
        "doubts": tuning.doubts,
    }
