"""The viewer's command-line options, and what the environment says about the terminal."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Final, Literal

from tui.render.styles import ASCII, DEPTHS, SHADED, UNICODE, Depth, GlyphSet, Theme

Renderer = Literal["auto", "direct", "textual"]  # how maps reach the terminal

SPEEDS: Final = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, math.inf)  # faster, slower

COLOR_SYSTEMS: Final = {
    Depth.NONE: "standard",
    Depth.SIXTEEN: "standard",
    Depth.INDEXED: "256",
    Depth.TRUE: "truecolor",
}
GLYPH_SETS: Final = {"unicode": UNICODE, "ascii": ASCII}
# Terminals with true colour that do not say so in COLORTERM.
TRUE_COLOUR_TERMS: Final = ("kitty", "alacritty", "ghostty", "wezterm", "foot", "contour")
# The Linux console has a font of 256 or 512 characters; "dumb" promises nothing.
PLAIN_TERMS: Final = ("linux", "dumb")


@dataclass(frozen=True)
class Options:
    """How to show a run, live or recorded."""

    read_only: bool = False  # no branches, no files in the current folder
    speed: float = 1.0
    at: int | None = None  # start at this tick, paused
    paused: bool = False
    fps: int = 30
    renderer: Renderer = "auto"
    ascii: bool = False
    color: str = "auto"  # or a key of tui.render.styles.DEPTHS
    theme: Theme | Literal["auto"] = "dark"  # auto: as the background of the terminal
    max_kbit: float | None = None
    plain: bool = False
    describe: bool = False  # sentences instead of a screen,
    only: Sequence[str] = ()  # of these kinds; (): of all,
    sentences: int | None = None  # at most this number per stretch

    @classmethod
    def of(cls, args: argparse.Namespace) -> Options:
        """The options of a parsed command line."""
        return cls(**{field.name: getattr(args, field.name) for field in fields(cls)})

    @property
    def shown_theme(self) -> Theme:
        """The theme, dark if the terminal has not been asked."""
        return "light" if self.theme == "light" else "dark"

    def depth(self, environ: Mapping[str, str]) -> Depth:
        """The colours to use."""
        return depth_of(environ, self.color)

    def glyphs(self, environ: Mapping[str, str]) -> GlyphSet:
        """The characters to use."""
        glyphs = glyphs_of(environ, "ascii" if self.ascii else "auto")
        bare = glyphs is UNICODE and self.depth(environ) == Depth.NONE
        return SHADED if bare else glyphs

    def for_textual(self, environ: Mapping[str, str]) -> dict[str, str]:
        """Variables that Textual reads on import, so that its colours match those of the map.

        With smooth scrolling, terminals would report every pixel of mouse movement, also over SSH.
        """
        depth = self.depth(environ)
        chosen = {"TEXTUAL_SMOOTH_SCROLL": "0", "TEXTUAL_COLOR_SYSTEM": COLOR_SYSTEMS[depth]}
        return {**chosen, "NO_COLOR": "1"} if depth == Depth.NONE else chosen


def depth_of(environ: Mapping[str, str], option: str = "auto") -> Depth:
    """The colours to use; `option`, a key of DEPTHS, overrides `environ` unless "auto"."""
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
    """The characters to use; `option`, a key of GLYPH_SETS, overrides `environ` unless "auto"."""
    if option != "auto":
        return GLYPH_SETS[option]
    if environ.get("TERM") in PLAIN_TERMS:
        return ASCII
    locale = _locale(environ).lower().replace("-", "")
    return UNICODE if not locale or "utf8" in locale else ASCII


def _locale(environ: Mapping[str, str]) -> str:
    """The locale for characters: LC_ALL, else LC_CTYPE, else LANG.

    In the C locale, Python itself sets LC_CTYPE to C.UTF-8 (PEP 538); that value is ignored.
    """
    of_type = environ.get("LC_CTYPE", "")
    if of_type == "C.UTF-8" and environ.get("LANG"):
        of_type = ""
    return environ.get("LC_ALL") or of_type or environ.get("LANG", "")
