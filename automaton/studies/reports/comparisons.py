"""The comparisons that a study declares, with the correction of their family.

baseline   each other level of the baseline's factors with the baseline, at equal other levels
pairs      all pairs of points

The p values of a family are Holm's, the intervals Bonferroni's: all of them hold together. Points with
the same runs, measured alike, are not compared. Of comparisons between identical points one counts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Final, NamedTuple

from automaton.studies.inference.effects import (
    Effect,
    bonferroni,
    effect,
    holm,
    paired_runs,
    unpaired_runs,
)
from automaton.studies.reports.point_names import levels_beside
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import SCENARIO, Levels, Point
from automaton.units import percent

HELPS: Final = 0.95  # variance ratios, and shares of the runs needed, below which pairing helps


class RunsNeeded(NamedTuple):
    """Runs of each point that the declared precision takes, by the variances of the runs made."""

    paired: int | None  # None: no runs share a seed
    unpaired: int


class Comparison(NamedTuple):
    """One line of a table of comparisons: `a` against `b`."""

    metric: str
    a: Point
    b: Point
    effect: Effect
    adjusted: float  # Holm's p value
    family: int  # comparisons in it
    runs: tuple[int, int]  # that count, of a and b
    needed: RunsNeeded | None  # None: no precision is declared, or it is one of nothing


def comparisons(results: Results) -> list[Comparison]:
    """All comparisons that can be made; those with fewer than two runs are left out."""
    analysis = results.analysis
    pairs = list(declared_pairs(results))
    metrics = [metric for metric in analysis.metrics if results.has(metric)]
    families = [[m] for m in metrics] if analysis.family == "metric" else [metrics]
    return [one for family in families for one in _family(results, family, pairs)]


def declared_pairs(results: Results) -> Iterator[tuple[Point, Point]]:
    """The points that are compared: the first against the second."""
    analysis, points = results.analysis, results.points
    if analysis.comparisons == "pairs":
        for earlier, later in itertools.combinations(points, 2):
            yield later, earlier
    if analysis.comparisons != "baseline" or not analysis.baseline:
        return
    varied = set(analysis.baseline)
    bases = {levels_beside(p, varied): p for p in points if _is(p, analysis.baseline)}
    for point in points:
        base = bases.get(levels_beside(point, varied))
        if base is not None and base is not point:
            yield point, base


def differing(
    results: Results, metric: str, pairs: list[tuple[Point, Point]]
) -> Iterator[tuple[Point, Point]]:
    """The pairs whose runs differ; of several that compare identical runs, the first."""
    seen: set[frozenset[int]] = set()
    first = results.identical(metric)
    for a, b in pairs:
        runs = frozenset((first[a.number], first[b.number]))
        if runs not in seen and not results.same(a, b, metric):
            seen.add(runs)
            yield a, b


def left_out(results: Results) -> int:
    """Comparisons that were declared but are of the same runs, or of runs compared already."""
    pairs = list(declared_pairs(results))
    metrics = [metric for metric in results.analysis.metrics if results.has(metric)]
    return sum(len(pairs) - len(list(differing(results, metric, pairs))) for metric in metrics)


def _level(point: Point, key: str) -> object:
    return point.scenario if key == SCENARIO else point.levels.get(key)


def _is(point: Point, levels: Levels) -> bool:
    return all(_level(point, key) == level for key, level in levels.items())


def _family(
    results: Results, metrics: list[str], pairs: list[tuple[Point, Point]]
) -> Iterator[Comparison]:
    analysis = results.analysis
    asked = [
        (metric, a, b, results.values(a, metric), results.values(b, metric))
        for metric in metrics
        for a, b in differing(results, metric, pairs)
    ]
    paired = results.study.paired
    usable = []
    for metric, a, b, x, y in asked:
        if paired:
            both = sorted(set(x) & set(y))
            x, y = {r: x[r] for r in both}, {r: y[r] for r in both}
        if min(len(x), len(y)) >= 2:
            usable.append((metric, a, b, x, y))
    if not usable:
        return
    level = bonferroni(1 - analysis.error, len(usable))
    common = results.study.common_random_numbers
    effects = [_effect(x, y, paired, level, common) for _, _, _, x, y in usable]
    adjusted = holm([one.p for one in effects])
    for (metric, a, b, x, y), found, p in zip(usable, effects, adjusted, strict=True):
        needed = runs_needed(x, y, analysis.precision, level, common)
        yield Comparison(metric, a, b, found, p, len(usable), (len(x), len(y)), needed)


def runs_needed(
    x: dict[int, float], y: dict[int, float], precision: float | None, level: float, common: bool
) -> RunsNeeded | None:
    """Runs until the interval of the difference reaches so far to each side, as a share of mean y.

    `common`: whether runs of the same replication share a seed.
    """
    half = (precision or 0.0) * abs(math.fsum(y.values()) / len(y))
    if half <= 0:
        return None
    pairs = _pairs(x, y, common)
    return RunsNeeded(
        paired_runs(*pairs, half, level) if pairs else None,
        unpaired_runs(list(x.values()), list(y.values()), half, level),
    )


def _effect(
    x: dict[int, float], y: dict[int, float], paired: bool, level: float, common: bool
) -> Effect:
    """The effect; correlation and variance ratio always from runs with the same seed."""
    found = effect(list(x.values()), list(y.values()), paired, level)
    pairs = _pairs(x, y, common)
    if pairs is None:
        return found._replace(correlation=None, variance_ratio=None)
    same = effect(*pairs, True, level)
    return found._replace(correlation=same.correlation, variance_ratio=same.variance_ratio)


def _pairs(
    x: dict[int, float], y: dict[int, float], common: bool
) -> tuple[list[float], list[float]] | None:
    """The runs with the same seed, one below the other; None for fewer than two."""
    both = sorted(set(x) & set(y)) if common else []
    return ([x[r] for r in both], [y[r] for r in both]) if len(both) > 1 else None


def pairing_remark(compared: list[Comparison], paired: bool) -> str:
    """Whether pairing helps in these comparisons, in a sentence; "" without pairs."""
    ratios = [
        one.effect.variance_ratio for one in compared if one.effect.variance_ratio is not None
    ]
    if not ratios:
        return ""
    low, high = min(ratios), max(ratios)
    spread = f"{low:.2f}" if high - low < 0.005 else f"{low:.2f} to {high:.2f}"
    declared = "paired" if paired else "not paired, as declared"
    helps = sum(ratio < HELPS for ratio in ratios)
    if helps == len(ratios):
        what = "pairing helps" if paired else "pairing would have helped"
    elif helps == 0:
        what = "pairing does not help"
    else:
        what = f"pairing helps in {helps} of {len(ratios)} comparisons"
    return f"Comparisons are {declared}; variance ratio of pairs {spread}: {what}."


def precision_remark(compared: list[Comparison], precision: float | None) -> str:
    """How many runs the declared precision takes with pairs and without; "" if none is declared."""
    needed = [one.needed for one in compared if one.needed is not None]
    if precision is None or not needed:
        return ""
    unpaired = max(one.unpaired for one in needed)
    wanted = f"Differences to within {percent(precision)} of the mean that is compared with, all of them,"
    by = "(by the variances found)"
    pairs = [one.paired for one in needed if one.paired is not None]
    if len(pairs) < len(needed):
        return f"{wanted} take {unpaired:,} runs of each point unpaired {by}."
    paired = max(pairs)
    what = f"{wanted} take {paired:,} runs of each point paired and {unpaired:,} unpaired {by}"
    if paired < HELPS * unpaired:
        return f"{what}: pairing saves {percent(1 - paired / unpaired, 0)} of the runs."
    return f"{what}: pairing does not help."
