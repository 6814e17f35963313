"""A run without end or decisions: the random-walk fleet of the bare step, to be watched."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from automaton.bench.measurement import open_floor, scene
from automaton.bench.step_speed import random_walk
from automaton.engine.state import CLOCK_TICK
from automaton.floor.cells import DIRECTION_VECTORS, FLOOR, WALL
from automaton.floor.floor_plan import make_floor_plan
from automaton.history.playback import Keyframes
from automaton.history.watched_run import Run
from automaton.recording.frames import StoredFrames
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved


class Walk(Run):
    """Every robot wants to move at random in every tick. Its past is not kept."""

    def __init__(self, resolved: Resolved) -> None:
        super().__init__({}, StoredFrames([]), resolved)
        self._walkers = Simulation(resolved, on_observe=self.event_history)
        self._walkers.world.robots.parked[:] = 0
        self._keyframes = Keyframes(self._walkers.world, self._walkers.observation, budget=0)

    @property
    def live(self) -> bool:
        return True

    @property
    def leading_simulation(self) -> Simulation:
        return self._walkers

    @property
    def head(self) -> int:
        return self._walkers.tick

    @property
    def end(self) -> int | None:
        return None

    @property
    def keyframes(self) -> Keyframes:
        return self._keyframes

    def _compute(self, until: int) -> None:
        world = self._walkers.world
        random_walk(world, self._walkers.tick + 1, until + 1)
        world.clock[CLOCK_TICK] = until


def walkers(width: int, height: int, robots: int) -> Resolved:
    """A free floor with so many robots, and a pillar in the middle on which a cursor is seen."""
    free = open_floor(width, height)
    kind, leave = free.kind.copy(), free.exits.copy()
    # Two rows: a wall with nothing but walls around it is not drawn.
    rows, columns = slice(height // 2, height // 2 + 2), slice(width // 2 - 1, width // 2 + 4)
    kind[rows, columns], leave[rows, columns] = WALL, 0
    leave &= exits_into(kind == FLOOR)
    return scene(make_floor_plan(kind, leave), robots)


def exits_into(drivable: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(h, w) the exits that lead to a drivable cell."""
    found = np.zeros(drivable.shape, np.uint8)
    for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
        found |= np.roll(drivable, (-dy, -dx), (0, 1)).astype(np.uint8) << np.uint8(direction)
    return found
