"""A report as JSON, as a workbook, and its tables as CSV: the numbers are those of the rows."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from report_helpers import report

from automaton.commands import main
from automaton.studies.reports.export import (
    column_names,
    csv_cell,
    without_empty,
    write_records_csv,
)

parquet = pytest.importorskip("pyarrow.parquet")

STUDY = """
name: tiny
scenario: tabletop-mini
factors:
  fleet.robots: [2, 3]
  strategy.allocation: [independent, {name: cooperative}]
replications: 3
analysis:
  metrics: [makespan, blocked_share]
  baseline: {strategy.allocation: independent}
  comparisons: baseline
"""
FILES = {
    "--csv": "rows.csv",
    "--parquet": "rows.parquet",
    "--summary": "summary.csv",
    "--comparisons": "comparisons.csv",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results, and all files that a report on them writes."""
    place = tmp_path_factory.mktemp("exports")
    (place / "tiny.yaml").write_text(STUDY)
    out = place / "results"
    assert main(["sweep", str(place / "tiny.yaml"), "--out", str(out), "--workers", "1"]) == 0
    options = [part for option, name in FILES.items() for part in (option, str(place / name))]
    assert main(["report", str(out), "--out", str(place / "report.json"), *options]) == 0
    assert main(["report", str(out), "--out", str(place / "report.xlsx")]) == 0
    return place


def rows_of(folder: Path) -> list[dict[str, Any]]:
    """The rows of the runs."""
    return parquet.read_table(folder / "rows.parquet").to_pylist()  # type: ignore[no-any-return]


def sheet(folder: Path, name: str) -> list[dict[str, Any]]:
    """A sheet of the workbook as records."""
    book = openpyxl.load_workbook(folder / "report.xlsx")
    head, *lines = book[name].iter_rows(values_only=True)
    return [dict(zip(head, line, strict=True)) for line in lines]


def means(folder: Path) -> dict[tuple[int, str], float]:
    """Of each point and metric the mean over its rows."""
    rows = rows_of(folder)
    return {
        (point, metric): sum(r[metric] for r in rows if r["point"] == point) / 3
        for point in range(4)
        for metric in ("makespan", "blocked_share")
    }


def test_the_workbook_has_the_numbers_of_the_rows(folder: Path) -> None:
    rows = rows_of(folder)
    book = openpyxl.load_workbook(folder / "report.xlsx")
    assert book.sheetnames == [*("answer", "summary", "tables", "comparisons", "periods", "rows")]
    told = sheet(folder, "rows")
    assert len(told) == len(rows) == 12
    for line, row in zip(told, rows, strict=True):
        assert line["seed"] == str(row["seed"])  # a cell would keep 15 of its digits
        assert {k: v for k, v in line.items() if k != "seed"} == pytest.approx(
            {name: row[name] for name in line if name != "seed"}
        )
    summaries = {(line["point"], line["metric"]): line["mean"] for line in sheet(folder, "summary")}
    assert summaries == pytest.approx(means(folder))
    for line in sheet(folder, "comparisons"):
        difference = [means(folder)[line[key], line["metric"]] for key in ("point", "against")]
        assert line["difference"] == pytest.approx(difference[0] - difference[1])


def test_sheets_for_readers_have_the_answer_and_numbers_as_such(folder: Path) -> None:
    book = openpyxl.load_workbook(folder / "report.xlsx")
    answer = [row[0] for row in book["answer"].iter_rows(values_only=True)]
    assert {"tiny", "Question", "Decision"} <= set(answer)
    lines = list(book["tables"].iter_rows(values_only=True))
    at = next(
        number for number, line in enumerate(lines) if line[:3] == ("robots", "allocation", "mean")
    )
    assert lines[at + 1][0] == 2 and lines[at + 1][2] == pytest.approx(means(folder)[0, "makespan"])


def test_sheets_keep_their_heads_and_show_numbers_as_people_read_them(folder: Path) -> None:
    book = openpyxl.load_workbook(folder / "report.xlsx")
    frozen = {sheet.title: sheet.freeze_panes for sheet in book}
    assert frozen["rows"] == frozen["summary"] == frozen["comparisons"] == "A2"
    head = [cell.value for cell in book["summary"][1]]
    assert book["summary"].cell(2, head.index("mean") + 1).number_format.startswith("#,##0")
    for sheet in book:
        for row in sheet.iter_rows():
            assert not [
                c for c in row if isinstance(c.value, float) and c.number_format == "General"
            ]
        assert max(one.width for one in sheet.column_dimensions.values()) <= 40


