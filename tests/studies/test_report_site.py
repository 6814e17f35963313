"""What a report says about the site: results by hour, deadlocks, inputs, its date, and its maps."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pod_scenes import RING, pod_scenario
from report_helpers import report
from synthetic_results import noise, study_of, synthetic_store

from automaton.commands import main
from automaton.documents.html_output import as_html, map_svg
from automaton.documents.report_document import HeatMap, ReportDocument
from automaton.runs.headless import run_once
from automaton.runs.periods import kept_period
from automaton.studies.reports.site_pages import (
    deadlock_remarks,
    input_rows,
    jam_remarks,
    site_picture,
)
from automaton.studies.sweeps.run_keys import replication_seeds
from automaton.world.resolve import resolve

openpyxl = pytest.importorskip("openpyxl")
pytest.importorskip("pyarrow")

CLOCK = ['units.clock="2026-03-02 06:00"', "units.tick=10 s"]
HOURS = """
name: by hour
scenario: tabletop-mini
factors:
  fleet.robots: [2, 3]
set: {units.clock: "2026-03-02 06:00", units.tick: 10 s}
replications: 3
analysis:
  metrics: [makespan, blocked_share]
"""
LOCKED = """
name: locked
scenario: tabletop-mini
factors:
  strategy.right_of_way: [retreat, wait]
set:
  fleet.robots: 4
  units.clock: "2026-03-02 06:00"
  units.tick: 10 s
  stop: {when: parked, max_duration: 6h}
replications: 3
analysis:
  metrics: [throughput]
"""


def swept(place: Path, study: str) -> Path:
    (place / "study.yaml").write_text(study)
    out = place / "results"
    assert main(["sweep", str(place / "study.yaml"), "--out", str(out), "--workers", "1"]) == 0
    return out


@pytest.fixture(scope="module")
def hours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept(tmp_path_factory.mktemp("hours"), HOURS)


@pytest.fixture(scope="module")
def locked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept(tmp_path_factory.mktemp("locked"), LOCKED)


# By hour.


def test_results_by_hour_are_means_over_the_runs_of_a_point(hours: Path, capsys: Any) -> None:
    code, out, _ = report(capsys, str(hours), "--json")
    assert code == 0
    told = [one for one in json.loads(out)["periods"] if one["point"] == 1]
    seeds = replication_seeds(1, 0, 3)
    runs = [run_once(resolve("tabletop-mini", [*CLOCK, "fleet.robots=3"], seed), every=360).periods
            for seed in seeds]  # fmt: skip
    assert [one["from"] for one in told][:3] == ["06:00", "07:00", "08:00"]
    assert len(told) == max(map(len, runs)) > 3
    for k, mean in enumerate(told):
        there = [run[k] for run in runs if len(run) > k]
        ticks = sum(one.ticks for one in there)
        assert mean["runs"] == len(there)
        assert mean["done"] == pytest.approx(np.mean([one.done for one in there]))
        assert mean["backlog"] == pytest.approx(np.mean([one.backlog for one in there]))
        for name in ("on_orders", "in_traffic"):
            by_hand = sum(getattr(one, name) * one.ticks for one in there) / ticks
            assert mean[name] == pytest.approx(by_hand)


def test_the_report_has_a_table_and_small_charts_by_hour(
    hours: Path, capsys: Any, tmp_path: Path
) -> None:
    _, out, _ = report(capsys, str(hours))
    _, _, section = out.partition("\nResults by hour\n")
    assert "\nrobots 3\n" in section and "\n06:00" in section
    assert out.index("\nDecision\n") < out.index("\nInputs\n") < out.index("\nResults by hour\n")
    assert out.index("\nResults by hour\n") < out.index("\nMetrics\n") < out.index("\nDesign\n")
    page = tmp_path / "report.html"
    report(capsys, str(hours), "--out", str(page))
    assert page.read_text().count('<div class="panel">') == 4
    assert "<b>on orders (robots)</b>" in page.read_text()


def test_periods_of_another_length_are_multiples_of_those_that_were_kept(
    hours: Path, capsys: Any, tmp_path: Path
) -> None:
    _, out, _ = report(capsys, str(hours), "--every", "30min")
    assert "\nResults by 30 min\n" in out and "\n06:30" in out
    code, out, err = report(capsys, str(hours), "--every", "10min")
    assert (code, out) == (2, "") and err.count("\n") == 1
    assert "counted in periods of 15 min; give a multiple of it" in err
    table = tmp_path / "periods.csv"
    assert report(capsys, str(hours), "--periods", str(table), "--every", "2h")[0] == 0
    rows = list(csv.DictReader(table.open()))
    assert [row["from"] for row in rows if row["point"] == "0"][:2] == ["06:00", "08:00"]
    by_hour = json.loads(report(capsys, str(hours), "--json")[1])["periods"]
    assert float(rows[0]["done"]) == pytest.approx(by_hour[0]["done"] + by_hour[1]["done"])


def test_where_a_tick_is_no_time_there_are_no_hours(capsys: Any, tmp_path: Path) -> None:
    plain = HOURS.replace("set:", "# set:").replace("replications: 3", "replications: 2")
    out = swept(tmp_path, plain)
    code, text, _ = report(capsys, str(out))
    assert code == 0 and "Results by" not in text
    code, _, err = report(capsys, str(out), "--every", "500")
    assert code == 2 and "they need a tick that is a time (units.tick)" in err


@pytest.mark.parametrize(
    ("tick", "longest", "kept", "refined"),
    [
        ("10 s", "12h", 90, 360),
        ("10 s", "400h", 360, 1440),
        ("10 s", "5000h", 0, 0),
        ("7 s", "12h", 514, 2057),  # an hour, which has no quarters
    ],
)
def test_runs_keep_quarters_of_an_hour_while_they_are_few(
    tick: str, longest: str, kept: int, refined: int
) -> None:
    settings = [f"units.tick={tick}", f"stop.max_duration={longest}"]
    assert kept_period(resolve("tabletop-mini", settings)) == kept
    assert kept_period(resolve("tabletop-mini", [*settings, "refine=4"])) == refined


def test_each_scenario_has_hours_of_its_own(capsys: Any, tmp_path: Path) -> None:
    """Of these two only the first has chargers, and only the second has stations."""
    both = """
