"""The stops of orders without a load, and how many orders a list of tasks becomes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.state import NIL, ORDER_DELIVERED, ORDER_WAITING
from automaton.runs.headless import orders_exhausted
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify_recording
from automaton.world import task_lists
from automaton.world.resolve import branched
from automaton.world.task_lists import _moves as moves
from automaton.world.task_lists import order_count

FLOOR = ".....\n.#.#.\n.....#.\n.....#."
GREEDY = {"allocation": "greedy", "right_of_way": "retreat"}


def stops_of(run: Simulation) -> list[list[tuple[int, int]]]:
    """The stops of each order, as (x, y)."""
    first, cell = run.world.orders.first_stop, run.world.stops.cell
    xy = run.resolved.floor_plan.xy
    return [[xy(int(c)) for c in cell[first[k] : first[k + 1]]] for k in range(len(first) - 1)]


def built(orders: Any, start: Sequence[tuple[int, int]] = ((0, 0),), **parts: Any) -> Simulation:
    return Simulation(scene(FLOOR, start, orders=orders, strategy=GREEDY, **parts), seed=4)


def test_tours_are_drawn_from_the_cells_that_robots_reach() -> None:
    run = built({"generator": "tours", "count": 4000, "stops": {"from": 1, "to": 3}})
    found = stops_of(run)
    used = [cell for stops in found for cell in stops]
    reached = np.flatnonzero(run.world.slots.reachable[0]).tolist()
    assert {run.resolved.floor_plan.xy(cell) for cell in reached} == set(used)
    assert (6, 2) not in used, "nobody gets there"
    counts = np.bincount([len(stops) for stops in found])
    assert counts[0] == 0 and abs(counts[1:] - 4000 / 3).max() < 4 * np.sqrt(4000 * 2 / 9)
    share = np.unique(used, axis=0, return_counts=True)[1] / len(used)
    assert abs(share - 1 / len(reached)).max() < 0.02
    assert all(a != b for stops in found for a, b in itertools.pairwise(stops))


def test_a_tour_depends_on_the_seed_and_its_number_alone() -> None:
    few = stops_of(built({"generator": "tours", "count": 5, "stops": {"from": 1, "to": 3}}))
    many = stops_of(built({"generator": "tours", "count": 50, "stops": {"from": 1, "to": 3}}))
    assert many[:5] == few


SHELVES = "t....t\n..rr..\n......\n..#..."
ALTERNATELY = {
    "generator": "tours",
    "count": 400,
    "assign": "round-robin",
    "cells": ["stations", "racks"],
}


def test_the_tours_of_a_robot_depend_on_the_seed_and_the_robot_alone() -> None:
    """Further robots and other numbers of orders do not change them."""
    orders = {"generator": "tours", "count": 400, "assign": "round-robin"}
    two = stops_of(built(orders, [(0, 0), (4, 0)]))
    three = stops_of(built({**orders, "count": 60}, [(0, 0), (4, 0), (2, 2)]))
    assert [two[0::2][:20], two[1::2][:20]] == [three[0::3], three[1::3]]
    assert any(a == b for a, b in itertools.pairwise(two[0::2])), "the present cell may be next"
    share = np.unique(np.concatenate(two), axis=0, return_counts=True)[1] / 400
    assert len(share) == 18 and abs(share - 1 / 18).max() < 0.05


def test_two_groups_of_cells_alternate() -> None:
    """A robot that starts at a station first visits a cell above or below a rack."""
    start, stations = [(1, 0), (5, 0)], {(0, 0), (5, 0)}
    run = Simulation(scene(SHELVES, start, orders=ALTERNATELY, strategy=GREEDY), seed=4)
    found = [stops[0] for stops in stops_of(run)]
    assert set(found[0::4]) | set(found[3::4]) == stations
    assert set(found[2::4]) | set(found[1::4]) == {(2, 0), (3, 0), (2, 2), (3, 2)}


def test_dead_ends_can_be_left_out() -> None:
    orders = {"generator": "tours", "count": 300, "cells": "no-dead-ends"}
    run = Simulation(scene("..#.\n....\n##.#", [(2, 2)], orders=orders, strategy=GREEDY), seed=4)
    found = {cell for stops in stops_of(run) for cell in stops}
    assert found == {(0, 0), (1, 0), (0, 1), (1, 1)}


@pytest.mark.parametrize("kinematics", ["omni", "differential"])
def test_a_robot_gets_its_next_tour_once_it_has_done_the_one_before(kinematics: str) -> None:
    start = [(1, 0), (5, 0), (4, 2)]
    resolved = scene(
        SHELVES,
        start,
        [f"fleet.kinematics={kinematics}"],
        orders=ALTERNATELY | {"count": 60},
        strategy={"allocation": "greedy", "right_of_way": {"name": "pibt", "ties": "fixed"}},
    )
    run, recorder = recorded_run(resolved)
    assert run.finished and verify_recording(recorder.recording()).passed
    released = run.world.orders.release_tick.reshape(-1, 3)
    assert (np.diff(released, axis=0) > 0).all()


def test_an_order_has_a_load_or_stops() -> None:
    floor = "......\ns..d.."
    listed = {"list": [{"from": [0, 1], "to": [3, 1]}, {"stops": [[5, 0], [0, 0]], "release": 3}]}
    resolved = scene(floor, [(2, 0), (4, 0)], orders=listed, strategy=GREEDY)
    run, recorder = recorded_run(resolved)
    orders = run.world.orders
    assert (orders.source == NIL).tolist() == (orders.target == NIL).tolist() == [False, True]
    assert orders.first_stop.tolist() == [0, 0, 2]
    assert run.finished and verify_recording(recorder.recording()).passed


TASKS = [[[0, 0], [4, 0]], [[2, 1]], [[4, 2], [0, 2], [2, 2]]]


def test_task_k_is_line_k_modulo_the_lines() -> None:
    orders = {"tasks": TASKS, "repeat": True, "revealed": 2.5}
    run = built(orders, stop={"when": "never", "max_duration": 100})
    found = stops_of(run)
    assert len(found) > 9
    for k, stops in enumerate(found):
        assert stops == [tuple(cell) for cell in TASKS[k % 3]]


def test_so_many_tasks_are_open_at_once_in_the_sequence_of_the_list() -> None:
    orders = {"tasks": TASKS, "repeat": True, "revealed": 1.5}
    start = [(0, 0), (4, 0), (4, 3)]
    run = built(orders, start, stop={"when": "never", "max_duration": 120})
    for tick in range(1, 121):
        done = int(np.count_nonzero(run.world.orders.state == ORDER_DELIVERED))
        run.run(until=tick)
        known = run.world.orders.release_tick <= tick
        assert known.tolist() == [True] * (4 + done) + [False] * (len(known) - 4 - done)
    assert done > 15


@pytest.mark.parametrize("assign", ["pool", "round-robin"])
@pytest.mark.parametrize("tasks", [TASKS, [[[0, 0]], [[1, 0]]], [[[0, 0]]]])
def test_a_list_that_repeats_is_never_used_up(assign: str, tasks: Any) -> None:
    orders = {"tasks": tasks, "repeat": True, "assign": assign}
    orders |= {"revealed": 2.0} if assign == "pool" else {"skip_reached": len(tasks) > 1}
    start = [(0, 0), (4, 0), (4, 3)]
    parts = {"picture": FLOOR.replace(".", "~")}
    resolved = scene(
        parts["picture"],
        start,
        orders=orders,
        strategy=GREEDY,
        stop={"when": "never", "max_duration": 200},
    )
    run, recorder = recorded_run(resolved)
    state = run.world.orders.state
    assert np.count_nonzero(state == ORDER_DELIVERED) > 20
    assert (state[-3:] != ORDER_DELIVERED).all() and len(state) == order_count(
        resolved.scenario, resolved.floor_plan
    )
    assert verify_recording(recorder.recording()).passed


@pytest.mark.parametrize("setting", ["stop.max_duration=200", "durations.move=3"])
def test_a_branch_keeps_the_orders_of_a_list_that_repeats(setting: str) -> None:
    orders = {"tasks": TASKS, "repeat": True, "revealed": 2.5}
    run = built(orders, stop={"when": "never", "max_duration": 100})
    run.run(until=20)
    before = run.world.orders.delivered.copy()
    other = branched(run.resolved, (setting,))
    assert order_count(other.scenario, other.floor_plan) != len(before)
    branch = run.continue_with(other)
    assert branch.world.orders.delivered.tolist() == before.tolist()
    branch.run(until=60)
    assert (branch.world.orders.delivered >= 0).sum() > (before >= 0).sum() > 0


def test_a_long_run_has_a_bounded_pool_of_tasks_and_says_when_it_is_used_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(task_lists, "MAX_TASK_ORDERS", 15)
    orders = {"tasks": TASKS, "repeat": True, "revealed": 2.0}
    start, stop = [(0, 0), (4, 0), (4, 3)], {"when": "never", "max_duration": 400}
    resolved = scene(FLOOR, start, orders=orders, strategy=GREEDY, stop=stop)
    run, recorder = recorded_run(resolved)
    assert run.world.orders.state.tolist() == 15 * [ORDER_DELIVERED]
    exhausted = orders_exhausted(run)
    assert exhausted is not None and exhausted.delivered == run.world.orders.delivered.max() < 400
    assert verify_recording(recorder.recording()).passed


@pytest.mark.parametrize("skip_reached", [False, True])
def test_rounds_that_are_alike_are_not_counted_one_by_one(
    skip_reached: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From one end of the row to the other takes 4 ticks each time, the first task none at best."""
    orders = {"tasks": [[[0, 0]], [[4, 0]]], "repeat": True, "assign": "round-robin"}
    orders["skip_reached"] = skip_reached
    stop = {"when": "never", "max_duration": 8_000_000}
    long = scene(FLOOR, [(0, 0)], orders=orders, strategy=GREEDY, stop=stop)
    looked = []
    monkeypatch.setattr(task_lists, "_moves", lambda *some: looked.append(1) or moves(*some))
    assert abs(order_count(long.scenario, long.floor_plan) - 2_000_000) < 4
    assert len(looked) < 30


