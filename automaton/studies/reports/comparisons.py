"""The comparisons of a study, its best point, and the names of points in reports.

    baseline  each other level of the baseline's factors with the baseline, at equal other levels
    pairs     all pairs of points
    answer    each point with the leading one, under the same conditions

One family of m tests answers all questions (Bonferroni): two means differ significantly if the interval
of their difference excludes 0, that is, if m p < error. It has the declared comparisons, and for each
condition those of one point with all others, since a best point can only be eliminated by its own tests
(multiple comparisons with the best, Hsu 1984). A point whose mean leaves runs out looks too good: it may
be worse than another one, never better. Identical runs are not compared, or count once.

The intervals decide whether a study has enough runs for its declared precision, and how many come next.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

from automaton.studies.inference.intervals import (
    STUDENT_MIN_RUNS,
    Effect,
    bonferroni,
    checked,
    effect,
    fewest,
    next_round,
    paired_runs,
    unpaired_runs,
)
from automaton.studies.reports.study_results import Results, read_results
from automaton.studies.sweeps.study import POINT_NAME, SCENARIO_FACTOR, Levels, Point, Study
from automaton.units import count, percent

if TYPE_CHECKING:
    from automaton.studies.sweeps.result_store import Store

Direction = Literal["lowest", "highest"]

HIGHER_IS_BETTER: Final = frozenset((
    "delivered", "throughput", "throughput_per_robot", "lines_done", "lines_per_visit",
    "parts_finished", "min_charge", "balanced_share", "ticks_per_second",
))  # fmt: skip
LOWER_IS_BETTER: Final = frozenset((
    "makespan", "sum_of_costs", "ticks", "operations", "operations_per_robot", "empty_moves_share",
    "empty_operations_share", "empty_ticks_share", "ticks_per_operation", "legs_per_order",
    "blocked_share", "task_time", "delay", "delay_p95", "detour_share", "slowdown_ticks",
    "retreats", "lead_time", "lead_time_p95", "lead_time_p99", "lead_time_max", "late_share",
    "tardiness", "tardiness_p95", "tardiness_p99", "oldest_order", "starved_robots", "energy",
    "repair_energy", "battery_depletions", "breakdowns", "towed", "downtime", "delayed_share",
    "distance", "part_flow_time", "messages", "illegal_answers", "deadlocks_resolved", "deadlocks",
    "deadlock_time", "longest_standstill", "station_queue_share", "charger_queue_share",
))  # fmt: skip
CONDITIONS: Final = frozenset((
    SCENARIO_FACTOR, "layout", "orders", "durations", "faults", "stop", "units", "measure",
))  # fmt: skip
HELPS: Final = 0.95  # pairing helps below this variance ratio or this share of the runs
COVERAGE_NOTE: Final = (
    "the intervals decided the number of runs, so their coverage is slightly lower than with a number "
    "fixed in advance (docs/explanation/statistics.md)"
)


# Names of design points, factors and their levels.


def level_text(study: Study, factor: str, level: Any) -> str:
    """A level of a factor as text; with its keys and all digits if another level has the same text."""
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


def setting_text(value: Any) -> str:
    """The value of a setting as in a file: "1.2 m/s", [3, 4]."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def varied_factors(study: Study) -> list[str]:
    """The factors with several levels, or that only some points have.

    All factors if none varies, so that a single point has a name.
    """
    listed = () if study.is_named else study.listed or ()
    varied = [
        name
        for name in study.factor_names
        if len(study.levels(name)) > 1 or any(name not in one for one in listed)
    ]
    return varied or ([] if len(study.scenarios) > 1 else list(study.factor_names))


def varied_columns(study: Study) -> list[str]:
    """The varied columns: the scenario if the study has several, then the varied factors."""
    several = [SCENARIO_FACTOR] if len(study.scenarios) > 1 else []
    return [*several, *varied_factors(study)]


def heads_by_factor(study: Study) -> dict[str, str]:
    """A short name of each factor: its last part, unless another factor has the same."""
    if study.is_named:
        return {POINT_NAME: "point"}
    names = list(study.factor_names)
    short = [name.rpartition(".")[2] for name in names]
    return {
        name: last if short.count(last) == 1 else name
        for name, last in zip(names, short, strict=True)
    }


def factor_heads(study: Study) -> list[str]:
    """The headings of tables for the varied columns."""
    heads = heads_by_factor(study)
    return [heads.get(name, name) for name in varied_columns(study)]


def factor_cells(study: Study, point: Point) -> list[str]:
    """The levels of a point, under `factor_heads`."""
    return [level_of(study, point, name) for name in varied_columns(study)]


