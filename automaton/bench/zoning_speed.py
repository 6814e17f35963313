"""Redesign of zones: days in the factory of Keith & La, and single designs.

A run is 8 hours of the factory with 50 % more parts, so work lasts to the end; it includes building
the world. Growth is measured on lattices of aisles: a crossing every six cells, a station halfway
along random aisles, flow between random stations. Exponents are slopes of log time over log size.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from automaton.bench.measurement import EXPONENT, MS, Measurement, S, Sample, cpu_seconds, slope
from automaton.engine.facilities import Design, Roads, empty_design
from automaton.floor.drawn_floors import draw_floor
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.units import unit
from automaton.world.building import roads_of
from automaton.world.resolve import resolve
from strategies.zoning.annealing import MAX_REPAIRS, repair
from strategies.zoning.genetic import evolve, population_for
from strategies.zoning.zone_workspace import (
    ZoneRules,
    ZoneSpace,
    space_for,
    typical_distance,
    zone_rules,
)
from strategies.zoning.zoning_parameters import Annealing, Genetic

Array = NDArray[Any]

HOURS: Final = 8
MORE_PARTS: Final = tuple(f"orders.parts.{k}.count={n}" for k, n in enumerate((45, 45, 30, 30)))
NEGOTIATED_DDZ: Final = "strategy.zoning={name: decentralized, design: factory-ddz, adjacency: 300}"
LIMITED_VIEW: Final = "information={radius: 131, shape: circle, orders: zones}"
FACTORY_RUNS: Final = {
    "2.5 ft, SA": ("factory", ()),
    "2.5 ft, DDZ": ("factory", (NEGOTIATED_DDZ,)),
    "2.5 ft, DDZ, limited view": ("factory", (NEGOTIATED_DDZ, LIMITED_VIEW)),
    "5 ft, SA": ("factory-5ft", ()),
    "5 ft, DDZ": ("factory-5ft", (NEGOTIATED_DDZ,)),
}
LATTICE_SIZES: Final = ((18, 3), (50, 3), (200, 3), (200, 10), (200, 30))  # stations, zones
FLEETS: Final = (3, 10, 30)
FLEET_STATIONS: Final = 200
LATTICE_TICKS: Final = 5000
ZONING_KINDS: Final = ("annealing", "decentralized")
FEWEST_ZONES: Final = 3
GROWTH_REPAIRS: Final = 5  # samples of each size, which differ by their random draws
BLOCK: Final = 6  # cells between two crossings of a lattice
ROBOT_SPEED: Final = 94.48  # cells per minute
LOADS: Final = 10  # most loads between two stations
ANNEALED: Final = Annealing()
BRED: Final = Genetic()


def measurements() -> list[Measurement]:
    """Runs, one design by annealing and one by breeding, and growth."""
    found = [
        Measurement(f"{HOURS} h of the factory, {name}", S, partial(prepare_run, *how))
        for name, how in FACTORY_RUNS.items()
    ]
    found.append(Measurement("zone repair by annealing, factory", MS, prepare_repair))
    what = f"{BRED.generations} generations of {BRED.population}, factory"
    found.append(Measurement(f"zones by breeding, {what}", S, prepare_breeding, at_most=3))
    for stations, zones in LATTICE_SIZES:
        name = f"zone repair by annealing, {stations} stations, {zones} zones"
        found.append(Measurement(name, MS, partial(prepare_lattice, stations, zones), at_most=5))
    for kind in ZONING_KINDS:
        for robots in FLEETS:
            name = f"{LATTICE_TICKS:,} ticks, {FLEET_STATIONS} stations, {robots} robots, {kind}"
            prepare = partial(prepare_fleet, kind, robots)
            found.append(Measurement(name, S, prepare, at_most=3))
    return found + growth()


def growth() -> list[Measurement]:
    """Exponents: repairs by stations and by zones, a run by robots."""
    most = max(stations for stations, _ in LATTICE_SIZES)
    ways: list[tuple[str, Mapping[int, Callable[[], Sample]], int]] = [
        (
            f"a repair with the stations, {FEWEST_ZONES} zones",
            {s: partial(prepare_lattice, s, z) for s, z in LATTICE_SIZES if z == FEWEST_ZONES},
            GROWTH_REPAIRS,
        ),
        (
            f"a repair with the zones, {most} stations",
            {z: partial(prepare_lattice, s, z) for s, z in LATTICE_SIZES if s == most},
            GROWTH_REPAIRS,
        ),
    ]
    for kind in ZONING_KINDS:
        runs = {robots: partial(prepare_fleet, kind, robots) for robots in FLEETS}
        ways.append((f"{LATTICE_TICKS:,} ticks with the robots, {kind}", runs, 1))
    return [
        Measurement(f"growth of {name}", EXPONENT, partial(prepare_growth, sizes, each), at_most=3)
        for name, sizes, each in ways
    ]


def prepare_growth(sizes: Mapping[int, Callable[[], Sample]], each: int) -> Sample:
    """A sampler of the slope over all sizes, each measured `each` times."""
    samplers = {size: prepare() for size, prepare in sizes.items()}

    def sample() -> float:
        times = [sum(take() for _ in range(each)) for take in samplers.values()]
        return slope(tuple(samplers), times)

    return sample


def prepare_run(scenario: str, settings: tuple[str, ...], hours: float = HOURS) -> Sample:
    """A sampler: seconds of a run, including building the world."""
    resolved = resolve(scenario, (*settings, *MORE_PARTS))
    until = round(3600 * hours / unit(resolved.scenario.units.tick).size)
    return lambda: cpu_seconds(lambda: Simulation(resolved).run(until))


class ZoneTask(NamedTuple):
    """A zoning problem."""

    roads: Roads
    rules: ZoneRules
    flow: Array
    design: Design
    workspace: ZoneSpace
    reach: Array


def task(roads: Roads, flow: Array, zones: int) -> ZoneTask:
    """Stations with a flow between them, and no zones yet."""
    rules = zone_rules(ROBOT_SPEED, typical_distance(roads.between))
    design = empty_design(len(roads.cell), len(roads.point), zones)
    return ZoneTask(roads, rules, flow, design, space_for(roads, zones), np.ones(zones, np.uint8))


def factory() -> ZoneTask:
    """The factory with the flow of all parts."""
    resolved = resolve("factory")
    cells = resolved.floor_plan.stations
    flow = np.zeros((len(cells), len(cells)))
    for kind in resolved.scenario.orders.parts or ():
        for here, then in itertools.pairwise(kind.route):
            flow[here - 1, then - 1] += kind.count
    return task(roads_of(resolved.floor_plan, cells).read_only(), flow, 3)


def anneal(one: ZoneTask, seed: int) -> int:
    """One zone repair; 0 if it found no zones."""
    roads, rules, flow, design, workspace, reach = one
    how = ANNEALED.hot, ANNEALED.cold, ANNEALED.steps, MAX_REPAIRS
    return int(repair(roads, rules, flow, *how, design, workspace, reach, np.uint64(seed), 1))


def repairing(one: ZoneTask) -> Sample:
    """A sampler: milliseconds of a repair, each with its own random draws."""
    seeds = itertools.count(1)

    def sample() -> float:
        seed = next(seeds)
        return 1e3 * cpu_seconds(lambda: anneal(one, seed))

    return sample


def prepare_repair() -> Sample:
    """A repair in the factory."""
    return repairing(factory())


def prepare_breeding(
    generations: int = BRED.generations, individuals: int = BRED.population
) -> Sample:
    """A sampler: seconds of the genetic algorithm in the factory."""
    roads, rules, flow, design, workspace, reach = factory()
    population = population_for(roads, individuals)
    how = generations, BRED.selected, BRED.mutation, population

    def sample() -> float:
        seed = np.uint64(1)
        return cpu_seconds(
            lambda: evolve(roads, rules, flow, *how, design, workspace, reach, seed, 1)
        )

    return sample


def lattice(stations: int) -> str:
    """A drawn floor: aisles with a crossing every BLOCK cells, t for stations halfway between two."""
    lines = 2
    while 2 * lines * (lines - 1) < 1.5 * stations:
        lines += 1
    side = BLOCK * (lines - 1) + 1
    rows = [
        ["~" if x % BLOCK == 0 or y % BLOCK == 0 else "#" for x in range(side)] for y in range(side)
    ]
    half = BLOCK // 2
    places = [(x, y) for x in range(0, side, BLOCK) for y in range(half, side, BLOCK)]
    places += [(y, x) for x, y in places]
    for k in np.random.default_rng(1).permutation(len(places))[:stations].tolist():
        x, y = places[k]
        rows[y][x] = "t"
    return "\n".join(map("".join, rows))


def prepare_lattice(stations: int, zones: int) -> Sample:
    """A repair on a lattice, with LOADS loads per station in total."""
    floor_plan = draw_floor(lattice(stations))
    rng = np.random.default_rng(2)
    flow = np.zeros((stations, stations))
    for here in range(stations):
        flow[here, (here + rng.integers(1, stations)) % stations] = LOADS
    return repairing(task(roads_of(floor_plan, floor_plan.stations).read_only(), flow, zones))


def fleet(kind: str, robots: int, stations: int = FLEET_STATIONS) -> Scenario:
    """Robots on a lattice, any number per cell; parts go through five random stations."""
    rng = np.random.default_rng(3)
    routes = [(rng.permutation(stations)[:5] + 1).tolist() for _ in range(2 * robots)]
    return msgspec.convert(
        {
            "name": "lattice",
            "layout": {
                "picture": lattice(stations).replace("t", "z"),
                "legend": {"z": {"kind": "station", "capacity": 0}},
            },
            "fleet": {"robots": robots, "kinematics": "omni", "start": "random"},
            "units": {"tick": "0.635055 s", "cell": "2.5 ft"},
            "durations": {"pick": 4, "drop": 4, "handling_jitter": 8},
            "orders": {
                "parts": [{"route": route, "count": 5} for route in routes],
                "processing_time": 100,
            },
            "strategy": {"zoning": kind, "allocation": "shortest-job", "right_of_way": "wait"},
            "stop": {"when": "never", "max_duration": LATTICE_TICKS},
        },
        Scenario,
    )


def prepare_fleet(kind: str, robots: int) -> Sample:
    """A sampler: seconds of a run on a lattice."""
    resolved = resolve(fleet(kind, robots))
    return lambda: cpu_seconds(lambda: Simulation(resolved).run())
