"""What each robot of a log did, tick by tick: moves, turns, picks, drops, stops, charging, waits.

    messages:   A ------ A ------ between A and B ------ C        at the ticks of their stamps
    timeline:   stands . | move to B .... | move to C .. |

Between two messages a robot drives at constant speed along the shortest way if there is only one. Else
it stands until the next message, which finds it elsewhere. A wait is a tick in which a robot with an
order or a load, or on its way to a charger, stands and will drive on.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from automaton.calibration.log_on_floor import RobotTracks, standable
from automaton.engine.record_codes import (
    CHANGE_DURATION,
    CHANGE_SEEN_CELL,
    CHANGE_SEEN_CHARGE,
    CHANGE_SEEN_GOAL,
    CHANGE_SEEN_HEADING,
    CHANGE_SEEN_LOAD,
    CHANGE_SEEN_ORDER,
    CHANGE_STATUS,
    DROPPED_ON_ARRIVAL,
    EXECUTED_BLOCKED,
    EXECUTED_CHARGE,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_SERVE,
    MOVE_EAST,
    PICKED_ON_ARRIVAL,
    TURN_LEFT,
    TURN_RIGHT,
    WAY_SHIFT,
)
from automaton.engine.state import (
    BATTERY_PERCENT,
    NIL,
    STATUS_FAILED,
    STATUS_REMOVED,
    STATUS_TOWED,
    STATUS_UP,
    Array,
)
from automaton.floor.floor_plan import FloorPlan

MAX_WAY: Final = 64  # cells between two messages
MAX_SPEED_FACTOR: Final = 3  # times the speed in the scenario; a longer way was another one
MAX_KNOWN_WAYS: Final = 100_000  # ways that stay in memory


class Ways:
    """The only shortest way between two cells, or None if there are several or no way."""

    def __init__(self, floor_plan: FloorPlan) -> None:
        exits = floor_plan.exits.ravel().tolist()
        self.offsets, self._stands = floor_plan.offsets, standable(floor_plan).tolist()
        self._next = [
            tuple(cell + step for way, step in enumerate(self.offsets) if leave >> way & 1)
            for cell, leave in enumerate(exits)
        ]
        for bay, home in floor_plan.bays.tolist():
            self._next[bay], self._next[home] = (home,), (*self._next[home], bay)
        self._way = lru_cache(MAX_KNOWN_WAYS)(self._search)

    def between(self, one: int, other: int, most: float) -> tuple[int, ...] | None:
        """The cells from one cell to another, both included, if they are `most` cells apart at most."""
        way: tuple[int, ...] | None = (one,)
        if other - one in self.offsets and self._stands[one] and self._stands[other]:
            way = (one, other)  # also against a one-way street: real robots may
        elif one != other:
            way = self._way(one, other)
        return None if way is None or len(way) - 1 > most else way

    def _search(self, one: int, other: int) -> tuple[int, ...] | None:
        """Breadth-first; a cell that is reached by two ways of one length has no only way."""
        ways: dict[int, tuple[int, ...] | None] = {one: (one,)}
        reached = {one}
        for _ in range(MAX_WAY):
            after: dict[int, tuple[int, ...] | None] = {}
            for cell, way in ways.items():
                for to in self._next[cell]:
                    if to not in reached:
                        after[to] = None if way is None or to in after else (*way, to)
            if other in after or not after:
                return after.get(other)
            reached |= after.keys()
            ways = after
        return None

    def direction(self, one: int, other: int) -> int:
        """The direction from a cell towards another: of its neighbours the exact one."""
        step = other - one
        if step in self.offsets:
            return self.offsets.index(step)
        stride = self.offsets[1]
        rows, columns = other // stride - one // stride, other % stride - one % stride
        if abs(columns) >= abs(rows):
            return 0 if columns > 0 else 2
        return 1 if rows > 0 else 3


class ObservedFleet(NamedTuple):
    """What the timelines of all robots need."""

    track: RobotTracks
    tick: Array  # (n,) of each message
    order: Array  # (n,) order of the run that the robot works on, or NIL
    load: Array  # (n,) order of the run whose load it carries, or NIL
    ways: Ways
    move_ticks: Array  # (robots of the log, 2) float64, empty and loaded
    turn_ticks: int  # of a quarter
    ticks: int  # of the run
    silence: float  # ticks after which a name of an order is that of another one


class RobotTimeline(NamedTuple):
    """What a robot did."""

    executed: Array  # (ticks + 1,) action that begins in each tick
    changes: Array  # (k, 3) tick, code, value
    jumps: int  # messages that find it elsewhere


def timeline_of(fleet: ObservedFleet, rows: slice) -> RobotTimeline:
    """The timeline of the robot with these messages, of which there is one at least."""
    line = _Line(fleet, rows)
    line.enter_states()
    line.enter_moves()
    line.enter_operations()
    line.enter_turns()
    line.enter_charging()
    line.enter_goals()
    line.enter_waits()
    changes = np.array(line.changes, np.int64).reshape(-1, 3)
    return RobotTimeline(line.executed, changes, line.jumps)


def absent_robot(ticks: int) -> RobotTimeline:
    """The timeline of a robot that sends no message."""
    changes = np.array([(0, CHANGE_STATUS, STATUS_REMOVED), (0, CHANGE_SEEN_CELL, NIL)], np.int64)
    return RobotTimeline(np.zeros(ticks + 1, np.uint16), changes, 0)


class _Line:
    """The timeline of a robot in the making; arrays are (m,), of its messages."""

    def __init__(self, fleet: ObservedFleet, rows: slice) -> None:
        track, samples = fleet.track, fleet.track.log.samples
        ticks = fleet.tick[rows]
        last = np.append(np.flatnonzero(np.diff(ticks)), len(ticks) - 1)  # of each tick
        self.fleet, self.ways = fleet, fleet.ways
        self.move_ticks: list[float] = fleet.move_ticks[samples.robot[rows.start]].tolist()
        self.tick = ticks[last]
        self.end = np.append(self.tick[1:], self.tick[-1] + 1)  # until the next message
        stamps = samples.time[rows]
        joined = track.log.usable[rows] | (np.diff(stamps, append=stamps[-1:]) == 0)
        self.usable = np.logical_and.reduceat(joined, last)
        self.cell, self.to_cell, self.share, self.heading, self.order, self.load = (
            one[rows][last]
            for one in (track.cell, track.to_cell, track.share, track.heading, *fleet[2:4])
        )
        self.down, self.action, self.action_id, self.charge, self.charging = (
            getattr(samples, name)[rows][last]
            for name in ("down", "action", "action_id", "charge", "charging")
        )
        self.driving = samples.driving[rows][last]
        self.executed = np.zeros(fleet.ticks + 1, np.uint16)
        self.free = np.ones(fleet.ticks + 1, np.bool_)  # ticks without an action
        self.changes: list[tuple[int, int, int]] = []
        self.jumps = 0
        self.visits: list[tuple[int, int]] = []  # tick, cell: where it is from a tick on
        self.moves: list[tuple[int, int]] = []  # first tick and direction of each move or jump
        self.operations: list[tuple[int, int]] = []  # first and last tick

    def begin(self, code: int, first: int, last: int) -> bool:
        """Enter an action in the ticks from `first` to `last`, as far as they are free."""
        last = min(last, self.fleet.ticks)
        ticks = np.flatnonzero(self.free[first : last + 1])
        if first > last or not len(ticks):
            return False
        first += int(ticks[0])
        taken = np.flatnonzero(~self.free[first : last + 1])
        duration = int(taken[0]) if len(taken) else last + 1 - first
        self.executed[first] = code
        self.free[first : first + duration] = False
        if duration > 1:
            self.changes.append((first, CHANGE_DURATION, duration))
        return True

    def _rows_of_changes(self, code: int, values: Array, known: Array) -> None:
        """Enter the messages in which a known value differs from the one before."""
        at = np.flatnonzero(known)
        new = at[np.append(True, np.diff(values[at]) != 0)] if len(at) else at
        self.changes += [
            (tick, code, value)
            for tick, value in zip(self.tick[new].tolist(), values[new].tolist(), strict=True)
        ]

    def enter_states(self) -> None:
        """Enter status, order and charge."""
        there, always = self.cell != NIL, np.ones(len(self.tick), np.bool_)
        status = np.where(self.down, np.where(there, STATUS_FAILED, STATUS_TOWED), STATUS_UP)
        self._rows_of_changes(CHANGE_STATUS, status, always)
        self._rows_of_changes(CHANGE_SEEN_ORDER, self.order, always)
        # An order that a robot has before a long silence, and not after it, ends with the last message.
        is_last = (self.order != NIL) & (self.order != np.append(self.order[1:], NIL))
        ends = self.tick[is_last & (self.end - self.tick > self.fleet.silence)]
        self.changes += [(tick + 1, CHANGE_SEEN_ORDER, NIL) for tick in ends.tolist()]
        known = np.isfinite(self.charge)
        units = np.rint(np.where(known, self.charge, 0).clip(0, 100) * BATTERY_PERCENT)
        self._rows_of_changes(CHANGE_SEEN_CHARGE, units.astype(np.int64), known)

    def enter_moves(self) -> None:
        """Enter the moves between messages, and where the robot is found elsewhere."""
        here, left, busy_until = NIL, 0.0, 0
        before: tuple[int, int, float, float] | None = None  # cell, to_cell, share, tick
        is_joined = stood = False
        at = zip(
            *(one.tolist() for one in (self.tick, self.cell, self.to_cell, self.share)),
            *(self.usable.tolist(), self.down.tolist(), (self.load != NIL).tolist()),
            self.driving.tolist(),
            strict=True,
        )
        for tick, cell, to_cell, share, usable, down, is_loaded, drives in at:
            if cell == NIL:
                if down and here != NIL:
                    self._put(tick, NIL)
                    here, before = NIL, None
                continue
            nodes = None
            if before is not None and is_joined:
                most = 1 + MAX_SPEED_FACTOR * (tick - before[3]) / min(self.move_ticks)
                nodes = self._nodes(before[0], before[1], cell, to_cell, most)
            if nodes is None:
                if here != cell:
                    self.jumps += here != NIL
                    self._put(max(tick, busy_until), cell)
                here, left = cell, tick
            else:
                assert before is not None
                inner = nodes.index(cell, 1 if before[1] != NIL and len(nodes) > 1 else 0)
                end = inner - before[2] + (share if to_cell != NIL else 0.0)
                for number in range(1, inner + 1):
                    part = (number - before[2]) / end if end > 0 else 1.0
                    arrival = before[3] + part * (tick - before[3])
                    stands = to_cell == NIL and drives < 1
                    if number == inner and stands and not stood:  # likewise when it arrives
                        since, way = (before[3], 1 - before[2]) if number == 1 else (left, 1.0)
                        arrival = min(arrival, since + way * self.move_ticks[is_loaded])
                    if stood:  # when it set out is known to a message only
                        left = max(left, arrival - self.move_ticks[is_loaded])
                        stood = False
                    begin = max(round(left), busy_until)
                    busy_until = max(round(arrival), begin)
                    self._move(begin, busy_until, nodes[number - 1], nodes[number])
                    here, left = nodes[number], arrival
            if to_cell == NIL:
                stood = drives == 0 or (
                    drives < 0 and before is not None and before[:2] == (cell, NIL)
                )
                left = tick
            elif stood:
                begin = tick - share * self.move_ticks[is_loaded]
                left, stood = max(left, min(begin, tick - 1)), False
            before, is_joined = (cell, to_cell, share if to_cell != NIL else 0.0, tick), usable

    def _nodes(
        self, one: int, one_to: int, other: int, other_to: int, most: float
    ) -> tuple[int, ...] | None:
        """The cells that a robot passes between two messages, up to the cell of the second."""
        if other == one and other_to in (one_to, NIL):
            return (one,)
        if one_to == NIL:
            return self.ways.between(one, other, most)
        rest = self.ways.between(one_to, other, most)
        return None if rest is None else (one, *rest)

    def _put(self, tick: int, cell: int) -> None:
        """Enter that the robot is in a cell from a tick on, without a move."""
        self.changes.append((tick, CHANGE_SEEN_CELL, cell))
        if self.visits and cell != NIL and self.visits[-1][1] != NIL:
            self.moves.append((tick, self.ways.direction(self.visits[-1][1], cell)))
        self.visits.append((tick, cell))

    def _move(self, begin: int, end: int, one: int, other: int) -> None:
        """Enter a move in the ticks after `begin` up to `end`."""
        if end <= begin or other - one not in self.ways.offsets or not self.free[begin + 1]:
            self._put(end, other)  # faster than a cell in a tick
            return
        way = self.ways.direction(one, other)
        if self.begin(MOVE_EAST + way, begin + 1, end):
            self.moves.append((begin + 1, way))
        self.visits.append((end, other))

    def enter_operations(self) -> None:
        """Enter picks, drops and stops; a load that comes or goes is a pick or a drop."""
        runs = np.flatnonzero(np.diff(self.action_id, prepend=0))
        for run, first in enumerate(runs.tolist()):
            if not self.action[first]:
                continue
            last = int(runs[run + 1]) - 1 if run + 1 < len(runs) else len(self.end) - 1
            self.operations.append((int(self.tick[first]), int(self.end[last]) - 1))
        changed = np.flatnonzero(np.diff(self.load, prepend=-2))
        firsts = [first for first, _ in self.operations]
        latest = np.searchsorted(firsts, self.tick[changed], "right")
        for row, number in zip(changed.tolist(), latest.tolist(), strict=True):
            tick, load = int(self.tick[row]), int(self.load[row])
            if row and not self.down[row]:  # a robot that is towed loses its load
                first, last = self.operations[number - 1] if number else (tick, NIL)
                tick = self._handle(tick, first, last, load)
            self.changes.append((tick, CHANGE_SEEN_LOAD, load))
        for first_tick, last_tick in self.operations:
            self.begin(EXECUTED_SERVE, first_tick, last_tick)

    def _handle(self, tick: int, first: int, last: int, load: int) -> int:
        """Enter the pick or the drop of a load that a message shows; return the tick in which the load
        changes. `first`, `last`: ticks of the last operation before the message."""
        if last < tick - 1:  # it was not about this load
            first = last = tick
        if load == NIL and last == tick - 1:  # the load was on the robot until the end
            self.begin(EXECUTED_DROP, first, last)
            return tick
        tick = min(tick, last)
        self.begin(EXECUTED_SERVE, first, tick - 1)
        if not self.free[tick]:  # it arrives in this tick
            self.executed[tick] |= DROPPED_ON_ARRIVAL if load == NIL else PICKED_ON_ARRIVAL
        self.begin(EXECUTED_DROP if load == NIL else EXECUTED_PICK, tick, last)
        return tick

    def enter_turns(self) -> None:
        """Enter headings, and turns: the free ticks around the first message with another heading."""
        known = np.flatnonzero((self.heading != NIL) & (self.cell != NIL))
        if len(known):
            first = int(known[0])
            self.changes.append(
                (int(self.tick[first]), CHANGE_SEEN_HEADING, int(self.heading[first]))
            )
        for one, other in pairwise(known.tolist()):
            heading, since, tick = (
                int(self.heading[other]),
                int(self.tick[one]),
                int(self.tick[other]),
            )
            quarters = (heading - int(self.heading[one])) & 3
            if quarters == 0:
                continue
            ticks = self.fleet.turn_ticks * min(quarters, 4 - quarters)
            begin = max(1, since + 1 - ticks)
            free = np.flatnonzero(self.free[begin : tick + 1])
            if len(free):
                tick = begin + int(free[-1])
                before = np.flatnonzero(~self.free[max(1, tick - ticks + 1) : tick])
                first = max(1, tick - ticks + 1) + (int(before[-1]) + 1 if len(before) else 0)
                # A robot may show its new heading as soon as it begins to turn.
                self.begin(TURN_LEFT if quarters == 3 else TURN_RIGHT, first, first + ticks - 1)
                tick = max(tick, since + 1)
            self.changes.append((tick, CHANGE_SEEN_HEADING, heading))

    def enter_charging(self) -> None:
        """Enter the free ticks in which the robot charges."""
        for row in np.flatnonzero(self.charging == 1).tolist():
            ticks = np.arange(self.tick[row], self.end[row])
            self._fill(ticks, np.full(len(ticks), EXECUTED_CHARGE, np.uint16))

    def _fill(self, ticks: Array, codes: Array) -> None:
        """Enter actions of one tick where ticks are free."""
        open_ = self.free[ticks]
        self.executed[ticks[open_]] = codes[open_]
        self.free[ticks[open_]] = False

    def enter_goals(self) -> None:
        """Enter where the robot drives: with its order to its next operation, or where the order ends;
        without one to the charger at which it charges next."""
        begins = [first for first, _ in self.operations]
        since, cells = zip(*self.visits, strict=True) if self.visits else ((0,), (NIL,))
        goals = [(0, NIL)]
        for first, last in self._tasks():
            inner = begins[bisect_left(begins, first) : bisect_left(begins, last)]
            changes = zip([first, *(one + 1 for one in inner)], [*inner, last], strict=True)
            goals += [
                (tick, cells[max(0, bisect_right(since, goal) - 1)]) for tick, goal in changes
            ]
            goals.append((last, NIL))
        for first, last, until in self._charges():
            goals += [(first, cells[max(0, bisect_right(since, last) - 1)]), (until, NIL)]
        goals.sort(key=lambda goal: goal[0])  # at one tick the end of a task comes before the next
        self.changes += [(tick, CHANGE_SEEN_GOAL, cell) for tick, cell in goals]

    def _tasks(self) -> list[tuple[int, int]]:
        """First tick and end of each stretch with one order or one load; a robot that gives its order
        back and takes it again in its place has it meanwhile."""
        begins = np.flatnonzero(np.diff(self.order, prepend=-2) | np.diff(self.load, prepend=-2))
        works = zip(self.order[begins].tolist(), self.load[begins].tolist(), strict=True)
        tasks: list[tuple[int, int]] = []
        last_work, moves = (NIL, NIL), [tick for tick, _ in self.moves]
        for work, ends in zip(works, pairwise([*self.tick[begins], self.tick[-1]]), strict=True):
            if work == (NIL, NIL):
                continue
            first, last = map(int, ends)
            if work == last_work and bisect_right(moves, first) == bisect_right(
                moves, tasks[-1][1]
            ):
                first, _ = tasks.pop()
            tasks.append((first, last))
            last_work = work
        return tasks

    def _charges(self) -> Iterator[tuple[int, int, int]]:
        """First tick of the way to each stay at a charger, and the ticks in which the stay begins and
        ends. The way begins with the first move after the last order or the last stay."""
        begins = [tick for tick, _ in self.moves]
        ends = [last for _, last in self._tasks()]
        state = np.flatnonzero(np.diff(self.charging == 1, prepend=False, append=False))
        end, before = [*self.tick.tolist(), int(self.end[-1])], 0
        for one, other in state.reshape(-1, 2).tolist():
            first, until = end[one], end[other]
            done = bisect_right(ends, first)
            move = bisect_right(begins, max(before, ends[done - 1] if done else 0))
            yield min([first, *begins[move : move + 1]]), first, until
            before = until

    def enter_waits(self) -> None:
        """Enter the ticks in which a robot with an order, or on its way to a charger, stands and will
        drive on."""
        begins = np.array([tick for tick, _ in self.moves], np.int64)
        ways = np.array([way for _, way in self.moves], np.int64)
        for row in np.flatnonzero(self.down).tolist():
            self.free[self.tick[row] : self.end[row]] = False
        for first, last in [*self._tasks(), *(trip[:2] for trip in self._charges())]:
            ticks = np.arange(max(first, 1), last)
            following = np.searchsorted(begins, ticks)
            goes_on = following < np.searchsorted(begins, last)
            codes = EXECUTED_BLOCKED | ways[following[goes_on]] << WAY_SHIFT
            self._fill(ticks[goes_on], codes.astype(np.uint16))
