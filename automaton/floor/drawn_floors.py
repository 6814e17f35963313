"""A floor as text: drawn in characters, one per cell, or a matrix of codes; read and written.

    b....s     The first column holds only parking bays, blanks and walls: it is the column x = -1, and
    b>>>.d     the second character of a row is x = 0. Other rows are counted from their first
    #....#     character. Short rows are filled with wall; A to Z are robots on free floor.

A FloorPlan stores the exits between cells, not the symbols of the picture. To draw a plan, each cell
gets the plainest symbol such that all symbols together give exactly the plan's exits; a cell that no
symbol fits gets a new symbol, explained by a legend. Walls are '#'.

A matrix is a CSV file, one line per row (Bhattathiri, Li & Kuhl, Figure 2):

    -1,-1, -1,-1     -1 wall, 0 free, 50 intersection, 100 rack, 200 dock
    -1, 0,200, 0     An intersection is a free cell: which ones they are follows from the floor, so
    -1,50,  0,50     0 and 50 mean the same when a matrix is read.

Spreadsheets write numbers as 100.0, or as 100,0 between semicolons if the comma is the decimal sign;
both are read, as are columns between tabs. A matrix does not give capacities: one number holds for all
free cells.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, alternatives
from automaton.floor.floor_plan import (
    ALL_EXITS,
    ALONG_X,
    ALONG_Y,
    BAY,
    CELL_KINDS,
    DIRECTIONS,
    DOCK,
    DRIVABLE,
    ENTRIES,
    FLOOR,
    KIND_BY_NAME,
    NO_EXITS,
    ONE_LOAD,
    RACK,
    SYMBOLS,
    TRACK,
    WALL,
    CellBytes,
    FloorPlan,
    Symbol,
    bordered,
    home_of,
    make_floor_plan,
)
from automaton.floor.traffic_zones import traffic_zones_of

Legend = tuple[tuple[str, Symbol], ...]  # symbols beyond the built-in ones; hashable

ROBOT_LETTERS = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
MAX_FLOOR_SIDE = 4096
LOOK_ALIKES = {  # characters that other programs write for a symbol
    **dict(zip("→←↑↓", "><^v", strict=True)),
    **dict.fromkeys("█■▓X", "#"),
    **dict.fromkeys("·•,", "."),
}

AROUND = ((0, 1), (1, 0), (0, -1), (-1, 0))  # (rows, columns) to the neighbour E, S, W, N
BITS_SET = np.array([bin(bits).count("1") for bits in range(ALL_EXITS + 1)])
NEW_SYMBOLS = "".join(  # symbols that a legend may add
    symbol for symbol in "oxykzabcdefghijlmnpqrstuvw0123456789" if symbol not in SYMBOLS
)
CONFLICT = 100  # cost of an exit that should not hold; more than any preference
ADDED = 50  # cost of a symbol that the legend has to explain
LOOSE = 5  # cost of an exit that only the neighbour's symbol closes: '>>>' rather than '>.>'
IMPOSSIBLE = 100_000  # cost of a symbol that closes an exit of the plan
SWEEPS = 40
SHAKES = 200
INTERSECTION: Final = 50
# The first separator that occurs; a comma beside others is a decimal comma.
SEPARATORS: Final = (";", "\t", ",")
CAPACITY_NUMBER: Final = re.compile(r"[-+]?[0-9]{1,9}(\.[0-9]{0,9})?")
KIND_OF: Final = {-1: WALL, 0: FLOOR, INTERSECTION: FLOOR, 100: RACK, 200: DOCK}
CODE_OF: Final = {kind: code for code, kind in KIND_OF.items() if code != INTERSECTION}


class PictureError(InputError):
    """An error in a row of a picture; rows count from 0."""

    def __init__(self, message: str, row: int = 0) -> None:
        super().__init__(message)
        self.row = row


def symbol_of(
    kind_name: str,
    capacity: int | None = None,
    exits: tuple[str, ...] | None = None,
    loaded: bool = False,
    opens: tuple[str, ...] | None = None,
) -> Symbol:
    """A symbol as a legend describes it. Raises InputError for what contradicts its kind."""
    kind = KIND_BY_NAME[kind_name]
    if not kind.drivable and (capacity, exits, opens) != (None, None, None):
        raise InputError(f"a {kind_name} has neither capacity nor exits: robots do not drive on it")
    if opens is not None and exits is not None:
        raise InputError("a symbol has either exits or the sides that it opens, not both")
    if kind.opens and exits is not None:
        raise InputError(f"set opens to the sides over which robots enter and leave a {kind_name}")
    if kind.opens and capacity not in (None, 1):
        raise InputError(f"a {kind_name} has room for one robot")
    if loaded and kind.holds != ONE_LOAD:
        able = alternatives(f"a {other.name}" for other in CELL_KINDS if other.holds == ONE_LOAD)
        raise InputError(f"a {kind_name} cannot be loaded; only {able} can")
    bits = None if exits is None else _bits(exits)
    sides = (ALL_EXITS if kind.opens else NO_EXITS) if opens is None else _bits(opens)
    if opens is not None and not sides:
        raise InputError("opens must name at least one side")
    if kind.code == TRACK and (not bits or (bits & ~ALONG_X and bits & ~ALONG_Y)):
        raise InputError("a track needs exits along one axis: [east, west] or [north, south]")
    if bits is None:
        bits = ALL_EXITS if kind.drivable else NO_EXITS
    if sides:
        bits = sides
    return Symbol(kind.code, bits, 1 if capacity is None else capacity, loaded, sides)


def _bits(names: tuple[str, ...]) -> int:
    """The set of directions with these names."""
    return sum(1 << DIRECTIONS.index(name) for name in set(names))


@lru_cache(maxsize=64)
def draw_floor(picture: str, legend: Legend = ()) -> FloorPlan:
    """The floor of a picture. Raises PictureError. Equal pictures give the same object."""
    symbols = {**SYMBOLS, **dict(legend)}
    rows = picture.rstrip().split("\n") if picture.strip() else []
    if not rows:
        raise PictureError("the picture is empty")
    if len(rows) > MAX_FLOOR_SIDE or max(map(len, rows)) > MAX_FLOOR_SIDE:
        raise PictureError(f"the picture has a side of more than {MAX_FLOOR_SIDE} cells")
    codes = _codes(rows)
    used = _symbols_of(codes, symbols)
    if not _first_column_is_bays(codes):
        codes = np.pad(codes, ((0, 0), (1, 0)), constant_values=ord("#"))
    codes = np.pad(codes, ((1, 1), (0, 1)), constant_values=ord("#"))

    kind, leave, capacity, loads, opens = (_mapped(codes, used, field) for field in range(5))
    for bay in np.flatnonzero(kind == KIND_BY_NAME["parking-bay"].code).tolist():
        if home_of(kind, bay) is None:
            row = bay // kind.shape[1] - 1
            raise PictureError(
                "a parking bay in this row opens on no cell that robots drive on", row
            )
    if not any(CELL_KINDS[symbol.kind].drivable for symbol in used.values()):
        raise PictureError("the picture has no cell that robots drive on")
    return make_floor_plan(kind, leave, capacity, loads, _starts(codes), opens=opens)


def _codes(rows: list[str]) -> npt.NDArray[np.uint32]:
    """(rows, longest row) code points, short rows filled with wall."""
    width = max(map(len, rows))
    text = "".join(row.ljust(width, "#") for row in rows)
    return np.frombuffer(text.encode("utf-32-le"), np.uint32).reshape(len(rows), width)


def _symbols_of(codes: npt.NDArray[np.uint32], symbols: dict[str, Symbol]) -> dict[str, Symbol]:
    """The symbols that a picture uses; robots stand on free floor."""
    used: dict[str, Symbol] = {"#": symbols["#"]}
    for character in map(chr, np.unique(codes).tolist()):
        if character in ROBOT_LETTERS:
            used[character] = Symbol(FLOOR, ALL_EXITS)
        elif character in symbols:
            used[character] = symbols[character]
        else:
            row, x = (int(index[0]) for index in np.nonzero(codes == ord(character)))
            known = "".join(sorted(set(symbols) - {" "}))
            raise PictureError(
                f"row {row + 1}, column {x + 1} of the picture: {character!r} has no meaning"
                f"{_alike(character, symbols)}; known are {known}, blanks, and A to Z for robots; a "
                "legend may add others",
                row,
            )
    return used


def _alike(character: str, symbols: dict[str, Symbol]) -> str:
    """A hint with the symbol that was probably meant."""
    meant = LOOK_ALIKES.get(character, character.lower())
    return f"; did you mean {meant!r}?" if meant != character and meant in symbols else ""


def _first_column_is_bays(codes: npt.NDArray[np.uint32]) -> bool:
    first = {chr(code) for code in codes[:, 0].tolist()}
    return "b" in first and first <= {"b", " ", "#"} and codes.shape[1] > 1


def _mapped(
    codes: npt.NDArray[np.uint32], used: dict[str, Symbol], field: int
) -> npt.NDArray[np.uint8]:
    """One field of the symbol of every cell."""
    values = np.zeros(codes.shape, np.uint8)
    for character, symbol in used.items():
        values[codes == ord(character)] = int(symbol[field])
    return values


def _starts(codes: npt.NDArray[np.uint32]) -> list[int]:
    """Flat cells of the robots drawn, A first."""
    starts: dict[str, int] = {}
    flat, width = codes.reshape(-1), codes.shape[1]
    drawn = np.flatnonzero((flat >= ord("A")) & (flat <= ord("Z"))).tolist()
    for cell in drawn:
        name = chr(flat[cell])
        if name in starts:
            (x, y), (first_x, first_y) = (
                (c % width - 1, c // width - 1) for c in (cell, starts[name])
            )
            text = f"robot {name} is drawn twice, at [{first_x}, {first_y}] and at [{x}, {y}]"
            raise PictureError(text, y)
        starts[name] = cell
    return [starts[name] for name in sorted(starts)]


def check_new_symbol(character: str) -> None:
    """Raises InputError for a legend's symbol that is not a single character or already in use."""
    if len(character) != 1:
        raise InputError(f"a symbol is a single character, found '{character}'")
    if character in ROBOT_LETTERS:
        raise InputError(
            f"'{character}': capital letters are reserved for robots; use a lower-case letter"
        )
    if character in SYMBOLS:
        name = CELL_KINDS[SYMBOLS[character].kind].name
        free = alternatives(sorted(set("oxytkz*:") - set(SYMBOLS)))
        raise InputError(f"'{character}' already stands for {name}; use another such as {free}")


