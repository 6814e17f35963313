"""Studies as files: what they say, and one sentence with its place for whatever is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from example_counts import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from automaton.commands import main
from automaton.errors import InputError
from automaton.scenario.text_files import SHIPPED_FOLDER, shipped
from automaton.studies.sweeps.study import (
    Analysis,
    Study,
    read_study,
    shipped_studies,
    study_document,
    study_schema,
)
from automaton.studies.sweeps.sweep_plan import check_study, make_sweep_plan

GOOD = """name: good
scenario: tabletop-mini
factors:
  fleet.robots: [1, 2, 3]
  strategy.allocation: [independent, cooperative]
  strategy.right_of_way:
    - retreat
    - {name: retreat, max_retries: 3}
replications: 20
seed: 7
analysis:
  metrics: [makespan, empty_moves_share]
  paired: true
  baseline: {strategy.allocation: independent}
  comparisons: baseline
"""

LISTED = """name: listed
scenario: [tabletop-1, tabletop-2]
points:
  - {fleet.robots: 4}
  - {fleet.robots: 2, durations.turn: 5}
replications: 3
design: terminating
"""


def complaint(folder: Path, text: str) -> str:
    """What is said about a study with this text; "FILE" stands for its path."""
    path = folder / "study.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        check_study(path)
    said = str(caught.value)
    assert "\n" not in said
    return said.replace(str(path), "FILE")


def test_factors_are_crossed_and_the_last_runs_fastest(tmp_path: Path) -> None:
    path = tmp_path / "good.yaml"
    path.write_text(GOOD)
    study = read_study(path)
    assert len(study.points) == 12 and study.runs == 240
    assert [point.number for point in study.points] == list(range(12))
    assert [point.levels["fleet.robots"] for point in study.points] == [1] * 4 + [2] * 4 + [3] * 4
    assert study.points[1].levels["strategy.right_of_way"] == {"name": "retreat", "max_retries": 3}
    assert study.column_types() == {
        "fleet.robots": "int",
        "strategy.allocation": "text",
        "strategy.right_of_way": "text",
    }
    assert study.analysis == Analysis(
        metrics=("makespan", "empty_moves_share"),
        paired=True,
        baseline={"strategy.allocation": "independent"},
        comparisons="baseline",
    )
    plan = make_sweep_plan(path)
    assert [resolved.scenario.fleet.robots for resolved in plan.scenarios[::4]] == [1, 2, 3]


def test_points_are_run_on_every_scenario(tmp_path: Path) -> None:
    path = tmp_path / "listed.yaml"
    path.write_text(LISTED)
    study, scenarios = check_study(path)
    assert [(point.scenario, len(point.levels)) for point in study.points] == [
        ("tabletop-1", 1),
        ("tabletop-1", 2),
        ("tabletop-2", 1),
        ("tabletop-2", 2),
    ]
    assert [resolved.scenario.durations.turn for resolved in scenarios] == [22, 5, 22, 5]
    assert study.levels("durations.turn") == (5,)


@pytest.mark.parametrize("name", shipped_studies())
def test_shipped_studies_are_good(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", name]) == 0
    assert capsys.readouterr().out.endswith("runs, ok\n")
    assert name not in shipped()
    study = read_study(name)
    assert study.name == name and study.summary and study.analysis
    jsonschema.Draft202012Validator(study_schema()).validate(study_document(name).data)


def test_paths_in_a_study_are_seen_from_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deep").mkdir()
    text = shipped()["tabletop-mini"].read_text()
    (tmp_path / "deep" / "own.yaml").write_text(text.replace("tabletop-mini", "own"))
    study = tmp_path / "deep" / "study.yaml"
    study.write_text(LISTED.replace("[tabletop-1, tabletop-2]", "own.yaml"))
    monkeypatch.chdir(tmp_path)
    assert [resolved.scenario.name for resolved in check_study("deep/study.yaml")[1]] == ["own"] * 2


CHANGES = [  # what is typed instead of what, line, words of the answer
    ("name: good", "nam: good", 1, ["unknown key 'nam'", "did you mean 'name'?"]),
    ("name: good\n", "", 1, ["the key 'name' is missing"]),
    ("name: good", "name: 5", 1, ["name must be text", "found 5"]),
    ("name: good", "name: [", 3, ["not valid YAML"]),
    ("scenario: tabletop-mini", "scenario: tabletop-mimi", 2, ["did you mean 'tabletop-mini'?"]),
    ("scenario: tabletop-mini", "scenario: nothing.yaml", 2, ["no such file"]),
    ("scenario: tabletop-mini", "scenario: []", 2, ["scenario must name at least one"]),
    ("scenario: tabletop-mini", "scenario: 5", 2, ["scenario must be text", "found 5"]),
    ("scenario: tabletop-mini", "scenario: [a, a]", 2, ["names a scenario twice"]),
    ("factors:", "factor:", 3, ["unknown key 'factor'", "did you mean 'factors'?"]),
    ("fleet.robots", "fleet.robot", 4, ["unknown key 'robot' in fleet", "did you mean 'robots'"]),
    ("fleet.robots", "flet.robots", 4, ["unknown key 'flet'", "did you mean 'fleet'?"]),
    ("fleet.robots", "fleet..robots", 4, ["is not a key of a scenario"]),
    ("fleet.robots", "seed", 4, ["seed is not a factor", "set `seed` of the study"]),
    ("fleet.robots", "name", 4, ["name is not a factor"]),
    ("fleet.robots", "orders", 4, ["vary a part of it, such as orders.count"]),
    (
        "[1, 2, 3]",
        "[1, 2, 9]",
        4,
        ["fleet.robots is 9 but the floor has 7 parking bays", "point 8:"],
    ),
    ("[1, 2, 3]", "[1, two]", 4, ["must be a whole number", "found 'two'"]),
    ("[1, 2, 3]", "[1, 2, 1]", 4, ["factors.fleet.robots has 1 twice"]),
    ("[1, 2, 3]", "[]", 4, ["must list at least one level"]),
    ("[1, 2, 3]", "3", 4, ["factors.fleet.robots must be a list", "found 3"]),
    ("[1, 2, 3]", "{1: 2}", 4, ["must be a list of levels, found a mapping"]),
    ("cooperative]", "coperative]", 5, ["'coperative' is unknown", "did you mean 'cooperative'"]),
    (
        "max_retries: 3",
        "max_retries: 0",
        8,
        ["strategy.right_of_way.max_retries must be", "found 0"],
    ),
    ("{name: retreat, max_retries: 3}", "{max_retries: 3}", 8, ["the key 'name' is missing"]),
    ("replications: 20", "replications: 0", 9, ["replications must be", "found 0"]),
    ("replications: 20", "replications: many", 9, ["whole number", "found 'many'"]),
    ("replications: 20\n", "", 1, ["the key 'replications' is missing"]),
    ("replications: 20", "replications: 999999", 9, ["11,999,988 runs", "10,000,000"]),
    ("seed: 7", "seed: -1", 10, ["seed must be", "found -1"]),
    ("seed: 7", "seed: 7\nseed: 8", 11, ["'seed' appears twice"]),
    ("seed: 7", "design: steady", 10, ["did you mean 'steady-state'?"]),
    ("seed: 7", "design: steady-state", 10, ["set stop.when: never", "point 0:"]),
    ("seed: 7", "warm_up: 100", 10, ["warm_up needs design: steady-state"]),
    ("seed: 7", "window: 100", 10, ["window needs design: steady-state"]),
    ("seed: 7", "common_random_numbers: false", 10, ["common_random_numbers must be true"]),
    ("seed: 7", "points: [{fleet.robots: 1}]", 1, ["either factors or points"]),
    (
        "[makespan, empty_moves_share]",
        "[makespann]",
        12,
        ["no metric is called", "mean 'makespan'?"],
    ),
    (
        "[makespan, empty_moves_share]",
        "[lead_time]",
        12,
        ["measures lead_time; it needs", "orders.arrivals"],
    ),
    ("[makespan, empty_moves_share]", "[makespan]\n  precision: 0", 13, ["analysis.precision"]),
    ("[makespan, empty_moves_share]", "[]", 12, ["analysis.metrics"]),
    ("  metrics: [makespan, empty_moves_share]\n", "", 11, ["'metrics' is missing in analysis"]),
    ("paired: true", "paired: yes", 13, ["true or false"]),
    (
        "{strategy.allocation: ind",
        "{strategy.alocation: ind",
        14,
        ["is not a factor", "did you mean"],
    ),
    (
        "allocation: independent",
        "allocation: adaptive",
        14,
        ["but the levels of strategy.allocation are: 'independent'"],
    ),
    ("  baseline: {strategy.allocation: independent}\n", "", 14, ["need a baseline"]),
    ("comparisons: baseline", "comparisons: all", 15, ["baseline, none or pairs", "found 'all'"]),
    ("comparisons: baseline", "comparisons: pairs", 14, ["baseline needs comparisons: baseline"]),
]


@pytest.mark.parametrize(("before", "after", "line", "words"), CHANGES)
def test_what_is_wrong_is_told_with_its_line(
    before: str, after: str, line: int, words: list[str], tmp_path: Path
) -> None:
    assert before in GOOD
    said = complaint(tmp_path, GOOD.replace(before, after, 1))
    assert all(word in said for word in words), said
    assert said.startswith(f"FILE:{line}: "), said


POINTS = [
    ("{fleet.robots: 4}", "{fleet.robots: 0}", 4, ["fleet.robots must be", "found 0", "point 0"]),
    ("{fleet.robots: 4}", "{fleet.robot: 4}", 4, ["unknown key 'robot'"]),
    ("{fleet.robots: 4}", "4", 4, ["points[0] must be a mapping", "found 4"]),
    ("durations.turn: 5", "durations.turn: 0", 5, ["durations.turn must be", "point 1"]),
    ("durations.turn: 5", "durations.turn: 22", 4, []),
    (
        "{fleet.robots: 2, durations.turn: 5}",
        "{fleet.robots: 4}",
        5,
        ["0 and 1 have the same runs"],
    ),
    ("{fleet.robots: 2, durations.turn: 5}", "{}", 5, ["0 and 1 have the same runs"]),
]


@pytest.mark.parametrize(("before", "after", "line", "words"), POINTS)
def test_points_are_checked_one_by_one(
    before: str, after: str, line: int, words: list[str], tmp_path: Path
) -> None:
    text = LISTED.replace(before, after, 1)
    if not words:
        (tmp_path / "study.yaml").write_text(text)
        assert len(check_study(tmp_path / "study.yaml")[1]) == 4
        return
    said = complaint(tmp_path, text)
    assert all(word in said for word in words), said
    assert said.startswith(f"FILE:{line}: "), said


STEADY = """name: steady
scenario: warehouse-100
factors: {fleet.robots: [10, 20]}
replications: 5
design: steady-state
warm_up: mser-5
window: 46
"""

WINDOWS = [
    ("window: 46", "window: 47", 7, ["needs 50 windows in a run", "48 of 47 ticks", "2,300"]),
    ("replications: 5", "replications: 4", 4, ["needs 5 replications, but the study has 4"]),
]


@pytest.mark.parametrize(("before", "after", "line", "words"), WINDOWS)
def test_a_warm_up_that_cannot_be_found_is_refused_before_anything_runs(
    before: str, after: str, line: int, words: list[str], tmp_path: Path
) -> None:
    (tmp_path / "study.yaml").write_text(STEADY)
    assert len(check_study(tmp_path / "study.yaml")[1]) == 2
    said = complaint(tmp_path, STEADY.replace(before, after))
    assert all(word in said for word in words), said
    assert said.startswith(f"FILE:{line}: "), said


@settings(max_examples=examples(100), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_mutation_of_a_study_gives_a_traceback(data: st.DataObject, tmp_path: Path) -> None:
    text = data.draw(st.sampled_from((GOOD, LISTED)))
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(text) - 1))
        length = data.draw(st.integers(0, 12))
        new = data.draw(
            st.one_of(
                st.text("[]{}:-,. \n0123456789abcflnorstu_#'\"&*", max_size=6),
                st.sampled_from(("null", "[]", "{}", "-1", "1e9", "0x1", "true", "fleet", "\n- ")),
            )
        )
        text = text[:at] + new + text[at + length :]
    path = tmp_path / "mutated.yaml"
    path.write_text(text)
    try:
        check_study(path)
    except InputError as error:
        assert str(error).startswith(str(tmp_path)) or "shipped" in str(error)
        assert "\n" not in str(error)


def test_a_missing_study_names_the_nearest_and_a_folder_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", "tabletop-flet", "--out", str(tmp_path / "x")]) == 2
    assert "did you mean 'tabletop-fleet'?" in capsys.readouterr().err
    assert main(["sweep", str(tmp_path), "--out", str(tmp_path / "x")]) == 2
    assert "is a folder" in capsys.readouterr().err
    assert main(["sweep", "nor.yaml", "--out", str(tmp_path / "x")]) == 2
    assert "no such file" in capsys.readouterr().err
    assert main(["sweep", str(shipped()["tabletop-1"]), "--out", str(tmp_path / "x")]) == 2
    assert "this is a scenario" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_check_knows_studies_and_list_names_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "good.yaml"
    path.write_text(GOOD)
    assert main(["check", str(path), "tabletop-1"]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first == "good: 12 points x 20 replications, 240 runs, ok"
    assert main(["check", str(path), "--set", "seed=2"]) == 2
    assert "--set is for scenarios" in capsys.readouterr().err
    path.write_text(GOOD.replace("[1, 2, 3]", "[0]"))
    assert main(["check", str(path)]) == 2
    assert f"{path}:4: fleet.robots must be" in capsys.readouterr().err
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["studies"]
    assert [entry["name"] for entry in listed] == list(shipped_studies())


def test_the_schema_of_studies_has_every_key_and_describes_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["schema", "study"]) == 0
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema)
    properties = schema["$defs"]["Study"]["properties"]
    assert set(properties) == {*Study.__struct_encode_fields__}
    described = {**properties, **schema["$defs"]["Analysis"]["properties"]}
    described.pop("analysis")
    assert all("description" in entry for entry in described.values())


@pytest.mark.parametrize("arguments", [["check", "tabletop-fleet"], ["schema", "study"], ["list"]])
def test_what_is_known_of_studies_needs_nothing_heavy(arguments: list[str]) -> None:
    heavy = ("numba", "textual", "rich", "pyarrow", "scipy", "distributed")
    code = (
        "import sys; from automaton.commands import main; "
        f"code = main({arguments!r}); "
        f"print([name for name in {heavy!r} if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"


# Studies built in Python


def test_levels_may_be_ranges_and_of_numpy() -> None:
    given: tuple[Any, ...] = (range(1, 3), np.arange(1, 3), (np.int64(1), np.int32(2)))
    for levels in given:
        study = Study(
            name="s",
            scenario="tabletop-mini",
            factors={"fleet.robots": levels},
            replications=np.int64(2),
            analysis=Analysis(
                metrics=("ticks",), comparisons="baseline", baseline={"fleet.robots": np.int64(1)}
            ),
        )
        assert [point.levels for point in make_sweep_plan(study).points] == [
            {"fleet.robots": 1},
            {"fleet.robots": 2},
        ]
    with pytest.raises(InputError, match=r"holds numbers, text, lists and mappings, found \{1"):
        Study(name="s", scenario="t", factors={"fleet.robots": {1, 2}}, replications=1)


# A scenario in the place of a study, and the other way round


def test_each_kind_of_file_is_told_from_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "study.yaml"
    study.write_text("name: s\nscenario: tabletop-mini\nfactors: {seed: [1]}\nreplications: 2\n")
    scenario = str(SHIPPED_FOLDER / "tabletop-mini.yaml")
    for command, said in (
        (
            ["sweep", scenario, "--out", str(tmp_path / "r")],
            "this is a scenario; a study is a separate file",
        ),
        (
            ["sweep", "tabletop-1", "--dry-run"],
            "'tabletop-1' is a scenario; a study is a separate file",
        ),
        (["run", str(study)], "this is a study; run it with `automaton sweep STUDY"),
        (
            ["watch", "tabletop-fleet"],
            "'tabletop-fleet' is a study; run it with `automaton sweep STUDY",
        ),
        (["report", str(study)], "is a file, but a report needs the folder of a sweep"),
        (["report", str(tmp_path)], "holds no results of a sweep"),
    ):
        assert main(command) == 2, command
        assert said in capsys.readouterr().err, command
