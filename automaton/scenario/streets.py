"""Streets: weights of moves, which guide robots, and moves that are closed.

    x,y,east,south,west,north,wait      streets: {preset: crisscross}
    12,0,0.5,,1,,                       streets: {file: streets.csv, scale: mean}
    12,1,closed,,0.5,,2                 streets: [{row: 12, east: 0.5, west: closed, capacity: 2}]

A weight multiplies the cost of a move where a way is chosen, never the ticks of the move; `wait` is the
weight of a tick of waiting. `open` and `capacity` replace what the layout says about moves and cells.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError, InvalidValueError, Keys
from automaton.floor.floor_plan import (
    CELL_KINDS,
    CHARGER,
    DIRECTIONS,
    STATION,
    WEIGHT_UNIT,
    FloorPlan,
)
from automaton.scenario.changing_floor import (
    CLOSED_MOVE,
    MOST_WEIGHT,
    OPEN_MOVE,
    Rectangle,
    Street,
    StreetPlan,
    cells_of_path,
    cells_of_set,
)
from automaton.scenario.changing_floor import Streets as Streets

STREETS: Final[Keys] = ("streets",)
THEN: Final[Keys] = (*STREETS, "then")
Weights = NDArray[np.int32]


def hundredths(weight: float) -> int:
    """A weight in 1 / WEIGHT_UNIT, half up, at least one unless it is 0."""
    rounded = math.floor(weight * WEIGHT_UNIT + 0.5)
    return max(rounded, 1) if weight > 0 else rounded


class StreetWeights:
    """The weights of the moves of a floor, in 1 / WEIGHT_UNIT, and of waiting; closed moves."""

    def __init__(self, floor_plan: FloorPlan, is_closed: bool = False) -> None:
        """`is_closed`: the floor is without its closed moves already, as that of a recording."""
        self.is_closed = is_closed
        cells = floor_plan.kind.size
        self.floor_plan = floor_plan
        self.exits = floor_plan.exits.reshape(-1).copy()
        self.moves: Weights = np.full((cells, 4), WEIGHT_UNIT, np.int32)
        self.waits: Weights = np.full(cells, WEIGHT_UNIT, np.int32)
        self.closed = np.zeros((cells, 4), np.bool_)
        self.opened = np.zeros((cells, 4), np.bool_)
        self.capacity = np.zeros(cells, np.uint8)  # 0: that of the floor
        self.closed_by: dict[tuple[int, int], Keys] = {}

    def set_move(
        self, cell: int, direction: int, weight: float | str, keys: Keys = STREETS
    ) -> bool:
        """Set the weight of a move, or open or close it; False if the floor has no such move.

        A move that the floor lacks has its weight from when a later street opens it.
        """
        if weight == OPEN_MOVE and self.floor_plan.possible_exits.flat[cell] >> direction & 1:
            self.exits[cell] |= np.uint8(1 << direction)
            self.opened[cell, direction] = True
        if not isinstance(weight, str):
            self.moves[cell, direction] = hundredths(weight)
        if not self.is_closed and not self.exits[cell] >> direction & 1:
            return False
        self.closed[cell, direction] = weight == CLOSED_MOVE
        if weight == CLOSED_MOVE:
            self.closed_by[cell, direction] = keys
        return True

    @property
    def rules(self) -> NDArray[np.uint8]:
        """(cells, 9) what cannot change during a run: closed and opened moves, capacities."""
        possible = self.floor_plan.possible_exits.reshape(-1)[:, None] >> np.arange(4) & 1 > 0
        parts = (self.closed & possible, self.opened & ~self.closed, self.capacity[:, None])
        return np.concatenate([part.astype(np.uint8) for part in parts], axis=1)

    def scale(self, factor: float | str, moves: NDArray[np.bool_] | None = None) -> None:
        """Multiply all weights; "mean": such that their mean becomes 1.

        `moves`: (cells, 4) the moves over which it is the mean; None: all moves.
        """
        if factor == "mean":
            exits = self.open_moves() if moves is None else moves
            mean = float(self.moves[exits].mean()) / WEIGHT_UNIT if exits.any() else 1.0
            factor = 1.0 / mean
        if factor == 1.0:
            return
        for weights, least in ((self.moves, 1), (self.waits, 0)):
            scaled = np.floor(weights * float(factor) + 0.5)
            weights[:] = np.clip(scaled, least, MOST_WEIGHT * WEIGHT_UNIT)

    def open_moves(self) -> NDArray[np.bool_]:
        """(cells, 4) the moves that the floor has, without closed ones."""
        bits = (self.exits[:, None] >> np.arange(4, dtype=np.uint8)) & 1
        exits: NDArray[np.bool_] = (bits > 0) & ~self.closed
        return exits

    def floor(self) -> FloorPlan:
        """The floor with these weights, and without closed exits; no arrays if all weights are 1."""
        shut = (self.closed << np.arange(4)).sum(axis=1).astype(np.uint8)
        floor_plan = self.floor_plan
        exits = (self.exits & ~shut).reshape(floor_plan.exits.shape)
        if (exits != floor_plan.exits).any():
            floor_plan = floor_plan.with_exits(exits)
        if self.capacity.any() and not self.is_closed:
            capacity = self.capacity.reshape(exits.shape)
            floor_plan = floor_plan.with_capacity(np.where(capacity, capacity, floor_plan.capacity))
        moves = np.where(self.open_moves(), self.moves, WEIGHT_UNIT).astype(np.int32)
        waits = np.where(floor_plan.drivable.reshape(-1), self.waits, WEIGHT_UNIT).astype(np.int32)
        return floor_plan.with_weights(moves, waits)


# The streets of a scenario on its floor.


def street_entries(streets: Sequence[Street]) -> list[dict[str, Any]]:
    """Streets as data, without the keys that they leave out."""
    data = msgspec.to_builtins(streets)
    return [{key: value for key, value in entry.items() if value is not None} for entry in data]


def streets_on(
    floor_plan: FloorPlan, streets: Streets | None, is_closed: bool = False
) -> StreetWeights:
    """The weights of a scenario without a file. Raises InvalidValueError."""
    weights = StreetWeights(floor_plan, is_closed)
    if isinstance(streets, StreetPlan):
        enter_crisscross(weights, streets)
        moves = None
        if (
            streets.scale == "mean"
        ):  # over the moves of the floor with all streets, as recordings have it
            unscaled = msgspec.structs.replace(streets, scale=1.0)
            moves = streets_on(floor_plan, unscaled, is_closed).open_moves()
        weights.scale(streets.scale, moves)
        enter_streets(weights, streets.then, THEN)
    else:
        enter_streets(weights, streets or ())
    return weights


def enter_streets(
    weights: StreetWeights, streets: Sequence[Street], within: Keys = STREETS
) -> None:
    """Enter a list of streets, which is at `within` in the scenario. Raises InvalidValueError."""
    for number, street in enumerate(streets):
        keys: Keys = (*within, number)
        try:
            enter_street(weights, street, f"street {number + 1}", keys)
        except InputError as error:
            if isinstance(error, InvalidValueError):
                raise
            raise InvalidValueError(keys, error.message) from None


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
    if street.capacity is not None:
        enter_capacity(weights, street.capacity, cells, name, keys)


def enter_capacity(
    weights: StreetWeights, capacity: int, cells: list[int], name: str, keys: Keys
) -> None:
    """Enter the capacity of a street's cells. Raises InvalidValueError for cells that have their own."""
    floor_plan, key = weights.floor_plan, (*keys, "capacity")
    driven = [cell for cell in cells if floor_plan.drivable.flat[cell]]
    if not driven:
        raise InvalidValueError(key, f"{name} has a capacity, but no cell on which robots drive")
    for cell in driven:
        kind = floor_plan.kind_of(cell)
        if kind.opens or kind.code == CHARGER:
            x, y = floor_plan.xy(cell)
            own = "has room for one robot" if kind.opens else "has its capacity from the legend"
            raise InvalidValueError(
                key, f"{name} has a capacity, but [{x}, {y}] is a {kind.name}, which {own}"
            )
    weights.capacity[driven] = capacity


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
        corners = Rectangle(first=(first, street.row), last=(last, street.row))
    else:
        first, last = street.rows or (0, floor_plan.height - 1)
        corners = Rectangle(first=(street.column or 0, first), last=(street.column or 0, last))
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


