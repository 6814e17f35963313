"""Pods of a CSV file: their names, classes and SKUs, and lines that name them."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from automaton.errors import InputError
from automaton.history.event_history import EventHistory
from automaton.history.explanation import explain
from automaton.history.snapshot import take_snapshot
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, resolve

SCENARIO = """\
name: shift
layout:
  picture: |
    >>>>>>>>>v
    ^#qqqq#q#v
    ^########v
    ^<<<<t<<<<
fleet: {robots: 1, kinematics: omni, start: [[2, 1]]}
durations: {pick: 3, drop: 3, handling: {line: 20}}
pods: {file: pods.csv, classes: {A: 0.5, B: 0.5}}
stations: {P1: {at: [5, 3]}}
orders: {lines: {file: lines.csv, columns: {released: T, pod: LOCATION, sku: ITEM}}}
strategy: {allocation: first-come, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 1000}
"""
PODS = """\
pod;x;y;name;class;weight;skus
2;3;1;A-17-8;B;5;apple pear
1;5;1;A-17-2;A;;apple
"""
LINES = "T;LOCATION;ITEM\n0;A-17-8;\n1;;pear\n2;1;\n"


def shift(folder: Path, pods: str = PODS, lines: str = LINES, **changes: str) -> Resolved:
    text = SCENARIO
    for old, new in changes.items():
        text = text.replace({"file": "{file: pods.csv, "}.get(old, old), new)
    (folder / "shift.yaml").write_text(text, encoding="utf-8")
    (folder / "pods.csv").write_text(pods, encoding="utf-8")
    (folder / "lines.csv").write_text(lines, encoding="utf-8")
    return resolve(folder / "shift.yaml")


def refused(folder: Path, **files: str) -> str:
    with pytest.raises(InputError) as error:
        shift(folder, **files)
    return str(error.value).replace(f"{folder}/", "")


def test_the_number_is_that_of_the_file_and_the_name_is_another_one(tmp_path: Path) -> None:
    resolved = shift(tmp_path)
    pods = resolved.scenario.pods.listed or ()
    assert [(pod.name, pod.at, pod.pod_class, pod.weight, pod.skus) for pod in pods] == [
        ("A-17-2", (5, 1), "A", 1, ("apple",)),
        ("A-17-8", (3, 1), "B", 5, ("apple", "pear")),
    ]
    run = Simulation(resolved)
    run.run(3)
    assert run.world.lines.taken_from.tolist() == [1, 1, 0]
    assert run.world.pods.pod_class.tolist() == [0, 1]
    assert [Path(path).name for path, _ in resolved.files] == ["pods.csv", "lines.csv"]


def test_without_numbers_pods_have_those_of_their_rows(tmp_path: Path) -> None:
    resolved = shift(tmp_path, "x,y\n3,1\n2,1\n", "T;LOCATION;ITEM\n0;2;\n")
    assert [pod.at for pod in resolved.scenario.pods.listed or ()] == [(3, 1), (2, 1)]
    assert resolved.pod_names == ("1", "2")


def test_what_is_said_of_a_robot_has_the_name_of_its_pod(tmp_path: Path) -> None:
    run = Simulation(shift(tmp_path), on_observe=EventHistory())
    while run.world.robots.load[0] < 0:
        run.run(run.tick + 1)
    found = explain(take_snapshot(run), run.resolved.floor_plan, 0)
    assert "picking up pod A-17-8" in found.lines[0]


def test_columns_are_called_as_the_scenario_says(tmp_path: Path) -> None:
    names = "{x: COL, y: ROW, name: BIN, class: ABC}"
    pods = "BIN;COL;ROW;ABC;NOTE\nA-17-2;3;1;A;\nA-17-8;2;1;B;old\n"
    files = {
        "lines": "T;LOCATION;ITEM\n0;A-17-8;\n",
        "file": f"{{file: pods.csv, columns: {names}, ",
    }
    resolved = shift(tmp_path, pods, **files)
    listed = resolved.scenario.pods.listed or ()
    assert [(pod.name, pod.at, pod.pod_class) for pod in listed] == [
        ("A-17-2", (3, 1), "A"),
        ("A-17-8", (2, 1), "B"),
    ]
    assert "pods.csv: ignored columns: NOTE" in resolved.file_notes
    said = refused(tmp_path, pods=pods.replace(";B", ";C"), **files)
    assert said.startswith("pods.csv:3: ABC 'C' is not a class of pods")


def test_a_workbook_has_the_pods_of_the_csv_file(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    book.active.title = "Bins"
    for row in csv.reader(PODS.splitlines(), delimiter=";"):
        book.active.append([int(text) if text.isdigit() else text for text in row])
    book.create_sheet("Notes")
    book.save(tmp_path / "pods.xlsx")
    of_sheet = shift(tmp_path, file="{file: pods.xlsx, sheet: Bins, ")
    assert of_sheet.scenario.pods == shift(tmp_path).scenario.pods


@pytest.mark.parametrize(
    ("pods", "says"),
    [
        ("{columns: {name: BIN}, ", "pods.columns belongs to pods with a file"),
        ("{sheet: Bins, ", "pods.sheet belongs to pods with a file"),
        ("{file: pods.csv, sheet: Bins, ", "pods.sheet belongs to a workbook (.xlsx)"),
        (
            "{file: pods.csv, columns: {nam: BIN}, ",
            "unknown key 'nam' in pods.columns (did you mean 'name'?)",
        ),
        (
            "{file: pods.csv, columns: {x: X}, ",
            "pods.csv:1: there is no column 'X' (did you mean 'x'?)",
        ),
    ],
)
def test_keys_of_a_file_that_do_not_fit(tmp_path: Path, pods: str, says: str) -> None:
    assert says in refused(tmp_path, file=pods)


def test_a_recording_has_the_pods_itself(tmp_path: Path) -> None:
    first = shift(tmp_path)
    (tmp_path / "pods.csv").unlink()
    (tmp_path / "lines.csv").unlink()
    runs = [Simulation(first), Simulation(resolve(first.scenario))]
    for run in runs:
        run.run()
    assert runs[0].finished and runs[0].digest == runs[1].digest


@pytest.mark.parametrize(
    ("pods", "says"),
    [
        ("x,y\n9,9\n", "pods.csv:2: pod 1 stands at [9, 9], but it lies outside the floor "),
        ("x,y\n2,1\n1,1\n", "pods.csv:3: pod 2 stands at [1, 1], but a wall is there, not storage"),
        ("x,y\n2,1\n2,1\n2,1\n", "pods.csv:3: a second pod stands at [2, 1] (first in line 2); 1 "),
        ("x,y,name\n2,1,A\n3,1,A\n", "pods.csv:3: name 'A' appears twice (first in line 2)"),
        ("x,y,pod\n2,1,1\n3,1,1\n", "pods.csv:3: pod 1 appears twice (first in line 2)"),
        ("x,y,pod\n2,1,1\n3,1,7\n", "pods.csv:3: pod 7: pods are numbered from 1 to 2"),
        (
            "x,y,pod\n2,1,1\n3,1,\n",
            "pods.csv:3: pod must be a whole number from 1 to 1,000,000, found nothing",
        ),
        ("x,y,class\n2,1,A\n3,1,b\n", "class 'b' is not a class of pods (did you mean 'B'?): "),
        ("x,y,class\n2,1,A\n3,1,\n", "pods.csv:3: class is empty, where others have one"),
        ("x,y,weight\n2,1,A lot\n", "pods.csv:2: weight must be a whole number from 1 to"),
        ("x,name\n2,A\n", "pods.csv:1: there is no column for y; the columns are x, name"),
        ("x,y\n", "has no rows below its header"),
    ],
)
def test_a_file_that_is_wrong(tmp_path: Path, pods: str, says: str) -> None:
    assert says in refused(tmp_path, pods=pods, lines="T;LOCATION;ITEM\n0;1;\n")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    said = refused(tmp_path, file="{file: bods.csv, ")
    assert said == "shift.yaml:10: there is no file of pods 'bods.csv'"


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (
            "T;LOCATION\n0;A-17-3\n" + "1;X-1\n" * 31,
            "lines.csv:2: LOCATION 'A-17-3' is not a pod (did you mean 'A-17-8'?); 31 more such rows",
        ),
        ("T;LOCATION\n0;3\n", "lines.csv:2: LOCATION '3' is not a pod"),
        ("T;ITEM\n0;aple\n", "ITEM 'aple' is not a SKU of a pod (did you mean 'apple'?)"),
        (
            "T;LOCATION\n0;1\n0;\n",
            "lines.csv:3: LOCATION is empty; a line without a pod needs a SKU",
        ),
        ("T;LOCATION;ITEM\n0;1;\n0;;\n", "lines.csv:3: LOCATION and ITEM are empty"),
    ],
)
def test_lines_that_name_what_there_is_not(tmp_path: Path, lines: str, says: str) -> None:
    columns = [name for name in ("T", "LOCATION", "ITEM") if name in lines]
    given = {"T": "released", "LOCATION": "pod", "ITEM": "sku"}
    names = ", ".join(f"{given[name]}: {name}" for name in columns)
    old = "{released: T, pod: LOCATION, sku: ITEM}"
    assert says in refused(tmp_path, lines=lines, **{old: f"{{{names}}}"})


def test_a_station_that_there_is_not(tmp_path: Path) -> None:
    lines = "T;LOCATION;ITEM;DEST\n0;1;;P1\n0;1;;1\n0;1;;\n0;1;;p1\n0;1;;2\n"
    named = {"sku: ITEM}": "sku: ITEM, station: DEST}"}
    said = refused(tmp_path, lines=lines, **named)
    assert (
        said
        == "lines.csv:5: DEST 'p1' is not a station (did you mean 'P1'?); 1 more such row, in line 6"
    )


def test_where_stations_are_few_they_are_named(tmp_path: Path) -> None:
    named = {"sku: ITEM}": "sku: ITEM, station: DEST}"}
    said = refused(tmp_path, lines="T;LOCATION;ITEM;DEST\n0;1;;East\n", **named)
    assert said == "lines.csv:2: DEST 'East' is not a station; there are P1, 1"


def test_a_row_may_have_any_sku_beside_its_pod(tmp_path: Path) -> None:
    resolved = shift(tmp_path, lines="T;LOCATION;ITEM\n0;1;plum\n")
    lines: Any = resolved.scenario.orders.lines
    assert [(line.pod, line.sku) for line in lines] == [("A-17-2", "plum")]
    run = Simulation(resolved)
    run.run()
    assert run.finished


def test_orders_of_a_list_name_pods_and_stations(tmp_path: Path) -> None:
    """Where pods stand first is where they are told to go, too."""
    old = "{lines: {file: lines.csv, columns: {released: T, pod: LOCATION, sku: ITEM}}}"
    there, back = "from: A-17-8, stops: [{at: P1, for: 20}], to: A-17-2", "from: A-17-2, to: A-17-8"
    new = f"{{list: [{{{there}}}, {{{back}}}]}}"
    order = (shift(tmp_path, **{old: new}).scenario.orders.listed or ())[0]
    assert (order.source, order.stop_cells, order.target) == ((3, 1), ((5, 3),), (5, 1))
    said = refused(tmp_path, **{old: new.replace("A-17-8", "A-17-3", 1)})
    assert (
        said
        == "shift.yaml:12: orders.list[0].from: 'A-17-3' is not a location (did you mean 'A-17-8'?)"
    )


def test_a_pod_and_a_station_of_one_name(tmp_path: Path) -> None:
    said = refused(tmp_path, pods="x,y,name\n2,1,P1\n", lines="T;LOCATION;ITEM\n0;P1;\n")
    assert said == "pods.csv:2: the station P1 is at [5, 3], but the pod P1 is at [2, 1]"
