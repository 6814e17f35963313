"""What `automaton size` asks once the answer is known: it may fall short, the answer stands."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from remembered_runs import remembered_runs
from statistics_trials import synthetic

from automaton.commands import main
from automaton.studies.sizing.fleet_search import (
    Candidate,
    FleetConfig,
    FleetRun,
    InfeasibleFleetError,
    Target,
    make_question,
)
from automaton.studies.sizing.sizing_session import RunBudget, SizingSession, best_of

ZERO = Target("makespan", True, 0.0)
LONGER = {-10: ["durations.turn=1"], 10: ["durations.turn=2"]}


def test_fleets_that_cannot_be_run_are_not_examined(capsys: Any) -> None:
    """Three starts are listed, so two robots cannot be run."""
    command = [
        "size", "tabletop-mini", "--target", "makespan<=1700", "--robots", "3", "--workers", "1",
        "--set", "fleet.start=[[0, 0], [1, 0], [2, 0]]", "--success-share", "0.8",
        "--indifference", "0.1", "--budget", "300",
    ]  # fmt: skip
    with remembered_runs():
        assert main(command) == 0
        out = " ".join(capsys.readouterr().out.split())
        assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    why = "not examined, fleet.robots is 2 but fleet.start lists 3 cells"
    assert "Answer: 3 robots; " in out  # of which some runs do not finish
    assert f"The last robot (2 -> 3): {why}" in out
    assert out.count(f"; 2: {why} (") == 2
    assert [one["refused"] is None for one in found["sensitivity"][0]["fleets"]] == [False, True]


def test_durations_that_no_fleet_can_have_are_not_examined() -> None:
    fleets = synthetic([1.0], np.random.default_rng(1))

    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        if place.percent == 10:
            raise InfeasibleFleetError("too long")
        return fleets(place, first, number)

    session = SizingSession(make_question(ZERO, (1, 1)), run, {}, LONGER)
    session.go()
    assert session.settled and session.complete
    assert [len(one.fleets) for one in session.moved] == [1, 0]


def test_ctrl_c_keeps_what_followed_so_far_and_counts_it() -> None:
    fleets, made = synthetic([0.0, 1.0, 1.0], np.random.default_rng(1)), 0

    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        nonlocal made
        if place == FleetConfig(2, percent=10):
            raise KeyboardInterrupt
        made += number
        return fleets(place, first, number)

    session = SizingSession(make_question(ZERO, (1, 3)), run, {}, LONGER)
    with pytest.raises(KeyboardInterrupt):
        session.go()
    assert [one.percent for one in session.moved] == [-10]
    assert session.spent == made


def test_strategies_that_drop_out_get_no_further_runs() -> None:
    """Two are so much alike that they take many runs; the third is far off from the first on."""

    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        mean = {"far": 150, "near": 101, "best": 100}[place.strategy]
        rng = np.random.default_rng(mean)
        values = rng.normal(mean, 10, first + number)[first:]
        return [FleetRun(True, {"makespan": value}) for value in values]

    fleets = [Candidate(FleetConfig(1, strategy)) for strategy in ("far", "near", "best")]
    question = make_question(Target("makespan", True, 200.0), (1, 1), ("far", "near", "best"))
    run_budget = RunBudget(run, 10_000)
    best = best_of(fleets, run_budget, question, zone=0.5)
    assert best is not None and best.left == ("best",)
    assert best.runs[0] == 200 < best.runs[1] == best.runs[2]
    assert run_budget.spent == sum(best.runs) == sum(len(one.runs) for one in fleets)
