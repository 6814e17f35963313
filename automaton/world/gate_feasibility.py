"""Whether gates fit the floor: where their cells are, and how many robots begin in them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from automaton.engine.facilities import GATE_BLOCK, GATE_LIFT
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.changing_floor import Block, Lift
from automaton.scenario.document import Document
from automaton.scenario.schema import MAX_MOVE_TICKS, Scenario
from automaton.units import ticks_and_time, unit
from automaton.world.closings import find_too_many_closings
from automaton.world.gate_cells import (
    CELL_KEYS,
    Gate,
    cells_of,
    gates_of,
    mouths_of,
    moves_between,
    shares,
)

Cells = npt.NDArray[Any]


def check_gates(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """Gates lie on the floor, shafts are paths and share no cells. Raises InputError."""
    owner: dict[int, Gate] = {}
    for gate in gates_of(scenario.floor):
        try:
            cells = cells_of(gate, floor_plan)
            if isinstance(gate.section, Lift):
                check_lift(gate, gate.section, cells, floor_plan, owner, scenario)
        except InputError as error:
            raise document.error((*gate.keys, CELL_KEYS[gate.kind]), error.message) from None
        if isinstance(gate.section, Lift):
            check_shares(document, gate, gate.section, moves_of(cells, floor_plan))
    if too_many := find_too_many_closings(scenario):
        gate, text = too_many
        raise document.error((*gate.keys, CELL_KEYS[gate.kind]), text)
    for name, level in scenario.floor.levels.items():
        for key, (x, y) in (("from", level.first), ("to", level.last)):
            if not floor_plan.holds(x, y):
                text = f"the corner [{x}, {y}] of the level {name} lies outside the floor"
                raise document.error(("floor", "levels", name, key), f"{text} {floor_plan.extent}")


def check_lift(
    gate: Gate,
    lift: Lift,
    shaft: list[int],
    floor_plan: FloorPlan,
    owner: dict[int, Gate],
    scenario: Scenario,
) -> None:
    """A lift has mouths at both ends, and its cells for itself. Raises InputError, without its place."""
    for cell in shaft:
        x, y = floor_plan.xy(cell)
        if cell in owner:
            raise InputError(f"{gate.name} and {owner[cell].name} both have the cell [{x}, {y}]")
        owner[cell] = gate
    mouths = mouths_of(shaft, floor_plan)
    for end in (shaft[0], shaft[-1]):
        if end not in mouths:
            x, y = floor_plan.xy(end)
            raise InputError(f"{gate.name} has no way out at its end [{x}, {y}]")
    if len(mouths) < 2:
        raise InputError(f"{gate.name} has one cell alone; a lift has a mouth at each end")
    most = max(moves_between(shaft, mouths))
    if lift.travel_time < most:
        tick = unit(scenario.units.tick)
        raise InputError(
            f"{gate.name} takes {ticks_and_time(lift.travel_time, tick)} from one mouth to the next "
            f"(travel_time), less than the {most} moves between them"
        )


def moves_of(shaft: list[int], floor_plan: FloorPlan) -> list[int]:
    """How many moves it takes from each mouth of a shaft to the next one."""
    return moves_between(shaft, mouths_of(shaft, floor_plan))


def check_shares(document: Document, gate: Gate, lift: Lift, moves: list[int]) -> None:
    """No move in a lift takes more ticks than a move may. Raises InputError."""
    most = max(shares(lift.travel_time, count)[1] for count in moves)
    if most > MAX_MOVE_TICKS:
        raise document.error(
            (*gate.keys, "travel_time"),
            f"a move in {gate.name} takes {most:,} ticks, its share of travel_time; "
            f"at most {MAX_MOVE_TICKS:,} are allowed",
        )


def cells_to_start(scenario: Scenario, floor_plan: FloorPlan, cells: Cells) -> Cells:
    """Those of a list of flat cells, in its order, in which robots may begin, one in each.

    No cell of a lift's shaft, and of a block no more than it holds.
    """
    is_open = np.ones(len(cells), np.bool_)
    for gate in gates_of(scenario.floor):
        if gate.kind in (GATE_BLOCK, GATE_LIFT):
            inside = np.flatnonzero(is_open & np.isin(cells, cells_of(gate, floor_plan)))
            most = gate.section.max_robots if isinstance(gate.section, Block) else 0
            is_open[inside[most:]] = False
    return cells[is_open]


def check_homes(
    scenario: Scenario, floor_plan: FloorPlan, homes: Iterable[int], *barred: int
) -> None:
    """No robot begins or parks in a gate of a kind that is barred. Raises InputError."""
    for gate in gates_of(scenario.floor):
        if gate.kind in barred:
            for cell in sorted({*homes} & {*cells_of(gate, floor_plan)}):
                x, y = floor_plan.xy(cell)
                raise InputError(f"a robot would begin or park at [{x}, {y}], in {gate.name}")


def check_starts_at_gates(scenario: Scenario, floor_plan: FloorPlan, starts: list[int]) -> None:
    """No more robots begin in a block than it holds. Raises InputError.

    `starts`: the flat cells of robots that begin on the floor.
    """
    for gate in gates_of(scenario.floor):
        if not isinstance(gate.section, Block):
            continue
        cells, most = set(cells_of(gate, floor_plan)), gate.section.max_robots
        count = sum(cell in cells for cell in starts)
        if count > most:
            robots = "robots begin" if count > 1 else "robot begins"
            raise InputError(f"{count} {robots} in {gate.name}, which holds {most}")
