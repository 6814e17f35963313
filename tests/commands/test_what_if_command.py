"""`automaton what-if`: a list of changes against the scenario as it is, with and without a folder."""

from __future__ import annotations

import json
import re
import tempfile
from pathlib import Path

import pytest
from sweep_studies import OwnThread, interrupting

from automaton.commands import main
from automaton.commands.sweep_command import Listener
from automaton.studies.sweeps import pools
from automaton.studies.sweeps.result_store import Store
from automaton.studies.sweeps.sweep_plan import make_sweep_plan

pytest.importorskip("pyarrow")

CHANGES = """- {name: one robot fewer, set: {fleet.robots: 2}}
- {name: slower turns, set: {durations.turn: 40, durations.pick: 15}}
- {name: earlier retreat, set: {strategy.right_of_way: {name: retreat, max_retries: 2}}}
"""
TWO_WAYS = """name: ring
layout:
  picture: |
    ......
    .##.#.
    ......
    .#.##.
    ......
fleet: {robots: 3, start: random, kinematics: differential}
durations: {turn: 2}
orders: {generator: tours, count: 500}
stop: {when: never, max_duration: 200}
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the list of changes; runs are in this process, temporary files in `temporary`."""
    (tmp_path / "changes.yaml").write_text(CHANGES)
    (tmp_path / "temporary").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pools, "LocalPool", OwnThread)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path


