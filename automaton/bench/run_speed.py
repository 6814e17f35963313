"""The cost of runs: whole runs of the table-top warehouse, ticks with pods, recording,
verification.

A run of the table-top warehouse includes its set-up, as in a sweep. All runs on a floor share the
floor and its distance tables, which the warm-up builds. Robots that carry pods to stations with
queues are measured per robot and tick, including the assignment of lines to trips. Recording to a
file and verifying it are measured as multiples of the run's time.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from automaton.bench.measurement import (
    MS_PER_RUN,
    NS_PER_ROBOT_AND_TICK,
    TIMES_THE_RUN,
    Measurement,
    Sample,
    cpu_seconds,
)
from automaton.papers.reproduction_study import ScenarioCase
from automaton.papers.tabletop_study import TABLETOP_STRATEGIES, cases, seeing_everything
from automaton.recording.recorder import Recorder
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify
from automaton.world.resolve import Resolved, resolve

SEEDS: Final = (1, 2, 3)  # of each cell of the table
GOODS_SCENARIO: Final = "goods-60x40"  # robots carry pods to stations
POD_STARTED, POD_TICKS = 500, 2000
POD_RIGHTS_OF_WAY: Final = ("pibt", "retreat")
RECORDED_TICKS: Final = 5000
RECORDING_NAME: Final = "run.rec"


def tabletop_measurements() -> list[Measurement]:
    """One: the average over the cells of the paper's Table 3, with robots that see the whole state."""
    return [Measurement("table-top run", MS_PER_RUN, prepare_tabletop)]


def prepare_tabletop(seeds: Sequence[int] = SEEDS) -> Sample:
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


def pod_measurements() -> list[Measurement]:
    """The shipped floor with 30 robots, while traffic flows."""
    return [
        Measurement(
            f"{GOODS_SCENARIO}, whole tick with {right_of_way}",
            NS_PER_ROBOT_AND_TICK,
            partial(prepare_pods, right_of_way),
        )
        for right_of_way in POD_RIGHTS_OF_WAY
    ]


def prepare_pods(right_of_way: str, started: int = POD_STARTED, ticks: int = POD_TICKS) -> Sample:
    """A sampler: ns per robot and tick over a number of ticks, after the first ones."""
    resolved = resolve(GOODS_SCENARIO, (f"strategy.right_of_way={right_of_way}",))
    robots = resolved.scenario.fleet.robots

    def sample() -> float:
        simulation = Simulation(resolved)
        simulation.run(started)
        seconds = cpu_seconds(lambda: simulation.run(started + ticks))
        return 1e9 * seconds / (robots * ticks)

    return sample


def recording_measurements() -> list[Measurement]:
    """The same ticks each time, including set-up."""
    return [
        Measurement(
            f"{GOODS_SCENARIO}, {RECORDED_TICKS:,} ticks recorded", TIMES_THE_RUN, prepare_recorded
        ),
        Measurement(
            f"{GOODS_SCENARIO}, {RECORDED_TICKS:,} ticks verified", TIMES_THE_RUN, prepare_verified
        ),
    ]


def prepare_recorded(scenario: str = GOODS_SCENARIO, ticks: int = RECORDED_TICKS) -> Sample:
    """A sampler: CPU time of a recorded run / CPU time of the run alone."""
    resolved = resolve(scenario, (f"stop.max_duration={ticks}",))
    folder = tempfile.TemporaryDirectory(prefix="automaton-bench-")
    return lambda: ratio(lambda: record(resolved, Path(folder.name) / RECORDING_NAME), resolved)


def prepare_verified(scenario: str = GOODS_SCENARIO, ticks: int = RECORDED_TICKS) -> Sample:
    """A sampler: CPU time of verifying a recording / CPU time of its run."""
    resolved = resolve(scenario, (f"stop.max_duration={ticks}",))
    folder = tempfile.TemporaryDirectory(prefix="automaton-bench-")
    record(resolved, Path(folder.name) / RECORDING_NAME)
    return lambda: ratio(lambda: check(Path(folder.name) / RECORDING_NAME), resolved)


def ratio(work: Callable[[], object], resolved: Resolved) -> float:
    """CPU time of `work` / CPU time of a run right after it."""
    return cpu_seconds(work) / cpu_seconds(lambda: Simulation(resolved).run())


def record(resolved: Resolved, path: Path) -> None:
    """Run a scenario and record it."""
    with Recorder(path, resolved, resolved.scenario.seed) as recorder:
        Simulation(resolved, on_record=recorder).run()


def check(path: Path) -> None:
    """Verify a recording."""
    if not verify(path).passed:
        raise AssertionError(f"{path.name} is not verified")
