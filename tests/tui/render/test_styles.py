"""The palette: no two meanings merge, everything is legible, shape carries what colour cannot."""

from __future__ import annotations

import re
import unicodedata
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

from automaton.drawings.looks import CELL_LETTERS
from tui.render import styles
from tui.render.cell_looks import TINT_CODES
from tui.render.styles import (
    ASCII,
    COLOUR_FLOOR,
    COLOUR_HEAT_0,
    COLOUR_TABLE,
    COLOUR_ZONE_0,
    STYLE_COUNT,
    UNICODE,
    Depth,
    GlyphSet,
    Look,
    code,
    contrast,
    style,
    text,
)
from tui.terminal.options import depth_of, glyphs_of

COLOURED = [
    Look(depth, theme)
    for depth in (Depth.SIXTEEN, Depth.INDEXED, Depth.TRUE)
    for theme in ("dark", "light")
]
every_look = pytest.mark.parametrize(
    "look", COLOURED, ids=lambda look: f"{look.depth.name}-{look.theme}"
)
ROBOTS = (
    *(
        styles.COLOUR_ROBOT,
        styles.COLOUR_LOADED,
        styles.COLOUR_PARKED,
        styles.COLOUR_CHARGING,
        styles.COLOUR_LOW_BATTERY,
    ),
    *(styles.COLOUR_WAITING, styles.COLOUR_FAULT, styles.COLOUR_SELECTED),
)
CELLS = (
    *(
        styles.COLOUR_WALL,
        styles.COLOUR_RACK,
        styles.COLOUR_SHELF,
        styles.COLOUR_BAY,
        styles.COLOUR_TURNTABLE,
    ),
    *(
        styles.COLOUR_CHARGER,
        styles.COLOUR_DESTINATION,
        styles.COLOUR_DOCK,
        styles.COLOUR_STATION,
        styles.COLOUR_LOAD,
    ),
)
HEAT = range(COLOUR_HEAT_0, COLOUR_HEAT_0 + 9)
ZONES = range(COLOUR_ZONE_0, COLOUR_ZONE_0 + 8)


def fg(look: Look, colour: int) -> int:
    return look.pair(style(colour, COLOUR_FLOOR))[0]


def test_the_first_style_is_the_plain_floor_and_the_first_code_is_blank() -> None:
    assert style(COLOUR_FLOOR, COLOUR_FLOOR) == 0
    assert code(0, UNICODE.blank) == 0
    assert UNICODE.characters[0] == ASCII.characters[0] == " "


def test_styles_and_codes_are_made_of_arrays_of_any_kind() -> None:
    foregrounds = np.array([styles.COLOUR_ROBOT, styles.COLOUR_SELECTED], np.uint8)
    made = style(foregrounds, styles.COLOUR_MARKED)
    assert made.tolist() == [style(int(one), styles.COLOUR_MARKED) for one in foregrounds]
    codes = code(made, UNICODE.digits[7])
    assert codes.dtype == np.uint32
    assert (codes >> 16).tolist() == made.tolist()
    assert (codes & 0xFFFF).tolist() == [ord("7")] * 2
    assert style(COLOUR_FLOOR, foregrounds).tolist() == foregrounds.tolist()


def test_another_paper_changes_neither_glyph_nor_ink() -> None:
    codes = code(
        style(np.array([styles.COLOUR_ROBOT, styles.COLOUR_FAULT]), COLOUR_ZONE_0),
        np.array([200, 65]),
    )
    expected = code(
        style(np.array([styles.COLOUR_ROBOT, styles.COLOUR_FAULT]), styles.COLOUR_CURSOR),
        np.array([200, 65]),
    )
    assert styles.with_background(codes, styles.COLOUR_CURSOR).tolist() == expected.tolist()
    back = styles.with_background(expected, np.array([COLOUR_ZONE_0, COLOUR_ZONE_0]))
    assert back.tolist() == codes.tolist()


