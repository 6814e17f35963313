"""Zones of robots of several types: speed, areas, payload, priority."""

from __future__ import annotations

import numpy as np
import pytest
from zoning_scenes import (
    ddz_rules,
    everyone,
    factory,
    factory_rules,
    scratch,
    shipped,
    training_flow,
)
from zoning_trials import ANNEALED, BRED

from automaton.engine.facilities import Design
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve
from strategies.zoning import annealing, genetic
from strategies.zoning.design_files import design_arrays
from strategies.zoning.genetic import match, population_for
from strategies.zoning.loads_and_transfers import find_loads, find_transfers
from strategies.zoning.negotiation import lead, parts_for
from strategies.zoning.zone_workspace import ZoneSpace

NORTH = [0, 1, 2, 3]  # stations 1 to 4, closed to the robot of zone 0
METHODS = {
    "static": "{name: static, adjacency: 243.6437908496732}",
    "annealing": "{name: annealing, adjacency: 243.6437908496732}",
    "genetic": "{name: genetic, adjacency: 243.6437908496732, population: 20, generations: 8}",
    "decentralized": "{name: decentralized, adjacency: 300}",
}
SIGHT = "information={radius: 131, shape: circle, orders: zones}"


def mixed() -> ZoneSpace:
    """Scratch for three zones: robot 0 is slow, does not get to the north, is first at 8 and 11."""
    workspace = scratch(factory()[2], 3)
    workspace.serves[0, NORTH] = 0
    workspace.first[0, [7, 10]] = 1
    workspace.move_time_factor[0] = 2.0
    return workspace


def assert_served(design: Design, workspace: ZoneSpace, first: bool = True) -> None:
    """Every station is in a zone whose robot serves it, with priority where there is any."""
    zone = np.asarray(design.zone)
    assert workspace.serves[zone, np.arange(len(zone))].all()
    for a, b, station in np.argwhere(np.asarray(design.transfer) == 1):
        assert workspace.serves[a, station] and workspace.serves[b, station]
    if first:
        assert (zone[[7, 10]] == 0).all()


def made(method: str, seed: int) -> tuple[Design, ZoneSpace]:
    """Zones by a method from the flow of training."""
    roads, workspace, flow = factory()[2], mixed(), training_flow()
    design, rules = design_arrays(roads, 3), factory_rules(roads)
    if method == "annealing":
        assert annealing.repair(
            roads, rules, flow, *ANNEALED, 3, design, workspace, everyone(3), np.uint64(seed), 0
        )
    else:
        limits = (8, *BRED)
        herd = population_for(roads, 20)
        assert genetic.evolve(
            roads, rules, flow, *limits, herd, design, workspace, everyone(3), np.uint64(seed), 0
        )
    return design, workspace


# Speed.


def test_minutes_of_a_zone_are_those_of_the_robot_that_serves_it() -> None:
    roads, flow = factory()[2], training_flow()
    design, rules = shipped("factory-logged"), factory_rules(roads)
    alike, slow = scratch(roads, 3), scratch(roads, 3)
    slow.move_time_factor[1] = 3.0
    find_loads(roads, rules, flow, 0, design, alike)
    find_loads(roads, rules, flow, 0, design, slow)
    assert alike.load[0] == slow.load[0] and alike.load[2] == slow.load[2]
    inside = design.zone == 1
    handling = (rules.base + flow[np.ix_(inside, inside)].sum()) * rules.handling
    assert slow.load[1] - handling == pytest.approx(3 * (alike.load[1] - handling))


def test_a_slow_robot_gets_a_smaller_zone() -> None:
    """Mean stations of robot 0 over seeds, alike and three times as slow."""
    roads, flow = factory()[2], training_flow()
    sizes = []
    for pace in (1.0, 3.0):
        found = []
        for seed in range(8):
            design, workspace = design_arrays(roads, 3), scratch(roads, 3)
            workspace.move_time_factor[0] = pace
            annealing.repair(
                roads,
                factory_rules(roads),
                flow,
                *ANNEALED,
                3,
                design,
                workspace,
                everyone(3),
                np.uint64(seed),
                0,
            )
            find_loads(roads, factory_rules(roads), flow, 0, design, scratch(roads, 3))
            found.append(int((design.zone == 0).sum()))
        sizes.append(np.mean(found))
    assert sizes[1] < sizes[0]


# Areas and priority.


@pytest.mark.parametrize("method", ["annealing", "genetic"])
def test_zones_hold_only_stations_that_their_robots_serve(method: str) -> None:
    for seed in range(6):
        assert_served(*made(method, seed))


def test_exchanges_of_a_leader_keep_to_what_robots_serve_and_to_priority() -> None:
    """Parts from everywhere to everywhere; leaders exchange what they may, and something is exchanged."""
    roads, rules = factory()[2], ddz_rules()
    moved = 0
    for seed in range(4):
        design, workspace = made("annealing", seed)
        find_loads(roads, rules, training_flow(), 0, design, workspace)
        find_transfers(roads, rules, design, workspace, everyone(3))
        parts = parts_for(17)
        parts.count = 17
        parts.at[:], parts.to[:] = range(17), range(1, 18)
        parts.zone[:], parts.stop[:] = design.zone[:17], parts.to
        for turn in range(6):
            before = design.zone.copy()
            lead(
                roads, rules, parts, 4.5, 0.3, 20, 10.0, 0, 10,
                design, workspace, turn % 3, everyone(3), 10.0 * turn, np.uint64(seed), turn,
            )  # fmt: skip
            moved += int((design.zone != before).any())
            assert_served(design, workspace)
    assert moved


