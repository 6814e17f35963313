"""The cells that a scenario means by corners of a path, or by the two corners of a rectangle."""

from __future__ import annotations

from collections.abc import Sequence

from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.changing_floor import CellSet, Rectangle

Pair = tuple[int, int]


def cells_of_set(name: str, cells: CellSet, floor_plan: FloorPlan) -> list[int]:
    """The flat cells of a path or a rectangle, each once. Raises InputError, without its place."""
    corners = (cells.first, cells.last) if isinstance(cells, Rectangle) else cells
    for x, y in corners:
        if not floor_plan.holds(x, y):
            size = f"{floor_plan.width} x {floor_plan.height} cells"
            raise InputError(f"{name} has the cell [{x}, {y}], outside the floor of {size}")
    if isinstance(cells, Rectangle):
        (x, y), (u, v) = cells.first, cells.last
        return [
            floor_plan.cell(column, row)
            for row in range(min(y, v), max(y, v) + 1)
            for column in range(min(x, u), max(x, u) + 1)
        ]
    return list(dict.fromkeys(cells_of_path(name, cells, floor_plan)))


def cells_of_path(name: str, corners: Sequence[Pair], floor_plan: FloorPlan) -> list[int]:
    """The flat cells from corner to corner. Raises InputError where two are not in line."""
    x, y = corners[0]
    path = [floor_plan.cell(x, y)]
    for u, v in corners[1:]:
        if (x != u) == (y != v):
            text = f"{name} goes from [{x}, {y}] to [{u}, {v}]"
            raise InputError(f"{text}: along neither a row nor a column")
        while (x, y) != (u, v):
            x, y = x + (u > x) - (u < x), y + (v > y) - (v < y)
            path.append(floor_plan.cell(x, y))
    return path
