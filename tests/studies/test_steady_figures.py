"""What a study of steady states tells, beside metrics counted by hand after the cut."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_helpers import report
from sweep_studies import swept_here

from automaton.documents.text_output import as_text
from automaton.engine.state import NIL, ORDER_DELIVERED
from automaton.errors import InputError
from automaton.runs.headless import run_marked, sums_by_stretch
from automaton.runs.metric_sums import metric
from automaton.runs.metrics import counted, metrics_of
from automaton.runs.simulation import Simulation
from automaton.runs.task_metrics import tasks_after
from automaton.studies.inference.steady_state import mser5, mser5_of_means
from automaton.studies.reports import study_results
from automaton.studies.reports.build_report import compose, floor_maps
from automaton.studies.reports.study_results import read_results
from automaton.studies.sweeps.result_store import Store, arrow
from automaton.studies.sweeps.study import SUMS_COLUMN, metric_names
from automaton.studies.sweeps.sweep_plan import check_study
from automaton.world.resolve import resolve

pytest.importorskip("pyarrow")

SMALL = """
name: small
layout: {generator: racks, rows: 9, columns: 16, block: 3, last_row: 0}
fleet: {robots: 3, kinematics: omni, start: racks}
orders: {generator: dock-to-rack, count: 120, mean_interarrival_time: 14}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: never, max_duration: 600}
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
  metrics: [throughput, throughput_per_robot, delivered, lead_time, task_time, empty_moves_share,
    lead_time_p95]
  comparisons: pairs
