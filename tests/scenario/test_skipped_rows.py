"""Rows of order files with mistakes: refused, or skipped up to a declared share."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.scenario.order_lines import line_column, listed_lines
from automaton.world.resolve import Resolved, resolve

PODS = """\
name: shift
layout:
  picture: |
    >>>>>>>>>v
    ^#pppp#p#v
    ^########v
    ^<<<<t<<<<
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
units: {tick: 1 s, clock: "06:00"}
stations: {P1: {at: [5, 3]}}
orders: {lines: {file: lines.csv, unknown: skip, at_most: 80 %}}
strategy: {allocation: first-come, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 1 h}
"""
LINES = """\
released;pod;station;units
06:00;1;P1;1
06:00;99;P1;1
06:01;2;P9;1
06:01;3;P1;0
soon;4;P1;2
06:02;5;P1
06:02;4;P1;2,5
06:03;;P1;-1
"""
TRANSPORTS = """\
name: shift
layout:
  picture: |
    t....t
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
locations: {in: [0, 0], out: [5, 0]}
orders: {transports: {file: lines.csv, unknown: skip, at_most: 0.5}}
strategy: {allocation: first-come, right_of_way: retreat}
stop: {when: delivered, max_duration: 1000}
"""


def shift(folder: Path, *settings: str, text: str = PODS, lines: str = LINES) -> Resolved:
    (folder / "shift.yaml").write_text(text, encoding="utf-8")
    (folder / "lines.csv").write_text(lines, encoding="cp1252")
    return resolve(folder / "shift.yaml", settings)


def refused(folder: Path, *settings: str, **files: str) -> str:
    with pytest.raises(InputError) as error:
        shift(folder, *settings, **files)
    return str(error.value).replace(f"{folder}/", "")


def test_rows_with_mistakes_are_left_out_and_counted(tmp_path: Path) -> None:
    resolved = shift(tmp_path)
    lines = listed_lines(resolved.scenario.orders)
    assert [(line.pod, line.station, line.release, line.units) for line in lines] == [
        (1, "P1", 0, 1),
        (4, "P1", 120, 3),
    ]
    assert resolved.skipped_rows == {
        "file": "lines.csv",
        "rows": 8,
        "skipped": 6,
        "reasons": {
            "unknown pod": 1,
            "unknown station": 1,
            "units 0": 1,
            "released unreadable": 1,
            "wrong number of values": 1,
            "units unreadable": 1,
        },
    }
    assert len(Simulation(resolved).world.lines.order) == 2


def test_a_skipped_row_is_not_in_the_warnings(tmp_path: Path) -> None:
    rows = "released;due;pod\n05:59;;99\n06:00;05:00;98\n06:00;06:30;1\n05:58;;2\n"
    resolved = shift(tmp_path, lines=rows)
    assert resolved.order_file is not None
    assert resolved.order_file.warnings == (
        "lines.csv: 1 row released before tick 0, so known from the start",
    )


def test_rows_are_refused_by_default_each_mistake_with_its_line(tmp_path: Path) -> None:
    text = PODS.replace(", unknown: skip, at_most: 80 %", "")
    said = refused(tmp_path, text=text).split("\n")
    assert said[0].startswith("lines.csv:3: pod '99' is not a pod")
    assert "lines.csv:5: units is 0, but must be at least 1" in said
    assert said[-1] == "lines.csv: there are mistakes of 2 more kinds"


def test_more_than_the_declared_share_is_refused_with_the_share_and_the_first_row(
    tmp_path: Path,
) -> None:
    said = refused(tmp_path, "orders.lines.at_most=50 %")
    assert said.startswith(
        "lines.csv:3: 6 of 8 rows would be skipped (75 %, but at_most is 50 %); first: pod '99'"
    )
    shift(tmp_path, "orders.lines.at_most=75 %")
    none = "released;pod\n06:00;77\n"
    said = refused(tmp_path, "orders.lines.at_most=100 %", lines=none)
    assert said.startswith("lines.csv:2: 1 of 1 row would be skipped (100 %); first: pod '77'")


def test_decimal_quantities_are_rounded_up_with_a_note(tmp_path: Path) -> None:
    decimals = 'released,pod,units\n0,1,2.5\n0,2,"1,0"\n0,3,2.0\n0,4,0.2\n0,5,"2,5"\n'
    resolved = shift(tmp_path, lines=decimals)
    lines = listed_lines(resolved.scenario.orders)
    assert line_column(lines, "units").tolist() == [3, 1, 2, 1, 3]
    assert "lines.csv: units rounded up to a whole number in 3 rows" in resolved.file_notes
    ambiguous = 'released,pod,units\n0,1,"1,000"\n'
    said = refused(
        tmp_path, "orders.lines.unknown=refuse", "orders.lines.at_most=null", lines=ambiguous
    )
    assert "units must be a number from 1 to 1,000,000, found '1,000'" in said


def test_transports_are_skipped_by_their_locations(tmp_path: Path) -> None:
    rows = "released,from,to\n0,in,out\n3,nowhere,out\n5,out,in\n"
    resolved = shift(tmp_path, text=TRANSPORTS, lines=rows)
    assert [order.release for order in resolved.scenario.orders.listed or ()] == [0, 5]
    assert resolved.skipped_rows is not None
    assert resolved.skipped_rows["reasons"] == {"unknown location": 1}
    outside = rows.replace("5,out,in", "5,out,out\n6,in,in")
    assert len(shift(tmp_path, text=TRANSPORTS, lines=outside).scenario.orders.listed or ()) == 3


def test_a_tick_that_is_no_time_is_not_a_mistake_of_a_row(tmp_path: Path) -> None:
    text = TRANSPORTS.replace("locations:", "units: {tick: 1 cycle, clock: '06:00'}\nlocations:")
    rows = "released,from,to\n06:00,in,out\n0,in,out\n0,in,out\n"
    assert "units.tick is '1 cycle'" in refused(tmp_path, text=text, lines=rows)


QUARANTINE = "orders.lines.unknown={quarantine: bad.csv}"


def test_check_writes_the_rows_as_they_are_behind_the_mistake(tmp_path: Path, capsys: Any) -> None:
    lines = LINES.replace("released;pod", "released;Gerät;pod").replace(":00;", ":00;Öl;")
    lines = (
        lines.replace("06:01;", "06:01;;")
        .replace("06:02;", "06:02;;")
        .replace("06:03;", "06:03;;")
        .replace("soon;", 'soon;"a;b";')
    )
    shift(tmp_path, "orders.lines.encoding=cp1252", lines=lines)
    (tmp_path / "bad.csv").write_text("old")
    resolve(tmp_path / "shift.yaml", [QUARANTINE, "orders.lines.encoding=cp1252"])
    assert (tmp_path / "bad.csv").read_text() == "old", "only check writes it"
    settings = ["--set", QUARANTINE, "--set", "orders.lines.encoding=cp1252"]
    assert main(["check", str(tmp_path / "shift.yaml"), *settings]) == 0
    assert f"6 skipped rows written to {tmp_path / 'bad.csv'}".replace("\n", "") in (
        capsys.readouterr().out.replace("\n    ", " ")
    )
    with (tmp_path / "bad.csv").open(encoding="cp1252", newline="") as file:
        rows = list(csv.reader(file, delimiter=";"))
    assert rows[0] == ["reason", "released", "Gerät", "pod", "station", "units"]
    assert rows[1] == ["unknown pod", "06:00", "Öl", "99", "P1", "1"]
    assert rows[4] == ["released unreadable", "soon", "a;b", "4", "P1", "2"]
    assert not list(tmp_path.glob(".bad*")), "written atomically"


def test_several_files_have_a_quarantine_each_and_a_workbook_has_one(
    tmp_path: Path, capsys: Any
) -> None:
    shift(tmp_path)
    for name, pod in (("day1.csv", 98), ("day2.csv", 99)):
        (tmp_path / name).write_text(f"released;pod\n06:00;1\n06:00;{pod}\n")
    settings = ["--set", QUARANTINE, "--set", "orders.lines.file=day?.csv"]
    assert main(["check", str(tmp_path / "shift.yaml"), *settings]) == 0
    assert (tmp_path / "bad-day2.csv").read_text() == (
        "reason;released;pod\nunknown pod;06:00;99\n"
    )
    assert (tmp_path / "bad-day1.csv").read_text().endswith(";98\n")
    book = openpyxl.Workbook()
    for row in (["released", "pod"], [0, 1], [None, None], [0, 99]):
        book.active.append(row)
    book.save(tmp_path / "lines.xlsx")
    settings = ["--set", QUARANTINE, "--set", "orders.lines.file=lines.xlsx"]
    assert main(["check", str(tmp_path / "shift.yaml"), *settings]) == 0
    assert (tmp_path / "bad.csv").read_text() == "reason,released,pod\nunknown pod,0,99\n"


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["orders.lines.at_most=null"], "orders.lines.unknown lets rows be skipped, which needs"),
        (["orders.lines.unknown=refuse"], "orders.lines.at_most belongs to unknown: skip"),
        (["orders.lines.unknown=ignore"], "orders.lines.unknown must be refuse or skip"),
        (["orders.lines.at_most=2"], "orders.lines.at_most must be a number from 0 to 1"),
        (
            ["orders.lines.unknown={quarantine: lines.csv}"],
            "the quarantine 'lines.csv' must not be",
        ),
        (
            ["orders.lines={count: 3, unknown: skip, at_most: 0.1}"],
            "orders.lines.unknown belongs to lines with a file",
        ),
    ],
)
def test_bad_settings_are_refused(tmp_path: Path, settings: list[str], says: str) -> None:
    assert says in refused(tmp_path, *settings)


def test_run_and_check_say_what_was_skipped(tmp_path: Path, capsys: Any) -> None:
    shift(tmp_path)
    file = str(tmp_path / "shift.yaml")
    assert main(["check", file, "--json"]) == 0
    checked = json.loads(capsys.readouterr().out)[0]
    assert checked["skipped"]["skipped"] == 6
    says = "lines.csv: 6 of 8 rows skipped: 1 unknown pod"
    assert any(line.startswith(says) for line in checked["lines"])
    assert main(["run", file]) == 0
    assert says in capsys.readouterr().out
    assert main(["run", file, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["skipped_rows"]["reasons"]["units 0"] == 1
