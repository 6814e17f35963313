"""Orders that come in time, visits, and stations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.state import NIL, ORDER_DELIVERED, ORDER_UNRELEASED, ORDER_WAITING
from automaton.runs.pictures import picture_of, world_from
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve

LANE = "t...t"
STRATEGY = {"allocation": "first-come", "right_of_way": "wait"}


def lane(*orders: dict[str, Any]) -> Any:
    return scene(LANE, [(2, 0)], orders={"list": list(orders)}, strategy=STRATEGY)


def test_an_order_is_known_from_its_tick_on() -> None:
    run = Simulation(lane({"from": [0, 0], "to": [4, 0], "release": 5}))
    run.run(until=4)
    assert run.world.orders.state[0] == ORDER_UNRELEASED
    assert run.world.robots.parked[0], "nobody knows of it"
    run.run(until=5)
    assert run.world.orders.state[0] == ORDER_WAITING and run.world.orders.reserved_by[0] == 0
    run.run()
    assert run.finished and run.world.orders.dispatched[0] == 5


def test_orders_become_known_by_their_ticks_whatever_their_sequence_in_the_list() -> None:
    late, early = (
        {"release": 30, "from": [0, 0], "to": [4, 0]},
        {"release": 3, "from": [4, 0], "to": [0, 0]},
    )
    run, recorder = recorded_run(lane(late, early))
    assert run.world.orders.release_sequence.tolist() == [1, 0]
    assert run.world.orders.dispatched.tolist() == [30, 3]
    assert validate_stored(recorder.recording()).valid


def test_a_picture_before_an_order_is_known_restores_the_run() -> None:
    resolved = lane({"from": [0, 0], "to": [4, 0], "release": 9})
    run = Simulation(resolved)
    run.run(until=6)
    again = world_from(picture_of(run), resolved)
    for each in (run, again):
        each.run()
    assert again.finished and again.digest == run.digest


def released(*settings: str, seed: int = 3) -> Any:
    return Simulation(resolve("depots", settings), seed).world.orders.release_tick


def test_with_an_interval_one_order_comes_in_a_tick_at_most_and_the_first_at_once() -> None:
    ticks = released(
        "orders={generator: stations, count: 4000, mean_interarrival_time: 25}",
        "stop.max_duration=200000",
    )
    gaps = np.diff(ticks)
    assert ticks[0] == 0 and gaps.min() == 1
    # Geometric: mean 25, standard deviation 24.5.
    assert abs(gaps.mean() - 25) < 4 * 24.5 / np.sqrt(len(gaps))
    assert abs(gaps.std() - 24.5) < 2


def test_every_tick_has_an_order_if_the_interval_is_one() -> None:
    settings = "orders={generator: stations, count: 50, mean_interarrival_time: 1}"
    assert released(settings).tolist() == list(range(50))


def test_when_orders_come_depends_on_the_seed_alone() -> None:
    """All fleets and strategies face the same demand; more orders begin with the same ones."""
    first = released()
    fleet = ("fleet.robots=2", "fleet.start=[[2, 0], [6, 0]]", "strategy.allocation=first-come")
    assert released(*fleet).tolist() == first.tolist()
    more = released("orders.count=300")
    assert more[: len(first)].tolist() == first.tolist()
    assert released(seed=4).tolist() != first.tolist()


def test_a_visit_is_done_by_being_there() -> None:
    resolved = scene(
        LANE,
        [(2, 0)],
        orders={"list": [{"from": [4, 0], "to": [4, 0]}, {"from": [0, 0], "to": [0, 0]}]},
        strategy=STRATEGY,
        durations={"pick": 3, "drop": 7},
    )
    run, recorder = recorded_run(resolved)
    orders = run.world.orders
    assert (
        run.finished and (orders.state == ORDER_DELIVERED).all() and orders.legs.tolist() == [1, 1]
    )
    # 2 moves, then it is there: done in the tick in which its 3 ticks of work begin; then 4 moves.
    assert orders.delivered.tolist() == [3, 10]
    assert run.world.robots.load[0] == NIL
    assert validate_stored(recorder.recording()).valid


def test_drawn_visits_end_where_they_begin_and_transports_elsewhere() -> None:
    visits = Simulation(resolve("depots", ["orders={generator: visits, count: 500}"])).world.orders
    assert (visits.source == visits.target).all()
    carried = Simulation(resolve("depots")).world.orders
    assert (carried.source != carried.target).all()
    assert len(set(visits.source.tolist())) == 13, "each station is visited"


@pytest.mark.parametrize("tick", [1, 40, 77, 300, 1500])
def test_a_picture_of_stations_chargers_and_lists_restores_everything(tick: int) -> None:
    resolved = resolve("depots")
    run = Simulation(resolved, seed=5)
    run.run(until=tick)
    picture = picture_of(run)
    again = world_from(picture, resolved)
    assert again.digest == run.digest
    assert picture_of(again) == picture
