"""A folder of tables: map.txt, agents_K.csv for fleets of several sizes, tasks_one.csv.

map.txt is a MovingAI map. agents_K.csv has the columns `agent id,row,col`. tasks_one.csv has the
column `targets`, one cell for each task, row * width + column counted from 0; from 1 where only so
all of them are free. Task j of robot r is line j * robots + r, and a robot passes over a task on
whose cell it is already.

Source: the experiments of A. Yukhnevich and A. Andreychuk, Enhancing PIBT via Multi-Action
Operations, AAAI-26.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from automaton.errors import InputError
from automaton.exchange.moving_ai import GridMap, read_map
from automaton.exchange.problem import Cells, Listed, Problem, checked
from automaton.scenario.document import Line, content_lines, quoted, whole_number

MAP: Final = "map.txt"
TASKS: Final = "tasks_one.csv"
AGENTS: Final = "agents_*.csv"
AGENT_COLUMNS: Final = ("agent id", "row", "col")
TASK_COLUMNS: Final = ("targets",)


def read_problem_folder(path: Path, robots: int | None = None) -> Problem:
    """Read the problem of a folder for a fleet of `robots`. Raises InputError."""
    for name in (MAP, TASKS):
        if not (path / name).is_file():
            raise InputError(f"a folder of a problem must hold {name}", str(path))
    grid = read_map(path / MAP)
    starts, starts_from = _starts(path, robots, grid)
    tasks, tasks_from = _tasks(path / TASKS, grid)
    return checked(
        Problem(
            name=f"{path.resolve().name}-{len(starts)}",
            grid=grid,
            starts=starts,
            tasks=tasks,
            assignment="round-robin",
            skip_reached=True,
            starts_from=starts_from,
            tasks_from=tasks_from,
        )
    )


def fleets_of(path: Path) -> list[int]:
    """Return for how many robots the folder has starts. Raises InputError."""
    return sorted(len(_table(file, AGENT_COLUMNS)) for file in path.glob(AGENTS))


def _starts(path: Path, robots: int | None, grid: GridMap) -> tuple[Cells, Listed]:
    """Read the starts of the file that has so many. Raises InputError."""
    tables = {file: _table(file, AGENT_COLUMNS) for file in sorted(path.glob(AGENTS))}
    fleets = {len(rows): file for file, rows in tables.items()}
    if not fleets:
        raise InputError(f"a folder of a problem must hold {AGENTS.replace('*', 'K')}", str(path))
    if robots is None and len(fleets) == 1:
        robots = next(iter(fleets))
    if robots not in fleets:
        sizes = ", ".join(map(str, sorted(fleets)))
        asked = "give --robots" if robots is None else f"--robots {robots} is not possible"
        raise InputError(f"{asked}: there are starts for {sizes} robots", str(path))
    file, rows = str(fleets[robots]), tables[fleets[robots]]
    cells = []
    for line, values in rows:
        row, column = (
            whole_number(text, name, file, line)
            for name, text in zip(AGENT_COLUMNS[1:], values[1:], strict=True)
        )
        if not (0 <= row < grid.height and 0 <= column < grid.width):
            text = f"the start in row {row}, column {column} lies outside the map "
            size = f"(rows 0..{grid.height - 1}, columns 0..{grid.width - 1})"
            raise InputError(text + size, file, line)
        cells.append(row * grid.width + column)
    return np.array(cells, np.int64), Listed(file, tuple(line for line, _ in rows))


def _tasks(path: Path, grid: GridMap) -> tuple[tuple[tuple[int, ...], ...], Listed]:
    rows = _table(path, TASK_COLUMNS)
    numbers = [whole_number(values[0], TASK_COLUMNS[0], str(path), line) for line, values in rows]
    free = set(np.flatnonzero(grid.free).tolist())
    different = set(numbers)
    from_one = not different <= free and {number - 1 for number in different} <= free
    tasks = tuple((number - from_one,) for number in numbers)
    return tasks, Listed(str(path), tuple(line for line, _ in rows))


def _table(path: Path, columns: tuple[str, ...]) -> list[tuple[int, list[str]]]:
    """Return the rows below the head of a CSV file, with their lines. Raises InputError."""
    file, lines = str(path), content_lines(path)
    head = ",".join(columns)
    first = lines[0] if lines else Line(1, "")
    if [name.strip() for name in re.split(",", first.text)] != list(columns):
        raise InputError(f"its head must be '{head}', found {quoted(first.text)}", file, 1)
    rows = []
    for line in lines[1:]:
        values = line.text.split(",")
        if len(values) != len(columns):
            text = f"the line has {len(values)} values, the head names {len(columns)} columns"
            raise InputError(text, file, line.number)
        rows.append((line.number, values))
    if not rows:
        raise InputError("holds no row below its head", file, first.number)
    return rows
