"""`detour_share`: how much longer the ways are that streets choose than the shortest ones."""

from __future__ import annotations

from typing import Any

import pytest

import automaton
from automaton.floor.floor_plan import SOUTH
from automaton.runs.metrics import counted, metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.unavailable_metrics import not_measured
from automaton.world.resolve import resolve

Data = dict[str, Any]
TWO_ROWS = ".....\n....."
AWAY = [{"row": 0, "east": 9, "west": 9}]  # robots drive along the row below


def scenario(streets: Any, **changes: Any) -> Data:
    return {
        "name": "detours",
        "layout": {"picture": TWO_ROWS},
        "fleet": {"robots": 1, "start": [[0, 0]], "kinematics": "omni"},
        "orders": {"tasks": [[[4, 0]]]},
        "strategy": {"right_of_way": "pibt"},
        "stop": {"when": "delivered", "max_duration": 500},
        "streets": streets,
        **changes,
    }


def share(data: Data) -> float | None:
    value = automaton.simulate(data).metrics.get("detour_share")
    return None if value is None else float(value)


def test_a_detour_of_two_moves_over_four_is_half() -> None:
    assert share(scenario(AWAY)) == pytest.approx((6 - 4) / 4)


def test_turns_and_slow_types_count_with_their_ticks() -> None:
    """Facing south: a turn and 4 moves along row 0, or 6 moves and two turns over the row below."""
    differential = {"robots": 1, "start": [[0, 0]], "kinematics": "differential"}
    data = scenario(AWAY, fleet=differential, durations={"move": 3, "turn": 2})
    assert Simulation(resolve(data)).world.robots.heading.tolist() == [SOUTH]
    assert share(data) == pytest.approx((6 * 3 + 2 * 2) / (4 * 3 + 2) - 1)
    types = [
        {"name": "fast", "robots": 1},
        {"name": "slow", "robots": 1, "move_time_factor": 2},
    ]
    data["fleet"] = {
        "robots": 2,
        "types": types,
        "start": [[0, 0], [0, 1]],
        "kinematics": "differential",
    }
    data["orders"] = {"tasks": [[[4, 0]], [[4, 1]]]}
    slow = 4 * 6 + 2
    assert share(data) == pytest.approx((6 * 3 + 2 * 2 + slow) / (4 * 3 + 2 + slow) - 1)


@pytest.mark.parametrize("streets", [{"preset": "crisscross", "along": 1}, AWAY[:0]])
def test_weights_that_are_all_1_make_no_detour(streets: Any) -> None:
    assert share(scenario(streets)) == 0


def test_a_leg_with_a_load_counts_too() -> None:
    """2 moves from [2, 1] to the shelf's cell and 4 to that of the destination, or over the row below."""
    streets = [{"row": 1, "east": 9, "west": 9}]
    data = scenario(streets, layout={"picture": "s###d\n.....\n....."})
    data["fleet"]["start"] = [[2, 1]]
    data["orders"] = {"list": [{"from": [0, 0], "to": [4, 0]}]}
    data["world"] = {"access_cell": "fixed"}
    assert share(data) == pytest.approx((4 + 6) / (2 + 4) - 1)


def test_a_run_without_streets_has_no_such_metric() -> None:
    data = scenario(None)
    assert share(data) is None
    assert not_measured(resolve(data).scenario)["detour_share"] == "streets"
    assert "detour_share" not in not_measured(resolve(scenario(AWAY)).scenario)


def test_the_share_of_a_stretch_counts_the_orders_that_were_done_in_it() -> None:
    """3 moves instead of 1 to the first cell, then 5 instead of 3 to the second."""
    orders = {"tasks": [[[1, 0]], [[4, 0]]]}
    run = Simulation(resolve(scenario(AWAY, orders=orders)))
    run.run(until=4)
    since = counted(run)
    assert metrics_of(run)["detour_share"] == pytest.approx(3 / 1 - 1)
    run.run()
    assert metrics_of(run)["detour_share"] == pytest.approx((3 + 5) / (1 + 3) - 1)
    assert metrics_of(run, since)["detour_share"] == pytest.approx(5 / 3 - 1)
