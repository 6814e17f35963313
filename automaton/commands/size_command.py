"""Find the smallest fleet that meets a target, with the confidence of the answer.

Exit code 0: answered; 1: not reached, undecided, or a worker died; 2: bad input; 130: interrupted;
143: ended by SIGTERM. Except for bad input, the results so far are always printed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

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
from automaton.errors import InputError, WorkerDiedError, nearest
from automaton.units import shown_unit, ticks_and_time, unit
from automaton.world.scenario_warnings import scenario_warnings

if TYPE_CHECKING:
    from automaton.scenario.document import Override
    from automaton.studies.sizing.fleet_runs import Fleets
    from automaton.studies.sizing.fleet_search import FleetConfig, Question, SearchQuantity
    from automaton.studies.sizing.sizing_session import ParkingSession, SizingSession


PARKING_STEPS = 5  # from the least to the greatest number of robots with orders
NOT_FOR_PARKING = (  # options of a search for the smallest fleet
    "assure", "success_share", "mean", "indifference", "strategies", "conditions", "price", "plots",
)  # fmt: skip


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
    add("--target", metavar="T", help=text)
    add("--robots", metavar="A..B", help="test fleets of A to B robots")
    text = (
        "vary WHAT instead of robots. For stations or chargers, find the smallest number of "
        "open ones; for strategy.allocation.active, find the limit that gives the best value "
        "of the metric that --target names (default: throughput or makespan)"
    )
    add("--vary", nargs=2, metavar=("WHAT", "A..B"), help=text)
    text = (
        "test every Nth number from A to B (default: 1; for strategy.allocation.active, a "
        "fifth of the range)"
    )
    add("--step", type=whole("a step", 1), metavar="N", help=text)
    text = (
        "with --robots, fix the number of robots of a type (slow=12) or the ratio of all types "
        "(slow:fast=1:3)"
    )
    add("--mix", metavar="TYPE=N", help=text)
    text = (
        "repeat the search under each condition of a YAML file, a list of {name, set}; all use "
        "the same seeds"
    )
    add("--conditions", type=Path, metavar="FILE", help=text)
    add(
        "--success-share",
        type=positive_share,
        metavar="P",
        help="require this share of the runs to meet the target (default: 0.95; in a steady state "
        "the mean is compared with the target, as with --mean)",
    )
    add(
        "--mean",
        action="store_true",
        default=None,
        help="require the mean of the runs, not a share of them, to meet the target",
    )
    add(
        "--assure",
        action="store_true",
        help="pass a fleet only if the runs show, with the confidence of --alpha, that at least "
        "the required share of all days meets the target",
    )
    add(
        "--indifference",
        type=positive,
        metavar="Z",
        help="allow either verdict if the true share is within Z of --success-share (default: "
        "0.02); with --mean, if the true mean is within Z of the target (default: 1 %% of the "
        "target)",
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
    text = (
        "also print the price of the answer, at P per robot (with --vary: per station or charger)"
    )
    add("--price", type=positive, default=0.0, metavar="P", help=text)
    text = "store the runs in this folder; if the command is repeated, only missing runs are made"
    add("--out", type=Path, metavar="DIR", help=text)
    add_workers_argument(parser)
    text = "write plots of shares and means as PNG and SVG (needs fleet-automaton[plots])"
    add("--plots", type=Path, metavar="DIR", help=text)
    add_output_arguments(parser, "--report")


def run(args: argparse.Namespace) -> int:
    """Search and report; after Ctrl-C or the death of a worker, report the results so far."""
    if args.plots is not None:
        from automaton.documents.html_output import figure_class

        figure_class()  # fails before any computation if matplotlib is missing
    output = output_of(args, "--report")
    from automaton.studies.process_pool import PersistentPool
    from automaton.studies.sizing.fleet_runs import Fleets, kept_in, run_and_measure_use
    from automaton.studies.sizing.fleet_search import PARKING, VARIED
    from automaton.studies.sizing.sizing_report import forecast

    quantity = quantity_of(args)
    with (
        kept_in(args.out) as run_store,
        PersistentPool(args.workers, run_and_measure_use) as rounds,
    ):
        fleets = {
            name: Fleets(args.scenario, settings, args.seed, rounds, quantity, args.mix, run_store)
            for name, settings in conditions_of(args, quantity).items()
        }
        if quantity == VARIED[PARKING]:
            return compare_parked(args, output, fleets[""])
        sessions = sessions_of(args, fleets)
        first = next(iter(sessions.values()))
        for sentence in forecast(first.question) if args.assure else ():
            note(sentence)
        cut = interruption_of(list(sessions.values()))
        show(args, output, sessions, next(iter(fleets.values())))
        if args.plots is not None:
            draw(args.plots, sessions)
        if cut is not None:
            raise_again(cut, args.out)
    return 0 if all(session.settled for session in sessions.values()) else 1


def interruption_of(
    sessions: Sequence[SizingSession | ParkingSession],
) -> BaseException | None:
    """Carry out sessions; return Ctrl-C or the death of a worker, after which results are printed."""
    try:
        for session in sessions:
            session.go()
    except (KeyboardInterrupt, WorkerDiedError) as error:
        return error
    finally:
        show_line("")
    return None


def raise_again(cut: BaseException, out: Path | None) -> NoReturn:
    """After the results so far: say how to go on, and raise what ended the search."""
    stored = f"stored in {out}; repeat the command to resume"
    note(f"stopped; the runs are {stored if out else 'not stored; with --out DIR they are'}")
    raise cut


def quantity_of(args: argparse.Namespace) -> SearchQuantity:
    """What the search varies. Raises InputError."""
    from automaton.studies.sizing.fleet_search import PARKING, ROBOT_COUNT, VARIED, quantity_named

    if (args.robots is None) == (args.vary is None):
        raise InputError(
            "size needs either --robots A..B, or --vary stations A..B or chargers A..B"
        )
    quantity = ROBOT_COUNT if args.vary is None else quantity_named(args.vary[0])
    if args.mix is not None and quantity != ROBOT_COUNT:
        raise InputError("--mix: the fleet stays as it is; use it with --robots")
    if quantity == VARIED[PARKING]:
        useless = [option for option in NOT_FOR_PARKING if getattr(args, option)]
        if useless:
            option = useless[0].replace("_", "-")
            raise InputError(f"--{option}: {quantity.option} compares means; omit it")
    elif args.target is None:
        raise InputError("size needs a target, such as --target 'makespan<=3000'")
    return quantity


def compare_parked(args: argparse.Namespace, output: Output, fleets: Fleets) -> int:
    """Compare numbers of robots with orders, the others being parked, and report."""
    from automaton.runs.metric_catalogue import METRIC_CATALOGUE
    from automaton.studies.reports.comparisons import direction_of
    from automaton.studies.sizing.fleet_runs import Checked
    from automaton.studies.sizing.fleet_search import Target, make_question, read_robots
    from automaton.studies.sizing.sizing_figures import parking_as_json, parking_document
    from automaton.studies.sizing.sizing_session import parking_of

    metric = args.target or ("makespan" if fleets.ends_with_orders else "throughput")
    direction = direction_of(metric) if metric in METRIC_CATALOGUE else None
    if direction is None:
        better = [one for one in METRIC_CATALOGUE if direction_of(one)]
        raise InputError(
            f"--target '{metric}': expected a metric that is better high or low{nearest(metric, better)}"
        )
    target = Target(metric, direction == "lowest", 0.0)
    numbers = read_robots(args.vary[1], fleets.quantity)
    question = make_question(
        target, numbers, ("",), None, 1.0, args.alpha, args.budget, True, fleets.warm_up,
        step=args.step or max(1, (numbers[1] - numbers[0]) // PARKING_STEPS),
        quantity=fleets.quantity,
    )  # fmt: skip
    print_warnings(fleets.base)
    runner = Checked(fleets, question)
    runner.on_round = lambda place, runs: show_line(
        f"{place.strategy or 'all robots with orders'}; {runs:,} of at most {args.budget:,} runs"
    )
    session = parking_of(fleets, runner)
    cut = interruption_of([session])
    name = fleets.base.scenario.name
    output.write(
        lambda: parking_document(session, name),
        lambda: parking_as_json(session, name, fleets.seed),
    )
    if cut is not None:
        raise_again(cut, args.out)
    return 0 if session.best is not None and len(session.best.left) == 1 else 1


def conditions_of(
    args: argparse.Namespace, quantity: SearchQuantity
) -> dict[str, tuple[str | Override, ...]]:
    """The settings of each condition by name; without a file those of the command. Raises InputError."""
    settings = settings_of(args)
    if args.conditions is None:
        return {"": settings}
    from automaton.scenario.document import keys_of
    from automaton.studies.sweeps.named_changes import read_changes
    from automaton.studies.sweeps.sweep_plan import resolve_changes

    changes = read_changes(args.conditions)
    for change in changes:
        for one in change.overrides:
            if one.keys == keys_of(quantity.key):
                text = f"'{change.name}' sets {quantity.key}, which varies in this search"
                raise InputError(text, *change.place)
    resolve_changes(args.scenario, settings, changes)
    return {change.name: (*settings, *change.overrides) for change in changes}


def sessions_of(args: argparse.Namespace, fleets: dict[str, Fleets]) -> dict[str, SizingSession]:
    """A session for each condition; they share the budget. Raises InputError."""
    from automaton.studies.sizing.fleet_runs import Checked
    from automaton.studies.sizing.fleet_search import check_budget
    from automaton.studies.sizing.sizing_session import session_of

    sessions = {}
    for name, one in fleets.items():
        question = asked_of(args, one)
        check_budget(question, len(fleets))
        runner = Checked(one, question._replace(budget=question.budget // len(fleets)))
        sessions[name] = session = session_of(one, runner)
        runner.on_round = partial(tell_progress, name, session)
    for warning in dict.fromkeys(
        text for one in fleets.values() for text in scenario_warnings(one.base)
    ):
        note(f"{next(iter(fleets.values())).base.scenario.name}: warning: {warning}")
    return sessions


def asked_of(args: argparse.Namespace, fleets: Fleets) -> Question:
    """The question that the arguments ask. Raises InputError."""
    from automaton.studies.sizing.fleet_search import (
        make_question,
        read_robots,
        read_target,
        strategies_of,
    )

    quantity = fleets.quantity
    return make_question(
        read_target(args.target, fleets.tick),
        read_robots(args.robots if args.vary is None else args.vary[1], quantity),
        strategies_of(args.strategies),
        args.success_share,
        args.indifference,
        args.alpha,
        args.budget,
        args.mean,
        fleets.warm_up,
        args.assure,
        args.step or 1,
        quantity,
    )


def show(
    args: argparse.Namespace, output: Output, sessions: dict[str, SizingSession], fleets: Fleets
) -> None:
    """Write the answer."""
    from automaton.studies.sizing.sizing_figures import as_json
    from automaton.studies.sizing.sizing_report import answer_document

    scenario = fleets.base.scenario
    limit = ticks_and_time(scenario.stop.max_duration, unit(scenario.units.tick))
    ends = f"A run that does not finish within {limit} fails."
    if not fleets.ends_with_orders:
        ends = f"Every run lasts {limit}."
    elif scenario.ends_at_limit:
        ends = f"A run ends with its orders, or after {limit}."
    if scenario.units.tick != "1 tick":
        ends += f" 1 tick = {shown_unit(scenario.units.tick)}."
    if scenario.refine > 1:
        ends += (
            f" Runs divide each tick into {scenario.refine}; metrics count the scenario's ticks."
        )
    output.write(
        lambda: answer_document(sessions, scenario.name, ends, args.price),
        lambda: as_json(sessions, scenario.name, fleets.seed, args.price),
    )


def draw(folder: Path, sessions: dict[str, SizingSession]) -> None:
    """Write the plots, and note their files."""
    from automaton.documents.html_output import write_plots
    from automaton.studies.sizing.sizing_figures import curves

    plots = [one for name, session in sessions.items() for one in curves(session, name)]
    for path in write_plots(plots, folder):
        note(f"wrote {path}")


def tell_progress(condition: str, session: SizingSession, place: FleetConfig, runs: int) -> None:
    """Show on a terminal what the search believes so far."""
    from automaton.studies.sizing.sizing_report import belief

    under = f"{condition}: " if condition else ""
    budget = session.question.budget
    show_line(f"{under}{belief(session, place)}; {runs:,} of at most {budget:,} runs")
