"""Find the reader of a problem by what its file is: a folder, `.json`, `.map` or `.scen`."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from automaton.errors import InputError
from automaton.exchange.bare_maps import read_map_problem, read_trips_problem
from automaton.exchange.problem import Problem
from automaton.exchange.problem_folder import read_problem_folder
from automaton.exchange.robot_runners import read_league_problem

READERS: Final[dict[str, tuple[Callable[[Path, int | None], Problem], str]]] = {
    ".map": (read_map_problem, "MovingAI map: random starts and tasks"),
    ".scen": (read_trips_problem, "MovingAI scenario: starts and goals"),
    ".json": (read_league_problem, "problem of the League of Robot Runners"),
}


def read_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a problem of another program, for `robots` of its robots. Raises InputError."""
    if os.path.isdir(path):
        return read_problem_folder(path, robots)
    if not os.path.exists(path):
        raise InputError("no such file", str(path))
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(f"{suffix} ({meaning})" for suffix, (_, meaning) in READERS.items())
        raise InputError(
            f"its name must end in {known}, or it must be a folder with map.txt, agents_K.csv and "
            "tasks_one.csv",
            str(path),
        )
    return reader[0](path, robots)
