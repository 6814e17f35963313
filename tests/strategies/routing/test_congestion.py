"""The strategy `congestion`: round a queue, with regard to each other, on every shipped floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from slow_zone_scenes import Traffic, is_empty

from automaton.commands import main
from automaton.engine.state import LAYER_ROUTING
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.routing.congestion import Congestion
from strategies.routing.routing_parameters import SharedPlans


def routing(**parameters: float) -> Congestion:
    return Congestion(SharedPlans(**parameters))  # type: ignore[arg-type]


# Straight on, A has 10 moves to the upper right corner, round the south 14.
QUEUE = "A~~~~~~~BC~\n~####~####~\n~~~~~~~~~~~"
CORNER = (10, 0)
STRAIGHT, ROUND = "EEEEEEEEEE", "SSEEEEEEEEEENN"


def test_it_goes_round_a_queue_that_stays() -> None:
    traffic = Traffic(QUEUE, routing=routing()).want(A=CORNER).tick()
    assert traffic.route("A") in ("SEEEEEEEEEENN", "EEEESSEEEEENN"), "after the first move"


def test_it_goes_straight_on_if_the_queue_will_be_gone() -> None:
    traffic = Traffic(QUEUE, routing=routing()).drive(B="EE", C="E").want(A=CORNER).tick()
    assert traffic.route("A") == STRAIGHT[1:]


def test_without_beta_only_the_distance_counts() -> None:
    traffic = Traffic(QUEUE, routing=routing(beta=0)).want(A=CORNER).tick()
    assert traffic.route("A") == STRAIGHT[1:]


@pytest.mark.parametrize(("beta", "ways"), [(0, 1), (2, 2)])
def test_of_two_that_plan_at_once_the_second_sees_the_route_of_the_first(
    beta: float, ways: int
) -> None:
    """Both ways from the upper left corner to the lower right one are as short."""
    ring = "~~~~~\n~###~\n~###~\n~###~\n~~~~~"
    traffic = Traffic(ring, robots=(8, 8), routing=routing(beta=beta))
    assert traffic.floor_plan.xy(8) == (0, 0)
    traffic.want(A=(4, 4), B=(4, 4)).tick()
    assert len({traffic.route("A"), traffic.route("B")}) == ways
    assert len(traffic.route("A")) == len(traffic.route("B")) == 7


@pytest.mark.parametrize(("every", "route"), [(0, STRAIGHT[3:]), (3, "EESSEEEEENN")])
def test_routes_are_made_anew_every_so_many_ticks(every: int, route: str) -> None:
    """B and C come into A's aisle when A is under way."""
    picture = "A~~~~~~~~~~\n~####~####~\n~~~~~~~~~~~\n####B######\n####C######"
    traffic = Traffic(picture, routing=routing(replan_period=every)).want(A=CORNER).tick(2)
    assert traffic.route("A") == STRAIGHT[2:]
    traffic.put("B", (8, 0))
    traffic.put("C", (9, 0))
    assert traffic.tick().route("A") == route


BLOCKED = """
name: blocked
layout:
  picture: |
    sA........B.d
    #.#########.#
    #...........#
fleet: {robots: 2, kinematics: omni}
orders: {list: [{from: [0, 0], to: [12, 0]}]}
strategy:
  routing: {name: congestion, beta: 0, replan_period: EVERY}
  right_of_way: {name: retreat, retreat_moves: [1, 1]}
stop: {when: delivered, max_duration: 150}
"""


@pytest.mark.parametrize("every", [0, 1, 2, 5])
def test_a_detour_is_not_dropped_for_the_way_that_is_blocked(tmp_path: Path, every: int) -> None:
    """B stands there for good; the way round it begins with the whole aisle back."""
    scenario = tmp_path / "blocked.yaml"
    scenario.write_text(BLOCKED.replace("EVERY", str(every)))
    run = Simulation(resolve(scenario))
    run.run()
    assert run.finished and metrics_of(run)["retreats"] == 1


