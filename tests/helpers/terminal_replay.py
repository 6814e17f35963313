"""What a terminal shows after some bytes, replayed in pyte: characters, colours and attributes.

    screen = screen_of(data, columns=80, rows=24)      all bytes at once, as if the terminal were new
    screen.display[3]                                  a row of text
    cell_at(screen, row, column)                       Cell(character, ink, paper, bold, ...)
    wrong_cells(screen, codes, look, glyphs, top, left)  where it does not show these codes

Colours are named as pyte names them: "rrggbb" for true colour and 256, "red" or "brightred" for
16, "default" where none was set. Programs that stream keep a `pyte.Screen` of their own and give
`for_pyte(text)` to it.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
import pyte
from numpy.typing import NDArray
from pyte import graphics
from pyte.screens import Char

from tui.render.styles import Depth, GlyphSet, Look

# Sequences that pyte 0.8.2 does not know and prints as text: kitty's keyboard protocol, questions
# about modes and their answers, synchronized output.
UNKNOWN = re.compile(r"\x1b\[(?:[<>=?][\d;]*u|\?[\d;]*\$[py]|\?2026[hl])")


class Cell(NamedTuple):
    """One cell of a terminal."""

    character: str
    ink: str
    paper: str
    bold: bool
    underline: bool
    reverse: bool


def for_pyte(text: str) -> str:
    """The same without what pyte chokes on."""
    return UNKNOWN.sub("", text)


def screen_of(data: bytes | str, columns: int, rows: int) -> pyte.Screen:
    """The screen of a terminal of this size that got these bytes."""
    text = data if isinstance(data, str) else data.decode("utf-8", "replace")
    screen = pyte.Screen(columns, rows)
    pyte.Stream(screen).feed(for_pyte(text))
    return screen


def cell_at(screen: pyte.Screen, row: int, column: int) -> Cell:
    """What is shown there."""
    char: Char = screen.buffer[row][column]
    return Cell(char.data, char.fg, char.bg, char.bold, char.underscore, char.reverse)


def cell_of(code: int, look: Look, glyphs: GlyphSet) -> Cell:
    """What a code has to look like on a terminal; nothing of the encoder goes into it."""
    style, glyph = divmod(int(code), 1 << 16)
    if look.depth == Depth.NONE:
        ink = paper = "default"
    else:
        ink, paper = (
            _name(value, look.depth, place) for place, value in enumerate(look.pair(style))
        )
    return Cell(glyphs.characters[glyph], ink, paper, *look.attributes(style))


def _name(value: int, depth: Depth, place: int) -> str:
    """pyte's name of a colour; place 0 is the ink, 1 the paper."""
    if depth == Depth.TRUE:
        return f"{value:06x}"
    if depth == Depth.INDEXED:
        return str(graphics.FG_BG_256[value])
    plain, bright = (
        (graphics.FG_ANSI, graphics.FG_AIXTERM),
        (graphics.BG_ANSI, graphics.BG_AIXTERM),
    )[place]
    number = value + (30, 40)[place] if value < 8 else value - 8 + (90, 100)[place]
    return str((plain if value < 8 else bright)[number])


def wrong_cells(
    screen: pyte.Screen,
    codes: NDArray[np.uint32],
    look: Look,
    glyphs: GlyphSet,
    top: int = 0,
    left: int = 0,
) -> list[tuple[int, int]]:
    """(row, column) in `codes` of the cells that the screen does not show as it should."""
    return [
        (row, column)
        for row, column in np.ndindex(*codes.shape)
        if seen(cell_at(screen, top + row, left + column))
        != seen(cell_of(codes[row, column], look, glyphs))
    ]


def seen(cell: Cell) -> Cell:
    """The same without what a blank does not show: its weight and, unless underlined, its ink."""
    if cell.character != " ":
        return cell
    ink, paper = (cell.paper, cell.ink) if cell.reverse else (cell.ink, cell.paper)
    return cell._replace(ink=ink if cell.underline else "", paper=paper, bold=False)
