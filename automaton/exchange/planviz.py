"""Outputs of the League of Robot Runners, as PlanViz shows them: read, and checked against a problem.

    actionModel        "MAPF_T"                    actualPaths     for each robot "F,R,C,W": forward,
    version            "2024 LoRR"                                 right, left, wait, tick by tick
    teamSize           robots                      plannerPaths    as they were planned
    start              [row, column, "E"], ...     errors          of the planner
    numTaskFinished                                actualSchedule  for each robot "tick:task,..."
    sumOfCost          ticks of all robots         events          [tick, robot, task, visits done]
    makespan           ticks                       tasks           [task, released, [row, column, ...]]

A robot turns by 90 degrees, goes one cell ahead or waits. It stays on free cells, no two robots are in
one cell, and no two exchange their cells. A visit is done when the robot is on the cell at the end of a
tick, at most one per tick. One robot does the visits of a task in sequence, and no other task in
between. This module shares no code with the engine.

In 2026 there are more keys and other paths (planviz_paths), and sumOfCost is missing:

    version            "2026 LoRR"                 agentMaxCounter     ticks of a move and of a turn
    outputSegmentSize  ticks of a segment          delayIntervals      for each robot [begin, end], ...
    numPlannerErrors, numScheduleErrors, numEntryTimeouts, scheduleErrors, plannerTimes

A robot waits in the ticks begin + 1 to end of its delays. Files of the league may lack `events` and
`tasks`: then visits follow from actualSchedule. Its entry of tick t counts from the end of this tick; the
robot of a task has none from its last visit to its next entry.

In 2023 tasks had one cell each and were assigned round-robin. `tasks` is [task, row, column], numbered
in the order of assignment; `events` has for each robot [task, tick, "assigned" or "finished"]. There is
neither `version` nor `actualSchedule`.

Sources: the competition's start kit, Input_Output_Format.md (2023 and 2024), Simulator.cpp and
DelayGenerator.cpp (2026); the outputs of 2026 in PlanViz 3.2.
"""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.planviz_paths import (
    HEADING_LETTERS,
    NO_TASK,
    VACANT,
    WAIT,
    Actions,
    PlanViolation,
    ScheduledVisits,
    TargetArrivals,
    actions_of,
    actions_of_segments,
    motion_of,
    wrong_cost,
)
from automaton.exchange.problem import Problem
from automaton.scenario.validation import T, shown, validated
from automaton.units import count

ACTION_MODEL: Final = "MAPF_T"
VERSION: Final = "2024 LoRR"
VERSION_2023: Final = "2023 LoRR"
VERSION_2026: Final = "2026 LoRR"
ASSIGNED, FINISHED = "assigned", "finished"  # events of 2023
MAX_PLANVIZ_BYTES: Final = 2_000_000_000


class PlanvizFile(msgspec.Struct, rename="camel"):
    """The keys of an output; other keys are ignored."""

    action_model: str
    version: str
    team_size: int
    start: list[tuple[int, int, str]]
    num_task_finished: int
    sum_of_cost: int
    makespan: int
    actual_paths: list[str]
    planner_paths: list[str]
    errors: list[Any]
    actual_schedule: list[str]
    events: list[tuple[int, int, int, int]]
    tasks: list[tuple[int, int, list[int]]]


class PlanvizFile2026(msgspec.Struct, rename="camel"):
    """The keys of an output of 2026; other keys are ignored."""

    action_model: str
    version: str
    team_size: int
    start: list[tuple[int, int, str]]
    num_task_finished: int
    makespan: int
    agent_max_counter: int
    actual_paths: list[str]
    delay_intervals: list[list[tuple[int, int]]] | None = None
    sum_of_cost: int | None = None
    actual_schedule: list[str] | None = None
    events: list[tuple[int, int, int, int]] | None = None
    tasks: list[tuple[int, int, list[int]]] | None = None