# From plans to pictures.


class Drawing(NamedTuple):
    """A floor as text; `draw_floor(*drawing)` gives the plan again."""

    picture: str
    legend: Legend


def floor_picture(floor_plan: FloorPlan) -> str:
    """The floor, one character per cell, with parking bays at x = -1 in a separate column.

    Raises InputError for a floor that no picture can express.
    """
    return floor_drawing(floor_plan).picture


def floor_legend(floor_plan: FloorPlan) -> dict[str, dict[str, object]]:
    """The symbols of `floor_picture` that are not built in, as a legend of a scenario."""
    return {mark: legend_entry(symbol) for mark, symbol in floor_drawing(floor_plan).legend}


def legend_entry(symbol: Symbol) -> dict[str, object]:
    """A symbol as an entry of a scenario's legend."""
    entry: dict[str, object] = {"kind": CELL_KINDS[symbol.kind].name}
    if CELL_KINDS[symbol.kind].drivable:
        if symbol.capacity != 1:
            entry["capacity"] = symbol.capacity
        if symbol.exits != ALL_EXITS:
            names = [name for d, name in enumerate(DIRECTIONS) if symbol.exits >> d & 1]
            entry["opens" if symbol.opens else "exits"] = names
    if symbol.loaded:
        entry["loaded"] = True
    return entry


