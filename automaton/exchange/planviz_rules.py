"""Check an output of the League of Robot Runners against its problem, tick by tick.

A robot turns by 90 degrees, goes one cell ahead or waits. It stays on free cells, no two robots are
in one cell, and no two exchange their cells. A visit is done when the robot is on the cell at the end
of a tick, at most one in a tick; the visits of a task are done in turn, by one robot, which does no
other task in between. This module shares no code with the engine.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.planviz import FORWARD, HEADINGS, LEFT, RIGHT, PlanvizOutput
from automaton.exchange.planviz_tasks import check_tasks
from automaton.exchange.planviz_violation import Violation
from automaton.exchange.problem import Problem
from automaton.units import count

STEPS = ((0, 1), (1, 0), (0, -1), (-1, 0))  # (rows, columns) of a step, in the order of HEADINGS
VACANT = -1


class Motion(NamedTuple):
    """Where an output leads its robots, up to the first violation of a rule of motion."""

    violation: Violation | None
    visited: npt.NDArray[np.int64]  # (events,) cell of the robot of each event; VACANT after it


def verify_output(output: PlanvizOutput, problem: Problem) -> Violation | None:
    """Return the first violation, or None. Raises InputError if they do not fit each other."""
    if output.robots != problem.robots:
        text = f"teamSize is {output.robots:,}, the problem has {count(problem.robots, 'robot')}"
        raise InputError(text, output.file)
    motion = follow(output, problem)
    tasks = check_tasks(output, problem, motion.visited.tolist())
    violations = [one for one in (_wrong_start(output, problem), motion.violation, tasks) if one]
    return min(violations, key=lambda one: one.tick, default=None)


def _wrong_start(output: PlanvizOutput, problem: Problem) -> Violation | None:
    """Robots start where the problem says, and face east."""
    width = problem.grid.width
    for robot, ((row, column, heading), cell) in enumerate(
        zip(output.start, problem.starts.tolist(), strict=True)
    ):
        if (row, column) != divmod(cell, width) or heading != HEADINGS[0]:
            said = f"starts in row {row}, column {column}, heading {heading}"
            return Violation(
                0, (robot,), "start", f"{said}; the problem says {problem.grid.place(cell)}, E"
            )
    return None


def follow(output: PlanvizOutput, problem: Problem) -> Motion:
    """Move all robots tick by tick, until a rule of motion is broken."""
    height, width = problem.grid.free.shape
    free = np.zeros((height + 2, width + 2), np.bool_)
    free[1:-1, 1:-1] = problem.grid.free
    passable, stride = free.reshape(-1), width + 2
    step = np.array([rows * stride + columns for rows, columns in STEPS])
    row, column = (np.array([start[k] for start in output.start]) for k in (0, 1))
    visited = np.full(len(output.events), VACANT, np.int64)
    if ((row < 0) | (row >= height) | (column < 0) | (column >= width)).any():
        return Motion(None, visited)  # the start itself is a violation
    cell = (row + 1) * stride + column + 1
    heading = np.array([HEADINGS.index(start[2]) for start in output.start])
    holder = np.full(passable.size, VACANT, np.int64)
    event_robot = np.array([event[1] for event in output.events], np.int64)
    ends = np.searchsorted(
        [event[0] for event in output.events], np.arange(output.ticks + 1), "right"
    )
    for tick, action in enumerate(output.actions, 1):
        ahead = np.where(action == FORWARD, cell + step[heading], cell)
        violation = _broken(tick, cell, ahead, passable, holder, stride)
        if violation is not None:
            return Motion(violation, visited)
        heading = (heading + (action == RIGHT) - (action == LEFT)) & 3
        cell = ahead
        now = slice(ends[tick - 1], ends[tick])
        at = cell[event_robot[now]]
        visited[now] = (at // stride - 1) * width + at % stride - 1
    return Motion(None, visited)


def _broken(
    tick: int,
    before: npt.NDArray[np.int64],
    after: npt.NDArray[np.int64],
    passable: npt.NDArray[np.bool_],
    holder: npt.NDArray[np.int64],
    stride: int,
) -> Violation | None:
    """Return the violation of a tick, that of the first robot; `holder`: (cells,) all VACANT, scratch."""
    robots = np.arange(len(after))

    def place(cell: int) -> str:
        return f"row {cell // stride - 1}, column {cell % stride - 1}"

    wrong = np.flatnonzero(~passable[after])
    if len(wrong):
        robot = int(wrong[0])
        return Violation(
            tick, (robot,), "wall", f"goes to {place(int(after[robot]))}, which is not free"
        )
    holder[after] = robots
    wrong = np.flatnonzero(holder[after] != robots)
    if len(wrong):
        robot = int(wrong[0])
        pair = tuple(np.flatnonzero(after == after[robot])[:2].tolist())
        return Violation(tick, pair, "collision", f"are both in {place(int(after[robot]))}")
    met = holder[before]  # which robot is now where each one was
    holder[after] = VACANT
    swapped = (met != VACANT) & (met != robots)
    swapped &= after == before[np.where(swapped, met, 0)]
    wrong = np.flatnonzero(swapped)
    if len(wrong):
        robot = int(wrong[0])
        cells = f"{place(int(before[robot]))} and {place(int(after[robot]))}"
        return Violation(tick, (robot, int(met[robot])), "swap", f"exchange {cells}")
    return None
