"""A layout as a graph: nodes in a plane, edges that robots drive along, stations, chargers, blocks."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from automaton.errors import InputError
from automaton.printable import one_line

FARTHEST: Final = 1e9  # metres
MAX_SPEED: Final = 1000.0  # m/s
MAX_LENGTH: Final = 1e9  # metres of an edge
LONGEST_NAME: Final = 100


class Node(NamedTuple):
    """A place where robots stop or turn off; y points upwards."""

    name: str
    x: float  # metres
    y: float


class Edge(NamedTuple):
    """A way from one node to another, in this direction alone."""

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


class Block(NamedTuple):
    """Nodes and edges that few robots may be on at a time."""

    name: str
    nodes: tuple[int, ...]
    edges: tuple[int, ...]
    same_direction: bool  # any number that drive the same way; else one robot


class Vehicle(NamedTuple):
    """A robot that the file names."""

    name: str
    speed: float | None  # m/s


@dataclass
class Graph:
    """What was read of a file. Edges lead between different nodes, names are single lines."""

    file: str
    format: str
    name: str
    nodes: list[Node] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    stations: list[GraphStation] = field(default_factory=list)
    chargers: set[int] = field(default_factory=set)  # nodes
    parking: list[int] = field(default_factory=list)  # nodes where robots begin first
    blocks: list[Block] = field(default_factory=list)
    vehicles: list[Vehicle] = field(default_factory=list)
    type: str = ""  # of the robots, where all are of one
    lost: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def straight(self, start: int, end: int) -> float:
        """Metres from a node to another as the crow flies."""
        a, b = self.nodes[start], self.nodes[end]
        return math.hypot(b.x - a.x, b.y - a.y)


def single_line(name: str) -> str:
    """Return a name as scenarios and reports may have it: one line, not empty, not too long."""
    return one_line(" ".join(name.split()), LONGEST_NAME)[:LONGEST_NAME].strip() or "unnamed"


def distinct(names: Iterable[str]) -> list[str]:
    """Return the names as single lines; where several have become alike, with a number each."""
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
    """Return a graph whose nodes all have edges; others are counted as lost. Raises InputError.

    Refused are graphs without edges, and those in which two nodes lie in the same place.
    """
    if not graph.edges:
        raise InputError("has no edge on which robots could drive", graph.file)
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
    """Leave only some nodes, and what lies at them."""
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
