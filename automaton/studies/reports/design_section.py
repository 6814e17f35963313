"""The design of a study: what was asked, and how it was made."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from automaton.runs.report_document import Block, Heading, Table, Text
from automaton.studies.inference.intervals import STUDENT_MIN_RUNS
from automaton.studies.reports.metric_tables import Scenarios
from automaton.studies.reports.point_names import level_text, varied_factors
from automaton.studies.reports.precision import stopping_text
from automaton.studies.reports.study_results import Results
from automaton.studies.reports.warm_up_cut import Cut
from automaton.units import count, percent, ticks_and_time

INTERVALS: Final = f"Student's, with a warning on skew below {STUDENT_MIN_RUNS} runs"
NO_WARM_UP: Final = "none: whole runs count"


def design(results: Results, scenarios: Scenarios) -> Iterator[Block]:
    """What was asked, and how it was made: all that another one needs to judge it."""
    study, analysis = results.study, results.analysis
    endings = "steady-state" if study.design == "steady-state" else "terminating"
    seeds = "replication r has the seed hash(study seed, r)"
    common = "the same for every point" if study.common_random_numbers else "one for each point"
    varied = [name for name in study.factor_names if name.startswith("durations.")]
    rows = [
        ["estimand", "mean of each metric over runs with seeds of their own, those that finish"],
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
    for name in study.factor_names:
        levels = ", ".join(level_text(study, name, level) for level in study.levels(name))
        yield Text(f"{'Factor' if name in varied_factors(study) else 'Fixed'} {name}: {levels}")


def warm_up(results: Results) -> str:
    """What is left out of all metrics, and who says so."""
    cut, declared, tick = results.cut, max(results.warm_ups), results.units.tick
    if cut is None:
        ticks = " or ".join(ticks_and_time(one, tick) for one in results.warm_ups)
        return f"the first {ticks}, as the scenarios say" if declared else NO_WARM_UP
    if not cut.ticks:
        return NO_WARM_UP
    of = f"the first {ticks_and_time(cut.ticks, tick)} of every run, which count in no metric"
    if not cut.found:
        return f"{of}; declared"
    least = f", not less than the {declared:,} that scenarios declare" if declared else ""
    return (
        f"{of}: the largest that MSER-5 finds at a point, by the deliveries in windows of "
        f"{count(cut.window, 'tick')} and by the times of orders and tasks{least}"
    )


def not_cut(metrics: Sequence[str], cut: Cut) -> str:
    """Why metrics of the runs are not those of a steady state."""
    return (
        f"{', '.join(metrics)}: left out, since rows keep no sums from which the warm-up could be "
        f"taken; a study with warm_up: {cut.ticks} has runs that measure after it"
    )


def runs_planned(results: Results) -> str:
    """Runs by point and in all."""
    study = results.study
    return f"{count(study.max_replications, 'run')} each, {count(study.runs, 'run')} in all"


def fixed(results: Results) -> str:
    """Whether the number of runs was declared before any was made."""
    rounds = stopping_text(results) if results.rounds else ""
    if not results.raised:
        return rounds or "n fixed beforehand"
    before = ", then ".join(map(str, results.raised))
    return f"{rounds}; " * bool(rounds) + (
        f"n not fixed beforehand: raised from {before} after runs had been made; if their metrics "
        "were the reason, intervals and p values say too much"
    )


def family(results: Results) -> str:
    """What is compared with what, corrected how."""
    analysis = results.analysis
    if analysis.comparisons == "none":
        return "none declared"
    what = "all pairs of points"
    if analysis.comparisons == "baseline" and analysis.baseline:
        levels = analysis.baseline.items()
        what = "against " + ", ".join(f"{k} {level_text(results.study, k, v)}" for k, v in levels)
    pairs = "paired by replication" if results.study.paired else "not paired"
    scope = "each metric" if analysis.family == "metric" else "the whole study"
    wanted = (
        "" if analysis.precision is None else f"; wanted to within {percent(analysis.precision)}"
    )
    return f"{what}, {pairs}; family: {scope}, p by Holm, intervals by Bonferroni{wanted}"
