"""Any text in ASCII: what looks most like it, as many columns wide.

Frames become - | +, marks letters, an accented letter the letter, what is left a question mark.
"""

from __future__ import annotations

import unicodedata
from typing import Final

LOOKALIKES: Final = {
    " ": "\N{NO-BREAK SPACE}▁▂▔░\N{BRAILLE PATTERN BLANK}",
    "-": "─━┄┅┈┉╌╍═‐‑‒–—−▬⎯╸╺",  # noqa: RUF001
    "|": "│┃┆┇┊┋╎╏║▏▎▍▌▕▐╹╻",
    "_": "▃▄",
    "'": "‘’▀",  # noqa: RUF001
    '"': "“”",
    "#": "█▉▊▋▅▆▇▓▒■",
    ">": "▶▸►→▹›",  # noqa: RUF001
    "<": "◀◂◄←◃‹",  # noqa: RUF001
    "^": "▲▴↑⌃⇧",
    "v": "▼▾↓⌄",
    "x": "✓✔×",  # noqa: RUF001
    "X": "✗✖✘⭘",
    "*": "•●◉★",
    "o": "○◌◯",
    ".": "·⋅∙",
    "~": "…",
    "/": "╱🔎",  # noqa: RUF001
    "\\": "╲",
}
UNKNOWN: Final = "?"
FRAMES: Final = range(0x2500, 0x2580)  # corners and crossings, as far as they are not above


class AsciiFallback(dict[int, str]):
    """By code point; made for a character when it is met for the first time."""

    def __missing__(self, point: int) -> str:
        spelled = self[point] = _fallback(chr(point))
        return spelled


def _fallback(character: str) -> str:
    from rich.cells import cell_len  # pictures of plain floors do without it

    if character.isascii():
        return character
    columns = cell_len(character)
    alike = next((sign for sign, many in LOOKALIKES.items() if character in many), "")
    if not alike and ord(character) in FRAMES:
        alike = "+"
    plain = "".join(c for c in unicodedata.normalize("NFKD", character) if c.isascii())
    return ((alike or plain)[:columns] or UNKNOWN * columns).ljust(columns)


ASCII_FALLBACK: Final = AsciiFallback()


def to_ascii(text: str) -> str:
    """The text in ASCII; no line gets longer or shorter on the screen."""
    return text if text.isascii() else text.translate(ASCII_FALLBACK)
