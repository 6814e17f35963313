"""The rules of tasks and visits that an output of the League of Robot Runners has to keep."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from automaton.exchange.planviz import NO_TASK, PlanvizOutput
from automaton.exchange.planviz_violation import Violation
from automaton.exchange.problem import Problem
from automaton.units import count


@dataclass
class Progress:
    """How far tasks and robots are, from event to event."""

    where: list[int]  # (robots,) the cell of a robot's last visit, or its start
    last_tick: list[int]  # (robots,) of a robot's last visit
    last_task: list[int]  # (robots,) that a robot finished, with round-robin; NO_TASK: none yet
    begun: dict[int, int] = field(default_factory=dict)  # robot: the task that it has to go on with
    robot_of: dict[int, int] = field(default_factory=dict)  # task: the robot of its first visit
    visits: dict[int, int] = field(default_factory=dict)  # task: visits done
    finished_at: list[int] = field(default_factory=list)  # tick of each finished task


def check_tasks(
    output: PlanvizOutput, problem: Problem, visited: Sequence[int]
) -> Violation | None:
    """Return the first violation of a rule about tasks, or None.

    `visited`: the cell of the robot of each event; negative from where motion breaks a rule.
    """
    wrong = min(_wrong_tasks(output, problem), key=lambda one: one.tick, default=None)
    n = problem.robots
    progress = Progress(problem.starts.tolist(), [0] * n, [NO_TASK] * n)
    for event, cell in zip(output.events, visited, strict=True):
        if cell < 0:
            break
        broken = _broken_by(output, problem, progress, event, cell)
        if broken is not None:
            return broken if wrong is None or broken.tick <= wrong.tick else wrong
    else:
        late = next(_wrong_counts(output, problem, progress), None)
        if wrong is None or (late is not None and late.tick < wrong.tick):
            return late
    return wrong


def _wrong_tasks(output: PlanvizOutput, problem: Problem) -> Iterator[Violation]:
    """Tasks are those of the lines of the problem, repeated."""
    width, lines = problem.grid.width, problem.tasks
    for task, (released, places) in output.tasks.items():
        expected = [divmod(cell, width) for cell in lines[task % len(lines)]]
        if task < 0 or (not problem.repeat and task >= len(lines)):
            text = f"task {task} is not one of the {len(lines):,} of the problem"
            yield Violation(max(0, released), (), "task", text)
        elif places != expected:
            cells = "; ".join(f"row {row}, column {column}" for row, column in expected)
            text = f"task {task} has other cells than those of the problem: {cells}"
            yield Violation(max(0, released), (), "task", text)


def _broken_by(
    output: PlanvizOutput,
    problem: Problem,
    progress: Progress,
    event: tuple[int, int, int, int],
    cell: int,
) -> Violation | None:
    """Return what is wrong with an event; enter it if nothing is."""
    tick, robot, task, visit = event
    released, places = output.tasks[task]
    done = progress.visits.get(task, 0)
    row, column = divmod(cell, problem.grid.width)
    begun = progress.begun.get(robot)
    robots: tuple[int, ...] = (robot,)
    if done == len(places):
        text = f"visits for task {task}, which is finished"
    elif visit != done + 1:
        text = f"does visit {visit} of task {task}, of which {done} of {len(places)} are done"
    elif tick <= released:
        text = f"visits for task {task}, which is released at the end of tick {released:,}"
    elif progress.last_tick[robot] == tick:
        text = f"does a second visit in the tick, for task {task}"
    elif progress.robot_of.get(task, robot) != robot:
        robots = (robot, progress.robot_of[task])
        text = f"both visit for task {task}: it stays with the robot of its first visit"
    elif begun is not None and begun != task:
        text = f"visits for task {task} before task {begun}, which it has begun, is finished"
    elif (row, column) != places[done]:
        where = f"row {places[done][0]}, column {places[done][1]}"
        text = f"is in row {row}, column {column}, not in {where} for task {task}"
    elif not _is_scheduled(output, robot, tick, task):
        text = f"visits for task {task}, which is not scheduled for it then"
    elif done == 0 and not _is_next(problem, progress, robot, task):
        text = f"visits for task {task}, which is not its next one"
    else:
        _enter(progress, event, len(places), cell)
        return None
    return Violation(tick, robots, "visit", text)


def _enter(progress: Progress, event: tuple[int, int, int, int], visits: int, cell: int) -> None:
    tick, robot, task, visit = event
    progress.visits[task] = visit
    progress.robot_of[task] = robot
    progress.last_tick[robot] = tick
    progress.where[robot] = cell
    if visit < visits:
        progress.begun[robot] = task
        return
    progress.begun.pop(robot, None)
    progress.last_task[robot] = task
    progress.finished_at.append(tick)


def _is_scheduled(output: PlanvizOutput, robot: int, tick: int, task: int) -> bool:
    """Whether a task is a robot's at the end of a tick; start kits count from this tick or the next."""
    if output.schedule is None:
        return True
    schedule = output.schedule[robot]
    first = bisect_right(schedule, tick - 1, key=lambda entry: entry[0])
    now = bisect_right(schedule, tick, key=lambda entry: entry[0])
    return any(scheduled == task for _, scheduled in schedule[max(0, first - 1) : now])


def _is_next(problem: Problem, progress: Progress, robot: int, task: int) -> bool:
    """Whether a robot may begin a task: with round-robin, tasks are dealt out in turn."""
    if problem.assignment == "pool":
        return True
    n, lines = problem.robots, problem.tasks
    last = progress.last_task[robot]
    expected = robot if last == NO_TASK else last + n
    if task % n != robot or task < expected:
        return False
    passed = range(expected, task, n)[: len(lines)]  # then the lines are the same again
    here = progress.where[robot]
    return all(problem.skip_reached and lines[one % len(lines)][0] == here for one in passed)


def _wrong_counts(
    output: PlanvizOutput, problem: Problem, progress: Progress
) -> Iterator[Violation]:
    """The pool is refilled as tasks are finished; these, ticks and what they cost are counted."""
    if problem.assignment == "pool" and problem.repeat:
        ends = [0] * problem.open_tasks + progress.finished_at
        for task, end in enumerate(ends):
            released = output.tasks[task][0] if task in output.tasks else None
            if released != end:
                said = "missing" if released is None else f"released in tick {released:,}"
                text = f"task {task} is {said}; the pool takes it in at the end of tick {end:,}"
                yield Violation(
                    end if released is None else min(end, released), (), "release", text
                )
        if len(output.tasks) > len(ends):
            text = f"there are {len(output.tasks):,} tasks, {len(ends):,} were released"
            yield Violation(output.ticks, (), "release", text)
    if output.finished != len(progress.finished_at):
        text = f"numTaskFinished is {output.finished:,}"
        text += f", the events finish {len(progress.finished_at):,}"
        yield Violation(output.ticks, (), "count", text)
    if output.makespan != output.ticks:
        text = f"makespan is {output.makespan:,}, the paths have {count(output.ticks, 'tick')}"
        yield Violation(output.ticks, (), "count", text)
    cost = output.robots * output.ticks
    if output.sum_of_cost != cost:
        text = f"sumOfCost is {output.sum_of_cost:,}, robots times ticks are {cost:,}"
        yield Violation(output.ticks, (), "count", text)
