"""Metrics and pictures of runs with orders that have no load."""

from __future__ import annotations

from typing import Any

import pytest
from drawn_scenes import scene

from automaton.errors import InputError
from automaton.runs.metrics import metrics_of
from automaton.runs.pictures import picture_of, world_from
from automaton.runs.simulation import Simulation
from automaton.world.resolved import Resolved

FLOOR = "......\n.##.#.\n......"
TOURS = {"generator": "tours", "count": 12, "stops": {"from": 1, "to": 3}}
STOP = {"when": "never", "max_duration": 200}


def resolved(start: list[tuple[int, int]], orders: Any = TOURS, **parts: Any) -> Resolved:
    strategy = {"allocation": "first-come", "right_of_way": "retreat"}
    return scene(FLOOR, start, orders=orders, strategy=strategy, **parts)


def test_a_robot_alone_loses_no_time() -> None:
    run = Simulation(resolved([(0, 0)], measure={"warm_up": 0}, stop=STOP))
    run.run()
    metrics = metrics_of(run)
    assert metrics["delivered"] == 12 and metrics["legs_per_order"] == 1
    assert metrics["delay"] == metrics["delay_p95"] == 0
    assert metrics["empty_moves_share"] == 1


def test_a_task_takes_the_ticks_from_its_order_to_its_last_stop() -> None:
    listed = {"list": [{"stops": [(3, 0), (3, 0), (3, 2)]}]}
    run = Simulation(resolved([(0, 0)], listed, measure={"warm_up": 0}, stop=STOP))
    run.run()
    assert metrics_of(run)["task_time"] == 3 + 1 + 2


def test_lead_times_count_from_the_release_in_a_closed_loop() -> None:
    orders = {**TOURS, "arrivals": {"closed_loop": {"in_system": 2}}}
    run = Simulation(resolved([(0, 0)], orders))
    run.run()
    lead = run.world.orders.delivered - run.world.orders.release_tick
    assert metrics_of(run)["lead_time"] == pytest.approx(lead.mean())


@pytest.mark.parametrize("tick", [1, 7, 19, 40])
def test_a_picture_can_be_run_on(tick: int) -> None:
    scenario = resolved([(0, 0), (5, 2)])
    run = Simulation(scenario)
    run.run(until=tick)
    again = world_from(picture_of(run), scenario)
    assert again.digest == run.digest
    for one in (run, again):
        one.run(until=tick + 20)
    assert again.world.stops.done.tolist() == run.world.stops.done.tolist()


def test_a_picture_says_what_is_done() -> None:
    listed = {"list": [{"stops": [(3, 0), (0, 0)]}]}
    run = Simulation(resolved([(0, 0)], listed))
    run.run(until=4)
    lines = picture_of(run).split("\n")
    assert lines[-2].startswith("A (2, 0), westbound, does a stop of 0 at (0, 0), drove")
    assert lines[-1] == "order 0 under way; stops in ticks 3"
    with pytest.raises(InputError, match="has 3 stops of order 0, which has 2"):
        world_from(picture_of(run).replace("ticks 3", "ticks 1 2 3"), run.resolved)
