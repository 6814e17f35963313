"""The chosen design made simpler and explained: one-way streets, fewer streets, and reasons.

Each step has its own seeds, so that what one of them chooses does not bias the next, nor the verdict.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from automaton.studies.street_search.designs import StreetDesign, StreetRuns
from automaton.studies.street_search.one_way import NeededWays, OneWay, flow_of, one_way
from automaton.studies.street_search.reasons import (
    MOST_CONFIRMED,
    ComparedRuns,
    FewerStreets,
    LeadTimes,
    Reason,
    fewer,
    lead_times_by_group,
    reasons,
    with_groups,
)
from automaton.world.resolved import Resolved

SELECT_RUNS_EACH: Final = 20  # in which a closed street is tried open, and streets are left out
SCREENING_PAIRS: Final = 8  # of each street, if there are many
REASON_PAIRS: Final = 40
LOSS_PAIRS: Final = 100  # that show what one-way streets cost
FLOW_RUNS: Final = 2


class FinishedDesign(NamedTuple):
    """A design after its last steps."""

    design: StreetDesign
    one_way: OneWay | None  # None: not asked for
    reasons: list[Reason]  # of all streets, those that were left out included
    fewer: FewerStreets


class DesignContext(NamedTuple):
    """The scenario of a search."""

    base: Resolved  # without streets
    with_design: Callable[[StreetDesign], Resolved]  # it with other streets
    runs: StreetRuns
    metric: str
    is_higher_better: bool
    robots: tuple[int | None, ...]  # the fleets over which designs are compared
    seeds: Callable[[str, int], list[int]]  # that serve one purpose only
    workers: int | None  # for the runs that count lead times

    def lead_times(
        self, designs: Sequence[StreetDesign], seeds: Sequence[int]
    ) -> list[list[LeadTimes]]:
        """What `lead_times_by_group` counts, by design and seed."""
        from automaton.studies.process_pool import PersistentPool  # needs Numba

        sums: list[list[LeadTimes]] = []
        with PersistentPool(self.workers, lead_times_by_group) as pool:
            for design in designs:
                resolved = self.with_design(design)
                sums.append([one.metrics for one in pool.run([(resolved, seed) for seed in seeds])])
        return sums


def most_runs(streets: int, is_one_way: bool, scaled: Callable[[int], int] = int) -> int:
    """The most runs of these steps for a design with this number of streets at most."""
    select = scaled(SELECT_RUNS_EACH)
    tried = select * (1 + streets) + 2 * scaled(LOSS_PAIRS) if is_one_way else 0
    screened = scaled(SCREENING_PAIRS) * (1 + streets) if streets > MOST_CONFIRMED else 0
    confirmed = scaled(REASON_PAIRS) * (1 + min(streets, MOST_CONFIRMED))
    return tried + screened + confirmed + 2 * select


def finished(design: StreetDesign, context: DesignContext, is_one_way: bool) -> FinishedDesign:
    """Make streets one-way if asked for, find the reasons, and leave out streets without effect."""
    resolved = context.with_design(design)
    compared = ComparedRuns(context.runs, context.metric, context.is_higher_better, context.robots)
    select = context.seeds("select", SELECT_RUNS_EACH)
    closed = None
    if is_one_way:
        flow = flow_of(resolved, context.seeds("flow", FLOW_RUNS))
        held_out = context.seeds("one-way", LOSS_PAIRS)
        closed = one_way(design, NeededWays(resolved), flow, compared, select, held_out)
        design = closed.design
    floor_plan, fresh = context.base.floor_plan, context.seeds("reasons", REASON_PAIRS)
    screening = context.seeds("screening", SCREENING_PAIRS)
    ranked = reasons(design, floor_plan, compared, screening, fresh)
    ranked = with_groups(ranked, design, floor_plan, context.lead_times, fresh)
    left = fewer(design, floor_plan, ranked, compared, select)
    return FinishedDesign(left.design, closed, ranked, left)
