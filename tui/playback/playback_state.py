"""The player's state: a moment of one or two runs, the playback, metrics so far, and trails."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.engine.observation import LOST_EVER
from automaton.engine.state import NIL, Array
from automaton.history.divergence import Divergence
from automaton.history.playback import Playback
from automaton.history.snapshot import Snapshot
from automaton.history.watched_run import WatchedRun
from automaton.runs.bottleneck import LEAST_TICKS, Period, longest_saturated
from automaton.runs.metrics import (
    OPERATION_STATES,
    executed_ticks,
    metrics_of,
    uses_of_run,
    uses_of_time,
)
from automaton.runs.progress import Jam, SlowPlace, largest_jam, slow_places, starved_robots
from automaton.runs.simulation import Simulation
from tui.registration import layer_named

TRAIL_CELLS: Final = 8
MAX_GAP_TICKS: Final = 64  # maximum gap between two states of one trail

OVERLAY_TIME_RATIO: Final = 4  # pause / computing time: a slow layer takes 1/5 of the time


@dataclass(frozen=True)
class PlaybackState:
    """A moment of the runs, and the state of playback."""

    seq: int
    tick: int  # of the clock; a shorter run stays at its end
    runs: tuple[WatchedRun, ...]  # read only plan, header, resolved and event_history
    snapshots: tuple[Snapshot, ...]
    figures: tuple[RunFigures, ...]
    playing: int  # -1 backwards, 0 paused, 1 forwards
    asked: float  # ticks per second; math.inf: full speed
    achieved: float  # ticks per second; 0: not measured yet
    head: int  # the last known tick
    known: int  # the last tick with known events
    ends: tuple[int | None, ...]  # by run: the final tick, if known
    live: bool
    stops: int  # number of stops by breakpoints
    stopped: str  # why a breakpoint stopped it, or ""
    breakpoint_robots: tuple[int, ...]  # robots of the last breakpoint hit,
    side: int  # and the index of their run
    error: str  # why playback cannot continue, or ""
    failed: str = ""  # why a strategy failed, or ""
    divergence: Divergence | None = None  # of two live runs, once known
    # By run: (n, k) int32 cells that robots passed through, or NIL.
    trails: tuple[Array, ...] = ()
    stuck: int | None = (
        None  # first tick of the deadlock at which it stopped, as it can only repeat
    )

    @property
    def end(self) -> int | None:
        """The final tick of the longest run, if known."""
        known = [end for end in self.ends if end is not None]
        return max(known) if len(known) == len(self.ends) else None

    def ended(self, side: int) -> bool:
        """Whether a run is at its end."""
        return self.snapshots[side].tick == self.ends[side]


@dataclass(frozen=True)
class RunFigures:
    """Metrics of a run at a tick."""

    tick: int
    metrics: dict[str, float | int]  # of the fleet, by names in automaton.runs.metrics.GLOSSARY
    operations: Array  # (n,) int64, by identity: operations begun
    active: Array  # (n,) float64: share of active ticks
    starved: Array  # (k,) identities of starved robots, ascending
    jam: Jam | None  # the largest group of these that stands together
    slow_places: tuple[SlowPlace, ...]  # a saturated station; where most time was lost
    periods: tuple[Period, ...]  # up to then
    uses: dict[str, int]  # robot ticks by use
    making_way: Array  # (n,) ticks by identity: lost in moves and turns that were undone


def figures_of(run: WatchedRun) -> RunFigures:
    """The metrics at the shown tick of a run; call it in the player's thread."""
    shown = run.shown
    world = shown.world
    by_identity = world.robots.at_index
    active = executed_ticks(world)[by_identity, 1:].sum((1, 2)) / max(1, shown.tick)
    operations = world.tally.operations[by_identity][:, OPERATION_STATES].sum((1, 2))
    starved = np.sort(world.robots.identity[starved_robots(world)])
    jam = largest_jam(world, run.floor_plan)
    lost = shown.observation.lost_ticks_by_cell[:, LOST_EVER]
    periods = tuple(run.periods())
    worst = slow_places(lost, run.floor_plan, run.resolved.place_names)
    station = saturated_station(run, shown.tick, periods)
    worst = (*station, *(one for one in worst if one.cell not in [at.cell for at in station]))
    figures = shown.tick, metrics_of(shown), operations, active
    uses, undone = uses_of_run(shown), uses_of_time(world).making_way[by_identity]
    return RunFigures(*figures, starved, jam, worst, periods, uses, undone)


