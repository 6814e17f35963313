"""The browser server: who gets in, what a session may do, and that nothing is left behind."""

from __future__ import annotations

import asyncio
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("textual_serve")

import aiohttp
from fake_viewer import TOKEN, Served, read_until, running, served, wait_for_end

from tui.serve import browser_session as session_module
from tui.serve import server as server_module
from tui.serve.browser_session import clean


def story(folder: Path, told: Callable[[Served], Any], manner: str = "", **options: Any) -> None:
    """Run one story against a server."""

    async def tell() -> None:
        async with served(folder, manner, **options) as server:
            await told(server)

    asyncio.run(tell())


async def received(browser: aiohttp.ClientWebSocketResponse) -> aiohttp.WSMessage:
    """The next message; aiohttp's own limit begins anew with each heartbeat."""
    async with asyncio.timeout(60):
        return await browser.receive()


# Who gets in


def test_the_token_becomes_a_cookie_and_leaves_the_address(tmp_path: Path) -> None:
    async def told(server: Served) -> None:
        status, _, headers = await server.get(f"/?token={TOKEN}&fontsize=20")
        assert (status, headers["Location"]) == (303, "/?fontsize=20")
        cookie, *attributes = headers["Set-Cookie"].split("; ")
        assert cookie == server.cookies["Cookie"]
        assert {"HttpOnly", "SameSite=Strict"} <= set(attributes)
        status, page, headers = await server.get("/?fontsize=20", Cookie=cookie)
        assert status == 200
        assert "&lt;floor&gt;" in page and 'data-font-size="20"' in page and TOKEN not in page
        assert headers["Cache-Control"] == "no-store"

    story(tmp_path, told)


@pytest.mark.parametrize("path", ["/", "/static/js/textual.js", "/page.js", "/ws", "/nowhere"])
def test_nothing_without_the_token(tmp_path: Path, path: str) -> None:
    async def told(server: Served) -> None:
        name = server.cookies["Cookie"].partition("=")[0]
        assert (await server.get(path))[0] == 403
        assert (await server.get(path, Cookie=f"{name}={TOKEN}x"))[0] == 403
        assert (await server.get(path, Cookie=f"{name}=\u00e9"))[0] == 403
        assert (await server.get(f"{path}?token=wrong", **server.cookies))[0] != 200 or path != "/"
        status, text, headers = await server.get(f"{path}?token={TOKEN[:-1]}")
        assert status == 403 and "Set-Cookie" not in headers and TOKEN not in text
        assert await server.refusal(Origin=server.url) == 403
        assert server.started() == []

    story(tmp_path, told)


def test_the_token_is_compared_in_constant_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compared: list[bytes] = []
    monkeypatch.setattr("hmac.compare_digest", lambda a, b: compared.append(a) or a == b)

    async def told(server: Served) -> None:
        assert (await server.get("/?token=wrong"))[0] == 403
        assert (await server.get("/", **server.cookies))[0] == 200
        assert compared == [b"wrong", TOKEN.encode()]

    story(tmp_path, told)


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "localhost:{port}", ""])
def test_a_foreign_name_of_this_machine_is_refused(tmp_path: Path, host: str) -> None:
    async def told(server: Served) -> None:
        name = host.format(port=server.url.rpartition(":")[2])
        for path in ("/", f"/?token={TOKEN}", "/static/js/textual.js"):
            status, text, headers = await server.get(path, Host=name, **server.cookies)
            assert (status, "Set-Cookie" in headers) == (403, False) and server.url in text
        assert await server.refusal(**server.page, Host=name) == 403
        assert server.started() == []

    story(tmp_path, told)


@pytest.mark.parametrize("origin", [None, "null", "http://evil.example", "http://127.0.0.1:1"])
@pytest.mark.parametrize("token", [TOKEN, None])
def test_foreign_pages_open_no_websocket(
    tmp_path: Path, origin: str | None, token: str | None
) -> None:
    async def told(server: Served) -> None:
        headers = {**server.cookies, **({} if origin is None else {"Origin": origin})}
        assert await server.refusal(**headers) == 403
        assert server.started() == []
        assert await server.refusal(**server.page) == 101

    story(tmp_path, told, token=token)


