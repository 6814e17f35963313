"""Deadlocks: found by one rule in all runs, watched or not, with their time and their place."""

from __future__ import annotations

from contextlib import suppress
from itertools import permutations

import msgspec
import numpy as np
import pytest
from small_runs import SmallRun
from whole_floors import drawn_whole, resolved_whole

from automaton.engine.observation import DEADLOCK_TICKS, EVENT_DEADLOCK
from automaton.errors import InputError
from automaton.history.event_history import EventHistory
from automaton.runs.headless import longest_deadlock, run_marked
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from automaton.world.resolved import Resolved

LONG_WAITS = (500, 500, 500, 500, 255)


def counts(run: Simulation) -> tuple[int, int, int, int]:
    """How many, robot ticks in them, the longest one, and its first tick."""
    count = run.world.deadlocks.count
    return int(count.total), int(count.robot_ticks), int(count.longest), int(count.longest_begin)


def test_two_robots_head_on_are_a_deadlock_after_64_ticks() -> None:
    floor = SmallRun(".AB", {"A": "E", "B": "W"}, waits=LONG_WAITS).tick(DEADLOCK_TICKS - 1)
    assert counts(floor.run)[0] == 0
    floor.tick()
    assert counts(floor.run) == (1, 2 * DEADLOCK_TICKS, DEADLOCK_TICKS, 1)
    floor.tick(36)
    assert counts(floor.run) == (1, 200, 100, 1)
    assert longest_deadlock(floor.run).cell == (1, 0), "of the robot with the lower identity"


def test_it_begins_when_the_last_of_its_robots_comes_to_wait() -> None:
    floor = SmallRun("A..B", {"A": "EEE", "B": "WWW"}, waits=LONG_WAITS).tick(80)
    assert counts(floor.run)[0] == 1
    assert counts(floor.run)[3] == 2, "they meet in the second tick"


def test_it_ends_when_one_of_its_robots_moves_and_the_next_one_counts_anew() -> None:
    floor = SmallRun(".AB.", {"A": "E", "B": "W"}, waits=(1, 1, 1, 1, 255)).tick(100)
    assert counts(floor.run) == (1, 200, 100, 1)
    floor.send("B", "E")
    floor.tick(10)
    found, robot_ticks, longest, _ = counts(floor.run)
    assert (found, int(floor.world.deadlocks.count.robots)) == (1, 0)
    assert 200 <= robot_ticks <= 204 and 100 <= longest <= 102
    floor.send("B", "W")
    floor.send("A", "E")
    floor.tick(DEADLOCK_TICKS + 10)
    assert counts(floor.run)[0] == 2


def test_a_robot_that_waits_for_the_cycle_is_none_of_it() -> None:
    floor = SmallRun("CAB", {"A": "E", "B": "W", "C": "E"}, waits=LONG_WAITS).tick(80)
    assert counts(floor.run) == (1, 160, 80, 1)
    assert floor.world.deadlocks.number[floor.index("C")] == 0


def test_robots_behind_an_idle_one_are_no_deadlock() -> None:
    floor = SmallRun("ABC", {"A": "E", "B": "E"}, waits=LONG_WAITS).tick(200)
    assert counts(floor.run)[0] == 0


def test_two_of_them_are_counted_alike_however_robots_are_stored() -> None:
    told = set()
    for storage in permutations(range(4)):
        ways = {"A": "E", "B": "W", "C": "E", "D": "W"}
        floor = SmallRun("AB\nCD", ways, storage=storage, waits=LONG_WAITS).tick(90)
        told.add((*counts(floor.run), longest_deadlock(floor.run).cell))
    assert told == {(2, 360, 90, 1, (0, 0))}


def test_a_run_counts_the_same_whether_it_is_observed_or_not() -> None:
    resolved = resolve("tabletop-mini", ["strategy.right_of_way=wait"])
    plain, history = Simulation(resolved), EventHistory()
    observed = Simulation(resolved, on_observe=history)
    plain.run(1000)
    observed.run(1000)
    assert counts(plain) == counts(observed) == (1, 1686, 843, 158)
    events = history.events[history.events[:, 1] == EVENT_DEADLOCK]
    assert events[:, 0].tolist() == [158 + DEADLOCK_TICKS - 1]


@pytest.mark.parametrize("seed", range(12))
def test_on_floors_that_nobody_drew_storage_and_observation_change_nothing(seed: int) -> None:
    resolved = whole(seed)
    n, history = resolved.scenario.fleet.robots, EventHistory()
    plain = Simulation(resolved)
    stored = np.random.default_rng(seed).permutation(n).astype(np.int32)
    observed = Simulation(resolved, storage=stored, on_observe=history)
    for run in (plain, observed):
        run.run(400)
    assert counts(plain) == counts(observed)
    events = int((history.events[:, 1] == EVENT_DEADLOCK).sum())
    assert events == counts(plain)[0] or history.log.dropped


def whole(seed: int) -> Resolved:
    """A drawn scenario with everything on that `check` accepts."""
    for attempt in range(50):
        with suppress(InputError, msgspec.ValidationError):
            return resolved_whole(drawn_whole(100 * seed + attempt))
    raise AssertionError("no scenario could be drawn")


def test_a_deadlock_that_ended_before_the_warm_up_is_no_standstill_after_it() -> None:
    """One that goes on counts from its first tick."""
    settings = [
        "strategy.right_of_way=wait",
        "measure.warm_up=1000",
        "stop={when: never, max_duration: 3000}",
    ]
    still = Simulation(resolve("tabletop-mini", settings))
    assert metrics_of(still, run_marked(still).warm_up)["longest_standstill"] > 2000
    ended = Simulation(resolve("tabletop-mini", settings[1:]))
    ended.world.deadlocks.count.longest = 500
    assert "longest_standstill" not in metrics_of(ended, run_marked(ended).warm_up)
