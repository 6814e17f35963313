"""Compare a fitted scenario with days of the site that it was not fitted to.

Exit code 0: the model matches the site, or this cannot be said; 1: it differs; 2: bad input; 130:
stopped by Ctrl-C; 143: by SIGTERM.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from automaton.commands.arguments import (
    add_output_arguments,
    add_scenario_arguments,
    add_workers_argument,
    output_of,
    print_warnings,
    show_line,
    whole,
)
from automaton.commands.demand_mode import add_orders_arguments, order_columns
from automaton.commands.log_command import add_columns_argument
from automaton.errors import InputError
from automaton.units import count

MIN_REPLICATIONS, MAX_REPLICATIONS = 20, 10_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton compare`."""
    add_scenario_arguments(parser)
    add = parser.add_argument
    text = "logs: VDA 5050 state messages, one JSON object a line, or CSV; each of a day, or of several"
    add("logs", nargs="+", type=Path, metavar="LOG", help=text)
    add_columns_argument(parser)
    text = (
        "the orders of the days: one file for all, or one for each LOG in their order (default: orders "
        "are recovered from the logs)"
    )
    add_orders_arguments(parser, text, several=True)
    add(
        "--runs",
        type=whole("a number of runs", MIN_REPLICATIONS, MAX_REPLICATIONS),
        default=50,
        metavar="N",
        help="simulate each day N times (default: 50)",
    )
    add_workers_argument(parser)
    add_output_arguments(parser, "--report")


def run(args: argparse.Namespace) -> int:
    """Read the days, simulate them, judge, print."""
    output = output_of(args, "--report")
    orders: list[Path] = args.orders or []
    if len(orders) not in (0, 1, len(args.logs)):
        logs = count(len(args.logs), "log")
        raise InputError(
            f"--orders is there {len(orders):,} times, but there are {logs}; use 1 or as many"
        )
    from automaton.calibration.agreement import DIFFERS
    from automaton.calibration.agreement_report import agreement_document, agreement_record
    from automaton.calibration.compared_days import compare_days
    from automaton.calibration.site_day import ComparedSite, read_days
    from automaton.world.resolve import resolve

    base = resolve(args.scenario, args.settings, args.seed)
    print_warnings(base)
    named = order_columns(args)
    settings = tuple(args.settings)
    site = ComparedSite(
        args.scenario, settings, args.seed, base, dict(args.columns), named, args.order_time, {}
    )
    none: list[Path | None] = [None]
    of_log = [*orders] if len(orders) > 1 else [*(orders or none)] * len(args.logs)
    days = [
        day
        for log, file in zip(args.logs, of_log, strict=True)
        for day in read_days(site, log, file)
    ]
    left, done = args.runs * len(days), 0

    def on_done(more: int) -> None:
        nonlocal done
        done += more
        show_line(f"{done:,} of {count(left, 'run')}")

    compared = compare_days(days, args.runs, args.workers, on_done)
    show_line("")
    notes = [note for day in days for note in day.notes]
    name = base.scenario.name
    output.write(
        lambda: agreement_document(name, compared, notes),
        lambda: agreement_record(name, compared, notes),
    )
    return 1 if compared.agreement.verdict == DIFFERS else 0
