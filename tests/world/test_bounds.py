"""What no fleet can beat: by hand on drawn floors, and against runs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from automaton.studies.process_pool import PersistentPool
from automaton.world.bounds import Bounds, bounds, least_ticks, most_throughput
from automaton.world.resolve import Resolved, resolve


@pytest.mark.parametrize("scenario", ["tabletop-mini", "crossing", "depots", "tabletop-2"])
def test_no_run_beats_the_bounds(scenario: str) -> None:
    few = ["orders.count=20"] if scenario == "depots" else []
    for robots in (2, 4):
        fleet = () if scenario == "depots" else (f"fleet.robots={robots}",)
        resolved = resolve(scenario, [*few, *fleet])
        with PersistentPool(1) as rounds:
            runs = rounds.run([(resolved, seed) for seed in range(5)])
        found = bounds(resolved)
        many = resolved.scenario.fleet.robots
        for run in runs:
            assert run.metrics["makespan"] >= least_ticks(found, many)[0] > 0
            assert run.metrics["throughput"] <= most_throughput(found, many)[0]


def test_bounds_by_hand() -> None:
    # Three loads, each beside the lane; ways of 4, 3 and 2 moves to the goal cell at the
    # destination.
    picture = "b.....d\n#sss###"
    layout = "layout={picture: " + json.dumps(picture) + "}"
    resolved = resolve("tabletop-mini", [layout, "fleet.kinematics=omni", "fleet.robots=1"])
    found = bounds(resolved)
    handling = resolved.scenario.durations.pick + resolved.scenario.durations.drop
    assert found.orders == 3
    assert found.work == 3 * handling + 4 + 3 + 2
    assert least_ticks(found, 3)[0] == handling + 4  # the longest order alone


def drawn(picture: str, kinematics: str, handling: int) -> Resolved:
    """A floor with the loads drawn on it; picks and drops take so many ticks each."""
    layout = "layout={picture: " + json.dumps(picture) + "}"
    durations = f"durations={{move: 1, turn: 5, pick: {handling}, drop: {handling}}}"
    fleet = [f"fleet.kinematics={kinematics}", "fleet.robots=1"]
    return resolve("tabletop-mini", [layout, durations, *fleet, "orders.generator=picture-loads"])


def test_turns_that_no_way_avoids_count() -> None:
    corner = "b...#\n#$#.#\n###.d"
    assert bounds(drawn(corner, "omni", 1)).work == 1 + 4 + 1
    assert bounds(drawn(corner, "differential", 1)).work == 1 + 2 + 5 + 2 + 1


def test_a_load_may_be_handed_on_through_a_shelf() -> None:
    table = "b.....d\n#.sss##\n#.....#\n###$###"
    assert bounds(drawn(table, "omni", 9)).work == 18 + 8  # round the table
    assert bounds(drawn(table, "omni", 1)).work == 2 + 2 + 2  # set down on the table, taken up


def test_energy_that_batteries_lack_comes_from_chargers() -> None:
    none = Bounds(
        1, 10.0, 10.0, 10.0, 0.0, 0.0, 0.0, energy=500.0, held=100.0, given=2.0, mended=0.0
    )
    assert least_ticks(none, 2) == (150.0, "chargers give no more energy")
    assert least_ticks(none, 5)[0] == 10.0
    assert least_ticks(none._replace(given=0.0), 2)[0] == float("inf")


def test_stations_hold_one_robot_each() -> None:
    found = bounds(resolve("depots"))
    stations, count = 13, 200
    assert found.station_ticks == pytest.approx(count * (5 + 5) / stations)


PARTS = """name: parts
layout: {picture: "t..t.t"}
fleet: {robots: 1, kinematics: omni, start: random}
durations: {pick: 2, drop: 3}
orders:
  parts:
    - {route: [1, 2, 3], count: 3, first_release: 7, interarrival_time: 10}
    - {route: [2, 3], interarrival_time: {mean: 5}, count: 2}
  processing_time: [20, 4, {mean: 9}]
strategy: {allocation: shortest-job, right_of_way: {name: retreat, idle_give_way: true}}
stop: {when: delivered, max_duration: 5000}
"""


def test_parts_take_the_work_of_stations_and_their_ways(tmp_path: Path) -> None:
    (tmp_path / "parts.yaml").write_text(PARTS)
    resolved = resolve(tmp_path / "parts.yaml")
    found = bounds(resolved)
    assert found.orders == 3 * 2 + 2
    assert found.work == 8 * (2 + 3) + 3 * 3 + 5 * 2
    assert found.busiest == 3 * 20  # station 1; the last of a route may be worked on after the end
    assert found.longest_part == 7 + 2 * 10 + 20 + 4 + 2 * (2 + 3) + 3 + 2
    assert least_ticks(found, 1) == (66.0, "one part on its whole route")
    with PersistentPool(1) as rounds:
        runs = rounds.run([(resolved, seed) for seed in range(5)])
    assert all(run.finished and run.metrics["makespan"] >= 66 for run in runs)
