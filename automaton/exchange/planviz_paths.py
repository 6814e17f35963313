"""Paths of outputs of the League of Robot Runners: read, followed tick by tick, and the visits on them.

Until 2024, a path is "F,R,C,W": forward, right, left or wait, one action a tick. Robots may follow each
other in any direction.

In 2026 an action takes C = agentMaxCounter ticks, and a path consists of segments:

    [(0,31,13,0,0):(F 21,W 20,F 6,C 3)][(50,31,14,1,2):(F 1,W 8)]

At its begin: tick, row, column, heading (0 to 3: east, south, west, north) and counter. Then runs of
ticks, as there are no single actions: with C = 3, "F 6" are two cells. The counter is the number of ticks
done of a move or a turn; waits do not change it, so "F 2,W 6,F 1" is one move with a delay in it. When it
reaches C, the robot is in the next cell or faces the next side; until then it counts as in the former
one. After t of C ticks of a move it stands t / C of the way to the next cell.

Robots are squares with sides of a cell (`agentSize` of the problem). They may touch, but overlap at no
time within a tick. So a robot moves into a cell that another one is still leaving only behind it, in the
same direction, and never ahead of it.

The state at the begin of a segment is for readers of a part of a file. The league's writer repeats that
of tick 0, and PlanViz uses only its tick, so nothing else of it is checked here.

Sources: the competition's start kit (Simulator.cpp, ActionModel.cpp, Counter.h, 2026); PlanViz 3.2.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.problem import Problem
from automaton.units import count

PATH_LETTERS: Final = "FRCW"  # forward, right, left, wait
FORWARD, RIGHT, LEFT, WAIT = range(4)
WORDS: Final = ("goes forward", "turns right", "turns left")
HEADING_LETTERS: Final = "ESWN"  # clockwise, as directions are numbered
STEP_OF_HEADING: Final = ((0, 1), (1, 0), (0, -1), (-1, 0))  # (rows, columns)
VACANT: Final = -1
NO_TASK: Final = -1  # no task, in a schedule
SEGMENT: Final = re.compile(r"\[\(([^()]*)\):\(([^()]*)\)\]")
SEGMENT_STATE: Final = re.compile(r"([0-9]{1,12})(,-?[0-9]{1,12}){4}")  # the tick comes first
RUN: Final = re.compile(r"(.) ([0-9]{1,12})")
MAX_ACTIONS: Final = 2_000_000_000  # of all robots
SHOWN_LETTERS: Final = 40  # letters of a path in an error
MOST_IN_A_CELL: Final = 5  # robots that hold a cell before two of them overlap

Actions = npt.NDArray[np.uint8]  # (ticks, robots) index of PATH_LETTERS
Cells = npt.NDArray[np.int64]


class PlanViolation(NamedTuple):
    """The first violation of a rule in an output."""

    tick: int
    robots: tuple[int, ...]
    rule: str  # start, wall, collision, swap, action, delay, visit, task, target, release or count
    text: str

    def __str__(self) -> str:
        name = "robot" if len(self.robots) == 1 else "robots"
        robots = f"{name} {' and '.join(map(str, self.robots))} " if self.robots else ""
        return f"tick {self.tick:,}: {robots}{self.text}"


# Reading.


def actions_of(paths: list[str], file: str) -> Actions:
    """Return (ticks, robots) actions of texts such as "F,R,W". Raises InputError."""
    plain = [path.replace(",", "") for path in paths]
    ticks = len(plain[0])
    for robot, (path, letters) in enumerate(zip(paths, plain, strict=True)):
        if len(letters) != ticks:
            text = f"actualPaths: robot {robot} has {count(len(letters), 'action')}"
            raise InputError(f"{text}, robot 0 has {ticks:,}", file)
        if path not in (letters, ",".join(letters)):
            raise InputError(f"actualPaths: robot {robot} has misplaced commas", file)
    codes = np.frombuffer("".join(plain).encode("utf-32-le"), np.uint32).reshape(-1, max(1, ticks))
    actions = np.full(codes.shape, len(PATH_LETTERS), np.uint8)
    for action, letter in enumerate(PATH_LETTERS):
        actions[codes == ord(letter)] = action
    unknown = np.argwhere(actions == len(PATH_LETTERS))
    if len(unknown):
        robot, at = unknown[0].tolist()
        text = f"actualPaths: robot {robot} has the action {plain[robot][at]!r} in tick {at + 1:,}"
        raise InputError(f"{text}; F, R, C and W are allowed", file)
    if not ticks:
        return np.zeros((0, len(paths)), np.uint8)
    return np.ascontiguousarray(actions.T)


def actions_of_segments(paths: list[str], file: str) -> Actions:
    """Return (ticks, robots) actions of texts such as "[(0,1,1,0,0):(F 2,W 3)]". Raises InputError."""
    runs = [_runs(path, f"actualPaths: robot {robot}", file) for robot, path in enumerate(paths)]
    ticks = sum(length for _, length in runs[0])
    for robot, run in enumerate(runs):
        length = sum(length for _, length in run)
        if length != ticks:
            text = f"actualPaths: robot {robot} has {count(length, 'tick')}, robot 0 has {ticks:,}"
            raise InputError(text, file)
    if ticks * len(runs) > MAX_ACTIONS:
        raise InputError(f"actualPaths has more than {MAX_ACTIONS:,} ticks of all robots", file)
    actions = np.empty((ticks, len(runs)), np.uint8)
    for robot, run in enumerate(runs):
        codes = np.array([code for code, _ in run], np.uint8)
        actions[:, robot] = np.repeat(codes, [length for _, length in run])
    return actions


def _runs(path: str, who: str, file: str) -> list[tuple[int, int]]:
    """Return (action, ticks) of the runs of a path; `who`: its place in words. Raises InputError."""
    runs: list[tuple[int, int]] = []
    done = end = 0
    for segment in SEGMENT.finditer(path):
        state = SEGMENT_STATE.fullmatch(segment[1].replace(" ", ""))
        if state is None:
            text = f"{who} has a segment that begins with {segment[1][:SHOWN_LETTERS]!r}, "
            raise InputError(f"{text}not with its tick, row, column, heading and counter", file)
        if int(state[1]) != done or segment.start() != end:
            text = f"{who} has a segment of tick {int(state[1]):,} where tick {done:,} comes next"
            raise InputError(text, file)
        end = segment.end()
        for text in segment[2].split(",") if segment[2] else ():
            run = RUN.fullmatch(text.strip())
            if run is None or run[1] not in PATH_LETTERS:
                what = f"{who} has the run {text[:SHOWN_LETTERS]!r} after tick {done:,}"
                raise InputError(f"{what}; F, R, C or W and its ticks are allowed", file)
            runs.append((PATH_LETTERS.index(run[1]), int(run[2])))
            done += int(run[2])
    if end != len(path):
        raise InputError(f"{who} has {path[end : end + SHOWN_LETTERS]!r} after tick {done:,}", file)
    return runs


# Motion.


@dataclass
class MovingRobots:
    """Robots that move on a map with a border of walls; `step`: its cells to the next, by heading."""

    passable: npt.NDArray[np.bool_]  # (cells,)
    width: int  # cells in a row, with the border
    cell: Cells  # (robots,)
    heading: Cells  # (robots,)

    def __post_init__(self) -> None:
        self.step = np.array([rows * self.width + columns for rows, columns in STEP_OF_HEADING])
        self.robots = np.arange(len(self.cell))

    def standing(self) -> Cells:
        """(robots,) the cell of each robot; VACANT for one that is between two cells."""
        return self.cell

    def place(self, cell: int) -> str:
        """A cell in words."""
        return f"row {cell // self.width - 1}, column {cell % self.width - 1}"

    def off_the_floor(self, tick: int, after: Cells) -> PlanViolation | None:
        """Return the violation of the first robot that goes to a cell that is not free."""
        for robot in np.flatnonzero(~self.passable[after])[:1].tolist():
            text = f"goes to {self.place(int(after[robot]))}, which is not free"
            return PlanViolation(tick, (robot,), "wall", text)
        return None

    def exchange(self, tick: int, robots: tuple[int, int], cells: tuple[int, int]) -> PlanViolation:
        """The violation of two robots that exchange their cells."""
        text = f"exchange {self.place(cells[0])} and {self.place(cells[1])}"
        return PlanViolation(tick, robots, "swap", text)


@dataclass
class SingleTickMotion(MovingRobots):
    """Actions of one tick: robots may follow each other in any direction."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._holder = np.full(self.passable.size, VACANT, np.int64)

    def carry_out(self, tick: int, action: npt.NDArray[np.uint8]) -> PlanViolation | None:
        """Carry out the actions of a tick; return the violation of the first robot, or None."""
        after = np.where(action == FORWARD, self.cell + self.step[self.heading], self.cell)
        violation = self.off_the_floor(tick, after) or self._meeting(tick, after)
        if violation is None:
            self.heading = (self.heading + (action == RIGHT) - (action == LEFT)) & 3
            self.cell = after
        return violation

    def _meeting(self, tick: int, after: Cells) -> PlanViolation | None:
        before, robots, holder = self.cell, self.robots, self._holder
        holder[after] = robots
        for robot in np.flatnonzero(holder[after] != robots)[:1].tolist():
            pair = tuple(np.flatnonzero(after == after[robot])[:2].tolist())
            text = f"are both in {self.place(int(after[robot]))}"
            return PlanViolation(tick, pair, "collision", text)
        met = holder[before]  # the robot that is now in each one's former cell
        holder[after] = VACANT
        swapped = (met != VACANT) & (met != robots)
        swapped &= after == before[np.where(swapped, met, 0)]
        for robot in np.flatnonzero(swapped)[:1].tolist():
            cells = int(before[robot]), int(after[robot])
            return self.exchange(tick, (robot, int(met[robot])), cells)
        return None


