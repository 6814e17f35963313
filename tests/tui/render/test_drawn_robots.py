"""Robots in cells of several rows: what is drawn of them, and that nothing is lost when they move."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from render_scenes import (
    DRAWN,
    bg,
    body,
    camera_at,
    composed,
    drawn,
    fg,
    make_scene,
    open_floor,
    text,
)
from terminal_replay import screen_of, wrong_cells

from automaton.engine.state import BATTERY_FULL
from tui.render import styles
from tui.render.camera import Camera
from tui.render.compose import compose
from tui.render.encode import encode
from tui.render.scene import Scene
from tui.render.styles import ASCII, GLYPHS, UNICODE, Codes, Depth, GlyphSet, Look

ROW = open_floor(4, 1)


def four_headings(**more: int) -> Scene:
    """A robot in each of four cells, looking east, south, west and north."""
    return make_scene(
        ROW, *({"cell": ROW.cell(x, 0), "heading": x, **more} for x in range(4)), battery=True
    )


LETTERS = {
    styles.COLOUR_FLOOR: ".",
    styles.COLOUR_VOID: ".",
    styles.COLOUR_FLOOR_MARK: ".",
    styles.COLOUR_ROBOT: "#",
    styles.COLOUR_LOADED: "O",
    styles.COLOUR_TEXT: "L",  # the load
    styles.COLOUR_DONE: "=",
    styles.COLOUR_LOW_BATTERY: "!",
    styles.COLOUR_WAITING: "W",
    styles.COLOUR_PARKED: "P",
    styles.COLOUR_SELECTED: "S",
}


def pixels(codes: Codes) -> list[str]:
    """Two lines for each row: the colours of its upper and lower pixels, and what is written there."""
    lines = []
    for row in codes:
        upper, lower = [], []
        for one in row.tolist():
            glyph, front, behind = one & int(GLYPHS), LETTERS[fg(one)], LETTERS[bg(one)]
            halves = {UNICODE.upper_half: (front, behind), UNICODE.lower_half: (behind, front)}
            sign = UNICODE.characters[glyph]
            up, down = halves.get(glyph, (behind if sign == " " else sign, behind))
            upper.append(up)
            lower.append(down)
        lines += ["".join(upper), "".join(lower)]
    return lines


def drawings(scene: Scene, zoom: str) -> list[str]:
    """The cells of a floor of one row, with blanks between."""
    codes, camera = composed(scene, zoom)
    width = camera.zoom.width
    lines = pixels(codes)
    return ["  ".join(line[at : at + width] for at in range(0, len(line), width)) for line in lines]


def test_in_two_rows_a_robot_has_a_point_a_sign_a_number_and_its_load():
    assert drawings(four_headings(load=1), "4x2") == [
        "O0O.  OO1L  .O2O  .▴O.",
        "OOOO  OOLL  OOOO  OOOO",
        "LL▸O  O▾OO  O◂LL  OO3L",
        "LLO.  .OO.  .OLL  OOLL",
    ]


def test_in_three_rows_a_bar_shows_the_charge():
    assert drawings(four_headings(charge=BATTERY_FULL // 2), "6x3") == [
        "####..  ===...  ..####  ..▵#..",
        "#####.  ######  .#####  .####.",
        "##0##▹  ###1##  ◃##2##  ###3##",
        "######  ######  ######  ######",
        "#####.  .#▿##.  .#####  ######",
        "==....  ..##..  ..==..  ===...",
    ]


def test_larger_robots_leave_a_margin_into_which_their_point_reaches():
    assert drawings(four_headings(load=1), "8x4") == [
        ".OOOO...  .======.  ...OOOO.  ...▴O...",
        ".OOOOO..  .OOOOOO.  ..OOOOO.  ..OOOO..",
        ".OO0OO▸.  .OLLLLO.  .◂OO2OO.  .OOO3OO.",
        ".OOOOOOO  .OLLLLO.  OOOOOOO.  .OOOOOO.",
        ".OLLLLOO  .OOO1OO.  OOLLLLO.  .OLLLLO.",
        ".OLLLLO.  .OOOOOO.  .OLLLLO.  .OLLLLO.",
        ".OOOOO..  ..O▾OO..  ..OOOOO.  .OOOOOO.",
        ".====...  ...OO...  ...====.  .======.",
    ]


def test_one_that_waits_is_flat_in_front_and_one_that_is_parked_has_no_front():
    waiting = make_scene(
        ROW, {"cell": ROW.cell(0, 0), "cause": 2}, {"cell": ROW.cell(1, 0), "parked": 1}
    )
    assert [line[:14] for line in drawings(waiting, "6x3")] == [
        "WWWWWW  .P⊡PP.",
        "WWWWWW  PPPPPP",
        "WW0WW▹  PPP1PP",
        "WWWWWW  PPPPPP",
        "WWWWWW  PPPPPP",
        "WWWWWW  .PPPP.",
    ]


def test_a_number_that_has_no_room_is_left_out():
    fleet = make_scene(ROW, *({"bay": 99} for _ in range(1000)), {"cell": ROW.cell(0, 0)})
    assert "1000" in text(composed(fleet, "6x3")[0])
    assert not set("0123456789") & set(text(composed(fleet, "4x2")[0]))


@pytest.mark.parametrize("zoom", DRAWN)
def test_the_selected_robot_changes_its_colour_and_keeps_its_state_in_its_signs(zoom: str):
    scene = four_headings()
    codes, _ = composed(scene, zoom)
    chosen, _ = composed(scene.with_(selected=0), zoom)
    width = codes.shape[1] // 4
    assert (codes != chosen)[:, :width].any() and not (codes != chosen)[:, width:].any()
    own = chosen[:, :width].reshape(-1)
    signs = [one for one in own if int(one & GLYPHS) in (*UNICODE.robot, *UNICODE.loaded)]
    assert [(fg(one), bg(one)) for one in signs] == [(styles.COLOUR_ROBOT, styles.COLOUR_SELECTED)]
    number = [code for code in own if chr(int(code & GLYPHS)) == "0"]
    assert [bg(one) for one in number] == [styles.COLOUR_ROBOT], "the body keeps its colour"


@pytest.mark.parametrize("zoom", [*DRAWN, "5x3"])
def test_every_character_of_a_cell_belongs_to_it(zoom: str):
    size = (12, 40) if zoom == "5x3" else (11, 30)
    floor_plan = open_floor(8, 4) if zoom == "5x3" else open_floor(5, 4)
    camera = Camera(floor_plan, *size)
    camera.zoom = next(step for step in camera.ladder if step.name == zoom)
    camera.centre_on(floor_plan.cell(4, 3))
    for row, column in np.ndindex(*size):
        cell = camera.cell_at(row, column)
        if cell is not None:
            place = camera.place_of(cell)
            assert place is not None
            assert place[0] <= row < place[0] + camera.zoom.height
            assert place[1] <= column < place[1] + camera.zoom.width


def test_the_route_is_a_line_from_cell_to_cell():
    floor_plan = open_floor(3, 2)
    cells = [floor_plan.cell(*xy) for xy in ((0, 0), (1, 0), (1, 1), (2, 1))]
    scene = make_scene(floor_plan, {"cell": cells[0]}, selected=0)
    codes, _ = composed(scene.with_(route=np.array(cells[1:], np.int32)), "6x3")
    on_route = np.array([[fg(code) == styles.COLOUR_ROUTE for code in row] for row in codes])
    assert ["".join(".*"[int(there)] for there in row) for row in on_route] == [
        "..................",
        "........*.........",
        "........*.........",
        "........*.........",
        "........*******...",
        "..................",
    ]


def test_robots_in_one_cell_are_counted_in_the_middle_of_it():
    floor_plan = drawn("~")
    robots = [{"cell": floor_plan.cell(0, 0)}] * 3
    codes, _ = composed(make_scene(floor_plan, *robots), "6x3")
    assert text(codes).split("\n") == ["", "  3", ""]
    assert {body(code) for code in codes.reshape(-1)} == {styles.COLOUR_ROBOT}


@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=lambda glyphs: glyphs.name)
@pytest.mark.parametrize("zoom", DRAWN)
def test_without_colours_states_still_differ(zoom: str, glyphs: GlyphSet):
    """What a terminal without colours shows of a robot that drives, waits, carries or is chosen."""
    look, shown = Look(Depth.NONE), set()
    for fields in ({}, {"load": 1}, {"cause": 2}, {"parked": 1}, {"status": 4}, {"selected": 0}):
        chosen = {"selected": 0} if "selected" in fields else {}
        state = {name: value for name, value in fields.items() if name != "selected"}
        cell = ROW.cell(1, 0)
        scene = make_scene(ROW, {"cell": cell, **state}, faults=True, **chosen)
        codes = compose(scene, camera_at(ROW, zoom), glyphs)
        shown.add(
            tuple(
                (glyphs.characters[int(one & GLYPHS)], look.attributes(int(one) >> 16))
                for one in codes.reshape(-1)
            )
        )
    assert len(shown) == 6


ACTIONS = st.lists(
    st.sampled_from(["in", "out", "fit", "east", "south", "drive", "select", "heat"]), max_size=12
)


@settings(max_examples=40)
@given(ACTIONS, st.sampled_from(list(Depth)), st.sampled_from([UNICODE, ASCII]), st.integers(0, 99))
def test_after_any_actions_the_terminal_shows_what_a_full_repaint_shows(
    actions: list[str], depth: Depth, glyphs: GlyphSet, seed: int
):
    random = np.random.default_rng(seed)
    floor_plan = drawn("s..=\n+-+.\n|$|~\n+-+c")
    free = np.flatnonzero(floor_plan.drivable.reshape(-1))
    robots = [{"cell": int(cell), "load": int(cell) % 2 - 1} for cell in random.choice(free, 5)]
    heat = np.where(floor_plan.drivable.reshape(-1), 9, 0).astype(np.int32)
    scene = make_scene(floor_plan, *robots, heat=heat, battery=True)
    camera, look = Camera(floor_plan, 14, 33, len(robots)), Look(depth)
    shown = compose(scene, camera, glyphs)
    stream = encode(shown, None, look, glyphs)
    for action in actions:
        if action in ("in", "out"):
            (camera.zoom_in if action == "in" else camera.zoom_out)((5, 9))
        elif action in ("east", "south"):
            camera.pan(action == "east", action == "south")
        elif action == "fit":
            camera.fit()
        elif action == "drive":
            scene.snapshot.robots.cell[:] = random.choice(free, len(robots))
            scene.snapshot.robots.heading[:] = random.integers(0, 4, len(robots))
        else:
            changes = {
                "select": {"selected": 2, "cursor": int(free[0])},
                "heat": {"layer": "visits"},
            }
            scene = scene.with_(**changes[action])
        codes = compose(scene, camera, glyphs)
        stream += encode(codes, shown, look, glyphs)
        shown = codes
    assert wrong_cells(screen_of(stream, 33, 14), shown, look, glyphs) == []
