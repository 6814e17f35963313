"""Closed cells and shut doors on the screen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from render_scenes import camera_at, composed, drawn, make_scene, text

from automaton.world.resolve import resolve
from tui.render.camera import Camera
from tui.render.compose import compose
from tui.render.scene import Scene, floor_of
from tui.render.styles import ASCII, UNICODE


def test_closed_cells_and_shut_doors_have_signs_of_their_own() -> None:
    scene = make_scene(drawn("......"))
    at = scene.floor.floor_plan.cell
    cells = tuple(np.array([at(x, 0)], np.int32) for x in (2, 4))
    scene.__dict__["shut_cells"] = cells
    codes, camera = composed(scene, "1x1")
    assert text(codes)[2] == "⊠" and text(codes)[4] == "⊟"
    signs = text(compose(scene, camera, ASCII), ASCII)
    assert signs[2] == "x" and signs[4] == "D"


def test_doors_lifts_closings_and_levels_of_a_bad_day_are_on_the_map() -> None:
    resolved = resolve("bad-day")
    camera = Camera(resolved.floor_plan, 31, 120)
    shown = text(compose(Scene(floor_of(resolved)), camera, UNICODE))
    assert camera.zoom.is_drawn and shown.count("⋂") == 1 and shown.count("⇅") == 3
    assert shown.count("⊝") == 7, "an aisle of six cells that is cleaned, and people who cross"
    assert "ground" in shown and "mezzanine" in shown
    shown = text(compose(Scene(floor_of(resolved)), Camera(resolved.floor_plan, 31, 78), UNICODE))
    assert shown.count("⇅") == 3 and shown.count("⇅1") == 1, "one lift of three cells"


def test_stations_and_chargers_have_their_names_where_there_is_room() -> None:
    resolved = resolve("depots")
    camera = Camera(resolved.floor_plan, 20, 80)
    shown = text(compose(Scene(floor_of(resolved)), camera, UNICODE))
    assert camera.zoom.name == "3x1.5"
    assert all(f"⌂{number}" in shown for number in range(1, 14)) and "↯1" in shown
    narrow = camera_at(resolved.floor_plan, "1x1")
    assert "↯1" not in text(compose(Scene(floor_of(resolved)), narrow, UNICODE))


def test_a_long_name_gives_way_to_its_number_if_no_other_place_has_it() -> None:
    resolved = resolve("goods-60x40")
    plan, floor = resolved.floor_plan, floor_of(resolved)
    camera = Camera(plan, 50, 140)
    shown = text(compose(Scene(floor), camera, UNICODE))
    assert camera.zoom.name == "2x1" and set(resolved.place_names.values()) >= {"station P1"}
    assert all(f"⌂{number}" in shown for number in range(1, 7))
    names = {cell: name.replace("P2", "Q1") for cell, name in floor.place_names.items()}
    shown = text(compose(Scene(replace(floor, place_names=names)), camera, UNICODE))
    assert "⌂1" not in shown and "⌂3" in shown, "P1 or Q1"
