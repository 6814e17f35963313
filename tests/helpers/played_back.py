"""Runs recorded in memory, and played again."""

from __future__ import annotations

from typing import Any

import numpy as np

from automaton.build.resolve import Resolved
from automaton.evidence.history.playback import Playback
from automaton.evidence.recording.frames import FRAME_KIND_TICKS, Recording
from automaton.evidence.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation


def recorded(resolved: Resolved, until: int | None = None, storage: Any = None) -> Recording:
    memory = MemoryRecorder(resolved)
    order = None if storage is None else np.array(storage, np.int32)
    Simulation(resolved, storage=order, on_record=memory).run(until)
    return memory.recording()


def digests_of(recording: Recording) -> Any:
    """(T, D): the recorded digests; row t - 1 tells of tick t."""
    return np.concatenate(
        [f.content["digests"] for f in recording.frames if f.kind == FRAME_KIND_TICKS]
    )


def playback_of(recording: Recording, **more: Any) -> Playback:
    return Playback(recording.header, recording.stored(), **more)


def check_at(playback: Playback, digests: Any, tick: int) -> None:
    playback.go_to(tick)
    assert playback.tick == tick
    if tick:
        assert np.array_equal(playback.simulation.digests(), digests[tick - 1]), f"tick {tick}"
