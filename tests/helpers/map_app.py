"""A small app for the tests of the presenter: a map on which robots walk at random, among widgets.

python map_app.py DUMP [robots]        DUMP: where SIGUSR1 writes what ought to be on the screen
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from textual._context import visible_screen_stack
from textual.app import App, ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal
from textual.events import AppBlur, AppFocus, CursorPosition
from textual.screen import ModalScreen
from textual.widgets import Footer, Header, Input, Static
from textual.widgets._toast import Toast
from textual.widgets._tooltip import Tooltip

from tui.render.styles import (
    COLOUR_FLOOR,
    COLOUR_LOADED,
    COLOUR_ROBOT,
    COLOUR_TRACK,
    Codes,
    Look,
    code,
    style,
)
from tui.terminal.frame_pacing import FrameClock, FramePacer, quiet_collector
from tui.terminal.map_view import MapView, Presenter
from tui.terminal.options import depth_of, glyphs_of

STEPS = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])


class Question(ModalScreen[None]):
    """A dialog in the middle, with an input whose caret must stay where it is."""

    CSS = "Question { align: center middle; } Input { width: 40; }"
    BINDINGS: ClassVar = [Binding("escape", "dismiss", "Close")]

    def compose(self) -> ComposeResult:
        yield Input("question", id="question")


class MapApp(App[None]):
    """Keys: space walk or stand (so does the wheel), t toast, o dialog, b panel, z other ground."""

    CSS = "#side { width: 30; height: 1fr; } #side.away { display: none; }"
    BINDINGS: ClassVar = [
        Binding("space", "toggle_walk", "Walk"),
        Binding("t", "toast", "Toast"),
        Binding("o", "ask", "Ask"),
        Binding("b", "panel", "Panel"),
        Binding("z", "zoom", "Zoom"),
        Binding("s", "shoot", "Screenshot"),
        Binding("ctrl+c", "quit", "Quit", priority=True),
    ]

    def __init__(self, dump: Path, robots: int) -> None:
        super().__init__()
        self.dump = dump
        self.dumps = 0
        self.walking = False
        self.ground = 1
        self.toasted = False
        self.stale = True
        self.random = np.random.default_rng(1)
        self.places = self.random.random((robots, 2))  # of the rows and of the columns
        self.robots: NDArray[np.intp] = np.zeros((robots, 2), np.intp)
        self.extent = np.zeros(2, np.intp)  # of the map, as its last message said
        self.presenter = Presenter(self, os.environ.get("RENDERER", "auto"))
        self.clock = FrameClock(
            self.presenter, self.draw, FramePacer(int(os.environ.get("FPS", "60")))
        )
        self.glyphs = glyphs_of(os.environ, "auto")
        self.map = MapView(self.presenter, Look(depth_of(os.environ, "auto"), "dark"), self.glyphs)

    def compose(self) -> ComposeResult:
        yield Header()
        with Horizontal():
            yield self.map
            yield Static("panel", id="side")
        yield Footer()

    def on_mount(self) -> None:
        self.query_one("#side").tooltip = "tooltip of the side"
        self.map.tooltip = "tooltip of the map"
        self.map.focus()
        self.clock.start()
        # By signal, since a key or the mouse would take the tooltip away.
        asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, self.write_dump)
        self.set_timer(1.5, quiet_collector)

    def on_unmount(self) -> None:
        self.clock.stop()

    def on_map_view_resized(self, event: MapView.Resized) -> None:
        self.extent = np.array([event.rows, event.columns])
        self.robots = (self.places * self.extent).astype(np.intp)
        self.stale = True
        self.clock.wake()

    def on_map_view_wheeled(self) -> None:
        self.action_toggle_walk()

    def on_cursor_position(self, event: CursorPosition) -> None:
        self.clock.answered(event.time)

    def on_resize(self) -> None:
        self.presenter.terminal_resized()

    def on_app_blur(self, _: AppBlur) -> None:
        self.clock.pace.blurred = True

    def on_app_focus(self, _: AppFocus) -> None:
        self.clock.pace.blurred = False

    def draw(self) -> bool:
        if not (self.walking or self.stale) or not self.extent.all():
            return False
        if self.walking:
            step = STEPS[self.random.integers(4, size=len(self.robots))]
            onward = self.robots + step
            # At an edge a robot turns round, so that every one moves in every frame.
            outside = (onward < 0) | (onward >= self.extent)
            self.robots = np.where(outside, self.robots - step, onward)
        self.map.present(self.picture())
        self.stale = False
        return True

    def picture(self) -> Codes:
        rows, columns = self.extent
        marks = np.array([self.glyphs.characters.index(mark) for mark in " .#"], np.uint32)
        y, x = np.mgrid[:rows, :columns]
        codes = code(
            style(COLOUR_TRACK, COLOUR_FLOOR), marks[(x + y * self.ground) % 7 % 3]
        ).astype(np.uint32)
        paint = np.where(
            np.arange(len(self.robots)) % 2,
            style(COLOUR_LOADED, COLOUR_FLOOR),
            style(COLOUR_ROBOT, COLOUR_FLOOR),
        )
        codes[tuple(self.robots.T)] = code(paint.astype(np.uint32), marks[2])
        return codes

    def action_toggle_walk(self) -> None:
        self.walking = not self.walking
        self.clock.wake()

    def action_toast(self) -> None:
        if self.toasted:
            self.clear_notifications()
        else:
            self.notify("a toast over the map", timeout=600)
        self.toasted = not self.toasted

    def action_ask(self) -> None:
        self.push_screen(Question())

    def action_panel(self) -> None:
        self.query_one("#side").toggle_class("away")

    def action_zoom(self) -> None:
        self.ground += 1
        self.stale = True
        self.clock.wake()

    def action_shoot(self) -> None:
        svg = self.export_screenshot()
        self.dump.with_suffix(".svg").write_text(svg)

    def write_dump(self) -> None:
        """Every metric and the intended cells, at once on the disk under their final name."""
        self.dumps += 1
        figures = {
            "number": self.dumps,
            "why_not": self.presenter.why_not,
            "obstructed": self.presenter.obstructed,
            "cursor": [self.cursor_position.x, self.cursor_position.y],
            "bytes": self.presenter.bytes,
            "frames": self.presenter.frames,
            "skipped": self.clock.pace.skipped,
            "top": self.map.region.y,
            "left": self.map.region.x,
            "codes": self.picture().tolist(),
            "covered": self.covered(),
            "screen": self.whole_screen(),
        }
        half = self.dump.with_suffix(".half")
        half.write_text(json.dumps(figures))
        half.rename(self.dump)

    def whole_screen(self) -> list[str]:
        """What Textual would paint, row by row; the map in it comes from `batch_view`."""
        visible_screen_stack.set(self._background_screens)
        return [strip.render(self.console) for strip in self.screen._compositor.render_strips()]

    def covered(self) -> list[tuple[int, int, int, int]]:
        """Where something lies over the map: x, y, width, height."""
        if self.screen is not self.map.screen:
            return [(0, 0, *self.size)]
        front = [*self.screen.query(Toast), *self.screen.query(Tooltip)]
        return [tuple(widget.region) for widget in front if widget.visible and widget.region]


def without_the_rule() -> None:
    """What a naive presenter does: write wherever the map is, whatever lies over it."""
    Presenter._uncovered = lambda self, view, visible: view.region  # type: ignore[method-assign]


if __name__ == "__main__":
    if os.environ.get("NAIVE"):
        without_the_rule()
    MapApp(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 100).run()
