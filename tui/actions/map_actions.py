"""Actions on the view of the floor: panning, zooming, following."""

from __future__ import annotations

from functools import partial
from typing import Final

from textual.app import App

from automaton.engine.state import NIL
from tui.actions import Command
from tui.playback.frame_cache import robot_cell
from tui.session.session import Session

STEP_COLUMNS: Final = 4
STEP_ROWS: Final = 2


class MapActions:
    """The map."""

    def __init__(self, app: App[None], session: Session) -> None:
        self._app, self._session = app, session
        self._choice, self._pictures = session.choice, session.pictures

    def commands(self) -> dict[str, Command]:
        ways = {"left": (-1, 0), "right": (1, 0), "up": (0, -1), "down": (0, 1)}
        pans: dict[str, Command] = {
            f"pan_{name}": partial(self._step, x, y) for name, (x, y) in ways.items()
        }
        pages = {f"page_{name}": partial(self._page, *way) for name, way in ways.items()}
        return {
            **pans,
            **pages,
            "zoom_in": partial(self.zoom, 1),
            "zoom_out": partial(self.zoom, -1),
            "zoom_fit": self._fit,
            "zoom_cell": self._one_to_one,
            "follow": self.follow,
            "maximise": self._maximise,
            "minimap": self._minimap,
        }

    def pan(self, columns: int, rows: int) -> None:
        """Move the view by so many characters; no robot is followed any more."""
        self._choice.following = self._pictures.fitted = False
        self._pictures.camera.pan_characters(columns, rows)
        self._session.changed()

    def zoom(self, steps: int, at: tuple[int, int] | None = None) -> None:
        """A step nearer or farther; what is at the place (row, column) of the map stays there."""
        camera = self._pictures.camera
        self._pictures.fitted = False
        if at is None and self._session.playback is not None:
            cell = robot_cell(self._session.playback, self._choice)
            at = None if cell == NIL else camera.place_of(cell)
        if steps > 0:
            camera.zoom_in(at)
        else:
            camera.zoom_out(at)
        self._session.changed()

    def follow(self) -> None:
        """Keep the selected robot on the screen, or no more."""
        choice, session = self._choice, self._session
        if choice.robot == NIL:
            session.notify("choose a robot first: click it, or press )")
            return
        choice.following = not choice.following
        if choice.following and session.playback is not None:
            self._pictures.fitted = False
            self._pictures.follow(session.playback, choice)
        session.changed()

    def _step(self, across: int, down: int) -> None:
        """Some characters, and at least a cell: the view moves by whole cells."""
        zoom = self._pictures.camera.zoom
        self.pan(across * max(STEP_COLUMNS, zoom.width), down * max(STEP_ROWS, zoom.height))

    def _page(self, across: int, down: int) -> None:
        camera = self._pictures.camera
        columns = max(camera.columns // 2, camera.zoom.width)
        self.pan(across * columns, down * max(camera.rows // 2, camera.zoom.height))

    def _fit(self) -> None:
        self._pictures.fitted = True
        self._pictures.camera.fit()
        self._session.changed()

    def _one_to_one(self) -> None:
        """About what is selected, if some of the floor is off the screen then."""
        session, camera = self._session, self._pictures.camera
        self._pictures.fitted = False
        camera.one_to_one()
        cell = self._choice.cell
        if session.playback is not None and self._choice.robot != NIL:
            cell = robot_cell(session.playback, self._choice)
        if cell != NIL and camera.exceeds():
            camera.centre_on(cell)
        session.changed()

    def _maximise(self) -> None:
        self._app.screen.toggle_class("-map-alone")
        self._session.changed()

    def _minimap(self) -> None:
        self._choice.minimap = not self._choice.minimap
        self._session.changed()
