"""Saving an episode: its actions enter a simulation, which a recorder records."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from automaton.errors import InputError
from automaton.recording.recorder import Recorder
from automaton.runs.simulation import Simulation


def save_episode(resolved: Any, seed: int, digests: Mapping[int, str], path: Any) -> None:
    """Record an episode; its digests by tick must be those that the environment had.

    Raises InputError if the file cannot be written, and AssertionError if a digest differs.
    """
    try:
        with Recorder(Path(path), resolved, seed) as recorder:
            simulation = Simulation(resolved, seed, on_record=recorder)
            for tick, digest in sorted(digests.items()):
                simulation.run(tick)
                if simulation.digest != digest and tick:
                    raise AssertionError(f"tick {tick}: the run differs from the episode")
            recorder.end()
    except OSError as error:
        raise InputError(f"cannot write the recording: {error.strerror}", str(path)) from error
