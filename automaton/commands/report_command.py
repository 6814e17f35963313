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
    text = "write curves and maps as PNG and SVG files (needs fleet-automaton[plots])"
    add("--plots", type=Path, metavar="DIR", help=text)
    text = "write a CSV file with a line per point and metric"
    add("--summary", type=Path, metavar="FILE", help=text)
    text = "write a CSV file with the declared comparisons"
    add("--comparisons", type=Path, metavar="FILE", help=text)
    text = "write a CSV file with all rows, for a spreadsheet"
    add("--csv", type=Path, metavar="FILE", help=text)
    text = "write a Parquet file with all rows, for pandas, polars or DuckDB"
    add("--parquet", type=Path, metavar="FILE", help=text)
    text = "write a zip with all inputs, results, versions and digests, for `automaton verify`"
    add("--archive", type=Path, metavar="FILE", help=text)
    text = "write a CSV file with a line per point and period (see --every)"
    add("--periods", type=Path, metavar="FILE", help=text)
    add(
        "--every",
        metavar="PERIOD",
        help="divide results into periods of this length: a multiple of 15 min, such as 30min "
        "(default: 1 h)",
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
    book = output.file if output.format == XLSX else None
    check_files(args)
    store = Store(args.folder)
    report = read_report(store)
    document = document_of(report, store, args.floor, args.every)
    wrote = write_files(args, book, store, report, document)
    if args.plots is not None:
        wrote += write_plots(document.blocks, args.plots)
    for path in wrote:
        note(f"wrote {path}")
    if book is None:
        from automaton.studies.reports.export import as_json

        output.write(lambda: document, lambda: as_json(report, args.every))
    return 0


def check_files(args: argparse.Namespace) -> None:
    """Raise InputError, before anything is written, if a file to replace is not our table."""
    from automaton.documents.workbook import check_replaced
    from automaton.studies.reports.export import (
        COMPARISONS_BEGIN,
        PARQUET_BEGINS,
        PERIODS_BEGIN,
        ROWS_BEGIN,
        SUMMARY_BEGINS,
    )
    from automaton.studies.sweeps.results_archive import ARCHIVE_BEGINS

    for path, begins in (
        (args.csv, ROWS_BEGIN),
        (args.parquet, PARQUET_BEGINS),
        (args.summary, SUMMARY_BEGINS),
        (args.comparisons, COMPARISONS_BEGIN),
        (args.archive, ARCHIVE_BEGINS),
        (args.periods, PERIODS_BEGIN),
    ):
        if path is not None:
            check_replaced(path, begins)


def write_files(
    args: argparse.Namespace,
    book: Path | None,
    store: Store,
    report: StudyReport,
    document: ReportDocument,
) -> list[Path]:
    """Write the requested tables and the workbook; return their files. Raises InputError."""
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
    if args.csv or args.parquet or book:
        rows, _ = measured_rows(store)
    if args.summary or book:
        summaries = without_empty(list(summary_records(results, report.scenarios)))
    if args.periods or book:
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
    if book is not None:
        write_workbook(document, summaries, compared, periods, rows, book)
        wrote.append(book)
    if args.archive is not None:
        from automaton.documents.html_output import as_html
        from automaton.studies.sweeps.results_archive import write_archive

        write_archive(store, as_html(document), args.archive)
        wrote.append(args.archive)
    return wrote
