"""The sections of a report about the design of a study, its comparisons, and effects of factors."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.documents.report_document import Block, Heading, NumberText, Table, Text
from automaton.studies.inference.intervals import (
    NO_SPREAD_WARNING,
    STUDENT_MIN_RUNS,
    TOO_FEW,
    Effect,
    Interval,
    bonferroni,
    mean_interval,
    student,
)
from automaton.studies.reports.comparisons import (
    Comparison,
    comparisons,
    declared_pairs,
    factor_cells,
    factor_heads,
    heads_by_factor,
    left_out,
    level_of,
    level_text,
    levels_apart,
    pairing_remark,
    point_name,
    precision_remark,
    setting_text,
    stopping_text,
    tests_of_best,
    varied_factors,
)
from automaton.studies.reports.metric_tables import RUN_HEADS, Scenarios, end_cells, figure
from automaton.studies.reports.study_results import Cut, MetricScale, Results
from automaton.studies.sweeps.study import SCENARIO_FACTOR
from automaton.units import count, percent, ticks_and_time

INTERVALS: Final = f"Student's t, with a warning about skew below {STUDENT_MIN_RUNS} runs"
NO_WARM_UP: Final = "none: metrics cover whole runs"
ADJUSTED: Final = "adjusted p"
MAX_REASONS: Final = 6  # reasons for missing comparisons
Array = npt.NDArray[np.float64]
ROUND_OFF: Final = 1e-12  # of the sum of absolute terms; smaller sums count as 0


# The design: everything that is needed to judge a study.


def design(results: Results, scenarios: Scenarios) -> Iterator[Block]:
    """The design section, with everything that is needed to judge a study."""
    study, analysis = results.study, results.analysis
    endings = "steady-state" if study.design == "steady-state" else "terminating"
    seeds = "replication r has the seed hash(study seed, r)"
    common = (
        "the same for every point" if study.common_random_numbers else "different for each point"
    )
    keys = dict.fromkeys(key for point in study.points for key in point.settings)
    varied = [name for name in keys if name.startswith("durations.")]
    rows = [
        ["estimand", "mean of each metric over independent complete runs"],
        ["design", f"{endings}; {count(len(study.points), 'point')}, {runs_planned(results)}"],
        ["runs", fixed(results)],
        ["seeds", f"study seed {study.seed}; {seeds}, {common}"],
        ["warm-up", warm_up(results)],
        ["intervals", f"{percent(1 - analysis.error, 0)}; {INTERVALS}"],
        ["comparisons", family(results)],
        ["durations", f"varied: {', '.join(varied)}" if varied else "not varied by this study"],
        [
            "ticks",
            ", ".join(
                sorted({f"1 tick = {s.unrefined.scenario.units.tick}" for s in scenarios.values()})
            )
            or "-",
        ],
        [
            "code",
            f"{results.version}; {', '.join(f'{k} {v}' for k, v in results.versions.items())}",
        ],
    ]
    yield Heading("Design")
    yield Table(("what", "how"), rows, left=2)
    for key, value in (study.settings or {}).items():
        yield Text(f"Fixed {key}: {setting_text(value)}")
    for name in () if study.is_named else study.factor_names:
        levels = ", ".join(level_text(study, name, level) for level in study.levels(name))
        yield Text(f"{'Factor' if name in varied_factors(study) else 'Fixed'} {name}: {levels}")


def warm_up(results: Results) -> str:
    """The warm-up period that all metrics exclude, and its source."""
    cut, declared, tick = results.cut, max(results.warm_ups), results.units.tick
    if cut is None:
        ticks = " or ".join(ticks_and_time(one, tick) for one in results.warm_ups)
        return f"the first {ticks}, as the scenarios declare" if declared else NO_WARM_UP
    if not cut.ticks:
        return NO_WARM_UP
    of = f"the first {ticks_and_time(cut.ticks, tick)} of every run, excluded from all metrics"
    if not cut.found:
        return f"{of}; declared"
    least = f"; at least the {declared:,} that scenarios declare" if declared else ""
    return (
        f"{of}: the largest cut that MSER-5 finds at any point, from deliveries in windows of "
        f"{count(cut.window, 'tick')} and from times of orders and tasks{least}"
    )


def not_cut(metrics: Sequence[str], cut: Cut) -> str:
    """Why metrics of the runs cannot be used for a steady state."""
    return (
        f"{', '.join(metrics)}: excluded because the warm-up period cannot be subtracted from stored "
        f"rows; a study with warm_up: {cut.ticks} measures them after this period"
    )


def runs_planned(results: Results) -> str:
    """The planned runs of each point and in total."""
    study = results.study
    return f"{count(study.max_replications, 'run')} each, {count(study.runs, 'run')} in total"


def fixed(results: Results) -> str:
    """Whether the number of runs was fixed before any was made."""
    rounds = stopping_text(results) if results.rounds else ""
    if not results.raised:
        return rounds or "number fixed in advance"
    before = ", then ".join(map(str, results.raised))
    return f"{rounds}; " * bool(rounds) + (
        f"number not fixed in advance: raised from {before} after runs had been made; if their "
        "results were the reason, intervals and p values are too optimistic"
    )


def family(results: Results) -> str:
    """The declared comparisons and their correction."""
    analysis = results.analysis
    if analysis.comparisons == "none":
        tests = count(tests_of_best(results), "test")
        return f"none declared; the best point by {tests} in one family, Bonferroni"
    what = "all pairs of points"
    if analysis.comparisons == "baseline" and analysis.baseline:
        levels = analysis.baseline_levels.items()
        what = "against " + ", ".join(f"{k} {level_text(results.study, k, v)}" for k, v in levels)
        if isinstance(analysis.baseline, str):
            what = f"against {analysis.baseline}"
    pairs = "paired by replication" if results.study.paired else "not paired"
    scope = "each metric" if analysis.family == "metric" else "the whole study"
    wanted = (
        ""
        if analysis.precision is None
        else f"; target half-width {percent(analysis.precision)} of the reference mean"
    )
    return f"{what}, {pairs}; family: {scope}, Bonferroni{wanted}"


# The declared comparisons.


def comparison_section(
    results: Results, compared: list[Comparison] | None = None
) -> Iterator[Block]:
    """The section on the declared comparisons; `compared`: these comparisons, if already computed."""
    if results.analysis.comparisons == "none":
        return
    compared = comparisons(results) if compared is None else compared
    yield Heading("Comparisons")
    same = left_out(results)
    if same:
        yield Text(
            f"{count(same, 'comparison')} excluded from the family: between identical runs, or of the "
            "same runs as another comparison."
        )
    if not compared:
        yield Text(
            "No comparison is left." if same else f"No comparison is possible: {why_none(results)}."
        )
        return
    yield Text(comparison_text(results, compared))
    for metric in dict.fromkeys(one.metric for one in compared):
        of_metric = [one for one in compared if one.metric == metric]
        yield Heading(f"{metric}, compared", 3)
        yield comparison_table(results, metric, of_metric)
    remark = pairing_remark(compared, results.study.paired)
    if remark:
        yield Text(remark)
    takes = precision_remark(compared, results.analysis.precision)
    if takes:
        yield Text(takes)
    still = sum(one.effect.difference.warning == NO_SPREAD_WARNING for one in compared)
    small = sum(bool(one.effect.difference.warning) for one in compared) - still
    if small:
        yield Text(
            f"Warning: {small} of these intervals are based on fewer than {STUDENT_MIN_RUNS} runs; their "
            "coverage may be lower than stated."
        )
    if still:
        yield Text(
            f"Warning: in {still} of these comparisons all runs of a point have the same value: the "
            "interval has no width, and p comes from a permutation test."
        )


def why_none(results: Results) -> str:
    """Why no comparison is possible."""
    if not list(declared_pairs(results)):
        return "the study declares no pair of points to compare"
    metrics, reasons = results.analysis.metrics, []
    if results.cut is not None:
        refused, unsteady = results.cut.refused, results.cut.unsteady
        reasons = [f"{point_name(results.study, results.points[n])}: {refused[n]}" for n in refused]
        reasons += [
            f"{metric} of {point_name(results.study, results.points[n])}: {why}"
            for (n, metric), why in unsteady.items()
            if metric in metrics
        ]
    if reasons:
        more = len(reasons) - MAX_REASONS
        return "; ".join(reasons[:MAX_REASONS]) + (f"; and {more:,} more" if more > 0 else "")
    if not any(results.has(metric) for metric in metrics):
        return f"no run has {', '.join(metrics)}"
    return "each point needs two complete runs"


def comparison_text(results: Results, compared: list[Comparison]) -> str:
    """How to read the table of comparisons."""
    sizes = sorted({one.family for one in compared})
    families = " and ".join(f"{size}" for size in sizes)
    answer = tests_of_best(results)
    with_answer = f", {answer:,} of them for the best point on the first page" if answer else ""
    return (
        f"Differences of means, {family(results)}. Tests in the family: {families}{with_answer}. A "
        "difference is called significant if its interval excludes 0, that is, if p times the number of "
        f"tests is below {results.analysis.error:g}. The intervals of a family hold simultaneously with "
        f"{percent(1 - results.analysis.error, 0)} confidence."
    )


def comparison_table(results: Results, metric: str, compared: list[Comparison]) -> Table:
    """One line for each comparison of a metric."""
    study, scale = results.study, results.scale(metric)
    heads = [*factor_heads(study), "against", f"difference, {scale.unit}", "low", "high"]
    heads += ["relative", ADJUSTED, "correlation", "var. ratio"]
    planned = results.analysis.precision is not None
    heads += ["needs paired", "unpaired"] if planned else []
    heads += RUN_HEADS
    rows = []
    for one in compared:
        found = one.effect
        both = [results.counts(point) for point in (one.a, one.b)]
        rows.append(
            [
                *factor_cells(study, one.a),
                levels_apart(study, one.a, one.b),
                *difference_cells(found.difference, scale),
                relative_text(found.relative),
                p_text(one.adjusted),
                "-" if found.correlation is None else f"{found.correlation:+.2f}",
                "-" if found.variance_ratio is None else f"{found.variance_ratio:.2f}",
                *needed_cells(one, planned),
                f"{one.runs[0]}, {one.runs[1]}",
                f"{both[0].censored}, {both[1].censored}",
                f"{both[0].failed}, {both[1].failed}",
            ]
        )
    return Table(heads, rows, left=1 + len(factor_heads(study)))


def needed_cells(one: Comparison, planned: bool) -> list[str]:
    """Runs that the declared precision needs, paired and unpaired; empty if none is declared."""
    if not planned:
        return []
    needed = (None, None) if one.needed is None else one.needed
    return ["-" if runs is None else f"{runs:,}" for runs in needed]


def difference_cells(difference: Interval | None, scale: MetricScale) -> list[str]:
    """A difference and the ends of its interval with a sign and four digits; "-" if missing."""
    if difference is None:
        return ["-"] * 3
    shown = scale.of(difference)
    return [signed(shown.value), *end_cells(shown, signed)]


def signed(value: float) -> str:
    """A difference as a cell."""
    return NumberText(f"{value:+,.4g}", value)


def p_text(p: float) -> str:
    """A p value as a cell."""
    return NumberText("<0.0001" if p < 1e-4 else f"{p:.4f}", p)


def relative_text(relative: Interval | None) -> str:
    """A relative effect with its interval, in percent."""
    if relative is None:
        return "-"
    if relative.low is None or relative.high is None:
        return f"{100 * relative.value:+.1f} % ({TOO_FEW})"
    low, high = 100 * relative.low, 100 * relative.high
    return f"{100 * relative.value:+.1f} % ({low:+.1f} to {high:+.1f})"


def effect_text(effect: Effect, scale: MetricScale) -> str:
    """An effect with its interval: in percent, or as a difference where the mean as it is may be 0."""
    if effect.relative is not None:
        return relative_text(effect.relative)
    value, low, high = difference_cells(effect.difference, scale)
    interval = f"{low} to {high}" if effect.difference.half is not None else TOO_FEW
    return f"{value} {scale.unit} ({interval})"


# Effects of the factors of a study, and their interactions.
#
#     main effect  of a level: its mean over all levels of the other factors, minus the mean of the
#                  first (or the baseline's) level
#     interaction  of a level of each of two factors: the effect of the one at the level of the other,
#                  minus its effect at the other's first level (a difference of differences)
#     share        of the squared deviations of the means of points; main effects, pairs of factors and
#                  the rest add up to 1
#
# They need a study with crossed factors and runs at each point. Each effect is a weighted sum of means
# of points and has a Student interval: with common seeds from the sums of replications, else from the
# variances of points (Satterthwaite 1946). The intervals of a metric hold simultaneously (Bonferroni).


class MainEffect(NamedTuple):
    """The effect of a level of a factor against its first level."""

    factor: str
    level: str
    mean: float
    against: str  # the first level; "" if this is the first level
    difference: Interval | None  # None for the first level, or with too few runs


class Interaction(NamedTuple):
    """The largest interaction of two factors."""

    factors: tuple[str, str]
    levels: tuple[str, str]
    against: tuple[str, str]
    difference: Interval | None


class FactorEffects(NamedTuple):
    """The effects of the factors of a study on a metric, in the unit of its runs."""

    metric: str
    main: tuple[MainEffect, ...]
    interactions: tuple[Interaction, ...]
    shares: Mapping[tuple[str, ...], float]  # of each factor and each pair; (): the rest
    family: int  # number of simultaneous intervals


class Crossed(NamedTuple):
    """A full factorial design: the levels of its factors, and the level numbers of each point."""

    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]  # by factor; the first level is the reference
    level_numbers: npt.NDArray[np.int64]  # (points, factors)


def crossed(results: Results) -> Crossed | None:
    """The design if it is a full factorial; None if not, or if nothing varies."""
    study = results.study
    factors, columns, names = [], [], []
    for factor in (SCENARIO_FACTOR, *study.factor_names):
        own = [level_of(study, point, factor) for point in results.points]
        order = list(dict.fromkeys(own))
        if len(order) == 1:
            continue
        factors.append(factor)
        first = _baseline_level(results, factor)
        if first in order:
            order.sort(key=lambda level: level != first)
        columns.append([order.index(level) for level in own])
        names.append(tuple(order))
    index = np.array(columns, np.int64).T.reshape(len(results.points), len(factors))
    cells = math.prod(len(own) for own in names)
    is_full = len(np.unique(index, axis=0)) == len(index) == cells
    return Crossed(tuple(factors), tuple(names), index) if factors and is_full else None


def _baseline_level(results: Results, factor: str) -> str | None:
    baseline = results.analysis.baseline_levels
    if factor not in baseline:
        return None
    return level_text(results.study, factor, baseline[factor])


def factor_effects(results: Results, metric: str) -> FactorEffects | None:
    """The effects of all factors on a metric; None if they cannot be separated."""
    design = crossed(results)
    if design is None:
        return None
    runs = [results.values(point, metric) for point in results.points]
    if not all(runs):
        return None
    means = np.array([math.fsum(own.values()) / len(own) for own in runs])
    pairs = list(itertools.combinations(range(len(design.factors)), 2))
    more = [len(levels) - 1 for levels in design.levels]  # levels besides the first
    family = sum(more) + sum(more[f] * more[g] for f, g in pairs)
    level = bonferroni(1 - results.analysis.error, max(1, family))
    common = results.study.common_random_numbers

    def interval(weights: Array) -> Interval | None:
        effect = contrast(runs, means, weights, level, common)
        return None if effect is None else effect.unless_vague(float(means.mean()))

    main = tuple(
        MainEffect(
            factor,
            name,
            float(means[design.level_numbers[:, f] == number].mean()),
            design.levels[f][0] if number else "",
            interval(step(design, f, number) / cells(design, f)) if number else None,
        )
        for f, factor in enumerate(design.factors)
        for number, name in enumerate(design.levels[f])
    )
    interactions = []
    for f, g in pairs:
        a, b = largest_interaction(design, means, f, g)
        interactions.append(
            Interaction(
                (design.factors[f], design.factors[g]),
                (design.levels[f][a], design.levels[g][b]),
                (design.levels[f][0], design.levels[g][0]),
                interval(step(design, f, a) * step(design, g, b) / cells(design, f, g)),
            )
        )
    return FactorEffects(metric, main, tuple(interactions), shares(design, means), family)


def step(design: Crossed, factor: int, level: int) -> Array:
    """(points,) 1 at this level of a factor, -1 at its first level, else 0."""
    own = design.level_numbers[:, factor]
    weights: Array = (own == level) * 1.0 - (own == 0) * 1.0
    return weights


def cells(design: Crossed, *factors: int) -> float:
    """The number of points that share each combination of levels of these factors."""
    return len(design.level_numbers) / math.prod(len(design.levels[f]) for f in factors)


def largest_interaction(design: Crossed, means: Array, f: int, g: int) -> tuple[int, int]:
    """The levels of two factors with the largest interaction."""
    table = np.zeros((len(design.levels[f]), len(design.levels[g])))
    np.add.at(table, (design.level_numbers[:, f], design.level_numbers[:, g]), means)
    beyond = np.abs(table - table[:1] - table[:, :1] + table[0, 0])[1:, 1:]
    a, b = np.unravel_index(int(beyond.argmax()), beyond.shape)
    return int(a) + 1, int(b) + 1


def contrast(
    runs: Sequence[Mapping[int, float]], means: Array, weights: Array, level: float, common: bool
) -> Interval | None:
    """The interval of a weighted sum of means; None if one of its points has fewer than two runs.

    `common`: replication r has the same seed at all points, so the interval uses the sums of
    replications, which are independent.
    """
    used: list[int] = np.flatnonzero(weights).tolist()
    if common:
        both = sorted(set.intersection(*(set(runs[point]) for point in used)))
        if len(both) < 2:
            return None
        values = np.array([[runs[point][r] for r in both] for point in used])
        sizes = np.abs(weights[used]) @ np.abs(values)
        effect = mean_interval(without_round_off(weights[used] @ values, sizes), level)
        return effect._replace(value=float(without_round_off(effect.value, sizes.mean())))
    if any(len(runs[point]) < 2 for point in used):
        return None
    parts = np.array(
        [
            weights[point] ** 2 * np.var(list(runs[point].values()), ddof=1) / len(runs[point])
            for point in used
        ]
    )
    total = without_round_off(weights @ means, np.abs(weights) @ np.abs(means))
    value, variance = float(total), float(parts.sum())
    n = min(len(runs[point]) for point in used)
    if variance <= 0:
        return Interval(value, value, value, n, "Welch", level, NO_SPREAD_WARNING)
    degrees = variance**2 / sum(
        part**2 / (len(runs[point]) - 1) for part, point in zip(parts, used, strict=True)
    )
    half = student(float(degrees), level) * math.sqrt(variance)
    return Interval(value, value - half, value + half, n, "Welch", level)


def without_round_off(sums: npt.ArrayLike, sizes: npt.ArrayLike) -> Array:
    """The sums, with 0 for those within round-off error; `sizes`: sums of the absolute terms."""
    return np.where(np.abs(sums) <= ROUND_OFF * np.asarray(sizes), 0.0, sums)


def shares(design: Crossed, means: Array) -> dict[tuple[str, ...], float]:
    """The shares of factors and of pairs in the squared deviations of means; (): the rest."""
    squared = float(((means - means.mean()) ** 2).sum())
    if squared <= 0:
        return {}
    parts: dict[tuple[int, ...], Array] = {(): np.full(len(means), means.mean())}
    out: dict[tuple[str, ...], float] = {}
    for size in (1, 2):
        for group in itertools.combinations(range(len(design.factors)), size):
            averages = _averages(design, means, group)
            inner = [parts[one] for one in parts if set(one) < set(group)]
            parts[group] = averages - np.sum(inner, axis=0)
            out[tuple(design.factors[f] for f in group)] = (
                float((parts[group] ** 2).sum()) / squared
            )
    out[()] = max(0.0, 1 - sum(out.values()))
    return out


def _averages(design: Crossed, means: Array, group: tuple[int, ...]) -> Array:
    """(points,) mean over all points that share the levels of a point in these factors."""
    _, member = np.unique(design.level_numbers[:, group], axis=0, return_inverse=True)
    member = member.reshape(-1)
    averages: Array = (np.bincount(member, means) / np.bincount(member))[member]
    return averages


def effects_section(results: Results) -> Iterator[Block]:
    """Main effects and interactions of the factors, for each metric of the analysis."""
    if len(results.points) < 2:
        return
    yield Heading("Effects of the factors")
    if crossed(results) is None:
        yield Text("Main effects cannot be estimated: the study does not cross its factors.")
        return
    for metric in results.analysis.metrics:
        if not results.has(metric):
            continue
        effects = factor_effects(results, metric)
        yield Heading(f"{metric} by factor", 3)
        if effects is None:
            yield Text(
                f"Main effects cannot be estimated: a point has no complete run with {metric}."
            )
            continue
        if effects.shares:
            yield Text(shares_text(results, effects))
        yield main_table(results, effects)
        if effects.interactions:
            yield interaction_table(results, effects)
        level = percent(1 - results.analysis.error, 0)
        intervals = f"{effects.family:,} simultaneous intervals ({level}, Bonferroni)"
        if effects.family == 1:
            intervals = f"1 interval ({level})"
        yield Text(f"Means over all levels of the other factors; {intervals}.")


def shares_text(results: Results, effects: FactorEffects) -> str:
    """The shares of factors in the variance between points, in a sentence."""
    heads = heads_by_factor(results.study)
    names = [
        (" x ".join(heads.get(name, name) for name in group) or "the rest", share)
        for group, share in effects.shares.items()
    ]
    parts = sorted(names, key=lambda item: -item[1])
    shown = ", ".join(f"{name} {percent(share)}" for name, share in parts if share >= 0.0005)
    return f"Share of variance explained (includes noise): {shown}."


def main_table(results: Results, effects: FactorEffects) -> Table:
    """One line for each level."""
    heads, scale = heads_by_factor(results.study), results.scale(effects.metric)
    rows = []
    for one in effects.main:
        cells = difference_cells(one.difference, scale)
        mean = figure(one.mean * scale.factor)
        name = heads.get(one.factor, one.factor)
        rows.append([name, one.level, mean, one.against or "-", *cells])
    head = ("factor", "level", f"mean, {scale.unit}", "against", "difference", "low", "high")
    return Table(head, rows, left=2, also_left=(3,))


def interaction_table(results: Results, effects: FactorEffects) -> Table:
    """The largest interaction of each pair of factors."""
    heads, scale = heads_by_factor(results.study), results.scale(effects.metric)
    rows = []
    for one in effects.interactions:
        first, second = (heads.get(name, name) for name in one.factors)
        (a, b), (c, d) = one.levels, one.against
        cells = difference_cells(one.difference, scale)
        rows.append([f"{first} {a} instead of {c}", f"{second} {b} instead of {d}", *cells])
    head = ("largest interaction of", "and", f"interaction effect, {scale.unit}")
    return Table((*head, "low", "high"), rows, left=2)
