"""The HTML report on paper: all columns of all tables are on the page, as Chromium prints it."""

from __future__ import annotations

import re
import shutil
import subprocess
import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from report_helpers import tables
from synthetic_results import noise, study_of, synthetic_store

from automaton.documents.html_output import as_html, page_parts
from automaton.documents.report_document import (
    Block,
    Heading,
    Listed,
    PageBreak,
    ReportDocument,
    Table,
    Text,
)
from automaton.studies.reports.comparison_tables import comparison_section, effects_section
from automaton.studies.reports.comparisons import answers, comparisons
from automaton.studies.reports.first_page import answer_section, first_page
from automaton.studies.reports.metric_tables import metric_section
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import Analysis, Study

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
A4 = {(595, 842), (842, 595)}  # points
STUDIES = {
    "tabletop-fleet": (
        ("tabletop-1", "tabletop-2"),
        {
            "fleet.robots": (1, 2, 3, 4, 5),
            "strategy.allocation": ("independent", "cooperative", "adaptive"),
        },
        {"strategy.allocation": "independent"},
        ("makespan", "operations_per_robot", "empty_moves_share"),
    ),
    "warehouse-fleet": (
        "warehouse-100",
        {
            "fleet.robots": (6, 20, 50),
            "strategy.routing": (
                {"name": "astar", "tie_break": "random"},
                {"name": "traffic-avoidance", "tie_break": "random"},
                "congestion",
            ),
        },
        {"strategy.routing": {"name": "astar", "tie_break": "random"}},
        ("delay", "task_time", "throughput_per_robot"),
    ),
}


def results_like(name: str) -> Results:
    """The points and metrics of a shipped study, with runs made up."""
    scenario, factors, baseline, metrics = STUDIES[name]
    analysis = Analysis(metrics=metrics, baseline=baseline, comparisons="baseline", precision=0.02)
    study = Study(name=name, scenario=scenario, factors=factors, replications=4, analysis=analysis)
    columns: dict[str, Any] = {metric: lambda p, r: 100 * noise(p, r) for metric in metrics}
    return synthetic_store(study, noise, **columns)


def blocks_of(results: Results) -> list[Block]:
    """What a report on them prints, without the parts that need a folder."""
    blocks: list[Block] = [
        *first_page(results, answers(results), []),
        PageBreak(),
        *answer_section(results, answers(results), comparisons(results)),
        *effects_section(results),
    ]
    for metric in results.analysis.metrics:
        blocks += metric_section(results, {}, metric)
    return [*blocks, *comparison_section(results)]


def printed(page: str, folder: Path) -> Path:
    """A page as PDF."""
    (folder / "report.html").write_text(page)
    out = folder / "report.pdf"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer"]
    command = [str(BROWSER), *options, f"--user-data-dir={folder / 'profile'}"]
    command += [f"--print-to-pdf={out}", (folder / "report.html").as_uri()]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return out


def words_on_paper(path: Path) -> list[str]:
    """The words of each page that begin between its left and its right margin; A4 all of them."""
    pypdf = pytest.importorskip("pypdf")
    pages = []
    for page in pypdf.PdfReader(path).pages:
        width, height = round(page.mediabox.width), round(page.mediabox.height)
        assert (width, height) in A4
        words: list[str] = []

        def visit(
            text: str,
            cm: Any,
            tm: Any,
            font: Any,
            size: float,
            words: Any = words,
            width: int = width,
        ) -> None:
            x = tm[4] * cm[0] + cm[4]
            end = x + 0.35 * size * cm[0] * len(text.strip())  # narrow letters are 0.35 of the size
            if text.strip() and x > 20:
                assert end < width, f"{text!r} ends beyond the page"
                words.append(text.strip())

        page.extract_text(visitor_text=visit)
        pages.append(unicodedata.normalize("NFKC", "".join(words)))  # without ligatures
    return pages


