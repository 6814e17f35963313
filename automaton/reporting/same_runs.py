"""Points whose runs are the same: a factor that does nothing there is no comparison.

With one robot, right of way changes nothing: every seed ends with the same digest under each rule.
Such points are called the same runs, tables say of which point, and a family compares them once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from automaton.experiments.study import SCENARIO, Point
from automaton.reporting.results import Results, factor_heads, level_text, levels_beside
from automaton.units import count

MOST_NAMED: Final = 6  # pairs of points


def same_heads(results: Results) -> list[str]:
    """The head of a table's column about the same runs; none if all points differ."""
    return ["the same runs as"] if results.repeats else []


def same_cells(results: Results, point: Point) -> list[str]:
    """Under `same_heads`: the number of the first point with the same runs."""
    first = results.alike(point)
    cell = "-" if first == point.number else f"point {first}"
    return [cell for _ in same_heads(results)]


def same_remarks(results: Results) -> Iterator[str]:
    """Which factors have no effect, and where; if none has, which points have the same runs."""
    inert = list(inert_factors(results)) if results.repeats else []
    yield from inert
    if results.repeats and not inert:
        named = [
            f"point {p.number} and point {results.alike(p)}" for p in results.repeats[:MOST_NAMED]
        ]
        more = len(results.repeats) - len(named)
        rest = f"; and {more:,} more" if more else ""
        yield f"the same runs, digest by digest: {'; '.join(named)}{rest}"


def inert_factors(results: Results) -> Iterator[str]:
    """A sentence for each factor whose levels give the same runs, everywhere or somewhere."""
    study = results.study
    several = [SCENARIO] if len(study.scenarios) > 1 else []
    for factor in [*several, *study.factor_names]:
        groups: dict[str, list[Point]] = {}
        for point in results.points:
            if factor == SCENARIO or factor in point.levels:
                groups.setdefault(levels_beside(point, (factor,)), []).append(point)
        compared = [group for group in groups.values() if len(group) > 1]
        inert = [g for g in compared if len({results.alike(p) for p in g}) == 1]
        if inert:
            where = (
                "" if len(inert) == len(compared) else f" with {_beside(results, inert, factor)}"
            )
            yield (
                f"{factor} has no effect{where}: its levels give the same runs, digest by digest, "
                "and are not compared"
            )


def _beside(results: Results, groups: list[list[Point]], factor: str) -> str:
    """The levels of the other factors in these groups; only what all of them share, if there is."""
    study = results.study
    heads = factor_heads(study)[len(factor_heads(study)) - len(study.factor_names) :]
    shared = [
        f"{head} {level_text(study, name, levels[0])}"
        for head, name in zip(heads, study.factor_names, strict=True)
        if name != factor
        and (levels := [group[0].levels.get(name) for group in groups])
        and all(level == levels[0] for level in levels)
    ]
    return ", ".join(shared) or f"{count(len(groups), 'combination')} of the other factors"
