"""The overview: where the view is, and where a click leads."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from render_scenes import body, make_scene, open_floor, signs

from automaton.world.resolve import resolve
from tui.playback.frame_cache import Pictures
from tui.playback.run_source import live
from tui.render import styles
from tui.render.camera import Camera
from tui.render.compose import Minimap
from tui.render.scene import Choice
from tui.render.styles import UNICODE


def framed(minimap: Minimap, camera: Camera) -> list[str]:
    """The overview of an empty floor."""
    codes = minimap.picture(make_scene(camera.floor_plan), camera, UNICODE)
    foregrounds = (codes >> 16) // len(styles.COLOUR_TABLE)
    return [
        "".join(row) for row in np.where(foregrounds == styles.COLOUR_CURSOR, signs(codes), ".")
    ]


def test_a_frame_goes_round_what_the_camera_shows():
    floor_plan = open_floor(24, 16)
    camera = Camera(floor_plan, 8, 12)
    camera.one_to_one()
    minimap = Minimap(camera, 4, 12)
    camera.pan(-99, -99)
    assert framed(minimap, camera) == [
        "⡏⠉⠉⠉⠉⢹......",
        "⣇⣀⣀⣀⣀⣸......",
        "............",
        "............",
    ]
    camera.pan(12, 8)
    assert framed(minimap, camera) == [
        "............",
        "............",
        "......⡏⠉⠉⠉⠉⢹",
        "......⣇⣀⣀⣀⣀⣸",
    ]


def test_the_frame_is_whole_where_the_floor_ends_within_the_screen():
    camera = Camera(open_floor(8, 8), 20, 60)
    assert not camera.exceeds()
    assert framed(Minimap(camera, 2, 4), camera) == ["⡏⠉⠉⢹", "⣇⣀⣀⣸"]


def test_robots_are_seen_in_the_overview_and_layers_are_not():
    floor_plan = open_floor(40, 40)
    camera = Camera(floor_plan, 10, 10)
    camera.one_to_one()
    scene = make_scene(
        floor_plan, {"cell": floor_plan.cell(1, 1)}, heat=np.ones(floor_plan.kind.size, np.int32)
    )
    minimap = Minimap(camera, 10, 20)
    codes = minimap.picture(scene, camera, UNICODE)
    assert body(codes[0, 0]) == styles.COLOUR_ROBOT
    assert np.array_equal(codes, minimap.picture(scene.with_(layer="visits"), camera, UNICODE))


def test_an_overview_is_made_once_for_a_size_of_the_map():
    pictures = Pictures(live(resolve("tabletop-1"), None), UNICODE)
    pictures.resize(12, 40)
    pictures.camera.one_to_one()
    while not pictures.camera.exceeds():
        pictures.camera.zoom_in()
    first = pictures.corner(Choice())
    assert first is not None
    pictures.camera.pan(3, 3)
    assert pictures.corner(Choice()) is first  # it would look at every cell of the floor again
    pictures.resize(6, 40)
    pictures.camera.zoom_in()
    smaller = pictures.corner(Choice())
    assert smaller is not None and smaller.minimap.camera.rows < first.minimap.camera.rows


def test_the_frame_goes_with_the_camera_and_takes_the_characters_that_are_asked_for():
    camera = Camera(open_floor(24, 16), 8, 12)
    camera.one_to_one()
    minimap, scene = Minimap(camera, 4, 12), make_scene(camera.floor_plan)
    seen = []
    for columns in (-99, 12, -12):
        camera.pan(columns, 0)
        seen.append(minimap.picture(scene, camera, UNICODE).copy())
    assert not np.array_equal(seen[0], seen[1]) and np.array_equal(seen[0], seen[2])
    fresh = Minimap(camera, 4, 12).picture(scene, camera, UNICODE)
    assert np.array_equal(seen[2], fresh)


@given(st.integers(1, 400), st.integers(1, 400), st.integers(1, 20), st.integers(1, 40))
def test_the_whole_floor_fits_and_a_click_leads_to_its_cell(width, height, rows, columns):
    camera = Camera(open_floor(width, height), 30, 100)
    minimap = Minimap(camera, rows, columns)
    assert not minimap.camera.exceeds()
    for row in range(rows):
        for column in range(columns):
            cell = minimap.cell_at(row, column)
            assert cell is None or minimap.camera.place_of(cell) == (row, column)
    corners = [camera.floor_plan.cell(0, 0), camera.floor_plan.cell(width - 1, height - 1)]
    assert all(minimap.camera.place_of(cell) is not None for cell in corners)
