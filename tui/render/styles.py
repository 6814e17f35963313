"""The content of a character of the screen: its code, one number for a glyph and a style.

A glyph is an index into the characters of either of two sets, so that a picture can be shown in
Unicode or in ASCII. Glyphs 32 to 126 are the printable ASCII characters themselves; 0 is the blank.

    unicode   ▹▿◃▵ empty  ▸▾◂▴ loaded  ⊡ parked  ▯▮ shelf  ⊔ destination  ◊ turntable  ↯ charger
              ◫ rack  ⊏ dock  ⌂ station  ⋈ transfer station  ⊓ pod  ▫ storage without
              ≻⋎≺⋏ battery low  ⍄⍌⍃⍓ the same, loaded  ⊞ charges  ∅ battery empty  ✗ broken  ▬ load
    ascii     >v<^ empty  }V{A loaded  B parked  #$ shelf  = destination  @ turntable  c charger
              H rack  [ dock  t station  T transfer station  p pod  q storage without
              ! battery low  & the same, loaded  C charges  Z battery empty  X broken  * load

No letter has two meanings, here or in drawings (automaton.drawings.looks.CELL_LETTERS): floors are
drawn in scenarios with the same letters for chargers, parking bays and stations.

Every character is one column wide. Except for the blocks ▀ ▄ █ ▌, none is "ambiguous" in Unicode's
table of East Asian widths: some terminals draw such characters two columns wide (▲ ▶ ● ─ →).

A style is a foreground on a background, both rows of one table of colours. The colours are those of
Okabe and Ito, which colour-blind people can distinguish; floor, walls and shelves are greys; heat has
the hues of cividis. Every colour has a value for dark and for light themes, in true colour, among 256
and among 16, chosen by hand: an automatic choice would merge orange with vermillion. Shape is always
the second channel.
"""

from __future__ import annotations

import unicodedata
from enum import IntEnum
from functools import cache
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from rich.style import Style

Codes = NDArray[np.uint32]  # (rows, columns) style << GLYPH_BITS | glyph
Entries = list[tuple[tuple[int, ...], str]]  # lines of a legend: codes and their meaning
GLYPH_BITS: Final = 16
GLYPHS: Final = np.uint32((1 << GLYPH_BITS) - 1)

_PRINTABLE: Final = " " * 32 + "".join(map(chr, range(32, 127))) + " "
# By the quarters that are filled: 1 upper left, 2 upper right, 4 lower left, 8 lower right.
QUARTER_SIGNS: Final = " ▘▝▀▖▌▞▛▗▚▐▜▄▙▟█"
BRAILLE: Final = " " + "".join(map(chr, range(0x2801, 0x2900)))  # a blank has one byte
# By row and column of a dot; a character's index in BRAILLE is the sum over its set dots.
DOT_BITS: Final = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], np.uint8)
_unicode = list(_PRINTABLE)
_ascii = list(_PRINTABLE)


def _shapes(unicode: str, ascii: str) -> tuple[int, ...]:
    """Add shapes to both sets; returns their glyphs."""
    first = len(_unicode)
    _unicode.extend(unicode)
    _ascii.extend(ascii)
    assert len(_unicode) == len(_ascii), unicode
    return tuple(range(first, len(_unicode)))


def _shape(unicode: str, ascii: str) -> int:
    (glyph,) = _shapes(unicode, ascii)
    return glyph


def _by_dots(ramp: str) -> str:
    """The character for each braille pattern: more dots are darker."""
    return "".join(ramp[pattern.bit_count()] for pattern in range(256))


def _by_quarters(quarters: str) -> str:
    """For each braille pattern the character of QUARTER_SIGNS that covers its dots."""
    masks = (0x03, 0x18, 0x44, 0xA0)
    return "".join(
        quarters[sum((pattern & mask != 0) << n for n, mask in enumerate(masks))]
        for pattern in range(256)
    )


