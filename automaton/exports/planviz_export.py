"""A recorded run as an output of the League of Robot Runners, as PlanViz shows it.

Robots must turn by 90 degrees and drive, and all moves and turns must take the same ticks. Their orders
must be visits without loads. Other runs are refused. If actions take several ticks or robots are delayed,
the output is of 2026, else of 2024 (planviz and planviz_paths describe both). Task k is order k. A task
is released at the end of the tick in which another task is finished, and is in a robot's schedule from
the tick of its assignment.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_DELAYED,
    CHANGE_ORDER_RESERVED,
    CHANGE_VISITED,
    MOVE_EAST,
    MOVE_NORTH,
    TURN_LEFT,
    TURN_RIGHT,
)
from automaton.errors import InputError
from automaton.exchange.planviz import ACTION_MODEL, VERSION, VERSION_2026
from automaton.exchange.planviz_paths import HEADING_LETTERS, NO_TASK, STEP_OF_HEADING
from automaton.floor.floor_plan import DRIVABLE, NIL
from automaton.recording.contents import FRAME_KIND_CONDITIONS, FRAME_KIND_TICKS, Content
from automaton.recording.frames import Recording
from automaton.scenario.refinement import refined_data
from automaton.scenario.robot_types import types_of

LETTERS: Final = np.full(ACTION_MASK + 1, ord("W"), np.uint8)  # of a recorded action
LETTERS[MOVE_EAST : MOVE_NORTH + 1] = ord("F")
LETTERS[TURN_RIGHT] = ord("R")
LETTERS[TURN_LEFT] = ord("C")
WAITING: Final = ord("W")
SEGMENT_TICKS: Final = 100

Rows = list[tuple[int, int]]


def planviz_output(recording: Recording) -> dict[str, Any]:
    """Return a recorded run as the keys of an output. Raises InputError if PlanViz cannot show it."""
    header = recording.header
    executed, changes, action_ticks = _ticks_of(recording)
    ticks, robots = executed.shape
    tasks = TaskHistory(header)
    tasks.apply(changes)
    letters = LETTERS[executed & ACTION_MASK]
    output = {
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
        "errors": [],
        "actualSchedule": [
            ",".join(f"{tick}:{task}" for tick, task in rows.items()) for rows in tasks.schedule
        ],
        "events": tasks.events,
        "tasks": tasks.listed(),
    }
    if action_ticks is not None:
        delays = changes[changes[:, 1] == CHANGE_DELAYED][:, [0, 2, 3]].tolist()
        return output | _of_2026(header, letters, action_ticks, delays)
    if is_one_shot(header):
        output["sumOfCost"] = sum_of_costs(header, letters, 1)
    paths = [",".join(row.tobytes().decode()) for row in letters.T]
    return output | {"actualPaths": paths, "plannerPaths": paths}


def _of_2026(
    header: Content,
    letters: npt.NDArray[np.uint8],
    action_ticks: int,
    delays: list[tuple[int, int, int]],
) -> dict[str, Any]:
    """Return the keys of 2026. `letters`: of the action that begins; `delays`: (tick, robot, ticks)."""
    intervals: list[list[tuple[int, int]]] = [[] for _ in range(letters.shape[1])]
    waits = np.zeros(letters.shape, np.bool_)
    for tick, robot, ticks in delays:
        intervals[robot].append((tick - 1, tick - 1 + ticks))
        waits[tick - 1 : tick - 1 + ticks, robot] = True
    paths = SegmentedPaths(header, action_ticks)
    for action, delayed in zip(letters, waits, strict=True):
        paths.add(action, delayed)
    letters = paths.letters()
    cost = sum_of_costs(header, letters, action_ticks) if is_one_shot(header) else letters.size
    return {
        "version": VERSION_2026,
        "sumOfCost": cost,
        "agentMaxCounter": action_ticks,
        "outputSegmentSize": SEGMENT_TICKS,
        "numPlannerErrors": 0,
        "numScheduleErrors": 0,
        "numEntryTimeouts": 0,
        "delayIntervals": intervals,
        "actualPaths": paths.texts(),
        "scheduleErrors": [],
    }


def _ticks_of(
    recording: Recording,
) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.int64], int | None]:
    """Return (T, n) actions of robots, rows (tick, code, subject, value) of changes, and the ticks
    of an action in an output of 2026, or None for 2024.

    Raises InputError for a run that PlanViz cannot show.
    """
    executed = [np.zeros((0, len(recording.header["robots"]["cell"])), np.uint16)]
    changes = [np.zeros((0, 4), np.int64)]
    action_ticks, usual = None, refined_data(recording.header["scenario"]).durations.moves[0]
    for kind, content in recording.frames:
        if kind == FRAME_KIND_CONDITIONS:
            scenario = refined_data(content["scenario"])
            wrong = next(_unfit(recording.header, content["scenario"]), "")
            if not wrong and scenario.durations.moves[0] != usual:
                wrong = (
                    f"a branch changed durations.move from {usual} to {scenario.durations.moves[0]}"
                )
            if wrong:
                raise InputError(
                    "PlanViz requires robots whose moves and turns all take the same ticks and "
                    f"that only visit cells, but {wrong}"
                )
            if scenario.durations.moves[0] > 1 or scenario.faults.delays is not None:
                action_ticks = scenario.durations.moves[0]
        elif kind == FRAME_KIND_TICKS:
            executed.append(content["executed"])
            changes.append(content["changes"])
    return np.concatenate(executed), np.concatenate(changes), action_ticks


def _unfit(header: Content, data: dict[str, Any]) -> Iterator[str]:
    """Yield the properties of a run that PlanViz cannot show."""
    scenario = refined_data(data)
    fleet, durations, world = scenario.fleet, scenario.durations, scenario.world
    for kinematics in fleet.all_kinematics:
        if kinematics != "differential":
            yield f"{'kinematics of a type' if fleet.types else 'fleet.kinematics'} is {kinematics}"
    usual = durations.moves[0]
    for name, given in (("move", durations.moves), ("turn", durations.turns)):
        for other in sorted({*given} - {usual}):
            yield f"durations.{name} is {other}, other moves or turns take {usual}"
    if any({*kind.moves, *kind.turns} - {usual} for kind in types_of(scenario)):
        yield "fleet.types has robots whose moves or turns take other ticks"
    if world.slowdown != "none" or world.extra_tick_probability or scenario.floor.speed_limits:
        yield "slow zones, speed limits or random delays lengthen moves"
    if fleet.when_idle != "park" or (header["robots"]["cell"] == NIL).any():
        yield "robots leave the floor"
    faults = scenario.faults
    if scenario.battery is not None or faults.listed or faults.probability:
        yield "robots may break down and be towed"
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


def is_one_shot(header: Content) -> bool:
    """Whether the robots of a run stay on their targets."""
    return bool(header["scenario"]["stop"]["when"] == "on-targets")


def sum_of_costs(header: Content, letters: npt.NDArray[np.uint8], action_ticks: int) -> int:
    """Return the sum over robots of the tick of their last arrival on their targets.

    A robot that does not end there costs all ticks. `letters`: (ticks, robots), `action_ticks` for each
    move and turn.
    """
    ticks, drives = len(letters), letters == ord("F")
    turned = (letters == ord("R")).astype(np.int64) - (letters == ord("C"))
    heading = header["robots"]["heading"] + np.cumsum(turned, axis=0) // action_ticks
    moved = (_steps(header)[heading & 3] * drives).sum(axis=0)
    last = np.where(drives.any(axis=0), ticks - drives[::-1].argmax(axis=0), 0)
    way = header["robots"]["home"].astype(np.int64) - header["robots"]["cell"]
    return int(np.where(moved == action_ticks * way, last, ticks).sum())


def _steps(header: Content) -> npt.NDArray[np.int64]:
    """Return (4,) the offsets of the next cell ahead, by heading."""
    width = header["floor"]["width"] + 2
    return np.array([rows * width + columns for rows, columns in STEP_OF_HEADING])


class SegmentedPaths:
    """The paths of robots in an output of 2026: what they do in each tick of their moves and turns.

    A recording has the tick in which an action begins. From then on a robot does one of its
    `action_ticks` in each tick, except while it is delayed and while it would go further into the next
    cell than the robot ahead out of it.
    """

    def __init__(self, header: Content, action_ticks: int) -> None:
        self._header, self._action_ticks = header, action_ticks
        self._step = _steps(header)
        self._cell = header["robots"]["cell"].astype(np.int64)
        self._heading = header["robots"]["heading"].astype(np.int64)
        self._done = np.zeros(len(self._cell), np.int64)  # ticks of the action under way
        self._under_way = np.full(len(self._cell), WAITING, np.uint8)
        self._holder = np.full(header["floor"]["kind"].size, NIL, np.int64)
        self._states: list[list[tuple[int, ...]]] = []  # of segments, by robot
        self._letters: list[npt.NDArray[np.uint8]] = []  # of ticks, by robot

    def add(self, begins: npt.NDArray[np.uint8], delayed: npt.NDArray[np.bool_]) -> None:
        """Add a tick. `begins`: letter of the action that begins, or WAITING."""
        if len(self._letters) % SEGMENT_TICKS == 0:
            self._states.append(self._state(len(self._letters)))
        self._under_way = np.where(begins == WAITING, self._under_way, begins)
        acts = (self._under_way != WAITING) & ~delayed
        drives = self._under_way == ord("F")
        target = np.where(drives, self._cell + self._step[self._heading], 0)
        self._hold_back(acts, drives, target)
        self._letters.append(np.where(acts, self._under_way, WAITING).astype(np.uint8))
        self._done += acts
        ends = self._done == self._action_ticks
        turned = (self._under_way == ord("R")).astype(np.int64) - (self._under_way == ord("C"))
        self._heading = np.where(ends, self._heading + turned, self._heading) & 3
        self._cell = np.where(ends & drives, target, self._cell)
        self._under_way[ends] = WAITING
        self._done[ends] = 0

    def _hold_back(
        self,
        acts: npt.NDArray[np.bool_],
        drives: npt.NDArray[np.bool_],
        target: npt.NDArray[np.int64],
    ) -> None:
        """Let robots wait that would pass the one ahead, from the head of a queue to its end."""
        self._holder[self._cell] = np.arange(len(self._cell))
        ahead = np.where(drives, self._holder[target], NIL)
        self._holder[self._cell] = NIL
        behind = np.flatnonzero((ahead != NIL) & acts)
        while len(behind):
            leader = ahead[behind]
            passes = self._done[behind] + 1 > self._done[leader] + acts[leader]
            acts[behind[passes]] = False
            behind = behind[~passes] if passes.any() else behind[:0]

    def _state(self, tick: int) -> list[tuple[int, ...]]:
        return [
            (tick, *_place(self._header, cell), heading, done)
            for cell, heading, done in zip(
                self._cell.tolist(), self._heading.tolist(), self._done.tolist(), strict=True
            )
        ]

    def letters(self) -> npt.NDArray[np.uint8]:
        """Return (ticks, robots) what the robots do."""
        return np.array(self._letters, np.uint8).reshape(len(self._letters), len(self._cell))

    def texts(self) -> list[str]:
        """Return the path of each robot."""
        return [
            "".join(
                f"[({','.join(map(str, states[robot]))}):"
                f"({_runs(row[at * SEGMENT_TICKS : (at + 1) * SEGMENT_TICKS])})]"
                for at, states in enumerate(self._states)
            )
            for robot, row in enumerate(np.ascontiguousarray(self.letters().T))
        ]


def _runs(letters: npt.NDArray[np.uint8]) -> str:
    """Return the runs of letters in the ticks of a segment, as "F 3,W 2"."""
    begins = np.flatnonzero(np.diff(letters, prepend=0))
    lengths = np.diff(begins, append=len(letters)).tolist()
    return ",".join(
        f"{chr(letter)} {length}"
        for letter, length in zip(letters[begins].tolist(), lengths, strict=True)
    )


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
