"""`automaton report`: a tiny folder in every format, declared comparisons, what failed, bad input."""

from __future__ import annotations

import csv
import math
import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from report_helpers import report, tables
from synthetic_results import noise, study_of, synthetic_store

from automaton.commands import main
from automaton.documents.html_output import as_html
from automaton.documents.report_document import (
    Curves,
    Heading,
    HeatMap,
    Listed,
    ReportCurve,
    ReportDocument,
    Table,
    Text,
)
from automaton.documents.text_output import (
    as_markdown,
    as_text,
    chart,
    coarse,
    shaded,
)
from automaton.studies.inference.intervals import effect
from automaton.studies.reports.build_report import remarks
from automaton.studies.reports.comparison_tables import comparison_section
from automaton.studies.reports.comparisons import comparisons, declared_pairs
from automaton.studies.reports.metric_tables import metric_section, summary
from automaton.studies.reports.study_results import columns_of

pa = pytest.importorskip("pyarrow")

STUDY = """
name: tiny
summary: Two fleets, two allocations.
scenario: tabletop-mini
factors:
  fleet.robots: [2, 3]
  strategy.allocation: [independent, cooperative]
replications: 6
analysis:
  metrics: [makespan, blocked_share]
  baseline: {strategy.allocation: independent}
  comparisons: baseline
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("report")
    (place / "tiny.yaml").write_text(STUDY)
    out = place / "results"
    assert main(["sweep", str(place / "tiny.yaml"), "--out", str(out), "--workers", "1"]) == 0
    return out


def same_everywhere(text: str) -> str:
    """Without what depends on the code's state and the machine."""
    text = re.sub(r"(?s)[0-9a-f]{16}; python.*?, msgspec [\d.]+", "CODE", text)
    return re.sub(r"Results of \d{4}-\d\d-\d\d", "Results of DATE", text)


def test_the_report_in_text(folder: Path, capsys: Any, grid_snapshot: Callable[..., None]) -> None:
    code, out, err = report(capsys, str(folder), "--floor", "1")
    assert (code, err) == (0, "")
    assert "another end" not in out
    grid_snapshot(re.sub(r"(?m)^-{90,}$", "", same_everywhere(out)))


def test_the_report_in_markdown(
    folder: Path, capsys: Any, grid_snapshot: Callable[..., None]
) -> None:
    code, out, _ = report(capsys, str(folder), "--format", "markdown")
    assert code == 0
    grid_snapshot(same_everywhere(out))