def _by_lines() -> str:
    """The character most similar to the line of each braille pattern."""
    rows = (0x09, 0x12, 0x24, 0xC0)
    signs = [" "] * 256
    for pattern in range(1, 256):
        across = sum(pattern & row != 0 for row in rows)  # rows with a dot
        both = any(pattern & row == row for row in rows)
        signs[pattern] = "-" if across == 1 else "+" if both else "|"
    return "".join(signs)


class GlyphSet:
    """Names of glyphs, and the characters that draw them. Directions are E, S, W, N."""

    blank: Final = 0
    digits: Final = tuple(range(ord("0"), ord("9") + 1))
    # Robots, by direction.
    robot: Final = _shapes("▹▿◃▵", ">v<^")
    loaded: Final = _shapes("▸▾◂▴", "}V{A")
    parked: Final = _shape("⊡", "B")
    idle: Final = _shape("⊚", "I")
    ghost: Final = _shape("◌", "G")  # a robot of the run beside this one
    low: Final = _shapes("≻⋎≺⋏", "!!!!")  # with a nearly empty battery
    low_loaded: Final = _shapes("⍄⍌⍃⍓", "&&&&")
    charging: Final = _shape("⊞", "C")
    drained: Final = _shape("∅", "Z")  # down, without charge
    fault: Final = _shape("✗", "X")  # down because of a fault
    cargo: Final = _shape("▪", "$")  # beside a robot that carries a load
    # Cells.
    floor: Final = ord(".")  # one byte, where ⋅ has three: moving robots uncover much floor
    wall = _shape("░", "%")
    track: Final = _shapes("╌╎", "-|")  # by axis
    crossing: Final = ord("+")  # of tracks, where no robot turns
    turntable: Final = _shape("◊", "@")  # in the fonts of all systems
    # ›⌄‹⌃, by direction; ASCII arrows are robots.
    one_way: Final = _shapes("\u203a⌄\u2039⌃", ")u(n")
    passing: Final = _shape("⇄", ":")
    unlimited: Final = ord("~")  # floor with room for any number of robots
    shelf = _shape("▯", "#")
    load: Final = _shape("▮", "$")  # a shelf that holds a load
    destination = _shape("⊔", "=")
    charger = _shape("↯", "c")
    bay = _shape("▢", "b")
    rack = _shape("◫", "H")
    dock = _shape("⊏", "[")
    station = _shape("⌂", "t")
    transfer: Final = _shape("⋈", "T")  # a station between two zones
    pod: Final = _shape("⊓", "p")  # in a storage cell
    storage: Final = _shape("▫", "q")  # without a pod
    left_load: Final = _shape("▬", "*")  # on the floor, where a robot had to leave it
    closed: Final = _shape("⊠", "x")  # no robot enters
    door: Final = _shape("⊟", "D")  # shut
    open_door: Final = _shape("⋂", '"')
    lift: Final = _shape("⇅", "L")
    closing: Final = _shape("⊝", ";")  # closed at times, for instance while people cross
    # Overlays.
    route: Final = _shape("∙", "o")
    trail: Final = _shape("∘", ",")
    stand: Final = _shape("⊗", "O")  # where the route ends
    arrow: Final = _shapes("⇢⇣⇠⇡", ")u(n")  # flow, by direction
    ramp: Final = tuple(map(ord, " .:-=+*#@"))  # nine levels, for heat without colours
    # Several cells per character.
    upper_half: Final = _shape("▀", "'")
    lower_half: Final = _shape("▄", ".")
    full: Final = _shape("█", ":")
    braille: Final = _shapes(BRAILLE, _by_dots(" .:-=+*#@"))
    fleet: Final = _shapes(BRAILLE, _by_dots(" rrrRRRRR"))  # the dots of robots
    fleet_quarters: Final = _shapes(_by_quarters(QUARTER_SIGNS), _by_quarters(" rrRrRRRrRRRRRRR"))
    fleet_full: Final = _shape(" ", "R")  # a character filled by robots, by its background
    fleet_half: Final = _shapes("▀▄", "rr")  # its upper and its lower half
    lines: Final = _shapes(BRAILLE, _by_lines())  # outlines of drawn cells
    # Streets, by direction. Filled heads would look like loaded robots, or are in few fonts; ASCII arrows
    # are robots.
    way: Final = _shapes("⇢⇣⇠⇡", "eswn")
    one_way_head: Final = _shapes("↠↡↞↟", "ESWN")

    def __init__(self, name: str, characters: str, shaded: bool) -> None:
        self.name = name
        self.characters = characters  # by glyph
        self.shaded = shaded  # shades show heat; half blocks look alike

    def __repr__(self) -> str:
        return f"GlyphSet({self.name!r})"


