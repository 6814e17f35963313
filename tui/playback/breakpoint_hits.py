"""Where breakpoints stop the clock: at the first tick at which one begins to hold in any run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from automaton.engine.state import Array
from automaton.history.breakpoints import Breakpoint
from automaton.history.watched_run import Run

RUN_LETTERS = "AB"  # of two runs beside each other
Held = list[list[Array]]  # of each run, for each breakpoint: the robots that it holds for


class Hit(NamedTuple):
    """A breakpoint that has begun to hold."""

    text: str
    side: int  # of the run
    robots: tuple[int, ...]  # for which it did not hold a tick before


def held_by(points: Sequence[Breakpoint], runs: Sequence[Run]) -> Held:
    """What holds at the ticks that the runs show."""
    return [[point.test(run.shown, run.floor_plan) for point in points] for run in runs]


def begun(points: Sequence[Breakpoint], before: Held, now: Held) -> list[Hit]:
    """What holds now and did not a tick before."""
    hits = []
    for side, (old, new) in enumerate(zip(before, now, strict=True)):
        for point, was, is_ in zip(points, old, new, strict=True):
            fresh = np.setdiff1d(is_, was)
            if len(fresh):
                hits.append(Hit(point.text, side, tuple(int(robot) for robot in fresh)))
    return hits


def reason(hits: Sequence[Hit], runs: int) -> str:
    """Why the clock stopped; with two runs it says in which."""
    return "; ".join(_hit_words(hit, runs) for hit in hits)


def _hit_words(hit: Hit, runs: int) -> str:
    where = f"run {RUN_LETTERS[hit.side]}, " if runs > 1 else ""
    others = " and others" if len(hit.robots) > 1 else ""
    return f"{hit.text}: {where}robot {hit.robots[0]}{others}"
