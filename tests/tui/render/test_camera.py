"""The camera: what is on the screen, where a cell is, and that the floor cannot get lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from render_scenes import open_floor

from automaton.floor.drawn_floors import draw_floor
from automaton.world.resolve import resolve
from tui.render.camera import Camera, CellRectangle, shown_rectangle


@st.composite
def moved_cameras(draw: st.DrawFn) -> Camera:
    """A camera over a floor of any size after any number of movements."""
    width, height = draw(st.integers(1, 300)), draw(st.integers(1, 300))
    camera = Camera(open_floor(width, height), draw(st.integers(1, 60)), draw(st.integers(1, 200)))
    for _ in range(draw(st.integers(0, 6))):
        move(camera, draw)
    return camera


def move(camera: Camera, draw: st.DrawFn) -> None:
    name = draw(st.sampled_from(["in", "out", "pan", "centre", "resize", "fit", "one"]))
    point = (draw(st.integers(0, camera.rows - 1)), draw(st.integers(0, camera.columns - 1)))
    if name == "in":
        camera.zoom_in(point)
    elif name == "out":
        camera.zoom_out(point)
    elif name == "pan":
        camera.pan(draw(st.floats(-400, 400)), draw(st.floats(-400, 400)))
    elif name == "centre":
        camera.centre_on(cells(camera)[draw(st.integers(0, 10**6)) % len(cells(camera))])
    elif name == "resize":
        camera.resize(draw(st.integers(1, 60)), draw(st.integers(1, 200)))
    elif name == "fit":
        camera.fit()
    else:
        camera.one_to_one()


def cells(camera: Camera) -> list[int]:
    return np.flatnonzero(camera.floor_plan.kind.reshape(-1) != 0).tolist()


def test_bays_in_the_border_column_are_shown_and_outer_walls_are_not():
    assert shown_rectangle(resolve("tabletop-mini").floor_plan) == CellRectangle(1, 0, 8, 13)
    walled = draw_floor("#####\n#...#\n#...#\n#####")
    assert shown_rectangle(walled) == CellRectangle(2, 2, 4, 5)


def test_the_ladder_ends_where_the_whole_floor_fits():
    small = Camera(open_floor(20, 20), 24, 80)
    assert [zoom.name for zoom in small.ladder] == [
        *("8x4", "6x3", "4x2", "3x1.5", "3x1", "2x1", "1.5x0.75", "1x1"),
        *("half", "quadrants", "braille 1"),
    ]
    large = Camera(open_floor(1000, 1000), 59, 200)
    assert large.ladder[-1].name == "braille 5"
    assert large.zoom.name == "braille 5" and not large.exceeds()
    assert Camera(open_floor(1000, 1000), 20, 80).ladder[-1].name == "braille 13"


@pytest.mark.parametrize(
    ("robots", "name"), [(4, "3x1"), (100, "3x1"), (101, "4x1"), (1001, "5x1")]
)
def test_the_nearest_step_of_one_row_has_room_for_the_highest_number(robots: int, name: str):
    ladder = Camera(open_floor(10, 8), 10, 40, robots).ladder
    assert name in [zoom.name for zoom in ladder]


def test_fit_takes_the_nearest_step_that_shows_everything_in_the_middle():
    camera = Camera(open_floor(20, 10), 24, 80)
    assert camera.zoom.name == "4x2"
    assert camera.place_of(camera.floor_plan.cell(0, 0)) == (2, 0)
    camera.resize(24, 50)
    camera.fit()
    assert camera.zoom.name == "2x1"


@given(moved_cameras())
def test_a_place_and_its_cell_are_inverse(camera: Camera):
    for row in {0, camera.rows // 3, camera.rows - 1}:
        for column in {0, camera.columns // 3, camera.columns - 1}:
            cell = camera.cell_at(row, column)
            if cell is None:
                continue
            place = camera.place_of(cell)
            assert place is not None
            assert 0 <= row - place[0] < camera.zoom.height
            assert 0 <= column - place[1] < camera.zoom.width
            rectangle = camera.rectangle_at(row, column)
            y, x = divmod(cell, camera.floor_plan.stride)
            assert rectangle.top <= y < rectangle.bottom
            assert rectangle.left <= x < rectangle.right
    if camera.zoom.kind == "cells":
        for cell in cells(camera)[:: max(1, len(cells(camera)) // 50)]:
            place = camera.place_of(cell)
            assert place is None or camera.cell_at(*place) == cell


@given(moved_cameras())
def test_the_visible_cells_are_those_that_have_a_place(camera: Camera):
    sample = np.array(cells(camera)[:: max(1, len(cells(camera)) // 50)], np.int32)
    placed = [camera.place_of(cell) is not None for cell in sample.tolist()]
    assert camera.inside(sample).tolist() == placed


@given(moved_cameras())
def test_some_of_the_floor_is_always_in_the_middle(camera: Camera):
    rows, columns = camera.size()
    assert -camera.rows // 2 - 1 <= camera.top <= rows - camera.rows // 2 + 1
    assert -(camera.columns // 2) - 3 <= camera.left <= columns - camera.columns // 2 + 3


@given(moved_cameras(), st.data())
def test_zooming_in_keeps_the_cell_under_the_pointer(camera: Camera, data: st.DataObject):
    row = data.draw(st.integers(0, camera.rows - 1))
    column = data.draw(st.integers(0, camera.columns - 1))
    cell = camera.cell_at(row, column)
    if cell is None:
        return
    camera.zoom_in((row, column))
    place = camera.place_of(cell)
    assert place is not None
    assert 0 <= row - place[0] < camera.zoom.height
    assert 0 <= column - place[1] < camera.zoom.width


def test_zooming_out_keeps_the_cell_under_the_pointer_inside_a_large_floor():
    camera = Camera(open_floor(1000, 1000), 59, 200)
    camera.one_to_one()
    for at in ((10, 20), (40, 120), (30, 60)):
        cell = camera.cell_at(*at)
        assert cell is not None
        camera.zoom_out(at)
        assert camera.place_of(cell) == at


@given(st.integers(1, 59), st.integers(1, 199))
def test_a_resize_keeps_the_centre(rows: int, columns: int):
    camera = Camera(open_floor(1000, 1000), 59, 200)
    camera.one_to_one()
    camera.centre_on(camera.floor_plan.cell(300, 600))
    before = camera.key
    camera.resize(rows, columns)
    place = camera.place_of(camera.floor_plan.cell(300, 600))
    assert place is not None
    assert abs(place[0] - rows // 2) <= 1 and abs(place[1] - columns // 2) <= 1
    camera.resize(59, 200)
    assert camera.key == before


def test_small_steps_of_a_pan_add_up():
    camera = Camera(open_floor(1000, 1000), 20, 80)
    camera.zoom_in()
    camera.zoom_in()
    assert camera.zoom.name == "braille 5"
    left = camera.left
    for _ in range(10):
        camera.pan(1, 0)
    assert camera.left == left + 1
    camera.pan_characters(3, 2)
    assert camera.left == left + 4


def test_a_pan_stops_at_the_edges_and_turns_at_once():
    camera = Camera(open_floor(300, 100), 20, 80)
    camera.one_to_one()
    camera.pan(-1000, -1000)
    assert (camera.top, camera.left) == (0, 0)
    camera.pan(1, 1)
    assert (camera.top, camera.left) == (1, 1)
    camera.pan(1000, 1000)
    assert (camera.top, camera.left) == (80, 220)


def test_centre_on_brings_a_cell_to_the_middle_unless_it_is_at_an_edge():
    camera = Camera(open_floor(300, 100), 20, 80)
    camera.one_to_one()
    camera.centre_on(camera.floor_plan.cell(150, 50))
    assert camera.place_of(camera.floor_plan.cell(150, 50)) == (10, 40)
    camera.centre_on(camera.floor_plan.cell(0, 0))
    assert camera.place_of(camera.floor_plan.cell(0, 0)) == (0, 0)
    assert camera.exceeds()


def test_a_copy_moves_by_itself():
    camera = Camera(open_floor(300, 100), 20, 80)
    other = camera.copy()
    other.one_to_one()
    assert camera.zoom.name != other.zoom.name
