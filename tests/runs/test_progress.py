"""Robots that get nothing done, and where they stand."""

from __future__ import annotations

from small_runs import SmallRun

from automaton.engine.state import GOAL_PICK, ORDER_WAITING
from automaton.runs.progress import largest_jam, oldest_order, starved_robots


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
    assert largest_jam(run.world, run.floor_plan) == ((0, 1), (1, 0), (2, 0))


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
    assert oldest_order(run.world) == 0
