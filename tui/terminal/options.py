"""What a user may ask of the viewer on the command line."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Final

from tui.render.glyphs import SHADED, UNICODE, GlyphSet
from tui.render.styles import Depth, Theme, depth_of, glyphs_of

if TYPE_CHECKING:  # Textual reads its variables when it is imported
    from tui.terminal.presenter import Renderer

SPEEDS: Final = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, math.inf)  # faster, slower
COLOR_SYSTEMS = {
    Depth.NONE: "standard",
    Depth.SIXTEEN: "standard",
    Depth.INDEXED: "256",
    Depth.TRUE: "truecolor",
}


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
