"""Batteries, chargers, faults and plans as the panels of the viewer show them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from panel_harness import (
    NARROW,
    WIDE,
    PanelHarness,
    click,
    moment,
    of_cell,
    of_robot,
    run_in_harness,
    said,
    shown,
    text,
)
from textual.pilot import Pilot

from automaton.engine.state import BATTERY_PERCENT, NIL, STATUS_FAILED, STATUS_TOWED
from automaton.history.explanation import explain
from automaton.history.live_run import LiveRun
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.history.state_words import charger_queue, charging_at, sent_to, ticks_to_charge
from automaton.world.resolve import resolve
from tui.playback.panel_view import View
from tui.screens.find_dialog import find
from tui.widgets.inspector import Inspector
from tui.widgets.metrics_panel import Figures
from tui.widgets.panel import ASCII_SIGNS as PLAIN_SIGNS
from tui.widgets.robot_table import Robots
from tui.widgets.why_panel import Why

FAULTS = "faults={failure_probability: 0.0003, tow_after: 60, repair_time: 100}"
CHARGER_CELL = resolve("depots").floor_plan.cell(4, 0)


Found = Callable[[Snapshot], Any]


def living(tick: int) -> View:
    """Four robots in a small depot with one charger."""
    return moment(tick, "depots", "battery.initial_charge=40", FAULTS)


@cache
def first(holds: Found, after: int = 0) -> int:
    """The first tick of that run in which something holds."""
    run = LiveRun(resolve("depots", ["battery.initial_charge=40", FAULTS]), 1)
    for tick in range(after + 1, 5_000):
        run.show(tick, 99)
        if holds(take_snapshot(run.shown)):
            return tick
    raise AssertionError("it never holds")


def is_line_of_two(now: Snapshot) -> bool:
    return len(charger_queue(now, CHARGER_CELL)) == 2 and len(charging_at(now, CHARGER_CELL)) == 1


def is_broken(now: Snapshot) -> bool:
    return bool((now.robots.status == STATUS_FAILED).any())


def is_towed(now: Snapshot) -> bool:
    return bool((now.robots.status == STATUS_TOWED).any())


def is_low_and_loaded(now: Snapshot) -> bool:
    return bool(((now.robots.charge < 20 * BATTERY_PERCENT) & (now.robots.load != NIL)).any())


def is_sent(now: Snapshot) -> bool:
    return bool(sent_to(now, CHARGER_CELL)) and not charging_at(now, CHARGER_CELL)


def is_held(now: Snapshot) -> bool:
    """Somebody queues, and who holds the charger does not charge."""
    line = charger_queue(now, CHARGER_CELL)
    there = now.robots.cell == CHARGER_CELL
    return bool(line and there.any() and not charging_at(now, CHARGER_CELL))


def in_line() -> tuple[View, int, int, int]:
    """A moment in which one robot charges and two queue: who charges, the first, the second."""
    view = living(first(is_line_of_two))
    (holder,) = charging_at(view.snapshot, CHARGER_CELL)
    one, two = charger_queue(view.snapshot, CHARGER_CELL)
    return view, holder, one, two


def in_percent(view: View, name: str, robot: int) -> float:
    return float(getattr(view.snapshot.robots, name)[robot]) / BATTERY_PERCENT


def drained(tick: int) -> View:
    """Nobody charges, nobody tows."""
    settings = ("battery.initial_charge=20", "strategy.charging=none", "faults={tow_after: null}")
    return moment(tick, "depots", *settings, "strategy.allocation=independent")


def selected(view: View, robot: int) -> View:
    """The moment as the player shows it when a robot is selected: with its plan."""
    plan = np.array([7, 3, 11], np.int32)
    snapshot = replace(view.snapshot, selected=robot, order_queue=plan)
    return of_robot(replace(view, playback=replace(view.playback, snapshots=(snapshot,))), robot)


# The inspector.


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_a_robot_in_line_tells_its_battery_its_place_and_its_plan(width: int) -> None:
    view, _, one, two = in_line()
    said_then = shown(Inspector(), selected(view, two), width)
    for words in (
        f"⋅ {in_percent(view, 'charge', two):.1f} %",
        f"charging up to {in_percent(view, 'charge_target', two):.0f} %, place 2 of 2 in the queue",
        "condition running",
        "goal to charge at (4, 0)",
        "ahead order 7, order 3, order 11",
    ):
        assert words in said_then
    assert "place 1 of 2 in the queue" in shown(Inspector(), of_robot(view, one), width)


def test_a_bar_shows_how_full_a_battery_is() -> None:
    view = of_robot(drained(1), 1)
    assert "battery ⣿⣿⣿⋅⋅⋅⋅⋅⋅⋅⋅⋅⋅⋅⋅⋅ 20.0 %" in shown(Inspector(), view)
    assert "battery ###------------- 20.0 %" in shown(Inspector(PLAIN_SIGNS), view)


def test_the_plan_of_a_robot_comes_with_the_snapshot_when_it_is_selected() -> None:
    view = living(first(lambda now: now.robots.order_queue_length.max() > 2))
    robot = int(np.argmax(view.snapshot.robots.order_queue_length))
    many = int(view.snapshot.robots.order_queue_length[robot])
    assert f"ahead {many} orders" in shown(Inspector(), of_robot(view, robot))
    run = LiveRun(resolve("depots", ["battery.initial_charge=40", FAULTS]), 1)
    run.show(view.snapshot.tick, 99)
    i = run.shown.world.robots.at_index[robot]
    order_queue = take_snapshot(run.shown, robot).order_queue.tolist()
    assert order_queue == run.shown.world.robots.order_queue[i, :many].tolist()
    assert len(take_snapshot(run.shown).order_queue) == 0


def test_a_robot_that_charges_says_how_long_and_keeps_its_word() -> None:
    view, holder, _, _ = in_line()
    said_then = shown(Inspector(), of_robot(view, holder), WIDE)
    level = in_percent(view, "charge_target", holder)
    ticks = int(np.ceil(level - in_percent(view, "charge", holder)))  # 1 % in each
    assert f"robot {holder} is charging up to {level:.0f} %, {ticks} tick" in said_then
    assert f"charging up to {level:.0f} %, {ticks} tick" in said_then
    end = view.snapshot.tick + ticks
    levels = [living(tick).snapshot.robots.charge_target[holder] for tick in (end - 1, end)]
    assert levels == [view.snapshot.robots.charge_target[holder], 0]


def test_out_of_order_since_when_and_until_when() -> None:
    tick = first(is_broken)
    view = living(tick + 10)
    (robot,) = np.flatnonzero(view.snapshot.robots.status == STATUS_FAILED)
    told = shown(Inspector(), of_robot(view, robot), WIDE)
    since = f"since tick {tick:,}: robot {robot} has broken down; it is towed in "
    assert since in told
    left = int(told.partition(since)[2].split()[0])
    at = [living(view.snapshot.tick + ticks).snapshot for ticks in (left - 1, left)]
    assert [now.robots.status[robot] for now in at] == [STATUS_FAILED, STATUS_TOWED], "as it said"
    towed = shown(Inspector(), of_robot(living(at[1].tick), robot), WIDE)
    assert f"robot {robot} was towed; it is back in 100 ticks" in towed and "off the floor" in towed
    assert living(at[1].tick + 100).snapshot.robots.status[robot] == 0


def test_an_empty_battery_says_what_it_lacks() -> None:
    empty = shown(Inspector(), of_robot(drained(100), 0), WIDE)
    assert "since tick 61: the battery of robot 0 holds 2.0 %, less than its next" in empty
    assert "operation needs; it is not towed" in empty


def test_a_robot_without_battery_and_faults_says_nothing_of_them() -> None:
    said_then = shown(Inspector(), of_robot(moment(600), 0), WIDE)
    assert "battery" not in said_then and "condition" not in said_then


def test_a_charger_tells_who_charges_who_waits_and_who_comes() -> None:
    view, holder, one, two = in_line()
    said_then = shown(Inspector(), of_cell(view, 4, 0), WIDE)
    assert "cell (4, 0) charger" in said_then
    charge, level = (in_percent(view, name, holder) for name in ("charge", "charge_target"))
    assert f"charging robot {holder} at {charge:.0f} %, up to {level:.0f} %, " in said_then
    queue = said_then.partition("queue ")[2]
    for robot in (one, two):
        charge, level = (in_percent(view, name, robot) for name in ("charge", "charge_target"))
        assert f"robot {robot} at {charge:.0f} %, up to {level:.0f} %" in queue
    assert queue.index(f"robot {one}") < queue.index(f"robot {two}")
    sent = living(first(is_sent))
    coming = shown(Inspector(), of_cell(sent, 4, 0), WIDE)
    assert "charging no robot" in coming and "away" in coming
    assert f"sent here robot {sent_to(sent.snapshot, CHARGER_CELL)[0]}" in coming


def test_an_order_says_from_when_it_is_known_and_how_long_it_takes() -> None:
    view = living(700)
    orders = view.snapshot.orders
    done = int(np.flatnonzero(orders.state == 2)[-1])
    open_ = int(np.flatnonzero(orders.state == 0)[0])
    inspector = Inspector()
    told: list[str] = []

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        inspector.show(view)
        for order in (done, open_, 199):
            inspector.show_order(order)
            await pilot.pause()
            told.append(text(inspector))

    run_in_harness(inspector, story, WIDE, 40)
    lead = orders.delivered[done] - orders.release_tick[done]
    assert (
        f"known from tick {orders.release_tick[done]}" in told[0] and f"lead time {lead}" in told[0]
    )
    assert f"lead time {700 - orders.release_tick[open_]} ticks so far" in told[1]
    assert "order 199 not released" in told[2] and "lead" not in told[2]


# Table, find, metrics, why.


def test_the_table_has_columns_for_batteries_and_plans() -> None:
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        view = in_line()[0]
        robots.show(moment(600))
        await pilot.pause()
        assert "battery" not in said(robots)[0] and "ahead" not in said(robots)[0]
        robots.show(view)
        await pilot.pause()
        await click(pilot, robots, "battery")
        fleet = view.snapshot.robots
        rows = [row.split() for row in said(robots)[1:5]]
        assert [int(row[0]) for row in rows] == np.argsort(fleet.charge, kind="stable").tolist()
        assert f"{fleet.charge.min() / BATTERY_PERCENT:.1f} %" in said(robots)[1]
        await click(pilot, robots, "ahead")
        ahead = np.argsort(-fleet.order_queue_length, kind="stable").tolist()
        assert [int(row.split()[0]) for row in said(robots)[1:5]] == ahead
        assert sum("queueing" in row for row in said(robots)) == 2

    run_in_harness(robots, story, 110, 20)


def test_robots_are_found_by_their_condition() -> None:
    view = living(first(is_broken))
    broken = np.flatnonzero(view.snapshot.robots.status == STATUS_FAILED).tolist()
    assert list(find("broken", view).robots) == broken
    view = living(first(is_low_and_loaded))
    fleet = view.snapshot.robots
    low = np.flatnonzero((fleet.charge < 20 * BATTERY_PERCENT) & (fleet.load != NIL)).tolist()
    assert list(find("battery < 20 and loaded", view).robots) == low
    view, _, one, two = in_line()
    assert list(find("queueing", view).robots) == sorted([one, two])
    assert find("empty", drained(100)).robots == (0, 1, 2)


def test_figures_tell_of_batteries_and_robots_out_of_order() -> None:
    view, out = in_line()[0], living(first(is_broken))
    charge = view.snapshot.robots.charge / BATTERY_PERCENT
    for width in (NARROW, WIDE):
        said_then = shown(Figures(), view, width, 100)
        assert f"mean battery {charge.mean():.0f} %, least {charge.min():.0f} %" in said_then
        assert "at chargers 1, 2 queue" in said_then and "batteries" in said_then
        assert "down 0 robots, 0 towed" in said_then
        assert "down 1 robot, 0 towed" in shown(Figures(), out, width, 100)
    towed = living(first(is_towed))
    assert "down 0 robots, 1 towed" in shown(Figures(), towed, WIDE, 100)
    plain = shown(Figures(), moment(600), WIDE, 100)
    assert "battery" not in plain and "down" not in plain


def test_lost_time_names_charger_empty_and_broken() -> None:
    assert " charger " in shown(Figures(), in_line()[0], WIDE, 100)
    assert " broken down " in shown(Figures(), living(first(is_broken) + 10), WIDE, 100)
    assert " empty battery " in shown(Figures(), drained(100), WIDE, 100)


def test_why_tells_the_line_before_a_charger() -> None:
    view, holder, one, two = in_line()
    line, charges = explain(view.snapshot, view.floor_plan, two).lines
    level = in_percent(view, "charge_target", holder)
    charging = f"robot {holder} is charging at (4, 0) up to {level:.0f} %"
    assert f"robot {two} has been queueing for 1 tick: {charging}" in line
    assert line.endswith(f" to go; robot {one} came before it")
    assert charges.startswith(f"robot {holder} is charging up to {level:.0f} %, ")
    assert f"robot {holder} is charging at (4, 0) up to" in shown(Why(), of_robot(view, two), WIDE)
    held = living(first(is_held)).snapshot
    (there,) = np.flatnonzero(held.robots.cell == CHARGER_CELL)
    waiting = charger_queue(held, CHARGER_CELL)[0]
    assert f"ticks: robot {there} holds (4, 0)" in explain(held, view.floor_plan, waiting).lines[0]


@pytest.mark.parametrize(
    ("charge", "level", "curve", "ticks"),
    [
        (0, 1_000_000, [[0, 10_000]], 100),
        (5, 10_005, [[0, 10_000]], 1),
        (5, 10_006, [[0, 10_000]], 2),
        (0, 1_000_000, [[0, 300_000], [800_000, 10_000]], 3 + 10),
        (850_000, 900_000, [[0, 300_000], [800_000, 10_000]], 5),
        (0, 900_000, [[0, 500_000], [800_000, 0]], 2),
        (0, 900_000, [[0, 400_000], [800_000, 0]], NIL),
        (7, 7, [[0, 1]], 0),
    ],
)
def test_how_long_charging_takes(charge: int, level: int, curve: list, ticks: int) -> None:
    assert ticks_to_charge(charge, level, np.array(curve)) == ticks
