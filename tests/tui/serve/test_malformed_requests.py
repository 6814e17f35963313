"""Requests that are not HTTP: an answer or a closed connection, and nothing on standard error."""

from __future__ import annotations

import asyncio
import random
import socket
from pathlib import Path

import pytest

pytest.importorskip("textual_serve")

from fake_viewer import served

from tui.serve import server as server_module

HEAD = b"GET %s HTTP/1.1\r\nHost: %s\r\n"
SOCKET = (
    b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nOrigin: http://%s\r\n\r\n"
)


def malformed(here: bytes) -> list[bytes]:
    """Requests, some of which only look like it."""
    chance = random.Random(1)
    good = HEAD % (b"/?fontsize=16", here) + b"Cookie: a=b\r\nContent-Length: 3\r\n\r\nabc"
    requests = [
        chance.randbytes(300) + b"\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET http://[::1 HTTP/1.1\r\n\r\n",
        HEAD % (b"/" + b"x" * 20_000, here) + b"\r\n",
        HEAD % (b"/static/" + b"x" * 5_000, here) + b"\r\n",
        HEAD % (b"/static/%00", here) + b"\r\n",
        HEAD % (b"/\xff\xfe", here) + b"\r\n",
        HEAD % (b"/", here) + b"X: " + b"y" * 20_000 + b"\r\n\r\n",
        HEAD % (b"/", here) + b"Bad Header\r\n\r\n",
        HEAD % (b"/", here) + b"Content-Length: -5\r\n\r\n",
        HEAD % (b"/", here) + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n\r\n",
        HEAD % (b"/ws", here) + SOCKET % here + chance.randbytes(200),
        HEAD % (b"/ws", here) + SOCKET % here + b"\x81\x7f" + b"\xff" * 8,
    ]
    for _ in range(40):
        data = bytearray(good)
        for _ in range(chance.choice((1, 2, 5))):
            data[chance.randrange(len(data))] = chance.randrange(256)
        requests.append(bytes(data))
    return requests


async def sent(port: int, request: bytes, is_reset: bool) -> None:
    """Send a request and wait for an answer, or reset the connection at once."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(request)
    if is_reset:
        await writer.drain()
        linger = b"\1\0\0\0\0\0\0\0"  # on, for 0 s
        writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        writer.transport.abort()
        return
    writer.write_eof()
    try:
        async with asyncio.timeout(30):
            await reader.read(100)
    except ConnectionResetError:
        pass
    writer.close()


def test_malformed_requests_are_answered_without_a_word_on_the_server(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    async def attack() -> None:
        async with served(tmp_path, token=None) as server:
            here = f"127.0.0.1:{server.port}".encode()
            for request in malformed(here):
                for is_reset in (False, True):
                    await sent(server.port, request, is_reset)
            assert (await server.get("/"))[0] == 200

    asyncio.run(attack())
    assert [record.getMessage() for record in caplog.records] == []
    assert capsys.readouterr().err == ""


def test_a_fault_of_ours_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> int:
        raise ValueError("no\nnumber")

    monkeypatch.setattr(server_module, "to_int", broken)

    async def ask() -> None:
        async with served(tmp_path, token=None) as server:
            assert (await server.get("/"))[0] == 500

    asyncio.run(ask())
    assert capsys.readouterr().err == "automaton: a request failed, ValueError: no number\n"
