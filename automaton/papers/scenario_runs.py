"""Runs of the living world for `auctions-floor`: what is run for a case, and what is read off it.

Every strategy faces the same orders and the same failures: they depend on the seed alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import msgspec
import numpy as np

from automaton.build.resolve import Resolved, resolve
from automaton.engine.random_numbers import STREAM_BREAKDOWNS, random_between
from automaton.engine.robot_status import FAILURE_DEPLETED
from automaton.engine.state import ACTION_CHARGE, ACTION_QUEUE, ORDER_DELIVERED, World
from automaton.papers.reproduction_study import Runner, ScenarioCase, with_published_names
from automaton.runs.metrics import metrics_of
from automaton.runs.process_pool import OnDone, Result, RunFunction, run_and_measure, run_jobs
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Fault

LOOK_EVERY: Final = 5  # ticks between two looks at the line before a charger; a move takes 10
LAST_FAILURE: Final = 2500  # tick until which a robot fails
TOW_AFTER: Final = 200  # ticks

Figures = dict[str, float | int]


def to_the_end(simulation: Simulation) -> Figures:
    """A run, and whether somebody was stranded, everything was delivered, loads were recovered."""
    return run_and_measure(simulation) | outcome_of(simulation.world)


def outcome_of(world: World) -> Figures:
    """Shares of runs (0 or 1 in a single one), and the loads that were picked up twice."""
    return {
        "stranded": float(world.tally.failures[:, FAILURE_DEPLETED].any()),
        "all_delivered": float((world.orders.state == ORDER_DELIVERED).all()),
        "recovered": int((world.orders.legs > 1).sum()),
    }


def with_lines(simulation: Simulation) -> Figures:
    """A run with a look at the line before the charger every few ticks.

    `in_line`: share of looks at which two or more stand in line; `wait`: ticks in line per stay.
    """
    limit, looks, lines = simulation.resolved.scenario.stop.max_duration, 0, 0
    while not simulation.finished and simulation.tick < limit:
        simulation.run(until=simulation.tick + LOOK_EVERY)
        looks += 1
        lines += int((simulation.world.robots.action == ACTION_QUEUE).sum()) >= 2
    tally = simulation.world.tally
    stays = int(tally.operations[:, ACTION_CHARGE].sum())
    return {
        **metrics_of(simulation),
        **outcome_of(simulation.world),
        "in_line": lines / looks,
        "wait": float(tally.ticks[:, ACTION_QUEUE].sum()) / max(1, stays),
        "stays": stays,
    }


def with_failure(resolved: Resolved, seed: int) -> Resolved:
    """The same scenario in which one robot, drawn by the seed, fails at a tick drawn by it."""
    with np.errstate(over="ignore"):
        address = np.uint64(seed), STREAM_BREAKDOWNS, 0
        robot = random_between(0, resolved.scenario.fleet.robots - 1, *address, 0)
        at = random_between(1, LAST_FAILURE, *address, 1)
    faults = msgspec.structs.replace(
        resolved.scenario.faults, listed=(Fault(robot=int(robot), at=int(at)),), tow_after=TOW_AFTER
    )
    scenario = msgspec.structs.replace(resolved.scenario, faults=faults)
    return replace(resolved, scenario=scenario)


def conduct_all(conduct: RunFunction, failing: bool = False) -> Runner:
    """A table's runner: each case with each seed, conducted like this."""

    def run(
        cases: Sequence[ScenarioCase],
        seeds: Sequence[int],
        workers: int | None = None,
        on_done: OnDone | None = None,
    ) -> list[list[Result]]:
        scenarios = [resolve(case.scenario, case.overrides) for case in cases]
        jobs = [
            (with_failure(resolved, seed) if failing else resolved, seed)
            for resolved in scenarios
            for seed in seeds
        ]
        results = [
            with_published_names(result) for result in run_jobs(jobs, workers, on_done, conduct)
        ]
        return [results[k : k + len(seeds)] for k in range(0, len(results), len(seeds))]

    return run


def beside_infinite(
    cases: Sequence[ScenarioCase],
    seeds: Sequence[int],
    workers: int | None = None,
    on_done: OnDone | None = None,
) -> list[list[Result]]:
    """Runs with `share`: throughput as a share of that of the first case with the same seed."""
    results = conduct_all(to_the_end)(cases, seeds, workers, on_done)
    most = [result.metrics["throughput"] for result in results[0]]
    return [
        [
            result._replace(
                metrics=result.metrics | {"share": result.metrics["throughput"] / reference}
            )
            for result, reference in zip(batch, most, strict=True)
        ]
        for batch in results
    ]
