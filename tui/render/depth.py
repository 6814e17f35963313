"""How many colours and which characters a terminal shows, as far as its environment tells."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

from tui.render.glyphs import ASCII, UNICODE, GlyphSet


class Depth(IntEnum):
    """Colours of a terminal."""

    NONE = 0  # bold, underlined and reversed only
    SIXTEEN = 1
    INDEXED = 2  # 256
    TRUE = 3


DEPTHS: Final = {
    "none": Depth.NONE,
    "16": Depth.SIXTEEN,
    "256": Depth.INDEXED,
    "true": Depth.TRUE,
}
GLYPH_SETS: Final = {"unicode": UNICODE, "ascii": ASCII}

# Terminals that do not name their colours, but are known to have all of them.
TRUE_COLOUR_TERMS: Final = ("kitty", "alacritty", "ghostty", "wezterm", "foot", "contour")
# The console of Linux has a font of 256 or 512 characters; "dumb" promises nothing at all.
PLAIN_TERMS: Final = ("linux", "dumb")


def depth_of(environ: Mapping[str, str], option: str = "auto") -> Depth:
    """The colours to use; `option` is "auto" or a key of DEPTHS and has the last word."""
    if option != "auto":
        return DEPTHS[option]
    term = environ.get("TERM", "")
    if environ.get("NO_COLOR") or term == "dumb":
        return Depth.NONE
    if environ.get("COLORTERM", "").lower() in ("truecolor", "24bit"):
        return Depth.TRUE
    if term.endswith("-direct") or any(name in term for name in TRUE_COLOUR_TERMS):
        return Depth.TRUE
    return Depth.INDEXED if "256color" in term else Depth.SIXTEEN


def glyphs_of(environ: Mapping[str, str], option: str = "auto") -> GlyphSet:
    """The characters to use; `option` is "auto" or a key of GLYPH_SETS and has the last word."""
    if option != "auto":
        return GLYPH_SETS[option]
    if environ.get("TERM") in PLAIN_TERMS:
        return ASCII
    locale = _locale(environ).lower().replace("-", "")
    return UNICODE if not locale or "utf8" in locale else ASCII


def _locale(environ: Mapping[str, str]) -> str:
    """The locale of characters: the first that is set of LC_ALL, LC_CTYPE, LANG.

    In the locale C, Python itself sets LC_CTYPE to C.UTF-8 (PEP 538): that says nothing.
    """
    of_type = environ.get("LC_CTYPE", "")
    if of_type == "C.UTF-8" and environ.get("LANG"):
        of_type = ""
    return environ.get("LC_ALL") or of_type or environ.get("LANG", "")
