"""The demand of a file of orders: rates of the week, batches, and whether Poisson arrivals would do."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest

from automaton.calibration.demand import (
    Releases,
    check_weeks,
    fit_demand,
    quantiles_of,
    read_releases,
    week_csv,
)
from automaton.calibration.demand_report import demand_document, demand_record, poisson_verdict
from automaton.documents.text_output import as_text
from automaton.errors import InputError
from automaton.world.resolve import resolve

MONDAY = datetime.datetime(2026, 3, 2)
WEEKS = 6
HOUR_S = 3600
SCENARIO = """\
name: fitted
layout: {picture: "t..t"}
fleet: {robots: 1, kinematics: omni, start: [[1, 0]]}
units: {tick: 1 s, clock: "2026-03-02 06:00"}
orders: {generator: stations, arrivals: {profile: week.csv, batch: BATCH}}
strategy: {allocation: first-come, routing: shortest, right_of_way: retreat}
stop: {when: delivered, max_duration: 1 h}
"""


def rates_of_week() -> np.ndarray:
    """Orders an hour: 12 by day, 2 in the evening, none at night, twice as many on Fridays."""
    day = np.array([0] * 6 + [12] * 10 + [2] * 6 + [0] * 2, float)
    return np.concatenate([day, day, day, day, 2 * day, np.zeros(48)])


def arrivals(seed: int, unit: int = 1, mean_batch: float = 1, rush: float = 0) -> Releases:
    """Batches of WEEKS weeks at the rates of the week; `rush`: how much weeks differ."""
    draw = np.random.default_rng(seed)
    factor = np.repeat(draw.uniform(1 - rush, 1 + rush, WEEKS * 7), 24)
    batches = draw.poisson(np.tile(rates_of_week(), WEEKS) * factor / mean_batch)
    times = np.repeat(np.arange(len(batches)) * HOUR_S, batches)
    times = (times + draw.integers(0, HOUR_S, len(times))) // unit * unit
    sizes = draw.geometric(1 / mean_batch, len(times))
    seconds = np.sort(np.repeat(times, sizes))
    return Releases(MONDAY + datetime.timedelta(seconds=int(seconds[0])), seconds - seconds[0])


def test_single_orders_at_varying_rates_are_poisson_even_if_times_are_rounded_to_minutes() -> None:
    for unit in (1, 60):
        demand = fit_demand(arrivals(1, unit))
        assert demand.orders.is_poisson and demand.batch == 1
        assert poisson_verdict(demand).startswith("Yes")
        assert np.abs(demand.rates - rates_of_week()).max() < 6  # 4 standard errors of a mean of 24


def test_batches_are_recovered_and_explain_why_arrivals_are_not_poisson() -> None:
    demand = fit_demand(arrivals(2, mean_batch=3))
    assert demand.orders.is_poisson is False and demand.batches.is_poisson
    assert isinstance(demand.batch, dict) and demand.batch["exponential"] == pytest.approx(
        3, rel=0.1
    )
    assert demand.orders.value == pytest.approx(demand.fitted_dispersion, rel=0.15)
    verdict = poisson_verdict(demand)
    assert "Batches reproduce" in verdict and "Weeks differ" not in verdict


def test_rare_large_batches_are_kept_in_an_empirical_distribution() -> None:
    releases = arrivals(3)
    large = np.repeat(releases.seconds[::50], 40)
    demand = fit_demand(releases._replace(seconds=np.sort([*releases.seconds, *large])))
    assert isinstance(demand.batch, dict) and "empirical" in demand.batch
    assert quantiles_of(demand.batch)[-1] == 41 and quantiles_of(demand.batch)[0] == 1
    assert demand.orders_of_batch == pytest.approx(demand.sizes.mean(), rel=0.02)


def test_days_that_differ_are_named_as_what_a_profile_cannot_express() -> None:
    demand = fit_demand(arrivals(4, rush=0.9))
    assert demand.orders.is_poisson is False and demand.batch == 1
    assert "Weeks differ more than a profile can express" in poisson_verdict(demand)


def test_the_written_rates_run_as_a_profile(tmp_path: Path) -> None:
    demand = fit_demand(arrivals(5, mean_batch=2))
    (tmp_path / "week.csv").write_text(week_csv(demand.rates), encoding="utf-8")
    batch = str(demand.batch).replace("'", "")
    (tmp_path / "fitted.yaml").write_text(SCENARIO.replace("BATCH", batch), encoding="utf-8")
    arrivals_of_run = resolve(tmp_path / "fitted.yaml").scenario.orders.arrivals
    assert arrivals_of_run is not None
    assert np.allclose(arrivals_of_run.rates, demand.rates, atol=1e-4)
    page = as_text(demand_document(demand, "orders.csv", "week.csv"))
    assert f"batch: {batch}" in page and "Sat " in page
    assert demand_record(demand, "orders.csv", "week.csv")["arrivals"]["batch"] == demand.batch


def test_hours_are_those_of_the_site_and_need_dates(tmp_path: Path) -> None:
    path = tmp_path / "orders.csv"
    winter = "2026-03-28T08:00:00+01:00\n2026-03-28T08:40:00+01:00\n"
    summer = "2026-03-29T08:10:00+02:00\n"  # daylight saving has begun
    path.write_text(f"CREATED\n{summer}{winter}", encoding="utf-8")
    releases = read_releases(path, {"released": "CREATED"})
    assert releases.first == datetime.datetime(2026, 3, 28, 8)
    assert releases.seconds.tolist() == [0, 2400, 24 * 3600 + 600], "hours by the clock of the site"
    with pytest.raises(InputError, match=r"orders.csv: covers 2 days; .* at least 4 weeks"):
        check_weeks(fit_demand(releases), "orders.csv")
    for text in ("released\n06:30\n07:00\n", "released\n240\n360\n"):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match="released needs a date in each row"):
            read_releases(path)
