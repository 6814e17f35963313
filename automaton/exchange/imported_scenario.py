"""A problem of another program as files of ours: a scenario, its starts and its tasks.

Robots are differential, begin facing east, and take a tick for a move and for a turn; one robot fits
in a cell. The strategies are named, so that `--set strategy.right_of_way=...` compares others.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import yaml

from automaton.exchange.problem import Problem
from automaton.units import count

ALLOCATION: Final = "greedy"
ROUTING: Final = "shortest"
RIGHT_OF_WAY: Final = "pibt"
FREE, WALL = ".", "#"


def imported_files(problem: Problem, stem: str, ticks: int) -> dict[str, str]:
    """Return the texts of the files STEM.yaml, STEM-starts.csv and STEM.tasks, by name.

    `ticks`: after which a run ends.
    """
    starts, tasks = f"{stem}-starts.csv", f"{stem}.tasks"
    return {
        starts: starts_text(problem),
        tasks: tasks_text(problem),
        f"{stem}.yaml": scenario_text(problem, starts, tasks, ticks),
    }


def scenario_text(problem: Problem, starts: str, tasks: str, ticks: int) -> str:
    """Return the scenario of a problem; `starts` and `tasks`: the files that it names."""
    grid = problem.grid
    size = f"{count(problem.robots, 'robot')} on {grid.width} x {grid.height} cells"
    orders: dict[str, object] = {"tasks": tasks, "repeat": problem.repeat}
    if problem.assignment == "pool":
        orders["revealed"] = problem.revealed
    orders["assign"] = problem.assignment
    if problem.skip_reached:
        orders["skip_reached"] = True
    fleet = {"robots": problem.robots, "kinematics": "differential", "start": {"file": starts}}
    strategy = {"allocation": ALLOCATION, "routing": ROUTING, "right_of_way": RIGHT_OF_WAY}
    sections = {
        "name": problem.name[:200],
        "summary": f"{size}, {count(len(problem.tasks), 'task')}, imported.",
        "fleet": fleet | {"heading": "east"},
        "durations": {"move": 1, "turn": 1},
        "orders": orders,
        "strategy": strategy,
        "stop": {"when": "never" if problem.repeat else "delivered", "max_duration": ticks},
        "seed": 1,
    }
    lines = [f"{key}: {flow(value)}" for key, value in sections.items()]
    symbols = np.where(grid.free, FREE, WALL)
    return "\n".join(
        [*lines, "layout:", "  picture: |", *(f"    {''.join(r)}" for r in symbols), ""]
    )


def starts_text(problem: Problem) -> str:
    """Return the starts as a CSV file."""
    width = problem.grid.width
    rows = [f"{cell % width},{cell // width}" for cell in problem.starts.tolist()]
    return "\n".join(["x,y", *rows, ""])


def tasks_text(problem: Problem) -> str:
    """Return the tasks as a file of tasks: a count, then the cells of each."""
    rows = [",".join(map(str, task)) for task in problem.tasks]
    return "\n".join([str(len(rows)), *rows, ""])


class _PlainDumper(yaml.SafeDumper):
    """A dumper that writes what is there twice twice, without an alias."""

    def ignore_aliases(self, data: object) -> bool:
        """Whether data has no alias."""
        return True


def flow(value: object) -> str:
    """Return a value as YAML in one line."""
    text: str = yaml.dump(
        value,
        Dumper=_PlainDumper,
        default_flow_style=True,
        sort_keys=False,
        width=10**6,
        allow_unicode=True,
    )
    return text.removesuffix("\n").removesuffix("\n...")
