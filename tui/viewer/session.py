"""The state of the viewer: one or two runs, the selection, and the widgets that show them.

Groups of actions change the session; the display shows it. For every key of the table
tui.widgets.bindings, Textual calls the app's action `do('ID')`. The app looks the ID up in the
`commands` of the groups.
"""

from __future__ import annotations

import asyncio
import math
import os
import threading
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from textual.app import App
from textual.notifications import SeverityLevel

from automaton.engine.jit.compile_progress import COMPILING
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.history.divergence import Divergence, first_difference
from automaton.units import unit
from tui.playback.frame_cache import Pictures, robot_cell
from tui.playback.run_source import Opening
from tui.registration import failure, layer_named
from tui.render import styles
from tui.render.scene import Choice, Scene
from tui.render.styles import Codes, Look
from tui.terminal.frame_pacing import FrameClock, FramePacer
from tui.terminal.map_view import MapView, Presenter
from tui.terminal.options import Options
from tui.terminal.pixel_map import PixelScreen
from tui.widgets.legend_panel import floor_legend
from tui.widgets.status import (
    Notice,
    Word,
    WordLine,
    choice_words,
    columns_of,
    describe,
    end_words,
    fleet_words,
    going_words,
    head_words,
    hint_words,
    lasting,
    link_words,
    long_tick_words,
    mode_word,
    scale_words,
    stuck_words,
    time_words,
    word,
)
from tui.widgets.timeline import Mark, Past, Timeline

if TYPE_CHECKING:
    from automaton.history.watched_run import WatchedRun
    from tui.playback.panel_view import View
    from tui.playback.playback_state import PlaybackState
    from tui.playback.player import Player


LINES_S: Final = 0.1  # between two updates of the lines under the map
PANELS_S: Final = 0.25  # between two updates of the panels
STRAINED_S: Final = 1.0  # between two updates of the panels over a slow link

NOTICE_S: Final = 5.0
FAILURE_S: Final = 20.0
NOTICE_COLOURS: Final = {
    "information": styles.COLOUR_TEXT,
    "warning": styles.COLOUR_LOADED,
    "error": styles.COLOUR_FAULT,
}

Command = Callable[[], Awaitable[None] | None]


class Actions(Protocol):
    """A group of actions."""

    def commands(self) -> dict[str, Command]:
        """The functions of the actions, by id in the table of bindings."""


