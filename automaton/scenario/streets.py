"""Streets: weights of moves, which guide robots, and moves that are closed.

    x,y,east,south,west,north,wait      streets: {preset: crisscross}
    12,0,0.5,,1,,                       streets: {file: streets.csv, scale: mean}
    12,1,closed,,0.5,,2                 streets: [{row: 12, east: 0.5, west: closed}]

A weight multiplies the cost of a move where a way is chosen, never the ticks of the move; `wait` is the
weight of a tick of waiting.
"""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError, InvalidValueError, Keys
from automaton.floor.floor_plan import DIRECTIONS, FloorPlan
from automaton.scenario.changing_floor import (
    CLOSED_MOVE,
    MOST_WEIGHT,
    Street,
    StreetPlan,
    cells_of_path,
    cells_of_set,
)
from automaton.scenario.changing_floor import Streets as Streets

STREETS: Final[Keys] = ("streets",)
UNIT: Final = 100  # weights are multiples of 1 / UNIT
Weights = NDArray[np.int32]


def hundredths(weight: float) -> int:
    """A weight in 1 / UNIT, half up, at least one unless it is 0."""
    rounded = math.floor(weight * UNIT + 0.5)
    return max(rounded, 1) if weight > 0 else rounded


class StreetWeights:
    """The weights of the moves of a floor, in 1 / UNIT, and of waiting; closed moves."""

    def __init__(self, floor_plan: FloorPlan, is_closed: bool = False) -> None:
        """`is_closed`: the floor is without its closed moves already, as that of a recording."""
        self.is_closed = is_closed
        cells = floor_plan.kind.size
        self.floor_plan = floor_plan
        self.exits = floor_plan.exits.reshape(-1)
        self.moves: Weights = np.full((cells, 4), UNIT, np.int32)
        self.waits: Weights = np.full(cells, UNIT, np.int32)
        self.closed = np.zeros((cells, 4), np.bool_)
        self.closed_by: dict[tuple[int, int], Keys] = {}

    def set_move(
        self, cell: int, direction: int, weight: float | str, keys: Keys = STREETS
    ) -> bool:
        """Set the weight of a move, or close it; False if the floor has no such move."""
        if not self.is_closed and not self.exits[cell] >> direction & 1:
            return False
        self.closed[cell, direction] = weight == CLOSED_MOVE
        if isinstance(weight, str):
            self.closed_by[cell, direction] = keys
        else:
            self.moves[cell, direction] = hundredths(weight)
        return True

    def scale(self, factor: float | str) -> None:
        """Multiply all weights; "mean": such that the mean over all moves becomes 1."""
        exits = self.open_moves()
        if factor == "mean":
            mean = float(self.moves[exits].mean()) / UNIT if exits.any() else 1.0
            factor = 1.0 / mean
        if factor == 1.0:
            return
        for weights, least in ((self.moves, 1), (self.waits, 0)):
            scaled = np.floor(weights * float(factor) + 0.5)
            weights[:] = np.clip(scaled, least, MOST_WEIGHT * UNIT)

    def open_moves(self) -> NDArray[np.bool_]:
        """(cells, 4) the moves that the floor has, without closed ones."""
        bits = (self.exits[:, None] >> np.arange(4, dtype=np.uint8)) & 1
        exits: NDArray[np.bool_] = (bits > 0) & ~self.closed
        return exits

    def floor(self) -> FloorPlan:
        """The floor with these weights, and without closed exits; no arrays if all weights are 1."""
        shut = (self.closed << np.arange(4)).sum(axis=1).astype(np.uint8)
        floor_plan = self.floor_plan
        if shut.any():
            exits = (self.exits & ~shut).reshape(floor_plan.exits.shape)
            floor_plan = floor_plan.with_exits(exits)
        moves = np.where(self.open_moves(), self.moves, UNIT).astype(np.int32)
        waits = np.where(floor_plan.drivable.reshape(-1), self.waits, UNIT).astype(np.int32)
        return floor_plan.with_weights(moves, waits)


# The streets of a scenario on its floor.