@dataclass
class SeveralTickMotion(MovingRobots):
    """Actions of several ticks, which waits may interrupt: robots never overlap."""

    action_ticks: int
    size: float = 1.0  # side of a robot, in cells
    counter: Cells = field(init=False)  # (robots,) ticks done of the action under way
    under_way: npt.NDArray[np.uint8] = field(init=False)  # (robots,) that action, or WAIT

    def __post_init__(self) -> None:
        super().__post_init__()
        self.counter = np.zeros(len(self.cell), np.int64)
        self.under_way = np.full(len(self.cell), WAIT, np.uint8)

    def standing(self) -> Cells:
        """(robots,) the cell of each robot; VACANT for one that is between two cells."""
        moving = (self.under_way == FORWARD) & (self.counter > 0)
        return np.where(moving, VACANT, self.cell)

    def carry_out(self, tick: int, action: npt.NDArray[np.uint8]) -> PlanViolation | None:
        """Carry out a tick; return the violation of the first robot, or None."""
        acts, drives = action != WAIT, action == FORWARD
        for robot in np.flatnonzero(acts & (self.counter > 0) & (action != self.under_way))[:1]:
            what = "move" if self.under_way[robot] == FORWARD else "turn"
            text = f"{WORDS[action[robot]]} before its {what} is done"
            return PlanViolation(tick, (int(robot),), "action", text)
        ahead = self.cell + self.step[self.heading]
        before = np.where(self.under_way == FORWARD, self.counter, 0)
        violation = self.off_the_floor(tick, np.where(drives, ahead, self.cell))
        violation = violation or self._overlap(tick, ahead, before, before + drives)
        if violation is not None:
            return violation
        self.counter += acts
        done = self.counter == self.action_ticks
        self.under_way = np.where(done, WAIT, np.where(acts, action, self.under_way)).astype(
            np.uint8
        )
        self.counter[done] = 0
        turned = (action == RIGHT).astype(np.int64) - (action == LEFT)
        self.heading = np.where(done, self.heading + turned, self.heading) & 3
        self.cell = np.where(done & drives, ahead, self.cell)
        return None

    def _overlap(
        self, tick: int, ahead: Cells, before: Cells, after: Cells
    ) -> PlanViolation | None:
        """Return the violation of the first two robots that overlap within the tick.

        `before`, `after`: ticks done of their moves into the cells `ahead`. Robots of the size of a
        cell overlap only if one holds a cell of the other.
        """
        between = np.flatnonzero(after)
        held = np.concatenate([self.cell, ahead[between]])
        holder = np.concatenate([self.robots, between])
        order = np.argsort(held, kind="stable")
        held, holder = held[order], holder[order]
        overlaps = []
        for apart in range(1, MOST_IN_A_CELL):
            same = np.flatnonzero(held[apart:] == held[:-apart])
            one, other = holder[same], holder[same + apart]
            hit = self._meet(one, other, before, after)
            pairs = zip(
                one[hit].tolist(), other[hit].tolist(), held[same][hit].tolist(), strict=True
            )
            overlaps += [(min(a, b), max(a, b), cell) for a, b, cell in pairs]
        if not overlaps:
            return None
        a, b, cell = min(overlaps)
        moves = after[a] > 0 and after[b] > 0
        if moves and self.cell[a] == ahead[b] and self.cell[b] == ahead[a]:
            return self.exchange(tick, (a, b), (int(self.cell[a]), int(self.cell[b])))
        text = f"are both in {self.place(cell)}"
        if moves and cell in (self.cell[a], self.cell[b]):
            text = f"overlap in {self.place(cell)}, which one enters before the other has left it"
        return PlanViolation(tick, (a, b), "collision", text)

    def _meet(self, one: Cells, other: Cells, before: Cells, after: Cells) -> npt.NDArray[np.bool_]:
        """Whether pairs of robots overlap at any time within a tick."""
        steps = np.array(STEP_OF_HEADING)[self.heading]
        side = self.size * self.action_ticks
        first, last = np.zeros(len(one)), np.ones(len(one))
        ever = np.ones(len(one), np.bool_)
        for axis, cells in enumerate((self.cell // self.width, self.cell % self.width)):
            begin = cells * self.action_ticks + steps[:, axis] * before
            speed = steps[:, axis] * (after - before)
            gap, closing = begin[one] - begin[other], speed[one] - speed[other]
            still = closing == 0
            ever &= ~still | (np.abs(gap) < side)
            rate = np.where(still, 1, closing)
            times = np.sort([(-side - gap) / rate, (side - gap) / rate], axis=0)
            first = np.where(still, first, np.maximum(first, times[0]))
            last = np.where(still, last, np.minimum(last, times[1]))
        return ever & (first < last)


def motion_of(
    free: npt.NDArray[np.bool_],
    start: list[tuple[int, int, str]],
    action_ticks: int | None,
    size: float,
) -> SingleTickMotion | SeveralTickMotion:
    """Return the robots of an output at their starts; `action_ticks`: None until 2024."""
    rows, width = free.shape[0] + 2, free.shape[1] + 2
    passable = np.zeros((rows, width), np.bool_)
    passable[1:-1, 1:-1] = free
    cell = np.array([(row + 1) * width + column + 1 for row, column, _ in start])
    heading = np.array([HEADING_LETTERS.index(side) for _, _, side in start])
    if action_ticks is None:
        return SingleTickMotion(passable.reshape(-1), width, cell, heading)
    return SeveralTickMotion(passable.reshape(-1), width, cell, heading, action_ticks, size)


# Visits.


class ScheduledVisits:
    """Visits of an output that lists none: they follow from the schedules and the robots' cells."""

    def __init__(self, schedule: list[list[tuple[int, int]]], problem: Problem) -> None:
        self.problem = problem
        entries = (
            (tick, robot, task) for robot, entries in enumerate(schedule) for tick, task in entries
        )
        self.entries = sorted(entries, key=itemgetter(0))
        self.begun = 0  # entries of the ticks until now
        self.task = [NO_TASK] * problem.robots
        self.target = np.full(problem.robots, VACANT)  # cell of the next visit of each robot
        self.visits: dict[int, int] = {}  # task: visits done
        self.robot_of: dict[int, int] = {}  # task: the robot of its first visit, or that has it now
        self.finished = 0

    def update(self, tick: int, cell: npt.NDArray[np.int64]) -> PlanViolation | None:
        """Do the visits of a tick at whose end the robots are in cells; `tick`: from 1, in sequence.

        A task may end in the tick of the entry that removes it, and begin in that of its own entry.
        """
        visited = self._visit(np.flatnonzero(cell == self.target))
        due = bisect_right(self.entries, tick, key=itemgetter(0))
        now, self.begun = self.entries[self.begun : due], due
        for _, robot, task in now:
            old = self.task[robot]
            if self.visits.get(old) and task != old:
                text = f"leaves task {old}, which it has begun, for task {task}"
                text = text if task != NO_TASK else f"leaves task {old}, which it has begun"
                return PlanViolation(tick, (robot,), "visit", text)
            self._assign(robot, NO_TASK)
        for _, robot, task in now:
            wrong = self._refused(tick, robot, task)
            if wrong is not None:
                return wrong
            self._assign(robot, task)
        fresh = {robot for _, robot, _ in now} - visited
        self._visit([robot for robot in sorted(fresh) if cell[robot] == self.target[robot]])
        return None

    def _visit(self, robots: Iterable[int]) -> set[int]:
        visited = set(map(int, robots))
        for robot in visited:
            task = self.task[robot]
            self.visits[task] = self.visits.get(task, 0) + 1
            if self.visits[task] == len(self._cells(task)):
                self.finished += 1
                self.task[robot], self.target[robot] = NO_TASK, VACANT
            else:
                self.target[robot] = self._cells(task)[self.visits[task]]
        return visited

    def _cells(self, task: int) -> tuple[int, ...]:
        return self.problem.tasks[task % len(self.problem.tasks)]

    def _refused(self, tick: int, robot: int, task: int) -> PlanViolation | None:
        """Return the error of an entry of a schedule."""
        if task == NO_TASK:
            return None
        problem, robots = self.problem, [robot]
        released = problem.open_tasks + self.finished
        other = self.robot_of.get(task, robot)
        if task < 0 or (not problem.repeat and task >= len(problem.tasks)):
            text = f"has task {task}, which the problem does not have"
        elif problem.assignment == "pool" and task >= released:
            text = f"has task {task}, but the pool has taken in those below {released:,}"
        elif self.visits.get(task, 0) == len(self._cells(task)):
            text = f"has task {task}, which is finished"
        elif other != robot:
            robots.append(other)
            text = f"both have task {task}"
        else:
            return None
        return PlanViolation(tick, tuple(robots), "task", f"{text} in the schedule")

    def _assign(self, robot: int, task: int) -> None:
        if task == NO_TASK:
            self.robot_of.pop(self.task[robot], None)
            cell = VACANT
        else:
            self.robot_of[task] = robot
            cell = self._cells(task)[self.visits.get(task, 0)]
        self.task[robot], self.target[robot] = task, cell


# Targets of one-shot problems.


class TargetArrivals:
    """Since when robots stand on their targets: the cost of a robot is the tick of its last arrival."""

    def __init__(self, problem: Problem, motion: MovingRobots) -> None:
        rows, columns = np.divmod([task[-1] for task in problem.tasks], problem.grid.width)
        self.target = (rows + 1) * motion.width + columns + 1
        self.motion = motion
        self.since = np.where(motion.standing() == self.target, 0, VACANT)

    def update(self, tick: int) -> None:
        """Note which robots stand on their targets at the end of a tick."""
        stands = self.motion.standing() == self.target
        self.since = np.where(stands, np.where(self.since == VACANT, tick, self.since), VACANT)

    def missed(self, tick: int) -> PlanViolation | None:
        """Return the violation of the first robot that does not stand on its target at the end."""
        for robot in np.flatnonzero(self.since == VACANT)[:1].tolist():
            ends, target = (int(cells[robot]) for cells in (self.motion.cell, self.target))
            text = f"ends in {self.motion.place(ends)}; its target is {self.motion.place(target)}"
            return PlanViolation(tick, (robot,), "target", text)
        return None


def wrong_cost(
    arrivals: TargetArrivals | None, ticks: int, robots: int, sum_of_cost: int | None
) -> PlanViolation | None:
    """Robots end on their targets, and the sum of costs is that of their last arrivals there.

    Without targets, each robot costs all ticks.
    """
    cost, what = robots * ticks, "robots times ticks are"
    if arrivals is not None:
        missed = arrivals.missed(ticks)
        if missed is not None:
            return missed
        cost, what = int(arrivals.since.sum()), "the last arrivals on targets add up to"
    if sum_of_cost in (None, cost):
        return None
    text = f"sumOfCost is {sum_of_cost:,}, {what} {cost:,}"
    return PlanViolation(ticks, (), "count", text)
