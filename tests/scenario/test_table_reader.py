"""Files of orders as warehouse systems write them: what is read, and what is said of mistakes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import pytest

from automaton.errors import InputError
from automaton.scenario.schema import Units
from automaton.scenario.table_fields import (
    NO_DUE,
    Column,
    ColumnNames,
    DueField,
    Field,
    NameField,
    NumberField,
    ReleaseField,
    TableOptions,
    TextField,
    column,
)
from automaton.scenario.table_reader import TableColumns, read_columns, read_table

HALF_SECONDS = Units(tick="0.5 s", clock="2026-03-02 06:00")
LINES = """ORDER_NO;POS;LOCATION;ITEM;QTY;CREATED;CUTOFF;PRIO;STATUS
100001;1;14;4711;2;2026-03-02 06:00:05;2026-03-02 08:00:00;0;OPEN
100001;2;330;0815;1;2026-03-02 06:00:05;2026-03-02 08:00:00;0;OPEN
100002;1;14;4711;1;2026-03-02 06:00:12;2026-03-02 08:00:00;0;OPEN
100003;1;801;1234;1;2026-03-02 06:01:30;2026-03-02 07:00:00;5;OPEN
100004;1;14;4711;1;2026-03-02 06:02:00;;0;CANCELLED
100005;1;402;5555;3;2026-03-02 06:04:10;2026-03-02 09:30:00;0;OPEN
"""
COLUMNS = {
    "order": "ORDER_NO",
    "pod": "LOCATION",
    "released": "CREATED",
    "due": "CUTOFF",
    "priority": "PRIO",
    "units": "QTY",
}
FIELDS: list[Field] = [
    ReleaseField(),
    DueField(),
    TextField("order"),
    TextField("pod"),
    NumberField("priority", -100, 100, default=0),
    NumberField("units", 1, 1_000_000, default=1),
]


def read(
    folder: Path,
    content: str | bytes,
    columns: Mapping[str, str] | None = None,
    units: Units = HALF_SECONDS,
    fields: list[Field] = FIELDS,
    **options: Any,
) -> TableColumns:
    path = folder / "shift.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    needed = [[["pod"], ["order"]]]
    file = TableOptions(file=path.name, **options)
    result = read_columns(path, fields, file, columns, units.scale, needed)
    result.errors.raise_any()
    return result


def complaint(folder: Path, content: str | bytes, *args: Any, **options: Any) -> list[str]:
    with pytest.raises(InputError) as caught:
        read(folder, content, *args, **options)
    return [line.replace(f"{folder}/", "") for line in str(caught.value).split("\n")]


def released(folder: Path, *times: str, units: Units = HALF_SECONDS, **options: Any) -> list[int]:
    rows = "".join(f"{k};{time}\n" for k, time in enumerate(times))
    result = read(folder, "order;released\n" + rows, units=units, **options)
    return [int(tick) for tick in result.values["released"]]


def said_of(folder: Path, *times: str, units: Units = HALF_SECONDS, **options: Any) -> str:
    rows = "".join(f"{k};{time}\n" for k, time in enumerate(times))
    return "\n".join(complaint(folder, "order;released\n" + rows, units=units, **options))


def test_lines_of_a_shift_are_known_and_due_in_these_ticks(tmp_path: Path) -> None:
    shift = read(tmp_path, LINES, COLUMNS, where={"STATUS": ("OPEN",)})
    assert shift.values["released"].tolist() == [10, 10, 24, 180, 500]
    assert shift.values["due"].tolist() == [14400, 14400, 14400, 7200, 25200]
    assert shift.values["priority"].tolist() == [0, 0, 0, 5, 0]
    assert shift.values["units"].tolist() == [2, 1, 1, 1, 3]
    orders = [shift.names["order"][code] for code in shift.values["order"]]
    assert orders == ["100001", "100001", "100002", "100003", "100005"]
    assert [shift.names["pod"][code] for code in shift.values["pod"]] == (
        ["14", "330", "14", "801", "402"]
    )
    assert shift.lines.tolist() == [2, 3, 4, 5, 7]
    assert (shift.counts.rows, shift.counts.left_out) == (6, {"STATUS CANCELLED": 1})
    assert shift.counts.ignored == ("POS", "ITEM")


def test_without_a_clock_the_earliest_release_is_tick_0(tmp_path: Path) -> None:
    units = Units(tick="0.5 s")
    shift = read(tmp_path, LINES, COLUMNS, units, where={"STATUS": "OPEN"})
    assert shift.values["released"].tolist() == [0, 0, 14, 170, 490]
    assert shift.values["due"].tolist()[0] == 14390
    assert shift.counts.tick_zero == "2026-03-02 06:00:05"


@pytest.mark.parametrize(
    ("content", "lines"),
    [
        ("order,released\nA,12\nB,7\n", [2, 3]),
        ("order\treleased\r\nA\t12\r\nB\t7\r\n", [2, 3]),
        ("\ufefforder;released\nA;12\n\n;\nB;7", [2, 5]),
        ('sep=|\n"order"|"released"\nA|12\n"B"|" 7 "\n', [3, 4]),
        ('"order";"a; b, c";"released"\nA;"two\nlines; one ""quote""";12\nB;;7\n', [2, 4]),
    ],
)
def test_tables_are_read_as_spreadsheets_write_them(
    content: str, lines: list[int], tmp_path: Path
) -> None:
    table = read(tmp_path, content)
    assert table.values["released"].tolist() == [12, 7]
    assert table.names["order"] == ["A", "B"]
    assert table.lines.tolist() == lines


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_umlauts_are_read_in_the_encoding_that_is_set(encoding: str, tmp_path: Path) -> None:
    content = "AUFTRAG;ANGELEGT\nGröße-1;5\nSüd;6\n".encode(encoding)
    columns = {"order": "AUFTRAG", "released": "ANGELEGT"}
    assert read(tmp_path, content, columns, encoding=encoding).names["order"] == ["Größe-1", "Süd"]


