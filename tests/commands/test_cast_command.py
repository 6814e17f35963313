"""Films and stills of recordings: what a player shows is the run, without a terminal or Textual."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pyte
import pytest
from terminal_replay import for_pyte, wrong_cells

from automaton.commands import Parser
from automaton.commands import cast_command as command
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.history.playback import Playback
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.recording.recorder import Recorder
from automaton.runs.simulation import Simulation
from automaton.units import unit
from automaton.world.resolve import Resolved, resolve
from tui.playback.film import Status, schedule
from tui.playback.playback_state import Overlays
from tui.render.camera import Camera
from tui.render.compose import compose
from tui.render.encode import as_svg, as_text
from tui.render.scene import Scene, floor_of
from tui.render.styles import ASCII, DEPTHS, SHADED, UNICODE, Codes, GlyphSet, Look

LAST = 205  # tick of the scenario crossing


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run of four robots."""
    path = tmp_path_factory.mktemp("recorded") / "crossing.rec"
    resolved = resolve("crossing")
    with Recorder(path, resolved, 1) as recorder:
        Simulation(resolved, 1, on_record=recorder).run()
        recorder.end()
    return path


def cast(*arguments: object) -> int:
    """The command line without its name."""
    parser = Parser(prog="automaton cast", allow_abbrev=False)
    command.add_arguments(parser)
    return command.run(parser.parse_args([str(argument) for argument in arguments]))


def film_of(path: Path) -> tuple[dict[str, Any], list[tuple[float, str]]]:
    """The header and the events (time, data) of an asciicast."""
    header, *events = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
    assert all(kind == "o" for _, kind, _ in events)
    return header, [(time, data) for time, _, data in events]


def snapshots_at(*ticks: int, robot: int = NIL, layer: str = "") -> list[Snapshot]:
    """States of the run computed again by its strategies, without the recording."""
    found = []
    simulation = Simulation(resolve("crossing"), 1, on_observe=Simulation.empty_observation)
    for tick in ticks:
        simulation.run(until=tick)
        bare = take_snapshot(simulation, robot, layer)
        found.append(Overlays().laid_over(bare, simulation, layer, playing=False))
    return found


def intended(
    resolved: Resolved,
    snapshot: Snapshot,
    columns: int,
    rows: int,
    glyphs: GlyphSet,
    layer: str = "",
) -> Codes:
    """The screen of a film of everything, put together from its parts."""
    orders = len(snapshot.orders.state)
    tick = unit(resolved.scenario.units.tick)
    below = Status(LAST, len(snapshot.robots), orders, tick, layer).codes(snapshot, columns)
    camera = Camera(resolved.floor_plan, rows - len(below), columns, len(snapshot.robots))
    above = compose(Scene(floor_of(resolved), snapshot, layer=layer), camera, glyphs)
    return np.vstack((above, below))


@pytest.mark.parametrize(
    ("color", "theme", "more", "size"),
    [
        ("true", "dark", [], "80x24"),
        ("256", "light", [], "60x9"),
        ("16", "dark", ["--ascii"], "44x10"),
        ("none", "light", [], "40x12"),
    ],
)
def test_a_player_shows_the_run(
    crossing: Path, tmp_path: Path, color: str, theme: str, more: list[str], size: str
) -> None:
    out = tmp_path / "film.cast"
    look = ("--color", color, "--theme", theme, *more)
    assert cast(crossing, "--out", out, "--speed", 2, "--size", size, *look) == 0
    header, events = film_of(out)
    columns, rows = header["width"], header["height"]
    assert f"{columns}x{rows}" == size
    screen = pyte.Screen(columns, rows)
    stream = pyte.Stream(screen)
    resolved, plain = resolve("crossing"), SHADED if color == "none" else UNICODE
    glyphs = ASCII if more else plain
    looked_at = {0.0: 0, 2.0: 40, 4.5: 90, 7.0: 140, 10.3: LAST}  # seconds: tick, at 20 a second
    states = dict(zip(looked_at, snapshots_at(*looked_at.values()), strict=True))
    seen = 0
    for time, data in events:
        stream.feed(for_pyte(data))
        if time in states:
            codes = intended(resolved, states[time], columns, rows, glyphs)
            assert wrong_cells(screen, codes, Look(DEPTHS[color], theme), glyphs) == []
            seen += 1
    assert seen == len(states)
    assert wrong_cells(screen, codes, Look(DEPTHS[color], theme), glyphs) == []  # when it is over
    assert not screen.cursor.hidden


