"""The floor of a scenario as a file of VDMA LIF, versions 1.0.0 and 2.0.0.

    v#######^###      A cell with a single way in and a single way straight out is not a node, unless
    >>>>>>>>└──t      it is a station or a charger, or moves take longer on one side of it. An edge
                      leads over such cells to the next node, in one direction.

Nodes are called x_y, as in a trace of VDA 5050, and lie in the middle of their cells: x and y are metres
to the right of and above the lower left corner of the floor. All robots are of one type. LIF has ways,
stations and chargers; other parts of a floor are counted as lost.

Source: VDMA, Layout Interchange Format.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.graphs.graph import distinct
from automaton.floor.floor_plan import (
    CELL_KINDS,
    CHARGER,
    DIRECTIONS,
    FLOOR,
    STATION,
    WALL,
    WEIGHT_UNIT,
    FloorPlan,
)
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import Scenario
from automaton.units import exact_time

LONGEST_LIST = 3  # cells in an error

MANUFACTURER: Final = "automaton"
ROBOT_SERIES: Final = "robot"
LAYOUT_ID: Final = "floor"
LIF_VERSIONS: Final = ("2.0.0", "1.0.0")
LATEST_LIF: Final = "2.0.0"
LIF_DECIMALS: Final = 9
FLOOR_PARTS: Final = ("closed", "doors", "blocks", "lifts")


class FloorEdge(NamedTuple):
    """A way between two nodes in one direction."""

    start: int  # flat cells
    end: int
    cells: int  # moves
    min_ticks: int  # least ticks of each of its moves


class FloorGraph(NamedTuple):
    """Nodes and edges in reading order."""

    nodes: list[int]  # flat cells
    edges: list[FloorEdge]
    alone: list[int]  # isolated drivable cells, without nodes


def floor_graph(floor_plan: FloorPlan) -> FloorGraph:
    """Return the graph of a floor. Raises InputError if a cell holds more than one robot."""
    crowded = np.flatnonzero(floor_plan.drivable & (floor_plan.capacity != 1))
    if len(crowded):
        places = ", ".join(
            str(list(floor_plan.xy(cell))) for cell in crowded[:LONGEST_LIST].tolist()
        )
        more = ", ..." if len(crowded) > LONGEST_LIST else ""
        raise InputError(
            f"{len(crowded):,} cells of the floor hold more than one robot ({places}{more}); a node of a "
            "graph holds one"
        )
    exits = floor_plan.exits.reshape(-1)
    ticks = _ticks(floor_plan)
    incoming = _incoming(floor_plan)
    used = (exits | incoming) != 0
    straight = _straight_on(floor_plan, exits, incoming, ticks)
    nodes = np.flatnonzero(used & ~straight)
    edges = []
    for start in nodes.tolist():
        for direction in range(len(DIRECTIONS)):
            if exits[start] >> direction & 1:
                edges.append(_edge(floor_plan, straight, start, direction, ticks))
    alone = np.flatnonzero(floor_plan.drivable.reshape(-1) & ~used)
    return FloorGraph(nodes.tolist(), edges, alone.tolist())


def _ticks(floor_plan: FloorPlan) -> npt.NDArray[np.uint16]:
    """(cells, 4) least ticks of a move out of a cell, by direction."""
    if len(floor_plan.min_move_ticks):
        return floor_plan.min_move_ticks
    return np.zeros((floor_plan.kind.size, len(DIRECTIONS)), np.uint16)


def _incoming(floor_plan: FloorPlan) -> npt.NDArray[np.uint8]:
    """(cells,) directions of travel in which a cell is entered, as bits."""
    exits = floor_plan.exits.reshape(-1)
    incoming = np.zeros_like(exits)
    for direction, offset in enumerate(floor_plan.offsets):
        # np.roll wraps around only through the border, which has no exits.
        incoming |= np.roll(exits & np.uint8(1 << direction), offset)
    return incoming


def _straight_on(
    floor_plan: FloorPlan,
    exits: npt.NDArray[np.uint8],
    incoming: npt.NDArray[np.uint8],
    ticks: npt.NDArray[np.uint16],
) -> npt.NDArray[np.bool_]:
    """(cells,) whether exactly one way leads in and straight out, at one speed."""
    kind = floor_plan.kind.reshape(-1)
    straight = np.zeros(kind.size, np.bool_)
    for direction, offset in enumerate(floor_plan.offsets):
        before = np.roll(ticks[:, direction], offset)
        straight |= (
            (exits == 1 << direction) & (exits == incoming) & (before == ticks[:, direction])
        )
    out: npt.NDArray[np.bool_] = straight & (kind != STATION) & (kind != CHARGER)
    return out


def _edge(
    floor_plan: FloorPlan,
    straight: npt.NDArray[np.bool_],
    start: int,
    direction: int,
    ticks: npt.NDArray[np.uint16],
) -> FloorEdge:
    """The edge that leaves a node in a direction."""
    offset = floor_plan.offsets[direction]
    end, cells = start + offset, 1
    while straight[end]:
        end, cells = end + offset, cells + 1
    return FloorEdge(start, end, cells, int(ticks[start, direction]))


# The file.


class LifFile(NamedTuple):
    """A layout, ready to be written as JSON."""

    data: dict[str, Any]
    nodes: int
    edges: int
    lost: dict[str, int]  # parts that LIF cannot hold, with their counts


def lif_file(
    scenario: Scenario,
    floor_plan: FloorPlan,
    station_names: Sequence[str],
    version: str = LATEST_LIF,
    timestamp: str = "1970-01-01T00:00:00.000Z",
) -> LifFile:
    """Return the layout of a scenario's floor.

    `station_names`: of stations 1, 2, ...; a number is replaced by the cell's name in locations, if any.
    Raises InputError if a cell has no size or holds more than one robot.
    """
    cell = scenario.units.scale.cell_metres
    graph = floor_graph(floor_plan)
    if not graph.edges:
        raise InputError("no cells of the floor are connected")
    writer = (_Lif1 if version == "1.0.0" else _Lif2)(scenario, floor_plan, cell)
    layout = {
        "layoutId": LAYOUT_ID,
        "layoutVersion": "1",
        "layoutLevelId": "0",
        "nodes": [writer.node(node) for node in graph.nodes],
        "edges": [writer.edge(edge) for edge in graph.edges],
        "stations": _stations(writer, graph, _named(scenario, floor_plan, station_names)),
    }
    data = writer.file(layout, timestamp)
    return LifFile(data, len(graph.nodes), len(graph.edges), _lost(scenario, floor_plan, graph))


class _Writer:
    """Nodes and edges, common to both versions."""

    node_properties: str
    edge_properties: str

    def __init__(self, scenario: Scenario, floor_plan: FloorPlan, cell: Fraction) -> None:
        self.name = scenario.name
        self.floor_plan = floor_plan
        self.cell = cell
        self.move_ticks = min(min(one.durations.moves) for one in types_of(scenario))
        self.tick = exact_time(scenario.units.tick)  # None: a tick is not a time

    def id_of(self, cell: int) -> str:
        """The node of a cell."""
        x, y = self.floor_plan.xy(cell)
        return f"{x}_{y}"

    def node(self, cell: int) -> dict[str, Any]:
        """A node."""
        x, y = self.floor_plan.xy(cell)
        row = self.floor_plan.height - y
        charges = self.floor_plan.kind.flat[cell] == CHARGER
        return {
            "nodeId": self.id_of(cell),
            "mapId": LAYOUT_ID,
            "nodePosition": {
                "x": decimal(self.cell * (2 * x + 1) / 2),
                "y": decimal(self.cell * (2 * row - 1) / 2),
            },
            self.node_properties: [self.of_type() | (self.charging() if charges else {})],
        }

    def edge(self, edge: FloorEdge) -> dict[str, Any]:
        """An edge, with its speed if a tick is a time."""
        start, end = self.id_of(edge.start), self.id_of(edge.end)
        speed = {}
        if self.tick is not None:
            ticks = max(edge.min_ticks, self.move_ticks)
            speed = {"speed": decimal(self.cell / (ticks * self.tick))}
        return {
            "edgeId": f"{start}-{end}",
            "startNodeId": start,
            "endNodeId": end,
            self.edge_properties: [self.of_type() | self.driving(**speed)],
        }

    def of_type(self) -> dict[str, Any]:
        """The robots for which properties hold."""
        raise NotImplementedError

    def charging(self) -> dict[str, Any]:
        """The properties of a node where robots charge."""
        raise NotImplementedError

    def driving(self, speed: float | None = None) -> dict[str, Any]:
        """The properties of an edge."""
        raise NotImplementedError

    def file(self, layout: dict[str, Any], timestamp: str) -> dict[str, Any]:
        """The whole file."""
        raise NotImplementedError


class _Lif1(_Writer):
    node_properties = "vehicleTypeNodeProperties"
    edge_properties = "vehicleTypeEdgeProperties"

    def of_type(self) -> dict[str, Any]:
        return {"vehicleTypeId": f"{MANUFACTURER}.{ROBOT_SERIES}"}

    def charging(self) -> dict[str, Any]:
        action = {"actionType": "startCharging", "requirementType": "OPTIONAL"}
        return {"actions": [{**action, "blockingType": "HARD"}]}

    def driving(self, speed: float | None = None) -> dict[str, Any]:
        known = {} if speed is None else {"maxSpeed": speed}
        return {"rotationAllowed": False, **known}

    def file(self, layout: dict[str, Any], timestamp: str) -> dict[str, Any]:
        meta = {"projectIdentification": self.name, "creator": MANUFACTURER}
        meta |= {"exportTimestamp": timestamp, "lifVersion": "1.0.0"}
        return {"metaInformation": meta, "layouts": [layout]}


class _Lif2(_Writer):
    node_properties = "mobileRobotTypeNodeProperties"
    edge_properties = "mobileRobotTypeEdgeProperties"

    def of_type(self) -> dict[str, Any]:
        return {"mobileRobotTypes": [{"manufacturer": MANUFACTURER, "seriesName": ROBOT_SERIES}]}

    def charging(self) -> dict[str, Any]:
        return {"feasibleActions": [{"actionType": "startCharging", "blockingType": "HARD"}]}

    def driving(self, speed: float | None = None) -> dict[str, Any]:
        return {} if speed is None else {"maximumSpeed": speed}

    def file(self, layout: dict[str, Any], timestamp: str) -> dict[str, Any]:
        meta = {"lifId": self.name, "creator": MANUFACTURER}
        meta |= {"exportTimestamp": timestamp, "lifVersion": "2.0.0"}
        return {
            "metaInformation": meta,
            "origins": [{"originId": LAYOUT_ID, "layouts": [layout]}],
        }


def decimal(value: Fraction) -> float:
    """A number in short decimal form: 1.2 and not 1.2000000000000002."""
    return float(round(value, LIF_DECIMALS))


def _stations(
    writer: _Writer, graph: FloorGraph, names: Sequence[str]
) -> list[dict[str, str | list[str]]]:
    """The stations that are connected."""
    nodes = set(graph.nodes)
    return [
        {"stationId": name, "interactionNodeIds": [writer.id_of(cell)]}
        for name, cell in zip(names, writer.floor_plan.stations.tolist(), strict=True)
        if cell in nodes
    ]


def _named(scenario: Scenario, floor_plan: FloorPlan, names: Sequence[str]) -> list[str]:
    """The name of each station, no two alike."""
    known: dict[int, str] = {}
    if isinstance(scenario.locations, dict):
        for name, (x, y) in scenario.locations.items():
            known.setdefault(floor_plan.cell(x, y), name)
    cells = floor_plan.stations.tolist()
    return distinct(
        known.get(cell, name) if name.isdecimal() else name
        for cell, name in zip(cells, names, strict=True)
    )


def _lost(scenario: Scenario, floor_plan: FloorPlan, graph: FloorGraph) -> dict[str, int]:
    """The parts of a floor and its scenario that are not in the file."""
    lost: dict[str, int] = {}
    for code, number in zip(*np.unique(floor_plan.kind, return_counts=True), strict=True):
        kind = CELL_KINDS[code]
        if code not in (WALL, FLOOR, STATION, CHARGER):
            as_floor = " (ways over it are kept)" if kind.drivable else ""
            lost[f"{kind.name}{as_floor}"] = int(number)
    parts: dict[str, int] = {part: len(getattr(scenario.floor, part)) for part in FLOOR_PARTS}
    parts |= {"types of robots": len(scenario.fleet.types), "areas": len(scenario.areas)}
    parts["cells without a way"] = len(graph.alone)
    parts["weights of streets"] = int((floor_plan.move_weights != WEIGHT_UNIT).sum())
    return lost | {name: number for name, number in parts.items() if number}
