"""A run in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys

TOLD = """
import sys
from automaton.build.resolve import resolve
from automaton.runs.simulation import Simulation
run = Simulation(resolve(sys.argv[1], sys.argv[3:]), seed=7)
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