def level_of(study: Study, point: Point, factor: str) -> str:
    """The level of a point in a factor (or its scenario) as text; "-" if it has none."""
    if factor == SCENARIO_FACTOR:
        return point.scenario
    return level_text(study, factor, point.levels[factor]) if factor in point.levels else "-"


def levels_beside(point: Point, factors: Collection[str]) -> str:
    """A key that is equal for points that differ only in these factors."""
    beside = {SCENARIO_FACTOR: point.scenario, **point.levels}
    return repr(sorted((key, level) for key, level in beside.items() if key not in factors))


def levels_named(study: Study, point: Point, factors: Sequence[str]) -> str:
    """The levels of some factors in one phrase: "robots 4, allocation cooperative"."""
    heads = {SCENARIO_FACTOR: "", **heads_by_factor(study), POINT_NAME: ""}
    return ", ".join(f"{heads[name]} {level_of(study, point, name)}".strip() for name in factors)


def point_name(study: Study, point: Point) -> str:
    """The name of a point, else its levels in one phrase: "robots 4, allocation cooperative"."""
    if point.name:
        return ", ".join(factor_cells(study, point))
    pairs = zip(factor_heads(study), factor_cells(study, point), strict=True)
    return ", ".join(f"{head} {cell}" for head, cell in pairs) or point.scenario


def levels_apart(study: Study, point: Point, other: Point) -> str:
    """The levels of `other` that differ from those of a point: "independent"."""
    pairs = zip(factor_cells(study, point), factor_cells(study, other), strict=True)
    return ", ".join(theirs for own, theirs in pairs if own != theirs)


# The comparisons.


class RunsNeeded(NamedTuple):
    """Runs of each point that the declared precision needs, estimated from the existing runs."""

    paired: int | None  # None: no runs share a seed
    unpaired: int


class Comparison(NamedTuple):
    """One line of a table of comparisons: `a` against `b`."""

    metric: str
    a: Point
    b: Point
    effect: Effect
    adjusted: float  # p value times the number of tests in the family, at most 1
    is_significant: bool  # adjusted p below the error of the study
    family: int  # number of tests in the family
    runs: tuple[int, int]  # runs of a and b that count
    needed: RunsNeeded | None  # None: no precision is declared, or the reference mean is 0


def is_what_if(results: Results) -> bool:
    """Whether the points of a study have names and are compared with one of them."""
    return results.study.is_named and results.analysis.comparisons == "baseline"


def comparisons(results: Results) -> list[Comparison]:
    """All possible declared comparisons; those with fewer than two runs are omitted."""
    analysis = results.analysis
    pairs = list(declared_pairs(results))
    metrics = [metric for metric in analysis.metrics if results.has(metric)]
    families = [[m] for m in metrics] if analysis.family == "metric" else [metrics]
    return [one for family in families for one in _family(results, family, pairs)]


def declared_pairs(results: Results) -> Iterator[tuple[Point, Point]]:
    """The declared pairs of points, each the first against the second."""
    analysis, points = results.analysis, results.points
    if analysis.comparisons == "pairs":
        for earlier, later in itertools.combinations(points, 2):
            yield later, earlier
    baseline = analysis.baseline_levels
    if analysis.comparisons != "baseline" or not baseline:
        return
    varied = set(baseline)
    bases = {levels_beside(p, varied): p for p in points if _is(p, baseline)}
    for point in points:
        base = bases.get(levels_beside(point, varied))
        if base is not None and base is not point:
            yield point, base


def differing(
    results: Results, metric: str, pairs: list[tuple[Point, Point]]
) -> Iterator[tuple[Point, Point]]:
    """The pairs whose runs differ; only the first of several pairs with identical runs."""
    seen: set[frozenset[int]] = set()
    first = results.identical(metric)
    for a, b in pairs:
        runs = frozenset((first[a.number], first[b.number]))
        if runs not in seen and not results.same(a, b, metric):
            seen.add(runs)
            yield a, b


def left_out(results: Results) -> int:
    """Number of declared comparisons between identical runs, or of runs compared already."""
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
    usable = [
        (metric, a, b)
        for metric in metrics
        for a, b in differing(results, metric, pairs)
        if min(map(len, compared_runs(results, a, b, metric))) >= 2
    ]
    has_answer = results.analysis.metrics[0] in metrics if metrics else False
    family = len(usable) + (tests_of_best(results) if has_answer else 0)
    for metric, a, b in usable:
        one = compare(results, metric, a, b, family)
        yield from [] if one is None else [one]


