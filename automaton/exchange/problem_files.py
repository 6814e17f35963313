"""Read a problem: files of MovingAI, a folder of tables, or a problem of the League of Robot Runners.

MovingAI: the trips of a `.scen`, or random tasks on a `.map`.

A folder: map.txt is a MovingAI map. agents_K.csv, one file per size of a fleet, has the columns `agent
id,row,col`. tasks_one.csv has the column `targets`, one cell for each task: row * width + column, from
0, or from 1 if only then all cells are free. Task j of robot r is line j * robots + r, and a robot skips
a task if it is already on its cell.

The league: a JSON file that names the other files, relative to itself:

    {"mapFile": "maps/a.map", "agentFile": "agents/a.agents", "taskFile": "tasks/a.tasks",
     "teamSize": 2, "numTasksReveal": 1.5, "version": "2024 LoRR"}

Agents and tasks: lines that begin with # are skipped; a count comes first, then a line for each entry,
with cells as row * width + column. From 2024 on tasks are 1 to 5 cells with commas, in a pool. Tasks of
2023 are single cells, assigned round-robin (`taskAssignmentStrategy`). In 2026 an action takes
`agentCounter` ticks, robots are squares with sides of `agentSize` cells, and they are delayed:

    "agentCounter": 3, "agentSize": 1.0, "delayConfig": {"eventModel": "bernoulli", "pDelay": 0.01,
     "minDelay": 1, "maxDelay": 4, "durationModel": "gaussian", "gaussMeanRatio": 0.5,
     "gaussStdRatio": 0.22}

Sources: the experiments of A. Yukhnevich and A. Andreychuk, Enhancing PIBT via Multi-Action Operations,
AAAI-26. The competition's start kit, Input_Output_Format.md; leagueofrobotrunners.org.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, nearest
from automaton.exchange.imported_floor import FILE_KINDS, FOLDER, LEAGUE, MAP, SCEN, kind_of
from automaton.exchange.problem import (
    Assignment,
    Cells,
    GridMap,
    ListedLines,
    Problem,
    checked,
    connected_parts,
    read_map,
    read_trips,
)
from automaton.scenario.order_files import read_tasks
from automaton.scenario.text_files import (
    ContentLine,
    content_lines,
    counted_lines,
    quoted,
    read_text,
    whole_number,
)
from automaton.scenario.validation import shown
from automaton.units import count

CELLS_PER_ROBOT: Final = 10  # share of the largest part of a map, by default
TASKS_PER_ROBOT: Final = 20
MAX_TASKS: Final = 100_000
SCENARIO_SEED: Final = 1

MAP_FILE: Final = "map.txt"
TASKS_FILE: Final = "tasks_one.csv"
AGENTS: Final = "agents_*.csv"
AGENT_COLUMNS: Final = ("agent id", "row", "col")
TASK_COLUMNS: Final = ("targets",)
MAX_TASK_CELLS: Final = 5
MAX_TEAM: Final = 1_000_000
MAX_ACTION_TICKS: Final = 1000
MAX_DELAY: Final = 1_000_000  # ticks
MAX_REVEAL: Final = 1000.0  # tasks open at once for each robot
SQUARE_VERSION: Final = "2026"  # robots are squares that never overlap
MIN_ROBOT_SIZE: Final = 0.01  # side of a robot, in cells
POOL_VERSIONS: Final = ("2024", SQUARE_VERSION)
EVENT_MODELS: Final = ("bernoulli", "poisson")
DURATION_MODELS: Final = ("uniform", "gaussian")
STRATEGIES_OF_2023: Final = ("roundrobin", "roundrobin-fixed")
FILES: Final = {"mapFile": "a map", "agentFile": "the starts", "taskFile": "the tasks"}


def read_trips_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a `.scen`: each robot drives from its start to its goal. Raises InputError.

    `robots`: only the first lines, as the authors define fleets of several sizes.
    """
    grid, trips = read_trips(path)
    if robots is not None and robots > len(trips):
        raise InputError(f"--robots {robots}, but it has {len(trips)} starts", str(path))
    trips = trips[:robots]
    listed = ListedLines(str(path), tuple(trip.line for trip in trips))
    return checked(
        Problem(
            name=path.stem,
            grid=grid,
            starts=np.array([trip.start for trip in trips], np.int64),
            tasks=tuple((trip.goal,) for trip in trips),
            assignment="round-robin",
            repeat=False,
            on_targets=True,
            starts_from=listed,
            tasks_from=listed,
        )
    )


