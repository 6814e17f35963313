"""How orders come: in bursts, in a closed loop, from shelves; parts one after another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.state import ORDER_DELIVERED, ORDER_UNRELEASED
from automaton.history.watched_run import ReplayedRun
from automaton.recording.recorder import Recorder
from automaton.runs.pictures import picture_of, world_from
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.verification.verification import verify
from automaton.world.draws import geometric
from automaton.world.resolve import resolve

LANE = "t...t..t"
STRATEGY = {"allocation": "first-come", "right_of_way": "wait"}
STREAMS = (
    "mean_interarrival_time: 30",
    "arrivals: {bursts: {size: 4, every: 90}}",
    "arrivals: {bursts: {size: {mean: 3}, every: {mean: 60}}}",
    "arrivals: {closed_loop: {in_system: 3}}",
)
FLOORS = (  # a scenario of each generator
    ("depots", "generator: stations, count: 20"),
    ("depots", "generator: visits, count: 20"),
    ("warehouse-100-trial", "generator: dock-to-rack, count: 20"),
    ("tabletop-mini", "generator: full-shelves"),
)


def released(*settings: str, seed: int = 3) -> Any:
    return Simulation(resolve("depots", settings), seed).world.orders.release_tick


def bursts(size: str, every: str, count: int = 2000) -> str:
    arrivals = f"{{bursts: {{size: {size}, every: {every}}}}}"
    return f"orders={{generator: stations, count: {count}, arrivals: {arrivals}}}"


def test_bursts_come_together_and_evenly() -> None:
    ticks = released(bursts("4", "90", 10))
    assert ticks.tolist() == [0] * 4 + [90] * 4 + [180] * 2


def test_drawn_bursts_have_their_means() -> None:
    ticks = released(bursts("{mean: 5}", "{mean: 40}", 20_000), "stop.max_duration=2000000")
    starts, sizes = np.unique(ticks, return_counts=True)
    gaps = np.diff(starts)
    assert abs(sizes.mean() - 5) < 4 * np.sqrt(20 / len(sizes)) and sizes.min() == 1
    assert abs(gaps.mean() - 40) < 4 * np.sqrt(1560 / len(gaps)) and gaps.min() == 1


def test_a_burst_depends_on_the_seed_and_its_number_alone() -> None:
    few, many = (released(bursts("{mean: 5}", "{mean: 40}", count)) for count in (200, 900))
    assert many[:200].tolist() == few.tolist()
    fleet = ("fleet.robots=2", "fleet.start=[[2, 0], [6, 0]]", "strategy.allocation=first-come")
    assert released(bursts("{mean: 5}", "{mean: 40}", 200), *fleet).tolist() == few.tolist()
    assert released(bursts("{mean: 5}", "{mean: 40}", 200), seed=4).tolist() != few.tolist()


def test_memoryless_numbers_have_their_distribution_to_the_tail() -> None:
    found = geometric(20.0, 5, 8, np.arange(200_000), 9)
    assert found.min() == 1 and abs(found.mean() - 20) < 4 * np.sqrt(380 / 200_000)
    for k in (1, 2, 7, 20, 64, 100):  # P(X > k) = 0.95^k
        share, expected = (found > k).mean(), 0.95**k
        assert abs(share - expected) < 4 * np.sqrt(expected * (1 - expected) / 200_000), k
    assert geometric(1.0, 5, 8, np.arange(9), 9).tolist() == [1] * 9


def test_a_closed_loop_keeps_so_many_orders_open_until_they_are_used_up() -> None:
    orders = {"generator": "stations", "count": 40, "arrivals": {"closed_loop": {"in_system": 3}}}
    resolved = scene(LANE, [(2, 0)], orders=orders, strategy=STRATEGY)
    run = Simulation(resolved)
    known = 3
    for _ in range(1500):
        done_before = int((run.world.orders.state == ORDER_DELIVERED).sum())
        run.run(until=run.tick + 1)
        state = run.world.orders.state
        known = int((state != ORDER_UNRELEASED).sum())
        assert known == min(40, 3 + done_before), "one for each that had been delivered before"
    assert known == 40 and run.finished
    order = run.world.orders
    assert np.sort(order.delivered)[:37].tolist() == (np.sort(order.release_tick)[3:] - 1).tolist()


def test_of_a_closed_loop_the_sequence_is_fixed_and_the_ticks_are_not() -> None:
    orders = {"generator": "stations", "count": 30, "arrivals": {"closed_loop": {"in_system": 4}}}
    runs = []
    for durations in ({"pick": 2}, {"pick": 9}):
        resolved = scene(LANE, [(2, 0)], orders=orders, strategy=STRATEGY, durations=durations)
        run, recorder = recorded_run(resolved)
        assert validate_stored(recorder.recording()).valid and run.finished
        runs.append(run.world.orders)
    one, other = runs
    assert one.release_sequence.tolist() == other.release_sequence.tolist()
    assert one.source.tolist() == other.source.tolist()
    assert one.target.tolist() == other.target.tolist()
    assert one.release_tick.tolist() != other.release_tick.tolist()


def test_the_validator_knows_when_an_order_of_a_closed_loop_may_be_taken() -> None:
    orders = {"generator": "visits", "count": 20, "arrivals": {"closed_loop": {"in_system": 2}}}
    _, recorder = recorded_run(scene(LANE, [(2, 0), (6, 0)], orders=orders, strategy=STRATEGY))
    recording = recorder.recording()
    assert validate_stored(recording).valid
    recording.header["scenario"]["orders"]["arrivals"]["closed_loop"]["in_system"] = 1
    found = validate_stored(recording).violations
    assert any("is assigned although it is not free" in one.text for one in found)


def test_shelves_are_not_emptied_one_row_after_the_other() -> None:
    settings = "orders={generator: full-shelves, arrivals: {bursts: {size: 1, every: 10}}}"
    orders = Simulation(resolve("tabletop-1", (settings,))).world.orders
    assert sorted(orders.release_tick.tolist()) == list(range(0, 500, 10))
    assert orders.release_tick.tolist() != sorted(orders.release_tick.tolist())
    assert sorted(orders.release_sequence.tolist()) == list(range(50))


@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize(("floor", "orders"), FLOORS, ids=[orders for _, orders in FLOORS])
def test_every_floor_has_every_stream(floor: str, orders: str, stream: str, tmp_path: Path) -> None:
    settings = (f"orders={{{orders}, {stream}}}", "stop.max_duration=900")
    resolved = resolve(floor, settings, seed=4)
    path = tmp_path / "run.rec"
    with Recorder(path, resolved, 4) as recorder:
        run = Simulation(resolved, on_record=recorder)
        run.run()
        recorder.end()
    found = verify(path)
    assert found.passed, found.report.violations[:3] or found.difference
    assert (run.world.orders.state == ORDER_DELIVERED).any()
    again = ReplayedRun(found.recording)
    again.show(run.tick, 9)
    assert again.shown.digest == run.digest


@pytest.mark.parametrize("stream", STREAMS)
def test_a_picture_restores_what_is_not_known_yet(stream: str) -> None:
    orders = f"orders={{generator: stations, count: 40, {stream}}}"
    resolved = scene(
        LANE, [(2, 0)], [orders], orders={"generator": "visits", "count": 1}, strategy=STRATEGY
    )
    run = Simulation(resolved)
    for tick in (1, 20, 33, 34, 35, 200):
        run.run(until=tick)
        again = world_from(picture_of(run), resolved)
        assert again.digest == run.digest, tick
        again.run(until=tick + 60)
        straight = Simulation(resolved)
        straight.run(until=tick + 60)
        assert again.digest == straight.digest, tick


def test_parts_come_one_after_another() -> None:
    parts = [
        {"route": [1], "count": 3, "first_release": 5, "interarrival_time": 20},
        {"route": [1], "count": 2},
    ]
    run = Simulation(
        scene(LANE, [(2, 0)], orders={"parts": parts, "processing_time": 4}, strategy=STRATEGY)
    )
    assert run.world.stations.arrival_tick.tolist() == [5, 25, 45, 0, 0]
    run.run()
    assert run.world.stations.completion_tick.tolist() == [13, 29, 49, 5, 9]


def test_drawn_work_and_arrivals_verify(tmp_path: Path) -> None:
    parts = [{"route": [1, 2, 3], "count": 12, "interarrival_time": {"mean": 30}}]
    work = [{"mean": 20}, 7, {"mean": 5}]
    resolved = scene(
        LANE, [(2, 0)], orders={"parts": parts, "processing_time": work}, strategy=STRATEGY
    )
    path = tmp_path / "run.rec"
    with Recorder(path, resolved, 1) as recorder:
        run = Simulation(resolved, 1, on_record=recorder)
        run.run()
        recorder.end()
    ticks = run.world.stations.processing_time.reshape(12, 3)
    assert len(set(ticks[:, 0])) > 5 and set(ticks[:, 1]) == {7}
    found = verify(path)
    assert run.finished and found.passed, found.report.violations[:3] or found.difference


# One station as a queue


def queue(load: float, mean: float, count: int) -> Any:
    parts = [{"route": [1], "count": count, "interarrival_time": {"mean": mean / load}}]
    orders = {"parts": parts, "processing_time": {"mean": mean}}
    stop = {"when": "delivered", "max_duration": 2_000_000_000}
    return scene("t..", [(1, 0)], orders=orders, strategy=STRATEGY, stop=stop)


def delays(resolved: Any, seed: int) -> tuple[Any, Any, Any]:
    """Ticks that parts stood in the line; when they came; how long the work took."""
    run = Simulation(resolved, seed)
    run.run()
    stations = run.world.stations
    assert run.finished
    return (
        stations.completion_tick - stations.processing_time - stations.arrival_tick,
        stations.arrival_tick,
        stations.processing_time,
    )


def test_a_station_is_the_queue_of_lindley() -> None:
    """The next part waits what this one waited and worked, less the time between them."""
    delay, came, ticks = delays(queue(0.8, 20.0, 3000), 1)
    wait, expected = 0, []
    for between, work in zip(np.diff(came).tolist(), ticks.tolist(), strict=False):
        expected.append(wait)
        wait = max(0, wait + work - between)
    # A part of tick 0 comes in tick 1, the first one.
    assert np.abs(delay[:-1] - expected).max() <= 1


def test_the_mean_delay_is_that_of_an_m_m_1_queue() -> None:
    """load / (1 - load) mean works: 4 at a load of 0.8; 6 seeds of 20,000 parts.

    The standard error of a mean over n parts is sqrt(1976 / n) works (Whitt 1989), here 0.13.
    """
    resolved = queue(0.8, 50.0, 20_000)
    found = [delays(resolved, seed)[0].mean() / 50.0 for seed in range(6)]
    assert abs(np.mean(found) - 4.0) < 3 * np.sqrt(1976 / 120_000)
    assert len(set(found)) == 6
