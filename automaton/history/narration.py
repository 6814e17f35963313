"""Describe the events of a run in sentences, one per line, for logs and screen readers.

The words are those of `explain` and of the list of events. To avoid flooding the reader, a run is
described in stretches of STRETCH_TICKS with a limited number of sentences. Kinds of sentences take
turns, the most serious first; omitted sentences are counted. The text does not depend on the speed of
the computation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from automaton.engine.observation import EVENT_DEADLOCK, is_waiting, waited_ticks
from automaton.engine.state import NIL, Array
from automaton.errors import InputError, nearest
from automaton.history.event_history import EVENT_GROUPS, Event, event_of, event_words
from automaton.history.explanation import explain as explain_wait
from automaton.history.explanation import link_of
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.history.state_words import (
    break_begins,
    break_begun_words,
    gate_states,
    gate_words_of,
)
from automaton.history.watched_run import WatchedRun
from automaton.runs.illegal_decisions import explainer
from automaton.runs.progress import largest_jam
from automaton.runs.run_diagnosis import describe_jam
from automaton.runs.simulation import Simulation

STRETCH_TICKS: Final = 100
SENTENCES: Final = 20  # default limit for a stretch
WAIT_TICKS: Final = 10  # a wait is reported after this time; most waits are shorter
MAX_CYCLE_NAMED: Final = 8  # largest deadlock whose robots are all named

KINDS: Final[tuple[str, ...]] = (  # kinds of sentences, the most serious first
    *("faults", "illegal", "deadlocks", "jams", "zones", "gates", "breaks", "waits"),
    *("deliveries", "parts", "orders", "charging", "retreats", "waits over", "picks"),
    "parking bays",
)
_KIND_OF_CODE: Final = np.full(1 + max(max(group) for group in EVENT_GROUPS.values()), NIL)
for _name, _codes in EVENT_GROUPS.items():
    _KIND_OF_CODE[list(_codes)] = KINDS.index(_name)


class Scope(NamedTuple):
    """The part of a run to describe."""

    kinds: frozenset[str] = frozenset(KINDS)
    sentences: int = SENTENCES  # maximum for a stretch
    first: int = 0  # the tick after which the description begins


class Passage(NamedTuple):
    """The sentences about a stretch of ticks."""

    tick: int  # the last tick
    lines: list[str]


def kinds_named(names: Sequence[str]) -> frozenset[str]:
    """The kinds with these names, written with blanks or hyphens; all kinds without names.

    Raises InputError.
    """
    kinds = frozenset(name.strip().replace("-", " ") for name in names)
    for kind in sorted(kinds - frozenset(KINDS)):
        known = [name.replace(" ", "-") for name in KINDS]
        hint = nearest(kind.replace(" ", "-"), known) or f"; there are {', '.join(known)}"
        raise InputError(f"'{kind}' is not a kind of sentence{hint}", "--only")
    return kinds or frozenset(KINDS)


def narrate(run: WatchedRun, scope: Scope) -> Iterator[Passage]:
    """Play a run to its end, and yield the sentences about each stretch when it is over."""
    narration = Narration(run, scope)
    while run.tick < scope.first and _go_on(run, scope.first):
        pass
    narration.begin()
    begun = run.tick
    while _go_on(run, run.tick + 1):
        narration.look()
        if run.tick % STRETCH_TICKS == 0:
            yield narration.take(begun)
            begun = run.tick
    if run.tick > begun:
        yield narration.take(begun)


def _go_on(run: WatchedRun, tick: int) -> bool:
    """Compute towards a tick; return whether the run has advanced."""
    before = run.tick
    return run.show(tick) > before


@dataclass
class Candidates:
    """Candidate sentences of one kind: the first ones, and the number of all."""

    lines: list[tuple[int, str]] = field(default_factory=list)  # place in the stretch, text
    count: int = 0


class Narration:
    """Inspects a run after each tick, and collects sentences."""

    def __init__(self, run: WatchedRun, scope: Scope) -> None:
        self._run, self._scope = run, scope
        self._seen = 0  # number of events seen so far
        self._place = 0  # place of the next line in its stretch
        self._candidates: dict[str, Candidates] = {
            kind: Candidates() for kind in KINDS if kind in scope.kinds
        }
        self._reported_waits = np.zeros((0, 2), np.int64)  # robot, first tick of its wait
        self._gates: Array = np.zeros(0, np.int64)
        self._jammed = False
        self._snapshot: Snapshot | None = None  # of the present tick

    def begin(self) -> None:
        """Start the description at the present tick."""
        log = self._run.event_history.log
        self._seen = log.dropped + log.index_at(self._run.tick)

    def look(self) -> None:
        """Note the events of the tick that was just computed."""
        self._snapshot = None
        simulation = self._run.shown
        self._note_events()
        self._note_waits(simulation)
        self._note_gates(simulation)
        self._note_breaks(simulation)
        if self._run.tick % STRETCH_TICKS == 0:
            self._note_jam(simulation)

    def take(self, begun: int) -> Passage:
        """Return the chosen sentences about the ticks after `begun`, and discard all candidates."""
        chosen: list[tuple[int, str]] = []
        for turn in range(self._scope.sentences):
            for one in self._candidates.values():
                if turn < len(one.lines) and len(chosen) < self._scope.sentences:
                    chosen.append(one.lines[turn])
        lines = [text for _, text in sorted(chosen)]
        places = {place for place, _ in chosen}
        left = {
            kind: one.count - sum(place in places for place, _ in one.lines)
            for kind, one in self._candidates.items()
        }
        if any(left.values()):
            more = ", ".join(f"{kind} {many:,}" for kind, many in left.items() if many)
            lines.append(f"ticks {begun + 1:,} to {self._run.tick:,}, left out: {more}")
        self._candidates = {kind: Candidates() for kind in self._candidates}
        self._place = 0
        return Passage(self._run.tick, lines)

    def _room(self, kind: str, many: int) -> int:
        """Count `many` events of a kind; return how many of them may get a sentence."""
        one = self._candidates.get(kind)
        if one is None:
            return 0
        one.count += many
        return max(0, min(many, self._scope.sentences - len(one.lines)))

    def _add(self, kind: str, text: str, robot: int = NIL) -> None:
        who = "" if robot == NIL else f", robot {robot}"
        text = text.removeprefix(f"robot {robot} ")
        line = (self._place, f"tick {self._run.tick:,}{who}: {text}")
        self._candidates[kind].lines.append(line)
        self._place += 1

    def _moment(self) -> Snapshot:
        """A snapshot of the present tick, taken only when needed."""
        if self._snapshot is None:
            self._snapshot = take_snapshot(self._run.shown)
        return self._snapshot

    def _note_events(self) -> None:
        log = self._run.event_history.log
        rows = log.rows[max(0, self._seen - log.dropped) : log.index_at(self._run.tick)]
        self._seen = log.dropped + log.index_at(self._run.tick)
        kinds = _KIND_OF_CODE[rows[:, 1]]
        chosen = []
        for kind in np.unique(kinds).tolist():
            at = np.flatnonzero(kinds == kind)
            chosen += at[: self._room(KINDS[kind], len(at))].tolist()
        for row in sorted(chosen):
            event = event_of(rows[row])
            self._add(KINDS[kinds[row]], self._words(event), event.robot)

    def _words(self, event: Event) -> str:
        world = self._run.shown.world
        explain = explainer(world, self._run.floor_plan)
        words = event_words(event, len(world.lines.order) > 0, explain)
        if event.code == EVENT_DEADLOCK and event.value <= MAX_CYCLE_NAMED:
            explanation = explain_wait(self._moment(), self._run.floor_plan, event.robot)
            if explanation.cycle != NIL:
                words += f", {explanation.cycle_line}"
        return words

    def _note_waits(self, simulation: Simulation) -> None:
        """Report waits that have lasted WAIT_TICKS, and the ends of reported waits."""
        observation, identity = simulation.observation, simulation.world.robots.identity
        waiting = is_waiting(observation.cause)
        self._note_ended_waits(simulation, waiting)
        waited = waited_ticks(observation.cause, observation.since, self._run.tick)
        long = np.flatnonzero(waiting & (waited == WAIT_TICKS))
        if not len(long):
            return
        robots = np.sort(identity[long])
        if "waits" in self._scope.kinds:  # else only their ends are reported
            robots = robots[: self._room("waits", len(long))]
            for robot in robots.tolist():
                self._add("waits", link_of(self._moment(), self._run.floor_plan, robot).text, robot)
        since = np.full(len(robots), self._run.tick - WAIT_TICKS)
        reported = np.column_stack((robots.astype(np.int64), since))
        self._reported_waits = np.concatenate((self._reported_waits, reported))

    def _note_ended_waits(self, simulation: Simulation, waiting: Array) -> None:
        if not len(self._reported_waits):
            return
        robots, since = self._reported_waits.T
        stored = simulation.world.robots.at_index[robots]
        over = ~waiting[stored] | (simulation.observation.since[stored] != since)
        room = self._room("waits over", int(over.sum()))
        for robot, tick in self._reported_waits[over][:room].tolist():
            self._add(
                "waits over", f"is no longer waiting, after {self._run.tick - tick:,} ticks", robot
            )
        self._reported_waits = self._reported_waits[~over]

    def _note_gates(self, simulation: Simulation) -> None:
        """Report closings that begin or end, doors that open or shut, and lifts that are called."""
        states = gate_states(simulation.world)
        before = self._gates if len(self._gates) else np.zeros_like(states)
        self._gates = states
        changed = np.flatnonzero(states != before)
        if len(changed):
            for gate in changed[: self._room("gates", len(changed))].tolist():
                self._add("gates", gate_words_of(self._moment(), gate))

    def _note_breaks(self, simulation: Simulation) -> None:
        stations = break_begins(simulation.world.pod_stations, self._run.tick)
        for station in stations[: self._room("breaks", len(stations))].tolist():
            self._add("breaks", break_begun_words(self._moment(), station))

    def _note_jam(self, simulation: Simulation) -> None:
        """Report when a jam appears and when it has dissolved."""
        jam = largest_jam(simulation.world, self._run.floor_plan)
        if (jam is not None) != self._jammed and self._room("jams", 1):
            words = describe_jam(jam)
            self._add("jams", words[0] if words else "the jam has dissolved")
        self._jammed = jam is not None
