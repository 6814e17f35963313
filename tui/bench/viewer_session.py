"""A viewer under measurement: started in a pseudo-terminal, timed by what reaches the other end."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from automaton.bench.measurement import NotMeasuredError
from tui.render.depth import Depth
from tui.render.styles import (
    COLOUR_CURSOR,
    COLOUR_FLOOR,
    COLOUR_FLOOR_MARK,
    COLOUR_WALL,
    Look,
    style,
)
from tui.terminal.terminal_host import FRAME_END, Arrived, Link, TerminalHost

BUILDING_S = 120.0  # until there is a fleet; what it needs has been compiled before
SETTLE_S = 3.0  # imports, the collector's last sweep, the first link figures
ESCAPE = "\x1b[27u"
KEY_S = 10.0  # a key whose effect is not seen by then counts as having taken so long
KEYS_S = 40.0  # for all keys of a session: a busy machine answers fewer of them
HERTZ = os.sysconf("SC_CLK_TCK")


class Session:
    """A viewer on a fleet (`tui.bench.fleet_viewer`)."""

    def __init__(
        self, fleet: dict[str, Any], link: Link | None = None, columns: int = 200, rows: int = 60
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="automaton-bench-")
        self._notes = Path(self._folder.name) / "notes"
        command = [sys.executable, "-m", "tui.bench.fleet_viewer"]
        command.append(json.dumps({**fleet, "notes": str(self._notes)}))
        environ = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        for name in ("NO_COLOR", "LINES", "COLUMNS"):
            environ.pop(name, None)
        self.host = TerminalHost(command, rows=rows, columns=columns, environ=environ, link=link)

    def __enter__(self) -> Self:
        try:
            self.host.wait_for(self._notes.exists, "a fleet", BUILDING_S)
        except TimeoutError as error:
            self.__exit__(type(error), error, error.__traceback__)
            raise NotMeasuredError(f"no viewer with a fleet within {BUILDING_S:g} s") from error
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
        return int(self._notes.read_text().split()[0])

    @property
    def tick(self) -> int:
        """The tick that is shown, as of a moment ago."""
        return int(self._notes.read_text().split()[1])

    def threads(self) -> list[int]:
        """All threads of the viewer's process."""
        return [int(name) for name in os.listdir(f"/proc/{self.host.process.pid}/task")]

    def cpu(self) -> float:
        """Seconds of CPU that the viewer has taken, its simulation aside."""
        return sum(self._cpu_of(one) for one in self.threads() if one != self.simulating)

    def cpu_of_simulation(self) -> float:
        """Seconds of CPU that the thread has taken which computes the fleet."""
        return self._cpu_of(self.simulating)

    def _cpu_of(self, thread: int) -> float:
        stat = Path(f"/proc/{self.host.process.pid}/task/{thread}/stat").read_text()
        values = stat.rpartition(")")[2].split()
        return (int(values[11]) + int(values[12])) / HERTZ

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
        """Seconds from a key to the cell that it changes: the wall in the middle gets the cursor.

        Every other key takes the cursor away again, and the next one waits until it has gone:
        if both came between two frames, nothing would be seen of either. After KEYS_S seconds the rest
        is left out. Raises NotMeasuredError if the viewer ends.
        """
        cursor, wall = cursor_colour(), wall_style()
        latencies: list[float] = []
        begun = time.monotonic()
        for number in range(presses):
            if latencies and time.monotonic() - begun > KEYS_S:
                break
            time.sleep(0.15)
            if number % 2 == 0:
                latencies.append(self._latency("i", lambda frame: cursor in frame))
            else:
                gone = lambda frame: wall in frame and cursor not in frame  # noqa: E731
                latencies.append(self._latency(ESCAPE, gone))
        return latencies

    def _latency(self, key: str, shows: Callable[[bytes], bool]) -> float:
        """Seconds until a frame shows what the key does, KEY_S at most."""
        begin, pressed = len(self.host.history), time.monotonic()
        self.host.send(key)
        with contextlib.suppress(TimeoutError):
            self.host.wait_for(lambda: self._shown_at(begin, shows) is not None, key, KEY_S)
        if self.host.process.poll() is not None:
            raise NotMeasuredError("the viewer has ended")
        shown = self._shown_at(begin, shows)
        return KEY_S if shown is None else shown - pressed

    def _shown_at(self, begin: int, shows: Callable[[bytes], bool]) -> float | None:
        """When a frame that shows it had arrived whole; None: not yet."""
        rest = b""
        for event in self.host.history[begin:]:
            if isinstance(event, Arrived):
                *frames, rest = (rest + event.data).split(FRAME_END)
                if any(map(shows, frames)):
                    return event.at
        return None


def cursor_colour() -> bytes:
    """How the colour of a selected cell is asked for."""
    look = Look(Depth.TRUE, "dark")
    background = look.css(int(style(COLOUR_FLOOR_MARK, COLOUR_CURSOR)))[1].lstrip("#")
    red, green, blue = (int(background[k : k + 2], 16) for k in (0, 2, 4))
    return f"48;2;{red};{green};{blue}".encode()


def wall_style() -> bytes:
    """How a wall is asked for; it is written again only where a cursor was."""
    return Look(Depth.TRUE, "dark").sgr(int(style(COLOUR_WALL, COLOUR_FLOOR))).encode()


def quantile(values: Sequence[float], share: float) -> float:
    """The value that so large a share of the values does not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
