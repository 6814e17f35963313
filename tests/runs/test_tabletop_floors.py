"""The table-top rules on floors that are in no list: any tables, positions, destinations, robots.

b+-+-+d      every run ends with everything delivered and every robot in its parking bay; for one
robot the
b|s|s|d      ticks follow from the rules alone and are computed here a second time.
b+-+-+d
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_paths import Pose, Ways

from automaton.engine.state import (
    ACTION_BLOCKED,
    ACTION_MOVE,
    ACTION_RETREAT,
    ACTION_WAIT,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_WAITING,
)
from automaton.errors import InputError
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Durations, Fleet, Scenario, Strategies
from automaton.world.resolve import Resolved, resolve

ALLOCATIONS = ("independent", "cooperative", "adaptive")
CYCLES = Durations(move=1, turn=22, pick=9, drop=9, try_drop=4)


@dataclass(frozen=True)
class Floor:
    """Parameters of the generator, and who drives there."""

    tables: int
    positions: int
    destinations: int
    robots: int
    allocation: str

    def resolved(self) -> Resolved:
        layout = {
            "generator": "tabletop",
            "tables": self.tables,
            "positions": self.positions,
            "destinations": self.destinations,
        }
        return resolve(
            Scenario(
                name="floor",
                layout=layout,
                fleet=Fleet(robots=self.robots, kinematics="rail"),
                durations=CYCLES,
                strategy=Strategies(allocation=self.allocation, right_of_way="retreat"),
            )
        )


@st.composite
def floors(draw: Any) -> Floor:
    positions = draw(st.integers(1, 7))
    rows = positions + 2
    return Floor(
        tables=draw(st.integers(1, 6)),
        positions=positions,
        destinations=draw(st.integers(1, rows)),
        robots=draw(st.integers(1, rows)),
        allocation=draw(st.sampled_from(ALLOCATIONS)),
    )


def assert_loads_conserved(run: Simulation) -> None:
    """Every load is on one shelf, on one robot, or delivered."""
    orders, robots, content = run.world.orders, run.world.robots, run.world.slots.content
    for order, state in enumerate(orders.state.tolist()):
        on_shelves = np.flatnonzero(content == order).tolist()
        carriers = np.flatnonzero(robots.load == order).tolist()
        current_slot = int(orders.current_slot[order])
        if state == ORDER_WAITING:
            assert (on_shelves, carriers) == ([current_slot], [])
        elif state == ORDER_CARRIED:
            assert (len(on_shelves), len(carriers), current_slot) == (0, 1, NIL)
            assert orders.reserved_by[order] == robots.identity[carriers[0]]
        else:
            assert (on_shelves, carriers, current_slot) == ([], [], orders.target[order])


def assert_done(run: Simulation) -> None:
    assert run.finished, f"not finished after {run.tick} ticks"
    orders, robots, slots = run.world.orders, run.world.robots, run.world.slots
    assert (orders.state == ORDER_DELIVERED).all() and (orders.legs >= 1).all()
    assert (
        (orders.reserved_by == NIL).all()
        and (slots.reserved_by == NIL).all()
        and (slots.content == NIL).all()
    )
    assert (robots.parked == 1).all() and (robots.cell == NIL).all()
    assert run.world.tally.illegal.sum() == 0
    assert metrics_of(run)["delivered"] == len(orders.state)


@settings(max_examples=examples(300))
@given(floors(), st.integers(0, 10**6))
def test_every_floor_is_emptied_and_every_robot_parked(floor: Floor, seed: int) -> None:
    run = Simulation(floor.resolved(), seed=seed)
    for until in (50, 200, 700):
        run.run(until=until)
        assert_loads_conserved(run)
    run.run()
    assert_loads_conserved(run)
    assert_done(run)
    if floor.robots == 1:
        times = run.world.tally.operations.sum((0, 2))
        assert times[[ACTION_WAIT, ACTION_BLOCKED, ACTION_RETREAT]].tolist() == [0, 0, 0], (
            "nobody is in its way"
        )
    if floor.allocation == "independent":
        assert (run.world.orders.legs == 1).all()


@pytest.mark.parametrize("allocation", ALLOCATIONS)
@pytest.mark.parametrize("robots", [1, 2, 3])
@pytest.mark.parametrize("destinations", [1, 2, 3])
def test_the_smallest_floor(allocation: str, robots: int, destinations: int) -> None:
    """b+-+d / b|s|d / b+-+d: one load; robot 0 fetches it, the others stay in their bays."""
    for seed in range(5):
        run = Simulation(Floor(1, 1, destinations, robots, allocation).resolved(), seed=seed)
        run.run()
        assert_done(run)
        moves = run.world.tally.operations[:, ACTION_MOVE].sum(1)
        assert (moves > 0).tolist() == [True] + [False] * (robots - 1)


def test_robots_without_work_stay_parked() -> None:
    run = Simulation(Floor(1, 2, 4, 4, "independent").resolved(), seed=1)
    run.run()
    assert_done(run)
    ticks = run.world.tally.ticks.sum((1, 2))
    assert np.count_nonzero(ticks) == 2, "two loads, two robots"


def test_more_robots_than_bays_is_an_error_that_says_so() -> None:
    with pytest.raises(InputError, match=r"fleet\.robots is 4 but the floor has 3 parking bays"):
        Floor(1, 1, 1, 4, "independent").resolved()


# One robot, computed by hand


def lone_robot_ticks(resolved: Resolved, run: Simulation) -> int:
    """makespan of one independent robot by the rules: nearest load first, ties to the lowest order.

    Costs are ticks on (cell, axis); `run` tells the targets of the orders and is not run.
    """
    floor_plan = resolved.floor_plan
    ways = Ways(floor_plan, "rail", CYCLES.move, CYCLES.turn)
    slot_cell = run.world.slots.cell.tolist()
    picks = [slot_cell[slot] + 1 for slot in run.world.orders.source.tolist()]
    drops = [slot_cell[slot] - 1 for slot in run.world.orders.target.tolist()]

    @cache
    def costs(pose: Pose) -> dict[Pose, int]:
        return ways.costs(pose)

    def drive(pose: Pose, cell: int) -> tuple[int, Pose]:
        known = costs(pose)
        return min((known[at], at) for at in ((cell, 0), (cell, 1)) if at in known)

    home = int(floor_plan.bays[0, 1])
    pose, ticks, waiting = (home, 1), 0, list(range(len(picks)))
    while waiting:
        order = min(waiting, key=lambda order: (drive(pose, picks[order])[0], order))
        waiting.remove(order)
        for cell, handling in ((picks[order], CYCLES.pick), (drops[order], CYCLES.drop)):
            cost, pose = drive(pose, cell)
            ticks += cost + handling
    return ticks + drive(pose, home)[0]


@settings(max_examples=examples(80))
@given(floors(), st.integers(0, 10**6))
def test_one_robot_takes_the_ticks_that_the_rules_give(floor: Floor, seed: int) -> None:
    alone = Floor(floor.tables, floor.positions, floor.destinations, 1, "independent")
    run = Simulation(alone.resolved(), seed=seed)
    expected = lone_robot_ticks(alone.resolved(), run)
    run.run()
    assert run.tick == expected


@pytest.mark.parametrize("name", ["tabletop-1", "tabletop-2"])
def test_one_robot_on_the_published_floors(name: str) -> None:
    resolved = resolve(name, ["fleet.robots=1", "strategy.allocation=independent"])
    for seed in range(1, 6):
        run = Simulation(resolved, seed=seed)
        expected = lone_robot_ticks(resolved, run)
        run.run()
        assert run.tick == expected


@pytest.mark.parametrize(
    ("name", "allocation", "reference"),
    [
        ("tabletop-1", "independent", 5137),
        ("tabletop-2", "independent", 5830),
        ("tabletop-1", "cooperative", 4615),
        ("tabletop-2", "cooperative", 9363),
    ],
)
def test_one_robot_is_as_fast_as_the_reference(name: str, allocation: str, reference: int) -> None:
    """Within 3 standard errors + 2 % of the mean that the same rules gave elsewhere."""
    resolved = resolve(name, ["fleet.robots=1", f"strategy.allocation={allocation}"])
    ticks = []
    for seed in range(1, 21):
        run = Simulation(resolved, seed=seed)
        run.run()
        assert_done(run)
        ticks.append(run.tick)
    allowed = 3 * float(np.std(ticks, ddof=1)) / len(ticks) ** 0.5 + 0.02 * reference
    assert abs(float(np.mean(ticks)) - reference) <= allowed