def test_no_page_may_frame_it_or_learn_its_address(tmp_path: Path) -> None:
    async def told(server: Served) -> None:
        for path in ("/", f"/?token={TOKEN}", "/static/js/textual.js", "/nowhere"):
            _, _, headers = await server.get(path, **server.cookies)
            policy = headers["Content-Security-Policy"].split("; ")
            assert {"default-src 'none'", "script-src 'self'", "frame-ancestors 'none'"} <= set(
                policy
            )
            assert f"connect-src ws{server.url.removeprefix('http')}" in policy
            assert headers["X-Frame-Options"] == "DENY"
            assert headers["Referrer-Policy"] == "no-referrer"
            assert headers["X-Content-Type-Options"] == "nosniff"
        _, page, _ = await server.get("/", **server.cookies)
        assert "http" not in page  # nothing from elsewhere
        for path in re.findall(r'(?:href|src)="(/[^"]+)"', page):
            assert (await server.get(path, **server.cookies))[0] == 200

    story(tmp_path, told)


def test_files_are_served_but_not_listed(tmp_path: Path) -> None:
    async def told(server: Served) -> None:
        for path in ("/static", "/static/", "/static/js", "/static/js/"):
            status, text, _ = await server.get(path, **server.cookies)
            assert status in (403, 404) and "textual.js" not in text
        assert (await server.get("/static/js/textual.js", **server.cookies))[0] == 200
        assert (await server.get("/static/..%2fserver.py", **server.cookies))[0] in (403, 404)

    story(tmp_path, told)


# What a session does


def test_the_browser_sees_the_app_and_its_keys_reach_it(tmp_path: Path) -> None:
    async def told(server: Served) -> None:
        async with server.connect() as browser:
            await read_until(browser, b"an empty floor")
            await browser.send_json(["stdin", "x"])
            await read_until(browser, b"robot")

    story(tmp_path, told, "app")


def test_messages_reach_the_program_as_packets_and_sizes_have_bounds(tmp_path: Path) -> None:
    async def told(server: Served) -> None:
        async with server.connect("/ws?width=999999999&height=-5") as browser:
            await read_until(browser, b"welcome to the floor")
            await browser.send_json(["stdin", "\u00e9\ud800"])
            await read_until(browser, b"D\xc3\xa9?")
            await browser.send_json(["resize", {"width": 10**9, "height": 0}])
            await read_until(browser, b'M{"type": "resize", "width": 1000, "height": 1}')
            await browser.send_json(["blur"])
            await read_until(browser, b'M{"type": "blur"}')
            await browser.send_json(["ping", "17"])
            assert await browser.receive_json() == ["pong", "17"]
            await browser.send_json(["resize", {"width": "wide"}])
            await browser.send_json(["unheard of"])
            await browser.send_json(["focus"])
            await read_until(browser, b'M{"type": "focus"}')
        variables = server.started()[0][3]
        assert (variables["COLUMNS"], variables["ROWS"]) == ("1000", "1")

    story(tmp_path, told)


@pytest.mark.parametrize(
    "message", ["no JSON", "[" * 60_000, '["resize", {"width": ' + "[" * 1000 + "]" * 1000 + "}]"]
)
def test_what_no_page_sends_ends_the_session(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, message: str
) -> None:
    async def told(server: Served) -> None:
        async with server.connect() as browser:
            await read_until(browser, b"welcome to the floor")
            await browser.send_str(message)
            assert (await received(browser)).type == aiohttp.WSMsgType.CLOSE

    story(tmp_path, told)
    assert "Traceback" not in caplog.text


def test_brackets_in_what_is_typed_are_no_nesting() -> None:
    assert session_module.read(r'["stdin", "[[[[{{{\"[[["]') == ["stdin", '[[[[{{{"[[[']
    with pytest.raises(ValueError, match="nested too deep"):
        session_module.read('["ping", [[1]]]')


@pytest.mark.parametrize("pieces", [[b"GET / HTTP/1.1\r\nHost: x\r\n"], [b""]])
def test_who_does_not_send_the_head_of_a_request_is_let_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pieces: list[bytes]
) -> None:
    monkeypatch.setattr(server_module, "HEAD_S", 0.05)

    async def told(server: Served) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        for piece in pieces:
            writer.write(piece)
        assert await ended(reader) == b""
        writer.close()

    story(tmp_path, told)