@pytest.mark.parametrize(
    ("content", "options", "sentence"),
    [
        ("order;released\nS\xfcd;5\n".encode("cp1252"), {},
         "shift.csv:2: is not utf-8 text (byte 0xfc); if it comes from Excel on Windows, set "
         "encoding: cp1252"),
        (b"\xef\xbb\xbforder;released\nA;5\n", {"encoding": "cp1252"},
         "shift.csv: begins with a UTF-8 byte order mark: leave out encoding: cp1252"),
        ("order;released\nA;5\n".encode("utf-16"), {}, "shift.csv: is UTF-16 text; save it as UTF-8"),
        (b"PK\x03\x04anything", {},
         "shift.csv: is a spreadsheet or an archive; save the sheet as CSV, or as .xlsx"),
        (b"", {}, "shift.csv: is empty; its first line must name the columns"),
        (b"order;released\n\n", {}, "shift.csv: has no rows below its header"),
        (b'order;released\nA;5\n"B;6\nC;7\n', {},
         "shift.csv:3: a quoted value begins in this row and is not closed"),
        (b'order;released\n"A" B;5\n', {},
         "shift.csv:2: text follows the closing quote of a value; double quotes inside quoted "
         "values"),
        (b"order;released\nA;5\nB;6;7\nC\n", {},
         "shift.csv:3: the row has 3 values, but the header has 2 columns; 1 more such row, in line 4"),
        (b"order;relased\nA;5\n", {},
         "shift.csv:1: there is no column for released (did you mean 'relased'?); the "
         "columns are order, relased; "
         "set columns: {...} to name them"),
        (b"item;released\nA;5\n", {},
         "shift.csv:1: there is no column for pod or order; the columns are item, released; "
         "set columns: {...} to name them"),
        (b"order;released;order\nA;5;B\n", {}, "shift.csv:1: the column order appears twice"),
        (b"order;released\nA;5\n", {"where": {"STATE": "OPEN"}},
         "shift.csv:1: there is no column 'STATE'; the columns are order, released"),
        (b"order;released\nA;5\nB;6\n", {"where": {"order": ("C", 4)}},
         "shift.csv: no row has order 4 or C; the values are 'A', 'B'"),
    ],
)  # fmt: skip
def test_what_is_not_a_table_is_refused_in_a_sentence(
    content: bytes, options: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    assert complaint(tmp_path, content, **options) == [sentence]


def test_a_column_that_is_named_must_be_there(tmp_path: Path) -> None:
    columns = {"order": "ORDER_N0", "released": "CREATED"}
    assert complaint(tmp_path, LINES, columns)[0].startswith(
        "shift.csv:1: there is no column 'ORDER_N0' (did you mean 'ORDER_NO'?); the columns are"
    )


def test_mistakes_are_gathered_by_kind(tmp_path: Path) -> None:
    places = {"A-17-8": 7}
    rows = ["A-17-8;2026-03-02 06:00;1"] * 5
    rows += [f"A-17-{k};soon;0" for k in range(100, 132)] + ["A-17-8;;1,5", "A-17-8;07:00;-3"]
    fields: list[Field] = [
        ReleaseField(),
        NameField("pod", places, "location"),
        NumberField("units", 1, 9),
    ]
    columns = {"pod": "LOCATION", "released": "CREATED", "units": "QTY"}
    content = "LOCATION;CREATED;QTY\n" + "\n".join(rows)
    assert complaint(tmp_path, content, columns, fields=fields) == [
        "shift.csv:7: LOCATION 'A-17-100' is not a location (did you mean 'A-17-8'?); "
        f"31 more such rows, in lines {', '.join(map(str, range(8, 18)))} and 21 more",
        "shift.csv:7: QTY must be a whole number from 1 to 9, found '0'; "
        f"33 more such rows, in lines {', '.join(map(str, range(8, 18)))} and 23 more",
        "shift.csv:7: CREATED 'soon' is not a time; expected ISO 8601 such as "
        "2026-03-02 06:30:00, a time of the day, or ticks; other rows are such as '2026-03-02 06:00': "
        f"use this format; 31 more such rows, in lines {', '.join(map(str, range(8, 18)))} and 21 more",
        "shift.csv:39: CREATED is empty",
    ]


def test_a_point_behind_thousands_is_not_taken_for_that_of_decimals(tmp_path: Path) -> None:
    fields: list[Field] = [ReleaseField(), TextField("order"), NumberField("units", 1, 9999)]
    says = (
        "units must be a whole number from 1 to 9,999, found '1.000'; write it without a "
        "decimal point"
    )
    semicolons = "order;released;units\nA;5;1.000\nB;5;1,000\nC;5;1.00\nD;5;1000\n"
    assert complaint(tmp_path, semicolons, fields=fields) == [f"shift.csv:2: {says}"]
    commas = read(tmp_path, "order,released,units\nA,5,1.000\n", fields=fields)
    assert commas.values["units"].tolist() == [1]


def test_five_kinds_of_mistakes_are_shown_at_most(tmp_path: Path) -> None:
    fields: list[Field] = [ReleaseField(), TextField("order")]
    fields += [NumberField(f"n{k}", 1, 9) for k in range(7)]
    content = "order;released;" + ";".join(f"n{k}" for k in range(7)) + "\nA;5" + ";x" * 7
    said = complaint(tmp_path, content, fields=fields)
    assert len(said) == 6 and said[-1] == "shift.csv: there are mistakes of 2 more kinds"


def test_times_of_all_forms_count_from_the_clock(tmp_path: Path) -> None:
    times = ("12", "20 s", "06:30", "06:00:01", "2026-03-02 6:30", "2026-03-03T06:00:00.25")
    assert released(tmp_path, *times) == [12, 40, 3600, 2, 3600, 172801]


@pytest.mark.parametrize(
    ("time", "of_format", "tick"),
    [
        ("02.03.2026 06:30", "%d.%m.%Y %H:%M", 3600),
        ("3/2/2026 6:30", "%m/%d/%Y %H:%M", 3600),
        ("03/02/26 6:30 AM", "%m/%d/%y %I:%M %p", 3600),
        ("20260302063000", "%Y%m%d%H%M%S", 3600),
        ("6.30", "%H.%M", 3600),
    ],
)
def test_times_are_read_by_a_format(time: str, of_format: str, tick: int, tmp_path: Path) -> None:
    assert released(tmp_path, time, time=of_format) == [tick]
    if " " in time:  # with its date
        assert f'set time: "{of_format}"' in said_of(tmp_path, time)


def test_a_format_is_offered_that_all_times_have(tmp_path: Path) -> None:
    said = said_of(tmp_path, "3/2/2026 6:30", "3/13/2026 6:30")
    assert said.endswith('ticks; set time: "%m/%d/%Y %H:%M"; 1 more such row, in line 3')
    said = said_of(tmp_path, "3/2/2026 6:30")
    assert said.endswith('set time: "%m/%d/%Y %H:%M" or time: "%d/%m/%Y %H:%M"')
    said = said_of(tmp_path, "2026-03-02 06:30", time="%d.%m.%Y %H:%M")
    assert "expected the format '%d.%m.%Y %H:%M', such as 02.03.2026 06:30; leave out" in said
    said = said_of(tmp_path, "46083.2708333")
    assert (
        "'46083.2708333' is a number of days, as spreadsheets store dates; set time: serial" in said
    )


@pytest.mark.parametrize(
    ("time", "tick"),
    [
        ("46083.2708333", 3600),
        ("46083,270833", 3600),
        ("46084", 18 * 7200),
        ("0.2708333", 3600),
        ("2026-03-02 06:30", 3600),
    ],
)
def test_times_are_days_as_spreadsheets_store_dates(time: str, tick: int, tmp_path: Path) -> None:
    assert released(tmp_path, time, time="serial") == [tick]


@pytest.mark.parametrize("of_format", ["ISO", "%Q", "%d.%m. %H:%M", "%H:%M %"])
def test_a_format_must_be_one_of_times(of_format: str) -> None:
    with pytest.raises(ValueError, match="time "):
        TableOptions(file="shift.csv", time=of_format)


def test_offsets_stand_in_all_times_or_in_none(tmp_path: Path) -> None:
    no_clock = Units(tick="1 s")
    ticks = released(
        tmp_path, "2026-03-29 01:30:00+01:00", "2026-03-29T03:30:00+02:00", units=no_clock
    )
    assert ticks == [0, 3600]  # the clocks were put forward in between
    bare = ("2026-03-29 01:30", "2026-03-29 03:30")
    assert released(tmp_path, *bare, units=no_clock) == [0, 7200]
    said = said_of(tmp_path, "2026-03-29 01:30Z", bare[1], units=no_clock)
    assert "'2026-03-29 03:30' has no offset from UTC, but the other times have one" in said
    said = said_of(tmp_path, bare[0], "2026-03-29 01:30Z", units=no_clock)
    assert "'2026-03-29 01:30Z' has an offset from UTC, but the other times have none" in said
    said = said_of(tmp_path, "2026-03-29 01:30Z")
    assert "'2026-03-29 01:30Z' has an offset from UTC, but units.clock has none" in said
    clock = Units(tick="1 s", clock="2026-03-29 01:00+01:00")
    assert released(tmp_path, "2026-03-29 01:30Z", units=clock) == [5400]


@pytest.mark.parametrize(
    ("times", "units", "sentence"),
    [
        (
            ("12", "06:30"),
            Units(tick="1 s"),
            "'06:30' is a clock time, but the clock time of tick 0 is unknown",
        ),
        (("06:30", "2026-03-02 06:30"), Units(tick="1 s"), "has a date, unlike the other times"),
        (("2026-03-02 06:30", "06:30"), Units(tick="1 s"), "has no date, unlike the other times"),
        (("2026-03-02 06:30",), Units(tick="1 s", clock="06:00"),
         "has a date, but units.clock has none; set it with a date"),
        (("2026-03-02 06:30",), Units(), "units.tick is '1 tick', which is not a time"),
        (("20 s",), Units(), "units.tick is '1 tick', which is not a time"),
        (("3000000000",), Units(tick="1 s"), "'3000000000' is after 2,000,000,000 ticks"),
        (("5 kg",), Units(tick="1 s"), "'5 kg' is not a time"),
        (("25:00",), Units(tick="1 s"), "'25:00' is not a time"),
    ],
)  # fmt: skip
def test_times_that_mean_no_tick_are_refused(
    times: tuple[str, ...], units: Units, sentence: str, tmp_path: Path
) -> None:
    assert f"shift.csv:{len(times) + 1}: released " in said_of(tmp_path, *times, units=units)
    said = said_of(tmp_path, *times, units=units)
    assert sentence in said and "\n" not in said, said


def test_what_was_released_before_tick_0_and_is_due_before_release_is_counted(
    tmp_path: Path,
) -> None:
    rows = (
        "A;05:00;",
        "B;05:00;05:30",
        "C;07:00;06:30",
        "D;07:00;10 min",
        "E;07:00;60",
        "F;07:00;7:30",
    )
    table = read(tmp_path, "order;released;due\n" + "\n".join(rows))
    assert table.values["released"].tolist() == [0, 0, 7200, 7200, 7200, 7200]
    assert table.values["due"].tolist() == [NO_DUE, -3600, 3600, 8400, 7260, 10800]
    assert [int(table.odd[kind].sum()) for kind in ("before", "late")] == [2, 1]


def test_times_between_two_ticks_are_rounded_and_counted(tmp_path: Path) -> None:
    table = read(tmp_path, "order;released\nA;06:00:00.2\nB;06:00:00.25\nC;06:00:01\nD;06:00:00.2")
    assert table.values["released"].tolist() == [0, 1, 2, 0]
    assert table.counts.rounded == 3


class ShelfColumns(ColumnNames, frozen=True, kw_only=True):
    """What the columns of a file of shelves are called."""

    rows = "shelves"
    needed = ((("row",),),)

    row: Annotated[Column, column("The row of the shelf.", NumberField, least=0, most=9)] = None
    aisle: Annotated[Column, column("The aisle.", NameField, what="corridor")] = None
    label: Annotated[Column, column("What is written on the shelf.")] = None


def test_a_new_kind_of_table_is_a_declaration_of_its_columns(tmp_path: Path) -> None:
    path, options = tmp_path / "shelves.csv", TableOptions(file="shelves.csv")
    path.write_text("R;aisle;label\n3;north;S-1\n4;;S-2\n")
    known = {"aisle": {"south": 0, "north": 1}}
    table = read_table(
        path, ShelfColumns, options, ShelfColumns(row="R", aisle="aisle"), known=known
    )
    assert table.values["row"].tolist() == [3, 4]
    assert table.values["aisle"].tolist() == [1, -1] and table.names["label"] == []
    path.write_text("R;aisle;label\n30;nort;S-1\n")
    wrong = read_table(
        path, ShelfColumns, options, ShelfColumns(row="R", aisle="aisle"), known=known
    )
    with pytest.raises(InputError) as caught:
        wrong.errors.raise_any()
    assert "R must be a whole number from 0 to 9, found '30'" in str(caught.value)
    assert "aisle 'nort' is not a corridor (did you mean 'north'?)" in str(caught.value)
    with pytest.raises(InputError, match="there is no column for row"):
        read_table(path, ShelfColumns, options, known=known)
