"""A run in a process of its own, and the same in this one."""

from __future__ import annotations

import os
import subprocess
import sys

from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

SEED = 7
TOLD = f"""
import sys
from automaton.world.resolve import resolve
from automaton.runs.simulation import Simulation
run = Simulation(resolve(sys.argv[1], sys.argv[3:]), seed={SEED})
run.run(until=int(sys.argv[2]))
print(run.tick, run.digest)
"""


def told(name: str, until: int, *settings: str, **environment: str) -> str:
    """ "TICK DIGEST" of a run in a fresh process."""
    done = subprocess.run(
        [sys.executable, "-c", TOLD, name, str(until), *settings],
        env={**os.environ, **environment},
        cwd=os.getcwd(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def told_here(name: str, until: int, *settings: str) -> str:
    """The same of a run in this process, which may have compiled code already."""
    run = Simulation(resolve(name, settings), seed=SEED)
    run.run(until=until)
    return f"{run.tick} {run.digest}"
