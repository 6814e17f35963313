"""The sources of a viewer's runs (live, recorded, reloaded), and files for recordings and screenshots.

An Opening is known at once, so that the floor is drawn before Numba is imported. Files go to the
user's state folder, named by the XDG rules.
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
from automaton.recording.frames import MAGIC, Recording, resolved_of
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

# Age from which a FILE.part counts as abandoned.
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
    paths: tuple[Path, ...] = ()  # recordings of live runs
    heads: tuple[Head, ...] = ()  # of two runs
    files: tuple[Path, ...] = ()  # files of the recordings
    reload: Reload | None = None  # for a live run whose files are watched

    @property
    def name(self) -> str:
        """The name of the scenario."""
        return self.resolved[0].scenario.name

    @property
    def comparing(self) -> bool:
        """Whether there are two runs."""
        return len(self.resolved) > 1


class Reload(NamedTuple):
    """How to reopen a scenario after a change of its files."""

    scenario: str  # as given on the command line
    load: Callable[[], Opening]  # raises InputError


def live(resolved: Resolved, path: Path | None) -> Opening:
    """A run computed while it is watched, recorded in `path` if given."""
    seed = resolved.scenario.seed

    def begin() -> list[WatchedRun]:
        from automaton.history.live_run import LiveRun

        return [LiveRun(resolved, seed, path)]

    paths = () if path is None else (path,)
    return Opening((title_of(resolved, seed),), (resolved,), True, begin, paths=paths)


def reloading(scenario: str, load: Callable[[], Resolved]) -> Opening:
    """An unrecorded live run that restarts whenever a file of its scenario changes.

    Raises InputError, as `load` does.
    """
    return replace(live(load(), None), reload=Reload(scenario, lambda: reloading(scenario, load)))


def live_pair(one: Resolved, other: Resolved, path: Path | None) -> Opening:
    """Two runs computed side by side, the second recorded beside the first.

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
    """Raise InputError about `second` if the sizes of floors differ: there is only one camera."""
    if len({one.floor_plan.kind.shape for one in resolved}) > 1:
        raise InputError("floors of different sizes cannot be compared", second)


# Files.


def state_folder(environ: Mapping[str, str]) -> Path:
    """$XDG_STATE_HOME/automaton, or ~/.local/state/automaton."""
    home = environ.get("XDG_STATE_HOME", "")
    base = Path(home) if os.path.isabs(home) else Path.home() / ".local" / "state"
    return base / "automaton"


def new_recording(name: str, environ: Mapping[str, str]) -> Path:
    """A free file for a run of this name; deletes the oldest recordings. Raises InputError."""
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
    """Delete the oldest recordings to make room for one, except those still being written."""
    now = time.time()
    files = [path for path in folder.iterdir() if path.name.endswith((".rec", ".rec.part"))]
    files = [p for p in files if p.suffix == ".rec" or now - p.stat().st_mtime > ABANDONED_S]
    files.sort(key=lambda path: path.stat().st_mtime)
    for path in files[: max(0, len(files) - MAX_RECORDINGS_KEPT + 1)]:
        path.unlink(missing_ok=True)


def checked_target(path: Path) -> Path:
    """`path`, if a recording may be written there. Raises InputError."""
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
                raise InputError("is not a recording, so it is not overwritten", str(path))
    return path


def beside(path: Path) -> Path:
    """A free file for a branch of the run recorded in `path`. Raises OSError."""
    return _reserved(path.parent, path.stem + "-branch", path.suffix)


def against(path: Path) -> Path:
    """A free file for the run compared with the one recorded in `path`. Raises InputError."""
    try:
        return _reserved(path.parent, path.stem + "-against", path.suffix)
    except OSError as error:
        text = f"cannot write the recording: {error.strerror}"
        raise InputError(text, str(path.parent)) from None


def capture_file(name: str, suffix: str, environ: Mapping[str, str], here: bool) -> Path:
    """A free file for a screenshot, in the current or the state folder. Raises OSError."""
    folder = Path.cwd()
    if not here or not os.access(folder, os.W_OK):
        folder = state_folder(environ) / "screenshots"
        folder.mkdir(parents=True, exist_ok=True)
    return _reserved_for(folder, name, suffix)


def give_up_unused(path: Path) -> None:
    """Remove the reservation of a file to which nothing was written."""
    part = _part_of(path)
    with suppress(OSError):
        if part.stat().st_size == 0:
            part.unlink()


def _reserved_for(folder: Path, name: str, suffix: str) -> Path:
    safe = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "run"
    return _reserved(folder, f"{safe}-{time.strftime('%Y%m%d-%H%M%S')}", suffix)


def _reserved(folder: Path, stem: str, suffix: str) -> Path:
    """A free file, reserved by an empty FILE.part, so that concurrent viewers get different files.

    Raises OSError if no file can be created.
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
    """The name of a file until it is complete."""
    return path.with_name(f"{path.name}.part")


def short_path(path: Path) -> str:
    """The path relative to the current folder, if inside it."""
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)


def comparing_command(old: Path, new: Path) -> str:
    """The command that shows two recordings side by side."""
    return shlex.join(["automaton", "replay", short_path(old), short_path(new)])
