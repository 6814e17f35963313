"""Whether a trip waits behind an idle robot: a check of progress while a run is observed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from automaton.engine.observation import CAUSE_IDLE_AHEAD, CAUSE_STATION_QUEUE
from automaton.engine.state import GOAL_NONE, NIL, STATUS_UP
from automaton.runs.simulation import Simulation

STEP = 16  # ticks between two looks
PATIENCE = 200  # ticks for which a trip may wait behind one idle robot that stays where it is


def run_to_end(run: Simulation, patience: int = PATIENCE) -> list[str]:
    """Run to the end; a phrase for each wait of a robot with an order behind an idle one.

    The run must be observed. In a queue of a station the cause is the queue, so its blockers count, too.
    """
    since: dict[int, tuple[tuple[int, int], int]] = {}
    found = []
    limit = run.resolved.scenario.stop.max_duration
    while not run.finished and run.tick < limit:
        run.run(run.tick + STEP)
        now = dict(waits_behind_idle(run))
        since = {
            robot: (wait, since[robot][1] if since.get(robot, (None,))[0] == wait else run.tick)
            for robot, wait in now.items()
        }
        for robot, (wait, tick) in since.items():
            if patience <= run.tick - tick < patience + STEP:
                found.append(f"robot {robot} waits for idle robot {wait[0]} since tick {tick}")
    return found


def waits_behind_idle(run: Simulation) -> Iterator[tuple[int, tuple[int, int]]]:
    """Robot, and the idle robot that keeps it with that one's cell, of each trip that waits now."""
    robots, observation = run.world.robots, run.observation
    is_kept = np.isin(observation.cause, (CAUSE_IDLE_AHEAD, CAUSE_STATION_QUEUE))
    for i in np.flatnonzero(is_kept & (robots.order != NIL) & (observation.blocker != NIL)):
        k = robots.at_index[observation.blocker[i]]
        if robots.goal_type[k] == GOAL_NONE and robots.status[k] == STATUS_UP:
            yield int(robots.identity[i]), (int(robots.identity[k]), int(robots.cell[k]))
