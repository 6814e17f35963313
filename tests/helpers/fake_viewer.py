"""Programs that stand in for the viewer behind `automaton serve`, and a server that runs them."""

from __future__ import annotations

import asyncio
import json
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp

TOKEN = "a-token-for-the-tests"

# Speaks textual-serve's protocol: leaves its pid, its child's pid and its environment in a file,
# greets, and answers what it gets. Arguments: the file, and how it behaves.
PROGRAM = """
import json, os, signal, struct, subprocess, sys

path, manner = sys.argv[1:]
def send(kind, payload):
    os.write(1, kind + struct.pack(">I", len(payload)) + payload)

asked = []
def leave():
    open(path + ".left", "w").close()
    sys.exit()
def on_terminate(number, frame):  # a viewer that is writing sees it only after that
    asked.append(number)
    if manner != "floods":
        leave()
signal.signal(signal.SIGTERM, signal.SIG_IGN if manner == "stubborn" else on_terminate)
is_broken, nothing = manner.startswith("broken"), subprocess.DEVNULL
child = subprocess.Popen(
    ["sleep", "600"],
    stdout=nothing if is_broken else None,
    stderr=nothing if manner == "broken" else None,
)
lines = open(path, "a")
print(json.dumps([os.getpid(), child.pid, os.getpgid(0), dict(os.environ)]), file=lines, flush=True)
if is_broken:
    sys.exit("cannot start")
os.write(1, b"__GANGLION__\\n")
send(b"D", b"welcome to the floor")
if manner == "delivers":
    about = {"path": "a.svg", "open_method": "download", "mime_type": "", "encoding": ""}
    send(b"M", json.dumps({"type": "deliver_file_start", "key": "k", **about}).encode())
    send(b"D", b"delivered")
while manner == "floods":
    send(b"D", b"x" * 65536)
    if asked:
        send(b"D", b"x" * 400000)  # a last picture: more than pipe and server hold unread
        leave()
chunks = [b"4:file", b"0:"]
while head := sys.stdin.buffer.read(5):
    body = sys.stdin.buffer.read(int.from_bytes(head[1:], "big"))
    if b"deliver_chunk_request" in body:
        send(b"P", b"ts13:deliver_chunks1:k" + chunks.pop(0) + b"e")
    send(b"D", head[:1] + body)
signal.pause()
"""

APP = """
from textual.app import App
from textual.widgets import Static

class Floor(App):
    BINDINGS = [("x", "show", "Show")]
    def compose(self):
        yield Static("an empty floor")
    def action_show(self):
        self.query_one(Static).update("a robot came")

Floor().run()
"""


def running(pid: int) -> bool:
    """Whether a process is alive; a zombie is not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):  # it may go while it is read
        return False


def wait_for_end(pids: list[int], seconds: float = 30.0) -> list[int]:
    """Those of `pids` that still run after a while: the kernel ends processes in its own time."""
    until = time.monotonic() + seconds
    while any(map(running, pids)) and time.monotonic() < until:
        time.sleep(0.02)
    return [pid for pid in pids if running(pid)]


class Served:
    """A server in this process, and what its programs wrote."""

    def __init__(self, port: int, path: Path, http: aiohttp.ClientSession) -> None:
        self.port = port
        self.url = f"http://127.0.0.1:{port}"
        self.cookies = {"Cookie": f"automaton-{port}={TOKEN}"}
        self.page = {**self.cookies, "Origin": self.url}  # the headers of the page's WebSocket
        self.http = http
        self._path = path

    def started(self) -> list[tuple[int, int, int, dict[str, str]]]:
        """Of each program: its pid, its child's, its group and its environment."""
        if not self._path.exists():
            return []
        return [tuple(json.loads(line)) for line in self._path.read_text().splitlines()]

    def left(self) -> bool:
        """Whether a program ended of its own accord when it was asked to."""
        return self._path.with_name(self._path.name + ".left").exists()

    def pids(self) -> list[int]:
        """All processes that sessions started."""
        return [pid for program, child, _, _ in self.started() for pid in (program, child)]

    async def get(self, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
        """Status, text and headers of an answer, redirects not followed."""
        async with self.http.get(self.url + path, headers=headers, allow_redirects=False) as answer:
            return answer.status, await answer.text(), dict(answer.headers)

    def connect(self, path: str = "/ws?width=80&height=24", **options: Any) -> Any:
        """The page's WebSocket, unless `options` say otherwise."""
        return self.http.ws_connect(self.url + path, **{"headers": self.page, **options})

    async def refusal(self, **headers: str) -> int:
        """The status with which a WebSocket with these headers is refused; 101 if it is not."""
        try:
            async with self.connect(headers=headers):
                return 101
        except aiohttp.WSServerHandshakeError as error:
            return error.status


@asynccontextmanager
async def served(
    folder: Path,
    manner: str = "",
    *,
    token: str | None = TOKEN,
    sessions: int = 4,
    idle_s: float | None = None,
    read_only: bool = True,
) -> AsyncIterator[Served]:
    """A server of stand-in programs on a free port."""
    from tui.serve.address import listen
    from tui.serve.server import Access, ViewerServer

    listener = listen("127.0.0.1", 0)
    port = listener.getsockname()[1]
    here = f"127.0.0.1:{port}"
    access = Access(f"http://{here}", frozenset({here}), token, f"automaton-{port}")
    path = folder / "started.jsonl"
    argv = [sys.executable, "-c", PROGRAM, str(path), manner]
    if manner == "app":
        argv = [sys.executable, "-c", APP]
    server = ViewerServer(
        argv, access, title="<floor>", sessions=sessions, idle_s=idle_s, read_only=read_only
    )
    serving = asyncio.create_task(server.run(listener))
    try:
        async with aiohttp.ClientSession() as http:
            yield Served(port, path, http)
            serving.cancel()  # with the browsers still there
            await asyncio.wait([serving])
    finally:
        serving.cancel()
        await asyncio.wait([serving])


async def read_until(websocket: Any, text: bytes, seconds: float = 10.0) -> bytes:
    """What the browser gets, until `text` is in it."""
    seen = b""
    async with asyncio.timeout(seconds):
        while text not in seen:
            message = await websocket.receive()
            assert message.type == aiohttp.WSMsgType.BINARY, (message, seen)
            seen += message.data
    return seen
