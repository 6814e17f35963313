"""The encoder: what a terminal shows after its bytes, in which order, and how many there are."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pyte
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from render_scenes import composed, make_scene, open_floor
from terminal_replay import cell_at, screen_of, wrong_cells

from tui.render.encode import encode
from tui.render.styles import (
    ASCII,
    COLOUR_FLOOR,
    COLOUR_FLOOR_MARK,
    COLOUR_LOADED,
    COLOUR_ROBOT,
    COLOUR_SHELF,
    COLOUR_VOID,
    STYLE_COUNT,
    UNICODE,
    Codes,
    Depth,
    GlyphSet,
    Look,
    code,
    style,
)

LOOKS = [Look(depth, theme) for depth in Depth for theme in ("dark", "light")]
FOREIGN = "\x1b[0;31;42m"


@st.composite
def pictures(draw: st.DrawFn) -> tuple[Codes, Codes]:
    """Two pictures of one size that differ in none, few, many or all cells."""
    shape = draw(st.integers(1, 12)), draw(st.integers(1, 30))
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    styles = random.integers(0, STYLE_COUNT, draw(st.integers(1, 40)))
    glyphs = random.integers(0, len(UNICODE.characters), draw(st.integers(1, 20)))
    pair = [code(random.choice(styles, shape), random.choice(glyphs, shape)) for _ in range(2)]
    changed = random.random(shape) < draw(st.sampled_from([0.0, 0.02, 0.2, 0.7, 1.0]))
    return pair[0], np.where(changed, pair[1], pair[0])


def all_foreign(columns: int, rows: int) -> str:
    """Bytes that fill a screen with something that is not ours."""
    return FOREIGN + "".join(f"\x1b[{row};1H{'x' * columns}" for row in range(1, rows + 1))


@pytest.mark.parametrize("look", LOOKS, ids=lambda look: f"{look.depth.name}-{look.theme}")
@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=lambda glyphs: glyphs.name)
@settings(max_examples=examples(30))
@given(
    pair=pictures(),
    top=st.integers(0, 3),
    left=st.integers(0, 12),
    below=st.integers(0, 2),
    beside=st.integers(0, 3),
)
def test_a_repaint_and_a_difference_show_the_picture_and_leave_the_rest_alone(
    look: Look,
    glyphs: GlyphSet,
    pair: tuple[Codes, Codes],
    top: int,
    left: int,
    below: int,
    beside: int,
) -> None:
    old, new = pair
    rows, columns = top + new.shape[0] + below, left + new.shape[1] + beside
    before = all_foreign(columns, rows) + encode(old, None, look, glyphs, top, left)
    screen = screen_of(before, columns, rows)
    assert wrong_cells(screen, old, look, glyphs, top, left) == []
    pyte.Stream(screen).feed(encode(new, old, look, glyphs, top, left))
    assert wrong_cells(screen, new, look, glyphs, top, left) == []
    foreign = cell_at(screen_of(FOREIGN + "x", 1, 1), 0, 0)
    ours = {(top + y, left + x) for y, x in np.ndindex(*new.shape)}
    rest = {place for place in np.ndindex(rows, columns)} - ours
    assert all(cell_at(screen, *place) == foreign for place in rest)


@given(pair=pictures(), look=st.sampled_from(LOOKS))
def test_a_difference_is_never_longer_than_a_repaint(pair: tuple[Codes, Codes], look: Look) -> None:
    """In bytes, which is what a connection carries: a sign of braille is three of them."""
    old, new = pair
    difference, repaint = (encode(new, one, look, UNICODE).encode() for one in (old, None))
    assert len(difference) <= len(repaint)


def test_nothing_is_sent_if_nothing_differs() -> None:
    codes = code(style(COLOUR_ROBOT, COLOUR_FLOOR), np.full((5, 9), UNICODE.robot[0]))
    assert encode(codes, codes.copy(), LOOKS[0], UNICODE) == ""


def test_the_style_is_reset_at_the_end() -> None:
    codes = code(style(COLOUR_ROBOT, COLOUR_FLOOR), np.full((2, 2), UNICODE.robot[0]))
    screen = screen_of(encode(codes, None, Look(Depth.TRUE), UNICODE) + "\x1b[4;1Hx", 9, 9)
    assert cell_at(screen, 3, 0) == ("x", "default", "default", False, False, False)


def test_a_torn_frame_shows_a_robot_twice_rather_than_never() -> None:
    """Wherever the stream is cut, each robot is in its old place or in its new one."""
    look, before, after = Look(Depth.TRUE), floor(6, 20), floor(6, 20)
    robots = [(2, 3, 2, 4), (4, 9, 3, 9), (5, 19, 5, 18), (0, 0, 1, 0)]
    for number, (y, x, to_y, to_x) in enumerate(robots):
        robot = code(
            style((COLOUR_ROBOT, COLOUR_LOADED)[number % 2], COLOUR_FLOOR), UNICODE.robot[0]
        )
        before[y, x] = after[to_y, to_x] = robot
    start, stream = encode(before, None, look, UNICODE), encode(after, before, look, UNICODE)
    for cut in range(len(stream)):
        screen = screen_of(start + stream[:cut], 20, 6)
        for y, x, to_y, to_x in robots:
            shown = cell_at(screen, y, x).character + cell_at(screen, to_y, to_x).character
            assert UNICODE.characters[UNICODE.robot[0]] in shown


def test_a_row_of_equal_styles_is_one_move_and_one_sequence() -> None:
    look, old = Look(Depth.SIXTEEN), floor(3, 20)
    new = old.copy()
    new[1, 4:8] = code(style(COLOUR_ROBOT, COLOUR_FLOOR), ord("R"))
    new[1, 10] = code(style(COLOUR_ROBOT, COLOUR_FLOOR), ord("S"))
    new[2, 11] = code(style(COLOUR_ROBOT, COLOUR_FLOOR), ord("T"))
    new[2, 8] = code(style(COLOUR_FLOOR_MARK, COLOUR_FLOOR), ord(","))
    robot, mark = (
        look.sgr(style(COLOUR_ROBOT, COLOUR_FLOOR)),
        look.sgr(style(COLOUR_FLOOR_MARK, COLOUR_FLOOR)),
    )
    expected = f"{robot}\x1b[2;5HRRRR\x1b[2CS\x1b[BT{mark}\x1b[4D,\x1b[0m"
    assert encode(new, old, look, UNICODE) == expected


def test_after_the_last_column_a_move_is_absolute() -> None:
    """A terminal may be waiting to wrap there, and terminals disagree on what moves then do."""
    look, old = Look(Depth.SIXTEEN), floor(4, 20)
    new = old.copy()
    new[1, 19] = new[2, 19] = new[3, 19] = code(style(COLOUR_ROBOT, COLOUR_FLOOR), ord("R"))
    robot = look.sgr(style(COLOUR_ROBOT, COLOUR_FLOOR))
    expected = f"{robot}\x1b[2;20HR\x1b[3;20HR\x1b[4;20HR\x1b[0m"
    assert encode(new, old, look, UNICODE) == expected


def test_without_colours_styles_that_look_alike_share_a_sequence() -> None:
    codes = np.array(
        [
            [
                code(style(fg, COLOUR_FLOOR), ord("x"))
                for fg in (COLOUR_SHELF, COLOUR_ROBOT, COLOUR_FLOOR_MARK)
            ]
        ]
    )
    assert encode(codes, None, Look(Depth.NONE), UNICODE).count("m") == 2


def test_a_field_of_many_colours_is_sent_in_reading_order() -> None:
    """Grouped by style it would be longer: nearly every pair of pixels has a style of its own."""
    random = np.random.default_rng(3)
    foregrounds, backgrounds = random.integers(0, 40, (2, 20, 60))
    codes = code(style(foregrounds, backgrounds), UNICODE.upper_half)
    look = Look(Depth.SIXTEEN)
    stream = encode(codes, None, look, UNICODE)
    assert stream.count("H") == 20
    assert wrong_cells(screen_of(stream, 60, 20), codes, look, UNICODE) == []


def floor(rows: int, columns: int) -> Codes:
    """Free floor with shelves."""
    y, x = np.mgrid[:rows, :columns]
    shelves = (x % 10 < 4) & (y % 4 == 3)
    mark, shelf = UNICODE.floor, UNICODE.shelf
    return np.where(
        shelves,
        code(style(COLOUR_SHELF, COLOUR_FLOOR), shelf),
        code(style(COLOUR_FLOOR_MARK, COLOUR_FLOOR), mark),
    ).astype(np.uint32)


def walk(robots: int, frames: int) -> list[Codes]:
    """Robots of one cell that all move in every frame, on 200 x 59; every second one is loaded."""
    random = np.random.default_rng(robots)
    extent = np.array([59, 200])
    place = (random.random((robots, 2)) * extent).astype(int)
    loaded = np.arange(robots) % 2
    foregrounds, shapes = (
        np.array([COLOUR_ROBOT, COLOUR_LOADED])[loaded],
        np.array([UNICODE.robot, UNICODE.loaded]),
    )
    pictures = []
    for _ in range(frames):
        direction = random.integers(4, size=robots)
        step = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])[direction]
        outside = ((place + step < 0) | (place + step >= extent)).any(axis=1)
        place = np.where(outside[:, None], place - step, place + step)
        picture = floor(59, 200)
        picture[tuple(place.T)] = code(style(foregrounds, COLOUR_FLOOR), shapes[loaded, direction])
        pictures.append(picture)
    return pictures


@pytest.mark.parametrize(("robots", "at_most"), [(100, 2500), (300, 6000), (1000, 15000)])
@pytest.mark.parametrize("depth", Depth)
def test_bytes_of_a_frame_in_which_every_robot_moves(
    robots: int, at_most: int, depth: Depth
) -> None:
    look, pictures = Look(depth), walk(robots, 40)
    sizes = [len(encode(new, old, look, UNICODE).encode()) for old, new in pairwise(pictures)]
    assert np.mean(sizes) <= at_most


def test_a_row_that_two_cells_share_needs_no_styles_of_its_own() -> None:
    floor_plan = open_floor(9, 9)
    robots = [{"cell": floor_plan.cell(x, 4), "load": x - 2} for x in (1, 4)]
    moved = [{**one, "cell": one["cell"] + floor_plan.stride} for one in robots]
    counts = []
    for zoom in ("3x1", "3x1.5"):
        old, new = (composed(make_scene(floor_plan, *fleet), zoom)[0] for fleet in (robots, moved))
        counts.append(encode(new, old, Look(Depth.TRUE), UNICODE).count("m"))
    assert counts[0] == counts[1]


def test_a_blank_is_written_in_a_style_that_other_cells_need() -> None:
    """It shows only its ground; but no robot vanishes before others appear."""
    look, old = Look(Depth.SIXTEEN), floor(1, 8)
    robot, mark = style(COLOUR_FLOOR, COLOUR_ROBOT), style(COLOUR_FLOOR_MARK, COLOUR_FLOOR)
    blanks = style(COLOUR_VOID, COLOUR_ROBOT), style(COLOUR_FLOOR, COLOUR_FLOOR)
    new = old.copy()
    new[0, :2] = code(robot, ord("R")), code(blanks[0], UNICODE.blank)
    new[0, 4] = code(blanks[1], UNICODE.braille[0])
    alone = encode(new, old, look, UNICODE)
    expected = f"{look.sgr(robot)}\x1b[HR {look.sgr(blanks[1])}\x1b[2C \x1b[0m"
    assert alone == expected, "blank floor is not written with the robot"
    new[0, 3] = code(mark, ord(","))
    beside = encode(new, old, look, UNICODE)
    assert beside == f"{look.sgr(robot)}\x1b[HR {look.sgr(mark)}\x1b[C, \x1b[0m"


def test_two_robots_in_one_row_of_characters_share_a_style_whichever_is_above() -> None:
    floor_plan = open_floor(2, 2)
    upper, lower = (
        make_scene(
            floor_plan,
            {"cell": floor_plan.cell(0, 0), "load": load},
            {"cell": floor_plan.cell(0, 1), "load": -1 - load},
        )
        for load in (0, -1)
    )
    shared = [composed(scene, "3x1.5")[0][1, 1] >> 16 for scene in (upper, lower)]
    assert shared[0] == shared[1]
