"""Actions on how the run goes on: conditions that stop it, and branches with other settings."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from textual.app import App

from automaton.engine.state import NIL
from automaton.recording.recording_reader import short, title_of
from tui.actions import Command
from tui.playback.recording_files import (
    beside,
    comparing_command,
    give_up_unused,
    short_path,
)
from tui.session.display import Display
from tui.session.session import Session
from tui.widgets.signs import signs_of
from tui.widgets.timeline import Mark

if TYPE_CHECKING:
    from automaton.history.watched_run import Run
    from automaton.world.resolve import Resolved
    from tui.playback.player import Player
    from tui.screens.breakpoint_dialog import Stop


class Branched(NamedTuple):
    """What came of a branch."""

    tick: int
    settings: tuple[str, ...]
    title: str
    path: Path | None
    resolved: Resolved


class BranchActions:
    """Breakpoints and branches."""

    def __init__(self, app: App[None], session: Session, display: Display) -> None:
        self._app, self._session, self._display = app, session, display
        self.stops: Sequence[Stop] = ()

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

    def _take_stops(self, stops: Sequence[Stop] | None) -> None:
        if stops is None:
            return
        from automaton.history.breakpoints import breakpoint_of

        self.stops = stops
        self._player.set_breakpoints([breakpoint_of(stop.text) for stop in stops if stop.on])

    def renew(self) -> None:
        """Let another player stop where the one before did."""
        self._take_stops(self.stops)

    def _branch(self) -> None:
        if not self._session.ready():
            return
        reason = self._no_branch()
        if reason:
            self._display.notices.say(reason, "warning")
            return
        from tui.screens.branch_dialog import BranchScreen

        self._app.push_screen(BranchScreen(self._session.view()), self.take)

    def _no_branch(self) -> str:
        if self._session.options.read_only:
            return "this viewer is read-only: runs cannot be branched"
        if self._session.opening.comparing:
            return "two runs are compared: open one of them alone to branch it"
        return ""

    def take(self, settings: tuple[str, ...] | None) -> None:
        """Go on with these settings; None: as before."""
        if settings is None:
            return
        path = self._branch_file()
        made: list[Branched] = []

        def branch(run: Run) -> Run:
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
        """Where a branch is recorded: beside the run that is, or was, recorded."""
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
        session.marks.append(Mark(made.tick, "branch"))
        session.notify(f"branched at tick {made.tick:,}: {' '.join(map(short, made.settings))}")
        if made.path is not None:
            origin = (*session.opening.files, *session.recordings)[-1]
            session.recordings.append(made.path)
            kept = f"the branch is recorded in {short_path(made.path)}"
            command = comparing_command(origin, made.path)
            self._display.notices.say(f"{kept}; to compare: {command}", timeout=10)
        session.ordered()
