"""Auctions, batteries, lines and failures: the same digests wherever and however they are run."""

from __future__ import annotations

import numpy as np
import pytest
from fresh_process import told, told_here

from automaton.runs.simulation import Simulation
from automaton.studies.process_pool import run_all
from automaton.world.resolve import resolve

FAILING = "faults={failure_probability: 0.0005, tow_after: 80, repair_time: 200}"
SETTINGS = {
    "depots": ("orders.count=50", FAILING),
    "depots-full": ("orders.count=40", "strategy.charging=opportunity"),
    "depots-line": ("orders.count=50", "battery.drain.wait=0.02", "battery.reserve=4"),
}
FEW = (
    "orders={generator: stations, count: 6, mean_interarrival_time: 20}",
    "battery.initial_charge=50",
    FAILING,
)


@pytest.mark.parametrize("name", SETTINGS)
def test_how_robots_are_stored_does_not_matter(name: str) -> None:
    resolved = resolve(name, SETTINGS[name])
    robots = resolved.scenario.fleet.robots
    digests = set()
    for shift in range(3):
        order = np.roll(np.arange(robots, dtype=np.int32)[:: 1 if shift else -1], shift)
        run = Simulation(resolved, seed=3, storage=order)
        run.run(until=3000)
        digests.add((run.tick, run.digest))
    assert len(digests) == 1


def test_fresh_processes_and_workers_agree() -> None:
    settings = SETTINGS["depots"]
    fresh = told("depots", 1500, *settings, PYTHONHASHSEED="5")
    assert fresh == told_here("depots", 1500, *settings)
    scenarios = [resolve(name, SETTINGS[name]) for name in ("depots", "depots-line")]
    alone, together = (run_all(scenarios, range(1, 4), workers) for workers in (1, 2))
    assert alone == together


@pytest.mark.parametrize(
    "allocation", ["auction", "{name: auction, auctioneer: token, announcement_radius: 3}"]
)
def test_with_the_jit_off_everything_is_the_same(allocation: str) -> None:
    settings = (*FEW, f"strategy.allocation={allocation}")
    compiled = told_here("depots", 400, *settings)
    assert told("depots", 400, *settings, NUMBA_DISABLE_JIT="1") == compiled


def test_a_run_in_pieces_is_the_same_run() -> None:
    resolved = resolve("depots", SETTINGS["depots"])
    whole = Simulation(resolved, seed=9)
    whole.run()
    pieces = Simulation(resolved, seed=9)
    while not pieces.finished:
        pieces.run(until=pieces.tick + 97)
    assert (pieces.tick, pieces.digest) == (whole.tick, whole.digest)