class Session:
    """The runs, the user's choice and the pictures of both, without widgets."""

    def __init__(self, opening: Opening, options: Options, notify: Callable[[str], None]) -> None:
        """`notify` shows a message to the user."""
        self.opening, self.options, self.notify = opening, options, notify
        self.player: Player | None = None
        self.playback: PlaybackState | None = None
        self.choice = Choice()
        self.speed = options.first_speed
        self.live = opening.live  # also after a branch from a recording
        self.titles = list(opening.titles)
        self.goal, self.goal_from = options.at, 0  # a requested tick, and where the way begins
        self.error = self.broken = ""  # why there is no run; why two cannot be compared
        self.hovered = NIL  # the cell under the mouse
        self.hovered_side = 0
        self.pointing = False  # the mouse has moved since the last selection
        self.marks: list[Mark] = []  # breakpoints hit, branches
        self.divergence: Divergence | None = None
        self.recordings: list[Path] = list(opening.paths)
        self.glyphs = options.glyphs(os.environ)
        self.look = Look(options.depth(os.environ), options.shown_theme)
        self.pictures = Pictures(opening, self.glyphs)
        self.changed: Callable[[], None] = lambda: None  # the choice has changed: draw it
        self.published: Callable[[], None] = lambda: None  # there is a new state
        # The player received a request: show its result at once.
        self.ordered: Callable[[], None] = lambda: None
        self._ending = threading.Lock()
        self._ended = False

    @property
    def runs(self) -> Sequence[WatchedRun]:
        """The runs, once there. Read only their plan, header, resolved and event_history."""
        return () if self.playback is None else self.playback.runs

    # Start and end; a separate thread opens the runs after the first picture.

    def open(self, published: Callable[[], None], prepare: Callable[[], object]) -> bool:
        """Import Numba and open the runs; returns whether the viewer still waits for them.

        The player's thread calls `published` for each new state. `prepare` is called before the
        runs are opened.
        """
        player: Player | None = None
        self.published = published
        try:
            from tui.playback.player import Player

            prepare()
            player = self._playing(Player(self.opening.begin()))
            player.published = published
        except InputError as wrong:
            self.error = str(wrong)
        except Exception as wrong:
            self.error = f"internal error, {type(wrong).__name__}: {wrong}"
        with self._ending:
            if self._ended and player is not None:
                player.close()
            elif not self._ended:
                self.player = player
        return not self._ended

    def _playing(self, player: Player) -> Player:
        player.set_speed(self.options.first_speed)
        if self.options.at is not None:
            player.seek(self.options.at)
        elif not self.options.paused:
            player.play()
        return player

    def reopen(self, opening: Opening, player: Player) -> Player | None:
        """Show a reloaded scenario from tick 0; returns the player to close, if any.

        Camera, layers and the selected robot stay if the new floor has them.
        """
        with self._ending:
            before, self.player = self.player, player
            if self._ended:
                return player
        choice, fleet = self.choice, opening.resolved[0].scenario.fleet
        choice.keep_what_is_there(fleet.robots, self.pictures.take_floor(opening))
        self.opening, self.titles, self.marks, self.goal = opening, list(opening.titles), [], None
        self.error, self.divergence, self.hovered = "", None, NIL
        player.published = self.published
        player.set_speed(self.speed)
        player.select(choice.robot)
        player.show_layer(choice.layer)
        player.show_trails(choice.trails)
        if self.playback is None or self.playback.playing:
            player.play()
        self.playback = player.latest()
        return before

    def compare(self) -> None:
        """Find where two recorded runs diverge; the player does so for live runs."""
        if self.opening.live:
            return
        from tui.playback.player import sentence

        try:
            self.divergence = first_difference(*self.opening.recordings)
        except Exception as wrong:
            self.broken = sentence(wrong)

    def close(self) -> None:
        """Stop computing and complete the recordings; callable from any thread."""
        with self._ending:
            if not self._ended and self.player is not None:
                self.player.close()
            self._ended = True

    def mark(self, tick: int, kind: str) -> None:
        """Put a mark at a tick of the timeline."""
        self.marks.append(Mark(tick, kind))

    # The selection.

    def ready(self) -> bool:
        """Whether there is a run; if not yet, notify the user."""
        if self.player is None:
            self.notify(self.error or "the world is not built yet")
        return self.player is not None

    def is_alone(self) -> bool:
        """Whether only one run is open; if so, a notice says how to compare two."""
        if not self.opening.comparing:
            self.notify("two recordings are compared by: automaton replay A B")
        return not self.opening.comparing

    def is_whole(self, side: int) -> bool:
        """Whether a run is live, or its recording complete."""
        return self.live or self.opening.recordings[side].complete

    def view(self) -> View:
        """The view for panels and dialogs; requires a playback state."""
        from tui.playback.panel_view import Picture, View

        assert self.playback is not None
        choice, pictures = self.choice, self.pictures
        side = choice.side
        robot = choice.robot if choice.robot < len(self.playback.snapshots[side].robots) else NIL
        drawn = (pictures.camera.zoom, self.look, self.glyphs, pictures.in_pixels)
        picture = Picture(self.scene(), *drawn)
        chosen = (robot, choice.cell, choice.layer, side, choice.zone, picture)
        return View(self.playback, self.playback.runs, *chosen)

    def scene(self, side: int | None = None) -> Scene:
        """The content of a run's picture; without `side`, of the chosen run."""
        side = self.choice.side if side is None else side
        return self.pictures.scene(self.playback, self.choice, side)

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

    def choose_zone(self, zone: int) -> None:
        """Select a zone; if none of it is on the screen, bring its middle there."""
        self.choose(zone=zone)
        cells = self.pictures.zone_cells(self.playback, zone, self.choice.side)
        if cells and not any(self.pictures.camera.place_of(cell) is not None for cell in cells):
            self.show_cell(cells[len(cells) // 2])

    def choose_at(self, cell: int) -> None:
        """Select the robot in a cell, or the cell if it is empty."""
        if self.playback is None:
            self.choose(cell=cell)
            return
        robots = self.playback.snapshots[self.choice.side].robots
        at = np.where(robots.cell == NIL, robots.bay, robots.cell)
        here = np.flatnonzero(at == cell)
        self.choose(int(here[0]) if len(here) else NIL, NIL if len(here) else cell)

    def show_cell(self, cell: int) -> None:
        """Bring a cell onto the screen."""
        if cell != NIL and self.pictures.camera.place_of(cell) is None:
            self.pictures.fitted = False
            self.pictures.camera.centre_on(cell)
        self.changed()

    @contextmanager
    def kept_in_sight(self) -> Iterator[None]:
        """Keep the selection on the map while the context resizes the map."""
        camera, cell = self.pictures.camera, self.choice.cell
        if self.playback is not None and self.choice.robot != NIL:
            cell = robot_cell(self.playback, self.choice)
        was_shown = cell != NIL and camera.place_of(cell) is not None
        yield
        if was_shown:
            self.show_cell(cell)

    def show_choice(self) -> None:
        """Bring the selection onto the screen."""
        if self.choice.robot != NIL:
            self.show_robot()
        else:
            self.show_cell(self.choice.cell)

    def show_robot(self) -> None:
        """Bring the selected robot onto the screen."""
        if self.playback is not None:
            self.show_cell(robot_cell(self.playback, self.choice))


class Display:
    """The widgets of the viewer, and the path of a frame from the player to them.

    Player -> PlaybackState -> Scene -> codes -> MapView        at every change
                            -> View -> panels, lines            at most a few times a second
    """

    def __init__(self, app: App[None], session: Session) -> None:
        options, opening = session.options, session.opening
        self._session = session
        self.presenter = Presenter(app, options.renderer)
        self.pixels = PixelScreen(self.presenter, options.pixels or "off")
        pacer = FramePacer(options.fps, options.max_kbit)
        self.frames = FrameClock(self.presenter, self.draw, pacer)
        self.maps = [self._made(MapView, f"map-{n}") for n in range(len(opening.resolved))]
        self.heads = [self._made(WordLine, f"head-{n}") for n in range(len(self.maps))]
        self.title_line = self._made(WordLine, "title")
        self.status = self._made(WordLine, "status")
        self.info = self._made(WordLine, "info")
        self.timeline = self._made(Timeline, "timeline")
        self.notices = Notices(app, session, self.info, self.refresh_lines_soon)
        self.column: Any = None  # the panels, once imported
        self.link_shown = False
        self._stale = self._texts_stale = True
        self._texts_updated_at = self._panels_at = -math.inf
        self._panels_know: object = None
        session.changed, session.ordered = self.changed, self.ordered

    def _made(self, kind: type[Any], id: str) -> Any:
        return kind(self.presenter, self._session.look, self._session.glyphs, id=id)

    def changed(self) -> None:
        """Draw a changed choice."""
        self._stale = True
        self.refresh_lines_soon()

    def ordered(self) -> None:
        """Show the result of a request to the player as soon as it is there."""
        self._texts_stale = True
        self.frames.expect()

    def refresh_lines_soon(self, at_once: bool = True) -> None:
        """Update the lines under the map; at once, or with the next frame."""
        self._texts_stale = True
        if at_once:
            self.frames.wake()

    def refresh_panels(self) -> None:
        """Write the panels again, since their layout has changed."""
        self._panels_know = None
        self.changed()

    def set_look(self, look: Look) -> None:
        """Set the colours."""
        self._session.look = look
        lines = (self.title_line, self.info, self.status, self.timeline)
        for view in (*self.maps, *self.heads, *lines):
            view.set_appearance(look, self._session.glyphs)
        self.changed()

    def toggle_link(self) -> None:
        """Show or hide measurements of the connection."""
        self.link_shown = not self.link_shown
        self.changed()

    def draw(self) -> bool:
        """Present all changes; returns False if nothing changed and nothing was written."""
        session = self._session
        before = session.playback
        if session.player is not None:
            session.playback = session.player.latest()
        if session.playback is not before:
            self._texts_stale = True
            self._follow_playback(before)
        if COMPILING.now() or (session.player is not None and session.player.computing()):
            self._texts_stale = True  # a line counts the seconds
        drawn = (session.playback is not before or self._stale) and self._draw_maps()
        is_said = self._update_texts()
        if failed := failure():
            self._leave_failed_layer()
            self.notices.say_switched_off(failed)
        if why := self.pixels.leave(self.frames.pace):
            self.notices.say(why, "warning")
            self.changed()
        return drawn or is_said

    def _leave_failed_layer(self) -> None:
        """Show the plain floor if the shown layer was switched off."""
        session = self._session
        layer = layer_named(session.choice.layer)
        if not layer.is_there(session.scene()):
            session.choice.layer = ""
            if session.player is not None:
                session.player.show_layer("")
                self.ordered()
            self.changed()

    def _follow_playback(self, before: PlaybackState | None) -> None:
        """Follow the selected robot, and select the robot of a breakpoint that stopped the run."""
        session = self._session
        playback = session.playback
        assert playback is not None
        session.pictures.follow(playback, session.choice)
        if playback.failed and (before is None or not before.failed):
            self.notices.say_failure()
        self._report_unreachable_tick(playback)
        session.divergence = playback.divergence or session.divergence
        if playback.stops > (0 if before is None else before.stops):
            if playback.stuck is None:
                session.mark(playback.tick, "stop")
                session.choice.side = playback.side
            session.goal = None  # the breakpoint ended the way to it
            if playback.breakpoint_robots:
                session.choose(playback.breakpoint_robots[0])
                session.show_robot()

    def _report_unreachable_tick(self, playback: PlaybackState) -> None:
        """Tell the user if the run ended before the requested tick."""
        goal, end = self._session.goal, playback.end
        if goal is None or playback.tick < min(goal, playback.head):
            return
        if end is not None and playback.tick == end < goal and not playback.failed:
            self._session.notify(f"the run ends at tick {end:,}; there is no tick {goal:,}")
        if playback.tick >= goal or playback.tick == end:
            self._session.goal = None

    def _draw_maps(self) -> bool:
        drawn = self._stale = False
        pictures, theme = self._session.pictures, self._session.look.theme
        for side, view in enumerate(self.maps):
            if not view.size.height or not view.size.width or not view.is_on_screen:
                continue
            shown = (partial(self._session.scene, side), pictures.camera, theme)
            written = self.pixels.present(view, *shown, self._has_card(side))
            pictures.in_pixels = written is not None
            if written is not None:
                view.cover(partial(self.codes_of, side))
                drawn |= written
                continue
            codes = self.codes_of(side)
            if view.shown is None or not np.array_equal(codes, view.shown):
                view.present(codes)
                drawn = True
        return drawn

    def codes_of(self, side: int) -> Codes:
        """The picture of a run at the shown tick, also while its map is hidden."""
        session, size = self._session, self.maps[side].size
        camera = session.pictures.camera
        rows, columns = size.height or camera.rows, size.width or camera.columns
        codes = session.pictures.picture(session.scene(side), session.choice, rows, columns)
        if self._has_card(side):
            from tui.widgets.end_card import draw_end_card

            fixed = session.opening.comparing or session.options.read_only
            draw_end_card(codes, session.view(), session.is_whole(side), not fixed)
        return codes

    def _has_card(self, side: int) -> bool:
        """Whether the result of a run is shown on its map."""
        playback, choice = self._session.playback, self._session.choice
        if side != choice.side:
            return False
        if playback is None or playback.failed or not playback.ended(side):
            choice.card = True  # at the end
            return False
        return choice.card

    def _update_texts(self) -> bool:
        """Update lines and panels if they are stale and due; returns whether a line changed."""
        now = asyncio.get_running_loop().time()
        pause = PANELS_S if self.frames.pace.strained else LINES_S
        said = False
        if self._texts_stale and now - self._texts_updated_at >= pause:
            self._texts_updated_at, self._texts_stale = now, False
            said = self._update_lines()
        self._update_panels(now)
        return said

    def _update_lines(self) -> bool:
        session = self._session
        playback, choice = session.playback, session.choice
        scene = session.scene()
        right = scale_words(scene, session.glyphs)
        right += link_words(self.frames.figures()) if self.link_shown else []
        changed: bool = self.info.set_words(self._message(), right)
        if playback is None:
            building = getattr(COMPILING.now(), "words", "the world is being built ...")
            state = "cannot run" if session.error else building
            changed |= self.status.set_words([word(state, styles.COLOUR_DIM)])
            return changed
        tick = unit(session.opening.resolved[0].scenario.units.tick)
        words = time_words(playback, choice.side, session.speed, tick, session.glyphs)
        chosen = choice_words(choice.robot, choice.following, choice.laid)
        mode, figures = self.mode(playback), playback.figures[choice.side]
        room = self.status.size.width - columns_of(lasting([*words, *chosen, mode, word("")]))
        words += fleet_words(scene, figures, session.glyphs, room, not playback.playing) + chosen
        changed |= self.status.set_words(words, [mode])
        changed |= self.timeline.set_content(self._past(playback))
        changed |= self.show_titles()
        return changed

    def show_titles(self) -> bool:
        """Show the titles of the runs and which of two has ended; returns whether any changed."""
        session = self._session
        changed: bool = self.title_line.set_words([word("automaton"), word(session.titles[0])])
        for side, (own, common) in enumerate(session.opening.heads):
            head, end = self.heads[side], end_words(session.playback, side)
            room = head.size.width - columns_of([*end, word("")])
            changed |= head.set_words(head_words(f"{'AB'[side]} {own}", common, room), end)
        return changed

    def mode(self, playback: PlaybackState) -> Word:
        """The mode (live, past of a live run, or recorded) and how the run ended."""
        session, side = self._session, self._session.choice.side
        if session.live:
            return mode_word(playback, side, "recording" if session.recordings else "live")
        name = "compare" if session.opening.comparing else "replay"
        return mode_word(playback, side, name, recorded=True, whole=session.is_whole(side))

    def _past(self, playback: PlaybackState) -> Past:
        """The content of the timeline."""
        session = self._session
        event_history = session.runs[session.choice.side].event_history
        marks = [Mark(tick, "deadlock") for tick in event_history.deadlocks.tolist()]
        marks += [Mark(tick, "redesign") for tick in event_history.redesigns.tolist()]
        marks += session.marks
        if session.divergence is not None and session.divergence.tick is not None:
            marks.append(Mark(session.divergence.tick, "difference"))
        series = event_history.curve, tuple(marks), session.runs[session.choice.side].lost.rows
        return Past(playback.tick, playback.head, playback.end, *series)

    def _message(self) -> list[Word]:
        """The most important message now."""
        session, playback, choice = self._session, self._session.playback, self._session.choice
        if (notice := self.notices.current()) is not None:
            return [notice]
        error = session.error or session.broken or (playback.error if playback is not None else "")
        if error:
            return [word(error, styles.COLOUR_FAULT, "play_pause")]
        if playback is not None and (compiling := COMPILING.now()):  # a branch may compile
            return [word(compiling.words, styles.COLOUR_CURSOR)]
        if playback is not None and playback.stuck is not None:
            return [word(stuck_words(playback.stuck), styles.COLOUR_FAULT, "deadlock")]
        if session.goal is not None and playback is not None and playback.tick < session.goal:
            going = going_words(session.goal_from, playback.tick, session.goal)
            return [word(going, styles.COLOUR_CURSOR, "clear")]
        if session.player is not None and (slow := session.player.computing()):
            return [word(long_tick_words(*slow), styles.COLOUR_CURSOR)]
        if playback is not None and playback.stopped:
            return [word(f"stopped: {playback.stopped}", styles.COLOUR_CURSOR, "breakpoints")]
        if session.hovered != NIL:
            return [word(describe(session.scene(session.hovered_side), session.hovered))]
        if playback is not None and playback.failed:
            return [word(playback.failed, styles.COLOUR_FAULT, "play_pause")]
        if choice.cell != NIL:
            return [word(describe(session.scene(), choice.cell))]
        if session.divergence is not None:
            return [word(session.divergence.text, styles.COLOUR_TEXT, "next_difference")]
        shown = session.pictures.camera.zoom, session.glyphs, session.pictures.in_pixels
        is_told = self.title_line.is_on_screen or session.opening.comparing
        name = "" if is_told else session.titles[0].partition(",")[0]
        return hint_words(floor_legend(session.scene().floor, *shown), name)

    def _update_panels(self, now: float) -> None:
        session, pause = self._session, STRAINED_S if self.frames.pace.strained else PANELS_S
        if self.column is None or session.playback is None or now - self._panels_at < pause:
            return
        choice, pictures = session.choice, session.pictures
        chosen = (choice.robot, choice.cell, choice.zone, choice.layer, choice.least, choice.side)
        looks = (choice.colouring, choice.trails, choice.lines)
        drawn = (session.look, pictures.camera.zoom, pictures.glyphs, pictures.in_pixels)
        know = (session.playback, chosen, looks, drawn)
        if self._panels_know == know or not self.column.is_on_screen:
            return
        self._panels_at, self._panels_know = now, know
        self.column.show(session.view())


class Notices:
    """Shows messages in the line or, if too long, over the map."""

    def __init__(
        self, app: App[None], session: Session, line: Any, refresh: Callable[..., None]
    ) -> None:
        """`line` is the line's widget; `refresh` updates it."""
        self._app, self._session, self._line, self._refresh = app, session, line, refresh
        self.notice: Notice | None = None

    def say(
        self, message: str, severity: SeverityLevel = "information", timeout: float | None = None
    ) -> None:
        """Show a message for `timeout` seconds."""
        seconds = NOTICE_S if timeout is None else timeout
        if not self._fits_line(message):
            self._toast(message, severity, seconds)
            return
        until = asyncio.get_running_loop().time() + seconds
        self.notice = Notice(word(message, NOTICE_COLOURS[severity]), until)
        self._refresh()
        self._app.set_timer(seconds + LINES_S, self._refresh)

    def say_of_layer(self, message: str) -> None:
        """Show a message about this layer and robot until either changes."""
        self.say(message)
        choice = self._session.choice
        self._let_go(message, layer=choice.layer, robot=choice.robot)

    def say_switched_off(self, message: str) -> None:
        """Show a message until another layer is shown, whose scale uses the same line."""
        self.say(message, "warning", FAILURE_S)
        self._let_go(message, layer=self._session.choice.layer)

    def say_failure(self) -> None:
        """Show the whole error, with the strategy's file and line."""
        if self._session.playback is not None:
            self._toast(self._session.playback.failed, "error", FAILURE_S)

    def end(self) -> None:
        """End the message, unless it belongs to a layer."""
        self._app.clear_notifications()
        if self.notice is not None and self.notice.layer is None:
            self.notice = None
            self._refresh(at_once=False)  # what ends it, such as a key, has its own frame

    def current(self) -> Word | None:
        """The message that is still due."""
        notice, choice = self.notice, self._session.choice
        if notice is not None:
            late = notice.until <= asyncio.get_running_loop().time()
            other_layer = notice.layer not in (None, choice.layer)
            if late or other_layer or notice.robot not in (None, choice.robot):
                self.notice = None
        return None if self.notice is None else self.notice.words

    def _let_go(self, message: str, layer: str, robot: int | None = None) -> None:
        """If the line shows this message, end it when the layer or the robot changes."""
        if self.notice is not None and self.notice.words.text == message:
            self.notice = self.notice._replace(layer=layer, robot=robot)

    def _toast(self, message: str, severity: SeverityLevel, seconds: float) -> None:
        self._app.clear_notifications()  # one at a time: several would cover the status line
        App.notify(self._app, message, severity=severity, timeout=seconds, markup=False)

    def _fits_line(self, message: str) -> bool:
        fits = message.isascii() and len(message) <= self._line.size.width
        return fits and len(self._app.screen_stack) == 1 and bool(self._line.is_on_screen)
