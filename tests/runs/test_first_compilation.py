"""Another process compiles a part of the first run: the right kernels, as long as it is wanted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from automaton.engine.features import FAULTS, GATES, compiled_feature
from automaton.engine.jit.kernel import jit_is_on
from automaton.runs import first_compilation
from automaton.runs.first_compilation import compiled_parts, compiled_side_by_side
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.allocation.cooperative import Cooperative

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="compilation is off")

MISSED = """
import gc
from numba.core.dispatcher import Dispatcher
from automaton.engine.features import FAULTS, GATES
from automaton.engine.gates import update_gates
print(len(update_gates.callee.overloads), update_gates.is_compiled)
from automaton.runs.first_compilation import compile_parts
compile_parts(["strategies.allocation.cooperative:Cooperative", "no.such.module:Rule"], [FAULTS, GATES])
kernels = [one for one in gc.get_objects() if isinstance(one, Dispatcher)]
for count in ("cache_hits", "cache_misses"):
    print(sum(len(getattr(kernel.stats, count)) for kernel in kernels))
"""


@pytest.fixture
def others(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Any]:
    """The other processes; it is a first run on two cores."""
    begun, popen = [], subprocess.Popen

    def started(*arguments: Any, **options: Any) -> Any:
        begun.append(popen(*arguments, **options))
        return begun[-1]

    monkeypatch.setattr(first_compilation.subprocess, "Popen", started)
    monkeypatch.setattr(first_compilation, "world_marker", lambda: tmp_path / "complete")
    monkeypatch.setattr(first_compilation, "cores", lambda: 2)
    return begun


def test_the_other_process_compiles_what_a_run_needs_and_nothing_else() -> None:
    Simulation(resolve("tabletop-mini", ["strategy.allocation=cooperative"]))  # fills the cache
    for number in (FAULTS, GATES):
        compiled_feature(number)
    done = subprocess.run([sys.executable, "-c", MISSED], capture_output=True, text=True)
    assert done.stdout.split() == ["0", "True", "3", "0"], done.stderr


def test_a_first_run_waits_for_the_other_process(others: list[Any]) -> None:
    with compiled_side_by_side([Cooperative], [FAULTS]):
        assert others[0].poll() is None
    assert [other.returncode for other in others] == [0]


def test_a_first_run_that_fails_ends_the_other_process(others: list[Any]) -> None:
    with pytest.raises(RuntimeError), compiled_side_by_side([Cooperative], [FAULTS]):
        raise RuntimeError
    assert others[0].returncode < 0


def test_the_other_process_ends_with_the_one_that_asked(others: list[Any]) -> None:
    with compiled_side_by_side([Cooperative], [FAULTS]):
        others[0].stdin.close()
        assert others[0].wait(20) == 1


@pytest.mark.parametrize("name", ["world_marker", "cores", "parent_process"])
def test_a_later_run_one_core_or_a_worker_has_no_other_process(
    name: str, others: list[Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found = {"world_marker": tmp_path, "cores": 1, "parent_process": object()}[name]
    monkeypatch.setattr(first_compilation, name, lambda: found)
    with compiled_side_by_side([Cooperative], [FAULTS]):
        pass
    assert not others


def test_where_no_process_can_be_started_this_one_compiles_alone(
    others: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*arguments: Any, **options: Any) -> None:
        raise OSError("too many processes")

    monkeypatch.setattr(first_compilation.subprocess, "Popen", refused)
    with compiled_side_by_side([Cooperative], [FAULTS]):
        pass


def test_scenarios_that_use_other_features_need_other_parts_compiled() -> None:
    usual = compiled_parts(resolve("tabletop-mini"))
    assert compiled_parts(resolve("tabletop-mini", ["fleet.robots=2"])) == usual
    for setting in (
        "faults.failure_probability=0.001",
        "faults.delays={probability: 0.01, ticks: {from: 1, to: 2}}",
        "information=orders",
        "world.extra_tick_probability=0.1",
        "strategy.right_of_way=pibt",
    ):
        assert compiled_parts(resolve("tabletop-mini", [setting])) != usual, setting
