"""Orders from a workbook: dates, formulas and sheets, and where a mistake stands."""

from __future__ import annotations

import datetime
import sys
import zipfile
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from automaton.errors import InputError
from automaton.scenario.schema import Units
from automaton.scenario.table_fields import NO_DUE, DueField, ReleaseField, TableOptions, TextField
from automaton.scenario.table_reader import TableColumns, read_columns
from automaton.world.resolve import resolve

UNITS = Units(tick="0.5 s", clock="2026-03-02 06:00")
HEAD = ["ORDER", "CREATED", "CUTOFF", "NOTE"]
FIELDS = [ReleaseField(), DueField(), TextField("order")]
COLUMNS = {"order": "ORDER", "released": "CREATED", "due": "CUTOFF"}


def at(hour: int, minute: int = 0, second: int = 0) -> datetime.datetime:
    return datetime.datetime(2026, 3, 2, hour, minute, second)


def read(path: Path, rows: list[list[Any]], name: str = "Orders", **options: Any) -> TableColumns:
    book = openpyxl.Workbook()
    book.active.title = name
    for row in rows:
        book.active.append(row)
    book.save(path)
    wanted = TableOptions(file=path.name, **options)
    columns = read_columns(path, FIELDS, wanted, COLUMNS, UNITS.scale)
    columns.errors.raise_any()
    return columns


@pytest.fixture
def shift(tmp_path: Path) -> Path:
    return tmp_path / "shift.xlsx"


def test_dates_times_and_numbers_are_what_they_mean(shift: Path) -> None:
    rows = [HEAD, [100001, at(6, 0, 5), at(8), "x"], [], ["A-2", datetime.time(6, 1), None]]
    columns = read(shift, rows)
    assert columns.lines.tolist() == [2, 4]
    assert columns.names["order"] == ["100001", "A-2"]
    assert columns.values["released"].tolist() == [10, 120]
    assert columns.values["due"].tolist() == [2 * 7200, NO_DUE]
    assert columns.counts.ignored == ("NOTE",)


def test_dates_need_no_format_and_texts_beside_them_do(shift: Path) -> None:
    rows = [HEAD, ["1", at(6, 1), None], ["2", "02.03.2026 06:02", None]]
    columns = read(shift, rows, time="%d.%m.%Y %H:%M")
    assert columns.values["released"].tolist() == [120, 240]


def test_a_sheet_is_chosen_by_its_name(shift: Path) -> None:
    book = openpyxl.Workbook()
    book.create_sheet("Orders").append(["released"])
    book["Orders"].append([7])
    book.save(shift)

    def values(sheet: str | None) -> list[int]:
        options = TableOptions(file="shift.xlsx", sheet=sheet)
        columns = read_columns(shift, [ReleaseField()], options, None, UNITS.scale)
        return columns.values["released"].tolist()

    assert values("Orders") == [7]
    with pytest.raises(InputError, match=r"has 2 sheets; set sheet: the sheets are Sheet, Orders"):
        values(None)
    with pytest.raises(InputError, match=r"no sheet 'orders' \(did you mean 'Orders'\?\)"):
        values("orders")


def test_a_formula_without_a_value_is_named_by_its_cell(shift: Path) -> None:
    rows = [HEAD, ["1", at(6), None], ["2", at(6), "=B3+TIME(2,0,0)"]]
    with pytest.raises(InputError) as caught:
        read(shift, rows)
    assert str(caught.value).startswith(f"{shift}!Orders!C3: is a formula whose value is not in")


def test_formulas_in_columns_that_are_not_read_do_no_harm(shift: Path) -> None:
    assert len(read(shift, [HEAD, ["1", at(6), None, "=1+1"]])) == 1


def test_mistakes_in_rows_name_sheet_and_row(shift: Path) -> None:
    with pytest.raises(InputError) as caught:
        read(shift, [HEAD, ["1", at(6)], ["2", "soon"], ["3", None]])
    first, second = str(caught.value).splitlines()
    assert first.startswith(f"{shift}!Orders:3: CREATED 'soon' is not a time")
    assert second == f"{shift}!Orders:4: CREATED is empty"


SCENARIO = """name: from-file
layout:
  picture: |
    >>>>>>>>>v
    ^#pppp#q#v
    ^########v
    ^<<<<t<<<<
fleet: {robots: 1, kinematics: omni, start: [[2, 1]]}
units: {tick: 1 s, clock: "2026-03-02 06:00"}
stations: {P1: {at: [5, 3]}}
orders: {lines: {file: shift.FORM, columns: {released: CREATED, pod: POD, station: DEST, due: CUTOFF}}}
strategy: {allocation: shortest-job, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 1h}
"""


def test_a_workbook_gives_the_lines_of_the_csv_file(tmp_path: Path) -> None:
    rows: list[list[Any]] = [["CREATED", "POD", "DEST", "CUTOFF"], [at(6), 1, "P1", at(8)]]
    rows += [[at(6, 1, 30), 2, "P1", None], [at(5), 1, None, at(7)]]
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(tmp_path / "shift.xlsx")
    texts = [";".join("" if value is None else str(value) for value in row) for row in rows]
    (tmp_path / "shift.csv").write_text("\n".join(texts))
    found = {}
    for form in ("csv", "xlsx"):
        (tmp_path / "floor.yaml").write_text(SCENARIO.replace("FORM", form))
        found[form] = resolve(tmp_path / "floor.yaml").scenario.orders.lines
    assert found["xlsx"] == found["csv"] and len(found["csv"]) == 3


@pytest.mark.parametrize(
    "content, said",
    [
        (b"ORDER;CREATED\n", "is not a workbook (.xlsx): File is not a zip file"),
        (b"PK\x05\x06" + bytes(18), "the workbook cannot be read: "),
    ],
)
def test_files_that_are_no_workbooks(shift: Path, content: bytes, said: str) -> None:
    shift.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_columns(shift, FIELDS, TableOptions(file="shift.xlsx"), COLUMNS, UNITS.scale)
    assert said in str(caught.value)


def test_sheets_belong_to_workbooks() -> None:
    with pytest.raises(ValueError, match=r"sheet belongs to a workbook \(\.xlsx\)"):
        TableOptions(file="shift.csv", sheet="Orders")


def test_without_openpyxl_the_extra_is_named(shift: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    openpyxl.Workbook().save(shift)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(InputError, match=r"pip install 'fleet-automaton\[excel\]'"):
        read_columns(shift, FIELDS, TableOptions(file="shift.xlsx"), COLUMNS, UNITS.scale)


def test_a_workbook_whose_stream_is_damaged_is_none(tmp_path: Path) -> None:
    """The first half of what is compressed of the sheet has other bytes."""
    path = tmp_path / "orders.xlsx"
    read(path, [HEAD, *[[f"O{n}", at(8), at(9), "x" * n] for n in range(60)]])
    with zipfile.ZipFile(path) as archive:
        member = archive.getinfo("xl/worksheets/sheet1.xml")
    damaged = bytearray(path.read_bytes())
    begin = member.header_offset + 30 + len(member.filename)
    for place in range(begin, begin + member.compress_size // 2):
        damaged[place] ^= 0x55
    path.write_bytes(damaged)
    with pytest.raises(InputError, match="is not a workbook"):
        read_columns(path, FIELDS, TableOptions(file=path.name), COLUMNS, UNITS.scale)
