"""Which arrays are the state of a run, and how it is carried from one simulation to another.

Left out are the static ones, scratch, and what belongs to the buffers of one simulation.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from automaton.engine.observation import BUFFERS, Observation
from automaton.engine.state import (
    CLOCK_CHANGE_ROWS,
    CLOCK_DECISION_WORDS,
    CLOCK_DIGEST_EVERY,
    CLOCK_OBSERVING,
    CLOCK_RECORDED_TICKS,
    CLOCK_RECORDING,
    CLOCK_STOP_TICK,
    NIL,
    Array,
    World,
)

OF_THE_BUFFERS: Final = (
    CLOCK_STOP_TICK,
    CLOCK_RECORDING,
    CLOCK_RECORDED_TICKS,
    CLOCK_CHANGE_ROWS,
    CLOCK_DECISION_WORDS,
    CLOCK_DIGEST_EVERY,
    CLOCK_OBSERVING,
)
STATIC: Final = ("identity", "at_index", "type", "bay", "route", "order_queue")
PARTS: Final = ("robots", "orders", "slots", "stations", "service_zones", "tally")
NOT_CARRIED: Final = {
    "robots": STATIC,
    "orders": ("source", "target", "weight"),
    "slots": ("first_spare", "reachable"),
    "stations": (
        "at",
        "slot",
        "part_arrivals",
        "station",
        "processing_time",
        "part",
        "releases_order",
        "job_of_order",
    ),
    "service_zones": ("roads", "design", "accessible", "has_priority"),
    "tally": (),
}


def state_arrays(world: World, observation: Observation) -> Iterator[tuple[str, Array]]:
    """The arrays of the state and of its observation by name; routes, plans and the clock aside."""
    for part in PARTS:
        struct = getattr(world, part)
        for name in struct._fields:
            if name not in NOT_CARRIED[part]:
                yield f"{part}.{name}", getattr(struct, name)
    for name in world.service_zones.design._fields:
        yield f"service_zones.design.{name}", getattr(world.service_zones.design, name)
    yield "traffic.occupancy", world.traffic.occupancy
    for name in observation._fields:
        if name not in (*BUFFERS, "scratch"):
            yield f"observation.{name}", getattr(observation, name)


def copy_clock(to: Array, since: Array) -> None:
    """Copy the entries of a clock that belong to the state."""
    kept = to[list(OF_THE_BUFFERS)]
    to[:] = since
    to[list(OF_THE_BUFFERS)] = kept


def take_over(
    world: World, observation: Observation, other_world: World, other_observation: Observation
) -> None:
    """Copy the state of another run of the same floor, fleet and orders, and its observation."""
    theirs = dict(state_arrays(other_world, other_observation))
    for name, array in state_arrays(world, observation):
        if array.shape == theirs[name].shape:  # an unobserved simulation has no observation
            np.copyto(array, theirs[name])
    if not world.rules.slowdown:
        observation.slow_zone[:] = NIL  # a branch may have switched it off
    np.copyto(world.robots.route, other_world.robots.route)
    np.copyto(world.robots.order_queue, other_world.robots.order_queue)
    copy_clock(world.clock, other_world.clock)
