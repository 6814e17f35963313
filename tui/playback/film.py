"""Films and pictures of a recording, drawn without a terminal: the map, and a status line below it.

    tick 1,234 of 2,616   617 s   3 work   1 wait   23/50 delivered                robot 2   visits

Every number has a fixed width, so that words do not move and few characters change.

A film is a file in the asciicast v2 format: a header line, then one line per output to the terminal,
with its time.

    {"version": 2, "width": 80, "height": 24, "title": "...", "env": {"TERM": "xterm-256color"}}
    [0.0, "o", "\\u001b[?25l..."]      the whole first picture
    [0.1, "o", "..."]                 the differences of the next one
    [3.7, "o", "\\u001b[24;1H..."]     after a final pause, the cursor again
"""

from __future__ import annotations

import itertools
import json
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final, NamedTuple

import numpy as np

from automaton.atomic_write import atomic_writer
from automaton.engine.state import NIL
from automaton.errors import InputError, alternatives
from automaton.films.recorded_stretch import checked
from automaton.floor.floor_plan import FloorPlan
from automaton.history.fleet_summary import summarize
from automaton.recording.recording_reader import title_of
from automaton.units import Unit, count, number, unit
from tui.playback.frame_cache import Pictures
from tui.playback.run_source import recorded
from tui.registration import failure, layer_named, layers
from tui.render import styles
from tui.render.camera import Camera
from tui.render.compose import compose
from tui.render.encode import as_svg, as_text, encode
from tui.render.scene import Choice, Scene, floor_of
from tui.render.styles import (
    ASCII,
    DEPTHS,
    SHADED,
    UNICODE,
    Codes,
    Depth,
    Look,
    Theme,
    code,
    style,
    text,
)

if TYPE_CHECKING:
    from automaton.history.snapshot import Snapshot
    from automaton.runs.simulation import Simulation
    from tui.playback.playback_state import PlaybackState, TimeComparison


MIN_FILM_SIZE: Final = (40, 8)
MAX_FILM_SIZE: Final = (500, 200)
MAX_DEFAULT_FILM_SIZE: Final = (120, 40)
FILM_MARGIN: Final = (2, 1)  # around a floor that fits

WORD_GAP: Final = 2
PAIR_GAP: Final = 2  # columns between two recordings
TIME_DIGITS: Final = 5  # as in "616.5": the usual width of numbers below 1,000

FILM_TICKS_PER_S: Final = 10  # at speed x1, as in the viewer
LAST_PAUSE: Final = 2  # seconds for which the last picture is shown

HIDE_CURSOR: Final = "\x1b[?25l"
SHOW_CURSOR: Final = "\x1b[?25h"
CLEAR: Final = "\x1b[0m\x1b[2J"  # the terminal may be larger than the film

STANDARD_OUTPUT: Final = Path("-")
SUFFIX: Final = ".cast"

Size = tuple[int, int]  # columns, rows


@dataclass(frozen=True)
class Request:
    """Options of films and pictures; `first` to `fps` apply to films only."""

    size: tuple[int, int] | None = None  # columns, rows; None: as large as the floor
    zoom: str = "fit"  # or a step of the ladder, with "-" for a blank
    follow: int = NIL  # robot
    layer: str = ""
    theme: Theme = "dark"
    color: str = "true"  # a key of tui.render.styles.DEPTHS
    ascii: bool = False
    first: int = 0  # tick
    last: int | None = None  # tick; None: the last one
    speed: Fraction = Fraction(1)  # 1 is ten ticks per second
    fps: int = 10


def make_film(recordings: Sequence[Path], request: Request, out: Path | None) -> None:
    """Write an asciicast of a recording, or of two side by side; print its size. Raises InputError."""
    path = out or recordings[0].with_suffix(SUFFIX)
    target = path if path == STANDARD_OUTPUT else checked(path)
    if target != STANDARD_OUTPUT and path.suffix != SUFFIX:
        raise InputError(
            f"{str(path)!r} is not a film file: allowed are FILE.gif, FILE.mp4, FILE.png, FILE.cast; "
            "--html makes a page"
        )
    film = film_of(recordings, request)
    first = film.checked(request.first)
    last = film.last if request.last is None else film.checked(request.last)
    if first > last:
        raise InputError(f"there is nothing from tick {first:,} to tick {last:,}")
    frames = schedule(first, last, request.speed, request.fps)
    if target == STANDARD_OUTPUT:
        said = _write(film, frames, sys.stdout.buffer)
        sys.stdout.flush()  # what cannot be written is said before what was
        print(f"automaton: {said}", file=sys.stderr)
        return
    with atomic_writer(target) as file:
        said = _write(film, frames, file)
    print(f"{path}: {said}")


