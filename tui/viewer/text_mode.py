"""A run as plain text, for pipes, dumb terminals and screen readers.

It prints either progress at growing intervals and then the report, or sentences that describe the
events, the progress and the end of the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from automaton.history.divergence import first_difference
from automaton.history.fleet_summary import summary_of
from automaton.history.live_run import LiveDivergence, LiveRun
from automaton.history.narration import SENTENCES, Scope, kinds_named, narrate
from automaton.history.watched_run import WatchedRun
from automaton.recording.frames import changed, resolved_of
from automaton.recording.recording_reader import branches_of
from automaton.runs.headless import (
    Outcome,
    longest_deadlock,
    operations,
    orders_exhausted,
    record_work,
)
from automaton.runs.illegal_decisions import illegal_decisions
from automaton.runs.metrics import metrics_by_robot, metrics_by_type, metrics_of, uses_of_run
from automaton.runs.progress import asked_orders, largest_jam
from automaton.runs.run_diagnosis import describe_unfinished_run, find_wait_cycles, stalled_robots
from automaton.runs.run_report import print_report, sentences
from automaton.runs.task_metrics import (
    metrics_by_charger,
    metrics_by_class,
    metrics_by_priority,
    metrics_by_station,
)
from automaton.world.resolved import Resolved
from tui.playback.run_source import Opening
from tui.terminal.options import Options

PROGRESS_SLICE_S: Final = 0.5


def run_in_text_mode(opening: Opening) -> int:
    """Run to the end; returns 0, or 1 for a live run that did not finish."""
    runs = opening.begin()
    outcomes = []
    try:
        for title, run in zip(opening.titles, runs, strict=True):
            print(title, flush=True)
            outcomes.append(_run_with_progress(run))
        difference = difference_line(opening, runs) if opening.comparing else ""
    finally:
        for run in runs:
            run.close()
    if opening.comparing:
        print(f"\n{difference}")
    for title, run, outcome in zip(opening.titles, runs, outcomes, strict=True):
        print()
        if opening.comparing:
            print(title)
        for line in branch_lines(run):
            print(line)
        print_report(scenario_at_end(run), outcome)
    return exit_code(opening, outcomes)


def _run_with_progress(run: WatchedRun) -> Outcome:
    """Run to the end, and print progress at growing intervals."""
    last_worked = np.zeros(run.resolved.scenario.fleet.robots, np.int64)
    worked = operations(run.leading_simulation)
    for tick in milestones():
        _go_to(run, tick)
        worked = record_work(run.leading_simulation, worked, last_worked)
        if run.tick < tick:
            return outcome_of(run, last_worked)
        print(fleet_line(run), flush=True)
    raise AssertionError("milestones never end")


def _go_to(run: WatchedRun, tick: int) -> None:
    before = -1
    while before < run.tick < tick:
        before = run.tick
        run.show(tick, PROGRESS_SLICE_S)


def run_described(opening: Opening, options: Options) -> int:
    """Describe each run to its end; returns 0, or 1 for a live run that did not finish.

    Raises InputError for an unknown kind of sentence.
    """
    scope = Scope(kinds_named(options.only), options.sentences or SENTENCES, options.at or 0)
    runs = opening.begin()
    outcomes = []
    try:
        for title, run in zip(opening.titles, runs, strict=True):
            print(title, flush=True)
            outcomes.append(_described(run, scope))
            print("\n".join(sentences(scenario_at_end(run), outcomes[-1])), flush=True)
        if opening.comparing:
            print(difference_line(opening, runs))
    finally:
        for run in runs:
            run.close()
    return exit_code(opening, outcomes)


def _described(run: WatchedRun, scope: Scope) -> Outcome:
    """Print a description of a run, with progress at growing intervals."""
    last_worked = np.zeros(run.resolved.scenario.fleet.robots, np.int64)
    worked = operations(run.leading_simulation)
    for line in branch_lines(run):
        print(line)
    marks = milestones()
    mark = next(marks)
    for stretch in narrate(run, scope):
        worked = record_work(run.leading_simulation, worked, last_worked)
        lines = list(stretch.lines)
        if stretch.tick >= mark:
            lines.append(fleet_line(run))
            while mark <= stretch.tick:
                mark = next(marks)
        if lines:
            print("\n".join(lines), flush=True)
    return outcome_of(run, last_worked)


# Lines of both forms.


def milestones() -> Iterator[int]:
    """The ticks at which progress is printed: 100, 200, 500, 1,000, ..."""
    size = 100
    while True:
        yield from (size, 2 * size, 5 * size)
        size *= 10


def fleet_line(run: WatchedRun) -> str:
    """Progress: the tick, the orders, and the states of the robots."""
    now = summary_of(run.leading_simulation)
    parked = int(run.leading_simulation.world.robots.parked.sum())
    robots = f"{now.working:,} working, {now.waiting:,} waiting, {parked:,} parked"
    return f"tick {run.tick:,}: {now.delivered:,} of {now.orders:,} orders delivered, {robots}"


def branch_lines(run: WatchedRun) -> list[str]:
    """The branches from which a run came."""
    return [f"branched off {branch}" for branch in branches_of(run.frames)]


def difference_line(opening: Opening, runs: Sequence[WatchedRun]) -> str:
    """Where two runs diverge."""
    live = [run for run in runs if isinstance(run, LiveRun)]
    parted = LiveDivergence(*live).look() if live else first_difference(*opening.recordings)
    return "" if parted is None else parted.text.partition(";")[0]


def scenario_at_end(run: WatchedRun) -> Resolved:
    """The scenario with the settings at the end."""
    if run.live:
        return run.resolved
    rules = run.frames.rules_at(run.tick)
    return resolved_of(changed(run.header, rules), with_strategies=False)


def outcome_of(run: WatchedRun, last_worked: np.ndarray) -> Outcome:
    """The outcome of a run; `last_worked` as in `run_to_end`."""
    front = run.leading_simulation
    scenario = scenario_at_end(run).scenario
    is_over = front.tick >= scenario.stop.max_duration
    finished = front.finished or (is_over and scenario.ends_at_limit)
    orders = asked_orders(front.world)
    return Outcome(
        finished=finished,
        ticks=front.tick,
        orders=len(orders.done),
        delivered=int((orders.done >= 0).sum()),
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
        chargers=metrics_by_charger(front),
        priorities=metrics_by_priority(front),
        classes=metrics_by_class(front),
        uses=uses_of_run(front),
        periods=(periods := run.marks.periods(front)),
        by_period=run.marks.is_fixed and len(periods) > 1,
        deadlock=longest_deadlock(front),
        illegal=illegal_decisions(front.world, front.resolved.floor_plan),
    )


def exit_code(opening: Opening, outcomes: Sequence[Outcome]) -> int:
    """0, or 1 if a live run did not finish."""
    return 0 if not opening.live or all(outcome.finished for outcome in outcomes) else 1
