"""Actions on the course of a run: breakpoints, branches with other settings, reloads.

With --reload, a scenario is loaded again whenever one of its files is written. The viewer checks
the files several times a second, by path: it notices editors that replace a file as well as those
that write into it.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from textual.app import App

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.recording.recording_reader import short, title_of
from automaton.scenario.reading import named_files
from tui.playback.run_source import Opening, beside, comparing_command, give_up_unused, short_path
from tui.screens.dialogs import ReloadErrorScreen
from tui.viewer.session import Command, Display, Session
from tui.widgets.panel import signs_of

if TYPE_CHECKING:
    from automaton.history.watched_run import WatchedRun
    from automaton.world.resolved import Resolved
    from tui.playback.player import Player
    from tui.screens.breakpoint_dialog import StopCondition


POLL_S: Final = 0.2  # between two checks of the files

Signature = tuple[tuple[int, int, int] | None, ...]  # by file: time, size, inode


class Branched(NamedTuple):
    """The result of a branch."""

    tick: int
    settings: tuple[str, ...]
    title: str
    path: Path | None
    resolved: Resolved


class BranchActions:
    """Breakpoints and branches."""

    def __init__(self, app: App[None], session: Session, display: Display) -> None:
        self._app, self._session, self._display = app, session, display
        self.stops: Sequence[StopCondition] = ()

    def commands(self) -> dict[str, Command]:
        return {"breakpoints": self._edit_stops, "branch": self._branch}

    @property
    def _player(self) -> Player:
        assert self._session.player is not None
        return self._session.player

    def _edit_stops(self) -> None:
        if not self._session.ready():
            return
        from tui.screens.breakpoint_dialog import BreakpointsScreen

        screen = BreakpointsScreen(self.stops, signs_of(self._session.glyphs))
        self._app.push_screen(screen, self._take_stops)

    def _take_stops(self, stops: Sequence[StopCondition] | None) -> None:
        if stops is None:
            return
        from automaton.history.breakpoints import breakpoint_of

        self.stops = stops
        self._player.set_breakpoints([breakpoint_of(stop.text) for stop in stops if stop.on])

    def renew(self) -> None:
        """Give a new player the breakpoints of the previous one."""
        self._take_stops(self.stops)

    def _branch(self) -> None:
        if not self._session.ready():
            return
        reason = self._no_branch()
        if reason:
            self._display.notices.say(reason, "warning")
            return
        from tui.screens.dialogs import BranchScreen

        self._app.push_screen(BranchScreen(self._session.view()), self.take)

    def _no_branch(self) -> str:
        if self._session.options.read_only:
            return "this viewer is read-only: runs cannot be branched"
        if self._session.opening.comparing:
            return "two runs are compared: open one of them alone to branch it"
        return ""

    def take(self, settings: tuple[str, ...] | None) -> None:
        """Branch with these settings; None: do nothing."""
        if settings is None:
            return
        path = self._branch_file()
        made: list[Branched] = []

        def branch(run: WatchedRun) -> WatchedRun:
            from automaton.history.live_run import branch_of  # with Numba

            fresh = branch_of(run, settings, path)
            title = title_of(fresh.resolved, fresh.header["seed"], fresh.frames)
            made.append(Branched(fresh.tick, settings, title, path, fresh.resolved))
            return fresh

        def done(error: str) -> None:
            if error:
                if path is not None:
                    give_up_unused(path)
                self._app.call_later(self._display.notices.say, error, "error", 10)
            else:
                self._app.call_later(self._branched, made[0])

        self._player.exchange(branch, done)
        self._session.notify("the past is computed again with its strategies ...")

    def _branch_file(self) -> Path | None:
        """The file for the branch, beside the recording of its run."""
        origin = (*self._session.recordings, *self._session.opening.files)[:1]
        return beside(origin[0]) if origin and os.access(origin[0].parent, os.W_OK) else None

    def _branched(self, made: Branched) -> None:
        session = self._session
        session.live = True
        session.titles[0] = made.title
        if session.pictures.take_zones(made.resolved):
            session.choice.zone = NIL
        self._display.show_titles()
        session.marks = [mark for mark in session.marks if mark.tick <= made.tick]
        session.mark(made.tick, "branch")
        session.notify(f"branched at tick {made.tick:,}: {' '.join(map(short, made.settings))}")
        if made.path is not None:
            origin = (*session.opening.files, *session.recordings)[-1]
            session.recordings.append(made.path)
            kept = f"the branch is recorded in {short_path(made.path)}"
            command = comparing_command(origin, made.path)
            self._display.notices.say(f"{kept}; to compare: {command}", timeout=10)
        session.ordered()


class Reloading:
    """Connects the thread that watches the files with the screen."""

    def __init__(
        self, app: App[None], session: Session, display: Display, branches: BranchActions
    ) -> None:
        """Raises InputError if the scenario is gone."""
        self._app, self._session, self._display = app, session, display
        self._branches = branches
        reload = session.opening.reload
        assert reload is not None
        self._reloader = Reloader(
            reload.scenario,
            reload.load,
            lambda opening, player: self._later(self._loaded, opening, player),
            lambda sentence: self._later(self._failed, sentence),
        )

    def start(self) -> None:
        """Start watching the files."""
        self._reloader.start()

    def close(self) -> None:
        """Stop watching the files."""
        self._reloader.close()

    def _later(self, *call: object) -> None:
        """From the watching thread, make a call in the app's thread."""
        self._app.call_later(*call)  # type: ignore[arg-type]

    def _loaded(self, opening: Opening, player: Player) -> None:
        if isinstance(self._app.screen, ReloadErrorScreen):
            self._app.screen.dismiss()
        before = self._session.reopen(opening, player)
        if before is not None:
            threading.Thread(target=before.close, name="closing", daemon=True).start()
        self._branches.renew()
        self._display.show_titles()
        self._session.notify("the files were changed and loaded again: tick 0")
        self._session.ordered()
        self._session.changed()

    def _failed(self, sentence: str) -> None:
        screen = self._app.screen
        if isinstance(screen, ReloadErrorScreen):
            screen.complain(sentence)
        else:
            self._app.push_screen(ReloadErrorScreen(sentence))


