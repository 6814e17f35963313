"""Show fitted values beside those of the scenario, and what a log cannot say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

from automaton.calibration.site_fits import HOUR, Estimate, SiteFits
from automaton.documents.report_document import Heading, Listed, ReportDocument, Table, Text

HEAD: Final = ("setting", "scenario", "fitted", "95 % interval", "unit", "from")


def fit_document(
    fits: SiteFits, remarks: Sequence[str], scenario: str, out: str, read: Sequence[str]
) -> ReportDocument:
    """The report of a fit; `read`: what was read from the log."""
    document = ReportDocument(f"{scenario}, fitted to a log")
    fitted = len(fits.estimates) + len(fits.slow)
    document.add(
        Text(
            f"Values: {fitted} fitted, {len(fits.unsaid)} not; written to {out}.",
            strong=True,
        ),
        Listed([*read, fits.extent], mark=""),
    )
    rows = [list(row) for row in estimate_rows(fits)]
    if rows:
        document.add(Heading("Fitted"), Table(HEAD, rows, left=1, also_left=(4, 5)))
    if fits.unsaid:
        document.add(Heading("What the log cannot say"), Listed(fits.unsaid))
    if fits.notes:
        document.add(Heading("Robots that differ"), Listed(fits.notes))
    if remarks:
        document.add(Heading("Choices"), Listed(remarks))
    use = f"`automaton run {scenario} --set @{out}` runs the fitted model."
    judge = (
        f"`automaton compare {scenario} --set @{out} LOG` judges it by days that were not fitted."
    )
    document.add(Heading("Use"), Listed([use, judge], mark=""))
    return document


def estimate_rows(fits: SiteFits) -> Iterator[Sequence[str]]:
    """A row for each fitted value."""
    for one in fits.estimates.values():
        present = "" if one.present is None else f"{one.present:.4g}"
        low, high = (f"{end:.4g}" for end in one.fit[1:3])
        unit = one.unit or "factor"
        source = f"{one.observed}, {one.remark}" if one.remark else one.observed
        yield one.key, present, f"{one.fit.value:.4g}", f"{low} to {high}", unit, source
    for start, rate in fits.charging:
        source = f"charging from {start:g} %" if len(fits.charging) > 1 else "charging"
        value, low, high = (f"{one * HOUR:.4g}" for one in rate[:3])
        yield "battery.charge_rate", "", value, f"{low} to {high}", "%/h", source
    for slow in fits.slow:
        where = "({}, {}) to ({}, {})".format(*slow.first, *slow.last)
        low, high = (f"{end:.4g}" for end in slow.speed[1:3])
        source = f"{slow.speed.n:,} pairs, {where}"
        yield "floor.speed_limits", "", f"{slow.speed.value:.4g}", f"{low} to {high}", "m/s", source


def fit_record(
    fits: SiteFits,
    settings: dict[str, Any],
    remarks: Sequence[str],
    scenario: str,
    out: str,
    read: Sequence[str],
) -> dict[str, Any]:
    """The report as a JSON object."""
    return {
        "scenario": scenario,
        "out": out,
        "log": list(read),
        "robots": fits.robots,
        "hours": fits.hours,
        "gap_s": fits.gap_s,
        "estimates": [estimate_record(one) for one in fits.estimates.values()],
        "slow": [
            {
                "from": slow.first,
                "to": slow.last,
                "share": slow.share.value,
                "value": slow.speed.value,
                "low": slow.speed.low,
                "high": slow.speed.high,
                "unit": "m/s",
            }
            for slow in fits.slow
        ],
        "charging": [
            {
                "from": start,
                "value": HOUR * rate.value,
                "low": HOUR * rate.low,
                "high": HOUR * rate.high if math.isfinite(rate.high) else None,
            }
            for start, rate in fits.charging
        ],
        "not_fitted": fits.unsaid,
        "robots_that_differ": fits.notes,
        "choices": list(remarks),
        "settings": settings,
    }


def estimate_record(one: Estimate) -> dict[str, Any]:
    """An estimate as a JSON object."""
    return {
        "key": one.key,
        "unit": one.unit,
        "scenario": one.present,
        "value": one.fit.value,
        "low": one.fit.low,
        "high": one.fit.high,
        "observations": one.fit.n,
        "remark": one.remark,
    }
