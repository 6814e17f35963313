"""Find the smallest fleet that meets a target, with the confidence of the answer.

Exit code 0: answered; 1: not reached, undecided, or a worker died; 2: bad input; 130: interrupted;
143: ended by SIGTERM. Except for bad input, the results so far are always printed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from automaton.commands.arguments import (
    Output,
    add_output_arguments,
    add_refinement_arguments,
    add_scenario_arguments,
    add_workers_argument,
    note,
    output_of,
    print_warnings,
    settings_of,
    show_line,
    whole,
)
from automaton.errors import WorkerDiedError
from automaton.units import shown_unit, ticks_and_time, unit

if TYPE_CHECKING:
    from automaton.studies.sizing.fleet_search import FleetConfig, Question
    from automaton.studies.sizing.sizing_session import Fleets, SizingSession


def positive(text: str) -> float:
    """The type of an argument that is a number above 0."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number above 0")
    return number


def positive_share(text: str) -> float:
    """The type of an argument that is a fraction, such as .95 or 95%."""
    return positive(text.removesuffix("%")) / (100 if text.endswith("%") else 1)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton size`."""
    add_scenario_arguments(parser)
    add_refinement_arguments(parser)
    add = parser.add_argument
    text = "find the smallest fleet with, for example, 'makespan<=3000' (ticks) or 'makespan<=5h'"
    add("--target", required=True, metavar="T", help=text)
    add("--robots", required=True, metavar="A..B", help="test fleets of A to B robots")
    add(
        "--success-share",
        type=positive_share,
        metavar="P",
        help="require this share of the runs to meet the target (default: 0.95; in a steady state: "
        "--mean)",
    )
    add(
        "--mean",
        action="store_true",
        default=None,
        help="require the mean of the runs, not a share of them, to meet the target",
    )
    add(
        "--indifference",
        type=positive,
        metavar="Z",
        help="accept either verdict if the true share is within P +- Z (default: 0.02); with --mean, "
        "if the mean is within Z of the target (default: 1 %% of it)",
    )
    add(
        "--alpha",
        type=positive,
        default=0.05,
        metavar="A",
        help="limit the error probability of all verdicts together (default: 0.05)",
    )
    add(
        "--budget",
        type=whole("a number of runs", 1),
        default=20_000,
        metavar="RUNS",
        help="make at most RUNS runs (default: 20,000)",
    )
    text = "compare these strategies, such as independent,cooperative"
    add("--strategies", metavar="A,B", help=text)
    text = "print the price of the fleet, at P per robot"
    add("--price", type=positive, default=0.0, metavar="P", help=text)
    add_workers_argument(parser)
    text = "write plots of shares and means as PNG and SVG (needs fleet-automaton[plots])"
    add("--plots", type=Path, metavar="DIR", help=text)
    add_output_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Search and report; after Ctrl-C or the death of a worker, report the results so far."""
    if args.plots is not None:
        from automaton.documents.html_output import figure_class

        figure_class()  # fails before any computation if matplotlib is missing
    output = output_of(args)
    from automaton.studies.process_pool import PersistentPool
    from automaton.studies.sizing.sizing_session import (
        Checked,
        Fleets,
        run_and_measure_use,
        session_of,
    )

    with PersistentPool(args.workers, run_and_measure_use) as rounds:
        fleets = Fleets(args.scenario, settings_of(args), args.seed, rounds)
        asked = asked_of(args, fleets)
        print_warnings(fleets.base)
        session = session_of(fleets, Checked(fleets, asked, tell_progress))
        cut: BaseException | None = None
        try:
            session.go()
        except (KeyboardInterrupt, WorkerDiedError) as error:
            cut = error
        finally:
            show_line("")
        show(args, output, session, fleets)
        if args.plots is not None:
            draw(args.plots, session)
        if cut is not None:
            raise cut
    return 0 if session.settled else 1


def asked_of(args: argparse.Namespace, fleets: Fleets) -> Question:
    """The question that the arguments ask. Raises InputError."""
    from automaton.studies.sizing.fleet_search import (
        make_question,
        read_robots,
        read_target,
        strategies_of,
    )

    target, robots = read_target(args.target, fleets.tick), read_robots(args.robots)
    strategies = strategies_of(args.strategies)
    return make_question(
        target,
        robots,
        strategies,
        args.success_share,
        args.indifference,
        args.alpha,
        args.budget,
        args.mean,
        fleets.warm_up,
    )


def show(args: argparse.Namespace, output: Output, session: SizingSession, fleets: Fleets) -> None:
    """Write the answer."""
    from automaton.studies.sizing.sizing_report import answer_document, as_json

    scenario = fleets.base.scenario
    limit = ticks_and_time(scenario.stop.max_duration, unit(scenario.units.tick))
    ends = f"A run that does not finish within {limit} fails."
    if not fleets.ends_with_orders:
        ends = f"Every run lasts {limit}."
    if scenario.units.tick != "1 tick":
        ends += f" 1 tick = {shown_unit(scenario.units.tick)}."
    if scenario.refine > 1:
        ends += (
            f" Runs divide each tick into {scenario.refine}; metrics count the scenario's ticks."
        )
    output.write(
        lambda: answer_document(session, scenario.name, ends, args.price),
        lambda: as_json(session, scenario.name, fleets.seed, args.price),
    )


def draw(folder: Path, session: SizingSession) -> None:
    """Write the plots, and note their files."""
    from automaton.documents.html_output import write_plots
    from automaton.studies.sizing.sizing_report import curves

    for path in write_plots(curves(session), folder):
        note(f"wrote {path}")


def tell_progress(place: FleetConfig, runs: int, asked: Question) -> None:
    """Show the progress of the search on a terminal."""
    show_line(f"{place.robots} robots, {runs:,} runs of at most {asked.budget:,}")
