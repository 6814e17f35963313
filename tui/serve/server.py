"""The server: the page, its files, and a limited number of sessions."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import html
import signal
import socket
from collections.abc import Sequence
from pathlib import Path
from string import Template

from aiohttp import WSMsgType, web
from aiohttp.typedefs import Handler
from textual_serve.server import Server, to_int

from tui.serve.access import Access
from tui.serve.browser_session import TERMINATE_GRACE_S, BrowserSession, bounded
from tui.serve.request_log import request_log

HERE = Path(__file__).parent
# how long a new session waits for one that is ending: a reloaded page
SESSION_SLOT_TIMEOUT_S = TERMINATE_GRACE_S + 1.0
SHUTDOWN_S = 3 * TERMINATE_GRACE_S
HEARTBEAT_S = 15.0  # a browser that vanished without a word is noticed by then
LONGEST_MESSAGE = 1 << 16  # bytes from the browser: keys, and what is pasted
HEAD_S = 10.0  # in which the head of a request must have come
HEAD_ENDS = b"\r\n\r\n"


class Punctual(asyncio.Protocol):
    """A connection that ends unless the head of its first request comes in time.

    aiohttp waits for it without end, so that anybody could hold all connections; between two requests
    it has a limit of its own (`keepalive_timeout`).
    """

    def __init__(self, handler: asyncio.Protocol) -> None:
        self._handler = handler
        self._end = b""  # of what has come of the head
        self._late: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._late = asyncio.get_running_loop().call_later(HEAD_S, transport.abort)
        self._handler.connection_made(transport)

    def data_received(self, data: bytes) -> None:
        if self._late is not None:
            head = self._end + data
            self._end = head[1 - len(HEAD_ENDS) :]
            if HEAD_ENDS in head:
                self._in_time()
        self._handler.data_received(data)

    def _in_time(self) -> None:
        if self._late is not None:
            self._late.cancel()
            self._late = None

    def eof_received(self) -> bool | None:
        return self._handler.eof_received()

    def connection_lost(self, error: Exception | None) -> None:
        self._in_time()
        self._handler.connection_lost(error)

    def pause_writing(self) -> None:
        self._handler.pause_writing()

    def resume_writing(self) -> None:
        self._handler.resume_writing()


@web.middleware
async def known_paths(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer that there is no file where a path is longer than a file system takes."""
    try:
        return await handler(request)
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise web.HTTPNotFound from None
        raise


class ViewerServer(Server):
    """textual-serve with a door, a limit and an end."""

    def __init__(
        self,
        argv: Sequence[str],
        access: Access,
        *,
        title: str,
        sessions: int,
        idle_s: float | None,
        read_only: bool,
    ) -> None:
        super().__init__(" ".join(argv), title=title, public_url=access.public_url)
        self._argv = argv
        self._access = access
        self._limit = sessions
        self._idle_s = idle_s
        self._read_only = read_only
        self._places = asyncio.Semaphore(sessions)
        self._sessions: set[BrowserSession] = set()
        self._closing = False

    async def _make_app(self) -> web.Application:
        app = web.Application(middlewares=[self._access.guard, known_paths])
        app.add_routes(
            [
                web.get("/", self.handle_index),
                web.get("/page.js", self.handle_script),
                web.get("/ws", self.handle_websocket),
                web.static("/static", self.statics_path),  # lists no directories
            ]
        )
        if not self._read_only:
            app.add_routes([web.get("/download/{key}", self.handle_download)])
        app.on_response_prepare.append(self._access.add_headers)
        app.on_shutdown.append(self.on_shutdown)
        return app

    async def handle_index(self, request: web.Request) -> web.Response:
        """The page with the terminal."""
        template = Template((HERE / "page.html").read_text(encoding="utf-8"))
        text = template.substitute(
            title=html.escape(self.title),
            socket=html.escape(self._access.websocket_url),
            font_size=to_int(request.query.get("fontsize", ""), 16),
            sessions=self._limit,
        )
        headers = {"Cache-Control": "no-store"}
        return web.Response(text=text, content_type="text/html", headers=headers)

    async def handle_script(self, request: web.Request) -> web.FileResponse:
        """The page's own script: the policy allows none inside the page."""
        return web.FileResponse(HERE / "page.js")

    async def handle_websocket(self, request: web.Request) -> web.WebSocketResponse:
        """A session, if there is a place for one."""
        self._access.check_origin(request)
        try:
            async with asyncio.timeout(SESSION_SLOT_TIMEOUT_S):
                await self._places.acquire()
        except TimeoutError:
            text = f"All sessions are taken: this server runs at most {self._limit} at once.\n"
            raise web.HTTPServiceUnavailable(text=text) from None
        try:
            return await self._serve_session(request)
        finally:
            self._places.release()

    async def _serve_session(self, request: web.Request) -> web.WebSocketResponse:
        if self._closing:
            raise web.HTTPServiceUnavailable(text="This server is closing.\n")
        websocket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=LONGEST_MESSAGE)
        await websocket.prepare(request)
        session = BrowserSession(self._argv, websocket, self.download_manager, self._read_only)
        width, height = (
            bounded(to_int(request.query.get(name, ""), default))
            for name, default in (("width", 80), ("height", 24))
        )
        self._sessions.add(session)
        try:
            await session.start(width, height)
            # Idle, or something that the page does not send: either ends the session.
            with contextlib.suppress(TimeoutError, ValueError):
                if not self._closing:  # on_shutdown came before there was a process
                    await self._converse(websocket, session)
        finally:
            await session.stop()
            self._sessions.discard(session)
        return websocket

    async def _converse(self, websocket: web.WebSocketResponse, session: BrowserSession) -> None:
        now = asyncio.get_running_loop().time
        async with asyncio.timeout(self._idle_s) as patience:
            async for message in websocket:
                by_hand = message.type == WSMsgType.TEXT and await session.take(message.data)
                if by_hand and self._idle_s is not None:
                    patience.reschedule(now() + self._idle_s)

    async def on_shutdown(self, app: web.Application) -> None:
        """End all sessions; none begins from here on."""
        self._closing = True
        await self._end_sessions()

    async def _end_sessions(self) -> None:
        await asyncio.gather(*(session.stop() for session in self._sessions))

    async def run(self, listener: socket.socket) -> None:
        """Serve on `listener` until SIGINT, SIGTERM or SIGHUP, or until cancelled."""
        # No access log: the first address has the token in it.
        app = await self._make_app()
        runner = web.AppRunner(
            app,
            access_log=None,
            logger=request_log(),
            shutdown_timeout=SHUTDOWN_S,
            keepalive_timeout=HEAD_S,
        )
        await runner.setup()
        handler = runner.server
        assert handler is not None
        loop = asyncio.get_running_loop()
        door = await loop.create_server(lambda: Punctual(handler()), sock=listener)
        try:
            await asked_to_end()
        finally:
            door.close()
            await runner.cleanup()
            await self._end_sessions()  # those whose requests aiohttp gave up waiting for


async def asked_to_end() -> None:
    """Wait for a signal that ends the server; `nohup` keeps it from the loss of its terminal."""
    end = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            loop.add_signal_handler(number, end.set)
    await end.wait()
