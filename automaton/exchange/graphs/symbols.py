"""Draw cells with exactly given exits: as arrows, box-drawing symbols, and symbols of a legend.

A picture closes exits that lead into walls, against arrows, and past the open sides of pockets. A
cell with one way in and out opens that side alone. A cell with one exit that is entered against it
from there, and from elsewhere, too, would be one-way: it gets a second exit that leads nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

from automaton.exchange.graphs.roads import Cell, ConflictError
from automaton.floor.cells import (
    ALL_EXITS,
    CHARGER,
    DIRECTION_VECTORS,
    FLOOR,
    NO_EXITS,
    STATION,
    SYMBOLS,
    Symbol,
)
from automaton.floor.drawn_floors import Legend, draw_floor
from automaton.floor.floor_drawing import legend_entry

WALL_MARK: Final = "#"
SINGLE: Final = (1, 2, 4, 8)  # sets of one exit
# Exits are bits: 1 east, 2 south, 4 west, 8 north.
BOXES: Final = {
    5: "─", 10: "│", 3: "┌", 6: "┐", 9: "└", 12: "┘", 11: "├", 14: "┤", 7: "┬", 13: "┴", 15: "┼"
}  # fmt: skip
ARROWS: Final = {1: ">", 2: "v", 4: "<", 8: "^"}
PLAIN: Final = {STATION: "t", CHARGER: "c"}
POCKETS: Final = {1: "╶", 2: "╷", 4: "╴", 8: "╵"}  # of plain floor
FURTHER: Final = {  # of a legend, the first ones first; those of SYMBOLS are skipped
    CHARGER: "zywu987654βδεζηθκλμξ",
    STATION: "onmlkjhgfea0123πτφχψω",
    FLOOR: "x*:",  # with no way out
}


@dataclass
class Drawing:
    """The picture of a floor and its legend."""

    rows: list[str] = field(default_factory=list)
    legend: dict[str, Symbol] = field(default_factory=dict)

    @property
    def picture(self) -> str:
        """The rows, each with its end of line."""
        return "".join(f"{row}\n" for row in self.rows)

    @property
    def entries(self) -> dict[str, dict[str, Any]]:
        """The legend as a scenario has it."""
        return {mark: legend_entry(symbol) for mark, symbol in self.legend.items()}


def draw(exits: dict[Cell, int], kinds: dict[Cell, int], width: int, height: int) -> Drawing:
    """Draw cells with their exits; `kinds`: of those that are not floor. Raises ConflictError."""
    out, cells = Drawing(), _Cells(exits, kinds)
    rows = [[WALL_MARK] * width for _ in range(height)]
    for x, y in exits:
        rows[y][x] = _mark(out, cells.symbol((x, y)), cells.kind((x, y)))
    out.rows = ["".join(row) for row in rows]
    _check(out, exits)
    return out


class _Cells:
    """Cells and their neighbours."""

    def __init__(self, exits: dict[Cell, int], kinds: dict[Cell, int]) -> None:
        self.exits, self.kinds = exits, kinds

    def kind(self, cell: Cell) -> int:
        """What a cell is."""
        return self.kinds.get(cell, FLOOR)

    def entries(self, cell: Cell) -> int:
        """The sides over which a cell is entered."""
        sides = 0
        for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
            leaves = self.exits.get((cell[0] + dx, cell[1] + dy), 0)
            sides |= (leaves >> (direction ^ 2) & 1) << direction
        return sides

    def is_pocket(self, cell: Cell) -> bool:
        """Whether a cell has one way in and out."""
        return self.exits[cell] in SINGLE and self.entries(cell) == self.exits[cell]

    def is_arrow(self, cell: Cell) -> bool:
        """Whether a cell of plain floor is one-way as it is drawn."""
        exits = self.exits[cell]
        is_single = exits in SINGLE and self.kind(cell) == FLOOR
        return is_single and not exits & self.entries(cell)

    def walls(self, cell: Cell) -> int:
        """The sides where there is nothing."""
        beside = ((cell[0] + dx, cell[1] + dy) for dx, dy in DIRECTION_VECTORS)
        return sum((there not in self.exits) << d for d, there in enumerate(beside))

    def blocked(self, cell: Cell) -> int:
        """The sides where an exit would lead nowhere: walls, arrows that point here, pockets."""
        sides = self.walls(cell)
        for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
            there = (cell[0] + dx, cell[1] + dy)
            facing = 1 << (direction ^ 2)
            if sides >> direction & 1:
                continue
            if self.is_pocket(there):
                sides |= (not self.exits[there] & facing) << direction
            elif self.is_arrow(there):
                sides |= (self.exits[there] == facing) << direction
        return sides

    def symbol(self, cell: Cell) -> Symbol:
        """Return the symbol of a cell. Raises ConflictError where no picture can express it."""
        kind, exits = self.kind(cell), self.exits[cell]
        is_free = kind in PLAIN and exits | self.walls(cell) == ALL_EXITS
        if self.is_pocket(cell):
            if kind == STATION and is_free:
                return SYMBOLS[PLAIN[kind]]
            return Symbol(kind, exits, opens=exits)
        if is_free:
            return SYMBOLS[PLAIN[kind]]
        if exits not in SINGLE or not exits & self.entries(cell):
            return Symbol(kind, exits)
        second = self.blocked(cell) & ~exits
        if not second:
            raise ConflictError(f"the cell {list(cell)} would be entered against its only exit")
        return Symbol(kind, exits | second & -second)


def _mark(out: Drawing, symbol: Symbol, kind: int) -> str:
    """Return the character of a symbol, and put it into the legend if it needs an entry."""
    if kind != FLOOR and symbol == SYMBOLS[PLAIN[kind]]:
        return PLAIN[kind]
    if kind != FLOOR or symbol.exits == NO_EXITS:
        known = {entry: mark for mark, entry in out.legend.items()}
        if symbol in known:
            return known[symbol]
        mark = next(mark for mark in FURTHER[kind] if mark not in (*out.legend, *SYMBOLS))
    elif symbol.opens:
        mark = POCKETS[symbol.opens]
    elif symbol.exits in ARROWS:
        return ARROWS[symbol.exits]
    else:
        mark = BOXES[symbol.exits]
    out.legend[mark] = symbol
    return mark


def _check(out: Drawing, exits: dict[Cell, int]) -> None:
    """Read the picture again and compare its exits. Raises ConflictError."""
    legend: Legend = tuple(out.legend.items())
    plan = draw_floor(out.picture, legend)
    for (x, y), bits in exits.items():
        if plan.exits[y + 1, x + 1] != bits:
            raise ConflictError(f"the exits of the cell {[x, y]} could not be drawn")
