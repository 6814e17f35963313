"""Problems of MovingAI files alone: the trips of a `.scen`, or random tasks on a `.map`."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.moving_ai import GridMap, read_map, read_trips
from automaton.exchange.problem import Listed, Problem, checked, connected_parts

CELLS_PER_ROBOT: Final = 10  # of the largest part of a map, where the number of robots is left out
TASKS_PER_ROBOT: Final = 20
MAX_TASKS: Final = 100_000
SEED: Final = 1


def read_trips_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a `.scen`: each robot drives from its start to its goal. Raises InputError.

    `robots`: those of the first lines alone, as its authors make fleets of several sizes.
    """
    grid, trips = read_trips(path)
    if robots is not None and robots > len(trips):
        raise InputError(f"--robots {robots}, but it has {len(trips)} starts", str(path))
    trips = trips[:robots]
    listed = Listed(str(path), tuple(trip.line for trip in trips))
    return checked(
        Problem(
            name=path.stem,
            grid=grid,
            starts=np.array([trip.start for trip in trips], np.int64),
            tasks=tuple((trip.goal,) for trip in trips),
            assignment="round-robin",
            repeat=False,
            starts_from=listed,
            tasks_from=listed,
        )
    )


def read_map_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a `.map`, and draw starts and tasks in its largest part. Raises InputError."""
    return random_problem(path.stem, read_map(path), robots)


def random_problem(name: str, grid: GridMap, robots: int | None = None) -> Problem:
    """Return a problem with random starts and tasks of one cell in the largest part of a map.

    The draws depend on the map and the number of robots alone. Raises InputError.
    """
    cells = np.flatnonzero(largest_part(grid.free).reshape(-1)).tolist()
    n = max(1, len(cells) // CELLS_PER_ROBOT) if robots is None else robots
    if n > len(cells):
        text = f"--robots {n}, but the largest part of the map has {len(cells)} free cells"
        raise InputError(text, grid.file)
    draw = random.Random(SEED).random
    starts = sorted(cells, key=lambda _: draw())[:n]
    goals = [cells[int(draw() * len(cells))] for _ in range(min(TASKS_PER_ROBOT * n, MAX_TASKS))]
    return checked(
        Problem(
            name=name,
            grid=grid,
            starts=np.array(starts, np.int64),
            tasks=tuple((goal,) for goal in goals),
            assignment="pool",
            revealed=1.5,
            starts_from=Listed(grid.file),
            tasks_from=Listed(grid.file),
        )
    )


def largest_part(free: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return the cells of the largest part of a map that hangs together: (height, width)."""
    parts = connected_parts(free)
    sizes = np.bincount(parts.reshape(-1))
    sizes[0] = 0  # blocked
    cells: npt.NDArray[np.bool_] = parts == sizes.argmax()
    return cells
