"""The viewer on a terminal of its own: how it begins and ends, what it sends, what is then to be seen."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from command_in_terminal import KEPT, Session, automaton
from pseudo_terminal import TRUECOLOR, painted, wrong_cells
from viewer_harness import record

from automaton.history.snapshot import take_snapshot
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.frames import encoded
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from tui.render.camera import Camera
from tui.render.compose import compose
from tui.render.encode import encode
from tui.render.scene import Scene, floor_of
from tui.render.styles import ASCII, SHADED, UNICODE, Codes, Depth, GlyphSet, Look
from tui.terminal.options import depth_of
from tui.terminal.terminal_host import TerminalHost

RESTORED = {
    "the alternate screen is left": b"\x1b[?1049l",
    "the cursor is shown": b"\x1b[?25h",
    "the mouse is released": b"\x1b[?1003l",
    "pasting is as before": b"\x1b[?2004l",
}
LOOKS = 20  # at the screen, each when it has been quiet for a while


@contextmanager
def watching(
    folder: Path, *arguments: str, ready: str = "tick", **more: str | int
) -> Iterator[Session]:
    """A session in which the world is there."""
    with automaton(folder, "watch", "tabletop-mini", *arguments, **more) as session:  # type: ignore[arg-type]
        session.wait_for_text(ready)
        yield session


def check_left(session: Session, folder: Path, way: str | signal.Signals, code: int) -> None:
    """While it plays, the viewer is left: the terminal is as before, and what was played is kept."""
    if isinstance(way, signal.Signals):
        session.host.process.send_signal(way)
    else:
        session.press(way)
    assert session.host.wait_for_end() == code
    output = session.host.output()
    after = output[output.rindex(b"\x1b[?1003l") - 200 :]
    for what, sequence in RESTORED.items():
        assert sequence in after, what
    assert b"Traceback" not in output
    (recording,) = (folder / "automaton" / "recordings").iterdir()
    assert recording.suffix == ".rec"
    assert b"recorded in " + bytes(recording) in output.replace(b"\r\n", b"")
    assert read_recording(recording).ticks > 200


def test_paused_it_sends_nothing_and_its_messages_may_go_to_a_file(tmp_path: Path) -> None:
    said = tmp_path / "said.txt"
    program = f"exec {sys.executable} -m automaton watch tabletop-mini --at 120 2> {said}"
    kept = {name: os.environ[name] for name in KEPT if name in os.environ}
    variables = {**kept, **TRUECOLOR, "XDG_STATE_HOME": str(tmp_path)}
    with TerminalHost(["sh", "-c", program], rows=60, columns=200, environ=variables) as host:
        session = Session(host)
        session.wait_for_text("tick 120")
        host.wait_for_quiet(2.0)
        before = len(host.output())
        with pytest.raises(TimeoutError):
            host.wait_for(lambda: False, "nothing", at_most=3.0)
        assert len(host.output()) == before
        session.press("q")
        assert host.wait_for_end() == 0
        assert all(sequence in host.output() for sequence in RESTORED.values())
    assert "recorded in " in said.read_text()


def test_what_a_lost_connection_and_a_killed_viewer_leave_replays(tmp_path: Path) -> None:
    lost, killed = tmp_path / "lost", tmp_path / "killed"
    with watching(lost, "--speed", "64") as session:
        session.wait_for_tick(200)
        session.host.hang_up()
        assert session.host.wait_for_end(10.0) == 129
    with watching(killed, "--speed", "64") as session:
        session.wait_for_tick(1000)
        session.host.process.kill()
        session.host.wait_for_end()
    (whole,) = (lost / "automaton" / "recordings").iterdir()
    (part,) = (killed / "automaton" / "recordings").iterdir()
    assert whole.suffix == ".rec" and part.name.endswith(".rec.part")
    with automaton(tmp_path, "replay", str(whole), str(part), "--at", "200") as session:
        session.wait_for_text("tick 200")
        session.wait_for_text("the runs are equal")
        session.press("q")
        assert session.host.wait_for_end() == 0


def test_an_error_inside_restores_the_terminal(tmp_path: Path) -> None:
    program = tmp_path / "fails.py"
    program.write_text(
        "import sys\n"
        "from tui.viewer.view_actions import LayerActions\n"
        "def fail(self): raise RuntimeError('made to fail')\n"
        "LayerActions._next = fail\n"
        "from automaton.commands import main\n"
        "sys.exit(main(['watch', 'tabletop-mini', '--paused']))\n"
    )
    kept = {name: os.environ[name] for name in KEPT if name in os.environ}
    environ = {**kept, **TRUECOLOR, "XDG_STATE_HOME": str(tmp_path)}
    with TerminalHost([sys.executable, str(program)], rows=24, columns=80, environ=environ) as host:
        session = Session(host)
        session.wait_for_text("tick 0")
        session.press("L")
        assert host.wait_for_end() == 1
        output = host.output()
    assert output.rindex(b"made to fail") > output.rindex(b"\x1b[?1049l")
    assert all(sequence in output for sequence in RESTORED.values())
    assert len(list((tmp_path / "automaton" / "recordings").glob("*.rec"))) == 1


def test_a_broken_strategy_says_so_and_the_viewer_goes_on(tmp_path: Path) -> None:
    (tmp_path / "broken.py").write_text(
        "from automaton.strategy.per_robot import park, per_robot\n"
        "@per_robot('allocation')\n"
        "def late(me, sees):\n"
        "    raise ValueError('nobody home')\n"
    )
    settings = ("--set", "strategy.allocation=broken:late")
    with watching(tmp_path, *settings, ready="nobody home", PYTHONPATH=str(tmp_path)) as session:
        # The status line tells whether the help is open: what is said of the strategy lies over both.
        session.wait_for_text("tick 0")
        session.press("?")
        session.wait_for_text("tick 0", present=False)
        session.press("\x1b")
        session.wait_for_text("tick 0")
        session.press(",")  # the past can still be seen
        session.press(" " * 5)
        session.settle()
        status = next(row for row in session.replay.text().splitlines() if "tick 0" in row)
        assert status.rstrip().endswith("failed")
        session.press("q")
        assert session.host.wait_for_end() == 2
        output = session.host.output()
    assert b"Traceback" not in output
    after = output[output.rindex(b"\x1b[?1049l") :].decode()
    assert "nobody home" in after and "broken.py:4" in after


def test_a_recording_that_was_altered_ends_with_a_sentence(tmp_path: Path) -> None:
    whole, other = record(tmp_path / "a.rec"), tmp_path / "b.rec"
    recording = read_recording(whole)
    frames = list(recording.frames)
    ticks = [frame.content for frame in frames if frame.kind == FRAME_KIND_TICKS]
    ticks[-1]["digests"][ticks[-1]["digests"].any(axis=1)] ^= np.uint64(1)
    other.write_bytes(encoded(recording.header, frames))
    for paths in ((other,), (whole, other)):
        with automaton(
            tmp_path, "replay", *map(str, paths), "--at", str(recording.ticks - 1)
        ) as session:
            session.wait_for_text("differs from the recording")
            session.press("q")
            assert session.host.wait_for_end() == 2
            output = session.host.output()
        after = output[output.rindex(b"\x1b[?1049l") :].decode()
        assert "Traceback" not in output.decode() and after.count("or altered") == 1


def test_bad_input_is_said_before_the_terminal_is_touched(tmp_path: Path) -> None:
    commands = {
        ("watch", "tabletop-9"): "tabletop-9",
        ("watch", "tabletop-1", "--speed", "1000"): "allowed are 0.25 to 64",
        ("watch", "tabletop-1", "--record", str(tmp_path)): "this is a folder",
        ("replay", str(tmp_path / "none.rec")): "cannot read the recording",
    }
    program = tmp_path / "several.py"
    program.write_text(
        "from automaton.commands import main\n"
        f"for arguments in {[*map(list, commands)]}:\n"
        "    print(main(arguments), flush=True)\n"
    )
    kept = {name: os.environ[name] for name in KEPT if name in os.environ}
    environ = {**kept, **TRUECOLOR, "XDG_STATE_HOME": str(tmp_path)}
    with TerminalHost([sys.executable, str(program)], environ=environ) as host:
        assert host.wait_for_end() == 0
        output = host.output().decode()
    assert "\x1b" not in output
    lines = output.splitlines()
    assert lines[1::2] == ["2"] * len(commands) and len(lines) == 2 * len(commands)
    for sentence, line in zip(commands.values(), lines[::2], strict=True):
        assert sentence in line


def intended(rows: int, columns: int, tick: int, glyphs: GlyphSet, steps: str = "") -> Codes:
    """The map as it ought to be, from a simulation of our own; `steps` are keys of the camera."""
    resolved = resolve("tabletop-mini")
    simulation = Simulation(resolved, on_observe=lambda run: None)
    simulation.observation.count[:2] = 0
    simulation.run(until=tick)
    camera = Camera(resolved.floor_plan, rows, columns, resolved.scenario.fleet.robots)
    for step in steps:
        {
            "+": camera.zoom_in,
            "-": camera.zoom_out,
            "l": lambda: camera.pan_characters(max(4, camera.zoom.width), 0),
            "j": lambda: camera.pan_characters(0, max(2, camera.zoom.height)),
            "0": camera.fit,
        }[step]()
    return compose(Scene(floor_of(resolved), take_snapshot(simulation)), camera, glyphs)


def wrong(session: Session, codes: Codes, look: Look, glyphs: GlyphSet) -> int:
    """Cells of the map at the upper left that do not become as intended while anything is painted."""
    picture = painted(encode(codes, None, look, glyphs), *codes.shape)
    left = LOOKS
    while True:
        session.settle()
        found = len(wrong_cells(session.replay.catch_up(), picture))
        left -= 1
        if found == 0 or left == 0:
            return found


@pytest.mark.parametrize(
    ("environ", "options", "glyphs", "way", "code"),
    [
        ({"LINES": "50", "COLUMNS": "100"}, (), UNICODE, "q", 0),
        ({"NO_COLOR": "1"}, (), SHADED, "\x03", 130),
        ({}, ("--ascii", "--color", "16"), ASCII, signal.SIGTERM, 143),
        ({}, ("--theme", "light", "--renderer", "textual"), UNICODE, signal.SIGINT, 130),
    ],
    ids=[
        "true colour, another size exported by a shell, left by q",
        "NO_COLOR, left by ctrl+c",
        "ASCII in 16 colours, terminated",
        "light, by the compositor, interrupted",
    ],
)
def test_the_screen_shows_the_intended_map_whatever_lay_over_it_and_is_given_back(
    tmp_path: Path,
    environ: dict[str, str],
    options: tuple[str, ...],
    glyphs: GlyphSet,
    way: str | signal.Signals,
    code: int,
) -> None:
    depth = Depth.SIXTEEN if "16" in options else depth_of({**TRUECOLOR, **environ})
    look = Look(depth, "light" if "light" in options else "dark")
    at = ("--at", "120", "--speed", "64")
    with watching(tmp_path, *at, *options, **environ) as session:  # type: ignore[arg-type]
        session.wait_for_text("tick 120")

        def check(rows: int, columns: int, steps: str = "", tick: int = 120) -> None:
            codes = intended(rows, columns, tick, glyphs, steps)
            assert not wrong(session, codes, look, glyphs), (rows, columns, steps, tick)

        check(20, 80)
        session.press("\x10")  # the palette
        session.wait_for_text("Search")
        session.press("\x1b")
        session.wait_for_text("Search", present=False)
        check(20, 80)
        session.press("?")
        session.wait_for_text("Looking closer")
        session.press("\x1b")
        session.wait_for_text("Looking closer", present=False)
        check(20, 80)
        session.press("M" + "+++++" + "llj")  # without the minimap
        check(20, 80, "+++++" + "llj")
        session.press("0" + ".....")
        session.wait_for_text("tick 125")
        check(20, 80, tick=125)
        session.host.resize(15, 50)
        session.wait_for_text("needs 60x16, has 50x15")
        session.host.resize(30, 90)
        session.wait_for_text("tick 125")
        check(26, 90, tick=125)
        for text in ("throughput", "nothing is selected"):  # beside the map, then in its place
            session.press("p")
            session.wait_for_text(text)
        session.press("p")
        session.wait_for_text("throughput", present=False)
        check(26, 90, tick=125)
        session.press(" ")
        session.wait_for_tick(250)
        check_left(session, tmp_path, way, code)


def test_after_playing_no_cell_is_wrong_and_colours_asked_for_have_the_last_word(
    tmp_path: Path,
) -> None:
    look = Look(Depth.TRUE, "dark")
    with watching(tmp_path, "--speed", "32", "--color", "true", NO_COLOR="1") as session:
        session.wait_for_tick(300)
        session.press("g")
        session.wait_for_text("Go to")
        session.press("500\r")
        session.wait_for_text("tick 500")
        codes = intended(20, 80, 500, UNICODE)
        assert not wrong(session, codes, look, UNICODE)
        assert np.count_nonzero(codes) > 500
        session.host.resize(40, 120)
        session.wait_for_text("throughput")
        before = len(session.host.output())
        session.press("e")
        session.wait_for_text("filter")
        session.settle()
        sent = re.findall(rb"[34]8;2;(\d+);(\d+);(\d+)", session.host.output()[before:])
        assert any(len(set(colour)) > 1 for colour in sent)
        session.press(" ")
        session.wait_for_tick(550)
        check_left(session, tmp_path, signal.SIGHUP, 129)


@pytest.mark.parametrize("color", ["none", "16", "256"])
def test_nothing_on_the_screen_has_more_colours_than_were_asked_for_in_either_theme(
    tmp_path: Path, color: str
) -> None:
    with watching(tmp_path, "--at", "200", "--color", color, rows=40, columns=120) as session:
        session.wait_for_text("throughput")
        hidden = unreadable(session)
        for _ in range(
            1 if color == "none" else 2
        ):  # light, then dark again; alike without colours
            before = papers(session)
            session.press("T")
            if color != "none":
                session.host.wait_for(lambda old=before: papers(session) != old, "the other theme")
            hidden += unreadable(session)
            for key, text in (("e", "filter"), ("t", "doing"), ("K", "faces"), ("w", "wait")):
                session.press(key)
                session.wait_for_text(text)
                hidden += unreadable(session)
        # In both themes test_panel_contrast measures them.
        dialogs = {"?": "Looking closer", "/": "Go there", "b": "Stops:"}
        for key, text in {**dialogs, "\x10": "Search"}.items():
            session.press(key)
            session.wait_for_text(text)
            hidden += unreadable(session)
            session.press("\x1b")
            session.wait_for_text(text, present=False)
        output = session.host.output()
    sent = set(re.findall(rb"\x1b\[([\d;]*)m", output))
    assert not [sgr for sgr in sent if re.search(rb"[34]8;2;", sgr)]
    if color != "256":
        assert not [sgr for sgr in sent if re.search(rb"[34]8;5;", sgr)]
    if color == "none":
        assert sent <= {b"", *(b";".join(some) for some in weights())}
    assert not hidden


def papers(session: Session) -> set[str]:
    """Colours that are behind anything on the screen."""
    screen = session.replay.catch_up()
    return {cell.bg for y in range(screen.lines) for cell in screen.buffer[y].values()}


def weights() -> Iterator[tuple[bytes, ...]]:
    """Bold, dim, italic, underlined, reversed and what else is not a colour, in any selection."""
    for count in range(1, 5):
        yield from combinations((b"0", b"1", b"2", b"3", b"4", b"7"), count)


def unreadable(session: Session) -> list[str]:
    """Characters in the colour of what is behind them, by line."""
    session.settle()
    screen = session.replay.catch_up()
    return [
        text
        for y in range(screen.lines)
        if (
            text := "".join(
                cell.data
                for cell in screen.buffer[y].values()
                if cell.fg == cell.bg != "default" and cell.data.isalnum()
            )
        )
    ]
