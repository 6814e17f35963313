"""Read a layout of VDMA LIF, versions 1.0.0 and 2.0.0, for one type of robots.

Version 2.0.0 has its layouts in `origins`, and names `mobileRobot...` and `maximum...` for `vehicle...`
and `max...` of 1.0.0; both are fields of the same structs. Other keys are counted, not read.

A trajectory is a NURBS, whose length is that of its edge:

    C(u) = sum of N_i,p(u) w_i P_i / sum of N_i,p(u) w_i      for knots u_p <= u <= u_n

Sources: VDMA, Layout Interchange Format, https://github.com/vdma-lif. L. Piegl and W. Tiller, The NURBS
Book, 1997, chapters 2 and 4; algorithm A2.2.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar, cast

import msgspec
import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, nearest
from automaton.exchange.graphs.graph import (
    FARTHEST_NODE,
    MAX_LENGTH,
    MAX_SPEED,
    Edge,
    Graph,
    GraphStation,
    Node,
    checked_graph,
    single_line,
)
from automaton.exchange.imported_floor import BYTE_ORDER_MARK, read_bytes
from automaton.scenario.text_files import quoted

MAX_DEGREE: Final = 20
MAX_CONTROL_POINTS: Final = 200
POINTS: Final = 64  # chords for each span of knots

Floats = npt.NDArray[np.float64]

TYPE_PROPERTIES: Final[dict[str, Any]] = {
    "vehicleTypeId": None,
    "mobileRobotTypes": {"manufacturer": None, "seriesName": None},
}
NODE_PROPERTY_KEYS: Final[dict[str, Any]] = {
    **TYPE_PROPERTIES,
    **dict.fromkeys(("actions", "feasibleActions")),
}
NODE_KEYS: Final[dict[str, Any]] = {
    "nodeId": None,
    "nodePosition": {"x": None, "y": None},
    "vehicleTypeNodeProperties": NODE_PROPERTY_KEYS,
    "mobileRobotTypeNodeProperties": NODE_PROPERTY_KEYS,
}
EDGE_PROPERTY_KEYS: Final[dict[str, Any]] = {
    **TYPE_PROPERTIES,
    **dict.fromkeys(("maxSpeed", "maximumSpeed", "trajectory")),
    "loadRestriction": {"unloaded": None, "loaded": None},
}
EDGE_KEYS: Final[dict[str, Any]] = {
    **dict.fromkeys(("edgeId", "startNodeId", "endNodeId")),
    "vehicleTypeEdgeProperties": EDGE_PROPERTY_KEYS,
    "mobileRobotTypeEdgeProperties": EDGE_PROPERTY_KEYS,
}
STATION_KEYS: Final[dict[str, Any]] = dict.fromkeys(("stationId", "interactionNodeIds"))
LAYOUT_KEYS: Final[dict[str, Any]] = {
    "layoutId": None,
    "nodes": NODE_KEYS,
    "edges": EDGE_KEYS,
    "stations": STATION_KEYS,
}
FILE_KEYS: Final[dict[str, Any]] = {
    "metaInformation": dict.fromkeys(("lifVersion", "projectIdentification", "lifId")),
    "layouts": None,
    "origins": dict.fromkeys(("originId", "layouts")),
}
MAX_OBJECTS: Final = 1_000_000  # values in a file, lists included
MAX_LIF_VALUES: Final = 10_000_000
MAX_LISTED: Final = 8  # names in an error
START_CHARGING: Final = "startCharging"
IDS: Final = ("nodeId", "edgeId", "stationId")
MALFORMED: Final = re.compile(r"JSON is malformed: (.*) \(byte (\d+)\)")
LIF_WORD: Final = re.compile(rb"[^\s,}\]]{1,20}")
T = TypeVar("T")


class LayoutChoice(NamedTuple):
    """A layout of the file with its names."""

    name: str
    data: dict[str, Any]


def read_lif(path: Path, layout: str | None = None, robot_type: str | None = None) -> Graph:
    """Read the layout and the type with these names; None: the only one. Raises InputError."""
    file = str(path)
    data = _decoded(path)
    version = _version(data, file)
    choices = list(_layouts(data, file))
    choice = _chosen_layout(choices, layout, file)
    others = [one for one in choices if one is not choice]
    graph = _LayoutReader(choice, others, file).graph(robot_type)
    meta = data.get("metaInformation")
    meta = meta if isinstance(meta, dict) else {}
    graph.name = single_line(
        str(meta.get("projectIdentification") or meta.get("lifId") or path.stem)
    )
    graph.format = f"VDMA LIF {version}, layout {single_line(choice.name)}, type {graph.type}"
    count_unread(data, FILE_KEYS, graph.lost)
    if others:
        graph.lost["other layouts"] += len(others)
    return checked_graph(graph)


def count_unread(value: Any, known: dict[str, Any] | None, lost: Counter[str]) -> None:
    """Count the unread keys of an object; `known`: the keys that are read, with their contents."""
    waiting = [(value, known)]
    while waiting:
        value, known = waiting.pop()
        if known is None:
            continue
        if isinstance(value, list):
            waiting += [(one, known) for one in value]
        elif isinstance(value, dict):
            for key, inner in value.items():
                if key in known:
                    waiting.append((inner, known[key]))
                else:
                    lost[single_line(key)] += 1


def _decoded(path: Path) -> dict[str, Any]:
    """Return a file as plain data of limited size. Raises InputError."""
    file, content = str(path), read_bytes(path).removeprefix(BYTE_ORDER_MARK)
    if content.count(b"{") + content.count(b"[") > MAX_OBJECTS:
        raise InputError(f"has more than {MAX_OBJECTS:,} objects and lists, the limit", file)
    if content.count(b",") > MAX_LIF_VALUES:
        raise InputError(f"has more than {MAX_LIF_VALUES:,} values, the limit", file)
    try:
        data = msgspec.json.decode(content)
    except RecursionError:
        raise InputError("is nested too deeply", file) from None
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        malformed = MALFORMED.fullmatch(str(error))
        if malformed is None:
            raise InputError(f"is not JSON: {error}", file) from None
        place = int(malformed[2])
        word, line = LIF_WORD.match(content, place), content.count(b"\n", 0, place) + 1
        at = f" at {quoted(word[0].decode(errors='replace'))}" if word else ""
        raise InputError(f"is not JSON: {malformed[1]}{at}", file, line) from None
    if not isinstance(data, dict):
        raise InputError("must be a JSON object with layouts", file)
    return data


def _version(data: dict[str, Any], file: str) -> str:
    meta = data.get("metaInformation")
    said = meta.get("lifVersion") if isinstance(meta, dict) else None
    version = str(said) if said is not None else "2.0.0" if "origins" in data else "1.0.0"
    if version.split(".")[0] not in ("1", "2"):
        raise InputError(
            f"metaInformation.lifVersion {single_line(version)!r} is not known; 1.0.0 and 2.0.0 are",
            file,
        )
    return single_line(version)


def _layouts(data: dict[str, Any], file: str) -> Iterator[LayoutChoice]:
    """Yield all layouts with their names, which have the name of the origin if there are several."""
    origins = data.get("origins")
    several = isinstance(origins, list) and len(origins) > 1
    for number, origin in enumerate(_objects(data, "origins", file) if "origins" in data else []):
        name = f"{origin.get('originId', number)}/" if several else ""
        for layout in _objects(origin, "layouts", file):
            yield LayoutChoice(f"{name}{layout.get('layoutId', '')}", layout)
    if "origins" not in data:
        for layout in _objects(data, "layouts", file):
            yield LayoutChoice(str(layout.get("layoutId", "")), layout)


def _objects(data: dict[str, Any], key: str, file: str) -> list[dict[str, Any]]:
    value = data.get(key)
    if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
        raise InputError(f"{key} must be a list of objects", file)
    return value


def _chosen_layout(choices: list[LayoutChoice], name: str | None, file: str) -> LayoutChoice:
    names = [single_line(choice.name) for choice in choices]
    if not names:
        raise InputError("has no layout", file)
    return choices[_chosen(names, name, "layout", file)]


def _chosen(names: list[str], name: str | None, what: str, file: str) -> int:
    """Return the index of a name, or of the only one. Raises InputError with the list of names."""
    if name is None and len(names) == 1:
        return 0
    if name in names:
        return names.index(name)
    shown = ", ".join(names[:MAX_LISTED]) + (", ..." if len(names) > MAX_LISTED else "")
    asked = f"set --{what}; the {what}s are {shown}"
    if name is not None:
        asked = f"has no {what} {name!r}{nearest(name, names)}; the {what}s are {shown}"
    raise InputError(asked, file)


class _LayoutReader:
    """The nodes, edges and stations of one layout."""

    def __init__(self, choice: LayoutChoice, others: list[LayoutChoice], file: str) -> None:
        self.file = file
        self.elsewhere = {name for other in others for name in _node_names(other)}
        layout = self.converted(choice.data, LifLayout, "layout")
        self.data = choice.data
        self.nodes = self.all_of(layout.nodes, LifNode, "nodes")
        self.edges = self.all_of(layout.edges, LifEdge, "edges")
        self.stations = self.all_of(layout.stations, LifStation, "stations")
        self.number: dict[str, int] = {}
        for place, node in enumerate(self.nodes):
            if self.number.setdefault(node.node_id, place) != place:
                raise InputError(f"the node {single_line(node.node_id)} appears twice", file)

    def all_of(self, items: list[Any], kind: type[T], where: str) -> list[T]:
        """Return the objects of a list as structs."""
        return [self.converted(item, kind, f"{where}[{place}]") for place, item in enumerate(items)]

    def converted(self, item: Any, kind: type[T], where: str) -> T:
        """Return an object as a struct. Raises InputError with its path and its id."""
        try:
            return msgspec.convert(item, kind)
        except msgspec.ValidationError as error:
            names = [item[key] for key in IDS if isinstance(item, dict) and key in item]
            of = f" ({single_line(str(names[0]))})" if names else ""
            text = str(error).replace("`$.", f"`{where}.").replace("`$`", f"`{where}`")
            text += "" if " - at `" in text else f" - at `{where}`"
            raise InputError(f"{text}{of}", self.file) from None

    def graph(self, robot_type: str | None) -> Graph:
        """Return the graph of a type."""
        types = list(dict.fromkeys(one for edge in self.edges for one in _types_of_edge(edge)))
        if not self.edges:
            raise InputError("has no drivable edge", self.file)
        if not types:
            raise InputError("no edge names a type of robot", self.file)
        kind = types[_chosen(types, robot_type, "type", self.file)]
        graph = Graph(self.file, "", "", type=single_line(kind))
        count_unread(self.data, LAYOUT_KEYS, graph.lost)
        graph.nodes = [self.node(node) for node in self.nodes]
        for edge in self.edges:
            self.add_edge(graph, edge, kind)
        for place, node in enumerate(self.nodes):
            self.add_actions(graph, place, node, kind)
        for station in self.stations:
            nodes = tuple(
                dict.fromkeys(self.node_of(n, station) for n in station.interaction_node_ids)
            )
            if nodes:
                graph.stations.append(GraphStation(station.station_id, nodes))
            else:
                graph.lost["stations without a node"] += 1
        return graph

    def node(self, node: LifNode) -> Node:
        """Return a node. Raises InputError if it is too far away."""
        x, y = node.node_position.x, node.node_position.y
        if not max(abs(x), abs(y)) <= FARTHEST_NODE:  # nan, too
            text = f"the node {single_line(node.node_id)} is at x {x:g}, y {y:g}; "
            raise InputError(f"{text}at most {FARTHEST_NODE:.0e} m are allowed", self.file)
        return Node(node.node_id, x, y)

    def node_of(self, name: str, station: LifStation) -> int:
        """Return the node of a station."""
        if name not in self.number:
            text = f"the station {single_line(station.station_id)} names the node "
            text += f"{single_line(name)}, which is not in the layout"
            raise InputError(text + nearest(name, self.number), self.file)
        return self.number[name]

    def add_edge(self, graph: Graph, edge: LifEdge, kind: str) -> None:
        """Add an edge, if robots of the type may drive it. Raises InputError."""
        name = single_line(edge.edge_id)
        ends = [self.number.get(one) for one in (edge.start_node_id, edge.end_node_id)]
        if None in ends:
            if self.elsewhere & {edge.start_node_id, edge.end_node_id}:
                graph.lost["edges to other layouts"] += 1
                return
            lost = edge.start_node_id if ends[0] is None else edge.end_node_id
            hint = nearest(lost, self.number)
            text = f"the edge {name} names the node {single_line(lost)}, which does not exist{hint}"
            raise InputError(text, self.file)
        both = [*edge.vehicle_type_edge_properties, *edge.mobile_robot_type_edge_properties]
        mine = [one for one in both if kind in _types_of(one)]
        if len(both) > len(mine):
            graph.lost["edge properties of other types"] += len(both) - len(mine)
        start, end = cast("list[int]", ends)
        if not mine or start == end:
            graph.lost["edges of other types" if not mine else "edges from a node to itself"] += 1
            return
        speed = self.speed(mine[0], name)
        if speed == 0 or mine[0].load_restriction == CLOSED:
            graph.lost["edges that are closed"] += 1
            return
        metres = self.metres(graph, mine[0].trajectory, start, end)
        closed = _closed_to(mine[0])
        graph.edges.append(Edge(name, start, end, metres, speed, closed))

    def speed(self, properties: EdgeProperties, name: str) -> float | None:
        """Return the speed on an edge. Raises InputError."""
        speed = properties.max_speed
        speed = properties.maximum_speed if speed is None else speed
        if speed is not None and not 0 <= speed <= MAX_SPEED:
            text = f"the edge {name} has a speed of {speed:g} m/s; 0 to {MAX_SPEED:g} are allowed"
            raise InputError(text, self.file)
        return speed

    def metres(self, graph: Graph, curve: Trajectory | None, start: int, end: int) -> float:
        """Return the length of an edge: of its curve if it has a valid one, else straight."""
        if curve is None:
            return graph.straight(start, end)
        length = _curve_length(curve)
        if length is None:
            graph.lost["trajectory that is not a NURBS (straight instead)"] += 1
            return graph.straight(start, end)
        graph.lost["trajectory (drawn straight, its length counts)"] += 1
        return length

    def add_actions(self, graph: Graph, place: int, node: LifNode, kind: str) -> None:
        """Turn a node where robots charge into a charger; count other actions."""
        both = [*node.vehicle_type_node_properties, *node.mobile_robot_type_node_properties]
        for one in both:
            if kind not in _types_of(one):
                graph.lost["node properties of other types"] += 1
                continue
            for action in (*one.actions, *one.feasible_actions):
                if action.action_type == START_CHARGING:
                    graph.chargers.add(place)
                else:
                    graph.lost[f"action {single_line(action.action_type)}"] += 1


def _node_names(choice: LayoutChoice) -> Iterator[str]:
    """Yield the ids of the nodes of a layout."""
    nodes = choice.data.get("nodes")
    for node in nodes if isinstance(nodes, list) else ():
        if isinstance(node, dict) and isinstance(node.get("nodeId"), str):
            yield node["nodeId"]


def _curve_length(curve: Trajectory) -> float | None:
    """Return the length of a curve; None if it is not a NURBS, or has no length."""
    points = np.array([(p.x, p.y) for p in curve.control_points], float).reshape(-1, 2)
    weights = np.array([p.weight for p in curve.control_points], float)
    knots = np.array(curve.knot_vector, float)
    if not curve.degree.is_integer() or (np.abs(points) > FARTHEST_NODE).any():
        return None
    if not is_nurbs(int(curve.degree), knots, points, weights):
        return None
    length = arc_length(int(curve.degree), knots, points, weights)
    return length if math.isfinite(length) and 0 < length <= MAX_LENGTH else None


def _types_of(properties: EdgeProperties | NodeProperties) -> list[str]:
    """Return the types of robots for which properties hold."""
    first = properties.vehicle_type_id
    names = [] if first is None else [first]
    return names + [one.name for one in properties.mobile_robot_types]


def _types_of_edge(edge: LifEdge) -> list[str]:
    both = (*edge.vehicle_type_edge_properties, *edge.mobile_robot_type_edge_properties)
    return [one for properties in both for one in _types_of(properties)]


def _closed_to(properties: EdgeProperties) -> str:
    restriction = properties.load_restriction
    if restriction is None or restriction.loaded == restriction.unloaded:
        return ""
    return "loaded" if restriction.unloaded else "empty"


# The keys of a file.


class LifPart(msgspec.Struct, rename="camel", frozen=True):
    """An object of the file."""


class RobotSeries(LifPart, frozen=True):
    """A type of robots, in version 2.0.0."""

    manufacturer: str = ""
    series_name: str = ""

    @property
    def name(self) -> str:
        """The name of the type in version 1.0.0."""
        return ".".join(part for part in (self.manufacturer, self.series_name) if part)


class LifAction(LifPart, frozen=True):
    """An action of robots at a node."""

    action_type: str


class NodeProperties(LifPart, frozen=True):
    """The properties of a node for one or several types."""

    vehicle_type_id: str | None = None
    mobile_robot_types: list[RobotSeries] = []
    actions: list[LifAction] = []
    feasible_actions: list[LifAction] = []


class Position(LifPart, frozen=True):
    """A place in the plane, in metres."""

    x: float
    y: float


class LifNode(LifPart, frozen=True):
    """A node."""

    node_id: str
    node_position: Position
    vehicle_type_node_properties: list[NodeProperties] = []
    mobile_robot_type_node_properties: list[NodeProperties] = []


class ControlPoint(LifPart, frozen=True):
    """A point of a NURBS."""

    x: float
    y: float
    weight: float = 1.0


class Trajectory(LifPart, frozen=True):
    """The curve along which an edge is driven."""

    knot_vector: list[float]
    control_points: list[ControlPoint]
    degree: float = 1.0


class LoadRestriction(LifPart, frozen=True):
    """Whether robots may drive along an edge without and with a load."""

    unloaded: bool = True
    loaded: bool = True


CLOSED: Final = LoadRestriction(unloaded=False, loaded=False)


class EdgeProperties(LifPart, frozen=True):
    """The properties of an edge for one or several types; speeds in m/s."""

    vehicle_type_id: str | None = None
    mobile_robot_types: list[RobotSeries] = []
    max_speed: float | None = None
    maximum_speed: float | None = None
    load_restriction: LoadRestriction | None = None
    trajectory: Trajectory | None = None


class LifEdge(LifPart, frozen=True):
    """An edge."""

    edge_id: str
    start_node_id: str
    end_node_id: str
    vehicle_type_edge_properties: list[EdgeProperties] = []
    mobile_robot_type_edge_properties: list[EdgeProperties] = []


class LifStation(LifPart, frozen=True):
    """A station."""

    station_id: str
    interaction_node_ids: list[str]


class LifLayout(LifPart, frozen=True):
    """A layout; its main parts are read separately, so that errors can name them."""

    layout_id: str
    nodes: list[Any]
    edges: list[Any]
    stations: list[Any] = []


# The length of a trajectory.


def is_nurbs(degree: int, knots: Floats, points: Floats, weights: Floats) -> bool:
    """Whether knots (m,), points (n, 2) and weights (n,) are a curve of a degree: m = n + degree + 1."""
    n = len(points)
    if not 1 <= degree <= MAX_DEGREE or not degree < n <= MAX_CONTROL_POINTS:
        return False
    return bool(
        len(knots) == n + degree + 1
        and np.isfinite(knots).all()
        and np.isfinite(points).all()
        and np.isfinite(weights).all()
        and (np.diff(knots) >= 0).all()
        and knots[degree] < knots[n]
        and (weights > 0).all()
    )


def arc_length(degree: int, knots: Floats, points: Floats, weights: Floats) -> float:
    """Return the length of a NURBS, in the unit of its points, by chords with extrapolation.

    The error of chords falls with the square of their number, so twice the chords have a quarter of the
    error: (4 L(2k) - L(k)) / 3 cancels it.
    """
    ends = np.unique(knots[degree : len(points) + 1])
    share = np.arange(2 * POINTS) / (2 * POINTS)
    u = np.append((ends[:-1, None] + np.diff(ends)[:, None] * share).reshape(-1), ends[-1])
    basis = _basis(degree, knots, len(points), u) * weights
    curve = basis @ points / basis.sum(axis=1, keepdims=True)
    fine = float(np.hypot(*np.diff(curve, axis=0).T).sum())
    coarse = float(np.hypot(*np.diff(curve[::2], axis=0).T).sum())
    return (4 * fine - coarse) / 3


def _basis(degree: int, knots: Floats, n: int, u: Floats) -> Floats:
    """(len(u), n) the B-spline basis functions, by the recursion of Cox and de Boor."""
    last = np.flatnonzero(np.diff(knots) > 0)[-1]
    span = np.minimum(np.searchsorted(knots, u, side="right") - 1, last)
    basis = np.zeros((len(u), len(knots) - 1))
    basis[np.arange(len(u)), span] = 1.0
    for p in range(1, degree + 1):
        width = knots[p:-1] - knots[: -p - 1], knots[p + 1 :] - knots[1:-p]
        rising, falling = (np.divide(1.0, w, out=np.zeros_like(w), where=w > 0) for w in width)
        left = (u[:, None] - knots[: -p - 1]) * rising * basis[:, :-1]
        basis = left + (knots[p + 1 :] - u[:, None]) * falling * basis[:, 1:]
    return basis[:, :n]
