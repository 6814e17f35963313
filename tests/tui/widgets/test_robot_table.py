"""The table of robots: sorted, wide and narrow, and led by mouse and keys."""

from __future__ import annotations

import re
from dataclasses import fields, replace

import numpy as np
import pytest
from panel_harness import (
    NARROW,
    PanelHarness,
    click,
    deadlocked,
    of_robot,
    run_in_harness,
    said,
    text,
)
from textual.pilot import Pilot

from automaton.engine.observation import CAUSE_REDUCED_SPEED
from automaton.history.snapshot import FleetSnapshot
from tui.playback.panel_view import View
from tui.playback.playback_state import RunFigures
from tui.widgets.robot_table import ROBOT_TABLE_COLUMNS, RobotColumn, Robots, ordered

PLAIN = [
    c for c in ROBOT_TABLE_COLUMNS if c.title not in ("type", "battery", "ahead", "zone", "queue")
]
TITLES = [column.title for column in PLAIN]  # without types, batteries, plans and zones to serve
ALL = 93  # columns for the whole table


def crowd(many: int) -> View:
    """The same moment with so many robots."""
    view = deadlocked()
    five = view.snapshot.robots
    copies = {
        field.name: np.resize(
            getattr(five, field.name), (many, *getattr(five, field.name).shape[1:])
        )
        for field in fields(FleetSnapshot)
    }
    metrics = view.playback.figures[0].metrics
    figures = RunFigures(
        300,
        metrics,
        np.arange(many),
        np.full(many, 0.5),
        np.zeros(0, int),
        None,
        (),
        (),
        {},
        np.zeros(many, int),
    )
    snapshot = replace(view.snapshot, robots=FleetSnapshot(**copies))
    return replace(view, playback=replace(view.playback, snapshots=(snapshot,), figures=(figures,)))


def rows_of(robots: Robots) -> list[list[str]]:
    return [row.split() for row in said(robots)[1:] if row]


def test_all_columns_tell_what_the_snapshot_says() -> None:
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        view = crowd(5)  # of its own: it is changed here
        view.snapshot.robots.lost[2, CAUSE_REDUCED_SPEED] = 7
        robots.show(view)
        await pilot.pause()
        assert [title.strip("▴▾") for title in said(robots)[0].split()] == TITLES
        fleet, figures = view.snapshot.robots, view.playback.figures[0]
        waited = 300 - int(fleet.since[2])
        x, y = view.floor_plan.xy(int(fleet.cell[2]))
        assert rows_of(robots)[2] == [
            *("2", "waiting", str(waited), "head-on", str(fleet.load[2]), str(fleet.order[2])),
            *(f"{x},{y}", "7", f"{100 * figures.active[2]:.0f}", "%", str(figures.operations[2])),
        ]

    run_in_harness(robots, story, ALL, 20)


@pytest.mark.parametrize("column", ROBOT_TABLE_COLUMNS, ids=lambda column: column.title)
def test_each_column_sorts_both_ways(column: RobotColumn) -> None:
    view = deadlocked()
    keys = np.asarray(column.keys(view)).tolist()
    up, down = ordered(view, column, False).tolist(), ordered(view, column, True).tolist()
    assert [keys[robot] for robot in up] == sorted(keys)
    assert [keys[robot] for robot in down] == sorted(keys, reverse=True)
    assert sorted(up) == sorted(down) == [0, 1, 2, 3, 4]


def test_a_click_on_a_title_sorts_and_another_turns_it_round() -> None:
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        robots.show(deadlocked())
        await pilot.pause()
        await click(pilot, robots, "waits ")
        assert "waits▾" in said(robots)[0]
        ticks = [int(row[2]) for row in rows_of(robots) if row[1] == "waiting"]
        assert ticks == sorted(ticks, reverse=True) and len(ticks) == 4
        await click(pilot, robots, "waits")
        assert "waits▴" in said(robots)[0] and rows_of(robots)[0][0] == "0"

    run_in_harness(robots, story, NARROW, 20)


def test_keys_sort_and_show_other_columns() -> None:
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        robots.show(deadlocked())
        robots.focus()
        await pilot.press("c", "c")
        assert "waits▾" in said(robots)[0]
        await pilot.press("V")
        assert "waits▴" in said(robots)[0]
        await pilot.press("C", "C", "C")
        assert robots.column == len(PLAIN) - 1 and "ops▾" in said(robots)[0]
        await pilot.press(*["left"] * 10)
        assert said(robots)[0].split()[1] == "doing"
        await pilot.press("right")
        assert said(robots)[0].split() == ["#", "doing", "1◃cause", "6", "more▹"]

    run_in_harness(robots, story, NARROW, 20)


@pytest.mark.parametrize("width", range(NARROW - 3, 60, 3))
def test_a_narrow_table_says_who_waits_how_long_and_why(width: int) -> None:
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        robots.show(deadlocked())
        await pilot.pause()
        titles = said(robots)[0].split()
        assert titles[:4] == ["#▴", "doing", "waits", "cause"]
        shown = [title for title in titles if title in TITLES]
        hidden = re.search(r"(\d+)( more)?▹$", said(robots)[0])
        assert hidden and int(hidden[1]) == len(TITLES) - 1 - len(shown)
        assert rows_of(robots)[2][3] in ("head-on", "head-on...")
        robots.sort_by(3)
        assert "cause▾" in said(robots)[0] and "▹" in said(robots)[0]
        assert all(len(row) <= robots.width for row in said(robots))

    run_in_harness(robots, story, width, 20)


def test_a_narrow_table_leads_on_by_mouse() -> None:
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        robots.show(deadlocked())
        await pilot.pause()
        assert said(robots)[0].endswith(" 6 more▹") and "cell" not in said(robots)[0]
        for _ in range(6):
            await pilot.click(robots, offset=(robots.width, 0))
        await pilot.pause()
        assert "ops" in said(robots)[0] and said(robots)[0].startswith("#▴ doing  6◃")
        assert "more" not in said(robots)[0] and rows_of(robots)[1][:2] == ["1", "waiting"]
        assert all(len(row) <= robots.width for row in said(robots))

    run_in_harness(robots, story, NARROW, 20)


def test_a_click_or_enter_selects_the_robot() -> None:
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        robots.show(deadlocked())
        await pilot.pause()
        await pilot.click(robots, offset=(5, 4))
        robots.focus()
        await pilot.press("down", "enter")
        assert stage.wishes() == [("robot", 3), ("robot", 4)]

    run_in_harness(robots, story, NARROW, 20)


def test_the_cursor_goes_to_the_robot_that_is_selected_elsewhere_and_stays_with_it() -> None:
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        robots.show(deadlocked())
        robots.show(of_robot(deadlocked(), 3))
        assert robots.cursor == 3
        robots.sort_by(0, greatest_first=True)
        assert robots.cursor == 1 and robots.order[1] == 3

    run_in_harness(robots, story, NARROW, 20)


def test_of_a_thousand_robots_only_those_in_sight_are_written() -> None:
    robots = Robots()
    written: list[int] = []
    row = robots.row
    robots.row = lambda index: written.append(index) or row(index)  # type: ignore[method-assign, func-returns-value]

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        robots.show(crowd(1000))
        await pilot.pause()
        assert len(set(written)) <= 20
        robots.focus()
        await pilot.press("up", *["pagedown"] * 60)
        assert rows_of(robots)[-1][0] == "999" and "999" in text(robots)

    run_in_harness(robots, story, NARROW, 20)
