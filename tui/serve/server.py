"""The server: who may speak to it, the page, its files, and a limited number of sessions.

A page that the user visits can send requests to 127.0.0.1 too. Host stops names that are made to
point here (DNS rebinding), Origin stops WebSockets of foreign pages, the token stops everybody else
on the machine or the network. It comes once in the address, moves into a cookie that scripts cannot
read and other sites cannot send, and vanishes from the address bar.
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

# how long a new session waits for one that is ending: a reloaded page
SESSION_SLOT_TIMEOUT_S = TERMINATE_GRACE_S + 1.0

SHUTDOWN_S = 3 * TERMINATE_GRACE_S
HEARTBEAT_S = 15.0  # a browser that vanished without a word is noticed by then
LONGEST_MESSAGE = 1 << 16  # bytes from the browser: keys, and what is pasted
HEAD_S = 10.0  # in which the head of a request must have come
HEAD_ENDS = b"\r\n\r\n"

LONGEST_LINE: Final = 300  # characters

# Requests that are not HTTP, and connections that went away while they were answered.
NOT_OURS: Final = (HttpProcessingError, ConnectionError)


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


# The Host, the token and the Origin of a request.


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(32)


def checked_token(token: str) -> str:
    """`token`, if it is long enough and needs no quoting in an address or a cookie."""
    if not USABLE_TOKEN.fullmatch(token):
        raise InputError("--token needs at least 16 letters, digits, '-' or '_'")
    return token


@dataclass(frozen=True)
class Access:
    """The door of one server."""

    public_url: str  # what browsers call it, such as http://127.0.0.1:8000: an Origin
    hosts: frozenset[str]  # what the Host header may say
    token: str | None  # None: whoever has the right Host and Origin
    cookie: str  # its name; cookies know no ports, so that it names the port

    @property
    def entrance(self) -> str:
        """The address to open."""
        return f"{self.public_url}/" + (f"?token={self.token}" if self.token else "")

    @property
    def websocket_url(self) -> str:
        """The address to which the page connects; https becomes wss."""
        return f"ws{self.public_url.removeprefix('http')}/ws"

    @web.middleware
    async def guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Let `request` through, or raise the answer it gets instead."""
        if request.headers.get("Host", "").lower() not in self.hosts:
            raise web.HTTPForbidden(text=f"This server is called {self.public_url} only.\n")
        if self.token is not None:
            given = request.query.get("token") if request.path == "/" else None
            if given is not None:
                self._check_token(given)
                raise self._admission(request)
            self._check_token(request.cookies.get(self.cookie, ""))
        return await handler(request)

    def check_origin(self, request: web.Request) -> None:
        """A WebSocket is for the server's own page: browsers let any page open one."""
        if request.headers.get("Origin") != self.public_url:
            raise web.HTTPForbidden(text=f"Only pages of {self.public_url} may connect.\n")

    def _check_token(self, given: str) -> None:
        assert self.token is not None
        # In constant time: how long a comparison takes must not tell where it failed.
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode()):
            text = "Open the address that `automaton serve` printed: it carries the token.\n"
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
        """What the browser must not do with anything that comes from here."""
        response.headers.update(
            {
                "Content-Security-Policy": self._content_security_policy(),
                "X-Frame-Options": "DENY",
                "X-Content-Type-Options": "nosniff",
                "Referrer-Policy": "no-referrer",  # the first address has the token in it
                "Cross-Origin-Resource-Policy": "same-origin",
            }
        )

    def _content_security_policy(self) -> str:
        """Own scripts, fonts and pictures, one WebSocket; xterm.js makes style elements."""
        socket = self.websocket_url.removesuffix("/ws")
        return (
            "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
            f"font-src 'self'; img-src 'self' data:; connect-src {socket}; "
            "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )


@web.middleware
async def known_paths(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer that there is no file where a path is longer than a file system takes."""
    try:
        return await handler(request)
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise web.HTTPNotFound from None
        raise


# Connections, and what is said of requests that fail.


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


class _OneLine(logging.Handler):
    """Writes what is ours to mend as one line on stderr, without a traceback."""

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, NOT_OURS):
            return
        what = record.getMessage() if error is None else f"{type(error).__name__}: {error}"
        said = one_line(" ".join(what.split()), LONGEST_LINE)
        print(f"automaton: a request failed, {said}", file=sys.stderr, flush=True)


def request_log() -> logging.Logger:
    """Return the logger for the server of aiohttp, which would print a traceback of each request."""
    log = logging.Logger(
        "automaton.serve", logging.ERROR
    )  # of no family: no other handler hears it
    log.addHandler(_OneLine())
    return log
