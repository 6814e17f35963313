"""The view for panels, and their messages that choose robots, cells, ticks and zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from textual.message import Message

from automaton.engine.state import NIL

if TYPE_CHECKING:  # most need Numba
    from automaton.floor.floor_plan import FloorPlan
    from automaton.history.snapshot import Snapshot
    from automaton.history.watched_run import WatchedRun
    from automaton.runs.progress import Jam
    from tui.playback.playback_state import PlaybackState, RunFigures
    from tui.render.camera import Zoom
    from tui.render.scene import Scene
    from tui.render.styles import GlyphSet, Look


class Picture(NamedTuple):
    """The scene of a map and how it is drawn."""

    scene: Scene
    zoom: Zoom
    look: Look
    glyphs: GlyphSet
    in_pixels: bool = False  # the map, which is not text


@dataclass(frozen=True)
class View:
    """A playback state with the user's choices.

    Read only the plan, header, resolved and event_history of a run.
    """

    playback: PlaybackState
    runs: Sequence[WatchedRun]
    robot: int = NIL  # the selected robot, or NIL
    cell: int = NIL  # the selected cell, or NIL
    layer: str = ""  # name of a registered layer, or ""
    side: int = 0  # index of the run that the panels show
    zone: int = NIL  # the selected zone, or NIL
    picture: Picture | None = None  # of this run

    @property
    def key(self) -> tuple[object, ...]:
        """Views with equal keys show the same."""
        chosen = (self.robot, self.cell, self.zone, self.side, self.layer)
        drawn: tuple[object, ...] = ()
        if self.picture is not None:
            scene = self.picture.scene
            laid = (scene.least, scene.colouring, scene.lines, scene.trails.size)
            drawn = (*laid, *self.picture[1:])
        return (id(self.run), self.playback.seq, *chosen, *drawn)

    @property
    def snapshot(self) -> Snapshot:
        """The snapshot of the run."""
        return self.playback.snapshots[self.side]

    @property
    def measured(self) -> RunFigures:
        """The metrics of the run at its tick."""
        return self.playback.figures[self.side]

    @property
    def run(self) -> WatchedRun:
        """The run that the panels show."""
        return self.runs[self.side]

    @property
    def floor_plan(self) -> FloorPlan:
        """The floor of the run."""
        return self.run.floor_plan


class RobotChosen(Message):
    """Select a robot and bring it onto the screen."""

    def __init__(self, robot: int) -> None:
        self.robot = robot
        super().__init__()


class CellChosen(Message):
    """Select a cell and bring it onto the screen."""

    def __init__(self, cell: int) -> None:
        self.cell = cell
        super().__init__()


class ZoneChosen(Message):
    """Select a zone and bring it onto the screen."""

    def __init__(self, zone: int) -> None:
        self.zone = zone
        super().__init__()


class JamChosen(Message):
    """Go to the largest jam."""


class TickChosen(Message):
    """Go to a tick."""

    def __init__(self, tick: int) -> None:
        self.tick = tick
        super().__init__()


class OrderChosen(Message):
    """Show an order."""

    def __init__(self, order: int) -> None:
        self.order = order
        super().__init__()


def middle_robot(jam: Jam, snapshot: Snapshot, floor_plan: FloorPlan) -> int:
    """Index in `jam.robots` of the robot nearest to the centre of the jam's bounding box."""
    cells = snapshot.robots.cell[list(jam.robots)]
    rows, columns = np.divmod(cells, floor_plan.stride)
    corners = [
        divmod(floor_plan.cell(*corner), floor_plan.stride) for corner in (jam.first, jam.last)
    ]
    row, column = np.mean(corners, axis=0)
    distance = np.where(cells == NIL, np.inf, abs(rows - row) + abs(columns - column))
    return int(np.argmin(distance))
