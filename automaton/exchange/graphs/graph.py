"""A layout as a graph of nodes and edges, and its placement on a grid of cells.

    angle   the angle mod 90 degrees, in steps of 0.1, with the most edge length
    snap    coordinates of an axis that differ by at most a quarter of a cell become their mean
    column  floor((x - least x) / cell + 1/2); rows likewise, from above

All edges between the same two nodes are one road. It runs along its axis, or as a staircase:

    A─┐            A robot on it makes one move for each row and column between its nodes, for any
      └─┐          shape of the staircase. If two roads get in each other's way, the layout cannot
        └─B        be drawn with cells of this size.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.floor.floor_plan import DIRECTION_VECTORS
from automaton.printable import one_line

FARTHEST_NODE: Final = 1e9  # metres
MAX_SPEED: Final = 1000.0  # m/s
MAX_LENGTH: Final = 1e9  # metres of an edge
LONGEST_NODE_NAME: Final = 100

STEPS_PER_DEGREE: Final = 10  # in a degree
SNAP: Final = 0.25  # of a cell
CLOSE: Final = 1e-9  # of a cell: rounding error of coordinates
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Cell = tuple[int, int]  # (x, y)
DIRECTION_OF = {vector: direction for direction, vector in enumerate(DIRECTION_VECTORS)}


class Node(NamedTuple):
    """A place where robots stop or turn off; y points upwards."""

    name: str
    x: float  # metres
    y: float


class Edge(NamedTuple):
    """A way from one node to another, in one direction."""

    name: str
    start: int  # nodes, by index
    end: int
    metres: float
    speed: float | None  # m/s; None: not given
    closed_to: str = ""  # "loaded" or "empty": robots that must not drive here


class GraphStation(NamedTuple):
    """A station and the nodes at which robots interact with it."""

    name: str
    nodes: tuple[int, ...]


class NodeBlock(NamedTuple):
    """Nodes and edges that few robots may be on at a time."""

    name: str
    nodes: tuple[int, ...]
    edges: tuple[int, ...]
    same_direction: bool  # any number of robots in the same direction; else one robot


class Vehicle(NamedTuple):
    """A robot that the file names."""

    name: str
    speed: float | None  # m/s
    length: float | None = None  # metres
    width: float | None = None


@dataclass
class Graph:
    """The graph of a file. Edges lead between different nodes, names are single lines."""

    file: str
    format: str
    name: str
    nodes: list[Node] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    stations: list[GraphStation] = field(default_factory=list)
    chargers: set[int] = field(default_factory=set)  # nodes
    parking: list[int] = field(default_factory=list)  # nodes where robots preferably begin
    blocks: list[NodeBlock] = field(default_factory=list)
    vehicles: list[Vehicle] = field(default_factory=list)
    type: str = ""  # of the robots, if all have the same
    lost: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def straight(self, start: int, end: int) -> float:
        """Metres from a node to another as the crow flies."""
        a, b = self.nodes[start], self.nodes[end]
        return math.hypot(b.x - a.x, b.y - a.y)


def single_line(name: str) -> str:
    """Return a name for scenarios and reports: one line, not empty, not too long."""
    return (
        one_line(" ".join(name.split()), LONGEST_NODE_NAME)[:LONGEST_NODE_NAME].strip() or "unnamed"
    )


def distinct(names: Iterable[str]) -> list[str]:
    """Return the names as single lines; equal names get a number each."""
    out: list[str] = []
    used: set[str] = set()
    for name in map(single_line, names):
        number, one = 2, name
        while one in used:
            one, number = f"{name} ({number})", number + 1
        used.add(one)
        out.append(one)
    return out


def checked_graph(graph: Graph) -> Graph:
    """Return a graph whose nodes all have edges; other nodes are counted as lost. Raises InputError.

    Graphs without edges, and graphs with two nodes in the same place, are refused.
    """
    if not graph.edges:
        raise InputError("has no drivable edge", graph.file)
    used = {node for edge in graph.edges for node in (edge.start, edge.end)}
    places: dict[tuple[float, float], str] = {}
    for index in sorted(used):
        node = graph.nodes[index]
        other = places.setdefault((node.x, node.y), node.name)
        if other != node.name:
            text = f"the nodes {other} and {node.name} are both at x {node.x:g}, y {node.y:g}"
            raise InputError(text, graph.file)
    alone = len(graph.nodes) - len(used)
    if alone:
        graph.lost["nodes without an edge"] += alone
        _drop_nodes(graph, used)
    graph.nodes = [
        node._replace(name=name)
        for node, name in zip(graph.nodes, distinct(n.name for n in graph.nodes), strict=True)
    ]
    graph.edges = [edge._replace(name=single_line(edge.name)) for edge in graph.edges]
    return graph


def _drop_nodes(graph: Graph, used: set[int]) -> None:
    """Leave only some nodes, with their edges and stations."""
    number = {node: place for place, node in enumerate(sorted(used))}
    graph.nodes = [graph.nodes[node] for node in number]
    graph.edges = [
        edge._replace(start=number[edge.start], end=number[edge.end]) for edge in graph.edges
    ]
    stations = [
        station._replace(nodes=tuple(number[node] for node in station.nodes if node in used))
        for station in graph.stations
    ]
    graph.stations = [station for station in stations if station.nodes]
    if len(stations) > len(graph.stations):
        graph.lost["stations without an edge"] += len(stations) - len(graph.stations)
    graph.chargers = {number[node] for node in graph.chargers & used}
    graph.parking = [number[node] for node in graph.parking if node in used]
    graph.blocks = [
        block._replace(nodes=tuple(number[node] for node in block.nodes if node in used))
        for block in graph.blocks
    ]


# The nodes on a grid: turned so that most edges run along it, and snapped to it.


class Placement(NamedTuple):
    """The nodes of a graph turned along the axes; metres, y upwards."""

    x: Floats  # (nodes,)
    y: Floats
    degrees: float  # clockwise turn of the layout


class GridPlaces(NamedTuple):
    """The cells of the nodes for one size of cells."""

    column: Integers  # (nodes,) from 0
    row: Integers  # (nodes,) from 0 at the top
    width: int
    height: int


def turned(graph: Graph) -> Placement:
    """Return the nodes turned by the angle with the most edge length."""
    x, y = np.array([(node.x, node.y) for node in graph.nodes]).T
    ends = np.array([(edge.start, edge.end) for edge in graph.edges])
    dx, dy = (c[ends[:, 1]] - c[ends[:, 0]] for c in (x, y))
    steps = np.rint(np.degrees(np.arctan2(dy, dx)) * STEPS_PER_DEGREE).astype(np.int64) % (
        90 * STEPS_PER_DEGREE
    )
    angle = int(np.bincount(steps, np.hypot(dx, dy)).argmax()) / STEPS_PER_DEGREE
    degrees = angle - 90 if angle > 45 else angle
    if degrees == 0:
        return Placement(x, y, 0.0)
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return Placement(x * cos + y * sin, y * cos - x * sin, degrees)


def on_grid(placement: Placement, cell: float) -> GridPlaces:
    """Return the cell of each node; numbers too large for a floor are clipped."""
    column, up = (_indices(_snapped(c, cell), cell) for c in (placement.x, placement.y))
    return GridPlaces(column, up.max() - up, int(column.max()) + 1, int(up.max()) + 1)


def _indices(coordinates: Floats, cell: float) -> Integers:
    steps = (coordinates - coordinates.min()) / cell
    cells: Integers = np.floor(np.minimum(steps, 1e12) + 0.5 + CLOSE).astype(np.int64)
    return cells


def _snapped(coordinates: Floats, cell: float) -> Floats:
    """Return coordinates in which close ones are replaced by their mean."""
    order = np.argsort(coordinates, kind="stable")
    ordered = coordinates[order]
    near = SNAP * cell * (1 + CLOSE)
    group, first = np.zeros(len(ordered), np.int64), 0
    starts = np.flatnonzero(np.diff(ordered, prepend=-np.inf) > 0)  # different values only
    number = -1
    for place in starts.tolist():
        if number < 0 or ordered[place] - ordered[first] > near:
            number, first = number + 1, place
        group[place] = number
    group = np.maximum.accumulate(group)
    mean = np.bincount(group, ordered) / np.bincount(group)
    single = np.bincount(group) == 1
    out = np.empty_like(coordinates)
    out[order] = np.where(single[group], ordered, mean[group])
    return out


# The edges as rows of cells.


class Road(NamedTuple):
    """The cells between two nodes, both included, and the edges that lead along them."""

    start: int  # the node with the lower index
    end: int
    cells: tuple[Cell, ...]  # from start to end
    edges: tuple[int, ...]

    @property
    def between(self) -> tuple[Cell, ...]:
        """The cells without those of its nodes."""
        return self.cells[1:-1]


class ConflictError(Exception):
    """Two parts that would share a cell without meeting there; `str` names them."""


@dataclass
class GraphRoads:
    """All roads of a graph on a grid."""

    roads: list[Road]
    node_cells: list[Cell]
    exits: dict[Cell, int] = field(default_factory=dict)  # bits by direction
    crossings: list[Cell] = field(default_factory=list)  # where roads cross without a node


def lay_roads(graph: Graph, placement: Placement, places: GridPlaces) -> GraphRoads:
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
    out = GraphRoads(roads, cells)
    out.crossings = _crossings(graph, placement, out)
    out.exits = _exits(graph, out)
    return out


def staircase(start: Cell, end: Cell) -> list[Cell]:
    """Return the cells from one to another, each a neighbour of the previous one.

    The straight line between the centres of both goes through these cells.
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


