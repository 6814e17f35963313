"""The floor of a scenario: speed limits, closed cells, doors, blocks, lifts, streets, names of cells.

    locations: {packing: [4, 2], rack-7: [1, 0]}      beside      locations: locations.csv

A name may be written instead of [x, y], as in `at: packing`. The field of a struct allows names by
`place()` among its annotations, as the type `NamedCell` does. `with_numbers` replaces names by cells
before the structs are made, so no other code handles names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta

from automaton.errors import InputError, nearest
from automaton.floor.floor_plan import DIRECTIONS, FloorPlan
from automaton.scenario.durations import Distribution, MoveTicks
from automaton.scenario.quantities import (
    LAST_TICK,
    TIME,
    ConfigSection,
    NamedCell,
    NonEmptyText,
    Pair,
    SingleLine,
    Tick,
    quantity,
)
from automaton.scenario.text_files import quoted

Cell = tuple[int, int]
Locations = Annotated[
    dict[SingleLine, Pair] | NonEmptyText,
    Meta(
        description="Names of cells, for orders: {NAME: [x, y]}, or a CSV file with the columns name, "
        "x and y; path relative to the scenario."
    ),
]

MAX_GATE_ENTRIES = 10_000
Lasting = Annotated[int, quantity(TIME, ge=1, le=LAST_TICK, description="A number of ticks.")]
Corners = Annotated[tuple[NamedCell, ...], Meta(min_length=1, max_length=10_000)]


def cell_named(name: str, names: Mapping[str, Cell]) -> Cell:
    """The cell of a name. Raises InputError without file and line."""
    cell = names.get(name.strip())
    if cell is not None:
        return cell
    if not names:
        raise InputError(
            f"{quoted(name)} is a name, and the scenario has no locations; write [x, y], or set "
            "locations: {NAME: [x, y]}"
        )
    raise InputError(f"{quoted(name)} is not a location{nearest(name, names)}")


class Rectangle(ConfigSection, frozen=True, kw_only=True):
    """Two opposite corners of a rectangle."""

    first: Annotated[NamedCell, Meta(description="One corner of the rectangle.")] = msgspec.field(
        name="from"
    )
    last: Annotated[NamedCell, Meta(description="The opposite corner.")] = msgspec.field(name="to")


CellSet = Annotated[
    Corners | Rectangle,
    Meta(
        description="The cells: corners of a path, or two opposite corners of a rectangle as "
        "{from, to}."
    ),
]


def cells_of_set(name: str, cells: CellSet, floor_plan: FloorPlan) -> list[int]:
    """The flat cells of a path or a rectangle, each once. Raises InputError without file and line."""
    corners = (cells.first, cells.last) if isinstance(cells, Rectangle) else cells
    for x, y in corners:
        if not floor_plan.holds(x, y):
            size = f"{floor_plan.width} x {floor_plan.height} cells"
            raise InputError(f"{name} has the cell [{x}, {y}], outside the floor of {size}")
    if isinstance(cells, Rectangle):
        (x, y), (u, v) = cells.first, cells.last
        return [
            floor_plan.cell(column, row)
            for row in range(min(y, v), max(y, v) + 1)
            for column in range(min(x, u), max(x, u) + 1)
        ]
    return list(dict.fromkeys(cells_of_path(name, cells, floor_plan)))


def cells_of_path(name: str, corners: Sequence[Cell], floor_plan: FloorPlan) -> list[int]:
    """The flat cells from corner to corner. Raises InputError where two are not in line."""
    x, y = corners[0]
    path = [floor_plan.cell(x, y)]
    for u, v in corners[1:]:
        if (x != u) == (y != v):
            text = f"{name} goes from [{x}, {y}] to [{u}, {v}]"
            raise InputError(f"{text}: along neither a row nor a column")
        while (x, y) != (u, v):
            x, y = x + (u > x) - (u < x), y + (v > y) - (v < y)
            path.append(floor_plan.cell(x, y))
    return path


class SpeedLimit(ConfigSection, frozen=True, kw_only=True):
    """Cells with a speed limit."""

    cells: CellSet
    max_speed: Annotated[
        MoveTicks,
        Meta(
            description="The greatest speed of a move between two of the cells; a plain number is the "
            "least duration of such a move, in ticks. With `world.slowdown: zones`, this "
            "duration is multiplied by the number of robots in the traffic zone."
        ),
    ]


class MeanGap(ConfigSection, frozen=True, kw_only=True):
    """A random time from reopening to the next closing."""

    mean: Annotated[
        float,
        quantity(
            TIME, ge=1, le=LAST_TICK, description="The mean of the time from reopening to closing."
        ),
    ]


class Closing(ConfigSection, frozen=True, kw_only=True):
    """Cells that are closed for some time."""

    cells: CellSet
    begin: Annotated[
        Tick | None,
        Meta(
            description="The first tick of the first closing; left out: 0, or random where `every` "
            "has a mean."
        ),
    ] = msgspec.field(name="from", default=None)
    ticks: Annotated[Lasting | Distribution, Meta(description="How long each closing lasts.")] = (
        msgspec.field(name="for")
    )
    every: Annotated[
        Lasting | MeanGap | None,
        Meta(
            description="Ticks from the start of one closing to the start of the next; {mean: ...}: a "
            "random time (geometric) from reopening to the next closing; left out: a single closing."
        ),
    ] = None
    known: Annotated[
        bool, Meta(description="Whether routing knows how long a closing that has begun will last.")
    ] = True

    def __post_init__(self) -> None:
        by_chance = isinstance(self.every, MeanGap)
        if by_chance and self.begin is not None:
            raise ValueError(
                "from belongs to scheduled closings, not to random ones (every: {mean: ...})"
            )
        if not by_chance and self.begin is None:
            raise ValueError("a scheduled closing needs from, its first tick")
        if not by_chance and isinstance(self.ticks, Distribution):
            raise ValueError(
                "for must be a number of ticks in a scheduled closing; only random closings "
                "(every: {mean: ...}) may have a random for"
            )
        if isinstance(self.every, int) and isinstance(self.ticks, int) and self.ticks >= self.every:
            raise ValueError(
                f"for ({self.ticks}) must be less than every ({self.every}): cells reopen between "
                "two closings"
            )


class Door(ConfigSection, frozen=True, kw_only=True):
    """A door: a cell that opens on request of robots."""

    at: Annotated[NamedCell, Meta(description="The cell of the door.")]
    opening_time: Annotated[
        Lasting, Meta(description="Ticks from the first request until the door is open.")
    ]
    hold_open: Annotated[
        int,
        quantity(
            TIME,
            ge=0,
            le=LAST_TICK,
            description="Ticks without a robot in the door and without a request after which the "
            "door shuts.",
        ),
    ]


class Block(ConfigSection, frozen=True, kw_only=True):
    """Cells that together hold at most a given number of robots."""

    cells: CellSet
    max_robots: Annotated[
        int,
        Meta(
            ge=1,
            le=1_000_000,
            description="Greatest number of robots in the block or moving into it.",
        ),
    ] = 1
    direction: Annotated[
        Literal["any", "same"],
        Meta(
            description="Where robots may enter. any: at any cell; same: while the block is occupied, "
            "only at the cell where the previous robot entered."
        ),
    ] = "any"


class Lift(ConfigSection, frozen=True, kw_only=True):
    """A lift between levels that are drawn side by side; it carries one robot at a time."""

    shaft: Annotated[
        Corners,
        Meta(
            description="Corners of the path of the shaft; each exit to the outside is a mouth of the "
            "lift."
        ),
    ]
    travel_time: Annotated[Lasting, Meta(description="Ticks from one mouth to the next.")]
    door_time: Annotated[
        int,
        quantity(
            TIME, ge=0, le=LAST_TICK, description="Ticks that the doors of the lift take to open."
        ),
    ] = 0


class ChangingFloor(ConfigSection, frozen=True, kw_only=True):
    """What limits traffic on the floor: closings, doors, blocks, lifts, speed limits, and the
    numbers of open stations and chargers.
    """

    open_stations: Annotated[
        Annotated[int, Meta(ge=1, le=100_000)] | None,
        Meta(
            description="Number of open stations. Stations open in the order of `stations`, then by "
            "number; closed ones are plain floor. null: all stations are open."
        ),
    ] = None
    open_chargers: Annotated[
        Annotated[int, Meta(ge=0, le=100_000)] | None,
        Meta(
            description="Number of open chargers. Chargers open in reading order; closed ones are plain "
            "floor. null: all chargers are open."
        ),
    ] = None
    closed: Annotated[
        tuple[Closing, ...],
        Meta(max_length=MAX_GATE_ENTRIES, description="Cells that are closed at times."),
    ] = ()
    replan_after: Annotated[
        Lasting | Literal["30 s"] | None,
        Meta(
            description="Ticks that a robot waits in front of a closed cell before it gets a "
            "route around closed cells, at most once per closing. null: never. If a tick has "
            "no unit of time, the default is 30 ticks."
        ),
    ] = "30 s"
    doors: Annotated[tuple[Door, ...], Meta(max_length=MAX_GATE_ENTRIES, description="Doors.")] = ()
    blocks: Annotated[
        tuple[Block, ...],
        Meta(
            max_length=MAX_GATE_ENTRIES,
            description="Cells that together hold at most a given number of robots.",
        ),
    ] = ()
    lifts: Annotated[tuple[Lift, ...], Meta(max_length=MAX_GATE_ENTRIES, description="Lifts.")] = ()
    speed_limits: Annotated[
        tuple[SpeedLimit, ...],
        Meta(
            description="Cells with a speed limit; where several limits apply, the slowest one counts."
        ),
    ] = ()
    levels: Annotated[
        dict[SingleLine, Rectangle],
        Meta(
            description="Names of levels in reports. Each level is a rectangle of the floor; "
            "lifts connect levels."
        ),
    ] = msgspec.field(default_factory=dict)

    @property
    def has_gates(self) -> bool:
        """Whether it has cells that are sometimes closed to robots."""
        return bool(self.closed or self.doors or self.blocks or self.lifts)


# Streets: weights of moves, and closed moves (automaton.scenario.streets).

LEAST_WEIGHT: Final = 0.01
MOST_WEIGHT: Final = 10_000
CLOSED_MOVE: Final = "closed"
OPEN_MOVE: Final = (
    "open"  # also against the arrows of the floor, and after an earlier street closed it
)

Weight = (
    Annotated[
        float,
        Meta(ge=LEAST_WEIGHT, le=MOST_WEIGHT, description="The weight of the moves."),
    ]
    | Literal["closed"]
    | None
)
StreetWeight = Weight | Literal["open"]
Wait = (
    Annotated[float, Meta(ge=0, le=MOST_WEIGHT, description="The weight of a tick of waiting.")]
    | None
)
Range = Pair | None


class Street(ConfigSection, frozen=True, kw_only=True):
    """Weights of moves in a cell, a row, a column, a path or an area. Later streets overwrite
    earlier ones. An open move is made even if the floor or an earlier street does not allow it.
    """

    at: Annotated[NamedCell | None, Meta(description="A cell.")] = None
    row: Annotated[Annotated[int, Meta(ge=0)] | None, Meta(description="The y of a row.")] = None
    columns: Annotated[Range, Meta(description="The first and last column of a row.")] = None
    column: Annotated[Annotated[int, Meta(ge=0)] | None, Meta(description="The x of a column.")] = (
        None
    )
    rows: Annotated[Range, Meta(description="The first and last row of a column.")] = None
    path: Annotated[
        Annotated[tuple[NamedCell, ...], Meta(min_length=2)] | None,
        Meta(description="Corners of a path."),
    ] = None
    area: Annotated[Rectangle | None, Meta(description="Two opposite corners of a rectangle.")] = (
        None
    )
    east: Annotated[
        StreetWeight, Meta(description="Weight of moves to the east, or closed, or open.")
    ] = None
    south: Annotated[
        StreetWeight, Meta(description="Weight of moves to the south, or closed, or open.")
    ] = None
    west: Annotated[
        StreetWeight, Meta(description="Weight of moves to the west, or closed, or open.")
    ] = None
    north: Annotated[
        StreetWeight, Meta(description="Weight of moves to the north, or closed, or open.")
    ] = None
    there: Annotated[
        StreetWeight, Meta(description="Weight of moves along the path, or closed, or open.")
    ] = None
    back: Annotated[
        StreetWeight, Meta(description="Weight of moves back along the path, or closed, or open.")
    ] = None
    wait: Annotated[Wait, Meta(description="Weight of a tick of waiting in the cells.")] = None
    capacity: Annotated[
        Literal[1, 2] | None,
        Meta(
            description="Number of robots that each of the cells holds: 1, or 2, one in each direction."
        ),
    ] = None

    def __post_init__(self) -> None:
        places = [key for key in STREET_PLACES if getattr(self, key) is not None]
        if len(places) != 1:
            raise ValueError("a street must have exactly one of at, row, column, path and area")
        if self.columns is not None and self.row is None:
            raise ValueError("columns limits a row; this street has none")
        if self.rows is not None and self.column is None:
            raise ValueError("rows limits a column; this street has none")
        if (self.there is not None or self.back is not None) and self.path is None:
            raise ValueError("there and back are directions of a path; this street has none")
        if self.path is not None and any(getattr(self, way) is not None for way in DIRECTIONS):
            raise ValueError("the directions of a path are there and back")
        rules = (*DIRECTIONS, "there", "back", "wait", "capacity")
        if all(getattr(self, rule) is None for rule in rules):
            raise ValueError(
                "this street has no weight: set a direction, there, back, wait or capacity"
            )


STREET_PLACES: Final = ("at", "row", "column", "path", "area")


class StreetPlan(ConfigSection, frozen=True, kw_only=True):
    """Streets of a file or of a pattern."""

    file: Annotated[
        NonEmptyText | None,
        Meta(
            description="A CSV file with the columns x, y, east, south, west, north and wait, or "
            "a file of guidance graphs (GGO); path relative to the scenario."
        ),
    ] = None
    preset: Annotated[
        Literal["crisscross"] | None,
        Meta(
            description="A pattern of streets. crisscross: rows alternate between east and west, columns "
            "between north and south; the first row runs east, the first column north."
        ),
    ] = None
    scale: Annotated[
        Annotated[float, Meta(gt=0, le=MOST_WEIGHT)] | Literal["mean"],
        Meta(
            description="Factor by which all weights are multiplied. mean: the factor that makes "
            "the mean weight of moves 1."
        ),
    ] = 1.0
    along: Annotated[
        float,
        Meta(
            ge=LEAST_WEIGHT,
            le=MOST_WEIGHT,
            description="crisscross: the weight of moves along a street.",
        ),
    ] = 0.5
    against: Annotated[
        Weight, Meta(description="crisscross: the weight of moves against a street, or closed.")
    ] = 1.0
    wait: Annotated[
        float,
        Meta(ge=0, le=MOST_WEIGHT, description="crisscross: the weight of a tick of waiting."),
    ] = 1.0
    phase: Annotated[
        tuple[Annotated[int, Meta(ge=0, le=1)], Annotated[int, Meta(ge=0, le=1)]],
        Meta(
            description="crisscross: [rows, columns]; 1 reverses the directions of the rows or of "
            "the columns."
        ),
    ] = (0, 0)
    then: Annotated[
        tuple[Street, ...], Meta(description="Streets that overwrite those of the file or pattern.")
    ] = ()

    def __post_init__(self) -> None:
        if (self.file is None) == (self.preset is None):
            raise ValueError("streets must have exactly one of file and preset, or be a list")
        own = [key for key in ("along", "against", "wait") if getattr(self, key) != CRISSCROSS[key]]
        if self.file is not None and (own or self.phase != (0, 0)):
            key = own[0] if own else "phase"
            raise ValueError(f"streets has {key}, which belongs to preset: crisscross")


CRISSCROSS: Final = {"along": 0.5, "against": 1.0, "wait": 1.0}

Streets = Annotated[
    StreetPlan | tuple[Street, ...],
    Meta(description="Weights of moves, which guide robots, and closed moves."),
]
