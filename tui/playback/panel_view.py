"""What the player shows: a moment of one or two runs, how it goes on, and the metrics so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from textual.message import Message

from automaton.engine.state import NIL, Array
from automaton.floor.floor_plan import FloorPlan
from automaton.history.live_run import Divergence
from automaton.history.snapshot import Snapshot
from automaton.history.watched_run import Run
from automaton.runs.metrics import OPERATIONS, executed_ticks, metrics_of
from automaton.runs.progress import Jam, largest_jam, starved_robots
from tui.render.camera import Zoom
from tui.render.glyphs import GlyphSet
from tui.render.scene import Scene
from tui.render.styles import Look


@dataclass(frozen=True)
class Figures:
    """Metrics of a run at a tick."""

    tick: int
    metrics: dict[str, float | int]  # of the fleet, by the names of automaton.runs.metrics.GLOSSARY
    operations: Array  # (n,) int64, by identity: operations begun
    active: Array  # (n,) float64: share of ticks in which it did something
    starved: Array  # (k,) identities of robots that have finished nothing for long, ascending
    jam: Jam | None  # most of them that stand together


@dataclass(frozen=True)
class PlaybackState:
    """What there is to be seen, and how it goes on."""

    seq: int
    tick: int  # of the clock; a run that is shorter stays at its end
    runs: tuple[Run, ...]  # of which plan, header, resolved and event_history may be read
    snapshots: tuple[Snapshot, ...]
    figures: tuple[Figures, ...]
    playing: int  # -1 backwards, 0 paused, 1
    asked: float  # ticks per second; math.inf = as fast as it goes
    achieved: float  # 0: not measured yet
    head: int  # the last tick that is known
    known: int  # the last tick up to which events are known
    ends: tuple[int | None, ...]  # of each run the last tick that there will be, if it is known
    live: bool
    stops: int  # how often breakpoints have stopped it
    stopped: str  # why a breakpoint stopped it, or ""
    breakpoint_robots: tuple[int, ...]  # robots that a breakpoint was about,
    side: int  # and in which of the runs
    error: str  # why it cannot go on, or ""
    failed: str = ""  # why a strategy could not go on, for as long as its run is there
    divergence: Divergence | None = None  # where two live runs part, once that is known
    trails: tuple[
        Array, ...
    ] = ()  # of each run (n, k) int32 cells that robots came through, or NIL

    @property
    def end(self) -> int | None:
        """The last tick that there will be in any run, if that is known."""
        known = [end for end in self.ends if end is not None]
        return max(known) if len(known) == len(self.ends) else None

    def ended(self, side: int) -> bool:
        """Whether a run is shown at its end."""
        return self.snapshots[side].tick == self.ends[side]


class LongTick(NamedTuple):
    """A tick that is being computed."""

    tick: int
    seconds: float  # for which it has been
    waited: bool  # a request waits for its end


def figures_of(run: Run) -> Figures:
    """The metrics at the tick that a run shows; in the thread of its player."""
    shown = run.shown
    world = shown.world
    by_identity = world.robots.at_index
    active = executed_ticks(world)[by_identity, 1:].sum((1, 2)) / max(1, shown.tick)
    operations = world.tally.operations[by_identity][:, OPERATIONS].sum((1, 2))
    starved = np.sort(world.robots.identity[starved_robots(world)])
    jam = largest_jam(world, run.floor_plan)
    return Figures(shown.tick, metrics_of(shown), operations, active, starved, jam)


# What every panel is given to show, and what panels ask of the app.


class Picture(NamedTuple):
    """What a picture of the map is made of, and how it is drawn."""

    scene: Scene
    zoom: Zoom
    look: Look
    glyphs: GlyphSet


@dataclass(frozen=True)
class View:
    """A playback state with what the user has chosen. Of a run only plan, header and event_history
    may be read.
    """

    playback: PlaybackState
    runs: Sequence[Run]
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
    def run(self) -> Run:
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


# Where a jam is: the robot in the middle of it.


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
