"""The best point of a study, or the points among which it lies as far as the runs show.

Points are compared where they differ by choice: by fleet, strategies and the like. What is a condition
instead, such as the orders or the floor, parts a study into as many questions.

    point i is left out if it is worse than the leading one, b, by more than chance allows:
    mean i - mean b > t(1 - error / (k - 1)) times its standard error, one-sided

Of k points the best is then left with a probability of 1 - error at least, whatever depends on what
(subset selection: Gupta 1965, with Bonferroni's inequality). One left: it is the best. Points with runs
that failed, lack or did not finish are not compared, since means leave such runs out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from automaton.studies.inference.effects import effect
from automaton.studies.inference.intervals import NO_SPREAD_WARNING, STUDENT_MIN_RUNS
from automaton.studies.reports.directions import Direction, direction_of
from automaton.studies.reports.point_names import levels_named, varied_factors
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import SCENARIO, Point

CONDITIONS: Final = (
    SCENARIO,
    "layout",
    "orders",
    "durations",
    "faults",
    "stop",
    "units",
    "measure",
)


class Answer(NamedTuple):
    """What the runs say of the best point under some conditions."""

    metric: str
    better: Direction | None  # None: neither is
    conditions: str  # "scenario tabletop-1"; "": all points are compared
    compared: tuple[Point, ...]  # of identical points the first
    candidates: tuple[Point, ...]  # the best is one of them; the leading one comes first
    incomplete: tuple[Point, ...]  # not compared: not all of their runs finished
    few_runs: int  # the fewest of a point, if they are few for Student's t; else 0
    level: float  # of certainty

    @property
    def leading(self) -> Point | None:
        """The point with the best mean."""
        return self.candidates[0] if self.candidates else None

    @property
    def best(self) -> Point | None:
        """The best point, if the runs show which one it is."""
        is_settled = len(self.candidates) == 1 and len(self.compared) > 1
        return self.candidates[0] if is_settled else None


def answers(results: Results) -> list[Answer]:
    """For the analysis' first metric, one answer for each of the conditions; all hold together.

    None if no run has any metric.
    """
    if not results.analysis.metrics:
        return []
    metric = results.analysis.metrics[0]
    groups = groups_by_condition(results)
    level = 1 - results.analysis.error / len(groups)
    return [_answer(results, metric, name, points, level) for name, points in groups.items()]


def groups_by_condition(results: Results) -> dict[str, list[Point]]:
    """The points by the conditions under which they are compared; "": these are equal everywhere."""
    study, conditions = results.study, condition_factors(results)
    groups: dict[str, list[Point]] = {}
    for point in results.points:
        name = levels_named(study, point, conditions)
        groups.setdefault(name, []).append(point)
    return groups


def condition_factors(results: Results) -> list[str]:
    """The factors that are conditions; none if nothing else varies, since these are compared then."""
    study = results.study
    several = [SCENARIO] if len(study.scenarios) > 1 else []
    varied = [*several, *varied_factors(study)]
    conditions = [name for name in varied if name.partition(".")[0] in CONDITIONS]
    return [] if len(conditions) == len(varied) else conditions


def _answer(
    results: Results, metric: str, conditions: str, points: Sequence[Point], level: float
) -> Answer:
    identical = results.identical(metric)
    complete = [point for point in points if is_complete(results, point, metric)]
    first = {identical[point.number]: point for point in reversed(complete)}
    compared = tuple(sorted(first.values(), key=lambda point: point.number))
    better = direction_of(metric)
    ranked = sorted(
        compared,
        key=lambda point: mean_of(results, point, metric) * (-1 if better == "highest" else 1),
    )
    kept_in = [] if better is None else list(_candidates(results, metric, ranked, better, level))
    counts = [len(results.values(point, metric)) for point in compared]
    few = min(counts, default=0)
    return Answer(
        metric,
        better,
        conditions,
        compared,
        tuple(kept_in),
        tuple(point for point in points if point not in complete),
        few if few < STUDENT_MIN_RUNS else 0,
        level,
    )


def is_complete(results: Results, point: Point, metric: str) -> bool:
    """Whether all runs that are planned of a point finished and have a metric, two at least."""
    measured = len(results.values(point, metric))
    return measured >= 2 and measured == results.counts(point).planned


def mean_of(results: Results, point: Point, metric: str) -> float:
    """The mean of a metric over the runs of a point."""
    values = results.values(point, metric).values()
    return math.fsum(values) / len(values)


def _candidates(
    results: Results, metric: str, ranked: Sequence[Point], better: Direction, level: float
) -> Iterator[Point]:
    """The points that are not worse than the first one by more than chance allows."""
    if not ranked:
        return
    yield ranked[0]
    error = (1 - level) / max(1, len(ranked) - 1)
    for point in ranked[1:]:
        if not is_worse(results, metric, point, ranked[0], better, error):
            yield point


def is_worse(
    results: Results, metric: str, point: Point, other: Point, better: Direction, error: float
) -> bool:
    """Whether a point is worse than another one, by a test with this one-sided error."""
    x, y = results.values(point, metric), results.values(other, metric)
    paired = results.study.paired
    if paired:
        both = sorted(set(x) & set(y))
        x, y = {r: x[r] for r in both}, {r: y[r] for r in both}
    if min(len(x), len(y)) < 2:
        return False
    tested = effect(list(x.values()), list(y.values()), paired, 1 - 2 * error)
    difference = tested.difference
    if (
        difference.warning == NO_SPREAD_WARNING
    ):  # of such runs only a permutation test says anything
        is_apart = tested.p / 2 <= error
        return is_apart and (difference.value > 0) == (better == "lowest")
    if difference.low is None or difference.high is None:
        return False
    return difference.low > 0 if better == "lowest" else difference.high < 0
