"""Actions that look closer: asking why, inspecting, stopping, branching."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from automaton.engine.observation import is_waiting
from automaton.engine.state import NIL
from tui.actions.find_actions import FindActions
from tui.playback.recording_files import beside, comparing_command, short_path
from tui.playback.titles import short, title_of
from tui.widgets.signs import signs_of
from tui.widgets.timeline import Mark

if TYPE_CHECKING:
    from automaton.build.resolve import Resolved
    from automaton.evidence.history.watched_run import Run
    from tui.screens.breakpoint_dialog import Stop


class Branched(NamedTuple):
    """What came of a branch."""

    tick: int
    settings: tuple[str, ...]
    title: str
    path: Path | None
    resolved: Resolved


class ChooseActions(FindActions):
    """Looking closer."""

    stops: Sequence[Stop] = ()

    def action_why(self) -> None:
        if not self.ready() or self.playback is None:
            return
        if self.choice.robot == NIL:
            longest = self._longest_waiting()
            if longest == NIL:
                self.notify("no robot waits; click one to select it")
                return
            self.choose(longest)
            self.show_robot()
        self.open_panel("why")

    def _longest_waiting(self) -> int:
        assert self.playback is not None
        robots = self.playback.snapshots[self.choice.side].robots
        kept = np.flatnonzero(is_waiting(robots.cause))
        return int(kept[np.argmin(robots.since[kept])]) if len(kept) else NIL

    def action_inspect(self) -> None:
        if not self.ready():
            return
        if self.pointing and self.hovered != NIL:
            self.choice.side = self.hovered_side
            self.choose_at(self.hovered)
        elif self.choice.robot == self.choice.cell == self.choice.zone == NIL:
            self._choose_middle()
        self.open_panel("inspector")

    def _choose_middle(self) -> None:
        """Of the map: something has to be inspected."""
        camera = self.pictures.camera
        middle = camera.cell_at(camera.rows // 2, camera.columns // 2)
        cell = middle if self.hovered == NIL else self.hovered
        if cell is not None:
            self.choose_at(cell)

    def action_events(self) -> None:
        self.stepping = "events"
        self.open_panel("events")

    def action_robots(self) -> None:
        self.open_panel("robots")

    def action_legend(self) -> None:
        self.open_panel("legend")

    def action_breakpoints(self) -> None:
        if not self.ready():
            return
        from tui.screens.breakpoint_dialog import BreakpointsScreen

        self.push_screen(BreakpointsScreen(self.stops, signs_of(self.glyphs)), self._take_stops)

    def _take_stops(self, stops: Sequence[Stop] | None) -> None:
        if stops is None:
            return
        from automaton.evidence.history.breakpoints import breakpoint_of

        self.stops = stops
        self._player.set_breakpoints([breakpoint_of(stop.text) for stop in stops if stop.on])

    def action_branch(self) -> None:
        if not self.ready():
            return
        reason = self._no_branch()
        if reason:
            self.notify(reason, severity="warning")
            return
        from tui.screens.branch_dialog import BranchScreen

        self.push_screen(BranchScreen(self.view()), self._take_branch)

    def _no_branch(self) -> str:
        if self.options.read_only:
            return "this viewer is read-only: runs cannot be branched"
        if self.opening.comparing:
            return "two runs are compared: open one of them alone to branch it"
        return ""

    def _take_branch(self, settings: tuple[str, ...] | None) -> None:
        if settings is None:
            return
        path = self._branch_file()
        made: list[Branched] = []

        def branch(run: Run) -> Run:
            from automaton.evidence.history.live_run import branch_of  # with Numba

            fresh = branch_of(run, settings, path)
            title = title_of(fresh.resolved, fresh.header["seed"], fresh.frames)
            made.append(Branched(fresh.tick, settings, title, path, fresh.resolved))
            return fresh

        def done(error: str) -> None:
            if error:
                self.call_later(self.notify, error, severity="error", timeout=10)
            else:
                self.call_later(self._branched, made[0])

        self._player.exchange(branch, done)
        self.notify("the past is computed again with its strategies ...")

    def _branch_file(self) -> Path | None:
        """Where a branch is recorded: beside the run that is, or was, recorded."""
        origin = (*self.recordings, *self.opening.files)[:1]
        return beside(origin[0]) if origin and os.access(origin[0].parent, os.W_OK) else None

    def _branched(self, made: Branched) -> None:
        self.live = True
        self.titles[0] = made.title
        if self.pictures.take_zones(made.resolved):
            self.choice.zone = NIL
        self.show_titles()
        self.marks = [mark for mark in self.marks if mark.tick <= made.tick]
        self.marks.append(Mark(made.tick, "branch"))
        self.notify(f"branched at tick {made.tick:,}: {' '.join(map(short, made.settings))}")
        if made.path is not None:
            origin = (*self.opening.files, *self.recordings)[-1]
            self.recordings.append(made.path)
            kept = f"the branch is recorded in {short_path(made.path)}"
            command = comparing_command(origin, made.path)
            self.notify(f"{kept}; to compare: {command}", timeout=10)
        self.ordered()
