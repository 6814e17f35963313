"""Import a layout that is a graph: fit it to cells, draw it, and report on every edge.

Robots use the largest part of the floor from which they can return; the rest is left out.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NamedTuple

from automaton.errors import InputError
from automaton.exchange.graphs.fit import (
    Fit,
    GraphCells,
    Speeds,
    exact,
    limits_of,
    speeds_of,
    text_of,
)
from automaton.exchange.graphs.graph import Cell, Graph, GraphRoads, Road, distinct
from automaton.exchange.graphs.lif import read_lif
from automaton.exchange.graphs.opentcs import read_opentcs
from automaton.exchange.graphs.vehicle_fit import (
    fit_vehicles,
    size_notes,
    size_of,
    speed_notes,
)
from automaton.exchange.imported_floor import (
    EdgeRow,
    ImportedFloor,
    ImportOptions,
    ImportReport,
    check_values,
)
from automaton.floor.floor_plan import DIRECTION_VECTORS, STATION
from automaton.strategy.lookup import IMPORTED, default_for
from automaton.units import count

LEAST_ORDERS: Final = 20  # shortest run of a scenario
ORDERS_PER_ROBOT: Final = 5
MAX_IMPORTED_ORDERS: Final = 2000
AT_STATION: Final = 10  # seconds that a robot stands at a station
MAX_STOP: Final = 10_000  # ticks
RUN_HOURS: Final = 1
MAX_TICKS: Final = 2_000_000_000
MAX_CORNERS: Final = 1000  # corners of a path of cells
GROUPS: Final = ("all", "empty", "loaded")  # forbidden names of types of robots
MAX_MARKS: Final = 9  # edges that are marked in the picture, by a digit each
MAX_NOTED_CELLS: Final = 10  # cells in a note
UNMARKED_ERROR: Final = 0.001  # errors up to this are not marked


def import_lif(path: Path, options: ImportOptions) -> ImportedFloor:
    """Import a layout of VDMA LIF. Raises InputError."""
    return import_graph(read_lif(path, options.layout, options.type), options)


def import_opentcs(path: Path, options: ImportOptions) -> ImportedFloor:
    """Import a plant model of openTCS. Raises InputError."""
    return import_graph(read_opentcs(path), options)


def import_graph(graph: Graph, options: ImportOptions) -> ImportedFloor:
    """Return a graph as a floor; without a floor if its report has a refusal. Raises InputError."""
    fit = fit_vehicles(graph, options)
    speeds = speeds_of(graph, fit.cell, options)
    if fit.layout is None:
        rows = edge_rows(graph, fit, speeds, speeds.of_edge)
        refusal = f"{graph.file}: {fit.refusal}"
        facts, lost = facts_of(graph, fit, speeds), dict(graph.lost.most_common())
        report = ImportReport(graph.format, facts, rows, lost, refusal=refusal)
        return ImportedFloor("", {}, {}, report)
    roads, kinds, drawing = fit.layout
    scenario = GraphScenario(graph, fit.layout, speeds, options)
    sections = scenario.sections()
    check_values(sections, graph.file)
    facts = facts_of(graph, fit, speeds) | {
        "stations": sum(kind == STATION for kind in kinds.values()),
        "chargers": len(graph.chargers),
        "robots": sections["fleet"]["robots"],
    }
    rows = edge_rows(graph, fit, speeds, speeds_of_edges(roads, scenario.of_road))
    report = ImportReport(
        graph.format,
        facts,
        rows,
        dict(graph.lost.most_common()),
        (
            *graph.notes,
            *size_notes(graph, fit, options),
            *speed_notes(graph, rows, speeds),
            *crossing_notes(roads),
            *scenario.notes,
        ),
        drawing.picture,
        marks_of(graph, roads, rows),
    )
    comments = (f"Imported from {Path(graph.file).name}: {graph.format}.",)
    names = scenario.places.locations
    return ImportedFloor(drawing.picture, drawing.entries, sections, report, names, comments)


def facts_of(graph: Graph, fit: Fit, speeds: Speeds) -> dict[str, str | int | float]:
    """Return the results of an import."""
    return {
        "cell_m": float(fit.cell),
        "tick_s": float(speeds.tick),
        "columns": fit.width,
        "rows": fit.height,
        "turned_degrees": fit.placement.degrees,
        "nodes": len(graph.nodes),
        "edges": len(graph.edges),
    }


def speeds_of_edges(roads: GraphRoads, of_road: list[Fraction]) -> tuple[Fraction, ...]:
    """Return the speed of each edge on the floor, from the speed of each road."""
    pairs = zip(roads.roads, of_road, strict=True)
    of_edge = {edge: speed for road, speed in pairs for edge in road.edges}
    return tuple(of_edge[edge] for edge in range(len(of_edge)))


def edge_rows(
    graph: Graph, fit: Fit, speeds: Speeds, drawn: tuple[Fraction, ...]
) -> tuple[EdgeRow, ...]:
    """Return a row for each edge, the worst first; `drawn`: the speed of each on the floor."""
    ticks = {speed: speeds.ticks(speed) for speed in set(drawn)}
    cell = float(fit.cell)
    rows = [
        EdgeRow(
            edge.name,
            edge.metres,
            int(fit.cells[number]),
            int(fit.cells[number]) * cell,
            speeds.wanted(graph, number),
            int(fit.cells[number]) * ticks[drawn[number]],
        )
        for number, edge in enumerate(graph.edges)
    ]
    return tuple(sorted(rows, key=lambda row: -round(abs(row.error), 9)))


def marks_of(graph: Graph, roads: GraphRoads, rows: tuple[EdgeRow, ...]) -> dict[Cell, str]:
    """Return digits for the worst edges, at the middle of each: their lines in the report."""
    middle = {
        graph.edges[road.edges[0]].name: road.between[len(road.between) // 2]
        for road in roads.roads
        if road.between
    }
    return {
        middle[row.name]: str(place)
        for place, row in enumerate(rows[:MAX_MARKS], 1)
        if abs(row.error) > UNMARKED_ERROR and row.name in middle
    }


def crossing_notes(roads: GraphRoads) -> list[str]:
    """Return a sentence about roads that cross without a node."""
    if not roads.crossings:
        return []
    cells = roads.crossings
    shown = ", ".join(f"[{x}, {y}]" for x, y in cells[:MAX_NOTED_CELLS])
    more = ", ..." if len(cells) > MAX_NOTED_CELLS else ""
    where = count(len(cells), "cell")
    return [f"edges cross without a node in {where}: robots may turn there ({shown}{more})"]


# The sections of the scenario, except its floor.


class Places(NamedTuple):
    """The names of cells."""

    stations: dict[str, Cell]  # chargers left out
    locations: dict[str, Cell]  # all names, stations first


class GraphScenario:
    """A graph on a grid, about to become a scenario."""

    def __init__(
        self, graph: Graph, layout: GraphCells, speeds: Speeds, options: ImportOptions
    ) -> None:
        self.graph, self.speeds, self.options = graph, speeds, options
        self.roads, self.kinds = layout.roads, layout.kinds
        self.rows = layout.drawing.rows
        self.notes: list[str] = []
        self.places = self._places()
        self.of_road, several = limits_of(self.roads.roads, speeds)
        if several:
            limits = len({speed for speed in self.of_road if speed < speeds.fastest})
            self.notes.append(f"{several} different speed limits became {limits}, the lower ones")
        differ = sum(
            len({speeds.of_edge[edge] for edge in road.edges}) > 1 for road in self.roads.roads
        )
        if differ:
            graph.lost["speed of the faster direction of an edge"] += differ
        self.areas = self._areas()
        self.part = self._part()
        self.in_blocks: list[tuple[set[Cell], int]] = []  # cells, and the robots that they may hold
        self.blocks = self._blocks()

    def sections(self) -> dict[str, Any]:
        """Return the sections in their order."""
        speeds, graph = self.speeds, self.graph
        robots = self._robots()
        floor = {"blocks": self.blocks, "speed_limits": self._speed_limits()}
        sections: dict[str, Any] = {
            "name": graph.name,
            "summary": f"{len(self.rows[0])} x {len(self.rows)} cells, "
            f"{count(len(graph.nodes), 'node')}, {count(len(graph.edges), 'edge')}, imported.",
            "units": {"tick": f"{text_of(speeds.tick)} s", "cell": f"{text_of(speeds.cell)} m"},
            "fleet": self._fleet(robots),
            "durations": {"move": f"{text_of(speeds.fastest)} m/s"},
            "areas": self.areas,
            "floor": {key: value for key, value in floor.items() if value},
            "orders": self._orders(robots),
            "strategy": {"allocation": default_for("allocation", IMPORTED), "routing": "shortest"},
            "stop": {"when": "delivered", "max_duration": self._duration()},
            "seed": 1,
        }
        return {key: value for key, value in sections.items() if value != {}}

    def _places(self) -> Places:
        """Name the cells: stations, then nodes; a node with a station's name gets another name."""
        graph, cells = self.graph, self.roads.node_cells
        out = Places({}, {})
        spots = [
            (f"{station.name}/{number}" if len(station.nodes) > 1 else station.name, cells[node])
            for station in graph.stations
            for number, node in enumerate(station.nodes, 1)
        ]
        names = distinct(name for name, _ in spots)
        for name, (_, cell) in zip(names, spots, strict=True):
            out.locations[name] = cell
            if self.kinds[cell] == STATION:
                out.stations[name] = cell
        for node, cell in zip(graph.nodes, cells, strict=True):
            name = node.name
            while out.locations.setdefault(name, cell) != cell:
                name = f"{name} (node)"
        return out

    def _areas(self) -> dict[str, Any]:
        """Return the cells that are closed to robots with a load, or without one, as rectangles."""
        out: dict[str, Any] = {}
        for road in self.roads.roads:
            groups = {self.graph.edges[edge].closed_to for edge in road.edges}
            if groups == {""}:
                continue
            if len(groups) > 1 or not road.between:
                self.graph.lost["loadRestriction of one direction, or of an edge of one move"] += 1
                continue
            name = self.graph.edges[road.edges[0]].name
            path = corners(road.between)
            for number, (first, last) in enumerate(zip(path, path[1:] or path, strict=False), 1):
                key = f"{name}/{number}" if len(path) > 2 else name
                while key in out:
                    key += "'"
                out[key] = {"from": first, "to": last, "closed_to": sorted(groups)}
        return out

    def _part(self) -> set[Cell]:
        """Return the cells from which empty robots can return. Raises InputError."""
        closed = {
            cell
            for road in self.roads.roads
            for cell in road.between
            if all(self.graph.edges[edge].closed_to == "empty" for edge in road.edges)
        }
        part = largest_part({c: bits for c, bits in self.roads.exits.items() if c not in closed})
        if len(part) < 2:
            text = "no robot could return: the graph has neither a ring nor a two-way edge"
            raise InputError(text, self.graph.file)
        outside = sum(cell not in part for cell in self.places.stations.values())
        if outside:
            self.notes.append(
                f"{count(outside, 'station')} left out of tours: robots could not return from there"
            )
        return part

    def _robots(self) -> int:
        """Return the number of robots. Raises InputError if they do not fit."""
        robots = self.options.robots or len(self.graph.vehicles) or 1
        if robots > len(self.part):
            text = (
                f"{count(robots, 'robot')} do not fit on the {len(self.part):,} cells from which "
            )
            raise InputError(f"{text}robots come back: give --robots", self.graph.file)
        return robots

    def _fleet(self, robots: int) -> dict[str, Any]:
        """Return the robots, in types by speed, and their start cells: parking places first."""
        graph, cells = self.graph, self.roads.node_cells
        nodes = [*graph.parking, *(n for n in range(len(cells)) if n not in set(graph.parking))]
        first = dict.fromkeys(cells[node] for node in nodes)
        starts = self._starts([*first, *sorted(self.part - set(first))], robots)
        fleet: dict[str, Any] = {"robots": robots, "kinematics": "omni", "start": starts}
        sizes = zip(("length", "width"), size_of(graph, self.options), strict=True)
        fleet |= {side: f"{text_of(metres)} m" for side, metres in sizes if metres is not None}
        types = self._types(robots)
        return {**fleet, "types": types} if types else fleet

    def _starts(self, cells: list[Cell], robots: int) -> list[list[int]]:
        """Return the first cells from which robots can return, in a block no more than its limit."""
        begun = [0] * len(self.in_blocks)
        out: list[list[int]] = []
        for cell in cells:
            inside = [number for number, (block, _) in enumerate(self.in_blocks) if cell in block]
            full = any(begun[number] >= self.in_blocks[number][1] for number in inside)
            if len(out) < robots and cell in self.part and not full:
                out.append(list(cell))
                for number in inside:
                    begun[number] += 1
        if len(out) < robots:
            text = (
                f"{count(robots, 'robot')} cannot begin on the {len(out):,} cells that blocks leave"
            )
            raise InputError(f"{text}: give --robots", self.graph.file)
        return out

    def _types(self, robots: int) -> list[dict[str, Any]]:
        """Return the types of robots: one for each speed, named like its first robot."""
        graph = self.graph
        if not graph.vehicles:
            return [{"name": type_name(graph.type)}] if graph.type else []
        many: Counter[Fraction] = Counter()
        names: dict[Fraction, str] = {}
        for number in range(robots):
            robot = graph.vehicles[number % len(graph.vehicles)]
            speed = exact(robot.speed) if robot.speed else self.speeds.fastest
            speed = min(speed, self.speeds.fastest)
            many[speed] += 1
            names.setdefault(speed, type_name(robot.name))
        if len(many) > 100:
            raise InputError(f"its robots have {len(many)} different speeds, at most 100 are allowed",
                             graph.file)  # fmt: skip
        return [
            {"name": name, "robots": many[speed]}
            | (
                {"durations": {"move": f"{text_of(speed)} m/s"}}
                if speed < self.speeds.fastest
                else {}
            )
            for (speed, name) in zip(names, distinct(names.values()), strict=True)
        ]

    def _speed_limits(self) -> list[dict[str, Any]]:
        """Return the roads that are slower than the fastest robot; winding roads in pieces."""
        out = []
        for road, speed in zip(self.roads.roads, self.of_road, strict=True):
            if speed < self.speeds.fastest:
                path = corners(road.cells)
                pieces = range(0, len(path) - 1, MAX_CORNERS - 1)
                out += [
                    {"cells": path[at : at + MAX_CORNERS], "max_speed": f"{text_of(speed)} m/s"}
                    for at in pieces
                ]
        return out

    def _blocks(self) -> list[dict[str, Any]]:
        """Return the blocks; blocks of unconnected cells are counted as lost."""
        road_of = {edge: road for road in self.roads.roads for edge in road.edges}
        out = []
        for block in self.graph.blocks:
            cells = {self.roads.node_cells[node] for node in block.nodes}
            for edge in block.edges:
                cells |= set(road_of[edge].between)
            ways = self._ways(cells, [road_of[edge] for edge in block.edges])
            path = walk(ways) if cells else None
            bends = corners(path) if path else []
            is_path = path is not None and len(path) == len(cells)
            if not bends or len(bends) > MAX_CORNERS or (block.same_direction and not is_path):
                self.graph.lost["blocks that are not connected, or too wide"] += 1
                continue
            robots = len(cells) if block.same_direction else 1
            self.in_blocks.append((cells, robots))
            direction = "same" if block.same_direction else "any"
            out.append({"cells": bends, "max_robots": robots, "direction": direction})
            self.notes.append(f"block {block.name}: {count(len(cells), 'cell')}")
        return out

    def _ways(self, cells: set[Cell], roads: list[Road]) -> dict[Cell, set[Cell]]:
        """Return for each cell of a block its neighbours on the same road."""
        ways: dict[Cell, set[Cell]] = defaultdict(set, {cell: set() for cell in sorted(cells)})
        for road in roads:
            for one, other in zip(road.cells, road.cells[1:], strict=False):
                if one in cells and other in cells:
                    ways[one].add(other)
                    ways[other].add(one)
        return dict(ways)

    def _orders(self, robots: int) -> dict[str, Any]:
        """Return tours over the stations from which robots can return, else over all cells."""
        names = [name for name, cell in self.places.stations.items() if cell in self.part]
        many = min(max(LEAST_ORDERS, ORDERS_PER_ROBOT * robots), MAX_IMPORTED_ORDERS)
        if len(names) < 2:
            return {"generator": "tours", "count": many, "stops": {"from": 1, "to": 3}}
        ticks = int(AT_STATION / self.speeds.tick + Fraction(1, 2))
        stay = {"for": f"{AT_STATION} s"} if 1 <= ticks <= MAX_STOP else {}
        return {
            "list": [
                {"stops": [{"at": names[(k + j) % len(names)], **stay} for j in range(2)]}
                for k in range(many)
            ]
        }

    def _duration(self) -> str | int:
        """Return the length of a run."""
        ticks = 3600 * RUN_HOURS / self.speeds.tick
        return self.options.ticks or (f"{RUN_HOURS} h" if 1 <= ticks < MAX_TICKS else 1000)


