"""The floor of a scenario as plain, immutable data: kinds of cells with the symbols that draw them,
exits, capacities, parking bays.

>.......    Directions count clockwise as seen on the screen (y grows downwards):
|###$s#d    EAST 0, SOUTH 1, WEST 2, NORTH 3.  d & 1 is the axis, d ^ 2 the opposite.
+------+

Users count cells from (0, 0) at the upper left; the arrays have a border of one cell, so that no
neighbour is outside: flat index c = (y + 1) * (width + 2) + (x + 1).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError

NIL: Final = -1  # no cell, slot, zone or order; equals NIL of the state

EAST: Final = 0
SOUTH: Final = 1
WEST: Final = 2
NORTH: Final = 3
DIRECTIONS: Final = ("east", "south", "west", "north")
DIRECTION_VECTORS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1))  # (dx, dy) of each direction


# Bit d of a set of exits: the cell may be left in direction d.
EXIT_EAST: Final = 1 << EAST
EXIT_SOUTH: Final = 1 << SOUTH
EXIT_WEST: Final = 1 << WEST
EXIT_NORTH: Final = 1 << NORTH
NO_EXITS: Final = 0
ALONG_X: Final = EXIT_EAST | EXIT_WEST
ALONG_Y: Final = EXIT_SOUTH | EXIT_NORTH
ALL_EXITS: Final = ALONG_X | ALONG_Y

WEIGHT_UNIT: Final = 100  # weights of streets are multiples of 1 / WEIGHT_UNIT
UNLIMITED: Final = 0  # capacity of a cell that holds any number of robots

WALL: Final = 0
FLOOR: Final = 1
TRACK: Final = 2
TURNTABLE: Final = 3
SHELF: Final = 4
DESTINATION: Final = 5
CHARGER: Final = 6
BAY: Final = 7
RACK: Final = 8
DOCK: Final = 9
STATION: Final = 10
STORAGE: Final = 11


BESIDE: Final = "beside"  # where a robot stands to pick or drop a load: next to the slot,
ABOVE_OR_BELOW: Final = "above or below"
ON_IT: Final = "on it"

ONE_LOAD: Final = "one"  # number of loads in a slot
ANY_LOADS: Final = "any"


class Kind(NamedTuple):
    """One kind of cell."""

    code: int  # value in the array of kinds
    name: str  # name in a legend
    meaning: str
    drivable: bool = False  # robots stand on the cell and drive over it
    turns: bool = False  # rail robots may turn here
    stand: str = ""  # of a slot, which holds loads: BESIDE, ABOVE_OR_BELOW or ON_IT
    holds: str = ""  # of a slot: ONE load or ANY number
    gives: bool = False  # orders may begin here
    takes: bool = False  # orders may end here
    remote: bool = False  # may be out of reach: then it gets no order
    opens: bool = False  # left and entered only over its open sides, regardless of arrows beside it

    @property
    def is_slot(self) -> bool:
        """Whether the kind is a slot, where loads are handled."""
        return self.stand != ""


CELL_KINDS: Final = (
    Kind(WALL, "wall", "nothing passes"),
    Kind(FLOOR, "floor", "free floor", drivable=True),
    Kind(TRACK, "track", "a rail along one axis", drivable=True),
    Kind(TURNTABLE, "turntable", "crossing where rail robots turn", drivable=True, turns=True),
    Kind(SHELF, "shelf", "holds one load", stand=BESIDE, holds=ONE_LOAD, gives=True, takes=True),
    Kind(
        DESTINATION,
        "destination",
        "where loads leave the floor",
        stand=BESIDE,
        holds=ANY_LOADS,
        takes=True,
    ),
    Kind(CHARGER, "charger", "floor where a robot charges", drivable=True),
    Kind(BAY, "parking-bay", "parks one robot beside its home cell"),
    Kind(
        RACK,
        "rack",
        "stores any number of loads, reached from above or below",
        stand=ABOVE_OR_BELOW,
        holds=ANY_LOADS,
        takes=True,
        remote=True,
    ),
    Kind(
        DOCK,
        "dock",
        "where loads arrive, any number",
        stand=BESIDE,
        holds=ANY_LOADS,
        gives=True,
        remote=True,
    ),
    Kind(
        STATION,
        "station",
        "floor where robots take loads and set them down, any number",
        drivable=True,
        stand=ON_IT,
        holds=ANY_LOADS,
        gives=True,
        takes=True,
        remote=True,
    ),
    Kind(
        STORAGE,
        "storage",
        "floor where a pod can stand; robots drive under it",
        drivable=True,
        stand=ON_IT,
        holds=ONE_LOAD,
        remote=True,
        opens=True,
    ),
)

KIND_BY_NAME: Final = {kind.name: kind for kind in CELL_KINDS}


class Symbol(NamedTuple):
    """The meaning of one character of a picture."""

    kind: int
    exits: int = NO_EXITS  # directions in which the cell may be left, before its neighbours matter
    capacity: int = 1  # robots at a time: 1, 2 (one for each direction of travel) or UNLIMITED
    loaded: bool = False  # a shelf that holds a load, or storage with a pod
    opens: int = NO_EXITS  # the only sides over which it is left and entered; arrows do not count


SYMBOLS: Final[dict[str, Symbol]] = {
    "#": Symbol(WALL),
    " ": Symbol(WALL),
    ".": Symbol(FLOOR, ALL_EXITS),
    "-": Symbol(TRACK, ALONG_X),
    "|": Symbol(TRACK, ALONG_Y),
    "+": Symbol(TURNTABLE, ALL_EXITS),
    "s": Symbol(SHELF),
    "$": Symbol(SHELF, loaded=True),
    "d": Symbol(DESTINATION),
    "c": Symbol(CHARGER, ALL_EXITS),
    "b": Symbol(BAY),
    "r": Symbol(RACK),
    "i": Symbol(DOCK),
    "t": Symbol(STATION, ALL_EXITS),
    "p": Symbol(STORAGE, ALL_EXITS, loaded=True, opens=ALL_EXITS),
    "q": Symbol(STORAGE, ALL_EXITS, opens=ALL_EXITS),
    ">": Symbol(FLOOR, EXIT_EAST),
    "v": Symbol(FLOOR, EXIT_SOUTH),
    "<": Symbol(FLOOR, EXIT_WEST),
    "^": Symbol(FLOOR, EXIT_NORTH),
    "=": Symbol(FLOOR, ALL_EXITS, capacity=2),
    "~": Symbol(FLOOR, ALL_EXITS, capacity=UNLIMITED),
}


def opposite_exits(exits: int) -> int:
    """The opposite directions of a set of exits."""
    return ((exits << 2) | (exits >> 2)) & ALL_EXITS


def entries(kind: int, exits: int) -> int:
    """Directions of travel in which a cell with these exits may be entered.

    A track is entered along its rail only. Floor with a single exit is one-way: it is entered from
    behind and from the sides, not against its arrow. Everything else drivable is entered freely.
    """
    if kind == TRACK:
        return exits
    if exits in (EXIT_EAST, EXIT_SOUTH, EXIT_WEST, EXIT_NORTH):
        return ALL_EXITS & ~opposite_exits(exits)
    return ALL_EXITS if CELL_KINDS[kind].drivable else NO_EXITS


# The floor.

CellBytes = npt.NDArray[np.uint8]  # (height + 2, width + 2)
Cells = npt.NDArray[np.int32]  # flat indices
Weights = npt.NDArray[np.int32]
MoveTicks = npt.NDArray[np.uint16]  # (cells, 4) by flat cell and direction

DRIVABLE = np.array([kind.drivable for kind in CELL_KINDS])  # (kinds,) bool
MAY_TURN_ON = np.array([kind.turns for kind in CELL_KINDS])  # (kinds,) bool
SLOT = np.array([kind.is_slot for kind in CELL_KINDS])  # (kinds,) bool
UNBOUNDED = np.array([kind.holds == ANY_LOADS for kind in CELL_KINDS])  # (kinds,) bool
ENTRIES = np.array(  # (kinds, 16) uint8: directions of travel that enter a cell with these exits
    [[entries(kind.code, exits) for exits in range(ALL_EXITS + 1)] for kind in CELL_KINDS], np.uint8
)


def may_turn(kinds: CellBytes, rail: bool) -> npt.NDArray[np.bool_]:
    """Whether robots may turn in a cell, by its kind, on rails or not."""
    turns: npt.NDArray[np.bool_] = (MAY_TURN_ON if rail else DRIVABLE)[kinds]
    return turns


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """A floor. All arrays are read-only; two plans with the same contents are equal."""

    width: int  # cells, without the border
    height: int
    kind: CellBytes  # (height + 2, width + 2) code of CELL_KINDS
    exits: CellBytes  # (height + 2, width + 2) bit d: may be left in direction d; 0 if not drivable
    capacity: CellBytes  # (height + 2, width + 2) robots at a time; 0 = unlimited
    bays: Cells  # (bays, 2) flat cells (bay, home cell), in reading order
    loads: CellBytes  # (height + 2, width + 2) 1 = a shelf drawn with a load, storage with a pod
    opens: CellBytes  # (height + 2, width + 2) sides of storage and pockets that are open; 0: arrows rule
    starts: tuple[int, ...] = ()  # flat cells of robots drawn in the picture
    numbered: tuple[int, ...] = ()  # flat cells of stations 1, 2, ...; (): in reading order
    # (cells, 4) ticks that a move out of a cell takes at least, by direction; (0, 4): there are no limits
    min_move_ticks: MoveTicks = field(default_factory=lambda: np.zeros((0, 4), np.uint16))
    # (cells, 4) and (cells,) weights of moves and of waiting, in 1/100; (0, 4) and (0,): all are 1
    move_weights: Weights = field(default_factory=lambda: np.zeros((0, 4), np.int32))
    wait_weights: Weights = field(default_factory=lambda: np.zeros(0, np.int32))

    @cached_property
    def stride(self) -> int:
        """Distance of vertical neighbours in flat indices."""
        return self.width + 2

    @cached_property
    def offsets(self) -> tuple[int, int, int, int]:
        """The offsets to the flat neighbours, in the order of directions."""
        return 1, self.stride, -1, -self.stride

    def cell(self, x: int, y: int) -> int:
        """Flat index of (x, y); the border column x = -1 counts as a cell."""
        return (y + 1) * self.stride + x + 1

    def xy(self, cell: int) -> tuple[int, int]:
        """The coordinates of a flat index, as users count them."""
        row, column = divmod(int(cell), self.stride)
        return column - 1, row - 1

    def holds(self, x: int, y: int) -> bool:
        """Whether (x, y) lies on the floor, border excluded."""
        return 0 <= x < self.width and 0 <= y < self.height

    @property
    def extent(self) -> str:
        """The range of coordinates: "(x 0..29, y 0..19)"."""
        return f"(x 0..{self.width - 1}, y 0..{self.height - 1})"

    def kind_of(self, cell: int) -> Kind:
        """The kind of a flat cell."""
        return CELL_KINDS[self.kind.flat[cell]]

    def neighbours(self, cell: int) -> tuple[int, int, int, int]:
        """Flat neighbours in the order of directions: east, south, west, north."""
        return cell + 1, cell + self.stride, cell - 1, cell - self.stride

    @cached_property
    def slots(self) -> Cells:
        """Flat cells that take loads (shelves, destinations) in table order: by x, then y."""
        columns, rows = np.nonzero(SLOT[self.kind].T)
        return _frozen_cells((rows * self.stride + columns).astype(np.int32))

    @cached_property
    def stations(self) -> Cells:
        """Flat cells of the stations 1, 2, ..."""
        cells = self.numbered or np.flatnonzero(self.kind == STATION)
        return _frozen_cells(np.array(cells, np.int32))

    @cached_property
    def drivable(self) -> npt.NDArray[np.bool_]:
        """(height + 2, width + 2) mask of the cells that robots stand on."""
        mask: npt.NDArray[np.bool_] = DRIVABLE[self.kind]
        mask.setflags(write=False)
        return mask

    @cached_property
    def fingerprint(self) -> str:
        """Hash of the contents, equal in every process."""
        parts = (self.kind, self.exits, self.capacity, self.bays, self.loads, self.opens)
        digest = hashlib.blake2b(
            f"{self.width}x{self.height} {self.starts} {self.numbered}".encode()
        )
        for part in (*parts, self.min_move_ticks, self.move_weights, self.wait_weights):
            digest.update(part.tobytes())
        return digest.hexdigest()[:32]

    def with_exits(self, exits: CellBytes) -> FloorPlan:
        """The same floor with other exits: (height + 2, width + 2)."""
        return replace(self, exits=_frozen(exits))

    def with_capacity(self, capacity: CellBytes) -> FloorPlan:
        """The same floor with other capacities of cells: (height + 2, width + 2)."""
        return replace(self, capacity=_frozen(capacity))

    @cached_property
    def possible_exits(self) -> CellBytes:
        """(height + 2, width + 2) the exits that the kinds of cells allow, whatever arrows say."""
        leave = np.full_like(self.exits, ALL_EXITS)
        for along in (ALONG_X, ALONG_Y):  # a track has a single axis
            leave[(self.kind == TRACK) & (self.exits & along != 0)] = along
        return derive_exits(self.kind, leave, self.opens)

    def with_weights(self, moves: Weights, waits: Weights) -> FloorPlan:
        """The same floor with weights of moves (cells, 4) and of waiting (cells,), in 1/100.

        Weights that all are 1 are left out.
        """
        if (moves == WEIGHT_UNIT).all() and (waits == WEIGHT_UNIT).all():
            return self.without_weights()
        moves, waits = moves.astype(np.int32), waits.astype(np.int32)
        moves.setflags(write=False)
        waits.setflags(write=False)
        return replace(self, move_weights=moves, wait_weights=waits)

    def without_weights(self) -> FloorPlan:
        """The same floor where all weights are 1."""
        return replace(
            self, move_weights=np.zeros((0, 4), np.int32), wait_weights=np.zeros(0, np.int32)
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FloorPlan) and self.fingerprint == other.fingerprint

    def __hash__(self) -> int:
        return hash(self.fingerprint)


def bordered(height: int, width: int, fill: int = 0) -> CellBytes:
    """An array for a floor of that size, border included."""
    return np.full((height + 2, width + 2), fill, np.uint8)


def make_floor_plan(
    kind: CellBytes,
    leave: CellBytes,
    capacity: CellBytes | None = None,
    loads: CellBytes | None = None,
    starts: Iterable[int] = (),
    numbered: Iterable[int] = (),
    opens: CellBytes | None = None,
) -> FloorPlan:
    """Derive a floor from the properties of each cell.

    `kind`, `leave`, `capacity`, `loads`, `opens`: (height + 2, width + 2), border included; `leave`: the
    directions in which a cell lets robots out, regardless of the neighbours; `opens`: the only sides
    over which a cell is left and entered. `starts`: flat cells; `numbered`: flat cells of all stations,
    in the order of their numbers. Raises InputError for a parking bay that opens on no drivable cell.
    """
    height, width = kind.shape[0] - 2, kind.shape[1] - 2
    if opens is None:
        opens = bordered(height, width)
    exits = derive_exits(kind, leave, opens)
    return FloorPlan(
        width=width,
        height=height,
        kind=_frozen(kind),
        exits=_frozen(exits),
        capacity=_frozen(bordered(height, width, 1) if capacity is None else capacity),
        bays=bays_of(kind),
        loads=_frozen(bordered(height, width) if loads is None else loads),
        opens=_frozen(opens),
        starts=tuple(int(cell) for cell in starts),
        numbered=tuple(int(cell) for cell in numbered),
    )


def derive_exits(kind: CellBytes, leave: CellBytes, opens: CellBytes) -> CellBytes:
    """The exits of a floor: the cell lets robots out, the neighbour is drivable and lets them in.

    Beside a cell with open sides arrows do not count: such sides connect both cells.
    """
    entry = ENTRIES[kind, leave]  # 0 where not drivable
    drivable = DRIVABLE[kind]
    sides = np.where(drivable, np.where(opens != 0, opens, ALL_EXITS), 0).astype(np.uint8)
    exits = np.zeros_like(leave)
    for direction, (rows, columns) in enumerate(((0, 1), (1, 0), (0, -1), (-1, 0))):
        bit, facing = np.uint8(1 << direction), np.uint8(1 << (direction ^ 2))
        # np.roll wraps around only through the border, which is not drivable.
        enters = np.roll(entry, (-rows, -columns), (0, 1)) & bit
        meets = np.roll(sides, (-rows, -columns), (0, 1)) & facing != 0
        is_open = (opens != 0) | (np.roll(opens, (-rows, -columns), (0, 1)) != 0)
        exits |= np.where(is_open, np.where(meets, sides & bit, 0), leave & enters)
    exits[~drivable] = 0
    return exits


def home_of(kind: CellBytes, bay: int) -> int | None:
    """The cell on which a parking bay opens: the first drivable one of east, west, south, north."""
    stride = kind.shape[1]
    flat = kind.reshape(-1)
    offsets = {EAST: 1, WEST: -1, SOUTH: stride, NORTH: -stride}
    for offset in offsets.values():
        home = int(bay + offset)
        if 0 <= home < flat.size and DRIVABLE[flat[home]]:
            return home
    return None


def bays_of(kind: CellBytes) -> Cells:
    """(bays, 2) flat cells (bay, home cell), in reading order. Raises InputError."""
    stride = kind.shape[1]
    pairs: list[tuple[int, int]] = []
    for bay in np.flatnonzero(kind == BAY).tolist():
        home = home_of(kind, bay)
        if home is None:
            x, y = bay % stride - 1, bay // stride - 1
            raise InputError(f"the parking bay at ({x}, {y}) opens on no cell that robots drive on")
        pairs.append((bay, home))
    return _frozen_cells(np.array(pairs, np.int32).reshape(-1, 2))


def _frozen(array: CellBytes) -> CellBytes:
    frozen = np.ascontiguousarray(array, np.uint8).copy()
    frozen.setflags(write=False)
    return frozen


def _frozen_cells(array: Cells) -> Cells:
    array.setflags(write=False)
    return array
