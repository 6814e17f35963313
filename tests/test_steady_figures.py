"""What a study of steady states tells, beside figures counted by hand after the cut."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from read_reports import report
from sweeping import swept_here

from automaton.experiments.names import STRETCHES, metric_names
from automaton.experiments.store import Store, arrow
from automaton.measured_run import run_marked, sums_by_stretch
from automaton.metrics import counted, metrics_of
from automaton.reporting.floor_maps import floor_maps
from automaton.reporting.results import read_results
from automaton.scenario.resolve import resolve
from automaton.simulation import Simulation
from automaton.statistics.steady import mser5
from automaton.sums import metric
from automaton.world.state import DELIVERED, NIL

pytest.importorskip("pyarrow")

SMALL = """
name: small
layout: {generator: racks, rows: 9, columns: 16, block: 3, last_row: 0}
fleet: {robots: 3, kinematics: omni, start: stands}
orders: {generator: dock-to-rack, count: 120, interval: 6}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: never, at_most: 600}
measure: {}
"""
STUDY = """
name: steady
scenario: small.yaml
factors: {fleet.robots: [2, 3]}
replications: 6
design: steady-state
warm_up: mser-5
analysis:
  metrics: [throughput, completions, delivered, lead_time, task_time, E_U_moves, lead_time_p95, T_total]
  comparisons: pairs
"""
BY_HAND = ("throughput", "completions", "delivered", "lead_time", "task_time", "E_U_moves")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the study."""
    home = tmp_path_factory.mktemp("steady")
    (home / "small.yaml").write_text(SMALL)
    (home / "study.yaml").write_text(STUDY)
    swept_here(home / "study.yaml", home / "out")
    return home / "out"


class Watched:
    """A run, looked at after each tick."""

    def __init__(self, scenario: Path, robots: int, seed: int) -> None:
        run = Simulation(resolve(scenario, [f"fleet.robots={robots}"]), seed)
        self.robots, self.deliveries, self.moves, self.empty = robots, [0], [0], [0]
        self.orders = run.world.orders
        for tick in range(1, 601):
            cells, free = run.world.robots.cell.copy(), run.world.robots.load == NIL
            run.run(tick)
            moved = run.world.robots.cell != cells
            self.moves.append(int(moved.sum()))
            self.empty.append(int((moved & free).sum()))
            self.deliveries.append(int((self.orders.state == DELIVERED).sum()))

    def series(self, window: int) -> list[int]:
        """Deliveries in each so many ticks."""
        return np.diff(self.deliveries[::window]).tolist()  # type: ignore[no-any-return]

    def after(self, cut: int) -> dict[str, float]:
        """The figures of what comes after a tick."""
        orders, late = self.orders, self.deliveries[-1] - self.deliveries[cut]
        ended = (orders.state == DELIVERED) & (orders.delivered > cut)
        begun = (orders.state == DELIVERED) & (orders.dispatched > cut)
        return {
            "throughput": 1000 * late / (600 - cut),
            "completions": 1000 * late / (600 - cut) / self.robots,
            "delivered": late,
            "lead_time": float((orders.delivered - orders.released)[ended].mean()),
            "task_time": float((orders.delivered - orders.dispatched + 1)[begun].mean()),
            "E_U_moves": sum(self.empty[cut + 1 :]) / sum(self.moves[cut + 1 :]),
        }


def test_all_figures_of_a_report_are_those_of_runs_cut_by_hand(folder: Path, capsys: Any) -> None:
    runs: dict[int, list[Watched]] = {0: [], 1: []}
    for row in Store(folder).rows().to_pylist():
        robots = row["fleet.robots"]
        runs[row["point"]].append(Watched(folder / "small.yaml", robots, row["seed"]))
    results = read_results(Store(folder))
    cuts = [3 * mser5([run.series(3) for run in runs[point]]).cut for point in runs]
    cut = math.ceil(max(cuts) / 15) * 15  # a stretch has five windows of three ticks
    assert results.cut is not None and results.cut.ticks == cut > 0
    _, out, _ = report(capsys, str(folder))
    for name in BY_HAND:
        for point in results.points:
            by_hand = [run.after(cut)[name] for run in runs[point.number]]
            told = results.values(point, name)
            assert list(told.values()) == pytest.approx(by_hand, rel=1e-12)
            mean = float(np.mean(by_hand))
            assert f"  {mean:.4g} " in out.partition(f"\n{name}\n---")[2].partition("\n---\n")[0]


