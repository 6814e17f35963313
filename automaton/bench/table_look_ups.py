"""What the bench asks of distance tables, compiled."""

from __future__ import annotations

import numpy as np

from automaton.engine.distance_tables import DistanceTables
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import NIL
from automaton.engine.state import Array
from automaton.engine.table_rows import cost_in, forget, row_to


@kernel
def compute(tables: DistanceTables, goals: Array) -> None:
    """Compute the tables to some goals, whether they are there or not."""
    for k in range(goals.shape[0]):
        row = tables.row_of[goals[k]]
        if row != NIL:
            forget(tables, row)
        row_to(tables, 0, goals[k], 0, False)


@kernel
def rank_options(
    tables: DistanceTables, goals: Array, cells: Array, headings: Array, rounds: int
) -> np.int64:
    """For robots with a goal each: what staying and each neighbour costs; the sum."""
    total = np.int64(0)
    for _ in range(rounds):
        for k in range(goals.shape[0]):
            row = row_to(tables, 0, goals[k], 0, True)
            total += cost_in(tables, row, cells[k], headings[k])
            for direction in range(4):
                after = cells[k] + tables.offset[direction]
                if tables.number[after] != NIL:
                    total += cost_in(tables, row, after, direction)
    return total