UNICODE: Final = GlyphSet("unicode", "".join(_unicode), shaded=False)
SHAPES: Final = {sign: glyph for glyph, sign in enumerate(_unicode) if not sign.isascii()}
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


# Any text in ASCII: each character becomes the most similar text of the same width.
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
UNKNOWN_CHARACTER: Final = "?"
# Other corners and crossings of frames become +.
FRAMES: Final = range(0x2500, 0x2580)


class AsciiFallback(dict[int, str]):
    """A table by code point that adds characters on demand."""

    def __missing__(self, point: int) -> str:
        spelled = self[point] = _fallback(chr(point))
        return spelled


def _fallback(character: str) -> str:
    from rich.cells import cell_len  # plain floors do not need Rich

    if character.isascii():
        return character
    columns = cell_len(character)
    alike = next((sign for sign, many in LOOKALIKES.items() if character in many), "")
    if not alike and ord(character) in FRAMES:
        alike = "+"
    plain = "".join(c for c in unicodedata.normalize("NFKD", character) if c.isascii())
    return ((alike or plain)[:columns] or UNKNOWN_CHARACTER * columns).ljust(columns)


ASCII_FALLBACK: Final = AsciiFallback()


def to_ascii(text: str) -> str:
    """The text in ASCII; lines keep their widths on the screen."""
    return text if text.isascii() else text.translate(ASCII_FALLBACK)


def text(words: str) -> tuple[int, ...]:
    """The glyphs of a text in ASCII, and of shapes in it."""
    spelled = ((SHAPES[c],) if c in SHAPES else to_ascii(c).encode("ascii") for c in words)
    return tuple(glyph for glyphs in spelled for glyph in glyphs)


class Depth(IntEnum):
    """Colour depth of a terminal."""

    NONE = 0  # bold, underline and reverse only
    SIXTEEN = 1
    INDEXED = 2  # 256
    TRUE = 3


DEPTHS: Final = {
    "none": Depth.NONE,
    "16": Depth.SIXTEEN,
    "256": Depth.INDEXED,
    "true": Depth.TRUE,
}
Theme = Literal["dark", "light"]


class ColourShades(NamedTuple):
    """One colour on terminals of each depth."""

    true: int  # 0xRRGGBB
    indexed: int  # of 256; above 15, since terminals differ in the first 16
    sixteen: int


class Colour(NamedTuple):
    """One row of the table."""

    name: str
    dark: ColourShades
    light: ColourShades
    bold: bool


_rows: list[Colour] = []


def _row(
    name: str, dark: tuple[int, int, int], light: tuple[int, int, int], bold: bool = False
) -> int:
    """Add a row; returns its index."""
    _rows.append(Colour(name, ColourShades(*dark), ColourShades(*light), bold))
    return len(_rows) - 1