# Stretches of a floor on which streets could be different.


class ChangedStretch(NamedTuple):
    """A straight run of cells, and the streets that change it."""

    name: str
    cells: tuple[int, ...]  # flat
    streets: tuple[dict[str, Any], ...]
    may_cut_off: bool = False  # whether they close moves


def changed_stretches(floor_plan: FloorPlan) -> Iterator[ChangedStretch]:
    """Each stretch of capacity 1 made 2, each closed one opened, each two-way one made one-way.

    A stretch is a maximal run of cells along a row or a column that are alike in this. Moves into
    storage and pockets do not count.
    """
    opens = np.array([kind.opens for kind in CELL_KINDS])[floor_plan.kind]
    usual = (floor_plan.drivable & ~opens).reshape(-1)
    serving = np.isin(floor_plan.kind, (CHARGER, STATION)).reshape(-1)
    single = usual & ~serving & (floor_plan.capacity.reshape(-1) == 1)
    alone = np.zeros_like(single)  # cells of capacity 1 between others
    long = np.zeros_like(single)  # those in longer stretches of capacity 1
    for axis in (0, 1):
        step = floor_plan.offsets[axis]
        inside = usual & np.roll(usual, -step)
        both, either = (two_way(exits, axis, step) & inside for exits in _exits(floor_plan))
        narrow = both & single & np.roll(single, -step)
        long |= narrow | np.roll(narrow, step)
        alone |= single & both & np.roll(both, step)
        yield from (doubled(floor_plan, cells) for cells in runs_of(narrow, step))
        for cells in runs_of(both, step):
            yield from one_ways(floor_plan, cells, axis)
        shut = either & ~both
        yield from (opened(floor_plan, cells) for cells in runs_of(shut, step))
        shut &= ~np.roll(shut, step) & ~np.roll(shut, -step)
        across = floor_plan.offsets[1 - axis]
        barrier = (usual | np.roll(usual, -step)) & ~both
        for cells in runs_of(barrier & np.roll(barrier, -across), across):
            passages = np.flatnonzero(shut[list(cells)])
            if len(passages) > 1:
                yield crossed(floor_plan, cells[passages[0] : passages[-1] + 1], axis)
    yield from (doubled(floor_plan, (cell,)) for cell in np.flatnonzero(alone & ~long).tolist())


