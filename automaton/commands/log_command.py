"""Make a recording from a log of real robots, to watch what they did as if it were a simulated run.

The log has VDA 5050 state messages, one JSON a line, bare or in an envelope with topic and payload; or it
is a CSV file with the columns robot, time, x and y, and, if there, theta, load, charge and state. Files
may be packed (.gz). The scenario has the floor and the fleet; units.origin and units.rotation place
the floor in the coordinates of the site.

Exit code 0: done; 2: bad input, such as positions that are not on the floor.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from automaton.commands.arguments import (
    add_json_argument,
    add_settings_argument,
    check_writable,
    print_document,
    print_json,
)
from automaton.documents.report_document import Block, Listed, ReportDocument
from automaton.errors import InputError
from automaton.units import count
from automaton.world.resolve import resolve

if TYPE_CHECKING:
    from automaton.calibration.observed_run import ObservedRun
    from automaton.calibration.state_log import StateLog


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton log`."""
    add_log_arguments(parser)
    text = "write the observed run to FILE, a recording for replay, cast, explain and verify"
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help=text)
    add_json_argument(parser)


def add_log_arguments(parser: argparse.ArgumentParser) -> None:
    """The log and its floor: `logs`, `floor`, `settings` and `columns`."""
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG", help="a file of the log")
    text = "a scenario file, or the name of a shipped scenario, with the floor and the fleet"
    parser.add_argument("--floor", required=True, metavar="SCENARIO", help=text)
    add_columns_argument(parser)
    add_settings_argument(
        parser, "change a value of the scenario, such as units.rotation=90; may be repeated"
    )


def add_columns_argument(parser: argparse.ArgumentParser) -> None:
    """The columns of CSV logs: `columns`, pairs."""
    text = "the column of a field in CSV logs, such as robot=agv; may be repeated"
    add = parser.add_argument
    add(
        "--column",
        type=named,
        action="append",
        default=[],
        dest="columns",
        metavar="FIELD=NAME",
        help=text,
    )


def named(text: str) -> tuple[str, str]:
    """A field and its name."""
    field, _, name = (part.strip() for part in text.partition("="))
    if not field or not name:
        raise argparse.ArgumentTypeError(f"{text!r} is not FIELD=NAME, such as robot=agv")
    return field, name


def run(args: argparse.Namespace) -> int:
    """Read the log, write the observed run, and print what the robots did."""
    from automaton.calibration.state_log import read_log

    resolved = resolve(args.floor, args.settings)
    check_writable(args.out)
    log = read_log(args.logs, dict(args.columns))
    from automaton.calibration.observed_run import write_observed_run

    try:
        observed = write_observed_run(log, resolved, args.out)
    except InputError as error:
        raise error.at(str(args.logs[0])) from None
    if args.json:
        print_json(as_json(args, log, observed))
    else:
        print_document(ReportDocument(str(args.out), list(blocks(args, log, observed))))
    return 0


def blocks(args: argparse.Namespace, log: StateLog, observed: ObservedRun) -> Iterator[Block]:
    """What was read, and where the time of the robots went."""
    from automaton.runs.run_report import headline_table, uses_table
    from automaton.units import unit

    tick = unit(observed.simulation.resolved.scenario.units.tick)
    first = f"{args.out}: observed run, {count(observed.robots, 'robot')}, "
    lines = [first + count(observed.simulation.tick, "tick"), *log.counts.sentences()]
    rest = {
        "messages off the floor": observed.off_floor,
        "robots elsewhere than their last messages lead": observed.jumps,
        "orders and loads beyond the most that a run holds": observed.left_out,
    }
    lines += [f"{what} {many:,}" for what, many in rest.items() if many]
    yield Listed(lines, mark="")
    outcome = observed.outcome()
    if log.orders or log.loads:
        yield headline_table(observed.simulation.resolved, outcome, tick)
    yield uses_table(outcome)


def as_json(args: argparse.Namespace, log: StateLog, observed: ObservedRun) -> dict[str, Any]:
    """The observed run as one object; times are in ticks."""
    outcome = observed.outcome()
    return {
        "file": str(args.out),
        "robots": observed.robots,
        "ticks": observed.simulation.tick,
        "log": log.counts._asdict(),
        "off_floor": observed.off_floor,
        "jumps": observed.jumps,
        "orders": outcome.orders,
        "delivered": outcome.delivered,
        "metrics": outcome.metrics,
        "robot_time": dict(outcome.uses),
    }
