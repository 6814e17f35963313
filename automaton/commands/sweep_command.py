"""Do the runs of a study and keep their rows in a folder; the same command again goes on.

Exit code 0: all runs are done; 1: some failed, now or before; 2: bad input;
130: stopped by Ctrl-C; 143: by SIGTERM.
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
    parser.add_argument("study", metavar="STUDY", help="a file, or a shipped study")
    parser.add_argument("--out", type=Path, metavar="DIR", help="the folder of the results")
    add_workers_argument(parser, 1024)
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on a Dask cluster, such as tcp://host:8786, or the file that its scheduler wrote",
    )
    parser.add_argument(
        "--dry-run", action="store_true", help="say what it would take, and run nothing but trials"
    )
    parser.add_argument(
        "--recompute",
        action="store_true",
        help="if the folder holds results of other code or another study, ignore them and do only the "
        "missing runs of this study",
    )
    parser.add_argument(
        "--retry-failed", action="store_true", help="also retry the runs that failed"
    )
    add_timeout_argument(parser)
    add_output_arguments(parser, "--report")


def run(args: argparse.Namespace) -> int:
    """Sweep, and say what was done."""
    if args.out is None and not args.dry_run:
        raise InputError("--out DIR is missing: the folder in which results are kept")
    if args.workers is not None and args.scheduler is not None:
        raise InputError("--workers are processes here; the scheduler has its own: leave one out")
    if args.dry_run and args.scheduler is not None:
        raise InputError("--dry-run reckons with processes here, not with a cluster: leave one out")
    output = output_of(args, "--report")
    from automaton.studies.sweeps.sweep_plan import copies_of, make_sweep_plan
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
            copies_of(args.study, plan),
            args.strategy_timeout,
            listener.decide,
        )
    tell(output, args.out, swept, time.monotonic() - begun_at)
    return 1 if swept.failed else 0


def crew_of(args: argparse.Namespace) -> Backend:
    """Who carries the runs out."""
    if args.scheduler is not None:
        from automaton.studies.sweeps.pools import DaskCluster

        return DaskCluster(args.scheduler)
    from automaton.studies.sweeps.pools import LocalPool

    return LocalPool(args.workers)


def dry_run(args: argparse.Namespace, output: Output, plan: Any) -> int:
    """Say what the sweep would take."""
    from automaton.runs.cores import cores
    from automaton.studies.sweeps.pools import LocalPool
    from automaton.studies.sweeps.sweep_session import forecast

    workers = args.workers or cores()
    found = forecast(plan, args.out, workers, LocalPool(1), args.retry_failed, args.recompute)
    seconds = {"wall_s": found.wall_s, "most_wall_s": found.most_wall_s}
    known = {**found._asdict(), **seconds, "bytes": found.bytes}
    disk = f"disk: {size_text(found.bytes)} at most"
    lines = [plan_text(plan, found), time_text(found), disk]
    output.write(
        lambda: ReportDocument(plan.study.name, [Listed(lines, mark="")]),
        lambda: {"study": plan.study.name, **known},
    )
    return 0


def plan_text(plan: Any, found: Forecast) -> str:
    """How many runs there are, and are left."""
    points = count(len(plan.points), "point")
    replications, runs = plan.study.planned
    text = f"{plan.study.name}: {points} x {replications} = {runs}"
    return text + (f", of which {found.done:,} are done" if found.done else "")


def time_text(found: Forecast) -> str:
    """How long they will take."""
    least = "at least " if found.cut else ""
    spread = f"{found.least_s * 1e3:,.0f} to {found.most_s * 1e3:,.0f} ms"
    seconds = duration(found.wall_s)
    if found.most_runs > found.runs:
        seconds += f" to {duration(found.most_wall_s)}, as precision takes,"
    return (
        f"time: {least}{seconds} with {count(found.workers, 'worker')} "
        f"({duration(found.start_s)} to start; {spread} a run, by {count(found.pilots, 'pilot run')})"
    )


def duration(seconds: float) -> str:
    """Seconds in the reader's units."""
    if seconds < 90:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    if seconds < 90 * SECONDS_PER_UNIT["min"]:
        return f"{seconds / SECONDS_PER_UNIT['min']:.0f} minutes"
    return f"{seconds / SECONDS_PER_UNIT['h']:.1f} hours"