def _exits(floor_plan: FloorPlan) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The exits of a floor as they are, and all that could be open."""
    return floor_plan.exits.reshape(-1), floor_plan.possible_exits.reshape(-1)


def two_way(exits: NDArray[np.uint8], axis: int, step: int) -> NDArray[np.bool_]:
    """(C,) whether robots move from each cell to the next one along an axis, and back."""
    back = np.roll(exits >> (axis + 2) & 1, -step)
    both: NDArray[np.bool_] = (exits >> axis & 1 & back) > 0
    return both


def runs_of(linked: NDArray[np.bool_], step: int) -> Iterator[tuple[int, ...]]:
    """The maximal runs of cells each of which is linked with the one a step ahead."""
    for first in np.flatnonzero(linked & ~np.roll(linked, step)).tolist():
        cells = [first]
        while linked[cells[-1]]:
            cells.append(cells[-1] + step)
        yield tuple(cells)


def line_of(floor_plan: FloorPlan, cells: Sequence[int]) -> tuple[str, dict[str, Any]]:
    """A run of cells in words and as the place of a street."""
    (x, y), (u, v) = floor_plan.xy(cells[0]), floor_plan.xy(cells[-1])
    if len(cells) == 1:
        return f"cell [{x}, {y}]", {"at": [x, y]}
    if y == v:
        return f"row {y}, columns {x} to {u}", {"row": y, "columns": [x, u]}
    return f"column {x}, rows {y} to {v}", {"column": x, "rows": [y, v]}


def path_of(floor_plan: FloorPlan, cells: Sequence[int]) -> dict[str, Any]:
    """A run of cells as a path."""
    return {"path": [list(floor_plan.xy(cell)) for cell in (cells[0], cells[-1])]}


def doubled(floor_plan: FloorPlan, cells: tuple[int, ...]) -> ChangedStretch:
    """A stretch of capacity 2."""
    name, place = line_of(floor_plan, cells)
    return ChangedStretch(f"{name}: capacity 2", cells, ({**place, "capacity": 2},))


def opened(floor_plan: FloorPlan, cells: tuple[int, ...]) -> ChangedStretch:
    """A stretch on which robots move both ways."""
    ways = {"there": OPEN_MOVE, "back": OPEN_MOVE}
    name = f"{line_of(floor_plan, cells)[0]}: open both ways"
    return ChangedStretch(name, cells, ({**path_of(floor_plan, cells), **ways},))


def crossed(floor_plan: FloorPlan, cells: tuple[int, ...], axis: int) -> ChangedStretch:
    """A stretch whose cells robots leave along the other axis, and enter from there."""
    beyond = tuple(cell + floor_plan.offsets[axis] for cell in cells)
    streets = tuple(
        {**line_of(floor_plan, some)[1], DIRECTIONS[direction]: OPEN_MOVE}
        for some, direction in ((cells, axis), (beyond, axis + 2))
    )
    name = f"{line_of(floor_plan, cells)[0]}: open to the {DIRECTIONS[axis]}, both ways"
    return ChangedStretch(name, (*cells, *beyond), streets)


def one_ways(floor_plan: FloorPlan, cells: tuple[int, ...], axis: int) -> Iterator[ChangedStretch]:
    """A stretch that is one-way, in either direction."""
    name = line_of(floor_plan, cells)[0]
    for direction, shut in ((axis, "back"), (axis + 2, "there")):
        street = {**path_of(floor_plan, cells), shut: CLOSED_MOVE}
        yield ChangedStretch(f"{name}: one-way {DIRECTIONS[direction]}", cells, (street,), True)
