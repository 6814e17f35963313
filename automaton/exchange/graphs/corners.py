"""Sets of cells as a scenario writes them: corners of a path, or rectangles."""

from __future__ import annotations

from collections.abc import Sequence

from automaton.exchange.graphs.roads import Cell


def corners(cells: Sequence[Cell]) -> list[list[int]]:
    """Return where a path of neighbouring cells begins, turns and ends."""
    out = [cells[0]]
    for place in range(1, len(cells) - 1):
        (x, y), (u, v), (s, t) = cells[place - 1 : place + 2]
        if (u - x, v - y) != (s - u, t - v):
            out.append((u, v))
    if len(cells) > 1:
        out.append(cells[-1])
    return [list(cell) for cell in out]


def walk(ways: dict[Cell, set[Cell]]) -> list[Cell] | None:
    """Return a path over all cells of a set, back over them where it must, or None.

    `ways`: of each cell those of the set beside it, to or from which robots drive. A set that is a
    path without branches is walked from end to end.
    """
    ends = [cell for cell, beside in ways.items() if len(beside) < 2]
    first = ends[0] if ends else next(iter(ways))
    path, walked = [first], {first}
    open_cells = [(first, iter(sorted(ways[first])))]
    while open_cells:
        ahead = next((cell for cell in open_cells[-1][1] if cell not in walked), None)
        if ahead is not None:
            walked.add(ahead)
            path.append(ahead)
            open_cells.append((ahead, iter(sorted(ways[ahead]))))
            continue
        open_cells.pop()
        if len(walked) == len(ways):
            return path
        if open_cells:
            path.append(open_cells[-1][0])
    return None
