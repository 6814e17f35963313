"""The bare step: every robot tries to move in a random direction, all occupancy rules apply.

Cases differ in size and density of the fleet and in storage order. Robots stored in random order
cause scattered memory access and are the harder case; other cases store robots in floor order or
use mixed capacities.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from automaton.bench.measured_kernels import random_walk, random_walk_in_spans
from automaton.bench.measurement import (
    NS_PER_ROBOT_AND_TICK,
    Measurement,
    Sample,
    cpu_seconds,
    mixed_floor,
    open_floor,
    scene,
)
from automaton.engine.state import Array, World
from automaton.floor.floor_plan import FloorPlan
from automaton.world.building import build_world
from automaton.world.starts import random_cells

WALK_SEED = 1
PRIORITIES = 8
SAMPLE_ROBOT_TICKS = 5_000_000  # of a sample: 25 to 250 ms
FEWEST_TICKS = 5


class WalkingFleet(NamedTuple):
    """A fleet on a floor."""

    robots: int
    side: int  # the floor is side x side cells
    remark: str = ""
    reading_order: bool = False  # robots stored in floor order at the start, else at random
    mixed: bool = False  # capacities 1, 2 and unlimited, 8 priorities
    spans: bool = False  # a tenth of the moves take 2 or 3 ticks
    convoy: bool = False  # robots follow those on their way out

    @property
    def name(self) -> str:
        return f"step {self.robots:,} on {self.side}x{self.side}{self.remark}"


ONE_TO_A_CELL = (
    WalkingFleet(10_000, 1000),
    WalkingFleet(100_000, 1000),
    WalkingFleet(1_000_000, 4000),
    WalkingFleet(500_000, 1000, " (half full)"),
)
WALKING_FLEETS = (
    *ONE_TO_A_CELL,
    *(
        case._replace(remark=f"{case.remark}, stored in reading order", reading_order=True)
        for case in ONE_TO_A_CELL
    ),
    WalkingFleet(100_000, 1000, ", mixed capacities, 8 priorities", mixed=True),
    WalkingFleet(100_000, 1000, ", mixed, a tenth of moves 2-3 ticks", mixed=True, spans=True),
    WalkingFleet(100_000, 1000, ", the same in convoy", mixed=True, spans=True, convoy=True),
)


def measurements() -> list[Measurement]:
    """One measurement for each case."""
    return [
        Measurement(case.name, NS_PER_ROBOT_AND_TICK, partial(prepare, case))
        for case in WALKING_FLEETS
    ]


def prepare(case: WalkingFleet) -> Sample:
    """A sampler: ns per robot and tick of the next ticks of a moving fleet."""
    world = walking_fleet(case)
    walk: Callable[[World, int, int], None] = random_walk_in_spans if case.spans else random_walk
    ticks = max(FEWEST_TICKS, SAMPLE_ROBOT_TICKS // case.robots)
    now = 0

    def sample() -> float:
        nonlocal now
        first, now = now, now + ticks
        seconds = cpu_seconds(lambda: walk(world, first, now))
        return 1e9 * seconds / (ticks * case.robots)

    return sample


def walking_fleet(case: WalkingFleet) -> World:
    """The world of a case at tick 0."""
    floor_plan = (mixed_floor if case.mixed else open_floor)(case.side, case.side)
    storage = storage_of(case, floor_plan)
    resolved = scene(floor_plan, case.robots, move=2 if case.convoy else 1)
    world, _ = build_world(resolved, WALK_SEED, storage, longest_route=1)
    if case.mixed:
        world.robots.priority[:] = world.robots.identity % PRIORITIES
    return world


def storage_of(case: WalkingFleet, floor_plan: FloorPlan) -> Array:
    """(n,) the identity stored at each index."""
    if case.reading_order:
        return np.argsort(random_cells(floor_plan, WALK_SEED)[: case.robots], kind="stable")
    return np.random.default_rng(WALK_SEED).permutation(case.robots)
