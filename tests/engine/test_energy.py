"""Batteries: what operations take and when, what an empty one does, and how chargers fill them."""

from __future__ import annotations

import numpy as np
import pytest
from battery_scenes import MOVES, BatteryScene
from drawn_scenes import recorded_run, scene

from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_DOWN,
    ACTION_MOVE,
    ACTION_QUEUE,
    ACTION_WAIT,
    BATTERY_FULL,
    NIL,
    STATUS_DEPLETED,
    STATUS_UP,
)
from automaton.scenario.schema import Battery, Drain, Durations
from automaton.verification.validator import validate_stored
from automaton.world.rules import drain_table


def test_a_drain_may_be_many_times_a_battery() -> None:
    drain = Drain(move=100.0, loaded_factor=10.0)
    table = drain_table(Battery(drain=drain, charge_rate=1.0))
    assert table[ACTION_MOVE].tolist() == [BATTERY_FULL, 10 * BATTERY_FULL]


def test_a_move_is_paid_when_it_begins() -> None:
    run = BatteryScene("A....", {"A": "EE"}, durations=Durations(move=3), battery=MOVES)
    assert [run.tick().charge("A") for _ in range(7)] == [97, 97, 97, 94, 94, 94, 94]
    assert run.at("A") == (2, 0)


def test_an_exhausted_robot_stops_in_its_cell_and_never_between_two() -> None:
    battery = Battery(drain=Drain(move=1.0), charge_rate=10.0, initial_charge=8.0)
    run = BatteryScene("A....", {"A": "EEEE"}, durations=Durations(move=3), battery=battery)
    run.tick(6)
    assert (run.at("A"), run.charge("A"), run.status("A")) == ((2, 0), 2, STATUS_UP)
    run.tick(2)  # the third move would take 3 %
    robots = run.world.robots
    assert run.status("A") == STATUS_DEPLETED
    assert (run.at("A"), robots.claim[0], robots.busy[0]) == ((2, 0), NIL, 0)
    assert run.charge("A") == 2, "what it cannot use it keeps"
    run.tick(50)
    assert run.at("A") == (2, 0)
    assert run.world.tally.ticks[0, ACTION_DOWN, 0] == 51


def test_standing_takes_what_the_scenario_says_until_nothing_is_left() -> None:
    battery = Battery(drain=Drain(move=1.0, wait=0.5), charge_rate=10.0, initial_charge=1.2)
    run = BatteryScene("A..", battery=battery)
    assert [run.tick().charge("A") for _ in range(4)] == pytest.approx([0.7, 0.2, 0, 0])
    assert run.status("A") == STATUS_DEPLETED


def test_a_load_makes_driving_dearer() -> None:
    orders = {"list": [{"from": [1, 0], "to": [3, 0]}]}
    battery = {
        "drain": {"move": 1.0, "pick": 0.5, "drop": 0.25, "loaded_factor": 2.0},
        "charge_rate": 10.0,
    }
    plain = scene(
        ".t.t.",
        [(0, 0)],
        orders=orders,
        battery=battery,
        durations={"pick": 3, "drop": 2},
        strategy={"allocation": "first-come", "right_of_way": "wait"},
    )
    run, _ = recorded_run(plain)
    # 1 move without the load, 3 ticks of picking, 2 moves with it, 2 ticks of setting down with it.
    spent = 1 * 1.0 + 3 * 0.5 + 2 * 2.0 + 2 * 0.25 * 2
    assert run.world.tally.energy_used[0] == spent * 10_000_000
    assert run.finished


CURVE = ((0.0, 10.0), (50.0, 4.0), (80.0, 1.0))


def test_a_charger_gives_by_the_curve_until_the_level_is_reached() -> None:
    battery = Battery(drain=Drain(move=1.0), charge_rate=CURVE, initial_charge=35.0)
    run = BatteryScene("c.", battery=battery, start=(5,))
    assert run.at("A") == (0, 0)
    run.send_to_charge("A", "", level=86)
    charges = [run.tick().charge("A") for _ in range(13)]
    assert charges == [45, 55, 59, 63, 67, 71, 75, 79, 83, 84, 85, 86, 86]
    assert not run.charges("A"), "it has nothing to do at the charger any more"
    tally = run.world.tally
    assert (tally.operations[0, ACTION_CHARGE, 0], tally.ticks[0, ACTION_CHARGE, 0]) == (1, 12), (
        "one stay of 12 ticks"
    )