def _write(film: Film, frames: list[FilmFrame], file: BinaryIO) -> str:
    """Write the lines; returns their size in words."""
    events, size = -1, 0  # without the header
    for line in asciicast(film, frames):
        size += file.write(line.encode())
        events += 1
    seconds = f"{float(duration(frames)):,.1f} s"
    return f"{count(events, 'event')}, {count(size, 'byte')}, {seconds} of {film.size}"


def make_picture(recordings: Sequence[Path], request: Request, out: Path, tick: int | None) -> str:
    """Write a still as SVG or text, by suffix; returns its size in words. Raises InputError."""
    if out.suffix not in (".svg", ".txt"):
        raise InputError(
            f"{str(out)!r} is not a picture file: allowed are FILE.png, FILE.svg and FILE.txt"
        )
    path = checked(out)
    film = film_of(recordings, request)
    tick = film.checked(film.last if tick is None else tick)
    (codes,) = film.codes_at([tick])
    if out.suffix == ".txt":
        drawn = as_text(codes, film.glyphs).encode()
    else:
        drawn = as_svg(codes, film.look, film.glyphs, film.title).encode()
    with atomic_writer(path) as file:
        file.write(drawn)
    return f"tick {tick:,}, {film.size}, {count(len(drawn), 'byte')}"


def film_of(recordings: Sequence[Path], request: Request) -> Film:
    """The film of a recording, or of two side by side. Raises InputError."""
    if len(recordings) == 1:
        layer = layer_named(request.layer)
        if layer.compares:
            raise InputError(f"{request.layer}: {layer.absent}")
        return Film(recordings[0], request)
    return FilmsSideBySide(*(Film(path, request) for path in recordings))


