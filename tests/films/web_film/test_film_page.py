"""A recording as a page: its columns are the run, it loads nothing, and a browser plays it."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import zlib
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from automaton.commands import Parser, cast_command
from automaton.drawings.looks import Theme, blended, css
from automaton.drawings.shapes import FADED
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.films import recorded_stretch
from automaton.films.film_page import page_of
from automaton.floor.floor_plan import CELL_KINDS, SHELF
from automaton.history.explanation import link_of
from automaton.history.fleet_summary import summarize
from automaton.history.playback import Playback
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.recording.recorder import Recorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
LAST = 205  # tick of the scenario crossing


def recorded(path: Path, name: str, *settings: str, until: int | None = None) -> Path:
    resolved = resolve(name, settings)
    with Recorder(path, resolved, 1) as recorder:
        Simulation(resolved, 1, on_record=recorder).run(until)
        recorder.end()
    return path


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four robots, recorded."""
    return recorded(tmp_path_factory.mktemp("film") / "crossing.rec", "crossing")


def cast(*arguments: object) -> int:
    parser = Parser(prog="automaton cast", allow_abbrev=False)
    cast_command.add_arguments(parser)
    return cast_command.run(parser.parse_args([str(argument) for argument in arguments]))


def page(recording: Path, *arguments: object) -> str:
    out = recording.with_name("film.html")
    assert cast(recording, "--html", out, *arguments) == 0
    return out.read_text(encoding="utf-8")


