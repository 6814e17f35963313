"""What the inspector says of a robot, a cell and an order, and where its links lead."""

from __future__ import annotations

import numpy as np
import pytest
from panel_harness import (
    NARROW,
    WIDE,
    PanelHarness,
    busy,
    click,
    deadlocked,
    moment,
    of_cell,
    of_robot,
    run_in_harness,
    said,
    shown,
    text,
)
from textual.pilot import Pilot

from automaton.drawings.looks import directions
from automaton.engine.state import GOAL_DROP, NIL
from automaton.floor.floor_plan import DIRECTIONS
from tui.widgets.inspector import Inspector


def test_nothing_selected_says_how_to_select() -> None:
    said_then = shown(Inspector(), busy())
    assert "nothing is selected" in said_then and "/ finds robots" in said_then


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_a_robot_is_told_with_all_that_it_does(width: int) -> None:
    said_then = shown(Inspector(), of_robot(busy(), 1), width)
    for words in (
        "robot 1 is picking up load 6 for 1 more tick",
        "cell (2, 7) track",
        "heading north, on rails north-south",
        "load load 6, destination (11, 8)",
        "order order 6",
        "goal to drop at (5, 7) on the way; it is picked up again there",
        "route 0 cells to (4, 7)",
        "priority 0",
        "home (0, 1), at its parking bay (-1, 1)",
        "active 100 %",
        "last events 593 picks up load 6 536 takes order 6 527 drops load 5",
    ):
        assert words in said_then


def test_a_goal_says_whether_it_is_the_destination_and_a_heading_what_the_map_shows() -> None:
    ways = set()
    for view in (busy(), moment(560, "tabletop-1", "fleet.robots=5")):
        robots, orders = view.snapshot.robots, view.snapshot.orders
        fronts = directions(robots, [2])
        for robot in range(5):
            said_then = shown(Inspector(), of_robot(view, robot), WIDE)
            assert f"heading {DIRECTIONS[fronts[robot]]}, on rails " in said_then
            if robots.goal_type[robot] == GOAL_DROP:
                is_last = robots.slot[robot] == orders.target[robots.load[robot]]
                assert ("on the way; it is picked up again" in said_then) != is_last
                ways.add(bool(is_last))
    assert ways == {False, True}


def test_a_waiting_robot_names_cell_and_blocker() -> None:
    said_then = shown(Inspector(), of_robot(deadlocked(), 1))
    assert "head-on, in a wait cycle" in said_then
    assert "waits for (8, 0) held by robot 2" in said_then


def test_no_more_than_five_events_the_newest_first() -> None:
    said_then = shown(Inspector(), of_robot(busy(), 0), WIDE).partition("last events ")[2]
    events = busy().run.event_history.events
    ticks = events[events[:, 2] == 0, 0][::-1][:5]
    assert [int(word) for word in said_then.split() if word in map(str, ticks)] == ticks.tolist()


def test_a_turntable_tells_exits_room_and_who_wants_it() -> None:
    said_then = shown(Inspector(), of_cell(deadlocked(), 8, 0))
    assert "cell (8, 0) turntable" in said_then and "where rail robots turn" in said_then
    assert "exits east, south, west" in said_then and "room for 1 robot" in said_then
    assert "here robot 2" in said_then and "wanted by robot 1, robot 4" in said_then


def test_exits_into_storage_are_told_apart_since_only_robots_with_a_pod_take_them() -> None:
    said_then = shown(Inspector(), of_cell(moment(0, "goods-60x40"), 20, 5))
    assert "exits north; east, south, west into storage" in said_then


def test_a_shelf_tells_its_load_its_goal_and_who_fetches_it() -> None:
    view = busy()
    orders, slots = view.snapshot.orders, view.snapshot.slots
    held = np.flatnonzero((orders.reserved_by != NIL) & (orders.state == 0))[0]
    x, y = view.floor_plan.xy(slots.cell[orders.current_slot[held]])
    said_then = shown(Inspector(), of_cell(view, x, y))
    assert (
        f"holds load {held}" in said_then
        and f"fetched by robot {orders.reserved_by[held]}" in said_then
    )


def test_a_destination_counts_its_deliveries() -> None:
    view = busy()
    orders, slots = view.snapshot.orders, view.snapshot.slots
    slot = orders.target[np.flatnonzero(orders.state == 2)[0]]
    many = np.count_nonzero((orders.target == slot) & (orders.state == 2))
    said_then = shown(Inspector(), of_cell(view, *view.floor_plan.xy(slots.cell[slot])))
    assert f"received {many} load" in said_then and "the last load" in said_then


def test_a_bay_and_the_counts_of_a_layer() -> None:
    view = moment(600, "tabletop-1", "fleet.robots=5", layer="visits")
    assert "opens on (0, 1)" in shown(Inspector(), of_cell(view, -1, 1))
    assert view.snapshot.heat is not None
    visits = view.snapshot.heat[view.floor_plan.cell(0, 0)]
    assert f"visits {visits} visits" in shown(Inspector(), of_cell(view, 0, 0))


def test_links_lead_from_robot_to_order_and_on_to_its_cell() -> None:
    inspector = Inspector()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        inspector.show(of_robot(busy(), 1))
        await click(pilot, inspector, "order 6")
        for words in ("order 6 carried", "to (11, 8)", "carried by robot 1", "picked up 1 time"):
            assert words in text(inspector)
        await click(pilot, inspector, "known")
        assert stage.wishes() == []  # a name leads nowhere
        await click(pilot, inspector, "(11, 8)")
        assert stage.wishes() == [("cell", busy().floor_plan.cell(11, 8))]

    run_in_harness(inspector, story)


def test_the_keyboard_follows_links() -> None:
    inspector = Inspector()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        inspector.show(of_robot(deadlocked(), 1))
        inspector.focus()
        await pilot.press("enter", "down", "enter")
        assert stage.wishes() == [("cell", deadlocked().floor_plan.cell(8, 0)), ("robot", 2)]

    run_in_harness(inspector, story)


def test_another_choice_ends_the_look_at_an_order() -> None:
    inspector = Inspector()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        inspector.show(of_robot(busy(), 1))
        inspector.show_order(6)
        inspector.show(of_robot(busy(), 2))
        await pilot.pause()
        assert said(inspector)[0].startswith("robot 2")

    run_in_harness(inspector, story)
