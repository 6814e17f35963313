"""Warn about gates that are legal but keep robots from what they need."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from automaton.engine.facilities import GATE_CLOSING
from automaton.floor.cells import CHARGER
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.reachability import Mask, reached
from automaton.scenario.changing_floor import Lift
from automaton.world.gate_cells import Gate, cells_of, gates_of, mouths_of, moves_between, shares
from automaton.world.resolve import Resolved

MAX_GATES = 100  # of which each one is looked at alone
FULL = 100 + 1e-9  # percent of a battery


def gate_warnings(resolved: Resolved) -> list[str]:
    """Return sentences about the first lift that empties batteries, and the only way to chargers."""
    return [*dear_rides(resolved), *gated_chargers(resolved)]


def dear_rides(resolved: Resolved) -> list[str]:
    """Return a sentence for the first lift that takes more from a battery than it holds."""
    for gate in gates_of(resolved.scenario.floor):
        if not isinstance(gate.section, Lift):
            continue
        shaft = cells_of(gate, resolved.floor_plan)
        ticks, how = longest_ride(gate.section, shaft, resolved.floor_plan)
        for one in resolved.fleet.types:
            if one.battery is None:
                continue
            drain, robots = (
                one.battery.drain,
                f"robots of type {one.name}" if one.name else "robots",
            )
            for factor, load in ((1.0, ""), (drain.loaded_factor, " with a load")):
                price = drain.move * factor * ticks
                if price > FULL:
                    taken = f"{gate.name} takes {price:,.6g} % of a battery {how}"
                    return [f"{taken}, more than it holds: {robots}{load} run empty in it"]
    return []


def longest_ride(lift: Lift, shaft: list[int], floor_plan: FloorPlan) -> tuple[int, str]:
    """The most ticks of moves in a lift without a charger on the way, and from where to where."""
    mouths = mouths_of(shaft, floor_plan)
    if any(floor_plan.kind.flat[cell] == CHARGER for cell in set(shaft) - set(mouths)):
        moves = moves_between(shaft, mouths)
        return max(shares(lift.travel_time, count)[1] for count in moves), "in one move"
    return lift.travel_time, "from one mouth to the next"


def gated_chargers(resolved: Resolved) -> list[str]:
    """Return a sentence for the first door, block or lift on the only way to a charger."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    gates = [gate for gate in gates_of(scenario.floor) if gate.kind != GATE_CLOSING]
    if scenario.battery is None or not gates or not (floor_plan.kind == CHARGER).any():
        return []
    everywhere = reach_chargers(resolved, ())
    chargers = set(np.flatnonzero(floor_plan.kind == CHARGER).tolist())
    gated = [cells_of(gate, floor_plan) for gate in gates]
    gated = [[] if set(cells) <= chargers else cells for cells in gated]  # it is the charger's line
    inside = sorted({cell for cells in gated for cell in cells})
    if not is_cut_off(everywhere, reach_chargers(resolved, inside), inside):
        return []
    for gate, cells in list(zip(gates, gated, strict=True))[:MAX_GATES]:
        if is_cut_off(everywhere, reach_chargers(resolved, cells), cells):
            return [sentence_about(gate)]
    return [
        "doors, blocks and lifts are on all ways to a charger: robots may run empty before them"
    ]


def sentence_about(gate: Gate) -> str:
    """The warning about one gate."""
    return (
        f"{gate.name} is on the only way to a charger: robots may run empty while they wait for it"
    )


def reach_chargers(resolved: Resolved, closed: Iterable[int]) -> Mask:
    """(k, C) bool: cells from which robots get to a charger without these cells, on rails or not."""
    floor_plan, cells = resolved.floor_plan, np.array(list(closed), np.int64)
    exits = floor_plan.exits.copy()
    exits.reshape(-1)[cells] = 0
    chargers = np.setdiff1d(np.flatnonzero(floor_plan.kind == CHARGER), cells)
    ways, plan = sorted({one.rail for one in resolved.fleet.types}), floor_plan.with_exits(exits)
    if not len(chargers):
        return np.zeros((len(ways), exits.size), np.bool_)
    return np.stack([reached(plan, chargers.tolist(), rail, backwards=True) for rail in ways])


def is_cut_off(before: Mask, after: Mask, inside: Iterable[int]) -> bool:
    """Whether a cell outside of these is cut off from all chargers."""
    lost = before & ~after
    lost[:, np.array(list(inside), np.int64)] = False
    return bool(lost.any())
