"""The first run: two processes compile its 400 kernels in parallel, into one cache.

A second process compiles the features that the run uses and the kernels of its strategies. This
process compiles the loop, loads the kernels that are ready by then, and compiles the others itself,
even if the second process fails.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import parent_process

from automaton.engine.batches import decide_signature
from automaton.engine.features import compiled_feature
from automaton.engine.jit.kernel import COMPILATIONS, jit_is_on, world_marker
from automaton.scenario.schema import Faults
from automaton.strategy.contract import Strategy, compiled_decide
from automaton.world.resolved import Resolved


def cores() -> int:
    """Return the number of CPU cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def compiled_side_by_side(
    kinds: Sequence[type[Strategy]], features: Sequence[int]
) -> Iterator[None]:
    """Compile strategies and features in a second process while the loop is first compiled inside.

    `features`: numbers in automaton.engine.features. On exit the second process has ended.
    """
    if not jit_is_on() or world_marker().exists() or cores() < 2 or parent_process():
        yield
        return
    try:
        other = subprocess.Popen(
            [sys.executable, "-c", _command(kinds, features)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:  # process limit reached, or out of memory
        yield
        return
    try:
        yield
        begun = time.perf_counter()
        other.wait()
        COMPILATIONS.seconds += time.perf_counter() - begun
    finally:
        other.kill()
        other.communicate()


def compiled_parts(resolved: Resolved) -> Hashable:
    """A key that determines which parts a run compiles: equal keys need the same parts."""
    scenario = resolved.scenario
    return (
        *(choice.name for _, choice in resolved.choices),
        scenario.battery is None,
        scenario.faults == Faults(),
        scenario.faults.delays == Faults().delays,
        repr((scenario.world, scenario.information, scenario.layout, scenario.floor)),
        repr((scenario.durations, scenario.pods, scenario.orders.generator)),
    )


def _command(kinds: Sequence[type[Strategy]], features: Sequence[int]) -> str:
    """The program of the second process, which has the module path of this one."""
    names = [f"{kind.__module__}:{kind.__qualname__}" for kind in kinds]
    return (
        f"import sys; sys.path[:] = {sys.path!r}\n"
        f"from {__name__} import compile_for_another as compile\n"
        f"compile({names!r}, {list(features)!r})"
    )


def compile_for_another(names: Sequence[str], features: Sequence[int]) -> None:
    """Compile strategies and features; exit when the parent process ends."""
    threading.Thread(target=_end_with_stdin, daemon=True).start()
    compile_parts(names, features)


def compile_parts(names: Sequence[str], features: Sequence[int]) -> None:
    """Compile features, given by number, and the kernels of strategies, given as "module:class"."""
    for number in features:
        compiled_feature(number)
    signature = decide_signature()  # type: ignore[no-untyped-call]
    for name in names:
        module, _, kind = name.partition(":")
        with suppress(Exception):  # the process that uses the strategy reports the error
            compiled = getattr(import_module(module), kind).compiled
            if compiled is not None:
                compiled_decide(compiled, signature)


def _end_with_stdin() -> None:
    os.read(0, 1)  # not sys.stdin, whose lock this thread would hold when the process ends
    os._exit(1)
