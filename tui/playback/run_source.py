"""What the viewer is opened with: known at once, so that the floor is drawn before Numba is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from automaton.errors import InputError
from automaton.floor.traffic_zones import traffic_zones_of
from automaton.recording.frames import Recording
from automaton.recording.header import resolved_of
from automaton.recording.recording_reader import (
    Head,
    heads_of,
    live_heads,
    read_recording,
    title_of,
)
from automaton.world.resolve import Resolved
from tui.playback.recording_files import against
from tui.render.scene import Floor

if TYPE_CHECKING:  # it needs Numba
    from automaton.history.watched_run import Run


class Reload(NamedTuple):
    """How a scenario is opened again when its files have changed."""

    scenario: str  # as given on the command line
    load: Callable[[], Opening]  # raises InputError


@dataclass(frozen=True)
class Opening:
    """One or two live runs, or one or two recorded ones."""

    titles: tuple[str, ...]  # of the runs
    resolved: tuple[Resolved, ...]
    live: bool
    begin: Callable[[], list[Run]]  # imports Numba, and may compile the world. Raises InputError
    recordings: tuple[Recording, ...] = ()
    paths: tuple[Path, ...] = ()  # where live runs are recorded
    heads: tuple[Head, ...] = ()  # of two runs
    files: tuple[Path, ...] = ()  # that the recordings were read from
    reload: Reload | None = None  # of a live run whose files are watched

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
        from automaton.history.live_run import LiveRun

        return [LiveRun(resolved, seed, path)]

    paths = () if path is None else (path,)
    return Opening((title_of(resolved, seed),), (resolved,), True, begin, paths=paths)


def reloading(scenario: str, load: Callable[[], Resolved]) -> Opening:
    """A live run that begins again whenever a file of its scenario is changed; it is not recorded.

    Raises InputError, as `load` does.
    """
    return replace(live(load(), None), reload=Reload(scenario, lambda: reloading(scenario, load)))


def live_pair(one: Resolved, other: Resolved, path: Path | None) -> Opening:
    """Two runs that are computed beside each other, the second recorded beside the first.

    Raises InputError.
    """
    resolved = (one, other)
    _check_sizes(resolved, "--against")
    paths = () if path is None else (path, against(path))

    def begin() -> list[Run]:
        from automaton.history.live_run import LiveRun

        files = paths or (None, None)
        first = LiveRun(one, one.scenario.seed, files[0])
        try:
            return [first, LiveRun(other, other.scenario.seed, files[1])]
        except BaseException:
            first.recorder.discard()
            raise

    titles = tuple(title_of(each, each.scenario.seed) for each in resolved)
    return Opening(titles, resolved, True, begin, paths=paths, heads=live_heads(*resolved))


def recorded(*paths: Path) -> Opening:
    """One recording, or two to be compared. Raises InputError."""
    recordings = tuple(read_recording(path) for path in paths)
    resolved = tuple(
        resolved_of(recording.header, with_strategies=False) for recording in recordings
    )
    _check_sizes(resolved, str(paths[-1]))

    def begin() -> list[Run]:
        from automaton.history.watched_run import RecordedRun

        return [RecordedRun(recording) for recording in recordings]

    titles = tuple(
        f"{path.name}: {title_of(one, recording.header['seed'], recording.stored())}"
        + ("" if recording.complete else ", cut short")
        for path, one, recording in zip(paths, resolved, recordings, strict=True)
    )
    names = [path.name for path in paths]
    heads = heads_of(names, recordings, resolved) if len(paths) > 1 else ()
    return Opening(titles, resolved, False, begin, recordings, heads=heads, files=paths)


def _check_sizes(resolved: Sequence[Resolved], second: str) -> None:
    """Raises InputError, at what named the second run, if one camera cannot show both floors."""
    if len({one.floor_plan.kind.shape for one in resolved}) > 1:
        raise InputError("floors of different sizes cannot be compared", second)


def floor_of(resolved: Resolved) -> Floor:
    """The floor for the pictures."""
    traffic_zones = traffic_zones_of(resolved.floor_plan, resolved.scenario.world.traffic_zones)
    scenario = resolved.scenario
    routing = scenario.strategy.routing
    return Floor(
        resolved.floor_plan,
        resolved.floor_plan.slots,
        tuple(one.headings for one in resolved.fleet.types),
        traffic_zones,
        battery=scenario.battery is not None,
        faults=bool(scenario.faults.listed or scenario.faults.probability),
        routing=routing if isinstance(routing, str) else str(routing.get("name", "")),
        type_names=tuple(kind.name for kind in scenario.fleet.types),
    )