def floor_drawing(floor_plan: FloorPlan) -> Drawing:
    """The floor as text, with the legend of its further symbols. Raises InputError."""
    marks = {symbol: mark for mark, symbol in reversed(SYMBOLS.items())}
    symbols, chosen = _symbols(floor_plan)
    first = 0 if (floor_plan.kind[:, 0] == BAY).any() else 1
    rows, columns = slice(1, -1), slice(first, -1)
    shown = chosen[rows, columns]
    legend: list[tuple[str, Symbol]] = []

    def mark_of(symbol: Symbol) -> str:
        if symbol not in marks:
            marks[symbol] = _new_mark(legend)
            legend.append((marks[symbol], symbol))
        return marks[symbol]

    letters = np.array([" "] * len(symbols))
    for index in dict.fromkeys(shown.reshape(-1).tolist()):
        letters[index] = mark_of(symbols[index])
    text = letters[shown]
    if first and "b" in text[:, 0] and set(text[:, 0]) <= {"b", "#"}:
        # Parking bays at x = 0 that would be taken for the column x = -1.
        text[text[:, 0] == "b", 0] = _new_mark(legend)
        legend.append((_new_mark(legend), Symbol(BAY)))
    for letter, cell in enumerate(floor_plan.starts):
        x, y = floor_plan.xy(cell)
        if letter >= 26 or text[y, x + 1 - first] != ".":
            raise InputError(f"the robot that starts at ({x}, {y}) cannot be drawn")
        text[y, x + 1 - first] = chr(ord("A") + letter)
    return Drawing("\n".join("".join(row) for row in text), tuple(legend))