@dataclass(frozen=True, eq=False)
class PlanvizOutput:
    """An output whose parts are consistent; the rules are checked separately."""

    file: str
    start: list[tuple[int, int, str]]
    actions: Actions
    # For each robot (tick, task) in the order of ticks; None: unknown, as in 2023.
    schedule: list[list[tuple[int, int]]] | None
    events: list[tuple[int, int, int, int]]  # in the order of ticks
    tasks: dict[
        int, tuple[int, list[tuple[int, int]]]
    ]  # task: released, (row, column) of its visits
    finished: int
    makespan: int
    sum_of_cost: int | None
    action_ticks: int | None = (
        None  # of a move and a turn in 2026; None: 1, by the rules until 2024
    )
    delays: list[list[tuple[int, int]]] | None = None  # for each robot (begin, end)
    lists_visits: bool = True  # its events and tasks are known

    @property
    def ticks(self) -> int:
        """The number of ticks."""
        return int(self.actions.shape[0])

    @property
    def robots(self) -> int:
        """The number of robots."""
        return int(self.actions.shape[1])


def _validated(data: Any, wanted: type[T], file: str) -> T:
    try:
        return validated(data, wanted)
    except InputError as error:
        raise error.at(file) from None


def read_output(path: Path) -> PlanvizOutput:
    """Read an output. Raises InputError if a key is missing or parts are inconsistent."""
    file = str(path)
    data = _parsed(path)
    if VERSION_2026[:4] in str(data.get("version")) or "agentMaxCounter" in data:
        return _output_of_2026(data, file)
    dealt_out = is_of_2023(data)
    if dealt_out:
        data = as_of_2024(data, file)
    said = _validated(data, PlanvizFile, file)
    _check_sizes(said, data, ("start", "actualPaths", "plannerPaths", "actualSchedule"), file)
    actions = actions_of(said.actual_paths, file)
    tasks = _tasks(said.tasks, file)
    schedule = _schedules(said.actual_schedule, file)
    for number, event in enumerate(said.events):
        _check_event(event, number, actions.shape, tasks, file)
    return PlanvizOutput(
        file=file,
        start=said.start,
        actions=actions,
        schedule=None if dealt_out else schedule,
        events=sorted(said.events, key=lambda event: event[0]),
        tasks=tasks,
        finished=said.num_task_finished,
        makespan=said.makespan,
        sum_of_cost=said.sum_of_cost,
    )


def _output_of_2026(data: dict[str, Any], file: str) -> PlanvizOutput:
    said = _validated(data, PlanvizFile2026, file)
    per_robot = ("start", "actualPaths", "delayIntervals", "actualSchedule")
    _check_sizes(said, data, [key for key in per_robot if data.get(key) is not None], file)
    if said.agent_max_counter < 1:
        text = f"agentMaxCounter must be at least 1, found {said.agent_max_counter}"
        raise InputError(text, file)
    actions = actions_of_segments(said.actual_paths, file)
    lists_visits = said.events is not None and said.tasks is not None
    tasks = _tasks(said.tasks or [], file) if lists_visits else {}
    events = (said.events or []) if lists_visits else []
    for number, event in enumerate(events):
        _check_event(event, number, actions.shape, tasks, file)
    listed = said.actual_schedule
    return PlanvizOutput(
        file=file,
        start=said.start,
        actions=actions,
        schedule=None if listed is None else _schedules(listed, file),
        events=sorted(events, key=lambda event: event[0]),
        tasks=tasks,
        finished=said.num_task_finished,
        makespan=said.makespan,
        sum_of_cost=said.sum_of_cost,
        action_ticks=said.agent_max_counter,
        delays=said.delay_intervals,
        lists_visits=lists_visits,
    )


def _check_sizes(
    said: PlanvizFile | PlanvizFile2026, data: dict[str, Any], keys: Iterable[str], file: str
) -> None:
    """Raises InputError for another action model, a list of another length or a strange heading."""
    if said.action_model != ACTION_MODEL:
        raise InputError(
            f"actionModel must be {ACTION_MODEL}, found {shown(said.action_model)}", file
        )
    robots = said.team_size
    for key in keys:
        if len(data[key]) != robots:
            text = f"{key} has {len(data[key]):,} entries, teamSize is {robots:,}"
            raise InputError(text, file)
    if robots < 1:
        raise InputError(f"teamSize must be at least 1, found {robots}", file)
    for robot, (_, _, heading) in enumerate(said.start):
        if heading not in HEADING_LETTERS or len(heading) != 1:
            text = f"start[{robot}] has the heading {shown(heading)}; E, S, W and N are allowed"
            raise InputError(text, file)