def saturated_station(
    run: WatchedRun, tick: int, periods: tuple[Period, ...]
) -> tuple[SlowPlace, ...]:
    """The station that was saturated for longest of all resources up to a tick, if it is one."""
    if tick < LEAST_TICKS or not periods:
        return ()
    resource, share = longest_saturated(run.resolved, periods)
    places = run.resolved.place_names.items() if share else ()
    cells = [cell for cell, name in places if name == resource]
    place = f"{resource}, {run.floor_plan.xy(cells[0])}, saturated" if cells else ""
    return (SlowPlace(cells[0], 0, share, place, "of the run"),) if cells else ()


KEPT_EVERY: Final = 512  # ticks between two counts that are kept


class RecordedCells:
    """How long robots have been in each cell of a recording, up to any tick."""

    def __init__(self, header: dict[str, Any], frames: Any, tick_unit: float) -> None:
        """`frames`: automaton.recording.frames.StoredFrames; `tick_unit`: the size of a tick."""
        self.is_observed = "observed" in header
        self._header, self._frames, self._tick_unit = header, frames, tick_unit
        self._playback: Playback | None = None
        self._ticks = np.zeros(0, np.int64)
        self._kept: dict[int, Array] = {}  # counts at some ticks, from which going back begins

    def until(self, tick: int) -> Array:
        """(C,) float64: robot time in each cell up to a tick, or to the end, in the unit of a tick."""
        if self._playback is None:
            self._playback = Playback(self._header, self._frames)
            cells = self._playback.simulation.world.grid.cell_flags.size
            self._ticks = np.zeros(cells, np.int64)
            self._kept = {0: self._ticks.copy()}
        if tick < self._playback.tick:
            nearest = tick - tick % KEPT_EVERY
            self._playback.go_to(nearest)
            self._ticks = self._kept[nearest].copy()
        while self._playback.tick < min(tick, self._frames.last_tick):
            self._playback.go_to(self._playback.tick + 1)
            cell = self._playback.simulation.world.robots.cell
            np.add.at(self._ticks, cell[cell != NIL], 1)
            if self._playback.tick % KEPT_EVERY == 0:
                self._kept.setdefault(self._playback.tick, self._ticks.copy())
        return self._ticks * self._tick_unit


class TimeComparison:
    """Two recordings side by side; where one was observed, the real one minus the simulated one."""

    def __init__(self, one: RecordedCells, other: RecordedCells) -> None:
        is_swapped = other.is_observed and not one.is_observed
        self._real, self._simulated = (other, one) if is_swapped else (one, other)

    def time_difference(self, tick: int) -> Array:
        """(C,) int32: robot time spent in each cell of one run, minus that of the other."""
        difference = self._real.until(tick) - self._simulated.until(tick)
        rounded: Array = np.rint(difference).astype(np.int32)
        return rounded


class LongTick(NamedTuple):
    """A tick that is being computed."""

    tick: int
    seconds: float  # since its start
    waited: bool  # a request waits for its end


