"""Whether drawn floors with pods ever break a rule of pods, lines, trips and places: run by hand.

    nice python tests/helpers/conservation_trials.py [FLOORS] [FIRST]

Each floor is run twice, the second time with its robots stored in another sequence: digests must be
equal. The recording must be valid, with states in between, and what is counted must agree with what
is added up. Exits with 1 if anything is found; a floor is named by its number.
"""

from __future__ import annotations

import sys
import time
from collections import Counter, deque
from collections.abc import Sequence
from itertools import pairwise
from random import Random
from typing import Any, NamedTuple

import numpy as np
from pod_floors import TICKS, drawn_pods

from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_LOAD_LEFT,
    CHANGE_PICKED,
    CHANGE_VISITED,
    EXECUTED_SERVE,
    MOVE_NORTH,
)
from automaton.engine.state import ACTION_STATION_QUEUE
from automaton.errors import InputError
from automaton.recording.contents import FRAME_KIND_KEYFRAME, FRAME_KIND_TICKS
from automaton.recording.frames import Recording
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.verification.pod_rules import ReplayedTrips
from automaton.verification.validator import Validator
from automaton.world.resolved import Resolved

FLOORS = 10_000
AT_ONCE = 250  # floors between two lines of figures
STATES = 25  # ticks between recorded states
MICRO = 1_000_000


class Outcome(NamedTuple):
    """What was found about a floor."""

    wrong: list[str]
    figures: Counter[str]


def trial(resolved: Resolved, number: int) -> Outcome:
    """Run a floor twice and check all of it."""
    recorder = MemoryRecorder(resolved)
    run = Simulation(resolved, on_record=recorder)
    while not run.finished and run.tick < resolved.scenario.stop.max_duration:
        run.run(until=run.tick + STATES)
        recorder(run)
        recorder.flush()
        recorder._keyframe(run.world)
    recording = recorder.recording()
    wrong = [] if permuted(resolved, number).digest == run.digest else ["digests differ"]
    validator = Validator(recording.header)
    validator.begin()
    counted = CountedTrips(validator.loads.trips)
    for kind, content in recording.frames:
        if kind == FRAME_KIND_TICKS:
            validator.ticks(content)
        elif kind == FRAME_KIND_KEYFRAME:
            validator.keyframe(content)
    wrong += [str(one) for one in validator.report.violations]
    figures = Counter(finished=int(run.finished), ticks=run.tick)
    wrong += identities(run, recording, counted, figures)
    return Outcome(wrong, figures)


class CountedTrips:
    """The trips of a validator, and what is counted as it goes through the ticks."""

    def __init__(self, trips: ReplayedTrips) -> None:
        self.trips = trips
        self.ended_early = 0  # trips without a place where they would have gone next
        self.open_ticks = 0  # sum over ticks of the lines that are known and not done
        self._end, self._end_early = trips.end, trips._end_early
        trips.end, trips._end_early = self.end, self.end_early  # type: ignore[method-assign]

    def end(self, load: Sequence[int]) -> None:
        self._end(load)
        self.open_ticks += sum(self.trips.open)

    def end_early(self, trip: int) -> None:
        self._end_early(trip)
        self.ended_early += 1


def permuted(resolved: Resolved, number: int) -> Simulation:
    """The same run with robots stored otherwise."""
    storage = list(range(resolved.scenario.fleet.robots))
    Random(number).shuffle(storage)
    run = Simulation(resolved, storage=np.array(storage, np.int32))
    run.run()
    return run


def identities(
    run: Simulation, recording: Recording, counted: CountedTrips, figures: Counter[str]
) -> list[str]:
    """What must be equal, added up in two ways."""
    world, trips = run.world, counted.trips
    lines, now = world.lines, run.tick
    wrong = []
    known = lines.served_at >= 0
    ended = np.where(lines.done >= 0, lines.done, now + 1)
    lead_times = int((ended - np.maximum(lines.release_tick, 1))[known].sum())
    if counted.open_ticks != lead_times:
        wrong.append(f"{counted.open_ticks} open lines by tick, {lead_times} by lead time")
    count = trips.known
    if world.orders.priority[:count].tolist() != trips.priority[:count]:
        wrong.append("priorities of trips differ")
    if (world.orders.release_tick[:count] != trips.release[:count]).any():
        wrong.append("releases of trips differ")
    told = Told(recording)
    if not len(lines.order):  # orders of a list have stops of their own
        done = world.stops.done >= 0
        by_stops = int(world.stops.ticks[done].sum())
        if told.served != by_stops:
            wrong.append(f"{told.served} ticks of SERVE, {by_stops} by stops")
        stored = int((world.orders.delivered >= 0).sum())
        figures.update(listed=len(world.orders.state), visits=int(done.sum()), stored=stored)
        return wrong
    by_lines = handling_of_visits(world, lines)
    if told.served != by_lines:
        wrong.append(f"{told.served} ticks of SERVE, {by_lines} by handling")
    stations = world.pod_stations.served_ticks.sum()
    if told.serving != stations:
        wrong.append(f"{told.serving} ticks of SERVE up to now, {stations} by station")
    wrong += told.short_trips(world)
    figures.update(
        lines=int(known.sum()),
        skus=int((known & (lines.sku >= 0)).sum()),
        done=int((lines.done >= 0).sum()),
        trips=count,
        visits=int(world.tally.visits.sum()),
        serve=told.served,
        stored=int((world.orders.delivered[:count] >= 0).sum()),
        joined=int((lines.trip >= 0).sum()) - count,
        early=counted.ended_early,
        aside=told.put_aside,
        queued=int(world.tally.ticks[:, ACTION_STATION_QUEUE].sum()),
    )
    return wrong


