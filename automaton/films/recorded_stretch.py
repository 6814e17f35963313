"""A stretch of a recording, played once and kept as columns: what every film is made of."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

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
from automaton.recording.frames import Recording
from automaton.recording.header import resolved_of
from automaton.recording.recording_reader import title_of
from automaton.runs.simulation import Simulation
from automaton.scenario.text_files import is_recording
from automaton.units import Unit, count, number, unit
from automaton.world.resolved import Resolved


@dataclass(frozen=True)
class RecordedStretch:
    """The ticks from `first` to `last` of a run."""

    resolved: Resolved
    floor: DrawnFloor
    columns: FilmColumns
    title: str
    first: int
    last: int
    recorded: int  # the last tick of the recording

    @property
    def unit(self) -> Unit:
        """What a tick stands for."""
        return unit(self.resolved.scenario.units.tick)

    def time_words(self, tick: int) -> str:
        """A tick, and what it is in the reader's unit."""
        words = f"tick {tick:,} of {self.recorded:,}"
        if self.unit.size == 1:
            return words
        return f"{words}, {number(self.unit.of(tick))} {self.unit.plural}"

    def fleet_words(self, tick: int) -> str:
        """How many robots work and wait, and what is done."""
        working, waiting, circling, done, orders = (
            self.columns.figure(name, tick)
            for name in ("working", "waiting", "circling", "delivered", "orders")
        )
        words = f"{working:,} working, {waiting:,} waiting, {done:,} of {orders:,} orders done"
        return f"{words}, {circling:,} in a wait cycle" if circling else words


def checked_range(recording: Recording, first: int | None, last: int | None) -> tuple[int, int]:
    """The first tick and the last one; None: those of the recording. Raises InputError."""
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
    """Play the ticks from `first` (0) to `last` (the last one). Raises InputError."""
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
    return RecordedStretch(resolved, floor, columns, title, begin, end, recording.ticks)


# What a film needs: columns of numbers by robot and tick, and the cells that change.


Column = NDArray[np.int32]

ROBOT_TICKS: Final = 20_000_000  # of a film: what a browser can hold, some 30 bytes for each
NOT_READ: Final = 1 << 62  # later than any tick
PARTS_OF_CELL: Final = 16  # of a cell: positions are counted in these
# A robot's mark in one number: its state, its direction from bit 3, its shape from bit 5.
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
    """Cells of one kind: those at first, and at which ticks cells join or leave them."""

    def __init__(self) -> None:
        self._first: Column | None = None
        self._now = np.zeros(0, np.int32)
        self._changes: list[tuple[int, int]] = []  # tick from the first on, cell
        self._shown: set[int] = set()  # the cells at the tick that was asked for last
        self._read, self._read_tick = 0, NOT_READ  # changes up to that tick, and the tick

    def take(self, k: int, cells: Column) -> None:
        """The cells at a tick from the first on; ticks ascend."""
        if self._first is None:
            self._first = cells
        else:
            changed = np.setxor1d(cells, self._now, assume_unique=True)
            self._changes += [(k, cell) for cell in changed.tolist()]
        self._now = cells

    def at(self, k: int) -> Column:
        """(c,) the cells at a tick from the first on; quick where ticks ascend."""
        assert self._first is not None
        if k < self._read_tick:
            self._read, self._shown, self._read_tick = 0, set(self._first.tolist()), -1
        while self._read < len(self._changes) and self._changes[self._read][0] <= k:
            self._shown ^= {self._changes[self._read][1]}
            self._read += 1
        self._read_tick = k
        return np.array(sorted(self._shown), np.int32)

    def packed(self) -> tuple[Column, Column]:
        """(1, c) the cells at first; (2, d) tick and cell of each change."""
        assert self._first is not None
        changes = np.array(self._changes, np.int32).reshape(-1, 2).T
        return self._first.reshape(1, -1), np.ascontiguousarray(changes)


class FilmColumns:
    """The robots, counts and loads of each tick from `first` to `last`.

    Raises InputError if they are more than a browser plays.
    """

    def __init__(self, floor: DrawnFloor, robots: int, first: int, last: int) -> None:
        ticks = last - first + 1
        if robots * ticks > ROBOT_TICKS:
            raise InputError(
                f"{count(robots, 'robot')} in {count(ticks, 'tick')} are more than a film holds, "
                f"{ROBOT_TICKS:,} together: --from and --to say which ticks"
            )
        self.floor, self.first, self.last = floor, first, last
        self._by_robot = {name: np.zeros((robots, ticks), np.int32) for name in BY_ROBOT}
        self.figures = np.zeros((len(FIGURES), ticks), np.int32)
        self.full, self.shut = ChangingCells(), ChangingCells()
        self._places: tuple[Column, Column] | None = None
        self._busy = np.zeros(robots, np.int64)  # ticks that each still needs after the last one

    def take(self, simulation: Simulation) -> None:
        """Read what is to be shown off the state after a tick; ticks ascend."""
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

    def packed(self) -> dict[str, Any]:
        """The columns as text: differences from tick to tick, deflated, in base 64.

        Numbers are 32 bits wide, the lowest byte first.
        """
        columns = {name: self._by_robot[name] for name in BY_ROBOT if name not in ("cell", "claim")}
        columns["x"], columns["y"] = self.places()
        columns["figures"] = self.figures
        columns["full"], columns["changes"] = self.full.packed()
        columns["shut"], columns["gates"] = self.shut.packed()
        return {name: deflated(_differences(column)) for name, column in columns.items()}

    def moment_at(self, tick: float) -> Moment:
        """The film at a tick, or between two, where robots are on their way from one to the other."""
        k = int(tick) - self.first
        part, after = tick - int(tick), min(k + 1, self.last - self.first)
        x, y = self.places()
        off, off_next = ((x[:, one] == NIL) & (y[:, one] == NIL) for one in (k, after))
        dx, dy = x[:, after] - x[:, k], y[:, after] - y[:, k]
        goes = ~off_next & (np.abs(dx) + np.abs(dy) <= PARTS_OF_CELL)  # else towed, not driven
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
        """One of FIGURES at a tick."""
        return int(self.figures[FIGURES.index(name), tick - self.first])

    def places(self) -> tuple[Column, Column]:
        """(n, T) the columns and the rows of robots, in parts of a cell; off the floor: NIL."""
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
        """(n, T) how far into the cell ahead a robot is that moves for several ticks."""
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
    """Of each cause its name and its sentence, with {robot}, {blocker} and {cell}."""
    return [{"name": cause.name, "text": cause.text} for cause in CAUSES]


def deflated(values: NDArray[Any]) -> str:
    """An array as text: its bytes deflated, in base 64."""
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values).tobytes(), 9)).decode()


def _differences(column: Column) -> Column:
    """What a row adds to its last value; the first one is added to 0."""
    return np.diff(column, axis=1, prepend=np.int32(0)).astype("<i4")


# Where a film may be written.


def checked(path: Path) -> Path:
    """A place for a file, links followed. Raises InputError before anything is computed."""
    try:
        path = path.resolve()
        if path.is_dir():
            raise cannot_write_error("this is a folder", path)
        if not path.parent.is_dir():
            raise cannot_write_error("there is no such folder", path.parent)
        if path.exists() and not path.is_file():
            raise cannot_write_error("this is not a regular file; '-' is standard output", path)
        if is_recording(path):
            raise cannot_write_error("this is a recording; --out names another file", path)
    except (OSError, RuntimeError) as error:
        raise cannot_write_error(
            getattr(error, "strerror", None) or "links in a circle", path
        ) from None
    return path
