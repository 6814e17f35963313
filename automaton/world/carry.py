"""Which arrays are the state of a run, and how it is carried from one simulation to another.

Left out are the static ones, scratch, and what belongs to the buffers of one simulation.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from automaton.world.state import (
    CHANGED,
    DECIDED,
    DIGEST_EVERY,
    NIL,
    OBSERVING,
    RECORDED,
    RECORDING,
    UNTIL,
    Array,
    World,
)
from automaton.world.waiting import BUFFERS, Observation

if TYPE_CHECKING:
    from automaton.simulation import Simulation

OF_THE_BUFFERS: Final = (UNTIL, RECORDING, RECORDED, CHANGED, DECIDED, DIGEST_EVERY, OBSERVING)
STATIC: Final = ("identity", "at_index", "type", "bay", "route", "plan")
PARTS: Final = ("robots", "orders", "slots", "stations", "zoning", "tally")
NOT_CARRIED: Final = {
    "robots": STATIC,
    "orders": ("source", "target", "weight"),
    "slots": ("spare", "within"),
    "stations": ("at", "slot", "entering", "station", "ticks", "part", "frees", "arrives"),
    "zoning": ("roads", "design", "serves", "first"),
    "tally": (),
}


def state_arrays(world: World, watch: Observation) -> Iterator[tuple[str, Array]]:
    """The arrays of the state and of its observation by name; routes, plans and the clock aside."""
    for part in PARTS:
        struct = getattr(world, part)
        for name in struct._fields:
            if name not in NOT_CARRIED[part]:
                yield f"{part}.{name}", getattr(struct, name)
    for name in world.zoning.design._fields:
        yield f"zoning.design.{name}", getattr(world.zoning.design, name)
    yield "traffic.occupancy", world.traffic.occupancy
    for name in watch._fields:
        if name not in (*BUFFERS, "scratch"):
            yield f"watch.{name}", getattr(watch, name)


def copy_clock(to: Array, since: Array) -> None:
    """Copy the entries of a clock that belong to the state."""
    kept = to[list(OF_THE_BUFFERS)]
    to[:] = since
    to[list(OF_THE_BUFFERS)] = kept


def take_over(world: World, watch: Observation, before: Simulation) -> None:
    """Copy the state of another simulation of the same floor, fleet and orders."""
    theirs = dict(state_arrays(before.world, before.watch))
    for name, array in state_arrays(world, watch):
        if array.shape == theirs[name].shape:  # an unobserved simulation has no observation
            np.copyto(array, theirs[name])
    if not world.rules.slowdown:
        watch.slow_zone[:] = NIL  # a branch may have switched it off
    np.copyto(world.robots.route, before.world.robots.route)
    np.copyto(world.robots.plan, before.world.robots.plan)
    copy_clock(world.clock, before.world.clock)
