"""Distance tables with weights of a strategy's own, such as lattice weights that order the traffic.

A strategy declares them in its state, builds them in `reset`, and asks in its kernels:

    class State(Struct):
        tables: DistanceTables

    table = weighted_table_of(view, state.tables, 0, goal_cell)
    cost = cost_in(state.tables, table, cell, heading)
"""

from __future__ import annotations

import numpy as np

from automaton.engine.distance_tables import DistanceTables as DistanceTables
from automaton.engine.state import Array, World
from automaton.engine.table_building import Costs, build_tables
from automaton.errors import InputError
from automaton.units import memory


def weighted_tables(view: World, step: Array, turn: int | Array) -> DistanceTables:
    """Tables for robots that pay `step` for a step and `turn` for a turn by 90 degrees.

    `step`: (C, 4) or, by set of costs, (S, C, 4) whole numbers from 1 on: from cell c in direction d
    (E, S, W, N); only exits are looked at. A set has 16 distinct costs at most, those of turns
    included. `turn`: one number, or one by set. Set k has the exits of robot type k, or all sets those
    of the only type. The tables take up to `world.distance_tables` of memory for themselves, beside
    those of ticks. Raises ValueError for costs that are too many or too small, or of another shape;
    InputError where the machine has not so much memory.
    """
    cells = len(view.grid.kind)
    steps = np.asarray(step).reshape(-1, cells, 4)
    types = view.grid.type_cell_flags
    if len(types) not in (1, len(steps)):
        raise ValueError(f"{len(steps)} sets of costs for {len(types)} types of robots")
    flags = np.broadcast_to(types, (len(steps), cells)).copy()
    turns = np.broadcast_to(np.asarray(turn, np.int64), len(steps)).copy()
    headings = np.broadcast_to(view.grid.type_headings, len(steps)).copy()
    stop = np.zeros(1, np.int64)  # the run puts its own in place
    budget = view.rules.table_bytes
    try:
        return build_tables(view.grid, Costs(flags, steps, turns, headings), budget, stop)
    except MemoryError:
        raise InputError(
            f"world.distance_tables is {memory(budget)}, and the tables of a strategy with weights of "
            "its own take as much again, more than this machine can give; set it lower"
        ) from None


def no_tables() -> DistanceTables:
    """Tables of no cells, for the state of a strategy whose parameters ask for none."""
    extents = ("C", "F", "G", "L", "P", "Q", "R", "S", "S C", "W", "words")
    return DistanceTables.sized(dict.fromkeys(extents, 0))
