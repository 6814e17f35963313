"""Films and stills of pixels, as Pillow and ffmpeg read them."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from automaton.commands import Parser, cast_command
from automaton.drawings.looks import STATE_COLOURS, rgb
from automaton.errors import InputError
from automaton.films import pixel_film
from automaton.films.painter import MAP_MARGIN, TITLE_HEIGHT, layout_of
from automaton.films.recorded_stretch import play_stretch, story_moments
from automaton.recording.recorder import Recorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from tui.playback.film import Film, FilmsSideBySide, Request

Image = pytest.importorskip("PIL.Image")
CELL = 40  # pixels of a cell of the scenario crossing
LAST = 205  # its last tick


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four robots, recorded."""
    path = tmp_path_factory.mktemp("film") / "crossing.rec"
    resolved = resolve("crossing")
    with Recorder(path, resolved, 1) as recorder:
        Simulation(resolved, 1, on_record=recorder).run()
    return path


def cast(*arguments: object) -> int:
    parser = Parser(prog="automaton cast", allow_abbrev=False)
    cast_command.add_arguments(parser)
    return cast_command.run(parser.parse_args([str(argument) for argument in arguments]))


def colours_of_robots(recording: Path, picture: Any, tick: int) -> None:
    """At the rim of each robot, away from its front, a picture has the colour of its state."""
    stretch = play_stretch(read_recording(recording), tick, tick)
    moment, (left, top, _, _) = stretch.columns.moment_at(tick), stretch.floor.box
    pixels = np.asarray(picture.convert("RGB"))
    for robot in np.flatnonzero(~np.isnan(moment.x)).tolist():
        x = MAP_MARGIN + round((moment.x[robot] - left + 0.5) * CELL)
        y = TITLE_HEIGHT + round((moment.y[robot] - top + 0.5) * CELL)
        rim = round(0.31 * CELL)  # between the load and the edge
        colour = rgb(STATE_COLOURS[moment.looks.state[robot]], "dark")
        around = [pixels[y + dy, x + dx] for dx, dy in ((rim, 0), (0, rim), (-rim, 0), (0, -rim))]
        assert any((one == colour).all() for one in around), robot


def test_a_still_shows_robots_in_their_places(crossing: Path, tmp_path: Path) -> None:
    out = tmp_path / "still.png"
    assert cast(crossing, "--picture", out, "--at", 90) == 0
    picture = Image.open(out)
    assert picture.size == (12 * CELL + 2 * MAP_MARGIN, 306)
    colours_of_robots(crossing, picture, 90)


