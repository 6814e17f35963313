"""The palette: no two meanings merge, everything is legible, shape carries what colour cannot."""

from __future__ import annotations

import unicodedata
from itertools import combinations, pairwise

import numpy as np
import pytest

from tui.render import styles
from tui.render.depth import Depth, depth_of, glyphs_of
from tui.render.glyphs import ASCII, UNICODE, GlyphSet, code, text
from tui.render.styles import COLOURS, FLOOR, HEAT_0, STYLES, ZONE_0, Look, contrast, style

COLOURED = [
    Look(depth, theme)
    for depth in (Depth.SIXTEEN, Depth.INDEXED, Depth.TRUE)
    for theme in ("dark", "light")
]
every_look = pytest.mark.parametrize(
    "look", COLOURED, ids=lambda look: f"{look.depth.name}-{look.theme}"
)
ROBOTS = (
    *(styles.ROBOT, styles.LOADED, styles.PARKED, styles.CHARGING, styles.LOW),
    *(styles.WAITS, styles.FAULT, styles.SELECTED),
)
CELLS = (
    *(styles.WALL, styles.RACK, styles.SHELF, styles.BAY, styles.TURNTABLE),
    *(styles.CHARGER, styles.DESTINATION, styles.DOCK, styles.STATION, styles.LOAD),
)
WRITTEN = (styles.TEXT, styles.DIM, styles.DONE, styles.ROUTE)
HEAT = range(HEAT_0, HEAT_0 + 9)
ZONES = range(ZONE_0, ZONE_0 + 8)


def ink(look: Look, colour: int) -> int:
    return look.pair(style(colour, FLOOR))[0]


def clearness(look: Look, colour: int, paper: int) -> float:
    return contrast(*look.pair(style(colour, paper)), look.depth)


def test_the_first_style_is_the_plain_floor_and_the_first_code_is_blank() -> None:
    assert style(FLOOR, FLOOR) == 0
    assert code(0, UNICODE.blank) == 0
    assert UNICODE.characters[0] == ASCII.characters[0] == " "


def test_styles_and_codes_are_made_of_arrays_of_any_kind() -> None:
    inks = np.array([styles.ROBOT, styles.SELECTED], np.uint8)
    made = style(inks, styles.MARKED)
    assert made.tolist() == [style(int(one), styles.MARKED) for one in inks]
    codes = code(made, UNICODE.digits[7])
    assert codes.dtype == np.uint32
    assert (codes >> 16).tolist() == made.tolist()
    assert (codes & 0xFFFF).tolist() == [ord("7")] * 2
    assert style(FLOOR, inks).tolist() == inks.tolist()


def test_another_paper_changes_neither_glyph_nor_ink() -> None:
    codes = code(style(np.array([styles.ROBOT, styles.FAULT]), ZONE_0), np.array([200, 65]))
    expected = code(
        style(np.array([styles.ROBOT, styles.FAULT]), styles.CURSOR), np.array([200, 65])
    )
    assert styles.repapered(codes, styles.CURSOR).tolist() == expected.tolist()
    back = styles.repapered(expected, np.array([ZONE_0, ZONE_0]))
    assert back.tolist() == codes.tolist()


@every_look
def test_no_two_states_of_a_robot_and_no_two_kinds_of_zone_or_heat_merge(look: Look) -> None:
    groups = [ROBOTS] if look.depth == Depth.SIXTEEN else [(*ROBOTS, *CELLS), (*ZONES, FLOOR), HEAT]
    for group in groups:
        for one, other in combinations(group, 2):
            assert ink(look, one) != ink(look, other), (COLOURS[one].name, COLOURS[other].name)


@every_look
def test_robots_have_other_colours_than_what_stands_around_them(look: Look) -> None:
    ground = {ink(look, colour) for colour in (FLOOR, *CELLS)}
    moving = (styles.ROBOT, styles.WAITS, styles.FAULT, styles.SELECTED)
    assert not ground & {ink(look, colour) for colour in moving}


@every_look
def test_signs_on_the_floor_are_legible(look: Look) -> None:
    """WCAG asks 4.5 of text and 3 of signs; of 16 colours each terminal has its own."""
    text_at_least, sign_at_least = (2.0, 2.0) if look.depth == Depth.SIXTEEN else (4.5, 2.5)
    for colour in WRITTEN:
        for paper in (FLOOR, styles.VOID):
            assert clearness(look, colour, paper) >= text_at_least, COLOURS[colour].name
    for colour in (*CELLS, styles.TRACK, styles.FLOW):
        assert clearness(look, colour, FLOOR) >= sign_at_least, COLOURS[colour].name
    for colour in ROBOTS:
        assert clearness(look, colour, FLOOR) >= max(sign_at_least, 2.0), COLOURS[colour].name


