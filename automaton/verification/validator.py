"""The independent validator: replays a recording by the rules and reports violations.

It reads only the header, committed actions and changes, tracks its own positions, and shares no
code with the kernels; recorded states are checked against its replay.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_LOAD_LEFT,
    CHANGE_ORDER_RESERVED,
    CHANGE_SLOT_RESERVED,
    CHANGE_STATUS,
    DROPPED_ON_ARRIVAL,
    ENTERED_PARKING_BAY,
    EXECUTED_VALUES,
    LEFT_PARKING_BAY,
    PICKED_ON_ARRIVAL,
)
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
    DecodedFrame,
)
from automaton.verification.energy_rules import Energy, ReplayedDelays, parted_faults
from automaton.verification.gate_rules import GateRules
from automaton.verification.load_rules import Loads
from automaton.verification.motion_rules import (
    Acts,
    ReplayedMotion,
    check_due_times,
    parted,
    parted_delays,
    parted_visits,
)
from automaton.verification.move_time_rules import NIL, CoarseTicks, in_fine_ticks

RULE_TEXTS: Final = {
    "busy": "a robot begins an operation only when its last one is over",
    "exits": "moves go to a neighbour through an exit of the cell",
    "heading": "moves go along the robot's axis or heading",
    "turn": "robots turn where their kinematics allow it",
    "capacity": "a cell holds no more robots than its capacity; long moves hold both cells, under "
    "convoy only the one ahead",
    "swap": "two robots do not swap over an edge where robots cannot pass",
    "following": "with following `none`, a cell is entered only if it had room when the tick began",
    "bay": "a parking bay holds one robot, which enters and leaves it through its own home "
    "cell, when that is empty, and without following",
    "load": "an order is in exactly one place; loads are handled next to their slot",
    "order": "an order is reserved by one robot at a time",
    "slot": "an empty shelf is reserved by one robot at a time",
    "move time": "a move takes its duration times the robots in its slow zone, plus random "
    "delays; under convoy at least the remaining ticks of the robot ahead",
    "area": "robots stay out of areas closed to their type",
    "payload": "robots carry no order heavier than the payload of their type",
    "arrival": "loads are handled on arrival only if that takes 0 ticks",
    "duration": "waits have recorded durations",
    "energy": "operations use charge when they begin; robots go down when their move ends and "
    "stand still until they are towed",
    "visit": "a robot does the next stop of its order when it stands there at the end of a "
    "tick; one stop per tick",
    "due": "each order is due when its scenario says",
    "pod": "a pod is in one storage cell or on one robot; no robot with a load drives under one",
    "line": "a line is done once, at its station, when its pod is there",
    "place": "no more robots are bound for a station than it has places",
    "delay": "delays begin and last as drawn; delayed robots begin no operation; no move ends "
    "before that of the robot ahead",
    "closed": "no robot enters a closed cell",
    "door": "no robot drives through a door that is shut",
    "block": "a block holds at most its number of robots, of one direction if it is one-way",
    "lift": "a lift takes one robot, at the mouth where its cabin is",
    "record": "the recording is consistent with itself",
}
ACTS: Final = (  # by code of recorded action
    *("nothing", "move_east", "move_south", "move_west", "move_north", "turn_left", "turn_right"),
    *("pick", "drop", "try_drop", "wait", "blocked", "retreat", "bay_blocked", "illegal"),
    *("charge", "serve"),
)
STATUS_EXHAUSTED: Final = 2  # a recorded status
STATUSES_GOING_DOWN: Final = (1, STATUS_EXHAUSTED)  # recorded statuses: failing, exhausted
STATUSES: Final = (0, 3, 4, 5, 6)  # statuses that changes may name
MAX_VIOLATIONS: Final = 100


class Violation(NamedTuple):
    """A broken rule."""

    tick: int
    rule: str  # a key of RULE_TEXTS
    robots: tuple[int, ...]  # identities
    cell: tuple[int, int] | None  # (x, y) as shown to users
    text: str

    def __str__(self) -> str:
        who = " and ".join(f"robot {robot}" for robot in self.robots)
        where = f" at ({self.cell[0]}, {self.cell[1]})" if self.cell else ""
        return f"tick {self.tick}: {self.rule}: " + ": ".join(
            filter(None, (who + where, self.text))
        )


@dataclass
class Report:
    """The result of a validation."""

    ticks: int = 0  # replayed ticks
    counts: dict[str, int] = field(default_factory=dict)  # number of actions by name
    violations: list[Violation] = field(default_factory=list)  # the first MAX_VIOLATIONS violations

    @property
    def valid(self) -> bool:
        """Whether no rule is broken."""
        return not self.violations


class _TooManyViolationsError(Exception):
    """Too many violations to continue."""


class Recorded(Protocol):
    """A recording of any origin."""

    @property
    def header(self) -> dict[str, Any]: ...

    @property
    def frames(self) -> Iterable[DecodedFrame]: ...


def validate_stored(recording: Recorded) -> Report:
    """Validate a recording that is open or in memory."""
    return validate_recording(recording.header, recording.frames)


def validate_recording(header: dict[str, Any], frames: Iterable[DecodedFrame]) -> Report:
    """Validate the frames after a header."""
    validator = Validator(header)
    try:
        validator.begin()
        for kind, content in frames:
            if kind == FRAME_KIND_TICKS:
                validator.ticks(content)
            elif kind == FRAME_KIND_KEYFRAME:
                validator.keyframe(content)
            elif kind == FRAME_KIND_CONDITIONS:
                validator.rules(content)
            elif kind == FRAME_KIND_END:
                validator.end(content)
    except _TooManyViolationsError:
        pass
    return validator.summed_up()


class Validator:
    """One replay; `motion` and `loads` hold the state, this class compares and reports."""

    def __init__(self, header: dict[str, Any]) -> None:
        self.ticks_of = CoarseTicks(header["scenario"])
        self.header = {**header, "scenario": in_fine_ticks(header["scenario"])}
        self.report = Report()
        self._now = 0  # the current tick of the replay
        self._stride = header["floor"]["width"] + 2
        self._acts: Any = np.zeros(EXECUTED_VALUES, np.int64)  # by recorded value

    def begin(self) -> None:
        """Check the state at tick 0."""
        self.motion = ReplayedMotion(self.header, self._report_violation)
        self.loads = Loads(self.header, self.motion, self._report_violation)
        self.energy = Energy(self.header, self.motion, self._report_violation)
        self.delays = ReplayedDelays(self.header, self.motion, self.energy, self._report_violation)
        self.loads.status = self.energy.status
        self.motion.types.load = self.loads.load
        self.gates = GateRules(self.header, self._report_violation)
        self.motion.pace.cabin_ticks = self.gates.cabin_ticks

    def ticks(self, content: dict[str, Any]) -> None:
        """Replay the ticks of a frame."""
        did = content["executed"]
        if content["first"] != self.report.ticks + 1 or did.shape[1] != len(self.motion.home):
            text = f"tick {content['first']} follows tick {self.report.ticks}"
            self._report_violation("record", [], NIL, text)
            raise _TooManyViolationsError
        self._acts += np.bincount(did.ravel(), minlength=EXECUTED_VALUES)
        when, who = np.nonzero(did)
        acts: list[Acts] = [[] for _ in did]
        for row, r, code in zip(when.tolist(), who.tolist(), did[when, who].tolist(), strict=True):
            acts[row].append((r, code))
        changes, first = content["changes"], content["first"]
        ends = np.searchsorted(changes[:, 0], first + np.arange(-1, len(did)), side="right")
        for tick, acted in enumerate(acts, first):
            rows = changes[ends[tick - first] : ends[tick - first + 1]].tolist()
            self._tick(tick, acted, rows)
        others = np.concatenate([changes[: ends[0], 0], changes[ends[-1] :, 0]])
        if len(others):
            text = f"changes of tick {others[0]} are among other ticks"
            self._report_violation("record", [], NIL, text)

    def _tick(self, tick: int, acts: Acts, rows: list[list[int]]) -> None:
        self._now = tick
        trips = self.loads.trips
        leaves = any(did & LEFT_PARKING_BAY for _, did in acts)
        faults, rows = parted_faults(rows)
        self._change_status(tick, faults)
        delays, rows = parted_delays(rows)
        self.delays.begin(tick, delays)
        if self.ticks_of.decides(tick):
            self.loads.release(tick)
        self.motion.look(acts)
        if self.gates.gates:
            self.gates.look(tick, self.motion.cell, self.motion.claim)
        placed = self.motion.open_bays(tick, acts) if leaves else set()
        if self.gates.gates:
            self.gates.check(tick, acts, placed, self.motion)
        self.energy.spend(tick, acts, rows, self.loads.load, placed)
        rows, stops = parted_visits(rows)
        before, after = parted(rows, acts)
        lengths = self.loads.apply(tick, before, acts)
        if trips.there:
            trips.check_moves(acts, self.loads.load, self.loads.order)
        self.motion.execute(tick, acts, lengths, placed)
        self.loads.arrive(tick, after, acts)
        self.loads.check_parked(acts)
        if stops or self.ticks_of.ends(tick):
            self.loads.visits.visit(tick, stops)
        if trips.there:
            trips.end(self.loads.load)
        self.report.ticks = tick

    def _change_status(self, tick: int, rows: list[list[int]]) -> None:
        """Robots go down, with the effects on their loads and orders, or return."""
        for row in rows:
            _, code, subject, value = row
            known = self.loads.exists(code, subject, value)
            if known and code == CHANGE_STATUS and value in STATUSES:
                self.energy.become(tick, subject, value, self.loads)
            elif known and code == CHANGE_LOAD_LEFT:
                self.loads.leave(subject, value)
            elif code in (CHANGE_ORDER_RESERVED, CHANGE_SLOT_RESERVED) and value == NIL:
                self.loads.apply(tick, [row], [])
            elif code == CHANGE_ORDER_RESERVED and self.loads.trips.offers.get(subject) == value:
                self.loads.apply(tick, [row], [])  # it is beneath a pod that was put there
            else:
                text = f"an invalid change among faults: {code} {subject} {value}"
                self._report_violation("record", [], NIL, text)

    def keyframe(self, content: dict[str, Any]) -> None:
        """Compare a recorded state with the replayed one."""
        tick = self.report.ticks
        if content["tick"] != tick:
            text = f"a state of tick {content['tick']} follows tick {tick}"
            self._report_violation("record", [], NIL, text)
            return
        motion, loads = self.motion, self.loads
        motion.know(content["robots"]["parked"].tolist())
        claims = [motion.claim.get(r, (NIL, 0))[0] for r in range(len(motion.home))]
        lanes = motion.capacity
        # The direction of travel matters only for a robot that holds a lane.
        seen = zip(motion.cell, motion.travel, content["robots"]["travel"].tolist(), strict=True)
        travel = [mine if c >= 0 and lanes[c] == 2 else theirs for c, mine, theirs in seen]
        expected: dict[str, dict[str, list[int]]] = {
            "robots": {
                "cell": motion.cell,
                "claim": claims,
                "heading": motion.heading,
                "travel": travel,
                "busy": motion.busy(tick),
                "load": loads.load,
                "order": loads.order,
                "parked": self._parked(content),
                "charge": self.energy.charge,
                "status": self._statuses(content),
            },
            "orders": {"state": loads.state, "current_slot": loads.place, "reserved_by": loads.by},
            "stops": {"done": loads.visits.done},
            "stations": {"in_service": loads.work.first(), "completion_tick": loads.work.done},
            "slots": {
                "content": loads.content,
                "reserved_by": loads.reserved,
                "cell": loads.slot_cell,
            },
        }
        if loads.trips.there:
            expected |= loads.trips.state()
            if loads.trips.of_lines:
                expected["orders"]["release_tick"] = loads.trips.release
        for part, arrays in expected.items():
            for name, values in arrays.items():
                self._compare(f"{part}.{name}", values, content[part][name])

    def _parked(self, content: dict[str, Any]) -> list[int]:
        """Parked robots by the replay; actions do not show a robot that lacked charge to set out."""
        robots = content["robots"]
        told = zip(robots["parked"].tolist(), robots["status"].tolist(), strict=True)
        pairs = zip(self.motion.parked, told, strict=True)
        return [
            theirs if status == STATUS_EXHAUSTED else int(mine) for mine, (theirs, status) in pairs
        ]

    def _statuses(self, content: dict[str, Any]) -> list[int]:
        """Statuses by the replay; robots about to fail count as up, since actions do not show it."""
        recorded = content["robots"]["status"].tolist()
        pairs = zip(self.energy.status, recorded, strict=True)
        return [
            theirs if mine == 0 and theirs in STATUSES_GOING_DOWN else mine
            for mine, theirs in pairs
        ]

    def _compare(self, name: str, replayed: list[int], recorded: Any) -> None:
        if len(replayed) != len(recorded):
            text = (
                f"{name} has {len(recorded):,} values in the recorded state, not {len(replayed):,}"
            )
            self._report_violation("record", [], NIL, text)
            return
        differ = np.flatnonzero(np.array(replayed, np.int64) != recorded)
        if not len(differ):
            return
        i = int(differ[0])
        text = f"{name}[{i}] is {recorded[i]} in the recorded state, {replayed[i]} by its actions"
        robots = [i] if name.startswith("robots.") else []
        self._report_violation("record", robots, NIL, text)

    def rules(self, content: dict[str, Any]) -> None:
        """New durations or rules apply from here on."""
        if content["tick"] != self.report.ticks:
            text = f"rules of tick {content['tick']} follow tick {self.report.ticks}"
            self._report_violation("record", [], NIL, text)
        scenario = in_fine_ticks(content["scenario"])
        self.header = {**self.header, "scenario": scenario}
        self.motion.apply_rules(scenario)
        self.energy.apply_rules(scenario)
        check_due_times(self.header, scenario, self._report_violation)

    def end(self, content: dict[str, Any]) -> None:
        """Compare the recorded end of the run."""
        stop = self.header["scenario"]["stop"]["when"]
        done = self.loads.undelivered == self.loads.work.undone == 0 and stop != "never"
        parked = {True} if stop == "delivered" else self.motion.all_parked()
        if stop == "on-targets":
            parked = {self.motion.stand_on(targets_of(self.header))}
        finished = {done and home for home in parked}
        for name, values in (("ticks", {self.report.ticks}), ("finished", finished)):
            if content[name] not in values:
                text = f"the end has {name} = {content[name]}, its actions give {min(values)}"
                self._report_violation("record", [], NIL, text)

    def summed_up(self) -> Report:
        """The report, with numbers of actions."""
        counts: Counter[str] = Counter()
        for did in np.flatnonzero(self._acts).tolist():
            times = int(self._acts[did])
            counts[ACTS[did & ACTION_MASK]] += times
            counts["left_bay"] += times * bool(did & LEFT_PARKING_BAY)
            counts["parked"] += times * bool(did & ENTERED_PARKING_BAY)
            counts["pick"] += times * bool(did & PICKED_ON_ARRIVAL)
            counts["drop"] += times * bool(did & DROPPED_ON_ARRIVAL)
        counts["visit"] = self.loads.visits.count if hasattr(self, "loads") else 0
        self.report.counts = {name: number for name, number in counts.items() if number}
        return self.report

    def _report_violation(self, rule: str, robots: list[int], cell: int, text: str) -> None:
        """Add a violation in the current tick."""
        place = None
        if cell >= 0:
            y, x = divmod(cell, self._stride)
            place = (x - 1, y - 1)
        self.report.violations.append(Violation(self._now, rule, tuple(robots), place, text))
        if len(self.report.violations) >= MAX_VIOLATIONS:
            raise _TooManyViolationsError


def targets_of(header: dict[str, Any]) -> list[int]:
    """The cell in which the task of each robot ends; without a task, its start cell."""
    cells: list[int] = header["robots"]["cell"].tolist()
    ends = header["stops"]["cell"][header["orders"]["first_stop"][1:] - 1].tolist()
    return [*ends, *cells[len(ends) :]]
