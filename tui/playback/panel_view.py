"""What panels show at a moment, and the messages by which they choose robots, cells, ticks and zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from textual.message import Message

from automaton.engine.state import NIL

if TYPE_CHECKING:  # most of them need Numba
    from automaton.floor.floor_plan import FloorPlan
    from automaton.history.snapshot import Snapshot
    from automaton.history.watched_run import WatchedRun
    from automaton.runs.progress import Jam
    from tui.playback.playback_state import PlaybackState
    from tui.render.camera import Zoom
    from tui.render.scene import Scene
    from tui.render.styles import GlyphSet, Look


class Picture(NamedTuple):
    """What a picture of the map is made of, and how it is drawn."""

    scene: Scene
    zoom: Zoom
    look: Look
    glyphs: GlyphSet


@dataclass(frozen=True)
class View:
    """A playback state with what the user has chosen.

    Of a run only plan, header and event_history may be read.
    """

    playback: PlaybackState
    runs: Sequence[WatchedRun]
    robot: int = NIL  # the selected robot, or NIL
    cell: int = NIL  # the selected cell, or NIL
    layer: str = ""  # the name of one that is registered, or none
    side: int = 0  # which of two compared runs the panels tell of
    zone: int = NIL  # the selected zone of the floor, or NIL
    picture: Picture | None = None  # of the run that the panels tell of

    @property
    def key(self) -> tuple[object, ...]:
        """Two views with one key show the same."""
        chosen = (self.robot, self.cell, self.zone, self.side, self.layer)
        drawn: tuple[object, ...] = ()
        if self.picture is not None:
            scene = self.picture.scene
            laid = (scene.least, scene.colouring, scene.lines, scene.trails.size)
            drawn = (*laid, *self.picture[1:])
        return (id(self.run), self.playback.seq, *chosen, *drawn)

    @property
    def snapshot(self) -> Snapshot:
        """The state to tell of."""
        return self.playback.snapshots[self.side]

    @property
    def run(self) -> WatchedRun:
        """The run to tell of."""
        return self.runs[self.side]

    @property
    def floor_plan(self) -> FloorPlan:
        """Its floor."""
        return self.run.floor_plan


class RobotChosen(Message):
    """Select a robot, and show where it is."""

    def __init__(self, robot: int) -> None:
        self.robot = robot
        super().__init__()


class CellChosen(Message):
    """Select a cell, and show where it is."""

    def __init__(self, cell: int) -> None:
        self.cell = cell
        super().__init__()


class ZoneChosen(Message):
    """Select a zone of the floor, and show where it is."""

    def __init__(self, zone: int) -> None:
        self.zone = zone
        super().__init__()


class JamChosen(Message):
    """Go to the largest jam."""


class TickChosen(Message):
    """Show a tick."""

    def __init__(self, tick: int) -> None:
        self.tick = tick
        super().__init__()


class OrderChosen(Message):
    """Tell about an order."""

    def __init__(self, order: int) -> None:
        self.order = order
        super().__init__()


def middle_robot(jam: Jam, snapshot: Snapshot, floor_plan: FloorPlan) -> int:
    """Index in `jam.robots` of the one nearest to the middle between the corners of the jam."""
    cells = snapshot.robots.cell[list(jam.robots)]
    rows, columns = np.divmod(cells, floor_plan.stride)
    corners = [
        divmod(floor_plan.cell(*corner), floor_plan.stride) for corner in (jam.first, jam.last)
    ]
    row, column = np.mean(corners, axis=0)
    distance = np.where(cells == NIL, np.inf, abs(rows - row) + abs(columns - column))
    return int(np.argmin(distance))
