"""No trip waits behind an idle robot: those in queues of stations and in pockets leave by themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from idle_waits import run_to_end
from pod_scenes import pod_scene

from automaton.engine.state import NIL
from automaton.floor.floor_plan import CHARGER, STATION
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from automaton.world.starts import homes

ROUND = """\
>>>>>>>>>>v
^#pppp#q##v
^#########v
^<<t<<<<<<<"""


def observed(resolved: Any, seed: int | None = None) -> Simulation:
    return Simulation(resolved, seed=seed, on_observe=lambda run: run.empty_observation())


def scene(lines: Any = ({"pod": 1, "station": "P1"},), **parts: Any) -> Any:
    """Robot 1 stands idle in the queue of the station to which robot 0 carries a pod."""
    strategy = {"allocation": {"name": "shortest-job", "idle": "stay"}, "right_of_way": "pibt"}
    given: dict[str, Any] = {
        "picture": ROUND,
        "fleet": {"robots": 2, "kinematics": "differential", "start": [[2, 1], [6, 3]]},
        "stations": {"P1": {"at": [3, 3], "queue": [[4, 3], [7, 3]]}},
        "strategy": strategy | parts.pop("strategy", {}),
        "stop": {"when": "delivered", "max_duration": 600},
    }
    return pod_scene(list(lines), **given | parts)


@pytest.mark.parametrize("name", ["pibt", "epibt"])
@pytest.mark.parametrize("durations", [{}, {"move": 2, "turn": 4}], ids=["quick", "slow"])
def test_a_robot_in_a_queue_leaves_it_for_a_trip(name: str, durations: dict[str, int]) -> None:
    times = {"pick": 3, "drop": 3, "handling": {"line": 20}, **durations}
    run = observed(scene(strategy={"right_of_way": name}, durations=times))
    assert run_to_end(run) == []
    assert run.finished


@pytest.mark.parametrize("name", ["pibt", "epibt"])
def test_idle_robots_that_have_to_turn_first_leave_too(name: str) -> None:
    """Both their turns take longer than any plan of the robot behind them can wait."""
    fleet = {"robots": 3, "kinematics": "differential", "start": [[2, 1], [5, 0], [6, 0]]}
    run = observed(
        scene(
            fleet=fleet | {"heading": ["north", "west", "west"]},
            strategy={"right_of_way": name},
            durations={"pick": 3, "drop": 3, "handling": {"line": 20}, "move": 2, "turn": 4},
        )
    )
    assert run_to_end(run) == []
    assert run.finished


def test_the_check_sees_a_trip_that_waits() -> None:
    """Under `wait` nobody makes room."""
    run = observed(scene(strategy={"right_of_way": "wait"}))
    found = run_to_end(run)
    assert len(found) == 1 and found[0].startswith("robot 0 waits for idle robot 1 since tick")
    assert not run.finished


def test_a_robot_stays_in_a_queue_that_nobody_needs() -> None:
    run = observed(scene([{"pod": 1, "station": "P1", "release": 590}]))
    run.run(500)
    assert run.resolved.floor_plan.xy(int(run.world.robots.cell[1])) == (6, 3)


def test_random_starts_avoid_stations_queues_and_chargers() -> None:
    resolved = resolve("goods-60x40", ["fleet.start=random", "fleet.robots=600"])
    queues = {(x, y) for y in range(4, 35, 6) for x in range(3, 10)}
    kinds = resolved.floor_plan.kind.reshape(-1)
    for seed in (1, 2):
        cells, bays = homes(resolved, seed)
        assert (bays == NIL).all() and len(set(cells.tolist())) == 600
        assert not np.isin(kinds[cells], (STATION, CHARGER)).any()
        assert not queues & {resolved.floor_plan.xy(int(cell)) for cell in cells}