def _parsed(path: Path) -> dict[str, Any]:
    """Return the JSON object of a file. Raises InputError."""
    file = str(path)
    try:
        if not os.path.isfile(path):
            raise InputError("no such file" if not os.path.exists(path) else "is not a file", file)
        if path.stat().st_size > MAX_PLANVIZ_BYTES:
            raise InputError(f"has more than {MAX_PLANVIZ_BYTES // 1_000_000:,} MB", file)
        data = msgspec.json.decode(path.read_bytes())
    except OSError as error:
        raise InputError(
            f"cannot be read: {(error.strerror or str(error)).lower()}", file
        ) from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InputError(f"is not valid JSON: {error}", file) from None
    if not isinstance(data, dict):
        raise InputError(f"an output must be a JSON object, found {shown(data)}", file)
    return data


def _tasks(
    listed: list[tuple[int, int, list[int]]], file: str
) -> dict[int, tuple[int, list[tuple[int, int]]]]:
    tasks: dict[int, tuple[int, list[tuple[int, int]]]] = {}
    for number, (task, released, places) in enumerate(listed):
        if task in tasks:
            raise InputError(f"tasks[{number}] repeats task {task}", file)
        if not places or len(places) % 2:
            text = f"tasks[{number}] has {count(len(places), 'number')}"
            raise InputError(f"{text} for its cells, not a row and a column for each", file)
        tasks[task] = released, list(zip(places[::2], places[1::2], strict=True))
    return tasks


def _check_event(
    event: tuple[int, int, int, int],
    number: int,
    shape: tuple[int, ...],
    tasks: dict[int, Any],
    file: str,
) -> None:
    """Raises InputError for an event with an unknown tick, robot or task."""
    tick, robot, task, _ = event
    ticks, robots = shape
    wrong = ""
    if not 1 <= tick <= ticks:
        wrong = f"tick {tick}; the ticks are 1 to {ticks:,}"
    elif not 0 <= robot < robots:
        wrong = f"robot {robot}; there are robots 0 to {robots - 1:,}"
    elif task not in tasks:
        wrong = f"task {task}, which is not among the tasks"
    if wrong:
        raise InputError(f"events[{number}] is of {wrong}", file)


def _schedules(texts: list[str], file: str) -> list[list[tuple[int, int]]]:
    return [_schedule(text, robot, file) for robot, text in enumerate(texts)]


def _schedule(text: str, robot: int, file: str) -> list[tuple[int, int]]:
    """Read "0:3,17:-1" as (tick, task) pairs. Raises InputError."""
    entries = []
    for entry in text.split(",") if text else ():
        tick, _, task = entry.partition(":")
        try:
            entries.append((int(tick), int(task)))
        except ValueError:
            sentence = f"actualSchedule: robot {robot} has {shown(entry)}, not 'tick:task'"
            raise InputError(sentence, file) from None
    return sorted(entries, key=lambda pair: pair[0])


class Parts2023(msgspec.Struct, rename="camel"):
    """The keys with another meaning than in 2024."""

    team_size: int
    events: list[list[tuple[int, int, str]]]
    tasks: list[tuple[int, int, int]]


def is_of_2023(data: dict[str, Any]) -> bool:
    """Whether an output is of 2023: its events are listed by robot."""
    events = data.get("events")
    if data.keys() & {"version", "actualSchedule"} or not isinstance(events, list):
        return False
    return any(isinstance(one, list) and one and isinstance(one[0], list) for one in events)


