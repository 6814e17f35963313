"""Find the best strategies and settings for a scenario, with a limited number of short runs.

The search covers rights of way and allocations with their declared parameters. Its result depends only
on the budget and the seed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from automaton.atomic_write import atomic_writer
from automaton.commands.arguments import (
    add_json_argument,
    add_scenario_arguments,
    add_workers_argument,
    check_writable,
    note,
    print_document,
    print_json,
    show_line,
    whole,
)

DEFAULT_BUDGET = 200  # runs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton tune`."""
    add_scenario_arguments(parser)
    add = parser.add_argument
    add(
        "--metric",
        metavar="M",
        help="optimize this metric, such as lead_time (default: throughput; makespan if runs end)",
    )
    add(
        "--budget",
        type=whole("a number of runs", 1),
        default=DEFAULT_BUDGET,
        metavar="RUNS",
        help=f"make at most RUNS runs (default: {DEFAULT_BUDGET})",
    )
    add("--out", type=Path, metavar="FILE", help="write the best settings to FILE, for --set @FILE")
    add_workers_argument(parser)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Search, report, and write the best settings."""
    from automaton.studies.process_pool import PersistentPool
    from automaton.studies.tuning import (
        TuningRound,
        as_json,
        candidates_of,
        check_metric,
        measure,
        settings_file,
        tune,
        tuning_document,
    )

    def show_round(now: TuningRound, spent: int) -> None:
        show_line(f"{now.candidates} candidates, {spent:,} runs of at most {args.budget:,}")

    if args.out is not None:
        check_writable(args.out)
    known = candidates_of(args.scenario, args.settings, args.seed)
    metric = check_metric(args.metric, known.candidates[0].resolved)
    try:
        with PersistentPool(args.workers, measure) as pool:
            tuned = tune(known, metric, args.budget, pool, show_round)
    finally:
        show_line("")
    if args.json:
        print_json(as_json(tuned, known))
    else:
        print_document(tuning_document(tuned, known))
    if args.out is not None:
        with atomic_writer(args.out) as file:
            file.write(settings_file(tuned, known).encode())
        note(f"wrote {args.out}; use it with --set @{args.out}")
    return 0
