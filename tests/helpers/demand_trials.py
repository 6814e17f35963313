"""Check the fit of demand on orders of real warehouses, WEPAStacks and CrossStacks: run by hand.

    python tests/helpers/demand_trials.py wepastacks [WHEEL]

Nine weeks are fitted, three weeks are predicted. The orders are in the wheel of slapstack 0.1.1 (MIT),
which is downloaded without its dependencies unless WHEEL names it. CrossStacks covers 15
days, too few for rates by hour of the week, so only its arrivals and batches are tested.
"""

from __future__ import annotations

import datetime
import json
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from automaton.calibration.demand import (
    Releases,
    WeeklyDemand,
    check_weeks,
    fit_demand,
    quantiles_of,
    size_quantiles,
)
from automaton.errors import InputError

WHEEL = "slapstack==0.1.1"
EPOCH = datetime.datetime(2024, 1, 1)  # the files count seconds, without a date
WEEK_S = 7 * 86_400
FITTED, PREDICTED = 9, 3  # weeks
P95 = 3  # in SIZE_SHARES


def seconds_of(wheel: Path, name: str) -> np.ndarray:
    """(n,) seconds of the orders of a warehouse, ascending."""
    with zipfile.ZipFile(wheel) as archive:
        orders = json.loads(archive.read(f"slapstack/use_cases/{name}/2_orders.json"))
    return np.sort([int(order[2]) for order in orders])


def releases(seconds: np.ndarray) -> Releases:
    """Seconds as the releases of a file."""
    first = EPOCH + datetime.timedelta(seconds=int(seconds[0]))
    return Releases(first, seconds - seconds[0])


def downloaded(folder: Path) -> Path:
    """The wheel, from the package index."""
    command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", str(folder), WHEEL]
    subprocess.run(command, check=True)
    return next(folder.glob("*.whl"))


def report(name: str, demand: WeeklyDemand) -> None:
    """Print what is fitted."""
    orders, batches = demand.orders, demand.batches
    print(
        f"{name}: {demand.total:,} orders, {demand.days} days; variance / mean "
        f"{orders.value:.1f} (orders, p = {orders.p:.1g}), {batches.value:.1f} (batches); "
        f"{100 * demand.zero_gaps:.0f} % of gaps are 0, cv {demand.gap_variation:.0f}"
    )
    assert orders.is_poisson is False


def wepastacks(wheel: Path) -> None:
    """Fit nine weeks and predict three; fit the batches of the other warehouse."""
    seconds = seconds_of(wheel, "wepastacks")
    begin = int(seconds[0]) // 86_400 * 86_400  # the first midnight
    week = (seconds - begin) // WEEK_S
    fitted = fit_demand(releases(seconds[week < FITTED]))
    held_out = seconds[(week >= FITTED) & (week < FITTED + PREDICTED)]
    report("WEPAStacks, 9 weeks", fitted)
    hours = np.bincount((held_out - begin - FITTED * WEEK_S) // 3600, minlength=PREDICTED * 168)
    trained = np.bincount((seconds[week < FITTED] - begin) // 3600, minlength=FITTED * 168)
    of_week = (begin // 3600 + np.arange(len(hours))) % 168
    error = np.abs(hours - fitted.rates[of_week]).mean()
    plain = np.abs(hours.reshape(-1, 168) - trained.reshape(-1, 168).mean(axis=0)).mean()
    print(
        f"hourly error {error:.1f} orders, {error / plain:.3f} times that of the hour-of-week mean"
    )
    sizes = np.unique(held_out, return_counts=True)[1]
    ours, real = quantiles_of(fitted.batch)[P95], size_quantiles(sizes)[P95]
    print(
        f"batches: p95 {ours} fitted, {real} in the other weeks; mean {fitted.orders_of_batch:.2f}, "
        f"{sizes.mean():.2f}"
    )
    assert error <= 1.1 * plain and abs(ours - real) <= 1
    other = fit_demand(releases(seconds_of(wheel, "crossstacks")))
    report("CrossStacks", other)
    print(
        f"batches: p95 {quantiles_of(other.batch)[P95]} fitted, "
        f"{size_quantiles(other.sizes)[P95]} in the data; {other.batch}"
    )
    assert abs(quantiles_of(other.batch)[P95] - size_quantiles(other.sizes)[P95]) <= 1
    try:
        check_weeks(other, "CrossStacks")
    except InputError as error_of_weeks:
        print(error_of_weeks)
    else:
        raise AssertionError("15 days must be too few")


if __name__ == "__main__":
    name, *wheel = sys.argv[1:]
    assert name == "wepastacks", "the trial is called wepastacks"
    with tempfile.TemporaryDirectory() as folder:
        wepastacks(Path(wheel[0]) if wheel else downloaded(Path(folder)))
