"""Fit a scenario to the log of a site. The result is a file of settings; the scenario is not changed.

Without a log, fit the demand of a week to a file of orders. Exit code 0: fitted; 2: bad input.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

from automaton.atomic_write import atomic_writer
from automaton.commands.arguments import (
    add_output_arguments,
    add_settings_argument,
    add_workers_argument,
    check_writable,
    measured,
    note,
    output_of,
    print_warnings,
    show_line,
    whole,
)
from automaton.commands.demand_mode import add_orders_arguments, fit_orders
from automaton.commands.log_command import add_columns_argument, named
from automaton.errors import InputError, alternatives
from automaton.units import count, exact_time


def pairs(text: str) -> int:
    """The type of --pairs: 0, or enough for an interval."""
    return 0 if text == "0" else whole("a number of pairs, or 0", 2, 1000)(text)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton calibrate`."""
    add = parser.add_argument
    text = "logs of real robots: VDA 5050 state messages, one JSON object a line, or CSV"
    add("logs", nargs="*", type=Path, metavar="LOG", help=text)
    add("--floor", metavar="SCENARIO", help="the scenario of the site: a file, or a shipped name")
    add_settings_argument(parser)
    text = "without LOG: a file of orders of at least 4 weeks; --out gets the rates of the week"
    add_orders_arguments(parser, text)
    text = "write the settings to FILE, for --set @FILE"
    add("--out", type=Path, required=True, metavar="FILE", help=text)
    add_columns_argument(parser)
    text = (
        "the action type of pick, drop or handling in the log, such as handling=serve (default: pick, "
        "drop, serve); may be repeated"
    )
    metavar = "FIELD=TYPE"
    add(
        "--action",
        type=named,
        action="append",
        default=[],
        dest="actions",
        metavar=metavar,
        help=text,
    )
    text = "count stops and slow drives from this length on as delays (default: 1 s)"
    delay = measured("a time", "2 s", exact_time)
    add("--shortest-delay", type=delay, default=Fraction(1), metavar="TIME", help=text)
    text = "list stretches and robots slower than usual by more than PERCENT (default: 5)"
    slow = whole("a percentage", 1, 90)
    add("--slow-stretch", type=slow, default=5, metavar="PERCENT", help=text)
    text = (
        "compare fitted and empirical handling times, and a finer tick, in N pairs of runs (default: "
        "20; 0: no runs)"
    )
    add("--pairs", type=pairs, default=20, metavar="N", help=text)
    add_workers_argument(parser)
    add_output_arguments(parser, "--report")


def run(args: argparse.Namespace) -> int:
    """Fit, compare, write the settings, print."""
    if not args.logs:
        if args.orders is None:
            raise InputError("calibrate needs a LOG, or --orders FILE")
        return fit_orders(args)
    if args.orders is not None:
        raise InputError("--orders is fitted without a LOG; leave one of them out")
    if args.floor is None:
        raise InputError("a log needs --floor SCENARIO, whose floor the robots drive on")
    check_scipy()
    output = output_of(args, "--report")
    check_writable(args.out)
    from automaton.calibration.fitted_settings import settings_text
    from automaton.calibration.site_fits import OPERATIONS, Thresholds, fit_site
    from automaton.calibration.state_log import read_log
    from automaton.world.resolve import resolve

    actions = dict(args.actions)
    check_fields(actions, OPERATIONS)
    base = resolve(args.floor, args.settings)
    print_warnings(base)
    log = read_log(args.logs, dict(args.columns))
    thresholds = Thresholds(args.slow_stretch / 100, float(args.shortest_delay))
    try:
        fits = fit_site(log, base, {**OPERATIONS, **actions}, thresholds)
    except InputError as error:
        raise error.at(str(args.logs[0])) from None
    model = fitted_model(args, fits)
    text = settings_text(model.settings, fits, ", ".join(map(str, args.logs)))
    with atomic_writer(args.out) as file:
        file.write(text.encode())
    note(f"wrote {args.out}; use it with --set @{args.out}")
    from automaton.calibration.fit_report import fit_document, fit_record

    head = args.floor, str(args.out), log.counts.sentences()
    output.write(
        lambda: fit_document(fits, model.remarks, *head),
        lambda: fit_record(fits, model.settings, model.remarks, *head),
    )
    return 0


