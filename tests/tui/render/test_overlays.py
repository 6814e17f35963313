"""What is laid over the floor changes the picture where it should, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from render_scenes import (
    ALL,
    DRAWN,
    NEAR,
    at,
    bg,
    camera_at,
    composed,
    drawn,
    fg,
    make_scene,
    open_floor,
    text,
)

from automaton.floor.traffic_zones import TrafficZones
from tui.render import styles
from tui.render.compose import compose
from tui.render.scene import Scene
from tui.render.styles import ASCII, SHADED, UNICODE, GlyphSet

FAR = [zoom for zoom in ALL if zoom not in NEAR]


def changed_cells(before: Scene, after: Scene, zoom: str) -> set[tuple[int, int]]:
    old, _ = composed(before, zoom)
    new, _ = composed(after, zoom)
    return {(row, column) for row, column in np.argwhere(old != new).tolist()}


def characters(scene: Scene, zoom: str, cells: list[int], whole: bool = True) -> set:
    """The characters of cells, all or the first of each."""
    camera = camera_at(scene.floor.floor_plan, zoom)
    places = [camera.place_of(cell) for cell in cells]
    width = camera.zoom.width if whole else 1
    return {(place[0], place[1] + column) for place in places if place for column in range(width)}


@pytest.mark.parametrize("zoom", ALL)
def test_the_selected_the_marked_and_the_cursor(zoom: str):
    floor_plan = open_floor(9, 9)
    robots = [{"cell": floor_plan.cell(x, x)} for x in (1, 4, 7)]
    scene = make_scene(floor_plan, *robots)
    for overlay, cell in (
        ({"selected": 0}, floor_plan.cell(1, 1)),
        ({"marked": np.array([1], np.int32)}, floor_plan.cell(4, 4)),
        ({"cursor": floor_plan.cell(7, 7)}, floor_plan.cell(7, 7)),
        ({"cursor": floor_plan.cell(0, 5)}, floor_plan.cell(0, 5)),
    ):
        after = scene.with_(**overlay)
        whole = "cursor" in overlay  # a mark is behind the sign
        assert changed_cells(scene, after, zoom) == characters(scene, zoom, [cell], whole)


@pytest.mark.parametrize("zoom", ALL)
def test_the_route_of_the_selected_robot(zoom: str):
    floor_plan = open_floor(9, 9)
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(0, 0)})
    route = np.array([floor_plan.cell(x, 8) for x in range(2, 7)], np.int32)
    after = scene.with_(route=route)
    assert changed_cells(scene, after, zoom) == characters(scene, zoom, route.tolist(), False)
    assert fg(at(after, zoom, int(route[0]))) == styles.COLOUR_ROUTE
    if zoom in NEAR:
        assert at(after, zoom, int(route[-1])) & 0xFFFF == UNICODE.stand


def test_the_shelf_for_which_the_selected_robot_works():
    floor_plan = drawn("...\n.$.\n...")
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(0, 0), "order": 0})
    after = scene.with_(selected=0, route=np.array([floor_plan.cell(1, 0)], np.int32))
    assert fg(at(after, "1x1", floor_plan.cell(1, 1))) == styles.COLOUR_ROUTE


@pytest.mark.parametrize(
    ("step", "sign"), [((1, 0), "⇢"), ((0, 1), "⇣"), ((-1, 0), "⇠"), ((0, -1), "⇡")]
)
def test_a_long_move_shows_the_cell_that_it_holds(step: tuple[int, int], sign: str):
    floor_plan = open_floor(3, 3)
    claim = floor_plan.cell(1 + step[0], 1 + step[1])
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(1, 1), "claim": claim})
    code = at(scene, "1x1", claim)
    assert UNICODE.characters[code & 0xFFFF] == sign and fg(code) == styles.COLOUR_DIM


@pytest.mark.parametrize("zoom", [*NEAR, "half"])
def test_a_load_is_on_its_shelf_and_gone_when_it_is_taken(zoom: str):
    floor_plan = drawn("....\n.$$.\n....")
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(0, 0)})
    full = at(scene, zoom, floor_plan.cell(1, 1))
    scene.snapshot.slots.content[0] = -1
    assert at(scene, zoom, floor_plan.cell(1, 1)) != full
    assert at(scene, zoom, floor_plan.cell(2, 1)) == full


def test_a_floor_alone_shows_the_loads_that_it_was_drawn_with():
    floor_plan = drawn("$s.")
    scene = make_scene(floor_plan).with_(snapshot=None)
    codes, _ = composed(scene, "1x1")
    assert text(codes, ASCII) == "$#."


@pytest.mark.parametrize("zoom", [*DRAWN, *ALL])
@pytest.mark.parametrize("layer", ["visits", "waiting", "congestion"])
def test_heat_colours_the_cells_that_have_some(zoom: str, layer: str):
    floor_plan = open_floor(8, 8)
    heat = np.zeros(floor_plan.kind.size, np.int32)
    heat[floor_plan.cell(6, 6)], heat[floor_plan.cell(2, 2)] = 500, 1
    plain = make_scene(floor_plan, {"cell": floor_plan.cell(0, 0)}, heat=heat)
    hot = at(plain.with_(layer=layer), zoom, floor_plan.cell(6, 6))
    assert styles.COLOUR_HEAT_8 in (fg(hot), bg(hot))
    mild = at(plain.with_(layer=layer), zoom, floor_plan.cell(2, 2))
    assert styles.COLOUR_HEAT_1 in (fg(mild), bg(mild))
    corner = at(plain.with_(layer=layer), zoom, floor_plan.cell(0, 6))
    assert not {fg(corner), bg(corner)} & set(range(styles.COLOUR_HEAT_1, styles.COLOUR_HEAT_8 + 1))
    assert at(plain, zoom, floor_plan.cell(6, 6)) != hot


@pytest.mark.parametrize("zoom", [*NEAR, "braille 1"])
def test_flow_points_where_most_robots_went(zoom: str):
    floor_plan = open_floor(8, 8)
    flow = np.zeros((floor_plan.kind.size, 4), np.int32)
    flow[floor_plan.cell(6, 6)] = [1, 2, 30, 4]
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(0, 0)}, flow=flow, layer="flow")
    assert UNICODE.characters[at(scene, zoom, floor_plan.cell(6, 6)) & 0xFFFF] == "⇠"
    assert UNICODE.characters[at(scene, zoom, floor_plan.cell(2, 6)) & 0xFFFF] not in "⇢⇣⇠⇡"


@pytest.mark.parametrize("zoom", [*DRAWN, *ALL])
def test_zones_tint_their_cells(zoom: str):
    floor_plan = open_floor(8, 8)
    of = np.full((floor_plan.kind.size, 2), -1, np.int32)
    of[[floor_plan.cell(6, y) for y in range(8)]] = 0
    traffic_zones = TrafficZones("undirected", of, 1, of[:, 0] == 1)
    scene = make_scene(
        floor_plan, {"cell": floor_plan.cell(0, 0)}, zones=traffic_zones, layer="traffic-zones"
    )
    tinted = at(scene, zoom, floor_plan.cell(6, 5))
    assert styles.COLOUR_ZONE_0 in (fg(tinted), bg(tinted))
    assert styles.COLOUR_ZONE_0 not in (fg(at(scene, zoom, floor_plan.cell(0, 5))),)


@pytest.mark.parametrize("zoom", ALL)
def test_robots_are_grey_and_visible_on_a_layer(zoom: str):
    floor_plan = open_floor(8, 8)
    heat = np.full(floor_plan.kind.size, 500, np.int32)
    cell = floor_plan.cell(6, 6)
    code = at(make_scene(floor_plan, {"cell": cell}, heat=heat, layer="visits"), zoom, cell)
    assert styles.COLOUR_TEXT in (fg(code), bg(code))


@pytest.mark.parametrize("zoom", ALL)
def test_a_robot_and_its_route_stand_on_the_heat_of_their_cells(zoom: str):
    floor_plan = open_floor(6, 6)
    heat = np.full(floor_plan.kind.size, 500, np.int32)
    here, ahead = floor_plan.cell(2, 2), floor_plan.cell(4, 2)
    scene = make_scene(floor_plan, {"cell": here}, heat=heat, layer="waiting")
    scene = scene.with_(route=np.array([ahead], np.int32))
    for cell, colour in ((here, styles.COLOUR_TEXT), (ahead, styles.COLOUR_ROUTE)):
        code = at(scene, zoom, cell)
        filled = zoom in NEAR and cell == here
        shown = (styles.COLOUR_FLOOR, colour) if filled else (colour, styles.COLOUR_HEAT_8)
        assert (fg(code), bg(code)) == shown
    codes, camera = composed(scene.with_(selected=0), zoom)
    row, column = camera.place_of(here)
    chosen = codes[row, column]
    assert (fg(chosen), bg(chosen)) == (styles.COLOUR_TEXT, styles.COLOUR_SELECTED)
    assert UNICODE.characters[chosen & 0xFFFF] not in ".:-=+*#@"


@pytest.mark.parametrize("zoom", FAR)
def test_a_robot_on_a_layer_takes_its_own_part_of_a_character(zoom: str):
    floor_plan = open_floor(8, 8)
    heat = np.full(floor_plan.kind.size, 500, np.int32)
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(4, 4)}, heat=heat, layer="visits")
    upper = at(scene, zoom, floor_plan.cell(4, 4))
    below = floor_plan.cell(4, 6 if zoom == "braille 1" else 5)
    scene.snapshot.robots.cell[0] = below
    lower = at(scene, zoom, below)
    assert upper >> 16 == lower >> 16 and upper != lower


@pytest.mark.parametrize("zoom", FAR)
@pytest.mark.parametrize("glyphs", [SHADED, ASCII], ids=["no colours", "ascii"])
def test_without_colours_the_level_of_heat_is_a_shade_also_from_afar(zoom: str, glyphs: GlyphSet):
    floor_plan = open_floor(8, 8)
    scene = make_scene(
        floor_plan, {"cell": floor_plan.cell(0, 0)}, heat=np.zeros(floor_plan.kind.size, np.int32)
    )
    scene = scene.with_(layer="waiting")
    camera = camera_at(floor_plan, zoom)
    shades = []
    for waited in (1, 100, 1000):
        heat = np.zeros(floor_plan.kind.size, np.int32)
        heat[floor_plan.cell(6, 6)], heat[floor_plan.cell(0, 6)] = waited, 1000
        scene.snapshot.heat[:] = heat
        codes = compose(scene.with_(), camera, glyphs)
        shades.append(int(codes[camera.place_of(floor_plan.cell(6, 6))]))
    assert len({shade & 0xFFFF for shade in shades}) == 3
    assert all(fg(shade) == bg(shade) for shade in shades)  # with colours those alone are seen


@pytest.mark.parametrize("zoom", ["8x4", "4x2", "3x1.5", "1.5x0.75", *ALL])
def test_marks_stand_around_robots_and_never_replace_the_colour_of_their_state(zoom: str):
    floor_plan = open_floor(9, 9)
    robots = [
        {"cell": floor_plan.cell(1, 1), "wait_cycle_ticks": 5, "cause": 2},  # deadlocked
        {"cell": floor_plan.cell(4, 4), "load": 1},
        {"cell": floor_plan.cell(7, 7)},
    ]
    scene = make_scene(floor_plan, *robots)
    colours = (styles.COLOUR_FAULT, styles.COLOUR_LOADED, styles.COLOUR_ROBOT)
    jam = scene.with_(marked=np.array([0, 1], np.int32), selected=2)
    marks = (styles.COLOUR_MARKED, styles.COLOUR_MARKED, styles.COLOUR_SELECTED)
    codes, camera = composed(jam, zoom)
    for robot, colour, mark in zip(robots, colours, marks, strict=True):
        row, column = camera.place_of(robot["cell"])
        above = max(row - (zoom == "1.5x0.75"), 0)  # a mark is in half a cell above or below
        cell = codes[above : row + camera.zoom.height, column : column + camera.zoom.width]
        shown = {part(code) for code in cell.reshape(-1) for part in (fg, bg)}
        assert {colour, mark} <= shown


@pytest.mark.parametrize("zoom", ["8x4", "4x2", "3x1.5", "1.5x0.75", *ALL])
def test_a_robot_of_the_other_run_is_a_dim_ghost_beneath_robots(zoom: str):
    floor_plan = open_floor(9, 9)
    here, there = floor_plan.cell(2, 2), floor_plan.cell(6, 6)
    scene = make_scene(floor_plan, {"cell": here})
    after = scene.with_(ghosts=np.array([here, there], np.int32))
    assert at(after, zoom, here) == at(scene, zoom, here)
    assert fg(at(after, zoom, there)) == styles.COLOUR_DIM != fg(at(scene, zoom, there))


def test_numbers_that_do_not_fit_are_left_out_and_not_cut():
    floor_plan = open_floor(12, 10)
    cells = [floor_plan.cell(x, y) for y in range(10) for x in range(12)]
    codes, _ = composed(make_scene(floor_plan, *({"cell": cell} for cell in cells)), "3x1")
    assert text(codes).split("\n")[8] == "  ".join("▹" * 12)
