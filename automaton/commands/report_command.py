"""Report on the results of a sweep: the answer, tables, intervals, comparisons, curves and maps.

Exit code 0: done; 2: bad input.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from automaton.commands.arguments import XLSX, add_output_arguments, note, output_of, whole
from automaton.errors import InputError

if TYPE_CHECKING:
    from automaton.documents.report_document import ReportDocument
    from automaton.studies.reports.build_report import StudyReport
    from automaton.studies.sweeps.result_store import Store


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton report`."""
    add = parser.add_argument
    add("folder", type=Path, metavar="DIR", help="the folder with the results of a sweep")
    add_output_arguments(parser)
    add(
        "--xlsx",
        type=Path,
        metavar="FILE",
        help="write the report and all rows to a workbook, and print no text (extra excel)",
    )
    text = "write curves and maps as PNG and SVG (extra plots)"
    add("--plots", type=Path, metavar="DIR", help=text)
    text = "write a CSV file with a line per point and metric"
    add("--summary", type=Path, metavar="FILE", help=text)
    text = "write a CSV file with the declared comparisons"
    add("--comparisons", type=Path, metavar="FILE", help=text)
    text = "write a CSV file with all rows, for a spreadsheet"
    add("--csv", type=Path, metavar="FILE", help=text)
    text = "write a Parquet file with all rows, for pandas, polars or DuckDB"
    add("--parquet", type=Path, metavar="FILE", help=text)
    text = "write a CSV file with a line per point and hour (or --every)"
    add("--periods", type=Path, metavar="FILE", help=text)
    add(
        "--every",
        metavar="PERIOD",
        help="show results by this period instead of by hour: a time such as 30min, a multiple of 15 min",
    )
    add(
        "--floor",
        type=whole("a design point", 0),
        action="append",
        default=[],
        metavar="POINT",
        help="add maps of lost time and traffic for one run of this point; may be repeated",
    )


def run(args: argparse.Namespace) -> int:
    """Read, compose, write."""
    from automaton.documents.html_output import figure_class, write_plots
    from automaton.studies.reports.build_report import document_of, read_report
    from automaton.studies.sweeps.result_store import Store

    if args.folder.is_file():
        raise InputError(
            "is a file, but a report needs the folder of a sweep; to compare two recordings, use "
            "automaton replay ONE OTHER",
            str(args.folder),
        )
    if args.plots is not None:
        figure_class()  # fails before any computation if matplotlib is missing
    output = output_of(args)
    has_text = args.xlsx is None or args.out is not None or args.json or args.format is not None
    if output.format == XLSX:
        if args.xlsx is not None:
            raise InputError("names a second workbook; leave it out", f"--xlsx {args.xlsx}")
        args.xlsx, has_text = output.file, False
    check_files(args)
    store = Store(args.folder)
    report = read_report(store)
    document = document_of(report, store, args.floor, args.every)
    wrote = write_files(args, store, report, document)
    if args.plots is not None:
        wrote += write_plots(document.blocks, args.plots)
    for path in wrote:
        note(f"wrote {path}")
    if has_text:
        from automaton.studies.reports.export import as_json

        output.write(lambda: document, lambda: as_json(report, args.every))
    return 0


def check_files(args: argparse.Namespace) -> None:
    """Raise InputError, before anything is written, if a file to replace is not our table."""
    from automaton.documents.workbook import WORKBOOK_BEGINS, check_replaced, openpyxl
    from automaton.studies.reports.export import (
        COMPARISONS_BEGIN,
        PARQUET_BEGINS,
        PERIODS_BEGIN,
        ROWS_BEGIN,
        SUMMARY_BEGINS,
    )

    for path, begins in (
        (args.csv, ROWS_BEGIN),
        (args.parquet, PARQUET_BEGINS),
        (args.summary, SUMMARY_BEGINS),
        (args.comparisons, COMPARISONS_BEGIN),
        (args.periods, PERIODS_BEGIN),
        (args.xlsx, WORKBOOK_BEGINS),
    ):
        if path is not None:
            check_replaced(path, begins)
    if args.xlsx is not None:
        openpyxl("workbooks are written")


def write_files(
    args: argparse.Namespace, store: Store, report: StudyReport, document: ReportDocument
) -> list[Path]:
    """Write the requested tables; return their files. Raises InputError."""
    from automaton.studies.reports.export import (
        comparison_records,
        periods_of_points,
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
    if args.periods or args.xlsx:
        periods = periods_of_points(report, args.every)
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
    if args.periods is not None:
        write_records_csv(periods, ("point", "point_name", "runs", "from"), args.periods)
        wrote.append(args.periods)
    if args.xlsx is not None:
        write_workbook(document, summaries, compared, periods, rows, args.xlsx)
        wrote.append(args.xlsx)
    return wrote
