"""Keyframes in memory: states of a run to which one can go back.

A state is kept as what differs from the state at tick 0, so that on a large floor only the cells
count that was reached.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import Final, NamedTuple

import numpy as np

from automaton.engine.observation import Observation
from automaton.engine.state import CLOCK_TICK, Array, World
from automaton.errors import InputError
from automaton.runs.state_copy import arrays_of_run, copy_clock, ragged_arrays, used_entries

KEYFRAME_BYTES: Final = 256 * 1024 * 1024  # bytes of all keyframes
OBJECT_BYTES: Final = 200  # of an array besides its values: four fifths of a small fleet's keyframe


class Delta(NamedTuple):
    """An array as its difference from another, or itself if that is shorter."""

    where: Array | None  # flat indices; None: values are all of it
    values: Array


UNCHANGED: Final = Delta(np.zeros(0, np.int32), np.zeros(0, np.int32))  # one for all arrays


class Keyframe(NamedTuple):
    """The state after a tick."""

    tick: int
    arrays: dict[str, Delta]
    routes: Array  # the steps of all routes, one after another
    plans: Array  # likewise the orders of all plans
    clock: Array

    @property
    def nbytes(self) -> int:
        deltas = (delta for delta in self.arrays.values() if delta is not UNCHANGED)
        parts = [a for delta in deltas for a in delta if a is not None]
        return sum(
            part.nbytes + OBJECT_BYTES for part in (*parts, self.routes, self.plans, self.clock)
        )


class Keyframes:
    """The keyframes of one run, in the order of their ticks; the first is that of tick 0."""

    def __init__(
        self, world: World, observation: Observation, budget: int = KEYFRAME_BYTES
    ) -> None:
        self.budget = budget
        self.ticks: list[int] = []  # those that can be gone back to at once, ascending
        arrays = arrays_of_run(world, observation)
        self._base = {name: array.copy() for name, array in arrays.items()}
        self._frames: list[Keyframe] = []
        self._bytes = 0
        self.keep(world, observation)

    def before(self, tick: int) -> int:
        """The last of the ticks up to this one. Raises InputError if there is none any more."""
        place = bisect_right(self.ticks, tick)
        if not place:
            raise InputError(f"what happened before tick {self.ticks[0]:,} is not kept any more")
        return self.ticks[place - 1]

    def keep(self, world: World, observation: Observation) -> None:
        """Keep the state; when they outgrow the budget, those go that leave the smallest gaps."""
        tick = int(world.clock[CLOCK_TICK])
        if self.ticks and tick <= self.ticks[-1]:
            return
        arrays = {
            name: _delta(array, self._base[name])
            for name, array in arrays_of_run(world, observation).items()
        }
        routes, plans = (
            rows.reshape(-1)[used_entries(rows, used)] for rows, used in ragged_arrays(world)
        )
        frame = Keyframe(tick, arrays, routes, plans, world.clock.copy())
        self._frames.append(frame)
        self.ticks.append(tick)
        self._bytes += frame.nbytes
        while self._bytes > self.budget and len(self._frames) > 2:
            ticks = np.array(self.ticks)
            self._drop(1 + int(np.argmin(ticks[2:] - ticks[:-2])))

    def forget_until(self, tick: int) -> None:
        """States before this tick are of no use any more; the newest one stays."""
        while len(self.ticks) > 1 and self.ticks[0] < tick:
            self._drop(0)

    def _drop(self, index: int) -> None:
        self._bytes -= self._frames.pop(index).nbytes
        del self.ticks[index]

    def fits(self, tick: int, world: World, observation: Observation) -> bool:
        """Whether that keyframe has all arrays of a world: not if a branch there has other zones."""
        frame = self._at(tick)
        return all(
            array.shape == self._shape(frame, name)
            for name, array in arrays_of_run(world, observation).items()
        )

    def _at(self, tick: int) -> Keyframe:
        return self._frames[bisect_right(self.ticks, self.before(tick)) - 1]

    def _shape(self, frame: Keyframe, name: str) -> tuple[int, ...]:
        where, values = frame.arrays[name]
        shape: tuple[int, ...] = (values if where is None else self._base[name]).shape
        return shape

    def restore(self, tick: int, world: World, observation: Observation) -> int:
        """Bring a world to the last keyframe at or before `tick`; returns that keyframe's tick.

        What the keyframe has otherwise (`fits`) stays as it is.
        """
        frame = self._at(tick)
        for name, array in arrays_of_run(world, observation).items():
            where, values = frame.arrays[name]
            if array.shape != self._shape(frame, name):
                continue
            if where is None:
                np.copyto(array, values)
            else:
                np.copyto(array, self._base[name])
                array.reshape(-1)[where] = values
        for (rows, used), values in zip(
            ragged_arrays(world), (frame.routes, frame.plans), strict=True
        ):
            rows.reshape(-1)[used_entries(rows, used)] = values
        copy_clock(world.clock, frame.clock)
        return frame.tick


def _delta(array: Array, base: Array) -> Delta:
    if array.shape != base.shape:  # a branch has other zones
        return Delta(None, array.copy())
    where = np.flatnonzero(array.reshape(-1) != base.reshape(-1)).astype(np.int32)
    if not where.size:
        return UNCHANGED
    values = array.reshape(-1)[where]
    if where.nbytes + values.nbytes < array.nbytes:
        return Delta(where, values)
    return Delta(None, array.copy())
