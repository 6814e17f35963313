"""How reports name design points, factors and their levels."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from automaton.studies.sweeps.study import SCENARIO, Point, Study


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


def heads_by_factor(study: Study) -> dict[str, str]:
    """A short name of each factor: its last part, where no other has the same."""
    names = list(study.factor_names)
    short = [name.rpartition(".")[2] for name in names]
    return {
        name: last if short.count(last) == 1 else name
        for name, last in zip(names, short, strict=True)
    }


def factor_heads(study: Study) -> list[str]:
    """The heads of tables for what varies: the scenario if there are several, then factors."""
    heads = heads_by_factor(study)
    several = ["scenario"] if len(study.scenarios) > 1 else []
    return several + [heads[name] for name in varied_factors(study)]


def factor_cells(study: Study, point: Point) -> list[str]:
    """The levels of a point, under `factor_heads`."""
    several = [point.scenario] if len(study.scenarios) > 1 else []
    return several + [level_of(study, point, name) for name in varied_factors(study)]


def level_of(study: Study, point: Point, factor: str) -> str:
    """The level of a point as text, the scenario's name included; "-": it has none."""
    if factor == SCENARIO:
        return point.scenario
    return level_text(study, factor, point.levels[factor]) if factor in point.levels else "-"


def levels_beside(point: Point, factors: Collection[str]) -> str:
    """What identifies the points that differ in these factors alone."""
    beside = {SCENARIO: point.scenario, **point.levels}
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
