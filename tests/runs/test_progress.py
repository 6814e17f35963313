"""Robots that get nothing done, and where they stand."""

from __future__ import annotations

import numpy as np
import pytest
from pod_scenes import pod_scene
from small_runs import SmallRun

from automaton.engine.state import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    GOAL_PICK,
    ORDER_WAITING,
)
from automaton.floor.drawn_floors import draw_floor
from automaton.runs.progress import (
    _groups,
    largest_jam,
    oldest_order,
    place_words,
    slow_places,
    starved_robots,
    starved_ticks,
)
from automaton.runs.run_diagnosis import JamWatch
from automaton.runs.simulation import Simulation


def head_on(ticks):
    """A and B meet head-on in an aisle and wait for ever; C has nothing to do."""
    run = SmallRun("A...B\n#####\nC....", {"A": "EEEE", "B": "WWWW"})
    for name in "AB":
        run.world.robots.goal_type[run.index(name)] = GOAL_PICK
    return run.tick(ticks)


def test_robots_that_finish_nothing_are_a_jam_where_they_stand():
    run = head_on(520)
    stalled = run.world.robots.identity[starved_robots(run.world)]
    assert sorted(stalled.tolist()) == [0, 1]
    assert largest_jam(run.world, run.floor_plan) == ((0, 1), (1, 0), (2, 0), 500)


def queue_of_pods(*, closed_after=10_000):
    """Four robots and a station that works 1,400 ticks on each pod, until its cell is walled up."""
    lines = [{"pod": pod, "station": "P1"} for pod in range(1, 5)]
    run = Simulation(
        pod_scene(
            lines,
            fleet={"robots": 4, "kinematics": "omni", "start": [[k, 1] for k in range(2, 6)]},
            durations={"pick": 3, "drop": 3, "handling": {"line": 1400}},
        )
    )
    found = []
    watch = JamWatch(lambda tick, jam: found.append((tick, len(jam.robots))))
    watch.run(run, closed_after, run.run)
    return run, found, watch


def test_a_queue_before_a_station_that_serves_is_no_jam():
    run, found, _ = queue_of_pods()
    assert run.finished and run.tick > 4 * 1400 and found == []


def test_the_queue_of_a_station_that_no_longer_serves_is_a_jam():
    run, found, watch = queue_of_pods(closed_after=2_000)
    assert found == [] and len(starved_robots(run.world)) == 0
    run.world.robots.busy[:] = 30_000  # nothing moves or ends any more
    run.world.robots.action[:] = 0
    watch.run(run, 4_000, run.run)
    assert [robots for _, robots in found] == [3]


@pytest.mark.parametrize(
    ("columns", "rows", "move", "handling", "ticks"),
    [
        (5, 3, 1, 0, 500),
        (100, 30, 1, 0, 520),  # 4 x 130
        (100, 30, 3, 0, 1560),  # at three ticks for a move
        (100, 30, 1, 10, 600),  # a pick and a drop more
    ],
)
def test_on_a_large_floor_robots_may_take_longer(columns, rows, move, handling, ticks):
    run = SmallRun("\n".join(["A" + "." * (columns - 1), *["." * columns] * (rows - 1)]))
    run.world.rules.duration[:, ACTION_MOVE] = move
    run.world.rules.duration[:, [ACTION_PICK, ACTION_DROP]] = handling
    assert starved_ticks(run.world) == ticks
    run.world.robots.goal_type[0] = GOAL_PICK
    for now, starved in ((ticks - 1, 0), (ticks, 1)):
        run.world.clock.tick = now
        assert len(starved_robots(run.world)) == starved


def test_before_that_there_is_none():
    run = head_on(499)
    assert not len(starved_robots(run.world))
    assert largest_jam(run.world, run.floor_plan) is None


def test_the_oldest_order_is_that_released_first_of_those_open():
    run = SmallRun("A.$\n..d")
    assert oldest_order(run.tick(7).world) == 7
    run.world.orders.release_tick[:] = 3
    assert oldest_order(run.world) == 4
    assert (run.world.orders.state == ORDER_WAITING).all()
    run.world.orders.state[:] = 2
    run.world.orders.delivered[:] = 5
    assert oldest_order(run.world) == 0


@pytest.mark.parametrize(
    ("picture", "groups"),
    [
        ("A.B..C\n......\n....D.", ["ABCD"]),  # C is near D, which is near B, which is near A
        ("A.....\n......\n...B..", ["A", "B"]),
        ("A....B\n......\n..C..D\n......\nE.....", ["ACE", "BD"]),
    ],
)
def test_robots_within_two_rows_and_columns_are_one_group_and_so_are_theirs(picture, groups):
    rows = picture.split("\n")
    places = {
        name: (y, x) for y, row in enumerate(rows) for x, name in enumerate(row) if name != "."
    }
    names = sorted(places)
    group = _groups(*(np.array([places[name][k] for name in names]) for k in (0, 1)))
    members: dict[int, str] = {}
    for name, number in zip(names, group.tolist(), strict=True):
        members[number] = members.get(number, "") + name
    assert list(members.values()) == groups


def test_places_that_cost_most_time_are_named_by_what_is_near() -> None:
    plan = draw_floor("........\n" + ".s.ss.s.\n" * 4 + "...tc...")
    lost = np.zeros(plan.kind.size, np.int32)
    for x, y, ticks in ((2, 1, 50), (2, 0, 10), (7, 3, 30), (3, 5, 6), (3, 4, 4)):
        lost[plan.cell(x, y)] = ticks
    worst = slow_places(lost, plan, {plan.cell(3, 5): "station 1"})
    assert [(one.place, one.ticks, one.share) for one in worst] == [
        ("mouth of aisle 2, (2, 1)", 60, 0.6),
        ("aisle 4, (7, 3)", 30, 0.3),
        ("station 1, (3, 5)", 10, 0.1),
    ]
    assert slow_places(np.zeros_like(lost), plan, {}) == ()


def test_the_nearest_of_many_named_places_counts_and_both_of_equally_near_ones() -> None:
    plan = draw_floor("\n".join(["." * 12] * 9))
    places = {(2, 2): "station 1", (6, 2): "station 2", (6, 8): "charger 1"}
    names = tuple((plan.cell(*at), name) for at, name in places.items())
    at = {(2, 2): "station 1, (2, 2)", (4, 2): "before station 1 and station 2, (4, 2)"}
    at |= {(5, 2): "before station 2, (5, 2)", (6, 6): "before charger 1, (6, 6)"}
    assert {xy: place_words(plan.cell(*xy), plan, names) for xy in at} == at
    assert "before" not in place_words(plan.cell(10, 4), plan, names)
