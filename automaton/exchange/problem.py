"""A problem for a fleet as others publish it: a map, starts, tasks, and how tasks find robots.

Cells are counted row * width + column from 0, whatever the files count.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.moving_ai import GridMap

Cells = npt.NDArray[np.int64]
Assignment = Literal["pool", "round-robin"]


@dataclass(frozen=True)
class Listed:
    """Where the entries of a list stand: in which file, and in which of its lines."""

    file: str
    lines: tuple[int, ...] = ()

    def error(self, entry: int, message: str) -> InputError:
        """An error about an entry, with its line where that is known."""
        line = self.lines[entry] if entry < len(self.lines) else None
        return InputError(message, self.file, line)


@dataclass(frozen=True, eq=False)
class Problem:
    """Robots on a map, all facing east, and tasks: cells that one robot has to visit in turn.

    pool: `revealed` times the robots are open at once, refilled in the order of the file, and any
    robot may do them. round-robin: task j of robot r is line j * robots + r. `repeat`: after the last
    line of tasks comes the first.
    """

    name: str
    grid: GridMap
    starts: Cells  # (robots,)
    tasks: tuple[tuple[int, ...], ...]
    assignment: Assignment
    revealed: float = 1.0
    repeat: bool = True
    skip_reached: bool = False  # a robot passes over a task on whose first cell it is already
    starts_from: Listed = field(default_factory=lambda: Listed(""))
    tasks_from: Listed = field(default_factory=lambda: Listed(""))

    @property
    def robots(self) -> int:
        """How many robots there are."""
        return len(self.starts)

    @property
    def open_tasks(self) -> int:
        """How many tasks are open at once, with a pool."""
        return max(1, int(self.revealed * self.robots + 1e-9))


def checked(problem: Problem) -> Problem:
    """Return a problem that can be done. Raises InputError with file and line.

    Robots start on different free cells; the cells of a task are free, and one robot can reach all.
    """
    _check_starts(problem)
    _check_tasks(problem)
    return problem


def _check_starts(problem: Problem) -> None:
    grid, places = problem.grid, problem.starts_from
    if problem.robots > np.count_nonzero(grid.free):
        text = (
            f"{problem.robots:,} robots, but the map has {np.count_nonzero(grid.free):,} free cells"
        )
        raise InputError(text, places.file)
    _check_cells(problem, problem.starts, np.arange(problem.robots), places, "robot {} starts in")
    unique, first, count = np.unique(problem.starts, return_index=True, return_counts=True)
    if (count > 1).any():
        again = np.ones(problem.robots, np.bool_)
        again[first] = False
        robot = int(np.flatnonzero(again)[0])
        cell = int(problem.starts[robot])
        other = int(first[np.searchsorted(unique, cell)])
        text = f"robot {robot} starts in {grid.place(cell)}, where robot {other} starts already"
        raise places.error(robot, text)


def _check_tasks(problem: Problem) -> None:
    if not problem.tasks:
        raise InputError("there is no task", problem.tasks_from.file)
    grid, places = problem.grid, problem.tasks_from
    lengths = np.array([len(task) for task in problem.tasks])
    cells = np.array([cell for task in problem.tasks for cell in task], np.int64)
    owner = np.repeat(np.arange(len(lengths)), lengths)
    _check_cells(problem, cells, owner, places, "task {} visits")
    part = connected_parts(grid.free).reshape(-1)
    with_robots = np.zeros(part.max() + 1, np.bool_)
    with_robots[part[problem.starts]] = True
    alone = ~with_robots[part[cells]]
    if alone.any():
        at = int(np.flatnonzero(alone)[0])
        text = f"task {owner[at]} visits {grid.place(int(cells[at]))}"
        raise places.error(int(owner[at]), f"{text}, which no robot can reach")
    apart = (owner[1:] == owner[:-1]) & (part[cells[1:]] != part[cells[:-1]])
    if apart.any():
        at = int(np.flatnonzero(apart)[0]) + 1
        text = f"task {owner[at]} leads from {grid.place(int(cells[at - 1]))}"
        raise places.error(
            int(owner[at]), f"{text} to {grid.place(int(cells[at]))}, which no way joins"
        )


def _check_cells(problem: Problem, cells: Cells, entry: Cells, places: Listed, what: str) -> None:
    """Refuse the first cell that is outside the map or blocked; `entry`: of the list, for each cell."""
    grid = problem.grid
    size = grid.free.size
    outside = (cells < 0) | (cells >= size)
    blocked = ~grid.free.reshape(-1)[np.where(outside, 0, cells)]
    wrong = np.flatnonzero(outside | blocked)
    if not len(wrong):
        return
    at = int(wrong[0])
    who = what.format(int(entry[at]))
    if outside[at]:
        text = f"{who} cell {int(cells[at])}, outside the map (cells 0 to {size - 1})"
    else:
        text = f"{who} {grid.place(int(cells[at]))}, which is blocked"
    raise places.error(int(entry[at]), text)


def connected_parts(free: npt.NDArray[np.bool_], block: int = 0) -> npt.NDArray[np.int32]:
    """Number the parts of a map that hang together: (height, width), 0 where it is blocked.

    Parts are numbered in the sequence in which one reads their first cells. `block`: nothing hangs
    together over the borders of blocks of so many rows and columns; 0: without blocks.

    Each run of free cells in a row begins as a part of its own; runs that touch are joined.
    """
    begins = free.copy()
    begins[:, 1:] &= ~free[:, :-1]
    touches = free[1:] & free[:-1]
    if block:
        begins[:, ::block] = free[:, ::block]
        touches[block - 1 :: block] = False
    run = np.cumsum(begins.reshape(-1), dtype=np.int32).reshape(free.shape)
    run[~free] = 0
    touches[:, 1:] &= ~touches[:, :-1] | begins[1:, 1:]  # one pair of runs, one touch
    upper, lower = run[:-1][touches], run[1:][touches]
    root = np.arange(int(run.max(initial=0)) + 1, dtype=np.int32)
    while len(upper):
        np.minimum.at(
            root, np.maximum(root[upper], root[lower]), np.minimum(root[upper], root[lower])
        )
        while not np.array_equal(root, root[root]):
            root = root[root]
        apart = root[upper] != root[lower]
        upper, lower = upper[apart], lower[apart]
    number = np.cumsum(root == np.arange(len(root)), dtype=np.int32) - 1
    parts: npt.NDArray[np.int32] = number[root][run]
    return parts
