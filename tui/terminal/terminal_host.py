"""A terminal without a screen: runs a program on a pty, answers its queries, models a slow link.

    program -> pty -> buffer of the link -> bytes per second -> half a round trip -> `history`
       ^                                                                              |
       +---------- half a round trip <- keys, mouse, answers to ESC[6n <--------------+

Tests replay the history in a terminal emulator; the benchmark measures it.
"""

from __future__ import annotations

import contextlib
import fcntl
import math
import os
import select
import signal
import struct
import subprocess
import termios
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Literal

LINK_PIECE_BYTES = 512  # bytes that a slow link carries in one piece
QUESTIONS = {
    b"\x1b[6n": b"\x1b[1;1R",  # where is the cursor?
    b"\x1b[c": b"\x1b[?62c",  # what kind are you?
    b"\x1b[?2026$p": b"\x1b[?2026;2$y",  # do you know synchronized output?
}
# Further answers of terminals that show images.
GRAPHICS: dict[str, dict[bytes, bytes]] = {
    "": {},
    "kitty": {b"\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\": b"\x1b_Gi=31;OK\x1b\\"},
    "sixel": {b"\x1b[c": b"\x1b[?62;4;22c"},
}
CHARACTER = 8, 16  # its width and height in pixels, where images are shown
FRAME_END = b"\x1b[6n"  # the query that ends each frame of the viewer


@dataclass(frozen=True)
class TerminalLink:
    """The link between program and terminal: by default ideal, or slow as with SSH."""

    bytes_per_second: float = math.inf
    round_trip: float = 0.0  # seconds
    buffer: int = 1 << 20  # bytes that the program's end buffers


class MarkerCount:
    """Counts a marker in a stream of pieces, also where the marker spans two pieces."""

    def __init__(self, marker: bytes) -> None:
        self._marker = marker
        self._tail = b""

    def count(self, piece: bytes) -> int:
        """Number of markers that end in this piece."""
        seen = self._tail + piece
        self._tail = seen[max(0, len(seen) - len(self._marker) + 1) :]
        return seen.count(self._marker)


@dataclass(frozen=True)
class Arrived:
    """Bytes that reached the terminal."""

    at: float
    data: bytes


@dataclass(frozen=True)
class Resized:
    """The terminal window was resized."""

    at: float
    rows: int
    columns: int


class TerminalHost:
    """One program in one terminal window; a context manager that leaves no process behind."""

    def __init__(
        self,
        command: Sequence[str],
        *,
        rows: int = 60,
        columns: int = 200,
        environ: Mapping[str, str] | None = None,
        link: TerminalLink | None = None,
        synchronized: bool = True,
        answers: bool = True,
        graphics: Literal["", "kitty", "sixel"] = "",
    ) -> None:
        self.rows, self.columns = rows, columns
        self.history: list[Arrived | Resized] = []
        self.max_backlog = 0  # maximum of bytes that waited for the link,
        self.max_frames = 0  # and of frames that had not passed it completely
        self._link = link or TerminalLink()
        self._character = CHARACTER if graphics else (0, 0)
        questions = {**QUESTIONS, **GRAPHICS[graphics]} if answers else {}
        self._answers = [
            (MarkerCount(question), answer)
            for question, answer in questions.items()
            if synchronized or b"2026" not in question
        ]
        self._ends_in, self._ends_out = MarkerCount(FRAME_END), MarkerCount(FRAME_END)
        self._frames = 0  # that wait for the link
        self._waiting: deque[bytes] = deque()
        self._backlog = 0
        self._free_at = 0.0
        self._down: deque[tuple[float, bytes]] = deque()
        self._up: deque[tuple[float, bytes]] = deque()
        self._hung_up = self._closing = False
        self._news = threading.Condition()
        self._wake_in, self._wake_out = os.pipe()
        self._terminal, program_end = os.openpty()
        self._tell_size()
        os.set_blocking(self._terminal, False)
        self.process = subprocess.Popen(
            command,
            stdin=program_end,
            stdout=program_end,
            stderr=program_end,
            env=environ,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(program_end)
        self._thread = threading.Thread(target=self._carry, name="terminal", daemon=True)
        self._thread.start()

    def __enter__(self) -> TerminalHost:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # Input ---------------------------------------------------------------------------------------

    def send(self, keys: str) -> None:
        """Type `keys`, which may contain escape sequences."""
        with self._news:
            self._up.append((time.monotonic() + self._link.round_trip / 2, keys.encode()))
        os.write(self._wake_out, b".")

    def resize(self, rows: int, columns: int) -> None:
        """Resize the window; the kernel sends SIGWINCH to the program."""
        with self._news:
            self.rows, self.columns = rows, columns
            self.history.append(Resized(time.monotonic(), rows, columns))
            self._tell_size()

    def hang_up(self) -> None:
        """Drop the connection: the program gets SIGHUP and end of file."""
        self._hung_up = True
        os.write(self._wake_out, b".")
        self._thread.join()

    # Output --------------------------------------------------------------------------------------

    def output(self) -> bytes:
        """All bytes that have arrived so far."""
        with self._news:
            return b"".join(event.data for event in self.history if isinstance(event, Arrived))

    def wait_for(self, condition: Callable[[], bool], what: str, at_most: float = 60.0) -> None:
        """Return when the condition holds; it is checked whenever something arrives."""
        end = time.monotonic() + at_most
        while not condition():
            over = not self._thread.is_alive() and not condition()
            if over or time.monotonic() > end:
                why = "the program has ended" if over else f"not within {at_most:g} s"
                raise TimeoutError(f"{what}: {why}; the last bytes are {self.output()[-400:]!r}")
            with self._news:
                self._news.wait(0.02)

    def wait_for_quiet(self, seconds: float, at_most: float = 60.0) -> None:
        """Return when nothing has arrived for `seconds`."""
        start = time.monotonic()

        def quiet() -> bool:
            last = self.history[-1].at if self.history else start
            return time.monotonic() - max(last, start) > seconds

        self.wait_for(quiet, f"{seconds} s without a byte", at_most)

    def wait_for_end(self, at_most: float = 60.0) -> int:
        """Wait until the program has ended and its last bytes have arrived; its exit code."""
        code = self.process.wait(at_most)
        self._thread.join(at_most)
        return code

    def close(self) -> None:
        """End the program, after 2 s by force."""
        self._closing = True
        with contextlib.suppress(OSError):
            os.write(self._wake_out, b".")
        self._thread.join()
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(2.0)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        for end in (self._terminal, self._wake_in, self._wake_out):
            with contextlib.suppress(OSError):
                os.close(end)

    # The link -----------------------------------------------------------------------------------

    def _carry(self) -> None:
        """Carry bytes both ways, in the thread, until the program ends or `hang_up` is called."""
        ended = False
        while not self._closing and not self._hung_up:
            now = time.monotonic()
            self._transmit(now)
            self._deliver(now)
            self._type(now)
            if ended and not self._waiting and not self._down:
                return
            room = not ended and self._backlog < self._link.buffer
            watched = [self._wake_in, *([self._terminal] if room else [])]
            readable, _, _ = select.select(watched, [], [], self._pause(time.monotonic()))
            if self._wake_in in readable:
                os.read(self._wake_in, 4096)
            if self._terminal in readable:
                ended = not self._take()
        if self._hung_up:
            os.close(self._terminal)

    def _pause(self, now: float) -> float:
        due = [queue[0][0] for queue in (self._down, self._up) if queue]
        if self._waiting:
            due.append(self._free_at)
        return max(0.0, min(due, default=now + 1.0) - now)

    def _take(self) -> bool:
        """Read the program's output; returns False at its end."""
        try:
            data = os.read(self._terminal, 65536)
        except BlockingIOError:
            return True
        except OSError:
            return False
        step = LINK_PIECE_BYTES if self._link.bytes_per_second < math.inf else len(data)
        self._waiting.extend(data[i : i + step] for i in range(0, len(data), step))
        self._backlog += len(data)
        self._frames += self._ends_in.count(data)
        self.max_frames = max(self.max_frames, self._frames)
        self.max_backlog = max(self.max_backlog, self._backlog)
        return bool(data)

    def _transmit(self, now: float) -> None:
        while self._waiting and self._free_at <= now:
            piece = self._waiting.popleft()
            self._backlog -= len(piece)
            self._frames -= self._ends_out.count(piece)
            # The link is busy until this piece has passed; an idle link starts now.
            start = self._free_at if now - self._free_at < 0.05 else now
            self._free_at = start + len(piece) / self._link.bytes_per_second
            self._down.append((self._free_at + self._link.round_trip / 2, piece))

    def _deliver(self, now: float) -> None:
        while self._down and self._down[0][0] <= now:
            piece = self._down.popleft()[1]
            with self._news:
                self.history.append(Arrived(now, piece))
                self._answer(piece, now)
                self._news.notify_all()

    def _answer(self, piece: bytes, now: float) -> None:
        for marks, answer in self._answers:
            for _ in range(marks.count(piece)):
                self._up.append((now + self._link.round_trip / 2, answer))

    def _type(self, now: float) -> None:
        with self._news:
            while self._up and self._up[0][0] <= now:
                keys = self._up.popleft()[1]
                with contextlib.suppress(OSError):
                    os.write(self._terminal, keys)

    def _tell_size(self) -> None:
        wide, high = self._character
        size = struct.pack("HHHH", self.rows, self.columns, self.columns * wide, self.rows * high)
        with contextlib.suppress(OSError):
            fcntl.ioctl(self._terminal, termios.TIOCSWINSZ, size)
