"""Points whose runs are the same, digest by digest, and the factors that make no difference there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from automaton.studies.reports.point_names import heads_by_factor, level_text, levels_beside
from automaton.studies.reports.study_results import MIN_SHARED_SEEDS, Results
from automaton.studies.sweeps.study import SCENARIO, Point
from automaton.units import count

MAX_SAME_RUNS_NAMED: Final = 6  # pairs of points


def same_heads(results: Results) -> list[str]:
    """The head of a table's column about the same runs; none if all points differ."""
    return ["the same runs as"] if results.repeats else []


def same_cells(results: Results, point: Point) -> list[str]:
    """Under `same_heads`: the number of the first point with the same runs."""
    first = results.first_same[point.number]
    cell = "-" if first == point.number else f"point {first}"
    return [cell for _ in same_heads(results)]


def same_remarks(results: Results) -> Iterator[str]:
    """Which factors change no run, and where; if none is so, which points have the same runs."""
    inert = list(inert_factors(results)) if results.repeats else []
    yield from inert
    if results.repeats and not inert:
        named = [
            f"point {p.number} and point {results.first_same[p.number]}"
            for p in results.repeats[:MAX_SAME_RUNS_NAMED]
        ]
        more = len(results.repeats) - len(named)
        rest = f"; and {more:,} more" if more else ""
        yield f"the same runs, digest by digest: {'; '.join(named)}{rest}"


def inert_factors(results: Results) -> Iterator[str]:
    """Sentences for each factor whose levels give the same runs, everywhere or somewhere."""
    study = results.study
    several = [SCENARIO] if len(study.scenarios) > 1 else []
    for factor in [*several, *study.factor_names]:
        groups: dict[str, list[Point]] = {}
        for point in results.points:
            if factor == SCENARIO or factor in point.levels:
                groups.setdefault(levels_beside(point, (factor,)), []).append(point)
        compared = [group for group in groups.values() if len(group) > 1]
        same = [group for group in compared if _agree(results, group)]
        apart = [[m for m in results.reported if not _agree(results, g, m)] for g in same]
        inert = [group for group, metrics in zip(same, apart, strict=True) if not metrics]
        otherwise = [group for group, metrics in zip(same, apart, strict=True) if metrics]
        if inert:
            yield (
                f"{factor} has no effect{_where(results, inert, compared, factor)}: its levels give "
                "the same runs, digest by digest, and are not compared"
            )
        if otherwise:
            differ = dict.fromkeys(metric for metrics in apart for metric in metrics)
            yield (
                f"{factor} changes no run{_where(results, otherwise, compared, factor)}: its levels "
                f"give the same runs, digest by digest, measured otherwise ({', '.join(differ)})"
            )


def _agree(results: Results, group: list[Point], metric: str | None = None) -> bool:
    """Whether all of these points have the same runs, with seeds that all of them share."""
    known: dict[int, object] = {}
    for point in group:
        for seed, run in results.runs(point, metric).items():
            if known.setdefault(seed, run) != run:
                return False
    shared = set(known).intersection(*(results.runs(point) for point in group))
    return len(shared) >= MIN_SHARED_SEEDS


def _where(
    results: Results, groups: list[list[Point]], compared: list[list[Point]], factor: str
) -> str:
    """Where that is, if it is not everywhere."""
    everywhere = len(groups) == len(compared)
    return "" if everywhere else f" with {_beside(results, groups, factor)}"


def _beside(results: Results, groups: list[list[Point]], factor: str) -> str:
    """The levels of the other factors in these groups; only what all of them share, if there is."""
    study = results.study
    shared = [
        f"{head} {level_text(study, name, levels[0])}"
        for name, head in heads_by_factor(study).items()
        if name != factor
        and (levels := [group[0].levels.get(name) for group in groups])
        and all(level == levels[0] for level in levels)
    ]
    return ", ".join(shared) or f"{count(len(groups), 'combination')} of the other factors"
