"""Zone repair by simulated annealing and by a genetic algorithm, and a turn of a DDZ leader."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from zoning_scenes import (
    FEET_PER_MINUTE,
    check_partition,
    drawn,
    everyone,
    factory,
    factory_rules,
    scratch,
    stations,
    training_flow,
)
from zoning_trials import ANNEALED, BRED, evolved, repaired, south, turn

from automaton.engine.facilities import Design
from automaton.engine.jit.kernel import jit_is_on
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.zoning import annealing, genetic, negotiation
from strategies.zoning.annealing import exponential, logarithm, temperature
from strategies.zoning.design_files import design_arrays, read_design
from strategies.zoning.designs import first_design, random_design
from strategies.zoning.genetic import population_for
from strategies.zoning.loads_and_transfers import connected, find_loads
from strategies.zoning.zone_workspace import (
    DRAWS_GENETIC,
    typical_distance,
    zone_rules,
)


def test_phase_1_gives_every_station_a_zone() -> None:
    _, _, roads = factory()
    design, workspace = design_arrays(roads, 3), scratch(roads, 3)
    assert first_design(roads, training_flow(), design, workspace)
    check_partition(roads, design)


def improved(design: Design, seed: int) -> float:
    _, _, roads = factory()
    workspace, rules, flow = scratch(roads, 3), factory_rules(roads), training_flow()
    svp = annealing.improve(roads, rules, flow, *ANNEALED, design, workspace, np.uint64(seed), 0)
    assert find_loads(roads, rules, flow, 0, design, workspace) == svp
    check_partition(roads, design)
    return float(svp)


@pytest.mark.parametrize("seed", range(8))
def test_phase_2_balances_what_phase_1_began(seed: int) -> None:
    """An independent event-level program of the same rules ends at 0.007 to 0.04."""
    _, _, roads = factory()
    design = design_arrays(roads, 3)
    first_design(roads, training_flow(), design, scratch(roads, 3))
    assert 0.0067 < improved(design, seed) < 0.04


def test_phase_2_balances_most_random_designs() -> None:
    """Some begin with a zone that holds all the ways around the others: there it gets stuck."""
    _, _, roads = factory()
    found = []
    for seed in range(40):
        design = design_arrays(roads, 3)
        assert random_design(
            roads, factory_rules(roads), design, scratch(roads, 3), np.uint64(seed), 0
        )
        found.append(improved(design, seed))
    assert min(found) > 0.0067 and np.median(found) < 0.04
    assert np.mean(np.array(found) < 0.04) > 0.7


def test_a_repair_depends_on_its_seed_and_tick_alone() -> None:
    first, again, other = (repaired(training_flow(), 3, seed)[1] for seed in (4, 4, 5))
    assert first.zone.tolist() == again.zone.tolist() != other.zone.tolist()


@given(st.integers(0, 2**32), st.integers(2, 5))
def test_repairs_of_any_flow_are_partitions(seed: int, zones: int) -> None:
    _, _, roads = factory()
    flow = np.random.default_rng(seed).integers(0, 5, (18, 18)).astype(float)
    done, design = repaired(flow, zones, seed)
    if done:
        check_partition(roads, design)
        assert connected(design, scratch(roads, zones))


COMB = """
    1.#3.#5.#7.
    .##.##.##.#
    ...........
    .##.##.##.#
    2.#4.#6.#8.
