"""The viewer on a large fleet, in its own process for the benchmark and the tests.

    python -m tui.bench.fleet_viewer '{"width": 200, "height": 57, "robots": 1000, "notes": "FILE"}'
    python -m tui.bench.fleet_viewer '{"right_of_way": "pibt", "robots": 10000, "notes": "FILE"}'

The fleet walks at random, or plans in the aisles of the steering benchmark. Once it exists, the first
line of `notes` is the native id of the thread that computes it, the second line the tick.
"""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from automaton.bench.steering_speed import BUSY_CROWD, busy_fleet
from automaton.floor.floor_plan import WALL
from automaton.history.watched_run import WatchedRun
from automaton.world.resolve import Resolved, resolve
from tui.bench.viewer_speed import Walk, walkers
from tui.playback.player import NORMAL_TICKS_PER_S
from tui.playback.run_source import Opening, live
from tui.terminal.options import Options
from tui.viewer.app import Viewer

NOTES_S = 0.2  # between two notes of the tick


def main(argument: str) -> int:
    """Show the fleet until q is pressed."""
    wanted = json.loads(argument)
    fps = wanted.get("fps", 30)
    per_second = wanted.get("ticks", fps)  # by default one tick per frame
    speed = math.inf if per_second is None else per_second / NORMAL_TICKS_PER_S
    options = Options(read_only=True, fps=fps, speed=speed)
    viewer = Viewer(planning(wanted) if "right_of_way" in wanted else walking(wanted), options)
    viewer.call_later(lambda: begin(viewer, wanted))
    viewer.run()
    viewer.session.close()
    return 0


def walking(wanted: dict[str, Any]) -> Opening:
    """A fleet without decisions."""
    resolved = walkers(wanted["width"], wanted["height"], wanted["robots"])

    def start() -> list[WatchedRun]:
        return [Walk(resolved)]

    return Opening(("walk",), (resolved,), True, start)


def planning(wanted: dict[str, Any]) -> Opening:
    """A fleet with orders, allocation and right of way, without a recording file."""
    return live(
        resolve(busy_fleet(wanted["right_of_way"], BUSY_CROWD._replace(robots=wanted["robots"]))),
        None,
    )


def begin(viewer: Viewer, wanted: dict[str, Any]) -> None:
    """Wait for the run; then set up the requested view, and write the notes."""
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
    """Show one character per cell, centred on a wall where a cursor is visible."""
    kind, camera = resolved.floor_plan.kind, viewer.session.pictures.camera
    rows, columns = np.nonzero(kind == WALL)
    middle = np.argmin(abs(rows - kind.shape[0] // 2) + abs(columns - kind.shape[1] // 2))
    viewer.session.pictures.fitted = False
    camera.one_to_one()
    camera.centre_on(int(rows[middle]) * kind.shape[1] + int(columns[middle]))
    viewer.session.changed()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
