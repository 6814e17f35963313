"""How many ticks plans have. Imports no Numba."""

from __future__ import annotations

from typing import Final

MOST_TICKS: Final = 64  # each cell needs a word for each


def horizon_of(depth: int, longest: int) -> int:
    """The ticks in which a plan is over that begins after the longest action."""
    return depth * longest + longest - 1