"""


def test_zones_too_far_apart_to_be_adjacent_are_joined() -> None:
    """By the rule for other floors, stations of two teeth are not adjacent."""
    _, roads = drawn(COMB)
    rules = zone_rules(FEET_PER_MINUTE / 2.5, typical_distance(roads.between))
    design, workspace, reach = design_arrays(roads, 4), scratch(roads, 4), everyone(4)
    flow = 1.0 - np.eye(8)
    for seed in range(6):
        assert annealing.repair(
            *(roads, rules, flow, *ANNEALED, annealing.MAX_REPAIRS),
            *(design, workspace, reach, np.uint64(seed), 0),
        )
        check_partition(roads, design)
        assert connected(design, workspace)


def test_first_zones_of_a_station_each() -> None:
    _, roads = drawn(COMB)
    rules = zone_rules(FEET_PER_MINUTE / 2.5, typical_distance(roads.between))
    design, workspace, reach = design_arrays(roads, 8), scratch(roads, 8), everyone(8)
    assert annealing.first_zones(
        roads, rules, *ANNEALED, 0, design, workspace, reach, np.uint64(1), 0
    )
    check_partition(roads, design)
    assert sorted(design.zone) == list(range(8)) and connected(design, workspace)


def test_annealing_ends_when_nothing_can_be_given() -> None:
    floor_plan, roads = drawn("1...2")
    design = read_design(floor_plan, roads, {"zones": [{"stations": [1]}, {"stations": [2]}]})
    rules, workspace = zone_rules(4, adjacent=9), scratch(roads, 2)
    svp = annealing.improve(
        roads, rules, np.zeros((2, 2)), *ANNEALED, design, workspace, np.uint64(1), 0
    )
    assert svp == 0 and design.zone.tolist() == [0, 1]


def test_breeding_ends_where_no_zone_has_a_station_to_give() -> None:
    """Each has one; mutation has nothing to try, and no child is born."""
    _, roads = drawn(COMB)
    rules = zone_rules(FEET_PER_MINUTE / 2.5, typical_distance(roads.between))
    design, workspace, herd = design_arrays(roads, 8), scratch(roads, 8), population_for(roads, 12)
    limits = (20, *BRED)
    flow = 1.0 - np.eye(8)
    genetic.evolve(
        roads, rules, flow, *limits, herd, design, workspace, everyone(8), np.uint64(1), 0
    )
    assert workspace.drawn - DRAWS_GENETIC < 4_000_000, (
        "500 tries to mutate each child are 36 million"
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_dozen_generations_find_a_balanced_design(seed: int) -> None:
    _, _, roads = factory()
    herd, workspace = population_for(roads, 30), scratch(roads, 3)
    design, rules = design_arrays(roads, 3), factory_rules(roads)
    limits = (12, *BRED)
    flow = training_flow()
    assert genetic.evolve(
        roads, rules, flow, *limits, herd, design, workspace, everyone(3), np.uint64(seed), 0
    )
    assert herd.now.value[-1] < 0.05  # with what drives past tips
    check_partition(roads, design)


def test_evolution_depends_on_its_seed_and_tick_alone() -> None:
    first, again, other = (evolved(training_flow(), seed).zone.tolist() for seed in (2, 2, 0))
    assert first == again != other


@given(st.integers(0, 2**32))
def test_evolved_designs_are_partitions(seed: int) -> None:
    _, _, roads = factory()
    flow = np.random.default_rng(seed).integers(0, 3, (18, 18)).astype(float)
    check_partition(roads, evolved(flow, seed, generations=2, individuals=6))


@pytest.fixture
def busy() -> dict[str, Any]:
    return south()


def test_a_turn_never_ends_worse_than_it_began(busy: dict[str, Any]) -> None:
    parts, workspace = busy["parts"], busy["workspace"]
    negotiation.loads_of_queues(
        *(busy[name] for name in ("roads", "rules", "design", "workspace")),
        *(parts, parts.zone, parts.stop, busy["reach"]),
    )
    mean = float(workspace.load.mean())
    sigma = float(workspace.load.std())
    sizes = [len(zone) for zone in stations(busy["design"])]
    best = turn(busy, 2, mean, seed=1)
    assert best < sigma
    check_partition(busy["roads"], busy["design"])
    assert connected(busy["design"], workspace)
    assert [len(zone) for zone in stations(busy["design"])] != sizes


def test_after_a_turn_parts_are_queued_by_the_new_design(busy: dict[str, Any]) -> None:
    turn(busy, 2, 20.0, seed=3)
    parts, design = busy["parts"], busy["design"]
    for k in range(int(parts.count)):
        if parts.stop[k] != parts.to[k]:
            assert design.transfer[parts.zone[k], :, parts.stop[k]].any()


def test_a_part_in_hand_keeps_its_robot(busy: dict[str, Any]) -> None:
    parts = busy["parts"]
    parts.carried[0] = 1
    before = (int(parts.zone[0]), int(parts.stop[0]))
    turn(busy, 2, 20.0, seed=3)
    assert (int(parts.zone[0]), int(parts.stop[0])) == before


def test_a_leader_without_neighbours_changes_nothing(busy: dict[str, Any]) -> None:
    busy["reach"] = np.array([0, 0, 1], np.uint8)
    before = stations(busy["design"])
    turn(busy, 2, 20.0, seed=3)
    assert stations(busy["design"]) == before


def test_a_turn_leaves_zones_out_of_reach_alone(busy: dict[str, Any]) -> None:
    busy["reach"] = np.array([1, 0, 1], np.uint8)
    before = stations(busy["design"])[1]
    turn(busy, 2, 20.0, seed=3)
    assert stations(busy["design"])[1] == before


def test_exp_and_ln_are_right_to_the_last_digits() -> None:
    for x in np.linspace(-40, 0, 401).tolist():
        assert exponential(x) == pytest.approx(math.exp(x), rel=1e-14)
    for x in (0.01, 0.0667, 0.5, 0.75, 1.0, 1.5, 2.0, 1000.0):
        assert logarithm(x) == pytest.approx(math.log(x), rel=1e-14, abs=1e-16)
    assert exponential(-1e9) == 0


def test_the_temperature_falls_from_hot_to_cold() -> None:
    assert temperature(4.5, 0.35, 500, 0) == 4.5
    assert temperature(4.5, 0.35, 500, 250) == pytest.approx(math.sqrt(4.5 * 0.35))
    assert temperature(4.5, 0.35, 500, 500) == pytest.approx(0.35)


TOLD = """
import sys
sys.path.insert(0, "tests/helpers")
from zoning_scenes import training_flow
from zoning_trials import evolved, repaired, south, turn
flow = training_flow()
print(repaired(flow, 3, 7)[1].zone.tolist(), evolved(flow, 7, 1, 4).zone.tolist())
scene = south()
print(turn(scene, 2, 20.0, 3).hex(), scene["design"].zone.tolist())
"""


def test_with_the_jit_off_everything_is_the_same() -> None:
    compiled, plain = (
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", TOLD],
            env=os.environ | {"NUMBA_DISABLE_JIT": jit},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for jit in ("0", "1")
    )
    assert compiled == plain != ""


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_seeds_reach_kernels_from_python_as_they_do_from_kernels() -> None:
    """With int64 besides uint64, all that zones are made by would be compiled twice."""
    bred = "strategy.zoning={name: genetic, design: factory-logged, generations: 2}"
    for settings in ((), (bred,)):
        Simulation(resolve("factory", settings)).run(until=9000)
    for kernel in (annealing.repair, genetic.evolve):
        assert {str(arguments[-2]) for arguments in kernel.signatures} == {"uint64"}
