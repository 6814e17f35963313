"""What `check` says of files that a fresh reader wrote: one good sentence each."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.scenario.reading import document_of
from automaton.world.conversion_table import plain_number_line
from automaton.world.resolve import Resolved, resolve
from automaton.world.scenario_warnings import scenario_warnings

SCENARIO = """\
name: shift
units: {tick: 0.5 s}
layout:
  picture: |
    >>>>>>>>>v
    ^#q##q#p#v
    ^########v
    ^<<<<t<<<<
fleet: {robots: 1, kinematics: omni, start: [[1, 0]]}
durations: {move: 1, pick: 30, drop: 3 s, handling: {line: 20}}
pods: {file: pods.csv}
stations: {P1: {at: [5, 3], queue: QUEUE}}
orders: {lines: {file: lines.csv, columns: {released: T, pod: LOCATION}}}
strategy: {allocation: first-come, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 1000}
"""
PODS = "x;y;bay\n2;1;7\n5;1;8\n7;1;9\n"
LINES = "T;LOCATION\n0;1\n1;2\n"


def shift(
    folder: Path, pods: str = PODS, lines: str = LINES, queue: str = "[[6, 3], [8, 3]]"
) -> Resolved:
    (folder / "shift.yaml").write_text(SCENARIO.replace("QUEUE", queue), encoding="utf-8")
    (folder / "pods.csv").write_text(pods, encoding="utf-8")
    (folder / "lines.csv").write_text(lines, encoding="utf-8")
    return resolve(folder / "shift.yaml")


def refused(folder: Path, **files: str) -> str:
    with pytest.raises(InputError) as error:
        shift(folder, **files)
    return str(error.value).replace(f"{folder}/", "")


def test_numbers_without_a_unit_are_named_with_their_times(tmp_path: Path) -> None:
    resolved = shift(tmp_path)
    document = document_of(tmp_path / "shift.yaml")
    assert plain_number_line(document.data, resolved.scenario.units.scale) == (
        "read in ticks of 0.5 s: durations.pick 30 (15 s), durations.handling.line 20 (10 s), "
        "stop.max_duration 1,000 (8.333 min)"
    )
    resolved = resolve(tmp_path / "shift.yaml", ["units.tick=1 s"])
    assert plain_number_line(document.data, resolved.scenario.units.scale) == ""


def test_columns_of_pods_that_are_not_read_are_named(tmp_path: Path) -> None:
    notes = shift(tmp_path).file_notes
    assert notes[:2] == ("pods.csv: 3 rows", "pods.csv: ignored columns: bay")


def test_a_pod_that_the_file_lacks_is_told_of_the_file(tmp_path: Path) -> None:
    said = refused(tmp_path, pods="x;y\n2;1\n5;1\n")
    assert (
        said
        == "pods.csv: has no pod at [7, 1], where the layout has one: add a row, or draw it as q"
    )


def test_due_times_are_told_by_lines_of_the_file(tmp_path: Path) -> None:
    scenario = SCENARIO.replace("pod: LOCATION", "pod: LOCATION, due: due")
    lines = "T;LOCATION;due\n06:00;1;\n07:00;2;06:30\n08:00;2;07:30\n"
    (tmp_path / "shift.yaml").write_text(
        scenario.replace("QUEUE", "[]").replace("max_duration: 1000", "max_duration: 100000")
    )
    (tmp_path / "pods.csv").write_text(PODS)
    (tmp_path / "lines.csv").write_text(lines)
    assert scenario_warnings(resolve(tmp_path / "shift.yaml")) == [
        "lines.csv:3: the first of 2 rows due before they are released, and therefore late from "
        "the start"
    ]


def test_one_row_with_another_date_is_to_be_written_as_the_others(tmp_path: Path) -> None:
    said = refused(tmp_path, lines="T;LOCATION\n2026-03-02 06:00;1\n02.03.2026 06:10;2\n")
    assert said.startswith("lines.csv:3: T '02.03.2026 06:10' is not a time")
    assert said.endswith("; other rows are such as '2026-03-02 06:00': use this format")


def test_lines_that_come_when_the_run_is_over_are_warned_of(tmp_path: Path) -> None:
    warnings = scenario_warnings(shift(tmp_path, lines="T;LOCATION\n0;1\n1000;2\n"))
    assert warnings == [
        "1 of 2 lines in the file comes after 1,000 ticks (8.333 min) or later, when the run is over "
        "(stop.max_duration 1,000 ticks (8.333 min)), so it will not finish"
    ]


def test_a_queue_that_is_listed_from_its_end_is_to_be_turned_round(tmp_path: Path) -> None:
    said = refused(tmp_path, queue="[[8, 3], [6, 3]]")
    assert "a queue is listed from the cell next to its station outwards: reverse the list" in said


def test_delays_that_never_end_are_refused(tmp_path: Path) -> None:
    shift(tmp_path)
    faults = "faults={delays: {probability: 1, ticks: {from: 1, to: 2}}}"
    with pytest.raises(InputError, match="probability must be below 1"):
        resolve(tmp_path / "shift.yaml", [faults])


def test_decimal_commas_are_read_between_semicolons(tmp_path: Path) -> None:
    lines = shift(tmp_path, lines="T;LOCATION;units\n1,5 s;1;\n2,0 s;2;\n").scenario.orders.lines
    assert lines is not None and [line.release for line in lines] == [3, 4]
    pods = shift(tmp_path, pods="x;y;weight\n2;1;3,0\n5;1;\n7,0;1;\n").scenario.pods.listed
    assert pods is not None and [(pod.at[0], pod.weight) for pod in pods] == [
        (2, 3),
        (5, 1),
        (7, 1),
    ]
    said = refused(tmp_path, pods="x;y;weight\n2;1;3,5\n5;1;\n7;1;\n")
    assert said == "pods.csv:2: weight must be a whole number from 1 to 1,000,000,000, found '3,5'"


def test_a_symbol_that_looks_like_another_is_told_which(tmp_path: Path) -> None:
    shift(tmp_path)
    path = tmp_path / "shift.yaml"
    path.write_text(path.read_text().replace("^########v", "^###█####v"), encoding="utf-8")
    with pytest.raises(InputError) as error:
        resolve(path)
    assert "shift.yaml:7: row 3, column 5 of the picture: '█' has no meaning" in str(error.value)
    assert "did you mean '#'?" in str(error.value)


def test_a_row_of_a_picture_that_is_too_short_is_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "hall.yaml"
    text = "name: hall\nlayout:\n  picture: |\n    .....\n    ...\n    ...#\nfleet: {robots: 1}\n"
    path.write_text(text + "orders: {list: [{stops: [[0, 0]]}]}\n")
    assert scenario_warnings(resolve(path)) == [
        "row 2 of the picture ends with '.' after 3 characters, but other rows have 5: the rest of "
        "the row is wall; write # there if this is intended"
    ]


def test_a_picture_without_loads_is_nothing_to_carry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is legal, and a run of it goes to its end."""
    scenario = tmp_path / "empty.yaml"
    scenario.write_text(
        'name: empty\nlayout: {picture: ".s.\\n.d."}\n'
        "fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}\n"
        "orders: {generator: picture-loads}\nstop: {when: never, max_duration: 50}\n"
    )
    assert "there are no orders" in scenario_warnings(resolve(scenario))[0]
    assert main(["run", str(scenario)]) == 0
    assert "ran for 50 ticks, 0 of 0 orders delivered" in capsys.readouterr().out
