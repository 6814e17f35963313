"""The few signs of the panels beside letters, in Unicode and in ASCII.

None is "ambiguous" in Unicode's table of East Asian widths: some terminals draw those two columns wide.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from tui.render.glyphs import GlyphSet


class Signs(NamedTuple):
    """What panels draw with."""

    rising: str  # the order of a column
    falling: str
    before: str  # there is more on the left
    beyond: str
    here: str  # the present, the current choice
    on: str
    off: str
    better: str  # the better of two metrics
    full: str  # of a bar
    half: str
    thin: str  # of a bar of the second kind
    thin_half: str
    dots: bool  # whether there are braille patterns


UNICODE: Final = Signs("▴", "▾", "◃", "▹", "▸", "✓", "⋅", "◂", "⣿", "⡇", "⠶", "⠆", True)
ASCII: Final = Signs("^", "v", "<", ">", ">", "+", "-", "*", "#", "", "=", "", False)


def signs_of(glyphs: GlyphSet) -> Signs:
    """Those that go with the characters of the map."""
    return ASCII if glyphs.name == "ascii" else UNICODE


def bar(share: float, width: int, signs: Signs, thin: bool = False) -> str:
    """A bar of at most `width` columns; something that is not nothing shows."""
    full, half = (signs.thin, signs.thin_half) if thin else (signs.full, signs.half)
    steps = 2 if half else 1
    long = min(width * steps, max(round(share * width * steps), int(share > 0)))
    return (full * (long // steps) + half * (long % steps)).ljust(width)