def _crossings(graph: Graph, placement: Placement, roads: GraphRoads) -> list[Cell]:
    """Return the cells where roads cross; raise ConflictError if roads share a cell otherwise."""
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
    """Whether the straight lines of two roads cross between their ends."""
    ends = (road.start, road.end, other.start, other.end)
    a, b, c, d = ((float(placement.x[node]), float(placement.y[node])) for node in ends)
    return _side(a, b, c) * _side(a, b, d) < 0 and _side(c, d, a) * _side(c, d, b) < 0


def _side(a: tuple[float, float], b: tuple[float, float], p: tuple[float, float]) -> int:
    """The side of the line from a to b on which a point lies: 1, -1, or 0 on the line."""
    area = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    return (area > 0) - (area < 0)


def _exits(graph: Graph, roads: GraphRoads) -> dict[Cell, int]:
    """Return the exits of all cells: exactly those of the edges through them."""
    exits: dict[Cell, int] = defaultdict(int)
    for road in roads.roads:
        forwards = {graph.edges[edge].start == road.start for edge in road.edges}
        for one, other in zip(road.cells, road.cells[1:], strict=False):
            direction = DIRECTION_OF[other[0] - one[0], other[1] - one[1]]
            exits[one] |= (True in forwards) << direction
            exits[other] |= (False in forwards) << (direction ^ 2)
    return dict(exits)