def compare(results: Results, metric: str, a: Point, b: Point, family: int) -> Comparison | None:
    """`a` against `b`, as one of `family` tests; None with fewer than two runs."""
    x, y = compared_runs(results, a, b, metric)
    if min(len(x), len(y)) < 2:
        return None
    analysis, common = results.analysis, results.study.common_random_numbers
    level = bonferroni(1 - analysis.error, family)
    found = _effect(x, y, results.study.paired, level, common)
    adjusted = min(1.0, family * found.p)
    needed = runs_needed(x, y, analysis.precision, level, common)
    runs = len(x), len(y)
    return Comparison(
        metric, a, b, found, adjusted, adjusted < analysis.error, family, runs, needed
    )


def compared_runs(
    results: Results, a: Point, b: Point, metric: str
) -> tuple[dict[int, float], dict[int, float]]:
    """A metric of two points by replication; if paired, of the replications that both have."""
    x, y = results.values(a, metric), results.values(b, metric)
    if not results.study.paired:
        return x, y
    both = sorted(set(x) & set(y))
    return {r: x[r] for r in both}, {r: y[r] for r in both}


def runs_needed(
    x: dict[int, float], y: dict[int, float], precision: float | None, level: float, common: bool
) -> RunsNeeded | None:
    """Runs for which the half-width of the difference is `precision` times the mean of y.

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
    """The effect, with correlation and variance ratio computed from runs with the same seed."""
    found = effect(list(x.values()), list(y.values()), paired, level)
    pairs = _pairs(x, y, common)
    if pairs is None:
        return found._replace(correlation=None, variance_ratio=None)
    same = effect(*pairs, True, level)
    return found._replace(correlation=same.correlation, variance_ratio=same.variance_ratio)


def _pairs(
    x: dict[int, float], y: dict[int, float], common: bool
) -> tuple[list[float], list[float]] | None:
    """The runs with the same seeds, in the same order; None for fewer than two."""
    both = sorted(set(x) & set(y)) if common else []
    return ([x[r] for r in both], [y[r] for r in both]) if len(both) > 1 else None


def pairing_remark(compared: list[Comparison], paired: bool) -> str:
    """A sentence that says whether pairing helps in these comparisons; "" without pairs."""
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
    """The number of paired and unpaired runs for the declared precision; "" if none is declared."""
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


# The best point, or the set of points that contains it.


class Answer(NamedTuple):
    """The answer about the best point under some conditions."""

    metric: str
    better: Direction | None  # None: no direction is better
    conditions: str  # "scenario tabletop-1"; "": all points are compared
    compared: tuple[Point, ...]  # only the first of identical points; at least two runs each
    candidates: tuple[Point, ...]  # the best is one of them; the leading point comes first
    incomplete: tuple[Point, ...]  # some of their runs are missing in their means
    against: tuple[Comparison, ...]  # the leading point against others
    few_runs: int  # least runs of a point, if too few for Student's t; else 0

    @property
    def leading(self) -> Point | None:
        """The complete point with the best mean."""
        return self.candidates[0] if self.candidates else None

    @property
    def best(self) -> Point | None:
        """The best point, if the runs determine it."""
        is_settled = len(self.candidates) == 1 and len(self.compared) > 1
        return self.candidates[0] if is_settled else None


def direction_of(metric: str) -> Direction | None:
    """Whether the lowest or the highest mean of a metric is best; None if neither is."""
    if metric in HIGHER_IS_BETTER:
        return "highest"
    if metric in LOWER_IS_BETTER or metric.startswith("lost_"):
        return "lowest"
    return None


def answers(results: Results, declared: Sequence[Comparison] | None = None) -> list[Answer]:
    """The answers for the first metric of the analysis, one for each condition; simultaneously valid.

    `declared`: the declared comparisons, if already computed. Empty if no run has any metric.
    """
    if not results.analysis.metrics:
        return []
    metric = results.analysis.metrics[0]
    by_metric = results.analysis.family == "metric"
    known = comparisons(results) if declared is None else declared
    sizes = [one.family for one in known if not by_metric or one.metric == metric]
    family = sizes[0] if sizes else tests_of_best(results)
    groups = groups_by_condition(results)
    return [_answer(results, metric, name, points, family) for name, points in groups.items()]


def _answer(
    results: Results, metric: str, conditions: str, points: Sequence[Point], family: int
) -> Answer:
    compared = _distinct(results, metric, points)
    complete = [point for point in compared if is_complete(results, point, metric)]
    better = direction_of(metric)
    sign = -1 if better == "highest" else 1
    ranked = sorted(complete, key=lambda point: sign * mean_of(results, point, metric))
    others = [*ranked[1:], *(one for one in compared if one not in complete)]
    leading = ranked[:1] if better else []
    tested = [compare(results, metric, one, other, family) for one in leading for other in others]
    against = [one for one in tested if one is not None]  # the leading point has all runs
    contenders = [
        one.b for one in against if not one.is_significant or sign * one.effect.difference.value > 0
    ]
    few = min((len(results.values(point, metric)) for point in compared), default=0)
    return Answer(
        metric,
        better,
        conditions,
        compared,
        (*leading, *contenders),
        tuple(point for point in points if not is_complete(results, point, metric)),
        tuple(against),
        few if few < STUDENT_MIN_RUNS else 0,
    )


def _distinct(results: Results, metric: str, points: Sequence[Point]) -> tuple[Point, ...]:
    """The points with at least two runs, without those that have the same runs as an earlier one."""
    identical = results.identical(metric)
    first: dict[int, Point] = {}
    for point in points:
        if len(results.values(point, metric)) >= 2:
            first.setdefault(identical[point.number], point)
    return tuple(first.values())


def tests_of_best(results: Results) -> int:
    """The tests of the answers besides the declared ones: those of one point of each group."""
    metric = results.analysis.metrics[0] if results.analysis.metrics else ""
    if direction_of(metric) is None or is_what_if(results):
        return 0
    identical = results.identical(metric)
    declared = {
        frozenset((identical[a.number], identical[b.number])) for a, b in declared_pairs(results)
    }
    tests = 0
    for points in groups_by_condition(results).values():
        own = [identical[point.number] for point in _distinct(results, metric, points)]
        undeclared = [sum(frozenset((a, b)) not in declared for b in own if a != b) for a in own]
        tests += max(undeclared, default=0)
    return tests


def groups_by_condition(results: Results) -> dict[str, list[Point]]:
    """The points by conditions, within which they are compared; "" if no condition varies."""
    study, conditions = results.study, condition_factors(results)
    groups: dict[str, list[Point]] = {}
    for point in results.points:
        name = levels_named(study, point, conditions)
        groups.setdefault(name, []).append(point)
    return groups


def condition_factors(results: Results) -> list[str]:
    """The varied factors that are conditions; none if nothing else varies: they are compared then."""
    varied = varied_columns(results.study)
    conditions = [name for name in varied if name.partition(".")[0] in CONDITIONS]
    return [] if len(conditions) == len(varied) else conditions


def mean_of(results: Results, point: Point, metric: str) -> float:
    """The mean of a metric over the runs of a point."""
    values = results.values(point, metric).values()
    return math.fsum(values) / len(values)


def is_complete(results: Results, point: Point, metric: str) -> bool:
    """Whether all planned runs of a point (at least two) are complete and have a metric."""
    measured = len(results.values(point, metric))
    return measured >= 2 and measured == results.counts(point).planned


# The declared precision, and the number of runs that it needs.


class WantedRuns(NamedTuple):
    """Runs of each point that one interval needs to reach the declared precision."""

    runs: int
    interval: str  # in words: "makespan of robots 2"


class NextRound(NamedTuple):
    """The next round of runs."""

    replications: int  # of each point after the round
    why: str


def next_replications(store: Store) -> NextRound | None:
    """The next round of a study; None if the precision or the maximum of runs is reached.

    All runs so far must be done. Raises InputError.
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
    """The interval that needs the most runs; None if no interval has a mean to relate to."""
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
    """Number of declared intervals that cannot be computed: too few runs, or a reference mean of 0."""
    metrics = results.analysis.metrics
    if results.analysis.comparisons == "none":
        asked = len(metrics) * len(results.points)
    else:
        pairs = list(declared_pairs(results))
        asked = sum(len(list(differing(results, metric, pairs))) for metric in metrics)
    return asked - sum(1 for _ in _wanted(results))


def _with_lost(runs: int, usable: int, results: Results) -> int:
    """Runs to make to get `runs` usable ones, since some fail or do not finish."""
    n = results.study.max_replications
    return runs if runs <= usable else math.ceil(runs * n / usable)


def stopping_text(results: Results) -> str:
    """The rounds of a study and why they ended, in a phrase."""
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
    """The caveats about runs made in rounds."""
    if not results.rounds:
        return
    wanted = most_wanted(results)
    if wanted is not None and wanted.runs > results.rounds[-1]:
        yield f"the declared precision is not reached: {wanted.interval} needs about {wanted.runs:,} runs"
    if len(results.rounds) > 1:
        yield COVERAGE_NOTE
