"""Check the verdicts of `compare` on days that are simulated, too: run by hand.

    python tests/helpers/comparison_trials.py truth [DAYS]      the model is right
    python tests/helpers/comparison_trials.py planted [SERIES]  one thing is wrong in the model
    python tests/helpers/comparison_trials.py tuned [SERIES]    picks are tuned to logs of four days

A day has random orders for one hour, in `planted` two. Site and model run with them; the site has seeds
that the model has not. Traces are taken from the runs: tests/calibration shows that those of logs equal
them. `planted` gives each fault SERIES of ten days. `tuned` fits a model whose picks are too short.
"""

from __future__ import annotations

import datetime
import re
import sys
import tempfile
import time
from collections import Counter
from fractions import Fraction
from pathlib import Path

import numpy as np

from automaton.calibration.agreement import DIFFERS, ERROR, DayResult, agreement
from automaton.calibration.compared_days import stretches_of
from automaton.calibration.fleet_trace import MeasurePlan, measured_run
from automaton.calibration.output_tuning import tune_outputs, tuned_numbers
from automaton.calibration.site_day import ComparedSite, SiteDay, read_days
from automaton.exports.vda5050_export import write_trace
from automaton.recording.recorder import Recorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.headless import run_once
from automaton.runs.simulation import Simulation
from automaton.scenario.document import Override
from automaton.world.resolve import resolve
from automaton.world.resolved import Resolved

SAMPLE_TICKS, RUNS, DAYS = 10, 50, 10
TUNED_DAYS = 4
TICKS = {"truth": 3600, "planted": 7200, "tuned": 3600}  # of 1 s
AISLE = [[3, y] for y in (2, 3, 4, 5)]
SITE = """\
name: trial
layout:
  legend: {z: {kind: charger, opens: [south]}}
  picture: |
    ####z####z####
    t............t
    .##.##.##.##..
    .##.##.##.##..
    .##.##.##.##..
    .##.##.##.##..
    t............t
    .##.##.##.##..
    .##.##.##.##..
    .##.##.##.##..
    t............t
fleet:
  kinematics: omni
  robots: 10
  start: [[1, 1], [2, 1], [3, 1], [5, 1], [6, 1], [7, 1], [8, 1], [10, 1], [11, 1], [12, 1]]
  types: [{name: usual, robots: 9}, {name: one, robots: 1}]
units: {tick: 1 s, cell: 1 m}
durations: {move: 1, pick: 20, drop: 15, handling_jitter: 10}
battery: {drain: {move: 0.08, wait: 0.01}, charge_rate: 0.5, initial_charge: 70, reserve: 25}
orders: {generator: stations, count: 1}
strategy: {allocation: greedy, charging: threshold, routing: astar, right_of_way: retreat}
stop: {when: never, max_duration: 7200}
"""
PLANTED = {
    "picks + 10 %": {"durations.pick": 22},
    "one robot in ten slow": {"fleet.types.1.durations": {"move": 2}},
    "an aisle closed an hour": {
        "floor.closed": [{"cells": AISLE, "from": 1800, "for": 3600, "known": True}]
    },
    "a dead charger": {"floor.open_chargers": 1},
}


