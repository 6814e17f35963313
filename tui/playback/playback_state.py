"""What the player shows: a moment of one or two runs, how it goes on, and the metrics so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from automaton.engine.state import Array
from automaton.history.divergence import Divergence
from automaton.history.snapshot import Snapshot
from automaton.history.watched_run import Run
from automaton.runs.metrics import OPERATIONS, executed_ticks, metrics_of
from automaton.runs.progress import Jam, largest_jam, starved_robots


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
