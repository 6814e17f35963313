"""Sweeps that go on, round by round, until the declared precision is reached."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from statistics_trials import round_coverage
from sweep_studies import OwnThread, plain, swept_here
from synthetic_results import noise, study_of, synthetic_store

from automaton.commands import main
from automaton.commands.sweep_command import Listener
from automaton.errors import InputError
from automaton.studies.inference.intervals import next_round
from automaton.studies.reports.build_report import compose
from automaton.studies.reports.comparison_tables import fixed
from automaton.studies.reports.comparisons import most_wanted, stopping_text
from automaton.studies.reports.study_results import read_results
from automaton.studies.sweeps import pools
from automaton.studies.sweeps.pools import ExternalExecutor
from automaton.studies.sweeps.result_store import Store
from automaton.studies.sweeps.run_keys import Row
from automaton.studies.sweeps.study import Analysis, Replications, Study, read_study
from automaton.studies.sweeps.sweep_plan import make_sweep_plan
from automaton.studies.sweeps.sweep_session import sweep_into

ROUNDS = """name: precise
scenario: tabletop-mini
factors: {strategy.allocation: [independent, cooperative]}
replications: {at_least: 10, at_most: %d}
analysis:
  metrics: [makespan]
  comparisons: baseline
  baseline: {strategy.allocation: independent}
  precision: %s
"""


def written(folder: Path, at_most: int = 60, precision: str = "0.05") -> Path:
    path = folder / "precise.yaml"
    path.write_text(ROUNDS % (at_most, precision))
    return path


@pytest.mark.parametrize(
    ("n", "wanted", "at_most", "expected"),
    [
        (20, 20, 200, None),  # enough
        (20, 7, 200, None),
        (20, 30, 200, 30),
        (20, 21, 200, 22),  # a tenth more at least
        (20, 900, 200, 40),  # twice as many at most
        (150, 900, 200, 200),
        (200, 900, 200, None),  # the bound
    ],
)
def test_the_next_round_is_what_the_variance_says_within_limits(
    n: int, wanted: int, at_most: int, expected: int | None
) -> None:
    assert next_round(n, wanted, at_most) == expected


def test_a_sweep_ends_when_its_intervals_are_as_narrow_as_declared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools, "LocalPool", OwnThread)
    study, out = written(tmp_path), tmp_path / "out"
    assert main(["sweep", str(study), "--out", str(out), "--workers", "1"]) == 0
    told = capsys.readouterr()
    store = Store(out)
    rounds = store.manifest.rounds
    assert isinstance(rounds, tuple) and len(rounds) > 1 and rounds[-1] < 60
    assert told.err.count("continuing to") == len(rounds) - 1
    assert "reached" in told.out and "not reached" not in told.out
    rows = store.rows().to_pylist()
    by_point = [[r["replication"] for r in rows if r["point"] == point] for point in (0, 1)]
    assert by_point[0] == by_point[1] == list(range(rounds[-1]))
    makespan = np.array([row["makespan"] for row in rows]).reshape(2, -1)
    difference = makespan[1] - makespan[0]
    half = 2.26 * difference.std(ddof=1) / np.sqrt(len(difference))  # at most: t of 9 degrees
    assert half <= 1.13 * 0.05 * makespan[0].mean()
    text = str(compose(store).blocks)
    assert f"{len(rounds)} rounds of" in text and "slightly lower" in text


def test_the_bound_ends_it_and_says_what_it_would_have_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools, "LocalPool", OwnThread)
    study, out = written(tmp_path, at_most=12, precision="0.01"), tmp_path / "out"
    assert main(["sweep", str(study), "--out", str(out), "--workers", "1"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert (
        "2 rounds of 10, 12 runs, until differences have a half-width of 1.0 %: not reached" in told
    )
    assert "the declared precision is not reached: makespan of allocation cooperative" in told


def test_interrupted_rounds_go_on_as_if_nothing_had_happened(tmp_path: Path) -> None:
    """Neither where it stops nor who does the runs changes what is decided."""
    study = written(tmp_path)
    expected = plain(swept_here(study, tmp_path / "whole"))
    for stop_at in (3, 25):  # in the first round, and in a later one
        interrupted(study, tmp_path / "out", stop_at)
    assert len(Store(tmp_path / "out").keys()) > 20
    assert plain(swept_here(study, tmp_path / "out")) == expected


def interrupted(study: Path, out: Path, stop_at: int) -> None:
    """A sweep by two threads that is stopped after so many more runs."""
    seen: list[Row] = []

    def stop(rows: list[Row]) -> None:
        seen.extend(rows)
        if len(seen) >= stop_at:
            raise KeyboardInterrupt

    with ThreadPoolExecutor(2) as executor, pytest.raises(KeyboardInterrupt):
        sweep_into(
            out,
            make_sweep_plan(study),
            lambda: ExternalExecutor(executor),
            on_rows=stop,
            decide=Listener(out).decide,
        )


def test_means_decide_where_nothing_is_compared() -> None:
    study = Study(
        name="made up",
        scenario="tabletop-mini",
        factors={"fleet.robots": [1, 2]},
        replications=10,
        analysis=Analysis(metrics=("makespan",), precision=0.01),
    )
    wanted = most_wanted(synthetic_store(study, noise))
    assert wanted is not None and wanted.interval.startswith("makespan of robots")
    assert 100 < wanted.runs < 1000  # sd 10 % of the mean: about 390


def test_an_interval_that_cannot_be_computed_is_not_called_reached() -> None:
    """Of 2 robots one run alone finished: nothing says how far off its mean is."""
    study = Study(
        name="made up",
        scenario="tabletop-mini",
        factors={"fleet.robots": [1, 2]},
        replications=10,
        analysis=Analysis(metrics=("makespan",), precision=0.5),
    )
    ends = []
    for finished in (1, 10):
        results = synthetic_store(
            study, noise, finished=lambda p, r, finished=finished: p == 0 or r < finished
        )
        ends.append(stopping_text(replace(results, rounds=(10,), at_most=20)).partition(": ")[2])
    assert ends == ["reached, except for 1 interval that cannot be computed", "reached"]


def test_a_comparison_that_cannot_be_made_is_not_called_reached() -> None:
    study = study_of(
        {"fleet.robots": (1, 2, 3)},
        10,
        precision=0.5,
        comparisons="baseline",
        baseline={"fleet.robots": 1},
    )
    results = synthetic_store(study, noise, finished=lambda p, r: p < 2 or r < 1)
    told = stopping_text(replace(results, rounds=(10,), at_most=20))
    assert told.endswith("reached, except for 1 interval that cannot be computed")


def test_nothing_is_decided_by_a_mean_of_zero() -> None:
    study = Study(
        name="made up",
        scenario="tabletop-mini",
        factors={"fleet.robots": [1, 2]},
        replications=10,
        analysis=Analysis(metrics=("makespan",), precision=0.01),
    )
    assert most_wanted(synthetic_store(study, lambda point, replication: 0.0)) is None


def test_rounds_are_remembered_when_at_least_is_raised_and_when_n_is_fixed(tmp_path: Path) -> None:
    study, out = written(tmp_path, at_most=12, precision="0.01"), tmp_path / "out"
    swept_here(study, out)
    assert Store(out).manifest.rounds == (10, 12)
    study.write_text(study.read_text().replace("10, at_most: 12", "15, at_most: 15"))
    swept_here(study, out)
    results = read_results(Store(out))
    assert (results.rounds, results.raised) == ((10, 12, 15), [12])
    said = fixed(results)
    assert "3 rounds of 10, 12, 15 runs" in said and "raised from 12 after runs" in said
    study.write_text(study.read_text().replace("{at_least: 15, at_most: 15}", "16"))
    swept_here(study, out)
    assert "number not fixed in advance: raised from 12, then 15" in fixed(read_results(Store(out)))


def test_runs_added_to_rounds_that_had_ended_were_not_fixed_beforehand(tmp_path: Path) -> None:
    """The rounds ended far below their bound, and the new number lies between."""
    study, out = written(tmp_path, at_most=60, precision="0.2"), tmp_path / "out"
    swept_here(study, out)
    made = read_results(Store(out)).rounds
    assert made[-1] < 30
    study.write_text(study.read_text().replace("{at_least: 10, at_most: 60}", "30"))
    swept_here(study, out)
    assert f"raised from {made[-1]} after runs had been made" in fixed(read_results(Store(out)))


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("  precision: 0.05\n", "", "replications with at_most need analysis.precision"),
        ("at_least: 10", "at_least: 9", "at_least must be a whole number from 10 to"),
        ("at_least: 10", "at_least: 90", "at_least 90 is more than at_most 60"),
        ("{at_least: 10, at_most: 60}", "{at_least: 10}", "at_most"),
        ("{at_least: 10, at_most: 60}", "many", "replications must be"),
    ],
)
def test_contradictions_are_refused(tmp_path: Path, before: str, after: str, expected: str) -> None:
    study = written(tmp_path)
    study.write_text(study.read_text().replace(before, after))
    with pytest.raises(InputError, match=expected):
        read_study(study)


def test_bounds_may_be_written_in_python() -> None:
    study = Study(
        name="s",
        scenario="tabletop-mini",
        factors={"fleet.robots": [1, 2]},
        replications=Replications(at_most=40),
        analysis=Analysis(metrics=("makespan",), precision=0.05),
    )
    plan = make_sweep_plan(study)
    assert (plan.study.in_rounds, plan.runs, plan.study.runs) == (True, 40, 80)


def test_in_a_pipe_there_is_a_line_now_and_then(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listener = Listener(tmp_path, period_s=0.0)
    listener.total = 100
    listener.rows([])
    listener.rows([{}] * 25)
    none, some = capsys.readouterr().err.splitlines()
    assert "0 of 100 runs; none done yet in" in none
    assert "25 of 100 runs, " in some and " left" in some
    quiet = Listener(tmp_path)
    quiet.rows([{}])
    assert capsys.readouterr().err == ""


def test_intervals_of_runs_that_were_counted_hold_the_truth_nearly_as_often() -> None:
    pool = np.random.default_rng(12).normal(100, 10, 10_000)
    held, runs, rounds = round_coverage(pool, at_least=20, needed=40, studies=300)
    assert 0.90 < held < 0.98 and 38 < runs < 55 and 1 < rounds < 5