def test_who_sends_it_in_pieces_keeps_the_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its end may be cut in two; from then on there is all the time in the world."""
    late: list[asyncio.TimerHandle] = []
    loops = asyncio.BaseEventLoop

    def noted(self: Any, delay: float, *call: Any, **more: Any) -> asyncio.TimerHandle:
        handle = call_later(self, delay, *call, **more)
        if delay == server_module.HEAD_S:
            late.append(handle)
        return handle

    call_later = loops.call_later
    monkeypatch.setattr(server_module, "HEAD_S", 1234.5)
    monkeypatch.setattr(loops, "call_later", noted)

    async def told(server: Served) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        for piece in (b"GET / HTTP/1.1\r\nHost: x\r\n\r", b"\n"):
            assert not any(handle.cancelled() for handle in late)
            writer.write(piece)
            await writer.drain()
            await asyncio.sleep(0)
        assert (await reader.readline()).startswith(b"HTTP/1.1 ")
        assert len(late) == 1 and late[0].cancelled()
        writer.close()

    story(tmp_path, told)


async def ended(reader: asyncio.StreamReader) -> bytes:
    """What comes until the other end closes, or aborts."""
    try:
        async with asyncio.timeout(60):
            return await reader.read()
    except ConnectionResetError:
        return b""


async def printed(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Wait until the server has printed these words."""
    async with asyncio.timeout(60):
        while words not in capsys.readouterr().out:
            await asyncio.sleep(0.02)


def test_a_program_that_cannot_start_closes_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    async def told(server: Served) -> None:
        async with server.connect() as browser:
            assert (await received(browser)).type == aiohttp.WSMsgType.CLOSE
        await printed("cannot start", capsys)

    story(tmp_path, told, "broken")


@pytest.mark.parametrize("manner", ["broken", "broken, and its child holds its stderr"])
def test_so_does_a_program_that_ends_before_it_is_listened_to(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    manner: str,
) -> None:
    opened = session_module.BrowserSession._open_app_process

    async def late(session: session_module.BrowserSession, *size: int) -> Any:
        process = await opened(session, *size)
        while not process.stdout.at_eof():
            await asyncio.sleep(0.01)
        return process

    async def told(server: Served) -> None:
        async with server.connect() as browser:
            assert (await received(browser)).type == aiohttp.WSMsgType.CLOSE
        await printed("cannot start", capsys)

    monkeypatch.setattr(session_module.BrowserSession, "_open_app_process", late)
    monkeypatch.setattr(session_module, "TERMINATE_GRACE_S", 120.0)  # it waits for none of it
    story(tmp_path, told, manner)


def test_the_environment_has_no_secrets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    monkeypatch.setenv("SSH_AUTH_SOCK", "/tmp/agent")
    monkeypatch.setenv("TEXTUAL_LOG", "/tmp/log")
    monkeypatch.setenv("AUTOMATON_CACHE_DIR", "/tmp/cache")
    monkeypatch.setenv("TERM", "dumb")

    async def told(server: Served) -> None:
        async with server.connect() as browser:
            await read_until(browser, b"welcome to the floor")
        variables = server.started()[0][3]
        assert not {"AWS_SECRET_ACCESS_KEY", "SSH_AUTH_SOCK", "TEXTUAL_LOG"} & set(variables)
        assert variables["AUTOMATON_CACHE_DIR"] == "/tmp/cache"
        assert variables["TERM"] == "xterm-256color" and "WebDriver" in variables["TEXTUAL_DRIVER"]
        assert variables["PATH"] == os.environ["PATH"]
        shell = {"PWD", "SHLVL", "_", "OLDPWD"}  # what a shell would have added
        assert clean(variables) == variables and not shell & set(variables)

    story(tmp_path, told)


@pytest.mark.parametrize("read_only", [True, False])
def test_files_are_delivered_only_if_interactive(tmp_path: Path, read_only: bool) -> None:
    async def told(server: Served) -> None:
        async with server.connect() as browser:
            offers = []
            while (message := await received(browser)).data != b"delivered":
                offers += [message.data] if message.type == aiohttp.WSMsgType.TEXT else []
            assert offers == ([] if read_only else ['["deliver_file_start", "k"]'])
            assert (await server.get("/download/k"))[0] == 403
            status, text, _ = await server.get("/download/k", **server.cookies)
            assert (status, text) == ((404, "404: Not Found") if read_only else (200, "file"))

    story(tmp_path, told, "delivers", read_only=read_only)


def test_an_untouched_session_ends_though_its_terminal_reports(tmp_path: Path) -> None:
    async def told(server: Served) -> None:
        async with server.connect() as browser:
            begun = time.monotonic()
            echo = None
            while echo != aiohttp.WSMsgType.CLOSE and time.monotonic() < begun + 60:
                await asyncio.sleep(0.1)
                await browser.send_json(["stdin", "\x1b[24;80R\x1b[?2026;2$y"])
                echo = (await received(browser)).type
            assert echo == aiohttp.WSMsgType.CLOSE
        assert wait_for_end(server.pids()) == []

    story(tmp_path, told, idle_s=1.0)


