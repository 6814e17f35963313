"""Show fitted demand beside the data, and how to use it in a scenario."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import yaml

from automaton.calibration.demand import (
    DAYS_OF_WEEK,
    SIZE_SHARES,
    Dispersion,
    WeeklyDemand,
    quantiles_of,
    size_quantiles,
)
from automaton.documents.report_document import (
    Block,
    Curves,
    Heading,
    Listed,
    Panels,
    ReportCurve,
    ReportDocument,
    Table,
    Text,
)
from automaton.scenario.arrivals import HOURS_OF_DAY
from automaton.units import count, percent

WEEKDAY_NAMES: Final = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
LINE_WIDTH: Final = 78


def demand_document(demand: WeeklyDemand, source: str, week: str) -> ReportDocument:
    """The fitted demand of a file; `week`: the file of rates that is written."""
    document = ReportDocument(f"Demand of {source}")
    document.add(Heading(document.title, 1), *demand_blocks(demand), *usage(demand, week))
    return document


def demand_blocks(demand: WeeklyDemand) -> list[Block]:
    """The fitted demand beside the data."""
    days = f"{count(demand.days, 'day')} from {demand.first:%Y-%m-%d}"
    return [
        Text(
            f"{count(demand.total, 'order')} on {days}; "
            f"{demand.rates.min():,.4g} to {demand.rates.max():,.4g} orders an hour of the week; "
            f"{rate_words(demand)}.",
            strong=True,
        ),
        Heading("Would Poisson arrivals do?"),
        Text(poisson_verdict(demand)),
        Listed(list(poisson_evidence(demand))),
        Heading("Days"),
        day_table(demand),
        Heading("Orders an hour"),
        rate_table(demand),
        rate_chart(demand),
        Heading("Orders that arrive at once"),
        size_table(demand),
    ]


def poisson_verdict(demand: WeeklyDemand) -> str:
    """Whether Poisson arrivals at the rates of the week would do, and what the profile can represent."""
    is_poisson = demand.orders.is_poisson
    if is_poisson is None:
        return "Cannot be said: too few orders an hour, or too few weeks."
    if is_poisson:
        return "Yes: at the rates of the week, orders arrive like a Poisson process."
    if demand.orders.value < 1:
        return "No: orders arrive more regularly than a Poisson process."
    verdict = "No: orders arrive more irregularly than a Poisson process."
    if demand.batch != 1:
        verdict += " Batches reproduce the orders that arrive at once."
    if demand.batches.is_poisson is False and demand.batches.value > 1:
        verdict += (
            " Weeks differ more than a profile can express, so totals of an hour vary less in runs "
            "than in the data; to judge busy days, read several days of orders instead (transports: "
            "{file: days/*.csv})."
        )
    return verdict


def poisson_evidence(demand: WeeklyDemand) -> Iterator[str]:
    """The numbers behind the verdict."""
    yield (
        f"orders in an hour of the week: variance / mean {_dispersion(demand.orders)}; "
        f"{demand.fitted_dispersion:,.1f} with the fitted batches, 1 for Poisson"
    )
    if demand.batch != 1:
        yield f"batches in an hour of the week: variance / mean {_dispersion(demand.batches)}"
    yield (
        f"times between orders: {percent(demand.zero_gaps)} are 0, standard deviation / mean "
        f"{demand.gap_variation:,.1f} (1 for Poisson at a constant rate; pauses and rates that change "
        "raise it)"
    )


def rate_words(demand: WeeklyDemand) -> str:
    """The rate of the busiest hour, and the mean over the hours with orders."""
    busiest = int(np.argmax(demand.rates))
    day, hour = divmod(busiest, HOURS_OF_DAY)
    mean = demand.rates[demand.rates > 0].mean()
    return (
        f"{demand.rates[busiest]:,.4g} on {WEEKDAY_NAMES[day]} at {hour}:00, "
        f"mean of the hours with orders {mean:,.4g}"
    )


def _dispersion(one: Dispersion) -> str:
    if not one.degrees:
        return "not known"
    p = "p < 0.001" if one.p < 0.001 else f"p = {one.p:.3f}"
    return f"{one.value:,.1f} ({p})"


def day_table(demand: WeeklyDemand) -> Table:
    """Orders of each weekday: fitted, and the days of the data that are complete."""
    totals = demand.weeks.reshape(-1, DAYS_OF_WEEK, HOURS_OF_DAY).sum(axis=2)
    fitted = demand.rates.reshape(DAYS_OF_WEEK, HOURS_OF_DAY).sum(axis=1)
    rows = []
    for name, one, own in zip(WEEKDAY_NAMES, fitted.tolist(), totals.T, strict=True):
        own = own[np.isfinite(own)]
        ends = (
            [f"{own.mean():,.1f}", f"{own.min():,.0f}", f"{own.max():,.0f}"] if len(own) else "---"
        )
        rows.append([name, f"{one:,.1f}", str(len(own)), *ends])
    return Table(["weekday", "fitted", "complete days", "data mean", "least", "most"], rows)


def rate_table(demand: WeeklyDemand) -> Table:
    """The fitted rates: a row for each hour, a column for each weekday."""
    rates = demand.rates.reshape(DAYS_OF_WEEK, HOURS_OF_DAY).T.tolist()
    rows = [
        [f"{hour:02}:00", *(f"{rate:,.4g}" for rate in of_hour)]
        for hour, of_hour in enumerate(rates)
        if any(of_hour)
    ]
    return Table(["hour", *WEEKDAY_NAMES], rows)


def rate_chart(demand: WeeklyDemand) -> Panels:
    """For each weekday the rates, with the least and the most orders of the data in each hour."""
    rows = np.concatenate([demand.weeks, demand.rates[None]])
    ends = demand.rates, np.nanmin(rows, axis=0), np.nanmax(rows, axis=0)
    label = "fitted; least and most in the data"
    charts = []
    for day, name in enumerate(WEEKDAY_NAMES):
        hours = slice(day * HOURS_OF_DAY, (day + 1) * HOURS_OF_DAY)
        line = ReportCurve(label, range(HOURS_OF_DAY), *(one[hours].tolist() for one in ends))
        charts.append(Curves(name, "hour", "orders an hour", [line], from_zero=True))
    return Panels("Fitted rates, with the least and the most orders of the data", charts)


def size_table(demand: WeeklyDemand) -> Table:
    """Sizes of batches in the data, and as fitted."""
    fitted, data = quantiles_of(demand.batch), size_quantiles(demand.sizes)
    heads = ["", "mean", *(percent(share, 0) for share in SIZE_SHARES)]
    return Table(
        heads,
        [
            ["data", f"{demand.sizes.mean():,.2f}", *(f"{one:,}" for one in data)],
            ["fitted", f"{demand.orders_of_batch:,.2f}", *(f"{one:,}" for one in fitted)],
        ],
        groups=(("this share has at most", len(SIZE_SHARES)),),
    )


def usage(demand: WeeklyDemand, week: str) -> Sequence[Block]:
    """How a scenario uses the rates and the sizes."""
    batch = yaml.safe_dump(demand.batch, default_flow_style=True, width=math.inf)
    text = f"batch: {batch.strip().removesuffix('...').strip()}"
    lines = textwrap.wrap(text, LINE_WIDTH, initial_indent="    ", subsequent_indent="      ")
    return [
        Heading("In the scenario"),
        Text("\n".join(["orders:", "  arrivals:", f"    profile: {week}", *lines]), code=True),
    ]


def demand_record(demand: WeeklyDemand, source: str, week: str) -> dict[str, Any]:
    """The fitted demand as one object."""

    def numbers(one: Dispersion) -> dict[str, Any]:
        known = {"dispersion": one.value, "p": one.p} if one.degrees else {}
        return {"dispersion": None, "p": None} | known | {"poisson": one.is_poisson}

    return {
        "orders_file": source,
        "out": week,
        "orders": demand.total,
        "days": demand.days,
        "arrivals": {"profile": week, "batch": demand.batch},
        "rates": [round(rate, 4) for rate in demand.rates.tolist()],
        "arrivals_of_orders": numbers(demand.orders),
        "arrivals_of_batches": numbers(demand.batches),
        "zero_gaps": demand.zero_gaps,
        "gap_variation": demand.gap_variation,
        "batch_sizes": {
            "shares": list(SIZE_SHARES),
            "data": size_quantiles(demand.sizes),
            "fitted": quantiles_of(demand.batch),
        },
    }
