"""Batteries, faults and stations on the map: each condition has a shape and a colour."""

from __future__ import annotations

import numpy as np
import pytest
from render_scenes import composed, drawn, make_scene, shipped, signs
from render_scenes import text as picture

from automaton.engine.state import BATTERY_FULL
from automaton.floor.floor_plan import STATION
from tui.render.compose import compose
from tui.render.scene import Scene
from tui.render.styles import ASCII, UNICODE, GlyphSet
from tui.widgets.legend_panel import legend
from tui.widgets.status import describe

EMPTY_AT = BATTERY_FULL // 5 - 1  # just below what counts as low


def every_condition() -> Scene:
    """Low, low with a load, charging, empty, broken, towed in its parking bay, and a load on the
    floor."""
    floor_plan = drawn("......\nbctt..")
    robots = [
        {"cell": floor_plan.cell(0, 0), "charge": EMPTY_AT, "travel": 2, "heading": 2},
        {"cell": floor_plan.cell(1, 0), "charge": EMPTY_AT, "load": 1, "heading": 3},
        {"cell": floor_plan.cell(2, 0), "charge": 0, "status": 3, "cause": 17},
        {"cell": floor_plan.cell(3, 0), "status": 4, "cause": 18},
        {"bay": floor_plan.cell(0, 1), "status": 5, "parked": 1},
        {
            **{"cell": floor_plan.cell(1, 1), "goal_cell": floor_plan.cell(1, 1), "charge": 5},
            **{"goal_type": 4, "action": 7},
        },
        {"cell": floor_plan.cell(5, 1), "charge": EMPTY_AT + 1},
    ]
    left = {floor_plan.cell(5, 0): 4, floor_plan.cell(2, 1): 5}
    return make_scene(floor_plan, *robots, left=left, battery=True, faults=True)


@pytest.mark.parametrize(
    ("zoom", "glyphs", "rows"),
    [
        ("1x1", UNICODE, ["≺⍓∅✗.▬", "✗⊞▬⌂.▹"]),
        ("1x1", ASCII, ["!&ZX.*", "XC*t.>"]),
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
    for meaning in ("charging", "battery below 20 %, with a load", "broken down", "had to leave"):
        assert meaning in words
    bare = make_scene(scene.floor.floor_plan, {"cell": 12})
    without = " ".join(entry.meaning for entry in legend(bare, camera.zoom, UNICODE))
    assert "battery" not in without and "broken" not in without and "leave" not in without
    assert "station" in without
    far = " ".join(entry.meaning for entry in legend(scene, composed(scene, "half")[1].zoom, ASCII))
    assert "battery below 20 %" in far and "down" in far and "station" in far


@pytest.mark.parametrize("zoom", ["half", "braille 1"])
def test_stations_are_seen_from_afar(zoom: str) -> None:
    floor_plan = shipped("depots")
    assert (floor_plan.kind == STATION).any()
    codes, camera = composed(make_scene(floor_plan), zoom)
    for cell in np.flatnonzero(floor_plan.kind.reshape(-1) == STATION):
        place = camera.place_of(int(cell))
        assert place is not None and signs(codes)[place] not in " ⠀"


def test_a_line_says_what_is_in_a_cell() -> None:
    scene = every_condition()
    floor_plan = scene.floor.floor_plan
    assert scene.snapshot is not None
    at = [describe(scene, floor_plan.cell(*xy)) for xy in ((5, 0), (2, 1), (0, 1), (0, 0))]
    assert at == [
        "(5, 0) floor, load 4 was left there",
        "(2, 1) station with 0 loads to fetch, 0 brought, load 5 was left there",
        "(0, 1) parking bay, robot 4 at 100 % towed",
        "(0, 0) floor, robot 0 at 20 % idle",
    ]
