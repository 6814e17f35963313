"""Run or resume a study: store a row per run in a folder. The same command resumes it.

Exit code 0: all runs are done; 1: some failed, now or before; 2: bad input; 130: stopped by Ctrl-C;
143: by SIGTERM.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from automaton.commands.arguments import (
    Output,
    add_output_arguments,
    add_timeout_argument,
    add_workers_argument,
    note,
    output_of,
)
from automaton.documents.report_document import Listed, ReportDocument
from automaton.errors import InputError
from automaton.units import SECONDS_PER_UNIT, count

if TYPE_CHECKING:
    from automaton.studies.sweeps.pools import Backend
    from automaton.studies.sweeps.result_store import Store
    from automaton.studies.sweeps.sweep_session import Forecast, SweepResult, SweepStart


LINE_EVERY_S = 60.0  # in a pipe


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton sweep`."""
    text = "a study file, or the name of a shipped study"
    parser.add_argument("study", metavar="STUDY", help=text)
    parser.add_argument("--out", type=Path, metavar="DIR", help="store the results in this folder")
    add_workers_argument(parser, 1024)
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on a Dask cluster: an address, such as tcp://host:8786, or the scheduler file",
    )
    parser.add_argument(
        "--dry-run", action="store_true", help="estimate time and disk space from a few pilot runs"
    )
    parser.add_argument(
        "--recompute",
        action="store_true",
        help="ignore results of other code or of another study in the folder; results of this study "
        "still count, and only missing runs are made",
    )
    parser.add_argument("--retry-failed", action="store_true", help="retry failed runs, too")
    add_timeout_argument(parser)
    add_output_arguments(parser, "--report")


def require_results() -> None:
    """Raise InputError before any computation if results folders cannot be written."""
    from automaton.studies.sweeps.result_store import arrow

    arrow()


def run(args: argparse.Namespace) -> int:
    """Sweep and report."""
    if args.out is None and not args.dry_run:
        raise InputError("--out DIR is missing: the folder for the results")
    if args.workers is not None and args.scheduler is not None:
        raise InputError("--workers sets local processes; leave it out with --scheduler")
    if args.dry_run and args.scheduler is not None:
        raise InputError("--dry-run estimates for local processes; leave --scheduler out")
    output = output_of(args, "--report")
    if args.out is not None:
        require_results()
    from automaton.studies.sweeps.sweep_plan import make_sweep_plan
    from automaton.studies.sweeps.sweep_session import sweep_into

    plan = make_sweep_plan(args.study)
    if args.dry_run:
        return dry_run(args, output, plan)
    begun_at = time.monotonic()
    with progress(args.out) as listener:
        swept = sweep_into(
            args.out,
            plan,
            lambda: crew_of(args),
            args.recompute,
            listener.begin,
            listener.rows,
            args.retry_failed,
            args.strategy_timeout,
            listener.decide,
        )
    tell(output, args.out, swept, time.monotonic() - begun_at)
    return 1 if swept.failed else 0


def crew_of(args: argparse.Namespace) -> Backend:
    """The local processes or the cluster for the runs."""
    if args.scheduler is not None:
        from automaton.studies.sweeps.pools import DaskCluster

        return DaskCluster(args.scheduler)
    from automaton.studies.sweeps.pools import LocalPool

    return LocalPool(args.workers)


def dry_run(args: argparse.Namespace, output: Output, plan: Any) -> int:
    """Print the estimated time and disk space of the sweep."""
    found = forecast_of(args, plan, args.out, args.retry_failed)
    seconds = {"wall_s": found.wall_s, "most_wall_s": found.most_wall_s}
    known = {**found._asdict(), **seconds, "bytes": found.bytes}
    disk = f"disk: {size_text(found.bytes)} at most"
    lines = [plan_text(plan, found), time_text(found), disk]
    output.write(
        lambda: ReportDocument(plan.study.name, [Listed(lines, mark="")]),
        lambda: {"study": plan.study.name, **known},
    )
    return 0


def forecast_of(
    args: argparse.Namespace, plan: Any, folder: Path | None, retry_failed: bool = False
) -> Forecast:
    """The runs of a plan that a folder lacks, and their time by a few pilot runs."""
    from automaton.runs.first_compilation import cores
    from automaton.studies.sweeps.pools import LocalPool
    from automaton.studies.sweeps.sweep_session import forecast

    workers = args.workers or cores()
    return forecast(plan, folder, workers, LocalPool(1), retry_failed, args.recompute)


def plan_text(plan: Any, found: Forecast) -> str:
    """The number of runs, and of those already done."""
    points = count(len(plan.points), "point")
    replications, runs = plan.study.planned
    text = f"{plan.study.name}: {points} x {replications} = {runs}"
    return text + (f", of which {found.done:,} are done" if found.done else "")


def time_text(found: Forecast) -> str:
    """The estimated time of the runs."""
    least = "at least " if found.cut else ""
    spread = f"{found.least_s * 1e3:,.0f} to {found.most_s * 1e3:,.0f} ms"
    seconds = duration(found.wall_s)
    if found.most_runs > found.runs:
        seconds += f" to {duration(found.most_wall_s)}, depending on precision,"
    return (
        f"time: {least}{seconds} with {count(found.workers, 'worker')} "
        f"({duration(found.start_s)} to start; {spread} a run, by {count(found.pilots, 'pilot run')})"
    )


