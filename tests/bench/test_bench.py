"""The instrument of `automaton bench`: that it measures what it says. How fast is for no test."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from docs_pages import page

from automaton.bench import (
    BENCH_PARTS,
    crowd_speed,
    loop_speed,
    route_speed,
    run_speed,
    steering_speed,
    table_speed,
    warehouse_speed,
)
from automaton.bench.measured_kernels import compute, random_walk, random_walk_in_spans
from automaton.bench.measurement import (
    Measurement,
    NotMeasuredError,
    open_floor,
    rounded,
    scene,
    take,
)
from automaton.bench.step_speed import (
    ONE_TO_A_CELL,
    WalkingFleet,
    prepare,
    storage_of,
    walking_fleet,
)
from automaton.commands import bench_command, main
from automaton.commands.bench_command import chosen, measurements
from automaton.engine.state import LAYER_ALLOCATION, LAYER_ZONING, NIL, World
from automaton.floor.floor_plan import UNLIMITED
from automaton.scenario.robot_types import RobotType
from strategies.routing.astar import LARGER_G
from tui.bench import viewer_speed

CROWDED = WalkingFleet(200, 20)
SMALL_FLOOR = {"generator": "random", "columns": 6, "rows": 6, "obstacles": 0.1}
SPARSE = WalkingFleet(200, 100)
EXITS = np.uint8(15)  # bits of grid.cell_flags that no wall has


def holders(world: World, cells: Any) -> Any:
    """(C,) robots that hold each cell: standing there, or entering it."""
    held = np.concatenate([world.robots.cell, world.robots.claim[world.robots.claim != NIL]])
    return np.bincount(held, minlength=cells)


def quoted(text: str) -> Iterator[tuple[str, set[str]]]:
    """Each line of the page's tables of `bench` that names sizes: its part, and the sizes."""
    for heading, part in (
        ("time per robot and tick", "step"),
        ("an auction on an empty plane", "auctions"),
    ):
        table = text.partition(heading)[2].partition("|---")[2].partition("\n\n")[0]
        for line in table.splitlines()[1:]:
            yield part, set(re.findall(r"([\d,]*\d) (?:robots|tasks|x)", line.split("|")[1]))


def test_each_size_that_the_page_quotes_is_measured() -> None:
    names = {
        part: [set(re.findall(r"\d[\d,]*", one.name)) for one in measurements([part])]
        for part in ("step", "auctions", "routes", "crowd")
    }
    names["step"] += names["routes"] + names["crowd"]
    lines = list(quoted(page("docs/explanation/speed.md").text))
    assert len(lines) == 14
    for part, sizes in lines:
        assert any(sizes <= measured for measured in names[part]), f"{part}: {sizes}"


def test_no_two_measurements_have_one_name() -> None:
    parts = chosen(
        [name for name in BENCH_PARTS if name != "watching"], True, True
    )  # viewer has it
    names = [measurement.name for measurement in measurements(parts)]
    assert len(set(names)) == len(names) and all(names)


def test_parts_are_chosen_by_name_and_by_option() -> None:
    assert chosen(["loop"], False, False) == ["loop"]
    assert chosen(["routes", "loop", "loop"], False, False) == ["routes", "loop"]
    assert chosen(["loop"], True, False) == ["loop", "compile"]
    assert chosen(["startup"], False, False) == ["startup"]
    assert chosen([], False, True) == [
        *(n for n, part in BENCH_PARTS.items() if part.usual),
        "startup",
    ]


