"""Any text in ASCII: what looks most like it, as many columns wide.

Frames become - | +, marks letters, an accented letter the letter, what is left a question mark.
"""

from __future__ import annotations

import unicodedata
from typing import Any, Final, overload

import numpy as np
from numpy.typing import NDArray

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


# The characters of the pictures: two sets of the same shapes, one in Unicode, one in ASCII.
#
# A glyph is an index into the characters of either set, so that a picture can be shown with the one
# or the other. Glyphs 32 to 126 are the printable ASCII characters themselves; 0 is the blank.
#
# unicode ▹▿◃▵ empty ▸▾◂▴ loaded ⊡ parked ▯▮ shelf ⊔ destination ◊ turntable ↯ charger ◫ rack ⊏ dock ⌂
# station ⋈ transfer station ⊓ pod ▫ storage without ≻⋎≺⋏ battery low ⍄⍌⍃⍓ the same, loaded ⊞ charges
# ∅ battery empty ✗ broken ▬ load ascii >v<^ empty }V{A loaded p parked #$ shelf = destination @
# turntable c charger H rack [ dock t station T transfer station P pod _ storage without ! battery low
# & the same, loaded C charges E battery empty X broken * load
#
# Every character is one column wide. None but the blocks ▀ ▄ █ is "ambiguous" in Unicode's table of
# East Asian widths, and so drawn two columns wide by some terminals (▲ ▶ ● ─ and → are).


Codes = NDArray[np.uint32]  # (rows, columns) style << GLYPH_BITS | glyph
Entries = list[tuple[tuple[int, ...], str]]  # lines of a legend: codes and what they mean
GLYPH_BITS: Final = 16
GLYPHS: Final = np.uint32((1 << GLYPH_BITS) - 1)

_PRINTABLE: Final = " " * 32 + "".join(map(chr, range(32, 127))) + " "
BRAILLE: Final = "".join(map(chr, range(0x2800, 0x2900)))
# Of the dots of a character, row and column: its place in BRAILLE is the sum of those that are set.
DOT_BITS: Final = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], np.uint8)
_unicode = list(_PRINTABLE)
_ascii = list(_PRINTABLE)


def _shapes(unicode: str, ascii: str) -> tuple[int, ...]:
    """Add shapes to both sets; their glyphs."""
    first = len(_unicode)
    _unicode.extend(unicode)
    _ascii.extend(ascii)
    assert len(_unicode) == len(_ascii), unicode
    return tuple(range(first, len(_unicode)))


def _shape(unicode: str, ascii: str) -> int:
    (glyph,) = _shapes(unicode, ascii)
    return glyph


def _by_dots(ramp: str) -> str:
    """The character of each braille pattern: the more dots, the darker."""
    return "".join(ramp[pattern.bit_count()] for pattern in range(256))


def _by_lines() -> str:
    """The character that looks most like the line of each braille pattern."""
    rows = (0x09, 0x12, 0x24, 0xC0)
    signs = [" "] * 256
    for pattern in range(1, 256):
        across = sum(pattern & row != 0 for row in rows)  # rows with a dot
        both = any(pattern & row == row for row in rows)
        signs[pattern] = "-" if across == 1 else "+" if both else "|"
    return "".join(signs)


