"""Kinds of cells, and the symbols that draw them.

>.......    Directions count clockwise as seen on the screen (y grows downwards):
|###$s#d    EAST 0, SOUTH 1, WEST 2, NORTH 3.  d & 1 is the axis, d ^ 2 the opposite.
+------+
"""

from __future__ import annotations

from typing import Final, NamedTuple

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
        "floor where a pod stands, under which robots drive",
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
