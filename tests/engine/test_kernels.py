"""Promises about compiled code: one signature for each kernel, and what is said while it is compiled."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from automaton.engine.jit import kernel as jit
from automaton.engine.jit.kernel import jit_is_on
from automaton.engine.jit.numba_parts import TRIED
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

ROOT = Path(__file__).parents[2]

LISTED = """
import sys
from automaton.engine.jit.kernel import Kernel
from automaton.world.resolve import resolve
from automaton.runs.simulation import Simulation
from automaton.bench import warehouse_speed as plans
from automaton.papers.traffic_trials import Setting, exact, run_seed
for allocation in ("independent", "cooperative", "adaptive"):
    simulation = Simulation(resolve("tabletop-mini", [f"strategy.allocation={allocation}"]))
    simulation.run()
for routing in ("astar", "traffic-avoidance"):
    simulation = Simulation(resolve("tabletop-mini", [f"strategy.routing={routing}"]))
    simulation.run()
run_seed(Setting(exact), 1)
from automaton.papers.auction_study import REPRODUCTION
from automaton.papers.reproduction_study import reproduce
reproduce(REPRODUCTION, 1)
import random
from strategies.allocation.auction import sequential
from strategies.linear_sum_assignment import assignment_for
sys.path.insert(0, "tests/helpers")
from auction_scenes import random_auction
for robots, rule in ((2, sequential.BID_AVERAGE), (5, sequential.BID_AVERAGE_ADDED)):
    *market, items = random_auction(random.Random(robots), robots, 4, policy=1)
    sequential.parallel(*market, items, 4, rule, 500)
    sequential.assign_once(*market, assignment_for(5), items, 4, rule, 500)
plans.prepare_avoidance(30, 1)()
kernels = {
    kernel for name, module in sys.modules.items() if name.startswith(("automaton.", "strategies."))
    for kernel in vars(module).values() if isinstance(kernel, Kernel)
}
for kernel in kernels:
    count = max(len(kernel.signatures), len(kernel.callee.signatures))
    print(kernel.py_func.__name__, count, kernel.py_func.__module__)
"""

# What the world has writable is read-only for strategies.
READ_AND_WRITTEN = {"has_room", "first_cell"}


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_every_kernel_is_compiled_for_one_signature() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LISTED], cwd=ROOT, capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in done.stdout.splitlines()]
    assert len(rows) > 60
    several = {name for name, count, _ in rows if int(count) > 1}
    assert several <= READ_AND_WRITTEN


FEW = """
import gc, sys
from automaton.engine.jit.kernel import Kernel
from automaton.world.resolve import resolve
from automaton.runs.simulation import Simulation
Simulation(resolve("tabletop-mini")).run()
kernels = [one for one in gc.get_objects() if isinstance(one, Kernel)]
made = [one for one in kernels if one._for_python or one._for_kernels]
print(len(kernels), len(made))
print("scipy.linalg" in sys.modules, "numba.typed.typedlist" in sys.modules)
import numpy as np
from numba import njit
print(njit(lambda a: np.dot(a, a))(np.eye(2))[0, 0])
"""


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_run_makes_nothing_of_kernels_that_it_finds_in_the_cache_of_others() -> None:
    Simulation(resolve("tabletop-mini")).run()  # fills the cache
    done = subprocess.run([sys.executable, "-c", FEW], capture_output=True, text=True, check=True)
    kernels, made, scipy, lists, product = done.stdout.split()
    assert int(kernels) > 300 and int(made) < 20
    assert lists == "False", "what Numba compiles with was imported, which takes 0.25 s"
    # Numba would import SciPy to see whether it is there; kernels that multiply still find it.
    assert (scipy, float(product)) == ("False", 1.0)


RUN = (
    "from automaton.commands import main; sys.exit(main(['run', 'tabletop-mini', '--until', '1']))"
)


@pytest.mark.parametrize(
    ("missing", "told"),
    [
        ("import numba.np.arrayobj as part; del part.populate_array", "cannot import name"),
        (
            "import numba.core.dispatcher as part; part.Dispatcher.get_call_template = print",
            "Dispatcher.get_call_template takes other arguments",
        ),
        (
            "import numba.core.event as part; del part.Listener.on_end; part.Listener.on_finish = 1",
            "event.Listener has other events",
        ),
    ],
)
def test_a_numba_without_the_private_parts_is_refused_in_a_sentence(
    missing: str, told: str
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; {missing}; {RUN}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert told in done.stderr and done.stderr.count("\n") == 1
    assert f"tested with {TRIED[0]} to {TRIED[1]}: pip install" in done.stderr


def test_what_is_compiled_for_long_is_said_once_and_is_no_time_of_a_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(jit, "COMPILE_NOTICE_DELAY_S", 0.0)
    kernel = SimpleNamespace(py_func=SimpleNamespace(__module__="strategies.right_of_way.retreat"))
    event: Any = SimpleNamespace(data={"dispatcher": kernel})
    listener = jit._Compilations()
    for _ in range(2):
        listener.on_start(event)
        listener.on_start(event)  # a kernel that it calls
        listener._timer.join(10)
        listener.on_end(event)
        listener.on_end(event)
    said = "automaton: first use on this machine: compiling right of way, once ...\n"
    assert capsys.readouterr().err == said
    assert listener.seconds > 0
    assert jit.subject_of("automaton.engine.loop") == "the world"
    # The first run on a machine is told as that; what explain needs beyond it is not.
    marker = tmp_path / "complete"
    monkeypatch.setattr(jit, "world_marker", lambda: marker)
    for said in ("first run of this version", "another part of the world (loop)"):
        other = jit._Compilations()
        other.announce("automaton.engine.loop")
        marker.touch()
        assert said in capsys.readouterr().err
    assert jit.subject_of("mine") == "mine"


def test_each_stream_of_random_draws_has_a_number_of_its_own() -> None:
    found = [
        match.groups()
        for top in ("automaton", "strategies")
        for path in sorted((ROOT / top).rglob("*.py"))
        for match in re.finditer(r"^(STREAM_\w+) = (\d+)\b", path.read_text(), re.MULTILINE)
    ]
    assert len(found) > 15
    for part in (0, 1):
        assert len({pair[part] for pair in found}) == len(found), sorted(found)