def test_help_has_a_line_for_each_part(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--help"]) == 0
    begun = [line.split(":")[0].strip() for line in capsys.readouterr().out.splitlines()]
    assert [name for name in begun if name in BENCH_PARTS] == list(BENCH_PARTS)


def test_a_figure_is_the_median_between_the_extremes_after_a_warm_up() -> None:
    values = iter([1000.0, 3.0, 1.0, 2.00004, 7.0, 9.0])
    figure = take(Measurement("it", "s", lambda: lambda: next(values)), 5)
    told = {"name": "it", "unit": "s", "median": 3.0, "low": 1.0, "high": 9.0}
    found = figure._asdict()
    assert found.pop("load") >= 0 and found == told
    assert take(Measurement("it", "s", lambda: lambda: 5.0, warm_up=False), 1).low == 5.0
    few = iter([4.0, 6.0])
    slow = Measurement("it", "s", lambda: lambda: next(few), warm_up=False, at_most=2)
    assert take(slow, 7).median == 5.0
    assert rounded(0.0123456) == 0.01235
    assert rounded(123456.0) == 123500.0


@pytest.mark.parametrize("case", [CROWDED, SPARSE, CROWDED._replace(reading_order=True)])
def test_random_walkers_never_share_a_cell_and_none_is_lost(case: WalkingFleet) -> None:
    world = walking_fleet(case)
    start = world.robots.cell.copy()
    for first in range(0, 300, 20):
        random_walk(world, first, first + 20)
        assert len(np.unique(world.robots.cell)) == case.robots
        assert np.all(world.grid.cell_flags[world.robots.cell] & EXITS), (
            "a robot has left the floor"
        )
    assert np.count_nonzero(world.robots.cell != start) > 0.8 * case.robots


@pytest.mark.parametrize("walk", [random_walk, random_walk_in_spans])
def test_random_walkers_keep_to_the_capacities_of_a_mixed_floor(walk: Any) -> None:
    world = walking_fleet(WalkingFleet(300, 20, mixed=True))
    capacity = (world.grid.cell_flags >> np.uint8(5)) & 3
    most = np.where(capacity == UNLIMITED, 300, capacity.astype(int))
    entering = shared = 0
    for tick in range(300):
        walk(world, tick, tick + 1)
        held = holders(world, len(most))
        assert np.all(held <= most)
        entering += int(np.count_nonzero(world.robots.claim != NIL))
        shared += int(np.count_nonzero(held > 1))
    assert shared > 0
    assert (entering > 0) == (walk is random_walk_in_spans)


def test_how_robots_are_stored_changes_nothing_but_the_speed() -> None:
    cells = []
    for case in (CROWDED, CROWDED._replace(reading_order=True)):
        world = walking_fleet(case)
        random_walk(world, 0, 50)
        cells.append(world.robots.cell[world.robots.at_index])
    assert np.array_equal(cells[0], cells[1])


def test_fleets_are_stored_in_random_order_or_along_the_floor() -> None:
    steps = []
    for along in (False, True):
        case = CROWDED._replace(reading_order=along)
        storage = storage_of(case, open_floor(case.side, case.side))
        assert np.array_equal(np.sort(storage), np.arange(case.robots))
        steps.append(np.diff(walking_fleet(case).robots.cell) > 0)
    assert 0.3 < steps[0].mean() < 0.7
    assert steps[1].all()


def test_the_sizes_quoted_are_the_sizes_measured() -> None:
    assert [(case.robots, case.side) for case in ONE_TO_A_CELL] == [
        (10_000, 1000),
        (100_000, 1000),
        (1_000_000, 4000),
        (500_000, 1000),
    ]
    world = walking_fleet(SPARSE)
    assert len(world.robots.cell) == SPARSE.robots
    assert np.count_nonzero(world.grid.cell_flags & EXITS) == SPARSE.side**2


def test_routes_are_driven_in_every_tick_and_nobody_is_asked() -> None:
    robots, side = 60, 10
    simulation = route_speed.circling_fleet(robots, side)
    start = simulation.world.robots.cell.copy()
    batches = simulation.world.tally.batches.copy()
    assert batches[LAYER_ALLOCATION] == 1
    for _ in range(3):
        assert route_speed.cpu_seconds_of_driving(simulation, 2 * side) > 0
        assert np.array_equal(simulation.world.robots.cell, start), "a round ends where it began"
    assert route_speed.cpu_seconds_of_driving(simulation, 1) >= 0
    assert np.all(simulation.world.robots.cell != start)
    assert np.array_equal(simulation.world.tally.batches, batches)
    assert len(np.unique(simulation.world.robots.cell)) == robots


def test_observing_is_measured_on_a_fleet_that_is_observed_and_one_that_is_not() -> None:
    alone, observed = (route_speed.observed_fleet(60, 20, watched) for watched in (False, True))
    for simulation in (alone, observed):
        assert route_speed.seconds_of_observing(simulation, 40, seed=1) > 0
    assert observed.observation.lost.sum() > 60 and observed.observation.flow.sum() > 100
    assert not alone.observation.lost.any() and alone.digest == observed.digest


def test_a_robot_in_the_way_of_the_routes_is_noticed() -> None:
    simulation = route_speed.circling_fleet(60, 10)
    simulation.world.robots.busy[0] = 5
    with pytest.raises(AssertionError, match="did not drive"):
        route_speed.cpu_seconds_of_driving(simulation, 20)


@pytest.mark.parametrize("strategy", [loop_speed.COMPILED, loop_speed.IN_PYTHON])
def test_the_layer_is_asked_every_tick_and_moves_nobody(strategy: str) -> None:
    simulation = loop_speed.idle_fleet(strategy)
    before = simulation.world.tally.batches.copy()
    loop_speed.seconds_of(simulation, 50)
    after = simulation.world.tally.batches
    assert after[LAYER_ZONING] - before[LAYER_ZONING] == 50
    assert np.array_equal(np.delete(after, LAYER_ZONING), np.delete(before, LAYER_ZONING))
    assert simulation.world.robots.parked.all()
    assert not simulation.finished


def test_every_sampler_returns_a_figure() -> None:
    assert prepare(CROWDED._replace(robots=20_000, side=200))() > 0
    assert route_speed.prepare(60, 10, 30)() > 0
    assert crowd_speed.prepare_holders(CROWDED)() > 0
    assert crowd_speed.prepare_crowd(50, 3)() > 0
    assert isinstance(route_speed.prepare_observing(60, 10, 30)(), float)
    assert isinstance(route_speed.prepare_observing(60, 10, 30, at_random=True)(), float)
    small = steering_speed.BUSY_FLEETS[0]._replace(robots=8, floor=SMALL_FLOOR, started=2, ticks=3)
    assert steering_speed.prepare_fleet("pibt", small)() > 0
    assert steering_speed.prepare_ones(small._replace(ticks=steering_speed.TURNS))() > 0


def test_recordings_are_timed() -> None:
    assert run_speed.prepare_recorded("goods-mini", 60)() > 0
    assert run_speed.prepare_verified("goods-mini", 60)() > 0


def test_pods_are_timed() -> None:
    assert run_speed.prepare_pods("pibt", 3, 5)() > 0
    assert table_speed.prepare_tables((17, 5), 2, True, 3)() > 0
    assert table_speed.prepare_streets(RobotType(), 2)() > 0 < table_speed.prepare_other_weights()()
    assert table_speed.prepare_options(20)() > 0
    assert run_speed.prepare_tabletop([1])() > 0
    assert warehouse_speed.prepare_legs(30, LARGER_G, 10)() > 0
    assert warehouse_speed.prepare_avoidance(30, 10)() > 0
    assert warehouse_speed.prepare_legs_in_time(30, 8)() > 0
    assert warehouse_speed.prepare_forecast(30, 8)() > 0
    assert warehouse_speed.prepare_fleet("zones", 20, 50)() > 0
    assert warehouse_speed.prepare_network(20)() > 0
    assert loop_speed.prepare_loop(1000)() > 0
    assert loop_speed.prepare_digest(10)() > 0
    for strategy in (loop_speed.COMPILED, loop_speed.IN_PYTHON):
        assert isinstance(loop_speed.prepare_layer(strategy, 100)(), float)


def test_tables_are_computed_in_each_sample_on_floors_of_shelves() -> None:
    floor_plan = table_speed.shelves(21, 4)
    assert floor_plan.drivable[1:-1, 1:-1].sum() == 4 * 21 - 10
    assert not floor_plan.drivable[2, 6:16].any()
    assert 0.5 < table_speed.shelves(161, 63).drivable.mean() < 0.6
    tables, goals = table_speed.tables_for((21, 4), 1), np.array([24, 25], np.int64)
    compute(tables, goals)
    assert np.count_nonzero(tables.owner != NIL) == 2
    tables.reached[:] = 0
    compute(tables, goals)
    assert tables.reached.any()


def test_a_scene_has_no_orders_and_never_ends() -> None:
    resolved = scene(open_floor(8, 6), 5)
    assert resolved.scenario.stop.when == "never"
    assert resolved.floor_plan.slots.size == 0


def test_bench_prints_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--only", "loop", "--repeat", "3", "--json"]) == 0
    captured = capsys.readouterr()
    rows = json.loads(captured.out)
    assert [list(row) for row in rows] == [["name", "unit", "median", "low", "high", "load"]] * 2
    assert [(row["name"], row["unit"]) for row in rows] == [
        ("loop, idle fleet", "ns per tick"),
        ("digest", "us"),
    ]
    assert all(0 < row["low"] <= row["median"] <= row["high"] for row in rows)


def test_bench_prints_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--only", "loop", "--repeat", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["measured", "median", "low", "high", "unit"]
    assert lines[2].startswith("loop, idle fleet") and lines[2].endswith("ns per tick")
    assert any(line.startswith("1 sample each at most; ") for line in lines)


@pytest.mark.parametrize(
    ("name", "begins"),
    [("a.md", b"| measured |"), ("a.html", b"<!doctype html>"), ("a.xlsx", b"PK")],
)
def test_bench_writes_the_formats_of_other_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, begins: bytes
) -> None:
    one = Measurement("first", "s", lambda: lambda: 1.0)
    monkeypatch.setattr(bench_command, "measurements", lambda parts: [one])
    assert main(["bench", "--only", "loop", "--repeat", "1", "--out", str(tmp_path / name)]) == 0
    assert (tmp_path / name).read_bytes().startswith(begins)


