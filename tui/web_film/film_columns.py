"""What a page needs to play a recording: a few words, and columns of numbers by robot and tick."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.observation import CAUSES
from automaton.engine.robot_status import BATTERY_PERCENT
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.units import count
from tui.playback.fleet_summary import summarize
from tui.render.robot_marks import robots_of
from tui.render.scene import Floor, Scene

if TYPE_CHECKING:  # it needs Numba
    from automaton.evidence.history.snapshot import Snapshot

Column = NDArray[np.int32]

ROBOT_TICKS: Final = 20_000_000  # of a film: what a browser can hold, some 30 bytes for each
PARTS: Final = 16  # of a cell: positions are counted in these
# A robot's mark in one number: its state, its direction from bit 3, its shape from bit 5.
DIRECTION_SHIFT: Final = 3
SHAPE_SHIFT: Final = 5
BY_ROBOT: Final = ("cell", "claim", "mark", "cause", "blocker", "wanted", "charge")
FIGURES: Final = ("working", "waiting", "circling", "delivered", "orders")


class FilmColumns:
    """The robots, counts and loads of each tick from `first` to `last`.

    Raises InputError if they are more than a browser plays.
    """

    def __init__(self, floor: Floor, robots: int, first: int, last: int) -> None:
        ticks = last - first + 1
        if robots * ticks > ROBOT_TICKS:
            raise InputError(
                f"{count(robots, 'robot')} in {count(ticks, 'tick')} are more than a page plays, "
                f"{ROBOT_TICKS:,} together: --from and --to say which ticks"
            )
        self.floor, self.first, self.last = floor, first, last
        self._by_robot = {name: np.zeros((robots, ticks), np.int32) for name in BY_ROBOT}
        self._figures = np.zeros((len(FIGURES), ticks), np.int32)
        self._full: NDArray[np.bool_] | None = None
        self._full_at_first = np.zeros(0, np.uint8)
        self._changes: list[tuple[int, int]] = []  # tick from the first on, slot

    def take(self, snapshot: Snapshot) -> None:
        """Read what is to be shown off the state after a tick; ticks ascend."""
        k = snapshot.tick - self.first
        fleet = snapshot.robots
        drawn = robots_of(Scene(self.floor, snapshot))
        values = {
            "cell": drawn.cell,
            "claim": fleet.claim,
            "mark": drawn.state
            | drawn.direction << DIRECTION_SHIFT
            | (drawn.shape.astype(np.int32) << SHAPE_SHIFT),
            "cause": fleet.cause,
            "blocker": fleet.blocker,
            "wanted": fleet.wanted,
            "charge": fleet.charge // BATTERY_PERCENT if self.floor.battery else np.int32(0),
        }
        for name, value in values.items():
            self._by_robot[name][:, k] = value
        now = summarize(snapshot)
        self._figures[:, k] = [getattr(now, name) for name in FIGURES]
        self._take_loads(k, snapshot.slots.content[: len(self.floor.slots_cell)] != NIL)

    def _take_loads(self, k: int, full: NDArray[np.bool_]) -> None:
        if self._full is None:
            self._full_at_first = full.astype(np.uint8)
        else:
            self._changes += [(k, int(slot)) for slot in np.flatnonzero(full != self._full)]
        self._full = full

    def packed(self) -> dict[str, Any]:
        """The columns as text: differences from tick to tick, deflated, in base 64.

        Numbers are 32 bits wide, the lowest byte first.
        """
        columns = {name: self._by_robot[name] for name in BY_ROBOT if name not in ("cell", "claim")}
        columns["x"], columns["y"] = self._places()
        columns["figures"] = self._figures
        changes = np.array(self._changes, np.int32).reshape(-1, 2).T
        columns["changes"] = np.ascontiguousarray(changes)
        packed = {name: _deflated(_differences(column)) for name, column in columns.items()}
        return packed | {"full": _deflated(self._full_at_first)}

    def _places(self) -> Iterator[Column]:
        """The columns and the rows of robots, in parts of a cell; off the floor: NIL."""
        stride = self.floor.floor_plan.stride
        cell, share = self._by_robot["cell"], self._shares()
        claim = np.where(self._by_robot["claim"] == NIL, cell, self._by_robot["claim"])
        for at, to in (
            (cell % stride - 1, claim % stride - 1),
            (cell // stride - 1, claim // stride - 1),
        ):
            place = at * PARTS + ((to - at) * PARTS * share).astype(np.int32)
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
            goes_on = same[:, k + 1] * until[:, k + 1] if k + 1 < ticks else 0
            until[:, k] = np.where(moving[:, k], 1 + goes_on, 0)
        shares: NDArray[np.float64] = since / np.maximum(since + until, 1)
        return shares


def cause_words() -> list[dict[str, str]]:
    """Of each cause its name and its sentence, with {robot}, {blocker} and {cell}."""
    return [{"name": cause.name, "text": cause.text} for cause in CAUSES]


def _differences(column: Column) -> Column:
    """What a row adds to its last value; the first one is added to 0."""
    return np.diff(column, axis=1, prepend=np.int32(0)).astype("<i4")


def _deflated(values: NDArray[Any]) -> str:
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values).tobytes(), 9)).decode()
