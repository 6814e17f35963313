"""Stations that work on parts: one at a time, first come first served, and what follows from it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.record_codes import CHANGE_DROPPED
from automaton.engine.state import NIL, ORDER_DELIVERED, ORDER_UNRELEASED, ORDER_WAITING
from automaton.errors import InputError
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored

LANE = "t..t..t"  # stations 1, 2, 3
STRATEGY = {"allocation": "shortest-job", "right_of_way": "wait"}


def line(parts: list[dict[str, Any]], work: Any = 1, **more: Any) -> Any:
    orders = {"parts": parts, "processing_time": work}
    more.setdefault("strategy", STRATEGY)
    more.setdefault("durations", {"pick": 2, "drop": 2})
    return scene(LANE, [(1, 0)], orders=orders, **more)


def test_each_way_of_a_part_is_an_order_that_is_known_when_the_work_before_it_is_done() -> None:
    run = Simulation(line([{"route": [1, 2, 3]}], work=[10, 20, 5]))
    orders, stations = run.world.orders, run.world.stations
    assert len(orders.state) == 2 and set(orders.state) == {ORDER_UNRELEASED}
    run.run(until=10)
    assert set(orders.state) == {ORDER_UNRELEASED} and stations.in_service.tolist() == [0, NIL, NIL]
    run.run(until=11)  # it came in tick 1, and 10 ticks of work are over
    assert (
        orders.state.tolist() == [ORDER_WAITING, ORDER_UNRELEASED] and orders.release_tick[0] == 11
    )
    run.run()
    assert run.finished and set(orders.state) == {ORDER_DELIVERED}
    # The work at a station begins when the robot has dropped the part, 2 ticks after its delivery.
    begins = orders.delivered + 2
    assert stations.arrival_tick[1:].tolist() == begins.tolist()
    assert (
        stations.completion_tick[1:].tolist()
        == [begins[0] + 20, begins[1] + 5]
        == [
            orders.release_tick[1],
            run.tick,
        ]
    )


def test_a_station_works_on_one_part_at_a_time_in_the_sequence_of_their_coming() -> None:
    parts = [
        {"route": [2], "count": 2},
        {"route": [2], "first_release": 4},
        {"route": [2], "first_release": 2},
    ]
    run = Simulation(line(parts, work=10))
    run.run()
    assert run.world.stations.completion_tick.tolist() == [
        11,
        21,
        41,
        31,
    ]  # the last one came before
    assert run.finished and run.tick == 41


@pytest.mark.parametrize("storage", [[0, 1], [1, 0]])
def test_of_parts_that_come_in_one_tick_the_lowest_number_is_first(storage: list[int]) -> None:
    """However the robots are stored that set them down."""
    parts = [{"route": [3, 2]}, {"route": [1, 2]}]
    resolved = scene(
        "u==u==u",
        [(0, 0), (6, 0)],
        ["layout.legend={u: {kind: station, capacity: 2}}"],
        orders={"parts": parts, "processing_time": 10},
        durations={"pick": 2, "drop": 2},
        strategy=STRATEGY,
    )
    run = Simulation(resolved, storage=np.array(storage, np.int32))
    run.run()
    arrival_tick, completion_tick = (
        run.world.stations.arrival_tick,
        run.world.stations.completion_tick,
    )
    assert arrival_tick[1] == arrival_tick[3], "they come together"
    assert completion_tick[1] == arrival_tick[1] + 10 and completion_tick[3] == arrival_tick[1] + 20


def test_a_run_ends_when_the_last_work_is_done() -> None:
    run = Simulation(line([{"route": [1, 3]}], work=[1, 1, 500]))
    run.run(until=400)
    assert set(run.world.orders.state) == {ORDER_DELIVERED} and not run.finished
    run.run()
    assert run.finished and run.tick == int(run.world.stations.completion_tick.max())


def test_parts_may_pass_the_same_station_twice() -> None:
    run = Simulation(line([{"route": [1, 2, 1, 2, 3], "count": 3}], work=7))
    run.run()
    assert run.finished and run.world.stations.completion_tick.min() > 0


def test_picks_and_drops_take_up_to_so_many_ticks_more() -> None:
    durations = {"pick": 3, "drop": 3, "handling_jitter": 5}
    run, recorder = recorded_run(line([{"route": [1, 2, 3], "count": 20}], durations=durations))
    ticks = run.world.tally.ticks[0].sum(axis=1)
    times = run.world.tally.operations[0].sum(axis=1)
    for action in (3, 4):
        mean = ticks[action] / times[action]
        assert 4.5 < mean < 6.5, "3 and 0 to 5 more"
    assert validate_stored(recorder.recording()).valid


def test_every_allocation_serves_stations() -> None:
    parts = [{"route": [1, 2, 3], "count": 4}, {"route": [3, 1], "count": 3}]
    for allocation in ("independent", "first-come", "auction", "shortest-job"):
        strategy = {"allocation": allocation, "right_of_way": "wait"}
        run, recorder = recorded_run(line(parts, work=9, strategy=strategy))
        assert run.finished, allocation
        report = validate_stored(recorder.recording())
        assert report.valid, f"{allocation}: {report.violations[:3]}"


def test_shortest_job_first_and_old_ones_before_new_ones() -> None:
    """Algorithm 2: 0.5 age - 10 (drive to it and with it), highest first."""
    first_of_all, far, near = (
        {"route": [3, 1]},
        {"route": [3, 2]},
        {"route": [1, 2], "first_release": 12},
    )

    def first(age: float) -> int:
        allocation = {"name": "shortest-job", "age": age, "job": 10.0}
        strategy = {"allocation": allocation, "right_of_way": "wait"}
        run = Simulation(line([first_of_all, far, near], strategy=strategy))
        while run.world.orders.delivered[0] == NIL:
            run.run(until=run.tick + 1)
        run.run(until=run.tick + 3)  # set down at station 1, where the near one waits
        return int(run.world.robots.order[0])

    assert first(age=0.5) == 2, "0 + 3 cells against 6 + 3"
    assert first(age=10.0) == 1, "it is 10 ticks older"


# What a validator finds


def spoiled(change: Any) -> set[str]:
    """The rules that a recording breaks after `change(header, first rows of changes)`."""
    _, recorder = recorded_run(line([{"route": [1, 2, 3], "count": 2}], work=5))
    recording = recorder.recording()
    frame = next(frame for frame in recording.frames if frame.kind == FRAME_KIND_TICKS)
    change(recording.header, frame.content["changes"])
    return {violation.rule for violation in validate_stored(recording).violations}


def test_an_order_taken_before_the_work_is_done_is_found() -> None:
    def slower(header: Any, rows: Any) -> None:
        header["scenario"]["orders"]["processing_time"] = 30

    assert "order" in spoiled(slower)


def test_orders_that_are_not_the_ways_of_the_parts_are_found() -> None:
    def elsewhere(header: Any, rows: Any) -> None:
        header["scenario"]["orders"]["parts"][0]["route"] = [2, 1, 3]

    assert "part" in spoiled(elsewhere)


def test_a_part_that_ends_elsewhere_is_found() -> None:
    def dropped(header: Any, rows: Any) -> None:
        row = next(row for row in rows if row[1] == CHANGE_DROPPED)
        row[3] = 0 if row[3] else 1

    assert spoiled(dropped)


# Bad input


@pytest.mark.parametrize(
    ("orders", "sentence"),
    [
        (
            {"parts": [{"route": [1, 4]}]},
            "a part goes to station 4, but the floor has the stations",
        ),
        ({"parts": [{"route": [1, 1]}]}, "from one station to another"),
        ({"parts": []}, "at least one type of parts"),
        ({"parts": [{"route": []}]}, "route"),
        ({"parts": [{"route": [1, 2]}], "processing_time": [1, 2]}, "lists 2 stations"),
        (
            {"generator": "stations", "count": 2, "processing_time": 3},
            "processing_time belongs to parts",
        ),
        ({"parts": [{"route": [1]}], "generator": "stations", "count": 2}, "either"),
    ],
)
def test_bad_parts_get_one_sentence(orders: Any, sentence: str) -> None:
    with pytest.raises((InputError, ValueError), match=sentence):
        scene(LANE, [(1, 0)], orders=orders, strategy=STRATEGY)


def test_delay_needs_picks_and_drops_that_take_time() -> None:
    with pytest.raises((InputError, ValueError), match="handling_jitter"):
        line([{"route": [1, 2]}], durations={"pick": 0, "handling_jitter": 2})


def test_lead_times_count_from_the_end_of_the_work() -> None:
    run = Simulation(line([{"route": [1, 2]}], work=50))
    run.run()
    orders = run.world.orders
    assert metrics_of(run)["lead_time"] == orders.delivered[0] - orders.release_tick[0] < 20
