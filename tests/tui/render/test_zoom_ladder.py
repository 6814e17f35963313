"""The steps of zooming: squares that grow as long as the floor fits, and cells that fill the screen."""

from __future__ import annotations

from importlib.resources import files

import pytest
from hypothesis import given
from hypothesis import strategies as st
from render_scenes import open_floor

from automaton.world.resolve import resolve
from tui.render.camera import (
    ENOUGH,
    SQUARE_STRETCH,
    Camera,
    fits,
    is_square,
    stretch,
    zoom_ladder,
)

PANES = {  # rows, columns of the map, with panels beside it and without
    "80x24": [(20, 80)],
    "120x36": [(31, 78), (31, 120)],
    "200x60": [(55, 144), (55, 200)],
}
LAYOUTS = sorted(
    path.name[:-5] for path in files("layouts").iterdir() if path.name.endswith("yaml")
)


def names(height: int, width: int, rows: int, columns: int) -> list[str]:
    return [zoom.name for zoom in zoom_ladder((height, width), (rows, columns), 4)]


def test_above_numbers_beside_signs_come_cells_in_which_robots_are_drawn():
    assert names(5, 10, 35, 140)[:6] == ["14x7", "12x6", "10x5", "8x4", "6x3", "4x2"]
    assert names(100, 100, 20, 80)[:4] == ["8x4", "6x3", "4x2", "3x1.5"], "on large floors, too"


def test_a_floor_that_squares_fill_badly_gets_cells_of_another_shape():
    assert Camera(open_floor(20, 10), 20, 80).zoom.name == "4x2", "squares fill all of it"
    assert Camera(open_floor(20, 10), 29, 80).zoom.name == "4x2", "and enough of this"
    assert Camera(open_floor(13, 7), 20, 80).zoom.name == "6x2", "here they would take 45 %"


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_shipped_floor_covers_its_pane_and_a_square_one_looks_square(name: str):
    resolved = resolve(name)
    for rows, columns in [pane for panes in PANES.values() for pane in panes]:
        camera = Camera(resolved.floor_plan, rows, columns, resolved.scenario.fleet.robots)
        floor, (high, wide) = (camera.height, camera.width), camera.size()
        assert not camera.exceeds(), "the whole floor is seen"
        assert max(high / rows, wide / columns) >= ENOUGH
        if is_square(floor):
            assert wide / (2 * high) == pytest.approx(floor[1] / floor[0], rel=0.1)


@given(st.integers(1, 300), st.integers(8, 60), st.integers(16, 200))
def test_a_square_hall_of_any_size_looks_square(side: int, rows: int, columns: int):
    camera = Camera(open_floor(side, side), rows, columns, side)
    assert fits(camera.zoom, (side, side), (rows, columns))
    assert stretch(camera.zoom) <= SQUARE_STRETCH


@given(
    st.tuples(st.integers(1, 200), st.integers(1, 200)),
    st.tuples(st.integers(1, 60), st.integers(1, 200)),
    st.integers(0, 2000),
)
def test_each_step_is_smaller_than_the_one_before_and_the_last_one_fits(
    floor: tuple[int, int], screen: tuple[int, int], robots: int
):
    ladder = zoom_ladder(floor, screen, robots)
    areas = [zoom.area for zoom in ladder]
    assert areas == sorted(areas, reverse=True) and len(set(ladder)) == len(ladder)
    assert fits(ladder[-1], floor, screen)