@every_look
def test_robots_are_legible_on_every_paper(look: Look) -> None:
    papers = (*HEAT, *ZONES, styles.MARKED, styles.CURSOR, styles.SELECTED)
    for colour in ROBOTS:
        for paper in papers:
            if (colour, paper) != (styles.SELECTED, styles.SELECTED):
                names = COLOURS[colour].name, COLOURS[paper].name
                assert clearness(look, colour, paper) >= styles.LEGIBLE, names


@pytest.mark.parametrize("theme", ["dark", "light"])
@pytest.mark.parametrize("depth", [Depth.INDEXED, Depth.TRUE])
def test_heat_rises_from_the_floor_in_steps_that_grow_brighter_or_darker(
    theme: styles.Theme, depth: Depth
) -> None:
    look = Look(depth, theme)
    levels = [look.pair(style(level, FLOOR)) for level in HEAT]
    assert levels[0] == look.pair(0)
    black = {Depth.INDEXED: 16, Depth.TRUE: 0}[depth]
    brightness = [contrast(value, black, depth) for value, _ in levels]
    rising = [b > a for a, b in pairwise(brightness)]
    assert rising == [theme == "dark"] * 8


def test_a_robot_on_a_hot_cell_takes_its_ink_of_the_other_theme() -> None:
    dark = Look(Depth.TRUE, "dark")
    assert dark.pair(style(styles.ROBOT, HEAT_0 + 2))[0] == COLOURS[styles.ROBOT].dark.true
    assert dark.pair(style(styles.ROBOT, HEAT_0 + 8))[0] == COLOURS[styles.ROBOT].light.true


def test_a_picture_of_pixels_shows_grounds_as_they_are() -> None:
    look = Look(Depth.TRUE, "dark")
    for one, other in combinations((*HEAT, *ZONES), 2):
        assert look.pair(style(one, other))[0] == COLOURS[one].dark.true


@pytest.mark.parametrize("depth", Depth)
def test_what_matters_most_is_painted_first_and_the_floor_last(depth: Depth) -> None:
    rank = Look(depth).rank
    assert len(set(rank.tolist())) == STYLES
    order = (
        *(styles.SELECTED, styles.FAULT, styles.LOADED, styles.ROBOT, styles.ROUTE),
        *(styles.LOAD, styles.SHELF, styles.FLOOR_MARK, FLOOR),
    )
    assert sorted(order, key=lambda colour: rank[style(colour, FLOOR)]) == list(order)
    assert rank[style(styles.TRACK, styles.SELECTED)] < rank[style(styles.FAULT, FLOOR)]


def test_without_colour_no_colour_is_sent_and_attributes_tell_what_needs_attention() -> None:
    look = Look(Depth.NONE)
    parameters = {look.sgr(number) for number in range(STYLES)}
    numbers = {n for one in parameters for n in one[2:-1].split(";")}
    assert numbers == {"0", "1", "4", "7"}
    alarming = [style(colour, FLOOR) for colour in (styles.ROBOT, styles.WAITS, styles.FAULT)]
    selected = [style(styles.ROBOT, paper) for paper in (styles.SELECTED, styles.CURSOR)]
    assert len({look.sgr(number) for number in (*alarming, *selected)}) == 5
    assert look.attributes(style(FLOOR, styles.ROBOT)).reverse  # a number cut out of a robot
    assert look.css(style(styles.FAULT, FLOOR))[:2] == look.css(0)[1::-1]


@pytest.mark.parametrize("depth", Depth)
def test_a_robot_that_waits_is_told_by_more_than_its_colour(depth: Depth) -> None:
    look = Look(depth)
    for paper in (FLOOR, styles.HEAT_5, styles.ZONE_2):
        waits, drives = (look.attributes(style(ink, paper)) for ink in (styles.WAITS, styles.ROBOT))
        assert waits.underline and not drives.underline
    if depth != Depth.NONE:  # words in that colour are not underlined: they lead nowhere
        assert not look.attributes(style(styles.WAITS, styles.VOID)).underline


@pytest.mark.parametrize("depth", Depth)
@pytest.mark.parametrize("theme", ["dark", "light"])
def test_rich_sends_the_same_colours(depth: Depth, theme: styles.Theme) -> None:
    from rich.color import ColorSystem
    from screens import cell_at, screen_of

    look = Look(depth, theme)
    for number in range(0, STYLES, 7):
        ours = look.sgr(number) + "x"
        theirs = look.rich(number).render("x", color_system=ColorSystem.TRUECOLOR)
        assert cell_at(screen_of(ours, 2, 1), 0, 0) == cell_at(screen_of(theirs, 2, 1), 0, 0)