def asked(capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str, str]:
    """Exit code and what was printed."""
    capsys.readouterr()
    code = main(["what-if", "tabletop-mini", "changes.yaml", *options])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_answer_names_every_change_with_its_verdict(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    code, said, noted = asked(capsys, "--metric", "makespan", "--pairs", "6")
    assert (code, noted) == (0, "")
    assert "What do 3 changes do to makespan, compared with today? 6 pairs of runs" in said
    assert "- slower turns: worse: makespan +" in said
    assert "- earlier retreat: same runs as today in makespan." in said
    assert "durations.pick" in said.partition("What was changed")[2]
    heads = ("Question", "Decision", "What was changed", "Inputs", "Comparisons")
    places = [said.index(f"\n{head}\n") for head in heads]
    assert places == sorted(places)
    decided = said.partition("\nDecision\n")[2]
    assert "Keep today: none of 3 changes improves makespan significantly." in decided
    assert list((here / "temporary").iterdir()) == []


def test_an_interrupted_command_prints_what_it_knows_and_goes_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    options = ("--metric", "makespan", "--pairs", "3", "--out", "kept")
    with monkeypatch.context() as patched:
        patched.setattr(Listener, "rows", interrupting(Listener.rows, 7))
        code, said, noted = asked(capsys, *options)
    assert code == 130 and noted.endswith("repeat the command to resume\nautomaton: interrupted\n")
    done = int(re.search(r"results so far, of (\d+) of 12 runs", said)[1])  # type: ignore[index]
    assert 7 <= done < 12 and f"stopped; {done} of 12 runs are stored in kept" in noted
    assert "- one robot fewer: " in said and "not compared" in said.partition("Comparisons")[2]
    code, said, _ = asked(capsys, *options, "--json")
    assert code == 0 and json.loads(said)["existing"] == done and json.loads(said)["complete"]


RING = """name: ring
layout: {picture: ">>v\\n^<<"}
fleet: {robots: 4, kinematics: omni}
durations: {move: 2}
orders: {generator: tours, count: 20000}
world: {following: none}
strategy: {allocation: first-come, right_of_way: pibt}
stop: {when: never, max_duration: 600}
"""


def test_a_jam_is_told_with_the_name_of_its_point_and_is_a_caveat(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    (here / "ring.yaml").write_text(RING)
    (here / "full.yaml").write_text("- {name: full, set: {fleet.robots: 6}}\n")
    capsys.readouterr()
    assert main(["what-if", "ring.yaml", "full.yaml", "--pairs", "2", "--out", "kept"]) == 0
    said, told = capsys.readouterr()
    jam = "tick 512: jam: 6 robots between [0, 0] and [2, 1] have finished nothing for the last 500 ticks"
    jams = [line for line in told.splitlines() if "jam: " in line]
    assert len(jams) == 2 and "point" not in told
    assert all(re.fullmatch(rf".* full, seed \d+: {re.escape(jam)}", line) for line in jams), jams
    assert Store("kept").rows().column("jam").to_pylist().count(jam) == 2
    caveats = " ".join(said.partition("Caveats")[2].split())
    assert "jams in 2 of 4 runs: full (2 of 2 runs). One of them: full, seed " in caveats


def test_a_folder_keeps_the_runs_and_the_same_command_resumes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    options = ("--out", "kept", "--metric", "makespan", "--json")
    code, said, _ = asked(capsys, *options, "--pairs", "2")
    first = json.loads(said)
    assert code == 0 and first["existing"] == 0 and first["out"] == "kept"
    code, said, _ = asked(capsys, *options, "--pairs", "3")
    more = json.loads(said)
    assert code == 0 and more["existing"] == 8 and more["pairs"] == 3
    assert len(Store("kept").rows()) == 12
    assert asked(capsys, *options, "--pairs", "2")[2].endswith("the study asks for fewer; use another "
        "folder, or --recompute to ignore rows of other code, scenarios or seeds\n")  # fmt: skip
    code, said, _ = asked(capsys, *options, "--pairs", "2", "--recompute")
    assert code == 0 and json.loads(said)["what_if"] == first["what_if"]
    assert main(["report", "kept"]) == 0
    assert "slower turns" in capsys.readouterr().out
    assert main(["sweep", "kept/study.yaml", "--out", "kept"]) == 0


def test_settings_of_the_command_line_hold_for_the_baseline_and_for_all_changes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = ("--set", "durations.drop=30", "--set", "seed=5", "--set", "fleet.robots=1")
    code, said, _ = asked(capsys, "--pairs", "2", "--json", *settings)
    found = json.loads(said)
    assert code == 0 and found["seed"] == 5
    assert found["set"] == {"durations.drop": 30, "fleet.robots": 1}
    assert [one["name"] for one in found["points"]] == [
        "today",
        "one robot fewer",
        "slower turns",
        "earlier retreat",
    ]
    assert found["what_if"][0]["metric"] == "throughput"
    assert asked(capsys, "--set", "fleet.robot=1")[2].startswith(
        "automaton: --set fleet.robot=1: unknown key 'robot'"
    )
    code, _, noted = asked(capsys, "--set", "fleet.robots=2")
    assert code == 2 and "changes.yaml:1: 'one robot fewer' changes nothing" in noted


def test_a_refined_tick_does_not_change_what_is_asked(capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = asked(capsys, "--pairs", "2", "--refine", "2", "--metric", "makespan", "--json")
    fine = json.loads(said)
    code, said, _ = asked(capsys, "--pairs", "2", "--metric", "makespan", "--json")
    coarse = json.loads(said)
    assert code == 0 and fine["set"] == {"refine": 2}
    for one, other in zip(fine["what_if"], coarse["what_if"], strict=True):
        assert one["mean"] == pytest.approx(other["mean"], rel=0.3)


def test_a_warning_of_a_change_names_it(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    (here / "changes.yaml").write_text("- {name: slower, set: {durations.turn: 1.3 s}}\n")
    capsys.readouterr()
    assert main(["what-if", "crossing", "changes.yaml", "--pairs", "2", "--metric=makespan"]) == 0
    noted = capsys.readouterr().err
    assert "automaton: slower: warning: durations.turn 1.3 s: 2.6 ticks -> 3" in noted


CLOSING = "{floor.closed: [{cells: [[1, 0]], from: 50, for: 20}]}"


@pytest.mark.parametrize(
    ("settings", "rule", "said"),
    [
        (CLOSING, "epibt", "closing: right of way epibt as in the scenario; its default is pibt"),
        (CLOSING[:-1] + ", strategy.right_of_way: pibt}", "pibt", ""),
    ],
)
def test_a_change_replaces_the_default_right_of_way_only_if_it_must(
    settings: str, rule: str, said: str, capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    (here / "ring.yaml").write_text(TWO_WAYS)
    (here / "changes.yaml").write_text(f"- {{name: closing, set: {settings}}}\n")
    options = ("--pairs", "2", "--metric", "throughput", "--out", "kept")
    assert main(["what-if", "ring.yaml", "changes.yaml", *options]) == 0
    noted = [line for line in capsys.readouterr().err.splitlines() if "right of way" in line]
    assert [line.startswith(f"automaton: {said}") for line in noted] == [True] * bool(said)
    changed = make_sweep_plan(here / "kept" / "study.yaml").scenarios[1].scenario
    assert changed.strategy.right_of_way == rule


def test_a_metric_that_no_run_has_is_refused_before_anything_runs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, _, noted = asked(capsys, "--metric", "makespan", "--metric", "lead_tim")
    assert code == 2 and noted.startswith("automaton: --metric lead_tim: no metric is called")
    code, _, noted = asked(capsys, "--metric", "lead_time")
    assert code == 2 and noted.startswith("automaton: --metric lead_time: no point")


@pytest.mark.parametrize("name", ["answer.html", "answer.md", "answer.json", "answer.xlsx"])
def test_the_answer_can_be_a_file(
    name: str, capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    code, said, noted = asked(capsys, "--pairs", "2", "--report", name)
    assert (code, said) == (0, "") and noted == f"automaton: wrote {name}\n"
    assert (here / name).stat().st_size > 1000


def test_a_scenario_and_its_files_are_copied_into_the_folder(
    capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    site = here / "site"
    site.mkdir()
    (site / "floor.txt").write_text("b>>>>>v#\nb^ssssvd\nb====.=d\nb^ssssvd\n#^<<<<.#\n")
    (site / "wider.txt").write_text("b>>>>>>v#\nb^sssssvd\nb=====.=d\nb^sssssvd\n#^<<<<<.#\n")
    (site / "own.yaml").write_text(
        "name: own\nlayout: {file: floor.txt}\nfleet: {robots: 2, kinematics: differential}\n"
        "orders: {generator: full-shelves}\nstrategy: {allocation: independent}\n"
        "stop: {when: parked, max_duration: 20000}\n"
    )
    (here / "changes.yaml").write_text("- {name: wider, set: {layout.file: wider.txt}}\n")
    capsys.readouterr()
    command = ["what-if", "site/own.yaml", "changes.yaml", "--pairs", "2", "--out", "kept"]
    code = main(command)
    assert code == 0, capsys.readouterr().err
    assert (here / "kept/site/own.yaml").exists()
    assert {path.name for path in (here / "kept/site").iterdir()} >= {"floor.txt", "wider.txt"}
