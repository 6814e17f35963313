"""What each factor of a study changes, and which factors depend on each other.

    main effect of a level   its mean over all levels of the other factors, less that of the first
                             level (or of the baseline's)
    interaction of a pair    by how much more a level of one factor changes at a level of the other
                             than at that one's first: a difference of differences
    share                    of the squared differences between the means of points, which main effects,
                             pairs of factors and the rest make up exactly

They need a study that crosses its factors, and runs at each point. Each is a weighted sum of means
of points, so its interval is Student's: with common seeds that of the sums of replications, else by
the variances of points (Satterthwaite 1946). The intervals of a metric hold together (Bonferroni).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.studies.inference.effects import bonferroni
from automaton.studies.inference.intervals import NO_SPREAD_WARNING, Interval, mean_interval
from automaton.studies.inference.t_distribution import student
from automaton.studies.reports.point_names import level_of, level_text
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import SCENARIO

Array = npt.NDArray[np.float64]
ROUND_OFF: Final = 1e-12  # of what is summed up; a sum that is less is 0


class MainEffect(NamedTuple):
    """A level of a factor, against its first one."""

    factor: str
    level: str
    mean: float
    against: str  # a level; "": this is the first one
    difference: Interval | None  # None: of the first level, or too few runs


class Interaction(NamedTuple):
    """Of two factors, the largest difference of differences."""

    factors: tuple[str, str]
    levels: tuple[str, str]
    against: tuple[str, str]
    difference: Interval | None


class FactorEffects(NamedTuple):
    """What the factors of a study change of a metric, in the unit of its runs."""

    metric: str
    main: tuple[MainEffect, ...]
    interactions: tuple[Interaction, ...]
    shares: Mapping[tuple[str, ...], float]  # of a factor, of a pair; (): of the rest
    family: int  # intervals that hold together


class Crossed(NamedTuple):
    """The points of a study that crosses its factors: of each its level of each factor, as a number."""

    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]  # by factor, the first one is that compared with
    level_numbers: npt.NDArray[np.int64]  # (points, factors)


def crossed(results: Results) -> Crossed | None:
    """The design, if all levels of its factors meet once; None if not, or if nothing varies."""
    study = results.study
    factors, columns, names = [], [], []
    for factor in (SCENARIO, *study.factor_names):
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
    baseline = results.analysis.baseline or {}
    if factor not in baseline:
        return None
    return level_text(results.study, factor, baseline[factor])


def factor_effects(results: Results, metric: str) -> FactorEffects | None:
    """The effects of all factors on a metric; None where they cannot be separated."""
    design = crossed(results)
    if design is None:
        return None
    runs = [results.values(point, metric) for point in results.points]
    if not all(runs):
        return None
    means = np.array([math.fsum(own.values()) / len(own) for own in runs])
    pairs = list(itertools.combinations(range(len(design.factors)), 2))
    more = [len(levels) - 1 for levels in design.levels]  # than the first one
    family = sum(more) + sum(more[f] * more[g] for f, g in pairs)
    level = bonferroni(1 - results.analysis.error, max(1, family))
    common = results.study.common_random_numbers

    def interval(weights: Array) -> Interval | None:
        return contrast(runs, means, weights, level, common)

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
    """(points,) 1 at this level of a factor, -1 at its first one, else 0."""
    own = design.level_numbers[:, factor]
    weights: Array = (own == level) * 1.0 - (own == 0) * 1.0
    return weights


def cells(design: Crossed, *factors: int) -> float:
    """How many points share each combination of levels of these factors."""
    return len(design.level_numbers) / math.prod(len(design.levels[f]) for f in factors)


def largest_interaction(design: Crossed, means: Array, f: int, g: int) -> tuple[int, int]:
    """The levels of two factors with the largest difference of differences from their first ones."""
    table = np.zeros((len(design.levels[f]), len(design.levels[g])))
    np.add.at(table, (design.level_numbers[:, f], design.level_numbers[:, g]), means)
    beyond = np.abs(table - table[:1] - table[:, :1] + table[0, 0])[1:, 1:]
    a, b = np.unravel_index(int(beyond.argmax()), beyond.shape)
    return int(a) + 1, int(b) + 1


def contrast(
    runs: Sequence[Mapping[int, float]], means: Array, weights: Array, level: float, common: bool
) -> Interval | None:
    """The interval of a weighted sum of means; None for fewer than two runs of a point in it.

    `common`: replication r has the same seed at all points, so sums of replications are independent.
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
    """Sums with 0 for those that are nothing beside what was summed up: `sizes`, of equal shape."""
    return np.where(np.abs(sums) <= ROUND_OFF * np.asarray(sizes), 0.0, sums)


def shares(design: Crossed, means: Array) -> dict[tuple[str, ...], float]:
    """The shares of factors and of pairs in the squared differences between means; (): the rest."""
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
    """(points,) of each point the mean of all that share its levels of these factors."""
    _, member = np.unique(design.level_numbers[:, group], axis=0, return_inverse=True)
    member = member.reshape(-1)
    averages: Array = (np.bincount(member, means) / np.bincount(member))[member]
    return averages
