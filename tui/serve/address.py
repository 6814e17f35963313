"""The address at which the server listens, and the one that browsers use."""

from __future__ import annotations

import errno
import ipaddress
import os
import socket
from urllib.parse import urlsplit

from automaton.errors import InputError

DEFAULT_PORTS = {"http": 80, "https": 443}
EVERYWHERE = ("", "0.0.0.0", "::")


def listen(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 picks a free port. Raises InputError."""
    try:
        family, _, _, _, place = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server((str(place[0]), port), family=family)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise InputError(
                f"port {port} of {host} is in use: choose another with --port, or 0 for a free one"
            ) from error
        reason = error.strerror if isinstance(error, socket.gaierror) else None
        reason = reason or os.strerror(error.errno or 0)
        raise InputError(f"cannot listen on port {port} of {host}: {reason}") from error


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches `host`; others may reach any name except localhost."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def authority(host: str, port: int, scheme: str = "http") -> str:
    """The Host header of browsers: without the scheme's default port, with brackets for IPv6."""
    name = f"[{host}]" if ":" in host else host
    return name if port == DEFAULT_PORTS[scheme] else f"{name}:{port}"


def origin(url: str) -> str:
    """`url` as browsers write it in the Origin header. Raises InputError."""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        raise InputError(f"--public-url: '{url}' is not an address") from None
    extra = parts.path.strip("/") or parts.query or parts.fragment or "@" in parts.netloc
    if parts.scheme not in DEFAULT_PORTS or not parts.hostname or extra:
        raise InputError(
            f"--public-url must look like https://host or http://host:8000, not '{url}'"
        )
    port = DEFAULT_PORTS[parts.scheme] if port is None else port
    return f"{parts.scheme}://{authority(parts.hostname, port, parts.scheme)}"


def checked_exposure(host: str, public_url: str | None, token: str | None) -> None:
    """Raise InputError for an address that nobody could open, or strangers without a token."""
    if host in EVERYWHERE and public_url is None:
        name = host or repr("")
        raise InputError(f"--host {name} needs --public-url, the address that browsers open")
    reached = [host] if public_url is None else [host, urlsplit(origin(public_url)).hostname or ""]
    for name in reached:
        if token is None and not is_loopback(name):
            raise InputError(f"--no-token works on this machine only, but others can reach {name}")