name: both
scenario: [depots, factory-types]
points:
  - {name: as it is}
  - {name: fine, set: {refine: 2}}
replications: 1
"""
    file = tmp_path / "a.html"
    assert report(capsys, str(swept(tmp_path, both)), "--out", str(file))[0] == 0
    page = file.read_text()
    assert page.count("tick 3,600</td>") == 2  # also in finer ticks
    first, _, second = page.partition("Results by hour, depots")[2].partition(
        "Results by hour, factory-types"
    )
    assert "<b>chargers (%)</b>" in first and "<b>stations (%)</b>" not in first
    assert "<b>stations (%)</b>" in second and "<b>chargers (%)</b>" not in second


# Deadlocks.


def test_a_report_with_deadlocks_says_so_on_its_first_page(locked: Path, capsys: Any) -> None:
    """The shift ends, so that the deadlocked runs are complete and count."""
    seeds = replication_seeds(1, 0, 3)
    more = ["fleet.robots=4", "strategy.right_of_way=wait", "stop.max_duration=6h"]
    outcomes = [run_once(resolve("tabletop-mini", [*CLOCK, *more], seed)) for seed in seeds]
    longest = max((one.deadlock for one in outcomes if one.deadlock), key=lambda one: one.ticks)
    _, out, _ = report(capsys, str(locked))
    first = " ".join(out.partition("\nInputs\n")[0].split())
    many = sum(one.deadlock is not None for one in outcomes)
    assert f"deadlocks in {many} of 6 runs: right_of_way wait ({many} of 3 runs)" in first
    at = 6 * 3600 + 10 * longest.first_tick
    assert f" at {longest.cell} from {at // 3600:02}:{at // 60 % 60:02}" in first
    assert "The means include these runs" in first


def test_deadlocked_runs_that_did_not_finish_are_not_in_the_means() -> None:
    study = study_of({"fleet.robots": (1, 2)}, 3)
    results = synthetic_store(
        study,
        noise,
        finished=lambda p, r: p == 0 or r > 0,
        deadlocks=lambda p, r: float(p),
        longest_standstill=lambda p, r: 100.0 + r,
        standstill_at=lambda p, r: "(7, 8)",
        standstill_from=lambda p, r: 50 + r,
    )
    (said,) = deadlock_remarks(results, {})
    assert said == (
        "deadlocks in 3 of 6 runs: robots 2 (3 of 3 runs). The longest lasted 102 ticks at (7, 8) from "
        "tick 52 (robots 2, seed 2). The means include the 2 of these runs that are complete"
    )
    assert not list(deadlock_remarks(synthetic_store(study, noise), {}))


def test_jams_are_a_caveat_with_their_points() -> None:
    study = study_of({"fleet.robots": (1, 2)}, 3)
    words = "tick 512: jam: 6 robots between [0, 0] and [2, 1] have finished nothing for 500 ticks"
    results = synthetic_store(study, noise, jam=lambda p, r: words if (p, r) == (1, 2) else None)
    assert list(jam_remarks(results)) == [
        f"jams in 1 of 6 runs: robots 2 (1 of 3 runs). One of them: robots 2, seed 2, {words}"
    ]
    assert not list(jam_remarks(synthetic_store(study, noise)))


# Inputs, picture and date.


def test_inputs_are_as_written_with_what_varies_and_what_was_rounded() -> None:
    few, many = (
        resolve("goods-60x40", [f"fleet.robots={n}", "durations.turn=2.2 s", *more])
        for n, more in ((20, ()), (30, ["durations.handling.line=9 s"]))
    )
    rows = dict(input_rows([few, many]))
    assert rows["floor"] == "60 x 40 cells of 1.2 m (72 x 48 m)"
    assert rows["cells: station"] == "6"
    assert rows["fleet.robots"] == "varied: 20, 30"
    assert rows["durations.move.empty"] == "1.2 m/s"
    assert rows["durations.turn"] == "2.2 s (simulated 9.1 % shorter)"
    assert rows["durations.handling.line"] == "at some points: 9 s"
    assert rows["orders.lines.mean_interarrival_time"] == "500/h"
    assert rows["stations.max_trips"] == "8" and rows["stations.P6.breaks[0].for"] == "15 min"
    assert rows["strategy.charging"] == "opportunity, start_below 80"
    assert not any(key.endswith((".at", ".queue")) for key in rows)


def test_inputs_in_lists_are_as_written_and_days_are_counted(tmp_path: Path) -> None:
    (tmp_path / "days").mkdir()
    for day, lines in enumerate((20, 35, 28)):
        text = "pod,released\n" + "".join(f"{k % 4 + 1},{60 * k}\n" for k in range(lines))
        (tmp_path / "days" / f"{day}.csv").write_text(text)
    drain = {"move": "9 %/h", "turn": "9 %/h", "wait": "2 %/h"}
    station = {"at": [5, 3], "queue": [[6, 3]], "breaks": [{"from": 3000, "for": "40 s"}]}
    keys = pod_scenario(
        {"file": "days/*.csv"},
        picture=RING.replace("q", "c"),
        units={"tick": "0.4 s"},
        stations={"P1": station},
        battery={"drain": drain, "charge_rate": [[0, "60 %/h"], [80, "20 %/h"]]},
    )
    keys["strategy"]["charging"] = "opportunity"
    (tmp_path / "site.yaml").write_text(json.dumps(keys))
    rows = dict(input_rows([resolve(tmp_path / "site.yaml")]))
    assert rows["battery.charge_rate"] == "[[0, 60 %/h], [80, 20 %/h]]"
    assert rows["stations.breaks[0].from"] == "20 min" and rows["stations.breaks[0].for"] == "40 s"
    assert rows["orders.lines"] == "3 files of days/*.csv, 20 to 35 lines"


@pytest.mark.parametrize("name", ["bad-day", "depots", "factory-types", "sorting", "random-400"])
def test_inputs_of_other_floors_are_one_line_each(name: str) -> None:
    rows = input_rows([resolve(name, []).unrefined])
    assert 10 < len(rows) < 100
    assert all("\n" not in text and len(text) < 200 for row in rows for text in row)


def test_the_page_begins_with_the_site_and_its_date(
    hours: Path, capsys: Any, tmp_path: Path
) -> None:
    for file in (hours / "rows").glob("*.parquet"):
        os.utime(file, (0, 86_400 * 365))
    _, out, _ = report(capsys, str(hours))
    assert out.splitlines()[3] == "tabletop-mini: 12 x 7 cells"
    assert "Results of 1971-01-01." in out.partition("\nQuestion\n")[0]
    page = tmp_path / "page.html"
    report(capsys, str(hours), "--out", str(page))
    text = page.read_text()
    assert text.index('class="drawing site"') < text.index("Results of 1971-01-01")
    assert not list(site_picture(synthetic_store(study_of({"fleet.robots": (1, 2)}, 2), noise), {}))


# Shares are percent, of which workbooks keep the fraction.


def test_shares_are_percent_for_readers_and_fractions_for_programs(
    hours: Path, capsys: Any, tmp_path: Path
) -> None:
    book_file, table = tmp_path / "book.xlsx", tmp_path / "summary.csv"
    _, out, _ = report(capsys, str(hours), "--summary", str(table))
    (row, _) = [one for one in csv.DictReader(table.open()) if one["metric"] == "blocked_share"]
    section = out.partition("\nblocked_share\n")[2][:600]
    assert "(%)" in section and f" {100 * float(row['mean']):.4g} " in section
    report(capsys, str(hours), "--out", str(book_file))
    book = openpyxl.load_workbook(book_file)
    assert book["summary"].auto_filter.ref and book["periods"].auto_filter.ref
    cells = {cell.value: cell for line in book["summary"] for cell in line}
    mean = next(cell for value, cell in cells.items() if value == pytest.approx(float(row["mean"])))
    assert mean.number_format == "0.00 %"
    head = [cell.value for cell in book["rows"][1]]
    own = book["rows"].cell(2, head.index("blocked_share") + 1)
    assert own.number_format == "0.00 %" and 0 < own.value < 1


# Maps.


def test_a_tall_floor_fits_on_a_page() -> None:
    tall = map_svg(HeatMap("Lost", "robot min", np.ones((2000, 30)), "", "m", 0.5))
    sizes = [
        float(tall.partition(f'{name}="')[2].partition('"')[0]) for name in ("width", "height")
    ]
    assert sizes[1] < 900 and tall.count("<rect") < 15_000
    assert ">1,000</text>" in tall and ">m</text>" in tall and "mean robot min of a cell" in tall
    assert "0.5" not in as_html(ReportDocument("", [])).partition("<body>")[2]
