"""What the user has chosen to see: a robot, a cell, a zone, a layer."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from tui.registration import layer_named
from tui.render.scene import NO_CELLS


@dataclass
class Choice:
    """What the user has chosen to see."""

    robot: int = NIL
    cell: int = NIL
    zone: int = NIL
    layer: str = ""
    least: int = 2  # paths through a cell of the layer "predicted"
    side: int = 0  # which of two runs the panels show
    following: bool = False
    route: bool = True
    minimap: bool = True
    matches: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # robots that were found,
    match_cells: NDArray[np.int32] = field(default_factory=lambda: NO_CELLS)  # or cells
    colouring: str = "state"  # of robots, of tui.render.colouring.COLOURINGS
    trails: bool = False
    lines: str = ""  # whose goals lines lead to, of tui.render.trails.LINES

    @property
    def laid(self) -> str:
        """The layer, as it is said."""
        return str(layer_named(self.layer).title(self))
