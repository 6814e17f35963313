"""Measure the speed of this machine: medians of several samples, on one core, after a warm-up.

Exit code 0: measured; 1: some measurements failed (each is named); 2: bad input.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from automaton.bench import BENCH_PARTS
from automaton.commands.arguments import add_output_arguments, note, output_of, progress_bar
from automaton.errors import InputError, nearest

if TYPE_CHECKING:
    from automaton.bench.measurement import MeasuredFigure, Measurement
    from automaton.documents.report_document import ReportDocument

REPEAT = 7


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton bench`."""
    parts = ";\n".join(f"{name}: {part.summary}" for name, part in BENCH_PARTS.items())
    add_output_arguments(parser)
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="PART",
        help=f"measure only this part (may be repeated).\n{parts}",
    )
    text = "also time first runs, which compile"
    parser.add_argument("--compile", action="store_true", help=text)
    parser.add_argument("--startup", action="store_true", help="also time the start of commands")
    text = "also measure POGEMA and RWARE with this interpreter, which has pogema and rware"
    parser.add_argument("--peers", metavar="PYTHON", help=text)
    text = f"take N samples (default: {REPEAT})"
    parser.add_argument("--repeat", type=int, default=REPEAT, metavar="N", help=text)


def run(args: argparse.Namespace) -> int:
    """Measure and print; Ctrl-C prints what has been measured."""
    if args.repeat < 1:
        raise InputError(f"--repeat must be at least 1, not {args.repeat}")
    output = output_of(args)
    parts = chosen(args.only, args.compile, args.startup)
    wanted = measurements(parts)
    if args.peers is not None:
        wanted += peers(parts, args.peers)
    figures: list[MeasuredFigure] = []
    unmeasured = 0
    try:
        unmeasured = measure(wanted, args.repeat, figures)
    finally:
        if args.json or figures:
            output.write(
                lambda: figures_document(figures, args.repeat),
                lambda: [figure._asdict() for figure in figures],
            )
    return 1 if unmeasured else 0


def chosen(only: Sequence[str], compile_too: bool, startup_too: bool) -> list[str]:
    """The parts to measure, in the order of the table. Raises InputError for an unknown one."""
    for name in only:
        if name not in BENCH_PARTS:
            known = ", ".join(BENCH_PARTS)
            raise InputError(
                f"unknown part '{name}'{nearest(name, BENCH_PARTS)}; there are {known}"
            )
    asked = {*only, *(["compile"] if compile_too else []), *(["startup"] if startup_too else [])}
    return [
        name for name, part in BENCH_PARTS.items() if name in asked or (part.usual and not only)
    ]


def measurements(parts: Sequence[str]) -> list[Measurement]:
    """The measurements of the parts. Raises InputError if compilation is off."""
    from automaton.engine.jit.kernel import jit_is_on

    if not jit_is_on():
        raise InputError("bench measures compiled code; unset NUMBA_DISABLE_JIT")
    found: list[Measurement] = []
    for name in parts:
        module, _, function = BENCH_PARTS[name].place.partition(":")
        if module.startswith("tui.") and not os.path.exists("/proc/self/task"):
            raise InputError(f"bench --only {name} counts CPU time by thread, which needs Linux")
        found += getattr(importlib.import_module(module), function or "measurements")()
    return found


def peers(parts: Sequence[str], python: str) -> list[Measurement]:
    """The measurements of other simulators. Raises InputError without the part environments."""
    if "environments" not in parts:
        raise InputError("--peers is for --only environments")
    from automaton.bench.environment_speed import peer_measurements

    return peer_measurements(python)


def measure(wanted: Sequence[Measurement], repeat: int, figures: list[MeasuredFigure]) -> int:
    """Append the results; note each failed measurement and return how many failed."""
    from automaton.bench.measurement import NotMeasuredError, take

    unmeasured = 0
    with progress(len(wanted)) as tell:
        for measurement in wanted:
            tell(measurement.name)
            try:
                figures.append(take(measurement, repeat))
            except NotMeasuredError as error:
                unmeasured += 1
                note(f"not measured: {measurement.name}: {error} ({machine()})")
    return unmeasured


@contextlib.contextmanager
def progress(total: int) -> Iterator[Callable[[str], None]]:
    """Name the current measurement on stderr if it is a terminal."""
    if not sys.stderr.isatty():
        yield lambda name: None
        return
    from rich.progress import MofNCompleteColumn, SpinnerColumn, TextColumn

    text = TextColumn("{task.description}", markup=False)
    with progress_bar(SpinnerColumn(), MofNCompleteColumn(), text) as bar:
        task = bar.add_task("", total=total, completed=-1)
        yield lambda name: bar.update(task, advance=1, description=name)


def figures_document(figures: Sequence[MeasuredFigure], repeat: int) -> ReportDocument:
    """The figures as a table, with the machine on which they were measured."""
    from automaton.documents.report_document import ReportDocument, Table, Text
    from automaton.units import count, number

    rows = [
        [one.name, *(number(value) for value in (one.median, one.low, one.high)), one.unit]
        for one in figures
    ]
    table = Table(("measured", "median", "low", "high", "unit"), rows, also_left=(4,))
    effort = Text(f"{count(repeat, 'sample')} each at most; {machine(figures)}")
    return ReportDocument("speed of this machine", [table, effort])


def machine(measured: Sequence[MeasuredFigure] = ()) -> str:
    """This machine and its load: wall-clock times are too long on a busy machine."""
    from automaton.bench.measurement import load

    cores = os.cpu_count() or 1
    text = f"{platform.machine()} {platform.system()}, {cores} cores"
    loads = [*(one.load for one in measured), load()]
    known = sorted(one for one in loads if one is not None)
    if not known:
        return text
    low, high = known[0], known[-1]
    busy = "; busy: times on the wall are too long" if high > cores else ""
    return f"{text}, load {low:.1f}" + (f" to {high:.1f}" if high > low else "") + busy
