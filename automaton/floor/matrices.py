"""A floor as a matrix of codes in a CSV file, one line per row (Bhattathiri, Li & Kuhl, Figure 2).

    -1,-1, -1,-1     -1 wall, 0 free, 50 intersection, 100 rack, 200 dock
    -1, 0,200, 0     An intersection is a free cell: which ones they are follows from the floor, so
    -1,50,  0,50     0 and 50 mean the same when a matrix is read.

Spreadsheets write numbers as 100.0 and, where the comma is the decimal sign, 100,0 between semicolons;
both are read, as are columns between tabs.

What a matrix does not say is how many robots a free cell holds: that is one number for all.
"""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, alternatives
from automaton.floor.cells import ALL_EXITS, CELL_KINDS, DOCK, FLOOR, RACK, WALL
from automaton.floor.drawn_floors import MAX_SIDE
from automaton.floor.floor_plan import FloorPlan, bordered, make_floor_plan
from automaton.floor.traffic_zones import traffic_zones_of

INTERSECTION: Final = 50
# The first that occurs; a comma beside others is a decimal one.
SEPARATORS: Final = (";", "\t", ",")
NUMBER: Final = re.compile(r"[-+]?[0-9]{1,9}(\.[0-9]{0,9})?")
KIND_OF: Final = {-1: WALL, 0: FLOOR, INTERSECTION: FLOOR, 100: RACK, 200: DOCK}
CODE_OF: Final = {kind: code for code, kind in KIND_OF.items() if code != INTERSECTION}


class MatrixError(InputError):
    """An error in a row of a matrix; rows count from 0."""

    def __init__(self, message: str, row: int = 0) -> None:
        super().__init__(message)
        self.row = row


@lru_cache(maxsize=16)
def read_matrix(text: str, capacity: int = 0) -> FloorPlan:
    """The floor of a matrix; every free cell has this capacity. Raises MatrixError."""
    rows = text.rstrip().split("\n") if text.strip() else []
    if not rows:
        raise MatrixError("the matrix is empty")
    separator = next((sign for sign in SEPARATORS if sign in rows[0]), ",")
    cells = [row.split(separator) for row in rows]
    width = len(cells[0])
    if max(len(rows), width) > MAX_SIDE:
        raise MatrixError(f"the matrix has a side of more than {MAX_SIDE:,} cells")
    kind = bordered(len(rows), width)
    for y, row in enumerate(cells):
        if len(row) != width:
            raise MatrixError(f"the row has {len(row)} codes, the first row {width}", y)
        kind[y + 1, 1:-1] = _kinds(row, y)
    if not (kind == FLOOR).any():
        raise MatrixError("the matrix has no free cell (0 or 50) that robots drive on")
    return _plan(kind, capacity)


def write_matrix(floor_plan: FloorPlan) -> str:
    """The matrix of a floor, intersections marked, with a newline at its end.

    Raises InputError for a floor with other kinds of cells, one-way cells or mixed capacities.
    """
    kind, free = floor_plan.kind[1:-1, 1:-1], floor_plan.kind == FLOOR
    for y, x in np.argwhere(~np.isin(kind, list(CODE_OF))).tolist():
        known = alternatives(CELL_KINDS[code].name for code in CODE_OF)
        name = CELL_KINDS[kind[y, x]].name
        raise InputError(f"a matrix has no code for the {name} at ({x}, {y}), only for {known}")
    if len(floor_plan.bays):
        x, y = floor_plan.xy(int(floor_plan.bays[0, 0]))
        raise InputError(f"a matrix has no code for the parking bay at ({x}, {y})")
    capacities = np.unique(floor_plan.capacity[free]).tolist()
    if len(capacities) > 1:
        raise InputError("a matrix cannot say that free cells hold different numbers of robots")
    if not np.array_equal(_plan(floor_plan.kind, 0).exits, floor_plan.exits):
        raise InputError("a matrix cannot say which cells are one-way")
    codes = np.vectorize(CODE_OF.get, otypes=[np.int64])(kind)
    crossing = traffic_zones_of(floor_plan).intersection.reshape(free.shape)[1:-1, 1:-1]
    codes = np.where(crossing, INTERSECTION, codes)
    return "".join(",".join(map(str, row)) + "\n" for row in codes.tolist())


def _kinds(row: list[str], y: int) -> list[int]:
    codes = [_number(code) for code in row]
    for x, code in enumerate(codes):
        if code not in KIND_OF:
            allowed = alternatives(map(str, KIND_OF))
            found = row[x].strip()[:20] or "nothing"
            # By size, not by letters: 99 is next to 100.
            near = min(KIND_OF, key=lambda known: abs(known - code)) if math.isfinite(code) else ""
            hint = f"; did you mean {near}?" if near != "" else ""
            raise MatrixError(
                f"column {x + 1} must be one of the codes {allowed}, found {found}{hint}", y
            )
    return [KIND_OF[int(code)] for code in codes]


def _number(text: str) -> float:
    """The number that a text writes; NaN for anything else."""
    plain = text.strip().replace(",", ".")
    return float(plain) if NUMBER.fullmatch(plain) else math.nan


def _plan(kind: npt.NDArray[np.uint8], capacity: int) -> FloorPlan:
    """A floor on which every free cell may be left in all directions."""
    leave = np.where(kind == FLOOR, ALL_EXITS, 0).astype(np.uint8)
    return make_floor_plan(kind, leave, np.where(kind == FLOOR, capacity, 1).astype(np.uint8))
