"""What the viewer is opened with: known at once, so that the floor is drawn before Numba is there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from automaton.build.resolve import Resolved
from automaton.errors import InputError
from automaton.evidence.recording.frames import Recording
from automaton.evidence.recording.header import resolved_of
from automaton.evidence.recording.recording_reader import read_recording
from automaton.floor.floor_plan import UNBOUNDED
from automaton.floor.traffic_zones import traffic_zones_of
from tui.playback.titles import Head, heads_of, title_of
from tui.render.scene import Floor

if TYPE_CHECKING:  # it needs Numba
    from automaton.evidence.history.watched_run import Run

HEADING_COUNTS = {"omni": 1, "rail": 2, "differential": 4}


@dataclass(frozen=True)
class Opening:
    """One live run, or one or two recorded ones."""

    titles: tuple[str, ...]  # of the runs
    resolved: tuple[Resolved, ...]
    live: bool
    begin: Callable[[], list[Run]]  # imports Numba, and may compile the world. Raises InputError
    recordings: tuple[Recording, ...] = ()
    path: Path | None = None  # where the live run is recorded
    heads: tuple[Head, ...] = ()  # of two runs
    files: tuple[Path, ...] = ()  # that the recordings were read from

    @property
    def name(self) -> str:
        """Of the scenario."""
        return self.resolved[0].scenario.name

    @property
    def comparing(self) -> bool:
        """Whether there are two runs."""
        return len(self.resolved) > 1


def live(resolved: Resolved, path: Path | None) -> Opening:
    """A run that is computed while it is watched."""
    seed = resolved.scenario.seed

    def begin() -> list[Run]:
        from automaton.evidence.history.live_run import LiveRun

        return [LiveRun(resolved, seed, path)]

    return Opening((title_of(resolved, seed),), (resolved,), True, begin, path=path)


def recorded(*paths: Path) -> Opening:
    """One recording, or two to be compared. Raises InputError."""
    recordings = tuple(read_recording(path) for path in paths)
    resolved = tuple(
        resolved_of(recording.header, with_strategies=False) for recording in recordings
    )
    if len({one.floor_plan.kind.shape for one in resolved}) > 1:
        raise InputError("floors of different sizes cannot be compared", str(paths[1]))

    def begin() -> list[Run]:
        from automaton.evidence.history.watched_run import RecordedRun

        return [RecordedRun(recording) for recording in recordings]

    titles = tuple(
        f"{path.name}: {title_of(one, recording.header['seed'], recording.stored())}"
        + ("" if recording.complete else ", cut short")
        for path, one, recording in zip(paths, resolved, recordings, strict=True)
    )
    names = [path.name for path in paths]
    heads = heads_of(names, recordings, resolved) if len(paths) > 1 else ()
    return Opening(titles, resolved, False, begin, recordings, heads=heads, files=paths)


def floor_of(resolved: Resolved) -> Floor:
    """The floor for the pictures."""
    cells = resolved.floor_plan.slots
    endless = UNBOUNDED[resolved.floor_plan.kind.reshape(-1)[cells]].astype(np.uint8)
    traffic_zones = traffic_zones_of(resolved.floor_plan, resolved.scenario.world.traffic_zones)
    scenario = resolved.scenario
    routing = scenario.strategy.routing
    return Floor(
        resolved.floor_plan,
        cells,
        endless,
        HEADING_COUNTS[scenario.fleet.kinematics],
        traffic_zones,
        battery=scenario.battery is not None,
        faults=bool(scenario.faults.listed or scenario.faults.probability),
        routing=routing if isinstance(routing, str) else str(routing.get("name", "")),
        type_names=tuple(kind.name for kind in scenario.fleet.types),
    )
