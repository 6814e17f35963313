"""Compare changes of a scenario with the unchanged scenario, in pairs of runs with the same seed.

Exit code 0: compared; 1: some runs failed; 2: bad input; 130: stopped by Ctrl-C; 143: by
SIGTERM. The results so far are printed before.
"""

from __future__ import annotations

import argparse
import contextlib
import shlex
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from automaton.commands.arguments import (
    add_output_arguments,
    add_refinement_arguments,
    add_scenario_arguments,
    add_timeout_argument,
    add_workers_argument,
    note,
    output_of,
    print_warnings,
    settings_of,
    whole,
)
from automaton.commands.sweep_command import progress, require_results
from automaton.documents.report_document import ReportDocument, Text
from automaton.scenario.document import Override, parse_setting
from automaton.units import count
from automaton.world.scenario_warnings import scenario_warnings

if TYPE_CHECKING:
    from automaton.scenario.schema import Scenario
    from automaton.studies.reports.build_report import StudyReport
    from automaton.studies.sweeps.result_store import Store
    from automaton.studies.sweeps.sweep_plan import SweepPlan
    from automaton.world.resolved import Resolved

FIXED_KEYS: Final = ("name", "summary", "seed")  # settings that are part of the study itself
MAX_PAIRS: Final = 1_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton what-if`."""
    add_scenario_arguments(parser)
    add = parser.add_argument
    text = "a YAML file that lists the changes, each as {name: NAME, set: {KEY: VALUE, ...}}"
    add("changes", type=Path, metavar="CHANGES", help=text)
    add_refinement_arguments(parser)
    add(
        "--pairs",
        type=whole("a number of pairs", 2, MAX_PAIRS),
        default=20,
        metavar="N",
        help="run each change and the unchanged scenario with the same N seeds (default: 20)",
    )
    add(
        "--metric",
        action="append",
        dest="metrics",
        metavar="NAME",
        help="compare this metric; may be repeated (default: throughput, lead_time, lead_time_p95 and "
        "late_share, where measured)",
    )
    add_run_arguments(parser)


def add_run_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of commands that compare changes: how to do the runs, and where results go."""
    add_workers_argument(parser, 1024)
    text = (
        "store the results in this folder; if the command is repeated, only missing runs are made"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help=text)
    parser.add_argument(
        "--recompute",
        action="store_true",
        help="with --out, ignore results in the folder if they come from other code or other changes",
    )
    add_timeout_argument(parser)
    add_output_arguments(parser, "--report")


def run(args: argparse.Namespace) -> int:
    """Run all pairs, compare, print."""
    output = output_of(args, "--report")
    settings = settings_of(args)
    require_results()
    from automaton.studies.reports.build_report import read_report
    from automaton.studies.sweeps.named_changes import what_if_study
    from automaton.studies.sweeps.sweep_plan import make_sweep_plan, with_same_right_of_way
    from automaton.world.resolve import resolve

    base = resolve(args.scenario, settings, args.seed).unrefined
    print_warnings(base)
    keys = study_keys(args.scenario, "what if", base.scenario, levels_of(settings))
    keys |= {"replications": args.pairs}
    keys |= {"analysis": {"metrics": args.metrics}} if args.metrics else {}
    study = what_if_study(args.changes, keys, asked_metrics(args))
    plan = with_same_right_of_way(study, make_sweep_plan(study), base, note)
    warn_of_changes(plan, base)
    with folder_of(args.out) as folder:
        swept = swept_into(args, folder, plan, args.recompute)
        report = read_report(swept.store)
    output.write(
        lambda: document_of(report, swept, args.out),
        lambda: as_json(report, swept, args.out),
    )
    if swept.failed:
        note(f"{count(swept.failed, 'run')} failed; the caveats say why")
    if swept.cut is not None:
        raise swept.cut
    return 1 if swept.failed else 0


class SweptRuns(NamedTuple):
    """The runs of a study, all of them unless they were cut off."""

    store: Store
    existing: int  # runs that the folder had before
    done: int
    failed: int
    cut: KeyboardInterrupt | None  # Ctrl-C or SIGTERM, after which the results so far are printed

    @property
    def cut_text(self) -> str:
        """A sentence about the missing runs; "" if none is missing."""
        runs = count(self.store.study.runs, "run")
        return f"Interrupted: results so far, of {self.done:,} of {runs}." if self.cut else ""


def swept_into(
    args: argparse.Namespace,
    folder: Path,
    plan: SweepPlan,
    recompute: bool,
) -> SweptRuns:
    """Do the runs of a study that a folder lacks, with progress on stderr. Raises InputError.

    Ctrl-C and SIGTERM end this, but are raised only if no run is done.
    """
    from automaton.studies.sweeps import pools
    from automaton.studies.sweeps.result_store import Store
    from automaton.studies.sweeps.sweep_session import sweep_into

    listener, cut = None, None
    try:
        with progress(args.out) as listener:
            sweep_into(
                folder,
                plan,
                lambda: pools.LocalPool(args.workers),
                recompute,
                listener.begin,
                listener.rows,
                patience=args.strategy_timeout,
            )
    except KeyboardInterrupt as error:
        if listener is None or not listener.done:
            raise
        cut = error
    store = Store(folder)
    return SweptRuns(store, listener.before, listener.done, len(store.failed()), cut)


def warn_of_changes(plan: SweepPlan, base: Resolved) -> None:
    """Print the warnings that a change adds to those of the scenario."""
    known = set(scenario_warnings(base))
    for point, resolved in zip(plan.points, plan.scenarios, strict=True):
        for warning in scenario_warnings(resolved.unrefined):
            if warning not in known:
                note(f"{point.name}: warning: {warning}")


def study_keys(
    scenario: str, what: str, base: Scenario, settings: dict[str, Any]
) -> dict[str, Any]:
    """The keys of a study of one scenario, without its points, their number of runs and its analysis."""
    return {
        "name": f"{base.name}: {what}",
        "scenario": scenario,
        **({"set": settings} if settings else {}),
        "seed": base.seed,
    }


def levels_of(settings: Sequence[str | Override]) -> dict[str, Any]:
    """The settings of the command line by key; those that no run depends on are left out."""
    levels: dict[str, Any] = {}
    for setting in settings:
        one = parse_setting(setting) if isinstance(setting, str) else setting
        key = ".".join(map(str, one.keys))
        levels.pop(key, None)  # the last of equal keys counts, in its place
        if key not in FIXED_KEYS:
            levels[key] = one.value
    return levels


def asked_metrics(args: argparse.Namespace) -> list[Override]:
    """The metrics of the command line, for errors about them."""
    return [
        Override(f"--metric {name}", ("analysis", "metrics", number), name)
        for number, name in enumerate(args.metrics or [])
    ]


@contextlib.contextmanager
def folder_of(out: Path | None) -> Iterator[Path]:
    """The results folder; without one, a temporary folder that is removed at the end."""
    if out is not None:
        yield out
        return
    with tempfile.TemporaryDirectory(prefix="automaton-what-if-") as folder:
        yield Path(folder)


def document_of(report: StudyReport, swept: SweptRuns, out: Path | None) -> ReportDocument:
    """The comparison as a document, in the order of a report."""
    from automaton.studies.reports.build_report import opening_of
    from automaton.studies.reports.what_if import what_if_section

    document = opening_of(report)
    if swept.cut_text:
        document.blocks.insert(1, Text(swept.cut_text, strong=True))
    document.add(*what_if_section(report.results, report.compared))
    if out is not None:
        command = f"automaton report {shlex.quote(str(out))}"
        document.add(Text(f"All runs are in {out}; `{command}` shows further tables."))
    return document


def as_json(report: StudyReport, swept: SweptRuns, out: Path | None) -> dict[str, Any]:
    """The comparison as one object, in the units of the runs."""
    from automaton.studies.reports.export import point_keys
    from automaton.studies.reports.what_if import what_if_records

    results = report.results
    return {
        "study": results.study.name,
        "scenario": results.study.scenario,
        "out": None if out is None else str(out),
        "seed": results.study.seed,
        "pairs": results.study.max_replications,
        "set": results.study.settings or {},
        "baseline": results.analysis.baseline,
        "points": [point_keys(point) for point in results.points],
        "what_if": list(what_if_records(results, report.compared)),
        "remarks": report.notes,
        "existing": swept.existing,
        "complete": swept.cut is None,
        "failed": swept.failed,
    }