@every_look
def test_no_two_states_of_a_robot_and_no_two_kinds_of_zone_or_heat_merge(look: Look) -> None:
    groups = (
        [ROBOTS]
        if look.depth == Depth.SIXTEEN
        else [(*ROBOTS, *CELLS), (*ZONES, COLOUR_FLOOR), HEAT]
    )
    for group in groups:
        for one, other in combinations(group, 2):
            assert fg(look, one) != fg(look, other), (
                COLOUR_TABLE[one].name,
                COLOUR_TABLE[other].name,
            )


@every_look
def test_robots_have_other_colours_than_what_stands_around_them(look: Look) -> None:
    ground = {fg(look, colour) for colour in (COLOUR_FLOOR, *CELLS)}
    moving = (
        styles.COLOUR_ROBOT,
        styles.COLOUR_WAITING,
        styles.COLOUR_FAULT,
        styles.COLOUR_SELECTED,
    )
    assert not ground & {fg(look, colour) for colour in moving}


@pytest.mark.parametrize("theme", ["dark", "light"])
@pytest.mark.parametrize("depth", [Depth.INDEXED, Depth.TRUE])
def test_heat_rises_from_the_floor_in_steps_that_grow_brighter_or_darker(
    theme: styles.Theme, depth: Depth
) -> None:
    look = Look(depth, theme)
    levels = [look.pair(style(level, COLOUR_FLOOR)) for level in HEAT]
    assert levels[0] == look.pair(0)
    black = {Depth.INDEXED: 16, Depth.TRUE: 0}[depth]
    brightness = [contrast(value, black, depth) for value, _ in levels]
    rising = [b > a for a, b in pairwise(brightness)]
    assert rising == [theme == "dark"] * 8


def test_a_robot_on_a_hot_cell_takes_its_ink_of_the_other_theme() -> None:
    dark = Look(Depth.TRUE, "dark")
    assert (
        dark.pair(style(styles.COLOUR_ROBOT, COLOUR_HEAT_0 + 2))[0]
        == COLOUR_TABLE[styles.COLOUR_ROBOT].dark.true
    )
    assert (
        dark.pair(style(styles.COLOUR_ROBOT, COLOUR_HEAT_0 + 8))[0]
        == COLOUR_TABLE[styles.COLOUR_ROBOT].light.true
    )


def test_a_picture_of_pixels_shows_grounds_as_they_are() -> None:
    look = Look(Depth.TRUE, "dark")
    for one, other in combinations((*HEAT, *ZONES), 2):
        assert look.pair(style(one, other))[0] == COLOUR_TABLE[one].dark.true


@pytest.mark.parametrize("depth", Depth)
def test_what_matters_most_is_painted_first_and_the_floor_last(depth: Depth) -> None:
    rank = Look(depth).rank
    assert len(set(rank.tolist())) == STYLE_COUNT
    order = (
        *(
            styles.COLOUR_SELECTED,
            styles.COLOUR_FAULT,
            styles.COLOUR_LOADED,
            styles.COLOUR_ROBOT,
            styles.COLOUR_ROUTE,
        ),
        *(styles.COLOUR_LOAD, styles.COLOUR_SHELF, styles.COLOUR_FLOOR_MARK, COLOUR_FLOOR),
    )
    assert sorted(order, key=lambda colour: rank[style(colour, COLOUR_FLOOR)]) == list(order)
    assert (
        rank[style(styles.COLOUR_TRACK, styles.COLOUR_SELECTED)]
        < rank[style(styles.COLOUR_FAULT, COLOUR_FLOOR)]
    )


