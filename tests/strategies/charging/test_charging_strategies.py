"""Charging strategies in the world: when a robot is sent to a charger, to which, and for how long."""

from __future__ import annotations

from typing import Any

import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.state import (
    ACTION_CHARGE,
    BATTERY_FULL,
    BATTERY_PERCENT,
    FAILURE_DEPLETED,
    GOAL_CHARGE,
    GOAL_PICK,
    NIL,
)
from automaton.runs.headless import run_once
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.strategy.lookup import NO_STRATEGY, load, names
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve

# The charger is at the left end, stations in the middle and at the right end.
ROAD = "c~~~~t~~~~t"
TRIP = {"from": [5, 0], "to": [10, 0]}


def road(
    charging: Any, *orders: dict[str, Any], has: float = 100.0, reserve: float = 0
) -> Simulation:
    """A run of one robot from (3, 0) on the road: a move takes 2 %, a tick at the charger gives 5 %."""
    rules = {"drain": {"move": 2.0}, "charge_rate": 5.0, "initial_charge": has, "reserve": reserve}
    strategy = {"allocation": "auction", "charging": charging, "right_of_way": "wait"}
    resolved = scene(
        ROAD, [(3, 0)], orders={"list": list(orders or (TRIP,))}, battery=rules, strategy=strategy
    )
    run, recorder = recorded_run(resolved)
    assert validate_stored(recorder.recording()).valid
    return run


def stays(run: Simulation, robot: int = 0) -> int:
    return int(run.world.tally.operations[robot, ACTION_CHARGE, 0])


def charged(run: Simulation, robot: int = 0) -> float:
    return float(run.world.tally.charged[robot]) / BATTERY_PERCENT


def test_insertion_charges_as_much_as_the_list_needs() -> None:
    """From (3, 0): 3 cells to the charger, 10 to the end with the pick on the way, 10 back: 46 %."""
    run = road("insertion", has=20.0)
    assert run.finished and stays(run) == 1
    # It arrives with 14 %, and 10 cells there and 10 back take 40 %: 26 % are missing, 6 ticks.
    assert charged(run) == 30
    assert run.world.robots.charge[0] / BATTERY_PERCENT == 14 + 30 - 20


def test_without_never_strand_it_does_not_keep_the_way_back() -> None:
    run = road({"name": "insertion", "never_strand": False}, has=10.0)
    assert run.finished and charged(run) == 20, "4 %, and the 20 % of the way there"


def test_a_reserve_is_never_touched() -> None:
    run = road("insertion", has=30.0, reserve=10.0)
    assert run.finished
    assert run.world.robots.charge[0] / BATTERY_PERCENT >= 10 + 20, (
        "and the way back to the charger"
    )


def test_a_robot_that_can_do_its_list_does_not_charge() -> None:
    run = road("insertion", has=60.0)
    assert run.finished and stays(run) == 0


def test_fill_up_charges_up_to_its_target() -> None:
    for target in (100, 80):
        run = road({"name": "fill-up", "target": target}, has=20.0)
        assert run.finished and stays(run) == 1
        assert run.world.robots.charge[0] / BATTERY_PERCENT == pytest.approx(target + 0 - 20, abs=5)


def test_the_threshold_charges_full_before_a_leg_that_would_end_below_it() -> None:
    """20 % at the start: after the task it would have 6 %."""
    for mode in ("threshold-only", "keep-charger-reachable"):
        run = road({"name": "threshold", "mode": mode}, has=20.0)
        assert run.finished and stays(run) == 1
        assert run.world.robots.charge[0] == BATTERY_FULL - 20 * BATTERY_PERCENT
    run = road({"name": "threshold", "threshold": 0, "mode": "threshold-only"}, has=20.0)
    assert run.finished and stays(run) == 0


def test_safe_also_charges_where_no_charger_could_be_reached_afterwards() -> None:
    """With 35 % it ends at (10, 0) with 21 %, above 20 %; the way back takes 20 %. With 33 % not."""
    runs = {
        (mode, start): stays(
            road(
                {"name": "threshold", "mode": mode, "threshold": 15},
                has=start,
            )
        )
        for mode in ("threshold-only", "keep-charger-reachable")
        for start in (35.0, 33.0)
    }
    assert runs == {
        ("threshold-only", 35.0): 0,
        ("keep-charger-reachable", 35.0): 0,
        ("threshold-only", 33.0): 0,
        ("keep-charger-reachable", 33.0): 1,
    }


def test_a_robot_that_took_an_order_gives_it_back_to_charge_first() -> None:
    rules = {"drain": {"move": 2.0}, "charge_rate": 5.0, "initial_charge": 20.0}
    strategy = {"allocation": "first-come", "charging": "insertion", "right_of_way": "wait"}
    resolved = scene(ROAD, [(3, 0)], orders={"list": [TRIP]}, battery=rules, strategy=strategy)
    run = Simulation(resolved)
    run.run(until=1)
    robots = run.world.robots
    assert robots.goal_type[0] == GOAL_CHARGE and robots.order[0] == NIL
    assert run.world.orders.reserved_by[0] == NIL, "others may have it meanwhile"
    run.run()
    assert run.finished and stays(run) == 1


