"""Signals in the middle of a long tick: compiled code ends, and what was recorded is whole."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import endless_strategies
import numpy as np
import pytest
from llvmlite.binding.executionengine import ExecutionEngine
from sweep_studies import end_all, started, wait_until

from automaton.commands import main
from automaton.engine.distance_tables import UNREACHABLE
from automaton.engine.search import begin_search, distance, find_path, follow_gradient, nearest_mark
from automaton.engine.state import NIL
from automaton.runs import interruption
from automaton.runs.interruption import (
    COMPILERS_CALLBACKS,
    TerminatedError,
    interruptible,
    signals_raise,
)
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.routing.astar import FIFO, route_space, search

LONG_TICK = endless_strategies.LONG_TICK
TOLD = ("--set", "strategy.allocation=endless_strategies:Told")


def in_the_long_tick(routing: str, *more: str) -> subprocess.Popen[str]:
    """A run whose strategy of routing computes its endless tick."""
    arguments = ["run", "tabletop-mini", *TOLD, "--set", f"strategy.routing={routing}", *more]
    code = f"import sys; sys.path.insert(0, {str(Path(endless_strategies.__file__).parent)!r}); "
    code += "from automaton.commands import main; sys.exit(main(sys.argv[1:]))"
    process = started([sys.executable, "-c", code, *arguments])
    assert process.stdout is not None
    while process.stdout.readline() != f"tick {LONG_TICK}\n":
        assert process.poll() is None, process.communicate()
    before = processor_s(process)
    wait_until(lambda: processor_s(process) > before + 0.1)  # it is in compiled code
    return process


def processor_s(process: subprocess.Popen[str]) -> float:
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize(
    "number, code, words",
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_a_signal_ends_a_search_in_the_middle_of_a_tick(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    number: signal.Signals,
    code: int,
    words: str,
) -> None:
    path = tmp_path / "run.rec"
    process = in_the_long_tick("endless_strategies:Searches", "--record", str(path))
    try:
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    finally:
        end_all([process])
    assert (process.returncode, said.splitlines()[-1]) == (code, f"automaton: {words}")
    assert main(["verify", str(path)]) == 0
    assert f"{LONG_TICK - 1} ticks" in capsys.readouterr().out


def test_a_loop_that_looks_at_nothing_is_ended_by_force() -> None:
    process = in_the_long_tick("endless_strategies:Counts")
    try:
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=60)
    finally:
        end_all([process])
    assert (process.returncode, said.splitlines()[-1]) == (143, "automaton: terminated, at once")


@pytest.fixture
def heard_interrupt() -> Iterator[None]:
    """SIGINT raises here, also where these tests run in the background and ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def given_up() -> Simulation:
    """A run that was interrupted before its first tick."""
    simulation = Simulation(resolve("tabletop-mini"))
    simulation.interrupt()
    return simulation


def test_a_run_that_is_interrupted_raises_and_computes_nothing(given_up: Simulation) -> None:
    with pytest.raises(KeyboardInterrupt):
        given_up.run()
    assert given_up.tick == 0


class WatchersLock:
    """The lock of the thread that hears of signals, and how often that asked for it and was done."""

    def __init__(self, lock: Any) -> None:
        self.lock = lock
        self.asked = self.done = 0

    def __enter__(self) -> None:
        if threading.current_thread().name == "signals":
            self.asked += 1
        self.lock.acquire()

    def __exit__(self, *_: object) -> None:
        self.lock.release()
        if threading.current_thread().name == "signals":
            self.done += 1


@pytest.fixture
def watcher(monkeypatch: pytest.MonkeyPatch) -> WatchersLock:
    with interruptible(np.zeros(1, np.int64)):
        pass  # the thread is there
    lock = WatchersLock(interruption._WATCHER._lock)
    monkeypatch.setattr(interruption._WATCHER, "_lock", lock)
    return lock


def test_a_handler_of_somebody_else_lets_the_run_go_on(watcher: WatchersLock) -> None:
    told: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, _: told.append(number))
    try:
        simulation = Simulation(resolve("tabletop-mini"))
        simulation.run(until=10)
        with interruptible(simulation.workspace.stop):
            done = watcher.done
            signal.raise_signal(signal.SIGTERM)
            wait_until(lambda: watcher.done > done)
        simulation.run()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert told == [signal.SIGTERM] and simulation.finished


