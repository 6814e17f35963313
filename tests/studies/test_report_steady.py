"""Reports of steady states: the warm-up, and scenarios that the folder has, lacks, or has changed."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_helpers import report, tables
from synthetic_results import noise, synthetic_store

from automaton import sweep
from automaton.documents.report_document import Listed
from automaton.documents.text_output import as_text
from automaton.engine.state import ORDER_DELIVERED
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.text_files import find
from automaton.studies.reports.build_report import compose
from automaton.studies.reports.metric_tables import bound, steady_section
from automaton.studies.reports.study_results import Results, cut_of
from automaton.studies.sweeps.result_store import Store
from automaton.studies.sweeps.study import Analysis, Point, Study
from automaton.world.resolve import resolve


def test_a_steady_state_is_given_or_refused_with_its_reason() -> None:
    study = replace_study(replications=20, warm_up="mser-5")

    def series(point: int, replication: int) -> list[int]:
        rng = np.random.default_rng((point, replication))
        ramp = np.linspace(0, 1, 50) if point == 0 else np.linspace(0, 1, 400)
        rate = np.concatenate([ramp, np.ones(400 - len(ramp))])
        return rng.poisson(5 * rate).tolist()  # type: ignore[no-any-return]

    results = cut_off(
        synthetic_store(study, noise, series=series, throughput=lambda p, r: 500.0 + r)
    )
    blocks = list(steady_section(results))
    (table,) = tables(blocks)
    good, refused = table.rows
    assert "replication-deletion" in good[5] and good[1] == "509.5"
    assert 300 <= int(good[4].replace(",", "")) <= 800  # of 4,000 ticks, 500 warm up
    assert refused[1] == "-"
    (listed,) = [block for block in blocks if isinstance(block, Listed)]
    assert "not stationary or too short" in listed.items[0]


def test_a_steady_state_of_a_few_runs_rests_on_all_of_them() -> None:
    def series(point: int, replication: int) -> list[int]:
        rng = np.random.default_rng((point, replication))
        return [99] * 20 + rng.poisson(5, 350).tolist()  # type: ignore[no-any-return]

    study = replace_study(replications=7, warm_up=200)
    results = cut_off(synthetic_store(study, noise, series=series), declared=200)
    (table,) = tables(steady_section(results))
    for row, point in zip(table.rows, (0, 1), strict=True):
        assert row[5] == "14 batch means of 7 runs"
        mean = np.mean([series(point, r)[20:] for r in range(7)]) * 1000 / 10
        assert float(row[1]) == pytest.approx(mean, rel=1e-3)


def test_the_largest_warm_up_of_all_points_is_cut_off_at_all_of_them() -> None:
    def series(point: int, replication: int) -> list[int]:
        rng = np.random.default_rng((point, replication))
        return rng.poisson([1] * (40 + 80 * point) + [9] * (360 - 80 * point)).tolist()  # type: ignore[no-any-return]

    results = synthetic_store(
        replace_study(replications=10, warm_up="mser-5"), noise, series=series
    )
    cut = cut_off(results).cut
    assert cut is not None and cut.found == {0: 400, 1: 1200} and cut.ticks == 1200
    declared = cut_off(results, declared=1500).cut
    assert declared is not None and declared.ticks == 1500  # by a scenario: never less


def cut_off(results: Results, declared: int = 0) -> Results:
    """With windows of 10 ticks."""
    points = np.array(results.columns["point"])
    cut = cut_of(results.study, points, results.columns["series"], declared, 10)
    return replace(results, cut=cut)


@pytest.fixture
def steady(tmp_path: Path) -> Path:
    """A folder of a steady state, with a copy of its scenario; the study's own lies beside that."""
    shipped = find("warehouse-100").read_text()
    (tmp_path / "own.yaml").write_text(shipped.replace("max_duration: 2300", "max_duration: 1200"))
    (tmp_path / "steady.yaml").write_text(
        "name: steady\nscenario: own.yaml\nreplications: 20\ndesign: steady-state\nwindow: 20\n"
        "warm_up: 400\npoints: [{fleet.robots: 10}]\n"
        "analysis: {metrics: [throughput, delay, blocked_share]}\n"
    )
    with ThreadPoolExecutor(1) as executor:
        sweep(tmp_path / "steady.yaml", tmp_path / "deep" / "results", executor)
    return tmp_path / "deep" / "results"


