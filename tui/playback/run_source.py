"""Where a viewer gets its runs: live, recorded or reloaded; and where recordings and screenshots go.

What a viewer is opened with is known at once, so that the floor is drawn before Numba is there. Files
go to the user's state folder, as the XDG rules name it.
"""

from __future__ import annotations

import itertools
import os
import re
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from automaton.errors import InputError
from automaton.recording.frames import MAGIC, Recording
from automaton.recording.header import resolved_of
from automaton.recording.recording_reader import (
    Head,
    heads_of,
    live_heads,
    read_recording,
    title_of,
)
from automaton.world.resolved import Resolved

if TYPE_CHECKING:
    from automaton.history.watched_run import WatchedRun


MAX_RECORDINGS_KEPT = 20  # recordings in the state folder

# Since the last byte: nobody writes to a FILE.part any more.
ABANDONED_S = 24 * 3600


@dataclass(frozen=True)
class Opening:
    """One or two live runs, or one or two recorded ones."""

    titles: tuple[str, ...]  # of the runs
    resolved: tuple[Resolved, ...]
    live: bool
    begin: Callable[
        [], list[WatchedRun]
    ]  # imports Numba, and may compile the world. Raises InputError
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


class Reload(NamedTuple):
    """How a scenario is opened again when its files have changed."""

    scenario: str  # as given on the command line
    load: Callable[[], Opening]  # raises InputError


def live(resolved: Resolved, path: Path | None) -> Opening:
    """A run that is computed while it is watched."""
    seed = resolved.scenario.seed

    def begin() -> list[WatchedRun]:
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

    def begin() -> list[WatchedRun]:
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

    def begin() -> list[WatchedRun]:
        from automaton.history.watched_run import ReplayedRun

        return [ReplayedRun(recording) for recording in recordings]

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


# Files.


def state_folder(environ: Mapping[str, str]) -> Path:
    """$XDG_STATE_HOME/automaton, or ~/.local/state/automaton."""
    home = environ.get("XDG_STATE_HOME", "")
    base = Path(home) if os.path.isabs(home) else Path.home() / ".local" / "state"
    return base / "automaton"


def new_recording(name: str, environ: Mapping[str, str]) -> Path:
    """A free file for a run of this name; of older ones the newest stay. Raises InputError."""
    folder = state_folder(environ) / "recordings"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _tidy(folder)
        return _reserved_for(folder, name, ".rec")
    except OSError as error:
        raise InputError(
            f"cannot keep recordings here: {error.strerror}; --no-record does without", str(folder)
        ) from None


def _tidy(folder: Path) -> None:
    """Room for one more: only the newest stay. One that may still be written to stays, too."""
    now = time.time()
    files = [path for path in folder.iterdir() if path.name.endswith((".rec", ".rec.part"))]
    files = [p for p in files if p.suffix == ".rec" or now - p.stat().st_mtime > ABANDONED_S]
    files.sort(key=lambda path: path.stat().st_mtime)
    for path in files[: max(0, len(files) - MAX_RECORDINGS_KEPT + 1)]:
        path.unlink(missing_ok=True)


def checked_target(path: Path) -> Path:
    """A file that a recording may be written to. Raises InputError before anything is drawn."""
    if path.is_dir():
        raise InputError("cannot write the recording: this is a folder", str(path))
    folder = path.parent
    if not folder.is_dir():
        raise InputError("cannot write the recording: there is no such folder", str(folder))
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise InputError("cannot write the recording: permission denied", str(path))
    if path.exists():
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise InputError("is not a recording, so it is not replaced by one", str(path))
    return path


def beside(path: Path) -> Path:
    """A free file for a branch of the run that is recorded in `path`. Raises OSError."""
    return _reserved(path.parent, path.stem + "-branch", path.suffix)


def against(path: Path) -> Path:
    """A free file for the run beside the one that is recorded in `path`. Raises InputError."""
    try:
        return _reserved(path.parent, path.stem + "-against", path.suffix)
    except OSError as error:
        text = f"cannot write the recording: {error.strerror}"
        raise InputError(text, str(path.parent)) from None


def capture_file(name: str, suffix: str, environ: Mapping[str, str], here: bool) -> Path:
    """A free file for a screenshot: in the current folder, or in the state folder. Raises OSError."""
    folder = Path.cwd()
    if not here or not os.access(folder, os.W_OK):
        folder = state_folder(environ) / "screenshots"
        folder.mkdir(parents=True, exist_ok=True)
    return _reserved_for(folder, name, suffix)


def give_up_unused(path: Path) -> None:
    """Remove what reserves a file that nothing was written to."""
    part = _part_of(path)
    with suppress(OSError):
        if part.stat().st_size == 0:
            part.unlink()


def _reserved_for(folder: Path, name: str, suffix: str) -> Path:
    safe = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "run"
    return _reserved(folder, f"{safe}-{time.strftime('%Y%m%d-%H%M%S')}", suffix)


def _reserved(folder: Path, stem: str, suffix: str) -> Path:
    """A free file, reserved by an empty FILE.part: of viewers that begin at once each gets its own.

    Raises OSError where no file can be made.
    """
    for number in itertools.count(1):
        path = folder / f"{stem}{'' if number == 1 else f'-{number}'}{suffix}"
        try:
            _part_of(path).touch(exist_ok=False)
        except FileExistsError:
            continue
        if not path.exists():
            return path
        _part_of(path).unlink()
    raise AssertionError


def _part_of(path: Path) -> Path:
    """What a file is called until it is complete."""
    return path.with_name(f"{path.name}.part")


def short_path(path: Path) -> str:
    """As a user in the current folder writes it."""
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)


def comparing_command(old: Path, new: Path) -> str:
    """What shows the two side by side."""
    return shlex.join(["automaton", "replay", short_path(old), short_path(new)])
