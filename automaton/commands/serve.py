"""Serve the viewer of a scenario to browsers: one session each, read-only unless --interactive.

Exit code 0: ended by Ctrl-C or a signal; 2: bad input, or an unusable address.
"""

from __future__ import annotations

import argparse
import asyncio
import importlib
import socket
import sys
from typing import Any

from automaton.commands.arguments import add_scenario_arguments, whole
from automaton.errors import InputError
from automaton.world.resolve import resolve


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton serve`."""
    add_scenario_arguments(parser)
    parser.add_argument("--host", default="127.0.0.1", help="listen here (default: 127.0.0.1)")
    parser.add_argument(
        "--port",
        type=whole("a port", 0, 65535),
        default=8000,
        help="listen on this port (default: 8000; 0: any free port)",
    )
    parser.add_argument(
        "--public-url", metavar="URL", help="browsers use this URL (default: http://HOST:PORT)"
    )
    token = parser.add_mutually_exclusive_group()
    text = "use this token, not a random one; other users of this machine can see it"
    token.add_argument("--token", help=text)
    text = "require no token: all users of this machine may connect"
    token.add_argument("--no-token", action="store_true", help=text)
    parser.add_argument(
        "--sessions",
        type=whole("a number of sessions", 1),
        default=4,
        metavar="N",
        help="allow at most N sessions at once (default: 4)",
    )
    parser.add_argument(
        "--idle",
        type=whole("a time", 0),
        default=1800,
        metavar="SECONDS",
        help="end a session after SECONDS without activity (default: 1800; 0: never)",
    )
    parser.add_argument(
        "--interactive", action="store_true", help="let browsers change runs and download files"
    )


def run(args: argparse.Namespace) -> int:
    """Serve until a signal arrives."""
    name = resolve(args.scenario, args.settings, args.seed).scenario.name
    listener, access = open_door(args)
    server = part("server").ViewerServer(
        viewer(args),
        access,
        title=name,
        sessions=args.sessions,
        idle_s=args.idle or None,
        read_only=not args.interactive,
    )
    print(greeting(args, name, access, listener), flush=True)
    asyncio.run(server.run(listener))
    return 0


def part(name: str) -> Any:
    """A module of the browser viewer, by name: headless code must not import the viewer."""
    try:
        return importlib.import_module(f"tui.serve.{name}")
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.startswith(("tui", "automaton")):
            raise
        raise InputError(
            "`automaton serve` needs the extra `serve`: pip install 'fleet-automaton[serve]'"
        ) from error


def viewer(args: argparse.Namespace) -> list[str]:
    """The command line of one session, which records nothing: browsers must not fill this disk."""
    command = [sys.executable, "-m", "automaton", "watch", args.scenario, "--no-record"]
    command += [] if args.interactive else ["--read-only"]
    command += [] if args.seed is None else [f"--seed={args.seed}"]
    return command + [f"--set={setting}" for setting in args.settings]


def open_door(args: argparse.Namespace) -> tuple[socket.socket, Any]:
    """The listening socket and its access rules."""
    server, address = part("server"), part("address")
    token = None
    if not args.no_token:
        token = server.new_token() if args.token is None else server.checked_token(args.token)
    address.checked_exposure(args.host, args.public_url, token)
    listener = address.listen(args.host, args.port)
    here = address.authority(args.host, listener.getsockname()[1])
    public_url = address.origin(args.public_url or f"http://{here}")
    door = server.Access(
        public_url=public_url,
        hosts=frozenset({here.lower(), public_url.partition("://")[2]}),
        token=token,
        cookie=f"automaton-{listener.getsockname()[1]}",
    )
    return listener, door


def greeting(args: argparse.Namespace, name: str, access: Any, listener: socket.socket) -> str:
    """The text with the URL to open, and how to reach it from another machine."""
    manner = "interactive" if args.interactive else "read-only"
    lines = [f"{name} in a browser ({manner}, at most {args.sessions} at once):", access.entrance]
    where = listener.getsockname()[1]
    if args.public_url is None and part("address").is_loopback(args.host):
        tunnel = f"ssh -L {where}:{args.host}:{where} {socket.gethostname()}"
        lines.append(f"From another machine: {tunnel}, then open the same address there.")
    elif access.public_url.startswith("http:"):
        lines.append("Not encrypted: anyone who sees the traffic has the token; ssh -L is safer.")
    return "\n".join([*lines, "Press Ctrl-C to stop."])
