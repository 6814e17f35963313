"""Report on a folder of results: tables, intervals, comparisons, curves, maps.

Exit code 0: done; 2: bad input.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from automaton.commands.arguments import note, whole
from automaton.errors import InputError

if TYPE_CHECKING:
    from automaton.runs.report_document import Document

FORMATS = ("text", "markdown", "html")
SUFFIXES = {".md": "markdown", ".html": "html", ".htm": "html", ".txt": "text"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton report`."""
    add = parser.add_argument
    add("folder", type=Path, metavar="DIR", help="where a sweep keeps its results")
    add("--format", choices=FORMATS, help="text; or what the name of --out says")
    add("--out", type=Path, metavar="FILE", help="write the report there: one file to give away")
    add("--plots", type=Path, metavar="DIR", help="curves and maps as PNG and SVG (extra plots)")
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
    from automaton.studies.reports.build_report import compose
    from automaton.studies.reports.export import (
        CSV_BEGINS,
        PARQUET_BEGINS,
        check_replaced,
        write_csv,
        write_parquet,
    )
    from automaton.studies.reports.plot_files import figure_class, write_plots
    from automaton.studies.reports.warm_up_cut import measured_rows
    from automaton.studies.sweeps.result_store import Store

    if args.folder.is_file():
        raise InputError(
            "is a file; a report is made of the folder of a sweep, two recordings are compared by "
            "automaton replay ONE OTHER",
            str(args.folder),
        )
    if args.plots is not None:
        figure_class()  # says what is missing before anything is computed
    form = form_of(args.format, args.out)
    for path, begins in ((args.csv, CSV_BEGINS), (args.parquet, PARQUET_BEGINS)):
        if path is not None:
            check_replaced(path, begins)
    store = Store(args.folder)
    document = compose(store, args.floor)
    wrote: list[Path] = []
    if args.csv is not None or args.parquet is not None:
        rows, _ = measured_rows(store)
        for path, write in ((args.csv, write_csv), (args.parquet, write_parquet)):
            if path is not None:
                write(rows, path)
                wrote.append(path)
    if args.plots is not None:
        wrote += write_plots(document.blocks, args.plots)
    text = rendered(document, form)
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


def form_of(form: str | None, out: Path | None) -> str:
    """The format that was asked for, or that a file's name says. Raises InputError."""
    if form is not None or out is None:
        return form or "text"
    if out.suffix.lower() not in SUFFIXES:
        known = ", ".join(SUFFIXES)
        raise InputError(f"--out {out}: its name ends with no known format ({known}); use --format")
    return SUFFIXES[out.suffix.lower()]


def rendered(document: Document, form: str) -> str:
    """The report in a format."""
    if form == "html":
        from automaton.studies.reports.html_output import as_html

        return as_html(document)
    from automaton.studies.reports.text_output import as_markdown, as_text

    return as_markdown(document) if form == "markdown" else as_text(document)
