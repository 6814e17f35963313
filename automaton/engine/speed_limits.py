"""How many ticks a move takes where the floor limits the speed of all robots."""

import numpy as np

from automaton.engine.jit.kernel import kernel


@kernel(inline=True)
def limited_ticks(grid, usual, cell, direction):
    """Ticks of a move out of a cell in a direction that takes `usual` ticks without a limit."""
    limits = grid.min_move_ticks
    if limits.shape[0] == 0:
        return np.int64(usual)
    return max(np.int64(usual), np.int64(limits[np.uint64(4 * cell + direction)]))
