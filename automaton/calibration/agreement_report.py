"""Show how well a model matches a site: the verdict, its quantities, days, hours and stretches."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from automaton.calibration.agreement import (
    DECISIVE,
    DIFFERS,
    ERROR,
    MATCHES,
    Agreement,
    DayResult,
    QuantityDifference,
)
from automaton.calibration.compared_days import Compared
from automaton.calibration.fleet_trace import (
    EMPTY_SHARE,
    HEADWAY,
    HOURLY,
    ORDER_SHARE,
    ORDERS_AN_HOUR,
    STRETCH,
)
from automaton.documents.report_document import (
    Curves,
    Heading,
    HeatMap,
    Listed,
    ReportCurve,
    ReportDocument,
    Table,
    Text,
)
from automaton.units import count, percent

EPOCH: Final = datetime.datetime(1970, 1, 1)
MAX_STRETCHES: Final = 8
SHARE_QUANTITIES: Final = (ORDER_SHARE, EMPTY_SHARE)


def agreement_document(name: str, compared: Compared, notes: Sequence[str]) -> ReportDocument:
    """The comparison as a document."""
    result, days = compared.agreement, compared.days
    title = f"{name}: does the model match the site?"
    document = ReportDocument(title)
    runs = count(len(days[0].runs), "run")
    document.add(
        Heading(title, 1),
        Heading("Verdict"),
        Text(verdict_sentence(compared), strong=True),
        Listed(list(reasons(compared))),
        Heading("Site and model"),
        quantity_table(compared),
        Listed(reading_lines(len(days)), mark=""),
        Heading("Days"),
        day_table(compared),
        *hour_chart(compared),
    )
    if result.stretches:
        document.add(Heading("Where robots spend more or less time"), stretch_table(compared))
        document.add(*seconds_maps(compared))
    document.add(
        Heading("How it was compared"),
        Text(
            f"Each day was simulated in {runs} with its own orders. Site and runs were measured in the "
            "same way, from the cell, order and load of each robot at equal times."
        ),
        Listed(notes),
    )
    return document


def verdict_sentence(compared: Compared) -> str:
    """The verdict in a sentence."""
    result = compared.agreement
    if result.verdict == MATCHES:
        within = ", ".join(
            f"{one.quantity} within {percent(one.tolerance or 0, 0)}" for one in judged(result)
        )
        return f"The model matches the site: {within}."
    if result.verdict == DIFFERS:
        return f"The model differs from the site{first_text(compared)}."
    open_ones = [one for one in judged(result) if one.verdict != MATCHES]
    why = "; ".join(dict.fromkeys(missing(one, len(compared.days)) for one in open_ones))
    return f"Cannot be said whether the model matches the site: {why}."


def missing(one: QuantityDifference, days: int) -> str:
    """What is missing to show that a quantity matches."""
    within = percent(one.tolerance or 0, 0)
    if one.days_needed is None:
        return (
            "one day has no spread; a match within 5 % needs about 4, 11 or 44 days that differ by 3, 5 "
            "or 10 % (power 90 %)"
        )
    needs = f"needs about {count(max(one.days_needed, days + 1), 'day')} like these {days:,}"
    if one.tolerance is None or abs(one.relative) < one.tolerance:
        return f"to show that {one.quantity} is within {within} {needs} (power 90 %)"
    assert one.interval is not None and one.interval.low is not None, "several days"
    ends = f"{100 * one.interval.low:+.1f} to {100 * (one.interval.high or 0):+.1f} %"
    return (
        f"{one.quantity} of the site is {100 * one.relative:+.1f} % beside the model ({ends}), beyond "
        f"{within}, but so few days may differ by chance; to show it {needs}"
    )


def judged(result: Agreement) -> list[QuantityDifference]:
    """The differences that decide whether a model matches."""
    return [one for one in result.differences if one.quantity in DECISIVE]


def first_text(compared: Compared) -> str:
    """Where a model first differs: ", first on monday at 10:00"; "" if no day is outside its band."""
    first = compared.agreement.first
    if first is None:
        return ""
    number, quantity = first
    day = compared.days[number]
    at = "at" if quantity.startswith(HOURLY) else "in"
    return f", first on {day.name} {at} {outside_name(compared, day, quantity)}"


def outside_name(compared: Compared, day: DayResult, quantity: str) -> str:
    """The name of what is outside a band: the time at which an hour begins, or a quantity."""
    if quantity.startswith(HOURLY):
        return hour_name(day, int(quantity.removeprefix(HOURLY)))
    return plain_name(compared, quantity)


def reasons(compared: Compared) -> Iterator[str]:
    """What differs, what is within its tolerance, and what the days are too few for."""
    result, days = compared.agreement, compared.days
    outside = sum(band.p <= ERROR for band in result.bands)
    if result.p_days <= ERROR:
        of_days = f"{outside:,} of {count(len(days), 'day')}"
        yield f"{of_days} outside the band of the runs ({_p(result.p_days)})"
    yield from (
        f"{plain_name(compared, one.quantity)} differs by {100 * one.relative:+.1f} % ({_p(one.p)})"
        for one in result.differences
        if one.p <= ERROR
    )
    if result.stretches and result.stretches[0].p <= ERROR:
        one = result.stretches[0]
        yield (
            f"robots spend {one.real - one.simulated:+,.0f} s a day on {place_of(compared, one.stretch)} "
            f"({_p(one.p)})"
        )
    if result.verdict != MATCHES:
        yield from (
            f"{one.quantity} matches within {percent(one.tolerance or 0, 0)}"
            for one in judged(result)
            if one.verdict == MATCHES
        )
    if result.verdict == DIFFERS:
        open_ones = (one for one in judged(result) if one.verdict != MATCHES and one.p > ERROR)
        why = dict.fromkeys(missing(one, len(days)) for one in open_ones)
        yield from (f"not shown to match: {one}" for one in why)


def _p(p: float) -> str:
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def quantity_table(compared: Compared) -> Table:
    """Each quantity of the site and of the model."""
    heads = ["", "site", "model", "diff.", "90 % low", "high", "p", "verdict"]
    rows = []
    for one in compared.agreement.differences:
        ends = [
            "-" if end is None else f"{100 * end:+.1f} %"
            for end in (one.interval[:3] if one.interval else (None, None, None))
        ]
        name = plain_name(compared, one.quantity)
        numbers = [shown(one.quantity, value) for value in (one.real, one.simulated)]
        p = f"{one.p:.3f}" if len(compared.days) > 1 else "-"
        rows.append([name, *numbers, *ends, p, verdict_word(one)])
    return Table(heads, rows, also_left=(len(heads) - 1,))


def verdict_word(one: QuantityDifference) -> str:
    """The verdict on a quantity in a table."""
    if one.verdict == DIFFERS:
        return DIFFERS
    if one.tolerance is None:
        return "-"
    within = f"± {percent(one.tolerance, 0)}"
    return f"{MATCHES} {within}" if one.verdict == MATCHES else f"open {within}"


def reading_lines(days: int) -> list[str]:
    """How to read the table of quantities."""
    lines = [
        "Times are in seconds. diff.: mean of (site / model - 1) over the days. p: adjusted for all "
        "tests of the page; at most 0.05 is a difference. matches: the 90 % interval lies within the "
        "tolerance (two one-sided tests at 5 %); open: it does not."
    ]
    return lines if days > 1 else [*lines, "With one day, only its band is tested."]


def plain_name(compared: Compared, quantity: str) -> str:
    """The name of a quantity, with its place."""
    if quantity.startswith(HEADWAY):
        x, y = compared.floor_plan.xy(compared.busiest[int(quantity.removeprefix(HEADWAY))])
        return f"headway at [{x}, {y}]"
    return quantity


def shown(quantity: str, value: float) -> str:
    """A value of a quantity."""
    if math.isnan(value):
        return "-"
    return percent(value) if quantity in SHARE_QUANTITIES else f"{value:,.1f}"


def day_table(compared: Compared) -> Table:
    """Each day: orders an hour, p of its band, and what is first outside."""
    rows = []
    for day, band in zip(compared.days, compared.agreement.bands, strict=True):
        first = ""
        if band.p <= ERROR and band.outside:
            first = outside_name(compared, day, band.outside[0])
        numbers = [
            shown(ORDERS_AN_HOUR, one)
            for one in (day.real[ORDERS_AN_HOUR], day.mean(ORDERS_AN_HOUR))
        ]
        rows.append([day.name, *numbers, f"{band.p:.3f}", first])
    heads = ["day", "orders an hour", "model", "p", "first outside the band"]
    return Table(heads, rows, also_left=(4,))


def hour_name(day: DayResult, number: int) -> str:
    """The clock time at which an hour of a day begins."""
    return f"{EPOCH + datetime.timedelta(milliseconds=day.begin, hours=number):%H:%M}"


def hour_chart(compared: Compared) -> Iterator[Curves]:
    """Orders by hour of the first day outside its band, else of the first day, if it has several."""
    first = compared.agreement.first
    number = 0 if first is None else first[0]
    day, band = compared.days[number], compared.agreement.bands[number]
    x, (real, mean, low, high) = range(len(band.hours)), band.hours.T.tolist()
    lines = [ReportCurve("site", x, real, real, real), ReportCurve("model", x, mean, low, high)]
    title = f"Orders by hour on {day.name}, and the 95 % band of the runs for all hours at once"
    if len(x) > 1:
        names = [hour_name(day, hour) for hour in x]
        yield Curves(title, "hour", "orders", lines, names, from_zero=True, is_in_order=True)


def stretch_table(compared: Compared) -> Table:
    """The stretches with the least likely differences."""
    rows = [
        [
            place_of(compared, one.stretch),
            f"{one.real:,.0f}",
            f"{one.simulated:,.0f}",
            f"{one.real - one.simulated:+,.0f}",
            f"{one.p:.3f}" if len(compared.days) > 1 else "-",
        ]
        for one in compared.agreement.stretches[:MAX_STRETCHES]
    ]
    return Table(["stretch", "robot seconds a day: site", "model", "difference", "p"], rows)


def place_of(compared: Compared, stretch: int) -> str:
    """The cells of a stretch: "[3, 1] to [3, 8]"."""
    cells = np.flatnonzero(compared.stretch_of == stretch)
    ends = [list(compared.floor_plan.xy(cell)) for cell in (cells[0], cells[-1])]
    return f"{ends[0]} to {ends[1]}" if len(cells) > 1 else f"{ends[0]}"


def seconds_maps(compared: Compared) -> Iterator[HeatMap]:
    """Where robots spend more time at the site than in the model, and where less, cell by cell."""
    floor_plan, stretch_of = compared.floor_plan, compared.stretch_of
    sizes = np.bincount(stretch_of[stretch_of >= 0])
    apart = np.where(floor_plan.drivable.ravel(), 0.0, math.nan)
    for one in compared.agreement.stretches:
        apart[stretch_of == one.stretch] = (one.real - one.simulated) / sizes[one.stretch]
    for word, sign in (("more", 1), ("less", -1)):
        field = np.maximum(sign * apart, 0).reshape(floor_plan.kind.shape)[1:-1, 1:-1]
        title = f"Where robots spend {word} time at the site than in the model"
        if np.nanmax(field) > 0:
            yield HeatMap(title, "seconds a day", field, "Mean over the cells of a stretch")


def agreement_record(name: str, compared: Compared, notes: Sequence[str]) -> dict[str, Any]:
    """The comparison as one object."""
    result = compared.agreement

    quantities = [name for name in compared.days[0].real if not name.startswith((STRETCH, HOURLY))]

    def number(value: float | None) -> float | None:
        return None if value is None or math.isnan(value) else value

    return {
        "scenario": name,
        "verdict": result.verdict,
        "reasons": list(reasons(compared)),
        "first": first_text(compared).removeprefix(", first ") or None,
        "runs": len(compared.days[0].runs),
        "sentence": verdict_sentence(compared),
        "days": [
            {
                "name": day.name,
                "begin": f"{EPOCH + datetime.timedelta(milliseconds=day.begin)}",
                "p": band.p,
                "outside": [outside_name(compared, day, one) for one in band.outside],
                "site": {name: number(day.real[name]) for name in quantities},
                "model": {name: number(day.mean(name)) for name in quantities},
                "hours": [
                    dict(zip(("site", "model", "low", "high"), hour, strict=True))
                    for hour in band.hours.tolist()
                ],
            }
            for day, band in zip(compared.days, result.bands, strict=True)
        ],
        "quantities": [
            {
                "quantity": plain_name(compared, one.quantity),
                "site": number(one.real),
                "model": number(one.simulated),
                "difference": number(one.relative),
                "low": None if one.interval is None else one.interval.low,
                "high": None if one.interval is None else one.interval.high,
                "tolerance": one.tolerance,
                "p": one.p,
                "verdict": one.verdict,
                "days_needed": one.days_needed,
            }
            for one in result.differences
        ],
        "stretches": [
            {
                "place": place_of(compared, one.stretch),
                "site": one.real,
                "model": one.simulated,
                "p": one.p,
            }
            for one in result.stretches
        ],
        "remarks": list(notes),
    }
