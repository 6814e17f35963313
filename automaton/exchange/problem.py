"""A published problem for a fleet: a map, starts, tasks, and the assignment of tasks.

Maps and scenarios are those of the MovingAI benchmarks, `.map` and `.scen`:

    type octile        A map: four header lines, then one character for each cell. A robot may
    height 2           stand on `.` `G` `S` `E`, and not on `@` `O` `T` `W`.
    width 3
    map                A scenario: `version 1`, then a line for each start and goal:
    ..@                bucket, map, width, height, start x, start y, goal x, goal y, length,
                       with tabs between them.
    .T.

Cells are row * width + column, from 0, regardless of the files.

Source: N. Sturtevant, Benchmarks for Grid-Based Pathfinding, 2012; movingai.com/benchmarks.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.floor.drawn_floors import MAX_FLOOR_SIDE
from automaton.scenario.text_files import content_lines, lines_of, quoted, whole_number

FREE_LETTERS: Final = ".GSE"
BLOCKED: Final = "@OTW"
WATER: Final = "W"
MAP_HEAD: Final = (
    ("type octile", re.compile(r"type\s+octile")),
    ("height N", re.compile(r"height\s+([0-9]{1,9})")),
    ("width N", re.compile(r"width\s+([0-9]{1,9})")),
    ("map", re.compile("map")),
)
SCEN_COLUMNS: Final = 9

Cells = npt.NDArray[np.int64]
Assignment = Literal["pool", "round-robin"]


@dataclass(frozen=True)
class ListedLines:
    """The file and the lines of the entries of a list."""

    file: str
    lines: tuple[int, ...] = ()

    def error(self, entry: int, message: str) -> InputError:
        """An error about an entry, with its line if it is known."""
        line = self.lines[entry] if entry < len(self.lines) else None
        return InputError(message, self.file, line)


@dataclass(frozen=True, eq=False)
class Problem:
    """Robots on a map, all facing east, and tasks: cells that one robot must visit in sequence.

    pool: `revealed` tasks per robot are open at once, refilled in the order of the file, and any robot
    may do them. round-robin: task j of robot r is line j * robots + r. `repeat`: the first line of tasks
    follows the last one.
    """

    name: str
    grid: GridMap
    starts: Cells  # (robots,)
    tasks: tuple[tuple[int, ...], ...]
    assignment: Assignment
    revealed: float = 1.0
    repeat: bool = True
    on_targets: bool = False  # one-shot: each robot stays on the last cell of its only task
    skip_reached: bool = False  # a robot skips a task on whose first cell it is already
    action_ticks: int = 1  # of a move and of a turn
    delays: Mapping[str, Any] | None = None  # the section `faults.delays` of its scenario
    # Side of a robot in cells, in 2026: robots never overlap. None: they follow in any direction.
    robot_size: float | None = None
    starts_from: ListedLines = field(default_factory=lambda: ListedLines(""))
    tasks_from: ListedLines = field(default_factory=lambda: ListedLines(""))

    @property
    def robots(self) -> int:
        """The number of robots."""
        return len(self.starts)

    @property
    def open_tasks(self) -> int:
        """The number of tasks that are open at once, with a pool."""
        return max(1, int(self.revealed * self.robots + 1e-9))


def checked(problem: Problem) -> Problem:
    """Return a feasible problem. Raises InputError with file and line.

    Robots start on different free cells. The cells of a task are free, and one robot can reach them all.
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
            int(owner[at]), f"{text} to {grid.place(int(cells[at]))}, which are not connected"
        )


def _check_cells(
    problem: Problem, cells: Cells, entry: Cells, places: ListedLines, what: str
) -> None:
    """Refuse the first cell that is outside the map or blocked; `entry`: list index of each cell."""
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
    """Number the connected parts of a map: (height, width), 0 in blocked cells.

    Parts are numbered in reading order of their first cells. `block`: the borders of blocks of this
    number of rows and columns separate parts; 0: no blocks.

    Each run of free cells in a row begins as a separate part; runs that touch are joined.
    """
    begins = free.copy()
    begins[:, 1:] &= ~free[:, :-1]
    touches = free[1:] & free[:-1]
    if block:
        begins[:, ::block] = free[:, ::block]
        touches[block - 1 :: block] = False
    run = np.cumsum(begins.reshape(-1), dtype=np.int32).reshape(free.shape)
    run[~free] = 0
    touches[:, 1:] &= ~touches[:, :-1] | begins[1:, 1:]  # one touch for each pair of runs
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


# Maps and scenarios of MovingAI.


@dataclass(frozen=True, eq=False)
class GridMap:
    """A map of free and blocked cells; cells are counted row * width + column from 0."""

    file: str
    free: npt.NDArray[np.bool_]  # (height, width)
    water: int = 0  # blocked cells that are drawn as water, where some robots could drive

    @property
    def height(self) -> int:
        """The number of rows."""
        return int(self.free.shape[0])

    @property
    def width(self) -> int:
        """The number of cells in a row."""
        return int(self.free.shape[1])

    def place(self, cell: int) -> str:
        """A cell in the words of an error."""
        return f"row {cell // self.width}, column {cell % self.width}"


