"""Programs on a pty for the tests: the stream of bytes, replayed in pyte, is what a person would see."""

from __future__ import annotations

import codecs
import json
import os
import re
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyte
from pyte.screens import Char
from terminal_replay import cell_at, seen

from tui.render.encode import encode
from tui.render.styles import Look
from tui.terminal.options import depth_of, glyphs_of
from tui.terminal.terminal_host import Resized, TerminalHost, TerminalLink

# Sequences that pyte 0.8 prints as text: kitty's keyboard protocol, questions about modes, images.
UNKNOWN_TO_PYTE = re.compile(r"\x1b\[(?:[<>=?][\d;]*u|\?[\d;]*\$p)|\x1b[P_][^\x1b]*\x1b\\")
UNFINISHED = re.compile(r"\x1b(?:\[[\d;?<>=$]*|[P_][^\x1b]*\x1b?)?\Z")
TRUECOLOR = {
    "TERM": "xterm-256color",
    "COLORTERM": "truecolor",
    "LANG": "C.UTF-8",
    "XDG_CONFIG_HOME": "/dev/null",
}
FPS = 60  # of the app, at most
MAP_APP = Path(__file__).with_name("map_app.py")


class Replay:
    """What has arrived at a host so far, as a screen full of characters."""

    def __init__(self, host: TerminalHost) -> None:
        self._host = host
        self._next = 0
        self._text = (-1, "")  # events that it is of, and the text
        self._decode = codecs.getincrementaldecoder("utf-8")("replace").decode
        self._wait_for_request = ""
        rows, columns = host.rows, host.columns
        self.screen = pyte.Screen(columns, rows)
        self._stream = pyte.Stream(self.screen)

    def catch_up(self) -> pyte.Screen:
        """The screen as it is now; an app may write faster than this emulator reads."""
        history = self._host.history
        now = len(history)
        while self._next < now:
            event = history[self._next]
            self._next += 1
            if isinstance(event, Resized):
                self.screen.resize(event.rows, event.columns)
                continue
            text = UNKNOWN_TO_PYTE.sub("", self._wait_for_request + self._decode(event.data))
            cut = UNFINISHED.search(text)
            text, self._wait_for_request = (text[: cut.start()], cut[0]) if cut else (text, "")
            self._stream.feed(text)
        return self.screen

    def text(self) -> str:
        """The characters alone; somebody who waits asks far more often than anything arrives."""
        screen = self.catch_up()
        if self._text[0] != self._next:
            rows = (screen.buffer[row] for row in range(screen.lines))
            self._text = (
                self._next,
                "\n".join(
                    "".join(row[column].data for column in range(screen.columns)) for row in rows
                ),
            )  # not `display`, which fails while one half of a wide character is painted over
        return self._text[1]


def wrong_cells(
    screen: pyte.Screen, reference: pyte.Screen, top: int = 0, left: int = 0
) -> set[tuple[int, int]]:
    """Cells (row, column) that do not look like those of the reference.

    The reference's first cell belongs at (top, left) of the screen.
    """
    blank = Char(" ")
    wrong = {
        (top + y, left + x)
        for y in range(reference.lines)
        for x in range(reference.columns)
        if screen.buffer[top + y].get(left + x, blank) != reference.buffer[y].get(x, blank)
    }
    return {
        (row, column)
        for row, column in wrong
        if seen(cell_at(screen, row, column)) != seen(cell_at(reference, row - top, column - left))
    }


def painted(text: str, rows: int, columns: int) -> pyte.Screen:
    """A screen on which only this was ever written."""
    screen = pyte.Screen(columns, rows)
    pyte.Stream(screen).feed(text)
    return screen