def read_map_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a `.map`, and draw starts and tasks in its largest part. Raises InputError."""
    return random_problem(path.stem, read_map(path), robots)


def random_problem(name: str, grid: GridMap, robots: int | None = None) -> Problem:
    """Return a problem with random starts and tasks of one cell in the largest part of a map.

    The draws depend only on the map and the number of robots. Raises InputError.
    """
    cells = np.flatnonzero(largest_part(grid.free).reshape(-1)).tolist()
    n = max(1, len(cells) // CELLS_PER_ROBOT) if robots is None else robots
    if n > len(cells):
        text = f"--robots {n}, but the largest part of the map has {len(cells)} free cells"
        raise InputError(text, grid.file)
    draw = random.Random(SCENARIO_SEED).random
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
            starts_from=ListedLines(grid.file),
            tasks_from=ListedLines(grid.file),
        )
    )


def largest_part(free: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return the cells of the largest connected part of a map: (height, width)."""
    parts = connected_parts(free)
    sizes = np.bincount(parts.reshape(-1))
    sizes[0] = 0  # blocked
    cells: npt.NDArray[np.bool_] = parts == sizes.argmax()
    return cells


# A folder of tables.


def read_problem_folder(path: Path, robots: int | None = None) -> Problem:
    """Read the problem of a folder for a fleet of `robots`. Raises InputError."""
    for name in (MAP_FILE, TASKS_FILE):
        if not (path / name).is_file():
            raise InputError(f"a folder of a problem must hold {name}", str(path))
    grid = read_map(path / MAP_FILE)
    starts, starts_from = _starts(path, robots, grid)
    tasks, tasks_from = _tasks(path / TASKS_FILE, grid)
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
    """Return the fleet sizes for which the folder has starts. Raises InputError."""
    return sorted(len(_table(file, AGENT_COLUMNS)) for file in path.glob(AGENTS))


def _starts(path: Path, robots: int | None, grid: GridMap) -> tuple[Cells, ListedLines]:
    """Read the starts of the file for this number of robots. Raises InputError."""
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
    return np.array(cells, np.int64), ListedLines(file, tuple(line for line, _ in rows))


def _tasks(path: Path, grid: GridMap) -> tuple[tuple[tuple[int, ...], ...], ListedLines]:
    rows = _table(path, TASK_COLUMNS)
    numbers = [whole_number(values[0], TASK_COLUMNS[0], str(path), line) for line, values in rows]
    free = set(np.flatnonzero(grid.free).tolist())
    different = set(numbers)
    from_one = not different <= free and {number - 1 for number in different} <= free
    tasks = tuple((number - from_one,) for number in numbers)
    return tasks, ListedLines(str(path), tuple(line for line, _ in rows))


def _table(path: Path, columns: tuple[str, ...]) -> list[tuple[int, list[str]]]:
    """Return the rows below the header of a CSV file, with their lines. Raises InputError."""
    file, lines = str(path), content_lines(path)
    head = ",".join(columns)
    first = lines[0] if lines else ContentLine(1, "")
    if [name.strip() for name in re.split(",", first.text)] != list(columns):
        raise InputError(f"its header must be '{head}', found {quoted(first.text)}", file, 1)
    rows = []
    for line in lines[1:]:
        values = line.text.split(",")
        if len(values) != len(columns):
            text = f"the line has {len(values)} values, but the header has {len(columns)} columns"
            raise InputError(text, file, line.number)
        rows.append((line.number, values))
    if not rows:
        raise InputError("has no rows below its header", file, first.number)
    return rows


# The League of Robot Runners.


