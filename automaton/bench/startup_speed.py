"""How long a command takes from Enter to the prompt, imports included.

The first run on a machine compiles everything, because the cache is empty.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Final

from automaton.bench.measurement import Measurement, S, Sample, wall_seconds

STRATEGY: Final = "strategies.allocation.cooperative"
TIMED_COMMANDS = (("--help",), ("check", "tabletop-1"), ("run", "tabletop-1"))
GOODS = ("run", "goods-60x40", "--until", "1000")
COLD = (  # one after the other, the first one with an empty cache
    ("first run", ("run", "tabletop-1")),
    ("then goods-60x40", GOODS),
    ("then goods-60x40 with epibt", (*GOODS, "--set", "strategy.right_of_way=epibt")),
)


def measurements() -> list[Measurement]:
    """One measurement per command; the warm-up fills the disk cache and the kernel cache."""
    return [
        *(
            Measurement(f"start-up, {' '.join(command)}", S, partial(prepare, command))
            for command in TIMED_COMMANDS
        ),
        Measurement("start-up, run tabletop-1, a strategy edited", S, prepare_edited),
    ]


def prepare(command: Sequence[str]) -> Sample:
    """A sampler: wall-clock seconds of a command in a separate process."""
    return lambda: wall_seconds(lambda: run_command(command))


def prepare_edited() -> Sample:
    """A sampler: wall-clock seconds of a run, each after an edit in a copy of a strategy."""
    folder = tempfile.TemporaryDirectory(prefix="automaton-bench-")
    spec = importlib.util.find_spec(STRATEGY)
    assert spec is not None and spec.origin is not None
    edited = Path(folder.name) / "edited.py"
    edited.write_bytes(Path(spec.origin).read_bytes())
    command = ("run", "tabletop-1", "--set", "strategy.allocation=edited:Cooperative")

    def sample() -> float:
        with edited.open("a") as file:
            file.write("# another edit\n")
        return wall_seconds(lambda: run_command(command, PYTHONPATH=folder.name))

    return sample


def run_command(command: Sequence[str], **variables: str) -> None:
    """Run `automaton COMMAND` silently, with these environment variables.

    Raises RuntimeError, with its stderr, if it fails.
    """
    environment = os.environ | variables
    done = subprocess.run(
        [sys.executable, "-m", "automaton", *command],
        env=environment,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"automaton {' '.join(command)} failed: {done.stderr.strip()}")


def first_run_measurements() -> list[Measurement]:
    """A first run on two cores and on one, and later runs that compile more; once or twice each."""
    return [
        Measurement("first run, compiling", S, prepare_first_run, warm_up=False, at_most=2),
        *(
            Measurement(f"{name}, CPU of one core", S, partial(prepare_cold, number), False, 1)
            for number, (name, _) in enumerate(COLD)
        ),
    ]


def prepare_first_run() -> Sample:
    """A sampler: wall-clock seconds of `run tabletop-1` with an empty cache."""

    def sample() -> float:
        with tempfile.TemporaryDirectory(prefix="automaton-bench-") as folder:
            return wall_seconds(
                lambda: run_command(("run", "tabletop-1"), AUTOMATON_CACHE_DIR=folder)
            )

    return sample


def prepare_cold(number: int) -> Sample:
    """A sampler: CPU seconds, on one core, of a run in a sequence that begins with an empty cache.

    On systems that cannot restrict cores, a second process helps the first run.
    """

    def sample() -> float:
        with tempfile.TemporaryDirectory(prefix="automaton-bench-") as folder, on_one_core():
            for _, command in COLD[: number + 1]:
                before = children_seconds()
                run_command(command, AUTOMATON_CACHE_DIR=folder)
            return children_seconds() - before

    return sample


@contextmanager
def on_one_core() -> Iterator[None]:
    """While inside, this process and its children use one core."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def children_seconds() -> float:
    """CPU seconds of finished child processes."""
    times = os.times()
    return times.children_user + times.children_system
