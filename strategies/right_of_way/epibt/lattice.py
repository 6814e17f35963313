"""Lattice weights: rows and columns are one-way streets by turns, so that crowds meet head-on less often.

Odd rows run east, even ones west; even columns run south, odd ones north. A move against its street is
allowed, and costs as much as three along it. A turn by 90 degrees costs as much as a move.
"""

import numpy as np

ALONG_STREET = 2
AGAINST_STREET = 6
TURN = 2


def lattice_weights(grid):
    """Return (C, 4): what a move costs that leaves a cell in a direction, E S W N."""
    y, x = np.divmod(np.arange(len(grid.kind)), grid.width)
    odd_row, odd_column = (y - 1) % 2 == 1, (x - 1) % 2 == 1
    against = np.stack((~odd_row, odd_column, odd_row, ~odd_column), axis=1)
    return np.where(against, AGAINST_STREET, ALONG_STREET)
