"""Floors without shelves and scenes without orders: nothing but driving."""

from __future__ import annotations

import numpy as np

from automaton.floor.cells import ALL_EXITS, FLOOR, UNLIMITED
from automaton.floor.floor_plan import FloorPlan, bordered, make_floor_plan
from automaton.scenario.schema import LAYER_NAMES, Durations, Fleet, Scenario, Stop, Strategies
from automaton.strategy import lookup
from automaton.world.resolve import Resolved, StrategyChoice

NEVER_ENDS = Stop(when="never", max_duration=2_000_000_000)
IDLE = "automaton.bench.idle_strategies:Idle"


def open_floor(width: int, height: int) -> FloorPlan:
    """Free floor, one robot to a cell."""
    kind, leave = bordered(height, width), bordered(height, width)
    kind[1:-1, 1:-1], leave[1:-1, 1:-1] = FLOOR, ALL_EXITS
    return make_floor_plan(kind, leave)


def mixed_floor(width: int, height: int) -> FloorPlan:
    """Free floor whose cells hold 1, 2 or any number of robots, each a third, at random."""
    plain = open_floor(width, height)
    capacity = bordered(height, width)
    choice = np.random.default_rng(1).choice([1, 2, UNLIMITED], (height, width))
    capacity[1:-1, 1:-1] = choice
    return make_floor_plan(plain.kind, plain.exits, capacity)


def scene(floor_plan: FloorPlan, robots: int, move: int = 1) -> Resolved:
    """Omnidirectional robots in random cells of a floor, no orders, no robot asked for decisions."""
    scenario = Scenario(
        name="bench",
        layout={},
        fleet=Fleet(robots=robots, kinematics="omni", start="random"),
        durations=Durations(move=move),
        strategy=Strategies(allocation=IDLE, right_of_way="wait"),
        stop=NEVER_ENDS,
    )
    strategies = {}
    for layer in LAYER_NAMES:
        name = getattr(scenario.strategy, layer)
        strategies[layer] = StrategyChoice(name, lookup.parameters_type(layer, name)())
    return Resolved(scenario, floor_plan, strategies, start="random", source="")