@pytest.mark.skipif(BROWSER is None, reason="no Chromium")
@pytest.mark.parametrize("name", STUDIES)
def test_all_columns_are_on_paper(name: str, tmp_path: Path) -> None:
    pytest.importorskip("pypdf")
    blocks = blocks_of(results_like(name))
    pages = words_on_paper(printed(as_html(ReportDocument(name, blocks)), tmp_path))
    text = "".join("".join(pages).split())
    missing = {
        word
        for table in tables(blocks)
        for line in (table.head, *table.rows)
        for cell in line
        for word in cell.split()
        if word not in text
    }
    assert not missing


@pytest.mark.skipif(BROWSER is None, reason="no Chromium")
def test_a_short_table_is_on_one_page_with_its_heading(tmp_path: Path) -> None:
    blocks: list[Block] = []
    for number in range(12):
        rows = [[f"[{number}.{row}]", "1"] for row in range(number + 3)]
        blocks += [Heading(f"[{number}.title]"), Text("What it has."), Table(["row", "n"], rows)]
    pages = words_on_paper(printed(as_html(ReportDocument("tables", blocks)), tmp_path))
    on = {part: page for page, words in enumerate(pages)
          for part in re.findall(r"\[[\w.]+\]", words)}  # fmt: skip
    assert len(on) == 12 + sum(range(3, 15)) and len(pages) > 2
    for number in range(12):
        assert len({on[f"[{number}.{part}]"] for part in ("title", *range(number + 3))}) == 1


@pytest.mark.skipif(BROWSER is None, reason="no Chromium")
@pytest.mark.parametrize("name", STUDIES)
def test_the_first_page_has_the_answer_and_its_picture(name: str, tmp_path: Path) -> None:
    results = results_like(name)
    pages = words_on_paper(printed(as_html(ReportDocument(name, blocks_of(results))), tmp_path))
    metric = results.analysis.metrics[0]
    assert "Question" in pages[0] and "Decision" in pages[0] and f"{metric} by " in pages[0]
    assert "Leading points" in pages[1]
    assert "Effects of the factors" in pages[1] + pages[2], "a wide table is on a page of its own"


def divs(blocks: Sequence[Block]) -> str:
    return "\n".join(page_parts(blocks))


def test_a_wide_table_is_turned_together_with_its_heading() -> None:
    narrow = Table(["a", "b"], [["x", "1"]])
    wide = Table(["name", *(f"column {n}" for n in range(20))], [["x", *["1,000"] * 20]])
    page = divs([Heading("Narrow"), narrow, Heading("Wide"), wide])
    before, _, turned = page.partition('<div class="turned">')
    assert "<h2>Narrow</h2>" in before and "<h2>Wide</h2>" in turned and "<table>" in before
    assert "turned" not in divs([Heading("Narrow"), narrow])
    assert "turned" not in divs([Heading("The first page"), wide, PageBreak()])


def test_what_is_said_below_a_wide_table_is_on_its_page() -> None:
    wide = Table(["name", *(f"column {n}" for n in range(20))], [["x", *["1,000"] * 20]])
    said = [Listed(["a warning"]), Text("A remark.")]
    page = divs([Heading("Wide"), wide, *said, Heading("Wide, too"), wide, Heading("Narrow")])
    before, turned = page.split('<div class="turned">')
    assert "<h2>" not in before and turned.endswith("\n</div>\n<h2>Narrow</h2>")
    assert "a warning" in turned and "A remark." in turned and turned.count("<table>") == 2


def test_lines_differ_by_more_than_colour() -> None:
    factors = {"fleet.robots": (1, 2), "strategy.allocation": tuple("abcdefgh")}
    results = synthetic_store(study_of(factors, 4), noise)
    page = divs(list(first_page(results, answers(results), [])))
    strokes = {line.partition('stroke-dasharray="')[2].partition('"')[0]
               for line in page.split("<polyline")[1:]}  # fmt: skip
    marks = {line.partition('d="')[2].partition('"')[0]
             for line in page.partition("<svg")[2].split("<path ")[1:]}  # fmt: skip
    assert len(strokes) == len(marks) == 8
