"""Fit a scenario to the log of a site. The result is a file of settings; the scenario is not changed.

Without a log, fit the demand of a week to a file of orders. Exit code 0: fitted; 2: bad input.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from automaton.atomic_write import atomic_writer
from automaton.calibration.demand import (
    WeeklyDemand,
    arrival_settings,
    check_weeks,
    fit_demand,
    read_releases,
    releases_at,
)
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
from automaton.commands.demand_mode import (
    add_orders_arguments,
    fit_orders,
    order_columns,
    refuse_alone,
)
from automaton.commands.log_command import add_columns_argument, named
from automaton.errors import InputError, alternatives
from automaton.units import count, exact_time

if TYPE_CHECKING:
    from automaton.calibration.output_tuning import TunedValue, Tuning
    from automaton.world.resolve import Resolved

ARRIVALS: Final = "orders.arrivals"
TUNING_BUDGET: Final = 500  # runs
PAIRS_OF_RUNS: Final = 20
SLOW_PERCENT: Final = 5
SHORTEST_DELAY: Final = Fraction(1)  # seconds


def pairs(text: str) -> int:
    """The type of --pairs: 0, or enough for an interval."""
    return 0 if text == "0" else whole("a number of pairs, or 0", 2, 1000)(text)


def keys(text: str) -> list[str]:
    """The type of --tune: keys of a scenario."""
    return [key.strip() for key in text.split(",") if key.strip()]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton calibrate`."""
    add = parser.add_argument
    text = "logs of real robots: VDA 5050 state messages, one JSON object a line, or CSV"
    add("logs", nargs="*", type=Path, metavar="LOG", help=text)
    add("--floor", metavar="SCENARIO", help="the scenario of the site: a file, or a shipped name")
    add_settings_argument(parser)
    text = (
        "a file of orders of at least 4 weeks, whose rates and batches are fitted (default: orders of "
        "the log); without LOG, --out gets the rates of the week"
    )
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
    add("--shortest-delay", type=delay, metavar="TIME", help=text)
    text = "list stretches and robots slower than usual by more than PERCENT (default: 5)"
    slow = whole("a percentage", 1, 90)
    add("--slow-stretch", type=slow, metavar="PERCENT", help=text)
    text = (
        "compare fitted and empirical handling times, and a finer tick, in N pairs of runs (default: "
        "20; 0: no runs)"
    )
    add("--pairs", type=pairs, metavar="N", help=text)
    text = (
        "tune at most two numbers, so that throughput and lead time of the days of the logs agree with "
        "the site; then compare needs other days"
    )
    add("--tune", type=keys, default=[], metavar="KEY[,KEY]", help=text)
    text = f"with --tune: make at most RUNS runs (default: {TUNING_BUDGET})"
    whole_runs = whole("a number of runs", 1)
    add("--budget", type=whole_runs, metavar="RUNS", help=text)
    add_workers_argument(parser)
    add_output_arguments(parser, "--report")


def of_logs(args: argparse.Namespace) -> dict[str, object]:
    """The options that only a LOG needs, if they are there."""
    return {
        **{"--floor": args.floor, "--set": args.settings, "--column": args.columns},
        **{"--action": args.actions, "--tune": args.tune, "--budget": args.budget},
        **{"--shortest-delay": args.shortest_delay, "--slow-stretch": args.slow_stretch},
        "--pairs": args.pairs is not None,
    }


def run(args: argparse.Namespace) -> int:
    """Fit, compare, write the settings, print."""
    if not args.logs:
        if args.orders is None:
            raise InputError("calibrate needs a LOG, or --orders FILE")
        refuse_alone(of_logs(args), "a LOG")
        return fit_orders(args)
    if args.floor is None:
        raise InputError("a log needs --floor SCENARIO, whose floor the robots drive on")
    if not args.tune:
        refuse_alone({"--budget": args.budget}, "--tune KEY")
    order_columns(args)
    check_scipy()
    output = output_of(args, "--report")
    check_writable(args.out)
    fitted = fitted_logs(args)
    with atomic_writer(args.out) as file:
        file.write(fitted.text(args).encode())
    note(f"wrote {args.out}; use it with --set @{args.out}")
    output.write(lambda: fitted.document(args), lambda: fitted.record(args))
    return 0