@pytest.mark.parametrize("suffix", ["gif", "png"])
def test_a_film_has_a_frame_for_each_moment(
    crossing: Path, tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / f"film.{suffix}"
    cast(crossing, "--out", out, "--from", 60, "--to", 90, "--fps", 20)
    size = out.stat().st_size
    said = f"{out}: 61 frames, {size:,} bytes, 5.0 s of 500x306\n"
    assert capsys.readouterr().out == said and size < 200_000
    film = Image.open(out)
    times, at, seen = [], 0, False
    for number in range(film.n_frames):
        film.seek(number)
        if at == 20 * 100:  # 2 s later, 10 ticks a second
            colours_of_robots(crossing, film, 80)
            seen = True
        times.append(film.info["duration"])
        at += int(times[-1])
    assert seen and sum(times) == 5_000 and times[-1] == 2_000
    assert [path.name for path in tmp_path.iterdir()] == [out.name]


def test_both_kinds_of_films_have_the_same_pixels(crossing: Path, tmp_path: Path) -> None:
    films = []
    for suffix in ("gif", "png"):
        out = tmp_path / f"film.{suffix}"
        cast(crossing, "--out", out, "--from", 60, "--to", 64, "--theme", "light")
        films.append(Image.open(out))
    for number in range(films[0].n_frames):
        one, other = (np.asarray((film.seek(number), film.convert("RGB"))[1]) for film in films)
        assert (one == other).all()


def test_the_same_recording_gives_the_same_bytes(crossing: Path, tmp_path: Path) -> None:
    made = []
    for name in ("a.gif", "b.gif"):
        cast(crossing, "--out", tmp_path / name, "--to", 10, "--follow", 1)
        made.append((tmp_path / name).read_bytes())
    assert made[0] == made[1]


def test_a_story_is_slow_at_its_moments_and_says_them(crossing: Path, tmp_path: Path) -> None:
    stretch = play_stretch(read_recording(crossing), None, None)
    film = pixel_film.PixelFilm(stretch, pixel_film.PixelRequest(story=True, fps=5))
    moments = story_moments(stretch)
    assert "the first delivery" in [one.caption for one in moments]
    assert moments[-1] == (205, "the end: 16 of 16 orders done")
    ticks = film._ticks
    assert ticks == sorted(ticks) and ticks[0] == 0 and ticks[-1] == 205
    for moment in moments:
        near = [tick for tick in ticks if abs(tick - moment.tick) <= 2]
        assert len(near) >= 1 + 2 * (moment.tick < 205)  # two ticks a frame
        assert film._caption(moment.tick) in [one.caption for one in moments]
    part = story_moments(play_stretch(read_recording(crossing), 60, 150))
    assert "the first delivery since tick 60" in [one.caption for one in part]
    assert part[-1].caption.startswith("tick 150: ")
    plain = pixel_film.PixelFilm(stretch, pixel_film.PixelRequest(fps=5))
    assert film.frames <= plain.frames and plain._caption(0) == stretch.title
    with pytest.raises(InputError, match=r"--story cannot be combined with a \.cast"):
        cast(crossing, "--out", tmp_path / "a.cast", "--story")


def test_beside_a_longer_recording_the_shorter_one_stays_at_its_end(
    crossing: Path, tmp_path: Path
) -> None:
    short = tmp_path / "short.rec"
    resolved = resolve("crossing")
    with Recorder(short, resolved, 1) as recorder:
        Simulation(resolved, 1, on_record=recorder).run(until=50)
    for pair in ((crossing, short), (short, crossing)):
        assert pixel_film.range_of(pair, None, None) == (0, 205)
        assert FilmsSideBySide(*(Film(path, Request()) for path in pair)).last == 205


def test_between_two_ticks_a_robot_is_between_two_cells(crossing: Path) -> None:
    columns = play_stretch(read_recording(crossing), 60, 61).columns
    before, between, after = (columns.moment_at(tick) for tick in (60, 60.25, 61))
    moved = (before.x != after.x) | (before.y != after.y)
    assert moved.any()
    for name in ("x", "y"):
        a, b, c = (getattr(one, name) for one in (before, between, after))
        assert np.allclose(b, a + (c - a) / 4, equal_nan=True)


def test_a_followed_robot_is_in_the_middle_of_a_large_floor() -> None:
    layout = layout_of((0, 0, 200, 100), None, follows=True)
    assert layout.scale == 24
    left, top = layout.corner((100.5, 50.5))
    width, height = layout.map_size
    assert abs(left + width / 24 / 2 - 100.5) < 0.05 and abs(top + height / 24 / 2 - 50.5) < 0.05
    assert layout.corner((0.5, 0.5)) == (0, 0)
    assert layout_of((0, 0, 200, 100), None, follows=False).scale == 4


def test_a_floor_larger_than_the_picture_is_made_smaller() -> None:
    layout = layout_of((0, 0, 3000, 1500), None, follows=False)
    assert layout.width == 980 and layout.scale == 0.32
    asked = layout_of((0, 0, 10, 10), (641, 481), follows=False)
    assert (asked.width, asked.height, asked.scale) == (642, 482, 41)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg here")
def test_ffmpeg_makes_a_film_of_as_many_frames(
    crossing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "film.mp4"
    cast(crossing, "--out", out, "--to", 10, "--fps", 10)
    assert re.search(
        r"film.mp4: 11 frames, [\d,]+ bytes, 3.0 s of 500x306", capsys.readouterr().out
    )
    assert out.read_bytes()[4:8] == b"ftyp"
    frame = tmp_path / "frame.png"
    read = ["ffmpeg", "-loglevel", "error", "-i", str(out), "-frames:v", "1", str(frame)]
    subprocess.run(read, check=True)
    first = play_stretch(read_recording(crossing), 0, 0)
    intended = pixel_film.PixelFilm(first, pixel_film.PixelRequest()).image(0)
    away = np.asarray(Image.open(frame).convert("RGB"), int) - np.asarray(intended, int)
    assert np.abs(away).mean() < 4  # MP4 keeps the look, not each pixel


def test_without_ffmpeg_or_pillow_a_sentence_says_what_to_install(
    crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(InputError, match=r"install the package ffmpeg, or write FILE\.gif"):
        cast(crossing, "--out", "film.mp4")
    monkeypatch.setitem(sys.modules, "PIL.Image", None)
    with pytest.raises(InputError, match=re.escape("pip install 'fleet-automaton[films]'")):
        cast(crossing, "--picture", "still.png")
    assert list(tmp_path.iterdir()) == []


def test_a_failing_ffmpeg_is_quoted(
    crossing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = tmp_path / "ffmpeg"
    fake.write_text("#!/bin/sh\necho 'Unknown encoder libx264' >&2\nexit 1\n")
    fake.chmod(0o755)
    monkeypatch.setattr(shutil, "which", lambda name: str(fake))
    with pytest.raises(InputError, match="could not make the film: Unknown encoder libx264"):
        cast(crossing, "--out", tmp_path / "film.mp4", "--to", 10)
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]
