"""Points with names: what a study says of them, how rows and reports call them, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest
import yaml
from report_helpers import report, tables
from sweep_studies import swept_here

from automaton.commands import main
from automaton.errors import InputError
from automaton.studies.reports.build_report import compose, read_report
from automaton.studies.reports.what_if import what_ifs
from automaton.studies.sweeps.named_changes import (
    changes_document,
    checked_changes,
    read_changes,
    what_if_study,
)
from automaton.studies.sweeps.result_store import Store
from automaton.studies.sweeps.study import Analysis, Study, read_study, study_schema
from automaton.studies.sweeps.sweep_plan import check_study, make_sweep_plan, resolve_changes

NAMED = """name: named
scenario: tabletop-mini
points:
  - {name: today}
  - {name: one robot fewer, set: {fleet.robots: 2}}
  - name: slower turns
    set:
      durations.turn: 40
      durations.pick: 9
replications: 6
analysis:
  metrics: [makespan, utilization]
"""
CHANGES = """- {name: one robot fewer, set: {fleet.robots: 2}}
- name: slower turns
  set:
    durations.turn: 40
"""


def written(folder: Path, text: str, name: str = "named.yaml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the study with names."""
    folder = tmp_path_factory.mktemp("named")
    swept_here(written(folder, NAMED), folder / "out")
    return folder / "out"


def test_the_name_is_the_only_factor_and_the_first_point_the_baseline(tmp_path: Path) -> None:
    study, scenarios = check_study(written(tmp_path, NAMED))
    assert study.is_named and study.factor_names == ("point_name",)
    assert [point.name for point in study.points] == ["today", "one robot fewer", "slower turns"]
    assert [point.settings for point in study.points][:2] == [{}, {"fleet.robots": 2}]
    assert [one.scenario.fleet.robots for one in scenarios] == [3, 2, 3]
    assert [one.scenario.durations.turn for one in scenarios] == [22, 22, 40]
    assert study.analysis == Analysis(
        metrics=("makespan", "utilization"), baseline="today", comparisons="baseline"
    )
    assert study.column_types() == {"point_name": "text"}


def test_settings_of_the_study_hold_at_all_points_and_points_come_after_them(
    tmp_path: Path,
) -> None:
    text = f"{NAMED}set: {{durations.turn: 30, durations.drop: 5}}\n"
    _, scenarios = check_study(written(tmp_path, text))
    durations = [one.scenario.durations for one in scenarios]
    assert [(one.turn, one.drop) for one in durations] == [(30, 5), (30, 5), (40, 5)]
    factors = "name: f\nscenario: tabletop-mini\nfactors: {fleet.robots: [1, 2]}\nreplications: 2\n"
    _, scenarios = check_study(written(tmp_path, f"{factors}set: {{durations.turn: 30}}\n"))
    assert [one.scenario.durations.turn for one in scenarios] == [30, 30]


def test_points_of_both_forms_are_in_the_schema(tmp_path: Path) -> None:
    schema = jsonschema.Draft202012Validator(study_schema())
    schema.validate(yaml.safe_load(NAMED))
    flat = "name: s\nscenario: tabletop-mini\npoints: [{fleet.robots: 2}, {}]\nreplications: 2\n"
    schema.validate(yaml.safe_load(flat))
    study = read_study(written(tmp_path, flat))
    assert not study.is_named and [one.settings for one in study.points] == [
        {"fleet.robots": 2},
        {},
    ]
    bad = yaml.safe_load(NAMED.replace("set: {fleet.robots: 2}", "sett: {fleet.robots: 2}"))
    with pytest.raises(jsonschema.ValidationError):
        schema.validate(bad)


STUDY_ERRORS = [  # what is typed instead of what, line, words of the answer
    ("set: {fleet.robots: 2}", "set: {fleet.robots: 3}", 5, ["'one robot fewer' changes nothing"]),
    ("set: {fleet.robots: 2}", "set: {}", 5, ["'one robot fewer' changes nothing"]),
    ("set: {fleet.robots: 2}", "set: {fleet.robot: 2}", 5, ["'robot'", "did you mean 'robots'?"]),
    ("durations.pick", "duration.pick", 9, ["'duration'", "did you mean 'durations'?"]),
    ("durations.pick: 9", "seed: 9", 9, ["seed cannot be set here", "the same seeds"]),
    ("durations.pick: 9", "name: b", 9, ["name cannot be set here"]),
    ("name: slower turns", "name: today", 6, ["'today' appears twice (first in line 4)"]),
    ("name: slower turns\n    set", "set", 6, ["this entry has no name"]),
    ("{name: one robot fewer, set: {fleet.robots: 2}}", "{}", 5, ["a name", "found no keys"]),
    ("{name: one robot fewer, set: {fleet.robots: 2}}", "{fleet.robots: 2}", 5, ["found the keys"]),
    ("name: one robot fewer", "name: 5", 5, ["name must be text", "found 5"]),
    ("set: {fleet.robots: 2}", "sett: {fleet.robots: 2}", 5, ["unknown key 'sett'", "'set'?"]),
    ("set: {fleet.robots: 2}", "set: [2]", 5, ["set must be a mapping", "found [2]"]),
    (", set: {fleet.robots: 2}", "", 5, ["'today' and 'one robot fewer' are the same scenario"]),
    ("analysis:", "analysis:\n  baseline: todai", 12, ["is not a point", "did you mean 'today'?"]),
    ("analysis:", "analysis:\n  comparisons: none", 12, ["points with names are always compared"]),
    (
        "analysis:",
        "analysis:\n  comparisons: pairs\n  baseline: today",
        13,
        ["baseline needs comparisons: baseline"],
    ),
    (
        "analysis:",
        "analysis:\n  comparisons: baseline\n  baseline: {fleet.robots: 2}",
        13,
        ["must be the name of a point", "today, one robot fewer, slower turns"],
    ),
    ("replications: 6", "replications: 6\nset: {fleet.robot: 2}", 11, ["did you mean 'robots'?"]),
    ("replications: 6", "replications: 6\nset: {flet.robots: 2}", 11, ["did you mean 'fleet'?"]),
]