class FittedLogs(NamedTuple):
    """What was fitted to logs."""

    log: Any  # automaton.calibration.state_log.StateLog
    fits: Any  # automaton.calibration.site_fits.SiteFits
    demand: WeeklyDemand | None
    model: FittedModel
    tuning: Tuning | None

    def text(self, args: argparse.Namespace) -> str:
        """The file of settings."""
        from automaton.calibration.fitted_settings import settings_text

        text = settings_text(self.model.settings, self.fits, ", ".join(map(str, args.logs)))
        return text if self.tuning is None else f"# Note: {self.model.remarks[-1]}.\n{text}"

    def document(self, args: argparse.Namespace) -> Any:
        """The report."""
        from automaton.calibration.fit_report import fit_document

        head = args.floor, str(args.out), self.log.counts.sentences()
        out = fit_document(self.fits, self.model.remarks, *head)
        if self.tuning is not None:
            from automaton.calibration.output_tuning import tuning_blocks

            out.add(*tuning_blocks(self.tuning))
        if ARRIVALS in self.fits.estimates and self.demand is not None:
            from automaton.calibration.demand_report import demand_blocks

            out.add(*demand_blocks(self.demand))
        return out

    def record(self, args: argparse.Namespace) -> dict[str, Any]:
        """The report as one object."""
        from automaton.calibration.fit_report import fit_record
        from automaton.calibration.output_tuning import tuning_record

        tuned = None if self.tuning is None else tuning_record(self.tuning)
        head = args.floor, str(args.out), self.log.counts.sentences()
        record = fit_record(self.fits, self.model.settings, self.model.remarks, *head)
        return {**record, "tuned": tuned}


def fitted_logs(args: argparse.Namespace) -> FittedLogs:
    """Read the logs, fit them, and tune. Raises InputError."""
    from automaton.calibration.site_fits import OPERATIONS, Thresholds, fit_site
    from automaton.calibration.state_log import read_log
    from automaton.world.resolve import resolve

    actions = dict(args.actions)
    check_fields(actions, OPERATIONS)
    base = resolve(args.floor, args.settings)
    print_warnings(base)
    if args.tune:
        from automaton.calibration.output_tuning import tuned_numbers

        tuned_numbers(args.tune, written_data(args))  # a wrong key, before all the work
    log = read_log(args.logs, dict(args.columns))
    slow, shortest = args.slow_stretch or SLOW_PERCENT, args.shortest_delay or SHORTEST_DELAY
    thresholds = Thresholds(slow / 100, float(shortest))
    try:
        fits = fit_site(log, base, {**OPERATIONS, **actions}, thresholds)
    except InputError as error:
        raise error.at(str(args.logs[0])) from None
    demand = demand_of_site(args, log, base)
    model = fitted_model(args, fits, demand)
    tuning = tuned_model(args, fits, model) if args.tune else None
    return FittedLogs(log, fits, demand, model, tuning)


def tuned_model(args: argparse.Namespace, fits: Any, model: FittedModel) -> Tuning:
    """Tune numbers of the fitted model by the days of the logs, and put them into it."""
    from automaton.calibration import output_tuning
    from automaton.calibration.fitted_settings import arguments_of
    from automaton.calibration.site_day import ComparedSite, read_days
    from automaton.scenario.document import Document, override
    from automaton.world.resolve import resolve

    own = tuple(arguments_of(model.settings))
    settings = (*args.settings, *own)
    data = override(Document(dict(written_data(args))), own).data
    numbers = output_tuning.tuned_numbers(args.tune, data)
    base = resolve(args.floor, settings)
    columns = dict(args.columns), order_columns(args), args.order_time
    site = ComparedSite(args.floor, settings, None, base, *columns, {})
    days = [day for log in args.logs for day in read_days(site, log, args.orders)]
    done, budget = 0, args.budget or TUNING_BUDGET

    def on_done(more: int) -> None:
        nonlocal done
        done += more
        show_line(f"tuning: {done:,} of at most {budget:,} runs")

    tuning = output_tuning.tune_outputs(site, days, numbers, budget, args.workers, on_done)
    show_line("")
    if args.orders is None:
        tuning.doubts.append(
            "orders are those of the logs, released when a robot takes them, which lengthens lead times "
            "of the model by a few percent; --orders FILE avoids this"
        )
    output_tuning.with_numbers(model.settings, data, tuning.tuned)
    for one in tuning.tuned:
        before = fits.estimates.pop(one.number.key, None)
        present = one.number.amount if before is None else before.present
        if one.ends is not None:
            fits.estimates[one.number.key] = estimate_of(one, one.ends, present, len(days))
    changes = " and ".join(output_tuning.change_words(one) for one in tuning.tuned)
    model.remarks.append(f"outputs were tuned: {changes}; `compare` needs other days")
    return tuning