def test_without_colour_no_colour_is_sent_and_attributes_tell_what_needs_attention() -> None:
    look = Look(Depth.NONE)
    parameters = {look.sgr(number) for number in range(STYLE_COUNT)}
    numbers = {n for one in parameters for n in one[2:-1].split(";")}
    assert numbers == {"0", "1", "4", "7"}
    alarming = [
        style(colour, COLOUR_FLOOR)
        for colour in (styles.COLOUR_ROBOT, styles.COLOUR_WAITING, styles.COLOUR_FAULT)
    ]
    selected = [
        style(styles.COLOUR_ROBOT, bg) for bg in (styles.COLOUR_SELECTED, styles.COLOUR_CURSOR)
    ]
    assert len({look.sgr(number) for number in (*alarming, *selected)}) == 5
    # a number cut out of a robot
    assert look.attributes(style(COLOUR_FLOOR, styles.COLOUR_ROBOT)).reverse
    assert look.css(style(styles.COLOUR_FAULT, COLOUR_FLOOR))[:2] == look.css(0)[1::-1]


@pytest.mark.parametrize("depth", Depth)
def test_a_robot_that_waits_is_told_by_more_than_its_colour(depth: Depth) -> None:
    look = Look(depth)
    for bg in (COLOUR_FLOOR, styles.COLOUR_HEAT_5, styles.COLOUR_ZONE_2):
        waits, drives = (
            look.attributes(style(fg, bg)) for fg in (styles.COLOUR_WAITING, styles.COLOUR_ROBOT)
        )
        assert waits.underline and not drives.underline
    if depth != Depth.NONE:  # words in that colour are not underlined: they lead nowhere
        assert not look.attributes(style(styles.COLOUR_WAITING, styles.COLOUR_VOID)).underline


@pytest.mark.parametrize("depth", Depth)
@pytest.mark.parametrize("theme", ["dark", "light"])
def test_rich_sends_the_same_colours(depth: Depth, theme: styles.Theme) -> None:
    from rich.color import ColorSystem
    from terminal_replay import cell_at, screen_of

    look = Look(depth, theme)
    for number in range(0, STYLE_COUNT, 7):
        ours = look.sgr(number) + "x"
        theirs = look.rich(number).render("x", color_system=ColorSystem.TRUECOLOR)
        assert cell_at(screen_of(ours, 2, 1), 0, 0) == cell_at(screen_of(theirs, 2, 1), 0, 0)


@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=lambda glyphs: glyphs.name)
def test_every_character_is_one_column_wide(glyphs: GlyphSet) -> None:
    blocks = "▀▄█▌"
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
        *(glyphs.rack, glyphs.dock, glyphs.station, glyphs.left_load, glyphs.closed, glyphs.door),
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


def test_no_letter_has_two_meanings_on_maps_and_in_drawings() -> None:
    named = vars(type(ASCII))
    meanings: dict[str, set[str]] = {letter: {name} for name, letter in CELL_LETTERS.items()}
    same = {"bay": "parking-bay", "fleet_full": "fleet", "fleet_half": "fleet"}
    same |= {"fleet_quarters": "fleet", "one_way": "direction", "way": "direction"}
    same |= {"arrow": "direction", "one_way_head": "closed direction"}
    for name, glyphs in named.items():
        if isinstance(glyphs, int | tuple) and not name.startswith("_"):
            for glyph in np.atleast_1d(glyphs).tolist():
                meanings.setdefault(ASCII.characters[glyph], set()).add(same.get(name, name))
    for letter in map(chr, TINT_CODES):
        meanings.setdefault(letter, set()).add("tint")
    letters = {letter: names for letter, names in meanings.items() if letter.isalpha()}
    assert len(letters) > 25
    assert {letter: names for letter, names in letters.items() if len(names) > 1} == {}


def test_the_guide_names_the_signs_that_are_drawn_without_unicode() -> None:
    guide = Path(__file__).parents[3] / "docs/how-to/watch-a-fleet.md"
    rows = guide.read_text(encoding="utf-8").partition("| sign | without Unicode |")[2]
    pairs = [
        (UNICODE.characters.index(sign), letter)
        for row in rows.partition("\n\n")[0].splitlines()[2:]
        for sign, letter in zip(
            *(re.findall("`(.)`", cell) for cell in row.split("|")[1:3]), strict=True
        )
    ]
    assert len(pairs) > 6
    assert {glyph: letter for glyph, letter in pairs} == {
        glyph: ASCII.characters[glyph] for glyph, _ in pairs
    }
