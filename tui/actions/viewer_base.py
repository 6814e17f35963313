"""What the viewer's actions work on: the runs, what is chosen, and the path of a frame.

Player -> PlaybackState -> Scene -> codes -> MapView        whenever something has changed
               -> View -> panels, lines            at most some times a second
"""

from __future__ import annotations

import asyncio
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from textual.app import App
from textual.notifications import SeverityLevel

from automaton.engine.state import NIL
from automaton.evidence.history.divergence import Divergence
from automaton.units import unit
from tui.playback.frame_cache import Choice, Pictures
from tui.playback.run_source import Opening
from tui.render import styles
from tui.render.describe import describe
from tui.render.glyphs import Codes
from tui.render.styles import Look
from tui.terminal.frame_pacing import FrameClock, FramePacer
from tui.terminal.options import Options
from tui.terminal.presenter import Presenter
from tui.widgets.map_view import MapView
from tui.widgets.status import (
    choice_words,
    end_words,
    fleet_words,
    head_words,
    link_words,
    mode_word,
    time_words,
)
from tui.widgets.timeline import Mark, Past, Timeline
from tui.widgets.word_row import Line, Word, word

if TYPE_CHECKING:
    from automaton.evidence.history.watched_run import Run
    from tui.playback.panel_view import View
    from tui.playback.playback_state import PlaybackState
    from tui.playback.player import Player

LINES_S: Final = 0.1  # between two updates of the lines under the map
PANELS_S: Final = 0.25
STRAINED_S: Final = 1.0  # the same over a slow link
NOTICE_S: Final = 5.0
FAILURE_S: Final = 20.0
NOTICE_COLOURS: Final = {
    "information": styles.COLOUR_TEXT,
    "warning": styles.COLOUR_LOADED,
    "error": styles.COLOUR_FAULT,
}
HINTS: Final = (  # what there is to be done, what a click on it does, and its rank
    ("? help", "help", 0),
    ("space play", "play_pause", 1),
    ("click a robot or a cell", "", 2),
    ("ctrl+p all commands", "command_palette", 3),
)


class Notice(NamedTuple):
    """A sentence in the line above the status line, for a while."""

    words: Word
    until: float
    about: tuple[str, int] | None = None  # the layer and the robot without which it goes sooner


