"""How many ticks plans have. Imports no Numba."""

from __future__ import annotations

from typing import Final

MOST_TICKS: Final = 256  # each cell needs a word for each: 1 KiB at most


def horizon_of(depth: int, longest: int, wait: int = 1) -> int:
    """The ticks in which a plan is over that begins after the longest action.

    `wait`: ticks until robots are asked again, which is when they see what such an action has left.
    """
    return depth * longest + longest - wait
