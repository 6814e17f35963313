"""Terminals that are too small, or almost: what is said, what still fits, and how it recovers."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest
from viewer_harness import Watched, screen_text, viewing

from tui.screens.dialogs import MIN_TERMINAL_COLUMNS, MIN_TERMINAL_ROWS, size_classes

OVER = {"slash": ("Find", (50, 20)), "ctrl+p": ("play or pause", (80, 12))}  # key: a word, a size


def story(tell: Callable[[Watched], Awaitable[None]], size: tuple[int, int]) -> None:
    async def told() -> None:
        async with viewing(size=size) as user:
            await user.at(100)
            await tell(user)

    asyncio.run(told())


def test_over_a_dialog_the_message_is_seen_and_then_the_dialog_with_its_caret_again() -> None:
    async def tell(user: Watched) -> None:
        for key, (word, small) in OVER.items():
            await user.press(key)
            await user.until(lambda word=word: word in screen_text(user.app), word)
            focused = user.app.screen.focused
            await user.pilot.resize_terminal(*small)
            said = f"automaton needs {MIN_TERMINAL_COLUMNS}x{MIN_TERMINAL_ROWS}, "
            said += f"has {small[0]}x{small[1]}"
            await user.until(lambda said=said: screen_text(user.app).strip() == said, said)
            await user.pilot.resize_terminal(80, 24)
            await user.until(lambda word=word: word in screen_text(user.app), word)
            await user.until(lambda at=focused: user.app.screen.focused is at, key)
            await user.press("escape")
            await user.until(lambda: len(user.app.screen_stack) == 1)

    story(tell, (80, 24))


def test_a_dialog_that_is_opened_or_closed_unseen_leaves_all_in_order() -> None:
    async def tell(user: Watched) -> None:
        await user.press("slash")
        await user.pilot.resize_terminal(40, 10)
        await user.press("escape")
        await user.until(lambda: len(user.app.screen_stack) == 1)
        await user.press("g")
        await user.until(lambda: len(user.app.screen_stack) == 2)
        assert screen_text(user.app).strip().startswith("automaton needs")
        await user.press("escape")
        await user.pilot.resize_terminal(90, 24)
        await user.until(lambda: "tick 100" in screen_text(user.app))
        await user.until(lambda: user.app.screen.focused is user.display.maps[0])

    story(tell, (80, 24))


def test_a_resize_under_a_dialog_reaches_the_screen_behind_it() -> None:
    async def tell(user: Watched) -> None:
        assert not user.app.query_one("#side").display
        await user.press("question_mark")
        await user.pilot.resize_terminal(120, 36)
        await user.press("escape")
        await user.until(lambda: user.app.query_one("#side").display)

    story(tell, (80, 24))


def test_a_resize_just_before_the_end_does_no_harm() -> None:
    async def tell(user: Watched) -> None:
        await user.pilot.resize_terminal(90, 24)
        user.app.leave(0)
        await user.until(lambda: user.app.return_code == 0)

    story(tell, (80, 24))


def test_the_palette_has_its_lower_edge_on_the_smallest_screen() -> None:
    async def tell(user: Watched) -> None:
        await user.press("ctrl+p")
        await user.until(lambda: "play or pause" in screen_text(user.app))
        assert "\u2581" * MIN_TERMINAL_COLUMNS in screen_text(user.app)

    story(tell, (MIN_TERMINAL_COLUMNS, MIN_TERMINAL_ROWS))


def test_the_last_row_names_whole_keys_and_always_help_and_the_way_out() -> None:
    async def tell(user: Watched) -> None:
        for width, words in ((MIN_TERMINAL_COLUMNS, 7), (80, 9), (MIN_TERMINAL_COLUMNS, 7)):
            await user.pilot.resize_terminal(width, MIN_TERMINAL_ROWS)

            def fits(words: int = words) -> bool:
                row = screen_text(user.app).splitlines()[-1].rstrip()
                ends = row.endswith(" ? Help q Quit") and " p Metrics " in row
                return ends and len(row.replace("Lost time", "Lost").split()) == 2 * words

            await user.until(fits, screen_text(user.app))

    story(tell, (MIN_TERMINAL_COLUMNS, MIN_TERMINAL_ROWS))


@pytest.mark.parametrize(
    ("size", "classes"),
    [
        ((59, 99), {"-tight", "-high"}),
        ((60, 15), {"-narrow", "-flat"}),
        ((60, 16), {"-narrow", "-short"}),
        ((100, 24), {"-normal", "-low"}),
        ((160, 30), {"-wide", "-high"}),
    ],
)
def test_every_size_has_a_class_for_its_width_and_one_for_its_height(
    size: tuple[int, int], classes: set[str]
) -> None:
    assert {name for name, is_on in size_classes(*size).items() if is_on} == classes
