"""Distance tables with a strategy's own weights, such as lattice weights that direct the traffic.

A strategy declares them in its state, builds them in `reset`, and uses them in its kernels:

    class State(Struct):
        tables: DistanceTables

    table = weighted_table_of(view, state.tables, 0, goal_cell)
    cost = cost_in(state.tables, table, cell, heading)
"""

from __future__ import annotations

import numpy as np

from automaton.engine.distance_tables import DistanceTables as DistanceTables
from automaton.engine.state import Array, World
from automaton.engine.table_building import Costs, build_tables, empty_tables
from automaton.errors import InputError
from automaton.units import memory


def weighted_tables(view: World, step: Array, turn: int | Array) -> DistanceTables:
    """Tables with cost `step` for a step and `turn` for a turn by 90 degrees.

    `step`: (C, 4) or, by set of costs, (S, C, 4) whole numbers from 1 on: from cell c in direction
    d (E, S, W, N); only exits are used. Tables are fastest with at most 16 distinct costs in a set.
    `turn`: one number, or one per set. Set k has the exits of robot type k; with a single type all
    sets have its exits. The tables take up to `world.distance_tables` of memory in addition to the
    tables of ticks. Raises ValueError for too small or too large costs or a wrong shape; InputError if
    the machine has too little memory.
    """
    cells = len(view.grid.kind)
    steps = np.asarray(step).reshape(-1, cells, 4)
    types = view.grid.type_cell_flags
    if len(types) not in (1, len(steps)):
        raise ValueError(f"{len(steps)} sets of costs for {len(types)} types of robots")
    flags = np.broadcast_to(types, (len(steps), cells)).copy()
    turns = np.broadcast_to(np.asarray(turn, np.int64), len(steps)).copy()
    headings = np.broadcast_to(view.grid.type_headings, len(steps)).copy()
    stop = np.zeros(1, np.int64)  # replaced by the run's own
    budget = view.rules.table_bytes
    try:
        return build_tables(view.grid, Costs(flags, steps, turns, headings), budget, stop)
    except MemoryError:
        raise InputError(
            f"world.distance_tables is {memory(budget)}, and the tables of a strategy with its "
            "own weights take the same amount again, more than this machine can give; set it lower"
        ) from None


def no_tables() -> DistanceTables:
    """Empty tables, for strategies whose parameters do not use them."""
    return empty_tables()