class Film:
    """A film of one recording. It plays nothing before pictures are requested."""

    def __init__(self, path: Path, request: Request) -> None:
        """Raises InputError if the file is not a recording or does not fit the request."""
        self._opening = recorded(path)
        (self.recording,), (self._resolved,) = self._opening.recordings, self._opening.resolved
        self.last = self.recording.ticks
        self.look = Look(DEPTHS[request.color], request.theme)
        bare = SHADED if self.look.depth == Depth.NONE else UNICODE
        self.glyphs = ASCII if request.ascii else bare
        self._choice = self._chosen(request)
        self._pictures = Pictures(self._opening, self.glyphs)
        self._status = self._said(request)
        floor_plan, robots = self._resolved.floor_plan, self._resolved.scenario.fleet.robots
        self.columns, self.rows = (
            checked_size(*request.size)
            if request.size
            else size_for(floor_plan, robots, request.zoom, self._status)
        )
        map_rows = self.rows - self._status.rows(self.columns)
        self._pictures.resize(map_rows, self.columns)
        aim(self._pictures.camera, request.zoom)

    @property
    def title(self) -> str:
        """The run in a few words, without the path of its file."""
        recording = self.recording
        return title_of(self._resolved, recording.header["seed"], recording.stored())

    @property
    def tick_unit(self) -> float:
        """The size of a tick in its unit."""
        return unit(self._resolved.scenario.units.tick).size

    @property
    def size(self) -> str:
        """COLUMNSxROWS."""
        return f"{self.columns}x{self.rows}"

    def checked(self, tick: int) -> int:
        """`tick`, if recorded. Raises InputError."""
        if tick > self.last:
            raise InputError(f"there is no tick {tick:,}: the recording ends at tick {self.last:,}")
        return tick

    def codes_at(
        self, ticks: Iterable[int], comparison: TimeComparison | None = None
    ) -> Iterator[Codes]:
        """(rows, columns) codes for each of these ascending ticks; `comparison`: with another film.

        Raises InputError if a layer of another distribution raises.
        """
        from automaton.history.playback import Playback
        from automaton.history.snapshot import take_snapshot
        from tui.playback.playback_state import Overlays

        overlays = Overlays()
        playback = Playback(self.recording.header, self.recording.stored())
        robot, layer = self._choice.robot, self._choice.layer
        for tick in ticks:
            playback.go_to(tick)
            bare = take_snapshot(playback.simulation, robot, layer)
            simulation = playback.simulation
            snapshot = overlays.laid_over(bare, simulation, layer, False, comparison)
            codes = self._codes(snapshot)
            if failed := failure():
                raise InputError(failed)
            yield codes

    def _codes(self, snapshot: Snapshot) -> Codes:
        playback, camera = self._playback(snapshot), self._pictures.camera
        self._pictures.follow(playback, self._choice)
        scene = self._pictures.scene(playback, self._choice, 0)
        floor = self._pictures.picture(scene, self._choice, camera.rows, camera.columns)
        return np.vstack((floor, self._status.codes(snapshot, self.columns)))

    def _playback(self, snapshot: Snapshot) -> PlaybackState:
        from tui.playback.playback_state import PlaybackState

        return PlaybackState(
            runs=(),
            stops=0,
            seq=0,
            tick=snapshot.tick,
            snapshots=(snapshot,),
            figures=(),
            playing=1,
            asked=0.0,
            achieved=0.0,
            head=self.last,
            known=self.last,
            ends=(self.last,),
            live=False,
            stopped="",
            breakpoint_robots=(),
            side=0,
            error="",
        )

    def _chosen(self, request: Request) -> Choice:
        robots = self._resolved.scenario.fleet.robots
        if request.follow >= robots:
            raise InputError(
                f"there is no robot {request.follow}: the last one is robot {robots - 1}"
            )
        check_layer(request.layer, request.follow)
        return Choice(request.follow, layer=request.layer, following=request.follow != NIL)

    def _said(self, request: Request) -> Status:
        scenario = self._resolved.scenario
        chosen = [request.layer] if request.layer else []
        chosen += [f"robot {request.follow}"] if request.follow != NIL else []
        lines = self.recording.header.get("lines")
        orders = max(lines["order"], default=-1) + 1 if lines else 0
        orders = orders or len(self.recording.header["orders"]["source"])
        tick = unit(scenario.units.tick)
        scene = self._pictures.scene(None, self._choice, 0)
        key = layer_named(request.layer).key_words(scene, self._resolved, self.glyphs)
        return Status(self.last, scenario.fleet.robots, orders, tick, "  ".join(chosen), key)


class FilmsSideBySide(Film):
    """A film of two recordings side by side; a shorter one stays at its last tick."""

    def __init__(self, one: Film, other: Film) -> None:
        self._films = one, other
        self.recording, self.last, self.look, self.glyphs = (
            one.recording,
            max(one.last, other.last),
            one.look,
            one.glyphs,
        )
        self.columns = one.columns + PAIR_GAP + other.columns
        self.rows = max(one.rows, other.rows)

    @property
    def title(self) -> str:
        return " | ".join(film.title for film in self._films)

    def codes_at(
        self, ticks: Iterable[int], comparison: TimeComparison | None = None
    ) -> Iterator[Codes]:
        from tui.playback.playback_state import RecordedCells, TimeComparison

        both = TimeComparison(
            *(
                RecordedCells(film.recording.header, film.recording.stored(), film.tick_unit)
                for film in self._films
            )
        )
        sides = itertools.tee(ticks)
        shown = (
            film.codes_at((min(tick, film.last) for tick in side), both)
            for film, side in zip(self._films, sides, strict=True)
        )
        for pair in zip(*shown, strict=True):
            one, other = (self._as_high(codes) for codes in pair)
            yield np.hstack((one, self._blank(self.rows, PAIR_GAP), other))

    def _as_high(self, codes: Codes) -> Codes:
        return np.vstack((codes, self._blank(self.rows - len(codes), codes.shape[1])))

    def _blank(self, rows: int, columns: int) -> Codes:
        return np.full((rows, columns), code(style(styles.COLOUR_TEXT, styles.COLOUR_VOID), 0))


def check_layer(layer: str, robot: int = NIL) -> None:
    """Raise InputError for an unknown layer, and for one that needs a robot."""
    known, problems = layers().by_name, layers().problems
    if layer and layer not in known:
        about = [one for one in problems if not known or one.startswith(f"layer {layer!r}")]
        allowed = f"unknown layer '{layer}': allowed are {alternatives(list(known))}"
        raise InputError(about[0] if about else allowed)
    if layer == "explored" and robot == NIL:
        raise InputError(
            "explored shows the search for one robot: choose it with cast RUN.rec --follow ROBOT"
        )