def test_the_status_tells_of_the_tick(crossing: Path, tmp_path: Path) -> None:
    at = tmp_path / "picture.txt"
    cast(crossing, "--picture", at, "--at", 90, "--size", "80x12")
    (snapshot,) = snapshots_at(90)
    assert int(np.count_nonzero(snapshot.orders.state == 2)) == 7
    assert at.read_text().splitlines()[-1] == (
        " tick  90 of 205     45 s  4 work  0 wait   7/16 delivered"
    )


def test_the_header_says_what_players_ask_for(crossing: Path, tmp_path: Path) -> None:
    out = tmp_path / "film.cast"
    cast(crossing, "--out", out, "--to", 3)
    header, _ = film_of(out)
    assert header == {
        "version": 2,
        "width": 112,
        "height": 33,
        "title": "automaton: crossing, 4 robots, seed 1",
        "env": {"TERM": "xterm-256color"},
    }


def test_an_event_comes_when_its_tick_does(crossing: Path, tmp_path: Path) -> None:
    """Half speed at 30 pictures a second: five of six pictures are like the one before."""
    out = tmp_path / "film.cast"
    cast(crossing, "--out", out, "--from", 20, "--to", 60, "--speed", "0.5", "--fps", 30)
    _, events = film_of(out)
    times = [time for time, _ in events]
    assert times == [round(tick * 0.2, 6) for tick in range(41)] + [10.0]
    screen = pyte.Screen(112, 33)
    stream = pyte.Stream(screen)
    shown = []
    for _, data in events[:-1]:
        stream.feed(for_pyte(data))
        shown.append(int(screen.display[32].split()[1]))
    assert shown == list(range(20, 61))


