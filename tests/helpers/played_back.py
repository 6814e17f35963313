"""Runs recorded in memory, and played again."""

from __future__ import annotations

from typing import Any

import numpy as np

from automaton.history.playback import Playback
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.frames import Recording
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.world.resolved import Resolved


class EachTick(MemoryRecorder):
    """A recorder that has digests of every tick, however large the world is."""

    digest_every = 1


def recorded(resolved: Resolved, until: int | None = None, storage: Any = None) -> Recording:
    memory = EachTick(resolved)
    order = None if storage is None else np.array(storage, np.int32)
    simulation = Simulation(resolved, storage=order, on_record=memory)
    simulation.world.clock.digest_every = 1
    simulation.run(until)
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
