"""Outputs of the League of Robot Runners, as PlanViz shows them: one JSON object.

    actionModel        "MAPF_T"                    actualPaths     for each robot "F,R,C,W": forward,
    version            "2024 LoRR"                                 right, left, wait, tick by tick
    teamSize           robots                      plannerPaths    as they were planned
    start              [row, column, "E"], ...     errors          of the planner
    numTaskFinished                                actualSchedule  for each robot "tick:task,..."
    sumOfCost          ticks of all robots         events          [tick, robot, task, visits done]
    makespan           ticks                       tasks           [task, released, [row, column, ...]]

Source: the competition's start kit, Input_Output_Format.md (2024).
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.planviz_2023 import as_of_2024, is_of_2023
from automaton.scenario.document import Document
from automaton.scenario.validation import shown, validated
from automaton.units import count

ACTION_MODEL: Final = "MAPF_T"
VERSION: Final = "2024 LoRR"
ACTIONS: Final = "FRCW"  # forward, right, left, wait
FORWARD, RIGHT, LEFT, WAIT = range(4)
HEADINGS: Final = "ESWN"  # clockwise, as directions are numbered
MAX_BYTES: Final = 2_000_000_000
NO_TASK: Final = -1  # in a schedule: none

Actions = npt.NDArray[np.uint8]  # (ticks, robots) index of ACTIONS


class PlanvizFile(msgspec.Struct, rename="camel"):
    """The keys of an output; others are passed over."""

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


@dataclass(frozen=True, eq=False)
class PlanvizOutput:
    """An output whose parts fit each other; whether it keeps the rules is another question."""

    file: str
    start: list[tuple[int, int, str]]
    actions: Actions
    # For each robot (tick, task) in the order of ticks; None where outputs have none, in 2023.
    schedule: list[list[tuple[int, int]]] | None
    events: list[tuple[int, int, int, int]]  # in the order of ticks
    tasks: dict[
        int, tuple[int, list[tuple[int, int]]]
    ]  # task: released, (row, column) of its visits
    finished: int
    makespan: int
    sum_of_cost: int

    @property
    def ticks(self) -> int:
        """How many ticks there are."""
        return int(self.actions.shape[0])

    @property
    def robots(self) -> int:
        """How many robots there are."""
        return int(self.actions.shape[1])


def read_output(path: Path) -> PlanvizOutput:
    """Read an output. Raises InputError where a key is missing or parts do not fit each other."""
    file = str(path)
    data = _parsed(path)
    dealt_out = is_of_2023(data)
    if dealt_out:
        data = as_of_2024(data, file)
    said = validated(Document(data={}, file=file), data, PlanvizFile)
    if said.action_model != ACTION_MODEL:
        raise InputError(
            f"actionModel must be {ACTION_MODEL}, found {shown(said.action_model)}", file
        )
    robots = said.team_size
    for key in ("start", "actualPaths", "plannerPaths", "actualSchedule"):
        if len(data[key]) != robots:
            text = f"{key} has {len(data[key]):,} entries, teamSize is {robots:,}"
            raise InputError(text, file)
    if robots < 1:
        raise InputError(f"teamSize must be at least 1, found {robots}", file)
    for robot, (_, _, heading) in enumerate(said.start):
        if heading not in HEADINGS or len(heading) != 1:
            text = f"start[{robot}] has the heading {shown(heading)}; E, S, W and N are possible"
            raise InputError(text, file)
    actions = actions_of(said.actual_paths, file)
    tasks = _tasks(said.tasks, file)
    for number, event in enumerate(said.events):
        _check_event(event, number, actions.shape, tasks, file)
    return PlanvizOutput(
        file=file,
        start=said.start,
        actions=actions,
        schedule=None if dealt_out else _schedules(said.actual_schedule, file),
        events=sorted(said.events, key=lambda event: event[0]),
        tasks=tasks,
        finished=said.num_task_finished,
        makespan=said.makespan,
        sum_of_cost=said.sum_of_cost,
    )


def _parsed(path: Path) -> dict[str, Any]:
    """Return the JSON object of a file. Raises InputError."""
    file = str(path)
    try:
        if not os.path.isfile(path):
            raise InputError("no such file" if not os.path.exists(path) else "is not a file", file)
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"has more than {MAX_BYTES // 1_000_000:,} MB", file)
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
    actions = np.full(codes.shape, len(ACTIONS), np.uint8)
    for action, letter in enumerate(ACTIONS):
        actions[codes == ord(letter)] = action
    unknown = np.argwhere(actions == len(ACTIONS))
    if len(unknown):
        robot, at = unknown[0].tolist()
        text = f"actualPaths: robot {robot} has the action {plain[robot][at]!r} in tick {at + 1:,}"
        raise InputError(f"{text}; F, R, C and W are possible", file)
    if not ticks:
        return np.zeros((0, len(paths)), np.uint8)
    return np.ascontiguousarray(actions.T)


def _tasks(
    listed: list[tuple[int, int, list[int]]], file: str
) -> dict[int, tuple[int, list[tuple[int, int]]]]:
    tasks: dict[int, tuple[int, list[tuple[int, int]]]] = {}
    for number, (task, released, places) in enumerate(listed):
        if task in tasks:
            raise InputError(f"tasks[{number}] is task {task} once more", file)
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
    """Raises InputError for an event of a tick, a robot or a task that there is not."""
    tick, robot, task, _ = event
    ticks, robots = shape
    wrong = ""
    if not 1 <= tick <= ticks:
        wrong = f"tick {tick}; there are ticks 1 to {ticks:,}"
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
