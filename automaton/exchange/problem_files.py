"""Find the reader of a problem by what its file is: a folder, JSON, a map or a scenario."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from automaton.errors import InputError
from automaton.exchange.bare_maps import read_map_problem, read_trips_problem
from automaton.exchange.file_kinds import FOLDER, KINDS, LEAGUE, MAP, SCEN, kind_of
from automaton.exchange.problem import Problem
from automaton.exchange.problem_folder import read_problem_folder
from automaton.exchange.robot_runners import read_league_problem

READERS: Final[dict[str, Callable[[Path, int | None], Problem]]] = {
    FOLDER: read_problem_folder,
    MAP: read_map_problem,
    SCEN: read_trips_problem,
    LEAGUE: read_league_problem,
}


def read_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a problem of another program, for `robots` of its robots. Raises InputError."""
    kind = kind_of(path)
    if kind not in READERS:
        raise InputError(f"is a layout ({KINDS[kind]}), not a problem with tasks", str(path))
    return READERS[kind](path, robots)
