"""Import a guidance graph (GGO): its floor, and the weights of its edges as streets.

    {"layout": ["w.e@", ...], "n_row": 33, "n_col": 36, "weights": [1.0, 0.5, ...]}

'.' is floor, '@' and 'T' wall, 'w' a station, 'e' floor beside a shelf. `weights` has the weights of
waiting of all free cells in reading order (optional), then the weights of the edges of each free cell:
east, north, west, south, without those into walls. Zhang et al., IJCAI 2024.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.exchange.imported_floor import (
    FILE_KINDS,
    FREE,
    GUIDANCE,
    ROUTING,
    WALL,
    ImportedFloor,
    ImportOptions,
    ImportReport,
    NamedTable,
    check_size,
    check_values,
    tasks_text,
)
from automaton.exchange.problem import GridMap
from automaton.exchange.problem_files import random_problem
from automaton.scenario.street_files import street_table
from automaton.scenario.text_files import quoted, read_text
from automaton.strategy.lookup import IMPORTED, STEERED, default_for
from automaton.units import count

STATION_MARK: Final = "w"
SYMBOL_OF: Final = {".": FREE, "e": FREE, STATION_MARK: "t", "@": WALL, "T": WALL}
EDGES: Final = (("east", 0, 1), ("north", -1, 0), ("west", 0, -1), ("south", 1, 0))  # row, column
DEFAULT_TICKS: Final = 1000

Weights = NDArray[np.float64]


class GuidanceGraph(msgspec.Struct, frozen=True):
    """The keys of a file that are read."""

    layout: list[str]
    n_row: int
    n_col: int
    weights: list[float] = []


def read_guidance_graph(path: Path, options: ImportOptions) -> ImportedFloor:
    """Read a guidance graph as a floor with streets. Raises InputError."""
    file = str(path)
    graph = _decoded(path)
    check_size(graph.n_col, graph.n_row, file, "use a smaller floor")
    _check_layout(graph, file)
    symbols = np.array([[SYMBOL_OF[mark] for mark in row] for row in graph.layout])
    free = symbols != WALL
    if not free.any():
        raise InputError("the layout has no free cell", file)
    problem = random_problem(path.stem[:200], GridMap(file, free), options.robots)
    ticks = options.ticks or DEFAULT_TICKS
    streets, facts = streets_of(graph, free, file)
    picture = "".join("".join(row) + "\n" for row in symbols.tolist())
    starts = [[cell % graph.n_col, cell // graph.n_col] for cell in problem.starts.tolist()]
    size = f"{count(problem.robots, 'robot')} on {graph.n_col} x {graph.n_row} cells"
    sections = {
        "name": problem.name,
        "summary": f"{size}, imported.",
        "fleet": {"robots": problem.robots, "kinematics": "omni", "start": starts},
        "durations": {"move": 1},
        "orders": {"repeat": True, "assign": "round-robin"},
        "strategy": {
            "allocation": default_for("allocation", IMPORTED),
            "routing": ROUTING,
            "right_of_way": default_for("right_of_way", STEERED),
        },
        "stop": {"when": "never", "max_duration": ticks},
        "seed": 1,
    }
    check_values(sections, file)
    known: dict[str, str | int | float] = {"columns": graph.n_col, "rows": graph.n_row}
    known |= {"floor": int(free.sum()), "stations": int((symbols == SYMBOL_OF[STATION_MARK]).sum())}
    report = ImportReport(
        FILE_KINDS[GUIDANCE], known | {"robots": problem.robots} | facts, picture=picture
    )
    tables = [NamedTable("orders", "tasks", ".tasks", tasks_text(problem))]
    if streets:
        tables.append(NamedTable("streets", "file", "-streets.csv", streets))
    return ImportedFloor(picture, {}, sections, report, tables=tuple(tables))


def layout_rows(path: Path) -> list[str]:
    """The rows of the layout of a guidance graph, in its own marks. Raises InputError."""
    graph = _decoded(path)
    _check_layout(graph, str(path))
    return graph.layout


def streets_text(path: Path) -> str:
    """The weights of a guidance graph as a file of streets; "" if all are 1. Raises InputError."""
    graph, file = _decoded(path), str(path)
    _check_layout(graph, file)
    free = np.array([[SYMBOL_OF[mark] != WALL for mark in row] for row in graph.layout])
    return streets_of(graph, free, file)[0]


def _decoded(path: Path) -> GuidanceGraph:
    """The file. Raises InputError."""
    try:
        return msgspec.json.decode(read_text(path), type=GuidanceGraph)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InputError(f"is not a guidance graph: {error}", str(path)) from None


def _check_layout(graph: GuidanceGraph, file: str) -> None:
    """Raises InputError for a layout of another size, or with unknown marks."""
    if len(graph.layout) != graph.n_row or min(graph.n_row, graph.n_col) < 1:
        raise InputError(f"n_row is {graph.n_row}, but layout has {len(graph.layout)} rows", file)
    for y, row in enumerate(graph.layout):
        if len(row) != graph.n_col:
            raise InputError(f"n_col is {graph.n_col}, but row {y} has {len(row)} cells", file)
        unknown = next((x for x, mark in enumerate(row) if mark not in SYMBOL_OF), None)
        if unknown is not None:
            raise InputError(
                f"cell [{unknown}, {y}] is {quoted(row[unknown])}; known are {' '.join(SYMBOL_OF)}",
                file,
            )


def streets_of(
    graph: GuidanceGraph, free: NDArray[np.bool_], file: str
) -> tuple[str, dict[str, float]]:
    """The streets as CSV ("": all weights are 1), and facts on them. Raises InputError."""
    inner = np.pad(free, 1)
    height, width = free.shape
    edges = np.stack(  # (free cells, 4) in the order of the file
        [
            inner[1 + row : 1 + row + height, 1 + column : 1 + column + width][free]
            for _, row, column in EDGES
        ],
        axis=1,
    )
    cells, listed = len(edges), int(edges.sum())
    if len(graph.weights) not in (0, listed, cells + listed):
        raise InputError(
            f"weights has {len(graph.weights):,} values; this layout needs {listed:,} for its edges, or "
            f"{cells + listed:,} with those of waiting",
            file,
        )
    moves, waits = np.ones((cells, len(EDGES))), np.ones(cells)
    if graph.weights:
        moves[edges] = graph.weights[-listed:] if listed else []
        if len(graph.weights) > listed:
            waits[:] = graph.weights[:cells]
    at = [(int(x), int(y)) for y, x in np.argwhere(free)]
    text = street_table([name for name, _, _ in EDGES], moves, waits, at, file)
    if not text:
        return "", {}
    mean = float(moves[edges].mean()) if listed else 1.0
    return text, {"weighted_cells": text.count("\n") - 1, "mean_weight": round(mean, 4)}
