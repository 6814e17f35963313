"""Warn about fleets that can never move, because a rule of the world refuses the first move.

Robots that fill cells out of which no way leads but into each other's cells form rings and files
without a gap. A full ring rotates under `convoy`, and under `handover` if its moves take one tick.
Under `none`, and under `handover` with longer moves, a first robot would have to begin, and none may.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automaton.floor.floor_plan import FloorPlan
from automaton.units import count
from automaton.world.resolve import Resolved

Mask = npt.NDArray[np.bool_]


def standstill_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence if robots stand still for ever where they begin."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    rule, least = scenario.world.following, resolved.fleet.least_move
    refuses = rule == "none" or (rule == "handover" and least >= 2)
    if not refuses or scenario.fleet.when_idle == "leave":
        return []  # robots that leave the floor make a gap
    from automaton.world.rules import may_fail  # needs Numba, as most checks do not

    if may_fail(scenario):
        return []  # so do those that are towed
    held = full_cells(floor_plan, filled_at_the_start(resolved))
    cells = int(held.sum())
    if cells < 2:
        return []
    x, y = floor_plan.xy(int(np.flatnonzero(held)[0]))
    of_moves = "" if rule == "none" else f" of moves longer than one tick (here {least:g})"
    most = count(cells - 1, "robot")
    return [
        f"stands still: {count(cells, 'robot')} fill the {count(cells, 'cell')} around [{x}, {y}], and "
        f"under world.following: {rule} a full ring{of_moves} cannot start; at most {most} "
        "can move there at all, or set world.following: convoy"
    ]


def filled_at_the_start(resolved: Resolved) -> Mask:
    """(C,) bool: cells for one robot that are held at the start, whatever the seed."""
    floor_plan, start = resolved.floor_plan, resolved.start
    drivable = floor_plan.drivable.reshape(-1)
    filled = np.zeros(drivable.size, np.bool_)
    if isinstance(start, tuple):
        filled[list(start)] = True
    elif start == "random" and resolved.scenario.fleet.robots >= drivable.sum():
        filled[drivable] = True
    single: Mask = filled & (floor_plan.capacity.reshape(-1) == 1)
    return single


def full_cells(floor_plan: FloorPlan, filled: Mask) -> Mask:
    """(C,) bool: the most filled cells whose exits, one at least, all lead into such cells."""
    exits = floor_plan.exits.reshape(-1)
    full: Mask = filled & (exits != 0)
    while True:
        leads_out = np.zeros(full.size, np.bool_)
        for direction, offset in enumerate(floor_plan.offsets):
            leads_out |= (exits >> direction & 1 != 0) & ~np.roll(full, -offset)
        if not (full & leads_out).any():
            return full
        full = full & ~leads_out
