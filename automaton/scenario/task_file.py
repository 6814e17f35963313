"""Tasks as a text file, one line each, below the number of tasks.

    # tasks of two cells on a floor of 32 columns
    2
    34,101
    7,640

Lines that begin with # and empty ones are skipped. A cell is row * width + column, counted from 0 at
the upper left. Problems of the League of Robot Runners have their tasks in such files. The content
becomes the scenario's own list of tasks, so that recordings stand alone.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.document import Document, Keys, ListFile
from automaton.scenario.orders import MAX_STOPS
from automaton.scenario.reading import content_hash
from automaton.scenario.schema import Scenario
from automaton.scenario.text_lines import (
    content_lines,
    counted_lines,
    split_columns,
    whole_number,
)

TASKS: Final[Keys] = ("orders", "tasks")


class TaskFile(NamedTuple):
    """The tasks of a file; whether there are such cells is known to who has the floor."""

    path: str
    content_hash: str  # 16 hex digits
    tasks: tuple[tuple[int, ...], ...]  # the cells of each
    lines: tuple[int, ...]  # where each task stands, from 1


def with_tasks_of_file(
    document: Document, scenario: Scenario, floor_plan: FloorPlan
) -> tuple[Document, Scenario, TaskFile | None]:
    """The scenario with the tasks of its file, if it names one. Raises InputError."""
    name = scenario.orders.tasks
    if not isinstance(name, str):
        return document, scenario, None
    path = document.folder / name
    if not os.path.isfile(path):
        raise document.error(TASKS, f"there is no file of tasks '{name}'")
    found = read_tasks(path)
    orders = msgspec.structs.replace(scenario.orders, tasks=_places(found, floor_plan))
    listed = ListFile(TASKS, found.path, found.lines)
    document = replace(document, listed=(*document.listed, listed))
    absolute = found._replace(path=str(path.resolve()))
    return document, msgspec.structs.replace(scenario, orders=orders), absolute


def read_tasks(path: Path, most: int = MAX_STOPS) -> TaskFile:
    """The tasks of a file, of at most so many cells each. Raises InputError with the line."""
    file = str(path)
    below = counted_lines(content_lines(path), "task", file)
    tasks = []
    for line in below:
        cells = tuple(
            whole_number(text, "a cell of a task", file, line.number, column)
            for column, text in split_columns(line.text, ",")
        )
        if len(cells) > most:
            text = f"the task has {len(cells)} cells, at most {most} are possible"
            raise InputError(text, file, line.number)
        tasks.append(cells)
    return TaskFile(file, content_hash(path), tuple(tasks), tuple(line.number for line in below))


def _places(found: TaskFile, floor_plan: FloorPlan) -> tuple[tuple[tuple[int, int], ...], ...]:
    """The cells (x, y) of each task. Raises InputError for one that lies outside the floor."""
    width, size = floor_plan.width, floor_plan.width * floor_plan.height
    for cells, line in zip(found.tasks, found.lines, strict=True):
        for cell in cells:
            if not 0 <= cell < size:
                text = f"cell {cell} lies outside the floor (cells 0 to {size - 1:,})"
                raise InputError(text, found.path, line)
    return tuple(tuple((cell % width, cell // width) for cell in cells) for cells in found.tasks)
