"""Report on a folder of results: the answer, tables, intervals, comparisons, curves, maps.

Exit code 0: done; 2: bad input.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from automaton.commands.arguments import add_json_argument, note, whole
from automaton.errors import InputError

if TYPE_CHECKING:
    from automaton.runs.report_document import ReportDocument
    from automaton.studies.reports.build_report import StudyReport
    from automaton.studies.sweeps.result_store import Store

REPORT_FORMATS = ("text", "markdown", "html", "json")
FORMAT_BY_SUFFIX = {
    ".md": "markdown",
    ".html": "html",
    ".htm": "html",
    ".txt": "text",
    ".json": "json",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton report`."""
    add = parser.add_argument
    add("folder", type=Path, metavar="DIR", help="where a sweep keeps its results")
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        "--format", choices=REPORT_FORMATS, help="text; or what the name of --out says"
    )
    add_json_argument(form)
    add("--out", type=Path, metavar="FILE", help="write the report there: one file to give away")
    add(
        "--xlsx",
        type=Path,
        metavar="FILE",
        help="the report and all rows as a workbook, instead of the text (extra excel)",
    )
    add("--plots", type=Path, metavar="DIR", help="curves and maps as PNG and SVG (extra plots)")
    add("--summary", type=Path, metavar="FILE", help="a line for each point and metric, as CSV")
    add("--comparisons", type=Path, metavar="FILE", help="the declared comparisons, as CSV")
    add("--csv", type=Path, metavar="FILE", help="all rows, for a spreadsheet")
    add("--parquet", type=Path, metavar="FILE", help="all rows, for pandas, polars or DuckDB")
    add(
        "--floor",
        type=whole("a design point", 0),
        action="append",
        default=[],
        metavar="POINT",
        help="also where robots lost time and drove in one run of this point; may be repeated",
    )


def run(args: argparse.Namespace) -> int:
    """Read, compose, write."""
    from automaton.studies.reports.build_report import document_of, read_report
    from automaton.studies.reports.html_output import figure_class, write_plots
    from automaton.studies.sweeps.result_store import Store

    if args.folder.is_file():
        raise InputError(
            "is a file; a report is made of the folder of a sweep, two recordings are compared by "
            "automaton replay ONE OTHER",
            str(args.folder),
        )
    if args.plots is not None:
        figure_class()  # says what is missing before anything is computed
    form = form_of("json" if args.json else args.format, args.out)
    check_files(args)
    store = Store(args.folder)
    report = read_report(store)
    document = document_of(report, store, args.floor)
    wrote = write_files(args, store, report, document)
    if args.plots is not None:
        wrote += write_plots(document.blocks, args.plots)
    is_asked = args.xlsx is None or args.format is not None or args.json
    text = rendered(report, document, form) if is_asked or args.out is not None else ""
    if args.out is None:
        print(text, end="")
    else:
        from automaton.atomic_write import atomic_writer

        with atomic_writer(args.out) as file:
            file.write(text.encode())
        wrote.append(args.out)
    for path in wrote:
        note(f"wrote {path}")
    return 0


def check_files(args: argparse.Namespace) -> None:
    """Refuse to replace what is not a table of ours, before anything is written. Raises InputError."""
    from automaton.studies.reports.export import (
        COMPARISONS_BEGIN,
        PARQUET_BEGINS,
        ROWS_BEGIN,
        SUMMARY_BEGINS,
        WORKBOOK_BEGINS,
        check_replaced,
    )
    from automaton.tables.table_files import openpyxl

    for path, begins in (
        (args.csv, ROWS_BEGIN),
        (args.parquet, PARQUET_BEGINS),
        (args.summary, SUMMARY_BEGINS),
        (args.comparisons, COMPARISONS_BEGIN),
        (args.xlsx, WORKBOOK_BEGINS),
    ):
        if path is not None:
            check_replaced(path, begins)
    if args.xlsx is not None:
        openpyxl("workbooks are written")


def write_files(
    args: argparse.Namespace, store: Store, report: StudyReport, document: ReportDocument
) -> list[Path]:
    """The tables that were asked for; the files written. Raises InputError."""
    from automaton.studies.reports.export import (
        comparison_records,
        summary_records,
        without_empty,
        write_parquet,
        write_records_csv,
        write_rows_csv,
        write_workbook,
    )
    from automaton.studies.reports.study_results import measured_rows

    results = report.results
    wrote: list[Path] = []
    if args.csv or args.parquet or args.xlsx:
        rows, _ = measured_rows(store)
    if args.summary or args.xlsx:
        summaries = without_empty(list(summary_records(results, report.scenarios)))
    compared = without_empty(list(comparison_records(results, report.compared)))
    if args.csv is not None:
        write_rows_csv(rows, args.csv)
        wrote.append(args.csv)
    if args.parquet is not None:
        write_parquet(rows, args.parquet)
        wrote.append(args.parquet)
    if args.summary is not None:
        write_records_csv(summaries, ("point", "metric", "mean"), args.summary)
        wrote.append(args.summary)
    if args.comparisons is not None:
        write_records_csv(compared, ("metric", "point", "against", "difference"), args.comparisons)
        wrote.append(args.comparisons)
    if args.xlsx is not None:
        write_workbook(document, summaries, compared, rows, args.xlsx)
        wrote.append(args.xlsx)
    return wrote


def form_of(form: str | None, out: Path | None) -> str:
    """The format that was asked for, or that a file's name says. Raises InputError."""
    if form is not None or out is None:
        return form or "text"
    if out.suffix.lower() not in FORMAT_BY_SUFFIX:
        known = ", ".join(FORMAT_BY_SUFFIX)
        more = "; a workbook is written by --xlsx" if out.suffix.lower() == ".xlsx" else ""
        raise InputError(
            f"--out {out}: its name ends with no known format ({known}); use --format{more}"
        )
    return FORMAT_BY_SUFFIX[out.suffix.lower()]


def rendered(report: StudyReport, document: ReportDocument, form: str) -> str:
    """The report in a format."""
    if form == "json":
        from automaton.studies.reports.export import as_json

        return json.dumps(as_json(report), indent=2, ensure_ascii=False) + "\n"
    if form == "html":
        from automaton.studies.reports.html_output import as_html

        return as_html(document)
    from automaton.studies.reports.text_output import as_markdown, as_text

    return as_markdown(document) if form == "markdown" else as_text(document)
