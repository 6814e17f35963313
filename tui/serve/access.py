"""Who may speak to the server: the Host, the token and the Origin of a request.

A page that the user visits can send requests to 127.0.0.1 too. Host stops names that are made to
point here (DNS rebinding), Origin stops WebSockets of foreign pages, the token stops everybody else
on the machine or the network. It comes once in the address, moves into a cookie that scripts cannot
read and other sites cannot send, and vanishes from the address bar.
"""

from __future__ import annotations

import hmac
import re
import secrets
from dataclasses import dataclass

from aiohttp import web
from aiohttp.typedefs import Handler
from yarl import URL

from automaton.errors import InputError

USABLE_TOKEN = re.compile(r"[A-Za-z0-9_-]{16,}")


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