@pytest.mark.parametrize(("before", "after", "line", "words"), STUDY_ERRORS)
def test_bad_points_are_refused_with_their_line(
    before: str, after: str, line: int, words: list[str], tmp_path: Path
) -> None:
    assert before in NAMED
    path = written(tmp_path, NAMED.replace(before, after, 1))
    with pytest.raises(InputError) as caught:
        check_study(path)
    said = str(caught.value)
    assert said.startswith(f"{path}:{line}: ") and "\n" not in said, said
    assert all(word in said for word in words), said


def test_only_points_with_names_can_be_called_by_a_name(tmp_path: Path) -> None:
    text = "name: s\nscenario: tabletop-mini\nfactors: {fleet.robots: [1, 2]}\nreplications: 2\n"
    path = written(tmp_path, f"{text}analysis: {{metrics: [makespan], baseline: today}}\n")
    with pytest.raises(InputError, match="only points with names"):
        check_study(path)
    path = written(tmp_path, f"{text}analysis: {{}}\n")
    with pytest.raises(InputError, match="the key 'metrics' is missing in analysis"):
        check_study(path)


def test_a_study_with_names_may_be_built_in_python() -> None:
    points = ({"name": "today"}, {"name": "fewer", "set": {"fleet.robots": 2}})
    study = Study(name="s", scenario="tabletop-mini", listed=points, replications=2)
    plan = make_sweep_plan(study)
    assert [point.name for point in plan.points] == ["today", "fewer"]
    again = yaml.safe_load(plan.manifest.text)
    assert again["analysis"]["baseline"] == "today" and "metrics" not in again["analysis"]


# A list of changes in a file of its own


def test_a_file_of_changes_is_read_for_any_command(tmp_path: Path) -> None:
    path = written(tmp_path, CHANGES, "changes.yaml")
    changes = read_changes(path)
    assert [change.name for change in changes] == ["one robot fewer", "slower turns"]
    assert [change.overrides[0].argument for change in changes] == [f"{path}:1", f"{path}:4"]
    resolved = resolve_changes("tabletop-mini", ["durations.drop=7"], changes)
    assert [one.scenario.fleet.robots for one in resolved] == [2, 3]
    assert [one.scenario.durations.drop for one in resolved] == [7, 7]
    with pytest.raises(InputError, match=r"changes\.yaml:3: 'slower turns' changes nothing"):
        resolve_changes("tabletop-mini", ["durations.turn=40"], changes)
    written(tmp_path, CHANGES.replace("durations.turn", "durations.tern"), "changes.yaml")
    with pytest.raises(InputError, match=r"changes\.yaml:4: unknown key 'tern'"):
        resolve_changes("tabletop-mini", [], read_changes(path))


def test_the_scenario_as_it_is_comes_first_unless_an_entry_names_it(tmp_path: Path) -> None:
    def study(text: str) -> Study:
        keys = {"name": "s", "scenario": "tabletop-mini", "replications": 2}
        return make_sweep_plan(what_if_study(written(tmp_path, text, "changes.yaml"), keys)).study

    added = study(CHANGES)
    assert [point.name for point in added.points] == ["today", "one robot fewer", "slower turns"]
    named = study(f"{CHANGES}- name: present layout\n")
    assert named.points[-1].name == "present layout" and len(named.points) == 3
    assert named.analysis and named.analysis.baseline == "present layout"
    taken = study(CHANGES.replace("slower turns", "today"))
    assert [point.name for point in taken.points] == ["as it is", "one robot fewer", "today"]