def film_of(text: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="film">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    film: dict[str, Any] = json.loads(found[1])
    return film


def column(film: dict[str, Any], name: str, rows: int) -> np.ndarray:
    """(rows, ticks) numbers of a column, by what its format says."""
    raw = zlib.decompress(base64.b64decode(film["columns"][name]))
    return np.cumsum(np.frombuffer(raw, "<i4").reshape(rows, -1), axis=1)


def snapshots(recording: Path, ticks: list[int]) -> list[Snapshot]:
    run = read_recording(recording)
    playback = Playback(run.header, run.stored())
    found = []
    for tick in ticks:
        playback.go_to(tick)
        found.append(take_snapshot(playback.simulation))
    return found


def test_its_columns_are_the_run(crossing: Path) -> None:
    film = film_of(page(crossing))
    robots, figures, stride = film["robots"], film["figures"], film["stride"]
    of_robots = {name: column(film, name, robots) for name in ("x", "y", "cause", "blocker")}
    of_fleet = column(film, "figures", len(figures))
    for shown in snapshots(crossing, list(range(LAST + 1))):
        fleet, tick = shown.robots, shown.tick
        for robot in np.flatnonzero(fleet.cell != NIL):
            y, x = divmod(int(fleet.cell[robot]), stride)
            at = (of_robots["x"][robot, tick], of_robots["y"][robot, tick])
            assert at == ((x - 1) * film["parts"], (y - 1) * film["parts"])
        assert of_robots["cause"][:, tick].tolist() == fleet.cause.tolist()
        assert of_robots["blocker"][:, tick].tolist() == fleet.blocker.tolist()
        now = summarize(shown)
        assert of_fleet[:, tick].tolist() == [getattr(now, name) for name in figures]


def test_a_wait_is_as_long_in_the_film_as_in_its_explanation(crossing: Path) -> None:
    film = film_of(page(crossing, "--from", 3))
    waited, cause = (column(film, name, film["robots"]) for name in ("waited", "cause"))
    floor_plan = resolve("crossing").floor_plan
    for shown in snapshots(crossing, list(range(3, LAST + 1))):
        links = [link_of(shown, floor_plan, robot) for robot in range(film["robots"])]
        assert waited[:, shown.tick - 3].tolist() == [link.ticks for link in links]
    goes_on = (cause[:, :-1] != cause[:, 1:]) & (waited[:, :-1] > 0) & (waited[:, 1:] > 1)
    assert waited[cause > 0].min() == 1  # the first tick lost counts
    assert goes_on.any()  # a wait whose cause changes is one wait


def test_loads_are_on_shelves_until_they_are_picked(crossing: Path) -> None:
    film = film_of(page(crossing))
    at_first = set(column(film, "full", 1)[0].tolist())
    changes = column(film, "changes", 2).T.tolist()
    for shown in snapshots(crossing, [0, 17, 60, 140, LAST]):
        slots = shown.slots
        shelves = CELL_KINDS[SHELF].code == crossing_kinds()[slots.cell]
        full = set(slots.cell[(slots.content != NIL) & shelves].tolist())
        toggled = Counter(cell for tick, cell in changes if tick <= shown.tick)
        odd = {cell for cell, times in toggled.items() if times % 2}
        assert at_first ^ odd == full
    assert changes


def crossing_kinds() -> np.ndarray:
    return resolve("crossing").floor_plan.kind.reshape(-1)


def test_a_closed_cell_is_closed_for_its_time(tmp_path: Path) -> None:
    closed = "floor.closed=[{cells: [[4, 0]], from: 10, for: 20}]"
    film = film_of(page(recorded(tmp_path / "closed.rec", "crossing", closed, until=40)))
    cell = 1 * film["stride"] + 4 + 1
    assert column(film, "shut", 1).size == 0
    assert column(film, "gates", 2).T.tolist() == [[10, cell], [30, cell]]


def test_doors_lifts_and_closings_are_places_with_signs(tmp_path: Path) -> None:
    film = film_of(page(recorded(tmp_path / "bad.rec", "bad-day", until=5)))
    names = resolve("bad-day").place_names
    assert [cell for cell, _ in film["places"]] == list(names)
    words = {
        names[cell]: [s[2] for s in shapes if s[0] == "word"] for cell, shapes in film["places"]
    }
    assert words["door 1"] == ["1"] and {word for one in words.values() for word in one} == {"1"}
    lines = {names[cell]: sum(s[0] == "line" for s in shapes) for cell, shapes in film["places"]}
    assert lines["lift 1"] == 4 and lines["door 1"] == 1


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_the_inside_of_blocks_of_walls_is_fainter_as_in_pictures(
    crossing: Path, theme: Theme
) -> None:
    told = film_of(page(crossing))["colours"][theme]
    assert told["inside"] == css(blended("wall", "floor", FADED, theme)) != told["void"]
    assert "colours().inside" in page(crossing)


def test_a_move_of_several_ticks_goes_from_cell_to_cell_in_equal_steps(tmp_path: Path) -> None:
    slow = recorded(tmp_path / "slow.rec", "crossing", "durations.move=4", until=60)
    film = film_of(page(slow))
    x, y = (column(film, name, film["robots"]) for name in ("x", "y"))
    steps = np.abs(np.diff(x, axis=1)) + np.abs(np.diff(y, axis=1))
    on_floor = (x[:, :-1] >= 0) & (x[:, 1:] >= 0) & (y[:, :-1] >= 0) & (y[:, 1:] >= 0)
    assert set(np.unique(steps[on_floor]).tolist()) == {0, film["parts"] // 4}


def test_a_part_of_a_run_begins_at_its_tick(crossing: Path) -> None:
    film = film_of(page(crossing, "--from", 50, "--to", 70, "--speed", 2, "--theme", "light"))
    assert (film["first"], film["last"], film["speed"], film["theme"]) == (50, 70, 2.0, "light")
    (shown,) = snapshots(crossing, [50])
    assert column(film, "cause", 4)[:, 0].tolist() == shown.robots.cause.tolist()
    assert column(film, "cause", 4).shape == (4, 21)


def test_it_loads_nothing_from_elsewhere(crossing: Path) -> None:
    text = page(crossing)
    attributes: list[tuple[str, str | None]] = []

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            attributes.extend(attrs)

    Reader().feed(text)
    assert not [name for name, _ in attributes if name in ("src", "href", "srcset", "action")]
    policy = [value for _, value in attributes if value and value.startswith("default-src")]
    assert policy == ["default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'"]
    assert not re.search(r"https?:|url\(|@import|fetch\(|XMLHttp", text)


def test_the_same_recording_gives_the_same_bytes(crossing: Path) -> None:
    assert page(crossing) == page(crossing)


def test_names_cannot_break_out_of_their_place() -> None:
    text = page_of("</title><script>[[FILM]]", {"title": "</script><b>"})
    assert "</title><script>" not in text and "</script><b>" not in text
    assert text.count("[[FILM]]") == 2  # in the title as it was written, and in its heading
    assert film_of(text) == {"title": "</script><b>"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--html", "film.mp4"), "'film.mp4' is not a page: the name must end in .html"),
        (("--html", "f.html", "--fps", 5), "--fps cannot be combined with --html"),
        (("--html", "f.html", "--zoom", "1x1"), "--zoom cannot be combined with --html"),
        (("--html", "f.html", "--picture", "f.svg"), "--picture cannot be combined with --html"),
        (("--html", "f.html", "--to", 206), "there is no tick 206: the recording ends at tick 205"),
        (("--html", "f.html", "--from", 9, "--to", 8), "there is nothing from tick 9 to tick 8"),
        (("--html", "f.html", "--follow", 4), "there is no robot 4: the last one is robot 3"),
    ],
)
def test_what_does_not_do_is_one_sentence(
    arguments: tuple[object, ...],
    said: str,
    crossing: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=re.escape(said)):
        cast(crossing, *arguments)
    assert list(tmp_path.iterdir()) == []


def test_more_than_a_browser_holds_is_refused(
    crossing: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorded_stretch, "ROBOT_TICKS", 823)
    with pytest.raises(
        InputError, match="4 robots in 206 ticks are more than a film holds, 823 tog"
    ):
        page(crossing)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium here")
def test_a_browser_seeks_follows_and_plays(crossing: Path, tmp_path: Path) -> None:
    page(crossing)
    film = crossing.with_name("film.html")
    moment = seen(film, "tick=60&robot=2", tmp_path)
    (shown,) = snapshots(crossing, [60])
    y, x = divmod(int(shown.robots.cell[2]), shown.stride)
    assert moment["tick"] == "tick 60, 30 s" and f"at ({x - 1}, {y - 1})" in moment["robot"]
    assert f"{summarize(shown).delivered} of 16 orders done" in moment["figures"]
    page(crossing, "--speed", 100)
    played = seen(film, "tick=60&play=1", tmp_path)
    assert int(re.findall(r"tick (\d+)", played["tick"])[0]) > 60


@pytest.mark.skipif(BROWSER is None, reason="no Chromium here")
def test_a_click_in_the_timeline_goes_to_its_tick_and_robot(crossing: Path, tmp_path: Path) -> None:
    text = page(crossing)
    film = film_of(text)
    states = column(film, "mark", 4) & 7
    probe = """<script>
    const click = (tick, robot) => {
      const canvas = $("timeline"), box = canvas.getBoundingClientRect(), row = rowHeight();
      const long = canvas.clientWidth - MARGIN - RIGHT, ctx = canvas.getContext("2d");
      const clientX = box.left + MARGIN + tick / (TICKS - 1) * long;
      const clientY = box.top + (robot + 0.5) * row;
      const colours = [0, 1, 2, 3].map((one) =>
        ctx.getImageData(MARGIN + (150.5 / TICKS) * long, one * row + 2, 1, 1).data.slice(0, 3));
      canvas.dispatchEvent(new MouseEvent("click", { clientX, clientY }));
      document.body.insertAdjacentHTML("beforeend", `<p id="colours">${colours.join(" ")}</p>`);
    };
    const timer = setInterval(() => {
      if (!document.body.dataset.ready) return;
      clearInterval(timer);
      click(60, 2);
    }, 50);
    </script></body>"""
    probed = tmp_path / "probed.html"
    probed.write_text(text.replace("</body>", probe), encoding="utf-8")
    moment = seen(probed, "tick=5", tmp_path)
    assert moment["tick"] == "tick 60, 30 s" and "Robot 2" in moment["robot"]
    expected = [film["colours"]["dark"]["states"][state] for state in states[:, 150]]
    shown = ["#" + bytes(map(int, one.split(","))).hex() for one in moment["colours"].split()]
    assert shown == expected and len(set(expected)) > 1


def seen(film: Path, address: str, home: Path) -> dict[str, str]:
    """What a browser writes into the places of the page."""
    done = subprocess.run(
        [
            *(str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"),
            *(
                "--virtual-time-budget=20000",
                "--run-all-compositor-stages-before-draw",
                f"--user-data-dir={home}",
                f"{film.as_uri()}#{address}",
            ),
        ],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    places = r'<(p|output|section)\b[^>]* ?id="(\w+)"[^>]*>(.*?)</\1>'
    found = re.findall(places, done.stdout, re.DOTALL)
    return {name: re.sub(r"<[^>]+>", " ", inner) for _, name, inner in found}
