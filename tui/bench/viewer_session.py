"""A viewer under measurement: started in a pseudo-terminal, timed by what reaches the other end."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from tui.render.styles import COLOUR_CURSOR
from tui.terminal.terminal_host import FRAME_END, Arrived, Link, TerminalHost

SETTLE_S = 3.0  # imports, the collector's last sweep, the first link figures
HERTZ = os.sysconf("SC_CLK_TCK")


class Session:
    """A viewer on the walking fleet, or on a command of its own."""

    def __init__(
        self, fleet: dict[str, Any], link: Link | None = None, columns: int = 200, rows: int = 60
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="automaton-bench-")
        self._notes = Path(self._folder.name) / "notes"
        command = [sys.executable, "-m", "tui.bench.walking_viewer"]
        command.append(json.dumps({**fleet, "notes": str(self._notes)}))
        environ = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        for name in ("NO_COLOR", "LINES", "COLUMNS"):
            environ.pop(name, None)
        self.host = TerminalHost(command, rows=rows, columns=columns, environ=environ, link=link)

    def __enter__(self) -> Self:
        self.host.wait_for(
            lambda: self._notes.exists() and self._notes.read_text() != "", "a fleet"
        )
        time.sleep(SETTLE_S)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.host.close()
        self._folder.cleanup()

    @property
    def simulating(self) -> int:
        """The thread that computes the fleet."""
        return int(self._notes.read_text())

    def threads(self) -> list[int]:
        """All threads of the viewer's process."""
        return [int(name) for name in os.listdir(f"/proc/{self.host.process.pid}/task")]

    def cpu(self) -> float:
        """Seconds of CPU that the viewer has taken, its simulation aside."""
        total = 0
        for thread in self.threads():
            if thread != self.simulating:
                stat = Path(f"/proc/{self.host.process.pid}/task/{thread}/stat").read_text()
                values = stat.rpartition(")")[2].split()
                total += int(values[11]) + int(values[12])
        return total / HERTZ

    def pin(self) -> None:
        """The viewer to the first core, its simulation and this process to another one."""
        cores = sorted(os.sched_getaffinity(0))
        if len(cores) < 2:
            return
        for thread in self.threads():
            own = cores[1] if thread == self.simulating else cores[0]
            os.sched_setaffinity(thread, {own})
        os.sched_setaffinity(0, {cores[1]})

    def watch(self, seconds: float) -> tuple[int, int, float]:
        """(bytes, frames, seconds) of a while from now."""
        begun, before = time.monotonic(), self.host.output()
        time.sleep(seconds)
        data = self.host.output()[len(before) :]
        return len(data), data.count(FRAME_END), time.monotonic() - begun

    def key_latencies(self, presses: int) -> list[float]:
        """Seconds from a key to the cell that it changes: the cell in the middle is looked at."""
        mark = cursor_colour()
        found = []
        for _ in range(presses):
            time.sleep(0.15)
            at = len(self.host.history)
            pressed = time.monotonic()
            self.host.send("i")
            self._wait_for(mark, at)
            found.append(_arrival(self.host, at, mark) - pressed)
            time.sleep(0.1)
            self.host.send("\x1b[27u")  # escape
        return found

    def _wait_for(self, mark: bytes, at: int) -> None:
        self.host.wait_for(lambda: mark in _since(self.host, at), "the cursor", 20.0)


def cursor_colour() -> bytes:
    """How the colour of a selected cell is asked for."""
    from tui.render.depth import Depth
    from tui.render.styles import COLOUR_FLOOR_MARK, Look, style

    look = Look(Depth.TRUE, "dark")
    background = look.css(int(style(COLOUR_FLOOR_MARK, COLOUR_CURSOR)))[1].lstrip("#")
    red, green, blue = (int(background[k : k + 2], 16) for k in (0, 2, 4))
    return f"48;2;{red};{green};{blue}".encode()


def _since(host: TerminalHost, at: int) -> bytes:
    return b"".join(event.data for event in host.history[at:] if isinstance(event, Arrived))


def _arrival(host: TerminalHost, at: int, mark: bytes) -> float:
    """When the mark had arrived."""
    seen = b""
    for event in host.history[at:]:
        if isinstance(event, Arrived):
            seen += event.data
            if mark in seen:
                return event.at
    raise RuntimeError("what was seen is not there any more")


def quantile(values: Sequence[float], share: float) -> float:
    """The value that so large a share of the values does not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
