"""A stretch of a recording, played once and stored as columns: the source of every film."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.atomic_write import cannot_write_error
from automaton.drawings.looks import RobotLooks, cell_of
from automaton.drawings.moment import (
    DrawnFloor,
    Moment,
    drawn_floor,
    fleet_of,
    full_cells,
    looks_of_fleet,
    shut_cells,
)
from automaton.engine.observation import CAUSES, waited_ticks
from automaton.engine.state import BATTERY_PERCENT, NIL
from automaton.errors import InputError
from automaton.history.fleet_summary import summary_of
from automaton.history.playback import Playback
from automaton.recording.frames import Recording, resolved_of
from automaton.recording.recording_reader import title_of
from automaton.runs.metrics import time_shares, uses_of_run
from automaton.runs.simulation import Simulation
from automaton.scenario.text_files import is_recording
from automaton.units import Unit, count, number, unit
from automaton.world.resolved import Resolved


@dataclass(frozen=True)
class RecordedStretch:
    """The ticks `first` to `last` of a recording."""

    resolved: Resolved
    floor: DrawnFloor
    columns: FilmColumns
    title: str
    first: int
    last: int
    recorded: int  # the last tick of the recording
    time_shares: list[tuple[str, float, str]]  # of the robots' time up to the last tick

    @property
    def unit(self) -> Unit:
        """The time unit of a tick."""
        return unit(self.resolved.scenario.units.tick)

    def time_words(self, tick: int) -> str:
        """A tick, and its time in the scenario's unit."""
        words = f"tick {tick:,} of {self.recorded:,}"
        if self.unit.size == 1:
            return words
        return f"{words}, {number(self.unit.of(tick))} {self.unit.plural}"

    def fleet_words(self, tick: int) -> str:
        """Numbers of working and waiting robots and of finished orders."""
        working, waiting, circling, done, orders = (
            self.columns.figure(name, tick)
            for name in ("working", "waiting", "circling", "delivered", "orders")
        )
        words = f"{working:,} working, {waiting:,} waiting, {done:,} of {orders:,} orders done"
        return f"{words}, {circling:,} in a wait cycle" if circling else words


def checked_range(recording: Recording, first: int | None, last: int | None) -> tuple[int, int]:
    """The first and the last tick; by default those of the recording. Raises InputError."""
    begin, end = first or 0, recording.ticks if last is None else last
    if max(begin, end) > recording.ticks:
        raise InputError(
            f"there is no tick {max(begin, end):,}: the recording ends at tick {recording.ticks:,}"
        )
    if begin > end:
        raise InputError(f"there is nothing from tick {begin:,} to tick {end:,}")
    return begin, end


def play_stretch(
    recording: Recording, first: int | None, last: int | None, follow: int = NIL
) -> RecordedStretch:
    """Play ticks `first` (default 0) to `last` (default: the end). Raises InputError."""
    begin, end = checked_range(recording, first, last)
    resolved = resolved_of(recording.header, with_strategies=False)
    robots = resolved.scenario.fleet.robots
    if follow >= robots:
        raise InputError(f"there is no robot {follow}: the last one is robot {robots - 1}")
    floor = drawn_floor(resolved)
    columns = FilmColumns(floor, robots, begin, end)
    frames = recording.stored()
    playback = Playback(recording.header, frames)
    for tick in range(begin, end + 1):
        playback.go_to(tick)
        columns.take(playback.simulation)
    title = title_of(resolved, recording.header["seed"], frames)
    shares = time_shares(uses_of_run(playback.simulation))
    return RecordedStretch(resolved, floor, columns, title, begin, end, recording.ticks, shares)


# The moments of a story.


CAPTIONED_WAIT: Final = 10  # ticks; shorter waits are left out


class StoryMoment(NamedTuple):
    """A moment at which a film slows down."""

    tick: int
    caption: str


