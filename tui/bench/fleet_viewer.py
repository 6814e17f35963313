"""A run without end or decisions: the random-walk fleet of the bare step, to be watched."""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from automaton.bench.measurement import open_floor, scene
from automaton.bench.random_walk import random_walk
from automaton.bench.steering_speed import BUSY_CROWD, busy_fleet
from automaton.engine.state import CLOCK_TICK
from automaton.floor.cells import DIRECTION_VECTORS, FLOOR, WALL
from automaton.floor.floor_plan import make_floor_plan
from automaton.history.playback import Keyframes
from automaton.history.watched_run import Run
from automaton.recording.frames import StoredFrames
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, resolve
from tui.playback.player import TICKS_PER_S
from tui.playback.run_source import Opening, live
from tui.terminal.options import Options
from tui.viewer.app import Viewer


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


# The viewer on a large fleet, in a process of its own for the benchmark and the tests.
#
# python -m tui.bench.fleet_viewer '{"width": 200, "height": 57, "robots": 1000, "notes": "FILE"}'
# python -m tui.bench.fleet_viewer '{"right_of_way": "pibt", "robots": 10000, "notes": "FILE"}'
#
# The fleet walks at random, or plans in the aisles of the benchmark of steering. Once it is there,
# the first line of `notes` is the native id of the thread that computes it, the second one the tick.


NOTES_S = 0.2  # between two notes of the tick


def main(argument: str) -> int:
    """Show the fleet until somebody presses q."""
    wanted = json.loads(argument)
    fps = wanted.get("fps", 30)
    per_second = wanted.get("ticks", fps)  # one tick a frame unless it says otherwise
    speed = math.inf if per_second is None else per_second / TICKS_PER_S
    options = Options(read_only=True, fps=fps, speed=speed)
    viewer = Viewer(planning(wanted) if "right_of_way" in wanted else walking(wanted), options)
    viewer.call_later(lambda: begin(viewer, wanted))
    viewer.run()
    viewer.session.close()
    return 0


def walking(wanted: dict[str, Any]) -> Opening:
    """A fleet without decisions."""
    resolved = walkers(wanted["width"], wanted["height"], wanted["robots"])

    def start() -> list[Run]:
        return [Walk(resolved)]

    return Opening(("walk",), (resolved,), True, start)


def planning(wanted: dict[str, Any]) -> Opening:
    """A fleet with orders, allocation and right of way; not recorded in a file."""
    return live(
        resolve(busy_fleet(wanted["right_of_way"], BUSY_CROWD._replace(robots=wanted["robots"]))),
        None,
    )


def begin(viewer: Viewer, wanted: dict[str, Any]) -> None:
    """Wait for the run; then look at what was asked for, and keep the notes."""
    player = viewer.session.player
    if player is None:
        viewer.set_timer(0.05, lambda: begin(viewer, wanted))
        return
    if not wanted.get("panels", True):
        viewer.panels.show("off")
    if "right_of_way" in wanted:
        look_at_a_wall(viewer, viewer.session.opening.resolved[0])
    path = Path(wanted["notes"])

    def note() -> None:
        fresh = path.with_suffix(".new")
        fresh.write_text(f"{player.thread}\n{player.latest().tick}\n")
        os.replace(fresh, path)

    note()
    viewer.set_interval(NOTES_S, note)


def look_at_a_wall(viewer: Viewer, resolved: Resolved) -> None:
    """One character a cell, and in the middle a wall, on which a cursor is seen."""
    kind, camera = resolved.floor_plan.kind, viewer.session.pictures.camera
    rows, columns = np.nonzero(kind == WALL)
    middle = np.argmin(abs(rows - kind.shape[0] // 2) + abs(columns - kind.shape[1] // 2))
    viewer.session.pictures.fitted = False
    camera.one_to_one()
    camera.centre_on(int(rows[middle]) * kind.shape[1] + int(columns[middle]))
    viewer.session.changed()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