def type_name(name: str) -> str:
    """Return a valid name of a type of robots."""
    return f"{name} (type)" if name in GROUPS else name


# Paths over cells, and the cells from which robots can return.


def corners(cells: Sequence[Cell]) -> list[list[int]]:
    """Return the ends and the corners of a path of neighbouring cells."""
    out = [cells[0]]
    for place in range(1, len(cells) - 1):
        (x, y), (u, v), (s, t) = cells[place - 1 : place + 2]
        if (u - x, v - y) != (s - u, t - v):
            out.append((u, v))
    if len(cells) > 1:
        out.append(cells[-1])
    return [list(cell) for cell in out]


def walk(ways: dict[Cell, set[Cell]]) -> list[Cell] | None:
    """Return a path over all cells of a set, which may go back over cells, or None.

    `ways`: for each cell its neighbours in the set, to or from which robots drive. A path without
    branches is walked from end to end.
    """
    ends = [cell for cell, beside in ways.items() if len(beside) < 2]
    first = ends[0] if ends else next(iter(ways))
    path, walked = [first], {first}
    open_cells = [(first, iter(sorted(ways[first])))]
    while open_cells:
        ahead = next((cell for cell in open_cells[-1][1] if cell not in walked), None)
        if ahead is not None:
            walked.add(ahead)
            path.append(ahead)
            open_cells.append((ahead, iter(sorted(ways[ahead]))))
            continue
        open_cells.pop()
        if len(walked) == len(ways):
            return path
        if open_cells:
            path.append(open_cells[-1][0])
    return None