@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=lambda glyphs: glyphs.name)
def test_every_character_is_one_column_wide(glyphs: GlyphSet) -> None:
    blocks = "▀▄█"
    for character in glyphs.characters:
        narrow = unicodedata.east_asian_width(character) in ("N", "Na")
        assert (narrow or character in blocks) and not unicodedata.combining(character)
        assert character.isprintable()


def test_both_sets_have_the_same_shapes_and_ascii_is_ascii() -> None:
    assert len(ASCII.characters) == len(UNICODE.characters)
    assert ASCII.characters.isascii()
    assert "".join(UNICODE.characters[glyph] for glyph in text("Robot 12")) == "Robot 12"
    assert UNICODE.characters[UNICODE.braille[0x47]] == chr(0x2847)


@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=lambda glyphs: glyphs.name)
def test_robots_are_told_by_shape_in_every_direction(glyphs: GlyphSet) -> None:
    robots = (*glyphs.robot, *glyphs.loaded, glyphs.parked, glyphs.fault)
    ways = slice(4) if glyphs is UNICODE else slice(1)  # ASCII has too few signs for those
    robots += (*glyphs.low[ways], *glyphs.low_loaded[ways], glyphs.charging, glyphs.drained)
    cells = (
        *(glyphs.floor, glyphs.wall, glyphs.turntable, glyphs.shelf, glyphs.load),
        *(glyphs.rack, glyphs.dock, glyphs.station, glyphs.left_load),
        *(glyphs.destination, glyphs.charger, glyphs.bay, glyphs.passing, glyphs.unlimited),
        *(*glyphs.track, glyphs.crossing, *glyphs.one_way, glyphs.route, glyphs.stand),
    )
    drawn = [glyphs.characters[glyph] for glyph in (*robots, *cells)]
    assert len(set(drawn)) == len(drawn)


@pytest.mark.parametrize(
    ("environ", "option", "expected"),
    [
        ({"TERM": "xterm-256color", "COLORTERM": "truecolor"}, "auto", Depth.TRUE),
        ({"TERM": "xterm-kitty"}, "auto", Depth.TRUE),
        ({"TERM": "xterm-direct"}, "auto", Depth.TRUE),
        ({"TERM": "tmux-256color"}, "auto", Depth.INDEXED),
        ({"TERM": "xterm"}, "auto", Depth.SIXTEEN),
        ({"TERM": "linux"}, "auto", Depth.SIXTEEN),
        ({"TERM": "dumb", "COLORTERM": "truecolor"}, "auto", Depth.NONE),
        ({"TERM": "xterm-256color", "NO_COLOR": "1"}, "auto", Depth.NONE),
        ({"TERM": "xterm-256color", "NO_COLOR": ""}, "auto", Depth.INDEXED),
        ({"TERM": "xterm-256color", "NO_COLOR": "1"}, "true", Depth.TRUE),
        ({"COLORTERM": "truecolor"}, "16", Depth.SIXTEEN),
        ({"COLORTERM": "truecolor"}, "256", Depth.INDEXED),
        ({"COLORTERM": "truecolor"}, "none", Depth.NONE),
    ],
)
def test_colours_follow_the_environment_and_the_option_has_the_last_word(
    environ: dict[str, str], option: str, expected: Depth
) -> None:
    assert depth_of(environ, option) == expected


@pytest.mark.parametrize(
    ("environ", "option", "expected"),
    [
        ({"LANG": "de_DE.UTF-8"}, "auto", UNICODE),
        ({"LANG": "C.utf8"}, "auto", UNICODE),
        ({}, "auto", UNICODE),
        ({"LANG": "C", "LC_CTYPE": "C.UTF-8"}, "auto", ASCII),  # as Python itself leaves it
        ({"LC_CTYPE": "C.UTF-8"}, "auto", UNICODE),
        ({"LANG": "C", "LC_CTYPE": "de_DE.UTF-8"}, "auto", UNICODE),
        ({"LANG": "de_DE.UTF-8", "LC_ALL": "C"}, "auto", ASCII),
        ({"LANG": "de_DE.ISO-8859-1"}, "auto", ASCII),
        ({"LANG": "de_DE.UTF-8", "TERM": "linux"}, "auto", ASCII),
        ({"LANG": "de_DE.UTF-8", "TERM": "linux"}, "unicode", UNICODE),
        ({"LANG": "de_DE.UTF-8"}, "ascii", ASCII),
    ],
)
def test_characters_follow_the_locale_and_the_option_has_the_last_word(
    environ: dict[str, str], option: str, expected: GlyphSet
) -> None:
    assert glyphs_of(environ, option) is expected