def test_a_report_would_be_the_same_whatever_the_warm_up_had_been(
    folder: Path, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Figures of whole runs, and sums before the cut, are replaced by nonsense."""
    told = []
    for name in ("a", "b"):
        paths = tmp_path / f"{name}.csv", tmp_path / f"{name}.html"
        options = ("--csv", str(paths[0]), "--out", str(paths[1]))
        assert report(capsys, str(folder), *options)[0] == 0
        told.append([path.read_text() for path in paths])
        table = poisoned(Store(folder))
        monkeypatch.setattr(Store, "rows", lambda store: table)  # noqa: B023
    assert told[0] == told[1]
    assert "lead_time_p95: left out, since rows keep no sums" in told[0][1]
    assert "T_total tells how long runs are" in told[0][1]


def poisoned(store: Store) -> Any:
    pa, table, cut = arrow(), store.rows(), read_results(store).cut
    assert cut is not None
    for name in metric_names(store.manifest.counted):
        at, values = table.schema.get_field_index(name), table.column(name).to_pylist()
        wrong = [None if value is None else 1e6 + row for row, value in enumerate(values)]
        if name != "T_total":
            table = table.set_column(at, table.schema.field(name), pa.array(wrong, pa.float64()))
    kept = cut.ticks // store.manifest.points[0].windows.stretch
    sums = [
        {
            name: None if values is None else [10**6 + row] * kept + values[kept:]
            for name, values in run.items()
        }
        for row, run in enumerate(table.column(STRETCHES).to_pylist())
    ]
    field = table.schema.field(STRETCHES)
    return table.set_column(
        table.schema.get_field_index(STRETCHES), field, pa.array(sums, field.type)
    )


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("tabletop-mini", []),
        ("depots", ["stop={when: never, at_most: 900}", "measure={}"]),
        ("factory", ["stop={when: never, at_most: 3000}"]),
        ("warehouse-100", ["stop={when: never, at_most: 400}", "measure={}"]),
    ],
)
def test_the_sums_of_stretches_are_those_of_the_run(scenario: str, settings: list[str]) -> None:
    """And reading them off on the way changes nothing."""
    resolved = resolve(scenario, settings)
    plain, run = Simulation(resolved), Simulation(resolved)
    plain.run()
    found = sums_by_stretch(run, run_marked(run, 70).stretches)
    assert run.digest == plain.digest
    sums = {name: sum(values) for name, values in found.items()}
    sums["robots"] = resolved.scenario.fleet.robots
    if "taken" in sums:
        sums |= {"completed": sums["delivered"], "watched_robot_ticks": sums["robot_ticks"]}
    told = {name: metric(name, sums) for name in metrics_of(plain)}
    whole = ("T_total", "lead_time_p95", "delay_p95", "least_charge", "busiest_station", "busiest")
    assert {name: value for name, value in told.items() if name not in whole} == {
        name: value for name, value in metrics_of(plain).items() if name not in whole
    }


def test_figures_after_a_tick_are_those_of_the_whole_run_without_what_came_before() -> None:
    resolved = resolve("factory", ["stop={when: never, at_most: 3000}"])
    run = Simulation(resolved)
    run.run(1200)
    before, then = metrics_of(run), counted(run)
    run.run()
    whole, after = metrics_of(run), metrics_of(run, then)
    for name in ("T_Rtotal", "lost_waiting", "delivered", "parts", "travel", "withdrawals"):
        assert after[name] == whole[name] - before[name]
    assert after["throughput"] == 1000 * after["delivered"] / 1800
    assert after["T_total"] == 3000


def test_maps_of_a_floor_show_what_comes_after_a_tick() -> None:
    resolved = resolve("warehouse-100", ["fleet.robots=60", "stop.at_most=500"])
    begun = resolve("warehouse-100", ["fleet.robots=60", "stop.at_most=350"])
    whole, before, after = (
        [np.nan_to_num(heat.field) for heat in floor_maps(*which)]
        for which in (
            (resolved, 1, "", "whole"),
            (begun, 1, "", "before"),
            (resolved, 1, "", "after", 350),
        )
    )
    assert len(whole) == len(before) == len(after) == 3 and after[1].any() and after[2].any()
    for one, two, three in zip(whole, before, after, strict=True):
        np.testing.assert_allclose(one, two + three)
