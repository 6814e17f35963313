"""The command `automaton` in a pseudo-terminal of its own."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from pseudo_terminal import TRUECOLOR, Replay

from tui.terminal.terminal_host import TerminalHost, TerminalLink

KEPT = ("PATH", "HOME", "PYTHONPATH", "AUTOMATON_CACHE_DIR", "XDG_CACHE_HOME", "NUMBA_CPU_NAME")


class Session:
    """`automaton` in a terminal."""

    def __init__(self, host: TerminalHost) -> None:
        self.host = host
        self.replay = Replay(host)

    def wait_for_text(self, text: str, present: bool = True) -> None:
        self.host.wait_for(lambda: (text in self.replay.text()) == present, text)

    def wait_for_tick(self, least: int) -> None:
        """While it plays: on a busy machine not every tick gets on the screen."""

        def come() -> bool:
            shown = re.search(r"tick ([\d,]+)", self.replay.text())
            return shown is not None and int(shown[1].replace(",", "")) >= least

        self.host.wait_for(come, f"tick {least} or later")

    def press(self, keys: str) -> None:
        self.host.send(keys)

    def settle(self) -> None:
        self.host.wait_for_quiet(0.4)


@contextmanager
def automaton(
    folder: Path,
    *arguments: str,
    rows: int = 24,
    columns: int = 80,
    graphics: Literal["", "kitty", "sixel"] = "",
    link: TerminalLink | None = None,
    **environ: str,
) -> Iterator[Session]:
    kept = {name: os.environ[name] for name in KEPT if name in os.environ}
    variables = {**kept, **TRUECOLOR, "XDG_STATE_HOME": str(folder), **environ}
    command = [sys.executable, "-m", "automaton", *arguments]
    size = {"rows": rows, "columns": columns}
    with TerminalHost(command, **size, environ=variables, link=link, graphics=graphics) as host:  # type: ignore[arg-type]
        yield Session(host)
