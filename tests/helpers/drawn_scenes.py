"""Scenarios of a few keys on a drawn floor, and recorded runs of them: for tests of any part of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.strategy.api import Strategy
from automaton.world.resolve import Resolved, resolve


def scene(
    picture: str, start: Sequence[tuple[int, int]], settings: Sequence[str] = (), **parts: Any
) -> Resolved:
    """A scenario on a drawn floor; omni robots that start in these cells."""
    fleet = {"robots": len(start), "kinematics": "omni", "start": list(start)}
    body = {"name": "scene", "layout": {"picture": picture.strip("\n")}, "fleet": fleet, **parts}
    body.setdefault("stop", {"when": "delivered", "max_duration": 3000})
    return resolve(msgspec.convert(body, Scenario), settings)


def recorded_run(
    resolved: Resolved, seed: int | None = None, strategies: Sequence[Strategy | None] | None = None
) -> tuple[Simulation, MemoryRecorder]:
    """A run to its end, recorded."""
    recorder = MemoryRecorder(resolved, seed)
    run = Simulation(resolved, seed, on_record=recorder, strategies=strategies)
    run.run()
    return run, recorder
