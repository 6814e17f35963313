"""Actions that keep what the screen shows: drawings, pictures and text."""

from __future__ import annotations

import io
import os

from rich.color import Color, blend_rgb
from rich.color_triplet import ColorTriplet
from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from rich.terminal_theme import DEFAULT_TERMINAL_THEME
from textual.app import App

from automaton.atomic_write import replacing
from tui.actions import Command
from tui.playback.run_source import capture_file, short_path
from tui.registration import layer_named
from tui.render.encode import Run, as_text, svg_of
from tui.render.styles import COLOUR_TEXT, COLOUR_VOID, Look, style
from tui.session.display import Display
from tui.session.session import Session

DIMMED = 0.4  # of the way to the background


def screen_rows(app: App[None], look: Look) -> list[list[Run]]:
    """The characters of a running app in their colours; where they have none, those of the map."""
    update = app.screen._compositor.render_update(full=True, screen_stack=app._background_screens)
    console = Console(
        file=io.StringIO(),
        width=app.size.width,
        height=app.size.height,
        force_terminal=True,
        color_system="truecolor",
        legacy_windows=False,
    )
    assert update is not None  # it is a full one
    segments = (segment for segment in console.render(update) if not segment.control)
    plain = look.css(style(COLOUR_TEXT, COLOUR_VOID))
    return [
        [_run(text, shown or Style.null(), plain) for text, shown, _ in row if text]
        for row in Segment.split_lines(segments)
    ]


def _run(text: str, shown: Style, plain: tuple[str, str, bool]) -> Run:
    fg = _rgb(shown.color, plain[0])
    bg = _rgb(shown.bgcolor, plain[1])
    if shown.reverse:
        fg, bg = bg, fg
    if shown.dim:
        fg = blend_rgb(fg, bg, DIMMED)
    return Run(text, fg.hex, bg.hex, bool(shown.bold))


def _rgb(colour: Color | None, plain: str) -> ColorTriplet:
    if colour is None or colour.is_default:
        return Color.parse(plain).get_truecolor()
    return colour.get_truecolor(DEFAULT_TERMINAL_THEME)


# Actions that take the picture with them, as a drawing or as text.


class CaptureActions:
    """Captures."""

    def __init__(self, app: App[None], session: Session, display: Display) -> None:
        self._app, self._session, self._display = app, session, display

    def commands(self) -> dict[str, Command]:
        return {"screenshot": self._take_screenshot, "copy_text": self._copy_text}

    def _take_screenshot(self) -> None:
        rows, look = screen_rows(self._app, self._session.look), self._session.look
        # It has painted everything, and with that forgot what was still to be painted.
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
        """What the letters of zones mean, if they are shown: there is no legend beside a text."""
        session = self._session
        layer, resolved = layer_named(session.choice.layer), session.opening.resolved[side]
        if session.runs:  # after a branch another one
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
        """To the browser."""
        if self._session.options.read_only:
            self._display.notices.say("this viewer is read-only: it hands out no files", "warning")
        else:
            self._app.deliver_text(io.StringIO(text), save_filename=name)
