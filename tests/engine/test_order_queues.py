"""Lists of orders that robots are to do: announced in the world, checked, recorded, drawn."""

from __future__ import annotations

import re

import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.state import LAYER_ALLOCATION
from automaton.runs.pictures import picture_of
from automaton.runs.simulation import Simulation
from automaton.strategy.api import CMD_PARK, NIL, ORDER_WAITING, Strategy
from automaton.verification.validator import validate_stored
from automaton.verification.verification import verify_recording
from automaton.world.resolve import resolve

LANE = "t....t"


def test_an_auction_announces_its_lists() -> None:
    orders = {"list": [{"from": [0, 0], "to": [5, 0]}, {"from": [5, 0], "to": [0, 0]}] * 2}
    resolved = scene(LANE, [(0, 0)], orders=orders, strategy={"allocation": "auction"})
    run = Simulation(resolved)
    run.run(until=1)
    robots = run.world.robots
    assert (
        robots.order_queue_length[0] == 3
        and robots.order[0] not in robots.order_queue[0, :3].tolist()
    )
    assert sorted([int(robots.order[0]), *robots.order_queue[0, :3].tolist()]) == [0, 1, 2, 3]
    assert re.search(r"^A .*; plan \d \d \d$", picture_of(run), re.MULTILINE)
    run.run()
    assert run.finished and robots.order_queue_length[0] == 0


def test_nobody_s_list_holds_what_another_does() -> None:
    run = Simulation(resolve("depots-full", ["orders.count=40"]), seed=2)
    while not run.finished:
        run.run(until=run.tick + 37)
        robots, orders = run.world.robots, run.world.orders
        lists = [robots.order_queue[i, : robots.order_queue_length[i]].tolist() for i in range(4)]
        listed = [order for plan in lists for order in plan]
        assert len(set(listed)) == len(listed)
        assert all(
            orders.state[order] == ORDER_WAITING and orders.reserved_by[order] == NIL
            for order in listed
        )


class Announcing(Strategy):
    """Parks; once, it announces a list."""

    layer = "allocation"
    plan: tuple[int, ...] = ()
    length = 0

    def decide(self, view, batch, decisions, memory, workspace):
        out = decisions.allocation
        for k in range(batch.count):
            out.command[k] = CMD_PARK
        if memory is not None and view.clock.tick == 1:
            out.order_queue[0, : len(self.plan)] = self.plan
            out.order_queue_length[0] = self.length


@pytest.mark.parametrize(
    ("plan", "length", "illegal"),
    [
        ((0, 1), 2, 0),
        ((), 0, 0),
        ((7,), 1, 1),  # there is no such order
        ((-1,), 1, 1),
        ((2,), 1, 1),  # it is not known yet
        ((), 10_000, 1),  # longer than a list may be
        ((), -3, 1),
    ],
)
def test_a_list_with_an_order_that_nobody_may_take_is_illegal(plan, length, illegal) -> None:
    there = {"from": [0, 0], "to": [5, 0]}
    orders = {"list": [there, there, there | {"release": 50}]}
    resolved = scene(
        LANE, [(1, 0)], orders=orders, stop={"when": "never", "max_duration": 3},
        strategy={"allocation": "auction", "right_of_way": "wait"},
    )  # fmt: skip
    strategy = Announcing()
    strategy.plan, strategy.length = plan, length
    run = Simulation(resolved, strategies=[None, None, strategy, None, None])
    run.run()
    assert run.world.tally.illegal[LAYER_ALLOCATION] == illegal
    assert run.world.robots.order_queue_length[0] == (0 if illegal else length)
    if not illegal:
        assert run.world.robots.order_queue[0, : len(plan)].tolist() == list(plan)


def test_lists_are_replayed_and_verified_from_a_recording() -> None:
    resolved = resolve("depots", ["orders.count=40"])
    run, recorder = recorded_run(resolved, seed=4)
    recording = recorder.recording()
    assert run.finished
    assert validate_stored(recording).valid
    found = verify_recording(recording)
    assert found.passed and found.difference is None


def test_another_list_is_another_digest() -> None:
    run = Simulation(resolve("depots-full"), seed=2)
    run.run(until=50)
    before = run.digest
    robots = run.world.robots
    assert robots.order_queue_length[0] >= 2
    robots.order_queue[0, [0, 1]] = robots.order_queue[0, [1, 0]]
    assert run.digest != before