def test_fast_films_leave_ticks_out_but_not_the_last() -> None:
    frames = schedule(0, 100, Fraction(8), 10)
    assert [frame.tick for frame in frames] == [*range(0, 100, 8), 100]
    assert [float(frame.time) for frame in frames] == [n / 10 for n in range(14)]
    assert [frame.tick for frame in schedule(7, 7, Fraction(1), 10)] == [7]
    odd = schedule(3, 50, Fraction("0.7"), 24)
    assert [frame.tick for frame in odd] == list(range(3, 51))
    assert all(frame.tick == 3 + frame.time * 7 // 1 for frame in odd)


def test_the_same_bytes_everywhere_and_no_textual(crossing: Path, tmp_path: Path) -> None:
    """In a fresh interpreter, another folder and a poor environment, to standard output."""
    out = tmp_path / "film.cast"
    arguments = ("--speed", "4", "--follow", "1", "--layer", "waiting", "--zoom", "3x1")
    cast(crossing, "--out", out, *arguments)
    elsewhere = tmp_path / "other: name.rec"
    elsewhere.write_bytes(crossing.read_bytes())
    program = (
        "import sys; from automaton.commands import Parser, cast_command as c; p = Parser();"
        "c.add_arguments(p); c.run(p.parse_args(sys.argv[1:]));"
        "assert 'tui.render.compose' in sys.modules;"
        "sys.exit(any(name.partition('.')[0] == 'textual' for name in sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(elsewhere), "--out", "-", *arguments],
        env={**os.environ, "TERM": "dumb", "NO_COLOR": "1", "LC_ALL": "C", "PYTHONHASHSEED": "7"},
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == out.read_bytes()
    assert done.stderr.decode().startswith("automaton: 5")  # events


def test_a_followed_robot_stays_on_the_screen(crossing: Path, tmp_path: Path) -> None:
    """Only a part of the floor fits; the cell of the selected robot is white in every picture."""
    tall = tmp_path / "tall.rec"
    resolved = resolve("tabletop-1", ["layout.positions=30"])
    with Recorder(tall, resolved, 1) as recorder:
        Simulation(resolved, 1, on_record=recorder).run(until=300)
    out = tmp_path / "film.cast"
    cast(tall, "--out", out, "--zoom", "3x1", "--size", "40x12", "--follow", 2)
    _, events = film_of(out)
    screen = pyte.Screen(40, 12)
    stream = pyte.Stream(screen)
    corners = set()
    for time, data in events[:-1]:
        stream.feed(for_pyte(data))
        backgrounds = [screen.buffer[row][column].bg for row in range(10) for column in range(40)]
        assert "ffffff" in backgrounds, (time, screen.display)
        corners.add("\n".join(row[:4] for row in screen.display[:10]))
    assert "robot 2" in screen.display[10]
    assert len(corners) > 5  # the camera moved


BROAD = (
    "name: broad\nlayout: {generator: tabletop, tables: 60, positions: 30}\nfleet: {robots: 1}\n"
)


@pytest.mark.parametrize(
    ("scenario", "zoom", "size"),
    [
        ("tabletop-2", "fit", (119, 24)),  # 23 x 7 cells of 5 x 3 characters, and a margin
        ("tabletop-mini", "1x1", (52, 11)),  # the status is broader
        (BROAD, "fit", (66, 15)),  # 123 x 32 cells, 2 x 3 in a character
        (BROAD, "3x1", (120, 35)),  # as many columns as there may be, and a single line below
    ],
)
def test_a_size_that_is_not_asked_for_holds_the_floor(
    tmp_path: Path, scenario: str, zoom: str, size: tuple[int, int]
) -> None:
    if scenario == BROAD:
        (tmp_path / "broad.yaml").write_text(BROAD)
        scenario = str(tmp_path / "broad.yaml")
    path, out = tmp_path / "some.rec", tmp_path / "film.cast"
    with Recorder(path, resolve(scenario), 1) as recorder:
        Simulation(resolve(scenario), 1, on_record=recorder).run(until=5)
    cast(path, "--out", out, "--zoom", zoom)
    header, _ = film_of(out)
    assert (header["width"], header["height"]) == size


def test_a_still_is_a_drawing_or_text(crossing: Path, tmp_path: Path) -> None:
    for name in ("still.svg", "still.txt"):
        assert cast(crossing, "--picture", tmp_path / name, "--at", 90, "--layer", "visits") == 0
    (snapshot,) = snapshots_at(90, layer="visits")
    codes = intended(resolve("crossing"), snapshot, 112, 33, UNICODE, "visits")
    text, drawing = ((tmp_path / f"still.{suffix}").read_text() for suffix in ("txt", "svg"))
    assert text == as_text(codes, UNICODE) and text.count("visits") == 1
    title = "crossing, 4 robots, seed 1"
    assert drawing == as_svg(codes, Look(DEPTHS["true"]), UNICODE, title) and title in drawing


def test_the_film_has_its_name_and_says_how_large_it_is(
    crossing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    here = tmp_path / "my.run.rec"
    here.write_bytes(crossing.read_bytes())
    cast(here, "--to", 10)
    out = tmp_path / "my.run.cast"
    size = out.stat().st_size
    assert capsys.readouterr().out == f"{out}: 12 events, {size:,} bytes, 3.0 s of 112x33\n"
    cast(here, "--to", 0)
    assert out.stat().st_size < size  # replaced


MADE = ("--out", "film.cast")
STILL = ("--picture", "still.svg")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("nowhere.rec", *MADE), "nowhere.rec: cannot read the recording: No such file"),
        (("notes.txt", *MADE), "notes.txt: this is not a recording of automaton"),
        (("run.rec", *MADE, "--to", "206"), "no tick 206: the recording ends at tick 205"),
        (("run.rec", *MADE, "--from", "2000"), "no tick 2,000: the recording ends at tick 205"),
        (("run.rec", *STILL, "--at", "206"), "no tick 206: the recording ends at tick 205"),
        (("run.rec", *MADE, "--from", "9", "--to", "8"), "nothing from tick 9 to tick 8"),
        (("run.rec", *MADE, "--to", "-1"), "'-1' is not a tick"),
        (("run.rec", *MADE, "--size", "39x8"), "39x8 is not a size: allowed are 40x8 to 500x200"),
        (("run.rec", *MADE, "--size", "80x7"), "80x7 is not a size"),
        (("run.rec", *MADE, "--size", "9999x24"), "9999x24 is not a size"),
        (("run.rec", *MADE, "--size", "large"), "'large' is not a size such as 80x24"),
        (("run.rec", *MADE, "--layer", "heat"), "unknown layer 'heat': allowed are visits, "),
        (
            ("run.rec", *MADE, "--layer", "explored"),
            "explored shows the search for one robot: choose",
        ),
        (
            ("run.rec", *MADE, "--zoom", "4x1"),
            "unknown zoom '4x1': allowed are fit, 9x5, 8x4, 6x3, ",
        ),
        (("run.rec", *MADE, "--follow", "4"), "there is no robot 4: the last one is robot 3"),
        (("run.rec", *MADE, "--speed", "0"), "'0' is not a speed: allowed are 0.01 to 10000"),
        (("run.rec", *MADE, "--speed", "1/0"), "'1/0' is not a speed"),
        (("run.rec", *MADE, "--speed", "nan"), "'nan' is not a speed"),
        (("run.rec", *MADE, "--fps", "0"), "'0' is not a frame rate"),
        (("run.rec", "--out", "run.rec"), "this is a recording; choose another file with --out"),
        (("film.cast",), "film.cast: cannot write it: this is a recording"),
        (("run.rec", "--out", "."), "cannot write it: this is a folder"),
        (("run.rec", "--out", "no/film.cast"), "no: cannot write it: there is no such folder"),
        (("run.rec", "--out", "/dev/null"), "not a regular file; '-' is standard output"),
        (("run.rec", "--picture", "still.bmp"), "'still.bmp' is not a picture file: allowed are"),
        (("run.rec", "--out", "film.avi"), "'film.avi' is not a film file: allowed are FILE.gif, "),
        (
            ("run.rec", "--out", "f.gif", "--layer", "visits"),
            "--layer cannot be combined with FILE.gif; use FILE.cast, or a picture FILE.svg",
        ),
        (("run.rec", "--out", "f.gif", "--fps", "60"), "more than .gif plays: allowed are 1 to 50"),
        (("run.rec", "--out", "f.png", "--size", "80x24"), "80x24 is not a size in pixels"),
        (("run.rec", "--out", "f.gif", "--speed", "0.01"), "41,001 frames are more than a film"),
        (("run.rec", *STILL, *MADE), "--out is for films: it cannot be combined with --picture"),
        (("run.rec", *STILL, "--to", "0"), "--to is for films"),
        (("run.rec", *MADE, "--at", "3"), "--at needs --picture"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(
    crossing: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    sentence: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run.rec").write_bytes(crossing.read_bytes())
    Path("notes.txt").write_text("no recording\n")
    if arguments == ("film.cast",):  # a recording of that name is not overwritten
        Path("film.cast").write_bytes(crossing.read_bytes())
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InputError) as caught:
        cast(*arguments)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_film_that_fails_leaves_the_older_one(
    crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "film.cast"
    out.write_text("older")
    go_to = Playback.go_to

    def until_fifty(self: Playback, tick: int) -> None:
        if tick > 50:
            raise InputError("the recording was altered")
        go_to(self, tick)

    monkeypatch.setattr(Playback, "go_to", until_fifty)
    with pytest.raises(InputError, match="altered"):
        cast(crossing, "--out", out)
    assert [path.name for path in tmp_path.iterdir()] == ["film.cast"]
    assert out.read_text() == "older"
