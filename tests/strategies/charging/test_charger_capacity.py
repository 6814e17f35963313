"""How many robots charge at a charger at once, and who is told when a place there is free."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from drawn_scenes import recorded_run
from played_back import playback_of

from automaton.engine.state import BATTERY_PERCENT, GOAL_CHARGE
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.verification import verify_recording
from automaton.world.floor_parts import places_of_chargers
from automaton.world.resolve import Resolved, resolve

FLOOR = """\
t.......t
.........
....x....
........."""
LATER = {"from": [0, 0], "to": [8, 0], "release": 200}


def crowd(capacity: int, starts: list[tuple[int, int]], **parts: Any) -> Resolved:
    """Idle robots with little charge around a charger at (4, 2); a tick there gives 1 %."""
    body = {
        "name": "charging",
        "layout": {"picture": FLOOR, "legend": {"x": {"kind": "charger", "capacity": capacity}}},
        "fleet": {"robots": len(starts), "kinematics": "omni", "start": starts},
        "orders": {"list": [LATER]},
        "battery": {"drain": {"move": 0.5}, "charge_rate": 1, "initial_charge": 50},
        "strategy": {"charging": "opportunity", "allocation": "first-come"},
        "stop": {"when": "never", "max_duration": 150},
        **parts,
    }
    return resolve(msgspec.convert(body, Scenario))


def charging(run: Simulation) -> list[int]:
    """Who stands in the charger now."""
    robots = run.world.robots
    inside = (robots.cell == run.world.chargers.cell[0]) & (robots.goal_type == GOAL_CHARGE)
    return sorted(robots.identity[inside].tolist())


def by_tick(resolved: Resolved, ticks: int) -> list[list[int]]:
    run, found = Simulation(resolved), []
    for tick in range(ticks):
        run.run(until=tick + 1)
        found.append(charging(run))
    return found


AROUND = [(2, 2), (6, 2), (4, 0)]


def test_at_a_charger_for_two_a_third_robot_waits_until_one_is_done() -> None:
    """Robots 0 and 1 are two cells away, on both sides. One enters a tick: there is one line."""
    seen = by_tick(crowd(2, AROUND), 70)
    assert seen[:4] == [[], [0], [0, 1], [0, 1]]
    assert max(map(len, seen)) == 2
    first = next(tick for tick, inside in enumerate(seen) if 2 in inside)
    assert first > 50, "the third one comes when one of them is full"


def test_robots_from_the_same_side_are_in_the_charger_together() -> None:
    """Elsewhere a cell for two has a lane for each direction."""
    seen = by_tick(crowd(2, [(2, 2), (1, 2)]), 6)
    assert seen[-1] == [0, 1]


def test_a_charger_without_a_limit_takes_all_that_come_in_a_tick() -> None:
    seen = by_tick(crowd(0, [(3, 2), (5, 2), (4, 1)]), 2)
    assert seen[0] == [0, 1, 2]


def test_a_usual_charger_serves_one() -> None:
    seen = by_tick(crowd(1, AROUND), 140)
    assert max(map(len, seen)) == 1
    assert {robot for inside in seen for robot in inside} == {0, 1, 2}


@pytest.mark.parametrize(("capacity", "places"), [(0, 3), (1, 1), (2, 2)])
def test_its_capacity_is_what_estimates_count(capacity: int, places: int) -> None:
    resolved = crowd(capacity, AROUND)
    assert list(places_of_chargers(resolved.scenario, resolved.floor_plan).values()) == [places]
    assert Simulation(resolved).world.chargers.places.tolist() == [places]


@pytest.mark.parametrize("capacity", [0, 1, 2])
@pytest.mark.parametrize("following", ["convoy", "none"])
def test_recorded_runs_are_verified(capacity: int, following: str) -> None:
    resolved = crowd(
        capacity,
        [*AROUND, (0, 3), (8, 3)],
        durations={"move": 3},
        world={"following": following},
        faults={"list": [{"robot": 1, "at": 30}], "tow_after": 10, "repair_time": 20},
    )
    run, recorder = recorded_run(resolved)
    assert run.world.tally.charged.sum() > 0
    recording = recorder.recording()
    assert verify_recording(recording).passed
    playback = playback_of(recording)
    playback.go_to(run.tick)
    assert playback.simulation.digest == run.digest


def test_a_scenario_that_is_resolved_again_has_no_more_blocks() -> None:
    once = crowd(2, AROUND).scenario
    assert resolve(once).scenario.floor.blocks == once.floor.blocks
    assert len(once.floor.blocks) == 1


# `opportunity` and chargers that become free


def test_an_idle_robot_drives_off_in_the_tick_after_a_charger_became_free() -> None:
    """Whatever tick that is: idle robots are looked at again every 1,000 ticks here."""
    charging = {"name": "opportunity", "check_idle_every": 1000}
    strategy = {"charging": charging, "allocation": "first-come", "right_of_way": "wait"}
    run = Simulation(crowd(1, [(4, 3), (0, 3)], strategy=strategy))
    robots = run.world.robots
    while (run.tick < 120 and robots.goal_type[0] == GOAL_CHARGE) or run.tick == 0:
        run.run(until=run.tick + 1)
        assert robots.goal_type[1] != GOAL_CHARGE, "the only charger is taken"
    full, cell = run.tick, robots.cell[1]
    assert robots.charge[0] == 100 * BATTERY_PERCENT and full % 50 != 0
    run.run(until=full + 1)
    assert robots.goal_type[1] == GOAL_CHARGE and robots.cell[1] != cell


def test_a_charger_is_free_when_the_robot_that_was_sent_there_fails() -> None:
    charging = {"name": "opportunity", "check_idle_every": 1000}
    strategy = {"charging": charging, "allocation": "first-come", "right_of_way": "wait"}
    faults = {"list": [{"robot": 0, "at": 3}], "tow_after": 5, "repair_time": 100}
    run = Simulation(crowd(1, [(8, 3), (0, 3)], strategy=strategy, faults=faults))
    run.run(until=2)
    assert run.world.robots.goal_type.tolist() == [GOAL_CHARGE, 0]
    run.run(until=5)
    assert run.world.robots.goal_type[1] == GOAL_CHARGE


def test_robots_that_wait_use_up_charge_and_are_looked_at_every_so_many_ticks() -> None:
    """At 80 % it need not charge; waiting takes 1 % a tick."""
    battery = {"drain": {"move": 0.5, "wait": 1}, "charge_rate": 1, "initial_charge": 90}
    sent = []
    for every in (15, 40):
        strategy = {
            "charging": {"name": "opportunity", "check_idle_every": every},
            "allocation": "first-come",
        }
        run = Simulation(crowd(1, [(0, 3)], battery=battery, strategy=strategy))
        while run.world.robots.goal_type[0] != GOAL_CHARGE:
            run.run(until=run.tick + 1)
        sent.append(run.tick)
    assert sent == [15, 40]