@pytest.mark.usefixtures("heard_interrupt")
def test_a_signal_that_is_heard_late_ends_no_later_run(watcher: WatchersLock) -> None:
    """The handler raises, and the next run begins, before the thread that hears of signals wakes."""
    first, later = np.zeros(1, np.int64), np.zeros(1, np.int64)
    asked, done = watcher.asked, watcher.done
    watcher.lock.acquire()
    with pytest.raises(KeyboardInterrupt), interruptible(first):
        signal.raise_signal(signal.SIGINT)
    wait_until(lambda: watcher.asked > asked)
    with interruptible(later):
        watcher.lock.release()
        wait_until(lambda: watcher.done > done)
        assert not later[0]


def test_searches_find_nothing_once_a_run_is_given_up(given_up: Simulation) -> None:
    view, workspace = given_up.view, given_up.workspace
    tables = workspace.tables
    tables.row_of[:] = tables.owner[:] = NIL  # runs before may have left distances
    here, there = int(view.robots.home[0]), int(view.robots.home[1])
    steps = np.zeros(100, np.uint8)
    assert distance(view, workspace, 0, here, 0, there) == UNREACHABLE
    assert follow_gradient(view, workspace, 0, here, 0, there, steps) == NIL
    assert find_path(view, workspace, 0, here, 0, there, False, steps) == NIL
    assert nearest_mark(view, workspace, begin_search(workspace), 0, here, 0, False) == NIL
    grid, duration = view.grid, view.rules.duration[0]
    routes, pose = route_space(grid).stopped_by(workspace.stop), here * grid.headings
    assert search(grid, 0, duration, routes, FIFO, np.uint64(1), pose, there, False) == NIL


def test_the_next_run_on_the_floor_finds_its_ways() -> None:
    """A floor lends its workspace, distance tables included, to one run after another."""
    resolved = resolve("tabletop-mini")
    first = Simulation(resolved)
    first.run()
    expected = first.digest
    del first
    broken = Simulation(resolved)
    broken.run(until=3)
    broken.interrupt()
    with pytest.raises(KeyboardInterrupt):
        broken.run()
    del broken
    after = Simulation(resolved)
    after.run()
    assert after.digest == expected


@pytest.mark.usefixtures("heard_interrupt")
def test_a_signal_while_the_compiler_hands_over_a_kernel_comes_after_that() -> None:
    done = []

    def _raw_object_cache_notify() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):  # the handler runs somewhere in here
            done.append(time.monotonic())

    callback = ctypes.CFUNCTYPE(None)(_raw_object_cache_notify)
    with pytest.raises(KeyboardInterrupt), signals_raise():
        callback()
        assert len(done) == 1000
        time.sleep(10)
    assert time.monotonic() - done[-1] < 10


def test_its_callbacks_have_the_names_by_which_they_are_known() -> None:
    names = [name for name in vars(ExecutionEngine) if name.startswith(COMPILERS_CALLBACKS)]
    assert sorted(names) == ["_raw_object_cache_getbuffer", "_raw_object_cache_notify"]


@pytest.mark.usefixtures("heard_interrupt")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_where_nothing_can_be_raised_comes_again(number: int) -> None:
    class Closing:
        def __del__(self) -> None:
            os.kill(os.getpid(), number)
            for _ in range(1000):  # what the handler raises in here is lost
                time.monotonic()

    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt) as raised, signals_raise():
        Closing()
        time.sleep(10)
    assert time.monotonic() - begun < 10
    assert (raised.type is TerminatedError) == (number == signal.SIGTERM)


@pytest.mark.usefixtures("heard_interrupt")
def test_a_signal_that_comes_again_at_once_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    class Closing:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(1000):  # what the handler raises in here is lost
                time.monotonic()

    send, hurried = interruption._send_again, []

    def send_at_once(number: int) -> None:
        if hurried:
            send(number)
            return
        hurried.append(number)
        os.kill(os.getpid(), number)
        for _ in range(1000):  # the handler runs in the hook
            time.monotonic()

    monkeypatch.setattr(interruption, "_send_again", send_at_once)
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt), signals_raise():
        Closing()
        time.sleep(10)
    assert time.monotonic() - begun < 10
    assert hurried