class GlyphSet:
    """Names of the glyphs, and the characters that draw them. Directions are E, S, W, N."""

    blank: Final = 0
    digits: Final = tuple(range(ord("0"), ord("9") + 1))
    # Robots, by direction.
    robot: Final = _shapes("▹▿◃▵", ">v<^")
    loaded: Final = _shapes("▸▾◂▴", "}V{A")
    parked: Final = _shape("⊡", "p")
    low: Final = _shapes("≻⋎≺⋏", "!!!!")  # with a battery that is nearly empty
    low_loaded: Final = _shapes("⍄⍌⍃⍓", "&&&&")
    charging: Final = _shape("⊞", "C")
    drained: Final = _shape("∅", "E")  # down, without charge
    fault: Final = _shape("✗", "X")  # down because of a fault
    cargo: Final = _shape("▪", "$")  # beside a robot that carries a load
    # Cells.
    floor: Final = ord(".")  # a byte, where ⋅ has three: robots that move uncover much floor
    wall: Final = _shape("░", "%")
    track: Final = _shapes("╌╎", "-|")  # by axis
    crossing: Final = ord("+")  # of tracks, where no robot turns
    turntable: Final = _shape("◊", "@")  # in the fonts of all systems
    # ›⌄‹⌃, by direction; ASCII arrows are robots.
    one_way: Final = _shapes("\u203a⌄\u2039⌃", ")u(n")
    passing: Final = _shape("⇄", ":")
    unlimited: Final = ord("~")  # floor for any number of robots
    shelf: Final = _shape("▯", "#")
    load: Final = _shape("▮", "$")  # a shelf that holds a load
    destination: Final = _shape("⊔", "=")
    charger: Final = _shape("↯", "c")
    bay: Final = _shape("▢", "b")
    rack: Final = _shape("◫", "H")
    dock: Final = _shape("⊏", "[")
    station: Final = _shape("⌂", "t")
    transfer: Final = _shape("⋈", "T")  # a station between two zones
    pod: Final = _shape("⊓", "P")  # in a storage cell
    storage: Final = _shape("▫", "_")  # without a pod
    left_load: Final = _shape("▬", "*")  # on the floor, where a robot had to leave it
    closed: Final = _shape("⊠", "x")  # no robot enters
    door: Final = _shape("⊟", "D")  # that is shut
    # What is laid over them.
    route: Final = _shape("∙", "o")
    trail: Final = _shape("∘", ",")
    stand: Final = _shape("⊗", "O")  # where the route ends
    arrow: Final = _shapes("⇢⇣⇠⇡", ")u(n")  # flow, by direction
    ramp: Final = tuple(map(ord, " .:-=+*#@"))  # nine levels, for heat without colours
    # Several cells in a character.
    upper_half: Final = _shape("▀", "'")
    lower_half: Final = _shape("▄", ".")
    full: Final = _shape("█", ":")
    braille: Final = _shapes(BRAILLE, _by_dots(" .:-=+*#@"))
    fleet: Final = _shapes(BRAILLE, _by_dots(" rrrRRRRR"))  # the dots of robots
    fleet_full: Final = _shape(" ", "R")  # a character filled by robots: their colour is behind it
    fleet_half: Final = _shapes("▀▄", "rr")  # its upper and its lower half
    lines: Final = _shapes(BRAILLE, _by_lines())  # outlines of cells that are drawn

    def __init__(self, name: str, characters: str, shaded: bool) -> None:
        self.name = name
        self.characters = characters  # by glyph
        self.shaded = shaded  # heat is told by shades, half blocks cannot be told apart

    def __repr__(self) -> str:
        return f"GlyphSet({self.name!r})"


UNICODE: Final = GlyphSet("unicode", "".join(_unicode), shaded=False)
SHADED: Final = GlyphSet("unicode", "".join(_unicode), shaded=True)  # for terminals without colours
ASCII: Final = GlyphSet("ascii", "".join(_ascii), shaded=True)


@overload
def code(style: int, glyph: int) -> np.uint32: ...
@overload
def code(style: NDArray[Any], glyph: int | NDArray[Any]) -> Codes: ...
@overload
def code(style: int, glyph: NDArray[Any]) -> Codes: ...
def code(style: int | NDArray[Any], glyph: int | NDArray[Any]) -> np.uint32 | Codes:
    """What stands in a cell: a style and a glyph, as one number."""
    shifted = np.asarray(style, np.uint32) << np.uint32(GLYPH_BITS)
    codes: np.uint32 | Codes = shifted | np.asarray(glyph, np.uint32)
    return codes


def text(words: str) -> tuple[int, ...]:
    """The glyphs of a text, which are those of ASCII."""
    return tuple(to_ascii(words).encode("ascii"))
