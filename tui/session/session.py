"""What the viewer shows: one or two runs, what is chosen of them, and how they are looked at.

A session knows no widget. Groups of actions change it, the display shows it.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.history.divergence import Divergence, first_difference
from tui.playback.frame_cache import Pictures, robot_cell
from tui.playback.run_source import Opening
from tui.render.scene import NO_CELLS, Choice, Scene
from tui.render.styles import Look
from tui.terminal.options import Options
from tui.widgets.timeline import Mark

if TYPE_CHECKING:
    from automaton.history.watched_run import Run
    from tui.playback.panel_view import View
    from tui.playback.playback_state import PlaybackState
    from tui.playback.player import Player


def _nothing() -> None:
    """What happens before there is a display."""


class Session:
    """The runs, the choice, and the pictures of both."""

    def __init__(self, opening: Opening, options: Options, notify: Callable[[str], None]) -> None:
        """`notify` says a sentence to the user."""
        self.opening, self.options, self.notify = opening, options, notify
        self.player: Player | None = None
        self.playback: PlaybackState | None = None
        self.choice = Choice()
        self.speed = options.speed
        self.live = opening.live  # or branched off a recording
        self.titles = list(opening.titles)
        self.goal = options.at  # a tick on the way to which the run may end
        self.error = ""  # why there is nothing to be played
        self.broken = ""  # why two runs cannot be compared
        self.hovered = NIL  # the cell under the mouse
        self.hovered_side = 0
        self.pointing = False  # the mouse has been moved since something was chosen
        self.marks: list[Mark] = []  # breakpoints met, branches
        self.divergence: Divergence | None = None
        self.recordings: list[Path] = list(opening.paths)
        self.glyphs = options.glyphs(os.environ)
        self.look = Look(options.depth(os.environ), options.theme)
        self.pictures = Pictures(opening, self.glyphs)
        self.changed: Callable[[], None] = _nothing  # something else is chosen: draw it
        self.published: Callable[[], None] = _nothing  # there is a new state
        # The player got a request: its result is to be seen as soon as it is there.
        self.ordered: Callable[[], None] = _nothing
        self._ending = threading.Lock()
        self._ended = False

    @property
    def runs(self) -> Sequence[Run]:
        """The runs, once they are there. Of a run read plan, header, resolved and event_history only."""
        return () if self.playback is None else self.playback.runs

    # Beginning and end; the runs come after the first picture, in a thread of their own.

    def open(self, published: Callable[[], None]) -> bool:
        """Import Numba and begin the runs; whether the viewer still waits for them.

        `published` is called in the player's thread for each new state.
        """
        player: Player | None = None
        self.published = published
        try:
            from tui.playback.player import Player
            from tui.widgets.panel_column import panel_widgets

            panel_widgets()  # they take a while to import
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
        player.set_speed(self.options.speed)
        if self.options.at is not None:
            player.seek(self.options.at)
        elif not self.options.paused:
            player.play()
        return player

    def reopen(self, opening: Opening, player: Player) -> Player | None:
        """Show a scenario that was loaded again, from tick 0; the player to be closed, if there is one.

        Camera, layers and the selected robot stay as far as the new floor has them.
        """
        with self._ending:
            before, self.player = self.player, player
            if self._ended:
                return player
        choice = self.choice
        if not self.pictures.take_floor(opening):
            choice.cell = NIL
        choice.robot = (
            choice.robot if choice.robot < opening.resolved[0].scenario.fleet.robots else NIL
        )
        choice.zone, choice.matches = NIL, NO_CELLS
        self.opening, self.titles, self.marks, self.goal = opening, list(opening.titles), [], None
        self.error, self.divergence, self.hovered = "", None, NIL
        player.published = self.published
        player.set_speed(self.speed)
        player.select(choice.robot)
        player.show_layer(choice.layer)
        if self.playback is None or self.playback.playing:
            player.play()
        self.playback = player.latest()
        return before

    def compare(self) -> None:
        """Find where two recorded runs part; of live ones the player does."""
        if self.opening.live:
            return
        from tui.playback.player import sentence

        try:
            self.divergence = first_difference(*self.opening.recordings)
        except Exception as wrong:
            self.broken = sentence(wrong)

    def close(self) -> None:
        """Nothing is computed any more, and what was recorded is whole; from any thread."""
        with self._ending:
            if not self._ended and self.player is not None:
                self.player.close()
            self._ended = True

    # What is chosen.

    def ready(self) -> bool:
        """Whether there is a run; if not yet, says so."""
        if self.player is None:
            self.notify(self.error or "the world is not built yet")
        return self.player is not None

    def is_alone(self) -> bool:
        """Whether no other run is beside this one; if so, says how to compare two."""
        if not self.opening.comparing:
            self.notify("two recordings are compared by: automaton replay A B")
        return not self.opening.comparing

    def view(self) -> View:
        """What panels and dialogs get; there has to be a playback state."""
        from tui.playback.panel_view import Picture, View

        assert self.playback is not None
        choice = self.choice
        side = choice.side
        robot = choice.robot if choice.robot < len(self.playback.snapshots[side].robots) else NIL
        picture = Picture(self.scene(), self.pictures.camera.zoom, self.look, self.glyphs)
        chosen = (robot, choice.cell, choice.layer, side, choice.zone, picture)
        return View(self.playback, self.playback.runs, *chosen)

    def scene(self, side: int | None = None) -> Scene:
        """What the picture of a run is made of; without a side, of the chosen run."""
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
        """Select a zone, and bring its middle on the screen unless some of it is there."""
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
        """Bring a cell on the screen if it is not on it."""
        if cell != NIL and self.pictures.camera.place_of(cell) is None:
            self.pictures.fitted = False
            self.pictures.camera.centre_on(cell)
        self.changed()

    @contextmanager
    def kept_in_sight(self) -> Iterator[None]:
        """While inside, the map gets another size: what is selected stays on it."""
        camera, cell = self.pictures.camera, self.choice.cell
        if self.playback is not None and self.choice.robot != NIL:
            cell = robot_cell(self.playback, self.choice)
        was_shown = cell != NIL and camera.place_of(cell) is not None
        yield
        if was_shown:
            self.show_cell(cell)

    def show_choice(self) -> None:
        """Bring what is selected on the screen."""
        if self.choice.robot != NIL:
            self.show_robot()
        else:
            self.show_cell(self.choice.cell)

    def show_robot(self) -> None:
        """Bring the selected robot on the screen."""
        if self.playback is not None:
            self.show_cell(robot_cell(self.playback, self.choice))