def _new_mark(legend: list[tuple[str, Symbol]]) -> str:
    if len(legend) == len(NEW_SYMBOLS):
        raise InputError("the floor needs more further symbols than there are characters")
    return NEW_SYMBOLS[len(legend)]


def _symbols(floor_plan: FloorPlan) -> tuple[list[Symbol], npt.NDArray[np.intp]]:
    """Symbols, and the index of each cell's symbol."""
    sides = floor_plan.opens != 0
    if not sides.any():
        return _arrows(floor_plan)
    beside = replace(floor_plan, kind=np.where(sides, WALL, floor_plan.kind).astype(np.uint8))
    closed = np.where(sides, 0, floor_plan.exits & _ahead(_all_exits(~sides))).astype(np.uint8)
    loads = np.where(sides, 0, floor_plan.loads).astype(np.uint8)
    symbols, chosen = _arrows(replace(beside, exits=closed, loads=loads))
    fields = (floor_plan.kind, floor_plan.opens, floor_plan.capacity, floor_plan.loads)
    for kind, opens, capacity, loaded in np.unique([f[sides] for f in fields], axis=1).T.tolist():
        symbol = Symbol(kind, opens, capacity, bool(loaded), opens)
        if symbol not in symbols:
            symbols.append(symbol)
        values = (kind, opens, capacity, loaded)
        same = np.logical_and.reduce([f == v for f, v in zip(fields, values, strict=True)])
        chosen = np.where(same, symbols.index(symbol), chosen)
    return symbols, chosen


def _all_exits(mask: npt.NDArray[np.bool_]) -> CellBytes:
    exits: CellBytes = np.where(mask, ALL_EXITS, NO_EXITS).astype(np.uint8)
    return exits


def _arrows(floor_plan: FloorPlan) -> tuple[list[Symbol], npt.NDArray[np.intp]]:
    """The same for a floor without open sides; symbols in order of preference."""
    symbols = _built_in()
    chosen = _fit(floor_plan, symbols, np.zeros(floor_plan.kind.shape, np.intp))
    if not _conflicts(floor_plan, symbols, chosen).any():
        return symbols, chosen
    symbols += _further(floor_plan, symbols)
    fits = np.stack(_fixed_costs(floor_plan, _behind(floor_plan.exits), symbols)) < IMPOSSIBLE
    generator = np.random.default_rng(1)
    for _ in range(SHAKES):
        chosen = _fit(floor_plan, symbols, chosen)
        wrong = _conflicts(floor_plan, symbols, chosen)
        if not wrong.any():
            return symbols, chosen
        # Stuck: two neighbours would have to change at once. So randomize the cells around them.
        near = np.logical_or.reduce([np.roll(wrong, shift, (0, 1)) for shift in (*AROUND, (0, 0))])
        shaken = np.argmax(np.where(fits, generator.random(fits.shape), -1), axis=0)
        chosen = np.where(near, shaken, chosen)
    raise InputError("the floor has exits that no picture can express")


def _built_in() -> list[Symbol]:
    """One symbol for each meaning of a built-in character, the plainest first."""
    plain = (symbol for symbol in SYMBOLS.values() if not symbol.opens)
    return sorted(dict.fromkeys(plain), key=lambda symbol: -BITS_SET[symbol.exits])