def largest_part(exits: dict[Cell, int]) -> set[Cell]:
    """Return the largest set of cells that all reach each other; of equal sets the first.

    The algorithm is R. Tarjan's (Depth-first search and linear graph algorithms, 1972), without
    recursion.
    """
    order: dict[Cell, int] = {}
    low: dict[Cell, int] = {}
    stack: list[Cell] = []
    on_stack: set[Cell] = set()
    best: list[Cell] = []
    for first in exits:
        if first in order:
            continue
        order[first] = low[first] = len(order)
        stack.append(first)
        on_stack.add(first)
        ways = [(first, iter(neighbours(exits, first)))]
        while ways:
            cell, ahead = ways[-1]
            for there in ahead:
                if there not in order:
                    order[there] = low[there] = len(order)
                    stack.append(there)
                    on_stack.add(there)
                    ways.append((there, iter(neighbours(exits, there))))
                    break
                if there in on_stack:
                    low[cell] = min(low[cell], order[there])
            else:
                ways.pop()
                if ways:
                    low[ways[-1][0]] = min(low[ways[-1][0]], low[cell])
                if low[cell] == order[cell]:
                    part = _cut(stack, cell)
                    on_stack.difference_update(part)
                    best = part if len(part) > len(best) else best
    return set(best)


def neighbours(exits: dict[Cell, int], cell: Cell) -> list[Cell]:
    """Return the neighbours to which robots drive from a cell."""
    ahead = [
        (cell[0] + dx, cell[1] + dy)
        for direction, (dx, dy) in enumerate(DIRECTION_VECTORS)
        if exits[cell] >> direction & 1
    ]
    return [there for there in ahead if there in exits]


def _cut(stack: list[Cell], cell: Cell) -> list[Cell]:
    """Pop a stack down to a cell."""
    part = [stack.pop()]
    while part[-1] != cell:
        part.append(stack.pop())
    return part
