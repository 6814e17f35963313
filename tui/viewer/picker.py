"""What `automaton` alone shows on a terminal: scenarios and recordings to choose from, with a picture.

The picture of a scenario begins to move after a moment.
"""

from __future__ import annotations

import os
import threading
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from typing import Final, NamedTuple

from rich.text import Text
from textual import events
from textual.app import App, ComposeResult
from textual.containers import Horizontal, Vertical
from textual.widgets import Input, Label, OptionList, Static
from textual.widgets.option_list import Option

from automaton.errors import InputError
from automaton.scenario.reading import is_study, read
from automaton.scenario.text_files import shipped
from automaton.world.resolve import Resolved, resolve
from tui.render.camera import Camera
from tui.render.compose import compose
from tui.render.scene import Scene, floor_of
from tui.render.styles import GLYPH_BITS, GLYPHS, Codes, GlyphSet, Look
from tui.terminal.options import Options
from tui.terminal.themes import themes

DWELL_S: Final = 0.8  # after which a picture begins to move
FRAME_S: Final = 0.1  # between two ticks of a moving picture
HINT: Final = "type to filter   up, down   enter opens   ctrl+q quits"


class Openable(NamedTuple):
    """Something that can be opened."""

    name: str
    kind: str  # shipped, scenario or recording

    @property
    def command(self) -> list[str]:
        """The command that opens it."""
        return ["replay" if self.kind == "recording" else "watch", self.name]


def choices(folder: Path) -> list[Openable]:
    """Scenarios and recordings of a folder, the latest first, then the shipped scenarios."""
    files = sorted(
        filter(Path.exists, folder.iterdir()), key=lambda path: (-changed_at(path), path.name)
    )
    own = [Openable(path.name, "recording") for path in files if path.suffix == ".rec"]
    own += [Openable(path.name, "scenario") for path in files if _is_scenario(path)]
    return own + [Openable(name, "shipped") for name in shipped()]


