"""A picture that stands still: as text, as a drawing."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from rich.cells import cell_len

from tui.render.glyphs import GLYPH_BITS, GLYPHS, Codes, GlyphSet
from tui.render.styles import COLOUR_TEXT, COLOUR_VOID, Look, style


def runs(row: NDArray[np.uint32], glyphs: GlyphSet) -> list[tuple[str, int]]:
    """A row of codes as (text, style), neighbours of one style together."""
    if not row.size:
        return []
    styles = row >> np.uint32(GLYPH_BITS)
    starts = [0, *(np.flatnonzero(styles[1:] != styles[:-1]) + 1).tolist()]
    words = _words(row, glyphs)
    ends = [*starts[1:], len(words)]
    numbers = styles[starts].tolist()
    return [(words[a:b], style) for a, b, style in zip(starts, ends, numbers, strict=True)]


def _words(row: NDArray[np.uint32], glyphs: GlyphSet) -> str:
    characters = glyphs.characters
    return "".join([characters[glyph] for glyph in (row & GLYPHS).tolist()])


def as_text(codes: Codes, glyphs: GlyphSet) -> str:
    """Characters alone, one line for each row, without blanks at their ends."""
    return "".join(_words(row, glyphs).rstrip() + "\n" for row in codes)


# A cell of a drawing in pixels, and the size of letters whose advance is a cell's width.
CHARACTER_WIDTH, CHARACTER_HEIGHT, FONT_SIZE, BASELINE = 9, 18, 15, 13
LETTER_RUNS = "[^ ▀▄█\u2800-\u28ff]+(?: [^ ▀▄█\u2800-\u28ff]+)*"  # words, blanks between them
DOTS = ((0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3))  # column, row by bit
TITLE_BAR_HEIGHT = 28  # height of the title bar
BOLD = ' font-weight="bold"'
FONTS = "'DejaVu Sans Mono', Menlo, Consolas, 'Liberation Mono', monospace"


class Run(NamedTuple):
    """Neighbouring characters of one look."""

    text: str
    fg: str  # as a style sheet writes it
    bg: str
    bold: bool


def as_svg(codes: Codes, look: Look, glyphs: GlyphSet, title: str = "") -> str:
    """A drawing that needs nothing beside itself, under a bar with a title if there is one."""
    rows = ([Run(text, *look.css(n)) for text, n in runs(row, glyphs)] for row in codes)
    return svg_of(rows, codes.shape, look, title)


def svg_of(
    rows: Iterable[Iterable[Run]], shape: tuple[int, ...], look: Look, title: str = ""
) -> str:
    """The same of any characters; `shape`: rows and columns, as of a terminal."""
    bar = TITLE_BAR_HEIGHT if title else 0
    width, height = shape[1] * CHARACTER_WIDTH, shape[0] * CHARACTER_HEIGHT + bar
    ground = look.css(0)[1]
    drawing = _Drawing(ground)
    for number, row in enumerate(rows):
        column = 0
        for run in row:
            drawing.add(run, column, number)
            column += cell_len(run.text)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
        f' width="{width}" height="{height}" font-family="{FONTS}" font-size="{FONT_SIZE}">'
        f'<rect width="{width}" height="{height}" fill="{ground}"/>'
        f"{_bar(title, width, look) if title else ''}"
        f'<g transform="translate(0 {bar})">{drawing.body()}</g></svg>\n'
    )


def _bar(title: str, width: int, look: Look) -> str:
    fg, bg, _ = look.css(style(COLOUR_TEXT, COLOUR_VOID))
    return (
        f'<rect width="{width}" height="{TITLE_BAR_HEIGHT}" fill="{bg}"/>'
        f'<text x="{width / 2:g}" y="19" fill="{fg}" text-anchor="middle">{escape(title)}</text>'
    )


class _Drawing:
    """Boxes and letters, gathered by colour.

    Blocks and braille are drawn as boxes: letters leave seams, and many fonts have no braille.
    """

    def __init__(self, ground: str) -> None:
        self._ground = ground
        self._boxes: dict[str, list[str]] = {}
        self._letters: dict[tuple[str, bool], list[str]] = {}

    def add(self, run: Run, column: int, row: int) -> None:
        """Characters of one look."""
        text, fg, bg, bold = run
        x, y = column * CHARACTER_WIDTH, row * CHARACTER_HEIGHT
        if bg != self._ground:
            self._box(bg, x, y, cell_len(text), CHARACTER_HEIGHT)
        for block in re.finditer(r"▀+|▄+|█+", text):
            upper, high = (
                block[0][0] != "▄",
                CHARACTER_HEIGHT if block[0][0] == "█" else CHARACTER_HEIGHT // 2,
            )
            at = y if upper else y + CHARACTER_HEIGHT // 2
            self._box(fg, x + block.start() * CHARACTER_WIDTH, at, len(block[0]), high)
        for braille in re.finditer("[\u2801-\u28ff]", text):
            self._dots(fg, x + braille.start() * CHARACTER_WIDTH, y, ord(braille[0]) - 0x2800)
        for word in re.finditer(LETTER_RUNS, text):
            self._letters.setdefault((fg, bold), []).append(
                f'<text x="{x + word.start() * CHARACTER_WIDTH}" y="{y + BASELINE}"'
                f' textLength="{cell_len(word[0]) * CHARACTER_WIDTH}">{escape(word[0])}</text>'
            )

    def _dots(self, fg: str, x: int, y: int, pattern: int) -> None:
        for bit, (column, row) in enumerate(DOTS):
            if pattern >> bit & 1:
                dot = f"M{x + 1 + 4 * column} {y + 1 + 4 * row}h3v3h-3z"
                self._boxes.setdefault(fg, []).append(dot)

    def _box(self, colour: str, x: int, y: int, cells: int, height: int) -> None:
        box = f"M{x} {y}h{cells * CHARACTER_WIDTH}v{height}h-{cells * CHARACTER_WIDTH}z"
        self._boxes.setdefault(colour, []).append(box)

    def body(self) -> str:
        boxes = (
            f'<path fill="{colour}" d="{"".join(shapes)}"/>'
            for colour, shapes in self._boxes.items()
        )
        letters = (
            f'<g fill="{fg}"{BOLD if bold else ""}>{"".join(words)}</g>'
            for (fg, bold), words in self._letters.items()
        )
        return f'<g shape-rendering="crispEdges">{"".join(boxes)}</g>{"".join(letters)}'
