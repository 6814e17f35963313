"""Choose the size of the cells: the largest with which every edge is drawn about as long as it is.

error of an edge = cells x cell / length - 1
"""

from __future__ import annotations

from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np

from automaton.errors import InputError
from automaton.exchange.graphs.alignment import (
    Floats,
    GridPlaces,
    Integers,
    Placement,
    on_grid,
    turned,
)
from automaton.exchange.graphs.graph import Graph
from automaton.exchange.graphs.roads import Cell, ConflictError, Roads, lay_roads
from automaton.exchange.graphs.symbols import Drawing, draw
from automaton.exchange.imported_floor import MAX_CELLS, check_size
from automaton.floor.cells import CHARGER, STATION
from automaton.floor.drawn_floors import MAX_SIDE

CANDIDATES: Final = tuple(Fraction(k, 20) for k in range(40, 1, -1))  # 2.00, 1.95, ... 0.10 m
EXACT: Final = 1e-9  # an error that rounding alone makes


class Layout(NamedTuple):
    """The cells of a graph."""

    roads: Roads
    kinds: dict[Cell, int]  # of the cells that are not plain floor
    drawing: Drawing


class Fit(NamedTuple):
    """A graph on a grid of cells of one size."""

    cell: Fraction  # metres
    placement: Placement
    width: int
    height: int
    cells: Integers  # (edges,) how many moves each edge is
    error: Floats  # (edges,) as a share
    layout: Layout | None = None  # None: an error is above the limit
    refusal: str = ""

    @property
    def worst(self) -> int:
        """The edge with the largest error."""
        return int(np.abs(self.error).argmax())


def fit_graph(graph: Graph, cell: Fraction | None, accept: float) -> Fit:
    """Return a graph on cells of a size, by default the largest that is not refused.

    `accept`: the largest error. A fit with a refusal has an edge whose error is larger. Raises
    InputError where nodes or edges get in each other's way, or the floor becomes too large.
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
    """Return the fit of the largest cells, or the refused one that comes nearest."""
    nearest: Fit | None = None
    conflict: tuple[Fraction, ConflictError] | None = None
    check_size(*_size(placement, CANDIDATES[0]), graph.file, "give a larger --cell")
    for cell in CANDIDATES:
        width, height = _size(placement, cell)
        if max(width, height) > MAX_SIDE or width * height > MAX_CELLS:
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
            f"no cell from 2 m to {float(size):g} m will do; in cells of {float(size):g} m {what}"
        )
        raise InputError(text, graph.file)
    text = f"no cell from 2 m to 0.1 m will do; {float(nearest.cell):g} m comes nearest: "
    return nearest._replace(refusal=text + nearest.refusal)


def _worst_error(fit: Fit) -> float:
    return float(abs(fit.error[fit.worst]))


def _size(placement: Placement, cell: Fraction) -> tuple[int, int]:
    places = on_grid(placement, float(cell))
    return places.width, places.height


def _fitted(graph: Graph, placement: Placement, cell: Fraction, accept: float) -> Fit:
    """Return the fit of one size of cells. Raises ConflictError."""
    places = on_grid(placement, float(cell))
    ends = np.array([(edge.start, edge.end) for edge in graph.edges]).T
    metres = np.array([edge.metres for edge in graph.edges])
    cells = sum(np.abs(line[ends[1]] - line[ends[0]]) for line in (places.column, places.row))
    with np.errstate(over="ignore"):
        error = cells * float(cell) / metres - 1
    fit = Fit(cell, placement, places.width, places.height, np.asarray(cells), error)
    edge, share = graph.edges[fit.worst], float(error[fit.worst])
    if abs(share) > accept + EXACT:
        drawn = float(cells[fit.worst] * cell)
        text = (
            f"the edge {edge.name}, {edge.metres:.4g} m, would be {drawn:.4g} m "
            f"({100 * share:+.1f} %) in cells of {float(cell):g} m, at most {100 * accept:g} % are "
            "accepted"
        )
        return fit._replace(refusal=f"{text}: choose another --cell, or a larger --accept")
    return fit._replace(layout=_laid_out(graph, placement, places))


def _laid_out(graph: Graph, placement: Placement, places: GridPlaces) -> Layout:
    """Return the cells of a graph. Raises ConflictError."""
    roads = lay_roads(graph, placement, places)
    kinds = {roads.node_cells[node]: STATION for one in graph.stations for node in one.nodes}
    kinds |= {roads.node_cells[node]: CHARGER for node in graph.chargers}
    return Layout(roads, kinds, draw(roads.exits, kinds, places.width, places.height))