def _further(floor_plan: FloorPlan, known: list[Symbol]) -> list[Symbol]:
    """All symbols that a legend could add for the kinds and capacities of this floor."""
    further: list[Symbol] = []
    cells = np.stack([floor_plan.kind, floor_plan.capacity], -1).reshape(-1, 2)
    for kind, capacity in np.unique(cells, axis=0).tolist():
        sets = [NO_EXITS]
        if kind == TRACK:
            sets = [bits for bits in range(1, 16) if not bits & ALONG_X or not bits & ALONG_Y]
        elif CELL_KINDS[kind].drivable:
            sets = list(range(ALL_EXITS + 1))
        sets.sort(key=lambda bits: -BITS_SET[bits])
        further += [Symbol(kind, bits, capacity) for bits in sets]
    return [symbol for symbol in further if symbol not in known]


def _fit(
    floor_plan: FloorPlan, symbols: list[Symbol], chosen: npt.NDArray[np.intp]
) -> npt.NDArray[np.intp]:
    """Improve the choice for all cells of one colour of a chessboard, then for the other colour."""
    leaves = np.array([symbol.exits for symbol in symbols], np.uint8)
    enters = np.array([ENTRIES[symbol.kind, symbol.exits] for symbol in symbols], np.uint8)
    rows, columns = np.indices(floor_plan.kind.shape)
    incoming = _behind(floor_plan.exits)
    fixed = _fixed_costs(floor_plan, incoming, symbols)
    chosen = np.argmin(fixed, axis=0) if not chosen.any() else chosen.copy()
    quiet = 0
    for sweep in range(SWEEPS):
        ahead, behind = _ahead(enters[chosen]), _behind(leaves[chosen])
        cost = [
            fixed[index]
            + CONFLICT * BITS_SET[leaves[index] & ~floor_plan.exits & ahead]
            + CONFLICT * BITS_SET[enters[index] & ~incoming & behind]
            for index in range(len(symbols))
        ]
        better = np.where((rows + columns) % 2 == sweep % 2, np.argmin(cost, axis=0), chosen)
        quiet = quiet + 1 if np.array_equal(better, chosen) else 0
        chosen = better
        if quiet == 2:
            break
    return chosen


def _fixed_costs(
    floor_plan: FloorPlan, incoming: CellBytes, symbols: list[Symbol]
) -> list[npt.NDArray[np.int64]]:
    """The cost of each symbol in every cell, independent of its neighbours."""
    to = _ahead(_all_exits(floor_plan.drivable))
    built_in = set(SYMBOLS.values())
    costs = []
    for index, symbol in enumerate(symbols):
        entry = ENTRIES[symbol.kind, symbol.exits]
        wrong = (floor_plan.kind != symbol.kind) | ((floor_plan.loads != 0) != symbol.loaded)
        if DRIVABLE[symbol.kind]:
            wrong |= floor_plan.capacity != symbol.capacity
            wrong |= floor_plan.exits & ~np.uint8(symbol.exits) != 0
            wrong |= incoming & ~entry != 0
        if symbol != Symbol(FLOOR, ALL_EXITS):
            wrong.reshape(-1)[list(floor_plan.starts)] = True  # robots are drawn on free floor
        loose = BITS_SET[np.uint8(symbol.exits) & ~floor_plan.exits & to]
        preference = index // 4 + LOOSE * loose + (0 if symbol in built_in else ADDED)
        costs.append(np.where(wrong, IMPOSSIBLE, preference))
    return costs


def _conflicts(
    floor_plan: FloorPlan, symbols: list[Symbol], chosen: npt.NDArray[np.intp]
) -> npt.NDArray[np.bool_]:
    """The cells that the chosen symbols would draw differently from the plan."""
    field = np.array([tuple(map(int, symbol[:4])) for symbol in symbols], np.uint8)
    kind, leave, capacity, loaded = (field[chosen, k] for k in range(4))
    drivable = DRIVABLE[kind]
    exits = np.where(drivable, leave & _ahead(ENTRIES[kind, leave]), 0)
    other = (kind != floor_plan.kind) | (exits != floor_plan.exits) | (loaded != floor_plan.loads)
    wrong: npt.NDArray[np.bool_] = other | (drivable & (capacity != floor_plan.capacity))
    return wrong


def _ahead(values: CellBytes) -> CellBytes:
    """For every cell and direction d: bit d of the next cell in direction d."""
    return _shifted(values, -1)


def _behind(values: CellBytes) -> CellBytes:
    """For every cell and direction d: bit d of the cell before it in direction d."""
    return _shifted(values, 1)