class Tags(HTMLParser):
    """Checks that tags close in order, and collects those that load something."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[Any] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        if tag not in ("meta", "!doctype"):
            self.open.append(tag)
        self.loads += [(name, value) for name, value in attrs if name in ("src", "href")]

    def handle_startendtag(self, tag: str, attrs: Any) -> None:
        self.loads += [(name, value) for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_report_as_one_html_file_that_loads_nothing(
    folder: Path, capsys: Any, tmp_path: Path
) -> None:
    out = tmp_path / "report.html"
    code, printed, err = report(capsys, str(folder), "--out", str(out), "--floor", "0")
    assert (code, printed) == (0, "")
    assert err == f"automaton: wrote {out}\n"
    tags = Tags()
    tags.feed(out.read_text())
    assert tags.open == [] and tags.loads == []
    text = out.read_text()
    for told in ("estimand", "Student&#x27;s", "automaton sweep study.yaml", "<svg", "Lost time",
                 "adjusted p", "var. ratio", "lower bound"):  # fmt: skip
        assert told in text
    folded = text.partition("<details><summary>study.yaml</summary>")[2].partition("</details>")[0]
    assert "name: tiny" in folded
    assert list(tmp_path.iterdir()) == [out]


def test_rows_for_other_tools(folder: Path, capsys: Any, tmp_path: Path) -> None:
    import pyarrow.parquet

    table, sheet = tmp_path / "rows.parquet", tmp_path / "rows.csv"
    code, _, err = report(capsys, str(folder), "--parquet", str(table), "--csv", str(sheet))
    assert code == 0 and "rows.csv" in err
    rows = list(csv.DictReader(sheet.open()))
    columns = pyarrow.parquet.read_table(table)
    assert len(rows) == columns.num_rows == 24
    assert [float(row["makespan"]) for row in rows] == columns.column("makespan").to_pylist()
    assert {row["strategy_allocation"] for row in rows} == {"independent", "cooperative"}


def test_plots(folder: Path, capsys: Any, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    code, _, _ = report(capsys, str(folder), "--plots", str(tmp_path / "plots"), "--floor", "0")
    assert code == 0
    names = {path.name for path in (tmp_path / "plots").iterdir()}
    assert {"makespan-by-fleet-robots.png", "makespan-by-fleet-robots.svg"} <= names
    assert any(name.startswith("lost-time-point-0") for name in names)


def test_without_matplotlib_plots_are_refused_in_a_sentence(
    folder: Path, capsys: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    code, out, err = report(capsys, str(folder), "--plots", str(tmp_path / "plots"))
    assert (code, out) == (2, "")
    assert "pip install 'fleet-automaton[plots]'" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--floor", "9"], "--floor 9: the study has the points 0 to 3"),
        (["--floor", "x"], "is not a design point"),
        (["--format", "pdf"], "invalid choice: 'pdf'"),
        (["--out", "report.pdf"], "no format has this extension"),
        (["--out", "/nowhere/report.md"], "cannot write it"),
        (["--csv", "/nowhere/rows.csv"], "cannot write it"),
    ],
)
def test_bad_input_is_one_sentence(
    folder: Path, capsys: Any, arguments: list[str], told: str
) -> None:
    code, out, err = report(capsys, str(folder), *arguments)
    assert (code, out) == (2, "")
    assert told in err and err.count("\n") == 1


def test_what_is_no_table_is_not_replaced_by_one(folder: Path, capsys: Any, tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    for option in ("--csv", "--parquet"):
        mine.write_text("name: mine")
        code, _, err = report(capsys, str(folder), option, str(mine))
        assert code == 2 and "is not a table of results, so it is not overwritten" in err
        assert mine.read_text() == "name: mine"
        mine.unlink()
        assert [report(capsys, str(folder), option, str(mine))[0] for _ in range(2)] == [0, 0]
    # Nor is anything written where the report itself has no format.
    rows = tmp_path / "rows.csv"
    assert report(capsys, str(folder), "--csv", str(rows), "--out", "report.pdf")[0] == 2
    assert not rows.exists()


def test_a_folder_without_results(capsys: Any, tmp_path: Path) -> None:
    assert report(capsys, str(tmp_path))[0] == 2
    assert report(capsys, str(tmp_path / "none"))[0] == 2
    (tmp_path / "run.rec").touch()
    code, _, err = report(capsys, str(tmp_path / "run.rec"))
    assert code == 2 and "is a file" in err and "automaton replay ONE OTHER" in err


def test_a_report_says_what_is_damaged(folder: Path, capsys: Any, tmp_path: Path) -> None:
    out = tmp_path / "results"
    shutil.copytree(folder, out)
    (file,) = (out / "rows").glob("*.parquet")
    file.write_bytes(file.read_bytes()[:-100])
    code, _, err = report(capsys, str(out))
    assert code == 2
    said = f"holds no readable runs; damaged: {file.name}; sweep again to repair\n"
    assert err == f"automaton: {out}: {said}"


# Results made up, without runs.


def test_failed_and_unfinished_runs_stand_in_every_table_and_in_no_mean() -> None:
    study = study_of({"fleet.robots": (1, 2)}, comparisons="pairs")
    results = synthetic_store(
        study,
        lambda p, r: None if r == 0 else (9999.0 if r == 1 else 100.0),
        error=lambda p, r: "it broke" if r == 0 else None,
        finished=lambda p, r: r > 1,
    )
    counts = results.counts(study.points[0])
    assert (counts.done, counts.finished, counts.censored, counts.failed) == (60, 58, 1, 1)
    assert set(results.values(study.points[0], "makespan").values()) == {100.0}
    for table in tables([*metric_section(results, {}, "makespan"), *comparison_section(results)]):
        assert {"runs", "unfinished", "failed"} <= set(table.head)
    notes = " ".join(remarks(results))
    assert "2 runs did not finish" in notes and "2 runs failed" in notes and "it broke" in notes


def test_ticks_per_second_are_those_of_whole_runs() -> None:
    table = pa.table({"ticks": [600, 600, None], "cpu_s": [2.0, 0.5, None]})
    assert columns_of(table)["ticks_per_second"] == [300.0, 1200.0, None]


def test_points_that_deliver_different_shares_of_orders_get_a_caveat() -> None:
    study = study_of({"fleet.robots": (1, 2)})
    assert study.analysis is not None
    analysis = structs.replace(study.analysis, metrics=("makespan", "lead_time"))
    study = structs.replace(study, analysis=analysis)

    def notes_of(delivered: int) -> str:
        results = synthetic_store(
            study,
            noise,
            orders=lambda p, r: 50,
            delivered=lambda p, r: 50 if p else delivered,
            lead_time=lambda p, r: 100.0,
        )
        return " ".join(remarks(results))

    assert "count delivered orders only" not in notes_of(50)
    said = "shares of their orders, 80 % with robots 1 and 100 % with robots 2: lead_time count"
    assert said in notes_of(40)


def test_what_was_not_measured_is_in_no_mean() -> None:
    study = study_of({"fleet.robots": (1, 2)})
    results = synthetic_store(study, lambda p, r: 100.0 if r % 3 else None)
    (table,) = tables(blocks := list(metric_section(results, {}, "makespan")))
    assert [row[1] for row in table.rows] == ["100", "100"]
    (listed, *_) = (block for block in blocks if isinstance(block, Listed))
    assert listed.items[0].startswith("robots 1: 20 of 60 runs have no makespan; the mean is")


def test_runs_that_lack_are_told() -> None:
    study = study_of({"fleet.robots": (1, 2)}, replications=10)
    whole = synthetic_store(study, noise)
    some = replace(whole, columns={k: v[:15] for k, v in whole.columns.items()}, earlier=1)
    notes = " ".join(remarks(some))
    assert "5 runs of 20 not done yet" in notes
    assert "the analysis or warm-up was changed 1 time after runs had been made" in notes


def test_the_baseline_is_compared_at_equal_other_levels() -> None:
    factors = {"fleet.robots": (1, 2), "strategy.allocation": ("a", "b", "c")}
    study = study_of(factors, comparisons="baseline", baseline={"strategy.allocation": "b"})
    pairs = list(declared_pairs(synthetic_store(study, noise)))
    assert [(a.levels, b.levels) for a, b in pairs] == [
        ({"fleet.robots": n, "strategy.allocation": x}, {"fleet.robots": n, "strategy.allocation": "b"})
        for n in (1, 2)
        for x in ("a", "c")
    ]  # fmt: skip


def test_a_family_shares_its_error() -> None:
    study = study_of({"fleet.robots": (1, 2, 3)}, comparisons="pairs")
    found = comparisons(synthetic_store(study, noise))
    assert [one.family for one in found] == [3, 3, 3]
    alone = effect(
        [noise(1, r) for r in range(60)], [noise(0, r) for r in range(60)], True, 1 - 0.05 / 3
    )
    assert found[0].effect.difference == alone.difference
    assert all(one.adjusted >= one.effect.p for one in found)


def test_few_runs_are_warned_of() -> None:
    results = synthetic_store(study_of({"fleet.robots": (1, 2)}, replications=10), noise)
    listed = [b for b in metric_section(results, {}, "makespan") if isinstance(b, Listed)]
    assert "only 10 runs, skew" in listed[0].items[0]


def test_of_many_warnings_the_most_skewed_point_is_named() -> None:
    study = study_of({"fleet.robots": (1, 2, 3, 4, 5)}, replications=10)
    results = synthetic_store(study, lambda p, r: 100.0 - (r == 9) * 50 if p == 2 else noise(p, r))
    (listed,) = (b for b in metric_section(results, {}, "makespan") if isinstance(b, Listed))
    assert (
        "5 points have fewer than 60 runs (fewest: 10). The most skewed is robots 3"
        in listed.items[0]
    )
    assert "skew -2.7" in listed.items[0]


def test_no_interval_of_a_metric_reaches_below_0() -> None:
    study = study_of({"fleet.robots": (1, 2)}, replications=10)
    results = synthetic_store(study, lambda p, r: 9.0 * (r == 0) if p == 0 else noise(p, r))
    rare, usual = (summary(results, {}, point, "makespan").interval for point in results.points)
    assert rare is not None and usual is not None
    assert rare.low == 0 and rare.high == pytest.approx(0.9 + 2.262157 * 0.9)
    assert usual.low is not None and usual.low > 90


def test_a_chart_by_hand() -> None:
    line = ReportCurve("fleet", [1, 2, 3], [10, 20, 15], [10, 18, 15], [10, 20, math.nan])
    drawn = list(chart(Curves("T by robots", "robots", "ticks", [line]), 13, height=6))
    assert drawn == [
        "T by robots (ticks)",
        "20 |    o",
        "   |    :",
        "   |",
        "14 |        o",
        "   |",
        "10 |o",
        "   +---------",
        "    1   2   3",
        "    robots",
        "    o fleet",
    ] or drawn[1:3] == ["20 |    o", "   |    :"]
    assert list(chart(Curves("T", "x", "y", [])))[1] == "no metrics"


def test_a_map_by_hand() -> None:
    field = np.array([[math.nan, 0.0, 8.0], [math.nan, 1.0, 4.0]])
    drawn = list(shaded(HeatMap("Lost", "ticks", field, "one run", "m", 1.5), 80))
    assert drawn[:4] == ["Lost (most: 8 ticks)", "   0         m", " 0  ·@", "    .="]
    assert drawn[-1] == "one run"
    assert coarse(field, 2).tolist()[0] == [0.5, 6.0]


def test_text_of_users_is_escaped() -> None:
    document = ReportDocument("<b>&|", [Text("<script>|*"), Table(["a|b"], [["<i>"]])])
    page = as_html(document)
    assert "<script>" not in page and "<i>" not in page and "&lt;script&gt;" in page
    assert r"\<script>\|\*" in as_markdown(document)
    for text, shown in (
        ("[a](b)", r"\[a](b)"),
        ("# a", r"\# a"),
        ("- a", r"\- a"),
        ("2. a", r"2\. a"),
        ("1.5 min", "1.5 min"),
    ):
        listed = [Text(text), Listed([text])]
        assert as_markdown(ReportDocument("", listed)) == f"{shown}\n\n- {shown}\n"
    assert "| a\\|b |" in as_markdown(document)
    assert as_markdown(ReportDocument("", [Heading("<b>", 2)])) == "## \\<b>\n"
    assert as_text(document).startswith("<script>|*")


def test_columns_of_a_table_are_aligned() -> None:
    table = Table(["name", "value"], [["a", "1"], ["long name", "1,000"]])
    assert as_text(ReportDocument("", [table])).splitlines() == [
        "name       value",
        "---------  -----",
        "a              1",
        "long name  1,000",
    ]