# From the ground up: later rows are more prominent and are painted earlier.
# Grounds. Heat omits the middle greys, on which no foreground is legible.
COLOUR_FLOOR: Final = _row("floor", (0x121212, 233, 0), (0xFFFFFF, 231, 15))
COLOUR_VOID: Final = _row("beyond the floor", (0x080808, 232, 0), (0xEEEEEE, 255, 15))
COLOUR_HEAT_0: Final = _row("heat 0", (0x121212, 233, 0), (0xFFFFFF, 231, 15))
COLOUR_HEAT_1: Final = _row("heat 1", (0x00224E, 17, 4), (0xFBF3C0, 230, 11))
COLOUR_HEAT_2: Final = _row("heat 2", (0x17325F, 18, 4), (0xF3E48E, 229, 11))
COLOUR_HEAT_3: Final = _row("heat 3", (0x33426B, 238, 8), (0xE3CF6C, 222, 3))
COLOUR_HEAT_4: Final = _row("heat 4", (0x465070, 240, 8), (0xCDBA66, 179, 3))
COLOUR_HEAT_5: Final = _row("heat 5", (0xBDB066, 143, 3), (0x4F5A75, 240, 8))
COLOUR_HEAT_6: Final = _row("heat 6", (0xD2C25C, 179, 3), (0x3B496C, 238, 8))
COLOUR_HEAT_7: Final = _row("heat 7", (0xE8D54C, 185, 11), (0x20386A, 18, 4))
COLOUR_HEAT_8: Final = _row("heat 8", (0xFEEB62, 228, 11), (0x00224E, 17, 4))
COLOUR_ZONE_0: Final = _row("zone 0", (0x14305C, 17, 4), (0xD6DFFA, 189, 12))
COLOUR_ZONE_1: Final = _row("zone 1", (0x4D3F00, 58, 3), (0xFAF3C4, 230, 11))
COLOUR_ZONE_2: Final = _row("zone 2", (0x00504A, 23, 6), (0xC9F5F2, 195, 14))
COLOUR_ZONE_3: Final = _row("zone 3", (0x55205C, 53, 5), (0xFAD6F4, 225, 13))
COLOUR_ZONE_4: Final = _row("zone 4", (0x3A3A3A, 237, 8), (0xDADADA, 253, 7))
COLOUR_ZONE_5: Final = _row("zone 5", (0x5E1C14, 52, 1), (0xFCD5CE, 224, 9))
COLOUR_ZONE_6: Final = _row("zone 6", (0x12430F, 22, 2), (0xD3F2CB, 194, 10))
COLOUR_ZONE_7: Final = _row("zone 7", (0x4B4B80, 60, 7), (0xAFC9F0, 153, 6))
COLOUR_FLOOR_MARK: Final = _row("floor mark", (0x626262, 241, 8), (0x919191, 246, 8))
# Cells.
COLOUR_TRACK: Final = _row("track", (0x767676, 243, 8), (0x828282, 244, 8))
COLOUR_FLOW: Final = _row("direction", (0x5F8787, 66, 6), (0x5F8787, 66, 8))
COLOUR_WALL: Final = _row("wall", (0x6C6C6C, 242, 8), (0x585858, 240, 8))
COLOUR_FAR_SHELF: Final = _row("storage from afar", (0x86654A, 95, 3), (0xB08860, 137, 8))
COLOUR_RACK: Final = _row("rack", (0x858585, 245, 8), (0x767676, 243, 8))
COLOUR_SHELF: Final = _row("shelf", (0x949494, 246, 7), (0x6C6C6C, 242, 8))
COLOUR_BAY: Final = _row("bay", (0x7A7AA8, 103, 8), (0x7474A0, 61, 8))
COLOUR_TURNTABLE: Final = _row("turntable", (0xA8648C, 132, 5), (0x96648A, 96, 5))
COLOUR_CHARGER: Final = _row("charger", (0xAFAF5F, 143, 2), (0x75750A, 100, 0))
COLOUR_DESTINATION: Final = _row("destination", (0x3F8FE0, 68, 12), (0x2A2AA8, 19, 12))
COLOUR_DOCK: Final = _row("dock", (0x5FA35F, 71, 2), (0x3F753F, 65, 12))
COLOUR_STATION: Final = _row("station", (0xC48484, 174, 3), (0xA05050, 131, 5))
COLOUR_LOAD: Final = _row("load", (0xB08860, 137, 3), (0x7A5C45, 95, 0))
# Text and overlays.
COLOUR_DIM: Final = _row("dim text", (0x8F8F8F, 246, 8), (0x606060, 241, 0))
COLOUR_TRAIL: Final = _row("trail", (0x8C8C6A, 101, 8), (0x6F6F48, 58, 8))
COLOUR_GOAL_LINE: Final = _row("line to a goal", (0x8A80A8, 103, 8), (0x6F6590, 60, 8))
COLOUR_TEXT: Final = _row("text", (0xD0D0D0, 252, 7), (0x262626, 235, 0))
COLOUR_DONE: Final = _row("done", (0x009E73, 36, 2), (0x007A58, 23, 4))
COLOUR_ROUTE: Final = _row("route", (0xE4E4E4, 254, 15), (0x303030, 236, 13))
COLOUR_MARKED: Final = _row("marked", (0xCDB2FF, 183, 4), (0xCDB2FF, 183, 14))
# Robots.
COLOUR_PARKED: Final = _row("parked", (0x6A93BC, 67, 6), (0x56738F, 24, 8))
COLOUR_IDLE: Final = _row("idle", (0xBFBFBF, 250, 7), (0x4F4F4F, 239, 8))
COLOUR_CLASS_0: Final = _row("robots 0", (0x6EA8FE, 111, 12), (0x1F5FBF, 25, 4))
COLOUR_CLASS_1: Final = _row("robots 1", (0xF0E442, 227, 11), (0x7A6A00, 58, 8))
COLOUR_CLASS_2: Final = _row("robots 2", (0x2EC4B6, 43, 14), (0x00706A, 23, 12))
COLOUR_CLASS_3: Final = _row("robots 3", (0xFF8A5C, 209, 9), (0xB03A12, 124, 1))
COLOUR_CLASS_4: Final = _row("robots 4", (0xB79CFF, 141, 13), (0x6A2BD9, 56, 5))
COLOUR_CLASS_5: Final = _row("robots 5", (0xC8C8C8, 251, 7), (0x4A4A4A, 239, 0))
COLOUR_CLASS_6: Final = _row("robots 6", (0x7BC96F, 114, 10), (0x2C7A1F, 22, 9))
COLOUR_CLASS_7: Final = _row("robots 7", (0xFF8FC7, 212, 5), (0xB01070, 125, 13))
COLOUR_LEVEL_0: Final = _row("amount 0", (0x8A82B4, 103, 12), (0x756C00, 58, 12))
COLOUR_LEVEL_1: Final = _row("amount 1", (0x5FA8D8, 74, 6), (0x3C7A2A, 22, 13))
COLOUR_LEVEL_2: Final = _row("amount 2", (0x3FBF9F, 43, 2), (0x0B6F7A, 24, 5))
COLOUR_LEVEL_3: Final = _row("amount 3", (0x9FD750, 149, 10), (0x2F4B9F, 19, 4))
COLOUR_LEVEL_4: Final = _row("amount 4", (0xFDE725, 226, 11), (0x440154, 53, 0))
COLOUR_CHARGING: Final = _row("charging", (0xF0E442, 227, 10), (0x467000, 58, 0))
COLOUR_ROBOT: Final = _row("robot", (0x56B4E9, 74, 14), (0x006DAA, 25, 4))
COLOUR_LOADED: Final = _row("loaded robot", (0xE69F00, 214, 11), (0x875000, 94, 5))
COLOUR_LOW_BATTERY: Final = _row("low battery", (0xE06FD0, 170, 1), (0x6A2BD9, 56, 12))
COLOUR_WAITING: Final = _row("waiting robot", (0xFFC8D8, 224, 13), (0xA0107A, 126, 9))
COLOUR_FAULT: Final = _row("fault", (0xFF5F1F, 202, 9), (0xC8102E, 160, 1), bold=True)
COLOUR_CURSOR: Final = _row("cursor", (0x5FFFD7, 86, 10), (0x20D8B0, 43, 10))
COLOUR_SELECTED: Final = _row("selected", (0xFFFFFF, 231, 15), (0x000000, 16, 13), bold=True)

