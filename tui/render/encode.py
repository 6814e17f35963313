"""Encode pictures as bytes for a terminal, as text and as SVG.

A terminal receives the difference between two pictures:

    SGR of the selection  move cell  SGR of loaded robots  move cell cell move cell ...  SGR of floor ...

Each style is set once, in order of rank, so that robots appear in their new cells before they vanish
from the old ones: a picture torn in the middle may show a robot twice, but never omits one. A blank
shows only its ground, so it is written in a style with this ground that other cells need. Within a
style, cells are written row by row. Terminals differ in where the cursor is after the last column, so
that the next move is absolute.

A cell is three words of eight bytes: the vertical part of the move to it, the horizontal part, and
its character. They are padded with zeros, which are dropped at the end.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Final, NamedTuple
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from rich.cells import cell_len

from tui.render.styles import (
    COLOUR_LOAD,
    COLOUR_TEXT,
    COLOUR_VOID,
    GLYPH_BITS,
    GLYPHS,
    QUARTER_SIGNS,
    Codes,
    GlyphSet,
    Look,
    code,
    prominence,
    style,
)

RESET: Final = "\x1b[0m"
ZERO: Final = b"\0"


class Words(NamedTuple):
    """Short sequences, each in 8 bytes, and their lengths."""

    bytes: NDArray[np.uint64]
    lengths: NDArray[np.int64]


class Moves(NamedTuple):
    """Cursor moves, in parts, on a screen of at most `size` rows and columns."""

    rows: Words  # (size + 1,) to a row, counted from 1; a column must follow
    columns: Words  # (size + 1,) to a column in it, counted from 1
    down: Words  # (size + 1,) down by a number of rows
    across: Words  # (2 size + 1,) right by the index minus `size`


class Painting(NamedTuple):
    """Cells in painting order, with the moves to them and the changes of style."""

    vertical: NDArray[np.uint64]
    horizontal: NDArray[np.uint64]
    character: NDArray[np.uint64]
    sgrs: list[str]
    starts: list[int]  # first cell of each style
    size: int  # in bytes


def encode(
    new: Codes, old: Codes | None, look: Look, glyphs: GlyphSet, top: int = 0, left: int = 0
) -> str:
    """The sequence that changes a terminal's `old` at (top, left) to `new`; "" if equal.

    Without `old` it paints everything. The final cursor position is arbitrary; the style is reset.
    """
    flat = new.reshape(-1)
    changed = np.arange(flat.size) if old is None else np.flatnonzero(flat != old.reshape(-1))
    if not changed.size:
        return ""
    moves = _moves(_rounded(max(top + new.shape[0], left + new.shape[1])))
    width = new.shape[1]
    flat = flat.copy()
    flat[changed] = _with_shared_blanks(flat[changed], look, glyphs)
    ranks = look.rank[flat[changed] >> np.uint32(GLYPH_BITS)]
    changed = changed[np.argsort(ranks, kind="stable")]
    painting = _painting(flat, changed, width, look, glyphs, moves, (top, left))
    if painting.size > flat.size and painting.size > _least(flat, look, glyphs):
        whole = _painting(flat, np.arange(flat.size), width, look, glyphs, moves, (top, left))
        painting = min(painting, whole, key=lambda one: one.size)
    return _text(painting)


def _with_shared_blanks(codes: NDArray[np.uint32], look: Look, glyphs: GlyphSet) -> Codes:
    """The codes, with blanks in styles of other cells where that looks the same.

    Blank floor is written with signs of cells, not with overlays and robots: those come first.
    """
    styles = codes >> np.uint32(GLYPH_BITS)
    blank = _characters(glyphs.characters).bytes[codes & GLYPHS] == ord(" ")
    needed = np.flatnonzero(np.bincount(styles[~blank])).tolist()
    for own in np.flatnonzero(np.bincount(styles[blank])).tolist():
        latest = max(prominence(own), COLOUR_LOAD)
        shared = [
            other
            for other in needed
            if prominence(other) <= latest and look.blank(other) == look.blank(own)
        ]
        if shared and own not in needed:
            styles[blank & (styles == own)] = max(shared, key=lambda one: look.rank[one])
    return code(styles, codes & GLYPHS)


def _least(flat: NDArray[np.uint32], look: Look, glyphs: GlyphSet) -> int:
    """A lower bound of a whole picture's bytes in reading order: characters and style changes."""
    styles = flat >> np.uint32(GLYPH_BITS)
    present = np.flatnonzero(np.bincount(styles))
    sgrs = [look.sgr(style) for style in present.tolist()]
    alike = np.zeros(present[-1] + 1, np.intp)  # equal for styles that look the same
    alike[present] = [sgrs.index(sgr) for sgr in sgrs]
    shown = alike[styles]
    changes = 1 + int(np.count_nonzero(shown[1:] != shown[:-1]))
    characters = _characters(glyphs.characters).lengths[flat & GLYPHS]
    return int(characters.sum()) + changes * min(map(len, sgrs))


