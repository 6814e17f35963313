"""The comparisons that a study declares, with the correction of their family; how points are named there.

    baseline  each other level of the baseline's factors with the baseline, at equal other levels
    pairs     all pairs of points

The p values of a family are Holm's, the intervals Bonferroni's: all of them hold together. Points with
the same runs, measured alike, are not compared. Of comparisons between identical points one counts.

Whether the runs of a study are as many as its declared precision takes, and how many come next, is
decided by the intervals that the report prints: of all comparisons, at the level of their family;
without comparisons those of all means.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from automaton.studies.inference.intervals import (
    Effect,
    bonferroni,
    checked,
    effect,
    fewest,
    holm,
    next_round,
    paired_runs,
    unpaired_runs,
)
from automaton.studies.reports.study_results import Results, read_results
from automaton.studies.sweeps.study import SCENARIO_FACTOR, Levels, Point, Study
from automaton.units import count, percent

if TYPE_CHECKING:
    from automaton.studies.sweeps.result_store import Store

HELPS: Final = 0.95  # variance ratios, and shares of the runs needed, below which pairing helps
COVERAGE_NOTE: Final = (
    "the intervals decided the number of runs, so their coverage is slightly lower than with a number "
    "fixed in advance (docs/explanation/statistics.md)"
)


# Names of design points, factors and their levels.


def level_text(study: Study, factor: str, level: Any) -> str:
    """A level of a factor as text; with its keys and all digits where others would look the same."""
    text = _values_of(level)
    if not isinstance(level, float | Mapping):
        return text
    others = (other for other in study.levels(factor) if other != level)
    return _in_full(level) if any(_values_of(other) == text for other in others) else text


def _values_of(level: Any) -> str:
    if isinstance(level, Mapping):
        return " ".join(str(value) for value in level.values())
    if isinstance(level, float):
        return f"{level:g}"
    return "null" if level is None else str(level)


def _in_full(level: Any) -> str:
    if not isinstance(level, Mapping):
        return repr(level)
    return " ".join(str(v) if key == "name" else f"{key} {v}" for key, v in level.items())


def varied_factors(study: Study) -> list[str]:
    """The factors in which points differ: several levels, or not given at all points.

    All of them if none does, so that a single point has a name.
    """
    varied = [
        name
        for name in study.factor_names
        if len(study.levels(name)) > 1 or any(name not in one for one in study.listed or ())
    ]
    return varied or ([] if len(study.scenarios) > 1 else list(study.factor_names))


def varied_columns(study: Study) -> list[str]:
    """What varies: the scenario if there are several, then the factors in which points differ."""
    several = [SCENARIO_FACTOR] if len(study.scenarios) > 1 else []
    return [*several, *varied_factors(study)]


def heads_by_factor(study: Study) -> dict[str, str]:
    """A short name of each factor: its last part, where no other has the same."""
    names = list(study.factor_names)
    short = [name.rpartition(".")[2] for name in names]
    return {
        name: last if short.count(last) == 1 else name
        for name, last in zip(names, short, strict=True)
    }


def factor_heads(study: Study) -> list[str]:
    """The heads of tables for what varies."""
    heads = heads_by_factor(study)
    return [heads.get(name, name) for name in varied_columns(study)]


def factor_cells(study: Study, point: Point) -> list[str]:
    """The levels of a point, under `factor_heads`."""
    return [level_of(study, point, name) for name in varied_columns(study)]


def level_of(study: Study, point: Point, factor: str) -> str:
    """The level of a point as text, the scenario's name included; "-": it has none."""
    if factor == SCENARIO_FACTOR:
        return point.scenario
    return level_text(study, factor, point.levels[factor]) if factor in point.levels else "-"


def levels_beside(point: Point, factors: Collection[str]) -> str:
    """What identifies the points that differ in these factors alone."""
    beside = {SCENARIO_FACTOR: point.scenario, **point.levels}
    return repr(sorted((key, level) for key, level in beside.items() if key not in factors))


def levels_named(study: Study, point: Point, factors: Sequence[str]) -> str:
    """The levels of some factors in one phrase: "robots 4, allocation cooperative"."""
    heads = heads_by_factor(study)
    return ", ".join(
        f"{heads[name]} {level_of(study, point, name)}" if name in heads else point.scenario
        for name in factors
    )


def point_name(study: Study, point: Point) -> str:
    """The levels of a point in one phrase: "robots 4, allocation cooperative"."""
    pairs = zip(factor_heads(study), factor_cells(study, point), strict=True)
    return ", ".join(f"{head} {cell}" for head, cell in pairs) or point.scenario


def levels_apart(study: Study, point: Point, other: Point) -> str:
    """The levels of `other` that are not those of a point: "independent"."""
    pairs = zip(factor_cells(study, point), factor_cells(study, other), strict=True)
    return ", ".join(theirs for own, theirs in pairs if own != theirs)


# The comparisons.


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
    return point.scenario if key == SCENARIO_FACTOR else point.levels.get(key)


def _is(point: Point, levels: Levels) -> bool:
    return all(_level(point, key) == level for key, level in levels.items())


def _family(
    results: Results, metrics: list[str], pairs: list[tuple[Point, Point]]
) -> Iterator[Comparison]:
    analysis = results.analysis
    usable = []
    for metric in metrics:
        for a, b in differing(results, metric, pairs):
            x, y = compared_runs(results, a, b, metric)
            if min(len(x), len(y)) >= 2:
                usable.append((metric, a, b, x, y))
    if not usable:
        return
    level = bonferroni(1 - analysis.error, len(usable))
    common = results.study.common_random_numbers
    effects = [_effect(x, y, results.study.paired, level, common) for _, _, _, x, y in usable]
    adjusted = holm([one.p for one in effects])
    for (metric, a, b, x, y), found, p in zip(usable, effects, adjusted, strict=True):
        needed = runs_needed(x, y, analysis.precision, level, common)
        yield Comparison(metric, a, b, found, p, len(usable), (len(x), len(y)), needed)