class ViewerBase(App[None]):
    """The state of the viewer. Actions are in mixins, widgets in `Viewer`."""

    def __init__(self, opening: Opening, options: Options) -> None:
        super().__init__()
        self.opening = opening
        self.options = options
        self.player: Player | None = None
        self.playback: PlaybackState | None = None
        self.choice = Choice()
        self.speed = options.speed
        self.live = opening.live  # or branched off a recording
        self.titles = list(opening.titles)
        self.goal = options.at  # a tick on the way to which the run may end
        self.notice: Notice | None = None
        self.error = ""  # why there is nothing to be played
        self.broken = ""  # why two runs cannot be compared
        self.hovered = NIL  # the cell under the mouse
        self.hovered_side = 0
        self.pointing = False  # the mouse has been moved since something was chosen
        self.link_shown = False
        self.marks: list[Mark] = []  # breakpoints met, branches
        self.divergence: Divergence | None = None
        self.recordings: list[Path] = [] if opening.path is None else [opening.path]
        self.glyphs = options.glyphs(os.environ)
        self.look = Look(options.depth(os.environ), options.theme)
        self.pictures = Pictures(opening, self.glyphs)
        self.presenter = Presenter(self, options.renderer)
        self.frames = FrameClock(
            self.presenter, self.draw, FramePacer(options.fps, options.max_kbit)
        )
        self.maps = [self._made(MapView, f"map-{n}") for n in range(len(opening.resolved))]
        self.heads = [self._made(Line, f"head-{n}") for n in range(len(self.maps))]
        self.title_line = self._made(Line, "title")
        self.status = self._made(Line, "status")
        self.info = self._made(Line, "info")
        self.timeline = self._made(Timeline, "timeline")
        self.column: Any = None  # the panels, once they are imported
        self._unit = unit(opening.resolved[0].scenario.units.tick)
        self._stale = self._texts_stale = True
        self._texts_updated_at = self._panels_at = -math.inf
        self._panels_know: object = None

    def _made(self, kind: type[Any], id: str) -> Any:
        return kind(self.presenter, self.look, self.glyphs, id=id)

    # What actions call.

    @property
    def runs(self) -> Sequence[Run]:
        """The runs, once they are there. Of a run read plan, header, resolved and event_history only."""
        return () if self.playback is None else self.playback.runs

    def changed(self) -> None:
        """Something else is chosen: draw it."""
        self._stale = self._texts_stale = True
        self.frames.wake()

    def ordered(self) -> None:
        """The player got a request: its result is to be seen as soon as it is there."""
        self._texts_stale = True
        self.frames.expect()

    def refresh_lines_soon(self) -> None:
        """Only the lines under the map have something new to say."""
        self._texts_stale = True
        self.frames.wake()

    def notify(
        self,
        message: str,
        *,
        title: str = "",
        severity: SeverityLevel = "information",
        timeout: float | None = None,
        markup: bool = False,
    ) -> None:
        """A short one goes to the line above the status line; a long one over the map."""
        seconds = NOTICE_S if timeout is None else timeout
        if not self._fits_line(message):
            self.clear_notifications()  # one at a time: many would cover the status line
            super().notify(message, title=title, severity=severity, timeout=seconds, markup=markup)
            return
        until = asyncio.get_running_loop().time() + seconds
        self.notice = Notice(word(message, NOTICE_COLOURS[severity]), until)
        self.refresh_lines_soon()
        self.set_timer(seconds + LINES_S, self.refresh_lines_soon)

    def notify_of_layer(self, message: str) -> None:
        """Say what holds as long as this layer is shown and this robot selected."""
        self.notify(message)
        if self.notice is not None and self.notice.words.text == message:
            self.notice = self.notice._replace(about=(self.choice.layer, self.choice.robot))

    def _is_current(self, notice: Notice) -> bool:
        now = (self.choice.layer, self.choice.robot)
        return asyncio.get_running_loop().time() < notice.until and notice.about in (None, now)

    def _fits_line(self, message: str) -> bool:
        fits = message.isascii() and len(message) <= self.info.size.width
        return fits and len(self.screen_stack) == 1 and bool(self.info.is_on_screen)

    def notify_failure(self) -> None:
        """The whole sentence, with the strategy's file and line."""
        if self.playback is not None:
            self.clear_notifications()
            super().notify(self.playback.failed, severity="error", timeout=FAILURE_S, markup=False)

    def ready(self) -> bool:
        """Whether there is a run; if not yet, says so."""
        if self.player is None:
            self.notify(self.error or "the world is not built yet")
        return self.player is not None

    def view(self) -> View:
        """What panels and dialogs get; there has to be a playback state."""
        from tui.playback.panel_view import View

        assert self.playback is not None
        choice = self.choice
        side = choice.side
        robot = choice.robot if choice.robot < len(self.playback.snapshots[side].robots) else NIL
        return View(
            self.playback, self.playback.runs, robot, choice.cell, choice.layer, side, choice.zone
        )

    def choose(self, robot: int = NIL, cell: int = NIL, zone: int = NIL) -> None:
        """Select a robot, a cell, a zone, or nothing."""
        if robot != self.choice.robot:
            self.choice.following = self.choice.following and robot != NIL
            if self.player is not None:
                self.player.select(robot)
                self.ordered()
        self.choice.robot, self.choice.cell, self.choice.zone = robot, cell, zone
        self.pointing = False
        self.changed()

    def show_cell(self, cell: int) -> None:
        """Bring a cell on the screen if it is not on it."""
        if cell != NIL and self.pictures.camera.place_of(cell) is None:
            self.pictures.fitted = False
            self.pictures.camera.centre_on(cell)
        self.changed()

    # The path of a frame.

    def draw(self) -> bool:
        """Present what has changed; False if nothing had, and then nothing was written."""
        before = self.playback
        if self.player is not None:
            self.playback = self.player.latest()
        if self.playback is not before:
            self._texts_stale = True
            self._follow_playback(before)
        if self.player is not None and self.player.computing():
            self._texts_stale = True  # the seconds go on
        drawn = False
        if self.playback is not before or self._stale:
            drawn = self._draw_maps()
        told = self._update_texts()
        return drawn or told

    def _follow_playback(self, before: PlaybackState | None) -> None:
        """Follow the selected robot, and go where a breakpoint stopped the run."""
        playback = self.playback
        assert playback is not None
        self.pictures.follow(playback, self.choice)
        if playback.failed and (before is None or not before.failed):
            self.notify_failure()
        self._report_unreachable_tick(playback)
        if playback.stops > (0 if before is None else before.stops):
            self.marks.append(Mark(playback.tick, "stop"))
            self.goal = None  # it is not on the way there any more
            self.choice.side = playback.side
            if playback.breakpoint_robots:
                self.choose(playback.breakpoint_robots[0])
                self.show_robot()

    def _report_unreachable_tick(self, playback: PlaybackState) -> None:
        """A tick was asked for that there is not."""
        if self.goal is None or playback.tick < min(self.goal, playback.head):
            return
        if (
            playback.end is not None
            and playback.tick == playback.end < self.goal
            and not playback.failed
        ):
            self.notify(f"the run ends at tick {playback.end:,}; there is no tick {self.goal:,}")
        if playback.tick >= self.goal or playback.tick == playback.end:
            self.goal = None

    def show_robot(self) -> None:
        """Bring the selected robot on the screen."""
        from tui.playback.frame_cache import robot_cell

        if self.playback is not None:
            self.show_cell(robot_cell(self.playback, self.choice))

    def _draw_maps(self) -> bool:
        drawn = self._stale = False
        for side, view in enumerate(self.maps):
            rows, columns = view.size.height, view.size.width
            if not rows or not columns or not view.is_on_screen:
                continue
            codes = self.codes_of(side)
            if view.shown is None or not np.array_equal(codes, view.shown):
                view.present(codes)
                drawn = True
        return drawn

    def codes_of(self, side: int) -> Codes:
        """The picture of a run at the tick that is shown, also while its map is hidden."""
        size, camera = self.maps[side].size, self.pictures.camera
        scene = self.pictures.scene(self.playback, self.choice, side)
        rows, columns = size.height or camera.rows, size.width or camera.columns
        return self.pictures.picture(scene, self.choice, rows, columns)

    def _update_texts(self) -> bool:
        """Lines and panels, if there is news and it is time for it."""
        now = asyncio.get_running_loop().time()
        pause = PANELS_S if self.frames.pace.strained else LINES_S
        said = False
        if self._texts_stale and now - self._texts_updated_at >= pause:
            self._texts_updated_at, self._texts_stale = now, False
            said = self._update_lines()
        self._update_panels(now)
        return said

    def _update_lines(self) -> bool:
        playback = self.playback
        changed: bool = self.info.set_words(self._message(), self._link())
        if playback is None:
            state = "cannot run" if self.error else "the world is being built ..."
            changed |= self.status.set_words([word(state, styles.COLOUR_DIM)])
            return changed
        side = self.choice.side
        words = time_words(playback, side, self.speed, self._unit, self.glyphs)
        words += fleet_words(playback.snapshots[side])
        words += choice_words(self.choice.robot, self.choice.following, self.choice.laid)
        changed |= self.status.set_words(words, [self.mode(playback)])
        changed |= self.timeline.set_content(self.past(playback))
        changed |= self.show_titles()
        return changed

    def show_titles(self) -> bool:
        """What the runs are called, and which of two has ended; whether anything changed."""
        changed: bool = self.title_line.set_words([word("automaton"), word(self.titles[0])])
        for side, (own, common) in enumerate(self.opening.heads):
            head, end = self.heads[side], end_words(self.playback, side)
            room = head.size.width - sum(len(one.glyphs) + Line.GAP for one in end)
            changed |= head.set_words(head_words(f"{'AB'[side]} {own}", common, room), end)
        return changed

    def mode(self, playback: PlaybackState) -> Word:
        """Live, in the past of a live run, or recorded; and how the run ended."""
        side = self.choice.side
        if self.live:
            return mode_word(playback, side, "live REC" if self.recordings else "live")
        name = "compare" if self.opening.comparing else "replay"
        whole = self.opening.recordings[side].complete
        return mode_word(playback, side, name, recorded=True, whole=whole)

    def past(self, playback: PlaybackState) -> Past:
        """What the timeline shows."""
        event_history = self.runs[self.choice.side].event_history
        marks = [Mark(tick, "deadlock") for tick in event_history.deadlocks.tolist()]
        marks += [Mark(tick, "redesign") for tick in event_history.redesigns.tolist()] + self.marks
        if self.divergence is not None and self.divergence.tick is not None:
            marks.append(Mark(self.divergence.tick, "difference"))
        return Past(playback.tick, playback.head, playback.end, event_history.curve, tuple(marks))

    def _message(self) -> list[Word]:
        """The most important of what there is to say."""
        playback = self.playback
        if self.notice is not None and self._is_current(self.notice):
            return [self.notice.words]
        self.notice = None
        error = self.error or self.broken or (playback.error if playback is not None else "")
        if error:
            return [word(error, styles.COLOUR_FAULT, "play_pause")]
        if self.player is not None and (slow := self.player.computing()):
            return [word(f"computing tick {slow[0]:,}, {slow[1]} s", styles.COLOUR_CURSOR)]
        if playback is not None and playback.stopped:
            return [word(f"stopped: {playback.stopped}", styles.COLOUR_CURSOR, "breakpoints")]
        if self.hovered != NIL:
            return [self._described(self.hovered, self.hovered_side)]
        if playback is not None and playback.failed:
            return [word(playback.failed, styles.COLOUR_FAULT, "play_pause")]
        if self.choice.cell != NIL:
            return [self._described(self.choice.cell, self.choice.side)]
        if self.divergence is not None:
            return [word(self.divergence.text, styles.COLOUR_TEXT, "next_difference")]
        return [word(text, styles.COLOUR_DIM, action, rank) for text, action, rank in HINTS]

    def _described(self, cell: int, side: int) -> Word:
        return word(describe(self.pictures.scene(self.playback, self.choice, side), cell))

    def _link(self) -> list[Word]:
        return link_words(self.frames.figures()) if self.link_shown else []

    def _update_panels(self, now: float) -> None:
        pause = STRAINED_S if self.frames.pace.strained else PANELS_S
        if self.column is None or self.playback is None or now - self._panels_at < pause:
            return
        choice = self.choice
        chosen = (choice.robot, choice.cell, choice.zone, choice.layer, choice.least, choice.side)
        known = (self.playback, chosen, self.look)
        camera = (self.pictures.camera.zoom, self.pictures.glyphs)
        if self._panels_know == (known, camera) or not self.column.is_on_screen:
            return
        self._panels_at, self._panels_know = now, (known, camera)
        scene = self.pictures.scene(self.playback, choice, choice.side)
        self.column.show_floor(scene, self.pictures.camera.zoom)
        self.column.show(self.view())