def _painting(
    flat: NDArray[np.uint32],
    order: NDArray[np.intp],
    width: int,
    look: Look,
    glyphs: GlyphSet,
    moves: Moves,
    corner: tuple[int, int],
) -> Painting:
    """The painting of these cells in this order."""
    codes = flat[order]
    row, column = np.divmod(order, width)
    vertical, horizontal, move_length = _shortest(row, column, width, moves, corner)
    glyph = codes & GLYPHS
    characters = _characters(glyphs.characters)
    styles = codes >> np.uint32(GLYPH_BITS)
    starts, sgrs = _changes_of_style(styles, look)
    size = int(move_length.sum()) + int(characters.lengths[glyph].sum()) + sum(map(len, sgrs))
    return Painting(vertical, horizontal, characters.bytes[glyph], sgrs, starts, size)


def _changes_of_style(styles: NDArray[np.uint32], look: Look) -> tuple[list[int], list[str]]:
    """Where the style sequence changes, and to what; without colours many styles share one."""
    starts: list[int] = []
    sgrs = [""]
    firsts = [0, *(np.flatnonzero(styles[1:] != styles[:-1]) + 1).tolist()]
    for first, number in zip(firsts, styles[firsts].tolist(), strict=True):
        sgr = look.sgr(number)
        if sgr != sgrs[-1]:
            starts.append(first)
            sgrs.append(sgr)
    return starts, sgrs[1:]


def _shortest(
    row: NDArray[np.intp],
    column: NDArray[np.intp],
    width: int,
    moves: Moves,
    corner: tuple[int, int],
) -> tuple[NDArray[np.uint64], NDArray[np.uint64], NDArray[np.int64]]:
    """The shorter move to each cell, absolute or relative: both parts, and the length."""
    top, left = corner
    to_row, to_column = row + top + 1, column + left + 1
    down, right = np.diff(row, prepend=0), np.diff(column, prepend=0) - 1
    across = right + len(moves.columns.bytes) - 1
    absolute = moves.rows.lengths[to_row] + moves.columns.lengths[to_column]
    relative = moves.down.lengths[down] + moves.across.lengths[across]
    is_relative = (relative < absolute) & (down >= 0)
    # The cursor is at an unknown place at first and after the last column.
    is_relative[0] = False
    is_relative[1:] &= column[:-1] != width - 1
    vertical = np.where(is_relative, moves.down.bytes[down], moves.rows.bytes[to_row])
    horizontal = np.where(is_relative, moves.across.bytes[across], moves.columns.bytes[to_column])
    return vertical, horizontal, np.where(is_relative, relative, absolute)


def _text(painting: Painting) -> str:
    """The painting as one string."""
    cells = np.stack((painting.vertical, painting.horizontal, painting.character), axis=1)
    pieces: list[bytes] = []
    ends = [*painting.starts[1:], len(cells)]
    for sgr, start, end in zip(painting.sgrs, painting.starts, ends, strict=True):
        pieces.append(sgr.encode())
        pieces.append(cells[start:end].tobytes().translate(None, ZERO))
    return b"".join(pieces).decode() + RESET


def _words(texts: list[str]) -> Words:
    encoded = np.array([text.encode() for text in texts], "S8")
    return Words(encoded.view(np.uint64), np.char.str_len(encoded).astype(np.int64))


def _rounded(size: int) -> int:
    """`size` rounded up to a power of two, to limit the number of tables of moves."""
    return 1 << (size - 1).bit_length()


