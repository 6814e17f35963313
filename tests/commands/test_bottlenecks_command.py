"""`automaton bottlenecks`: single changes of a scenario, ranked, with and without a folder."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import pytest
from sweep_studies import OwnThread, interrupting

from automaton.commands import main
from automaton.commands.sweep_command import Listener
from automaton.studies.inference.intervals import Effect, Interval
from automaton.studies.reports.comparison_tables import effect_text
from automaton.studies.reports.study_results import MetricScale
from automaton.studies.sweeps import pools
from automaton.studies.sweeps.result_store import Store

pytest.importorskip("pyarrow")

QUICK = ("--pairs", "3,5")
CHANGES = """- {name: slower turns, set: {durations.turn: 40}}
- {name: earlier retreat, set: {strategy.right_of_way: {name: retreat, max_retries: 2}}}
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a list of changes; runs are in this process, temporary files in `temporary`."""
    (tmp_path / "changes.yaml").write_text(CHANGES)
    (tmp_path / "temporary").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(pools, "LocalPool", OwnThread)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path


def asked(
    capsys: pytest.CaptureFixture[str], *options: str, scenario: str = "tabletop-mini"
) -> tuple[int, str, str]:
    """Exit code and what was printed; without --only streets are left out, of which there are many."""
    if "--only" not in options:
        options += ("--only", "station,energy,fleet")
    capsys.readouterr()
    code = main(["bottlenecks", scenario, *options])
    out, err = capsys.readouterr()
    return code, out, err


def answered(capsys: pytest.CaptureFixture[str], *options: str, **more: str) -> dict[str, Any]:
    """The answer as data."""
    code, said, noted = asked(capsys, "--json", *QUICK, *options, **more)
    assert code == 0, noted
    answer: dict[str, Any] = json.loads(said)
    return answer


def test_the_answer_names_the_change_with_the_largest_effect(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    code, said, noted = asked(capsys, "--pairs", "6,20", "--changes", "changes.yaml")
    assert (code, noted) == (0, "")
    assert "Which single change lowers makespan most? 7 changes tried with 6 pairs" in said
    assert "- 'turns x 0.5' has the largest effect: makespan -" in said
    assert "1. turns x 0.5\n   --set durations.turn=11\n" in said
    table = said.partition("effect, 95 %")[2]
    assert table.index("turns x 0.5") < table.index("one robot fewer") < table.index("Settings")
    assert "earlier retreat  changes nothing" in said.partition("Not ranked")[2]
    assert list((here / "temporary").iterdir()) == []


def test_the_places_of_changes_are_drawn_and_compared_with_lost_time(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, said, _ = asked(capsys, "--pairs", "3,9", scenario="goods-mini")
    assert code == 0
    assert "^<<<<1<<<<\n" in said
    words = " ".join(said.split())
    assert "1 station P1: handling x 0.5 -18.9 % (-18.9 to -18.9)" in words
    assert "rank: among 2 changes with a place." in words
    assert "- one robot more: fleet.robots is 3 but fleet.start lists 2 cells" in said


def test_data_have_every_change_with_its_status(capsys: pytest.CaptureFixture[str]) -> None:
    answer = answered(capsys, "--changes", "changes.yaml")
    assert (answer["metric"], answer["better"], answer["pairs"]) == ("makespan", "lowest", [3, 5])
    by_name = {one["name"]: one for one in answer["changes"]}
    assert by_name["earlier retreat"]["status"] == "changes nothing"
    assert by_name["earlier retreat"]["rank"] is None
    assert by_name["turns x 0.5"]["set"] == {"durations.turn": 11}
    assert by_name["turns x 0.5"]["status"] == "confirmed"
    ranks = sorted(one["rank"] for one in answer["changes"] if one["rank"])
    assert ranks == list(range(1, len(ranks) + 1))


def test_a_folder_keeps_the_runs_and_more_pairs_continue(
    capsys: pytest.CaptureFixture[str],
) -> None:
    first = answered(capsys, "--out", "kept")
    assert len(Store("kept/screening").rows()) == 18
    again = answered(capsys, "--out", "kept")
    assert again == first
    more = answered(capsys, "--out", "kept", "--pairs", "4,6")
    assert more["pairs"] == [4, 6] and len(Store("kept/screening").rows()) == 24
    assert main(["report", "kept/confirmation"]) == 0
    seeds = [set(Store(f"kept/{name}").rows().column("seed").to_pylist())
             for name in ("screening", "confirmation")]  # fmt: skip
    assert not seeds[0] & seeds[1], "those that confirm are fresh"
    code, _, noted = asked(capsys, "--out", "kept", "--only", "energy,fleet", "--most", "2")
    assert code == 2 and "holds results of 6 points, not 3" in noted


def test_kinds_numbers_and_metrics_restrict_what_is_tried(
    capsys: pytest.CaptureFixture[str],
) -> None:
    answer = answered(capsys, "--most", "2", "--metric", "utilization", "--minimise")
    assert (answer["metric"], answer["better"]) == ("utilization", "lowest")
    assert (len(answer["changes"]), answer["not_tried"]) == (2, 3)
    answer = answered(capsys, "--only", "station", scenario="goods-mini")
    assert {one["kind"] for one in answer["changes"]} == {"station"}
    assert answer["refused"] == []
    answer = answered(capsys, "--metric", "blocked_share", "--maximise")
    assert answer["better"] == "highest"


def test_streets_are_changed_and_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = asked(capsys, "--only", "place", "--most", "2", "--dry-run")
    assert code == 0 and "--set 'streets=[{" in said
    assert "further changes not tried (--most)." in said


def test_the_tick_may_be_refined_and_the_scenario_changed(
    capsys: pytest.CaptureFixture[str],
) -> None:
    coarse = answered(capsys, "--set", "durations.turn=10", "--seed", "7")
    assert (coarse["seed"], coarse["set"]) == (7, {"durations.turn": 10})
    fine = answered(capsys, "--refine", "2")
    turns = next(one for one in fine["changes"] if one["name"] == "turns x 0.5")
    assert fine["set"] == {"refine": 2} and turns["set"] == {"durations.turn": 11}


def test_a_dry_run_lists_the_changes_and_estimates_the_time(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    code, said, _ = asked(capsys, "--dry-run", "--workers", "2", "--out", "kept")
    assert code == 0
    assert said.startswith("screening: 6 scenarios x 20 = 120 runs\nconfirmation: 6 to 6 scenarios")
    assert "time: at most" in said and "2 workers" in said
    assert "5. drops x 0.5\n   --set durations.drop=5\n" in said
    assert not (here / "kept").exists()


@pytest.mark.parametrize(
    ("ends", "shown"),
    [((None, None), "+2 ticks (too few runs)"), ((1.0, 3.0), "+2 ticks (+1 to +3)")],
)
def test_an_effect_without_an_interval_says_why(ends: tuple[float, float], shown: str) -> None:
    effect = Effect(Interval(2.0, *ends, 3, "t"), None, 0.5, True, None, None)
    assert effect_text(effect, MetricScale(1.0, "ticks")) == shown


@pytest.mark.parametrize(
    ("after", "phase", "table"),
    # the screening has 6 x 4 runs
    [(15, "screening", "not confirmed yet"), (33, "confirmation", "effect, 95 %")],
)
def test_an_interrupted_command_prints_what_it_knows(
    after: int,
    phase: str,
    table: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Listener, "rows", interrupting(Listener.rows, after))
    code, said, noted = asked(capsys, "--pairs", "4,8", "--out", "kept")
    assert code == 130 and noted.endswith("repeat the command to resume\nautomaton: interrupted\n")
    told = " ".join(said.split())
    assert "Interrupted: results so far, of " in told and f"They are those of the {phase}." in told
    assert table in told


def test_runs_that_do_not_finish_give_no_answer(capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = asked(capsys, *QUICK, "--set", "stop.max_duration=300")
    assert code == 1
    assert "- No answer: 0 of 3 runs of the scenario as it is finished." in said


def test_a_change_whose_runs_fail_is_not_ranked_and_has_the_reason(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    breaking = "{fleet.robots: 2, strategy.allocation: 'sweep_studies:Raises'}"
    (here / "changes.yaml").write_text(f"- {{name: breaks, set: {breaking}}}\n")
    code, said, noted = asked(capsys, *QUICK, "--changes", "changes.yaml", "--most", "2")
    assert code == 1 and "3 runs failed; the report says why" in noted
    assert "breaks" in said.partition("Not ranked")[2]
    assert "jams in 3 of 3 runs (as it is: 0); 3 runs failed: " in " ".join(said.split())


def test_changes_without_effect_are_said_to_have_none(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--metric", "throughput", "--set", "orders.count=3", "--only", "fleet")
    settings = ("--set", "orders.generator=dock-to-rack", "--set", "fleet.robots=6")
    code, said, _ = asked(capsys, *QUICK, *options, *settings, scenario="warehouse-100")
    assert code == 0
    assert "- No change has a statistically significant effect" in said


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--only", "stations"), "unknown kind 'stations' (did you mean 'station'?); there are"),
        (("--only", "energy"), "tabletop-mini: no change is left to try: the scenario has none of"),
        (("--pairs", "20"), "'20' is not two numbers of pairs such as 20,100"),
        (("--pairs", "1,9"), "'1' is not a number of pairs: allowed are 2 to 1000000"),
        (("--metric", "lead_tim"), "--metric lead_tim: no metric is called 'lead_tim'"),
        (
            ("--metric", "utilization"),
            "--metric utilization: neither direction is better: add --minimise or",
        ),
        (("--changes", "wrong.yaml"), "wrong.yaml:2: unknown key 'fleets' (did you mean 'fleet'?)"),
        (("--changes", "same.yaml"), "same.yaml:1: 'as before' changes nothing"),
        (("--changes", "twice.yaml"), "twice.yaml:2: 'a' and 'b' are the same scenario"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(
    capsys: pytest.CaptureFixture[str], here: Path, options: tuple[str, ...], sentence: str
) -> None:
    (here / "wrong.yaml").write_text("- {name: x}\n- {name: y, set: {fleets.robots: 2}}\n")
    (here / "same.yaml").write_text("- {name: as before, set: {fleet.robots: 3}}\n")
    twice = "- {name: a, set: {fleet.robots: 2}}\n- {name: b, set: {fleet.robots: 2}}\n"
    (here / "twice.yaml").write_text(twice)
    code, said, noted = asked(capsys, *QUICK, *options)
    assert (code, said) == (2, "") and sentence in noted


@pytest.mark.parametrize("name", ["answer.html", "answer.md", "answer.json", "answer.xlsx"])
def test_the_answer_can_be_a_file(
    name: str, capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    code, said, noted = asked(capsys, *QUICK, "--report", name)
    assert (code, said) == (0, "") and noted == f"automaton: wrote {name}\n"
    assert (here / name).stat().st_size > 1000
