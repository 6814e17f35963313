"""What a layer may answer, what it sees, and what becomes of answers that break a rule."""

from __future__ import annotations

from typing import Any

import example_strategies
import numpy as np
import pytest
from gate_scenes import gate_scene

from automaton.engine.jit.kernel import jit_is_on
from automaton.engine.state import ACTION_CHARGE, NIL
from automaton.errors import InputError
from automaton.runs.metrics import illegal_by_layer, metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve


def run(scenario: str = "tabletop-mini", *settings: str, until: int | None = None) -> Simulation:
    simulation = Simulation(resolve(scenario, settings))
    simulation.run(until)
    return simulation


def test_compiled_and_python_strategy_give_equal_digests() -> None:
    for robots in (1, 3, 5):
        for scenario in ("tabletop-1", "tabletop-2"):
            fleet = f"fleet.robots={robots}"
            compiled = run(scenario, fleet, "strategy.allocation=independent")
            python = run(scenario, fleet, "strategy.allocation=independent-python")
            assert compiled.digest == python.digest
            assert compiled.finished


@pytest.mark.parametrize(
    ("scenario", "orders"),
    [
        ("goods-mini", ()),  # pods
        ("tabletop-mini", ("orders={generator: tours, count: 20, stops: {from: 1, to: 3}}",)),
    ],
)
def test_pods_and_orders_without_a_load_are_done_in_python_as_well(
    scenario: str, orders: tuple[str, ...]
) -> None:
    compiled, python, alone = (
        run(scenario, *orders, f"strategy.allocation={name}", until=3000)
        for name in ("independent", "independent-python", "example_strategies:eager")
    )
    assert compiled.finished and compiled.digest == python.digest
    assert alone.finished and not any(illegal_by_layer(alone).values())


def test_a_named_strategy_and_its_class_are_the_same_strategy() -> None:
    by_class = "strategy.allocation=strategies.allocation.cooperative:Cooperative"
    by_name = "strategy.allocation=cooperative"
    assert run("tabletop-mini", by_class).digest == run("tabletop-mini", by_name).digest


def test_zones_given_by_zoning_are_seen_by_everybody() -> None:
    simulation = run("tabletop-mini", "strategy.zoning=example_strategies:HalfAndHalf", until=0)
    assert set(simulation.view.robots.service_zone) == {NIL}
    simulation.run(1)  # zoning is asked when there are orders in no queue, and every 5 ticks
    assert list(simulation.view.robots.service_zone) == [0, 1, 0]


def test_a_robot_sent_to_a_charger_drives_there_and_stays() -> None:
    simulation = run(
        "crossing",
        "strategy.charging=example_strategies:ChargeFirst",
        "strategy.allocation=example_strategies:Idle",
        "fleet.robots=1",
        "battery={initial_charge: 40, charge_rate: 10, drain: {move: 0}}",
        "stop.when=never",
        until=60,
    )
    robots, tally = simulation.world.robots, simulation.world.tally
    assert tally.ticks[0, ACTION_CHARGE].sum() == 6  # from 40 % to 100 % by 10 % in a tick
    assert robots.parked[0] == 1  # and afterwards it drives home
    assert illegal_by_layer(simulation)["charging"] == 0


def test_illegal_answers_cost_a_tick_and_are_counted_against_their_layer() -> None:
    simulation = run("tabletop-mini", "strategy.allocation=example_strategies:Greedy", until=50)
    assert illegal_by_layer(simulation) == {
        "zoning": 0, "charging": 0, "allocation": 3 * 50, "routing": 0, "right_of_way": 0
    }  # fmt: skip
    assert metrics_of(simulation)["lost_illegal"] == 150
    assert simulation.world.robots.parked.all()


def test_a_strategy_that_stays_silent_leaves_everything_as_it_is() -> None:
    simulation = run("tabletop-mini", "strategy.allocation=example_strategies:Idle", until=300)
    assert not simulation.finished
    assert simulation.world.robots.parked.all()
    assert metrics_of(simulation)["operations"] == 0
    assert simulation.world.tally.batches.sum() == 1  # asked once; nothing changed since


def test_the_view_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        run("tabletop-mini", "strategy.allocation=example_strategies:Writes")


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_kernel_that_writes_to_the_view_is_refused_with_its_place() -> None:
    with pytest.raises(
        InputError, match=r"example_strategies\.py:\d+: the strategy does not compile"
    ):
        run("tabletop-mini", "strategy.allocation=example_strategies:CompiledWrites")


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_kernel_that_makes_an_array_is_refused_with_its_line() -> None:
    line = example_strategies.copy_of_batch.py_func.__code__.co_firstlineno + 2
    with pytest.raises(InputError) as caught:
        run("tabletop-mini", "strategy.allocation=example_strategies:Allocates")
    sentence = f"example_strategies.py:{line}: kernels may not allocate; line {line}: np.empty; "
    assert sentence in str(caught.value)


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_kernel_with_a_missing_argument_is_refused_with_its_place() -> None:
    with pytest.raises(InputError, match=r"strategies\.py:\d+: a compiled decide takes \(view"):
        run("tabletop-mini", "strategy.allocation=example_strategies:WrongArity")