def test_a_steady_state_needs_no_scenario_to_be_reported(steady: Path) -> None:
    (steady / "own.yaml").unlink()
    store = Store(steady)
    document = compose(store)
    told = [item for block in document.blocks if isinstance(block, Listed) for item in block.items]
    assert any("no bounds and maps" in item for item in told)
    table = next(one for one in tables(document.blocks) if "orders/1000 ticks" in one.head)
    series = np.array(store.rows().column("series").to_pylist())[:, 400 // 20 :]  # 1,200 ticks
    assert float(table.rows[0][1]) == pytest.approx(series.mean() * 1000 / 20, rel=1e-3)


def test_a_warm_up_in_ticks_is_left_out_of_all_figures_by_the_runs_themselves(steady: Path) -> None:
    text = as_text(compose(Store(steady)))
    assert "the first 400 ticks of every run, excluded from all metrics; declared" in text
    assert "for --floor: 0 robots 10" in text
    row = Store(steady).rows().to_pylist()[0]
    run = Simulation(resolve(steady / "own.yaml", ["fleet.robots=10"]), row["seed"])
    run.run()
    orders = run.world.orders
    late = (orders.state == ORDER_DELIVERED) & (orders.delivered > 400)
    assert (
        row["throughput"]
        == 1000 * late.sum() / 800
        != 1000 * (orders.state == ORDER_DELIVERED).sum() / 1200
    )
    assert row["delivered"] == late.sum() < (orders.state == ORDER_DELIVERED).sum()


def test_runs_of_a_given_length_are_measured_after_their_warm_up_by_default_too(
    tmp_path: Path, capsys: Any
) -> None:
    """Figures, deliveries and maps; runs that have no warm-up are told of."""
    shipped = find("warehouse-100").read_text()
    (tmp_path / "own.yaml").write_text(shipped.replace("max_duration: 2300", "max_duration: 600"))
    (tmp_path / "study.yaml").write_text(
        "name: plain\nscenario: own.yaml\nreplications: 2\nfactors: {measure.warm_up: [0, 200]}\n"
        "analysis: {metrics: [throughput, delivered]}\n"
    )
    with ThreadPoolExecutor(1) as executor:
        sweep(tmp_path / "study.yaml", tmp_path / "out", executor)
    whole, _, cut, _ = rows = Store(tmp_path / "out").rows().to_pylist()
    assert whole["delivered"] > cut["delivered"] > 0
    for row, ticks in zip(rows, (600, 600, 400, 400), strict=True):
        assert row["throughput"] == 1000 * row["delivered"] / ticks
    code, out, _ = report(capsys, str(tmp_path / "out"), "--floor", "1")
    assert code == 0 and "ticks 201 to 600" in out
    told = " ".join(out.split())
    assert "no warm-up period is discarded: runs of warm_up 0 have a fixed length" in told
    assert "runs of warm_up 200" not in told


def test_whoever_is_given_a_report_can_repeat_it(steady: Path) -> None:
    text = as_text(compose(Store(steady)))
    study, own = ((steady.parent.parent / f"{n}.yaml").read_text() for n in ("steady", "own"))
    for line in (*study.splitlines(), *own.splitlines()):
        assert line.strip() in text


def test_a_scenario_that_changed_gives_no_bounds_and_no_maps(steady: Path, capsys: Any) -> None:
    """Beside the folder's own study, where the report looks first, lies a copy of the scenario."""
    own = steady.parent.parent / "own.yaml"
    code, out, _ = report(capsys, str(steady), "--floor", "0")
    assert code == 0 and "Visits, point 0" in out and "ticks 401 to 1,200" in out
    (steady / "own.yaml").write_text(own.read_text().replace("count: 2000", "count: 1999"))
    code, out, _ = report(capsys, str(steady))
    assert code == 0
    told = "no bounds and maps for 1 of 1 point, because the scenario has changed since"
    assert told in " ".join(out.split())
    code, _, err = report(capsys, str(steady), "--floor", "0")
    assert (
        code == 2 and "--floor 0: no map is possible" in err and "since it was run: own.yaml" in err
    )


def replace_study(**more: Any) -> Study:
    return Study(
        name="steady",
        scenario="warehouse-100",
        factors={"fleet.robots": (1, 2)},
        design="steady-state",
        analysis=Analysis(metrics=("makespan",)),
        **more,
    )


def test_no_bound_is_shown_where_it_would_say_nothing() -> None:
    """Of drawn orders the cheapest possible one bounds the rate: 8,500 beside 98.9."""

    def most(scenario: str, *settings: str) -> float | None:
        resolved = resolve(scenario, settings)
        point = Point(0, scenario, {})
        return bound({0: resolved}, point, "throughput")

    assert most("warehouse-100") is most("warehouse-100", "stop={when: delivered}") is None
    assert most("tabletop-1", "stop={when: never}") is None
    run = Simulation(resolve("tabletop-1"))
    run.run()
    rate = metrics_of(run)["throughput"]
    bounded = most("tabletop-1")
    assert bounded is not None and 0 < rate <= bounded < 5 * rate
