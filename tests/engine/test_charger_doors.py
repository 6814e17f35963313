"""Chargers on narrow floors: who is done gets out past those who queue."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from automaton.engine.state import ORDER_DELIVERED
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

SURROUNDED = """
name: surrounded
layout:
  picture: |
    #########
    #t.....t#
    #..A.B..#
    #..C.D..#
    #t..c..t#
    #########
fleet: {robots: 4, kinematics: omni}
orders: {generator: stations, count: 40}
battery: {drain: {move: 0.2}, charge_rate: 1, initial_charge: 19}
strategy: {allocation: first-come, charging: threshold, routing: shortest, right_of_way: retreat}
stop: {when: parked, max_duration: 20000}
"""
CORRIDOR = """
name: corridor
layout:
  picture: |
    t..A..c..B..t
    ......#......
fleet: {robots: 2, kinematics: omni}
orders: {generator: stations, count: 12}
battery: {drain: {move: 0.2}, charge_rate: 1, initial_charge: 19}
strategy: {allocation: first-come, charging: threshold, routing: shortest, right_of_way: retreat}
stop: {when: delivered, max_duration: 20000}
"""


@pytest.mark.parametrize("text", [SURROUNDED, CORRIDOR], ids=["three doors", "two doors"])
@pytest.mark.parametrize("routing", ["shortest", "congestion"])
def test_a_robot_that_is_done_gets_out_past_the_line(
    text: str, routing: str, tmp_path: Path
) -> None:
    path = tmp_path / "floor.yaml"
    path.write_text(text)
    for seed in range(1, 7):
        run = Simulation(resolve(path, [f"strategy.routing={routing}"], seed=seed))
        run.run()
        assert run.finished and (run.world.orders.state == ORDER_DELIVERED).all(), seed


def test_a_towed_robot_on_rails_stands_as_its_home_leads(tmp_path: Path) -> None:
    for tick in range(2, 12):
        faults = f"faults={{list: [{{robot: 0, at: {tick}}}], tow_after: 5, repair_time: 5}}"
        run = Simulation(resolve("tabletop-mini", [faults]))
        run.run()
        assert run.finished and run.world.tally.failures[:, 2].sum() == 1, tick


def test_a_branch_may_have_shorter_lists_than_the_plans_it_finds() -> None:
    run = Simulation(resolve("depots-full"))
    run.run(until=3)
    assert run.world.robots.order_queue_length.max() > 1
    short = "strategy.allocation={name: auction, max_orders_per_robot: 1, max_items: 1}"
    branch = run.continue_with(resolve("depots-full", [short]))
    branch.run(until=3000)
    assert int((branch.world.orders.state == ORDER_DELIVERED).sum()) > 20


def test_plans_end_with_the_strategy_that_made_them() -> None:
    run = Simulation(resolve("depots-full"))
    run.run(until=300)
    assert run.world.robots.order_queue_length.any()
    branch = run.continue_with(resolve("depots-full", ["strategy.allocation=first-come"]))
    assert not branch.world.robots.order_queue_length.any()


def test_auctions_need_to_see_everything() -> None:
    with pytest.raises(InputError, match="an auction needs information: everything"):
        resolve("depots", ["information=orders"])


def test_orders_far_apart_come_at_the_end_not_before_their_time() -> None:
    run = Simulation(
        resolve(
            "depots", ["orders={generator: stations, count: 2600, mean_interarrival_time: 1000000}"]
        )
    )
    release_tick = run.world.orders.release_tick
    assert (np.diff(release_tick) >= 0).all()
    assert release_tick.max() == run.resolved.scenario.stop.max_duration + 1
