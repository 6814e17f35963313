"""The worked example of De Ryck et al. (section 4) in full simulation, as far as the world allows.

Robots with 100 % at position 3 and 45 % at position 1 have lists 7, 8, 13 and 5, 4, 9; then the task at
position 14 is announced. kc = 0.5 %/s, kr = 5 %/s, the only charger at position 2, epsilon = 0.5. Robot
1 wins by 145 against 154, though robot 2 is nearer: that one would have to charge.
"""

from __future__ import annotations

import pytest

from automaton.engine.state import ACTION_CHARGE, ORDER_DELIVERED
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from layouts.depots import CELL_OF_POSITION

FIRST = (7, 8, 13, 5, 4, 9)
LAST = len(FIRST)  # the number of the order that is announced later


def visits() -> str:
    """The first six at once, 14 when robots have begun."""
    lines = [(place, 0) for place in FIRST] + [(14, 2)]
    texts = [
        f"{{from: {list(CELL_OF_POSITION[p])}, to: {list(CELL_OF_POSITION[p])}, release: {at}}}"
        for p, at in lines
    ]
    return f"orders={{list: [{', '.join(texts)}]}}"


EXAMPLE = (
    "fleet.robots=2",
    f"fleet.start={[list(CELL_OF_POSITION[3]), list(CELL_OF_POSITION[1])]}",
    visits(),
    "durations={move: 10, pick: 0, drop: 0}",
    "battery={initial_charge: [100, 45], drain: {move: 0.5}, charge_rate: 5}",
    "strategy.allocation={name: auction, epsilon: 0.5}",
    "stop.max_duration=3000",
)
PAPER = "strategy.charging={name: insertion, never_strand: false}"


def example(*settings: str) -> Simulation:
    run = Simulation(resolve("depots", (*EXAMPLE, *settings)))
    run.run(until=1)
    robots, orders = run.world.robots, run.world.orders
    lists = [
        [int(robots.order[r]), *robots.order_queue[r, : robots.order_queue_length[r]].tolist()]
        for r in range(2)
    ]
    assert [[FIRST[order] for order in one] for one in lists] == [[7, 8, 13], [5, 4, 9]]
    run.run(until=2)
    run.run()
    assert (orders.state[:LAST] == ORDER_DELIVERED).all()
    return run


def winner(run: Simulation) -> int:
    """Who visited position 14, with which the run ends: it stands there."""
    cell = run.resolved.floor_plan.cell(*CELL_OF_POSITION[14])
    return int((run.world.robots.cell == cell).argmax())


def test_the_robot_that_need_not_charge_wins() -> None:
    run = example(PAPER)
    tally, orders = run.world.tally, run.world.orders
    assert run.finished and winner(run) == 0
    assert orders.delivered[LAST] == 180, "after 70 + 110 s"
    assert orders.delivered[:LAST].max() == 70
    assert tally.operations[:, ACTION_CHARGE].sum() == 0
    assert run.world.robots.charge[0] == 100_000_000, (
        "10 %, and 60 % of the way back to the charger"
    )


def test_without_batteries_the_nearer_one_wins() -> None:
    run = example("battery=null", "strategy.charging=none")
    assert run.finished and winner(run) == 1
    assert run.world.orders.delivered[LAST] == 100


def test_if_every_depot_charges_the_other_one_wins() -> None:
    """Section 3.2.1 lets all depots charge: robot 2 needs 1 s at its start, and bids 66 after all."""
    run = example(PAPER, "layout.chargers=[1, 2, 3]")
    assert run.finished and winner(run) == 1
    assert run.world.tally.charged[1] > 0


@pytest.mark.parametrize("reserve", [0, 10])
def test_who_must_reach_a_charger_afterwards_does_not_bid(reserve: int) -> None:
    """From the charger to 14 and back are 240 m, and a full battery lasts for 200."""
    run = example("strategy.charging=insertion", f"battery.reserve={reserve}")
    assert not run.finished
    assert run.world.orders.state[LAST] != ORDER_DELIVERED
    assert (run.world.tally.failures == 0).all(), "and nobody is stranded, as the paper's winner is"