COLOUR_TABLE: Final = tuple(_rows)
STYLE_COUNT: Final = len(COLOUR_TABLE) ** 2
# Grounds keep their value as foreground; all others adapt to the background, see `Look`.
GROUNDS: Final = range(COLOUR_FLOOR, COLOUR_FLOOR_MARK)
BACKGROUNDS: Final = (*GROUNDS, COLOUR_MARKED, COLOUR_CURSOR, COLOUR_SELECTED)
# Robots carry numbers; the other colours are used for text around the map and on the floor.
CLASS_COLOURS: Final = range(COLOUR_CLASS_0, COLOUR_CLASS_7 + 1)  # classes of robots
LEVEL_COLOURS: Final = range(COLOUR_LEVEL_0, COLOUR_LEVEL_4 + 1)  # levels of amounts
ROBOT_COLOURS: Final = range(COLOUR_PARKED, COLOUR_FAULT + 1)
WORD_COLOURS: Final = (
    *(COLOUR_FLOOR, COLOUR_STATION, COLOUR_DIM, COLOUR_TEXT, COLOUR_DONE, COLOUR_CURSOR),
)
WHITE: Final = ColourShades(0xFFFFFF, 231, 15)
BLACK: Final = ColourShades(0x000000, 16, 0)

TEXT_CONTRAST: Final = 4.5  # minimum for text, and for robots, which carry numbers
MARK_CONTRAST: Final = 3.0  # minimum for signs

