"""What robots report of themselves, period by period, as a recorded run is played again.

Each sample has the state after a tick, by identity, and what a state alone does not hold: the moves
that a robot has begun for its order, and the ticks in which its move and its operation began.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.engine.observation import COUNT_EVENTS, EVENT_ORDER_TAKEN
from automaton.engine.record_codes import (
    ACTION_MASK,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_SERVE,
    MOVE_EAST,
    MOVE_NORTH,
)
from automaton.engine.state import NIL, Array, World
from automaton.evidence.history.playback import Playback
from automaton.evidence.recording.frames import Content, Recording
from automaton.runs.simulation import Simulation

OPERATIONS: Final = (EXECUTED_PICK, EXECUTED_DROP, EXECUTED_SERVE)


class Sample(NamedTuple):
    """The state after a tick; arrays are by identity."""

    tick: int
    world: World
    stored: Array  # (n,) where each robot is stored
    moves: Array  # (n,) moves begun for the order at hand, that under way included
    moved: Array  # (n,) share of the move under way that is driven; 0 without one
    driving: Array  # (n,) bool: in a move, or at its end in this tick
    begun: Array  # (n,) tick in which the last pick, drop or stop began


class StateTrace:
    """A recording played again, in samples of which each is `period` ticks after the one before it."""

    def __init__(self, recording: Recording, period: int) -> None:
        self.recording = recording
        self.period = period
        robots = len(recording.header["robots"]["cell"])
        self._frame = 0  # first tick of the one whose ticks are counted
        # Begun up to each of its ticks, and before it.
        self._moves = np.zeros((1, robots), np.int64)
        self._begun = np.zeros((1, robots), np.int64)  # likewise the last tick of an operation
        self._set_out = np.zeros((1, robots), np.int64)  # and of a move
        self._before_order = np.zeros(robots, np.int64)  # moves begun when the order was taken
        self._playback = Playback(recording.header, recording.stored(), on_observe=self._observe)

    def __iter__(self) -> Iterator[Sample]:
        """Yield a sample at tick 0 and after each period. Raises InputError for an altered file."""
        for tick in range(0, self.recording.ticks + 1, self.period):
            self._playback.go_to(max(tick - 1, 0))
            before = self._in_move()
            self._playback.go_to(tick)
            yield self._sample(tick, before)

    def _observe(self, simulation: Simulation) -> None:
        """Note which orders were taken; what is played at a time lies within one frame."""
        content = self._playback.frames.ticks_with(simulation.tick)
        if content is not None and content["first"] != self._frame:
            self._count(content)
        observation = simulation.observation
        events = observation.events[: observation.count[COUNT_EVENTS]]
        for tick, _, robot, *_ in events[events[:, 1] == EVENT_ORDER_TAKEN].tolist():
            self._before_order[robot] = self._moves[tick - self._frame, robot]
        simulation.empty_observation()

    def _count(self, content: Content) -> None:
        """Count moves and note beginnings in the ticks of a frame; row 0 is the tick before it."""
        executed = content["executed"] & ACTION_MASK
        ticks = content["first"] + np.arange(len(executed))[:, None]
        is_move = (executed >= MOVE_EAST) & (executed <= MOVE_NORTH)
        self._frame = content["first"]
        self._moves = np.cumsum(np.concatenate((self._moves[-1:], is_move)), axis=0)
        self._set_out = _latest(self._set_out, is_move, ticks)
        self._begun = _latest(self._begun, np.isin(executed, OPERATIONS), ticks)

    def _in_move(self) -> Array:
        """(n,) bool: which robots are in a move after the tick that is shown."""
        robots = self._playback.simulation.world.robots
        in_move: Array = robots.claim[robots.at_index] != NIL
        return in_move

    def _sample(self, tick: int, before: Array) -> Sample:
        """`before`: (n,) which robots were in a move a tick ago."""
        world: Any = self._playback.simulation.world
        index = world.robots.at_index
        row = tick - self._frame + 1 if tick else 0
        robots, set_out = world.robots, self._set_out[row]
        busy, driven = robots.busy[index].astype(np.int64), tick - set_out + 1
        in_move = self._in_move()
        begins = (set_out > 0) & (set_out == tick)
        return Sample(
            tick=tick,
            world=world,
            stored=index,
            moves=self._moves[row] - self._before_order,
            moved=np.where(in_move, driven / (driven + busy), 0.0),
            driving=in_move | before | begins,
            begun=self._begun[row],
        )


def _latest(before: Array, happens: Array, ticks: Array) -> Array:
    """(T + 1, n) the last tick in which something happened; row 0 is that of `before`'s last row."""
    rows = np.concatenate((before[-1:], np.where(happens, ticks, 0)))
    latest: Array = np.maximum.accumulate(rows, axis=0)
    return latest
