"""Who has nothing to do makes room, wherever it stands: also where it has stood from the beginning."""

from __future__ import annotations

from pathlib import Path

import pytest
from played_back import recorded

from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve

SCENARIO = """name: narrow
layout:
  picture: |
    {rows}
fleet: {{robots: 2, kinematics: omni, start: [[0, 0], [{x}, 0]]}}
orders: {{list: [{{from: [0, 0], to: [{x}, 0]}}]}}
strategy:
  allocation: {{name: shortest-job, idle: {idle}}}
  right_of_way: {{name: retreat, idle_give_way: {give_way}}}
stop: {{when: delivered, max_duration: 2000}}
"""
AROUND = "t...t\n    ....."  # robot 0 has the only order; robot 1 stands where it ends
DEAD_END = "t===t"  # to get out of a station in a dead end it has to pass who wants in


def scenario(folder: Path, rows: str, idle: str, give_way: str = "true") -> Path:
    path = folder / "narrow.yaml"
    path.write_text(SCENARIO.format(rows=rows, x=4, idle=idle, give_way=give_way))
    return path


@pytest.mark.parametrize("idle", ["stay", "park"])
@pytest.mark.parametrize("rows", [AROUND, DEAD_END], ids=["around", "dead end"])
def test_a_robot_that_never_had_an_order_makes_room(tmp_path: Path, rows: str, idle: str) -> None:
    for seed in range(1, 9):
        run = Simulation(resolve(scenario(tmp_path, rows, idle), seed=seed))
        run.run()
        assert run.finished, seed
        assert run.world.tally.illegal.sum() == 0


def test_otherwise_it_stays_where_it_is(tmp_path: Path) -> None:
    run = Simulation(resolve(scenario(tmp_path, AROUND, "stay", give_way="false")))
    run.run()
    assert not run.finished and run.tick == 2000


def test_such_a_run_keeps_the_rules_when_it_is_recorded(tmp_path: Path) -> None:
    """The validator knows by itself that a robot on the floor that moves is not parked any more."""
    assert validate_stored(recorded(resolve(scenario(tmp_path, AROUND, "park")))).valid


PLANT = """name: plant
layout:
  picture: |
    t=====t=====t
    =#####=#####=
    =#####=#####=
    t#####=#####t
    =#####=#####=
    =#####=#####=
    t==t==t==t==t
    =#####=#####=
    =#####=#####=
    t#####=#####t
    =#####=#####=
    =============
fleet: {robots: 5, kinematics: omni}
durations: {pick: 3, drop: 3, handling_jitter: 2}
orders:
  parts:
    - {route: [1, 4, 8, 5], count: 15, interarrival_time: 40}
    - {route: [2, 7, 12, 3, 10], count: 15, interarrival_time: {mean: 50}}
    - {route: [11, 6, 9], count: 10, first_release: 20, interarrival_time: 60}
  processing_time: 20
strategy:
  allocation: {name: shortest-job, idle: stay}
  right_of_way: {name: retreat, idle_give_way: true}
stop: {when: delivered, max_duration: 30000}
"""


def test_who_cannot_withdraw_for_an_idle_robot_behind_it_is_made_room_for(tmp_path: Path) -> None:
    """Robot 0 stands between one that comes and one that stays; both its ways were closed for ever."""
    (tmp_path / "plant.yaml").write_text(PLANT)
    run = Simulation(resolve(tmp_path / "plant.yaml", seed=5739497603756485852))
    run.run()
    assert run.finished


FILE = """name: file
layout:
  picture: |
    t...t....
fleet: {robots: 3, kinematics: omni, start: [[0, 0], [4, 0], [5, 0]]}
orders: {list: [{from: [0, 0], to: [4, 0]}]}
strategy:
  allocation: {name: shortest-job, idle: stay}
  right_of_way: {name: retreat, idle_give_way: true}
stop: {when: delivered, max_duration: 2000}
"""


@pytest.mark.parametrize("radius", [0, 8])
def test_a_file_of_robots_makes_room_whatever_they_see_of_each_other(
    tmp_path: Path, radius: int
) -> None:
    """Robot 1 stands where the order of robot 0 ends, with robot 2 behind it."""
    (tmp_path / "file.yaml").write_text(FILE)
    settings = [f"information={{radius: {radius}}}"] if radius else []
    run = Simulation(resolve(tmp_path / "file.yaml", settings, seed=1))
    run.run()
    assert run.finished and run.world.tally.illegal.sum() == 0