def orders_of_day(day: int, ticks: int) -> list[dict[str, object]]:
    """Random orders from station to station."""
    draw = np.random.default_rng(day)
    stations = [[0, 1], [13, 1], [0, 6], [13, 6], [0, 10], [13, 10]]
    releases = np.cumsum(draw.exponential(30, 2 * ticks // 30))
    pairs = [draw.choice(len(stations), 2, replace=False) for _ in releases]
    return [
        {"from": stations[a], "to": stations[b], "release": int(at)}
        for at, (a, b) in zip(releases, pairs, strict=True)
        if at < ticks
    ]


def with_orders(path: Path, ticks: int, day: int, settings: dict[str, object]) -> Resolved:
    """The site with the orders of a day and other settings."""
    changes = {
        "orders": {"list": orders_of_day(day, ticks)},
        "stop.max_duration": ticks,
        **settings,
    }
    overrides = [
        Override(key, tuple(_key(part) for part in key.split(".")), value)
        for key, value in changes.items()
    ]
    return resolve(str(path), overrides)


def _key(part: str) -> str | int:
    return int(part) if part.isdecimal() else part


def plan_of(resolved: Resolved, released: np.ndarray) -> MeasurePlan:
    """How traces of the site are measured."""
    stretch_of = stretches_of(resolved.floor_plan)
    cells = tuple(
        resolved.floor_plan.cell(x, y) for x, y in ((3, 1), (3, 6), (9, 6), (6, 1), (6, 6))
    )
    rows = resolved.scenario.stop.max_duration // SAMPLE_TICKS + 1
    period = float(SAMPLE_TICKS)
    return MeasurePlan(
        SAMPLE_TICKS, rows, period, stretch_of, int(stretch_of.max()) + 1, cells, False, released
    )


class Days:
    """Days of the trial, each with the runs of the model."""

    def __init__(self, path: Path, ticks: int) -> None:
        self.path, self.ticks = path, ticks

    def measured(self, day: int, seed: int, settings: dict[str, object]) -> dict[str, float]:
        """A run of a day."""
        resolved = with_orders(self.path, self.ticks, day, settings)
        orders = resolved.scenario.orders.listed or ()
        released = np.array([order.release for order in orders], float)
        return measured_run(Simulation(resolved, seed), plan_of(resolved, released))

    def runs(self, day: int) -> list[dict[str, float]]:
        """The runs of the model."""
        resolved = with_orders(self.path, self.ticks, day, {})
        orders = resolved.scenario.orders.listed or ()
        plan = plan_of(resolved, np.array([order.release for order in orders], float))
        return [measured_run(Simulation(resolved, seed), plan) for seed in range(1, RUNS + 1)]

    def result(
        self, day: int, runs: list[dict[str, float]], settings: dict[str, object]
    ) -> DayResult:
        """A day of the site beside the runs."""
        return DayResult(f"day {day}", 0, self.measured(day, 1000 + day, settings), runs)


def truth(days: Days, many: int) -> None:
    """The model is right: days, and series of ten days, that differ."""
    results: list[DayResult] = []
    single = 0
    for day in range(many):
        results.append(days.result(day, days.runs(day), {}))
        single += agreement(results[-1:]).verdict == DIFFERS
        if (day + 1) % 50 == 0:
            print(f"{single} of {day + 1} days differ", flush=True)
    series = [agreement(results[k : k + DAYS]).verdict for k in range(0, many - DAYS + 1, DAYS)]
    print(f"days: {single} of {many} differ ({100 * single / many:.1f} %)")
    print(f"series of {DAYS} days: {dict(Counter(series))}")
    assert single <= 0.072 * many


def planted(days: Days, many: int) -> None:
    """One thing is wrong in the model: series of ten days that differ."""
    differ: Counter[str] = Counter()
    ranked = 0
    floor_plan = resolve(str(days.path)).floor_plan
    aisle = stretches_of(floor_plan)[floor_plan.cell(*AISLE[0])]
    for series in range(many):
        numbers = range(series * DAYS, (series + 1) * DAYS)
        runs = {day: days.runs(day) for day in numbers}
        for name, settings in PLANTED.items():
            result = agreement([days.result(day, runs[day], settings) for day in numbers])
            differ[name] += result.verdict == DIFFERS
            if name == "an aisle closed an hour":
                ranked += result.stretches[0].stretch == aisle
        print(f"{series + 1} series: {dict(differ)}, aisle first {ranked}", flush=True)
    for name in PLANTED:
        assert differ[name] >= 0.9 * many, name
    assert ranked >= 0.9 * many


def site_of(days: Days) -> ComparedSite:
    """The model of `tuned`, in which picks take 16 s."""
    base = with_orders(days.path, days.ticks, 0, {"durations.pick": 16})
    return ComparedSite(str(days.path), ("durations.pick=16",), None, base, {}, None, None, {})


def order_file(days: Days, day: int) -> str:
    """The orders of a day as a file of a warehouse system; the clock of the log begins in 1970."""
    rows = ["order,released,from_x,from_y,to_x,to_y"]
    for number, order in enumerate(orders_of_day(day, days.ticks)):
        released = datetime.timedelta(seconds=int(str(order["release"])))
        places = re.findall(r"[0-9]+", f"{order['from']} {order['to']}")
        rows.append(",".join([str(number), f"1970-01-01 0{released}", *places]))
    return "\n".join([*rows, ""])


def logged_days(days: Days, series: int, folder: Path) -> list[SiteDay]:
    """Days of a site in which picks take 22 s, as the model reads them from their logs."""
    settings, site, out = {"durations.pick": 22}, site_of(days), []
    for day in range(series * TUNED_DAYS, (series + 1) * TUNED_DAYS):
        resolved = with_orders(days.path, days.ticks, day, {**settings, "seed": 1000 + day})
        recording, log = folder / "day.rec", folder / f"{day}.jsonl"
        with Recorder(recording, resolved, resolved.scenario.seed) as on_record:
            run_once(resolved, on_record)
        with log.open("wb") as stream:
            write_trace(read_recording(recording), stream, Fraction(SAMPLE_TICKS))
        orders = folder / "orders.csv"
        orders.write_text(order_file(days, day), encoding="utf-8")
        out += read_days(site, log, orders)
    return out


def tuned(days: Days, many: int) -> None:
    """Picks are too short in the model: the tuned time, and whether its interval holds the truth."""
    factors, held = [], 0
    for series in range(many):
        with tempfile.TemporaryDirectory() as folder:
            of_site = logged_days(days, series, Path(folder))
        numbers = tuned_numbers(["durations.pick"], {"durations": {"pick": "16 s"}})
        tuning = tune_outputs(site_of(days), of_site, numbers, 500, 1, lambda runs: None)
        (one,) = tuning.tuned
        factors.append(16 * one.factor)
        held += one.ends is not None and one.ends[0] <= 22 / 16 <= one.ends[1]
        print(
            f"series {series}: {16 * one.factor:.1f} s, {tuning.runs} runs, {held} held", flush=True
        )
    error = np.abs(np.array(factors) / 22 - 1)
    print(
        f"22 s tuned to {np.mean(factors):.2f} s; error {error.mean():.1%}, at most {error.max():.1%}"
    )
    assert error.mean() <= 0.1 and held >= 0.8 * many


def main(what: str, many: int) -> None:
    """Run a trial."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trial.yaml"
        path.write_text(SITE, encoding="utf-8")
        {"truth": truth, "planted": planted, "tuned": tuned}[what](Days(path, TICKS[what]), many)
    print(f"{time.process_time() - begun:.0f} CPU s; error {ERROR}")


if __name__ == "__main__":
    what, *number = sys.argv[1:]
    main(what, int(number[0]) if number else {"truth": 400, "planted": 20, "tuned": 20}[what])
