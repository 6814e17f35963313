"""What the screen shows, row by row, for a drawing of it."""

from __future__ import annotations

import io

from rich.color import Color, blend_rgb
from rich.color_triplet import ColorTriplet
from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from rich.terminal_theme import DEFAULT_TERMINAL_THEME
from textual.app import App

from tui.render.image_export import Run
from tui.render.styles import COLOUR_TEXT, COLOUR_VOID, Look, style

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
