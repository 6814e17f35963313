"""Verify a recorded run: check the rules, run it again, and report the first tick that differs.

Of an observed run, made by `automaton log`, list what its robots did against the rules.

Verify a results folder or its archive: do all runs again, with the strategies that it holds, and
compare their results. These strategies are programs: verify archives of senders you trust. With
--problem, check the output of another program for a problem of the League of Robot Runners.
Exit code 0: all recorded ticks (even of an incomplete recording) follow the rules and are reproduced,
all results are equal, or the run is an observed one; 1: a rule is broken, or a tick or a result
differs; 2: the file is damaged or none of these.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from automaton.commands.arguments import (
    add_json_argument,
    add_workers_argument,
    print_document,
    print_json,
    progress_bar,
    show_line,
)
from automaton.documents.report_document import INDENT, Listed, ReportDocument
from automaton.errors import InputError
from automaton.recording.recording_reader import read_recording
from automaton.runs.provenance import first_changes
from automaton.units import count

if TYPE_CHECKING:
    from automaton.verification.verification import Show, Verification

MAX_PRINTED_VIOLATIONS = 10  # violations or differences in the text
ZIP_BEGINS: Final = b"PK"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton verify`."""
    text = (
        "a recording, or a results folder or its archive; strategies in it are executed. With "
        "--problem, the output of another program"
    )
    parser.add_argument("file", metavar="FILE", help=text)
    parser.add_argument(
        "--problem",
        type=Path,
        metavar="PROBLEM",
        help="check the output of another program (JSON for PlanViz) for this problem",
    )
    add_workers_argument(parser, 1024)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Verify and report."""
    if args.problem is not None:
        return verify_against_problem(args)
    if is_results(args.file):
        return verify_results(args)
    try:
        recording = read_recording(args.file)  # rejects other files before Numba is loaded
    except InputError as error:
        if not args.file.endswith(".json"):
            raise
        text = f"{error.message}; to check an output file, name its problem with --problem"
        raise InputError(text, error.file) from None
    if recording.is_observed:
        return report_breaches(args, recording)
    from automaton.verification.verification import verify_recording

    try:
        with progress(recording.ticks) as show:
            found = verify_recording(recording, show)
    except InputError as error:
        raise error.at(args.file) from None
    if args.json:
        print_json(as_json(args.file, found))
    else:
        print_document(ReportDocument(args.file, list(blocks(args.file, found))))
    return 0 if found.passed else 1


def report_breaches(args: argparse.Namespace, recording: Any) -> int:
    """List what real robots did against the rules; a recording of them cannot be run again."""
    from automaton.history.playback import breaches_of

    try:
        with progress(recording.ticks) as show:
            breaches = breaches_of(recording, show)
    except InputError as error:
        raise error.at(args.file) from None
    scenario = recording.header["scenario"]["name"]
    if args.json:
        print_json(
            {
                **{"file": args.file, "scenario": scenario, "ticks": recording.ticks},
                **{"observed": True, "complete": recording.complete},
                "against_the_rules": [
                    {**breach._asdict(), "sentence": str(breach)} for breach in breaches
                ],
            }
        )
        return 0
    robots = sum(map(bool, recording.header["observed"]["robots"]))
    size = f"{scenario}, {count(robots, 'robot')}, {count(recording.ticks, 'tick')}"
    lines = [f"{args.file}: observed: rules not applicable: {size}"]
    lines += [str(breach) for breach in breaches] or ["no two robots in a cell for one, no swaps"]
    print_document(ReportDocument(args.file, [Listed(lines, mark="")]))
    return 0


@contextlib.contextmanager
def progress(ticks: int) -> Iterator[Show]:
    """Show the progress in ticks on stderr if it is a terminal."""
    if not sys.stderr.isatty():
        yield lambda what, tick: None
        return
    from rich.progress import BarColumn, TextColumn

    text = TextColumn("{task.description}, tick {task.completed:,} of {task.total:,}")
    with progress_bar(text, BarColumn()) as bar:
        task = bar.add_task("run again", total=ticks)
        yield lambda what, tick: bar.update(task, description=what, completed=tick)


def is_results(file: str) -> bool:
    """Whether this is a folder or a zip."""
    if os.path.isdir(file):
        return True
    if not os.path.isfile(file):
        return False
    with open(file, "rb") as stream:
        return stream.read(len(ZIP_BEGINS)) == ZIP_BEGINS


def verify_results(args: argparse.Namespace) -> int:
    """Do the runs of a results folder or archive again; report those that differ."""
    from automaton.studies.sweeps.pools import LocalPool
    from automaton.studies.sweeps.results_archive import repeat_results

    done = 0

    def show(rows: list[Any]) -> None:
        nonlocal done
        done += len(rows)
        show_line(f"{count(done, 'run')} done again")

    try:
        again = repeat_results(Path(args.file), lambda: LocalPool(args.workers), show)
    finally:
        show_line("")
    passed = bool(again.compared) and not again.differences
    if args.json:
        print_json({"file": args.file, **again._asdict(), "verified": passed})
        return 0 if passed else 1
    runs, verdict = count(again.compared, "run"), "verified" if passed else "not verified"
    lines = [f"{args.file}: {verdict}: {again.study}, {runs} done again"]
    if again.changed_sources:
        lines.append(f"made with other code: {first_changes(again.changed_sources)}")
    lines.append(f"{len(again.differences):,} of {runs} differ")
    if passed:
        lines[-1] = "all results are equal"
    more = len(again.differences) - MAX_PRINTED_VIOLATIONS
    inner = [*again.differences[:MAX_PRINTED_VIOLATIONS], *([f"and {more} more"] * (more > 0))]
    document = ReportDocument(args.file, [Listed(lines, mark="")])
    document.add(Listed(inner, mark=INDENT))
    print_document(document)
    return 0 if passed else 1


def verify_against_problem(args: argparse.Namespace) -> int:
    """Check the output of another program; report the first violation."""
    from automaton.exchange.planviz import read_output, unchecked, verify_output
    from automaton.exchange.problem_files import read_problem

    output = read_output(Path(args.file))
    # A problem folder has starts for fleets of several sizes.
    robots = output.robots if args.problem.is_dir() else None
    problem = read_problem(args.problem, robots)
    violation, missing = verify_output(output, problem), list(unchecked(output, problem))
    if args.json:
        print_json(
            {
                "file": args.file,
                "problem": str(args.problem),
                "robots": output.robots,
                "ticks": output.ticks,
                "tasks_finished": output.finished,
                "verified": violation is None,
                "unchecked": missing,
                "violation": None
                if violation is None
                else {**violation._asdict(), "sentence": str(violation)},
            }
        )
    else:
        verdict = "verified" if violation is None else "not verified"
        size = f"{count(output.robots, 'robot')}, {count(output.ticks, 'tick')}"
        lines = [
            f"{args.file}: {verdict}: {size}, {count(output.finished, 'task')} finished",
            "rules: no violations" if violation is None else f"rules: violation: {violation}",
            *(f"not checked: {rule}" for rule in missing),
        ]
        print_document(ReportDocument(args.file, [Listed(lines, mark="")]))
    return 0 if violation is None else 1


def blocks(file: str, found: Verification) -> Iterator[Listed]:
    """The result in a few lines, the verdict first."""
    recording, report = found.recording, found.report
    name, seed = recording.header["scenario"]["name"], recording.header["seed"]
    robots = recording.header["scenario"]["fleet"]["robots"]
    verdict = "not verified"
    if found.passed:
        verdict = "verified" if recording.complete else "verified up to its last tick"
    first = f"{file}: {verdict}: {name}, seed {seed}, {robots} robots, {report.ticks:,} ticks"
    broken_rules = count(len(report.violations), "violation")
    rules = f"rules: {'no violations' if report.valid else broken_rules}"
    yield Listed([first, *extent(found), rules], mark="")
    broken = [str(violation) for violation in report.violations[:MAX_PRINTED_VIOLATIONS]]
    more = len(report.violations) - len(broken)
    yield Listed([*broken, *([f"and {more} more"] if more else [])], mark=INDENT)
    equal = "run again: every tick is identical"
    lines = [equal if found.difference is None else f"run again: {found.difference}"]
    lines += found.illegal.lines()
    lines += [f"{file} has changed since the run was recorded" for file in found.changed_files]
    if found.changed_sources:
        recorded = recording.header["versions"].get("fleet-automaton", "unknown")
        lines.append(
            f"recorded by other code (version {recorded}): {first_changes(found.changed_sources)}"
        )
    yield Listed(lines, mark="")


def extent(found: Verification) -> list[str]:
    """The extent of an incomplete recording; [] if it is complete."""
    recording, last = found.recording, found.recording.ticks
    if not recording.complete:
        return [f"incomplete (cut short or interrupted): intact up to tick {last:,}"]
    return []


def as_json(file: str, found: Verification) -> dict[str, Any]:
    """The result as one object."""
    recording, report, difference = found.recording, found.report, found.difference
    return {
        "file": file,
        "scenario": recording.header["scenario"]["name"],
        "seed": recording.header["seed"],
        "ticks": recording.ticks,
        "verified": found.passed,
        "complete": recording.complete,
        "valid": report.valid,
        "violations": [
            {**violation._asdict(), "sentence": str(violation)} for violation in report.violations
        ],
        "equal": difference is None,
        "difference": None if difference is None else difference._asdict(),
        "illegal_decisions": found.illegal.as_json(),
        "same_sources": not found.changed_sources,
        "changed_sources": found.changed_sources,
        "changed_files": list(found.changed_files),
        "actions": report.counts,
    }
