"""No run hangs: two to five robots, both configurations, all strategies, every seed ends.

A part of what `automaton reproduce tabletop --seeds 200` runs. What hangs when a rule is missing:
head-on meetings without retreat, cycles of three without the limit of retries, robots parked on
the track, loads that no robot may take.
"""

from __future__ import annotations

import pytest

from automaton.studies.process_pool import run_all
from automaton.world.resolve import resolve

SEEDS = range(1001, 1026)  # not those of the reproduction
LONGEST = 3.5  # times the mean of all seeds: a run that crawls is not a run that ends


@pytest.mark.parametrize("allocation", ["independent", "cooperative", "adaptive"])
@pytest.mark.parametrize("name", ["tabletop-1", "tabletop-2"])
def test_every_run_ends(name: str, allocation: str) -> None:
    fleets = [
        resolve(name, [f"fleet.robots={robots}", f"strategy.allocation={allocation}"])
        for robots in (2, 3, 4, 5)
    ]
    for runs in run_all(fleets, SEEDS, workers=1):
        ticks = [run.metrics["makespan"] for run in runs]
        assert [run.seed for run in runs if not run.finished] == []
        assert max(ticks) < LONGEST * sum(ticks) / len(ticks)
        assert all(run.metrics["illegal_answers"] == 0 for run in runs)


def test_without_withdrawals_runs_do_hang() -> None:
    """The counter-check: the situations that retreats resolve do occur."""
    waiting = resolve("tabletop-1", ["strategy.right_of_way=wait", "stop.max_duration=20000"])
    (runs,) = run_all([waiting], SEEDS, workers=1)
    assert sum(not run.finished for run in runs) > len(runs) / 2