@lru_cache(maxsize=4)
def _moves(size: int) -> Moves:
    numbers = range(1, size + 1)
    down = ["", "\x1b[B", *(f"\x1b[{n}B" for n in numbers[1:])]
    right = ["", "\x1b[C", *(f"\x1b[{n}C" for n in numbers[1:])]
    left = [f"\x1b[{n}D" for n in reversed(numbers[1:])] + ["\x1b[D"]
    rows = ["", "\x1b[", *(f"\x1b[{n}" for n in numbers[1:])]
    columns = ["", "H", *(f";{n}H" for n in numbers[1:])]
    return Moves(_words(rows), _words(columns), _words(down), _words(left + right))


@lru_cache(maxsize=2)
def _characters(characters: str) -> Words:
    return _words(list(characters))


# Still pictures.


def runs(row: NDArray[np.uint32], glyphs: GlyphSet) -> list[tuple[str, int]]:
    """A row of codes as pairs (text, style), one per stretch of equal style."""
    if not row.size:
        return []
    styles = row >> np.uint32(GLYPH_BITS)
    starts = [0, *(np.flatnonzero(styles[1:] != styles[:-1]) + 1).tolist()]
    words = _row_text(row, glyphs)
    ends = [*starts[1:], len(words)]
    numbers = styles[starts].tolist()
    return [(words[a:b], style) for a, b, style in zip(starts, ends, numbers, strict=True)]


def _row_text(row: NDArray[np.uint32], glyphs: GlyphSet) -> str:
    characters = glyphs.characters
    return "".join([characters[glyph] for glyph in (row & GLYPHS).tolist()])


def as_text(codes: Codes, glyphs: GlyphSet) -> str:
    """The characters only, one line per row, without trailing blanks."""
    return "".join(_row_text(row, glyphs).rstrip() + "\n" for row in codes)


# A character's size in pixels, and the font size whose advance is this width.
CHARACTER_WIDTH, CHARACTER_HEIGHT, FONT_SIZE, BASELINE = 9, 18, 15, 13
LETTER_RUNS = (
    "[^ ▀▄█▌▐▖-▟\u2800-\u28ff]+(?: [^ ▀▄█▌▐▖-▟\u2800-\u28ff]+)*"  # words with single blanks
)
DOTS = ((0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3))  # column, row by bit
TITLE_BAR_HEIGHT = 28  # height of the title bar
BOLD = ' font-weight="bold"'
FONTS = "'DejaVu Sans Mono', Menlo, Consolas, 'Liberation Mono', monospace"


class TextRun(NamedTuple):
    """Adjacent characters of one look."""

    text: str
    fg: str  # as in CSS
    bg: str
    bold: bool


def as_svg(codes: Codes, look: Look, glyphs: GlyphSet, title: str = "") -> str:
    """A self-contained SVG, under a bar with the title if there is one."""
    rows = ([TextRun(text, *look.css(n)) for text, n in runs(row, glyphs)] for row in codes)
    return svg_of(rows, codes.shape, look, title)


def svg_of(
    rows: Iterable[Iterable[TextRun]], shape: tuple[int, ...], look: Look, title: str = ""
) -> str:
    """The SVG of any characters; `shape`: rows and columns, as of a terminal."""
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
    """Boxes and letters, grouped by colour.

    Blocks and braille are drawn as boxes: letters leave seams, and many fonts lack braille.
    """

    def __init__(self, ground: str) -> None:
        self._ground = ground
        self._boxes: dict[str, list[str]] = {}
        self._letters: dict[tuple[str, bool], list[str]] = {}

    def add(self, run: TextRun, column: int, row: int) -> None:
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
        for sign in re.finditer("[▌▐▖-▟]", text):
            self._quarters(fg, x + sign.start() * CHARACTER_WIDTH, y, QUARTER_SIGNS.index(sign[0]))
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

    def _quarters(self, fg: str, x: int, y: int, filled: int) -> None:
        wide, high = CHARACTER_WIDTH / 2, CHARACTER_HEIGHT // 2
        for n in range(4):
            if filled >> n & 1:
                box = f"M{x + n % 2 * wide:g} {y + n // 2 * high}h{wide}v{high}h-{wide}z"
                self._boxes.setdefault(fg, []).append(box)

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
