"""Batteries, faults, orders and auctions: whatever a file says of them is answered in one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest
from powered import scene

from automaton.commands import main
from automaton.errors import InputError
from automaton.scenario.doubts import doubts
from automaton.scenario.resolve import resolve

GOOD = """name: good
layout: {generator: depots, chargers: [2, 3]}
fleet: {robots: 2, kinematics: omni, start: [[2, 0], [4, 10]]}
orders: {generator: stations, count: 5, interval: 10}
battery: {start: 50, reserve: 10, drain: {move: 0.3, loaded: 2}, charge: [[0, 1], [80, 0.5]]}
faults: {list: [{robot: 1, at: 9}], rate: 0.1, tow_after: 30, repair: 60}
strategy:
  allocation: {name: auction, auction: sequential, epsilon: 0.5, winner: lowest, limit: 8}
  charging: {name: threshold, threshold: 20, mode: safe}
"""


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
    assert doubts(resolve(path)) == []


CHANGES = [  # what is typed instead of what, line, words of the answer
    ("start: 50", "start: 101", 5, ["battery.start", "from 0 to 100", "found 101"]),
    ("start: 50", "start: {from: 60, to: 40}", 5, ["battery.start", "from (60)", "above to (40)"]),
    ("start: 50", "start: [50, 60, 70]", 5, ["fleet.robots is 2", "battery.start lists 3 charges"]),
    ("reserve: 10", "reserve: -1", 5, ["battery.reserve", "found -1"]),
    ("reserve: 10", "resreve: 10", 5, ["'resreve' in battery", "did you mean 'reserve'?"]),
    ("move: 0.3, ", "", 5, ["the key 'move' is missing in battery.drain"]),
    ("move: 0.3", "moves: 0.3", 5, ["'moves' in battery.drain", "did you mean 'move'?"]),
    ("move: 0.3", "move: much", 5, ["battery.drain.move must be a number", "found 'much'"]),
    ("loaded: 2", "loaded: 11", 5, ["battery.drain.loaded", "from 0 to 10", "found 11"]),
    ("[[0, 1], [80, 0.5]]", "0", 5, ["battery.charge", "found 0"]),
    ("[[0, 1], [80, 0.5]]", "[[5, 1]]", 5, ["battery", "charge must rise from 0", "[[0, 1],"]),
    ("[[0, 1], [80, 0.5]]", "[[0, 1], [0, 2]]", 5, ["charge must rise from 0"]),
    ("[[0, 1], [80, 0.5]]", "[[0, 1], [80, 0]]", 5, ["battery.charge[1]", "found 0"]),
    ("[[0, 1], [80, 0.5]]", "[]", 5, ["charge must rise from 0"]),
    ("robot: 1", "robot: 2", 6, ["there is no robot 2", "fleet.robots is 2, counted from 0"]),
    ("at: 9", "at: 0", 6, ["faults.list[0].at", "found 0"]),
    ("at: 9", "when: 9", 6, ["'when' in faults.list[0]"]),
    ("rate: 0.1", "rate: 2", 6, ["faults.rate", "from 0 to 1", "found 2"]),
    ("tow_after: 30", "tow_after: 0", 6, ["faults.tow_after", "found 0"]),
    ("repair: 60", "repair: soon", 6, ["faults.repair", "found 'soon'"]),
    ("repair: 60", "repair: 60, charge: 101", 6, ["faults.charge", "from 0 to 100", "found 101"]),
    ("repair: 60", "repair: 60, charge: full", 6, ["faults.charge", "kept", "found 'full'"]),
    ("repair: 60", "repairs: 60", 6, ["did you mean 'repair'?"]),
    ("interval: 10", "interval: 0.5", 4, ["orders", "interval must be 0 or at least 1"]),
    ("interval: 10", "interval: -3", 4, ["orders.interval", "found -3"]),
    (", count: 5", "", 4, ["the generator stations needs a count of orders"]),
    ("generator: stations", "generator: station", 4, ["did you mean 'stations'?"]),
    ("generator: stations, count: 5", "list: [{from: [0, 2], to: [8, 8]}]", 4,
     ["interval belongs to generators"]),
    ("interval: 10", "interval: 10, stream: {closed: {in_system: 2}}", 4,
     ["interval does not go together with a stream"]),
    ("interval: 10", "stream: {}", 4, ["stream must have exactly one of bursts, closed or file"]),
    ("interval: 10", "stream: {bursts: {size: 0, every: 9}}", 4,
     ["orders.stream.bursts.size", "found 0"]),
    ("interval: 10", "stream: {bursts: {size: {mean: 0.5}, every: 9}}", 4,
     ["orders.stream.bursts.size.mean", "found 0.5"]),
    ("interval: 10", "stream: {closed: {in_sistem: 2}}", 4, ["did you mean 'in_system'?"]),
    ("interval: 10", "stream: {file: orders.csv}", 4, ["orders must have either a generator"]),
    ("generator: stations, count: 5, interval: 10", "stream: {file: none.csv}", 4,
     ["there is no file of orders 'none.csv'"]),
    ("generator: stations, count: 5, interval: 10",
     "parts: [{route: [1, 2]}], work: {mean: 0}", 4, ["orders.work.mean", "found 0"]),
    ("generator: stations, count: 5, interval: 10",
     "list: [{from: [0, 2], to: [8, 8], at: -1}]", 4, ["orders.list[0].at", "found -1"]),
    ("generator: stations, count: 5, interval: 10",
     "list: [{from: [2, 0], to: [8, 8]}]", 4, ["an order begins at", "[2, 0] is a floor"]),
    ("[2, 3]", "[2, 18]", 2, ["chargers are at positions 1 to 17, found 18"]),
    ("[2, 3]", "[]", 2, ["strategy.charging is threshold, but the floor has no charger"]),
    ("threshold: 20", "threshold: 120", 9, ["strategy.charging.threshold", "found 120"]),
    ("threshold: 20", "treshold: 20", 9, ["did you mean 'threshold'?"]),
    ("mode: safe", "mode: save", 9, ["look or safe", "did you mean 'safe'?"]),
    ("name: threshold", "name: tresholt", 9, ["'tresholt'", "did you mean 'threshold'?"]),
    ("sequential", "sequental", 8, ["did you mean 'sequential'?"]),
    ("winner: lowest", "winner: lower", 8, ["did you mean 'lowest'?"]),
    ("limit: 8", "limit: 0", 8, ["strategy.allocation.limit", "from 1 to 64", "found 0"]),
    ("limit: 8", "limits: 8", 8, ["did you mean 'limit'?"]),
    ("epsilon: 0.5", "epsilon: 1.5", 8, ["strategy.allocation.epsilon", "1.5"]),
    ("epsilon: 0.5", "epsilon: lode", 8, ["strategy.allocation.epsilon", "load"]),
    ("epsilon: 0.5", "epsilon: {from: 0, to: 1}", 8, ["'until' is missing in strategy.allocation"]),
    ("sequential", "exact", 8, ["strategy.allocation is auction", "exact knows no charging"]),
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
BATTERY = {"drain": {"move": 1.0}, "charge": 5.0}


def parked(starts: list[tuple[int, int]], charging: str = "insertion", picture: str = FLOOR) -> str:
    resolved = scene(
        picture,
        starts,
        orders={"generator": "stations", "count": 3},
        battery=BATTERY,
        strategy={"allocation": "auction", "charging": charging},
    )
    return "; ".join(doubts(resolved))


def test_a_robot_that_parks_on_a_charger_is_warned_of() -> None:
    assert parked([(1, 0), (0, 0)]) == (
        "robot 1 begins at [0, 0], and so parks there, on a charger that others need: "
        "2 robots share 1; let it begin beside it"
    )
    assert parked([(1, 0), (2, 0)]) == ""
    assert parked([(0, 0)]) == "", "there is nobody else"
    assert "parks there" not in parked([(0, 0), (1, 1)], "none"), "nobody charges"
    assert parked([(0, 0), (1, 1)], picture="c..t\nc..t") == "", "there is one for each"


@pytest.mark.parametrize("scenario", ["depots", "depots-line", "depots-full"])
def test_an_order_beyond_the_range_of_a_battery_is_warned_of(scenario: str) -> None:
    """From pos_2 to 4 there are 6 cells, from 16 back 12, and 14 between them: 32 moves of 3 %."""
    assert doubts(resolve(scenario)) == []
    said = doubts(resolve(scenario, ["battery.reserve=5"]))
    if scenario == "depots-full":
        assert said == [], "there is a charger near every station"
        assert doubts(resolve(scenario, ["battery.reserve=20"])) == []
        return
    assert said == [
        "an order from [0, 2] to [8, 8] takes 96 % of a battery, from a charger and back to one, and "
        "above the reserve there are 95 %: a robot that comes from a charger never does it"
    ]
    strands = "strategy.charging={name: insertion, never_strand: false}"
    assert doubts(resolve(scenario, ["battery.reserve=5", strands])) == []
    assert doubts(resolve(scenario, ["battery.reserve=5", "orders.generator=visits"])) == []
    loaded = doubts(resolve(scenario, ["battery.drain.loaded=1.5"]))
    assert "takes 117 % of a battery" in loaded[0]


def test_check_and_run_say_it_and_go_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = ("--set", "fleet.start=[[4, 0], [2, 0], [6, 0], [2, 1]]")
    for command in ("check", "run"):
        assert main([command, "depots", *settings, "--set", "orders.count=3"]) == 0
        assert "depots: warning: robot 0 begins at [4, 0]" in capsys.readouterr().err