def test_keys_keep_a_session_alive(tmp_path: Path) -> None:
    async def told(server: Served) -> None:
        async with server.connect() as browser:
            await read_until(browser, b"welcome to the floor")
            for _ in range(8):
                await asyncio.sleep(0.25)
                await browser.send_json(["stdin", "\x1b[A"])
                await read_until(browser, b"D\x1b[A")

    story(tmp_path, told, idle_s=1.0)


# Limits and ends


def test_more_sessions_than_allowed_are_told_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server_module, "SESSION_SLOT_TIMEOUT_S", 0.3)

    async def told(server: Served) -> None:
        async with server.connect() as first, server.connect() as second:
            await read_until(first, b"welcome to the floor")
            await read_until(second, b"welcome to the floor")
            status, text, _ = await server.get("/ws", **server.page)
            assert status == 503 and "at most 2" in text
            assert await server.refusal(**server.page) == 503
            assert len(server.started()) == 2

    story(tmp_path, told, sessions=2)


def test_a_reloaded_page_gets_the_place_it_gave_up(tmp_path: Path) -> None:
    async def told(server: Served) -> None:
        first = await server.connect()
        await read_until(first, b"welcome to the floor")
        second = asyncio.create_task(server.connect().__aenter__())
        await asyncio.sleep(0.2)
        await first.close()
        await read_until(await second, b"welcome to the floor")

    story(tmp_path, told, sessions=1)


@pytest.mark.parametrize("manner", ["", "stubborn", "floods"])
def test_nothing_runs_after_the_browser_went(
    tmp_path: Path, manner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if manner == "stubborn":  # the others end by themselves, on a busy machine later than that
        monkeypatch.setattr(session_module, "TERMINATE_GRACE_S", 0.5)

    async def told(server: Served) -> None:
        browser = await server.connect()
        await received(browser)
        pids = server.pids()
        assert len(pids) == 2 and all(map(running, pids))
        assert server.started()[0][2] == pids[0]  # a group of its own
        browser._response.connection.transport.abort()  # as if its machine were switched off
        assert await asyncio.to_thread(wait_for_end, pids) == []
        assert server.left() == (manner != "stubborn")

    story(tmp_path, told, manner)


@pytest.mark.parametrize("manner", ["", "stubborn", "floods"])
def test_nothing_runs_after_the_server_ended(
    tmp_path: Path, manner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_module, "TERMINATE_GRACE_S", 0.5)
    pids: list[int] = []
    browsers: list[aiohttp.ClientWebSocketResponse] = []  # kept, so that they stay connected

    async def told(server: Served) -> None:
        for _ in range(2):
            browsers.append(await server.connect())
            await received(browsers[-1])
        pids.extend(server.pids())

    story(tmp_path, told, manner)
    assert len(pids) == 4 and wait_for_end(pids) == []


def test_a_session_that_begins_while_the_server_ends_ends_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = session_module.BrowserSession.start

    async def slow(self: session_module.BrowserSession, width: int, height: int) -> None:
        await asyncio.sleep(0.5)  # as on a busy machine
        await start(self, width, height)
        started.append(self)

    monkeypatch.setattr(session_module.BrowserSession, "start", slow)
    started: list[session_module.BrowserSession] = []
    browsers: list[aiohttp.ClientWebSocketResponse] = []

    async def told(server: Served) -> None:
        browsers.append(await server.connect())

    story(tmp_path, told)
    (session,) = started
    assert session._process is not None and wait_for_end([session._process.pid]) == []


def test_a_request_that_the_server_gave_up_leaves_no_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_module, "TERMINATE_GRACE_S", 0.5)
    monkeypatch.setattr(server_module, "SHUTDOWN_S", 0.1)
    monkeypatch.setattr(server_module.ViewerServer, "on_shutdown", lambda *_: asyncio.sleep(0))
    pids: list[int] = []
    browsers: list[aiohttp.ClientWebSocketResponse] = []

    async def told(server: Served) -> None:
        browsers.append(await server.connect())
        await received(browsers[-1])
        pids.extend(server.pids())

    story(tmp_path, told, "stubborn")
    assert len(pids) == 2 and wait_for_end(pids) == []
