"""Import a layout or benchmark from another tool: write a scenario with its floor, robots and tasks.

FILE is a layout (VDMA LIF, openTCS, a ROS map), a guidance graph (GGO), a MovingAI map or scenario, a
problem of the League of Robot Runners, or a folder with map.txt, agents_K.csv and tasks_one.csv. The
kind is detected from the content.

Exit code 0: done; 1: an edge would be too inaccurate, nothing is written; 2: bad input.
"""

from __future__ import annotations

import argparse
import os
import re
from fractions import Fraction
from pathlib import Path
from typing import Final

from automaton.atomic_write import atomic_writer
from automaton.commands.arguments import (
    add_json_argument,
    measured,
    note,
    print_document,
    print_json,
    whole,
)
from automaton.documents.report_document import Listed, ReportDocument, Text
from automaton.errors import InputError
from automaton.exchange.floor_readers import FLOOR_READERS, check_options, read_floor
from automaton.exchange.imported_floor import (
    FILE_KINDS,
    ImportOptions,
    ImportReport,
    imported_files,
    kind_of,
)
from automaton.exchange.problem_files import read_problem
from automaton.units import count, exact_length, exact_time

DEFAULT_TICKS: Final = 1000
DEFAULTS: Final = ImportOptions()
PERCENT_TEXT: Final = re.compile(r"(\d{1,4}(?:\.\d{1,6})?)\s*%")
SPEED_TEXT: Final = re.compile(r"(.+)/\s*(\w+)\s*")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton import`."""
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="a layout, a problem, or a folder")
    text = "write the scenario to YAML, and its other files beside it"
    add("--out", type=Path, required=True, metavar="YAML", help=text)
    add(
        "--robots",
        type=whole("a number of robots", 1, 1_000_000),
        metavar="N",
        help="set the number of robots: of a problem, the first N robots are used; of a folder, the "
        "file with N robots; on a map without start cells, robots start in random cells",
    )
    add(
        "--ticks",
        type=whole("a number of ticks", 1, 2_000_000_000),
        metavar="N",
        help=f"set the length of a run (default: {DEFAULT_TICKS:,} ticks; for a layout, 1 hour)",
    )
    add("--force", action="store_true", help="overwrite existing files that differ")
    add_json_argument(parser)
    add_layout_arguments(parser)


def add_layout_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments for layouts and images."""
    add = parser.add_argument_group("layouts and images").add_argument
    add("--floor", type=Path, metavar="FILE", help="write the drawn floor to FILE")
    add(
        "--cell",
        type=measured("a length", "0.5m", exact_length),
        metavar="0.5m",
        help="set the side of a cell (default for a layout: the largest side that fits; for an "
        "image: the smallest whole number of pixels that is at least as wide as --robot)",
    )
    add(
        "--tick",
        type=measured("a time", "0.5s", exact_time),
        metavar="0.5s",
        help="set the duration of a tick (default: the time the fastest robot takes for a cell)",
    )
    add(
        "--speed",
        type=measured("a speed", "1.5m/s", exact_speed),
        metavar="1m/s",
        help="use this speed where the file gives none",
    )
    add(
        "--robot",
        type=measured("a length", "0.6m", exact_length),
        metavar="0.6m",
        help="for images, set the width of a robot (default: the side of a cell); for other layouts, "
        "set the length of a vehicle (default: as in the file) and compare it with the cells",
    )
    add(
        "--unknown",
        choices=("wall", "free"),
        default=DEFAULTS.unknown,
        help="for images, treat unknown area as wall (default) or free",
    )
    add("--layout", metavar="ID", help="import this layout, if the file has several")
    add("--type", metavar="NAME", help="use this robot type, if the file has several")
    add(
        "--accept",
        type=share,
        default=DEFAULTS.accept,
        metavar="5%",
        help="accept a cell size if it changes the length of each edge by at most this share "
        "(default: 5%%)",
    )


def exact_speed(text: str) -> Fraction | None:
    """A speed such as "4 km/h" in m/s, exactly; None if the text is not a speed."""
    match = SPEED_TEXT.fullmatch(text)
    metres, time = (exact_length(match[1]), exact_time(f"1 {match[2]}")) if match else (None, None)
    return None if metres is None or time is None else metres / time


def share(text: str) -> float:
    """Return a percentage such as 10% as a fraction."""
    match = PERCENT_TEXT.fullmatch(text.strip())
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a percentage such as 10%")
    return float(match[1]) / 100


def run(args: argparse.Namespace) -> int:
    """Read the file; write the scenario and its other files."""
    if args.out.suffix not in (".yaml", ".yml"):
        raise InputError("--out must end in .yaml", str(args.out))
    kind = kind_of(args.file)
    options = options_of(args)
    if kind in FLOOR_READERS:
        return import_floor(args, kind, options)
    check_options(kind, options, args.file)
    return import_problem(args, kind)


def options_of(args: argparse.Namespace) -> ImportOptions:
    return ImportOptions(
        args.cell,
        args.tick,
        args.speed,
        args.layout,
        args.type,
        args.accept,
        robots=args.robots,
        ticks=args.ticks,
        robot=args.robot,
        unknown=args.unknown,
    )


def import_floor(args: argparse.Namespace, kind: str, options: ImportOptions) -> int:
    """Write the scenario of a layout, and print a report."""
    imported = read_floor(args.file, kind, options)
    names: list[str] = []
    if not imported.report.refusal:
        texts = imported.files(
            args.out.stem, args.floor and os.path.relpath(args.floor, args.out.parent)
        )
        names = write_files(args, texts)
    if args.json:
        print_json({"files": names, **imported.report.json()})
    else:
        print_report(imported.report, names)
    return 1 if imported.report.refusal else 0


def print_report(report: ImportReport, files: list[str]) -> None:
    """Print a report; a terminal shows its picture in color."""
    document = ReportDocument(report.format, list(report.blocks()))
    if not report.refusal:
        document.add(Text(f"written: {', '.join(files)}"))
    print_document(document)
    if report.refusal:
        note(report.refusal)


def import_problem(args: argparse.Namespace, kind: str) -> int:
    """Write the scenario of a problem with its starts and tasks."""
    problem = read_problem(args.file, args.robots)
    names = write_files(args, imported_files(problem, args.out.stem, args.ticks or DEFAULT_TICKS))
    grid = problem.grid
    floor = int(grid.free.sum())
    facts = {"columns": grid.width, "rows": grid.height, "floor": floor}
    facts |= {"wall": grid.free.size - floor, "robots": problem.robots, "tasks": len(problem.tasks)}
    lost = {"water (drawn as wall)": grid.water} if grid.water else {}
    if args.json:
        report = ImportReport(FILE_KINDS.get(kind, kind), facts, lost=lost)
        print_json({"files": names, **report.json()})
        return 0
    size = f"{count(problem.robots, 'robot')} on {grid.width} x {grid.height} cells"
    water = f", {grid.water:,} of them water" if grid.water else ""
    lines = [
        f"{args.out}: {size}, {count(len(problem.tasks), 'task')}",
        f"{floor:,} cells of floor, {facts['wall']:,} of wall{water}",
        f"with it: {', '.join(names[:-1])}",
    ]
    print_document(ReportDocument(str(args.out), [Listed(lines, mark="")]))
    return 0


def write_files(args: argparse.Namespace, texts: dict[str, str]) -> list[str]:
    """Write the last text to --out, the others beside it by name; return the names."""
    out: Path = args.out
    names = [*list(texts)[:-1], out.name]
    files = {
        out.parent / name: text.encode() for name, text in zip(names, texts.values(), strict=True)
    }
    for path, content in files.items():
        check_replaced(path, content, args.file, args.force)
    for path, content in files.items():
        with atomic_writer(path) as file:
            file.write(content)
    return names


def check_replaced(path: Path, content: bytes, source: Path, force: bool) -> None:
    """Raise InputError if a different file exists at `path`, unless `force` allows replacing it."""
    if not os.path.exists(path):
        return
    if not path.is_file() or path.samefile(source):
        raise InputError("cannot be replaced: choose another --out", str(path))
    try:
        same = path.read_bytes() == content
    except OSError:
        same = False
    if not same and not force:
        raise InputError(
            "already exists: choose another --out, or replace it with --force", str(path)
        )
