"""Lattice guidance: rows and columns are one-way streets by turns, so that crowds rarely meet head-on.

Odd rows run east, even ones west; even columns run south, odd ones north. A move against its street is
allowed, and costs as much as three along it. Turns cost their ticks.
"""

import numpy as np

from automaton.engine.state import ACTION_MOVE, ACTION_TURN
from automaton.strategy.weighted_tables import weighted_tables

AGAINST_STREET = 3  # times the ticks of a move along a street


def moves_against_streets(grid):
    """Return (C, 4) bool: whether a move out of a cell, E S W N, is against its street."""
    y, x = np.divmod(np.arange(len(grid.kind)), grid.width)
    odd_row, odd_column = (y - 1) % 2 == 1, (x - 1) % 2 == 1
    return np.stack((~odd_row, odd_column, odd_row, ~odd_column), axis=1)


def lattice_tables(view, scale=1):
    """Return distance tables whose costs are `scale` times the ticks, against streets three times that.

    Set k is of robot type k.
    """
    duration = np.asarray(view.rules.duration, np.int64)
    ticks = duration[:, ACTION_MOVE, None, None]
    if len(view.grid.min_move_ticks):
        ticks = np.maximum(ticks, view.grid.min_move_ticks.reshape(-1, 4))
    weights = np.where(moves_against_streets(view.grid), AGAINST_STREET, 1)
    return weighted_tables(view, scale * ticks * weights, scale * duration[:, ACTION_TURN])
