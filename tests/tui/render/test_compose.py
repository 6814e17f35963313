"""Pictures of floors: what a person sees at each step of the ladder."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from render_scenes import (
    ALL,
    DRAWN,
    NEAR,
    at,
    bg,
    body,
    camera_at,
    composed,
    crossing,
    drawn,
    fg,
    make_scene,
    mini,
    open_floor,
    signs,
    text,
)

from tui.render import styles
from tui.render.camera import Camera
from tui.render.compose import compose
from tui.render.scene import Scene, levels_of, scale_for
from tui.render.styles import ASCII, GLYPHS, UNICODE, Codes

# Goldens.

GOLDENS = {
    ("crossing", "3x1"): [
        "B0 )  )  )  }1 )  )  )  )  )  u  %%%",
        "b  n  #  #  #  #  #  #  #  #  u  =",
        "b  :  :  :  :  ~  :  :  :  :  :  =",
        "b  n  #  #  #  #  #  #  #  #  u  =",
        "%%%n  (  (  (  (  (  (  (  (  .  %%%",
        "%%%c  .  .  .  .  <2 .  .  .  c  %%%",
    ],
    ("crossing", "2x1"): [
        "B ) ) ) }$) ) ) ) ) u %%",
        "b n # # # # # # # # u =",
        "b : : : : ~ : : : : : =",
        "b n # # # # # # # # u =",
        "%%n ( ( ( ( ( ( ( ( . %%",
        "%%c . . . . < . . . c %%",
    ],
    ("crossing", "1x1"): [
        "B)))})))))u%",
        "bn########u=",
        "b::::~:::::=",
        "bn########u=",
        "%n((((((((.%",
        "%c....<...c%",
    ],
    ("crossing", "half"): [
        "▀ ⢄⢄▀⢄⢄⢄⢄⢄ ⣿",
        "⣿ ⢄⢄⢄⢄⢄⢄⢄⢄ ⣿",
        "⣿⣤    ▄   ⣤⣿",
    ],
    ("crossing", "braille 1"): [
        "▀⣒▀⣒⣒⢰",
        "⠐  ▀ ⠂",
    ],
    ("mini", "3x1"): [
        "b  @-----@-----v1 ---@-----@-----@  =",
        "b  |  #  |  #  |  #  |  #  |  #  |  =",
        "b  |  #  |  #  |  #  |  #  |  #  |  =",
        "b  |  #  A0 #  |  #  |  #  |  #  |  =",
        "b  |  #  |  #  |  #  |  #  |  #  |  =",
        "b  |  #  |  #  |  #  |  #  |  #  |  =",
        "b  @-----@-----@-----@-----@-----@  =",
    ],
    ("mini", "2x1"): [
        "b @---@---v --@---@---@ =",
        "b | # | # | # | # | # | =",
        "b | # | # | # | # | # | =",
        "b | # A$# | # | # | # | =",
        "b | # | # | # | # | # | =",
        "b | # | # | # | # | # | =",
        "b @---@---@---@---@---@ =",
    ],
    ("mini", "1x1"): [
        "b@-@-v-@-@-@=",
        "b|#|#|#|#|#|=",
        "b|#|#|#|#|#|=",
        "b|#A#|#|#|#|=",
        "b|#|#|#|#|#|=",
        "b|#|#|#|#|#|=",
        "b@-@-@-@-@-@=",
    ],
    ("mini", "half"): [
        "⣿ ⢄ ⢄▀⢄ ⢄ ⢄ ⣿",
        "⣿ ⢕▄⢕ ⢕ ⢕ ⢕ ⣿",
        "⣿ ⢕ ⢕ ⢕ ⢕ ⢕ ⣿",
        "⠛           ⠛",
    ],
    ("mini", "braille 1"): [
        "⡇▄▀⡆⡆⡆⡇",
        "⠇⠃⠃⠃⠃⠃⠇",
    ],
}
UNICODE_GOLDEN = [
    "▢  ◊╌╌╌╌╌◊╌╌╌╌╌▿1 ╌╌╌◊╌╌╌╌╌◊╌╌╌╌╌◊  ⊔",
    "▢  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ⊔",
    "▢  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ⊔",
    "▢  ╎  ▯  ▴0 ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ⊔",
    "▢  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ⊔",
    "▢  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ▯  ╎  ⊔",
    "▢  ◊╌╌╌╌╌◊╌╌╌╌╌◊╌╌╌╌╌◊╌╌╌╌╌◊╌╌╌╌╌◊  ⊔",
]


@pytest.mark.parametrize(("name", "zoom"), GOLDENS)
def test_a_shipped_floor_with_robots(name: str, zoom: str):
    scene = {"crossing": crossing, "mini": mini}[name]()
    codes, _ = composed(scene, zoom)
    glyphs = ASCII if zoom in NEAR else UNICODE
    assert text(codes, glyphs).split("\n") == GOLDENS[name, zoom]


def test_the_unicode_set_draws_the_same_floor():
    codes, _ = composed(mini(), "3x1")
    assert text(codes).split("\n") == UNICODE_GOLDEN


# Robots are where the snapshot says.


@st.composite
def fleets(draw: st.DrawFn, min_size: int = 1) -> Scene:
    """Robots in cells of their own; with 12 of them more than one for four characters of dots."""
    least = 4 if min_size > 1 else 1
    floor_plan = open_floor(draw(st.integers(least, 12)), draw(st.integers(least, 12)))
    free = np.flatnonzero(floor_plan.drivable.reshape(-1)).tolist()
    spots = draw(st.lists(st.sampled_from(free), unique=True, max_size=12, min_size=min_size))
    return make_scene(
        floor_plan,
        *(
            {
                "cell": cell,
                "heading": draw(st.integers(0, 3)),
                "load": draw(st.sampled_from([-1, 3])),
            }
            for cell in spots
        ),
    )


@given(fleets(), st.sampled_from(NEAR), st.integers(1, 20), st.integers(1, 40), st.data())
def test_every_robot_on_the_screen_is_at_its_place_and_shows_its_heading(
    scene: Scene, zoom: str, rows: int, columns: int, data: st.DataObject
):
    camera = camera_at(scene.floor.floor_plan, zoom, rows, columns)
    camera.pan(data.draw(st.integers(-9, 9)), data.draw(st.integers(-9, 9)))
    codes = compose(scene, camera, UNICODE)
    robots = scene.snapshot.robots
    wanted: dict[tuple[int, int], int] = {}
    for robot, cell in enumerate(robots.cell.tolist()):
        place = camera.place_of(cell)
        # Of a cell that the left edge cuts the sign is off the screen.
        if place is not None and (place[1] + camera.left) % camera.zoom.width == 0:
            shapes = UNICODE.loaded if robots.load[robot] >= 0 else UNICODE.robot
            wanted[place] = shapes[robots.heading[robot]]
    every = {*UNICODE.loaded, *UNICODE.robot}
    drawn_ones = {
        (row, column): int(codes[row, column]) & 0xFFFF
        for row, column in np.argwhere(np.isin(codes & 0xFFFF, list(every))).tolist()
    }
    assert drawn_ones == wanted


@given(fleets(min_size=12))
def test_from_afar_each_of_many_robots_is_a_dot_of_its_own(scene: Scene):
    codes, camera = composed(scene, "braille 1")
    dots = 0
    for cell in scene.snapshot.robots.cell.tolist():
        place = camera.place_of(cell)
        assert place is not None
        assert fg(codes[place]) in (styles.COLOUR_ROBOT, styles.COLOUR_LOADED)
    for sign in signs(codes).reshape(-1).tolist():
        dots += (ord(sign) - 0x2800).bit_count() if sign != " " else 0
    assert dots == len(scene.snapshot.robots.cell)


@given(fleets())
def test_in_half_blocks_each_robot_is_a_half_in_its_colour(scene: Scene):
    codes, camera = composed(scene, "half")
    robots = scene.snapshot.robots
    for cell, load in zip(robots.cell.tolist(), robots.load.tolist(), strict=True):
        place = camera.place_of(cell)
        assert place is not None
        y = cell // scene.floor.floor_plan.stride - camera.shown.top
        foregrounds = halves(codes[place])
        assert foregrounds[y % 2] == (styles.COLOUR_LOADED if load >= 0 else styles.COLOUR_ROBOT)


def halves(code: int) -> tuple[int, int]:
    """The colours of the upper and the lower half."""
    glyph = int(code) & 0xFFFF
    if glyph == UNICODE.upper_half:
        return fg(code), bg(code)
    if glyph == UNICODE.lower_half:
        return bg(code), fg(code)
    assert glyph == UNICODE.full
    return fg(code), fg(code)


def test_identities_stand_beside_their_robots():
    floor_plan = open_floor(12, 10)
    cells = [floor_plan.cell(x, y) for y in range(10) for x in range(12)]
    scene = make_scene(floor_plan, *({"cell": cell} for cell in cells))
    camera = Camera(floor_plan, 10, 48, robots=len(cells))
    camera.zoom = next(step for step in camera.ladder if step.name == "4x1")
    camera.resize(10, 48)
    assert text(compose(scene, camera, UNICODE)).split("\n")[8][12:27] == "▹99 ▹100▹101▹10"


@pytest.mark.parametrize(
    ("heading", "travel", "sign"), [(0, 0, "▹"), (0, 2, "◃"), (1, 3, "▵"), (1, 0, "▿"), (0, 1, "▹")]
)
def test_a_robot_on_rails_shows_the_way_it_came_until_it_turns(heading, travel, sign):
    floor_plan = drawn("+-+\n| |\n+-+")
    robot = {"cell": floor_plan.cell(0, 0), "heading": heading, "travel": travel}
    codes, _ = composed(make_scene(floor_plan, robot, headings=2), "1x1")
    assert signs(codes)[0, 0] == sign


CORNER = open_floor(4, 4).cell(0, 0)
STATES = [
    ({}, styles.COLOUR_ROBOT),
    ({"load": 1}, styles.COLOUR_LOADED),
    ({"load": 1, "cause": 2}, styles.COLOUR_WAITING),
    ({"load": 1, "cause": 2, "wait_cycle_ticks": 1}, styles.COLOUR_FAULT),
    ({"cause": 12}, styles.COLOUR_IDLE),
    ({"parked": 1, "cause": 12}, styles.COLOUR_PARKED),
    ({"load": 1, "charge": 199_999_999}, styles.COLOUR_LOW_BATTERY),
    ({"charge": 200_000_000}, styles.COLOUR_ROBOT),
    ({"charge": 1, "cause": 2}, styles.COLOUR_WAITING),
    ({"action": 7, "goal_type": 4, "goal_cell": CORNER, "charge": 1}, styles.COLOUR_CHARGING),
    ({"action": 7, "goal_type": 2, "goal_cell": CORNER}, styles.COLOUR_ROBOT),  # it has charged
    ({"status": 3, "cause": 17, "charge": 1}, styles.COLOUR_FAULT),
    ({"status": 4, "cause": 18}, styles.COLOUR_FAULT),
]


@pytest.mark.parametrize("zoom", ALL)
@pytest.mark.parametrize(("fields", "colour"), STATES)
def test_a_robot_has_the_colour_of_its_state(zoom: str, fields: dict[str, int], colour: int):
    scene = make_scene(open_floor(4, 4), {"cell": CORNER, **fields}, battery=True, faults=True)
    assert body(at(scene, zoom, CORNER)) == colour


@pytest.mark.parametrize("zoom", DRAWN)
@pytest.mark.parametrize(("fields", "colour"), STATES)
def test_a_drawn_robot_has_it_too(zoom: str, fields: dict[str, int], colour: int):
    scene = make_scene(open_floor(4, 4), {"cell": CORNER, **fields}, faults=True, battery=True)
    codes, camera = composed(scene, zoom)
    cell = codes[: camera.zoom.height, : camera.zoom.width]
    colours = [fg(one) for one in cell.ravel()] + [bg(one) for one in cell.ravel()]
    assert max(styles.ROBOT_COLOURS, key=colours.count) == colour


@pytest.mark.parametrize("first", [0, 1])
def test_the_worst_robot_gives_a_shared_character_its_colour(first: int):
    floor_plan = open_floor(4, 4)
    states = [{"wait_cycle_ticks": 1, "cause": 2}, {"load": 1}]
    robots = [
        {"cell": floor_plan.cell(1, 3), **states[first]},
        {"cell": floor_plan.cell(0, 0), **states[1 - first]},
    ]
    assert (
        fg(at(make_scene(floor_plan, *robots), "braille 1", floor_plan.cell(0, 0)))
        == styles.COLOUR_FAULT
    )


def test_from_afar_robots_are_not_drowned_by_shelves():
    floor_plan = drawn("ssss\ns..s\nssss\nssss")
    codes, _ = composed(make_scene(floor_plan, {"cell": floor_plan.cell(1, 1)}), "braille 1")
    assert signs(codes).tolist() == [["⠐", "⣽"]]


BLOCKS = """
########.########
########.########
########.########
.................
########.###.####
########.###.####
########.###.####
########.###.####
""".strip()


def test_from_afar_blocks_of_walls_are_filled_and_narrow_aisles_between_them_stay_open():
    """Two cells share a dot: walls beside an aisle of one cell do not fill the dots of the aisle."""
    codes, _ = composed(make_scene(drawn(BLOCKS)), "braille 2")
    assert ["".join(row) for row in signs(codes).tolist()] == ["⣭⣭⢨⢩⡅"]


@pytest.mark.parametrize(
    ("robots", "sign"), [(1, " "), (4, " "), (5, "▀"), (16, "▀"), (17, "⠁")], ids=str
)
def test_few_robots_fill_a_character_of_dots_some_half_of_it_and_many_are_dots(
    robots: int, sign: str
):
    floor_plan = open_floor(16, 32)  # 8 x 8 characters
    rest = [{"cell": floor_plan.cell(x, 31)} for x in range(robots - 1)]
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(2, 4)}, *rest)
    code = at(scene, "braille 1", floor_plan.cell(2, 4))
    assert UNICODE.characters[code & 0xFFFF] == sign and body(code) == styles.COLOUR_ROBOT


def test_several_robots_in_a_cell_are_counted():
    floor_plan = drawn("...\n.~.\n...")
    cell = floor_plan.cell(1, 1)
    scene = make_scene(
        floor_plan, {"cell": cell, "load": 1}, {"cell": cell}, {"cell": cell, "wait_cycle_ticks": 1}
    )
    code = at(scene, "1x1", cell)
    assert chr(code & 0xFFFF) == "3" and bg(code) == styles.COLOUR_FAULT
    assert fg(at(scene, "half", cell)) == styles.COLOUR_FAULT
    reversed_order = make_scene(floor_plan, {"cell": cell, "wait_cycle_ticks": 1}, {"cell": cell})
    assert fg(at(reversed_order, "half", cell)) == styles.COLOUR_FAULT
    many = make_scene(floor_plan, *({"cell": cell} for _ in range(11)))
    assert chr(at(many, "1x1", cell) & 0xFFFF) == "+"


# The rest of the screen.


def test_beyond_the_floor_is_void_and_the_buffer_is_used_again():
    floor_plan = open_floor(3, 3)
    scene = make_scene(floor_plan, {"cell": floor_plan.cell(1, 1)})
    camera = camera_at(floor_plan, "1x1", 5, 9)
    camera.one_to_one()
    out = compose(scene, camera, UNICODE)
    first = out.copy()
    assert text(out, ASCII).split("\n") == ["", "   ...", "   .>.", "   ...", ""]
    assert bg(out[0, 0]) == styles.COLOUR_VOID
    out[:] = 0
    assert compose(scene, camera, UNICODE, out) is out
    assert np.array_equal(out, first)


@given(st.integers(1, 12), st.integers(1, 12), st.integers(-20, 20), st.integers(-20, 20))
def test_a_window_shows_what_the_whole_picture_has_there(rows, columns, dx, dy):
    scene = crossing()
    for zoom in [*DRAWN, *ALL]:
        whole, everything = composed(scene, zoom)
        camera = camera_at(scene.floor.floor_plan, zoom, rows, columns)
        camera.pan(dx, dy)
        codes = compose(scene, camera, UNICODE)
        for row in range(rows):
            for column in range(columns):
                y, x = row + camera.top, column + camera.left
                inside = 0 <= y < everything.rows and 0 <= x < everything.columns
                assert not inside or codes[row, column] == whole[y, x]


def test_one_way_floor_is_an_arrow_but_a_dead_end_is_not():
    codes, _ = composed(make_scene(drawn("..>.\n####")), "1x1")
    assert text(codes, ASCII) == "..)."


def test_levels_begin_where_the_legend_says():
    scale = scale_for(730)
    assert scale.end == 800
    assert scale.begins == (1, 12, 50, 110, 200, 310, 450, 610)
    values = np.array([0, 1, 11, 12, 609, 610, 800], np.int32)
    assert levels_of(values, scale).tolist() == [0, 1, 1, 2, 7, 8, 8]
    assert scale.words(1, 1) == "1 to 11" and scale.words(7, 8) == "450 to 800"
    assert scale_for(1001).end == 1200 and scale_for(0).begins == (1, 2, 3, 4, 5, 6, 7, 8)


def test_the_scale_ends_so_near_that_the_worst_cell_is_of_the_last_levels():
    for largest in range(1, 5000):
        scale = scale_for(largest)
        level = int(levels_of(np.array([largest], np.int32), scale)[0])
        assert scale.end >= largest and (level >= 7 or largest < 8)
    assert [scale_for(n).end for n in (51, 81, 100, 101)] == [60, 100, 100, 120]


def test_cells_of_one_and_a_half_rows_have_their_signs_and_half_a_row_of_their_colour():
    scene = mini()
    rows, camera = composed(scene, "3x1")
    tall, other = composed(scene, "3x1.5")
    assert other.size() == (-(-camera.height * 3 // 2), 3 * camera.width)
    for y in range(camera.height):
        assert np.array_equal(tall[other.zoom.first_row(y)], rows[y])
    shared = tall[1 : 3 * (camera.height // 2) : 3]
    assert np.array_equal(
        shared & GLYPHS == UNICODE.blank, background(rows)[0:-1:2] == background(rows)[1::2]
    )


def background(codes: Codes) -> np.ndarray:
    return (codes >> 16) % len(styles.COLOUR_TABLE)


@given(fleets())
def test_in_enlarged_half_blocks_each_cell_has_one_to_four_pixels_of_its_colour(scene: Scene):
    codes, camera = composed(scene, "1.5x0.75")
    filled = codes[np.isin(codes & GLYPHS, UNICODE.braille, invert=True)]
    pixels = np.array([halves(code) for code in filled])
    robots = scene.snapshot.robots
    colours = np.where(robots.load >= 0, styles.COLOUR_LOADED, styles.COLOUR_ROBOT)
    for state in (styles.COLOUR_LOADED, styles.COLOUR_ROBOT):
        count = np.count_nonzero(colours == state)
        assert count <= np.count_nonzero(pixels == state) <= 4 * count
    for cell, colour in zip(robots.cell.tolist(), colours.tolist(), strict=True):
        assert colour in halves(codes[camera.place_of(cell)])
