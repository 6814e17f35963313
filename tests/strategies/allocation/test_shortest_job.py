"""Which order scores highest."""

from __future__ import annotations

import numpy as np
from example_counts import examples
from pod_floors import drawn_pods

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
        state = ShortestJobState(age=500 * (number % 3), job=1000, parks=0, storage=0)
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
