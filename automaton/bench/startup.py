"""How long a command takes from Enter to the prompt, imports included."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from functools import partial

from automaton.bench.measurement import SECONDS, Measurement, Sample, wall_seconds

COMMANDS = (("--help",), ("check", "tabletop-1"), ("run", "tabletop-1"))


def measurements() -> list[Measurement]:
    """One for each command; the warm-up fills the caches of the disk and of the kernels."""
    return [
        Measurement(f"start-up, {' '.join(command)}", SECONDS, partial(prepare, command))
        for command in COMMANDS
    ]


def prepare(command: Sequence[str]) -> Sample:
    """A sampler: seconds on the wall of a command in a process of its own."""
    return lambda: wall_seconds(lambda: run_command(command))


def run_command(command: Sequence[str], cache: str | None = None) -> None:
    """Run `automaton COMMAND` silently, with a kernel cache of its own if wanted.

    Raises RuntimeError, with what it wrote to stderr, if it fails.
    """
    environment = dict(os.environ)
    if cache is not None:
        environment["AUTOMATON_CACHE_DIR"] = cache
    done = subprocess.run(
        [sys.executable, "-m", "automaton", *command],
        env=environment,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"automaton {' '.join(command)} failed: {done.stderr.strip()}")
