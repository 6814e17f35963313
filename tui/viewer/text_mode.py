"""A run as plain text, for pipes, dumb terminals and screen readers: metrics, then the report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from automaton.build.resolve import Resolved
from automaton.engine.state import NIL
from automaton.evidence.history.divergence import first_difference
from automaton.evidence.history.fleet_summary import summary_of
from automaton.evidence.history.watched_run import Run
from automaton.evidence.recording.header import changed, resolved_of
from automaton.evidence.recording.titles import branches_of
from automaton.runs.asked_orders import asked_orders
from automaton.runs.headless import Outcome, operations, orders_exhausted, record_work
from automaton.runs.metrics import metrics_by_robot, metrics_by_type, metrics_of
from automaton.runs.progress import largest_jam
from automaton.runs.run_diagnosis import describe_unfinished_run, find_wait_cycles, stalled_robots
from automaton.runs.run_report import print_report
from automaton.runs.station_metrics import metrics_by_station
from tui.playback.run_source import Opening

PROGRESS_SLICE_S: Final = 0.5


def run_in_text_mode(opening: Opening) -> int:
    """Run to the end; returns 0, or 1 for a live run that did not finish."""
    runs = opening.begin()
    outcomes = []
    try:
        for title, run in zip(opening.titles, runs, strict=True):
            print(title, flush=True)
            outcomes.append(_run_with_progress(run))
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
        print_report(_scenario_at_end(run), outcome)
    return 0 if not opening.live or outcomes[0].finished else 1


def _run_with_progress(run: Run) -> Outcome:
    """Run it to its end, and say some words at ever longer intervals."""
    last_worked = np.zeros(run.resolved.scenario.fleet.robots, np.int64)
    worked = operations(run.leading_simulation)
    for tick in _milestones():
        _go_to(run, tick)
        worked = record_work(run.leading_simulation, worked, last_worked)
        if run.tick < tick:
            return _outcome(run, last_worked)
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
        run.show(tick, PROGRESS_SLICE_S)


def _figures(run: Run) -> str:
    now = summary_of(run.leading_simulation)
    parked = int(run.leading_simulation.world.robots.parked.sum())
    robots = f"{now.working:,} work, {now.waiting:,} wait, {parked:,} parked"
    return f"tick {run.tick:,}: {now.delivered:,} of {now.orders:,} orders delivered, {robots}"


def _scenario_at_end(run: Run) -> Resolved:
    """The scenario that held at the end."""
    if run.live:
        return run.resolved
    rules = run.frames.rules_at(run.tick)
    return resolved_of(changed(run.header, rules), with_strategies=False)


def _outcome(run: Run, last_worked: np.ndarray) -> Outcome:
    front = run.leading_simulation
    stop = _scenario_at_end(run).scenario.stop
    finished = front.finished or (stop.when == "never" and front.tick >= stop.max_duration)
    orders = asked_orders(front.world)
    return Outcome(
        finished=finished,
        ticks=front.tick,
        orders=len(orders.done),
        delivered=int((orders.done != NIL).sum()),
        digest=front.digest,
        wall_s=None,
        metrics=metrics_of(front),
        robots=metrics_by_robot(front),
        diagnosis="" if finished else describe_unfinished_run(front, last_worked),
        stopped=not finished and not run.live,
        circles=find_wait_cycles(front.world, stalled_robots(front, last_worked)),
        jam=largest_jam(front.world, front.resolved.floor_plan),
        ran_out=orders_exhausted(front),
        types=metrics_by_type(front),
        stations=metrics_by_station(front),
    )
