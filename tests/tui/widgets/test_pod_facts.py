"""Pods, trips and stations as the panels of the viewer tell of them."""

from __future__ import annotations

import pytest
from panel_harness import WIDE, moment, of_cell, of_robot, shown

from automaton.errors import InputError
from automaton.history.fleet_summary import summarize
from tui.playback.panel_view import View
from tui.render.scene import Scene, floor_of
from tui.screens.find_dialog import find
from tui.widgets.event_list import Events
from tui.widgets.inspector import Inspector
from tui.widgets.metrics_panel import Figures
from tui.widgets.status import describe


def goods(tick: int) -> View:
    return moment(tick, "goods-mini")


def test_a_storage_cell_tells_of_its_pod() -> None:
    empty = shown(Inspector(), of_cell(goods(30), 2, 1), WIDE)
    assert "pod none" in empty and "stood here pod 1" in empty
    full = shown(Inspector(), of_cell(goods(30), 4, 1), WIDE)
    assert "pod 3" in full and "trip none" in full


def test_lines_that_wait_for_the_next_trip_are_counted() -> None:
    """Line 3 is known in tick 60 and pod 1 is stored in tick 70."""
    told = shown(Inspector(), of_cell(goods(70), 2, 1), WIDE)
    assert "pod 1" in told and "waiting 1 line for the trip after it" in told


def test_a_station_tells_whom_it_serves() -> None:
    told = shown(Inspector(), of_cell(goods(30), 5, 3), WIDE)
    for words in (
        "station P1",
        "serves robot 1 is served there for 7 more ticks: 1 line",
        "queue robot 0",
        "places 2 of 5 taken",
        "open lines 2",
        "so far served 43 %, starved 40 % of the time",
    ):
        assert words in told, told
    assert "parts" not in told
    assert "queue of P1" in shown(Inspector(), of_cell(goods(30), 7, 3), WIDE)


def test_a_robot_tells_of_its_trip() -> None:
    told = shown(Inspector(), of_robot(goods(30), 0), WIDE)
    for words in (
        "load pod 1",
        "trip trip 0 of pod 1",
        "stops P1 (1 line)",
        "station P1, 1 of 1 in the queue",
        "goal to station P1",
        "picks up the pod of trip 0",
    ):
        assert words in told, told
    assert "due tick 90" in shown(Inspector(), of_robot(goods(30), 1), WIDE)


def test_a_trip_has_its_stops() -> None:
    panel = Inspector()
    panel.show_order(1)
    view = of_robot(goods(60), 1)
    panel._chosen = (view.robot, view.cell, view.zone)
    told = shown(panel, view, WIDE)
    assert "trip 1 done" in told
    assert "stops P1: 1 line, done in tick 37" in told


def test_orders_and_lines_are_counted_not_trips() -> None:
    now = summarize(goods(75).snapshot)
    assert (now.delivered, now.orders, now.lines_done, now.lines) == (2, 3, 2, 3)
    assert "lines done 2 of 3, 2 trips" in shown(Figures(), goods(75), WIDE)


def test_what_is_typed_finds_pods_and_stations() -> None:
    view, plan = goods(30), goods(30).floor_plan
    assert find("pod 3", view).cells == (plan.cell(4, 1),)
    assert find("pod 1", view).robots == (0,), "it is on its way"
    assert find("trip 1", view).robots == (1,)
    assert find("station p1", view).cells == find("P1", view).cells == (plan.cell(5, 3),)
    for text, reason in (("pod 9", "from 1 to 4"), ("station x", "stations are P1")):
        with pytest.raises(InputError, match=reason):
            find(text, view)


def test_the_line_about_a_cell() -> None:
    view = goods(30)
    scene = Scene(floor_of(view.run.resolved), view.snapshot)

    def words(x: int, y: int) -> str:
        return describe(scene, view.floor_plan.cell(x, y))

    assert words(4, 1).startswith("(4, 1) storage with pod 3, ")
    assert words(2, 1).startswith("(2, 1) storage, empty, ")
    assert words(5, 3).startswith("(5, 3) station P1 with 2 open lines, 1 in its queue")
    assert "one-way floor east" in words(3, 0), "though robots turn off into storage"


def test_events_are_those_of_trips() -> None:
    told = shown(Events(), goods(75), WIDE)
    assert "stores the pod of trip 0" in told and "was served for trip 1" in told
    assert "order" not in told.partition("events")[2]