def changed_at(path: Path) -> float:
    """When a file was changed last; 0 if it has been deleted."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _is_scenario(path: Path) -> bool:
    if path.suffix not in (".yaml", ".yml") or not path.is_file():
        return False
    try:
        data = read(str(path)).data
    except InputError:
        return False
    return "fleet" in data and not is_study(data)


def pick(folder: Path, options: Options) -> list[str] | None:
    """Let the user choose; returns the command line that opens it, or None."""
    picker = Picker(choices(folder), options)
    return picker.run()


class Picker(App[list[str]]):
    """The list on the left, what is chosen on the right."""

    CSS = """
    #list { width: 34; border-right: vkey $border; }
    #choices { height: 1fr; border: none; background: $background; }
    #filter { border: none; height: 1; }
    #what { padding: 0 1; height: 3; }
    #hint { color: $text-disabled; height: 1; }
    #floor { width: 1fr; height: 1fr; }
    """

    def __init__(self, offered: list[Openable], options: Options) -> None:
        super().__init__()
        self._offered = offered
        self._look = Look(options.depth(os.environ), options.shown_theme)
        self._glyphs = options.glyphs(os.environ)
        self._stop = threading.Event()
        for theme in themes():
            self.register_theme(theme)
        self.theme = f"automaton-{options.shown_theme}"

    def compose(self) -> ComposeResult:
        with Horizontal():
            with Vertical(id="list"):
                yield Input(placeholder="filter", id="filter")
                yield OptionList(id="choices")
            with Vertical():
                yield Static(id="what")
                yield Static(id="floor")
        yield Label(HINT, id="hint")

    def on_mount(self) -> None:
        self._fill("")
        self.query_one(Input).focus()

    def on_unmount(self) -> None:
        self._stop.set()

    def on_input_changed(self, event: Input.Changed) -> None:
        self._fill(event.value)

    def on_key(self, event: events.Key) -> None:
        """Up and down move in the list while the filter has the focus."""
        key = event.key
        moves = {
            "up": "cursor_up",
            "down": "cursor_down",
            "pageup": "page_up",
            "pagedown": "page_down",
        }
        if key in moves and self.focused is self.query_one(Input):
            getattr(self.query_one(OptionList), f"action_{moves[key]}")()

    def on_input_submitted(self) -> None:
        chosen = self._chosen()
        if chosen is not None:
            self.exit(chosen.command)

    def on_option_list_option_selected(self) -> None:
        self.on_input_submitted()

    def on_option_list_option_highlighted(self) -> None:
        chosen = self._chosen()
        if chosen is not None:
            self._show(chosen)

    def on_resize(self) -> None:
        self.on_option_list_option_highlighted()

    def _fill(self, words: str) -> None:
        """List the choices that contain these words."""
        shown = self.query_one(OptionList)
        shown.clear_options()
        for number, one in enumerate(self._offered):
            if words.strip().lower() in one.name.lower():
                mark = "" if one.kind == "shipped" else f"  ({one.kind})"
                shown.add_option(Option(f"{one.name}{mark}", id=str(number)))
        shown.highlighted = 0 if shown.option_count else None

    def _chosen(self) -> Openable | None:
        shown = self.query_one(OptionList)
        if shown.highlighted is None:
            return None
        return self._offered[int(shown.get_option_at_index(shown.highlighted).id or 0)]

    # The picture.

    def _show(self, chosen: Openable) -> None:
        """Describe a choice, and draw its floor."""
        self._stop.set()
        what, floor = self.query_one("#what", Static), self.query_one("#floor", Static)
        floor.update("")
        if chosen.kind == "recording":
            path = Path(chosen.name)
            size = f"{(path.stat().st_size + 1023) // 1024:,} KB" if path.exists() else "deleted"
            what.update(Text(f"{chosen.name}\nrecording, {size}"))
            return
        try:
            resolved = resolved_of(chosen.name)
        except InputError as error:
            what.update(Text(f"{chosen.name}\n{error}"))
            return
        summary = resolved.scenario.summary or f"{resolved.scenario.fleet.robots} robots"
        what.update(Text(f"{chosen.name}\n{summary}"))
        rows, columns = floor.size.height, floor.size.width
        if rows and columns:
            scene = Scene(floor_of(resolved))
            camera = Camera(resolved.floor_plan, rows, columns, resolved.scenario.fleet.robots)
            self._draw(scene, camera)
            self._stop = threading.Event()
            work = threading.Thread(
                target=self._move, args=(resolved, scene, camera, self._stop), daemon=True
            )
            work.start()

    def _draw(self, scene: Scene, camera: Camera) -> None:
        codes = compose(scene, camera, self._glyphs)
        self.query_one("#floor", Static).update(text_of(codes, self._look, self._glyphs))

    def _draw_moving(self, scene: Scene, camera: Camera, stop: threading.Event) -> None:
        if not stop.is_set():  # another choice has not been drawn meanwhile
            self._draw(scene, camera)

    def _move(
        self, resolved: Resolved, scene: Scene, camera: Camera, stop: threading.Event
    ) -> None:
        """Run a scenario until another one is chosen; in a thread of its own."""
        if stop.wait(DWELL_S):
            return
        from automaton.history.snapshot import take_snapshot
        from automaton.runs.simulation import Simulation

        try:
            simulation = Simulation(resolved, None, on_observe=Simulation.empty_observation)
            while not stop.wait(FRAME_S) and not simulation.finished:
                simulation.run(until=simulation.tick + 1)
                moment = scene.with_(snapshot=take_snapshot(simulation))
                self.call_from_thread(self._draw_moving, moment, camera, stop)
        except (InputError, RuntimeError):  # a strategy fails, or the picker has ended
            return


@lru_cache(maxsize=64)
def resolved_of(name: str) -> Resolved:
    """A scenario by its name, kept. Raises InputError."""
    return resolve(name, [])


def text_of(codes: Codes, look: Look, glyphs: GlyphSet) -> Text:
    """A picture as styled text."""
    text = Text(no_wrap=True)
    for row in codes.tolist():
        for style, several in groupby(row, lambda code: code >> GLYPH_BITS):
            words = "".join(glyphs.characters[code & int(GLYPHS)] for code in several)
            text.append(words, look.rich(style))
        text.append("\n")
    return text