class Overlays:
    """The latest numbers of a layer for one run."""

    def __init__(self) -> None:
        self._of: tuple[Simulation, int, int, str] | None = None  # run, tick, robot and layer
        self._field: Array | None = None
        self._next = -math.inf  # earliest time of the next computation during playback

    def laid_over(
        self,
        snapshot: Snapshot,
        simulation: Simulation,
        name: str,
        playing: bool,
        comparison: TimeComparison | None = None,
    ) -> Snapshot:
        """The snapshot with the numbers of a layer; `comparison`: of two recordings.

        During playback the numbers may be older: a slow layer computes them with pauses of at least
        `pause_s`.
        """
        layer = layer_named(name)
        now = (simulation, snapshot.tick, snapshot.selected, name)
        began = time.monotonic()
        old = self._of is not None and self._of[2:] == now[2:] and began < self._next
        if self._of != now and not (playing and old):
            self._of, self._field = now, layer.numbers(simulation, snapshot.selected)
            if layer.compares and comparison is not None:
                self._field = comparison.time_difference(snapshot.tick)
            ended = time.monotonic()
            pause = max(layer.pause_s, OVERLAY_TIME_RATIO * (ended - began))
            self._next = ended + (pause if layer.pause_s else 0.0)
        if layer.arrows:
            return replace(snapshot, flow=self._field)
        return replace(snapshot, heat=self._field)


class Trails:
    """The cells that each robot of one run passed through last.

    The driven part of a robot's present route is always known, even after skipping or rewinding.
    Cells before this route come from previously shown states.
    """

    def __init__(self) -> None:
        self._past: DrivenCells | None = None

    def at(self, simulation: Simulation) -> Array:
        """(n, TRAIL_CELLS) int32 by identity, the latest cell first, padded with NIL."""
        past, tick, robots = self._past, simulation.tick, len(simulation.world.robots.cell)
        if past is not None and past.tick == tick and len(past.steps) == robots:
            return past.cells
        position, steps, cells = _driven(simulation)
        if past is not None and 0 < tick - past.tick <= MAX_GAP_TICKS:
            cells = _with_older(position, cells, steps, past)
        self._past = DrivenCells(tick, position, steps, cells)
        return cells


class DrivenCells(NamedTuple):
    """Trails and positions of all robots at a tick."""

    tick: int
    position: Array  # (n,) present cell, or the one being entered
    steps: Array  # (n,) steps driven on the route
    cells: Array  # (n, TRAIL_CELLS)


def _driven(simulation: Simulation) -> tuple[Array, Array, Array]:
    """Positions of robots, steps driven on their routes, and the cells of the last steps."""
    robots, offset = simulation.world.robots, simulation.world.grid.offset
    i = robots.at_index
    position = np.where(robots.claim[i] == NIL, robots.cell[i], robots.claim[i])
    steps = np.where(position == NIL, 0, robots.route_index[i])
    at = steps[:, None] - 1 - np.arange(TRAIL_CELLS)
    back = offset[robots.route[i[:, None], np.maximum(at, 0)]]
    cells = position[:, None] - np.cumsum(back, axis=1)
    return position, steps, np.where(at >= 0, cells, NIL).astype(np.int32)


def _with_older(position: Array, cells: Array, steps: Array, past: DrivenCells) -> Array:
    """Trails, extended by earlier ones before the start of the present route."""
    before = np.concatenate((past.position[:, None], past.cells), axis=1)
    now = np.concatenate((position[:, None], cells), axis=1)
    on_route = np.minimum(steps, TRAIL_CELLS)
    since = np.clip(steps - past.steps, 0, TRAIL_CELLS)
    same = (steps >= past.steps) & (_of(now, since) == past.position)  # still on the same route
    stood = _of(now, on_route) == past.position  # its new route began there
    first = np.where(same, 1 + np.minimum(past.steps, TRAIL_CELLS), stood)
    at = first[:, None] + np.arange(TRAIL_CELLS) - on_route[:, None]
    older = np.take_along_axis(before, np.clip(at, 0, TRAIL_CELLS), axis=1)
    known = (np.arange(TRAIL_CELLS) >= on_route[:, None]) & (at <= TRAIL_CELLS)
    return np.where(known, older, cells)


def _of(rows: Array, columns: Array) -> Array:
    """One value of each row."""
    values: Array = np.take_along_axis(rows, columns[:, None], axis=1)[:, 0]
    return values
