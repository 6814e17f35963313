"""A run described in sentences, without a screen: what happens, how far it is, and how it ended."""

from __future__ import annotations

import numpy as np

from automaton.history.narration import SENTENCES, Scope, kinds_named, narrate
from automaton.history.watched_run import Run
from automaton.runs.headless import Outcome, operations, record_work
from automaton.runs.run_report import sentences
from tui.playback.run_source import Opening
from tui.terminal.options import Options
from tui.viewer.text_mode import (
    branch_lines,
    difference_line,
    exit_code,
    fleet_line,
    milestones,
    outcome_of,
    scenario_at_end,
)


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


def _described(run: Run, scope: Scope) -> Outcome:
    """Describe a run, and at ever longer intervals how far it is."""
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