FILE_ERRORS = [
    ("", "", ["is empty", "list the changes"]),
    ("# nothing\n", "", ["is empty"]),
    ("[]", "", ["is empty"]),
    ("a: 2\n", ":1", ["must be a list of changes", "found a mapping"]),
    ("- 5\n", ":1", ["found 5"]),
    ("- {name: a}\n", ":1", ["no entry has `set`"]),
    ("- name: [\n", ":2", ["not valid YAML"]),
    ("- {name: a, set: {fleet.robots: 2}}\n- name: a\n", ":2", ["appears twice (first in line 1)"]),
    ("- name: a\n  set:\n    flet.robots: 2\n", ":3", ["did you mean 'fleet'?"]),
    ("- name: a\n  set:\n    fleet.robot: 2\n", ":3", ["did you mean 'robots'?"]),
    ("- name: a\n  set:\n    fleet.robots: 3\n", ":2", ["'a' changes nothing"]),
]


@pytest.mark.parametrize(("text", "line", "words"), FILE_ERRORS)
def test_a_bad_file_of_changes_is_one_sentence_with_its_line(
    text: str, line: str, words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, text, "changes.yaml")
    assert main(["what-if", "tabletop-mini", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"automaton: {path}{line}: ") and said.count("\n") == 1, said
    assert all(word in said for word in words), said


def test_changes_may_be_part_of_any_document(tmp_path: Path) -> None:
    document = changes_document(written(tmp_path, CHANGES))
    assert len(checked_changes(document, document.data["points"])) == 2
    with pytest.raises(InputError, match="no such file"):
        read_changes(tmp_path / "nothing.yaml")
    with pytest.raises(InputError, match="is a folder"):
        read_changes(tmp_path)


# What rows and reports call them


def test_rows_have_the_names_and_no_column_for_each_setting(swept: Path) -> None:
    table = Store(swept).rows()
    assert set(table.column("point_name").to_pylist()) == {
        "today",
        "one robot fewer",
        "slower turns",
    }
    assert [name for name in table.column_names if "." in name] == []


def test_renaming_a_point_keeps_its_runs_and_a_new_setting_does_not(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = written(tmp_path, NAMED.replace("slower turns", "careful turns"))
    assert len(swept_here(study, swept)) == 18
    assert Store(swept).study.points[2].name == "careful turns"
    swept_here(written(tmp_path, NAMED), swept)
    changed = written(tmp_path, NAMED.replace("durations.turn: 40", "durations.turn: 41"))
    with pytest.raises(InputError, match=r"durations.turn 40.* and is now .*durations.turn 41"):
        swept_here(changed, swept)


def test_the_report_has_one_table_one_picture_and_the_settings_once(
    swept: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, _ = report(capsys, str(swept))
    assert code == 0
    first = said.partition("\nMetrics\n")[0]
    assert "compared with today? 6 pairs of runs" in " ".join(first.split())
    assert first.count("verdict") == 1 and first.count("\nDifference from today\n") == 1
    changed_in, inputs = first.partition("What was changed")[2].split("Inputs")
    assert changed_in.count("durations.turn") == 1 and "varied: 22 cycles, 40" in inputs
    assert "Effects of the factors" not in said
    assert "for --floor: 0 today; 1 one robot fewer; 2 slower turns" in said
    document = compose(Store(swept))
    heads = [table.head for table in tables(document.blocks)]
    assert sum("verdict" in head for head in heads) == 1
    changed = next(one for one in tables(document.blocks) if one.head[1] == "setting")
    assert [list(row) for row in changed.rows] == [
        ["today", "the scenario as it is", ""],
        ["one robot fewer", "fleet.robots", "2"],
        ["slower turns", "durations.turn", "40"],
        ["", "durations.pick", "9"],
    ]


def test_the_report_as_json_names_points_and_verdicts(
    swept: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, _ = report(capsys, str(swept), "--json")
    found = json.loads(said)
    assert code == 0 and found["answers"] == [] and found["effects"] == []
    assert found["points"][1] == {
        "point": 1,
        "scenario": "tabletop-mini",
        "name": "one robot fewer",
        "set": {"fleet.robots": 2},
    }
    whole = read_report(Store(swept))
    verdicts = [one.verdict for one in what_ifs(whole.results, whole.compared)]
    assert [one["verdict"] for one in found["what_if"]] == verdicts and len(verdicts) == 4
    assert {one["against"] for one in found["what_if"]} == {"today"}
    assert {one["point_name"] for one in found["metrics"]} == {
        "today",
        "one robot fewer",
        "slower turns",
    }


def test_all_pairs_of_named_points_are_the_usual_comparisons(tmp_path: Path) -> None:
    text = NAMED.replace("analysis:", "analysis:\n  comparisons: pairs").replace(": 6", ": 2")
    swept_here(written(tmp_path, text), tmp_path / "out")
    document = compose(Store(tmp_path / "out"))
    heads = [table.head for table in tables(document.blocks)]
    assert any("against" in head for head in heads) and not any("verdict" in head for head in heads)
