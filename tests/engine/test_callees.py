"""Kernels that only kernels call: compiled once, in what Python calls, and kept for other processes."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from compiled_kernels import LISTENING
from numba import types
from numba.core.registry import cpu_target

from automaton.engine.jit import kernel as jit
from automaton.engine.jit.kernel import Kernel, jit_is_on, kernel
from automaton.engine.jit.numba_parts import LINKS_OTHERWISE, BaseFunction

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="compilation is off")

CALLEES = """
import numpy as np
from numba import njit
from automaton.engine.jit.kernel import kernel

@kernel
def halved(n):
    if n % 2:
        raise ValueError("an odd number")
    return n // 2

@kernel
def never_halved(n):
    return halved(n) if n != n else n  # LLVM finds that it calls nothing, after Numba has entered it

@kernel
def quartered(n):
    return never_halved(halved(halved(n)))

TABLE = np.arange(400_000)  # so large that Numba compiles its address in

@kernel
def looked_up(n):
    return TABLE[n]

@kernel
def doubled(n):
    return 2 * looked_up(n)

@njit
def of_numba(n):
    return quartered(n)
"""
CALLERS = """
from automaton.engine.jit.kernel import kernel
from callees import doubled, never_halved, of_numba, quartered

@kernel
def {name}(n):
    return {body}
"""
USED = f"""{LISTENING}function = getattr(__import__(sys.argv[1]), sys.argv[1])
results = [int(function(8))]
try:
    results.append(int(function(6)))
except ValueError as error:
    results.append(error.args)
print(json.dumps([compiled, *results]))
"""


def used(folder: Path, name: str, before: str = "") -> Any:
    """What a process compiles that calls a kernel, and what that returns and raises."""
    done = subprocess.run(
        [sys.executable, "-c", before + USED, name],
        env=os.environ
        | {"AUTOMATON_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": f"{folder}:{ROOT}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture
def modules(tmp_path: Path) -> Path:
    """Modules whose kernels call each other."""
    bodies = {
        "first": "never_halved(n) - n + quartered(n)",
        "second": "quartered(n) + never_halved(0)",
        "third": "doubled(n) - 14",
        "fourth": "of_numba(n)",
    }
    (tmp_path / "callees.py").write_text(CALLEES)
    for name, body in bodies.items():
        (tmp_path / f"{name}.py").write_text(CALLERS.format(name=name, body=body))
    return tmp_path


def test_what_kernels_call_is_compiled_once_for_all_processes(modules: Path) -> None:
    callees, raised = {"halved", "never_halved", "quartered"}, ["an odd number"]
    compiled, *results = used(modules, "first")
    assert (set(compiled), results) == ({"first", *callees}, [2, raised])
    assert used(modules, "first") == [[], 2, raised]
    # Another kernel of another process finds them in the cache, and links what is there.
    assert used(modules, "second") == [["second"], 2, raised]


def test_code_with_an_address_in_it_is_compiled_by_each_process(modules: Path) -> None:
    """Neither what looks into a large array, nor what calls that, is of use to another process."""
    both = {"looked_up", "doubled"}
    for name, callees in (("third", both), ("third", both), ("fourth", set())):
        compiled, *results = used(modules, name)
        assert results[0] == 2
        assert callees <= set(compiled)


OTHER = """
from numba.core.compiler import Compiler
usual = Compiler.compile_extra
Compiler.compile_extra = lambda self, func, other=None: usual(self, func)
"""


def test_with_a_numba_that_links_otherwise_each_kernel_has_code_of_its_own(modules: Path) -> None:
    compiled, *results = used(modules, "first", OTHER)
    assert (len(compiled), results) == (4, [2, ["an odd number"]])
    # It takes nothing for its own that was compiled the other way.
    assert len(used(modules, "second")[0]) == 4
    said = "from automaton.commands import main; main(['--version', '--verbose'])"
    for before, way in (
        (
            OTHER,
            "one by one, which is slower: in this Numba, Compiler.compile_extra takes other",
        ),
        ("", "the fast way: functions that only kernels call are compiled once"),
    ):
        done = subprocess.run(
            [sys.executable, "-c", before + said], cwd=ROOT, capture_output=True, text=True
        )
        assert f"kernels are compiled {way}" in " ".join(done.stdout.split())
        assert "Numba 0." in done.stdout and "compiled code in /" in done.stdout


def test_a_kernel_that_only_kernels_call_has_no_machine_code() -> None:
    if LINKS_OTHERWISE:
        pytest.skip(LINKS_OTHERWISE)
    inner: Kernel = kernel(lambda n: n + 1, cached=False)
    outer: Kernel = kernel(lambda n: inner(n), cached=False)
    assert outer(1) == 2
    (called,) = inner.callee.overloads.values()
    assert called.library.get_pointer_to_function(called.fndesc.llvm_func_name) == 0
    assert called.library._compiled_object is None
    assert inner(3) == 4, "called by Python it has"


def test_garbage_is_looked_for_seldom_while_a_kernel_is_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before, seen = gc.get_threshold(), []
    monkeypatch.setattr(jit.COMPILING, "begin", lambda: seen.append(gc.get_threshold()))
    kernel(lambda n: n, cached=False)(1)
    assert seen[0] >= (50_000, 50, 1000)
    assert gc.get_threshold() == before


def test_the_type_of_an_operator_is_inferred_once(monkeypatch: pytest.MonkeyPatch) -> None:
    import operator

    context = cpu_target.typing_context
    context.refresh()
    of_add = context.resolve_value_type(operator.add)
    operands = (types.int16, types.float32)
    first = context.resolve_function_type(of_add, operands, {})
    assert first.return_type == types.float32
    monkeypatch.setattr(type(of_add), "_depth", None, raising=False)
    for template in of_add.templates:
        monkeypatch.setattr(template, "apply", None, raising=False)
    assert BaseFunction.get_call_type(of_add, context, operands, {}) is first


STARTED = """
import gc
import automaton.commands
from automaton.__main__ import main

def run():
    from automaton.world.resolve import resolve
    from automaton.runs.simulation import Simulation
    print(gc.get_threshold()[0], gc.get_freeze_count())
    Simulation(resolve("tabletop-mini"))
    print(gc.get_threshold() == usual, gc.get_freeze_count() > 100_000)
    return 0

usual, automaton.commands.main = gc.get_threshold(), run
print(main())
"""


def test_no_garbage_is_looked_for_while_a_command_starts() -> None:
    done = subprocess.run([sys.executable, "-c", STARTED], capture_output=True, text=True)
    assert done.stdout.split() == ["300000", "0", "True", "True", "0"], done.stderr
