"""A floor drawn in characters, one per cell, as a FloorPlan.

b....s     The first column holds only parking bays, blanks and walls: it is the column x = -1, and
b>>>.d     the second character of a row is x = 0. Other rows are counted from their first
#....#     character. Short rows are filled with wall; A to Z are robots on free floor.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, alternatives
from automaton.floor.cells import (
    ALL_EXITS,
    ALONG_X,
    ALONG_Y,
    CELL_KINDS,
    DIRECTIONS,
    FLOOR,
    KIND_BY_NAME,
    NO_EXITS,
    ONE,
    SYMBOLS,
    TRACK,
    Symbol,
)
from automaton.floor.floor_plan import FloorPlan, home_of, make_floor_plan

Legend = tuple[tuple[str, Symbol], ...]  # symbols beyond the built-in ones; hashable

ROBOTS = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
MAX_SIDE = 4096
LOOK_ALIKES = {  # what is written for a symbol by other programs
    **dict(zip("→←↑↓", "><^v", strict=True)),
    **dict.fromkeys("█■▓X", "#"),
    **dict.fromkeys("·•,", "."),
}


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
        raise InputError(f"say over which sides a {kind_name} is left and entered by opens")
    if kind.opens and capacity not in (None, 1):
        raise InputError(f"a {kind_name} has room for one robot")
    if loaded and kind.holds != ONE:
        able = alternatives(f"a {other.name}" for other in CELL_KINDS if other.holds == ONE)
        raise InputError(f"a {kind_name} cannot be loaded; only {able} can")
    bits = None if exits is None else _bits(exits)
    sides = (ALL_EXITS if kind.opens else NO_EXITS) if opens is None else _bits(opens)
    if opens is not None and not sides:
        raise InputError("opens must name a side at least")
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
    if len(rows) > MAX_SIDE or max(map(len, rows)) > MAX_SIDE:
        raise PictureError(f"the picture has a side of more than {MAX_SIDE} cells")
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
        if character in ROBOTS:
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
    """The symbol that was probably meant, where it is easily mistaken."""
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
    if character in ROBOTS:
        raise InputError(f"'{character}': capital letters stand for robots")
    if character in SYMBOLS:
        name = CELL_KINDS[SYMBOLS[character].kind].name
        free = alternatives(sorted(set("oxytkz*:") - set(SYMBOLS)))
        raise InputError(f"'{character}' already stands for {name}; use another such as {free}")