def layer_text(simulation: Simulation, layer: str) -> str:
    """The floor of an observed run with a layer, one character per cell, and the layer's key.

    Raises InputError if a layer of another distribution raises.
    """
    from automaton.history.snapshot import take_snapshot
    from tui.playback.playback_state import Overlays

    resolved = simulation.resolved
    bare = take_snapshot(simulation, NIL, layer)
    snapshot = Overlays().laid_over(bare, simulation, layer, playing=False)
    scene = Scene(floor_of(resolved), snapshot, layer=layer)
    camera = Camera(resolved.floor_plan, 1, 1)
    camera.one_to_one()
    camera.resize(*camera.size())
    codes = compose(scene, camera, SHADED)
    key = layer_named(layer).key_words(scene, resolved, SHADED)
    if failed := failure():
        raise InputError(failed)
    return "\n".join([as_text(codes, SHADED), *key])


# The size of a film, and its step of the zoom ladder.


def checked_size(columns: int, rows: int) -> Size:
    """The size, if allowed. Raises InputError."""
    if not (
        MIN_FILM_SIZE[0] <= columns <= MAX_FILM_SIZE[0]
        and MIN_FILM_SIZE[1] <= rows <= MAX_FILM_SIZE[1]
    ):
        least, most = (f"{size[0]}x{size[1]}" for size in (MIN_FILM_SIZE, MAX_FILM_SIZE))
        raise InputError(f"{columns}x{rows} is not a size: allowed are {least} to {most}")
    return columns, rows


def size_for(floor_plan: FloorPlan, robots: int, zoom: str, status: Status) -> Size:
    """Fit the floor at this zoom, its margin and the status, up to MAX_DEFAULT_FILM_SIZE."""
    margins = 2 * FILM_MARGIN[0], 2 * FILM_MARGIN[1]
    columns, rows = MAX_DEFAULT_FILM_SIZE[0] - margins[0], MAX_DEFAULT_FILM_SIZE[1] - margins[1] - 2
    camera = Camera(floor_plan, rows, columns, robots)
    aim(camera, zoom)
    height, width = camera.size()
    columns = max(min(width, columns) + margins[0], status.least, MIN_FILM_SIZE[0])
    rows = min(height, rows) + margins[1] + status.rows(columns)
    return columns, max(rows, MIN_FILM_SIZE[1])


def aim(camera: Camera, zoom: str) -> None:
    """Set the zoom: "fit", or a step of the ladder by name. Raises InputError."""
    if zoom == "fit":
        camera.fit()
        return
    steps = {step.name.replace(" ", "-"): step for step in camera.ladder}
    if zoom not in steps:
        raise InputError(f"unknown zoom '{zoom}': allowed are {alternatives(['fit', *steps])}")
    camera.zoom = steps[zoom]
    camera.resize(camera.rows, camera.columns)


# The lines under the map.


class FilmWord(NamedTuple):
    """Words in one colour."""

    words: str
    fg: int
    gap: int = WORD_GAP  # columns before it


