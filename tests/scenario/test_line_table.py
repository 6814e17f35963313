"""Lines of a file are kept as columns, and used as a tuple of lines would be."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automaton.scenario.order_lines import LineTable, line_column, listed_lines, plain_data
from automaton.scenario.orders import Line
from automaton.scenario.quantities import DueAt
from automaton.world.pods import line_columns
from automaton.world.resolve import Resolved, resolve

SCENARIO = """\
name: shift
layout:
  picture: |
    >>>>v
    ^#ppv
    ^t<<<
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
stations: {P1: {at: [1, 2]}}
orders: {lines: {file: shift.csv}}
"""
CSV = """\
order;pod;station;released;due;priority;units
B;2;P1;5;90;2;3
;1;;0;;0;
A;1;1;7;;0;1
B;1;P1;7;80;-1;1
;2;;9;;0;1
"""
LINES = (
    Line(order="B", pod=2, station="P1", release=5, due=DueAt(at=95), priority=2, units=3),
    Line(pod=1),
    Line(order="A", pod=1, station=1, release=7),
    Line(order="B", pod=1, station="P1", release=7, due=DueAt(at=87), priority=-1),
    Line(pod=2, release=9),
)
BYTES = 200  # of a line, at most


def read(folder: Path, content: str = CSV) -> Resolved:
    (folder / "shift.csv").write_text(content)
    (folder / "shift.yaml").write_text(SCENARIO)
    return resolve(folder / "shift.yaml")


def test_a_table_is_a_tuple_of_lines(tmp_path: Path) -> None:
    table = listed_lines(read(tmp_path).scenario.orders)
    assert isinstance(table, LineTable)
    assert len(table) == 5 and tuple(table) == LINES and table == LINES
    assert table[1] == LINES[1] and table[-1] == LINES[-1] and tuple(table[1:3]) == LINES[1:3]
    assert table != LINES[:4] and table != "lines"


def test_its_columns_are_those_of_the_lines(tmp_path: Path) -> None:
    table = listed_lines(read(tmp_path).scenario.orders)
    for name in ("release", "due", "priority", "units"):
        assert line_column(table, name).tolist() == line_column(LINES, name).tolist()


def test_the_same_lines_come_of_a_file_and_of_a_list(tmp_path: Path) -> None:
    resolved = read(tmp_path)
    listed = resolve(resolved.scenario)  # as data, one by one
    assert isinstance(listed.scenario.orders.lines, tuple)
    columns = [line_columns(one.scenario, 2, {"P1": 0, "1": 0}, 1) for one in (resolved, listed)]
    pairs = zip(*columns, strict=True)
    assert all((mine == theirs).all() for mine, theirs in pairs)


def test_a_line_takes_few_bytes(tmp_path: Path) -> None:
    """Beside the columns there are the names of orders."""
    rows = "".join(f"order {k // 2};{k % 2 + 1};P1;{k};{k + 50};0;1\n" for k in range(1000))
    table = listed_lines(read(tmp_path, CSV.partition("\n")[0] + "\n" + rows).scenario.orders)
    assert isinstance(table, LineTable)
    names = sum(name.__sizeof__() + 8 for name in table.orders)
    assert sum(column.nbytes for column in table.values.values()) + names < BYTES * len(table)
    assert {column.dtype for column in table.values.values()} == {np.dtype(np.int32)}
    assert len(plain_data(table)) == 1000
