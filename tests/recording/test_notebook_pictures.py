"""What notebooks show of a simulation, of its outcome and of a recording."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from html import unescape
from pathlib import Path

import pytest

from automaton import read, simulate
from automaton.commands import main
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.runs.headless import BusyPicture, Outcome
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """A run of four robots that was recorded."""
    return simulate("crossing", record=tmp_path_factory.mktemp("run") / "crossing.rec")


def drawing(page: str) -> ET.Element:
    found = re.search(r"<svg.*</svg>", page, re.DOTALL)
    assert found is not None
    return ET.fromstring(found[0])


def robots(page: str) -> int:
    return sum(one.tag.endswith("title") for one in drawing(page).iter())


def test_a_simulation_shows_its_floor_and_robots() -> None:
    simulation = Simulation(resolve("crossing"))
    simulation.run(until=90)
    page = simulation._repr_html_()
    assert robots(page) == 4
    assert "<p>crossing, 4 robots: tick 90, 7 of 16 orders done</p>" in page


def test_an_outcome_shows_robots_at_work_and_how_the_run_ended(recorded: Outcome) -> None:
    page = recorded._repr_html_()
    assert robots(page) == 4 and "<p>finished in tick 205</p>" in page
    shown = re.search(r"tick (\d+), \d+ of 16 orders done", page)
    assert shown is not None
    simulation = Simulation(resolve("crossing"))
    simulation.run(until=int(shown[1]))
    assert (simulation.world.robots.order != NIL).sum() >= 2  # of 4
    simulation.run(until=int(shown[1]) + max(1, int(shown[1]) // BusyPicture.LOOKS))
    assert (simulation.world.robots.order != NIL).sum() < 2


def test_the_picture_of_a_run_that_ends_at_work_is_its_end() -> None:
    outcome = simulate("goods-mini", stop__max_duration=100)
    assert "tick 100," in outcome._repr_html_()


def test_an_outcome_shows_the_metrics_that_a_run_prints_first(
    recorded: Outcome, capsys: pytest.CaptureFixture[str]
) -> None:
    page = ET.fromstring(re.findall("<table>.*</table>", recorded._repr_html_())[0])
    rows = [["".join(cell.itertext()) for cell in row] for row in page]
    assert main(["run", "crossing"]) == 0
    printed = capsys.readouterr().out.split("-----\n", 1)[1].split("\n\n")[0]
    assert rows == [re.split("  +", line.strip(), maxsplit=1) for line in printed.splitlines()]
    assert rows[0] == ["delivered", "16 of 16 orders"] and 4 <= len(rows) <= 6


def test_what_a_notebook_shows_is_escaped(recorded: Outcome) -> None:
    page = recorded._replace(headline=[["<b>", "a & b"]], finished=False, diagnosis="<i>")
    assert "&lt;b&gt;" in page._repr_html_() and "a &amp; b" in page._repr_html_()
    assert "&lt;i&gt;" in page._repr_html_() and "<i>" not in page._repr_html_()


def test_a_recording_shows_any_tick(recorded: Outcome, tmp_path: Path) -> None:
    run = read(recorded.recording.path)
    assert "tick 205" in run._repr_html_()
    picture = run.picture(at=90, theme="dark", follow=1)
    assert "tick 90" in picture.caption and "#121212" in picture.svg
    picture.save(tmp_path / "still.svg")
    assert (tmp_path / "still.svg").read_text() == picture.svg


def test_a_film_is_a_whole_page_in_a_frame(recorded: Outcome) -> None:
    film = recorded.film(first=50, last=60, follow=2, height=480)
    frame = film._repr_html_()
    attributes = dict(re.findall(r' (\w+)="([^"]*)"', frame))
    assert frame.startswith("<iframe ") and attributes["height"] == "480"
    assert unescape(attributes["srcdoc"]) == film.page and attributes["sandbox"] == "allow-scripts"
    assert film.page.startswith("<!doctype html>") and '"first":50,"last":60' in film.page
    assert attributes["title"] == "crossing, 4 robots, seed 1"


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ("simulate('crossing').film()", 'simulate(..., record="run.rec") records it'),
        ("run.film(last=206)", "there is no tick 206: the recording ends at tick 205"),
        ("run.film(theme='blue')", "unknown theme 'blue': allowed are dark or light"),
        ("run.picture(at=206)", "there is no tick 206: the recording ends at tick 205"),
        ("run.picture(follow=4)", "there is no robot 4: the last one is robot 3"),
        ("run.picture(theme='blue')", "unknown theme 'blue': allowed are dark or light"),
    ],
)
def test_what_cannot_be_shown_is_one_sentence(recorded: Outcome, asked: str, sentence: str) -> None:
    names = {"simulate": simulate, "run": recorded.recording}
    with pytest.raises(InputError, match=re.escape(sentence)):
        eval(asked, names)


def test_pictures_need_no_terminal_program(recorded: Outcome) -> None:
    program = (
        "import sys; from automaton import read; run = read(sys.argv[1]);"
        "run._repr_html_(); run.film()._repr_html_();"
        "sys.exit(any(name.partition('.')[0] in ('tui', 'textual', 'PIL') for name in sys.modules))"
    )
    path = str(recorded.recording.path)
    subprocess.run([sys.executable, "-c", program, path], check=True)