def renamed(design: Design, name: list[int]) -> None:
    """Zone z becomes zone name[z]."""
    for numbers in (design.zone, design.owner, design.held):
        numbers[numbers != NIL] = np.array(name)[numbers[numbers != NIL]]
    design.transfer[:] = 0


def test_zones_are_matched_to_robots_one_to_one_or_not_at_all() -> None:
    design, workspace = made("annealing", 1)
    renamed(design, [1, 2, 0])
    assert not workspace.serves[design.zone, np.arange(18)].all()
    assert match(design, workspace)
    assert_served(design, workspace)
    assert set(design.zone.tolist()) == {0, 1, 2}
    workspace.serves[1:, 12] = 0
    workspace.serves[0, 13] = 0
    design.zone[12] = design.zone[13] = 1  # no robot serves both
    assert not match(design, workspace)


def test_a_design_with_a_station_that_its_robot_does_not_serve_is_refused() -> None:
    with pytest.raises(InputError, match=r"station \d+ is in zone 1 .* robot 0 \(tug\) cannot"):
        zones = "{zones: [{stations: [1, 2, 3, 4, 5, 6, 7]}, {stations: [8, 9, 10, 11]}, "
        zones += "{stations: [12, 13, 14, 15, 16, 17, 18]}]}"
        Simulation(resolve("factory-types", [f"strategy.zoning={{name: static, design: {zones}}}"]))


@pytest.mark.parametrize(
    ("priority", "words"),
    [
        ("{tig: [1]}", r"the type 'tig' .*tug.*fleet.types has tug, shuttle"),
        ("{tug: [19]}", r"names station 19, but there are stations 1 to 18"),
    ],
)
def test_wrong_priorities_get_one_sentence(priority: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        resolve("factory-types", [f"strategy.zoning={{name: static, priority: {priority}}}"])


# Runs.


def day(method: str, *more: str, seed: int = 1) -> Simulation:
    """A run of factory-types to its end, by a method; nothing is illegal."""
    zoning = METHODS[method].replace("}", ", priority: {tug: [8, 11]}}")
    settings = [f"strategy.zoning={zoning}", *more, *([SIGHT] if method == "decentralized" else [])]
    simulation = Simulation(resolve("factory-types", settings), seed)
    simulation.run()
    assert simulation.finished and not simulation.world.tally.illegal.any()
    return simulation


@pytest.mark.parametrize("method", METHODS)
def test_heavy_parts_go_with_the_tug_and_the_north_without_it(method: str) -> None:
    world = day(method).world
    heavy = world.orders.weight > 10
    assert heavy.any() and (world.orders.dispatched_type[heavy] == 0).all()
    service_zones = world.service_zones
    assert service_zones.accessible[service_zones.design.zone, np.arange(18)].all()
    assert (service_zones.design.zone[[7, 10]] == 0).all(), "priority"
    assert not service_zones.accessible[0, NORTH].any()


def test_a_recorded_day_keeps_the_rules() -> None:
    resolved = resolve("factory-types")
    recorder = MemoryRecorder(resolved)
    Simulation(resolved, on_record=recorder).run(12_000)
    assert validate_stored(recorder.recording()).valid


@pytest.mark.parametrize("method", ["static", "decentralized"])
def test_the_zone_of_a_broken_tug_is_served_as_far_as_others_can(method: str) -> None:
    """Its heavy orders wait until it is back; the others of its zone do not."""
    faults = "faults={list: [{robot: 0, at: 4000}], tow_after: 100, repair_time: 9000}"
    simulation = day(method, faults)
    orders = simulation.world.orders
    heavy = orders.weight > 10
    gone = (orders.dispatched > 4300) & (orders.dispatched < 13_000)
    assert not (gone & heavy).any()
    assert (gone & ~heavy).any()


def test_orders_that_a_substitute_cannot_carry_go_to_an_able_robot() -> None:
    """Two tugs: when one breaks down, the other one gets its heavy orders, whoever gets its zone."""
    types = (
        "fleet.types=[{name: tug, robots: 2, move_time_factor: 2}, {name: shuttle, payload: 10}]"
    )
    faults = "faults={list: [{robot: 0, at: 4000}], tow_after: 100, repair_time: 9000}"
    start = "fleet.start=[[28, 128], [72, 90], [52, 0]]"
    orders = day("static", types, faults, start).world.orders
    heavy = orders.weight > 10
    taken = heavy & (orders.dispatched > 4300) & (orders.dispatched < 13_000)
    assert taken.any()


def test_of_able_robots_priority_comes_first() -> None:
    """Station 11 is in the zone of the tug, which is too weak; the type with priority there gets it."""
    types = (
        "fleet.types=[{name: crane, robots: 1}, {name: hoist, robots: 1}, {name: tug, payload: 5}]"
    )
    parts = "orders.parts=[{route: [11, 8], count: 6, weight: 25}]"
    took = {}
    for first in ("crane", "hoist"):
        zoning = (
            f"{{name: static, sharing: false, design: factory-logged, priority: {{{first}: [11]}}}}"
        )
        settings = [types, "areas={}", parts, f"strategy.zoning={zoning}"]
        simulation = Simulation(resolve("factory-types", settings))
        simulation.run()
        assert simulation.finished
        took[first] = set(simulation.world.orders.dispatched_type.tolist())
    assert took == {"crane": {0}, "hoist": {1}}