def streets_on(
    floor_plan: FloorPlan, streets: Streets | None, is_closed: bool = False
) -> StreetWeights:
    """The weights of a scenario without a file. Raises InvalidValueError."""
    weights = StreetWeights(floor_plan, is_closed)
    if isinstance(streets, StreetPlan):
        enter_crisscross(weights, streets)
        weights.scale(streets.scale)
        return weights
    for number, street in enumerate(streets or ()):
        keys: Keys = (*STREETS, number)
        try:
            enter_street(weights, street, f"street {number + 1}", keys)
        except InputError as error:
            if isinstance(error, InvalidValueError):
                raise
            raise InvalidValueError(keys, error.message) from None
    return weights


def crisscross_on(floor_plan: FloorPlan, phase: tuple[int, int]) -> StreetWeights:
    """The weights of the crisscross pattern with a phase."""
    return streets_on(floor_plan, StreetPlan(preset="crisscross", phase=phase))


def enter_crisscross(weights: StreetWeights, plan: StreetPlan) -> None:
    """Rows run east and west in turn, columns south and north."""
    floor_plan = weights.floor_plan
    for cell in np.flatnonzero(floor_plan.drivable).tolist():
        x, y = floor_plan.xy(cell)
        runs = ((y + plan.phase[0]) % 2 * 2, 1 if (x + plan.phase[1]) % 2 else 3)
        for direction in range(4):
            weight = plan.along if direction in runs else plan.against
            weights.set_move(cell, direction, 1.0 if weight is None else weight)
        weights.waits[cell] = hundredths(plan.wait)


def enter_street(weights: StreetWeights, street: Street, name: str, keys: Keys) -> None:
    """Enter the weights of a street. Raises InputError."""
    floor_plan = weights.floor_plan
    cells = cells_of_street(street, name, floor_plan)
    if street.path is not None:
        enter_path(weights, street, cells, name, keys)
    for direction, way in enumerate(DIRECTIONS):
        weight = getattr(street, way)
        if weight is None:
            continue
        met = [weights.set_move(cell, direction, weight, keys) for cell in cells]
        if not any(met):
            raise InvalidValueError(
                (*keys, way), f"{name} has {way}, but no robot can move {way} from its cells"
            )
    if street.wait is not None:
        weights.waits[cells] = hundredths(street.wait)


def cells_of_street(street: Street, name: str, floor_plan: FloorPlan) -> list[int]:
    """The flat cells of a street. Raises InputError."""
    if street.at is not None:
        cells = cells_of_set(name, (street.at,), floor_plan)
        if not floor_plan.drivable.flat[cells[0]]:
            x, y = street.at
            kind = floor_plan.kind_of(cells[0]).name
            raise InputError(f"{name} has the cell [{x}, {y}], a {kind}; robots do not drive there")
        return cells
    if street.path is not None:
        cells_of_set(name, street.path, floor_plan)
        return cells_of_path(name, street.path, floor_plan)
    if street.area is not None:
        return cells_of_set(name, street.area, floor_plan)
    if street.row is not None:
        first, last = street.columns or (0, floor_plan.width - 1)
        corners = ((first, street.row), (last, street.row))
    else:
        first, last = street.rows or (0, floor_plan.height - 1)
        corners = ((street.column or 0, first), (street.column or 0, last))
    return cells_of_set(name, corners, floor_plan)


def enter_path(
    weights: StreetWeights, street: Street, cells: list[int], name: str, keys: Keys
) -> None:
    """Enter the weights along a path, and back. Raises InputError for a move that the floor lacks."""
    floor_plan = weights.floor_plan
    for here, after in itertools.pairwise(cells):
        direction = floor_plan.offsets.index(after - here)
        ways = ((here, direction, street.there), (after, direction ^ 2, street.back))
        for cell, way, weight in ways:
            if weight is not None and not weights.set_move(cell, way, weight, keys):
                x, y = floor_plan.xy(cell)
                raise InputError(
                    f"{name} goes {DIRECTIONS[way]} from [{x}, {y}], where no robot can move so"
                )