def as_of_2024(data: dict[str, Any], file: str) -> dict[str, Any]:
    """Return the output with the keys of 2024; the j-th task of robot r out of n becomes task j n + r.

    Raises InputError.
    """
    said = _validated(data, Parts2023, file)
    n = said.team_size
    if len(said.events) != n:
        raise InputError(f"events has {len(said.events):,} entries, teamSize is {n:,}", file)
    places = {task: [row, column] for task, row, column in said.tasks}
    number: dict[int, int] = {}  # by task
    events, tasks = [], []
    for robot, entries in enumerate(said.events):
        following = robot
        for task, tick, what in entries:
            if what == ASSIGNED and task in places and task not in number:
                number[task] = following
                tasks.append([following, tick, places[task]])
                following += n
            elif what == FINISHED and task in number:
                events.append([tick, robot, number[task], 1])
            else:
                text = f"events[{robot}] has {shown([task, tick, what])}: tasks are assigned once"
                raise InputError(f"{text} and then finished", file)
    return {
        **data,
        "version": VERSION_2023,
        "actualSchedule": [""] * n,
        "events": events,
        "tasks": tasks,
    }


# Tasks and visits.


@dataclass
class TaskProgress:
    """The progress of tasks and robots, from event to event."""

    where: list[int]  # (robots,) the cell of a robot's last visit, or its start
    last_tick: list[int]  # (robots,) tick of a robot's last visit
    last_task: list[int]  # (robots,) last finished task, with round-robin; NO_TASK: none yet
    begun: dict[int, int] = field(default_factory=dict)  # robot: its begun task
    robot_of: dict[int, int] = field(default_factory=dict)  # task: the robot of its first visit
    visits: dict[int, int] = field(default_factory=dict)  # task: visits done
    finished_at: list[int] = field(default_factory=list)  # tick of each finished task


def check_tasks(
    output: PlanvizOutput, problem: Problem, visited: Sequence[int]
) -> PlanViolation | None:
    """Return the first violation of a rule about tasks, or None.

    `visited`: the cell of the robot of each event; negative after motion breaks a rule.
    """
    wrong = min(_wrong_tasks(output, problem), key=lambda one: one.tick, default=None)
    n = problem.robots
    progress = TaskProgress(problem.starts.tolist(), [0] * n, [NO_TASK] * n)
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


def _wrong_tasks(output: PlanvizOutput, problem: Problem) -> Iterator[PlanViolation]:
    """The tasks must be the lines of the problem, repeated."""
    width, lines = problem.grid.width, problem.tasks
    for task, (released, places) in output.tasks.items():
        expected = [divmod(cell, width) for cell in lines[task % len(lines)]]
        if task < 0 or (not problem.repeat and task >= len(lines)):
            text = f"task {task} is not one of the {len(lines):,} of the problem"
            yield PlanViolation(max(0, released), (), "task", text)
        elif places != expected:
            cells = "; ".join(f"row {row}, column {column}" for row, column in expected)
            text = f"task {task} has other cells than those of the problem: {cells}"
            yield PlanViolation(max(0, released), (), "task", text)


def _broken_by(
    output: PlanvizOutput,
    problem: Problem,
    progress: TaskProgress,
    event: tuple[int, int, int, int],
    cell: int,
) -> PlanViolation | None:
    """Return the error of an event; record the event if it has none."""
    tick, robot, task, visit = event
    released, places = output.tasks[task]
    done = progress.visits.get(task, 0)
    row, column = divmod(cell, problem.grid.width)
    begun = progress.begun.get(robot)
    robots: tuple[int, ...] = (robot,)
    if done == len(places):
        text = f"visits for task {task}, which is finished"
    elif visit != done + 1:
        text = f"does visit {visit} of task {task}, after {done} of {len(places)} visits"
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
    return PlanViolation(tick, robots, "visit", text)


def _enter(
    progress: TaskProgress, event: tuple[int, int, int, int], visits: int, cell: int
) -> None:
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
    """Whether a robot has a task at the end of a tick; start kits count from this tick or the next."""
    if output.schedule is None:
        return True
    schedule = output.schedule[robot]
    first = bisect_right(schedule, tick - 1, key=lambda entry: entry[0])
    now = bisect_right(schedule, tick, key=lambda entry: entry[0])
    return any(scheduled == task for _, scheduled in schedule[max(0, first - 1) : now])