def test_a_workbook_stands_for_the_text(folder: Path, capsys: Any, tmp_path: Path) -> None:
    path = tmp_path / "report.xlsx"
    code, out, err = report(capsys, str(folder / "results"), "--out", str(path))
    assert (code, out, err) == (0, "", f"automaton: wrote {path}\n")
    assert openpyxl.load_workbook(path).sheetnames[0] == "answer"
    code, _, err = report(capsys, str(folder / "results"), "--format", "xlsx")
    assert code == 2 and "needs --out FILE" in err and err.count("\n") == 1
    assert report(capsys, str(folder / "results"), "--json", "--format", "html")[0] == 2


def test_csv_has_the_numbers_of_the_rows(folder: Path) -> None:
    summaries = list(csv.DictReader((folder / "summary.csv").open()))
    told = {(int(one["point"]), one["metric"]): float(one["mean"]) for one in summaries}
    assert told == pytest.approx(means(folder))
    compared = list(csv.DictReader((folder / "comparisons.csv").open()))
    assert [(one["point"], one["against"]) for one in compared] == [("1", "0"), ("3", "2")] * 2
    lines = (folder / "rows.csv").read_text().splitlines()
    seed = rows_of(folder)[0]["seed"]
    assert f'"{seed}"' in lines[1]


def test_columns_have_no_dots_and_none_is_empty(folder: Path) -> None:
    for name in ("rows.csv", "summary.csv", "comparisons.csv"):
        rows = list(csv.DictReader((folder / name).open()))
        assert not [column for column in rows[0] if "." in column]
        assert not [column for column in rows[0] if all(row[column] == "" for row in rows)]
    table = parquet.read_table(folder / "rows.parquet")
    assert {"fleet_robots", "strategy_allocation"} <= set(table.column_names)
    assert "error" not in table.column_names  # no run failed
    assert all(table.column(name).null_count < 12 for name in table.column_names)


def test_json_has_the_answer_and_the_numbers_of_the_rows(folder: Path, capsys: Any) -> None:
    code, out, err = report(capsys, str(folder / "results"), "--json")
    assert (code, err) == (0, "")
    data = json.loads(out)
    assert data == json.loads((folder / "report.json").read_text())
    told = {(one["point"], one["metric"]): one["mean"] for one in data["metrics"]}
    assert told == pytest.approx(means(folder))
    (answer,) = data["answers"]
    assert answer["leading"] in answer["candidates"] and answer["metric"] == "makespan"
    assert [one["p_adjusted"] for one in data["comparisons"]] and data["effects"][0]["main"]
    assert data["points"][1]["levels"]["strategy.allocation"] == {"name": "cooperative"}


@pytest.mark.parametrize("option", ["--summary", "--comparisons", "--format=xlsx"])
def test_what_is_no_table_of_ours_is_not_replaced(
    folder: Path, capsys: Any, tmp_path: Path, option: str
) -> None:
    given = [option, "--out"] if option.startswith("--format") else [option]
    mine = tmp_path / "mine.yaml"
    mine.write_text("name: mine")
    code, _, err = report(capsys, str(folder / "results"), *given, str(mine))
    assert code == 2 and "is not a table of results, so it is not overwritten" in err
    assert mine.read_text() == "name: mine"
    mine.unlink()
    assert [report(capsys, str(folder / "results"), *given, str(mine))[0] for _ in "ab"] == [0, 0]


def test_columns_that_would_become_equal_stay_apart() -> None:
    assert column_names(["a.b", "a_b", "c"]) == ["a_b", "a_b_", "c"]


def test_a_column_that_says_nothing_is_left_out() -> None:
    records = [{"a": 1, "b": None, "c": float("nan")}, {"a": None, "b": None, "c": None}]
    assert without_empty(records) == [{"a": 1}, {"a": None}]


def test_text_in_csv_is_no_formula() -> None:
    assert [csv_cell(one) for one in ("=1+1", "@sum", "-x", -1, "a=b")] == [
        '"\'=1+1"', '"\'@sum"', '"\'-x"', "-1", '"a=b"',
    ]  # fmt: skip


def test_text_in_csv_is_quoted(tmp_path: Path) -> None:
    assert [csv_cell(one) for one in ('a "b"', 1, 0.5, None, True)] == [
        '"a ""b"""', "1", "0.5", "", "True",
    ]  # fmt: skip
    write_records_csv([], ("metric", "point"), tmp_path / "none.csv")
    assert (tmp_path / "none.csv").read_text() == "metric,point\n"
