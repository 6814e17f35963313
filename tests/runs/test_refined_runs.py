"""Runs in finer ticks: the same day, told in ticks that are K times shorter."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from played_back import recorded

from automaton.commands import main
from automaton.engine.state import NEVER, World
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve

RING = """name: ring
layout:
  picture: |
    .......
    .#.#.#.
    .......
fleet: {robots: 1, start: random, kinematics: differential}
orders: {generator: tours, count: 8, stops: 2, mean_interarrival_time: 15}
durations: {move: 2, turn: 3}
stop: {when: never, max_duration: 200}
"""
# Faults, delays, batteries that run empty, and moves that chance makes longer. Without following what
# robots may do does not depend on how finely moves are cut.
HARD = """name: hard
layout:
  picture: |
    .........
    .##.##.#.
    .........
    .#.#.#.#.
    .........
fleet: {robots: 6, start: random, kinematics: differential}
orders: {generator: tours, count: 40, stops: 2, mean_interarrival_time: 4}
world: {following: none, extra_tick_probability: 0.1}
battery: {drain: {move: 0.5, turn: 0.2, wait: 0.1}, charge_rate: 3.3, initial_charge: {from: 30, to: 90}}
faults:
  mtbf: 120
  tow_after: 9
  repair_time: 25
  repair_in_place: {uniform: {from: 2, to: 20}}
  delays: {probability: 0.02, ticks: {from: 1, to: 6}}
