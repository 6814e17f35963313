"""Warn about gates that are legal but keep robots from what they need."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from automaton.build.gate_cells import Gate, cells_of, gates_of
from automaton.build.resolve import Resolved
from automaton.engine.gates import GATE_CLOSING
from automaton.floor.cells import CHARGER
from automaton.floor.reachability import Mask, reached

MAX_GATES = 100  # of which each one is looked at alone


def gate_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence for the first door, block or lift on the only way to a charger."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    gates = [gate for gate in gates_of(scenario.floor) if gate.kind != GATE_CLOSING]
    if scenario.battery is None or not gates or not (floor_plan.kind == CHARGER).any():
        return []
    everywhere = reach_chargers(resolved, ())
    gated = [cells_of(gate, floor_plan) for gate in gates]
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
    """(C,) bool: cells from which robots get to a charger without these cells."""
    floor_plan, cells = resolved.floor_plan, np.array(list(closed), np.int64)
    exits = floor_plan.exits.copy()
    exits.reshape(-1)[cells] = 0
    chargers = np.setdiff1d(np.flatnonzero(floor_plan.kind == CHARGER), cells)
    rail = resolved.scenario.fleet.kinematics == "rail"
    if not len(chargers):
        return np.zeros(exits.size, np.bool_)
    return reached(floor_plan.with_exits(exits), chargers.tolist(), rail, backwards=True)


def is_cut_off(before: Mask, after: Mask, inside: Iterable[int]) -> bool:
    """Whether a cell outside of these is cut off from all chargers."""
    lost = before & ~after
    lost[np.array(list(inside), np.int64)] = False
    return bool(lost.any())