def test_a_class_of_another_layer_is_refused() -> None:
    with pytest.raises(InputError, match="HalfAndHalf is a strategy for layer 'zoning'"):
        run("tabletop-mini", "strategy.allocation=example_strategies:HalfAndHalf")


def test_an_unknown_class_is_answered_with_the_nearest_one() -> None:
    with pytest.raises(
        InputError, match=r"no class 'Idel' in example_strategies \(did you mean 'Idle'"
    ):
        run("tabletop-mini", "strategy.allocation=example_strategies:Idel")


def test_an_installed_plugin_is_found_by_its_entry_point(monkeypatch: Any) -> None:
    from importlib import metadata

    from automaton.strategy import lookup

    point = metadata.EntryPoint("allocation.lazy", "example_strategies:Idle", lookup.PLUGINS)
    entry_points = metadata.entry_points

    def with_one_more(**wanted: str) -> Any:
        return [point] if wanted == {"group": lookup.PLUGINS} else entry_points(**wanted)

    monkeypatch.setattr(metadata, "entry_points", with_one_more)
    lookup._plugins.cache_clear()
    try:
        assert "lazy" in lookup.names("allocation")
        assert not run("tabletop-mini", "strategy.allocation=lazy", until=10).finished
    finally:
        lookup._plugins.cache_clear()


@pytest.mark.parametrize("information", ["everything", "orders", "{radius: 2}"])
def test_a_strategy_for_one_robot_at_a_time_delivers_everything(information: str) -> None:
    allocation = "strategy.allocation=example_strategies:eager"
    simulation = run("tabletop-mini", allocation, f"information={information}")
    assert simulation.finished
    assert metrics_of(simulation)["delivered"] == 25
    assert metrics_of(simulation)["illegal_answers"] == 0


def test_an_order_of_stops_is_as_far_as_its_first_one() -> None:
    strategy = {"allocation": "example_strategies:eager", "right_of_way": "wait"}
    simulation = Simulation(gate_scene({}, (7, 0), (1, 0), start=[[3, 0]], strategy=strategy))
    simulation.run(until=1)
    assert simulation.world.orders.reserved_by.tolist() == [NIL, 0]


def test_a_robot_remembers_its_own_numbers_under_a_radius() -> None:
    allocation = "strategy.allocation=example_strategies:counting"
    simulation = run("tabletop-mini", allocation, "information={radius: 1}")
    assert simulation.finished
    assert metrics_of(simulation)["delivered"] == 25


@pytest.mark.parametrize(("information", "reach"), [("orders", 1), ("{radius: 3}", 3)])
def test_a_strategy_cannot_read_a_robot_beyond_its_sight(information: str, reach: int) -> None:
    example_strategies.Watcher.sightings.clear()
    example_strategies.Watcher.memories.clear()
    settings = ("strategy.right_of_way=example_strategies:Watcher", f"information={information}")
    simulation = Simulation(resolve("tabletop-1", [*settings, "strategy.allocation=independent"]))
    width = simulation.world.grid.width
    blind = near = 0
    for tick in range(1, 400):
        cells = simulation.world.robots.cell.copy()
        simulation.run(tick)
        for robot, seen in example_strategies.Watcher.sightings:
            for other in range(len(cells)):
                if other == robot or cells[robot] == NIL or cells[other] == NIL:
                    continue
                dx = abs(cells[robot] % width - cells[other] % width)
                dy = abs(cells[robot] // width - cells[other] // width)
                far = max(dx, dy) > reach
                blind, near = blind + far, near + (not far)
                assert (other in seen) == (not far)
        example_strategies.Watcher.sightings.clear()
    assert blind > 100
    assert near > 10
    if information != "orders":
        assert set(example_strategies.Watcher.memories) == {
            0
        }  # nobody reads another robot's memory


def test_with_everything_in_sight_the_layer_is_called_once_for_all() -> None:
    example_strategies.Watcher.sightings.clear()
    simulation = run("tabletop-1", "strategy.right_of_way=example_strategies:Watcher", until=1)
    assert simulation.world.tally.batches[4] == 1
    assert [robot for robot, _ in example_strategies.Watcher.sightings] == [0, 1, 2, 3]
    everybody = frozenset(np.arange(4))
    assert all(seen <= everybody for _, seen in example_strategies.Watcher.sightings)