def handling_of_visits(world: Any, lines: Any) -> int:
    """Ticks that all visits took that are over: lines by the visit in which they were done."""
    visits: dict[tuple[int, int, int], int] = {}
    stations = world.pod_stations
    for line in np.flatnonzero(lines.done >= 0).tolist():
        station = int(lines.served_at[line])
        visit = int(lines.trip[line]), int(lines.done[line]), station
        parts = visits.get(visit, int(stations.visit[station]))
        visits[visit] = parts + int(lines.handling[stations.rule[station], line])
    return sum(max(1, (2 * parts + MICRO) // (2 * MICRO)) for parts in visits.values() if parts)


class Told:
    """What a recording tells of trips, read without the validator."""

    def __init__(self, recording: Recording) -> None:
        self.header = recording.header
        frames = [frame.content for frame in recording.frames if frame.kind == FRAME_KIND_TICKS]
        self.did = np.concatenate([content["executed"] for content in frames])
        self.changes = np.concatenate([content["changes"] for content in frames])
        self.served = self.serving = self.put_aside = 0
        for tick, code, r, ticks in self.changes.tolist():
            serves = code == CHANGE_DURATION and self.did[tick - 1, r] & ACTION_MASK
            if serves == EXECUTED_SERVE:
                self.serving += min(ticks, len(self.did) - tick + 1)
                self.served += ticks if tick + ticks - 1 <= len(self.did) else 0

    def short_trips(self, world: Any) -> list[str]:
        """The trips that drive less with their load than the way from slot to slot is long."""
        slots, wrong = self.header["slots"]["cell"].tolist(), []
        stands = [slots[slot] for slot in self.header["pods"]["slot"].tolist()]
        under_way: dict[int, tuple[int, int, list[int]]] = {}
        done: Counter[int] = Counter()  # stops, by trip
        most = world.stops.cell.shape[0] // max(1, len(world.orders.state))
        moves = (self.did & ACTION_MASK > 0) & (self.did & ACTION_MASK <= MOVE_NORTH)
        for tick, code, subject, value in self.changes.tolist():
            if code == CHANGE_PICKED:
                pod = int(world.trips.pod[value])
                under_way[subject] = tick, value, [stands[pod]]
            elif code == CHANGE_VISITED:
                trip, way = under_way[subject][1:]
                station = int(world.trips.station[trip * most + done[trip]])
                done[trip] += 1
                way.append(int(world.pod_stations.cell[station]))
            elif code == CHANGE_LOAD_LEFT:  # it may be put anywhere
                _, trip, way = under_way.pop(subject)
                stands[int(world.trips.pod[trip])] = slots[value]
                self.put_aside += 1
            elif code == CHANGE_DROPPED:
                begun, trip, way = under_way.pop(subject)
                way.append(slots[value])
                stands[int(world.trips.pod[trip])] = slots[value]
                least = sum(self._way(a, b) for a, b in pairwise(way))
                driven = int(moves[begun - 1 : tick, subject].sum())
                if driven < least:
                    wrong.append(f"trip {trip} drives {driven} moves, its way has {least}")
        return wrong

    def _way(self, start: int, end: int) -> int:
        """Cells from one to another, whatever is in them."""
        floor = self.header["floor"]
        exits, stride = floor["exits"].ravel().tolist(), floor["width"] + 2
        offsets = (1, stride, -1, -stride)
        seen, queue = {start: 0}, deque([start])
        while queue:
            cell = queue.popleft()
            if cell == end:
                return seen[cell]
            for direction, offset in enumerate(offsets):
                if exits[cell] >> direction & 1 and cell + offset not in seen:
                    seen[cell + offset] = seen[cell] + 1
                    queue.append(cell + offset)
        return 1 << 30


def trials(numbers: range, ticks: int = TICKS) -> tuple[list[str], Counter[str]]:
    """(what is wrong, what was found)"""
    wrong: list[str] = []
    figures: Counter[str] = Counter()
    for number in numbers:
        try:
            resolved = drawn_pods(number, ticks)
        except InputError:
            figures["refused"] += 1
            continue
        try:
            found = trial(resolved, number)
        except Exception as error:
            wrong.append(f"floor {number}: {type(error).__name__}: {error}")
            continue
        figures["floors"] += 1
        figures.update(found.figures)
        wrong += [f"floor {number}: {text}" for text in found.wrong]
    return wrong, figures


def digests(numbers: range, ticks: int) -> str:
    """The digests of some floors after so many ticks, one a line; floors that are refused have none."""
    found = []
    for number in numbers:
        try:
            run = Simulation(drawn_pods(number, ticks))
        except InputError:
            continue
        run.run()
        found.append(f"{number} {run.tick} {run.digest}")
    return "\n".join(found)


def main(arguments: list[str]) -> int:
    """Run the trials; 1 if anything is wrong."""
    count, first, *_ = [*map(int, arguments), *(FLOORS, 0)[len(arguments) :]]
    begun = time.monotonic()
    wrong: list[str] = []
    figures: Counter[str] = Counter()
    for start in range(first, first + count, AT_ONCE):
        found, counted = trials(range(start, min(start + AT_ONCE, first + count)))
        wrong += found
        figures.update(counted)
        print("\n".join(found[:60]), flush=True)
        print(", ".join(f"{number:,} {name}" for name, number in figures.items()), flush=True)
    print(f"{len(wrong)} found; {time.monotonic() - begun:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