def _is_next(problem: Problem, progress: TaskProgress, robot: int, task: int) -> bool:
    """Whether a robot may begin a task: with round-robin, only its next one."""
    if problem.assignment == "pool":
        return True
    n, lines = problem.robots, problem.tasks
    last = progress.last_task[robot]
    expected = robot if last == NO_TASK else last + n
    if task % n != robot or task < expected:
        return False
    passed = range(expected, task, n)[: len(lines)]  # then the lines repeat
    here = progress.where[robot]
    return all(problem.skip_reached and lines[one % len(lines)][0] == here for one in passed)


def _wrong_counts(
    output: PlanvizOutput, problem: Problem, progress: TaskProgress
) -> Iterator[PlanViolation]:
    """The pool is refilled as tasks are finished; the counts of tasks, ticks and costs are right."""
    if problem.assignment == "pool" and problem.repeat:
        ends = [0] * problem.open_tasks + progress.finished_at
        for task, end in enumerate(ends):
            released = output.tasks[task][0] if task in output.tasks else None
            if released != end:
                said = "missing" if released is None else f"released in tick {released:,}"
                text = f"task {task} is {said}; the pool takes it in at the end of tick {end:,}"
                yield PlanViolation(
                    end if released is None else min(end, released), (), "release", text
                )
        if len(output.tasks) > len(ends):
            text = f"there are {len(output.tasks):,} tasks, {len(ends):,} were released"
            yield PlanViolation(output.ticks, (), "release", text)
    yield from _wrong_totals(output, len(progress.finished_at))


def _wrong_totals(output: PlanvizOutput, finished: int | None) -> Iterator[PlanViolation]:
    """The counts of tasks, ticks and costs are right; `finished`: None if unknown."""
    if finished is not None and output.finished != finished:
        how = "events" if output.lists_visits else "schedules"
        text = f"numTaskFinished is {output.finished:,}, the {how} finish {finished:,}"
        yield PlanViolation(output.ticks, (), "count", text)
    if output.makespan != output.ticks:
        text = f"makespan is {output.makespan:,}, the paths have {count(output.ticks, 'tick')}"
        yield PlanViolation(output.ticks, (), "count", text)


# Motion.


class PlannedMotion(NamedTuple):
    """The cells of the robots of an output, up to the first violation of a rule of motion."""

    violation: PlanViolation | None
    visited: npt.NDArray[np.int64]  # (events,) cell of the robot of each event; VACANT after it
    finished: int | None  # tasks finished by the schedules, if the output lists no visits
    arrivals: TargetArrivals | None = None  # on the targets of a one-shot problem


def unchecked(output: PlanvizOutput, problem: Problem) -> Iterator[str]:
    """Yield the rules that cannot be checked, as the output has no keys for them."""
    if output.delays is None and problem.delays is not None:
        yield "delays: the file has no delayIntervals"
    if not output.lists_visits and output.schedule is None:
        yield "visits and tasks: the file has no events, tasks and actualSchedule"
    elif not output.lists_visits:
        yield "the ticks of visits: the file has no events and tasks, only actualSchedule"


def verify_output(output: PlanvizOutput, problem: Problem) -> PlanViolation | None:
    """Return the first violation, or None. Raises InputError unless output and problem fit."""
    if output.robots != problem.robots:
        text = f"teamSize is {output.robots:,}, the problem has {count(problem.robots, 'robot')}"
        raise InputError(text, output.file)
    if (output.action_ticks or 1) != problem.action_ticks:
        text = f"an action takes {count(output.action_ticks or 1, 'tick')}, "
        raise InputError(f"{text}{problem.action_ticks} in the problem", output.file)
    motion = follow(output, problem)
    if output.lists_visits:
        tasks = check_tasks(output, problem, motion.visited.tolist())
    else:
        tasks = next(_wrong_totals(output, motion.finished), None)
    costs = wrong_cost(motion.arrivals, output.ticks, output.robots, output.sum_of_cost)
    rest = motion.violation, tasks, costs
    first = (_wrong_start(output, problem), wrong_delay(output, problem), *rest)
    return min((one for one in first if one), key=lambda one: one.tick, default=None)


