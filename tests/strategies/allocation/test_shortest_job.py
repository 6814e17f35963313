"""Which order scores highest."""

from __future__ import annotations

import numpy as np
import pytest
from example_counts import examples
from pod_floors import drawn_pods
from pod_scenes import line_ticks, played, pod_scene

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.strategy.placing import is_open
from strategies.allocation.shortest_job import WORST, ShortestJobState, best_order, score

FLOORS = examples(40)


def test_no_open_order_scores_higher() -> None:
    """Orders that are left out early, since the way to them is too long, would not be taken."""
    chosen = 0
    for number in range(FLOORS):
        try:
            run = Simulation(drawn_pods(number))
        except InputError:
            continue
        run.run(1 + number % 9)
        run.world.orders.reserved_by[:] = NIL
        run.world.pod_stations.taken[:] = 0
        world, out = run.world.read_only(), run.decisions.allocation
        out.order_taken[:] = 0
        state = ShortestJobState(
            age=500 * (number % 3), job=1000, per_line=number % 2, parks=0, storage=0
        )
        for i in np.flatnonzero((world.robots.cell != NIL) & (world.robots.load == NIL)):
            worth = {
                order: (int(world.orders.priority[order]), score(*asked, WORST), -order)
                for order in range(world.clock.first_open, world.clock.known_orders)
                if is_open(world, out, i, order)
                for asked in [(world, run.workspace, state, i, order)]
            }
            worth = {order: one for order, one in worth.items() if one[1] > WORST}
            best = max(worth, key=worth.__getitem__, default=NIL)
            assert best_order(world, out, state, run.workspace, i) == best
            chosen += len(worth) > 1
    assert chosen > FLOORS // 4, "there was something to choose"


@pytest.mark.parametrize("per_line", [False, True])
def test_a_pod_with_more_open_lines_comes_first_if_driving_counts_per_line(per_line: bool) -> None:
    """The robot stands at pod 1, which has one line; pod 4 has three."""
    lines = [{"pod": 1}, {"pod": 4}, {"pod": 4}, {"pod": 4}]
    allocation = {"name": "shortest-job", "idle": "stay", "per_line": per_line, "age": 0}
    run = played(pod_scene(lines, strategy={"allocation": allocation, "right_of_way": "wait"}))
    done = line_ticks(run)
    assert (max(done[1:]) < done[0]) == per_line, done
