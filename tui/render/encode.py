"""The difference of two pictures as bytes for a terminal.

    SGR of the selection  move cell  SGR of loaded robots  move cell cell move cell ...  SGR of floor ...

Each style is set once, in order of rank, so that robots appear in their new cells before they
vanish from the old ones; a picture torn in the middle shows a robot twice, never not at all. Within
a style cells come row by row. Where a terminal has moved on by itself after the last column is
uncertain, so that from there every move is absolute.

A cell is three words of eight bytes, filled up with zeros that are dropped at the end: the vertical
part of the move to it, the horizontal part, its character.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tui.render.glyphs import GLYPH_BITS, GLYPHS, Codes, GlyphSet
from tui.render.styles import Look

RESET: Final = "\x1b[0m"
ZERO: Final = b"\0"


class Words(NamedTuple):
    """Short sequences, each in 8 bytes, and their lengths."""

    bytes: NDArray[np.uint64]
    lengths: NDArray[np.int64]


class Moves(NamedTuple):
    """The parts of moves on a screen of at most `size` rows and columns."""

    rows: Words  # (size + 1,) to a row, counted from 1; a column has to follow
    columns: Words  # (size + 1,) to a column in it, counted from 1
    down: Words  # (size + 1,) so many rows down
    across: Words  # (2 size + 1,) so many columns to the right, less `size`


class Painting(NamedTuple):
    """Cells in the order in which they are painted, how to get to each, and where styles change."""

    vertical: NDArray[np.uint64]
    horizontal: NDArray[np.uint64]
    character: NDArray[np.uint64]
    sgrs: list[str]
    starts: list[int]  # of each style
    size: int  # in bytes


def encode(
    new: Codes, old: Codes | None, look: Look, glyphs: GlyphSet, top: int = 0, left: int = 0
) -> str:
    """What makes a terminal that shows `old` at (top, left) show `new`; "" if nothing differs.

    Without `old` everything is painted. The cursor is left anywhere, the style is reset.
    """
    flat = new.reshape(-1)
    changed = np.arange(flat.size) if old is None else np.flatnonzero(flat != old.reshape(-1))
    if not changed.size:
        return ""
    moves = _moves(_rounded(max(top + new.shape[0], left + new.shape[1])))
    width = new.shape[1]
    ranks = look.rank[flat[changed] >> np.uint32(GLYPH_BITS)]
    changed = changed[np.argsort(ranks, kind="stable")]
    painting = _painting(flat, changed, width, look, glyphs, moves, (top, left))
    if painting.size > flat.size and painting.size > _least(flat, look, glyphs):
        whole = _painting(flat, np.arange(flat.size), width, look, glyphs, moves, (top, left))
        painting = min(painting, whole, key=lambda one: one.size)
    return _text(painting)


def _least(flat: NDArray[np.uint32], look: Look, glyphs: GlyphSet) -> int:
    """What a whole picture takes at least in reading order: its characters and changes of style."""
    styles = flat >> np.uint32(GLYPH_BITS)
    present = np.flatnonzero(np.bincount(styles))
    sgrs = [look.sgr(style) for style in present.tolist()]
    alike = np.zeros(present[-1] + 1, np.intp)  # the same number for styles that look the same
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
    """How to paint these cells in this order."""
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
    """Where another sequence has to be sent, and which; without colours many styles share one."""
    starts: list[int] = []
    sgrs = [""]
    firsts = [0, *(np.flatnonzero(styles[1:] != styles[:-1]) + 1).tolist()]
    for first, code in zip(firsts, styles[firsts].tolist(), strict=True):
        sgr = look.sgr(code)
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
    """The shorter way to each cell, absolute or from the one before: both parts, and its length."""
    top, left = corner
    to_row, to_column = row + top + 1, column + left + 1
    down, right = np.diff(row, prepend=0), np.diff(column, prepend=0) - 1
    across = right + len(moves.columns.bytes) - 1
    absolute = moves.rows.lengths[to_row] + moves.columns.lengths[to_column]
    relative = moves.down.lengths[down] + moves.across.lengths[across]
    is_relative = (relative < absolute) & (down >= 0)
    # Neither the cursor's first place nor its place behind the last column is known.
    is_relative[0] = False
    is_relative[1:] &= column[:-1] != width - 1
    vertical = np.where(is_relative, moves.down.bytes[down], moves.rows.bytes[to_row])
    horizontal = np.where(is_relative, moves.across.bytes[across], moves.columns.bytes[to_column])
    return vertical, horizontal, np.where(is_relative, relative, absolute)


def _text(painting: Painting) -> str:
    """The bytes of a painting, as text."""
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
    """Up to the next power of two, so that few tables of moves are made."""
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