def _wrong_start(output: PlanvizOutput, problem: Problem) -> PlanViolation | None:
    """Robots must start in the cells of the problem, and face east."""
    width = problem.grid.width
    for robot, ((row, column, heading), cell) in enumerate(
        zip(output.start, problem.starts.tolist(), strict=True)
    ):
        if (row, column) != divmod(cell, width) or heading != HEADING_LETTERS[0]:
            said = f"starts in row {row}, column {column}, heading {heading}"
            return PlanViolation(
                0, (robot,), "start", f"{said}; the problem says {problem.grid.place(cell)}, E"
            )
    return None


def wrong_delay(output: PlanvizOutput, problem: Problem) -> PlanViolation | None:
    """Return the first violation of a delay: it is as long as the problem says, and the robot waits."""
    broken = (
        _broken_delay(output, problem, robot, delay, before)
        for robot, delays in enumerate(output.delays or ())
        for before, delay in zip([(0, 0), *delays], delays, strict=False)
    )
    return min((one for one in broken if one), key=lambda one: one.tick, default=None)


def _broken_delay(
    output: PlanvizOutput,
    problem: Problem,
    robot: int,
    delay: tuple[int, int],
    before: tuple[int, int],
) -> PlanViolation | None:
    (begin, end), ticks = delay, delay[1] - delay[0]
    allowed = None if problem.delays is None else problem.delays["ticks"]
    tick, text = max(0, begin) + 1, ""
    if begin < before[1] or ticks < 1:
        text = f"has a delay of the ticks {begin:,} to {end:,} after one to tick {before[1]:,}"
    elif allowed is None:
        text = "is delayed, but the problem has no delays"
    elif not allowed["from"] <= ticks <= allowed["to"]:
        text = f"is delayed for {count(ticks, 'tick')}, the problem says "
        text += f"{allowed['from']} to {allowed['to']}"
    else:
        acts = np.flatnonzero(output.actions[begin:end, robot] != WAIT)
        if len(acts):
            tick += int(acts[0])
            text = f"does not wait in its delay of the ticks {begin + 1:,} to {end:,}"
    return PlanViolation(tick, (robot,), "delay", text) if text else None


def follow(output: PlanvizOutput, problem: Problem) -> PlannedMotion:
    """Move all robots tick by tick, until a rule of motion or of a schedule is broken."""
    height, width = problem.grid.free.shape
    visited = np.full(len(output.events), VACANT, np.int64)
    row, column = (np.array([start[k] for start in output.start]) for k in (0, 1))
    if ((row < 0) | (row >= height) | (column < 0) | (column >= width)).any():
        return PlannedMotion(None, visited, None)  # the start itself is a violation
    motion = motion_of(
        problem.grid.free, output.start, output.action_ticks, problem.robot_size or 1.0
    )
    scheduled = None
    if not output.lists_visits and output.schedule is not None:
        scheduled = ScheduledVisits(output.schedule, problem)
    event_robot = np.array([event[1] for event in output.events], np.int64)
    ends = np.searchsorted(
        [event[0] for event in output.events], np.arange(output.ticks + 1), "right"
    )
    arrivals = TargetArrivals(problem, motion) if problem.on_targets else None
    for tick, action in enumerate(output.actions, 1):
        violation = motion.carry_out(tick, action)
        if arrivals is not None:
            arrivals.update(tick)
        cell = (motion.cell // motion.width - 1) * width + motion.cell % motion.width - 1
        if violation is None and scheduled is not None:
            violation = scheduled.update(tick, cell)
        if violation is not None:
            return PlannedMotion(violation, visited, None)
        now = slice(ends[tick - 1], ends[tick])
        visited[now] = cell[event_robot[now]]
    finished = None if scheduled is None else scheduled.finished
    return PlannedMotion(None, visited, finished, arrivals)
