"""Maps in pixels: a terminal shows the picture of films, and text wherever that is not possible."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command_in_terminal import Session, automaton
from terminal_images import ImagesOfTerminal
from textual._xterm_parser import XTermParser
from textual.events import Key
from textual.geometry import Region
from textual.message import Message

from automaton.drawings.moment import drawn_floor, moment_of
from automaton.errors import InputError
from automaton.films.painter import Painter
from automaton.history.snapshot import take_snapshot
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from tui.render.camera import Camera
from tui.render.scene import Scene, floor_of
from tui.terminal.frame_pacing import FramePacer
from tui.terminal.options import Options, Pixels
from tui.terminal.pixel_map import (
    NO_SIZE,
    SLOW_PIXELS,
    AnswerParser,
    PixelScreen,
    ShownMap,
    SixelColours,
    TerminalAnswer,
    can_paint,
    layout_seen,
)
from tui.terminal.terminal_host import CHARACTER, TerminalLink

ROWS, COLUMNS = 20, 70
ROUNDING = 2  # of a channel: sixel colours are percentages,
EDGES = 9  # and the smooth edges of signs have similar colours
KINDS = ("kitty", "sixel")


def observed(until: int, name: str = "tabletop-mini") -> Simulation:
    simulation = Simulation(resolve(name, []), on_observe=lambda _: None)
    simulation.run(until=until)
    return simulation


def film_picture(simulation: Simulation, camera: Camera, rows: int, columns: int) -> np.ndarray:
    """The same moment as films paint it, all at once."""
    floor = drawn_floor(simulation.resolved)
    layout = layout_seen(camera, rows, columns, CHARACTER)
    moment = moment_of(floor, simulation.world, simulation.observation)
    return np.asarray(Painter(floor, layout, "dark", -1)._map(moment))


def is_equal(picture: np.ndarray, expected: np.ndarray, kind: str) -> bool:
    """Whether a picture arrived: exactly, or as well as 256 colours in percentages allow."""
    away = np.abs(picture.astype(int) - expected.astype(int)).max(axis=2)
    if kind == "kitty":
        return not away.any()
    return bool((away > ROUNDING).mean() < 0.05 and (away > EDGES).mean() < 0.01)


def sent(
    shown: ShownMap, blocks: set[tuple[int, int]] | None, kind: str, colours: SixelColours
) -> str:
    """The sequences of blocks."""
    return "".join(shown.kitty(blocks) if kind == "kitty" else shown.sixel(blocks, colours))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("steps", [0, 3])  # of zooming out, to one colour a cell
def test_what_arrives_is_the_picture_of_films_at_every_tick(kind: str, steps: int) -> None:
    simulation = observed(0)
    resolved, region = simulation.resolved, Region(3, 2, COLUMNS, ROWS)
    camera = Camera(resolved.floor_plan, ROWS, COLUMNS, 3)
    for _ in range(steps * 2):
        camera.zoom_out()
    floor, shown, colours = floor_of(resolved), ShownMap(0), SixelColours()
    images = ImagesOfTerminal(ROWS + 4, COLUMNS + 6, CHARACTER)
    layout = layout_seen(camera, ROWS, COLUMNS, CHARACTER)
    sizes = []
    for tick in range(60, 90):
        simulation.run(until=tick)
        scene = Scene(floor, take_snapshot(simulation))
        blocks = shown.update(scene, layout, region, "dark")
        text = sent(shown, blocks, kind, colours)
        sizes.append(len(text))
        images.feed(text.encode())
        wide, high = CHARACTER
        picture = images.picture()[2 * high :, 3 * wide :][: ROWS * high, : COLUMNS * wide]
        expected = film_picture(simulation, camera, ROWS, COLUMNS)
        assert is_equal(picture, expected, kind)
    assert len(images.placed) == (kind == "kitty") * 180  # an image of a block replaces the former
    assert max(sizes[1:]) < sizes[0] / 2  # only what changed


@pytest.mark.parametrize("kind", KINDS)
def test_a_frame_of_thirty_robots_and_their_pods_is_at_most_60_kilobytes(kind: str) -> None:
    simulation = observed(100, "goods-60x40")
    resolved, region, character = simulation.resolved, Region(0, 0, 144, 53), (10, 20)
    camera = Camera(resolved.floor_plan, region.height, region.width, 30)
    floor, shown, colours = floor_of(resolved), ShownMap(0), SixelColours()
    layout = layout_seen(camera, region.height, region.width, character)
    sizes = []
    for tick in range(100, 108):
        simulation.run(until=tick)
        scene = Scene(floor, take_snapshot(simulation))
        blocks = shown.update(scene, layout, region, "dark")
        sizes.append(len(sent(shown, blocks, kind, colours)))
    assert 1000 < max(sizes[1:]) < 60_000 < sizes[0]


def test_selection_and_route_are_painted_and_vanish_again() -> None:
    simulation = observed(100)
    region, shown = Region(0, 0, COLUMNS, ROWS), ShownMap(0)
    camera = Camera(simulation.resolved.floor_plan, ROWS, COLUMNS, 3)
    layout = layout_seen(camera, ROWS, COLUMNS, CHARACTER)
    plain = Scene(floor_of(simulation.resolved), take_snapshot(simulation))
    snapshot = take_snapshot(simulation, 1)
    chosen = plain.with_(snapshot=snapshot, selected=1, route=snapshot.route)
    pictures = []
    for scene in (plain, chosen, plain):
        changed = shown.update(scene, layout, region, "dark")
        assert shown._painted is not None
        pictures.append(np.asarray(shown._painted.image).copy())
    assert changed and len(changed) < 180
    assert (pictures[0] != pictures[1]).any() and (pictures[0] == pictures[2]).all()


def test_what_films_do_not_draw_is_text(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = observed(10)
    scene = Scene(floor_of(simulation.resolved), take_snapshot(simulation))
    assert can_paint(scene)
    cells = np.array([12], np.int32)
    for change in (
        {"layer": "visits"},
        {"lines": "all"},
        {"slow_places": (12,)},
        {"zone": 0},
        {"colouring": "order"},
        {"trails": cells[None]},
        {"marked_cells": cells},
    ):
        assert not can_paint(scene.with_(**change)), change
    monkeypatch.setattr("tui.terminal.pixel_map.MAX_ROBOTS", 2)  # the floor has three robots
    assert not can_paint(scene)


# What the terminal answers.


class NoTerminal:
    """A presenter that keeps what is written."""

    why_not = ""

    def __init__(self) -> None:
        self.written = ""

    def add(self, piece: str) -> None:
        self.written += piece


@pytest.mark.parametrize(
    ("wanted", "answers", "pixels"),
    [
        ("auto", "\x1b_Gi=31;OK\x1b\\\x1b[6;20;10t\x1b[?62;c", "kitty"),
        ("auto", "\x1b_Gi=31;OK\x1b\\\x1b[?62;4c", "kitty"),
        ("auto", "\x1b[?62;4c\x1b_Gi=31;OK\x1b\\\x1b[?62;4c", "kitty"),  # an earlier question
        ("auto", "\x1b[?63;1;2;4;6;9c", "sixel"),
        ("auto", "\x1b[?4;6c", "off"),  # a terminal of this kind
        ("auto", "\x1b[?62;14;44c", "off"),
        ("auto", "\x1b_Gi=31;ENOTSUPPORTED\x1b\\\x1b[?62;22c", "off"),
        ("auto", "", "off"),
        ("off", "\x1b_Gi=31;OK\x1b\\\x1b[?62;4c", "off"),
        ("sixel", "\x1b_Gi=31;OK\x1b\\\x1b[?62c", "sixel"),
    ],
)
def test_a_terminal_shows_what_it_says_or_what_is_asked_for(
    wanted: Pixels, answers: str, pixels: str
) -> None:
    presenter = NoTerminal()
    screen = PixelScreen(presenter, wanted)
    screen.ask()
    assert bool(presenter.written) == (wanted != "off")
    for message in AnswerParser().feed(answers):
        assert isinstance(message, TerminalAnswer)
        screen.answered(message.text)
    assert screen.protocol == pixels


ANSWERS = (
    "\x1b_Gi=31;OK\x1b\\",
    "\x1b_Gi=31;EINVAL:no\x1b\\",
    "\x1b[6;20;10t",
    "\x1b[?62;4c",
    "\x1b]11;rgb:ffff/ffff/ffff\x07",
    "\x1b]11;rgb:0/0/0\x1b\\",
)
KEYS = "a\x1b[A\x1b[6~\x1b[6;20R\x1b[<0;3;4M\x1b[?2026;2$y\x1b[20;2Hq"


@pytest.mark.parametrize("piece", [1, 3, 1000])  # characters that arrive together
def test_answers_never_become_keys_and_keys_never_get_lost(piece: int) -> None:
    def messages(parser: XTermParser, text: str) -> list[Message]:
        pieces = [text[at : at + piece] for at in range(0, len(text), piece)]
        return [message for one in pieces for message in parser.feed(one)]

    plain = list(map(str, messages(XTermParser(), KEYS + KEYS)))
    for answer in ANSWERS:
        mixed = messages(AnswerParser(), KEYS + answer + KEYS)
        answers = [one.text for one in mixed if isinstance(one, TerminalAnswer)]
        others = [str(one) for one in mixed if not isinstance(one, TerminalAnswer)]
        assert answers == [answer] and others == plain


def test_the_escape_key_alone_is_a_key_after_a_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    parser = AnswerParser()
    assert list(parser.feed("\x1b")) == []
    monkeypatch.setattr("textual._parser.get_time", lambda: 1e12)
    (key,) = parser.tick()
    assert isinstance(key, Key) and key.key == "escape"


def test_multiplexers_and_terminals_without_colours_get_text() -> None:
    environ = {"TERM": "xterm-256color", "LANG": "C.UTF-8"}
    auto = Options(pixels="auto")
    assert auto.shown_pixels(environ) == "auto"
    assert Options().shown_pixels(environ) == "auto"
    assert Options(pixels="off").shown_pixels(environ) == "off"
    for name, value in (
        ("TMUX", "/tmp/tmux-0/default,1,0"),
        ("STY", "1.screen"),
        ("TERM", "tmux-256color"),  # over SSH from tmux
        ("TERM", "linux"),
        ("TERM_PROGRAM", "Apple_Terminal"),
        ("NO_COLOR", "1"),
        ("TEXTUAL_DRIVER", "web"),
    ):
        assert auto.shown_pixels(environ | {name: value}) == "off"
    assert Options(pixels="auto", ascii=True).shown_pixels(environ) == "off"


def test_pixels_that_are_asked_for_need_pillow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert Options(pixels="auto").shown_pixels({}) == "off"
    with pytest.raises(InputError, match="--pixels kitty needs Pillow"):
        Options(pixels="kitty").shown_pixels({})


def test_why_maps_are_text_is_said_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tui.terminal.pixel_map.character_size", lambda: (0, 0))
    quick, late = (SimpleNamespace(is_late=late, has_images=False) for late in (False, True))
    screen = PixelScreen(NoTerminal(), "sixel")
    assert screen.leave(quick) == "" and not quick.has_images  # not answered yet
    screen._maps = {0: SimpleNamespace(region=None), 1: SimpleNamespace(region=(0, 0, 9, 9))}
    assert screen.leave(quick) == "" and quick.has_images
    screen._maps = {}
    screen.answered("\x1b[?62;4c")
    assert screen.leave(quick) == NO_SIZE and screen.leave(quick) == "" and not quick.has_images
    screen = PixelScreen(NoTerminal(), "kitty")
    assert screen.leave(late) == SLOW_PIXELS and screen.leave(late) == ""
    assert not screen.answered("\x1b_Gi=31;OK\x1b\\")  # late


@pytest.mark.parametrize(
    ("way", "bytes_per_second", "busy_every", "with_images", "late"),
    [
        (0.05, 125_000, 0, True, True),  # 1 Mbit/s
        (0.05, 125_000, 0, False, False),  # text: nothing is asked, and no frame gives way
        (0.05, 5_000_000, 0, True, False),
        (0.4, 5_000_000, 0, True, False),  # far away
        (0.4, 60_000, 0, True, True),
        (0.001, 50_000_000, 4, True, False),  # a busy machine: 3 answers of 4 take 0.3 s longer
    ],
)
def test_a_connection_is_late_by_the_time_that_it_takes_for_bytes(
    way: float, bytes_per_second: int, busy_every: int, with_images: bool, late: bool
) -> None:
    pace, now, free, sizes = FramePacer(), 0.0, 0.0, 0
    pace.has_images = with_images
    answers: list[float] = []
    was_late = asked = False
    for number in range(6000):
        now = number / 500
        while answers and answers[0] <= now:
            pace.answered(answers.pop(0))
        was_late |= pace.is_late
        asked |= pace.needs_bare_question
        if (pace.ready(now, 0) and number % 50 == 0) or (pace.needs_bare_question and not answers):
            sizes += 1
            size = 10 if pace.needs_bare_question else (14_000, 18_000, 22_000)[sizes % 3]
            pace.sent(now, size)
            free = max(free, now) + size / bytes_per_second
            pause = 0.3 if busy_every and sizes % busy_every else 0.0
            answers.append(max([free + way + pause, *answers]))
    assert was_late == late and (with_images or not asked)


# On a terminal.


def images_of(session: Session) -> ImagesOfTerminal:
    images = ImagesOfTerminal(session.host.rows, session.host.columns, CHARACTER)
    images.feed(session.host.output())
    return images


def quit_cleanly(session: Session) -> None:
    session.press("q")
    assert session.host.wait_for_end() == 0


@pytest.mark.parametrize("kind", KINDS)
def test_the_map_is_an_image_and_a_dialog_hides_it(tmp_path: Path, kind: str) -> None:
    arguments = ("watch", "tabletop-mini", "--at", "120", "--no-record")
    with automaton(tmp_path, *arguments, rows=30, columns=90, graphics=kind) as session:  # type: ignore[arg-type]
        session.wait_for_text("tick 120")
        session.settle()
        images = images_of(session)
        rows, columns = np.nonzero(images.picture().any(axis=2))
        top, left = int(rows.min()) // 16, int(columns.min()) // 8
        high, wide = int(rows.max()) // 16 + 1 - top, int(columns.max()) // 8 + 1 - left
        simulation = observed(120)
        camera = Camera(simulation.resolved.floor_plan, high, wide, 3)
        expected = film_picture(simulation, camera, high, wide)
        picture = images.picture()[16 * top :, 8 * left :][: 16 * high, : 8 * wide]
        assert is_equal(picture, expected, kind)

        session.press("?")
        session.wait_for_text("Play or pause")
        session.settle()
        before = images_of(session)
        assert before.placed == {}  # sixels vanish under text
        session.press("\x1b")
        session.wait_for_text("Play or pause", present=False)
        session.host.wait_for(lambda: images_of(session).count > before.count, "images again")
        session.settle()
        assert (images_of(session).picture() == images.picture()).all()

        session.press("\x1b[14~")  # F4, a layer: text
        session.wait_for_text("ticks lost")
        session.settle()
        assert images_of(session).placed == {}
        quit_cleanly(session)
        assert images_of(session).placed == {}


@pytest.mark.parametrize("kind", KINDS)
def test_what_changed_is_the_same_as_all_painted_again(tmp_path: Path, kind: str) -> None:
    arguments = ("watch", "tabletop-mini", "--at", "120", "--no-record")
    with automaton(tmp_path, *arguments, rows=30, columns=90, graphics=kind) as session:  # type: ignore[arg-type]
        session.wait_for_text("tick 120")
        session.host.wait_for(lambda: images_of(session).count > 0, "images")
        for keys in ("[", "+", "\x1b[C", ")", "-", "]"):  # rewind, zoom, pan, select
            session.settle()
            count = images_of(session).count
            session.press(keys)
            session.host.wait_for(lambda: images_of(session).count > count, f"images after {keys}")  # noqa: B023
            session.settle()
            changed = images_of(session).picture()
            session.press("?")
            session.wait_for_text("Play or pause")
            session.settle()
            session.press("\x1b")
            session.wait_for_text("Play or pause", present=False)
            session.host.wait_for_quiet(0.6)
            assert (images_of(session).picture() == changed).all(), keys
        quit_cleanly(session)
        assert images_of(session).placed == {}


@pytest.mark.parametrize(
    ("arguments", "environ"),
    [(("--pixels", "off"), {}), (("--pixels", "auto"), {"TMUX": "/tmp/tmux-0/default,1,0"})],
)
def test_no_image_is_sent_where_none_is_wanted(
    tmp_path: Path, arguments: tuple[str, ...], environ: dict[str, str]
) -> None:
    command = ("watch", "tabletop-mini", "--at", "20", "--no-record", *arguments)
    with automaton(tmp_path, *command, graphics="kitty", **environ) as session:
        session.wait_for_text("tick 20")
        session.settle()
        assert b"\x1b_G" not in session.host.output()
        quit_cleanly(session)


def test_an_answer_that_arrives_late_is_no_key(tmp_path: Path) -> None:
    link = TerminalLink(round_trip=1.2)
    command = ("watch", "tabletop-mini", "--at", "20", "--no-record", "--pixels", "auto")
    with automaton(tmp_path, *command, graphics="kitty", link=link) as session:
        session.wait_for_text("tick 20")
        session.host.wait_for_quiet(2.0)
        text = session.replay.text()
        assert "tick 20" in text and "Gi=31" not in text and "go to" not in text.lower()
        assert images_of(session).placed  # text at first, then pixels
        quit_cleanly(session)


def test_a_slow_link_gets_text_and_says_so_once(tmp_path: Path) -> None:
    link = TerminalLink(bytes_per_second=10_000, round_trip=0.05)
    command = ("watch", "tabletop-mini", "--no-record", "--speed", "2", "--pixels", "auto")
    with automaton(tmp_path, *command, graphics="kitty", link=link) as session:
        session.wait_for_text("pixels are too slow here")
        images = images_of(session)
        assert images.placed == {}
        session.wait_for_tick(200)
        assert images_of(session).count == images.count
        quit_cleanly(session)