def estimate_of(
    one: TunedValue, ends: tuple[float, float], present: float | None, days: int
) -> Any:
    """A tuned number among the estimates."""
    from automaton.calibration.site_fits import Estimate, FittedValue

    number = one.number
    value = FittedValue(one.factor, *ends, days).scaled(number.amount)
    observed = count(days, "day")
    return Estimate(number.key, number.unit.strip(), present, value, observed, "tuned by outputs")


def demand_of_site(args: argparse.Namespace, log: Any, base: Resolved) -> WeeklyDemand | None:
    """The demand of the file of orders, else of the orders of the log; None: neither."""
    import numpy as np

    if args.orders is not None:
        named = order_columns(args) or {}
        released = {key: named[key] for key in ("released",) if key in named}
        return fit_demand(read_releases(args.orders, released or None, args.order_time))
    if not log.orders:
        return None
    clock = base.scenario.units.scale.clock
    ahead = 0 if clock is None else 1000 * (clock.offset or 0)
    first = np.full(len(log.orders) + 1, log.samples.time.max())
    np.minimum.at(first, log.samples.order, log.samples.time)
    return fit_demand(releases_at(first[1:] + ahead))


def add_arrivals(
    args: argparse.Namespace,
    fits: Any,
    demand: WeeklyDemand | None,
    data: Mapping[str, Any],
    settings: dict[str, Any],
) -> Iterator[str]:
    """Add the demand to the fits and the settings, or to what cannot be said; yield remarks."""
    from automaton.calibration.demand_report import poisson_verdict, rate_words
    from automaton.calibration.fitted_settings import arguments_of
    from automaton.calibration.site_fits import Estimate, FittedValue
    from automaton.studies.inference.intervals import mean_interval
    from automaton.world.resolve import resolve

    source = "the log" if args.orders is None else str(args.orders)
    if demand is None:
        fits.unsaid.append(f"{ARRIVALS}: the log names no orders; --orders FILE reads them")
        return
    section = arrival_settings(demand, data.get("orders") or {})
    try:
        check_weeks(demand, source)
        with_orders = arguments_of({**settings, "orders": section})
        resolve(args.floor, [*args.settings, *with_orders])
    except InputError as error:
        which = f"{source} " if error.file == source else ""
        fits.unsaid.append(f"{ARRIVALS}: {which}{error.message}")
        if args.orders is not None:
            yield f"`compare --orders {source}` runs days with these orders as they are"
        return
    settings["orders"] = section
    rate = mean_interval(demand.weekly)
    low, high = (rate.value if end is None else end for end in (rate.low, rate.high))
    value = FittedValue(rate.value, low, high, rate.n)
    observed = f"{count(demand.total, 'order')}, {count(demand.days, 'day')}"
    remark = f"mean of all hours of the week; {rate_words(demand)}"
    fits.estimates[ARRIVALS] = Estimate(ARRIVALS, "/h", None, value, observed, remark)
    yield f"orders: would Poisson arrivals do? {poisson_verdict(demand)}"


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


def fitted_model(args: argparse.Namespace, fits: Any, demand: WeeklyDemand | None) -> FittedModel:
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
    remarks = list(add_arrivals(args, fits, demand, data, settings))
    own = [*args.settings, *arguments_of(settings)]
    fitted = resolve(args.floor, own)
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
    if args.pairs != 0:
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
    from automaton.studies.tuning import compare_pairs
    from automaton.world.resolve import resolve

    done = 0

    def difference(first: dict[str, Any], second: dict[str, Any], *more: str) -> tuple[bool, str]:
        """Whether two models differ, and by how much."""
        models = [
            resolve(args.floor, [*args.settings, *arguments_of(values), *own])
            for values, own in ((first, ()), (second, more))
        ]
        changes = compare_pairs(
            models[0], models[1], args.pairs or PAIRS_OF_RUNS, args.workers, on_done
        )
        words = ", ".join(f"{name.replace('_', ' ')} {change}" for name, change in changes.items())
        return any(change.matters for change in changes.values()), words or "nothing to compare"

    def on_done(more: int) -> None:
        nonlocal done
        done += more
        show_line(f"{count(done, 'run')} done")

    fit = fits.operations.get("handling")
    if fit is not None and fit.family != "constant":
        others: dict[str, Any] = {
            name: settings[name] for name in ("units", "orders") if name in settings
        }
        empirical = {**settings_of(fits, data, is_empirical=True), **others}
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
