"""The cells of gates on a floor: of closings, doors, blocks and lifts, with the keys of each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from automaton.engine.facilities import GATE_BLOCK, GATE_CLOSING, GATE_DOOR, GATE_LIFT
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.changing_floor import (
    Block,
    ChangingFloor,
    Closing,
    Door,
    Lift,
)
from automaton.scenario.document import Keys
from automaton.world.cell_sets import cells_of_set

Pair = tuple[int, int]


class Gate(NamedTuple):
    """A gate as a scenario has it."""

    kind: int  # GATE_*
    section: Closing | Door | Block | Lift
    keys: Keys  # where the scenario says so
    name: str  # in sentences about it


def gates_of(floor: ChangingFloor) -> Iterator[Gate]:
    """All gates in the sequence of their numbers."""
    for number, closing in enumerate(floor.closed):
        yield Gate(GATE_CLOSING, closing, ("floor", "closed", number), f"closing {number + 1}")
    for number, door in enumerate(floor.doors):
        yield Gate(GATE_DOOR, door, ("floor", "doors", number), f"door {number + 1}")
    for number, block in enumerate(floor.blocks):
        yield Gate(GATE_BLOCK, block, ("floor", "blocks", number), f"block {number + 1}")
    for number, lift in enumerate(floor.lifts):
        yield Gate(GATE_LIFT, lift, ("floor", "lifts", number), f"lift {number + 1}")


CELL_KEYS: Final = {GATE_CLOSING: "cells", GATE_DOOR: "at", GATE_BLOCK: "cells", GATE_LIFT: "shaft"}


def cells_of(gate: Gate, floor_plan: FloorPlan) -> list[int]:
    """The cells of a gate that robots may stand in, flat; of a path in its sequence.

    Raises InputError, without its place, for what no floor has.
    """
    section = gate.section
    if isinstance(section, Door):
        cells = cells_of_set(gate.name, (section.at,), floor_plan)
    elif isinstance(section, Lift):
        cells = cells_of_set(gate.name, section.shaft, floor_plan)
    else:
        cells = cells_of_set(gate.name, section.cells, floor_plan)
    drivable = [cell for cell in cells if floor_plan.drivable.flat[cell]]
    is_path = isinstance(section, Lift) or (
        isinstance(section, Block) and section.direction == "same"
    )
    if is_path:
        check_path(gate.name, cells, floor_plan)
    elif not drivable:
        raise InputError(f"{gate.name} has no cell in which robots can stand")
    return drivable


def check_path(name: str, cells: list[int], floor_plan: FloorPlan) -> None:
    """Robots drive from each cell of a path to the next one, or back. Raises InputError."""
    for index, cell in enumerate(cells):
        x, y = floor_plan.xy(cell)
        if not floor_plan.drivable.flat[cell]:
            kind = floor_plan.kind_of(cell).name
            raise InputError(f"{name} must be a path, but [{x}, {y}] is a cell of kind {kind}")
        if index and not are_joined(floor_plan, cells[index - 1], cell):
            u, v = floor_plan.xy(cells[index - 1])
            raise InputError(
                f"{name} must be a path, but no robot drives from [{u}, {v}] to [{x}, {y}]"
            )


def are_joined(floor_plan: FloorPlan, cell: int, other: int) -> bool:
    """Whether robots drive from one cell to another beside it, or back."""
    if other - cell not in floor_plan.offsets:
        return False
    way = floor_plan.offsets.index(other - cell)
    out, back = (
        floor_plan.exits.flat[cell] >> way & 1,
        floor_plan.exits.flat[other] >> (way ^ 2) & 1,
    )
    return bool(out or back)


def mouths_of(shaft: list[int], floor_plan: FloorPlan) -> list[int]:
    """The cells of a shaft over which robots come in or go out, in its sequence."""
    inside = set(shaft)
    return [
        cell
        for cell in shaft
        if any(
            other not in inside
            and floor_plan.drivable.flat[other]
            and are_joined(floor_plan, cell, other)
            for other in floor_plan.neighbours(cell)
        )
    ]


def moves_between(shaft: list[int], mouths: list[int]) -> list[int]:
    """How many moves it takes from each mouth to the next one."""
    places = [shaft.index(mouth) for mouth in mouths]
    return np.diff(places).tolist()


def shares(travel_ticks: int, moves: int) -> tuple[int, int]:
    """The ticks of a move from one mouth to the next, and of the last one, which takes the rest too."""
    share = travel_ticks // moves
    return share, travel_ticks - share * (moves - 1)
