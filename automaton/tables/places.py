"""Cells in tables: columns and rows of numbers, and texts such as `4_2`."""

from __future__ import annotations

import numpy as np

from automaton.engine.state import NIL
from automaton.floor.floor_plan import FloorPlan
from automaton.runs.task_metrics import Measured
from automaton.tables.columns import NO_TEXT, Array, texts_where, where


def columns_and_rows(floor_plan: FloorPlan, cells: Array) -> tuple[Array, Array]:
    """(k,) x and y of flat cells; NO_NUMBER off the floor."""
    rows, columns = np.divmod(np.asarray(cells, np.int64), floor_plan.stride)
    is_cell = np.asarray(cells) != NIL
    return where(is_cell, columns - 1), where(is_cell, rows - 1)


def cell_texts(run: Measured) -> tuple[Array, list[str]]:
    """(s + 1,) the code of the cell of each slot, NO_TEXT of one without a cell; and the texts."""
    cells = run.world.slots.cell
    different, codes = np.unique(cells, return_inverse=True)
    texts = ["{}_{}".format(*run.resolved.floor_plan.xy(cell)) for cell in different.tolist()]
    return np.append(texts_where(cells != NIL, codes), NO_TEXT), texts
