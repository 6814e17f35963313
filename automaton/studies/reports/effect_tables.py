"""The section of a report about what each factor changes, alone and with others."""

from __future__ import annotations

from collections.abc import Iterator

from automaton.runs.report_document import Block, Heading, Table, Text
from automaton.studies.reports.comparison_tables import signed
from automaton.studies.reports.factor_effects import FactorEffects, crossed, factor_effects
from automaton.studies.reports.metric_tables import figure
from automaton.studies.reports.point_names import heads_by_factor
from automaton.studies.reports.study_results import Results
from automaton.units import count, percent


def effects_section(results: Results) -> Iterator[Block]:
    """Main effects and interactions of the factors, for each metric of the analysis."""
    if len(results.points) < 2:
        return
    yield Heading("Effects of the factors")
    if crossed(results) is None:
        yield Text("Not separable: the study does not cross its factors.")
        return
    for metric in results.analysis.metrics:
        if not results.has(metric):
            continue
        effects = factor_effects(results, metric)
        yield Heading(f"{metric} by factor", 3)
        if effects is None:
            yield Text(f"Not separable: a point has no finished run with {metric}.")
            continue
        if effects.shares:
            yield Text(shares_text(results, effects))
        yield main_table(results, effects)
        if effects.interactions:
            yield interaction_table(results, effects)
        level = percent(1 - results.analysis.error, 0)
        yield Text(
            f"Means over all levels of the other factors; {count(effects.family, 'interval')}, which "
            f"hold together with {level} (Bonferroni)."
        )


def shares_text(results: Results, effects: FactorEffects) -> str:
    """How much of the differences between points each factor makes up."""
    heads = heads_by_factor(results.study)
    names = [
        (" with ".join(heads.get(name, name) for name in group) or "the rest", share)
        for group, share in effects.shares.items()
    ]
    parts = sorted(names, key=lambda item: -item[1])
    shown = ", ".join(f"{name} {percent(share)}" for name, share in parts if share >= 0.0005)
    return f"Of the squared differences between the means of points, chance included: {shown}."


def main_table(results: Results, effects: FactorEffects) -> Table:
    """One line for each level."""
    heads, scale = heads_by_factor(results.study), results.scale(effects.metric)
    rows = []
    for one in effects.main:
        cells = ["-"] * 3
        if one.difference is not None:
            shown = scale.of(one.difference)
            cells = [signed(end) for end in (shown.value, shown.low, shown.high)]
        mean = figure(one.mean * scale.factor)
        name = heads.get(one.factor, one.factor)
        rows.append([name, one.level, mean, one.against or "-", *cells])
    head = ("factor", "level", f"mean, {scale.unit}", "against", "difference", "low", "high")
    return Table(head, rows, left=2, also_left=(3,))


def interaction_table(results: Results, effects: FactorEffects) -> Table:
    """Of each pair of factors the largest difference of differences."""
    heads, scale = heads_by_factor(results.study), results.scale(effects.metric)
    rows = []
    for one in effects.interactions:
        first, second = (heads.get(name, name) for name in one.factors)
        (a, b), (c, d) = one.levels, one.against
        cells = ["-"] * 3
        if one.difference is not None:
            shown = scale.of(one.difference)
            cells = [signed(end) for end in (shown.value, shown.low, shown.high)]
        rows.append([f"{first} {a} instead of {c}", f"{second} {b} instead of {d}", *cells])
    head = ("largest interaction of", "and", f"beyond both alone, {scale.unit}")
    return Table((*head, "low", "high"), rows, left=2)