def check_scipy() -> None:
    """Check that the extra is installed. Raises InputError."""
    try:
        import scipy  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"calibrate needs SciPy, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[calibrate]'"
        ) from None


def check_fields(actions: Mapping[str, str], known: Mapping[str, str]) -> None:
    """Check the operations of --actions. Raises InputError."""
    for name in actions:
        if name not in known:
            raise InputError(f"'{name}' is not an operation; use {alternatives(known)}", "--action")


class FittedModel(NamedTuple):
    """The settings of a fit, and how they were chosen."""

    settings: dict[str, Any]
    remarks: list[str]


def fitted_model(args: argparse.Namespace, fits: Any) -> FittedModel:
    """The settings: the tick that they need, and the family of handling times that is good enough."""
    from automaton.calibration.fitted_settings import (
        arguments_of,
        largest_tick,
        plain_numbers,
        settings_of,
    )
    from automaton.world.resolve import resolve

    data = written_data(args)
    settings = settings_of(fits, data)
    own = [*args.settings, *arguments_of(settings)]
    fitted = resolve(args.floor, own)
    remarks = []
    if "handling" in settings.get("durations", {}) and own_handling(data):
        named = ", ".join(own_handling(data))
        remarks.append(f"{named} has handling times of its own, which calibrate does not change")
    tick = largest_tick(fitted)
    if tick is not None:
        plain = plain_numbers(args.floor, own, data, tick)
        if plain:
            keys = ", ".join(plain)
            remarks.append(
                f"a tick of {tick:g} s would convert all times within 2 %, but it would change {keys}"
            )
        else:
            settings["units"] = {"tick": f"{tick:g} s"}
            remarks.append(
                f"the tick is {tick:g} s: the largest that converts all times within 2 %"
            )
    if args.pairs:
        remarks += list(compare_models(args, fits, data, settings))
    return FittedModel(settings, remarks)


def written_data(args: argparse.Namespace) -> Mapping[str, Any]:
    """The scenario as it is written, with the settings of the command line."""
    from automaton.scenario.document import Document, override, parse
    from automaton.world.resolve import resolve

    data, _ = parse(resolve(args.floor).source, None)
    return override(Document(data), args.settings).data


def own_handling(data: Mapping[str, Any]) -> list[str]:
    """The stations with handling times of their own."""
    stations = data.get("stations") or {}
    return [name for name, one in stations.items() if isinstance(one, dict) and "handling" in one]


def compare_models(
    args: argparse.Namespace, fits: Any, data: Mapping[str, Any], settings: dict[str, Any]
) -> Iterator[str]:
    """Compare the fitted model with empirical handling times and with a finer tick; the former replace
    the family in `settings` if they change the result."""
    from automaton.calibration.fitted_settings import arguments_of, settings_of
    from automaton.studies.model_pairs import compare_pairs
    from automaton.world.resolve import resolve

    done = 0

    def difference(first: dict[str, Any], second: dict[str, Any], *more: str) -> tuple[bool, str]:
        """Whether two models differ, and by how much."""
        models = [
            resolve(args.floor, [*args.settings, *arguments_of(values), *own])
            for values, own in ((first, ()), (second, more))
        ]
        changes = compare_pairs(models[0], models[1], args.pairs, args.workers, on_done)
        words = ", ".join(f"{name.replace('_', ' ')} {change}" for name, change in changes.items())
        return any(change.matters for change in changes.values()), words or "nothing to compare"

    def on_done(more: int) -> None:
        nonlocal done
        done += more
        show_line(f"{count(done, 'run')} done")

    fit = fits.operations.get("handling")
    if fit is not None and fit.family != "constant":
        units = {"units": settings["units"]} if "units" in settings else {}
        empirical = {**settings_of(fits, data, is_empirical=True), **units}
        differs, words = difference(settings, empirical)
        if differs:
            settings["durations"] = empirical["durations"]
            yield f"handling times are a list instead of {fit.family}, since this changes {words}"
        else:
            yield f"handling times stay {fit.family}; a list of observed ones changes {words}"
    differs, words = difference(settings, settings, "refine=2")
    verdict = "matters, see `run --refine`" if differs else "is fine enough"
    yield f"the tick {verdict}: half of it changes {words}"
    show_line("")
