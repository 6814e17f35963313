"""Breakpoints: what can be asked, what is told about mistakes, and where a run is stopped."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from small_runs import SmallRun

from automaton.engine.observation import (
    CAUSE_NO_ORDER,
    CAUSE_NOT_WAITING,
    CAUSE_REDUCED_SPEED,
    CAUSE_UNDECIDED,
    CAUSES,
    DEADLOCK_TICKS,
    EVENT_DEADLOCK,
    EVENT_DELIVERED,
    EVENT_WAIT_CYCLE,
)
from automaton.engine.state import ACTION_NAMES, BATTERY_PERCENT, NIL
from automaton.errors import InputError
from automaton.history.breakpoints import (
    FIELDS,
    WAIT_CAUSE_CODES,
    breakpoint_of,
    robots_where,
)
from automaton.history.live_run import LiveRun
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.world.resolve import resolve

ENERGY = ("battery", "charging", "queueing", "empty", "broken", "towed", "ahead")


@pytest.fixture(scope="module")
def run() -> LiveRun:
    run = LiveRun(resolve("tabletop-1", ["fleet.robots=5"]), 3)
    run.show(700, 99)
    return run


def holding(run: LiveRun, text: str) -> list[int]:
    return sorted(breakpoint_of(text).test(run.shown, run.floor_plan).tolist())


@pytest.fixture(scope="module")
def living() -> LiveRun:
    """Robots on batteries that fail, with orders ahead of them; robot 3 has hardly any energy."""
    faults = "faults={failure_probability: 0.0003, tow_after: 60, repair_time: 100}"
    battery = ["battery.initial_charge=[40, 40, 40, 5]", "battery.drain.wait=0.02"]
    run = LiveRun(resolve("depots", [*battery, faults]), 1)
    run.show(700, 99)
    return run


def reader(snapshot: Snapshot, run: LiveRun) -> Callable[[str, int], int]:
    return lambda field, robot: expected(field, snapshot, run, robot)


def expected(field: str, snapshot: Snapshot, run: LiveRun, robot: int) -> int:
    """The value of a field, read off a snapshot."""
    fleet = snapshot.robots
    cell = fleet.bay[robot] if fleet.cell[robot] == NIL else fleet.cell[robot]
    waits = fleet.cause[robot] not in (CAUSE_NOT_WAITING, CAUSE_NO_ORDER)
    values = {
        "battery": fleet.charge[robot] / BATTERY_PERCENT,
        "charging": int(
            ACTION_NAMES[fleet.action[robot]] == "charge" and fleet.charge_target[robot] > 0
        ),
        "queueing": int(
            fleet.ticket[robot] != 0
            and fleet.goal_cell[robot] not in (fleet.cell[robot], fleet.claim[robot])
        ),
        "empty": int(CAUSES[fleet.cause[robot]].name == "empty battery"),
        "broken": int(CAUSES[fleet.cause[robot]].name == "broken down"),
        "towed": int(fleet.status[robot] in (5, 6)),
        "ahead": int(fleet.order_queue_length[robot]),
        "zone": int(fleet.service_zone[robot]) + 1,  # 0: none
        "robot": robot,
        "x": run.floor_plan.xy(int(cell))[0],
        "y": run.floor_plan.xy(int(cell))[1],
        "loaded": int(fleet.load[robot] != NIL),
        "waiting": snapshot.tick - int(fleet.since[robot]) if waits else 0,
        "slowdown_ticks": int(fleet.lost[robot, CAUSE_REDUCED_SPEED]),
        "steps": int(fleet.route_length[robot]),
    }
    return values[field] if field in values else int(getattr(fleet, field)[robot])


@pytest.mark.parametrize("field", FIELDS)
def test_each_field_is_what_it_says(field: str, run: LiveRun) -> None:
    seen = set()
    for tick in (1, 40, 333, 500, 700):
        run.show(tick, 99)
        snapshot = take_snapshot(run.shown)
        for robot in range(5):
            value = expected(field, snapshot, run, robot)
            seen.add(value)
            same = [r for r in range(5) if expected(field, snapshot, run, r) == value]
            assert holding(run, f"{field} == {value}") == same
            assert robots_where(f"{field} == {value}", snapshot, run.floor_plan).tolist() == same
    never = ("zone", "parked", "priority", "slowdown_ticks", *ENERGY)
    assert len(seen) > 1 or field in never


@pytest.mark.parametrize("field", ENERGY)
def test_batteries_and_faults_are_asked_for(field: str, living: LiveRun) -> None:
    seen = set()
    for tick in range(20, 700, 20):
        living.show(tick, 99)
        snapshot = take_snapshot(living.shown)
        values = [expected(field, snapshot, living, robot) for robot in range(4)]
        for value in values:
            seen.add(value)
            same = [robot for robot in range(4) if values[robot] == value]
            assert holding(living, f"{field} == {value}") == same
            assert robots_where(f"{field} == {value}", snapshot, living.floor_plan).tolist() == same
    assert len(seen) > 1


def test_queueing_is_a_condition(living: LiveRun) -> None:
    living.show(100, 99)
    snapshot = take_snapshot(living.shown)
    waiting = np.flatnonzero(snapshot.robots.ticket).tolist()
    assert waiting
    for text in ("queueing", "  queueing  and battery < 50", "not (not queueing or charging)"):
        assert holding(living, text) == waiting
        assert robots_where(text, snapshot, living.floor_plan).tolist() == waiting
    assert holding(living, "queueing and loaded and battery < 1") == []
    with pytest.raises(InputError, match="'in line' is not a known cause"):
        breakpoint_of("cause == 'in line'")


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("x > 3", lambda f, r: f("x", r) > 3),
        ("3 >= y", lambda f, r: f("y", r) <= 3),
        ("robot != 2", lambda f, r: r != 2),
        ("loaded", lambda f, r: f("loaded", r) == 1),
        ("not loaded and steps > 2", lambda f, r: not f("loaded", r) and f("steps", r) > 2),
        ("x < y or robot == 1", lambda f, r: f("x", r) < f("y", r) or r == 1),
        ("load == -1", lambda f, r: f("load", r) == -1),
        ("-x < -4", lambda f, r: f("x", r) > 4),
        ("-loaded < 0", lambda f, r: f("loaded", r) == 1),
        ("action == 'move'", lambda f, r: ACTION_NAMES[f("action", r)] == "move"),
        ("'no order' != cause", lambda f, r: CAUSES[f("cause", r)].name != "no order"),
        ("  stalled   >   0 ", lambda f, r: f("waiting", r) > 0),
        ("stalled>0", lambda f, r: f("waiting", r) > 0),
        ("busy < 1.5", lambda f, r: f("busy", r) < 1.5),
    ],
)
def test_conditions_are_read_as_in_python(text: str, plain, run: LiveRun) -> None:
    for tick in (40, 333, 700):
        run.show(tick, 99)
        snapshot = take_snapshot(run.shown)
        mine = [r for r in range(5) if plain(reader(snapshot, run), r)]
        assert holding(run, text) == mine == robots_where(text, snapshot, run.floor_plan).tolist()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "is not a condition; valid are, for example, deadlock, delivered 7, stalled > 50"),
        ("x >", "'x >' is not a condition"),
        ("delivered seven", "'delivered seven' is not a condition"),
        ("(" * 5000, "a condition has at most 200 characters; this one has 5,000"),
        ("(" * 150, "is not a condition"),
        ("\0", "is not a condition"),
        ("laoded", "a robot has no 'laoded' (did you mean 'loaded'?); there are robot, x, y"),
        ("waitng > 3", "a robot has no 'waitng' (did you mean 'waiting'?)"),
        ("deadlok", "(did you mean 'deadlock'?)"),
        (
            "cause == 'quue'",
            "'quue' is not a known cause (did you mean 'queue'?); there are none, queue",
        ),
        ("action != 'moove'", "'moove' is not a known action (did you mean 'move'?)"),
        ("x == 'move'", "'move' can only be compared with cause and action"),
        ("x > 3 > y", "is not a condition on a robot; allowed are comparisons of robot"),
        ("x + 1", "is not a condition on a robot"),
        ("x > y + 1", "'y + 1' is neither a number nor one of robot"),
        ("x in y", "is not a condition on a robot"),
        ("__import__('os')", "is not a condition on a robot"),
        ("x.real > 3", "'x.real' is neither a number"),
        ("x > 3j", "'3j' is neither a number"),
        ("7", "'7' is not a condition on a robot"),
    ],
)
def test_mistakes_are_told_in_a_sentence(text: str, told: str) -> None:
    with pytest.raises(InputError) as error:
        breakpoint_of(text)
    assert told in str(error.value) and "\n" not in str(error.value)
    assert len(str(error.value)) < 400


def test_circles_are_caught_when_they_close_and_when_they_last() -> None:
    floor = SmallRun("CAB", {"A": "E", "B": "W", "C": "E"}, waits=(999, 999, 999, 999, 255))
    held = {text: [] for text in ("wait cycle", "deadlock")}
    for _ in range(DEADLOCK_TICKS + 5):
        floor.tick()
        for text, ticks in held.items():
            if len(breakpoint_of(text).test(floor.run, floor.floor_plan)):
                ticks.append(floor.run.tick)
                assert breakpoint_of(text).test(floor.run, floor.floor_plan).tolist() == [0, 1]
    mine = {
        name: [e.tick for e in floor.events() if e.code == code]
        for name, code in (("wait cycle", EVENT_WAIT_CYCLE), ("deadlock", EVENT_DEADLOCK))
    }
    assert held == mine == {"wait cycle": [1], "deadlock": [DEADLOCK_TICKS]}
    assert robots_where("deadlock", floor.snapshot(), floor.floor_plan).tolist() == [0, 1]


def test_deliveries_name_the_robot_that_delivered(run: LiveRun) -> None:
    run.show(700, 99)
    mine = [e for e in run.event_history.events.tolist() if e[1] == EVENT_DELIVERED]
    assert len(mine) > 3
    for tick, _, robot, load, _ in mine:
        run.show(tick, 99)
        assert robot in holding(run, "delivered") and holding(run, f"delivered {load}") == [robot]
        assert holding(run, f"delivered {load + 1000}") == []
        run.show(tick + 1, 99)
        assert robot not in holding(run, "delivered")


def test_each_cause_of_waiting_can_be_asked_for() -> None:
    codes = {cause.name: code for code, cause in enumerate(CAUSES) if code != CAUSE_REDUCED_SPEED}
    assert codes == WAIT_CAUSE_CODES
    floor = SmallRun("ABC", {"A": "E", "B": "E"}).tick()
    causes = floor.run.observation.cause
    for name, code in codes.items():
        causes[:] = [code, CAUSE_UNDECIDED, code]
        held = breakpoint_of(f"cause == '{name}'").test(floor.run, floor.floor_plan)
        assert held.tolist() == [0, 2]
    with pytest.raises(InputError, match="'reduced speed' is not a known cause"):
        breakpoint_of("cause == 'reduced speed'")  # who drives slowly does not wait


def test_how_robots_are_stored_does_not_matter() -> None:
    found = set()
    for storage in ([0, 1, 2], [2, 0, 1]):
        floor = SmallRun("ABC", {"A": "E", "B": "E"}, storage=storage).tick()
        found.add(
            tuple(np.sort(breakpoint_of("cause == 'queue'").test(floor.run, floor.floor_plan)))
        )
    assert found == {(0,)}
