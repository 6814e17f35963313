"""Keys that come in one read take effect in the order in which they were typed."""

from __future__ import annotations

import asyncio

import pytest
from panel_harness import PanelHarness
from textual import events
from textual.pilot import Pilot
from textual.widget import Widget
from textual.widgets import Input, TextArea

from tui.widgets.panel import TypedInput, TypedText

NAMES = {"<": "backspace", "^": "home", ">": "end", "\n": "enter"}


async def typed(widget: Widget, keys: str) -> None:
    """Send keys as a terminal does that has them all at once: none waits for the one before."""
    app = PanelHarness(widget)

    async def story(pilot: Pilot[None]) -> None:
        widget.focus()
        await pilot.pause()
        for key in keys:
            name = NAMES.get(key, key)
            app.post_message(events.Key(name, None if key in NAMES else key))
        await pilot.pause()
        await pilot.pause()

    async with app.run_test() as pilot:
        await story(pilot)


@pytest.mark.parametrize(
    ("keys", "text"),
    [("ab<cd", "acd"), ("ab<<cd<e", "ce"), ("bc^a>d", "abcd")],
)
def test_a_backspace_deletes_what_was_typed_before_it(keys: str, text: str) -> None:
    line, area = TypedInput(), TypedText()
    asyncio.run(typed(line, keys))
    asyncio.run(typed(area, keys))
    assert (line.value, area.text) == (text, text)


def test_enter_takes_the_line_as_it_was_when_it_was_pressed() -> None:
    taken: list[str] = []

    class Line(TypedInput):
        def on_input_submitted(self, event: Input.Submitted) -> None:
            taken.append(event.value)

    asyncio.run(typed(Line(), "ab<c\nd"))
    assert taken == ["ac"]


def test_the_fields_of_textual_still_need_this() -> None:
    """Once they do not, tui.widgets.panel can go."""
    line, area = Input(), TextArea()
    asyncio.run(typed(line, "ab<cd"))
    asyncio.run(typed(area, "ab<cd"))
    assert "acd" not in (line.value, area.text)
