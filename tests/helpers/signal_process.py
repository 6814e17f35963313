"""Commands that hear a signal, also where tests run in the background, or under nohup, and ignore it."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

# A process of its own sets that: between fork and exec of a process with threads no Python may run.
HEARS = """
import os, signal, sys
signal.signal(int(sys.argv[1]), signal.SIG_DFL)
os.execvp(sys.argv[2], sys.argv[2:])
"""


def signal_process(number: signal.Signals, command: Sequence[str]) -> list[str]:
    """The same command, begun by a process that stops ignoring the signal."""
    return [sys.executable, "-I", "-S", "-c", HEARS, str(int(number)), *command]
