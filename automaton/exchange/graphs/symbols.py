"""Draw cells with exactly given exits: as arrows, box-drawing symbols, and symbols of a legend.

A picture closes exits that lead into walls, against arrows, and past the open sides of pockets. A
cell with one way in and out opens that side alone. A cell with one exit that is entered against it
from there, and from elsewhere, too, would be one-way: it gets a second exit that leads nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

from automaton.errors import InputError
from automaton.exchange.graphs.roads import Cell
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
NO_WAY_OUT: Final = "x"
POCKETS: Final = {1: "╶", 2: "╷", 4: "╴", 8: "╵"}  # of plain floor
FURTHER: Final = {  # symbols of a legend for kinds, the first ones first
    CHARGER: "zywu987654βδεζηθκλμξ",
    STATION: "onmlkjhgfea0123πτφχψω",
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


def draw(
    exits: dict[Cell, int], kinds: dict[Cell, int], size: tuple[int, int], file: str
) -> Drawing:
    """Draw cells with their exits; `kinds`: of those that are not floor. Raises InputError."""
    out, cells = Drawing(), _Cells(exits, kinds)
    rows = [[WALL_MARK] * size[0] for _ in range(size[1])]
    for x, y in exits:
        rows[y][x] = _mark(out, cells.symbol((x, y), file), cells.kind((x, y)))
    out.rows = ["".join(row) for row in rows]
    _check(out, exits, file)
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

    def blocked(self, cell: Cell) -> int:
        """The sides where an exit would lead nowhere: walls, arrows that point here, pockets."""
        sides = 0
        for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
            there = (cell[0] + dx, cell[1] + dy)
            facing = 1 << (direction ^ 2)
            if there not in self.exits:
                sides |= 1 << direction
            elif self.is_pocket(there):
                sides |= (not self.exits[there] & facing) << direction
            elif self.is_arrow(there):
                sides |= (self.exits[there] == facing) << direction
        return sides

    def symbol(self, cell: Cell, file: str) -> Symbol:
        """Return the symbol of a cell. Raises InputError where no picture can express it."""
        kind, exits, blocked = self.kind(cell), self.exits[cell], self.blocked(cell)
        is_free = kind in PLAIN and exits | blocked == ALL_EXITS
        if self.is_pocket(cell):
            if kind == STATION and is_free:
                return SYMBOLS[PLAIN[kind]]
            return Symbol(kind, exits, opens=exits)
        if is_free:
            return SYMBOLS[PLAIN[kind]]
        if exits not in SINGLE or not exits & self.entries(cell):
            return Symbol(kind, exits)
        second = blocked & ~exits
        if not second:
            raise InputError(
                f"the cell at [{cell[0]}, {cell[1]}] would be entered against its only exit, which "
                "no picture can say: choose a smaller cell",
                file,
            )
        return Symbol(kind, exits | second & -second)


def _mark(out: Drawing, symbol: Symbol, kind: int) -> str:
    """Return the character of a symbol, and put it into the legend if it needs an entry."""
    if kind != FLOOR:
        if symbol == SYMBOLS[PLAIN[kind]]:
            return PLAIN[kind]
        known = {entry: mark for mark, entry in out.legend.items()}
        if symbol in known:
            return known[symbol]
        mark = next(mark for mark in FURTHER[kind] if mark not in out.legend)
    elif symbol.opens:
        mark = POCKETS[symbol.opens]
    elif symbol.exits in ARROWS:
        return ARROWS[symbol.exits]
    else:
        mark = NO_WAY_OUT if symbol.exits == NO_EXITS else BOXES[symbol.exits]
    out.legend[mark] = symbol
    return mark


def _check(out: Drawing, exits: dict[Cell, int], file: str) -> None:
    """Read the picture again and compare its exits. Raises InputError."""
    legend: Legend = tuple(out.legend.items())
    plan = draw_floor(out.picture, legend)
    for (x, y), bits in exits.items():
        if plan.exits[y + 1, x + 1] != bits:
            text = f"the exits of the cell at [{x}, {y}] cannot be drawn: choose a smaller cell"
            raise InputError(text, file)
