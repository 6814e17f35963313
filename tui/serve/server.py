"""The server: access control, the page and its files, and a limited number of sessions.

Any page that the user visits can send requests to 127.0.0.1. The check of Host stops names that are
made to point here (DNS rebinding), the check of Origin stops WebSockets of foreign pages, and the
token stops everybody else on the machine or the network. The first address carries the token. It
moves into a cookie that scripts cannot read and other sites cannot send, and vanishes from the
address bar.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import hmac
import html
import logging
import re
import secrets
import signal
import socket
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Final

from aiohttp import WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError
from aiohttp.typedefs import Handler
from textual_serve.server import Server, to_int
from yarl import URL

from automaton.errors import InputError
from automaton.printable import one_line
from tui.serve.browser_session import TERMINATE_GRACE_S, BrowserSession, bounded

HERE = Path(__file__).parent

USABLE_TOKEN = re.compile(r"[A-Za-z0-9_-]{16,}")

# A reloaded page waits so long for its old session to end.
SESSION_SLOT_TIMEOUT_S = TERMINATE_GRACE_S + 1.0

SHUTDOWN_S = 3 * TERMINATE_GRACE_S
HEARTBEAT_S = 15.0  # interval at which vanished browsers are noticed
LONGEST_MESSAGE = 1 << 16  # bytes from the browser: keys and pasted text
HEAD_S = 10.0  # for the head of a request to arrive
HEAD_ENDS = b"\r\n\r\n"

LONGEST_LINE: Final = 300  # characters

# Requests that are not HTTP, and connections lost while they were answered.
NOT_OURS: Final = (HttpProcessingError, ConnectionError)


class ViewerServer(Server):
    """textual-serve with access control, a limit of sessions and an orderly end."""

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
        """The page's script, a file since the policy forbids inline scripts."""
        return web.FileResponse(HERE / "page.js")

    async def handle_websocket(self, request: web.Request) -> web.WebSocketResponse:
        """Run a session, if fewer than the limit are running."""
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
            # Idle time or a message that the page never sends ends the session.
            with contextlib.suppress(TimeoutError, ValueError):
                if not self._closing:  # on_shutdown may have come before the process
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
        """End all sessions and start no more."""
        self._closing = True
        await self._end_sessions()

    async def _end_sessions(self) -> None:
        await asyncio.gather(*(session.stop() for session in self._sessions))

    async def run(self, listener: socket.socket) -> None:
        """Serve on `listener` until SIGINT, SIGTERM or SIGHUP, or until cancelled."""
        # No access log: the first address contains the token.
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
            await self._end_sessions()  # sessions for which aiohttp stopped waiting


async def asked_to_end() -> None:
    """Wait for a signal that ends the server; under `nohup` SIGHUP is ignored."""
    end = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            loop.add_signal_handler(number, end.set)
    await end.wait()


# The Host, the token and the Origin of a request.


def new_token() -> str:
    """A token that nobody can guess."""
    return secrets.token_urlsafe(32)


def checked_token(token: str) -> str:
    """`token`, if long enough and without characters to quote. Raises InputError."""
    if not USABLE_TOKEN.fullmatch(token):
        raise InputError("--token needs at least 16 letters, digits, '-' or '_'")
    return token


@dataclass(frozen=True)
class Access:
    """Access control of one server."""

    public_url: str  # an Origin, such as http://127.0.0.1:8000
    hosts: frozenset[str]  # allowed Host headers
    token: str | None  # None: Host and Origin suffice
    cookie: str  # its name, with the port: browsers share cookies between ports

    @property
    def entrance(self) -> str:
        """The address to open."""
        return f"{self.public_url}/" + (f"?token={self.token}" if self.token else "")

    @property
    def websocket_url(self) -> str:
        """The address to which the page connects: wss for https."""
        return f"ws{self.public_url.removeprefix('http')}/ws"

    @web.middleware
    async def guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Let `request` through, or raise the response that it gets instead."""
        if request.headers.get("Host", "").lower() not in self.hosts:
            raise web.HTTPForbidden(text=f"Open this server as {self.public_url}.\n")
        if self.token is not None:
            given = request.query.get("token") if request.path == "/" else None
            if given is not None:
                self._check_token(given)
                raise self._admission(request)
            self._check_token(request.cookies.get(self.cookie, ""))
        return await handler(request)

    def check_origin(self, request: web.Request) -> None:
        """Only the server's own page may open a WebSocket; browsers let any page try."""
        if request.headers.get("Origin") != self.public_url:
            raise web.HTTPForbidden(text=f"Only pages of {self.public_url} may connect.\n")

    def _check_token(self, given: str) -> None:
        assert self.token is not None
        # In constant time: the duration of a comparison must not reveal where it failed.
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode()):
            text = "Open the address that `automaton serve` printed: it contains the token.\n"
            raise web.HTTPForbidden(text=text)

    def _admission(self, request: web.Request) -> web.HTTPException:
        assert self.token is not None
        rest = {key: value for key, value in request.query.items() if key != "token"}
        response = web.HTTPSeeOther(str(URL("/").with_query(rest)))
        response.set_cookie(
            self.cookie,
            self.token,
            httponly=True,
            samesite="Strict",
            secure=self.public_url.startswith("https:"),
        )
        return response

    async def add_headers(self, request: web.Request, response: web.StreamResponse) -> None:
        """Add headers that restrict what the browser may do with responses."""
        response.headers.update(
            {
                "Content-Security-Policy": self._content_security_policy(),
                "X-Frame-Options": "DENY",
                "X-Content-Type-Options": "nosniff",
                "Referrer-Policy": "no-referrer",  # the first address contains the token
                "Cross-Origin-Resource-Policy": "same-origin",
            }
        )

    def _content_security_policy(self) -> str:
        """Allow own scripts, fonts, pictures and one WebSocket; xterm.js makes style elements."""
        socket = self.websocket_url.removesuffix("/ws")
        return (
            "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
            f"font-src 'self'; img-src 'self' data:; connect-src {socket}; "
            "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )


@web.middleware
async def known_paths(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer 404 if a path is too long for the file system."""
    try:
        return await handler(request)
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise web.HTTPNotFound from None
        raise


# Connections, and the log of failed requests.


class Punctual(asyncio.Protocol):
    """A connection that ends unless the head of its first request arrives in time.

    aiohttp itself would wait forever, so that anybody could hold all connections. It limits only
    the time between two requests (`keepalive_timeout`).
    """

    def __init__(self, handler: asyncio.Protocol) -> None:
        self._handler = handler
        self._end = b""  # the last bytes of the head so far
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


class _OneLine(logging.Handler):
    """Writes errors of our own code to stderr, one line each, without a traceback."""

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, NOT_OURS):
            return
        what = record.getMessage() if error is None else f"{type(error).__name__}: {error}"
        said = one_line(" ".join(what.split()), LONGEST_LINE)
        print(f"automaton: a request failed, {said}", file=sys.stderr, flush=True)


def request_log() -> logging.Logger:
    """The logger for aiohttp, which would otherwise print a traceback for each failed request."""
    log = logging.Logger(
        "automaton.serve", logging.ERROR
    )  # without a parent: no other handler receives it
    log.addHandler(_OneLine())
    return log
