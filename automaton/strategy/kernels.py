"""The kernels that compiled strategies may call: the world's public view, in compiled form.

Strategies import compiled code from here and nowhere else (an import contract holds this).
"""

from automaton.compiled import kernel
from automaton.kernels.draws import ABORTS, STRATEGY, WITHDRAWALS, draw, draw_between
from automaton.kernels.motion import has_room
from automaton.kernels.operations import first_cell
from automaton.kernels.search import (
    FAR,
    begin_search,
    descend,
    distance,
    find_path,
    mark_goal,
    nearest_mark,
)

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
    """The cell from which a robot drives on: in a long move the one that it enters, in a bay its home."""
    return first_cell(view.robots, i)