"""
BY_HAND = (
    "throughput",
    "throughput_per_robot",
    "delivered",
    "lead_time",
    "task_time",
    "empty_moves_share",
)


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
        self.orders, self.run = run.world.orders, run
        for tick in range(1, 601):
            cells, free = run.world.robots.cell.copy(), run.world.robots.load == NIL
            run.run(tick)
            moved = run.world.robots.cell != cells
            self.moves.append(int(moved.sum()))
            self.empty.append(int((moved & free).sum()))
            self.deliveries.append(int((self.orders.state == ORDER_DELIVERED).sum()))

    def series(self, window: int) -> list[int]:
        """Deliveries in each so many ticks."""
        return np.diff(self.deliveries[::window]).tolist()  # type: ignore[no-any-return]

    def times(self) -> list[Any]:
        """Of lead times, task times and delays: the tick each counts in, and the time."""
        orders, tasks = self.orders, tasks_after(self.run, 0)
        done = orders.state == ORDER_DELIVERED
        lead = np.stack([orders.delivered, orders.delivered - orders.release_tick])[:, done]
        return [lead, *(np.stack([tasks.begun, v]) for v in (tasks.times, tasks.delays))]

    def after(self, cut: int) -> dict[str, float]:
        """The metrics of what comes after a tick."""
        orders, late = self.orders, self.deliveries[-1] - self.deliveries[cut]
        ended = (orders.state == ORDER_DELIVERED) & (orders.delivered > cut)
        begun = (orders.state == ORDER_DELIVERED) & (orders.dispatched > cut)
        return {
            "throughput": 1000 * late / (600 - cut),
            "throughput_per_robot": 1000 * late / (600 - cut) / self.robots,
            "delivered": late,
            "lead_time": float((orders.delivered - orders.release_tick)[ended].mean()),
            "task_time": float((orders.delivered - orders.dispatched + 1)[begun].mean()),
            "empty_moves_share": sum(self.empty[cut + 1 :]) / sum(self.moves[cut + 1 :]),
        }


def test_all_figures_of_a_report_are_those_of_runs_cut_by_hand(folder: Path, capsys: Any) -> None:
    runs: dict[int, list[Watched]] = {0: [], 1: []}
    for row in Store(folder).rows().to_pylist():
        robots = row["fleet.robots"]
        runs[row["point"]].append(Watched(folder / "small.yaml", robots, row["seed"]))
    results = read_results(Store(folder))
    cuts = [3 * mser5([run.series(3) for run in runs[point]]).cut for point in runs]
    by_deliveries = max(cuts)
    cuts += [cut for own in runs.values() for cut in cuts_by_times(own)]
    assert max(cuts) > by_deliveries  # or times would not matter
    cut = math.ceil(max(cuts) / 15) * 15  # a stretch has five windows of three ticks
    assert results.cut is not None and results.cut.ticks == cut > 0
    _, out, _ = report(capsys, str(folder))
    for name in BY_HAND:
        for point in results.points:
            by_hand = [run.after(cut)[name] for run in runs[point.number]]
            told = results.values(point, name)
            assert list(told.values()) == pytest.approx(by_hand, rel=1e-12)
            mean = float(np.mean(by_hand)) * (100 if name.endswith("share") else 1)
            assert f"  {mean:.4g} " in out.partition(f"\n{name}\n")[2].partition("\n\n\n")[0]


def cuts_by_times(runs: list[Watched]) -> list[int]:
    """What MSER-5 leaves out by lead times, task times and delays, in stretches of 15 ticks."""
    found = []
    for number, times in enumerate(zip(*(run.times() for run in runs), strict=True)):
        at, values = np.concatenate(times, axis=1)
        inside = [(at > begin) & (at <= begin + 15) for begin in range(0, 600, 15)]
        means = np.array([values[one].mean() if one.any() else math.nan for one in inside])
        if number > 0:  # tasks count where they begin: the last are not done
            lasting = np.concatenate([tasks_after(run.run, 0).times for run in runs]).mean()
            means[-math.ceil(lasting / 15) :] = math.nan
        found.append(15 * mser5_of_means(means))
    return found


def test_times_that_grow_have_no_figure_though_deliveries_are_steady(tmp_path: Path) -> None:
    """More orders come than two robots carry: the fleet works at its most, and the queue grows."""
    (tmp_path / "small.yaml").write_text(
        SMALL.replace("mean_interarrival_time: 14", "mean_interarrival_time: 4")
    )
    (tmp_path / "study.yaml").write_text(STUDY.replace("[2, 3]", "[2]"))
    swept_here(tmp_path / "study.yaml", tmp_path / "out")
    results = read_results(Store(tmp_path / "out"))
    (point,) = results.points
    assert len(results.values(point, "throughput")) == len(results.values(point, "task_time")) == 6
    assert not results.values(point, "lead_time")
    told = as_text(compose(Store(tmp_path / "out")))
    assert "no lead_time for" in told and "not stationary or too short: MSER-5 would" in told
    assert "No point has lead_time after the warm-up period" in told


LENGTHS = """
name: lengths
scenario: small.yaml
points: [{stop.max_duration: 400}, {stop.max_duration: 3000, measure.warm_up: 500}]
replications: 5
design: steady-state
analysis: {metrics: [throughput], comparisons: pairs}
"""


def test_a_warm_up_that_some_runs_do_not_outlast_is_refused_beforehand(tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(SMALL)
    (tmp_path / "study.yaml").write_text(LENGTHS)
    why = r"the first 500 ticks, but runs of point 0 end after 400 \(small.yaml, stop.max_duration 400\)"
    with pytest.raises(InputError, match=why) as told:
        check_study(tmp_path / "study.yaml")
    assert told.value.line == 4
    (tmp_path / "study.yaml").write_text(LENGTHS.replace("500", "390"))
    check_study(tmp_path / "study.yaml")
    (tmp_path / "study.yaml").write_text(LENGTHS.replace("500", "391"))
    with pytest.raises(InputError, match="the first 400 ticks"):  # sums are of stretches of 10
        check_study(tmp_path / "study.yaml")


def test_a_point_whose_runs_end_before_the_cut_says_so(tmp_path: Path) -> None:
    """Deliveries of the long runs set in late; made up, beside those of short ones."""
    (tmp_path / "small.yaml").write_text(SMALL)
    study = LENGTHS.replace(", measure.warm_up: 500", "") + "warm_up: mser-5\n"
    (tmp_path / "study.yaml").write_text(study)
    swept_here(tmp_path / "study.yaml", tmp_path / "out")
    store = Store(tmp_path / "out")
    table, window = store.rows(), store.manifest.points[0].windows.window
    of_point = [1, 2] * (200 // window), [0] * (600 // window) + [1, 2] * (1200 // window)
    series = [of_point[row["point"]] for row in table.to_pylist()]
    at, field = table.schema.get_field_index("series"), table.schema.field("series")
    table = table.set_column(at, field, arrow().array(series, field.type))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Store, "rows", lambda _: table)
        cut, told = read_results(store).cut, " ".join(as_text(compose(store)).split())
    assert cut is not None and cut.ticks >= 600
    why = f"its runs of 400 ticks end before the cut at {cut.ticks:,}"
    assert cut.refused == {0: why}
    assert f"No comparison is possible: max_duration 400: {why}." in told
    assert f"no metrics for max_duration 400: {why}" in told


def test_a_report_would_be_the_same_whatever_the_warm_up_had_been(
    folder: Path, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Metrics of whole runs, and sums before the cut, are replaced by nonsense."""
    told = []
    for name in ("a", "b"):
        paths = tmp_path / f"{name}.csv", tmp_path / f"{name}.html"
        options = ("--csv", str(paths[0]), "--out", str(paths[1]))
        assert report(capsys, str(folder), *options)[0] == 0
        told.append([path.read_text() for path in paths])
        table = poisoned(Store(folder))
        cut = read_results(Store(folder)).cut
        monkeypatch.setattr(Store, "rows", lambda store: table)  # noqa: B023
        monkeypatch.setattr(study_results, "cut_of", lambda *_: cut)  # noqa: B023
    assert told[0] == told[1]
    assert "lead_time_p95: excluded because the warm-up period cannot" in told[0][1]