def read_league_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a problem of the league; `robots`: only its first robots. Raises InputError."""
    file, data = str(path), _mapping(path)
    folder = path.parent
    for key, meaning in FILES.items():
        if not isinstance(data.get(key), str) or not data[key]:
            raise InputError(_missing(data, key, f"the file of {meaning}"), file)
    team = _number(data, "teamSize", file, 1, MAX_TEAM)
    if robots is not None and robots > team:
        raise InputError(f"--robots {robots} but the problem has {int(team)} robots", file)
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
            action_ticks=int(_number(data, "agentCounter", file, 1, MAX_ACTION_TICKS, default=1)),
            delays=_delays(data, file),
            robot_size=_robot_size(data, file),
            starts_from=starts_from,
            tasks_from=ListedLines(tasks.path, tasks.lines),
        )
    )


def _robot_size(data: dict[str, Any], file: str) -> float | None:
    if SQUARE_VERSION not in str(data.get("version")):
        return None
    return _number(data, "agentSize", file, MIN_ROBOT_SIZE, 1, integral=False, default=1.0)


def _delays(data: dict[str, Any], file: str) -> dict[str, Any] | None:
    """The delays of a problem of 2026 as a scenario has them; None: none."""
    said = data.get("delayConfig")
    if said is None:
        return None
    if not isinstance(said, dict):
        raise InputError(f"delayConfig must be a mapping, found {shown(said)}", file)
    probability = _number(said, "pDelay", file, 0, 1, integral=False)
    least = int(_number(said, "minDelay", file, 1, MAX_DELAY))
    most = int(_number(said, "maxDelay", file, least, MAX_DELAY))
    events = _one_of(said, "eventModel", EVENT_MODELS, file)
    durations = _one_of(said, "durationModel", DURATION_MODELS, file)
    if not probability:
        return None
    delays: dict[str, Any] = {
        "probability": probability,
        "events": events,
        "ticks": {"from": least, "to": most},
    }
    if durations == "gaussian":
        mean = _number(said, "gaussMeanRatio", file, 0, 1, integral=False)
        deviation = _number(said, "gaussStdRatio", file, 0, 10, integral=False)
        delays["distribution"] = {"gaussian": {"mean_ratio": mean, "sd_ratio": deviation}}
    return delays


def _one_of(data: dict[str, Any], key: str, allowed: Sequence[str], file: str) -> str:
    value = data.get(key)
    if value not in allowed:
        raise InputError(_missing(data, key, " or ".join(allowed)), file)
    return str(value)


def read_agents(path: Path) -> tuple[Cells, ListedLines]:
    """Read the starts of a file of agents, with their lines. Raises InputError."""
    file = str(path)
    below = counted_lines(content_lines(path), "agent", file)
    cells = [whole_number(line.text, "a start", file, line.number) for line in below]
    return np.array(cells, np.int64), ListedLines(file, tuple(line.number for line in below))


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
    """Return the assignment of tasks, the open tasks per robot, and whether tasks repeat."""
    version = str(data.get("version") or "")
    if any(year in version for year in POOL_VERSIONS):
        return "pool", _number(data, "numTasksReveal", file, 1, MAX_REVEAL, integral=False), True
    if version and "2023" not in version:
        text = (
            "version must be '2026 LoRR', '2024 LoRR', '2023 LoRR' or left out, "
            f"found {shown(version)}"
        )
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


def _number(
    data: dict[str, Any],
    key: str,
    file: str,
    least: float,
    most: float,
    integral: bool = True,
    default: float | None = None,
) -> float:
    value = data.get(key, default)
    if value is None:
        raise InputError(_missing(data, key, "a number"), file)
    kinds = int if integral else (int, float)
    if isinstance(value, bool) or not isinstance(value, kinds) or not least <= value <= most:
        kind = "a whole number" if integral else "a number"
        text = f"{key} must be {kind} from {least:,.10g} to {most:,.0f}, found {shown(value)}"
        raise InputError(text, file)
    return float(value)


def _missing(data: dict[str, Any], key: str, meaning: str) -> str:
    if key in data:
        return f"{key} must be {meaning}, found {quoted(str(data[key]))}"
    return f"the key '{key}' ({meaning}) is missing{nearest(key, data)}"


PROBLEM_READERS: Final[dict[str, Callable[[Path, int | None], Problem]]] = {
    FOLDER: read_problem_folder,
    MAP: read_map_problem,
    SCEN: read_trips_problem,
    LEAGUE: read_league_problem,
}


def read_problem(path: Path, robots: int | None = None) -> Problem:
    """Read a problem of another program, for `robots` of its robots. Raises InputError."""
    kind = kind_of(path)
    if kind not in PROBLEM_READERS:
        raise InputError(f"is a layout ({FILE_KINDS[kind]}), not a problem with tasks", str(path))
    return PROBLEM_READERS[kind](path, robots)
