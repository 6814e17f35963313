"""A recorded run as an output of the League of Robot Runners, as PlanViz shows it.

Robots must turn by 90 degrees or drive one cell per tick, and their orders must be visits without loads;
other runs are refused. Task k is order k. A task is released at the end of the tick in which another
task is finished, and is in a robot's schedule from the tick of its assignment.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_ORDER_RESERVED,
    CHANGE_VISITED,
    MOVE_EAST,
    MOVE_NORTH,
    TURN_LEFT,
    TURN_RIGHT,
)
from automaton.errors import InputError
from automaton.exchange.planviz import ACTION_MODEL, HEADING_LETTERS, NO_TASK, VERSION
from automaton.floor.floor_plan import DRIVABLE, NIL
from automaton.recording.contents import FRAME_KIND_CONDITIONS, FRAME_KIND_TICKS, Content
from automaton.recording.frames import Recording
from automaton.scenario.refinement import refined_data
from automaton.scenario.robot_types import types_of

LETTERS: Final = np.full(ACTION_MASK + 1, ord("W"), np.uint8)  # of a recorded action
LETTERS[MOVE_EAST : MOVE_NORTH + 1] = ord("F")
LETTERS[TURN_RIGHT] = ord("R")
LETTERS[TURN_LEFT] = ord("C")

Rows = list[tuple[int, int]]


def planviz_output(recording: Recording) -> dict[str, Any]:
    """Return a recorded run as the keys of an output. Raises InputError if PlanViz cannot show it."""
    header = recording.header
    executed, changes = _ticks_of(recording)
    ticks, robots = executed.shape
    tasks = TaskHistory(header)
    tasks.apply(changes)
    paths = [",".join(row.tobytes().decode()) for row in LETTERS[executed & ACTION_MASK].T]
    return {
        "actionModel": ACTION_MODEL,
        "version": VERSION,
        "teamSize": robots,
        "start": [
            [*_place(header, cell), HEADING_LETTERS[heading]]
            for cell, heading in zip(
                header["robots"]["cell"].tolist(), header["robots"]["heading"].tolist(), strict=True
            )
        ],
        "numTaskFinished": len(tasks.finished),
        "sumOfCost": ticks * robots,
        "makespan": ticks,
        "actualPaths": paths,
        "plannerPaths": paths,
        "errors": [],
        "actualSchedule": [
            ",".join(f"{tick}:{task}" for tick, task in rows.items()) for rows in tasks.schedule
        ],
        "events": tasks.events,
        "tasks": tasks.listed(),
    }


def _ticks_of(recording: Recording) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.int64]]:
    """Return (T, n) actions of robots, and rows (tick, code, subject, value) of changes.

    Raises InputError for a run that PlanViz cannot show.
    """
    executed = [np.zeros((0, len(recording.header["robots"]["cell"])), np.uint16)]
    changes = [np.zeros((0, 4), np.int64)]
    for kind, content in recording.frames:
        if kind == FRAME_KIND_CONDITIONS:
            wrong = next(_unfit(recording.header, content["scenario"]), "")
            if wrong:
                raise InputError(
                    "PlanViz requires robots that move and turn in one tick and only visit "
                    f"cells, but {wrong}"
                )
        elif kind == FRAME_KIND_TICKS:
            executed.append(content["executed"])
            changes.append(content["changes"])
    return np.concatenate(executed), np.concatenate(changes)


def _unfit(header: Content, data: dict[str, Any]) -> Iterator[str]:
    """Yield the properties of a run that PlanViz cannot show."""
    scenario = refined_data(data)
    fleet, durations, world = scenario.fleet, scenario.durations, scenario.world
    for kinematics in fleet.all_kinematics:
        if kinematics != "differential":
            yield f"{'kinematics of a type' if fleet.types else 'fleet.kinematics'} is {kinematics}"
    for name, given in (("move", durations.moves), ("turn", durations.turns)):
        if max(given) != 1:
            yield f"durations.{name} is {max(given)}"
    if any(max(kind.moves) > 1 or max(kind.turns) > 1 for kind in types_of(scenario)):
        yield "fleet.types has robots whose moves or turns take longer"
    if world.slowdown != "none" or world.extra_tick_probability or scenario.floor.speed_limits:
        yield "slow zones, speed limits or random delays lengthen moves"
    if fleet.when_idle != "park" or (header["robots"]["cell"] == NIL).any():
        yield "robots leave the floor"
    faults = scenario.faults
    if scenario.battery is not None or faults.listed or faults.probability:
        yield "robots may break down and be towed"
    if faults.delays is not None:
        yield "faults.delays delays robots"
    floor = header["floor"]
    if (floor["capacity"][DRIVABLE[floor["kind"]]] != 1).any():
        yield "the floor has cells for more than one robot"
    first = header["orders"].get("first_stop")
    if first is None or (header["orders"]["source"] != NIL).any():
        yield "its orders have loads"
    elif header["stops"]["ticks"].any():
        yield "its stops take time"


def _place(header: Content, cell: int) -> tuple[int, int]:
    """Return row and column of a flat cell."""
    row, column = divmod(cell, header["floor"]["width"] + 2)
    return row - 1, column - 1


class TaskHistory:
    """The history of the tasks of a run, from its changes."""

    def __init__(self, header: Content) -> None:
        self.header = header
        scenario = refined_data(header["scenario"])
        robots, orders = len(header["robots"]["cell"]), header["orders"]
        self.dealt_out = scenario.orders.assign == "round-robin"
        self.open_at_once = scenario.orders.in_system(robots)
        self.release_tick = orders["release_tick"].tolist()
        sequence = orders.get("release_sequence")
        self.sequence = [] if sequence is None else sequence.tolist()
        self.schedule: list[dict[int, int]] = [{} for _ in range(robots)]  # tick: task
        self.events: list[list[int]] = []  # tick, robot, task, visits done
        self.finished: list[int] = []  # tick of each finished task
        self.first_given: dict[int, int] = {}  # task: tick
        self._visits: dict[int, int] = {}
        self._robot_of: dict[int, int] = {}
        first = orders["first_stop"]
        self._first = first.tolist() if first is not None else []

    def apply(self, changes: npt.NDArray[np.int64]) -> None:
        """Apply the changes of a run in their order."""
        codes = (CHANGE_ORDER_RESERVED, CHANGE_VISITED)
        for tick, code, subject, value in changes[np.isin(changes[:, 1], codes)].tolist():
            if code == CHANGE_VISITED:
                self._visit(tick, robot=subject, task=value)
            elif value == NIL:
                self._take_back(tick, task=subject)
            else:
                self.schedule[value][tick] = subject
                self._robot_of[subject] = value
                self.first_given.setdefault(subject, tick)

    def _visit(self, tick: int, robot: int, task: int) -> None:
        done = self._visits[task] = self._visits.get(task, 0) + 1
        self.events.append([tick, robot, task, done])
        if done == self._first[task + 1] - self._first[task]:
            self.finished.append(tick)

    def _take_back(self, tick: int, task: int) -> None:
        robot = self._robot_of.pop(task, None)
        if robot is None:
            return
        done = self._visits.get(task, 0) == self._first[task + 1] - self._first[task]
        # A task that is finished at the end of a tick belongs to the robot until then.
        self.schedule[robot][tick + done] = NO_TASK

    def listed(self) -> list[list[Any]]:
        """Return [task, released, [row, column, ...]] of the tasks that were released."""
        return [[task, tick, self._cells(task)] for task, tick in sorted(self._released())]

    def _released(self) -> Iterator[tuple[int, int]]:
        """Yield each task and the tick at whose end it is released."""
        if self.dealt_out:
            yield from ((task, max(0, tick - 1)) for task, tick in self.first_given.items())
        elif self.open_at_once:
            ends = [0] * self.open_at_once + self.finished
            yield from zip(self.sequence, ends, strict=False)
        else:
            yield from ((task, max(0, tick - 1)) for task, tick in enumerate(self.release_tick))

    def _cells(self, task: int) -> list[int]:
        stops = self.header["stops"]["cell"][self._first[task] : self._first[task + 1]]
        return [number for cell in stops.tolist() for number in _place(self.header, cell)]
