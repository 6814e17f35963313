"""Charging as a viewer tells it: who is at a charger, who queues, and for how long."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from automaton.engine.robot_states import BATTERY_FULL, is_charging, is_queueing
from automaton.engine.state import GOAL_CHARGE, NIL, Array
from automaton.units import count, percent

if TYPE_CHECKING:  # it needs Numba, pictures do not
    from automaton.evidence.history.snapshot import Snapshot


def ticks_to_charge(charge: int, level: int, curve: Array) -> int:
    """Ticks at a charger from one charge to another, or NIL if the curve never gets there.

    `curve`: (K, 2) from this charge on, units that a tick gives; as in automaton.engine.energy.
    """
    ticks = 0
    ends = [*curve[1:, 0].tolist(), BATTERY_FULL]
    for rate, end in zip(curve[:, 1].tolist(), ends, strict=True):
        missing = min(level, end) - charge
        if missing > 0:
            if rate <= 0:
                return NIL
            ticks += -(-missing // rate)
            charge += rate * -(-missing // rate)
    return ticks


def charging_at(snapshot: Snapshot, cell: int) -> list[int]:
    """The robots that charge in a cell."""
    fleet = snapshot.robots
    robots: list[int] = np.flatnonzero(is_charging(fleet) & (fleet.cell == cell)).tolist()
    return robots


def charger_queue(snapshot: Snapshot, cell: int) -> list[int]:
    """The robots that queue before the charger in a cell, in arrival order."""
    fleet = snapshot.robots
    standing = np.flatnonzero(is_queueing(fleet) & (fleet.goal_cell == cell))
    found: list[int] = standing[np.argsort(fleet.ticket[standing])].tolist()
    return found


def sent_to(snapshot: Snapshot, cell: int) -> list[int]:
    """The robots on their way to the charger in a cell."""
    fleet = snapshot.robots
    going = (fleet.goal_type == GOAL_CHARGE) & (fleet.goal_cell == cell) & ~is_queueing(fleet)
    found: list[int] = np.flatnonzero(going & (fleet.cell != cell)).tolist()
    return found


def up_to(snapshot: Snapshot, robot: int) -> str:
    """To which charge a robot charges, and how long that still takes."""
    fleet = snapshot.robots
    charge, charge_target = int(fleet.charge[robot]), int(fleet.charge_target[robot])
    ticks = ticks_to_charge(charge, charge_target, snapshot.curve[fleet.type[robot]])
    left = "which it never reaches" if ticks == NIL else f"{count(ticks, 'tick')} to go"
    return f"up to {percent(charge_target / BATTERY_FULL, 0)}, {left}"


def queueing_words(snapshot: Snapshot, robot: int, place: str) -> str:
    """Why a robot queues before the charger at `place`."""
    cell = int(snapshot.robots.goal_cell[robot])
    standing = charger_queue(snapshot, cell)
    before = standing[: standing.index(robot)] if robot in standing else []
    there = charging_at(snapshot, cell)
    said = [f"robot {one} charges at {place} {up_to(snapshot, one)}" for one in there]
    if before:
        others = f" and {count(len(before) - 1, 'other')}" if len(before) > 1 else ""
        said.append(f"robot {before[0]}{others} came before it")
    blocker = int(snapshot.robots.blocker[robot])
    if not said and blocker != NIL:
        enters = int(snapshot.robots.claim[blocker]) == cell
        said.append(f"robot {blocker} {'drives into' if enters else 'holds'} {place}")
    return f"robot {robot} queues" + (": " if said else "") + "; ".join(said)
