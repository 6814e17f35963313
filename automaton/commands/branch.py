"""Continue a recording from any tick with other settings, and compare the two futures.

The branch is recorded together with its past. Exit code 0: it finished or reached --until; 1: it did
not finish; 2: bad input or a failing strategy.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from automaton.commands.arguments import (
    add_json_argument,
    add_recording_argument,
    add_settings_argument,
    print_document,
    print_json,
    tick,
    whole,
)
from automaton.commands.explain import check_tick, shown_at
from automaton.errors import InputError
from automaton.recording.frames import Recording
from automaton.recording.recording_reader import read_recording
from automaton.scenario.refinement import refined_data
from automaton.scenario.schema import Units
from automaton.units import count, unit

if TYPE_CHECKING:
    from automaton.documents.report_document import ReportDocument
    from automaton.history.divergence import Divergence
    from automaton.history.watched_run import WatchedRun
    from automaton.runs.simulation import Simulation


class Future(NamedTuple):
    """The result of a run up to the tick of the comparison."""

    name: str
    ticks: int
    finished: bool
    digest: str
    metrics: dict[str, float | int]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton branch`."""
    add = parser.add_argument
    add_recording_argument(parser, "RECORDING")
    add(
        "--at",
        type=tick,
        required=True,
        metavar="TICK",
        help="apply the new settings after this tick",
    )
    what = (
        "change a value of strategy, durations, information, world, stop or streets; may be "
        "repeated"
    )
    add_settings_argument(parser, what)
    text = "record the branch in FILE (default: RECORDING-at-TICK.rec)"
    add("--out", type=Path, metavar="FILE", help=text)
    text = "stop at this tick at the latest"
    add("--until", type=whole("a tick", 1), metavar="TICK", help=text)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Branch off, run, and report on both."""
    recording = read_recording(args.file)
    recording.check_simulated("a branch", args.file)
    check_tick(args.file, args.at, recording.ticks)
    if args.until is not None and args.until <= args.at:
        raise InputError(f"--until {args.until} is not after --at {args.at}")
    out = args.out or args.file.with_name(f"{args.file.stem}-at-{args.at}.rec")
    if os.path.exists(out) and out.samefile(args.file):
        raise InputError("--out is the recording itself: choose another file", str(out))
    branch, missing = branched_off(recording, args, out)
    original = original_until(recording, args.until)
    from automaton.history.divergence import first_difference

    # If the branch could not be written, `out` may be the file of an earlier branch.
    difference = None if missing else first_difference(recording, read_recording(out))
    if args.json:
        print_json(as_json(args, None if missing else out, original, branch, difference))
    else:
        from automaton.documents.report_document import Text

        settings = ", ".join(args.settings) or "nothing changed"
        header = recording.header
        name, seed = header["scenario"]["name"], header["seed"]
        lines = [f"{name}, seed {seed}, branched off after tick {args.at:,}: {settings}"]
        lines += [] if difference is None else [difference.text.partition(";")[0]]
        document = futures_document(lines, original, branch, refined_data(header["scenario"]).units)
        document.add(*([] if missing else [Text(f"recorded in {out}")]))
        print_document(document)
    if missing:
        raise InputError(missing)
    return 0 if branch.finished or branch.ticks == args.until else 1


def branched_off(recording: Recording, args: argparse.Namespace, out: Path) -> tuple[Future, str]:
    """Run and record the branch; return its result, and what went wrong with the file or ""."""
    from automaton.history.live_run import branch_of
    from automaton.history.watched_run import ReplayedRun
    from automaton.runs.headless import is_finished

    branch = branch_of(shown_at(ReplayedRun(recording), args.at), tuple(args.settings), out)
    try:
        advance(branch, args.until)
        found = future("branch", branch.leading_simulation, is_finished(branch.leading_simulation))
        branch.recorder.end()
    finally:
        branch.close()
    return found, branch.warning


def original_until(recording: Recording, until: int | None) -> Future:
    """The result of the recorded run at `until`, or at its end."""
    from automaton.history.watched_run import ReplayedRun
    from automaton.runs.headless import is_finished

    recorded = ReplayedRun(recording)
    last = recorded.head if until is None else min(until, recorded.head)
    shown = shown_at(recorded, last).shown
    return future("original", shown, is_finished(shown))


def advance(run: WatchedRun, until: int | None) -> None:
    """Compute a live run up to a tick, or to its end."""
    before = -1
    while run.tick > before and (until is None or run.tick < until):
        before = run.tick
        run.show(2**62 if until is None else until, 1.0)


def future(name: str, simulation: Simulation, finished: bool) -> Future:
    from automaton.runs.metrics import metrics_of

    return Future(name, simulation.tick, finished, simulation.digest, metrics_of(simulation))


def futures_document(
    lines: list[str], original: Future, branch: Future, units: Units
) -> ReportDocument:
    """Some lines, then the metrics of both runs side by side, in the units of the scenario."""
    from automaton.documents.report_document import Listed, ReportDocument, Table
    from automaton.runs.metrics import METRIC_CATALOGUE
    from automaton.runs.run_report import in_units

    tick_unit, cell = unit(units.tick), units.cell
    ends = [
        f"{one.name}: {'' if one.finished else 'not '}finished after {count(one.ticks, 'tick')}"
        for one in (original, branch)
    ]
    rows = []
    names = [name for name in branch.metrics if name in original.metrics]
    for name in names:
        kind = METRIC_CATALOGUE.get(name, ("times", ""))[0]
        before, now = original.metrics[name], branch.metrics[name]
        cell_unit = unit(cell) if cell is not None and kind == "cells" else None
        (left, said), (right, _), (change, _) = (
            in_units(value, kind, tick_unit, cell_unit) for value in (before, now, now - before)
        )
        sign = "+" if now > before else ""
        rows.append([name, left, right, "=" if now == before else sign + change, said])
    heads = ("metric", original.name, branch.name, "difference", "unit")
    document = ReportDocument(lines[0], [Listed([*lines, *ends], mark="")])
    document.add(Table(heads, rows, also_left=(4,)))
    return document


def as_json(
    args: argparse.Namespace,
    out: Path | None,
    original: Future,
    branch: Future,
    found: Divergence | None,
) -> dict[str, Any]:
    """Both futures as one object; times are in ticks. `out`: None if it could not be written."""
    return {
        "file": str(args.file),
        "out": None if out is None else str(out),
        "at": args.at,
        "settings": args.settings,
        "difference": None if found is None else found.tick,
        "original": original._asdict(),
        "branch": branch._asdict(),
    }