class Trip(NamedTuple):
    """A line of a scenario: one robot's start and goal, as cells."""

    line: int
    start: int
    goal: int


def read_map(path: Path) -> GridMap:
    """Read a `.map`. Raises InputError with line and column."""
    file, lines = str(path), [line.rstrip() for line in lines_of(path)]
    while lines and not lines[-1]:
        lines.pop()
    height, width = _size(lines, file)
    rows = lines[len(MAP_HEAD) :]
    if len(rows) != height:
        line = len(MAP_HEAD) + min(len(rows), height + 1)
        raise InputError(f"the map has {len(rows):,} rows, its height is {height:,}", file, line)
    for number, row in enumerate(rows, len(MAP_HEAD) + 1):
        if len(row) != width:
            column = min(len(row), width) + 1
            text = f"column {column}: the row has {len(row):,} cells, the width is {width:,}"
            raise InputError(text, file, number)
    codes = np.frombuffer("".join(rows).encode("utf-32-le"), np.uint32).reshape(height, width)
    free = np.isin(codes, [ord(symbol) for symbol in FREE_LETTERS])
    unknown = ~free & ~np.isin(codes, [ord(symbol) for symbol in BLOCKED])
    if unknown.any():
        row_index, column = (int(index[0]) for index in np.nonzero(unknown))
        raise InputError(
            f"column {column + 1}: unknown symbol {rows[row_index][column]!r}; "
            f"free are {' '.join(FREE_LETTERS)}, blocked are {' '.join(BLOCKED)}",
            file,
            len(MAP_HEAD) + 1 + row_index,
        )
    if not free.any():
        raise InputError("the map has no free cell", file)
    return GridMap(file, free, int(np.count_nonzero(codes == ord(WATER))))


def _size(lines: list[str], file: str) -> tuple[int, int]:
    """Return the height and the width in the header of a map. Raises InputError."""
    sizes = []
    for number, (form, pattern) in enumerate(MAP_HEAD, 1):
        text = lines[number - 1].strip() if number <= len(lines) else ""
        match = pattern.fullmatch(text)
        if match is None:
            raise InputError(
                f"line {number} of a map must be '{form}', found {quoted(text)}", file, number
            )
        if match.groups():
            sizes.append(int(match[1]))
            if not 1 <= sizes[-1] <= MAX_FLOOR_SIDE:
                text = f"a side must have 1 to {MAX_FLOOR_SIDE:,} cells, found {sizes[-1]:,}"
                raise InputError(text, file, number)
    return sizes[0], sizes[1]


def read_trips(path: Path) -> tuple[GridMap, list[Trip]]:
    """Read a `.scen` and the map that its lines name, beside it. Raises InputError with the line."""
    file, lines = str(path), content_lines(path)
    if not lines or not re.fullmatch(r"version\s+1(\.0)?", lines[0].text.strip()):
        text = quoted(lines[0].text if lines else "")
        raise InputError(f"a scenario must begin with 'version 1', found {text}", file, 1)
    if len(lines) == 1:
        raise InputError("holds no start and goal below 'version 1'", file, lines[0].number)
    rows = [(line.number, _columns(line.text)) for line in lines[1:]]
    for number, row in rows:
        if len(row) != SCEN_COLUMNS:
            text = f"the line has {len(row)} columns, a scenario has {SCEN_COLUMNS}: bucket, map, "
            text += "width, height, start x, start y, goal x, goal y, length"
            raise InputError(text, file, number)
        if row[1] != rows[0][1][1]:
            text = (
                f"the line names the map {quoted(row[1])}, but the first line "
                f"{quoted(rows[0][1][1])}"
            )
            raise InputError(text, file, number)
    grid = read_map(_map_beside(path, rows[0][1][1], rows[0][0]))
    return grid, [_trip(grid, row, file, number) for number, row in rows]


def _columns(text: str) -> list[str]:
    """The columns of a line, split at tabs if it has any: names of maps may have blanks."""
    return [part.strip() for part in text.split("\t")] if "\t" in text else text.split()


def _map_beside(path: Path, name: str, line: int) -> Path:
    """Return the map of a scenario: the path in its lines, or that name in the same folder."""
    places = [path.parent / name, path.parent / Path(name.replace("\\", "/")).name]
    for place in places:
        if os.path.isfile(place):
            return place
    raise InputError(f"there is no map {quoted(name)} next to the file", str(path), line)


def _trip(grid: GridMap, row: list[str], file: str, line: int) -> Trip:
    names = ("width", "height", "start x", "start y", "goal x", "goal y")
    values = [
        whole_number(text, name, file, line) for name, text in zip(names, row[2:8], strict=True)
    ]
    if values[:2] != [grid.width, grid.height]:
        text = f"the line says {values[0]} x {values[1]} cells, "
        raise InputError(text + f"the map has {grid.width} x {grid.height}", file, line)
    cells = []
    for name, (x, y) in (("start", values[2:4]), ("goal", values[4:6])):
        if not (0 <= x < grid.width and 0 <= y < grid.height):
            text = f"the {name} x {x}, y {y} lies outside the map "
            raise InputError(text + f"(x 0..{grid.width - 1}, y 0..{grid.height - 1})", file, line)
        cells.append(y * grid.width + x)
    return Trip(line, *cells)
