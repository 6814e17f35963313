"""Draw the edges of a graph as rows of cells, and find where two of them are in each other's way.

All edges between the same two nodes are one road. It runs along its axis, or as a staircase:

    A─┐            A robot on it does as many moves as there are rows and columns between its nodes,
      └─┐          whichever way the staircase goes.
        └─B
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import NamedTuple

from automaton.exchange.graphs.alignment import GridPlaces, Placement
from automaton.exchange.graphs.graph import Graph
from automaton.floor.cells import DIRECTION_VECTORS

Cell = tuple[int, int]  # (x, y)
DIRECTION_OF = {vector: direction for direction, vector in enumerate(DIRECTION_VECTORS)}


class Road(NamedTuple):
    """The cells between two nodes, both included, and the edges that lead along them."""

    start: int  # the node with the lower index
    end: int
    cells: tuple[Cell, ...]  # from start to end
    edges: tuple[int, ...]

    @property
    def between(self) -> tuple[Cell, ...]:
        """The cells that are not its nodes'."""
        return self.cells[1:-1]


class ConflictError(Exception):
    """Two things that would share a cell without meeting there; `str` names them."""


@dataclass
class Roads:
    """All roads of a graph on a grid."""

    roads: list[Road]
    node_cells: list[Cell]
    exits: dict[Cell, int] = field(default_factory=dict)  # bits by direction
    crossings: list[Cell] = field(default_factory=list)  # where roads cross without a node


def lay_roads(graph: Graph, placement: Placement, places: GridPlaces) -> Roads:
    """Return the roads of a graph. Raises ConflictError."""
    cells = list(zip(places.column.tolist(), places.row.tolist(), strict=True))
    _check_nodes(graph, cells)
    edges: dict[tuple[int, int], list[int]] = defaultdict(list)
    for number, edge in enumerate(graph.edges):
        edges[min(edge.start, edge.end), max(edge.start, edge.end)].append(number)
    roads = [
        Road(start, end, tuple(staircase(cells[start], cells[end])), tuple(numbers))
        for (start, end), numbers in edges.items()
    ]
    out = Roads(roads, cells)
    out.crossings = _crossings(graph, placement, out)
    out.exits = _exits(graph, out)
    return out


def staircase(start: Cell, end: Cell) -> list[Cell]:
    """Return the cells from one to another, each a neighbour of the one before.

    They are those through which the straight line between the middles of both goes.
    """
    (x, y), (u, v) = start, end
    across, down = abs(u - x), abs(v - y)
    step_x, step_y = (1 if u > x else -1), (1 if v > y else -1)
    cells, done_x, done_y = [start], 0, 0
    while (x, y) != end:
        # The line leaves the cell over the side that it meets first.
        if (2 * done_x + 1) * down <= (2 * done_y + 1) * across and done_x < across:
            x, done_x = x + step_x, done_x + 1
        else:
            y, done_y = y + step_y, done_y + 1
        cells.append((x, y))
    return cells


def _check_nodes(graph: Graph, cells: list[Cell]) -> None:
    taken: dict[Cell, int] = {}
    for node, cell in enumerate(cells):
        if cell in taken:
            names = f"{graph.nodes[taken[cell]].name} and {graph.nodes[node].name}"
            raise ConflictError(f"the nodes {names} would be in one cell")
        taken[cell] = node


def _crossings(graph: Graph, placement: Placement, roads: Roads) -> list[Cell]:
    """Return the cells where roads cross; raise ConflictError where they otherwise share one."""
    node_of = {cell: node for node, cell in enumerate(roads.node_cells)}
    taken: dict[Cell, int] = {}
    out: dict[Cell, None] = {}
    for number, road in enumerate(roads.roads):
        for cell in road.between:
            if cell in node_of:
                name = graph.edges[road.edges[0]].name
                node = graph.nodes[node_of[cell]].name
                raise ConflictError(f"the edge {name} would go through the cell of the node {node}")
            other = roads.roads[taken.setdefault(cell, number)]
            if other is road:
                continue
            if not _cross(placement, road, other):
                names = " and ".join(graph.edges[one.edges[0]].name for one in (other, road))
                raise ConflictError(
                    f"the edges {names} would be in one cell, where they do not meet"
                )
            out[cell] = None
    return list(out)


def _cross(placement: Placement, road: Road, other: Road) -> bool:
    """Whether the straight lines of two roads cross, each between the ends of the other."""
    ends = (road.start, road.end, other.start, other.end)
    a, b, c, d = ((float(placement.x[node]), float(placement.y[node])) for node in ends)
    return _side(a, b, c) * _side(a, b, d) < 0 and _side(c, d, a) * _side(c, d, b) < 0


def _side(a: tuple[float, float], b: tuple[float, float], p: tuple[float, float]) -> int:
    """On which side of the line from a to b a point lies: 1, -1, or 0 on it."""
    area = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    return (area > 0) - (area < 0)


def _exits(graph: Graph, roads: Roads) -> dict[Cell, int]:
    """Return the exits of all cells: those of the edges that lead through them, and no others."""
    exits: dict[Cell, int] = defaultdict(int)
    for road in roads.roads:
        forwards = {graph.edges[edge].start == road.start for edge in road.edges}
        for one, other in zip(road.cells, road.cells[1:], strict=False):
            direction = DIRECTION_OF[other[0] - one[0], other[1] - one[1]]
            exits[one] |= (True in forwards) << direction
            exits[other] |= (False in forwards) << (direction ^ 2)
    return dict(exits)
