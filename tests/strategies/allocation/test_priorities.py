"""Priorities: of the orders that it could do, a robot gets one of the highest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from drawn_scenes import recorded_run, scene

from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify_recording
from automaton.world.resolved import Resolved

CORRIDOR = "t.......t"
ALLOCATIONS = ("first-come", "independent", "independent-python", "shortest-job", "greedy")


def corridor(
    allocation: str, *lines: dict[str, Any], at: Sequence[int] = (0,), **parts: Any
) -> Resolved:
    return scene(
        CORRIDOR,
        [(x, 0) for x in at],
        orders={"list": list(lines)},
        strategy={"allocation": allocation, "right_of_way": "wait"},
        **parts,
    )


def sequence(run: Simulation) -> list[int]:
    """The orders in the sequence in which they were delivered."""
    delivered = run.world.orders.delivered.tolist()
    assert run.finished
    return sorted(range(len(delivered)), key=delivered.__getitem__)


EAST, WEST = {"from": (0, 0), "to": (8, 0)}, {"from": (8, 0), "to": (0, 0)}


@pytest.mark.parametrize("allocation", ALLOCATIONS)
def test_the_highest_priority_comes_first(allocation: str) -> None:
    """Order 0 is the oldest, the nearest and the shortest."""
    lines = (EAST, WEST | {"priority": 2}, WEST | {"priority": -3}, EAST | {"priority": 1})
    run = Simulation(corridor(allocation, *lines))
    run.run()
    assert sequence(run) == [1, 3, 0, 2]


@pytest.mark.parametrize("allocation", ALLOCATIONS)
def test_one_that_is_released_later_comes_before_those_that_wait(allocation: str) -> None:
    urgent = WEST | {"priority": 9, "release": 5}
    run = Simulation(corridor(allocation, EAST, EAST, urgent, EAST))
    run.run()
    assert sequence(run)[:2] == [0, 2], "the order that the robot has is not taken from it"


def test_tours_go_by_priority_too() -> None:
    lines = [{"stops": [(x, 0)], "priority": p} for x, p in ((1, 0), (7, 4), (2, 4), (1, 7))]
    for allocation, expected in (("greedy", [3, 2, 1, 0]), ("first-come", [3, 1, 2, 0])):
        run = Simulation(corridor(allocation, *lines))
        run.run()
        assert sequence(run) == expected


@pytest.mark.parametrize(("allocation", "first", "last"), [("first-come", 2, 0), ("greedy", 0, 2)])
def test_an_order_that_comes_back_goes_by_its_priority(
    allocation: str, first: int, last: int
) -> None:
    """Robot 0 has taken an order and breaks down; robot 1 brings its own, and then what is urgent."""
    faults = {"list": [{"robot": 0, "at": 2}], "tow_after": 1, "repair_time": None}
    lines = (WEST, WEST | {"priority": 1, "release": 3}, WEST)
    resolved = corridor(allocation, *lines, at=(0, 8), faults=faults)
    run, recorder = recorded_run(resolved)
    assert sequence(run) == [first, 1, last]
    found = verify_recording(recorder.recording())
    assert found.report.violations == [] and found.difference is None


@pytest.mark.parametrize("allocation", ["auction", "cooperative", "adaptive"])
def test_allocations_that_know_no_priorities_say_so(allocation: str) -> None:
    with pytest.raises(InputError, match=r"ignores priorities|only on shelves|access_cell"):
        corridor(allocation, EAST, EAST | {"priority": 1})


def test_a_file_of_orders_has_a_column_for_them(tmp_path: Any) -> None:
    from automaton.world.resolve import resolve

    (tmp_path / "orders.csv").write_text(
        "released,from_x,from_y,to_x,to_y,priority\n0,0,0,8,0,0\n0,8,0,0,0,7\n"
    )
    text = (
        f"name: p\nlayout:\n  picture: |\n    {CORRIDOR}\n"
        "fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}\n"
        "orders: {transports: {file: orders.csv}}\n"
        "strategy: {allocation: greedy, right_of_way: wait}\nstop: {when: delivered, max_duration: 99}\n"
    )
    (tmp_path / "p.yaml").write_text(text)
    run = Simulation(resolve(tmp_path / "p.yaml"))
    run.run()
    assert sequence(run) == [1, 0]