floor: {closed: [{cells: [[4, 2]], for: 5, every: {mean: 20}}]}
stop: {when: never, max_duration: 250}
"""


@pytest.fixture
def hard(tmp_path: Path) -> Path:
    return written(tmp_path, HARD)


def written(folder: Path, text: str) -> Path:
    path = folder / "scenario.yaml"
    path.write_text(text)
    return path


def run(scenario: Path | str, refine: int, *settings: str) -> World:
    simulation = Simulation(resolve(scenario, [f"refine={refine}", *settings]))
    simulation.run()
    return simulation.world


def coarse(ticks: Any, refine: int) -> Any:
    """The coarse ticks to which ticks belong."""
    return np.where((ticks > 0) & (ticks < NEVER), -(-ticks.astype(np.int64) // refine), ticks)


def history(world: World, refine: int) -> list[list[int]]:
    """When each order was released, taken and done, by whom; where robots are at the end."""
    orders = world.orders
    ticks = [coarse(a, refine) for a in (orders.release_tick, orders.dispatched, orders.delivered)]
    return [array.tolist() for array in (*ticks, orders.dispatched_to, world.robots.cell)]


def counted(world: World, refine: int) -> Any:
    return world.tally.ticks.sum(axis=0) / refine


@pytest.mark.parametrize("refine", [2, 5])
def test_one_robot_does_the_same_orders_at_the_same_times(tmp_path: Path, refine: int) -> None:
    ring = written(tmp_path, RING)
    usual, fine = run(ring, 1), run(ring, refine)
    assert history(fine, refine) == history(usual, 1)
    assert (usual.orders.delivered > 0).sum() > 3


@pytest.mark.parametrize("right_of_way", ["pibt", "retreat"])
def test_a_hard_day_is_the_same_day(hard: Path, right_of_way: str) -> None:
    setting = f"strategy.right_of_way={right_of_way}"
    usual, fine = run(hard, 1, setting), run(hard, 3, setting)
    assert history(fine, 3) == history(usual, 1)
    assert np.allclose(counted(fine, 3), counted(usual, 1))
    assert usual.tally.failures.sum() > 0
    assert usual.delays.lasted.sum() * 3 == fine.delays.lasted.sum() > 0


def test_lines_that_are_picked_at_stations_are_the_same(tmp_path: Path) -> None:
    settings = ("world.following=none", "strategy.right_of_way=pibt", "fleet.robots=1")
    usual, fine = (run("goods-mini", k, *settings, "fleet.start=[[2, 1]]") for k in (1, 3))
    assert coarse(fine.lines.done, 3).tolist() == usual.lines.done.tolist()
    assert usual.lines.done.min() > 0


@pytest.mark.parametrize("decide", ["coarse", "fine"])
def test_refined_recordings_keep_the_rules_and_can_be_run_again(hard: Path, decide: str) -> None:
    recording = recorded(resolve(hard, ["refine=3", f"decide={decide}"]))
    assert not validate_stored(recording).violations
    assert recording.header["scenario"]["stop"]["max_duration"] == 250, "as it was read"


def test_a_refined_crowd_in_convoy_keeps_the_rules() -> None:
    settings = ["fleet.robots=250", "refine=2", "stop.max_duration=40"]
    assert not validate_stored(recorded(resolve("random-400", settings))).violations


@pytest.mark.parametrize("right_of_way", ["pibt", "epibt"])
def test_a_crowd_that_is_steered_goes_the_same_ways(right_of_way: str) -> None:
    settings = ["fleet.robots=400", f"strategy.right_of_way={right_of_way}", "stop.max_duration=60"]
    usual, fine = (run("random-400", k, *settings) for k in (1, 3))
    assert history(fine, 3) == history(usual, 1)
    assert usual.orders.delivered.max() > 0


def test_deadlocks_are_broken_at_the_same_times() -> None:
    settings = ["fleet.robots=700", "durations.move=2", "world.following=none"]
    settings += [
        "strategy.right_of_way={name: pibt, deadlock_patience: 2}",
        "stop.max_duration=150",
    ]
    broken = []
    for refine in (1, 2):
        simulation = Simulation(resolve("random-400", [*settings, f"refine={refine}"]))
        simulation.run()
        broken.append(dict(simulation.counted)["deadlocks_resolved"])
    assert broken[0] == broken[1] > 0


def test_strategies_decide_in_the_first_of_fine_ticks_or_in_all(tmp_path: Path) -> None:
    ring = written(tmp_path, RING)
    layer = 4  # right of way, asked whenever anything is decided
    asked = [
        int(run(ring, 3, f"decide={when}").tally.batches[layer]) for when in ("coarse", "fine")
    ]
    assert asked == [200, 600]


def test_a_refined_run_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ring = str(written(tmp_path, RING))
    assert main(["run", ring, "--refine", "3", "--until", "50", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["refine"], printed["decide"], printed["ticks"]) == (3, "coarse", 150)
    assert main(["run", ring, "--refine", "3", "--decide", "fine", "--until", "50"]) == 0
    out = capsys.readouterr().out
    assert "stopped after 50 coarse-ticks" in out
    assert "refined: ticks are 3 times finer, strategies decide in every tick" in out
    assert main(["run", ring, "--until", "50", "--json"]) == 0
    assert "refine" not in json.loads(capsys.readouterr().out)


def test_a_branch_of_a_refined_recording_goes_on_in_its_ticks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ring, file, out = (str(tmp_path / name) for name in ("scenario.yaml", "a.rec", "b.rec"))
    written(tmp_path, RING)
    assert main(["run", ring, "--refine", "2", "--record", file]) == 0
    branch = ["branch", file, "--at", "100", "--set", "durations.pick=5", "--out", out]
    assert main(branch) == 0
    assert main(["verify", file]) == main(["verify", out]) == 0
    assert "every tick is identical" in capsys.readouterr().out
    assert main(["branch", file, "--at", "100", "--set", "refine=3", "--out", out]) == 2
    assert "refine cannot change during a run" in capsys.readouterr().err


def test_sweeps_and_sizes_count_in_the_ticks_of_the_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ring = written(tmp_path, RING.replace("never", "delivered"))
    study = tmp_path / "study.yaml"
    study.write_text(
        f"name: ticks\nscenario: {ring}\nfactors: {{refine: [1, 3]}}\nreplications: 2\n"
        "analysis: {metrics: [makespan]}\n"
    )
    folder = tmp_path / "out"
    assert main(["sweep", str(study), "--out", str(folder), "--workers", "1"]) == 0
    capsys.readouterr()
    assert main(["report", str(folder), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["metrics"]
    usual, fine = (row["mean"] for row in rows if row["metric"] == "makespan")
    assert usual == pytest.approx(fine)
    assert usual > 100


def resolved_twice(name: str) -> tuple[Resolved, Resolved]:
    return resolve(name), resolve(name, ["refine=2"])


@pytest.mark.parametrize("name", ["tabletop-mini", "depots", "goods-to-person"])
def test_shipped_scenarios_have_the_same_demand(name: str) -> None:
    usual, fine = (Simulation(one).world for one in resolved_twice(name))
    assert coarse(fine.orders.release_tick, 2).tolist() == usual.orders.release_tick.tolist()
    assert fine.orders.source.tolist() == usual.orders.source.tolist()
    assert (fine.rules.duration[:, 1] == 2 * usual.rules.duration[:, 1]).all()
