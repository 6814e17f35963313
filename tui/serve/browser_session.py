"""A browser session: the process of its viewer, and the environment of that process."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import shlex
import signal
from asyncio.subprocess import PIPE, Process
from collections.abc import Mapping, Sequence
from typing import Any

from aiohttp import web
from textual_serve.app_service import AppService
from textual_serve.download_manager import DownloadManager

TERMINATE_GRACE_S = 3.0  # for a process to end after SIGTERM, for a browser to answer a close

TERMINAL_SIZES = range(1, 1001)  # rows and columns; a browser may ask for any number

# Answers that a terminal sends by itself: cursor position, modes, attributes. The viewer requests a
# position with every frame; if answers counted as input, a playing viewer would never be idle.
REPORTS = re.compile(r"(\x1b\[\??[\d;]*(R|\$y|c|n|t))+")

STRING = re.compile(r'"(?:[^"\\]|\\.)*"')
MAX_JSON_NESTING = 2  # levels of lists and objects that the page sends


class BrowserSession(AppService):
    """A process of the viewer behind a WebSocket."""

    def __init__(
        self,
        argv: Sequence[str],
        websocket: web.WebSocketResponse,
        downloads: DownloadManager,
        read_only: bool,
    ) -> None:
        super().__init__(
            shlex.join(argv),
            write_bytes=websocket.send_bytes,
            write_str=websocket.send_str,
            close=self._close,
            download_manager=downloads,
        )
        self._argv = argv
        self._websocket = websocket
        self._read_only = read_only
        self._ending: asyncio.Task[None] | None = None

    def _build_environment(self, width: int = 80, height: int = 24) -> dict[str, str]:
        return clean(super()._build_environment(width=width, height=height))

    async def _open_app_process(self, width: int = 80, height: int = 24) -> Process:
        # In a process group of its own, the process and its children can be ended together, and
        # Ctrl-C in the server's terminal does not reach them first.
        self._process = await asyncio.create_subprocess_exec(
            *self._argv,
            stdin=PIPE,
            stdout=PIPE,
            stderr=PIPE,
            env=self._build_environment(width, height),
            start_new_session=True,
        )
        self._stdin = self._process.stdin
        return self._process

    async def run(self) -> None:
        """Send the process's output to the browser until the process ends; then close."""
        try:
            await super().run()
        except asyncio.CancelledError:
            task = asyncio.current_task()
            if task is not None and task.cancelling():
                raise
            # The process had ended before: the task that reads its errors was cancelled unstarted.
        if self._ending is None:
            await asyncio.gather(self._print_errors(), self._close())

    async def _print_errors(self) -> None:
        """Print what the process said at its end; a child of it may hold the pipe open."""
        assert self._process is not None and self._process.stderr is not None
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(TERMINATE_GRACE_S):
                while data := await self._process.stderr.read(4096):
                    print(end=data.decode("utf-8", "replace"))

    async def take(self, text: str) -> bool:
        """Pass a message of the browser to the process; returns whether a person caused it."""
        match read(text):
            case ["stdin", str(data)]:
                await self.send_bytes(data.encode("utf-8", "replace"))
                return REPORTS.fullmatch(data) is None
            case ["resize", {"width": int(width), "height": int(height)}]:
                await self.set_terminal_size(bounded(width), bounded(height))
                return True
            case ["ping", data]:
                await self._websocket.send_json(["pong", data])
            case ["blur"]:
                await self.blur()
            case ["focus"]:
                await self.focus()
                return True
        return False

    async def on_meta(self, data: bytes) -> None:
        """Pass on messages of the process, except files in a read-only session."""
        if self._read_only and json.loads(data)["type"] == "deliver_file_start":
            return
        await super().on_meta(data)

    async def stop(self) -> None:
        """End the process with all its children; may be called repeatedly and concurrently."""
        if self._process is None:
            return
        if self._ending is None:
            self._ending = asyncio.create_task(self._end(self._process))
        await asyncio.shield(self._ending)

    async def _end(self, process: Process) -> None:
        await self._download_manager.cancel_app_downloads(app_service_id=self.app_service_id)
        signal_group(process.pid, signal.SIGTERM)
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait([self._task], timeout=TERMINATE_GRACE_S)
        try:
            # RuntimeError: its reader has not ended yet.
            with contextlib.suppress(TimeoutError, RuntimeError):
                async with asyncio.timeout(TERMINATE_GRACE_S):
                    # Read on: a process blocked by a full pipe would never handle the signal.
                    await process.communicate()
        finally:
            signal_group(process.pid, signal.SIGKILL)  # or its remaining children
        with contextlib.suppress(TimeoutError):
            # a child outside the group may hold the pipes
            async with asyncio.timeout(TERMINATE_GRACE_S):
                await process.wait()
        await self._close()

    async def _close(self) -> None:
        with contextlib.suppress(TimeoutError):
            # a browser that reads nothing never answers
            async with asyncio.timeout(TERMINATE_GRACE_S):
                await self._websocket.close()


def bounded(size: int) -> int:
    """A number of rows or columns, clamped to TERMINAL_SIZES."""
    return min(max(size, TERMINAL_SIZES[0]), TERMINAL_SIZES[-1])


def read(text: str) -> Any:
    """Parse a message of the browser. Raises ValueError unless it is JSON of limited nesting."""
    depth = 0
    for mark in STRING.sub("", text):
        depth += (mark in "[{") - (mark in "]}")
        if depth > MAX_JSON_NESTING:
            raise ValueError("nested too deep")
    return json.loads(text)


def signal_group(pid: int, number: signal.Signals) -> None:
    """Send a signal to the process group that `pid` leads, if it still exists."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(pid, number)


# The environment of the process: only the variables that it needs.


ALLOWED_VARIABLES = {"PATH", "HOME", "TMPDIR", "LD_LIBRARY_PATH", "VIRTUAL_ENV"}
ALLOWED_PREFIXES = ("XDG_", "PYTHON", "NUMBA_", "AUTOMATON_")

PROTOCOL = {  # set by textual-serve
    "TEXTUAL_DRIVER",
    "TEXTUAL_FPS",
    "TEXTUAL_COLOR_SYSTEM",
    "TERM_PROGRAM",
    "TERM_PROGRAM_VERSION",
    "COLUMNS",
    "ROWS",
}

# The terminal is the browser, whichever terminal started the server.
TERMINAL = {"TERM": "xterm-256color", "COLORTERM": "truecolor", "LC_ALL": "C.UTF-8"}


def clean(environment: Mapping[str, str]) -> dict[str, str]:
    """The variables that a session may see: no passwords, keys or agent sockets."""
    allowed = ALLOWED_VARIABLES | PROTOCOL
    kept = {
        name: value
        for name, value in environment.items()
        if name in allowed or name.startswith(ALLOWED_PREFIXES)
    }
    return kept | TERMINAL
