"""Actions on the view: the map, its layers, the panels, and screenshots."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np
from rich.color import Color, blend_rgb
from rich.color_triplet import ColorTriplet
from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from rich.terminal_theme import DEFAULT_TERMINAL_THEME
from textual.app import App

from automaton.atomic_write import replacing
from automaton.engine.observation import is_waiting
from automaton.engine.state import NIL
from tui.playback.frame_cache import robot_cell
from tui.playback.run_source import capture_file, short_path
from tui.registration import layer_named, layers, panels
from tui.render.drawn_robots import COLOURINGS, is_possible
from tui.render.encode import TextRun, as_text, svg_of
from tui.render.styles import COLOUR_TEXT, COLOUR_VOID, Depth, Look, style
from tui.viewer.session import Command, Display, Notices, Session

STEP_COLUMNS: Final = 4
STEP_ROWS: Final = 2

WIDE: Final = 100  # columns from which panels have room beside the map
BESIDE_COLUMNS: Final = 36  # of a panel beside the map of a narrow screen
BELOW_SHARE: Final = 0.45  # share of the rows for a panel below such a map
LEAST_ROWS: Final = 6  # its least number of rows
ABOUT_CHOICE: Final = ("inspector", "why")  # panels about the selection
MIDDLE_CELL: Final = "the cell in the middle of the map: / finds a place, ) shows the next robot"

DIMMED = 0.4  # share of the way to the background


class MapActions:
    """Actions on the view of the floor: panning, zooming, following."""

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
        """Move the view by characters and stop following a robot."""
        self._choice.following = self._pictures.fitted = False
        self._pictures.camera.pan_characters(columns, rows)
        self._session.changed()

    def zoom(self, steps: int, at: tuple[int, int] | None = None) -> None:
        """Zoom in by a step, or out; the cell at `at` (row, column of the map) stays in place."""
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
        """Start or stop keeping the selected robot on the screen."""
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
        """Pan by some characters, but at least a cell, since the view moves by whole cells."""
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
        """Show one character per cell, around the selection if the floor exceeds the screen."""
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


class LayerActions:
    """Actions on the registered layers, the colours of robots, trails and lines."""

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
        """Show a layer by name; "" for the plain floor."""
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
        """Colour robots by one of COLOURINGS, if there are colours and robots differ in it."""
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
        """More commands of the palette: names, meanings, functions."""
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
        whose = {"": "none", "selected": "the selected robot's", "all": "all robots'"}
        at = list(whose).index(self._choice.lines) + 1
        self._choice.lines = list(whose)[at % len(whose)]
        self._notices.say(f"lines to goals: {whose[self._choice.lines]}", timeout=2)
        self._session.changed()

    def _press(self, names: list[str]) -> None:
        """Handle a key that several layers share: show the next available one of them."""
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


class PanelActions:
    """Actions on panels: off, beside or below the map, or in its place; and the open panel."""

    def __init__(self, app: App[None], session: Session, display: Display) -> None:
        self._app, self._session, self._display = app, session, display
        self.shown = "side"  # off, side or full; on a narrow screen "side" counts as off
        self.opened = False  # unless a panel was opened, beside or below the map
        self._picked = NIL  # the robot that the key of the waits selected last
        # Called before a key opens a panel.
        self.before: dict[str, Callable[[], None]] = {
            "why": self._choose_waiting,
            "inspector": self._choose_pointed,
        }

    def commands(self) -> dict[str, Command]:
        opening: dict[str, Command] = {
            panel.action: partial(self._open_by_key, name)
            for name, panel in panels().by_name.items()
        }
        return {
            **opening,
            "panels": self._turn,
            "compare_side": self._change_side,
            "scroll_down": partial(self._scroll, 1),
            "scroll_up": partial(self._scroll, -1),
        }

    def _open_by_key(self, name: str) -> None:
        before = None if self._closes(name) else self.before.get(name)
        if before is not None and self._session.ready():
            before()
        self.open(name)

    def _closes(self, name: str) -> bool:
        """Whether the key of this panel closes it."""
        column = self._display.column
        covers = self._seen == "full" or self.opened
        return covers and column is not None and column.name_open == name

    def show(self, panels: str) -> None:
        """Show panels off, side or full; a narrow screen uses the side that leaves more map."""
        self.shown, column = panels, self._display.column
        self.opened = panels == "side" and self._is_narrow
        self.fit()
        for name in ("off", "side", "full"):
            self._app.screen_stack[0].set_class(name == panels, f"-panels-{name}")
        if column is not None:
            column.set_class(panels == "full", "full")
        if panels != "full" or column is None:
            self._display.maps[0].focus()
        self._display.refresh_panels()

    def fit(self) -> None:
        """Place an open panel of a narrow screen beside or below the map."""
        screen, pictures = self._app.screen_stack[0], self._session.pictures
        body, side = screen.query_one("#body"), screen.query_one("#side")
        opened, room = self.opened and self._is_narrow, body.size
        rows = max(LEAST_ROWS, round(BELOW_SHARE * room.height))
        beside = len(self._display.maps) == 1 and pictures.larger_beside(
            room.height, room.width, rows, BESIDE_COLUMNS
        )
        screen.set_class(opened, "-panels-open")
        if (column := self._display.column) is not None and column.has_class("one") != opened:
            column.show_one(opened)
            self._display.refresh_panels()  # what was hidden is not up to date
        screen.set_class(opened and not beside, "-panels-below")
        side.styles.height = rows if opened and not beside else None

    def open(self, name: str, focus: bool = True) -> None:
        """Show a panel; on a narrow screen, or in place of the map, its key also closes it.

        With `focus` it receives the keys, unless all panels fit beside the map.
        """
        column = self._display.column
        if not self._session.ready() or column is None:
            return
        if self._closes(name):
            self.leave()
            return
        self._app.screen.remove_class("-map-alone")
        if self._seen == "off":
            self.show("side")
        column.open(name, focus=focus and (self.opened or self.shown == "full"))
        self._display.refresh_panels()
        if name in ABOUT_CHOICE:
            self._app.call_after_refresh(self._session.show_choice)

    def open_for_click(self) -> None:
        """After a click on the map, open the inspector unless a panel shows the selection."""
        column, is_robot = self._display.column, self._session.choice.robot != NIL
        if column is None or self._app.screen.has_class("-map-alone"):
            return
        is_shown = column.name_open == "inspector" or (
            is_robot and column.name_open in ABOUT_CHOICE
        )
        if self._seen == "off" or not is_shown:
            self.open("inspector", focus=False)

    def leave_full(self) -> None:
        """Show the map again, with panels beside it."""
        if self.shown == "full":
            self.show("side")

    def leave(self) -> None:
        """Close the opened panel and show the map."""
        self.leave_full()
        if self.opened:
            self.opened = False
            self.fit()
            self._display.maps[0].focus()

    @property
    def _is_narrow(self) -> bool:
        return self._app.size.width < WIDE

    @property
    def _seen(self) -> str:
        is_hidden = self.shown == "side" and self._is_narrow and not self.opened
        return "off" if is_hidden else self.shown

    def _turn(self) -> None:
        was_off, column = self._seen == "off", self._display.column
        self.show({"off": "side", "side": "full", "full": "off"}[self._seen])
        if was_off and column is not None:
            column.open("metrics")
        elif self._seen == "full":
            self._display.notices.say("p shows the map again", timeout=3)

    def _scroll(self, pages: int) -> None:
        column = self._display.column
        if column is None or not column.is_on_screen:
            self._session.notify("no panel is open: p opens the panels")
        else:
            column.scroll_pages(pages)

    def _change_side(self) -> None:
        session, choice = self._session, self._session.choice
        if session.is_alone():
            return
        choice.side = (choice.side + 1) % len(self._display.maps)
        session.changed()
        own = session.opening.heads[choice.side].own
        self._display.notices.say(f"panels show {'AB'[choice.side]} {own}", timeout=3)

    def _choose_waiting(self) -> None:
        """Select the robot that waits longest, unless one is selected; in the open panel, the next one.

        A robot that this selected before and that waits no more does not count as selected.
        """
        session, column = self._session, self._display.column
        if session.playback is None or column is None:
            return
        robots, robot = session.playback.snapshots[session.choice.side].robots, session.choice.robot
        waiting = np.flatnonzero(is_waiting(robots.cause))
        longest = waiting[np.argsort(robots.since[waiting], kind="stable")].tolist()
        is_open = self._seen != "off" and column.name_open == "why"
        if longest and (is_open or robot == NIL or robot == self._picked not in longest):
            follows = longest.index(robot) + 1 if robot in longest else 0
            self._picked = longest[follows % len(longest)]
            session.choose(self._picked)
            session.show_robot()

    def _choose_pointed(self) -> None:
        """Select the cell or robot under the mouse; without any selection, a default."""
        session, choice = self._session, self._session.choice
        if session.pointing and session.hovered != NIL:
            choice.side = session.hovered_side
            session.choose_at(session.hovered)
        elif choice.robot == choice.cell == choice.zone == NIL:
            self._choose_middle()

    def _choose_middle(self) -> None:
        """Select the cell under the mouse, or in the middle of the map, and say so."""
        camera = self._session.pictures.camera
        middle = camera.cell_at(camera.rows // 2, camera.columns // 2)
        cell = middle if self._session.hovered == NIL else self._session.hovered
        if cell is not None:
            self._session.choose_at(cell)
            if self._session.hovered == NIL:
                self._display.notices.say(MIDDLE_CELL)


class CaptureActions:
    """Actions that save pictures, as a drawing or as text."""

    def __init__(self, app: App[None], session: Session, display: Display) -> None:
        self._app, self._session, self._display = app, session, display

    def commands(self) -> dict[str, Command]:
        return {"screenshot": self._take_screenshot, "copy_text": self._copy_text}

    def _take_screenshot(self) -> None:
        rows, look = screen_rows(self._app, self._session.look), self._session.look
        # Rendering everything has cleared the list of pending repaints.
        self._app.screen.refresh()
        width, height = self._app.size
        title = f"automaton: {self._session.opening.name}"
        self._save(svg_of(rows, (height, width), look, title), ".svg")

    def _copy_text(self) -> None:
        glyphs = self._session.glyphs
        texts = [
            f"{title}, tick {self._tick_of(side):,}\n"
            f"{as_text(self._display.codes_of(side), glyphs)}{self._key(side)}"
            for side, title in enumerate(self._session.titles)
        ]
        text = "\n".join(texts)
        self._app.copy_to_clipboard(text)
        self._save(text, ".txt")

    def _key(self, side: int) -> str:
        """The meaning of shown zone letters, since a text has no legend."""
        session = self._session
        layer, resolved = layer_named(session.choice.layer), session.opening.resolved[side]
        if session.runs:  # differs after a branch
            resolved = session.runs[side].resolved
        words = layer.key_words(session.scene(side), resolved, session.glyphs)
        return f"{'; '.join(words)}\n" if words else ""

    def _tick_of(self, side: int) -> int:
        playback = self._session.playback
        return 0 if playback is None else playback.snapshots[side].tick

    def _save(self, text: str, suffix: str) -> None:
        session = self._session
        tick = 0 if session.playback is None else session.playback.tick
        name = f"{session.opening.name}-{tick}"
        if self._app.is_web:
            self._deliver(text, f"{name}{suffix}")
            return
        try:
            path = capture_file(name, suffix, os.environ, here=not session.options.read_only)
            with replacing(path, path.with_name(f"{path.name}.part")) as file:
                file.write(text.encode())
        except OSError as error:
            self._display.notices.say(f"cannot save the picture: {error.strerror}", "error")
            return
        session.notify(f"saved {short_path(path)}")

    def _deliver(self, text: str, name: str) -> None:
        """Send it to the browser."""
        if self._session.options.read_only:
            self._display.notices.say("this viewer is read-only: it hands out no files", "warning")
        else:
            self._app.deliver_text(io.StringIO(text), save_filename=name)


def screen_rows(app: App[None], look: Look) -> list[list[TextRun]]:
    """The characters of a running app in their colours, by default those of the map."""
    update = app.screen._compositor.render_update(full=True, screen_stack=app._background_screens)
    console = Console(
        file=io.StringIO(),
        width=app.size.width,
        height=app.size.height,
        force_terminal=True,
        color_system="truecolor",
        legacy_windows=False,
    )
    assert update is not None  # a full update
    segments = (segment for segment in console.render(update) if not segment.control)
    plain = look.css(style(COLOUR_TEXT, COLOUR_VOID))
    return [
        [_run(text, shown or Style.null(), plain) for text, shown, _ in row if text]
        for row in Segment.split_lines(segments)
    ]


def _run(text: str, shown: Style, plain: tuple[str, str, bool]) -> TextRun:
    fg = _rgb(shown.color, plain[0])
    bg = _rgb(shown.bgcolor, plain[1])
    if shown.reverse:
        fg, bg = bg, fg
    if shown.dim:
        fg = blend_rgb(fg, bg, DIMMED)
    return TextRun(text, fg.hex, bg.hex, bool(shown.bold))


def _rgb(colour: Color | None, plain: str) -> ColorTriplet:
    if colour is None or colour.is_default:
        return Color.parse(plain).get_truecolor()
    return colour.get_truecolor(DEFAULT_TERMINAL_THEME)
