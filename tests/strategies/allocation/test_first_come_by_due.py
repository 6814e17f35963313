"""first-come with `by: due`: of the orders of the highest priority, the one that is due first."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from drawn_scenes import recorded_run, scene
from hypothesis import given, settings
from hypothesis import strategies as st

from automaton.engine.state import LAYER_ALLOCATION, NEVER, NIL, ORDER_WAITING
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify_recording
from automaton.world.resolved import Resolved
from strategies.allocation.first_come import DueQueue, drop_first, enter_order

CORRIDOR = "t.......t"
BY_DUE = {"name": "first-come", "by": "due"}


def corridor(lines: list[dict[str, Any]], robots: int = 1, **parts: Any) -> Resolved:
    return scene(
        CORRIDOR,
        [(2 * robot, 0) for robot in range(robots)],
        orders={"list": lines},
        strategy={"allocation": BY_DUE, "right_of_way": "wait"},
        **parts,
    )


def stop(x: int = 3, **more: Any) -> dict[str, Any]:
    return {"stops": [[x, 0]], **more}


def sequence(run: Simulation) -> list[int]:
    delivered = run.world.orders.delivered.tolist()
    assert run.finished
    return sorted(range(len(delivered)), key=delivered.__getitem__)


def test_what_is_due_first_comes_first() -> None:
    """No due time last; ties by release, then by number; a higher priority before all."""
    lines = [
        *(stop(), stop(due=60), stop(release=1, due=29), stop(due=30), stop(due={"at": 30})),
        *(stop(priority=1, due=900), stop(due={"at": -5})),
    ]
    run = Simulation(corridor(lines))
    run.run()
    assert run.world.orders.due.tolist() == [NEVER, 60, 30, 30, 30, 900, -5]
    assert sequence(run) == [5, 6, 3, 4, 2, 1, 0]


def test_an_order_that_comes_later_and_is_due_earlier_overtakes_those_that_wait() -> None:
    run = Simulation(corridor([stop(8, due=80), stop(due=90), stop(release=3, due=20)]))
    run.run()
    assert sequence(run) == [0, 2, 1], "the order that the robot has is not taken from it"


def test_an_order_that_comes_back_keeps_its_place() -> None:
    """Robot 0 breaks down with the order that is due second; robot 1 does what is due first."""
    faults = {"list": [{"robot": 0, "at": 2}], "tow_after": 1, "repair_time": None}
    lines = [stop(8, due=50), stop(6, due=60), stop(due=70), stop(due=40, release=4)]
    run, recorder = recorded_run(corridor(lines, robots=2, faults=faults))
    assert sequence(run) == [1, 3, 0, 2]
    found = verify_recording(recorder.recording())
    assert found.report.violations == [] and found.difference is None


def key(world: Any, order: int) -> tuple[int, ...]:
    orders = world.orders
    due, release = int(orders.due[order]), int(orders.release_tick[order])
    return -int(orders.priority[order]), due, release, order


ORDERS = st.lists(
    st.builds(
        stop,
        x=st.integers(1, 7),
        release=st.integers(0, 30),
        priority=st.integers(-1, 1),
        due=st.none() | st.integers(0, 40) | st.builds(lambda at: {"at": at}, st.integers(-9, 50)),
    ),
    min_size=6,
    max_size=24,
)


@settings(max_examples=40, deadline=None)
@given(
    ORDERS,
    st.integers(1, 3),
    st.lists(st.integers(1, 60), max_size=3, unique=True),
    st.sampled_from(["everything", "orders", {"radius": 2}]),
)
def test_robots_take_what_a_sort_puts_first(
    lines: list[dict[str, Any]], robots: int, broken: list[int], information: Any
) -> None:
    """In each tick what was taken comes, sorted, before all that is still open; orders come back."""
    faults = [{"robot": number % robots, "at": at} for number, at in enumerate(sorted(broken))]
    more = {"faults": {"list": faults, "tow_after": 1, "repair_time": 2}} if faults else {}
    run = Simulation(corridor(lines, robots, information=information, **more))
    orders = run.world.orders
    while not run.finished and run.tick < 600:
        run.run(until=run.tick + 1)
        taken = np.flatnonzero((orders.dispatched == run.tick) & (orders.reserved_by != NIL))
        is_open = (orders.state == ORDER_WAITING) & (orders.reserved_by == NIL)
        known = [*taken.tolist(), *np.flatnonzero(is_open).tolist()]
        first = sorted(known, key=lambda order: key(run.world, order))[: len(taken)]
        assert sorted(first) == taken.tolist()
    assert (orders.dispatched != NIL).any()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 19), st.integers(1, 50)), max_size=60))
def test_an_order_that_is_entered_again_comes_forward(changes: list[tuple[int, int]]) -> None:
    """Orders become due earlier while they are in the queue; in between the first is taken out."""
    world = Simulation(corridor([stop(due=900)] * 20)).world
    queue = DueQueue.sized({"K": 1, "q": 20})
    inside: set[int] = set()
    for order, earlier in changes:
        world.orders.due[order] -= earlier
        enter_order(world, queue, order)
        inside.add(order)
        if earlier % 3 == 0:
            first = min(inside, key=lambda one: key(world, one))
            assert queue.order[0, 0] == first
            drop_first(world, queue, 0)
            inside.remove(first)
    assert queue.size[0] == len(inside)
    assert sorted(queue.order[0, : len(inside)].tolist()) == sorted(inside)
    assert np.flatnonzero(queue.place[0]).tolist() == sorted(inside)


def test_each_order_is_looked_at_a_few_times_however_many_wait() -> None:
    """Two types of robots, of which one can do half of the orders."""
    load = {"from": (0, 0), "to": (8, 0)}
    lines = [load | {"weight": 1 + k % 2, "due": 900 - k} for k in range(30)]
    types = [{"name": f"up-to-{most}", "robots": 1, "payload": most} for most in (1, 2)]
    fleet = {"robots": 2, "kinematics": "omni", "start": [(3, 0), (6, 0)], "types": types}
    run = Simulation(corridor(lines, fleet=fleet))
    run.run(until=200)
    queue = run._states[LAYER_ALLOCATION].queue
    assert queue.size[0] > 0 and queue.looked <= 4 * len(lines)


def test_what_there_is_to_go_by_is_named() -> None:
    with pytest.raises(InputError, match=r"by.*'dew'"):
        scene(
            CORRIDOR,
            [(0, 0)],
            orders={"list": [stop()]},
            strategy={"allocation": {"name": "first-come", "by": "dew"}},
        )