def story_moments(stretch: RecordedStretch) -> list[StoryMoment]:
    """The first delivery, the first wait cycle, the longest wait and the end, by tick."""
    columns, first = stretch.columns, stretch.first
    delivered, circling, waited = (
        *map(columns.of_fleet, ("delivered", "circling")),
        columns.of_robots("waited"),
    )
    moments, since = [], f" since tick {first:,}" if first else ""
    if len(later := np.flatnonzero(delivered > delivered[0])):
        moments.append(StoryMoment(first + int(later[0]), f"the first delivery{since}"))
    if len(cycles := np.flatnonzero(circling)):
        text = f"the first wait cycle{since}: {circling[cycles[0]]} robots wait for each other"
        moments.append(StoryMoment(first + int(cycles[0]), text))
    robot, k = np.unravel_index(int(waited.argmax()), waited.shape)
    if waited[robot, k] >= CAPTIONED_WAIT:
        cause, blocker = (int(columns.of_robots(name)[robot, k]) for name in ("cause", "blocker"))
        names = {"robot": f"robot {robot}", "cell": "the next cell"}
        names["blocker"] = "another robot" if blocker == NIL else f"robot {blocker}"
        why = CAUSES[cause].text.format(**names)
        text = f"the longest wait{since}, of robot {robot}, {count(int(waited[robot, k]), 'tick')}: {why}"
        moments.append(StoryMoment(first + int(k), text))
    name = "the end" if stretch.last == stretch.recorded else f"tick {stretch.last:,}"
    end = f"{name}: {int(delivered[-1]):,} of {columns.of_fleet('orders')[-1]:,} orders done"
    return sorted([*moments, StoryMoment(stretch.last, end)])


# Data of a film: columns of numbers by robot and tick, and the changes of cells.


Column = NDArray[np.int32]

ROBOT_TICKS: Final = 20_000_000  # maximum of a film: a browser needs about 30 bytes for each
NOT_READ: Final = 1 << 62  # later than any tick
PARTS_OF_CELL: Final = 16  # units of positions per cell
# A robot's mark: its state from bit 0, its direction from bit 3, its shape from bit 5.
DIRECTION_SHIFT: Final = 3
SHAPE_SHIFT: Final = 5
BY_ROBOT: Final = (
    "cell",
    "claim",
    "mark",
    "doing",
    "cause",
    "blocker",
    "wanted",
    "charge",
    "waited",
)
FIGURES: Final = ("working", "waiting", "circling", "delivered", "orders")


class ChangingCells:
    """A changing set of cells: the first set, and the ticks at which cells join or leave."""

    def __init__(self) -> None:
        self._first: Column | None = None
        self._now = np.zeros(0, np.int32)
        self._changes: list[tuple[int, int]] = []  # tick since the first, cell
        self._shown: set[int] = set()  # the cells at the last requested tick
        self._read, self._read_tick = 0, NOT_READ  # number of changes up to that tick, the tick

    def take(self, k: int, cells: Column) -> None:
        """Record the cells at tick k since the first; ticks ascend."""
        if self._first is None:
            self._first = cells
        else:
            changed = np.setxor1d(cells, self._now, assume_unique=True)
            self._changes += [(k, cell) for cell in changed.tolist()]
        self._now = cells

    def at(self, k: int) -> Column:
        """(c,) the cells at tick k since the first; fast for ascending ticks."""
        assert self._first is not None
        if k < self._read_tick:
            self._read, self._shown, self._read_tick = 0, set(self._first.tolist()), -1
        while self._read < len(self._changes) and self._changes[self._read][0] <= k:
            self._shown ^= {self._changes[self._read][1]}
            self._read += 1
        self._read_tick = k
        return np.array(sorted(self._shown), np.int32)

    def packed(self) -> tuple[Column, Column]:
        """(1, c) the first cells; (2, d) tick and cell of each change."""
        assert self._first is not None
        changes = np.array(self._changes, np.int32).reshape(-1, 2).T
        return self._first.reshape(1, -1), np.ascontiguousarray(changes)


