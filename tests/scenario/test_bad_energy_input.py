"""Batteries, faults, orders and auctions: whatever a file says of them is answered in one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest
from drawn_scenes import scene

from automaton.commands import main
from automaton.errors import InputError
from automaton.world.resolve import resolve
from automaton.world.scenario_warnings import scenario_warnings

GOOD = """name: good
layout: {generator: depots, chargers: [2, 3]}
fleet: {robots: 2, kinematics: omni, start: [[2, 0], [4, 10]]}
orders: {generator: stations, count: 5, mean_interarrival_time: 10}
battery: {initial_charge: 50, reserve: 10, drain: {move: 0.3, loaded_factor: 2}, charge_rate: [[0, 1], [80, 0.5]]}
faults: {list: [{robot: 1, at: 9}], failure_probability: 0.1, tow_after: 30, repair_time: 60}
strategy:
  allocation: {name: auction, mechanism: sequential, epsilon: 0.5, winner_rule: lowest, max_orders_per_robot: 8}
  charging: {name: threshold, threshold: 20, mode: keep-charger-reachable}
"""  # noqa: E501


def complaint(folder: Path, old: str, new: str) -> str:
    """What is said about the good scenario with one thing changed; "FILE" stands for its path."""
    assert GOOD.count(old) == 1
    path = folder / "scenario.yaml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError) as caught:
        resolve(path)
    said = str(caught.value)
    assert "\n" not in said
    return said.replace(str(path), "FILE")


def test_the_scenario_is_good(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(GOOD)
    assert scenario_warnings(resolve(path)) == []


CHANGES = [  # what is typed instead of what, line, words of the answer
    ("initial_charge: 50", "initial_charge: 101", 5,
     ["battery.initial_charge", "from 0 to 100", "found 101"]),
    ("initial_charge: 50", "initial_charge: {from: 60, to: 40}", 5,
     ["battery.initial_charge", "from (60)", "above to (40)"]),
    ("initial_charge: 50", "initial_charge: [50, 60, 70]", 5,
     ["fleet.robots is 2", "battery.initial_charge lists 3 charges"]),
    ("reserve: 10", "reserve: -1", 5, ["battery.reserve", "found -1"]),
    ("reserve: 10", "resreve: 10", 5, ["'resreve' in battery", "did you mean 'reserve'?"]),
    ("move: 0.3, ", "", 5, ["the key 'move' is missing in battery.drain"]),
    ("move: 0.3", "moves: 0.3", 5, ["'moves' in battery.drain", "did you mean 'move'?"]),
    ("move: 0.3", "move: much", 5, ["battery.drain.move must be a number", "found 'much'"]),
    ("loaded_factor: 2", "loaded_factor: 11", 5,
     ["battery.drain.loaded_factor", "from 0 to 10", "found 11"]),
    ("[[0, 1], [80, 0.5]]", "0", 5, ["battery.charge_rate", "found 0"]),
    ("[[0, 1], [80, 0.5]]", "[[5, 1]]", 5, ["battery", "charge_rate must rise from 0", "[[0, 1],"]),
    ("[[0, 1], [80, 0.5]]", "[[0, 1], [0, 2]]", 5, ["charge_rate must rise from 0"]),
    ("[[0, 1], [80, 0.5]]", "[[0, 1], [80, 0]]", 5, ["battery.charge_rate[1]", "found 0"]),
    ("[[0, 1], [80, 0.5]]", "[]", 5, ["charge_rate must rise from 0"]),
    ("robot: 1", "robot: 2", 6, ["there is no robot 2", "fleet.robots is 2, counted from 0"]),
    ("at: 9", "at: 0", 6, ["faults.list[0].at", "found 0"]),
    ("at: 9", "when: 9", 6, ["'when' in faults.list[0]"]),
    ("failure_probability: 0.1", "failure_probability: 2", 6,
     ["faults.failure_probability", "from 0 to 1", "found 2"]),
    ("tow_after: 30", "tow_after: 0", 6, ["faults.tow_after", "found 0"]),
    ("repair_time: 60", "repair_time: soon", 6, ["faults.repair_time", "found 'soon'"]),
    ("repair_time: 60", "repair_time: 60, charge: 101", 6,
     ["faults.charge", "from 0 to 100", "found 101"]),
    ("repair_time: 60", "repair_time: 60, charge: full", 6, ["faults.charge", "kept", "found 'full'"]),
    ("repair_time: 60", "repair_tim: 60", 6, ["did you mean 'repair_time'?"]),
    ("mean_interarrival_time: 10", "mean_interarrival_time: 0.5", 4,
     ["orders", "mean_interarrival_time must be 0 or at least 1"]),
    ("mean_interarrival_time: 10", "mean_interarrival_time: -3", 4,
     ["orders.mean_interarrival_time", "found -3"]),
    (", count: 5", "", 4, ["the generator stations needs a count of orders"]),
    ("generator: stations", "generator: station", 4, ["did you mean 'stations'?"]),
    ("generator: stations, count: 5", "list: [{from: [0, 2], to: [8, 8]}]", 4,
     ["mean_interarrival_time belongs to generators"]),
    ("mean_interarrival_time: 10",
     "mean_interarrival_time: 10, arrivals: {closed_loop: {in_system: 2}}", 4,
     ["set either mean_interarrival_time or arrivals, not both"]),
    ("mean_interarrival_time: 10", "arrivals: {}", 4,
     ["arrivals must have exactly one of bursts, closed_loop and profile"]),
    ("mean_interarrival_time: 10", "arrivals: {bursts: {size: 0, every: 9}}", 4,
     ["orders.arrivals.bursts.size", "found 0"]),
    ("mean_interarrival_time: 10", "arrivals: {bursts: {size: {mean: 0.5}, every: 9}}", 4,
     ["orders.arrivals.bursts.size.mean", "found 0.5"]),
    ("mean_interarrival_time: 10", "arrivals: {closed_loop: {in_sistem: 2}}", 4,
     ["did you mean 'in_system'?"]),
    ("mean_interarrival_time: 10", "transports: {file: orders.csv}", 4,
     ["orders must have either a generator"]),
    ("generator: stations, count: 5, mean_interarrival_time: 10", "transports: {file: none.csv}", 4,
     ["there is no file of orders 'none.csv'"]),
    ("generator: stations, count: 5, mean_interarrival_time: 10",
     "parts: [{route: [1, 2]}], processing_time: {mean: 0}", 4,
      ["orders.processing_time.mean", "found 0"]),
    ("generator: stations, count: 5, mean_interarrival_time: 10",
     "list: [{from: [0, 2], to: [8, 8], release: -1}]", 4, ["orders.list[0].release", "found -1"]),
    ("generator: stations, count: 5, mean_interarrival_time: 10",
     "list: [{from: [2, 0], to: [8, 8]}]", 4, ["an order begins at", "[2, 0] is a floor"]),
    ("[2, 3]", "[2, 18]", 2, ["chargers are at positions 1 to 17, found 18"]),
    ("[2, 3]", "[]", 2, ["strategy.charging is threshold, but the floor has no charger"]),
    ("threshold: 20", "threshold: 120", 9, ["strategy.charging.threshold", "found 120"]),
    ("threshold: 20", "treshold: 20", 9, ["did you mean 'threshold'?"]),
    ("mode: keep-charger-reachable", "mode: keep-charger-reachabel", 9,
     ["or threshold-only", "did you mean 'keep-charger-reachable'?"]),
    ("name: threshold", "name: tresholt", 9, ["'tresholt'", "did you mean 'threshold'?"]),
    ("sequential", "sequental", 8, ["did you mean 'sequential'?"]),
    ("winner_rule: lowest", "winner_rule: lower", 8, ["did you mean 'lowest'?"]),
    ("max_orders_per_robot: 8", "max_orders_per_robot: 0", 8,
     ["strategy.allocation.max_orders_per_robot", "from 1 to 64", "found 0"]),
    ("max_orders_per_robot: 8", "max_orders_per_robots: 8", 8, ["did you mean 'max_orders_per_robot'?"]),
    ("epsilon: 0.5", "epsilon: 1.5", 8, ["strategy.allocation.epsilon", "1.5"]),
    ("epsilon: 0.5", "epsilon: lode", 8, ["strategy.allocation.epsilon", "load"]),
    ("epsilon: 0.5", "epsilon: {from: 0, to: 1}", 8, ["'until' is missing in strategy.allocation"]),
    ("sequential", "exact", 8, ["strategy.allocation is auction", "exact ignores charging"]),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "words"), CHANGES, ids=[c[1][:40] for c in CHANGES])
def test_a_mistake_is_named_with_its_line(
    tmp_path: Path, old: str, new: str, line: int, words: list[str]
) -> None:
    said = complaint(tmp_path, old, new)
    assert said.startswith(f"FILE:{line}: "), said
    assert all(word in said for word in words), said


def test_charging_without_a_battery_is_refused(tmp_path: Path) -> None:
    battery = GOOD[GOOD.index("battery:") : GOOD.index("faults:")]
    assert "strategy.charging is threshold, but the scenario has no battery" in complaint(
        tmp_path, battery, ""
    )


# Doubts.

FLOOR = "c..t\n...t"
BATTERY = {"drain": {"move": 1.0}, "charge_rate": 5.0}


def parked(starts: list[tuple[int, int]], charging: str = "insertion", picture: str = FLOOR) -> str:
    resolved = scene(
        picture,
        starts,
        orders={"generator": "stations", "count": 3},
        battery=BATTERY,
        strategy={"allocation": "auction", "charging": charging},
    )
    return "; ".join(scenario_warnings(resolved))


def test_a_robot_that_parks_on_a_charger_is_warned_of() -> None:
    assert parked([(1, 0), (0, 0)]) == (
        "robot 1 begins at [0, 0] and therefore parks there, on a charger that other robots need: "
        "2 robots share 1; start it next to the charger"
    )
    assert parked([(1, 0), (2, 0)]) == ""
    assert parked([(0, 0)]) == "", "there is nobody else"
    assert "parks there" not in parked([(0, 0), (1, 1)], "none"), "nobody charges"
    assert parked([(0, 0), (1, 1)], picture="c..t\nc..t") == "", "there is one for each"


@pytest.mark.parametrize("scenario", ["depots", "depots-line", "depots-full"])
def test_an_order_beyond_the_range_of_a_battery_is_warned_of(scenario: str) -> None:
    """From pos_2 to 4 there are 6 cells, from 16 back 12, and 14 between them: 32 moves of 3 %."""
    assert scenario_warnings(resolve(scenario)) == []
    said = scenario_warnings(resolve(scenario, ["battery.reserve=5"]))
    if scenario == "depots-full":
        assert said == [], "there is a charger near every station"
        assert scenario_warnings(resolve(scenario, ["battery.reserve=20"])) == []
        return
    assert said == [
        "an order from [0, 2] to [8, 8] takes 96 % of a battery, from a charger and back to one, "
        "but only 95 % are above the reserve: robots that leave a charger will never take it"
    ]
    strands = "strategy.charging={name: insertion, never_strand: false}"
    assert scenario_warnings(resolve(scenario, ["battery.reserve=5", strands])) == []
    assert (
        scenario_warnings(resolve(scenario, ["battery.reserve=5", "orders.generator=visits"])) == []
    )
    loaded = scenario_warnings(resolve(scenario, ["battery.drain.loaded_factor=1.5"]))
    assert "takes 117 % of a battery" in loaded[0]


def test_check_and_run_say_it_and_go_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = ("--set", "fleet.start=[[4, 0], [2, 0], [6, 0], [2, 1]]")
    for command in ("check", "run"):
        assert main([command, "depots", *settings, "--set", "orders.count=3"]) == 0
        assert "depots: warning: robot 0 begins at [4, 0]" in capsys.readouterr().err
