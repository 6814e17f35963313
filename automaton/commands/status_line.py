"""What a command adds on a terminal: its progress in the last line, and the command to run next.

The line appears as soon as a command has printed nothing for a moment. Any output clears it first.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import stat
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from string import Formatter
from typing import Any, Final

SILENCE_S: Final = 0.6  # without output, before the line appears
REDRAW_S: Final = 0.2
CLEARED: Final = "\r\x1b[K"

# By command, what to run next: the first text whose arguments the command has.
NEXT_COMMANDS: Final = {
    "check": ("run {file}",),
    "import": ("check {out}",),
    "run": ("replay {record}", "watch {scenario}"),
    "log": ("replay {out}",),
    "branch": ("replay {file} {out}",),
    "size": ("bottlenecks {scenario}",),
    "what-if": ("report {out}", "bottlenecks {scenario}"),
    "compare": ("what-if {scenario} CHANGES.yaml",),
    "bottlenecks": ("what-if {scenario} {changes}", "size {scenario} --target T --robots A..B"),
    "tune": ("run {scenario} --set @{out}",),
    "sweep": ("report {out}",),
    "train": ("run {scenario}",),
    "compile": ("run {file}", "run goods-mini"),
}


class StatusLine:
    """The last line of the terminal while a command works; does nothing without a terminal."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        self._over = threading.Event()
        self._stream: Any = None
        self._text: str | Callable[[], str] = ""
        self._name, self._drawn = "", ""
        self._begun = self._printed = 0.0

    @contextlib.contextmanager
    def shown(self, stream: Any, name: str) -> Iterator[None]:
        """While inside, show what the command `name` does in the last line of a terminal."""
        is_read = stream is not None and stream.isatty() and not is_pipe(sys.stdout)
        if not is_read or os.environ.get("TERM", "dumb") == "dumb":
            yield
            return
        self._stream, self._name, self._text = stream, name, ""
        self._begun = self._printed = self._clock()
        self._over.clear()
        writer = threading.Thread(target=self._redraw, name="status line", daemon=True)
        writer.start()
        try:
            yield
        finally:
            self._over.set()
            writer.join()
            self.clear()
            self._stream = None

    def show(self, text: str | Callable[[], str]) -> None:
        """Name what the command does, or a function that names it now; "" names the command."""
        self._text = text

    def clear(self) -> None:
        """Clear the line, as something else is about to be printed."""
        with self._lock:
            self._printed = self._clock()
            if self._drawn:
                self._write(CLEARED)
                self._drawn = ""

    def draw(self) -> None:
        """Draw the line if nothing has been printed for a moment."""
        text = self._text() if callable(self._text) else self._text
        seconds = self._clock() - self._begun
        line = f"{text or self._name}, {seconds:.0f} s"
        line = textwrap.shorten(
            line, max(20, shutil.get_terminal_size().columns - 1), placeholder=" ..."
        )
        with self._lock:
            is_silent = self._clock() - self._printed >= SILENCE_S
            if is_silent and line != self._drawn and not self._over.is_set():
                self._write(CLEARED + line)
                self._drawn = line

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):  # a terminal that is gone ends no command
            self._stream.write(text)
            self._stream.flush()

    def _redraw(self) -> None:
        while not self._over.wait(REDRAW_S):
            self.draw()


def is_pipe(stream: Any) -> bool:
    """Whether a stream goes to another program, which may show it on the same terminal."""
    try:
        return stat.S_ISFIFO(os.fstat(stream.fileno()).st_mode)
    except (AttributeError, OSError, ValueError):
        return False


STATUS_LINE: Final = StatusLine()


def print_next(name: str, arguments: dict[str, Any]) -> None:
    """Print the command to run next, if both streams are terminals and the answer is text."""
    is_read = sys.stdout.isatty() and sys.stderr.isatty()
    if is_read and not arguments.get("json") and arguments.get("format") != "json":
        text = next_command(name, arguments)
        if text:
            sys.stdout.flush()
            print(f"next: {text}", file=sys.stderr)


def next_command(name: str, arguments: dict[str, Any]) -> str:
    """The command to run after `name` with these arguments; "" if none suggests itself."""
    for text in NEXT_COMMANDS.get(name, ()):
        fields = [field for _, field, _, _ in Formatter().parse(text) if field]
        values = {field: words_of(arguments.get(field)) for field in fields}
        if all(values.values()):
            is_again = bool({"scenario", "file"} & set(fields))
            settings = arguments.get("settings") or () if is_again else ()
            more = [f" --set {shlex.quote(one)}" for one in settings if isinstance(one, str)]
            return f"automaton {text.format(**values)}{''.join(more)}"
    return ""


def words_of(value: Any) -> str:
    """An argument as it is typed; "" without one, or with several."""
    values = value if isinstance(value, list | tuple) else [value]
    if len(values) > 1:
        return ""
    return shlex.join(str(one) for one in values if one is not None)