def _shifted(values: CellBytes, sign: int) -> CellBytes:
    out = np.zeros_like(values)
    for direction, (rows, columns) in enumerate(AROUND):
        out |= np.roll(values, (sign * rows, sign * columns), (0, 1)) & np.uint8(1 << direction)
    return out


# Matrices.


class MatrixError(InputError):
    """An error in a row of a matrix; rows count from 0."""

    def __init__(self, message: str, row: int = 0) -> None:
        super().__init__(message)
        self.row = row


@lru_cache(maxsize=16)
def read_matrix(text: str, capacity: int = 0) -> FloorPlan:
    """The floor of a matrix; every free cell has this capacity. Raises MatrixError."""
    rows = text.rstrip().split("\n") if text.strip() else []
    if not rows:
        raise MatrixError("the matrix is empty")
    separator = next((sign for sign in SEPARATORS if sign in rows[0]), ",")
    cells = [row.split(separator) for row in rows]
    width = len(cells[0])
    if max(len(rows), width) > MAX_FLOOR_SIDE:
        raise MatrixError(f"the matrix has a side of more than {MAX_FLOOR_SIDE:,} cells")
    kind = bordered(len(rows), width)
    for y, row in enumerate(cells):
        if len(row) != width:
            raise MatrixError(f"the row has {len(row)} codes, the first row {width}", y)
        kind[y + 1, 1:-1] = _kinds(row, y)
    if not (kind == FLOOR).any():
        raise MatrixError("the matrix has no free cell (0 or 50) that robots drive on")
    return _plan(kind, capacity)


def write_matrix(floor_plan: FloorPlan) -> str:
    """The matrix of a floor, intersections marked, with a newline at its end.

    Raises InputError for a floor with other kinds of cells, one-way cells or mixed capacities.
    """
    kind, free = floor_plan.kind[1:-1, 1:-1], floor_plan.kind == FLOOR
    for y, x in np.argwhere(~np.isin(kind, list(CODE_OF))).tolist():
        known = alternatives(CELL_KINDS[code].name for code in CODE_OF)
        name = CELL_KINDS[kind[y, x]].name
        raise InputError(f"a matrix has no code for the {name} at ({x}, {y}), only for {known}")
    if len(floor_plan.bays):
        x, y = floor_plan.xy(int(floor_plan.bays[0, 0]))
        raise InputError(f"a matrix has no code for the parking bay at ({x}, {y})")
    capacities = np.unique(floor_plan.capacity[free]).tolist()
    if len(capacities) > 1:
        raise InputError("a matrix cannot store different capacities of free cells")
    if not np.array_equal(_plan(floor_plan.kind, 0).exits, floor_plan.exits):
        raise InputError("a matrix cannot store one-way cells")
    codes = np.vectorize(CODE_OF.get, otypes=[np.int64])(kind)
    crossing = traffic_zones_of(floor_plan).intersection.reshape(free.shape)[1:-1, 1:-1]
    codes = np.where(crossing, INTERSECTION, codes)
    return "".join(",".join(map(str, row)) + "\n" for row in codes.tolist())


def _kinds(row: list[str], y: int) -> list[int]:
    codes = [_number(code) for code in row]
    for x, code in enumerate(codes):
        if code not in KIND_OF:
            allowed = alternatives(map(str, KIND_OF))
            found = row[x].strip()[:20] or "nothing"
            # By value, not by letters: 99 is near 100.
            near = min(KIND_OF, key=lambda known: abs(known - code)) if math.isfinite(code) else ""
            hint = f"; did you mean {near}?" if near != "" else ""
            raise MatrixError(
                f"column {x + 1} must be one of the codes {allowed}, found {found}{hint}", y
            )
    return [KIND_OF[int(code)] for code in codes]


def _number(text: str) -> float:
    """The number of a text; NaN for other texts."""
    plain = text.strip().replace(",", ".")
    return float(plain) if CAPACITY_NUMBER.fullmatch(plain) else math.nan


def _plan(kind: npt.NDArray[np.uint8], capacity: int) -> FloorPlan:
    """A floor on which robots may leave every free cell in all directions."""
    leave = np.where(kind == FLOOR, ALL_EXITS, 0).astype(np.uint8)
    return make_floor_plan(kind, leave, np.where(kind == FLOOR, capacity, 1).astype(np.uint8))
