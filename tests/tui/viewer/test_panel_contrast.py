"""Words of panels and dialogs have a contrast of 4.5 (WCAG 2.2) in both themes at every depth.

Measured on the screens themselves, in the colours that are sent: of 256 and of 16 the nearest ones,
as Rich chooses them. Of 16 colours each terminal has its own; these are xterm's.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.color import Color, ColorSystem, ColorType
from rich.style import Style
from viewer_harness import Watched, mini, viewing

from tui.render.styles import DEPTHS, TEXT_CONTRAST, Depth, Look, Theme, contrast, rgb
from tui.terminal.options import Options
from tui.viewer.app import Viewer

SYSTEMS = {
    "16": ColorSystem.STANDARD,
    "256": ColorSystem.EIGHT_BIT,
    "true": ColorSystem.TRUECOLOR,
}
VISITS = {
    "inspector": ["i"],
    "why": ["w"],
    "events": ["e"],
    "robots": ["t"],
    "legend": ["f3", "K"],
    "panels alone": ["p"],
    "help": ["question_mark"],
    "find": ["slash", *"robot"],
    "breakpoints": ["b"],
    "a wrong tick": ["g", "x", "enter"],
    "palette": ["ctrl+p"],
}


def shade(colour: Color, system: ColorSystem) -> int:
    """0xRRGGBB that a terminal shows for a colour."""
    sent = colour.downgrade(system)
    if sent.type == ColorType.TRUECOLOR:
        assert sent.triplet is not None
        return int(sent.triplet.hex[1:], 16)
    assert sent.number is not None
    return rgb(sent.number, Depth.INDEXED)


def words(app: Viewer) -> Iterator[tuple[str, Style]]:
    """What is written on the screen or in its dialog, which lies over what is dimmed.

    Numbers of robots on the map are measured elsewhere.
    """
    on_maps = [view.region for view in app.main_display.maps if view.is_on_screen]
    alone = len(app.screen_stack) == 1
    boxes = [child.region for child in app.screen.children]
    for y, strip in enumerate(app.screen._compositor.render_strips(app.size)):
        x = 0
        for text, style, _ in strip:
            on_map = alone and any(region.contains(x, y) for region in on_maps)
            dimmed = not alone and not any(box.contains(x, y) for box in boxes)
            if style is not None and not on_map and not dimmed and any(map(str.isalnum, text)):
                yield text, style
            x += len(text)


def pale(app: Viewer, system: ColorSystem) -> list[tuple[str, float]]:
    """Words without enough contrast, and the contrast that they have."""
    found = []
    for text, style in words(app):
        fg, bg = style.color, style.bgcolor
        if fg is None or bg is None or fg.is_default or bg.is_default:
            continue  # the terminal's own
        clear = contrast(shade(fg, system), shade(bg, system), Depth.TRUE)
        if clear < TEXT_CONTRAST:
            found.append((text.strip(), round(clear, 2)))
    return found


async def illegible(user: Watched, colours: tuple[str, ...]) -> list[tuple[str, ...]]:
    found = []
    for name, keys in VISITS.items():
        await user.press(*keys)
        for depth in colours:
            user.display.set_look(Look(DEPTHS[depth], user.session.look.theme))
            await user.pilot.pause(0.3)
            for text, clear in pale(user.app, SYSTEMS[depth]):
                found.append((name, depth, text, str(clear)))
        while len(user.app.screen_stack) > 1:
            await user.press("escape")
    return found


@pytest.mark.parametrize("theme", ["dark", "light"])
@pytest.mark.parametrize("colours", [("16",), ("256", "true")], ids=" and ".join)
def test_words_are_legible_wherever_they_stand(
    theme: Theme, colours: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A viewer in 256 colours and one in true colour differ in nothing but the `Look`."""
    monkeypatch.chdir(tmp_path)

    async def story() -> list[tuple[str, ...]]:
        options = Options(paused=True, color=colours[0], theme=theme)
        async with viewing(mini(), (120, 36), options) as user:
            await user.at(320)
            user.session.choose(1)
            assert user.session.look.depth == DEPTHS[colours[0]]
            return await illegible(user, colours)

    assert asyncio.run(story()) == []
