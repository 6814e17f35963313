"""Assigned routes on the floor of De Ryck et al., as text (their Figures 2 and 3)."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Sequence
from typing import Final

from automaton.floor.floor_plan import FloorPlan
from automaton.papers.auctions.auction_floor import DEPOTS
from automaton.papers.auctions.auction_trials import OPTIMUM, Solved, solve
from automaton.scenario.floor_section import generator_type

ROBOTS: Final = 3
TASKS: Final = 10
SEED: Final = 12  # of the first twenty, the one with the largest difference
WIDTH: Final = 7  # characters of a cell

Cell = tuple[int, int]


def pictures() -> list[tuple[str, str]]:
    """(title, drawing) of one task set, by the auction and by the optimum."""
    return [
        (f"{title}: {TASKS} tasks, {ROBOTS} robots (seed {SEED})", described(method))
        for title, method in (
            ("Figure 2, the sequential auction", "LB"),
            ("Figure 3, the optimum", OPTIMUM),
        )
    ]


def described(method: str) -> str:
    """The drawing, and below it each robot's list with its seconds."""
    solved = solve("full", ROBOTS, TASKS, SEED, method, 0)
    lines = [drawing(solved.lists)]
    for r, stations in enumerate(solved.lists):
        path = " ".join(map(str, (DEPOTS[r], *stations)))
        lines.append(f"{name(r)}: {path}: {way_length(solved, r)} s")
    lines.append(f"all done after {solved.objective:g} s")
    return "\n".join(lines)


def name(r: int) -> str:
    """A, B, C, ..."""
    return chr(ord("A") + r)


def way_length(solved: Solved, r: int) -> int:
    """Seconds of robot r's route: a cell takes ten."""
    return 10 * (len(route((DEPOTS[r], *solved.lists[r]))) - 1)


def drawing(lists: Sequence[Sequence[int]]) -> str:
    """The floor; a cell shows who drives over it, a station its number, * where a task is."""
    floor = generator_type("depots")()
    floor_plan: FloorPlan = floor.build()  # type: ignore[attr-defined]
    at = {cell: position for position, cell in floor.places().items()}  # type: ignore[attr-defined]
    drivers: dict[Cell, str] = {}
    for r, stations in enumerate(lists):
        for cell in dict.fromkeys(route((DEPOTS[r], *stations))):
            drivers[cell] = drivers.get(cell, "") + name(r)
    tasks = {station for stations in lists for station in stations}
    rows = []
    for y in range(floor_plan.height):
        cells = []
        for x in range(floor_plan.width):
            position = at.get((x, y))
            sign = "" if position is None else f"{position}{'*' if position in tasks else ''} "
            drivable = floor_plan.drivable[y + 1, x + 1]
            cells.append(
                f"{sign + drivers.get((x, y), '' if sign or not drivable else '.'):{WIDTH}}"
            )
        rows.append("".join(cells).rstrip())
    return "\n".join(rows)


def route(positions: Sequence[int]) -> list[Cell]:
    """The cells of the shortest ways from position to position."""
    floor = generator_type("depots")()
    floor_plan: FloorPlan = floor.build()  # type: ignore[attr-defined]
    places: dict[int, Cell] = floor.places()  # type: ignore[attr-defined]
    cells = [places[positions[0]]]
    for start, target in itertools.pairwise(positions):
        cells += way(floor_plan, places[start], places[target])[1:]
    return cells


def way(floor_plan: FloorPlan, start: Cell, target: Cell) -> list[Cell]:
    """A shortest way over cells, both ends included."""
    begin, goal = floor_plan.cell(*start), floor_plan.cell(*target)
    exits = floor_plan.exits.reshape(-1)
    before, queue = {begin: begin}, deque([begin])
    while goal not in before:
        cell = queue.popleft()
        for direction, neighbour in enumerate(floor_plan.neighbours(cell)):
            if exits[cell] >> direction & 1 and neighbour not in before:
                before[neighbour] = cell
                queue.append(neighbour)
    path = [goal]
    while path[-1] != begin:
        path.append(before[path[-1]])
    return [floor_plan.xy(cell) for cell in reversed(path)]
