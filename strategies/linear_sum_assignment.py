"""Linear sum assignment: at most one column for each row, minimum total cost.

Shortest augmenting paths with potentials (Jonker & Volgenant 1987), O(rows^2 x columns).
"""

from typing import Final

import numpy as np

from automaton.strategy.api import NIL, SCRATCH, Array, Struct, field, kernel

INF_COST: Final = 1 << 60  # the cost of a forbidden pair
NO_EDGE: Final = 1 << 50  # the cost of a forbidden pair on a path


class Assignment(Struct, role=SCRATCH):
    """Scratch for up to q rows and columns."""

    cost: Array = field("(q, q) int64")
    row_price: Array = field("(q,) int64")
    column_price: Array = field("(q + 1,) int64")
    row_of: Array = field("(q + 1,) int32", "the row of a column, or NIL")
    parent_column: Array = field("(q + 1,) int32", "the previous column on the path")
    slack: Array = field("(q + 1,) int64")
    visited: Array = field("(q + 1,) uint8")


def assignment_for(most: int) -> Assignment:
    """Scratch for up to this number of rows and columns."""
    return Assignment.sized({"q": most})


@kernel
def linear_sum_assignment(cost, rows, columns, workspace):
    """workspace.row_of[:columns] = the row of each column, or NIL; rows <= columns.

    cost: (>= rows, >= columns) int64; forbidden pairs cost INF_COST. A row for which only forbidden
    pairs remain gets no column.
    """
    for j in range(columns + 1):
        workspace.row_of[j] = NIL
        workspace.column_price[j] = 0
    for i in range(rows):
        workspace.row_price[i] = 0
    for i in range(rows):
        # The virtual column `columns` stands for the new row.
        workspace.row_of[columns] = i
        j = augmenting_end(cost, columns, workspace)
        while j != columns:
            before = np.int64(workspace.parent_column[j])
            workspace.row_of[j] = workspace.row_of[before]
            j = before
    for j in range(columns):
        if workspace.row_of[j] != NIL and cost[workspace.row_of[j], j] >= INF_COST:
            workspace.row_of[j] = NIL


@kernel
def augmenting_end(cost, columns, workspace):
    """Update the prices; return the free column at which the shortest augmenting path ends."""
    for j in range(columns + 1):
        workspace.slack[j] = INF_COST
        workspace.visited[j] = 0
    here = np.int64(columns)
    while workspace.row_of[here] != NIL:
        workspace.visited[here] = 1
        row = np.int64(workspace.row_of[here])
        step, then = np.int64(INF_COST), np.int64(NIL)
        for j in range(columns):
            if workspace.visited[j] == 1:
                continue
            edge = min(cost[row, j], np.int64(NO_EDGE))
            reduced = edge - workspace.row_price[row] - workspace.column_price[j]
            if reduced < workspace.slack[j]:
                workspace.slack[j] = reduced
                workspace.parent_column[j] = here
            if workspace.slack[j] < step:
                step, then = workspace.slack[j], np.int64(j)
        for j in range(columns + 1):
            if workspace.visited[j] == 1:
                workspace.row_price[workspace.row_of[j]] += step
                workspace.column_price[j] -= step
            else:
                workspace.slack[j] -= step
        here = then
    return here
