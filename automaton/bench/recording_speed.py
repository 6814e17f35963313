"""What a recording costs, in runs that are not recorded: made as a file, and verified from it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

from automaton.bench.measurement import TIMES_THE_RUN, Measurement, Sample, cpu_seconds
from automaton.recording.recorder import Recorder
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify
from automaton.world.resolve import Resolved, resolve

GOODS_SCENARIO: Final = "goods-60x40"  # robots carry pods to stations
RECORDED_TICKS: Final = 5000
RECORDING_NAME: Final = "run.rec"


def measurements() -> list[Measurement]:
    """The same ticks each time, set-up included."""
    return [
        Measurement(
            f"{GOODS_SCENARIO}, {RECORDED_TICKS:,} ticks recorded", TIMES_THE_RUN, prepare_recorded
        ),
        Measurement(
            f"{GOODS_SCENARIO}, {RECORDED_TICKS:,} ticks verified", TIMES_THE_RUN, prepare_verified
        ),
    ]


def prepare_recorded(scenario: str = GOODS_SCENARIO, ticks: int = RECORDED_TICKS) -> Sample:
    """A sampler: CPU time of a run that is recorded, by that of the run alone."""
    resolved = resolve(scenario, (f"stop.max_duration={ticks}",))
    folder = tempfile.TemporaryDirectory(prefix="automaton-bench-")
    return lambda: ratio(lambda: record(resolved, Path(folder.name) / RECORDING_NAME), resolved)


def prepare_verified(scenario: str = GOODS_SCENARIO, ticks: int = RECORDED_TICKS) -> Sample:
    """A sampler: CPU time of the verification of a recording, by that of its run."""
    resolved = resolve(scenario, (f"stop.max_duration={ticks}",))
    folder = tempfile.TemporaryDirectory(prefix="automaton-bench-")
    record(resolved, Path(folder.name) / RECORDING_NAME)
    return lambda: ratio(lambda: check(Path(folder.name) / RECORDING_NAME), resolved)


def ratio(work: Callable[[], object], resolved: Resolved) -> float:
    """CPU time of some work, by that of a run right after it."""
    return cpu_seconds(work) / cpu_seconds(lambda: Simulation(resolved).run())


def record(resolved: Resolved, path: Path) -> None:
    """Run a scenario and record it."""
    with Recorder(path, resolved, resolved.scenario.seed) as recorder:
        Simulation(resolved, on_record=recorder).run()


def check(path: Path) -> None:
    """Verify a recording."""
    if not verify(path).passed:
        raise AssertionError(f"{path.name} is not verified")
