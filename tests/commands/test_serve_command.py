"""`automaton serve` from the outside: what it prints, how it ends, and what it refuses."""

from __future__ import annotations

import asyncio
import signal
import socket
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest

pytest.importorskip("textual_serve")

import aiohttp
from fake_viewer import TOKEN, wait_for_end
from signal_process import signal_process

from automaton.commands import main
from automaton.commands.serve import viewer
from tui.serve.address import origin


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_command_prints_its_address_and_ends_on_a_signal(number: signal.Signals) -> None:
    command = [sys.executable, "-m", "automaton", "serve", "tabletop-mini", "--port", "0"]
    process = subprocess.Popen(
        signal_process(number, command),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    printed = ""
    for line in process.stdout:
        printed += line
        if "Ctrl-C" in line:
            break
    try:
        entrance = next(line for line in printed.splitlines() if line.startswith("http"))
        assert "?token=" in entrance and "ssh -L" in printed and "read-only" in printed

        async def visit() -> int:
            async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as http:
                async with http.get(entrance) as answer:
                    assert "token" not in str(answer.url) and "tabletop-mini" in await answer.text()
                origin, _, _ = entrance.partition("/?")
                async with http.ws_connect(origin + "/ws", origin=origin):
                    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
                    async with asyncio.timeout(20):  # for the session to begin
                        while not (pids := [int(pid) for pid in children.read_text().split()]):
                            await asyncio.sleep(0.01)
                    process.send_signal(number)
                    code = await asyncio.to_thread(process.wait, 20)
                    assert wait_for_end(pids) == []
                    return code

        assert asyncio.run(visit()) == 0
        assert "Traceback" not in process.stdout.read()
    finally:
        process.kill()


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The sentence with which `automaton serve` refuses its arguments."""
    assert main(["serve", "tabletop-mini", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--host", "192.168.1.5", "--no-token"], "others can reach 192.168.1.5"),
        (["--host", "0.0.0.0", "--public-url", "http://localhost", "--no-token"], "others can"),
        (["--public-url", "https://lab.example", "--no-token"], "others can reach lab.example"),
        (["--host", "0.0.0.0"], "needs --public-url"),
        (["--host", "192.0.2.1"], "cannot listen on port 8000 of 192.0.2.1"),
        (["--host", "no.such.host.invalid"], "cannot listen on port 8000 of no.such"),
        (["--public-url", "lab.example"], "must look like"),
        (["--public-url", "http://lab.example/floor"], "must look like"),
        (["--public-url", "http://lab.example:port"], "is not an address"),
        (["--token", "short"], "at least 16"),
        (["--token", TOKEN, "--no-token"], "not allowed with"),
        (["--sessions", "0"], "not a number of sessions"),
        (["--port", "65536"], "not a port"),
        (["--idle", "soon"], "not a time"),
        (["--set", "fleet.robots=many"], "fleet"),
    ],
)
def test_what_cannot_be_served_is_one_sentence(
    capsys: pytest.CaptureFixture[str], arguments: list[str], sentence: str
) -> None:
    assert sentence in refused(capsys, *arguments)


def test_a_port_in_use_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        assert f"port {port} of 127.0.0.1 is in use" in refused(capsys, "--port", port)


def test_without_the_extra_it_says_which(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.startswith("tui.serve.")]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("textual_serve.server", "textual_serve.app_service", "aiohttp"):
        monkeypatch.setitem(sys.modules, name, None)
    assert "fleet-automaton[serve]" in refused(capsys)


@pytest.mark.parametrize(
    ("url", "written"),
    [
        ("HTTPS://Lab.Example:443/", "https://lab.example"),
        ("http://lab.example:80", "http://lab.example"),
        ("http://[::1]:8000", "http://[::1]:8000"),
    ],
)
def test_a_public_address_is_written_as_browsers_do(url: str, written: str) -> None:
    assert origin(url) == written


def test_a_session_looks_only_unless_told_otherwise() -> None:
    args = Namespace(scenario="mine.yaml", settings=["a=-1"], seed=3, interactive=False)
    assert viewer(args)[2:] == [
        *("automaton", "watch", "mine.yaml", "--no-record", "--read-only"),
        *("--seed=3", "--set=a=-1"),
    ]
    args.interactive = True
    assert "--read-only" not in viewer(args)
