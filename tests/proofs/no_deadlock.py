"""Whether steered fleets ever stand still on random floors where no rule makes them: run by hand.

    nice python tests/proofs/no_deadlock.py --right-of-way pibt --robot-ticks 1e6 --seed 1 --record 0

Floors, rules of following, speeds, breakdowns, delays and batteries are drawn (helpers/flow_floors.py).
Found are wait cycles that outlast the strategy's patience, jams, in which no robot has finished anything
for long, and illegal answers. The first `--record` robot ticks are recorded, judged by the validator, and
the positions are counted again after each tick. A finding is named by its seed; `--only SEED` repeats it.
Exits with 1 if anything is found.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from flow_floors import RULES, drawn_fleet

from automaton.engine.state import ACTION_BLOCKED, FOLLOWING_CONVOY, NIL, STATUS_EXHAUSTED
from automaton.errors import InputError
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.progress import starved_robots, starved_ticks
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolved import Resolved

TICKS = 4000  # of a run
LOOK = 50  # ticks between two looks
PATIENCE = 64


class Recount:
    """Counts after each tick how many robots are in a cell, and how far each has come."""

    def __init__(self, run: Simulation) -> None:
        world = run.world
        self.world, self.wrong = world, ""
        self.capacity = world.grid.cell_flags >> 5 & 3
        self.step = set(np.asarray(world.grid.offset[:4]).tolist())
        self.convoy = int(world.rules.following) == FOLLOWING_CONVOY
        self.before = world.robots.cell.copy()

    def tick(self) -> None:
        robots, before = self.world.robots, self.before
        cell, claim = robots.cell, np.where(robots.claim == robots.cell, NIL, robots.claim)
        self.before = cell.copy()
        stays = (cell != NIL) & ((claim == NIL) | (not self.convoy))
        leaving = cell[(cell != NIL) & (claim != NIL)]
        held = np.concatenate((cell[stays], claim[claim != NIL]))
        count = np.bincount(held, minlength=len(self.capacity))
        if ((count > self.capacity) & (self.capacity > 0)).any():
            self.wrong = f"tick {self.world.clock.tick}: a cell holds too many robots"
        left = np.bincount(leaving, minlength=len(self.capacity))
        if self.convoy and ((left > self.capacity) & (self.capacity > 0)).any():
            self.wrong = f"tick {self.world.clock.tick}: too many robots leave a cell"
        moved = (before != NIL) & (cell != NIL) & (before != cell)
        if not set((cell[moved] - before[moved]).tolist()) <= self.step:
            self.wrong = f"tick {self.world.clock.tick}: a robot jumps"


def look(run: Simulation) -> str:
    """What is wrong with a run now, or an empty string."""
    world, tick = run.world, run.tick
    longest = int(world.rules.duration.max())
    if delays := run.resolved.scenario.faults.delays:
        longest += delays.ticks.most
    age = int(run.observation.wait_cycle_ticks.max())
    if age > 2 * PATIENCE + 8 * longest:  # it had the time to break itself
        return f"tick {tick}: a wait cycle of {age} ticks"
    up = (world.robots.status <= STATUS_EXHAUSTED) & (world.robots.cell != NIL)
    idle = tick - int(world.tally.progress[up].max(initial=tick if not up.any() else 0))
    if idle >= starved_ticks(world):
        return f"tick {tick}: no robot has finished anything for {idle} ticks"
    return "an answer is illegal" if world.tally.illegal.any() else ""


def trial(resolved: Resolved, record: bool) -> tuple[str, Counter[str]]:
    """Run one fleet; return what is wrong, and figures."""
    recorder = MemoryRecorder(resolved) if record else None
    run = Simulation(resolved, on_record=recorder, on_observe=Simulation.empty_observation)
    recount = Recount(run)
    wrong, end = "", resolved.scenario.stop.max_duration
    while run.tick < end and not wrong:
        run.run(until=run.tick + (1 if record else LOOK))
        if record:
            recount.tick()
        if run.tick % LOOK == 0:
            wrong = look(run)
    if recorder is not None:
        wrong = wrong or recount.wrong
        violations = validate_stored(recorder.recording()).violations
        wrong = wrong or (str(violations[0]) if violations else "")
    world = run.world
    long_moves = int(world.rules.duration.max(axis=0)[1]) > 1
    return wrong, Counter(
        robot_ticks=run.tick * resolved.scenario.fleet.robots,
        runs=1,
        visits=int(world.tally.visits.sum()),
        starved=len(starved_robots(world)),
        refused=int(world.tally.ticks[:, ACTION_BLOCKED].sum()) if long_moves else 0,
        resolved=run.counted.get("deadlocks_resolved", 0),
        down=int(world.tally.failures[:, :2].sum()),
        **{f"{resolved.scenario.world.following}": 1},
    )


def trials(
    right_of_way: str,
    robot_ticks: float,
    seed: int,
    record: float = 0,
    following: str | None = None,
) -> tuple[list[str], Counter[str]]:
    """Run fleets until so many robot ticks are done: findings, and the sums of their figures."""
    findings: list[str] = []
    figures: Counter[str] = Counter()
    while figures["robot_ticks"] < robot_ticks:
        try:
            resolved = drawn_fleet(seed, right_of_way, TICKS, following)
        except InputError as error:
            figures[f"refused: {str(error)[:50]}"] += 1
            resolved = None
        if resolved is not None:
            wrong, more = trial(resolved, figures["robot_ticks"] < record)
            figures += more
            if wrong:
                findings.append(f"seed {seed} ({resolved.scenario.world.following}): {wrong}")
                print(findings[-1], flush=True)
        seed += 1
    return findings, figures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--right-of-way", choices=("pibt", "epibt"), default="pibt")
    parser.add_argument("--robot-ticks", type=float, default=1e6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--record", type=float, default=0)
    parser.add_argument("--only", type=int)
    parser.add_argument("--following", choices=RULES)
    options = parser.parse_args()
    begun = time.monotonic()
    amount, seed = (1, options.only) if options.only else (options.robot_ticks, options.seed)
    findings, figures = trials(
        options.right_of_way, amount, seed, options.record, options.following
    )
    print(options.right_of_way, dict(figures), f"{time.monotonic() - begun:.0f} s", sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
