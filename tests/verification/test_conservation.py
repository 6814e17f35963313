"""Conservation on drawn floors with pods: pods, lines, places and times add up in every tick.

A sample of what `tests/helpers/conservation_trials.py` does on 10,000 floors.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conservation_trials import digests, trials
from drawn_scenes import scene

from automaton.runs.simulation import Simulation

HELPERS = Path(__file__).parents[1] / "helpers"
FLOORS, WITHOUT_JIT = range(256, 300), range(100, 108)


def test_on_drawn_floors_everything_adds_up() -> None:
    wrong, figures = trials(FLOORS)
    assert wrong == []
    assert figures["floors"] > 25 and figures["finished"] > 5
    for name in ("visits", "joined", "queued", "early", "stored", "aside", "skus", "listed"):
        assert figures[name] > 0, f"no floor tells of {name}"


MEETING = """\
p...p
t...t
..t.."""


@pytest.mark.parametrize("storage", [(0, 1), (1, 0)])
def test_who_gets_the_last_place_does_not_depend_on_storage(storage: tuple[int, int]) -> None:
    lines = [{"pod": pod, "station": station} for pod, station in ((1, 1), (2, 2), (1, 3), (2, 3))]
    settings = {
        "durations": {"handling": {"line": 5}},
        "orders": {"lines": lines},
        "stations": {"P3": {"at": [2, 2], "max_trips": 1}},
        "strategy": {"allocation": "first-come", "routing": "shortest", "right_of_way": "retreat"},
    }
    run = Simulation(scene(MEETING, [(0, 0), (4, 0)], **settings), storage=np.array(storage))
    run.run()
    trips = run.world.lines.trip.tolist()
    assert run.finished and trips == [0, 1, 0, 2], "the robot of the lower identity goes on"


def test_with_the_jit_off_pods_go_the_same_ways() -> None:
    code = "from conservation_trials import digests; print(digests(range(%d, %d), 60))"
    command = [sys.executable, "-c", code % (WITHOUT_JIT.start, WITHOUT_JIT.stop)]
    environment = {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(HELPERS)}
    told = subprocess.run(
        command, env=os.environ | environment, capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == digests(WITHOUT_JIT, 60)
    assert len(told.stdout.splitlines()) > 4
