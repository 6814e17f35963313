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
    MAX_STRETCH,
    Camera,
    covered,
    drawn,
    fits,
    stretch,
    zoom_ladder,
)

PANES = {  # rows, columns of the map, with panels beside it and without
    "80x24": [(20, 80)],
    "120x36": [(32, 120), (32, 86)],
    "200x60": [(56, 200), (56, 144)],
}
LAYOUTS = sorted(
    path.name[:-5] for path in files("layouts").iterdir() if path.name.endswith("yaml")
)


def names(height: int, width: int, rows: int, columns: int) -> list[str]:
    return [zoom.name for zoom in zoom_ladder((height, width), (rows, columns), 4)]


def test_above_numbers_beside_signs_come_cells_in_which_robots_are_drawn():
    assert names(5, 10, 35, 140)[:6] == ["14x7", "12x6", "10x5", "8x4", "6x3", "4x2"]
    assert names(100, 100, 20, 80)[:4] == ["8x4", "6x3", "4x2", "3x1"], "on large floors, too"


def test_a_floor_that_squares_fill_badly_gets_cells_of_another_shape():
    assert Camera(open_floor(20, 10), 20, 80).zoom.name == "4x2", "squares fill all of it"
    assert Camera(open_floor(20, 10), 29, 80).zoom.name == "4x2", "and enough of this"
    assert Camera(open_floor(13, 7), 20, 80).zoom.name == "6x2", "here they would take 45 %"


@pytest.mark.parametrize("pane", PANES)
@pytest.mark.parametrize("name", LAYOUTS)
def test_the_map_of_a_shipped_floor_fills_its_pane(name: str, pane: str):
    """At least 60 % of it, or all that its shape or its size allow."""
    resolved = resolve(name)
    for rows, columns in PANES[pane]:
        camera = Camera(resolved.floor_plan, rows, columns, resolved.scenario.fleet.robots)
        floor, screen = (camera.height, camera.width), (rows, columns)
        share = covered(camera.zoom, floor, screen)
        assert share > 0, "the whole floor is seen"
        if share >= ENOUGH:
            continue
        shapes = [
            drawn(width, height)
            for height in range(2, rows + 1)
            for width in range(1, columns + 1)
            if stretch(drawn(width, height)) <= MAX_STRETCH
        ]
        assert max(covered(shape, floor, screen) for shape in shapes) <= share
        nearer = camera.ladder[: camera.ladder.index(camera.zoom)]
        assert not any(fits(step, floor, screen) for step in nearer)


def test_most_shipped_floors_of_few_cells_fill_it():
    shares = {}
    for name in ("crossing", "goods-mini", "tabletop-1", "tabletop-2", "tabletop-mini"):
        resolved = resolve(name)
        for pane in [(32, 86), (56, 200)]:
            camera = Camera(resolved.floor_plan, *pane, resolved.scenario.fleet.robots)
            rows, columns = camera.size()
            shares[name, pane] = rows * columns / (pane[0] * pane[1])
    below = {at: share for at, share in shares.items() if share < ENOUGH}
    assert list(below) == [("tabletop-2", (32, 86))], "23 x 7 cells in a pane that is too high"


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
