"""Maps and scenarios of the MovingAI benchmarks: `.map` and `.scen`.

    type octile        A map: four lines of head, then one character for each cell. A robot may
    height 2           stand on `.` `G` `S` `E`, and not on `@` `O` `T` `W`.
    width 3
    map                A scenario: `version 1`, then a line for each start and goal:
    ..@                bucket, map, width, height, start x, start y, goal x, goal y, length,
                       with tabs between them.
    .T.

Source: N. Sturtevant, Benchmarks for Grid-Based Pathfinding, 2012; movingai.com/benchmarks.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.floor.drawn_floors import MAX_SIDE
from automaton.scenario.document import content_lines, lines_of, quoted, whole_number

FREE: Final = ".GSE"
BLOCKED: Final = "@OTW"
WATER: Final = "W"
HEAD: Final = (
    ("type octile", re.compile(r"type\s+octile")),
    ("height N", re.compile(r"height\s+([0-9]{1,9})")),
    ("width N", re.compile(r"width\s+([0-9]{1,9})")),
    ("map", re.compile("map")),
)
SCEN_COLUMNS: Final = 9


@dataclass(frozen=True, eq=False)
class GridMap:
    """A map of free and blocked cells; cells are counted row * width + column from 0."""

    file: str
    free: npt.NDArray[np.bool_]  # (height, width)
    water: int = 0  # of the blocked cells, those drawn as water, where only some robots could drive

    @property
    def height(self) -> int:
        """How many rows there are."""
        return int(self.free.shape[0])

    @property
    def width(self) -> int:
        """How many cells a row has."""
        return int(self.free.shape[1])

    def place(self, cell: int) -> str:
        """A cell as an error names it."""
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
    rows = lines[len(HEAD) :]
    if len(rows) != height:
        line = len(HEAD) + min(len(rows), height + 1)
        raise InputError(f"the map has {len(rows):,} rows, its height is {height:,}", file, line)
    for number, row in enumerate(rows, len(HEAD) + 1):
        if len(row) != width:
            column = min(len(row), width) + 1
            text = f"column {column}: the row has {len(row):,} cells, the width is {width:,}"
            raise InputError(text, file, number)
    codes = np.frombuffer("".join(rows).encode("utf-32-le"), np.uint32).reshape(height, width)
    free = np.isin(codes, [ord(symbol) for symbol in FREE])
    unknown = ~free & ~np.isin(codes, [ord(symbol) for symbol in BLOCKED])
    if unknown.any():
        row_index, column = (int(index[0]) for index in np.nonzero(unknown))
        raise InputError(
            f"column {column + 1}: unknown symbol {rows[row_index][column]!r}; "
            f"free are {' '.join(FREE)}, blocked are {' '.join(BLOCKED)}",
            file,
            len(HEAD) + 1 + row_index,
        )
    if not free.any():
        raise InputError("the map has no free cell", file)
    return GridMap(file, free, int(np.count_nonzero(codes == ord(WATER))))


def _size(lines: list[str], file: str) -> tuple[int, int]:
    """Return height and width, as the head of a map gives them. Raises InputError."""
    sizes = []
    for number, (form, pattern) in enumerate(HEAD, 1):
        text = lines[number - 1].strip() if number <= len(lines) else ""
        match = pattern.fullmatch(text)
        if match is None:
            raise InputError(
                f"line {number} of a map must be '{form}', found {quoted(text)}", file, number
            )
        if match.groups():
            sizes.append(int(match[1]))
            if not 1 <= sizes[-1] <= MAX_SIDE:
                text = f"a side must have 1 to {MAX_SIDE:,} cells, found {sizes[-1]:,}"
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
            text = f"the line names the map {quoted(row[1])}, the first one {quoted(rows[0][1][1])}"
            raise InputError(text, file, number)
    grid = read_map(_map_beside(path, rows[0][1][1], rows[0][0]))
    return grid, [_trip(grid, row, file, number) for number, row in rows]


def _columns(text: str) -> list[str]:
    """The columns of a line, by tabs if it has any: names of maps may have blanks."""
    return [part.strip() for part in text.split("\t")] if "\t" in text else text.split()


def _map_beside(path: Path, name: str, line: int) -> Path:
    """Return the map of a scenario: where its lines say, or of that name in the same folder."""
    places = [path.parent / name, path.parent / Path(name.replace("\\", "/")).name]
    for place in places:
        if os.path.isfile(place):
            return place
    raise InputError(f"there is no map {quoted(name)} beside the file", str(path), line)


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