# The first 16 colours of xterm, by which contrast is measured; other terminals differ.
XTERM: Final = (
    *(0x000000, 0xCD0000, 0x00CD00, 0xCDCD00, 0x0000EE, 0xCD00CD, 0x00CDCD, 0xE5E5E5),
    *(0x7F7F7F, 0xFF0000, 0x00FF00, 0xFFFF00, 0x5C5CFF, 0xFF00FF, 0x00FFFF, 0xFFFFFF),
)


@overload
def style(fg: int, bg: int) -> int: ...
@overload
def style(fg: NDArray[Any], bg: int | NDArray[Any]) -> NDArray[np.uint32]: ...
@overload
def style(fg: int, bg: NDArray[Any]) -> NDArray[np.uint32]: ...
def style(fg: int | NDArray[Any], bg: int | NDArray[Any]) -> int | NDArray[np.uint32]:
    """The number of a foreground on a background; style 0 is the plain floor."""
    if isinstance(fg, int) and isinstance(bg, int):
        return fg * len(COLOUR_TABLE) + bg
    styles: NDArray[np.uint32] = np.asarray(fg, np.uint32) * np.uint32(len(COLOUR_TABLE))
    return styles + np.asarray(bg, np.uint32)


def prominence(style: int) -> int:
    """The more prominent colour of a style: its higher row of the table."""
    return max(divmod(style, len(COLOUR_TABLE)))


def with_background(codes: Codes, bg: int | NDArray[Any]) -> Codes:
    """The same glyphs and foregrounds on another background."""
    styles = codes >> np.uint32(GLYPH_BITS)
    fg = styles - styles % np.uint32(len(COLOUR_TABLE))
    return ((fg + np.asarray(bg, np.uint32)) << np.uint32(GLYPH_BITS)) | (codes & GLYPHS)


class Attributes(NamedTuple):
    """Attributes of a style other than its colours."""

    bold: bool = False
    underline: bool = False
    reverse: bool = False