class FilmColumns:
    """The robots, counts and loads of each tick from `first` to `last`.

    Raises InputError if they are too many for a browser.
    """

    def __init__(self, floor: DrawnFloor, robots: int, first: int, last: int) -> None:
        ticks = last - first + 1
        if robots * ticks > ROBOT_TICKS:
            raise InputError(
                f"{count(robots, 'robot')} in {count(ticks, 'tick')} are more than a film holds, "
                f"{ROBOT_TICKS:,} together: choose fewer ticks with --from and --to"
            )
        self.floor, self.first, self.last = floor, first, last
        self._by_robot = {name: np.zeros((robots, ticks), np.int32) for name in BY_ROBOT}
        self.figures = np.zeros((len(FIGURES), ticks), np.int32)
        self.full, self.shut = ChangingCells(), ChangingCells()
        self._places: tuple[Column, Column] | None = None
        self._busy = np.zeros(robots, np.int64)  # remaining busy ticks at the last tick

    def take(self, simulation: Simulation) -> None:
        """Record the state after a tick; ticks ascend."""
        k = simulation.tick - self.first
        world = simulation.world
        self._busy = world.robots.busy[world.robots.at_index].astype(np.int64)
        fleet = fleet_of(world, simulation.observation)
        looks = looks_of_fleet(fleet, self.floor)
        values = {
            "cell": cell_of(fleet),
            "claim": fleet.claim,
            "mark": looks.state
            | looks.direction << DIRECTION_SHIFT
            | (looks.shape.astype(np.int32) << SHAPE_SHIFT),
            "doing": fleet.doing,
            "cause": fleet.cause,
            "blocker": fleet.blocker,
            "wanted": fleet.wanted,
            "waited": waited_ticks(fleet.cause, fleet.since, simulation.tick),
            "charge": fleet.charge // BATTERY_PERCENT if self.floor.battery else np.int32(0),
        }
        for name, value in values.items():
            self._by_robot[name][:, k] = value
        now = summary_of(simulation)
        self.figures[:, k] = [getattr(now, name) for name in FIGURES]
        self.full.take(k, full_cells(world, self.floor))
        self.shut.take(k, shut_cells(world))

    def marks(self) -> Column:
        """All different marks, in ascending order."""
        return np.unique(self._by_robot["mark"])

    def packed(self) -> dict[str, Any]:
        """The columns as text: differences between ticks, deflated, in base 64.

        Numbers are 32-bit little-endian.
        """
        columns = {name: self._by_robot[name] for name in BY_ROBOT if name not in ("cell", "claim")}
        columns["x"], columns["y"] = self.places()
        columns["figures"] = self.figures
        columns["full"], columns["changes"] = self.full.packed()
        columns["shut"], columns["gates"] = self.shut.packed()
        return {name: deflated(_differences(column)) for name, column in columns.items()}

    def moment_at(self, tick: float) -> Moment:
        """The film at a tick, or between two ticks with interpolated positions."""
        k = int(tick) - self.first
        part, after = tick - int(tick), min(k + 1, self.last - self.first)
        x, y = self.places()
        off, off_next = ((x[:, one] == NIL) & (y[:, one] == NIL) for one in (k, after))
        dx, dy = x[:, after] - x[:, k], y[:, after] - y[:, k]
        goes = ~off_next & (np.abs(dx) + np.abs(dy) <= PARTS_OF_CELL)  # else towed
        at = [(one[:, k] + step * goes * part) / PARTS_OF_CELL for one, step in ((x, dx), (y, dy))]
        mark = self._by_robot["mark"][:, k]
        state, direction = mark & 7, mark >> DIRECTION_SHIFT & 3
        looks = (one.astype(np.uint8) for one in (state, mark >> SHAPE_SHIFT, direction))
        return Moment(
            tick=int(tick),
            x=np.where(off, np.nan, at[0]),
            y=np.where(off, np.nan, at[1]),
            looks=RobotLooks(*looks),
            doing=self._by_robot["doing"][:, k],
            cause=self._by_robot["cause"][:, k],
            blocker=self._by_robot["blocker"][:, k],
            full=self.full.at(k),
            shut=self.shut.at(k),
        )

    def figure(self, name: str, tick: int) -> int:
        """The value of one of FIGURES at a tick."""
        return int(self.of_fleet(name)[tick - self.first])

    def of_fleet(self, name: str) -> Column:
        """(T,) one of FIGURES."""
        series: Column = self.figures[FIGURES.index(name)]
        return series

    def of_robots(self, name: str) -> Column:
        """(n, T) one of BY_ROBOT."""
        return self._by_robot[name]

    def places(self) -> tuple[Column, Column]:
        """(n, T) columns and rows of robots in parts of a cell; NIL: off the floor."""
        if self._places is None:
            x, y = self._measured_places()
            self._places = x, y
        return self._places

    def _measured_places(self) -> Iterator[Column]:
        stride = self.floor.floor_plan.stride
        cell, share = self._by_robot["cell"], self._shares()
        claim = np.where(self._by_robot["claim"] == NIL, cell, self._by_robot["claim"])
        for at, to in (
            (cell % stride - 1, claim % stride - 1),
            (cell // stride - 1, claim // stride - 1),
        ):
            place = at * PARTS_OF_CELL + ((to - at) * PARTS_OF_CELL * share).astype(np.int32)
            yield np.where(cell == NIL, NIL, place).astype(np.int32)

    def _shares(self) -> NDArray[np.float64]:
        """(n, T) progress, 0 to 1, of robots in moves of several ticks."""
        cell, claim = self._by_robot["cell"], self._by_robot["claim"]
        moving = (claim != NIL) & (cell != NIL) & (claim != cell)
        same = np.zeros_like(moving)
        same[:, 1:] = (
            moving[:, 1:]
            & moving[:, :-1]
            & (cell[:, 1:] == cell[:, :-1])
            & (claim[:, 1:] == claim[:, :-1])
        )
        since, until = np.zeros(cell.shape), np.zeros(cell.shape)
        ticks = cell.shape[1]
        for k in range(ticks):
            since[:, k] = np.where(moving[:, k], 1 + same[:, k] * (since[:, k - 1] if k else 0), 0)
        for k in range(ticks - 1, -1, -1):
            goes_on = same[:, k + 1] * until[:, k + 1] if k + 1 < ticks else self._busy - 1
            until[:, k] = np.where(moving[:, k], 1 + goes_on, 0)
        shares: NDArray[np.float64] = since / np.maximum(since + until, 1)
        return shares


def cause_words() -> list[dict[str, str]]:
    """Name and text of each cause; the text contains {robot}, {blocker} and {cell}."""
    return [{"name": cause.name, "text": cause.text} for cause in CAUSES]


def deflated(values: NDArray[Any]) -> str:
    """The bytes of an array, deflated, in base 64."""
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values).tobytes(), 9)).decode()


def _differences(column: Column) -> Column:
    """Differences along rows, the first one from 0."""
    return np.diff(column, axis=1, prepend=np.int32(0)).astype("<i4")


# Output files.


def checked(path: Path) -> Path:
    """The resolved path of an output file. Raises InputError."""
    try:
        path = path.resolve()
        if path.is_dir():
            raise cannot_write_error("this is a folder", path)
        if not path.parent.is_dir():
            raise cannot_write_error("there is no such folder", path.parent)
        if path.exists() and not path.is_file():
            raise cannot_write_error("this is not a regular file; '-' is standard output", path)
        if is_recording(path):
            raise cannot_write_error("this is a recording; choose another file with --out", path)
    except (OSError, RuntimeError) as error:
        raise cannot_write_error(
            getattr(error, "strerror", None) or "circular links", path
        ) from None
    return path
