"""Stills: a picture as text and as a drawing."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np

from tui.render.encode import as_svg, as_text, runs
from tui.render.styles import (
    ASCII,
    COLOUR_FAULT,
    COLOUR_FLOOR,
    COLOUR_FLOOR_MARK,
    COLOUR_LOADED,
    COLOUR_MARKED,
    COLOUR_ROBOT,
    COLOUR_SHELF,
    COLOUR_TABLE,
    COLOUR_TEXT,
    UNICODE,
    Codes,
    Depth,
    GlyphSet,
    Look,
    code,
    style,
    text,
)

SVG = "{http://www.w3.org/2000/svg}"


def small_picture(glyphs: GlyphSet) -> Codes:
    """Two robots between shelves, and an identity."""
    mark, shelf = (
        code(style(COLOUR_FLOOR_MARK, COLOUR_FLOOR), glyphs.floor),
        code(style(COLOUR_SHELF, COLOUR_FLOOR), glyphs.shelf),
    )
    codes = np.full((3, 8), mark)
    codes[1, 2:5] = shelf
    codes[0, 3] = code(style(COLOUR_ROBOT, COLOUR_FLOOR), glyphs.robot[0])
    codes[2, 6] = code(style(COLOUR_LOADED, COLOUR_MARKED), glyphs.loaded[3])
    codes[1, 6:] = code(style(COLOUR_TEXT, COLOUR_FLOOR), np.array(text("7 ")))
    return codes


def test_a_still_in_text_is_what_the_screen_shows() -> None:
    assert as_text(small_picture(ASCII), ASCII) == "...>....\n..###.7\n......A.\n"
    assert as_text(small_picture(UNICODE), UNICODE) == "...▹....\n..▯▯▯.7\n......▴.\n"


def test_a_row_is_cut_where_the_style_changes() -> None:
    codes = small_picture(ASCII)
    mark, shelf, words = (
        style(COLOUR_FLOOR_MARK, COLOUR_FLOOR),
        style(COLOUR_SHELF, COLOUR_FLOOR),
        style(COLOUR_TEXT, COLOUR_FLOOR),
    )
    expected = [("..", mark), ("###", shelf), (".", mark), ("7 ", words)]
    assert runs(codes[1], ASCII) == expected
    assert runs(codes[1, :0], ASCII) == []


def drawing(codes: Codes, look: Look, title: str = "") -> ET.Element:
    return ET.fromstring(as_svg(codes, look, UNICODE, title))


def letters(root: ET.Element) -> list[tuple[str, str, float, float]]:
    """(text, colour, x, y) of the words of a drawing."""
    return [
        (word.text or "", group.get("fill", ""), float(word.get("x", 0)), float(word.get("y", 0)))
        for group in root.iter(f"{SVG}g")
        for word in group.findall(f"{SVG}text")
    ]


def test_a_drawing_has_each_run_in_its_colour_and_place() -> None:
    look = Look(Depth.TRUE)
    words = letters(drawing(small_picture(UNICODE), look))
    colour = {fg: f"#{COLOUR_TABLE[fg].dark.true:06x}" for fg in (COLOUR_ROBOT, COLOUR_SHELF)}
    assert ("▹", colour[COLOUR_ROBOT], 27, 13) in words
    assert ("▯▯▯", colour[COLOUR_SHELF], 18, 31) in words
    assert len(words) == 10


def test_a_drawing_has_a_box_where_the_paper_is_not_the_floor() -> None:
    root = drawing(small_picture(UNICODE), Look(Depth.TRUE))
    (box,) = root.iter(f"{SVG}path")
    assert box.get("fill") == f"#{COLOUR_TABLE[COLOUR_MARKED].dark.true:06x}"
    assert box.get("d") == "M54 36h9v18h-9z"


def test_blocks_and_braille_are_drawn_without_letters() -> None:
    glyphs = [UNICODE.upper_half, UNICODE.lower_half, UNICODE.full, UNICODE.braille[0b10000001]]
    root = drawing(code(style(COLOUR_ROBOT, COLOUR_FLOOR), np.array([glyphs])), Look(Depth.TRUE))
    assert letters(root) == []
    (path,) = root.iter(f"{SVG}path")
    assert re.findall(r"M[^M]*", path.get("d", "")) == [
        *("M0 0h9v9h-9z", "M9 9h9v9h-9z", "M18 0h9v18h-9z"),
        *("M28 1h3v3h-3z", "M32 13h3v3h-3z"),
    ]


def test_a_title_is_written_on_a_bar_above() -> None:
    codes, look = small_picture(UNICODE), Look(Depth.TRUE, "light")
    plain, titled = drawing(codes, look), drawing(codes, look, "a <floor> & robots")
    assert titled.findtext(f"{SVG}text") == "a <floor> & robots"
    assert int(titled.get("height", 0)) == int(plain.get("height", 0)) + 28
    assert plain.findtext(f"{SVG}text") is None


def test_faults_are_bold_and_a_drawing_needs_no_other_file() -> None:
    codes = code(style(COLOUR_FAULT, COLOUR_FLOOR), np.array([[UNICODE.fault]]))
    svg = as_svg(codes, Look(Depth.TRUE), UNICODE)
    assert 'font-weight="bold"' in svg
    assert not re.search(r"href|url\(|@import", svg)


def test_a_drawing_of_a_full_screen_is_small() -> None:
    codes = np.full((59, 200), code(style(COLOUR_FLOOR_MARK, COLOUR_FLOOR), UNICODE.floor))
    places = np.random.default_rng(1).permutation(codes.size)[:1000]
    codes.reshape(-1)[places] = code(style(COLOUR_ROBOT, COLOUR_FLOOR), UNICODE.robot[0])
    assert len(as_svg(codes, Look(Depth.TRUE), UNICODE)) < 130_000