def test_interrupted_it_prints_what_it_has(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted() -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(
        "automaton.commands.bench_command.measurements",
        lambda parts: [
            Measurement("first", "s", lambda: lambda: 1.0),
            Measurement("second", "s", interrupted),
        ],
    )
    assert main(["bench", "--json"]) == 130
    captured = capsys.readouterr()
    assert [row["name"] for row in json.loads(captured.out)] == ["first"]
    assert "interrupted" in captured.err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--only", "lop"], "unknown part 'lop' (did you mean 'loop'?)"),
        (["--repeat", "0"], "--repeat must be at least 1"),
        (["--peers", "python3"], "--peers is for --only environments"),
        (["--jsno"], "'--jsno' (did you mean '--json'?)"),
    ],
)
def test_bad_arguments_are_told(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", *arguments]) == 2
    assert told in capsys.readouterr().err


def test_what_cannot_be_measured_is_named_and_the_rest_is_measured(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def ends() -> float:
        raise NotMeasuredError("the viewer has ended")

    wanted = [
        Measurement("first", "s", lambda: ends, warm_up=False),
        Measurement("second", "s", lambda: lambda: 2.0, warm_up=False),
    ]
    monkeypatch.setattr(bench_command, "measurements", lambda parts: wanted)
    assert main(["bench", "--only", "loop", "--repeat", "1"]) == 1
    told = capsys.readouterr()
    assert "second" in told.out and "first" not in told.out and "load" in told.out
    assert "not measured: first: the viewer has ended (" in told.err and "load" in told.err


def test_a_session_that_cannot_be_measured_is_tried_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tries = []

    def too_slow() -> list[float]:
        tries.append(1)
        raise NotMeasuredError("too slow")

    monkeypatch.setattr(viewer_speed, "compile_walkers", lambda: None)
    sessions = viewer_speed.Together(too_slow)
    for at in (0, 1):
        with pytest.raises(NotMeasuredError):
            take(sessions.figure(str(at), "s", itemgetter(at)), 1)
    assert len(tries) == 1