def duration(seconds: float) -> str:
    """A duration in the most readable unit."""
    if seconds < 90:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    if seconds < 90 * SECONDS_PER_UNIT["min"]:
        return f"{seconds / SECONDS_PER_UNIT['min']:.0f} minutes"
    return f"{seconds / SECONDS_PER_UNIT['h']:.1f} hours"


def size_text(size: int) -> str:
    """A number of bytes in the most readable unit."""
    return f"{size / 1e6:,.1f} MB" if size >= 1e5 else f"{size / 1e3:,.1f} kB"


class Listener:
    """Follows the progress of a sweep and writes notes to stderr; in a pipe, a line a minute."""

    def __init__(self, out: Path | None, period_s: float = LINE_EVERY_S) -> None:
        self.out = out
        self.total = self.done = self.before = 0
        self.since = self.said = time.monotonic()
        self.period_s = period_s

    def begin(self, begun: SweepStart) -> None:
        """Note on stderr problems with existing results in the folder."""
        self.total, self.done = begun.runs, begun.done
        self.since, self.before = time.monotonic(), begun.done
        for path in begun.aside:
            note(f"{path} is damaged; its runs are repeated")
        if begun.reanalysed:
            note(
                "the analysis or warm-up declared in the study has changed since "
                f"{count(begun.done, 'run')} were made; sweep.json keeps the earlier one"
            )

    def rows(self, rows: list[Any]) -> None:
        """Count finished runs; note the progress once per period."""
        self.done += len(rows)
        now = time.monotonic()
        if now - self.said >= self.period_s:
            self.said = now
            note(self.line(now - self.since))

    def line(self, seconds: float) -> str:
        """The progress after this number of seconds."""
        fresh = self.done - self.before
        if not fresh:
            return (
                f"{self.done:,} of {count(self.total, 'run')}; none done yet in {duration(seconds)}"
            )
        left = (self.total - self.done) * seconds / fresh
        rate = f"{fresh / max(seconds, 1e-3):,.1f} a second"
        return f"{self.done:,} of {count(self.total, 'run')}, {rate}, about {duration(left)} left"

    def decide(self, store: Store) -> int | None:
        """After a round: the number of replications of the next one; None: stop."""
        from automaton.studies.reports.comparisons import next_replications

        following = next_replications(store)
        if following is None:
            return None
        note(following.why)
        return following.replications


class Bar(Listener):
    """Shows on a terminal's stderr the finished runs, their rate and the remaining time."""

    def __init__(self, out: Path | None) -> None:
        super().__init__(out, math.inf)
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
        from rich.progress import TimeRemainingColumn as Remaining

        rate = TextColumn("{task.fields[rate]}", markup=False)
        columns = ("runs", BarColumn(), MofNCompleteColumn(), rate, "left", Remaining())
        self.bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self.task = self.bar.add_task("runs", total=None, rate="")

    def begin(self, begun: SweepStart) -> None:
        super().begin(begun)
        self.bar.reset(self.task, total=begun.runs, completed=begun.done)

    def rows(self, rows: list[Any]) -> None:
        super().rows(rows)
        rate = (self.done - self.before) / max(time.monotonic() - self.since, 1e-3)
        self.bar.update(self.task, completed=self.done, rate=f"{rate:,.1f} a second")


@contextlib.contextmanager
def progress(out: Path | None) -> Iterator[Listener]:
    """A progress bar on a terminal, a line a minute in a pipe; after Ctrl-C, a note on how to resume.

    `out`: the results folder; None: the results are not kept.
    """
    listener = Bar(out) if sys.stderr.isatty() else Listener(out)
    try:
        with listener.bar if isinstance(listener, Bar) else contextlib.nullcontext():
            yield listener
    except KeyboardInterrupt:
        if listener.total:
            runs = f"{listener.done:,} of {count(listener.total, 'run')} are"
            stored = f"stored in {out}; repeat the command to resume"
            note(f"stopped; {runs} {stored if out else 'done; with --out DIR they are stored'}")
        raise


def tell(output: Output, out: Path, swept: SweepResult, seconds: float) -> None:
    """Write the result, and note failed runs."""
    begun, tally, study = swept.begun, swept.tally, swept.store.study

    def summary() -> dict[str, Any]:
        done = {"study": study.name, "out": str(out), "runs": study.runs}
        done |= {"existing": begun.done, **tally._asdict(), "failed": swept.failed}
        return {**done, "wall_s": round(seconds, 3)}

    output.write(lambda: summary_document(swept, out), summary)
    if swept.failed:
        what = f"{count(swept.failed, 'run')} failed; see the column `error` for the reason"
        note(f"{what}, or retry with --retry-failed")


def summary_document(swept: SweepResult, out: Path) -> ReportDocument:
    """The result in a few sentences."""
    begun, tally, study = swept.begun, swept.tally, swept.store.study
    before = f" ({begun.done:,} done before)" if begun.done else ""
    lines = [f"{study.name}: {count(study.runs, 'run')} in {out}{before}"]
    if swept.store.declared.in_rounds:
        from automaton.studies.reports.comparisons import stopping_remarks, stopping_text
        from automaton.studies.reports.study_results import read_results

        results = read_results(swept.store)
        lines += [stopping_text(results), *stopping_remarks(results)]
    if tally.unfinished:
        lines.append(f"{count(tally.unfinished, 'run')} reached the time limit of the scenario")
    if tally.repeated:
        lines.append(f"{count(tally.repeated, 'run')} started twice, because a worker died")
    return ReportDocument(study.name, [Listed(lines, mark="")])
