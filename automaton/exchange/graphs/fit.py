"""Fit a graph to cells: their size, a picture with exactly the exits of the graph, ticks of the edges.

The cell size is the largest one for which the errors of all edges are accepted:

    error of an edge = cells x cell / length - 1

A picture closes exits that lead into walls, against arrows, and past the open sides of pockets. A cell
with a single way in and out opens only that side. A cell with one exit that robots enter over this exit
and from other sides, too, would be drawn one-way: it gets a second exit that leads nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.errors import InputError
from automaton.exchange.graphs.graph import (
    Cell,
    ConflictError,
    Floats,
    Graph,
    GraphRoads,
    GridPlaces,
    Integers,
    Placement,
    Road,
    lay_roads,
    on_grid,
    turned,
)
from automaton.exchange.imported_floor import MAX_WRITTEN_CELLS, ImportOptions, check_size
from automaton.floor.drawn_floors import MAX_FLOOR_SIDE, Legend, draw_floor, legend_entry
from automaton.floor.floor_plan import (
    ALL_EXITS,
    CHARGER,
    DIRECTION_VECTORS,
    FLOOR,
    NO_EXITS,
    STATION,
    SYMBOLS,
    Symbol,
)

WALL_MARK: Final = "#"
SINGLE_EXITS: Final = (1, 2, 4, 8)  # sets of one exit
# Exits are bits: 1 east, 2 south, 4 west, 8 north.
BOXES: Final = {
    5: "─", 10: "│", 3: "┌", 6: "┐", 9: "└", 12: "┘", 11: "├", 14: "┤", 7: "┬", 13: "┴", 15: "┼"
}  # fmt: skip
ARROWS: Final = {1: ">", 2: "v", 4: "<", 8: "^"}
FREE_SYMBOLS: Final = {STATION: "t", CHARGER: "c"}
POCKETS: Final = {1: "╶", 2: "╷", 4: "╴", 8: "╵"}  # of plain floor
FURTHER: Final = {  # characters of a legend, in this order, except those of SYMBOLS
    CHARGER: "zywu987654βδεζηθκλμξ",
    STATION: "onmlkjhgfea0123πτφχψω",
    FLOOR: "x*:",  # without a way out
}

CANDIDATES: Final = tuple(Fraction(k, 20) for k in range(40, 1, -1))  # 2.00, 1.95, ... 0.10 m
ROUNDING_ERROR: Final = 1e-9  # error of rounding
MAX_MOVE: Final = 10_000  # ticks
MAX_LIMITS: Final = 14  # most different speed limits of a floor
COMPARED_DECIMALS: Final = 12


class GraphCells(NamedTuple):
    """The cells of a graph."""

    roads: GraphRoads
    kinds: dict[Cell, int]  # only cells that are not plain floor
    drawing: FittedDrawing


class Fit(NamedTuple):
    """A graph on a grid of cells of one size."""

    cell: Fraction  # metres
    placement: Placement
    width: int
    height: int
    cells: Integers  # (edges,) moves of each edge
    error: Floats  # (edges,) error as a share
    layout: GraphCells | None = None  # None if an error is above the limit
    refusal: str = ""

    @property
    def worst(self) -> int:
        """The edge with the largest error."""
        return int(np.abs(self.error).argmax())


def fit_graph(graph: Graph, cell: Fraction | None, accept: float) -> Fit:
    """Return a graph on cells of a given size, by default of the largest accepted size.

    `accept`: the largest error. A fit with a refusal has an edge with a larger error. Raises InputError
    if nodes or edges conflict, or the floor becomes too large.
    """
    placement = turned(graph)
    if cell is not None:
        check_size(*_size(placement, cell), graph.file, "choose a larger cell")
        try:
            return _fitted(graph, placement, cell, accept)
        except ConflictError as error:
            text = f"in cells of {float(cell):g} m {error}: choose a smaller cell"
            raise InputError(text, graph.file) from None
    return _largest(graph, placement, accept)


def _largest(graph: Graph, placement: Placement, accept: float) -> Fit:
    """Return the accepted fit with the largest cells, or the refused fit with the smallest error."""
    nearest: Fit | None = None
    conflict: tuple[Fraction, ConflictError] | None = None
    check_size(*_size(placement, CANDIDATES[0]), graph.file, "set a larger --cell")
    for cell in CANDIDATES:
        width, height = _size(placement, cell)
        if max(width, height) > MAX_FLOOR_SIDE or width * height > MAX_WRITTEN_CELLS:
            break
        try:
            fit = _fitted(graph, placement, cell, accept)
        except ConflictError as error:
            conflict = (cell, error)
            continue
        if not fit.refusal:
            return fit
        if nearest is None or _worst_error(fit) < _worst_error(nearest):
            nearest = fit
    if nearest is None:
        assert conflict is not None  # the first cell is fitted or refused
        size, what = conflict
        text = (
            f"no cell from 2 m to {float(size):g} m is accepted; in cells of {float(size):g} m "
            f"{what}"
        )
        raise InputError(text, graph.file)
    text = (
        "no cell size between 0.1 and 2 m meets the tolerance; the best is "
        f"{float(nearest.cell):g} m: "
    )
    reason = diagonal_reason(graph, placement, accept)
    return nearest._replace(refusal=reason or text + nearest.refusal)


def diagonal_reason(graph: Graph, placement: Placement, accept: float) -> str:
    """Return a sentence if an edge is too long along rows and columns for cells of any size, or ""."""
    worst, error = None, accept + ROUNDING_ERROR
    for edge in graph.edges:
        drawn = sum(
            abs(float(line[edge.end] - line[edge.start])) for line in (placement.x, placement.y)
        )
        if drawn / edge.metres - 1 > error:
            worst, error = (edge, drawn), drawn / edge.metres - 1
    if worst is None:
        return ""
    edge, drawn = worst
    return (
        f"the edge {edge.name} runs diagonally: robots drive along rows and columns, where its "
        f"{edge.metres:.4g} m become {drawn:.4g} m ({100 * error:+.1f} %), and at most "
        f"{100 * accept:g} % are accepted; no cell size changes this: set a larger --accept"
    )


def _worst_error(fit: Fit) -> float:
    return float(abs(fit.error[fit.worst]))


def _size(placement: Placement, cell: Fraction) -> tuple[int, int]:
    places = on_grid(placement, float(cell))
    return places.width, places.height


def _fitted(graph: Graph, placement: Placement, cell: Fraction, accept: float) -> Fit:
    """Return the fit for one cell size. Raises ConflictError."""
    places = on_grid(placement, float(cell))
    ends = np.array([(edge.start, edge.end) for edge in graph.edges]).T
    metres = np.array([edge.metres for edge in graph.edges])
    cells = sum(np.abs(line[ends[1]] - line[ends[0]]) for line in (places.column, places.row))
    with np.errstate(over="ignore"):
        error = cells * float(cell) / metres - 1
    fit = Fit(cell, placement, places.width, places.height, np.asarray(cells), error)
    edge, share = graph.edges[fit.worst], float(error[fit.worst])
    if abs(share) > accept + ROUNDING_ERROR:
        drawn = float(cells[fit.worst] * cell)
        text = (
            f"the edge {edge.name}, {edge.metres:.4g} m, would be {drawn:.4g} m "
            f"({100 * share:+.1f} %) in cells of {float(cell):g} m, at most {100 * accept:g} % are "
            "accepted"
        )
        advice = "choose another --cell, or a larger --accept"
        reason = diagonal_reason(graph, placement, accept)
        return fit._replace(refusal=reason or f"{text}: {advice}")
    return fit._replace(layout=_laid_out(graph, placement, places))


def _laid_out(graph: Graph, placement: Placement, places: GridPlaces) -> GraphCells:
    """Return the cells of a graph. Raises ConflictError."""
    roads = lay_roads(graph, placement, places)
    kinds = {roads.node_cells[node]: STATION for one in graph.stations for node in one.nodes}
    kinds |= {roads.node_cells[node]: CHARGER for node in graph.chargers}
    return GraphCells(roads, kinds, draw(roads.exits, kinds, places.width, places.height))


# The picture.


@dataclass
class FittedDrawing:
    """The picture of a floor and its legend."""

    rows: list[str] = field(default_factory=list)
    legend: dict[str, Symbol] = field(default_factory=dict)

    @property
    def picture(self) -> str:
        """The rows with line ends."""
        return "".join(f"{row}\n" for row in self.rows)

    @property
    def entries(self) -> dict[str, dict[str, Any]]:
        """The legend as a scenario has it."""
        return {mark: legend_entry(symbol) for mark, symbol in self.legend.items()}


def draw(exits: dict[Cell, int], kinds: dict[Cell, int], width: int, height: int) -> FittedDrawing:
    """Draw cells with their exits; `kinds`: of cells that are not floor. Raises ConflictError."""
    out, cells = FittedDrawing(), _Cells(exits, kinds)
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
        """The kind of a cell."""
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
        return self.exits[cell] in SINGLE_EXITS and self.entries(cell) == self.exits[cell]

    def is_arrow(self, cell: Cell) -> bool:
        """Whether a cell of plain floor would be drawn one-way."""
        exits = self.exits[cell]
        is_single = exits in SINGLE_EXITS and self.kind(cell) == FLOOR
        return is_single and not exits & self.entries(cell)

    def walls(self, cell: Cell) -> int:
        """The sides without a neighbour."""
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
        is_free = kind in FREE_SYMBOLS and exits | self.walls(cell) == ALL_EXITS
        if self.is_pocket(cell):
            if kind == STATION and is_free:
                return SYMBOLS[FREE_SYMBOLS[kind]]
            return Symbol(kind, exits, opens=exits)
        if is_free:
            return SYMBOLS[FREE_SYMBOLS[kind]]
        if exits not in SINGLE_EXITS or not exits & self.entries(cell):
            return Symbol(kind, exits)
        second = self.blocked(cell) & ~exits
        if not second:
            raise ConflictError(f"the cell {list(cell)} would be entered against its only exit")
        return Symbol(kind, exits | second & -second)


def _mark(out: FittedDrawing, symbol: Symbol, kind: int) -> str:
    """Return the character of a symbol, and add a legend entry if it needs one."""
    if kind != FLOOR and symbol == SYMBOLS[FREE_SYMBOLS[kind]]:
        return FREE_SYMBOLS[kind]
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


def _check(out: FittedDrawing, exits: dict[Cell, int]) -> None:
    """Read the picture again and compare its exits. Raises ConflictError."""
    legend: Legend = tuple(out.legend.items())
    plan = draw_floor(out.picture, legend)
    for (x, y), bits in exits.items():
        if plan.exits[y + 1, x + 1] != bits:
            raise ConflictError(f"the exits of the cell {[x, y]} could not be drawn")


# Ticks of the edges: ticks per move, and speed limits.


class Speeds(NamedTuple):
    """The speeds of robots and edges, in m/s, and the ticks of a move at each."""

    cell: Fraction  # metres
    tick: Fraction  # seconds
    fastest: Fraction
    of_edge: tuple[Fraction, ...]  # (edges,) at most `fastest`

    def ticks(self, speed: Fraction) -> int:
        """Ticks of a move at a speed, rounded."""
        return int(self.cell / (speed * self.tick) + Fraction(1, 2))

    def wanted(self, graph: Graph, edge: int) -> float:
        """Exact ticks of an edge in the file."""
        return float(graph.edges[edge].metres / (float(self.of_edge[edge]) * float(self.tick)))


def speeds_of(graph: Graph, cell: Fraction, options: ImportOptions) -> Speeds:
    """Return the speeds on a graph. Raises InputError without a speed or a suitable tick."""
    known = [edge.speed for edge in graph.edges if edge.speed]
    robots = [robot.speed for robot in graph.vehicles if robot.speed]
    default = options.speed
    if default is None and (known or robots):
        default = exact(max(known or robots))
    if default is None:
        raise InputError("has no speed: set --speed, such as 1m/s", graph.file)
    as_written = {speed: exact(speed) for speed in set(known)}
    of_edge = [as_written[edge.speed] if edge.speed else default for edge in graph.edges]
    fastest = max(of_edge)
    if robots and len(robots) == len(graph.vehicles):
        fastest = min(fastest, exact(max(robots)))
    tick = rounded(options.tick or cell / fastest)
    speeds = Speeds(cell, tick, fastest, tuple(min(speed, fastest) for speed in of_edge))
    _check_ticks(graph, speeds)
    return speeds


def _check_ticks(graph: Graph, speeds: Speeds) -> None:
    """Raises InputError if a move would take less than half a tick, or too many ticks."""
    if not speeds.tick or speeds.ticks(speeds.fastest) < 1:
        text = f"a move at {text_of(speeds.fastest)} m/s would be less than half a tick of "
        raise InputError(f"{text}{float(speeds.tick):g} s: set a smaller --tick", graph.file)
    slowest = min(speeds.of_edge)
    robots = [(exact(one.speed), f"robot {one.name}") for one in graph.vehicles if one.speed]
    edge = graph.edges[speeds.of_edge.index(slowest)].name
    for speed, what in (*robots, (slowest, f"the edge {edge}")):
        if speeds.ticks(speed) > MAX_MOVE:
            text = f"{what} has a speed of {float(speed):.3g} m/s: a move would take more than "
            raise InputError(f"{text}{MAX_MOVE:,} ticks; set a larger --tick", graph.file)


def limits_of(roads: list[Road], speeds: Speeds) -> tuple[list[Fraction], int]:
    """Return the speed on each road, and the number of limits before merging (0: none merged).

    The speed of a road is that of its slowest edge. Beyond MAX_LIMITS different limits, adjacent ones
    are merged into the lower one.
    """
    of_road = [min(speeds.of_edge[edge] for edge in road.edges) for road in roads]
    slow = sorted({speed for speed in of_road if speed < speeds.fastest})
    if len(slow) <= MAX_LIMITS:
        return of_road, 0
    lowest: dict[int, Fraction] = {}
    together = {}
    for place, speed in enumerate(slow):
        together[speed] = lowest.setdefault(place * MAX_LIMITS // len(slow), speed)
    return [together.get(speed, speed) for speed in of_road], len(slow)


def exact(value: float) -> Fraction:
    """Return a number exactly as it is written: 0.1 is a tenth."""
    return rounded(Fraction(repr(value)))


def rounded(value: Fraction) -> Fraction:
    """Return a number rounded to the decimals of a scenario."""
    return Fraction(round(value * 10**COMPARED_DECIMALS), 10**COMPARED_DECIMALS)


def text_of(value: Fraction) -> str:
    """Return a number as a scenario writes it: no exponent, no needless zeros."""
    integer, part = divmod(round(value * 10**COMPARED_DECIMALS), 10**COMPARED_DECIMALS)
    return f"{integer}.{part:0{COMPARED_DECIMALS}d}".rstrip("0").rstrip(".")
