"""One-shot problems of path finding: how many are solved, and whether their costs are right.

    python tests/helpers/mapf_trials.py MAP [PROBLEMS] [RIGHT_OF_WAY] [FIRST_SEED]

Draws problems of 50 to 400 robots on a MovingAI map: different starts and different goals in the largest
part of the map. Each is imported, run, exported and verified by the commands. The makespan and the sum of
costs are counted again from the letters of the exported paths. An unsolved run must exit with 1 and say
in one sentence how many robots are not on their targets.

Exits with 1 if a command or a cost is wrong, or if more than 2 of 25 problems are unsolved. The tests
run one small problem.
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from automaton.commands import main
from automaton.exchange.problem import read_map
from automaton.exchange.problem_files import largest_part

PROBLEMS = 25
LEAST_ROBOTS, MOST_ROBOTS = 50, 400
TICKS = 2000
MAX_UNSOLVED_SHARE = 2 / 25
STEPS = {"E": (0, 1), "S": (1, 0), "W": (0, -1), "N": (-1, 0)}

Cell = tuple[int, int]  # row, column


class Attempt(NamedTuple):
    """A run of a problem; `wrong`: what contradicts the problem, "" if nothing does."""

    solved: bool
    makespan: int
    sum_of_costs: int
    wrong: str


def draw_problem(source: Path, robots: int, seed: int, folder: Path) -> Path:
    """Copy a map, and write a problem with different starts and different goals beside it."""
    grid = read_map(source)
    rows, columns = largest_part(grid.free).nonzero()
    cells = list(zip(columns.tolist(), rows.tolist(), strict=True))
    draw = random.Random(seed)
    ends = zip(draw.sample(cells, robots), draw.sample(cells, robots), strict=True)
    head = f"0\t{source.name}\t{grid.width}\t{grid.height}"
    lines = [f"{head}\t{x}\t{y}\t{to_x}\t{to_y}\t0" for (x, y), (to_x, to_y) in ends]
    shutil.copy(source, folder)
    path = folder / "problem.scen"
    path.write_text("\n".join(["version 1", *lines, ""]))
    return path


def attempt(problem: Path, right_of_way: str, ticks: int = TICKS) -> Attempt:
    """Import, run, export and verify a problem, and count its costs again."""
    floor, run, out = (problem.with_suffix(suffix) for suffix in (".yaml", ".rec", ".json"))
    settings = ["--set", f"strategy.right_of_way={right_of_way}", "--record", str(run), "--json"]
    command("import", problem, "--out", floor, "--ticks", ticks, "--force")
    code, text, complaint = command("run", floor, *settings)
    outcome = json.loads(text)
    exported, _, refused = command("export", run, "--planviz", out)
    assert exported == 0, refused
    checked, verdict, _ = command("verify", out, "--problem", problem)
    solved, metrics = bool(outcome["finished"]), outcome["metrics"]
    ends, goals = last_arrivals(json.loads(out.read_text())), goals_of(problem)
    on_targets = all(cell == goals[robot] for robot, (cell, _) in enumerate(ends))
    costs = [tick for _, tick in ends]
    wrong = []
    if (code, checked) != ((0, 0) if solved else (1, 1)) or solved != on_targets:
        wrong.append(f"exit codes {code} and {checked}, on targets: {on_targets}: {verdict}")
    if solved and (metrics["makespan"], metrics["sum_of_costs"]) != (max(costs), sum(costs)):
        wrong.append(
            f"{metrics['makespan']}, {metrics['sum_of_costs']}: {max(costs)}, {sum(costs)}"
        )
    if not solved and "unsolved" not in complaint:
        wrong.append(f"no sentence: {complaint}")
    return Attempt(solved, max(costs), sum(costs), "; ".join(wrong))


def goals_of(problem: Path) -> list[Cell]:
    rows = [line.split("\t") for line in problem.read_text().splitlines()[1:]]
    return [(int(row[7]), int(row[6])) for row in rows]


def last_arrivals(output: dict[str, Any]) -> list[tuple[Cell, int]]:
    """The last cell of each robot, and the tick of its last move."""
    arrivals = []
    for (row, column, heading), path in zip(output["start"], output["actualPaths"], strict=True):
        side, last = "ESWN".index(heading), 0
        for tick, letter in enumerate(path.split(","), 1):
            side = (side + {"R": 1, "C": -1}.get(letter, 0)) % 4
            if letter == "F":
                down, right = STEPS["ESWN"[side]]
                row, column, last = row + down, column + right, tick
        arrivals.append(((row, column), last))
    return arrivals


def command(*words: object) -> tuple[int, str, str]:
    """Run a command; return its exit code, output and complaints."""
    out, complaint = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(complaint):
        code = main([str(word) for word in words])
    return code, out.getvalue(), complaint.getvalue()


def trials(source: Path, problems: int, right_of_way: str, first_seed: int) -> int:
    """Print a line for each problem; return 1 if a promise is broken."""
    unsolved, wrong = 0, 0
    for number in range(problems):
        step = (MOST_ROBOTS - LEAST_ROBOTS) / max(1, problems - 1)
        robots = round(LEAST_ROBOTS + number * step)
        with tempfile.TemporaryDirectory() as folder:
            result = attempt(
                draw_problem(source, robots, first_seed + number, Path(folder)), right_of_way
            )
        unsolved += not result.solved
        wrong += bool(result.wrong)
        state = "solved" if result.solved else "unsolved"
        costs = f"makespan {result.makespan:,}, sum of costs {result.sum_of_costs:,}"
        print(f"{number:3} {robots:4} robots {state:8} {costs} {result.wrong}", flush=True)
    print(f"{right_of_way}: {problems - unsolved} of {problems} solved, {wrong} wrong")
    return int(wrong > 0 or unsolved > MAX_UNSOLVED_SHARE * problems)


if __name__ == "__main__":
    source, problems, right_of_way, first_seed = [*sys.argv[1:], "", "", ""][:4]
    strategy = right_of_way or "pibt"
    sys.exit(trials(Path(source), int(problems or PROBLEMS), strategy, int(first_seed or 0)))