def size_text(size: int) -> str:
    """Bytes in the reader's units."""
    return f"{size / 1e6:,.1f} MB" if size >= 1e5 else f"{size / 1e3:,.1f} kB"


class Listener:
    """Hears how far a sweep is, and notes on stderr what to say: in a pipe also a line a minute."""

    def __init__(self, out: Path, period_s: float = LINE_EVERY_S) -> None:
        self.out = out
        self.total = self.done = self.before = 0
        self.since = self.said = time.monotonic()
        self.period_s = period_s

    def begin(self, begun: SweepStart) -> None:
        """Tell on stderr what was found in the folder."""
        self.total, self.done = begun.runs, begun.done
        self.since, self.before = time.monotonic(), begun.done
        for path in begun.aside:
            note(f"{path} is damaged; its runs are done again")
        if begun.reanalysed:
            note(
                "the analysis or warm-up declared in the study is another one than that with which "
                f"{count(begun.done, 'run')} were made; the earlier one stays in sweep.json"
            )

    def rows(self, rows: list[Any]) -> None:
        """Count what is done; say so when it is time."""
        self.done += len(rows)
        now = time.monotonic()
        if now - self.said >= self.period_s:
            self.said = now
            note(self.line(now - self.since))

    def line(self, seconds: float) -> str:
        """How far it is, after so many seconds."""
        fresh = self.done - self.before
        if not fresh:
            return (
                f"{self.done:,} of {count(self.total, 'run')}; none done yet in {duration(seconds)}"
            )
        left = (self.total - self.done) * seconds / fresh
        rate = f"{fresh / max(seconds, 1e-3):,.1f} a second"
        return f"{self.done:,} of {count(self.total, 'run')}, {rate}, about {duration(left)} left"

    def decide(self, store: Store) -> int | None:
        """After a round: how many replications the next one makes; None: it is enough."""
        from automaton.studies.reports.comparisons import next_replications

        following = next_replications(store)
        if following is None:
            return None
        note(following.why)
        return following.replications


class Bar(Listener):
    """Shows on a terminal's stderr how many runs are done, how fast, and how long the rest takes."""

    def __init__(self, out: Path) -> None:
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
def progress(out: Path) -> Iterator[Listener]:
    """A progress bar on a terminal, a line a minute in a pipe; says what is kept after Ctrl-C."""
    listener = Bar(out) if sys.stderr.isatty() else Listener(out)
    try:
        with listener.bar if isinstance(listener, Bar) else contextlib.nullcontext():
            yield listener
    except KeyboardInterrupt:
        if listener.total:
            kept = f"{listener.done:,} of {count(listener.total, 'run')} are kept in {out}"
            note(f"stopped; {kept}; the same command goes on")
        raise


def tell(output: Output, out: Path, swept: SweepResult, seconds: float) -> None:
    """Say what was done."""
    begun, tally, study = swept.begun, swept.tally, swept.store.study

    def summary() -> dict[str, Any]:
        done = {"study": study.name, "out": str(out), "runs": study.runs}
        done |= {"existing": begun.done, **tally._asdict(), "failed": swept.failed}
        return {**done, "wall_s": round(seconds, 3)}

    output.write(lambda: summary_document(swept, out), summary)
    if swept.failed:
        what = f"{count(swept.failed, 'run')} failed; the column `error` says why"
        note(f"{what}, --retry-failed tries again")


def summary_document(swept: SweepResult, out: Path) -> ReportDocument:
    """What was done, in a few sentences."""
    begun, tally, study = swept.begun, swept.tally, swept.store.study
    before = f" ({begun.done:,} were done before)" if begun.done else ""
    lines = [f"{study.name}: {count(study.runs, 'run')} in {out}{before}"]
    if swept.store.declared.in_rounds:
        from automaton.studies.reports.comparisons import stopping_remarks, stopping_text
        from automaton.studies.reports.study_results import read_results

        results = read_results(swept.store)
        lines += [stopping_text(results), *stopping_remarks(results)]
    if tally.unfinished:
        lines.append(f"{count(tally.unfinished, 'run')} reached the limit of the scenario")
    if tally.repeated:
        lines.append(f"{count(tally.repeated, 'run')} begun twice, since a worker died")
    return ReportDocument(study.name, [Listed(lines, mark="")])