class Status:
    """The status of each tick, in one row if it fits, else in two; below it the key."""

    def __init__(
        self,
        last: int,
        robots: int,
        orders: int,
        tick: Unit,
        chosen: str,
        key: Sequence[str] = (),  # meanings of a layer's signs, in their own row
    ) -> None:
        self.last, self.unit, self.chosen = last, tick, chosen
        self.key = [FilmWord(words, styles.COLOUR_DIM) for words in key]
        self.robots_width, self.orders_width = len(f"{robots:,}"), len(f"{orders:,}")
        self.orders = orders

    @property
    def widths(self) -> tuple[int, int]:
        """Columns for the words about time and for those about the fleet."""
        return _width(self._time(self.last)), _width(self._fleet(0, 0, 0, 1))

    @property
    def least(self) -> int:
        """Least number of columns that hold everything."""
        return max(*self.widths, _width(self.key))

    def rows(self, columns: int) -> int:
        """Number of rows, including the key."""
        return (1 if sum(self.widths) <= columns else 2) + bool(self.key)

    def codes(self, snapshot: Snapshot, columns: int) -> Codes:
        """(rows, columns) codes."""
        time = self._time(snapshot.tick)
        now = summarize(snapshot)
        fleet = self._fleet(now.working, now.waiting, now.delivered, now.circling)
        lines = [time + fleet] if sum(self.widths) <= columns else [time, fleet]
        lines += [self.key] if self.key else []
        return np.stack([_line(words, columns) for words in lines])

    def _time(self, tick: int) -> list[FilmWord]:
        last = f"{self.last:,}"
        said = [
            FilmWord(f"tick {tick:>{len(last)},}", styles.COLOUR_SELECTED),
            FilmWord(f"of {last}", styles.COLOUR_DIM, 1),
        ]
        if self.unit.size != 1:
            width = max(TIME_DIGITS, len(number(self.unit.of(self.last))))
            said.append(
                FilmWord(
                    f"{number(self.unit.of(tick)):>{width}} {self.unit.plural}", styles.COLOUR_DIM
                )
            )
        return said + ([FilmWord(self.chosen, styles.COLOUR_CURSOR)] if self.chosen else [])

    def _fleet(self, working: int, waiting: int, delivered: int, circling: int) -> list[FilmWord]:
        width = self.robots_width
        done = f"{delivered:>{self.orders_width},}/{self.orders:,} delivered"
        said = [
            FilmWord(f"{working:>{width},} work", styles.COLOUR_ROBOT),
            FilmWord(
                f"{waiting:>{width},} wait", styles.COLOUR_WAITING if waiting else styles.COLOUR_DIM
            ),
            FilmWord(done, styles.COLOUR_DONE),
        ]
        if circling:
            said.append(FilmWord(f"{circling:>{width},} in a wait cycle", styles.COLOUR_FAULT))
        return said


def _width(words: list[FilmWord]) -> int:
    return sum(len(word.words) + word.gap for word in words)


def _line(words: list[FilmWord], columns: int) -> Codes:
    """(columns,) codes; words that do not fit are omitted."""
    line = np.full(columns, code(style(styles.COLOUR_TEXT, styles.COLOUR_VOID), 0))
    end = -1  # the first word begins in column 1
    for word in words:
        begin = end + word.gap
        end = begin + len(word.words)
        if end > columns:
            break
        line[begin:end] = code(
            style(word.fg, styles.COLOUR_VOID), np.array(text(word.words), np.uint32)
        )
    return line


# The asciicast.


class FilmFrame(NamedTuple):
    """A tick and the time at which it is shown."""

    time: Fraction  # seconds
    tick: int


def schedule(first: int, last: int, speed: Fraction, fps: int) -> list[FilmFrame]:
    """The frames that show a new tick, including the last tick."""
    frames = [FilmFrame(Fraction(0), first)]
    rate = FILM_TICKS_PER_S * speed / fps  # ticks per frame
    while (shown := frames[-1].tick) < last:
        number = math.ceil((shown + 1 - first) / rate)
        tick = min(first + math.floor(number * rate), last)
        frames.append(FilmFrame(Fraction(number, fps), tick))
    return frames


def asciicast(film: Film, frames: list[FilmFrame]) -> Iterator[str]:
    """The lines of the file, the same for the same recording and request."""
    yield _json_line(_header(film))
    shown = None
    pictures = film.codes_at(frame.tick for frame in frames)
    for (time, _), codes in zip(frames, pictures, strict=True):
        sent = encode(codes, shown, film.look, film.glyphs)
        if shown is None:
            sent = HIDE_CURSOR + CLEAR + sent
        yield _event(time, sent)
        shown = codes
    yield _event(duration(frames), f"\x1b[{film.rows};1H{SHOW_CURSOR}")


def duration(frames: list[FilmFrame]) -> Fraction:
    """Seconds, including the final pause."""
    return frames[-1].time + LAST_PAUSE


def _header(film: Film) -> dict[str, object]:
    """The header, without a time stamp: equal films are equal files."""
    return {
        "version": 2,
        "width": film.columns,
        "height": film.rows,
        "title": f"automaton: {film.title}",
        "env": {"TERM": "xterm-256color"},
    }


def _event(time: Fraction, sent: str) -> str:
    return _json_line([round(float(time), 6), "o", sent])


def _json_line(content: object) -> str:
    return json.dumps(content, ensure_ascii=False) + "\n"
