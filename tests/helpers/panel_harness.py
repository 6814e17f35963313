"""Panels and dialogs on a stage: moments of real runs to show, and what a panel shows and asks for."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from functools import cache
from typing import Any

from textual.app import App, ComposeResult
from textual.message import Message
from textual.pilot import Pilot
from textual.widget import Widget

from automaton.engine.state import NIL
from automaton.history.live_run import LiveRun
from automaton.world.resolve import resolve
from tui.playback.panel_view import CellChosen, RobotChosen, TickChosen, View
from tui.playback.player import Player

NARROW, WIDE = 34, 56  # columns of the side


@cache
def moment(
    tick: int,
    scenario: str = "tabletop-1",
    *settings: str,
    layer: str = "",
    against: str = "",
    selected: int = NIL,
) -> View:
    """A run at a tick; `against` is a setting of a second run to compare it with."""
    runs = [LiveRun(resolve(scenario, list(settings)), 1)]
    if against:
        runs.append(LiveRun(resolve(scenario, [*settings, against]), 1))
    player = Player(runs)
    player.show_layer(layer)
    player.select(selected)
    player.seek(tick)
    until = time.monotonic() + 20
    while player.latest().tick < tick or player.latest().figures[0].tick < tick:
        assert time.monotonic() < until
        time.sleep(0.005)
    player.close()
    return View(player.latest(), player.latest().runs, layer=layer)


def busy() -> View:
    """Five robots at work."""
    return moment(600, "tabletop-1", "fleet.robots=5")


def deadlocked() -> View:
    """Robots 1 and 2 are head-on, 3 and 4 queue behind them."""
    return moment(300, "tabletop-1", "fleet.robots=5", "strategy.right_of_way=wait")


def of_robot(view: View, robot: int) -> View:
    """The same moment with a robot selected."""
    return replace(view, robot=robot, cell=NIL)


def of_cell(view: View, x: int, y: int) -> View:
    """The same moment with a cell selected."""
    return replace(view, robot=NIL, cell=view.floor_plan.cell(x, y))


class PanelHarness(App[None]):
    """One widget alone on a screen, and a list of what it asked for."""

    def __init__(self, widget: Widget) -> None:
        super().__init__()
        self.widget = widget
        self.question: list[Message] = []

    def compose(self) -> ComposeResult:
        yield self.widget

    def on_robot_chosen(self, message: RobotChosen) -> None:
        self.question.append(message)

    def on_cell_chosen(self, message: CellChosen) -> None:
        self.question.append(message)

    def on_tick_chosen(self, message: TickChosen) -> None:
        self.question.append(message)

    def wishes(self) -> list[tuple[str, int]]:
        """What was asked for, and forget it."""
        names = {RobotChosen: "robot", CellChosen: "cell", TickChosen: "tick"}
        asked = [(names[type(one)], next(iter(_numbers(one)))) for one in self.question]
        self.question.clear()
        return asked


def _numbers(message: Any) -> list[int]:
    return [getattr(message, name) for name in ("robot", "cell", "tick") if hasattr(message, name)]


Story = Callable[[PanelHarness, Pilot[None]], Awaitable[None]]


def run_in_harness(widget: Widget, story: Story, width: int = NARROW, height: int = 40) -> None:
    """Play a story with a widget on a screen of this size."""

    async def run() -> None:
        stage = PanelHarness(widget)
        async with stage.run_test(size=(width, height)) as pilot:
            await pilot.pause()
            await story(stage, pilot)

    asyncio.run(run())


def said(widget: Widget) -> list[str]:
    """The lines that a widget shows, without blanks at their ends."""
    return [widget.render_line(y).text.strip() for y in range(widget.size.height)]


def text(widget: Widget) -> str:
    """All that a widget shows, as one sentence: how it is broken into lines does not matter."""
    return " ".join(" ".join(said(widget)).split())


def shown(panel: Any, view: View, width: int = NARROW, height: int = 60) -> str:
    """All that a panel says of a moment."""
    texts: list[str] = []

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        panel.show(view)
        await pilot.pause()
        texts.append(text(getattr(panel, "list", panel)))

    run_in_harness(panel, story, width, height)
    return texts[0]


def place_of(widget: Widget, words: str) -> tuple[int, int]:
    """Where a widget shows some words, to be clicked."""
    for y in range(widget.size.height):
        x = widget.render_line(y).text.find(words)
        if x >= 0:
            return x + widget.styles.padding.left + 1, y
    raise AssertionError(f"{words!r} is not shown: {said(widget)}")


async def click(pilot: Pilot[None], widget: Widget, words: str) -> None:
    """Click on some words of a widget."""
    await pilot.click(widget, offset=place_of(widget, words))
    await pilot.pause()
