"""The tables of goods-mini, whose ticks were counted by hand.

>>>>>>>>>v      robot 0 and pod 1 begin at (2, 1), robot 1 and pod 2 at (3, 1); every trip lifts for
^#pppp#q#v      3 ticks, drives 26 moves of a tick, is served for 20 and stores for 3. Robot 1 is
^########v      ahead: served in 18 to 37; robot 0 waits for 20 ticks and is served in 39 to 58.
^<<<<t<<<<      Line 2, known in 60, is a trip when pod 1 is stored: taken in 73, done in 110.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from automaton import read, simulate
from automaton.commands import main
from automaton.tables.table_files import Tables


@pytest.fixture(scope="module")
def tables() -> Tables:
    found: Tables = simulate("goods-mini", tables=True, states="10 s", events=True).tables
    return found


def columns(table: Any, *names: str) -> list[tuple[Any, ...]]:
    return [tuple(row.values()) for row in table.select(names).to_pylist()]


def test_lines_have_the_ticks_of_the_page(tables: Tables) -> None:
    names = ("line", "pod", "station", "trip", "robot", "released")
    assert columns(tables.lines, *names) == [
        (0, 1, "P1", 0, 0, 0),
        (1, 2, "P1", 1, 1, 0),
        (2, 1, "P1", 2, 0, 60),
    ]
    assert columns(tables.lines, "taken", "lifted", "arrived", "begun", "done") == [
        (1, 1, 38, 39, 58),
        (1, 1, 17, 18, 37),
        (73, 73, 90, 91, 110),
    ]
    assert tables.lines["done_s"].to_pylist() == [58.0, 37.0, 110.0]


def test_a_run_of_a_file_of_lines_is_written_and_can_be_run_again(tmp_path: Path) -> None:
    (tmp_path / "l.csv").write_text("nr;item;released;units\nK7;nut;0;3\nK8;bolt;4;2\n")
    named = "columns: {order: nr, sku: item, released: released, units: units}"
    (tmp_path / "l.yaml").write_text(
        "name: shift\nlayout:\n  picture: |\n    >>>>v\n    ^#ppv\n    ^t<<<\n"
        "fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}\n"
        "pods: {list: [{at: [2, 1], skus: [nut]}, {at: [3, 1], skus: [bolt]}]}\n"
        f"orders: {{lines: {{file: l.csv, {named}}}}}\n"
        "stop: {when: delivered, max_duration: 500}\n"
    )
    run = simulate(tmp_path / "l.yaml", tables=True, folder=tmp_path / "out")
    assert columns(run.tables.lines, "sku", "pod", "units") == [("nut", 1, 3), ("bolt", 2, 2)]
    assert columns(run.tables.orders, "name") == [("K7",), ("K8",)]
    assert simulate(tmp_path / "out" / "scenario.yaml").digest == run.digest


def test_lines_by_sku_have_the_pod_that_was_chosen_and_its_name() -> None:
    pods = [{"at": [2, 1], "name": "A-1", "skus": ["nut"]}, {"at": [3, 1], "skus": ["nut", "bolt"]}]
    pods += [{"at": [4, 1], "name": "A-3"}, {"at": [5, 1], "name": "A-4"}]
    lines = [{"sku": "bolt"}, {"pod": "A-1", "order": "K7"}, {"sku": "nut", "release": 5000}]
    settings: Any = {"pods.list": pods, "orders.lines": lines, "stop.max_duration": 200}
    table = simulate("goods-mini", tables=True, **settings).tables
    named = columns(table.lines, "sku", "pod", "pod_name")
    assert named == [("bolt", 2, "2"), (None, 1, "A-1"), ("nut", None, None)]
    assert columns(table.orders, "name") == [(None,), ("K7",), (None,)]


def test_trips_drive_26_moves_and_one_of_them_queues(tables: Tables) -> None:
    names = ("pod", "from", "to", "robot", "picked", "delivered")
    assert columns(tables.trips, *names) == [
        (1, "2_1", "2_1", 0, 1, 70),
        (2, "3_1", "3_1", 1, 1, 50),
        (1, "2_1", "2_1", 0, 73, 122),
    ]
    assert columns(tables.trips, "stops", "moves", "drive", "least_drive", "queued") == [
        (1, 26, 26, 26, 20),
        (1, 26, 26, 26, 0),
        (1, 26, 26, 26, 0),
    ]


def test_orders_are_done_with_their_lines(tables: Tables) -> None:
    names = ("order", "priority", "released", "due", "done", "lead_time", "tardiness", "late")
    assert columns(tables.orders, *names, "lines") == [
        (0, 0, 0, None, 58, 58, None, None, 1),
        (1, 0, 0, 90, 37, 37, 0, False, 1),
        (2, 1, 60, None, 110, 50, None, None, 1),
    ]


def test_states_are_those_of_every_tenth_second(tables: Tables) -> None:
    assert set(tables.states["tick"].to_pylist()) == set(range(0, 121, 10))
    at_30 = tables.states.filter(tables.states["tick"].to_numpy() == 30)
    names = ("robot", "x", "y", "action", "load", "order", "cause", "blocker")
    assert columns(at_30, *names) == [
        (0, 6, 3, "station_queue", 0, 0, "station queue", 1),
        (1, 5, 3, "serve", 1, 1, None, None),
    ]


def test_events_tell_of_every_visit(tables: Tables) -> None:
    visited = [row for row in tables.events.to_pylist() if row["event"] == "visited"]
    assert [(row["tick"], row["robot"], row["order"]) for row in visited] == [
        (37, 1, 1),
        (58, 0, 0),
        (110, 0, 2),
    ]
    assert {(row["x"], row["y"]) for row in visited} == {(5, 3)}


def test_the_station_works_60_ticks_and_78_moves_are_on_the_cells(tables: Tables) -> None:
    assert columns(tables.stations, "station", "x", "y", "visits", "lines", "work") == [
        ("P1", 5, 3, 3, 3, 60)
    ]
    flows = [tables.cells[f"flow_{side}"].to_numpy().sum() for side in "eswn"]
    assert sum(flows) == 78 == sum(tables.cells["visits"].to_pylist())
    waited = {(x, y): n for x, y, n in columns(tables.cells, "x", "y", "waited") if n}
    assert waited == {(6, 3): 20}


def test_a_recording_has_the_same_tables(tables: Tables, tmp_path: Path) -> None:
    assert main(["run", "goods-mini", "--record", str(tmp_path / "a.rec")]) == 0
    recorded = read(tmp_path / "a.rec").tables(states="10 s", events=True)
    assert recorded.names == tables.names
    assert [name for name in tables if not recorded[name].equals(tables[name])] == []


def test_states_and_events_of_one_robot(tables: Tables, tmp_path: Path) -> None:
    assert main(["run", "goods-mini", "--record", str(tmp_path / "a.rec")]) == 0
    recorded = read(tmp_path / "a.rec").tables(states=10, events=True, robots=[1])
    for name in ("states", "events"):
        rows = [row for row in tables[name].to_pylist() if row["robot"] == 1]
        assert recorded[name].to_pylist() == rows
    assert recorded.lines.equals(tables.lines)
