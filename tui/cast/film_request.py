"""What is to be shown of a recording, and how."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from automaton.engine.state import NIL
from tui.render.styles import Theme


@dataclass(frozen=True)
class Request:
    """The same for films and pictures; `first` to `fps` matter to films only."""

    size: tuple[int, int] | None = None  # columns, rows; None: as large as the floor
    zoom: str = "fit"  # or a step of the ladder, with "-" for blanks
    follow: int = NIL  # robot
    layer: str = ""
    theme: Theme = "dark"
    color: str = "true"  # a key of tui.render.depth.DEPTHS
    ascii: bool = False
    first: int = 0  # tick
    last: int | None = None  # tick; None: the last one
    speed: Fraction = Fraction(1)  # x1 is ten ticks a second
    fps: int = 10
