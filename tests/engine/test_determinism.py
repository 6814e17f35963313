"""Same scenario, same seed: same digest, whoever runs it, however, and wherever robots are stored.

The digests of whole runs are kept in snapshots/test_determinism; a change of the rules or of a
strategy changes them, and `pytest tests/engine/test_determinism.py --update-grids` writes them again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fresh_process import told, told_here

from automaton.engine.digest import DIGEST_NAMES
from automaton.engine.state import Clock
from automaton.history.live_run import LiveRun
from automaton.pytest_plugin import GridSnapshot
from automaton.runs.simulation import Simulation
from automaton.studies.process_pool import run_all
from automaton.world.resolve import resolve

ALLOCATIONS = ("independent", "cooperative", "adaptive", "independent-python")
SETTINGS = ("fleet.robots=4", "strategy.allocation=adaptive")


def simulation(name: str, *settings: str, seed: int = 7, **options: Any) -> Simulation:
    return Simulation(resolve(name, settings), seed=seed, **options)


def digest(name: str, *settings: str, seed: int = 7, **options: Any) -> str:
    """The digest of a run to its end."""
    run = simulation(name, *settings, seed=seed, **options)
    run.run()
    assert run.finished
    return run.digest


def test_two_fresh_processes_agree() -> None:
    first = told("tabletop-1", 50_000, *SETTINGS, PYTHONHASHSEED="1")
    assert first == told("tabletop-1", 50_000, *SETTINGS, PYTHONHASHSEED="2")
    assert first.split()[1] == digest("tabletop-1", *SETTINGS), "and this process agrees with them"


def test_the_number_of_workers_does_not_matter() -> None:
    scenarios = [resolve(name, SETTINGS) for name in ("tabletop-mini", "tabletop-2")]
    alone, together = (run_all(scenarios, range(1, 7), workers) for workers in (1, 2))
    assert [[run.digest for run in runs] for runs in alone] == [
        [run.digest for run in runs] for runs in together
    ]


@pytest.mark.parametrize("allocation", ["cooperative", "adaptive"])
def test_with_the_jit_off_the_world_is_the_same(allocation: str) -> None:
    settings = ("fleet.robots=4", f"strategy.allocation={allocation}")
    compiled = told_here("tabletop-mini", 400, *settings)
    assert told("tabletop-mini", 400, *settings, NUMBA_DISABLE_JIT="1") == compiled
    assert compiled.startswith("400 ")


def test_with_the_jit_off_zones_are_as_slow() -> None:
    rules = (
        "world.slowdown=zones",
        "world.traffic_zones=directed",
        "world.extra_tick_probability=0.3",
    )
    settings = (*rules, "durations.pick=0", "durations.drop=0")
    compiled = told_here("crossing", 60, *settings)
    assert told("crossing", 60, *settings, NUMBA_DISABLE_JIT="1") == compiled
    assert compiled.startswith("60 ")


@pytest.mark.parametrize("information", ["everything", "orders", "radius"])
@pytest.mark.parametrize("allocation", ALLOCATIONS)
def test_how_robots_are_stored_does_not_matter(allocation: str, information: str) -> None:
    sight = "information.radius=2" if information == "radius" else f"information={information}"
    settings = (
        "fleet.robots=5",
        f"strategy.allocation={allocation}",
        sight,
        "stop.max_duration=4000",
    )
    expected = None
    for storage in (None, [4, 3, 2, 1, 0], [2, 0, 4, 1, 3]):
        order = None if storage is None else np.array(storage, np.int32)
        run = simulation("tabletop-mini", *settings, storage=order)
        run.run()
        expected = expected or (run.tick, run.digest)
        assert (run.tick, run.digest) == expected


def test_a_run_in_pieces_is_the_same_run() -> None:
    whole = digest("tabletop-2", *SETTINGS)
    run = simulation("tabletop-2", *SETTINGS)
    for until in (1, 2, 3, 500, 500, 501, 1700, 50_000):
        run.run(until=until)
        assert run.tick == until or run.finished
    assert run.finished and run.digest == whole
    run.run()
    assert run.digest == whole, "a finished run stays as it is"


STEERED = (
    "layout={generator: random, columns: 7, rows: 7, obstacles: 0.1}",
    "fleet.robots=20",
    "orders={generator: tours, count: 400, stops: 2}",
    "stop.max_duration=200",
)


@pytest.mark.parametrize("name", ["pibt", "epibt"])
def test_where_robots_are_steered_the_digest_is_the_same_however_they_run(name: str) -> None:
    """Processes, slices as a viewer asks for them, and the compiler."""
    settings = (*STEERED, f"strategy.right_of_way={name}")
    scenario, seeds = resolve("random-400", settings), (7, 8)
    alone, together = (run_all([scenario], seeds, workers) for workers in (1, 2))
    digests = [run.digest for run in alone[0]]
    assert [run.digest for run in together[0]] == digests and len(set(digests)) == 2
    live = LiveRun(scenario, seeds[0])
    while live.end is None:
        live.show(live.head + 7)
    assert live.leading_simulation.digest == digests[0]
    live.close()
    short = told_here("random-400", 30, *settings)
    assert told("random-400", 30, *settings, NUMBA_DISABLE_JIT="1") == short


def test_two_runs_at_once_do_not_disturb_each_other() -> None:
    """They share the floor with its cached distance fields, and nothing else."""
    seeds = (7, 8)
    expected = [digest("tabletop-1", *SETTINGS, seed=seed) for seed in seeds]
    runs = [simulation("tabletop-1", *SETTINGS, seed=seed) for seed in seeds]
    for until in range(100, 10_000, 100):
        for run in runs:
            run.run(until=until)
    assert [run.digest for run in runs] == expected
    assert expected[0] != expected[1]


def test_memory_that_others_use_meanwhile_is_not_the_run_s() -> None:
    """A run holds on to everything that its compiled loop reads."""
    expected = simulation("tabletop-mini", *SETTINGS, "information.radius=2")
    expected.run(until=1500)
    run = simulation("tabletop-mini", *SETTINGS, "information.radius=2")
    rubbish: list[Any] = []
    for until in range(50, 1501, 50):
        rubbish = [np.full(size, 255, np.uint8) for size in (5, 8, 40, 64) for _ in range(200)]
        run.run(until=until)
    assert run.digest == expected.digest and rubbish


def test_recording_and_observing_change_nothing() -> None:
    taken = {"on_record": Simulation.empty_record, "on_observe": Simulation.empty_observation}
    expected = digest("tabletop-1", *SETTINGS)
    for name, empty in taken.items():
        assert digest("tabletop-1", *SETTINGS, **{name: empty}) == expected


def test_the_tutorial_strategy_decides_as_its_compiled_twin() -> None:
    for name, robots in (("tabletop-mini", 1), ("tabletop-mini", 4), ("tabletop-1", 5)):
        compiled, python = (
            digest(name, f"fleet.robots={robots}", f"strategy.allocation={allocation}")
            for allocation in ("independent", "independent-python")
        )
        assert compiled == python


@pytest.mark.parametrize("name", ["tabletop-mini", "tabletop-1", "tabletop-2"])
def test_whole_runs_end_as_they_always_did(name: str, grid_snapshot: GridSnapshot) -> None:
    lines = [f"{'strategy':12} robots seed ticks digest"]
    for allocation in ALLOCATIONS[:3]:
        for robots in range(1, 6):
            settings = (f"fleet.robots={robots}", f"strategy.allocation={allocation}")
            run = simulation(name, *settings, seed=robots)
            run.run()
            lines.append(f"{allocation:12} {robots:6} {robots:4} {run.tick:5} {run.digest}")
    grid_snapshot("\n".join(lines))


# What the digest covers


@pytest.mark.parametrize("name", DIGEST_NAMES)
def test_the_digest_changes_with_every_field(name: str) -> None:
    part, _, field = name.partition(".")
    if part in ("stations", "service_zones"):
        run = simulation("factory")
    elif part in ("pods", "lines", "trips", "pod_stations"):
        run = simulation("goods-mini")
    elif part == "delays":
        delays = "faults.delays={probability: 0.001, ticks: {from: 1, to: 2}}"
        run = simulation("tabletop-mini", *SETTINGS, delays)
    elif part == "gates":
        run = simulation("bad-day")
    elif part == "stops":
        run = simulation("crossing", "orders={generator: tours, count: 100}")
    else:
        run = simulation("tabletop-mini", *SETTINGS)
    run.run(until=300)
    arrays, whole = run.digests(), run.digest
    if name == "tick":
        values, element = run.world.clock, list(Clock.meanings).index("tick")
    elif name == "service_zones.design":
        values, element = run.world.service_zones.design.zone, 2
    else:
        told_by = {"route": "route_hash", "order_queue": "order_queue_length"}
        values = getattr(getattr(run.world, part), told_by.get(field, field)).reshape(-1)
        element = min(2, len(values) - 1)
    with np.errstate(over="ignore"):
        values[element : element + 1] += values.dtype.type(1)
    changed = [DIGEST_NAMES[k] for k in np.flatnonzero(run.digests() != arrays)]
    assert changed == [name]
    assert run.digest != whole


def test_the_digest_knows_which_robot_has_which_value() -> None:
    run = simulation("tabletop-mini", *SETTINGS)
    run.run(until=300)
    whole = run.digest
    cells = run.world.robots.cell
    assert cells[0] != cells[1]
    cells[[0, 1]] = cells[[1, 0]]
    assert run.digest != whole


def test_a_route_that_differs_in_one_step_has_another_digest() -> None:
    run = simulation("tabletop-mini", *SETTINGS)
    sums = set()
    for until in range(1, 200):
        run.run(until=until)
        robots = run.world.robots
        for i in range(len(robots.cell)):
            if robots.route_length[i]:
                route = tuple(robots.route[i, : robots.route_length[i]].tolist())
                sums.add((route, int(robots.route_hash[i])))
    assert len({route for route, _ in sums}) == len({total for _, total in sums}) == len(sums) > 10
