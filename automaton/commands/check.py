"""Check scenario and study files without running them."""

from __future__ import annotations

import argparse
import csv
import io
import os
import re
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from automaton.atomic_write import atomic_writer, cannot_write_error
from automaton.commands.arguments import (
    add_json_argument,
    add_refinement_arguments,
    add_settings_argument,
    note,
    print_document,
    print_json,
    print_warnings,
    settings_of,
)
from automaton.documents.report_document import INDENT, Listed, ReportDocument
from automaton.errors import InputError, refuse
from automaton.floor.drawn_floors import floor_picture, write_matrix
from automaton.floor.floor_plan import DESTINATION, DOCK, RACK, SHELF
from automaton.scenario.columns import QuarantinedRows, rows_as_written
from automaton.scenario.document import Document
from automaton.scenario.reading import Reading, document_of, is_study, read
from automaton.scenario.text_files import shipped
from automaton.studies.sweeps.study import Point, Study, shipped_studies
from automaton.studies.sweeps.sweep_plan import check_study, describe_point
from automaton.units import count, shown_unit
from automaton.world.bounds import bounds_in_words
from automaton.world.capabilities import default_right_of_way
from automaton.world.conversion_table import conversion_lines, plain_number_line
from automaton.world.order_feasibility import arrivals_in_words
from automaton.world.resolve import Resolved, resolve
from automaton.world.scenario_warnings import misfits, scenario_warnings