class Look:
    """Shows styles at one colour depth in one theme.

    If a foreground lacks contrast on a background, its value from the other theme is used: on a hot
    cell of the dark theme, which is bright, a robot is as dark as on white. If that lacks contrast,
    too, white or black is used, so that at least the shape is visible: one of these has a contrast
    of at least 4.58 with any colour.
    """

    def __init__(self, depth: Depth, theme: Theme = "dark") -> None:
        self.depth = depth
        self.theme = theme
        fg, bg = np.divmod(np.arange(STYLE_COUNT, dtype=np.int32), np.int32(len(COLOUR_TABLE)))
        # (STYLE_COUNT,) the order of painting, the most important style first.
        self.rank: NDArray[np.int32] = (len(COLOUR_TABLE) - np.maximum(fg, bg)) * STYLE_COUNT
        self.rank += np.arange(STYLE_COUNT, dtype=np.int32)
        self._sgr: dict[int, str] = {}
        self._rich: dict[int, Style] = {}
        self._blank: dict[int, tuple[int | None, ...]] = {}

    def sgr(self, style: int) -> str:
        """The sequence that sets this style, independent of the previous one."""
        sgr = self._sgr.get(style)
        if sgr is None:
            sgr = self._sgr[style] = self._made_sgr(style)
        return sgr

    def blank(self, style: int) -> tuple[int | None, ...]:
        """What is seen of a blank in this style: equal for styles whose blanks look the same."""
        blank = self._blank.get(style)
        if blank is None:
            _, underline, reverse = self.attributes(style)
            fg, bg = self.pair(style) if self.depth != Depth.NONE else (0, 0)
            ground, ink = (fg, bg) if reverse else (bg, fg)
            blank = self._blank[style] = ground, reverse, ink if underline else None
        return blank

    def rich(self, style: int) -> Style:
        """The style for Rich and Textual."""
        made = self._rich.get(style)
        if made is None:
            made = self._rich[style] = self._made_rich(style)
        return made

    def css(self, style: int) -> tuple[str, str, bool]:
        """Foreground, background and weight for a page or a drawing."""
        attributes = self.attributes(style)
        if self.depth == Depth.NONE:
            fg, bg = (
                _own(COLOUR_TABLE[COLOUR_TEXT], self.theme).true,
                _own(COLOUR_TABLE[0], self.theme).true,
            )
        else:
            fg, bg = (rgb(value, self.depth) for value in self.pair(style))
        if attributes.reverse:
            fg, bg = bg, fg
        return f"#{fg:06x}", f"#{bg:06x}", attributes.bold

    def pair(self, style: int) -> tuple[int, int]:
        """The values of foreground and background at this depth."""
        fg, bg = divmod(style, len(COLOUR_TABLE))
        index = 3 - self.depth  # in ColourShades
        below = _own(COLOUR_TABLE[bg], self.theme)[index]
        own = _own(COLOUR_TABLE[fg], self.theme)[index]
        cut_out = fg == COLOUR_FLOOR and bg not in GROUNDS
        if not cut_out and (fg in GROUNDS or bg not in BACKGROUNDS):
            return own, below
        needed = self.needed(fg, bg)
        if contrast(own, below, self.depth) >= needed:
            return own, below
        of_other_theme = COLOUR_TABLE[fg].light if self.theme == "dark" else COLOUR_TABLE[fg].dark
        if contrast(of_other_theme[index], below, self.depth) >= needed:
            return of_other_theme[index], below
        either = WHITE[index], BLACK[index]
        return max(either, key=lambda value: contrast(value, below, self.depth)), below

    def needed(self, fg: int, bg: int) -> float:
        """The minimum contrast of a style: TEXT_CONTRAST, or MARK_CONTRAST for signs.

        A background COLOUR_VOID means a line of words. On white, only five of the 16 colours have
        the contrast of text, too few for the states of a robot.
        """
        written = fg in WORD_COLOURS or bg == COLOUR_VOID
        written = written or (fg in ROBOT_COLOURS and self.depth != Depth.SIXTEEN)
        return TEXT_CONTRAST if written else MARK_CONTRAST

    def attributes(self, style: int) -> Attributes:
        """Weight and, without colours, the attributes that replace them.

        Text on a robot's colour is reversed, and so are the selection, the cursor and faults.
        Waiting robots are underlined at every depth, since colour alone is not enough. The blanks of
        a drawn robot have the foreground "beyond the floor" and no underline.
        """
        fg, bg = divmod(style, len(COLOUR_TABLE))
        bold = COLOUR_TABLE[fg].bold
        cut_out = fg in GROUNDS and bg not in GROUNDS
        written = fg == COLOUR_FLOOR and bg in (COLOUR_WAITING, COLOUR_FAULT)
        if self.depth != Depth.NONE:
            waits = fg in (COLOUR_WAITING, COLOUR_FAULT) and bg != COLOUR_VOID
            return Attributes(bold, underline=waits or written)
        return Attributes(
            bold=bold
            or fg == COLOUR_LOADED
            or bg in (COLOUR_MARKED, COLOUR_SELECTED)
            or (cut_out and COLOUR_TABLE[bg].bold),
            underline=COLOUR_WAITING in (fg, bg) or bg in (COLOUR_SELECTED, COLOUR_MARKED),
            reverse=cut_out or fg == COLOUR_FAULT or bg in (COLOUR_SELECTED, COLOUR_CURSOR),
        )

    def _made_sgr(self, style: int) -> str:
        attributes = self.attributes(style)
        numbers = [0] + [n for n, is_on in zip((1, 4, 7), attributes, strict=True) if is_on]
        if self.depth != Depth.NONE:
            fg, bg = self.pair(style)
            numbers += _parameters(fg, self.depth, 38) + _parameters(bg, self.depth, 48)
        return f"\x1b[{';'.join(map(str, numbers))}m"

    def _made_rich(self, style: int) -> Style:
        from rich.color import Color
        from rich.style import Style

        bold, underline, reverse = self.attributes(style)
        colours: list[Color | None] = [None, None]
        if self.depth == Depth.TRUE:
            colours = [Color.from_rgb(*channels(value)) for value in self.pair(style)]
        elif self.depth != Depth.NONE:
            colours = [Color.from_ansi(value) for value in self.pair(style)]
        fg, bg = colours
        return Style(color=fg, bgcolor=bg, bold=bold, underline=underline, reverse=reverse)


