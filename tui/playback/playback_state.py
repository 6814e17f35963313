"""What the player shows: a moment of one or two runs, how it goes on, the metrics so far, and trails."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from automaton.engine.state import NIL, Array
from automaton.history.divergence import Divergence
from automaton.history.snapshot import Snapshot
from automaton.history.watched_run import WatchedRun
from automaton.runs.metrics import OPERATION_STATES, executed_ticks, metrics_of
from automaton.runs.progress import Jam, largest_jam, starved_robots
from automaton.runs.simulation import Simulation
from tui.registration import layer_named

TRAIL_CELLS: Final = 8
MAX_GAP_TICKS: Final = 64  # between two states that are still one way

OVERLAY_TIME_RATIO: Final = 4  # at most a fourth of the time goes into a layer that takes long


@dataclass(frozen=True)
class PlaybackState:
    """What there is to be seen, and how it goes on."""

    seq: int
    tick: int  # of the clock; a run that is shorter stays at its end
    runs: tuple[WatchedRun, ...]  # of which plan, header, resolved and event_history may be read
    snapshots: tuple[Snapshot, ...]
    figures: tuple[RunFigures, ...]
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
    # Of each run (n, k) int32 cells that robots came through, or NIL.
    trails: tuple[Array, ...] = ()

    @property
    def end(self) -> int | None:
        """The last tick that there will be in any run, if that is known."""
        known = [end for end in self.ends if end is not None]
        return max(known) if len(known) == len(self.ends) else None

    def ended(self, side: int) -> bool:
        """Whether a run is shown at its end."""
        return self.snapshots[side].tick == self.ends[side]


@dataclass(frozen=True)
class RunFigures:
    """Metrics of a run at a tick."""

    tick: int
    metrics: dict[str, float | int]  # of the fleet, by the names of automaton.runs.metrics.GLOSSARY
    operations: Array  # (n,) int64, by identity: operations begun
    active: Array  # (n,) float64: share of ticks in which it did something
    starved: Array  # (k,) identities of robots that have finished nothing for long, ascending
    jam: Jam | None  # most of them that stand together


def figures_of(run: WatchedRun) -> RunFigures:
    """The metrics at the tick that a run shows; in the thread of its player."""
    shown = run.shown
    world = shown.world
    by_identity = world.robots.at_index
    active = executed_ticks(world)[by_identity, 1:].sum((1, 2)) / max(1, shown.tick)
    operations = world.tally.operations[by_identity][:, OPERATION_STATES].sum((1, 2))
    starved = np.sort(world.robots.identity[starved_robots(world)])
    jam = largest_jam(world, run.floor_plan)
    return RunFigures(shown.tick, metrics_of(shown), operations, active, starved, jam)


class LongTick(NamedTuple):
    """A tick that is being computed."""

    tick: int
    seconds: float  # for which it has been
    waited: bool  # a request waits for its end


class Overlays:
    """The numbers of a layer that were computed last for one run."""

    def __init__(self) -> None:
        self._of: tuple[Simulation, int, int, str] | None = None  # run, tick, robot and layer
        self._field: Array | None = None
        self._next = -math.inf  # when it may be computed again while ticks go by

    def laid_over(
        self, snapshot: Snapshot, simulation: Simulation, name: str, playing: bool
    ) -> Snapshot:
        """The snapshot of this moment with the numbers of a layer.

        While ticks go by they may be as old as the layer's `pause_s`; otherwise they are of this tick.
        """
        layer = layer_named(name)
        now = (simulation, snapshot.tick, snapshot.selected, name)
        began = time.monotonic()
        old = self._of is not None and self._of[2:] == now[2:] and began < self._next
        if self._of != now and not (playing and old):
            self._of, self._field = now, layer.numbers(simulation, snapshot.selected)
            ended = time.monotonic()
            pause = max(layer.pause_s, OVERLAY_TIME_RATIO * (ended - began))
            self._next = ended + (pause if layer.pause_s else 0.0)
        if layer.arrows:
            return replace(snapshot, flow=self._field)
        return replace(snapshot, heat=self._field)


class Trails:
    """The cells that each robot of one run came through last.

    Behind a robot lies the part of its route that it has driven, whatever was skipped or rewound;
    what it drove before its present route is known from the states that were shown before.
    """

    def __init__(self) -> None:
        self._past: DrivenCells | None = None

    def at(self, simulation: Simulation) -> Array:
        """(n, TRAIL_CELLS) int32 by identity, the last cell first, then NIL."""
        past, tick, robots = self._past, simulation.tick, len(simulation.world.robots.cell)
        if past is not None and past.tick == tick and len(past.steps) == robots:
            return past.cells
        position, steps, cells = _driven(simulation)
        if past is not None and 0 < tick - past.tick <= MAX_GAP_TICKS:
            cells = _with_older(position, cells, steps, past)
        self._past = DrivenCells(tick, position, steps, cells)
        return cells


class DrivenCells(NamedTuple):
    """What was known of all robots at a tick."""

    tick: int
    position: Array  # (n,) the cell where it is, or which it enters
    steps: Array  # (n,) driven on its route
    cells: Array  # (n, TRAIL_CELLS)


def _driven(simulation: Simulation) -> tuple[Array, Array, Array]:
    """Where robots are, the steps that they have driven of their routes, and the cells of the last."""
    robots, offset = simulation.world.robots, simulation.world.grid.offset
    i = robots.at_index
    position = np.where(robots.claim[i] == NIL, robots.cell[i], robots.claim[i])
    steps = np.where(position == NIL, 0, robots.route_index[i])
    at = steps[:, None] - 1 - np.arange(TRAIL_CELLS)
    back = offset[robots.route[i[:, None], np.maximum(at, 0)]]
    cells = position[:, None] - np.cumsum(back, axis=1)
    return position, steps, np.where(at >= 0, cells, NIL).astype(np.int32)


def _with_older(position: Array, cells: Array, steps: Array, past: DrivenCells) -> Array:
    """Trails that go on with those of before where the present route began."""
    before = np.concatenate((past.position[:, None], past.cells), axis=1)
    now = np.concatenate((position[:, None], cells), axis=1)
    on_route = np.minimum(steps, TRAIL_CELLS)
    since = np.clip(steps - past.steps, 0, TRAIL_CELLS)
    same = (steps >= past.steps) & (_of(now, since) == past.position)  # it is still on that route
    stood = _of(now, on_route) == past.position  # it began its new route there
    first = np.where(same, 1 + np.minimum(past.steps, TRAIL_CELLS), stood)
    at = first[:, None] + np.arange(TRAIL_CELLS) - on_route[:, None]
    older = np.take_along_axis(before, np.clip(at, 0, TRAIL_CELLS), axis=1)
    known = (np.arange(TRAIL_CELLS) >= on_route[:, None]) & (at <= TRAIL_CELLS)
    return np.where(known, older, cells)


def _of(rows: Array, columns: Array) -> Array:
    """One value of each row."""
    values: Array = np.take_along_axis(rows, columns[:, None], axis=1)[:, 0]
    return values