def poisoned(store: Store) -> Any:
    pa, table, cut = arrow(), store.rows(), read_results(store).cut
    assert cut is not None
    for name in metric_names(store.manifest.counted):
        at, values = table.schema.get_field_index(name), table.column(name).to_pylist()
        wrong = [None if value is None else 1e6 + row for row, value in enumerate(values)]
        if name != "makespan" and name not in study_results.AT_THE_END:
            table = table.set_column(at, table.schema.field(name), pa.array(wrong, pa.float64()))
    kept = cut.ticks // store.manifest.points[0].windows.stretch
    sums = [
        {
            name: None if values is None else [10**6 + row] * kept + values[kept:]
            for name, values in run.items()
        }
        for row, run in enumerate(table.column(SUMS_COLUMN).to_pylist())
    ]
    field = table.schema.field(SUMS_COLUMN)
    return table.set_column(
        table.schema.get_field_index(SUMS_COLUMN), field, pa.array(sums, field.type)
    )


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("tabletop-mini", []),
        ("depots", ["stop={when: never, max_duration: 900}", "measure={}"]),
        ("factory", ["stop={when: never, max_duration: 3000}"]),
        ("warehouse-100", ["stop={when: never, max_duration: 400}", "measure={}"]),
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
    whole = (
        *("makespan", "longest_standstill"),
        *("lead_time_p95", "lead_time_p99", "lead_time_max"),
        "delay_p95",
        "min_charge",
        "oldest_order",
        "starved_robots",
        "busiest_station",
        "busiest_station_utilization",
    )
    assert {name: value for name, value in told.items() if name not in whole} == {
        name: value for name, value in metrics_of(plain).items() if name not in whole
    }


def test_figures_after_a_tick_are_those_of_the_whole_run_without_what_came_before() -> None:
    resolved = resolve("factory", ["stop={when: never, max_duration: 3000}"])
    run = Simulation(resolved)
    run.run(1200)
    before, then = metrics_of(run), counted(run)
    run.run()
    whole, after = metrics_of(run), metrics_of(run, then)
    for name in (
        "operations",
        "lost_waiting",
        "delivered",
        "parts_finished",
        "distance",
        "retreats",
    ):
        assert after[name] == whole[name] - before[name]
    assert after["throughput"] == 1000 * after["delivered"] / 1800
    assert "makespan" not in after


def test_maps_of_a_floor_show_what_comes_after_a_tick() -> None:
    resolved = resolve("warehouse-100", ["fleet.robots=60", "stop.max_duration=500"])
    begun = resolve("warehouse-100", ["fleet.robots=60", "stop.max_duration=350"])
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
