"""Whether the runs of a study are as many as its declared precision takes, and how many come next.

What decides are the intervals that the report prints: of all comparisons, at the level of their family;
without comparisons those of all means.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, NamedTuple

from automaton.studies.inference.effects import fewest
from automaton.studies.inference.intervals import checked
from automaton.studies.inference.rounds import next_round
from automaton.studies.reports.comparisons import comparisons, declared_pairs, differing
from automaton.studies.reports.point_names import levels_apart, point_name
from automaton.studies.reports.study_results import Results, read_results
from automaton.units import count, percent

if TYPE_CHECKING:
    from automaton.studies.sweeps.result_store import Store

COVERAGE_NOTE: Final = (
    "intervals decided how many runs were made, and hold the truth a little less often than with n "
    "fixed beforehand (docs/explanation/statistics.md says how often)"
)


class Wanted(NamedTuple):
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
        f"{n:,} runs of each point are done; {wanted.interval} to within {precision} takes about "
        f"{wanted.runs:,}: going on to {replications:,}"
    )
    return NextRound(replications, why)


def most_wanted(results: Results) -> Wanted | None:
    """The interval that takes the most runs; None without an interval of which a share can be taken."""
    return max(_wanted(results), key=lambda one: one.runs, default=None)


def _wanted(results: Results) -> Iterator[Wanted]:
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
                yield Wanted(
                    _with_lost(runs, usable, results), f"{one.metric} of {name} against {against}"
                )


def _wanted_of_means(results: Results) -> Iterator[Wanted]:
    analysis = results.analysis
    for metric in analysis.metrics:
        for point in results.points:
            values = list(results.values(point, metric).values())
            half = (analysis.precision or 0.0) * abs(math.fsum(values)) / max(1, len(values))
            if len(values) >= 2 and half > 0:
                variance = float(checked(values).var(ddof=1))
                runs = fewest(variance, 1.0, half, 1 - analysis.error)
                name = point_name(results.study, point)
                yield Wanted(_with_lost(runs, len(values), results), f"{metric} of {name}")


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
    text = f"{count(len(rounds), 'round')} of {sizes} runs, until {what} are within {precision}"
    return f"{text}: {_end(results)}"


def _end(results: Results) -> str:
    if any(results.counts(point).missing for point in results.points):
        return "the last one is not done yet"
    wanted, n = most_wanted(results), results.rounds[-1]
    if wanted is None:
        return "ended, since no interval can be compared with a mean"
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
        yield f"the declared precision is not reached: {wanted.interval} takes about {wanted.runs:,} runs"
    if len(results.rounds) > 1:
        yield COVERAGE_NOTE
