"""How far the kernels are that a run needs: which count, and when they are done."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from automaton.engine.jit.compile_progress import (
    CLEAR_LINE,
    CompileProgress,
    Compiling,
    kernels_of,
)
from automaton.engine.jit.kernel import jit_is_on, kernel

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="compilation is off")


@kernel(cached=False)
def half(x):
    return x // 2


@kernel(inline=True)
def pasted(x):
    return half(x) + 1


@kernel(cached=False)
def other(x):
    return x + 3


def loop(x):
    return [pasted(x) + half(x) for _ in range(1)]


@kernel(cached=False)
def decide(x):
    return half(x) + other(x)


def test_what_is_called_counts_once_but_not_what_is_pasted_into_its_callers() -> None:
    assert kernels_of(loop) == (half,)
    assert set(kernels_of(decide)) == {decide, half, other}


def test_kernels_are_done_when_they_are_compiled_or_what_calls_them_is_there() -> None:
    now = [5.0]
    compiling = Compiling(lambda: now[0])
    assert compiling.now() is None
    with compiling.expected([loop, decide]):
        assert compiling.now() is None  # as long as everything is loaded
        compiling.begin()
        now[0] = 17.0
        assert compiling.now() == CompileProgress(0, 3, 12.0)
        half(8)
        assert compiling.now() == CompileProgress(1, 3, 12.0)
        compiling.finish(loop)
        compiling.finish(decide)
        assert compiling.now() == CompileProgress(3, 3, 12.0)
    assert compiling.now() is None


def test_a_function_that_was_loaded_does_not_count() -> None:
    compiling = Compiling(lambda: 0.0)
    with compiling.expected([loop, other]):
        compiling.finish(loop)
        compiling.begin()
        assert compiling.now() == CompileProgress(0, 1, 0.0)


def test_on_a_terminal_one_line_is_overwritten_and_then_gone(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    compiling, shown = Compiling(lambda: 0.0), threading.Event()
    progress_now = compiling.now

    def now() -> Any:
        progress = progress_now()
        shown.set()
        return progress

    monkeypatch.setattr(compiling, "now", now)
    assert not compiling.show_in_line()
    compiling.on_terminal = True
    assert not compiling.show_in_line()  # nothing is expected
    with compiling.expected([other]):
        compiling.begin()
        assert compiling.show_in_line() and compiling.show_in_line()
        assert shown.wait(20)
    said = capsys.readouterr().err.split(CLEAR_LINE)
    assert len(said) >= 3 and said[0] == said[-1] == ""
    assert set(said[1:-1]) == {f"compiling (once): {'.' * 20} 0 %, 0 of 1 kernels, 0 s"}


def test_the_bar_is_as_long_as_the_share() -> None:
    words = CompileProgress(223, 418, 45.4).words
    assert words == "compiling (once): ##########.......... 53 %, 223 of 418 kernels, 45 s"
