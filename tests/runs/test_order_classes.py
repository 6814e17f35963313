"""Metrics by the class of orders: of lists and of files, of loads and of lines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from drawn_scenes import recorded_run, scene

from automaton.commands import main
from automaton.recording.frames import resolved_of
from automaton.runs.simulation import Simulation
from automaton.runs.task_metrics import metrics_by_class
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve

LANE = "t...t"
STRATEGY = {"allocation": "first-come", "right_of_way": "wait"}
PODS = """\
name: shift
layout:
  picture: |
    >>>>>>>>>v
    ^#pppp#p#v
    ^########v
    ^<<<<t<<<<
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
units: {tick: 1 s}
orders: {lines: {file: lines.csv, columns: {released: AT, pod: POD, order: ORDER, due: DUE, class: KIND}}}
strategy: {allocation: first-come, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 1 h}
"""
LINES = """\
ORDER;AT;POD;KIND;DUE
a;0;1;EXPRESS;1
b;0;2;;900
a;0;3;STANDARD;1
c;0;4;STANDARD;900
d;500;5;RUSH;1
"""


def test_each_class_has_its_lead_time_and_its_share_of_late_orders() -> None:
    orders = [
        {"from": [0, 0], "to": [4, 0], "class": "express", "due": 2},
        {"from": [4, 0], "to": [0, 0], "class": "standard", "due": 500},
        {"from": [0, 0], "to": [4, 0], "class": "express", "due": 500},
        {"from": [0, 0], "to": [4, 0]},
    ]
    run = Simulation(scene(LANE, [(2, 0)], orders={"list": orders}, strategy=STRATEGY))
    run.run()
    express, standard, other = metrics_by_class(run)
    done = run.world.orders.delivered.tolist()
    assert express == {
        "class": "express",
        "orders": 2,
        "delivered": 2,
        "lead_time": (done[0] + done[2]) / 2,
        "lead_time_p95": max(done[0], done[2]),
        "late_share": 0.5,
    }
    assert (standard["class"], standard["orders"], standard["late_share"]) == ("standard", 1, 0.0)
    assert (other["class"], other["orders"], other["late_share"]) == (None, 1, None)


def test_an_order_of_several_lines_has_the_class_of_the_first(tmp_path: Path) -> None:
    (tmp_path / "shift.yaml").write_text(PODS)
    (tmp_path / "lines.csv").write_text(LINES)
    run, recorder = recorded_run(resolve(tmp_path / "shift.yaml"))
    of_class = {row["class"]: row for row in metrics_by_class(run)}
    assert {name: row["orders"] for name, row in of_class.items()} == {
        "EXPRESS": 1,
        "STANDARD": 1,
        "RUSH": 1,
        None: 1,
    }
    assert of_class["EXPRESS"]["late_share"] == 1.0 and of_class["STANDARD"]["late_share"] == 0.0
    recording = recorder.recording()
    assert validate_stored(recording).valid
    again = Simulation(resolved_of(recording.header))
    again.run()
    assert metrics_by_class(again) == metrics_by_class(run)


def test_without_classes_there_are_no_metrics_of_them() -> None:
    orders = [{"from": [0, 0], "to": [4, 0]}]
    run = Simulation(scene(LANE, [(2, 0)], orders={"list": orders}, strategy=STRATEGY))
    run.run()
    assert metrics_by_class(run) == []


def test_run_prints_them_in_a_table_and_as_json(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "shift.yaml").write_text(PODS)
    (tmp_path / "lines.csv").write_text(LINES)
    file = str(tmp_path / "shift.yaml")
    assert main(["run", file, "--set", "refine=2"]) == 0
    printed = capsys.readouterr().out
    assert "class     orders  delivered  lead time" in printed and "no class" in printed
    assert main(["run", file, "--json"]) == 0
    classes = json.loads(capsys.readouterr().out)["classes"]
    assert [row["class"] for row in classes] == ["EXPRESS", "STANDARD", "RUSH", None]