def test_dealt_out_each_robot_does_its_own_tasks_one_after_another() -> None:
    orders = {"tasks": [*TASKS[:2], [[1, 2]], [[3, 2]]], "repeat": True, "assign": "round-robin"}
    start = [(0, 0), (4, 3), (4, 0)]
    run = built(orders, start, stop={"when": "never", "max_duration": 150})
    found = stops_of(run)
    for tick in range(1, 151):
        run.run(until=tick)
        state, mine = run.world.orders.state, run.world.robots.order
        for robot in range(3):
            assert mine[robot] in (NIL, *range(robot, len(found), 3))
            done = state[robot::3] == ORDER_DELIVERED
            assert done.tolist() == sorted(done.tolist(), reverse=True)
            assert np.count_nonzero(state[robot::3] == ORDER_WAITING) <= 1
    assert np.count_nonzero(run.world.orders.state == ORDER_DELIVERED) > 15


def test_a_robot_passes_over_a_task_in_whose_first_cell_it_stands() -> None:
    """Tasks of A: (0, 0), where it begins, then (2, 1), then (0, 0) again, then (2, 1)."""
    orders = {"tasks": [[[0, 0]], [[2, 1]], [[2, 1]]], "repeat": True, "assign": "round-robin"}
    stop = {"when": "never", "max_duration": 30}
    plain = built(orders, stop=stop)
    skips = built({**orders, "skip_reached": True}, stop=stop)
    for run in (plain, skips):
        run.run(until=30)
    assert plain.world.orders.delivered[:6].tolist() == [1, 4, 5, 8, 11, 12]
    assert skips.world.orders.delivered[:7].tolist() == [NIL, 3, NIL, 6, 9, NIL, 12]