SLOTS = {  # what a scenario's line counts
    SHELF: ("shelf", "shelves"),
    DESTINATION: ("destination",),
    DOCK: ("dock",),
    RACK: ("rack",),
}
REASON_COLUMN = "reason"  # the first column of a quarantine
NUMBER_TEXT = re.compile(r"\d[\d,.]*")  # in which the same warning of two points may differ


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton check`."""
    text = "a scenario or study file, or the name of a shipped one"
    parser.add_argument("file", nargs="+", metavar="FILE", help=text)
    add_settings_argument(parser)
    add_refinement_arguments(parser)
    parser.add_argument(
        "--matrix",
        type=Path,
        metavar="CSV",
        help=("write the floor to CSV as a matrix of cell codes"),
    )
    parser.add_argument("--picture", action="store_true", help="draw the floor as text")
    parser.add_argument(
        "--trial",
        action="store_true",
        help="also run each scenario briefly, for 500 ticks or 2,000,000 robot ticks (ticks x "
        "robots), whichever is more, and report jams, robots without progress and exceeded "
        "bounds",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Print a line for each good file and a sentence for each bad one.

    Returns 2 if a file is bad, else 1 if a trial has found a problem.
    """
    bad, reports = 0, []
    if args.matrix is not None and len(args.file) != 1:
        raise InputError(f"--matrix writes the floor of one scenario, found {len(args.file)}")
    for file in args.file:
        try:
            report = check_file(file, args)
        except InputError as error:
            if args.debug:
                raise
            bad += 1
            report = CheckedFile(file, error=str(error))
            sys.stdout.flush()  # keeps the order where both streams meet
            print(f"automaton: {error}", file=sys.stderr)
        reports.append(report)
    if args.json:
        print_json([report._asdict() for report in reports])
    failed = any(report.trial is not None and not report.trial["passed"] for report in reports)
    return 2 if bad else int(failed)


class CheckedFile(NamedTuple):
    """The result for one file: an object of the JSON output."""

    file: str
    name: str | None = None  # of the scenario or study; None: the file is bad
    lines: tuple[str, ...] = ()  # as printed
    warnings: tuple[str, ...] = ()
    trial: dict[str, Any] | None = None
    error: str | None = None
    skipped: dict[str, Any] | None = None  # rows of the file of orders; None: none was
    picture: str | None = None  # of the floor, with --picture


def check_file(file: str, args: argparse.Namespace) -> CheckedFile:
    """Check a file, and print the result unless --json is given. Raises InputError."""
    if names_study(file):
        if args.picture:
            raise InputError(f"--picture draws the floor of one scenario; {file} is a study")
        study, scenarios = checked_study(file, args)
        line, warnings = described_study(study), study_warnings(study, scenarios)
        show([line], args)
        for warning in warnings:
            note(f"{study.name}: warning: {warning}")
        return CheckedFile(file, study.name, (line,), tuple(warnings))
    settings = settings_of(args)
    resolved = resolve(file, settings)
    as_read = resolved.unrefined
    if args.matrix is not None:
        export_matrix(resolved, args.matrix)
    document = document_of(file, settings)
    with Reading(document).placing_errors():
        refuse(misfits(resolved))
    plain = plain_number_line(document.data, as_read.scenario.units.scale)
    more = (
        *([f"seed {as_read.scenario.seed}: {day}"] if (day := resolved.day_in_words) else []),
        *resolved.file_notes,
        *arrivals_in_words(as_read.scenario),
        *conversion_lines(as_read),
        resolved.streets_in_words,
        plain,
        *bounds_in_words(resolved),
    )
    lines = [described(resolved, names_right_of_way(document)), *(line for line in more if line)]
    lines += [write_quarantine(rows) for rows in quarantines(resolved)]
    picture = floor_picture(resolved.floor_plan) if args.picture else None
    show(lines, args)
    if picture is not None and not args.json:
        print(f"\n{picture}\n")
    print_warnings(resolved)
    trial = None
    if args.trial:
        from automaton.runs.trial import try_out  # only trials need compiled code

        trial = try_out(resolved)
        show(trial.lines(), args, INDENT)
    name, warnings = resolved.scenario.name, scenario_warnings(resolved)
    done = None if trial is None else trial.as_json()
    checked = CheckedFile(file, name, tuple(lines), tuple(warnings), done)
    return checked._replace(skipped=resolved.skipped_rows, picture=picture)


def quarantines(resolved: Resolved) -> list[QuarantinedRows]:
    """The skipped rows of each file of orders that has a quarantine."""
    rows = (day.file.quarantine for day in resolved.days)
    return [one for one in rows if one is not None]


def write_quarantine(rows: QuarantinedRows) -> str:
    """Write skipped rows behind a column with their mistakes, atomically; return a sentence about it.

    The file has the encoding and the separator of its source; that of a workbook is UTF-8 with commas.
    Raises InputError.
    """
    separator, head, skipped = rows_as_written(
        rows.source, rows.encoding, rows.sheet, rows.mistakes
    )
    text = io.StringIO(newline="")
    writer = csv.writer(text, delimiter=separator, lineterminator="\n")
    writer.writerow([REASON_COLUMN, *head])
    writer.writerows([rows.mistakes[line], *row] for line, row in skipped)
    with atomic_writer(rows.target) as file:
        file.write(text.getvalue().encode(rows.encoding))
    return f"{count(len(skipped), 'skipped row')} written to {rows.target}"


def show(lines: Sequence[str], args: argparse.Namespace, mark: str = "") -> None:
    """Print lines, all but the first indented, unless --json is given."""
    if not args.json:
        first, more = Listed(lines[:1], mark=mark), Listed(lines[1:], mark=INDENT)
        print_document(ReportDocument(lines[0], [first, more]))


def names_study(file: str) -> bool:
    """Whether a file or shipped name is a study. Raises InputError if the file cannot be read."""
    if not os.path.exists(file) and file not in shipped():
        return file in shipped_studies()
    return is_study(read(file).data)


def checked_study(file: str, args: argparse.Namespace) -> tuple[Study, tuple[Resolved, ...]]:
    """A good study and the scenarios of its points. Raises InputError."""
    options = {
        "--set": args.settings,
        "--refine": args.refine,
        "--matrix": args.matrix,
        "--trial": args.trial,
    }
    for option in (name for name, value in options.items() if value):
        raise InputError(f"{option} is for scenarios only; this is a study", file)
    return check_study(file)


def described_study(study: Study) -> str:
    """A valid study in one line."""
    replications, runs = study.planned
    return f"{study.name}: {count(len(study.points), 'point')} x {replications}, {runs}, ok"


def study_warnings(study: Study, scenarios: Sequence[Resolved]) -> list[str]:
    """Return the warnings of all points; warnings that differ only in numbers are merged."""
    first: dict[str, tuple[str, Point]] = {}
    points: Counter[str] = Counter()
    for point, resolved in zip(study.points, scenarios, strict=True):
        for warning in scenario_warnings(resolved):
            kind = NUMBER_TEXT.sub("", warning)
            first.setdefault(kind, (warning, point))
            points[kind] += 1
    sentences = []
    for kind, (warning, point) in first.items():
        others = points[kind] - 1
        where = f"point {point.number}: {describe_point(point)}"
        more = f"; and {count(others, 'more point')}" if others else ""
        sentences.append(f"{warning} ({where}{more})")
    return sentences


def export_matrix(resolved: Resolved, path: Path) -> None:
    """Write the floor as a matrix of codes, atomically. Raises InputError."""
    text = write_matrix(resolved.floor_plan)
    if os.path.exists(path) and not os.path.isfile(path):
        raise cannot_write_error("this is not a regular file", path)
    with atomic_writer(path) as file:
        file.write(text.encode())


def names_right_of_way(document: Document) -> bool:
    """Whether a scenario names its right of way."""
    return document.data.get("strategy", {}).get("right_of_way") is not None


def described(resolved: Resolved, names_right_of_way: bool = True) -> str:
    """A valid scenario in one line, with the defaults chosen for it."""
    kinds = resolved.floor_plan.kind
    parts = [count(int(np.count_nonzero(kinds == kind)), *names) for kind, names in SLOTS.items()]
    parts = [part for part in parts if not part.startswith("0 ")]
    fleet = resolved.scenario.fleet
    robots = count(fleet.robots, "robot")
    if fleet.types:
        types = [
            f"{kind.name} {many}" + (f" by {kind.own_allocation}" if kind.own_allocation else "")
            for kind, many in zip(fleet.types, fleet.counts, strict=True)
        ]
        robots += f" ({', '.join(types)})"
    closed = [
        f"{area} closed to {' and '.join(given.closed_to)}"
        for area, given in resolved.scenario.areas.items()
    ]
    open_places = {
        "station": resolved.scenario.floor.open_stations,
        "charger": resolved.scenario.floor.open_chargers,
    }
    closed += [f"{count(k, what)} open" for what, k in open_places.items() if k is not None]
    chosen = []
    if not names_right_of_way:
        name, why = default_right_of_way(resolved.scenario, resolved.fleet)
        chosen = [f"right of way {name} by default" + (f" ({why})" if why else "")]
    scenario = resolved.scenario
    if scenario.refine > 1:
        chosen.append(f"tick refined {scenario.refine} times: {shown_unit(scenario.units.tick)}")
    return f"{scenario.name}: {', '.join([*parts, robots, *closed, *chosen])}, ok"
