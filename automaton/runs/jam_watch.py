"""Report jams while a run goes on, once each, between two pauses of the loop."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Final

from automaton.engine.robot_states import STATUS_DEPLETED
from automaton.engine.state import NIL
from automaton.runs.progress import Jam, jams, starved_ticks, stuck_robots
from automaton.runs.run_diagnosis import describe_jam
from automaton.runs.simulation import RECORD_TICKS, Simulation

LOOK_TICKS: Final = RECORD_TICKS  # ticks between two looks; pauses there change no recording


class JamWatch:
    """Call `on_jam` with the tick and the jam as soon as one is seen.

    A jam is seen when its robots have finished nothing for `starved_ticks`, 500 at least, and at most
    LOOK_TICKS later. It stays the same jam as long as one of its robots makes no progress. As long as a
    robot is down on the floor, and for as many ticks after, others wait behind it: no jam is reported.
    """

    def __init__(self, on_jam: Callable[[int, Jam], None]) -> None:
        self._on_jam = on_jam
        self._known: set[int] = set()  # robots of jams that have been reported
        self._down_at = NIL  # the last look at which a robot was down on the floor
        self._ticks = 0  # without progress, after which a robot counts

    def run(self, simulation: Simulation, until: int, advance: Callable[[int], None]) -> None:
        """Carry a run on to a tick, or to its end, with the looks that are due on the way."""
        while simulation.tick < until and not simulation.finished:
            advance(min(until, self._next_look(simulation)))
            self._look(simulation)

    def _next_look(self, simulation: Simulation) -> int:
        """Return the next multiple of LOOK_TICKS at which a robot may be without progress for long."""
        self._ticks = self._ticks or starved_ticks(simulation.world)
        return -(-max(self._ticks, simulation.tick + 1) // LOOK_TICKS) * LOOK_TICKS

    def _look(self, simulation: Simulation) -> None:
        world = simulation.world
        if ((world.robots.status >= STATUS_DEPLETED) & (world.robots.cell != NIL)).any():
            self._down_at = simulation.tick
        if self._down_at != NIL and simulation.tick - self._down_at < self._ticks:
            return
        stored = stuck_robots(world, self._ticks)
        starved = set(world.robots.identity[stored].tolist())
        self._known &= starved
        for jam in jams(world, simulation.resolved.floor_plan) if starved else ():
            if not self._known & set(jam.robots):
                self._on_jam(simulation.tick, jam)
            self._known |= set(jam.robots)


def note_jam(where: str, tick: int, jam: Jam) -> None:
    """Print on stderr that a run has jammed; `where`: the scenario, and which run of a study."""
    begin = "\r\x1b[K" if sys.stderr.isatty() else ""  # in the place of a line of progress
    sys.stdout.flush()  # keeps the order where both streams meet
    text = f"{begin}automaton: {where}: tick {tick:,}: {describe_jam(jam)[0]}\n"
    print(text, end="", file=sys.stderr, flush=True)
