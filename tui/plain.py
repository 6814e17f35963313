"""A run as plain text, for pipes, dumb terminals and screen readers: metrics, then the report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from automaton.circles import circles
from automaton.headless import Outcome, note_work, operations, ran_out
from automaton.history.divergence import first_difference
from automaton.history.run import Run
from automaton.metrics import metrics_by_robot, metrics_by_type, metrics_of
from automaton.recording.header import changed, resolved_of
from automaton.run_report import print_report
from automaton.scenario.resolve import Resolved
from automaton.standstill import stuck, trouble
from automaton.world.state import ORDER_DELIVERED
from tui.opening import Opening
from tui.tally import tally_of
from tui.titles import branches_of

SLICE_S: Final = 0.5


def tell(opening: Opening) -> int:
    """Run to the end; returns 0, or 1 for a live run that did not finish."""
    runs = opening.begin()
    outcomes = []
    try:
        for title, run in zip(opening.titles, runs, strict=True):
            print(title, flush=True)
            outcomes.append(_told(run))
    finally:
        for run in runs:
            run.close()
    if opening.comparing:
        print(f"\n{first_difference(*opening.recordings).text.partition(';')[0]}")
    for title, run, outcome in zip(opening.titles, runs, outcomes, strict=True):
        print()
        if opening.comparing:
            print(title)
        for branch in branches_of(run.frames):
            print(f"branched off {branch}")
        print_report(_held(run), outcome)
    return 0 if not opening.live or outcomes[0].finished else 1


def _told(run: Run) -> Outcome:
    """Run it to its end, and say some words at ever longer intervals."""
    still = np.zeros(run.resolved.scenario.fleet.robots, np.int64)
    worked = operations(run.front)
    for tick in _milestones():
        _go_to(run, tick)
        worked = note_work(run.front, worked, still)
        if run.tick < tick:
            return _outcome(run, still)
        print(_figures(run), flush=True)
    raise AssertionError("milestones never end")


def _milestones() -> Iterator[int]:
    size = 100
    while True:
        yield from (size, 2 * size, 5 * size)
        size *= 10


def _go_to(run: Run, tick: int) -> None:
    before = -1
    while before < run.tick < tick:
        before = run.tick
        run.show(tick, SLICE_S)


def _figures(run: Run) -> str:
    now = tally_of(run.front)
    parked = int(run.front.world.robots.parked.sum())
    robots = f"{now.working:,} work, {now.waiting:,} wait, {parked:,} parked"
    return f"tick {run.tick:,}: {now.delivered:,} of {now.orders:,} orders delivered, {robots}"


def _held(run: Run) -> Resolved:
    """The scenario that held at the end."""
    if run.live:
        return run.resolved
    rules = run.frames.rules_at(run.tick)
    return resolved_of(changed(run.header, rules), with_strategies=False)


def _outcome(run: Run, still: np.ndarray) -> Outcome:
    front = run.front
    stop = _held(run).scenario.stop
    finished = front.finished or (stop.when == "never" and front.tick >= stop.max_duration)
    state = front.world.orders.state
    return Outcome(
        finished=finished,
        ticks=front.tick,
        orders=len(state),
        delivered=int((state == ORDER_DELIVERED).sum()),
        digest=front.digest,
        wall_s=None,
        metrics=metrics_of(front),
        robots=metrics_by_robot(front),
        trouble="" if finished else trouble(front, still),
        stopped=not finished and not run.live,
        circles=circles(front.world, stuck(front, still)),
        ran_out=ran_out(front),
        types=metrics_by_type(front),
    )