def _own(colour: Colour, theme: Theme) -> ColourShades:
    return colour.dark if theme == "dark" else colour.light


def _parameters(value: int, depth: Depth, place: int) -> list[int]:
    """The SGR parameters of a colour; place 38 is the foreground, 48 the background."""
    if depth == Depth.TRUE:
        return [place, 2, *channels(value)]
    if depth == Depth.INDEXED:
        return [place, 5, value]
    return [place - 8 + value if value < 8 else place + 52 + value - 8]


def channels(value: int) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255."""
    return value >> 16, value >> 8 & 255, value & 255


@cache
def rgb(value: int, depth: Depth) -> int:
    """0xRRGGBB of a colour at this depth."""
    if depth == Depth.TRUE:
        return value
    if value < 16:
        return XTERM[value]
    if value > 231:
        return 0x010101 * (8 + 10 * (value - 232))
    levels = (0, 95, 135, 175, 215, 255)
    red, rest = divmod(value - 16, 36)
    return levels[red] << 16 | levels[rest // 6] << 8 | levels[rest % 6]


@cache
def contrast(one: int, other: int, depth: Depth) -> float:
    """The contrast ratio, 1 to 21, of the Web Content Accessibility Guidelines 2.2."""
    low, high = sorted(_luminance(rgb(value, depth)) for value in (one, other))
    return (high + 0.05) / (low + 0.05)


def _luminance(value: int) -> float:
    shares = (channel / 255 for channel in channels(value))
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
