"""Actions on the view of the floor: panning, zooming, following."""

from __future__ import annotations

from functools import partial
from typing import Final

from textual.app import App

from automaton.engine.state import NIL
from tui.actions import Command
from tui.playback.frame_cache import robot_cell
from tui.registration import layer_named, layers
from tui.render.cell_view import LINES
from tui.render.robot_marks import COLOURINGS, is_possible
from tui.render.styles import Depth
from tui.session.display import Notices
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


# Actions on what is laid over the floor.


class LayerActions:
    """Layers: those that are registered."""

    def __init__(self, session: Session, notices: Notices) -> None:
        self._session, self._notices, self._choice = session, notices, session.choice

    def commands(self) -> dict[str, Command]:
        ids: dict[str, list[str]] = {}
        for name, layer in layers().by_name.items():
            ids.setdefault(layer.action, []).append(name)
        return {
            "layer_none": partial(self.show, ""),
            **{id: partial(self._press, names) for id, names in ids.items()},
            "layer_route": self._turn_route,
            "next_layer": self._next,
            "next_colouring": self._next_colouring,
            "trails": self._turn_trails,
            "goal_lines": self._next_lines,
        }

    def show(self, name: str) -> None:
        """A layer by its name; "" for the plain floor."""
        session = self._session
        if session.ready() and session.player is not None:
            again = bool(name) and name == self._choice.layer
            self._choice.layer = name
            said = layer_named(name).shown(self._choice, again)
            session.player.show_layer(name)
            session.ordered()
            session.changed()
            if said:
                self._notices.say_of_layer(said)

    def colour_by(self, name: str) -> None:
        """Robots get their colours by one of COLOURINGS, if there are colours and they differ in it."""
        session = self._session
        if session.look.depth == Depth.NONE:
            session.notify("there are no colours here: shapes alone distinguish robots")
        elif not is_possible(session.scene(), name):
            session.notify(f"robots cannot be coloured by {name} here: they have none")
        else:
            self._choice.colouring = name
            self._notices.say(f"robots are coloured by {COLOURINGS[name]}", timeout=2)
            session.changed()

    def colourings(self) -> list[tuple[str, str, Command]]:
        """What the palette has beside the table of bindings: names, meanings, and what is done."""
        scene = self._session.scene()
        return [
            (f"Colours: {name}", f"robots coloured by {words}", partial(self.colour_by, name))
            for name, words in COLOURINGS.items()
            if is_possible(scene, name)
        ]

    def _next_colouring(self) -> None:
        there = [name for name in COLOURINGS if is_possible(self._session.scene(), name)]
        now = self._choice.colouring
        self.colour_by(there[(there.index(now) + 1) % len(there)] if now in there else there[0])

    def _turn_trails(self) -> None:
        session = self._session
        if session.ready() and session.player is not None:
            self._choice.trails = not self._choice.trails
            session.player.show_trails(self._choice.trails)
            session.ordered()
            session.changed()
            shown = "shown" if self._choice.trails else "hidden"
            self._notices.say(f"trails are {shown}", timeout=2)

    def _next_lines(self) -> None:
        at = LINES.index(self._choice.lines) + 1
        self._choice.lines = LINES[at % len(LINES)]
        whose = {"": "none", "selected": "the selected robot's", "all": "all robots'"}
        self._notices.say(f"lines to goals: {whose[self._choice.lines]}", timeout=2)
        self._session.changed()

    def _press(self, names: list[str]) -> None:
        """The key of layers that take turns: the first that is there, or the one after that shown."""
        there = [name for name in names if self._is_there(name)]
        if not there:
            self._session.notify(layer_named(names[-1]).absent)
            return
        shown = self._choice.layer
        if there == [shown] != names:
            self._session.notify(layer_named(names[-1]).absent)
            return
        self.show(there[(there.index(shown) + 1) % len(there)] if shown in there else there[0])

    def _turn_route(self) -> None:
        self._choice.route = not self._choice.route
        shown = "shown" if self._choice.route else "hidden"
        self._notices.say(f"routes are {shown}", timeout=2)
        self._session.changed()

    def _next(self) -> None:
        there = ["", *(name for name in layers().by_name if self._is_there(name))]
        shown = self._choice.layer
        self.show(there[(there.index(shown) + 1) % len(there)] if shown in there else "")

    def _is_there(self, name: str) -> bool:
        return bool(layer_named(name).is_there(self._session.scene()))
