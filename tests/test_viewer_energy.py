"""Batteries, chargers, faults and plans as the viewer shows them: on the map and in the panels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from panel_stage import (
    NARROW,
    WIDE,
    Stage,
    click,
    moment,
    of_cell,
    of_robot,
    on_stage,
    said,
    shown,
    text,
)
from staged_scenes import composed, drawn, shipped, signs, stage
from staged_scenes import text as picture
from textual.pilot import Pilot

from automaton.history.charging import ticks_to_charge
from automaton.history.explanation import explain
from automaton.world.cells import STATION
from automaton.world.state import NIL
from automaton.world.waiting import CAUSES
from tui.render.compose import compose
from tui.render.describe import describe
from tui.render.glyphs import ASCII, UNICODE, GlyphSet
from tui.render.legend import legend
from tui.render.scene import Scene
from tui.search import find
from tui.view import View
from tui.widgets.figures import Figures
from tui.widgets.inspector import Inspector
from tui.widgets.lost import LETTERS
from tui.widgets.robots import Robots
from tui.widgets.why import Why

FAULTS = "faults={rate: 0.0003, tow_after: 60, repair: 100}"
EMPTY_AT = 200_000 - 1  # just below what counts as low


def living(tick: int) -> View:
    """Four robots in a small depot with one charger."""
    return moment(tick, "depots", "battery.start=40", FAULTS)


def drained(tick: int) -> View:
    """Nobody charges, nobody tows."""
    settings = ("battery.start=20", "strategy.charging=none", "faults={tow_after: null}")
    return moment(tick, "depots", *settings, "strategy.allocation=independent")


def selected(view: View, robot: int) -> View:
    """The moment as the player shows it when a robot is selected: with its plan."""
    plan = np.array([7, 3, 11], np.int32)
    snapshot = replace(view.snapshot, selected=robot, plan=plan)
    return of_robot(replace(view, shot=replace(view.shot, snapshots=(snapshot,))), robot)


# The map.


def every_condition() -> Scene:
    """Low, low with a load, charging, empty, broken, towed in its bay, and a load on the floor."""
    plan = drawn("......\nbctt..")
    robots = [
        {"cell": plan.cell(0, 0), "charge": EMPTY_AT, "travel": 2, "heading": 2},
        {"cell": plan.cell(1, 0), "charge": EMPTY_AT, "load": 1, "heading": 3},
        {"cell": plan.cell(2, 0), "charge": 0, "status": 3, "cause": 17},
        {"cell": plan.cell(3, 0), "status": 4, "cause": 18},
        {"bay": plan.cell(0, 1), "status": 5, "parked": 1},
        {
            **{"cell": plan.cell(1, 1), "stand": plan.cell(1, 1), "charge": 5},
            **{"goal": 4, "action": 7},
        },
        {"cell": plan.cell(5, 1), "charge": EMPTY_AT + 1},
    ]
    left = {plan.cell(5, 0): 4, plan.cell(2, 1): 5}
    return stage(plan, *robots, left=left, battery=True, faults=True)


@pytest.mark.parametrize(
    ("zoom", "glyphs", "rows"),
    [
        ("1x1", UNICODE, ["≺⍓∅✗.▬", "✗⊞▬⌂.▹"]),
        ("1x1", ASCII, ["!&EX.*", "XC*t.>"]),
        ("2x1", UNICODE, ["≺ ⍓▪∅ ✗ . ▬", "✗ ⊞ ▬ ⌂ . ▹"]),
        ("3x1", UNICODE, ["≺0 ⍓1 ∅2 ✗3 .  ▬", "✗4 ⊞5 ▬  ⌂  .  ▹6"]),
    ],
)
def test_each_condition_has_a_shape(zoom: str, glyphs: GlyphSet, rows: list[str]) -> None:
    scene = every_condition()
    _, camera = composed(scene, zoom)
    assert picture(compose(scene, camera, glyphs), glyphs).split("\n") == rows


def test_the_legend_explains_them_where_they_can_occur() -> None:
    scene = every_condition()
    codes, camera = composed(scene, "1x1")
    entries = legend(scene, camera.zoom, UNICODE)
    told = {sign: entry.meaning for entry in entries for sign in entry.signs}
    for code in codes.reshape(-1):
        if signs(np.array([code]))[0] not in " ✗":
            assert int(code) in told
    words = " ".join(told.values())
    for meaning in ("charges", "battery below 20 %, with a load", "broken down", "had to leave"):
        assert meaning in words
    bare = stage(scene.floor.plan, {"cell": 12})
    without = " ".join(entry.meaning for entry in legend(bare, camera.zoom, UNICODE))
    assert "battery" not in without and "broken" not in without and "leave" not in without
    assert "station" in without
    far = " ".join(entry.meaning for entry in legend(scene, composed(scene, "half")[1].zoom, ASCII))
    assert "battery below 20 %" in far and "out of order" in far and "station" in far


@pytest.mark.parametrize("zoom", ["half", "braille 1"])
def test_stations_are_seen_from_afar(zoom: str) -> None:
    plan = shipped("depots")
    assert (plan.kind == STATION).any()
    codes, camera = composed(stage(plan), zoom)
    for cell in np.flatnonzero(plan.kind.reshape(-1) == STATION):
        place = camera.place_of(int(cell))
        assert place is not None and signs(codes)[place] not in " ⠀"


def test_a_line_says_what_is_in_a_cell() -> None:
    scene = every_condition()
    plan = scene.floor.plan
    assert scene.snapshot is not None
    at = [describe(scene, plan.cell(*xy)) for xy in ((5, 0), (2, 1), (0, 1), (0, 0))]
    assert at == [
        "(5, 0) floor, load 4 was left there",
        "(2, 1) station with 0 loads to fetch, 0 brought, load 5 was left there",
        "(0, 1) bay, robot 4 at 100 % towed",
        "(0, 0) floor, robot 0 at 20 %",
    ]


# The inspector.


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_a_robot_in_line_tells_its_battery_its_place_and_its_plan(width: int) -> None:
    view = living(100)
    first, second = np.flatnonzero(view.snapshot.robots.ticket).tolist()
    level = view.snapshot.robots.level[second] / 10_000
    said_then = shown(Inspector(), selected(view, second), width)
    for words in (
        f"battery ⣿⣿⣿⣿⋅⋅⋅⋅⋅⋅⋅⋅⋅⋅⋅⋅ {view.snapshot.robots.charge[second] / 10_000:.1f} %",
        f"charging up to {level:.0f} %, place 2 of 2 in line",
        "condition in order",
        "goal to charge at (4, 0)",
        "ahead order 7, order 3, order 11",
    ):
        assert words in said_then
    assert "place 1 of 2 in line" in shown(Inspector(), of_robot(view, first), width)


def test_a_plan_of_a_robot_that_is_just_selected_is_a_number() -> None:
    view = living(100)
    robot = int(np.argmax(view.snapshot.robots.planned))
    many = int(view.snapshot.robots.planned[robot])
    assert many > 1 and f"ahead {many} orders" in shown(Inspector(), of_robot(view, robot))


def test_a_robot_that_charges_says_how_long() -> None:
    said_then = shown(Inspector(), of_robot(living(100), 3), WIDE)
    assert "robot 3 charges up to 96 %, 21 ticks to go" in said_then
    assert "charging up to 96 %, 21 ticks to go condition" in said_then


def test_out_of_order_since_when_and_until_when() -> None:
    broken = shown(Inspector(), of_robot(living(650), 0), WIDE)
    assert "since tick 617: robot 0 has broken down; it is towed in 27 ticks" in broken
    assert living(676).snapshot.robots.status[0] == 4
    assert living(677).snapshot.robots.status[0] == 5, "as it said"
    towed = shown(Inspector(), of_robot(living(700), 0), WIDE)
    assert "robot 0 was towed; it is back in 77 ticks" in towed and "off the floor" in towed
    empty = shown(Inspector(), of_robot(drained(100), 0), WIDE)
    assert "since tick 61: the battery of robot 0 holds 2.0 %, less than its next" in empty
    assert "operation takes; nobody tows it" in empty


def test_a_robot_without_battery_and_faults_says_nothing_of_them() -> None:
    said_then = shown(Inspector(), of_robot(moment(600), 0), WIDE)
    assert "battery" not in said_then and "condition" not in said_then


def test_a_charger_tells_who_charges_who_waits_and_who_comes() -> None:
    view = living(100)
    fleet = view.snapshot.robots
    said_then = shown(Inspector(), of_cell(view, 4, 0), WIDE)
    assert "cell (4, 0) charger" in said_then
    assert "charges robot 3 at 75 %, up to 96 %, 21 ticks to go" in said_then
    first, second = np.flatnonzero(fleet.ticket)[np.argsort(fleet.ticket[fleet.ticket != 0])]
    assert f"in line robot {first} at" in said_then
    assert said_then.index(f"robot {first} at 25") < said_then.index(f"robot {second} at 25")
    sent = moment(20, "depots", "battery.start=40", FAULTS)
    assert (sent.snapshot.robots.goal == 4).any(), "somebody is on the way"
    coming = shown(Inspector(), of_cell(sent, 4, 0), WIDE)
    assert "charges nobody" in coming and "sent here robot" in coming and "away" in coming


def test_an_order_says_from_when_it_is_known_and_how_long_it_takes() -> None:
    view = living(700)
    orders = view.snapshot.orders
    done = int(np.flatnonzero(orders.state == 2)[-1])
    open_ = int(np.flatnonzero(orders.state == 0)[0])
    inspector = Inspector()
    told: list[str] = []

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        inspector.show(view)
        for order in (done, open_, 199):
            inspector.tell_order(order)
            await pilot.pause()
            told.append(text(inspector))

    on_stage(inspector, story, WIDE, 40)
    lead = orders.delivered[done] - orders.released[done]
    assert f"known from tick {orders.released[done]}" in told[0] and f"lead time {lead}" in told[0]
    assert f"lead time {700 - orders.released[open_]} ticks so far" in told[1]
    assert "order 199 will come; no strategy knows it yet" in told[2] and "lead" not in told[2]


# Table, find, figures, why.


def test_the_table_has_columns_for_batteries_and_plans() -> None:
    robots = Robots()

    async def story(stage: Stage, pilot: Pilot[None]) -> None:
        view = living(100)
        robots.show(moment(600))
        await pilot.pause()
        assert "battery" not in said(robots)[0] and "ahead" not in said(robots)[0]
        robots.show(view)
        await pilot.pause()
        await click(pilot, robots, "battery")
        fleet = view.snapshot.robots
        rows = [row.split() for row in said(robots)[1:5]]
        assert [int(row[0]) for row in rows] == np.argsort(fleet.charge, kind="stable").tolist()
        assert f"{fleet.charge.min() / 10_000:.1f} %" in said(robots)[1]
        await click(pilot, robots, "ahead")
        assert [int(row.split()[0]) for row in said(robots)[1:5]] == [0, 3, 1, 2]
        assert sum("in line" in row for row in said(robots)) == 2

    on_stage(robots, story, 110, 20)


def test_robots_are_found_by_their_condition() -> None:
    assert find("broken", living(650)).robots == (0,)
    view = living(420)
    assert find("battery < 20 and loaded", view).robots == (3,)
    fleet = view.snapshot.robots
    assert fleet.charge[3] < 200_000 and fleet.load[3] != NIL
    assert find("in line", living(100)).robots == (0, 1)
    assert find("empty", drained(100)).robots == (0, 1, 2)


def test_figures_tell_of_batteries_and_robots_out_of_order() -> None:
    view = living(650)
    charge = view.snapshot.robots.charge / 10_000
    for width in (NARROW, WIDE):
        said_then = shown(Figures(), view, width, 100)
        assert f"mean battery {charge.mean():.0f} %, least {charge.min():.0f} %" in said_then
        assert "at chargers 1, 0 in line" in said_then and "batteries" in said_then
        assert "out of order 1 robot, 0 towed" in said_then
    plain = shown(Figures(), moment(600), WIDE, 100)
    assert "battery" not in plain and "out of order" not in plain


def test_lost_time_names_charger_empty_and_broken() -> None:
    assert "P charger" in shown(Figures(), living(100), WIDE, 100)
    assert "b broken down" in shown(Figures(), living(650), WIDE, 100)
    assert "e empty battery" in shown(Figures(), drained(100), WIDE, 100)
    assert len(LETTERS) == len(set(LETTERS)) == len(CAUSES)
    pairs = list(zip(LETTERS, CAUSES, strict=True))[1:]
    assert all(letter.isupper() == cause.blocked for letter, cause in pairs)


def test_why_tells_the_line_before_a_charger() -> None:
    view = living(100)
    assert explain(view.snapshot, view.plan, 1).lines == [
        "robot 1 has waited 10 ticks: robot 1 stands in line: robot 3 charges at (4, 0) "
        "up to 96 %, 21 ticks to go; robot 0 came before it",
        "robot 3 charges up to 96 %, 21 ticks to go",
    ]
    assert living(121).snapshot.robots.level[3] == 0 != living(120).snapshot.robots.level[3]
    assert "robot 3 charges at (4, 0) up to 96 %" in shown(Why(), of_robot(view, 1), WIDE)
    held = living(1350)
    assert explain(held.snapshot, held.plan, 1).lines[0].endswith("in line: robot 2 holds (4, 0)")


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
