"""Dialogs: what they find, where they lead, what they refuse, and that they fit the smallest screen."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
import pytest
from panel_harness import deadlocked, said
from textual.app import App
from textual.pilot import Pilot
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from automaton.errors import InputError
from automaton.floor.floor_plan import TURNTABLE
from automaton.history.breakpoints import FIELDS
from automaton.scenario.quantities import Scale, read_clock
from tui.screens.breakpoint_dialog import BreakpointsScreen, StopCondition, StopList
from tui.screens.dialogs import (
    MIN_TERMINAL_COLUMNS,
    MIN_TERMINAL_ROWS,
    BranchScreen,
    GoToScreen,
    SettingField,
    SettingList,
    settings_of,
    tick_of,
)
from tui.screens.find_dialog import FindScreen, Found, MatchList, find


class Stage(App[None]):
    """An empty app under a dialog."""

    result: Any = "open"


Story = Callable[[Stage, Pilot[None]], Awaitable[None]]


def with_dialog(dialog: ModalScreen[Any], story: Story, size: tuple[int, int] = (80, 24)) -> Any:
    """Play a story with a dialog; its result, or "open" if it is open still."""

    async def run() -> Any:
        stage = Stage()

        def closed(result: Any) -> None:
            stage.result = result

        async with stage.run_test(size=size) as pilot:
            stage.push_screen(dialog, closed)
            await pilot.pause()
            await story(stage, pilot)
            await pilot.pause()
            return stage.result

    return asyncio.run(run())


def typed(dialog: ModalScreen[Any], *keys: str) -> Any:
    """The result after these keys."""

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        await pilot.press(*keys)

    return with_dialog(dialog, story)


def complaint(dialog: ModalScreen[Any]) -> str:
    return str(dialog.query_one(".error", Static).content)


DIALOGS: dict[str, Callable[[], ModalScreen[Any]]] = {
    "find": lambda: FindScreen(deadlocked()),
    "go to": lambda: GoToScreen(deadlocked()),
    "breakpoints": lambda: BreakpointsScreen([StopCondition("deadlock")]),
    "branch": lambda: BranchScreen(deadlocked()),
}


@pytest.mark.parametrize(
    "size", [(80, 24), (MIN_TERMINAL_COLUMNS, MIN_TERMINAL_ROWS)], ids=["80x24", "least"]
)
@pytest.mark.parametrize("name", DIALOGS)
def test_every_dialog_fits_and_closes_by_escape(name: str, size: tuple[int, int]) -> None:
    dialog = DIALOGS[name]()

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        for complaint in ("", "a sentence of two lines, as those about settings are " * 2):
            dialog.complain(complaint)
            await pilot.pause()
            for widget in dialog.query("*").exclude(".none").exclude(".spare"):
                assert stage.screen.region.contains_region(widget.region), widget
            assert dialog.query_one("#accept").region.height == 1
            assert stage.focused is not None  # one can type at once
        await pilot.press("escape")

    assert with_dialog(dialog, story, size) in (None, (StopCondition("deadlock"),))


@pytest.mark.parametrize("name", ["find", "go to", "branch"])
def test_every_dialog_is_left_by_mouse(name: str) -> None:
    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        await pilot.click("#cancel")

    assert with_dialog(DIALOGS[name](), story) is None


# Find.


def test_robots_loads_cells_and_kinds_are_found() -> None:
    view = deadlocked()
    assert find("3", view).robots == find(" Robot 3 ", view).robots == (3,)
    assert find("order 10", view).robots == find("load 10", view).robots == (2,)  # it carries it
    orders = view.snapshot.orders
    lying = int(np.flatnonzero((orders.state == 0) & (orders.reserved_by == -1))[0])
    assert find(f"load {lying}", view).cells == (
        int(view.snapshot.slots.cell[orders.current_slot[lying]]),
    )
    assert find("8,4", view).cells == find("(8, 4)", view).cells == (view.floor_plan.cell(8, 4),)
    kinds = view.floor_plan.kind.reshape(-1)
    assert [kinds[cell] for cell in find("turntables", view).cells] == [TURNTABLE] * 12
    assert find("shelves", view).cells == find("shelf", view).cells != ()


def test_conditions_find_robots_in_the_language_of_breakpoints() -> None:
    view = deadlocked()
    fleet = view.snapshot.robots
    assert find("deadlock", view).robots == find("wait cycle", view).robots == (1, 2)
    assert find("cause == 'queue'", view).robots == (3, 4)
    assert find("loaded", view).robots == tuple(np.flatnonzero(fleet.load >= 0).tolist())
    assert find("waiting > 20 and loaded", view).robots == (2, 3)
    assert find("stalled > 1000", view).robots == ()
    assert find("x == 8 and y < 1", view).robots == (2,)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("17", "there is no robot 17; robots are numbered from 0 to 4"),
        ("load 50", "there is no order 50; orders are numbered from 0 to 49"),
        ("99,99", "there is no cell (99, 99); the floor goes from (0, 0) to ("),
        ("waitng > 3", "a robot has no 'waitng' (did you mean 'waiting'?)"),
    ],
)
def test_what_cannot_be_found_is_said_in_a_sentence(words: str, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        find(words, deadlocked())
    assert sentence in str(caught.value)


def test_matches_appear_while_typing_and_the_chosen_one_comes_first() -> None:
    dialog = FindScreen(deadlocked())

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        await pilot.press(*"waiting > 2")
        matches = dialog.query_one(MatchList)
        assert [row.split("  ")[0] for row in said(matches)[:4]] == [
            f"robot {robot}" for robot in (1, 2, 3, 4)
        ]
        assert str(dialog.query_one("#many", Static).content) == "4 robots"
        assert said(matches)[1] == "robot 2  waiting at (8, 0), load 10"
        await pilot.press("down", "down", "enter")

    assert with_dialog(dialog, story) == Found("waiting > 2", robots=(1, 2, 3, 4), first=2)


def test_a_wrong_condition_stays_in_the_dialog() -> None:
    dialog = FindScreen(deadlocked())

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        await pilot.press(*"waitin > 2", "enter")
        assert "did you mean 'waiting'?" in complaint(dialog)
        dialog.query_one(Input).value = "parked"
        await pilot.pause()
        assert complaint(dialog) == ""
        assert str(dialog.query_one("#many", Static).content) == "nothing matches now"
        await pilot.press("enter")

    assert with_dialog(dialog, story) == "open"


def test_a_match_is_taken_by_a_click() -> None:
    dialog = FindScreen(deadlocked(), "loaded")

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        await pilot.click(MatchList, offset=(4, 1))

    found = with_dialog(dialog, story)
    assert isinstance(found, Found) and found.first == 1


# Go to.

HALF_SECONDS = Scale("0.5 s")
FROM_SIX = Scale("0.5 s", clock=read_clock("2026-03-02 06:00"))


@pytest.mark.parametrize(
    ("words", "tick"),
    [
        *(("1200", 1200), ("1,200", 1200), ("+100", 400), ("-50", 250), ("-1000", 0)),
        *(("50%", 2000), ("50 %", 2000), ("30 s", 60), ("+ 5 s", 310), ("7 ticks", 7)),
        *(("+9999", 10_299), ("4001", 4001)),
    ],
)
def test_a_tick_can_be_written_in_many_ways(words: str, tick: int) -> None:
    assert tick_of(words, 300, 900, 4000, HALF_SECONDS) == tick


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("soon", "'soon' is not a tick; expected 1200, +100, -50, 50 %, 15 s"),
        ("120 %", "120 % lies after the end; a run goes from 0 % to 100 %"),
        ("3 cycles", "there is no unit 'cycles' here; time is counted in ticks or s"),
    ],
)
def test_what_is_no_tick_is_refused_in_a_sentence(words: str, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        tick_of(words, 300, 900, 4000, HALF_SECONDS)
    assert str(caught.value) == sentence


def test_where_units_have_a_clock_a_tick_is_a_time_of_the_day() -> None:
    for words, tick in (("06:30", 3600), ("2026-03-03 06:00", 172_800)):
        assert tick_of(words, 300, 900, None, FROM_SIX) == tick
    for words, scale, reason in (
        ("05:59", FROM_SIX, "'05:59' is before tick 0"),
        ("06:30", HALF_SECONDS, "the clock time of tick 0 is unknown"),
        ("soon", FROM_SIX, "50 %, 15 s, 07:00"),
    ):
        with pytest.raises(InputError, match=reason):
            tick_of(words, 300, 900, None, scale)


def test_a_live_run_without_an_end_can_be_sent_ahead() -> None:
    assert tick_of("5000", 300, 900, None, HALF_SECONDS) == 5000
    assert tick_of("50 %", 300, 900, None, HALF_SECONDS) == 450


def test_the_dialog_gives_the_tick_or_says_what_is_wrong() -> None:
    assert typed(GoToScreen(deadlocked()), *"+20", "enter") == 320
    dialog = GoToScreen(deadlocked())

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        await pilot.press(*"soon")
        await pilot.click("#accept")
        assert "'soon' is not a tick" in complaint(dialog)
        await pilot.press(*["backspace"] * 4, *"5 cycles", "enter")

    assert with_dialog(dialog, story) == 5  # tabletop-1 counts in cycles


# Breakpoints.


def test_breakpoints_are_added_and_what_is_wrong_is_said() -> None:
    dialog = BreakpointsScreen([])

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        assert all(
            name in " ".join(str(s.content) for s in dialog.query(Static)) for name in FIELDS
        )
        await pilot.press(*"staled > 3", "enter")
        assert "a robot has no 'staled' (did you mean 'stalled'?)" in complaint(dialog)
        dialog.query_one(Input).value = "stalled  >  50"
        await pilot.press("enter")
        assert said(dialog.query_one(StopList))[0].startswith("✓ stalled > 50")
        await pilot.press(*"delivered 7", "enter", "enter")

    assert with_dialog(dialog, story) == (
        StopCondition("stalled > 50"),
        StopCondition("delivered 7"),
    )


def test_breakpoints_are_switched_and_removed_by_keys() -> None:
    stops = [StopCondition("deadlock"), StopCondition("delivered"), StopCondition("loaded")]
    result = typed(BreakpointsScreen(stops), "tab", "down", "space", "down", "delete", "escape")
    assert result == (StopCondition("deadlock"), StopCondition("delivered", on=False))


def test_breakpoints_are_switched_and_removed_by_mouse() -> None:
    dialog = BreakpointsScreen([StopCondition("deadlock"), StopCondition("delivered")])

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        stops = dialog.query_one(StopList)
        await pilot.click(StopList, offset=(4, 0))
        assert said(stops)[0].startswith("⋅ deadlock")
        await pilot.click(StopList, offset=(stops.width - 2, 1))
        await pilot.click("#accept")

    assert with_dialog(dialog, story) == (StopCondition("deadlock", on=False),)


# Branch.


def test_settings_are_checked_before_the_dialog_closes() -> None:
    dialog = BranchScreen(deadlocked())

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        await pilot.click("#accept")
        assert "write at least one setting" in complaint(dialog)
        field = dialog.query_one(SettingField)
        for setting, sentence in (
            ("fleet.robots=9", "fleet cannot change during a run"),
            ("strategy.right_of_way=wiat", "did you mean 'wait'?"),
            ("durations.move", "durations.move"),
        ):
            field.text = setting
            await pilot.press("ctrl+s")
            assert sentence in complaint(dialog)
        field.text = "strategy.right_of_way=retreat\n\n durations.pick=30 "
        await pilot.press("ctrl+s")

    settings = with_dialog(dialog, story)
    assert settings == ("strategy.right_of_way=retreat", "durations.pick=30")


def test_what_may_change_is_listed_and_a_click_copies_it() -> None:
    dialog = BranchScreen(deadlocked())
    listed = settings_of(deadlocked().run.resolved.scenario)
    assert "strategy.right_of_way=wait" in listed and "world.following=convoy" in listed
    assert not any(setting.startswith(("fleet", "layout", "orders")) for setting in listed)

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        await pilot.click(SettingList, offset=(4, 1))
        field = dialog.query_one(SettingField)
        assert field.text == listed[1] and stage.focused is field
        await pilot.press("enter", *"stop.max_duration=5000", "ctrl+s")

    assert with_dialog(dialog, story) == (listed[1], "stop.max_duration=5000")
