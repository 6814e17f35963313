"""Tasks as a text file, one line each, below the number of tasks.

    # tasks of two cells on a floor of 32 columns
    2
    34,101
    7,640

Lines that begin with # and empty ones are skipped. A cell is row * width + column, counted from 0 at
the upper left. The content becomes the scenario's own list of tasks, so that recordings stand alone.
"""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.document import Document, Keys, ListFile
from automaton.scenario.orders import MAX_STOPS
from automaton.scenario.reading import content_hash, read_text
from automaton.scenario.schema import Scenario

TASKS: Final[Keys] = ("orders", "tasks")
NUMBER: Final = re.compile(r"[0-9]{1,10}")
Cell = tuple[int, int]


class TaskFile(NamedTuple):
    """The tasks of a file."""

    path: str
    content_hash: str  # 16 hex digits
    tasks: tuple[tuple[Cell, ...], ...]  # cells (x, y)
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
    found = read_tasks(path, floor_plan)
    orders = msgspec.structs.replace(scenario.orders, tasks=found.tasks)
    listed = ListFile(TASKS, found.path, found.lines)
    document = replace(document, listed=(*document.listed, listed))
    absolute = found._replace(path=str(path.resolve()))
    return document, msgspec.structs.replace(scenario, orders=orders), absolute


def read_tasks(path: Path, floor_plan: FloorPlan) -> TaskFile:
    """The tasks of a file. Raises InputError with the line."""
    file = str(path)
    text = read_text(path).replace("\r", "\n").split("\n")
    rows = [(number, row.strip()) for number, row in enumerate(text, 1)]
    rows = [(number, row) for number, row in rows if row and not row.startswith("#")]
    if not rows:
        raise InputError("is empty; its first line must be the number of tasks", file)
    first, head = rows[0]
    if not NUMBER.fullmatch(head) or int(head) == 0:
        wrong = f"the first line must be the number of tasks, found {head[:20]!r}"
        raise InputError(wrong, file, first)
    count, below = int(head), rows[1:]
    if len(below) != count:
        line = below[count][0] if count < len(below) else first
        raise InputError(
            f"line {first} says {count:,} tasks, the file has {len(below):,}", file, line
        )
    tasks = tuple(_cells(row, file, number, floor_plan) for number, row in below)
    return TaskFile(file, content_hash(path), tasks, tuple(number for number, _ in below))


def _cells(row: str, file: str, line: int, floor_plan: FloorPlan) -> tuple[Cell, ...]:
    words = [word.strip() for word in row.split(",")]
    if len(words) > MAX_STOPS:
        text = f"the task has {len(words)} cells, at most {MAX_STOPS} are possible"
        raise InputError(text, file, line)
    size = floor_plan.width * floor_plan.height
    cells = []
    for word in words:
        if not NUMBER.fullmatch(word) or int(word) >= size:
            found = repr(word[:20]) if word else "nothing"
            text = f"a cell must be a whole number from 0 to {size - 1:,}, found {found}"
            raise InputError(text, file, line)
        y, x = divmod(int(word), floor_plan.width)
        cells.append((x, y))
    return tuple(cells)