def compared_runs(
    results: Results, a: Point, b: Point, metric: str
) -> tuple[dict[int, float], dict[int, float]]:
    """A metric of two points by replication; of pairs, the replications that both have, in order."""
    x, y = results.values(a, metric), results.values(b, metric)
    if not results.study.paired:
        return x, y
    both = sorted(set(x) & set(y))
    return {r: x[r] for r in both}, {r: y[r] for r in both}


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
    wanted = f"A half-width of {percent(precision)} of the reference mean in all comparisons"
    by = "(estimated from these runs)"
    pairs = [one.paired for one in needed if one.paired is not None]
    if len(pairs) < len(needed):
        return f"{wanted} needs {unpaired:,} runs per point unpaired {by}."
    paired = max(pairs)
    what = f"{wanted} needs {paired:,} runs per point paired and {unpaired:,} unpaired {by}"
    if paired < HELPS * unpaired:
        return f"{what}: pairing saves {percent(1 - paired / unpaired, 0)} of the runs."
    return f"{what}: pairing does not help."


# The precision, and the runs that it takes.


class WantedRuns(NamedTuple):
    """Runs of each point that one interval takes to reach the declared precision."""

    runs: int
    interval: str  # in words: "makespan of robots 2"


class NextRound(NamedTuple):
    """A round that is to come."""

    replications: int  # of each point when it is done
    why: str


def next_replications(store: Store) -> NextRound | None:
    """The next round of a study that is done so far; None if the precision or the bound is reached.

    Raises InputError.
    """
    results = read_results(store)
    wanted = most_wanted(results)
    if wanted is None:
        return None
    n, at_most = store.manifest.replications, store.declared.max_replications
    replications = next_round(n, wanted.runs, at_most)
    if replications is None:
        return None
    precision = percent(results.analysis.precision or 0.0)
    why = (
        f"{n:,} runs per point are done; {wanted.interval} needs about {wanted.runs:,} for a half-width "
        f"of {precision}: continuing to {replications:,}"
    )
    return NextRound(replications, why)


def most_wanted(results: Results) -> WantedRuns | None:
    """The interval that takes the most runs; None without an interval of which a share can be taken."""
    return max(_wanted(results), key=lambda one: one.runs, default=None)


def _wanted(results: Results) -> Iterator[WantedRuns]:
    if results.analysis.comparisons == "none":
        yield from _wanted_of_means(results)
        return
    for one in comparisons(results):
        if one.needed is not None:
            runs = one.needed.paired if one.effect.paired else one.needed.unpaired
            name = point_name(results.study, one.a)
            against = levels_apart(results.study, one.a, one.b)
            if runs is not None:
                usable = min(one.runs)
                yield WantedRuns(
                    _with_lost(runs, usable, results), f"{one.metric} of {name} against {against}"
                )


def _wanted_of_means(results: Results) -> Iterator[WantedRuns]:
    analysis = results.analysis
    for metric in analysis.metrics:
        for point in results.points:
            values = list(results.values(point, metric).values())
            half = (analysis.precision or 0.0) * abs(math.fsum(values)) / max(1, len(values))
            if len(values) >= 2 and half > 0:
                variance = float(checked(values).var(ddof=1))
                runs = fewest(variance, 1.0, half, 1 - analysis.error)
                name = point_name(results.study, point)
                yield WantedRuns(_with_lost(runs, len(values), results), f"{metric} of {name}")


def without_interval(results: Results) -> int:
    """Intervals that are declared but cannot be computed: of too few runs, or beside a mean of 0."""
    metrics = results.analysis.metrics
    if results.analysis.comparisons == "none":
        asked = len(metrics) * len(results.points)
    else:
        pairs = list(declared_pairs(results))
        asked = sum(len(list(differing(results, metric, pairs))) for metric in metrics)
    return asked - sum(1 for _ in _wanted(results))


def _with_lost(runs: int, usable: int, results: Results) -> int:
    """Runs to make so that so many count, where some failed or did not finish."""
    n = results.study.max_replications
    return runs if runs <= usable else math.ceil(runs * n / usable)


def stopping_text(results: Results) -> str:
    """How many rounds a study took and what ended it, in a phrase."""
    rounds, precision = results.rounds, percent(results.analysis.precision or 0.0)
    what = "means" if results.analysis.comparisons == "none" else "differences"
    sizes = ", ".join(f"{n:,}" for n in rounds)
    text = f"{count(len(rounds), 'round')} of {sizes} runs, until {what} have a half-width of {precision}"
    return f"{text}: {_end(results)}"


def _end(results: Results) -> str:
    if any(results.counts(point).missing for point in results.points):
        return "the last round is not done yet"
    wanted, n = most_wanted(results), results.rounds[-1]
    if wanted is None:
        return "ended, because no interval can be expressed as a share of a mean"
    if wanted.runs > n:
        bounded = n >= results.at_most
        return f"not reached, ended by at_most {n:,}" if bounded else "not reached yet"
    lacking = without_interval(results)
    excepted = f"{count(lacking, 'interval')} that cannot be computed"
    return f"reached, except for {excepted}" if lacking else "reached"


def stopping_remarks(results: Results) -> Iterator[str]:
    """What a reader must know of runs that were made in rounds."""
    if not results.rounds:
        return
    wanted = most_wanted(results)
    if wanted is not None and wanted.runs > results.rounds[-1]:
        yield f"the declared precision is not reached: {wanted.interval} needs about {wanted.runs:,} runs"
    if len(results.rounds) > 1:
        yield COVERAGE_NOTE
