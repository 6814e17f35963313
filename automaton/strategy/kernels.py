"""The kernels that compiled strategies may call: the world's public view, in compiled form.

Strategies import compiled code from here and nowhere else (an import contract holds this).
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import ABORTS, STRATEGY, WITHDRAWALS, draw, draw_between
from automaton.kernels.motion import has_room
from automaton.kernels.search import (
    FAR,
    begin_search,
    descend,
    distance,
    find_path,
    mark_goal,
    nearest_mark,
)
from automaton.world.state import NIL

__all__ = [
    "ABORTS",
    "FAR",
    "STRATEGY",
    "WITHDRAWALS",
    "begin_search",
    "descend",
    "distance",
    "draw",
    "draw_between",
    "find_path",
    "has_room",
    "kernel",
    "mark_goal",
    "nearest_mark",
    "position",
]


@kernel
def position(view, i):
    """The cell of a robot, or the home cell through which it leaves its bay."""
    if view.robots.cell[i] == NIL:
        return np.int64(view.robots.home[i])
    return np.int64(view.robots.cell[i])