def test_an_idle_robot_charges_before_it_cannot_reach_a_charger_any_more() -> None:
    """Where waiting takes energy, a robot that parks far away goes to charge in time."""
    rules = {"drain": {"move": 2.0, "wait": 0.1}, "charge_rate": 5.0}
    strategy = {"allocation": "auction", "charging": "insertion", "right_of_way": "wait"}
    resolved = scene(
        ROAD,
        [(10, 0)],
        orders={"list": [TRIP | {"release": 4000}]},
        battery=rules,
        strategy=strategy,
        stop={"when": "delivered", "max_duration": 6000},
    )
    run = Simulation(resolved)
    run.run()
    assert run.finished and run.world.tally.failures[0, FAILURE_DEPLETED] == 0
    assert stays(run) >= 4
    with_none = Simulation(
        scene(
            ROAD, [(10, 0)], orders={"list": [TRIP | {"release": 4000}]}, battery=rules,
            strategy={**strategy, "charging": "none"}, faults={"tow_after": None},
            stop={"when": "delivered", "max_duration": 6000},
        )
    )  # fmt: skip
    with_none.run()
    assert with_none.world.tally.failures[0, FAILURE_DEPLETED] == 1


def test_opportunity_charges_when_there_is_nothing_to_do_and_is_called_away() -> None:
    later = TRIP | {"release": 8}
    runs = {name: road(name, later, has=70.0) for name in ("opportunity", "insertion")}
    assert stays(runs["insertion"]) == 0
    run = runs["opportunity"]
    assert stays(run) == 1
    assert run.world.orders.dispatched[0] == 8, "it leaves at once for an order that it can do"
    assert 0 < charged(run) < 30, "before it is full"


def test_opportunity_stays_for_an_order_that_it_cannot_finish() -> None:
    run = road("opportunity", TRIP | {"release": 6}, has=20.0)
    assert run.finished and stays(run) >= 1
    assert run.world.tally.failures[0, FAILURE_DEPLETED] == 0


TWO = """
c~~~~t~~~~c
~~~~~t~~~~~
"""


def two_chargers(charging: Any) -> list[tuple[int, int]]:
    """A, at the left charger, gives its order back to charge; B, which takes it, must, too."""
    rules = {"drain": {"move": 2.0}, "charge_rate": 1.0, "initial_charge": 12.0}
    strategy = {"allocation": "first-come", "charging": charging, "right_of_way": "wait"}
    order = {"from": [5, 0], "to": [5, 1]}
    resolved = scene(
        TWO, [(1, 0), (4, 0)], orders={"list": [order]}, battery=rules, strategy=strategy
    )
    run = Simulation(resolved)
    run.run(until=3)
    assert (run.world.robots.goal_type == GOAL_CHARGE).all()
    return [resolved.floor_plan.xy(int(stand)) for stand in run.world.robots.goal_cell]


def test_of_two_chargers_a_robot_takes_the_shorter_line() -> None:
    assert two_chargers({"name": "insertion", "count_queues": False}) == [(0, 0), (0, 0)]
    assert two_chargers("insertion") == [(0, 0), (10, 0)]


@pytest.mark.parametrize(
    "charging",
    [
        "insertion",
        "{name: insertion, mode: joint}",
        "fill-up",
        "{name: fill-up, target: 80}",
        "opportunity",
    ],
)
@pytest.mark.parametrize("scenario", ["depots", "depots-full", "depots-line"])
def test_no_robot_runs_empty_and_every_order_is_delivered(scenario: str, charging: str) -> None:
    for seed in (1, 2):
        settings = [f"strategy.charging={charging}", "orders.count=60"]
        run, recorder = recorded_run(resolve(scenario, settings), seed=seed)
        figures = metrics_of(run)
        assert run.finished and figures["delivered"] == 60
        assert (figures["battery_depletions"], figures["illegal_answers"]) == (0, 0)
        assert validate_stored(recorder.recording()).valid


def test_an_empty_list_needs_no_charger() -> None:
    """With a robot on its way to pick up, the goal stays; only those that must go are sent."""
    run = Simulation(resolve("depots", ["orders.count=10"]), seed=1)
    run.run(until=1)
    assert (run.world.robots.goal_type == GOAL_PICK).any()
    assert (run.world.robots.goal_type != GOAL_CHARGE).all(), "all batteries are full"


def test_who_charges_for_long_or_stands_in_line_does_not_just_wait() -> None:
    """Said where a run does not finish: it took 1,000 ticks at a charger for a wait."""
    resolved = scene(
        "c~~~~t~~~~t",
        [(1, 0), (2, 0)],
        orders={"list": [TRIP]},
        battery={"drain": {"move": 1.0}, "charge_rate": 0.01, "initial_charge": 10.0},
        strategy={"allocation": "first-come", "charging": "threshold", "right_of_way": "wait"},
        stop={"when": "delivered", "max_duration": 2500},
    )
    outcome = run_once(resolved)
    assert outcome.metrics["lost_charger_queue"] > 1000, "one charges, the other is next"
    assert not outcome.finished and "only waited" not in outcome.diagnosis


@pytest.mark.parametrize("name", sorted({*names("charging")} - {NO_STRATEGY}))
def test_they_are_asked_within_the_compiled_loop(name: str) -> None:
    assert load("charging", name).compiled is not None
