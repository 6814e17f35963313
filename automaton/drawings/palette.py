"""The colours of drawings, by what they mean, for dark and for light themes.

Colours of robots are those of Okabe and Ito, which colour-blind people distinguish; floor, walls and
shelves are greys. Shape is always the second channel.
"""

from __future__ import annotations

from typing import Final, Literal

Theme = Literal["dark", "light"]
THEMES: Final[tuple[Theme, ...]] = ("dark", "light")

# 0xRRGGBB, dark and light.
COLOURS: Final[dict[str, tuple[int, int]]] = {
    "floor": (0x121212, 0xFFFFFF),
    "void": (0x080808, 0xEEEEEE),
    "mark": (0x444444, 0xBCBCBC),
    "track": (0x6C6C6C, 0x8A8A8A),
    "direction": (0x5F8787, 0x5F8787),
    "wall": (0x585858, 0x585858),
    "rack": (0x767676, 0x767676),
    "shelf": (0x8A8A8A, 0x808080),
    "parking-bay": (0x7A7AA8, 0x7474A0),
    "turntable": (0xA8648C, 0x96648A),
    "charger": (0xAFAF5F, 0x75750A),
    "destination": (0x2C7FD0, 0x2A2AA8),
    "dock": (0x5FA35F, 0x4A7F4A),
    "station": (0xB87878, 0xA05050),
    "load": (0xB08860, 0x7A5C45),
    "dim": (0x8F8F8F, 0x6C6C6C),
    "text": (0xD0D0D0, 0x262626),
    "done": (0x009E73, 0x007A58),
    "cursor": (0x5FFFD7, 0x20D8B0),
    "parked": (0x5F87AF, 0x5F7F9F),
    "charging": (0xF0E442, 0x4E7A00),
    "empty": (0x56B4E9, 0x0072B2),
    "loaded": (0xE69F00, 0xA85F00),
    "low battery": (0xE06FD0, 0x6A2BD9),
    "waiting": (0xFFC8D8, 0xA0107A),
    "fault": (0xFF5F1F, 0xC8102E),
    "selected": (0xFFFFFF, 0x000000),
}


def rgb(name: str, theme: Theme) -> tuple[int, int, int]:
    """Red, green and blue of a colour, 0 to 255 each."""
    value = COLOURS[name][THEMES.index(theme)]
    return value >> 16, value >> 8 & 255, value & 255


def blended(name: str, ground: str, share: float, theme: Theme) -> tuple[int, int, int]:
    """A colour over another one, of which 1 - `share` shines through."""
    over, under = rgb(name, theme), rgb(ground, theme)
    red, green, blue = (round(u + (o - u) * share) for o, u in zip(over, under, strict=True))
    return red, green, blue


def css(colour: tuple[int, int, int]) -> str:
    """A colour as a style sheet writes it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
