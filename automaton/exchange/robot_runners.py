"""Problems of the League of Robot Runners: a JSON file that names a map, agents and tasks.

    {"mapFile": "maps/a.map", "agentFile": "agents/a.agents", "taskFile": "tasks/a.tasks",
     "teamSize": 2, "numTasksReveal": 1.5, "version": "2024 LoRR"}

Files are relative to it. Agents and tasks: lines that begin with # are left out, a count comes
first, then a line for each, cells as row * width + column; tasks of 2024 are 1 to 5 cells with
commas, in a pool. Those of 2023 are single cells, dealt out in turn (`taskAssignmentStrategy`).

Source: the competition's start kit, Input_Output_Format.md; leagueofrobotrunners.org.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from automaton.errors import InputError, nearest
from automaton.exchange.moving_ai import read_map
from automaton.exchange.problem import Assignment, Cells, Listed, Problem, checked
from automaton.scenario.document import (
    content_lines,
    counted_lines,
    quoted,
    read_text,
    whole_number,
)
from automaton.scenario.table_files import read_tasks
from automaton.scenario.validation import shown
from automaton.units import count

MAX_TASK_CELLS: Final = 5
MAX_REVEAL: Final = 1000.0  # tasks open at once for each robot
STRATEGIES_OF_2023: Final = ("roundrobin", "roundrobin-fixed")
FILES: Final = {"mapFile": "a map", "agentFile": "the starts", "taskFile": "the tasks"}


def read_league_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a problem of the league; `robots`: the first of its robots alone. Raises InputError."""
    file, data = str(path), _mapping(path)
    folder = path.parent
    for key, meaning in FILES.items():
        if not isinstance(data.get(key), str) or not data[key]:
            raise InputError(_missing(data, key, f"the file of {meaning}"), file)
    team = _number(data, "teamSize", file, integral=True)
    if robots is not None and robots > team:
        raise InputError(f"--robots {robots} of a problem for {int(team)} robots", file)
    grid = read_map(folder / data["mapFile"])
    starts, starts_from = read_agents(folder / data["agentFile"])
    if team > len(starts):
        text = f"teamSize is {int(team)}, but {starts_from.file} has {count(len(starts), 'robot')}"
        raise InputError(text, file)
    tasks = read_tasks(folder / data["taskFile"], MAX_TASK_CELLS)
    assignment, revealed, repeat = _rules(data, file)
    return checked(
        Problem(
            name=path.stem,
            grid=grid,
            starts=starts[: int(team) if robots is None else robots],
            tasks=tasks.tasks,
            assignment=assignment,
            revealed=revealed,
            repeat=repeat,
            starts_from=starts_from,
            tasks_from=Listed(tasks.path, tasks.lines),
        )
    )


def read_agents(path: Path) -> tuple[Cells, Listed]:
    """Read the starts of a file of agents, and where each stands. Raises InputError."""
    file = str(path)
    below = counted_lines(content_lines(path), "agent", file)
    cells = [whole_number(line.text, "a start", file, line.number) for line in below]
    return np.array(cells, np.int64), Listed(file, tuple(line.number for line in below))


def _mapping(path: Path) -> dict[str, Any]:
    """Return the JSON object of a file. Raises InputError."""
    text = read_text(path)
    try:
        data = msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError) as error:
        raise InputError(f"is not valid JSON: {error}", str(path)) from None
    if not isinstance(data, dict):
        raise InputError(f"a problem must be a JSON object, found {shown(data)}", str(path))
    return data


def _rules(data: dict[str, Any], file: str) -> tuple[Assignment, float, bool]:
    """Return how tasks find robots, how many are open for each robot, and whether they repeat."""
    version = str(data.get("version") or "")
    if "2024" in version:
        return "pool", _number(data, "numTasksReveal", file), True
    if version and "2023" not in version:
        text = f"version must be '2024 LoRR', or '2023 LoRR' or left out, found {shown(version)}"
        raise InputError(text, file)
    strategy = data.get("taskAssignmentStrategy", STRATEGIES_OF_2023[0])
    if strategy not in STRATEGIES_OF_2023:
        allowed = " or ".join(STRATEGIES_OF_2023)
        raise InputError(
            f"taskAssignmentStrategy must be {allowed} (a problem of 2023), or version "
            f"'2024 LoRR', found {shown(strategy)}",
            file,
        )
    return "round-robin", 1.0, strategy == STRATEGIES_OF_2023[0]


def _number(data: dict[str, Any], key: str, file: str, integral: bool = False) -> float:
    value = data.get(key)
    if value is None:
        raise InputError(_missing(data, key, "a number"), file)
    kinds = int if integral else (int, float)
    most = 1_000_000 if integral else MAX_REVEAL
    if isinstance(value, bool) or not isinstance(value, kinds) or not 1 <= value <= most:
        kind = "a whole number" if integral else "a number"
        raise InputError(f"{key} must be {kind} from 1 to {most:,.0f}, found {shown(value)}", file)
    return float(value)


def _missing(data: dict[str, Any], key: str, meaning: str) -> str:
    if key in data:
        return f"{key} must be {meaning}, found {quoted(str(data[key]))}"
    return f"the key '{key}' ({meaning}) is missing{nearest(key, data)}"