class MovingMapSession:
    """`map_app.py` in a terminal of its own."""

    def __init__(self, host: TerminalHost, dump: Path, environ: Mapping[str, str]) -> None:
        self.host = host
        self.replay = Replay(host)
        self._dump = dump
        self._dumps = 0
        self._look = Look(depth_of(environ, "auto"), "dark")
        self._glyphs = glyphs_of(environ, "auto")

    def press(self, keys: str) -> None:
        self.host.send(keys)

    def point_at(self, row: int, column: int) -> None:
        """Move the mouse with no button down; row and column count from 0."""
        self._report_mouse(35, row, column)

    def turn_wheel(self, row: int, column: int) -> None:
        """Turn the wheel of the mouse up by a notch."""
        self._report_mouse(64, row, column)

    def _report_mouse(self, code: int, row: int, column: int) -> None:
        """Send an SGR report with a code of xterm."""
        self.host.send(f"\x1b[<{code};{column + 1};{row + 1}M")

    def walk(self, frames: int = 20) -> None:
        """Start walking; returns after so many frames."""
        self.press(" ")
        self.wait_for_frames(frames)

    def wait_for_frames(self, frames: int) -> None:
        goal = self.figures()["frames"] + frames
        time.sleep(frames / FPS)  # no sooner: what it counts it tells with the whole screen
        self.host.wait_for(lambda: self.figures()["frames"] >= goal, "more frames")

    def figures(self) -> Any:
        """What the app counts and intends, at this moment."""
        self._dumps += 1
        number = self._dumps
        self.host.process.send_signal(signal.SIGUSR1)
        self.host.wait_for(lambda: self._read().get("number") == number, "the dump")
        return self._read()

    def wait_for_text(self, text: str, present: bool = True) -> None:
        self.host.wait_for(lambda: (text in self.replay.text()) == present, text)

    def wrong(self) -> set[tuple[int, int]]:
        """Cells (row, column) that do not show what they ought to at this moment.

        The whole screen is compared with what Textual would paint; the map, where nothing lies over
        it, also with the picture that the app intends.
        """
        figures = self.figures()
        screen = self.replay.catch_up()
        rows = "".join(f"\x1b[{y}H{row}" for y, row in enumerate(figures["screen"], start=1))
        wrong = wrong_cells(screen, painted(rows, len(figures["screen"]), screen.columns))
        codes = np.array(figures["codes"], np.uint32)
        picture = painted(encode(codes, None, self._look, self._glyphs), *codes.shape)
        wrong_map = wrong_cells(screen, picture, figures["top"], figures["left"])
        for x, y, width, height in figures["covered"]:
            wrong_map = {
                (row, column)
                for row, column in wrong_map
                if not (y <= row < y + height and x <= column < x + width)
            }
        return wrong | wrong_map

    def wait_until_right(self) -> None:
        """Until nothing more arrives and every cell is right."""
        self.host.wait_for_quiet(0.2)
        self.host.wait_for(lambda: not self.wrong(), "the intended picture", at_most=30.0)

    def _read(self) -> Any:
        return json.loads(self._dump.read_text()) if self._dump.exists() else {}


@contextmanager
def moving_map(
    folder: Path,
    *,
    rows: int = 30,
    columns: int = 100,
    robots: int = 100,
    link: TerminalLink | None = None,
    synchronized: bool = True,
    answers: bool = True,
    **environ: str,
) -> Iterator[MovingMapSession]:
    """A session whose first picture is on the screen; `environ` adds to a truecolor terminal's."""
    variables = {**TRUECOLOR, **environ}
    kept = {name: os.environ[name] for name in ("PATH", "HOME", "PYTHONPATH") if name in os.environ}
    with TerminalHost(
        [sys.executable, str(MAP_APP), str(folder / "dump.json"), str(robots)],
        rows=rows,
        columns=columns,
        environ={**kept, **variables},
        link=link,
        synchronized=synchronized,
        answers=answers,
    ) as host:
        session = MovingMapSession(host, folder / "dump.json", variables)
        session.wait_for_text("Walk")
        session.wait_until_right()
        yield session
