"""The cells of the queues of stations."""

from __future__ import annotations

from automaton.floor.floor_plan import FloorPlan


def queue_path(
    floor_plan: FloorPlan, at: tuple[int, int], corners: tuple[tuple[int, int], ...]
) -> list[int]:
    """Flat cells of a queue, the one next to the station first, by the corners of its path."""
    path: list[int] = []
    x, y = at
    for u, v in corners:
        while (x, y) != (u, v):
            x, y = (x + (u > x) - (u < x), y) if x != u else (x, y + (v > y) - (v < y))
            path.append(floor_plan.cell(x, y))
    return path
