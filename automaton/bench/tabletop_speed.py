"""Whole runs of the table-top warehouse: what a sweep pays for a run, setting up included.

The floor and its distance fields are shared by all runs on it, so the warm-up has built them.
"""

from __future__ import annotations

from collections.abc import Sequence

from automaton.bench.measurement import MS_PER_RUN, Measurement, Sample, cpu_seconds
from automaton.papers.reproduction_study import ScenarioCase
from automaton.papers.tabletop_study import TABLETOP_STRATEGIES, cases, seeing_everything
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, resolve

SEEDS = (1, 2, 3)


def measurements() -> list[Measurement]:
    """One: the average over the cells of the paper's Table 3, with robots that see the whole state."""
    return [Measurement("table-top run", MS_PER_RUN, prepare)]


def prepare(seeds: Sequence[int] = SEEDS) -> Sample:
    """A sampler: ms per run, over all cells and seeds."""
    tried = seeing_everything(cases)(TABLETOP_STRATEGIES)
    scenarios = [resolve(c.scenario, c.overrides) for c in tried if isinstance(c, ScenarioCase)]

    def sample() -> float:
        runs = len(scenarios) * len(seeds)
        return 1e3 * cpu_seconds(lambda: run_through(scenarios, seeds)) / runs

    return sample


def run_through(scenarios: Sequence[Resolved], seeds: Sequence[int]) -> None:
    """Build and run every scenario with every seed."""
    for resolved in scenarios:
        for seed in seeds:
            simulation = Simulation(resolved, seed)
            simulation.run()
            if not simulation.finished:
                raise AssertionError(f"{resolved.overrides} with seed {seed} did not finish")
