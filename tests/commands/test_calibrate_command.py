"""`automaton calibrate` on the command line: bad input in a sentence, and pairs of models.

The page "Fit the model to your site" runs the whole way from a log to settings and a verdict.
"""

from __future__ import annotations

import datetime
import sys
from pathlib import Path

import pytest

from automaton.commands import main
from automaton.commands.arguments import settings_in
from automaton.studies.tuning import Change, compare_pairs
from automaton.world.resolve import resolve

MONDAY = datetime.datetime(2026, 3, 2)
SITE = """\
name: site
layout: {picture: "t......t"}
fleet: {robots: 1, kinematics: omni, start: [[1, 0]]}
units: {tick: 1 s, cell: 1 m, clock: "2026-03-02 06:00"}
orders: {generator: stations, count: 9, mean_interarrival_time: 60}
"""
MESSAGES = "robot,time,x,y\n" + "".join(f"0,{second},{second}.5,0.5\n" for second in range(8))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("--out f.yaml", "calibrate needs a LOG, or --orders FILE"),
        ("{log} --out f.yaml", "a log needs --floor SCENARIO"),
        ("{log} --orders {log} --floor goods-mini --out f.yaml", "no column 'released'"),
        (
            "{log} --floor goods-mini --out f.yaml --budget 60",
            "--budget does nothing without --tune",
        ),
        (
            "{log} --floor goods-mini --out f.yaml --order-time %H",
            "--order-time does nothing without --orders FILE",
        ),
        ("--orders {log} --out f.csv --column x=y", "--column does nothing without a LOG"),
        ("--orders {log} --out f.csv --action pick=y", "--action does nothing without a LOG"),
        ("--orders {log} --out f.csv --floor goods-mini", "--floor does nothing without a LOG"),
        (
            "{log} --floor goods-mini --out f.yaml --action lift=pick",
            "'lift' is not an operation; use pick, drop or handling",
        ),
        ("{log} --floor goods-mini --out f.yaml --pairs 1", "'1' is not a number of pairs, or 0"),
        ("{log} --floor goods-mini --out no/f.yaml", "there is no folder no"),
        ("{folder}/no.csv --floor goods-mini --out f.yaml", "no.csv"),
    ],
)
def test_bad_input_is_a_sentence(
    arguments: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.csv"
    log.write_text(MESSAGES)
    assert main(["calibrate", *arguments.format(log=log, folder=tmp_path).split()]) == 2
    assert sentence in capsys.readouterr().err


def test_a_missing_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "scipy", None)
    assert main(f"calibrate log.csv --floor goods-mini --out {tmp_path}/f.yaml".split()) == 2
    assert "pip install 'fleet-automaton[calibrate]'" in capsys.readouterr().err


def test_a_log_that_says_little_gives_no_settings_but_reasons(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = tmp_path / "log.csv", tmp_path / "f.yaml"
    log.write_text(MESSAGES)
    assert main(f"calibrate {log} --floor goods-mini --out {out} --pairs 0".split()) == 0
    assert "faults.mtbf: 0 of at least 10 breakdowns" in capsys.readouterr().out
    assert "Not fitted" in out.read_text() and out.read_text().endswith("{}\n")


def test_orders_beside_a_log_become_arrivals_if_they_cover_four_weeks(tmp_path: Path) -> None:
    log, site, out = (tmp_path / name for name in ("log.csv", "site.yaml", "f.yaml"))
    log.write_text(MESSAGES)
    site.write_text(SITE)
    orders = tmp_path / "orders.csv"
    command = f"calibrate {log} --floor {site} --orders {orders} --out {out} --pairs 0".split()
    for days, sentence in ((3, "covers 3 days; rates by hour"), (29, "0.08333")):
        moments = (
            MONDAY + datetime.timedelta(days=k // 2, hours=6 + k % 2) for k in range(2 * days)
        )
        orders.write_text("".join(["released\n", *(f"{moment}\n" for moment in moments)]))
        assert main(command) == 0
        assert sentence in out.read_text()
    fitted = resolve(site, settings_in(out)).scenario.orders
    assert fitted.count is None and fitted.arrivals is not None
    assert fitted.arrivals.rates[5:9] == [0, 1, 1, 0]


def test_pairs_of_one_model_are_the_same_and_a_finer_tick_counts_in_the_same_time() -> None:
    model = resolve("tabletop-mini")
    same = compare_pairs(model, model, 2, 1)
    assert same["throughput"].value == 0 and not same["throughput"].matters
    finer = compare_pairs(model, resolve("tabletop-mini", ["refine=2"]), 2, 1)
    assert abs(finer["throughput"].value) < 0.2
    assert not Change(0.02, -0.01, 0.05).matters and Change(0.02, 0.01, 0.03).matters
