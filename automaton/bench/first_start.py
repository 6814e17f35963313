"""The first run ever on a machine: everything is compiled, because the cache is empty."""

from __future__ import annotations

import tempfile

from automaton.bench.measurement import SECONDS, Measurement, Sample, wall_seconds
from automaton.bench.startup_speed import run_command


def measurements() -> list[Measurement]:
    """One, taken twice at most: it takes as long as everything else together."""
    return [
        Measurement("first run, compiling", SECONDS, prepare, warm_up=False, at_most=2),
    ]


def prepare() -> Sample:
    """A sampler: seconds on the wall of `run tabletop-1` with an empty cache."""

    def sample() -> float:
        with tempfile.TemporaryDirectory(prefix="automaton-bench-") as folder:
            return wall_seconds(
                lambda: run_command(("run", "tabletop-1"), AUTOMATON_CACHE_DIR=folder)
            )

    return sample