class Reloader:
    """A thread that reopens the scenario after each change, with a player at tick 0."""

    def __init__(
        self,
        scenario: str,
        load: Callable[[], Opening],
        on_loaded: Callable[[Opening, Player], None],
        on_error: Callable[[str], None],
    ) -> None:
        """The thread calls the callbacks; `load` may raise InputError. Raises InputError."""
        self._files = ScenarioFiles(scenario)
        self._load, self._on_loaded, self._on_error = load, on_loaded, on_error
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="reloading", daemon=True)

    def start(self) -> None:
        """Start watching the files."""
        self._thread.start()

    def close(self) -> None:
        """Stop watching the files, without waiting for a load in progress."""
        self._closing.set()

    def _watch(self) -> None:
        while not self._closing.wait(POLL_S):
            if self._files.settled_change():
                self._files.note_loading()
                self._reload()

    def _reload(self) -> None:
        from tui.playback.player import Player, sentence

        try:
            opening = self._load()
            player = Player(opening.begin())
        except Exception as error:  # of the scenario or of a strategy
            if not self._closing.is_set():
                self._on_error(sentence(error))
            return
        if self._closing.is_set():
            player.close()
        else:
            self._on_loaded(opening, player)


class ScenarioFiles:
    """Detects changes of a scenario's files since it was last loaded."""

    def __init__(self, scenario: str) -> None:
        """Raises InputError if there is no such scenario."""
        self._scenario = scenario
        self.paths = named_files(scenario)
        self._loaded = self._seen = signature_of(self.paths)

    def settled_change(self) -> bool:
        """Whether the files have changed since the last load, but not since the last check."""
        before, self._seen = self._seen, signature_of(self.paths)
        return self._seen == before != self._loaded

    def note_loading(self) -> None:
        """Before a load, update the list of files; missing files stay in it: they may return."""
        with suppress(InputError):
            gone = (path for path in self.paths if not path.exists())
            self.paths = tuple(dict.fromkeys((*named_files(self._scenario), *gone)))
        self._loaded = self._seen = signature_of(self.paths)


def signature_of(paths: Iterable[Path]) -> Signature:
    """A value that changes when one of the files is written, replaced or removed."""
    return tuple(map(_signature, paths))


def _signature(path: Path) -> tuple[int, int, int] | None:
    try:
        stat = os.stat(path)
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino
