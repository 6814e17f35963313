"""Tuned settings: the better strategies are found, the same ones every time, and can be used."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from automaton.commands import main
from automaton.studies.inference.intervals import effect, mean_interval
from automaton.studies.tuning import Tuned, candidates_of, conclusion, in_words, make_plan
from automaton.world.resolve import resolve

CROWD = """name: crowd
layout: {generator: random, columns: 10, rows: 10, obstacles: 0.1}
fleet: {robots: 40, kinematics: differential}
durations: {turn: 2}
orders: {generator: tours, count: 2000, stops: {from: 2, to: 2}, arrivals: {closed_loop: {in_system: 60}}}
strategy: {allocation: first-come, right_of_way: retreat}
stop: {when: never, max_duration: 80}
"""
PODS = "goods-mini"
LEAST = 63  # runs for the 35 candidates of the crowd


@pytest.fixture
def crowd(tmp_path: Path) -> str:
    path = tmp_path / "crowd.yaml"
    path.write_text(CROWD)
    return str(path)


def tuned(crowd: str, capsys: pytest.CaptureFixture[str], *more: str) -> Any:
    assert main(["tune", crowd, "--budget", str(LEAST), "--workers", "1", "--json", *more]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_crowd_gets_a_right_of_way_that_gets_it_through(
    crowd: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "settings.yaml"
    answer = tuned(crowd, capsys, "--out", str(out))
    best = answer["candidates"][0]["strategy"]
    assert best["right_of_way"]["name"] in ("pibt", "epibt")
    assert answer["difference"]["low"] > 0 and answer["relative"]["value"] > 0.5
    assert answer["spent"] == answer["budget"] == LEAST
    rounds = [one["round"] for one in answer["candidates"]]
    assert rounds == sorted(rounds, reverse=True) and rounds[0] == 4
    assert tuned(crowd, capsys) == answer, "the same budget and seed, the same answer"
    assert main(["run", crowd, "--json", "--set", f"@{out}"]) == 0
    done = json.loads(capsys.readouterr().out)["metrics"]["throughput"]
    assert done > 1.5 * answer["as_it_is"]["value"]


def test_what_the_scenario_refuses_is_left_out_with_its_reason(crowd: str) -> None:
    known = candidates_of(crowd, ["fleet.kinematics=omni"])
    tried = {candidate.choices[0]["name"] for candidate in known.candidates}
    assert tried == {"retreat", "pibt"}
    assert any(
        one.startswith("strategy.right_of_way is epibt: it plans for robots with kinematics")
        for one in known.left_out
    )
    assert len(known.left_out) == len(set(known.left_out))


def test_storage_is_tuned_where_pods_are_stored_and_the_lattice_where_there_are_none() -> None:
    with_pods = [
        in_words(choice) for one in candidates_of(PODS, []).candidates for choice in one.choices
    ]
    assert "greedy, rest 1.0, storage nearest" in with_pods
    assert not any("lattice" in choice for choice in with_pods)
    without = candidates_of("random-400", []).candidates
    words = [in_words(choice) for one in without for choice in one.choices]
    assert "pibt, guidance lattice" in words and not any("storage" in one for one in words)
    chosen = [one.choices for one in without]
    assert all(chosen.count(one) == 1 for one in chosen), (
        "the scenario as it is, too, is tried once"
    )


def test_a_budget_is_spent_to_the_last_pair() -> None:
    for budget in range(36, 200):
        plan = make_plan(18, budget, ends=False)
        spent = sum(one.candidates * one.runs for one in plan.rounds) + 2 * plan.pairs
        assert budget - 1 <= spent <= budget and plan.pairs >= 5
        assert [one.candidates for one in plan.rounds] == [18, 6, 2]
    assert [one.length for one in plan.rounds] == [0.5, 1, 1]
    assert {one.length for one in make_plan(18, 100, ends=True).rounds} == {1}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--metric", "thruput"], "--metric: no metric is called 'thruput'"),
        (["--metric", "makespan"], "--metric: runs end at a given tick, so makespan is the same"),
        (
            ["--metric", "energy"],
            "--metric: this scenario does not measure energy; it needs a batt",
        ),
        (["--metric", "utilization"], "--metric: utilization has no better direction"),
        (["--budget", "62"], f"--budget 62: 35 candidates need at least {LEAST} runs"),
        (["--out", "nowhere/settings.yaml"], "nowhere/settings.yaml: cannot write it: there is no"),
        (["--out", "."], "cannot write it: this is not a regular file"),
        (["--set", "@nowhere.yaml"], "nowhere.yaml: no such file"),
    ],
)
def test_bad_input_is_refused_before_any_run(
    arguments: list[str],
    sentence: str,
    crowd: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("automaton.studies.process_pool.run_chunk", None)
    assert main(["tune", crowd, *arguments]) == 2
    printed = capsys.readouterr()
    assert sentence in printed.err and printed.err.count("\n") == 1 and not printed.out


def test_settings_of_a_file_are_those_that_are_typed(crowd: str, tmp_path: Path) -> None:
    path = tmp_path / "settings.yaml"
    path.write_text("strategy:\n  right_of_way: {name: epibt, repair_tries: 1}\nseed: 4\n")
    from automaton.commands.arguments import settings_in

    resolved = resolve(crowd, settings_in(path))
    assert resolved.scenario.seed == 4
    assert resolved.strategies["right_of_way"].parameters.repair_tries == 1
    path.write_text("- 1\n")
    assert main(["check", crowd, "--set", f"@{path}"]) == 2


def test_shares_are_in_percent_and_their_differences_in_percentage_points() -> None:
    winner, own = [0.10, 0.11, 0.12, 0.105, 0.115], [0.20, 0.21, 0.23, 0.205, 0.215]
    tuned = Tuned(
        "late_share", 90, 1, winner=mean_interval(winner), own=mean_interval(own),
        gain=effect(winner, own, paired=True),
    )  # fmt: skip
    said = conclusion(tuned)
    assert said.startswith("Best: late_share 11 % (10.02 % to 11.98 %), unchanged 21.2 % (")
    assert "; difference -10.2 (-10.76 to -9.645) percentage points, -48.1 %; 5 runs" in said


def test_a_winner_that_delivers_fewer_orders_gets_a_caveat() -> None:
    winner, own = [10.0, 11.0, 12.0, 10.5, 11.5], [20.0, 21.0, 23.0, 20.5, 21.5]
    for delivered, is_said in (((40, 50), True), ((50, 50), False)):
        tuned = Tuned(
            "lead_time", 90, 1, winner=mean_interval(winner), own=mean_interval(own),
            gain=effect(winner, own, paired=True), delivered=delivered,
        )  # fmt: skip
        said = "Caveat: the winner delivered 20 % fewer orders, and lead_time counts delivered"
        assert (said in conclusion(tuned)) == is_said


def test_a_winner_that_did_not_always_finish_is_not_called_best() -> None:
    """Its mean leaves out the runs that went wrong; those of the unchanged scenario do not help it."""
    winner, own = [10.0, 11.0, 12.0, 10.5, 11.5], [20.0, 21.0, 23.0, 20.5, 21.5]
    for lost, head in (
        (0, "Best: makespan 11 "),
        (2, "Unclear, because the winner did not finish in 2"),
    ):
        tuned = Tuned(
            "makespan", 90, 1, winner=mean_interval(winner), own=mean_interval(own), unfinished=2,
            gain=effect(winner, own, paired=True), lost=lost,
        )  # fmt: skip
        assert conclusion(tuned).startswith(head)