def test_a_battery_is_never_more_than_full() -> None:
    battery = Battery(drain=Drain(move=1.0), charge_rate=30.0, initial_charge=50.0)
    run = BatteryScene("c.", battery=battery, start=(5,))
    run.send_to_charge("A", "", level=100)
    assert [run.tick().charge("A") for _ in range(3)] == [80, 100, 100]
    assert run.world.tally.charged[0] == 500_000_000


LINE = "~~~c~"


def waiting_three(picture: str, gap: int) -> tuple[BatteryScene, list[str]]:
    """C, then B, then A come to the charger; who charges, in the order in which they begin."""
    battery = Battery(drain=Drain(move=0.1), charge_rate=10.0, initial_charge=50.0)
    run = BatteryScene(picture, battery=battery, start=tuple(range(8, 11)))
    run.tick(gap)
    for name, route in (("A", "EEE"), ("B", "EE"), ("C", "E")):
        run.send_to_charge(name, route, level=70)
    served: list[str] = []
    for _ in range(40):
        run.tick()
        for name in "ABC":
            if run.at(name) == (3, 0) and name not in served:
                served.append(name)
            if run.at(name) == (3, 0) and not run.charges(name):
                run.send(name, "E")
    return run, served


@pytest.mark.parametrize("gap", range(6))
def test_first_come_first_served_in_cells_for_any_number(gap: int) -> None:
    """Where they stand side by side, no draw decides: who came first goes first."""
    run, served = waiting_three(LINE, gap + 1)
    assert served == ["C", "B", "A"]
    assert all(run.at(name) == (4, 0) for name in "ABC")
    # Each charges for three ticks and leaves in the fourth.
    assert run.world.tally.ticks[:, ACTION_QUEUE, 0].tolist() == [8, 4, 0]


def test_robots_in_a_line_draw_no_waits() -> None:
    """They begin when it is their turn, not when a wait is over."""
    run, _ = waiting_three(LINE, 1)
    assert run.world.tally.operations[:, ACTION_WAIT].sum() == 0
    assert run.world.tally.operations[:, ACTION_QUEUE].sum() > 0


def test_the_first_in_a_narrow_lane_is_served_first() -> None:
    _, served = waiting_three("...c~", 1)
    assert served == ["C", "B", "A"]


# The charger c ends a narrow lane: who has charged meets whoever waits at its door, head-on.
DEAD_END = """
c.~~t
##~~t
"""
DRAIN = {"drain": {"move": 1.0}, "charge_rate": 5.0, "initial_charge": 50.0, "reserve": 25.0}
TRIPS = {"generator": "stations", "count": 30}


def dead_end(seed: int, right_of_way: str) -> object:
    strategy = {"allocation": "auction", "charging": "insertion", "right_of_way": right_of_way}
    resolved = scene(
        DEAD_END,
        [(2, 1), (3, 1)],
        battery=DRAIN,
        orders=TRIPS,
        strategy=strategy,
        seed=seed,
    )
    run, recorder = recorded_run(resolved)
    assert validate_stored(recorder.recording()).valid
    return run


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_robot_that_leaves_a_dead_end_charger_gets_past_the_line(seed: int) -> None:
    run = dead_end(seed, "retreat")
    assert run.finished and run.world.tally.failures.sum() == 0  # type: ignore[attr-defined]
    assert run.world.tally.charged.all()  # type: ignore[attr-defined]


def test_without_withdrawals_it_does_not() -> None:
    assert not all(dead_end(seed, "wait").finished for seed in range(1, 6))  # type: ignore[attr-defined]


def test_storage_does_not_decide_who_is_first_in_line() -> None:
    battery = Battery(drain=Drain(move=0.1), charge_rate=10.0, initial_charge=50.0)
    digests = set()
    for storage in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        run = BatteryScene(LINE, battery=battery, start=(8, 8, 8), storage=storage)
        for name in "ABC":
            run.send_to_charge(name, "EEE", level=70)
        run.tick(12)
        digests.add(run.run.digest)
    assert len(digests) == 1
    assert np.count_nonzero(run.world.robots.ticket) == 2, (
        "and the other two have different tickets"
    )
