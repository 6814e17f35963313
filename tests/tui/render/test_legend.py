"""The legend explains what is drawn, and a line says what a cell holds."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from render_scenes import (
    body,
    camera_at,
    composed,
    crossing,
    drawn,
    make_scene,
    mini,
    open_floor,
    shipped,
    signs,
)

from automaton.drawings.looks import LOW_CHARGE
from automaton.engine.observation import CAUSE_NO_ORDER, CAUSE_QUEUE
from automaton.floor.floor_plan import SHELF
from automaton.floor.traffic_zones import traffic_zones_of
from tui.render import drawn_robots
from tui.render.camera import Zoom, zoom_ladder
from tui.render.cell_looks import cell_codes, look
from tui.render.scene import DETAIL_FULL_SHELF
from tui.render.styles import GLYPHS, UNICODE
from tui.widgets.legend_panel import floor_legend, legend, worst_cells
from tui.widgets.status import describe, legend_words


@pytest.mark.parametrize("zoom", ["1x1", "braille 1"])
def test_the_legend_explains_every_sign_of_the_picture(zoom: str):
    for scene in (crossing(), mini()):
        codes, camera = composed(scene, zoom)
        explained = {
            (body(sign), sign & 0xFFFF if zoom == "1x1" else 0)
            for entry in legend(scene, camera.zoom, UNICODE)
            for sign in entry.signs
        }
        shown = {
            (body(code), int(code) & 0xFFFF if zoom == "1x1" else 0)
            for code in codes.reshape(-1)
            if signs(np.array([code]))[0] not in " ⠀"
        }
        assert shown <= explained


STATES = {  # words of the legend near and far, and fields of a robot in that state
    ("robot, and the way it faces", "without a load"): {},
    ("robot with a load", "with a load"): {"load": 1},
    ("waiting", "waiting"): {"cause": CAUSE_QUEUE},
    ("in a wait cycle", "in a wait cycle"): {"cause": CAUSE_QUEUE, "wait_cycle_ticks": 9},
    ("idle", "idle"): {"cause": CAUSE_NO_ORDER},
    ("parked", "parked"): {"parked": 1},
    ("battery below 20 %", "battery below 20 %"): {"charge": LOW_CHARGE // 2},
}
LADDER = zoom_ladder((200, 200), (1, 1), 1)[:13]


@pytest.mark.parametrize("robots", [1, 50, 400])  # on the floor or off it: they set the far marks
@pytest.mark.parametrize("step", LADDER, ids=lambda step: step.name)
def test_a_robot_in_the_legend_is_drawn_as_on_the_map(
    step: Zoom, robots: int, monkeypatch: pytest.MonkeyPatch
):
    blanks = np.zeros((robots, step.width), np.uint32)
    monkeypatch.setattr(drawn_robots, "number_glyphs", lambda *_: blanks[:, 1:])
    monkeypatch.setattr(drawn_robots, "draw_numbers", lambda *_: None)
    floor_plan = open_floor(40, 40)
    for layer, (words, fields) in product(("", "visits"), STATES.items()):
        there = {"cell": floor_plan.cell(0, 0), **fields}
        heat = np.zeros(floor_plan.kind.size, np.int32)
        more = {"battery": True, "heat": heat, "layer": layer}
        scene = make_scene(floor_plan, there, *[{}] * (robots - 1), **more)
        codes, _ = composed(scene, step.name)
        near = step.kind == "cells"
        shown = codes[: -(-step.height // step.down), : step.width if near else 1]
        entries = legend(scene, step, UNICODE)
        same = [one for one in entries if one.meaning.startswith(words[not near])]
        if same or not layer:  # on heat, small zooms do not tell the states
            rows = same[0].rows
            assert (
                (shown[0, 0] in rows[0] and len(rows) == 1)
                if step.width == 1
                else shown.tolist() == [*map(list, rows)]
            )


@pytest.mark.parametrize("step", LADDER, ids=lambda step: step.name)
def test_a_cell_in_the_legend_is_drawn_as_on_the_map(step: Zoom):
    scene = make_scene(drawn("\n".join(["c" * 14 + "."] * 28)))
    codes, _ = composed(scene, step.name)
    rows = next(one.rows for one in legend(scene, step, UNICODE) if one.meaning == "charger")
    high, wide = (len(rows), step.width) if step.kind == "cells" else (1, 1)
    assert codes[:high, :wide].tolist() == [list(row) for row in rows]


@pytest.mark.parametrize("size", [(3, 2), (4, 2), (6, 2), (6, 3), (8, 4)])
def test_a_shelf_with_a_load_differs_from_an_empty_one_in_shape(size: tuple[int, int]):
    codes = cell_codes(UNICODE, *size)[[look(SHELF), look(SHELF, DETAIL_FULL_SHELF)]]
    assert (codes[0] & GLYPHS != codes[1] & GLYPHS).any()


def test_a_line_shows_a_row_of_drawn_cells_and_what_is_least_known_first():
    floor_plan = drawn("s..\n#.d\n...")
    floor = replace(make_scene(floor_plan).floor, place_names={floor_plan.cell(1, 0): "door 1"})
    steps = {step.name: step for step in LADDER}
    texts = {}
    for zoom in ("8x4", "1x1", "braille 1"):
        words = legend_words(floor_legend(floor, steps[zoom], UNICODE, False), 0)
        texts[zoom] = [word.text for word in words]
    assert texts["8x4"][:3] == [
        *("⢰⊟⠒⡆ door that is shut", "⋂ door that is open", "⢰⠒⠒⡆ empty shelf")
    ]
    assert texts["1x1"][:3] == ["⊟ door that is shut", "⋂ door that is open", "▯ empty shelf"]
    assert {"wall", "floor"} == {text.split()[-1] for text in texts["8x4"][-2:]}
    assert "⣿ shelf" in texts["braille 1"]


def test_the_legend_of_a_map_in_pixels_has_the_letters_of_pictures() -> None:
    floor_plan = drawn("s..\n#.d\n...")
    floor = make_scene(floor_plan).floor
    steps = {step.name: step for step in LADDER}
    found = {
        zoom: {
            word.text for word in legend_words(floor_legend(floor, steps[zoom], UNICODE, True), 0)
        }
        for zoom in ("8x4", "1x1")
    }
    assert {"d destination", "█ empty shelf"} <= found["8x4"]
    assert {"⊔ destination", "▯ empty shelf"} <= found["1x1"]  # cells too small for letters


@pytest.mark.parametrize("name", ["8x4", "3x1.5", "3x1", "braille 1.5"])
def test_in_a_low_panel_each_entry_takes_one_row_and_none_is_missing(name: str):
    (step,) = (step for step in LADDER if step.name == name)
    floor_plan = drawn("s..\n#.d\n...")
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(1, 0)}, battery=True)
    high, low = (legend(scene, step, UNICODE, low) for low in (False, True))
    words = [entry.meaning.removesuffix(": flat in front") for entry in high]
    assert [entry.meaning for entry in low] == words
    assert {len(entry.rows) for entry in low} == {1}
    if step.kind == "cells":
        signs = [{sign & int(GLYPHS) for sign in entry.signs} for entry in (high[0], low[0])]
        assert signs[0] & signs[1] - {UNICODE.blank, UNICODE.lower_half}, "the same sign"


def test_pictures_in_the_legend_are_not_larger_than_many_need():
    scene = make_scene(open_floor(3, 3))
    zooms = [step for step in zoom_ladder((3, 3), (60, 200), 1) if step.is_drawn]
    large, largest = ([e.rows for e in legend(scene, step, UNICODE)] for step in zooms[:2])
    assert zooms[0].area > 32 and large == largest and len(large[0]) == 4


def test_the_legend_has_only_what_can_occur():
    words = [
        entry.meaning
        for entry in legend(mini(), camera_at(mini().floor.floor_plan, "1x1").zoom, UNICODE)
    ]
    assert "turntable: robots turn here" in words and "parking bay" in words
    assert not {"charger", "charging", "one-way floor", "two robots pass here"} & set(words)


def test_the_legend_gives_the_numbers_of_a_layer():
    floor_plan = open_floor(3, 3)
    heat = np.zeros(floor_plan.kind.size, np.int32)
    heat[floor_plan.cell(1, 1)] = 90
    zoom = camera_at(floor_plan, "1x1").zoom
    hot = legend(make_scene(floor_plan, heat=heat, layer="visits"), zoom, UNICODE)
    assert [entry.meaning for entry in hot if "visits" in entry.meaning][:2] == [
        "visits: 1",
        "visits: 2 to 5",
    ]
    flow = np.zeros((floor_plan.kind.size, 4), np.int32)
    flow[floor_plan.cell(1, 1), 2] = 90
    flowing = legend(make_scene(floor_plan, flow=flow, layer="flow"), zoom, UNICODE)
    assert "moves: 77 to 100" in [entry.meaning for entry in flowing]
    floor_plan = shipped("tabletop-mini")
    shown = make_scene(floor_plan, zones=traffic_zones_of(floor_plan), layer="traffic-zones")
    meanings = [entry.meaning for entry in legend(shown, zoom, UNICODE)]
    assert "16 zones, undirected; those that touch differ" in meanings
    assert "intersection, in no zone" in meanings


def test_a_cell_is_described_in_one_line():
    floor_plan = drawn("$.>.d\ns====")
    robots = [
        {"cell": floor_plan.cell(1, 0), "load": 7, "cause": 2},
        {"cell": floor_plan.cell(1, 1), "claim": floor_plan.cell(2, 1), "action": 1},
    ]
    scene = make_scene(floor_plan, *robots)
    scene.snapshot.orders.reserved_by[0] = 1
    scene.snapshot.slots.reserved_by[1] = 0
    described = [
        describe(scene, floor_plan.cell(*xy)) for xy in ((0, 0), (0, 1), (1, 0), (2, 0), (2, 1))
    ]
    assert described == [
        "(0, 0) shelf with load 0 for (4, 0), to be fetched by robot 1",
        "(0, 1) shelf, empty, reserved by robot 0",
        "(1, 0) floor, robot 0 with load 7 waiting: head-on",
        "(2, 0) one-way floor east",
        "(2, 1) passing aisle, robot 1 comes",
    ]
    assert describe(scene, floor_plan.cell(1, 1)) == "(1, 1) passing aisle, robot 1 driving"
    assert describe(scene, floor_plan.cell(4, 0)) == "(4, 0) destination with 0 loads"


def test_the_worst_cells_of_a_layer_are_known():
    floor_plan = open_floor(4, 4)
    heat = np.zeros(floor_plan.kind.size, np.int32)
    heat[floor_plan.cell(2, 1)], heat[floor_plan.cell(0, 3)] = 51, 7
    scene = make_scene(floor_plan, heat=heat, layer="waiting")
    assert worst_cells(scene) == [(floor_plan.cell(2, 1), 51), (floor_plan.cell(0, 3), 7)]
    assert worst_cells(scene.with_(layer="")) == []