def test_more_plans_than_fit_into_memory_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    settings = ["layout={generator: racks, rows: 1000, columns: 1000}", "fleet.robots=300000"]
    settings.append("strategy.routing=congestion")
    arguments = [part for text in settings for part in ("--set", text)]
    assert main(["run", "warehouse-100", *arguments]) == 2
    errors = capsys.readouterr().err
    assert "with this fleet horizon at most 333" in errors and errors.count("\n") == 1
    fewer = (*settings, "strategy.routing={name: congestion, horizon: 333}")
    assert resolve("warehouse-100", fewer).strategies["routing"].name == "congestion"


SMALL = ("layout.rows=40", "layout.columns=40", "fleet.robots=30", "stop.max_duration=500")


def test_how_robots_are_stored_does_not_matter() -> None:
    resolved = resolve("warehouse-100", (*SMALL, "strategy.routing=congestion"))
    digests = set()
    for storage in (None, np.random.default_rng(1).permutation(30)):
        run = Simulation(resolved, storage=storage)
        run.run(120)
        digests.add(run.digest)
    assert len(digests) == 1


@pytest.mark.parametrize("extra_tick", [0.0, 0.1])
def test_a_fleet_loses_less_time_to_itself(extra_tick: float) -> None:
    delays = {}
    for name in ("astar", "congestion"):
        rules = (
            f"strategy.routing={name}",
            f"world.extra_tick_probability={extra_tick}",
            "measure.warm_up=100",
        )
        runs = [Simulation(resolve("warehouse-100", (*SMALL, *rules, f"seed={k}"))) for k in (1, 2)]
        for run in runs:
            run.run()
            assert run.world.tally.illegal.sum() == 0
        delays[name] = np.array([metrics_of(run)["delay"] for run in runs])
    assert (delays["congestion"] < 0.7 * delays["astar"]).all(), delays


OTHERS = [
    (floor, ways) for floor in ("tabletop-mini", "crossing") for ways in ("differential", "omni")
]


@pytest.mark.parametrize("forecast", ["tasks", "task-averages"])
@pytest.mark.parametrize("scenario", ["tabletop-mini", "crossing"])
def test_who_knows_tasks_alone_finishes_too(scenario: str, forecast: str) -> None:
    finishes(scenario, f"strategy.routing={{name: congestion, forecast: {forecast}}}")


@pytest.mark.parametrize(("scenario", "kinematics"), [("tabletop-mini", "rail"), *OTHERS])
def test_it_finishes_on_other_floors(scenario: str, kinematics: str) -> None:
    """One robot to a cell, turns that take time, aisles that are not rails, bays."""
    finishes(scenario, f"fleet.kinematics={kinematics}")


@pytest.mark.parametrize("scenario", ["tabletop-1", "tabletop-2"])
def test_it_finishes_in_the_large_table_top_warehouses(scenario: str) -> None:
    finishes(scenario)


@pytest.mark.parametrize("information", ["orders", "{radius: 3}"])
def test_it_finishes_when_robots_see_little(information: str) -> None:
    """Who is not seen is not predicted."""
    finishes("tabletop-mini", f"information={information}")


def finishes(scenario: str, *overrides: str) -> None:
    run = Simulation(resolve(scenario, ("strategy.routing=congestion", *overrides)))
    run.run()
    assert run.finished
    assert run.world.tally.illegal[LAYER_ROUTING] == 0
    assert is_empty(run.states[LAYER_ROUTING]), "nothing is left of a forecast"


def test_pods_are_carried_and_no_way_leads_through_storage() -> None:
    run = Simulation(resolve("goods-mini", ["strategy.routing=congestion"]))
    run.run()
    assert (run.finished, run.tick, metrics_of(run)["lines_done"]) == (True, 122, 3)


def test_what_is_predicted_from_tasks_alone_knows_no_trips(
    capsys: pytest.CaptureFixture[str],
) -> None:
    routing = "strategy.routing={name: congestion, forecast: tasks}"
    assert main(["check", "goods-mini", "--set", routing]) == 2
    assert "forecast tasks supports loads, but not pods" in capsys.readouterr().err
