"""What a user may ask of the viewer on the command line, and what its environment says of a terminal."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Final, Literal

from tui.render.styles import ASCII, DEPTHS, SHADED, UNICODE, Depth, GlyphSet, Theme

Renderer = Literal["auto", "direct", "textual"]  # how maps get to the terminal

SPEEDS: Final = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, math.inf)  # faster, slower

COLOR_SYSTEMS: Final = {
    Depth.NONE: "standard",
    Depth.SIXTEEN: "standard",
    Depth.INDEXED: "256",
    Depth.TRUE: "truecolor",
}
GLYPH_SETS: Final = {"unicode": UNICODE, "ascii": ASCII}
# Terminals that do not name their colours, but are known to have all of them.
TRUE_COLOUR_TERMS: Final = ("kitty", "alacritty", "ghostty", "wezterm", "foot", "contour")
# The console of Linux has a font of 256 or 512 characters; "dumb" promises nothing at all.
PLAIN_TERMS: Final = ("linux", "dumb")


@dataclass(frozen=True)
class Options:
    """How a run is shown; the same for live and recorded ones."""

    read_only: bool = False  # no branches, no files in the current folder
    speed: float = 1.0
    at: int | None = None  # begin at this tick, paused
    paused: bool = False
    fps: int = 30
    renderer: Renderer = "auto"
    ascii: bool = False
    color: str = "auto"  # or a key of tui.render.styles.DEPTHS
    theme: Theme = "dark"
    max_kbit: float | None = None
    plain: bool = False
    describe: bool = False  # sentences in place of a screen,
    only: Sequence[str] = ()  # of these kinds; none: of all,
    sentences: int | None = None  # and so many of each stretch at most

    @classmethod
    def of(cls, args: argparse.Namespace) -> Options:
        """Those of a parsed command line."""
        return cls(**{field.name: getattr(args, field.name) for field in fields(cls)})

    def depth(self, environ: Mapping[str, str]) -> Depth:
        """The colours to use."""
        return depth_of(environ, self.color)

    def glyphs(self, environ: Mapping[str, str]) -> GlyphSet:
        """The characters to use."""
        glyphs = glyphs_of(environ, "ascii" if self.ascii else "auto")
        bare = glyphs is UNICODE and self.depth(environ) == Depth.NONE
        return SHADED if bare else glyphs

    def for_textual(self, environ: Mapping[str, str]) -> dict[str, str]:
        """Variables that Textual reads when it is imported, so that its colours are the map's.

        Smooth scrolling would make terminals report the mouse pixel by pixel, also over SSH.
        """
        depth = self.depth(environ)
        chosen = {"TEXTUAL_SMOOTH_SCROLL": "0", "TEXTUAL_COLOR_SYSTEM": COLOR_SYSTEMS[depth]}
        return {**chosen, "NO_COLOR": "1"} if depth == Depth.NONE else chosen


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
