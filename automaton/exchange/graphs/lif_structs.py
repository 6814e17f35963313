"""What is read of a VDMA LIF, version 1.0.0 or 2.0.0: its keys, as structs.

Version 2.0.0 has its layouts in `origins` and says `mobileRobot...` and `maximum...` where 1.0.0 says
`vehicle...` and `max...`; both are fields of the same structs. Other keys are counted, not read.

Source: VDMA, Layout Interchange Format, https://github.com/vdma-lif.
"""

from __future__ import annotations

from typing import Any, Final

import msgspec


class Part(msgspec.Struct, rename="camel", frozen=True):
    """An object of the file."""


class RobotSeries(Part, frozen=True):
    """A type of robots, in version 2.0.0."""

    manufacturer: str = ""
    series_name: str = ""

    @property
    def name(self) -> str:
        """As the type is called in version 1.0.0."""
        return ".".join(part for part in (self.manufacturer, self.series_name) if part)


class Action(Part, frozen=True):
    """What robots can do at a node."""

    action_type: str


class NodeProperties(Part, frozen=True):
    """What a node is to one type, or to several."""

    vehicle_type_id: str | None = None
    mobile_robot_types: list[RobotSeries] = []
    actions: list[Action] = []
    feasible_actions: list[Action] = []


class Position(Part, frozen=True):
    """A place in the plane, in metres."""

    x: float
    y: float


class LifNode(Part, frozen=True):
    """A node."""

    node_id: str
    node_position: Position
    vehicle_type_node_properties: list[NodeProperties] = []
    mobile_robot_type_node_properties: list[NodeProperties] = []


class ControlPoint(Part, frozen=True):
    """A point of a NURBS."""

    x: float
    y: float
    weight: float = 1.0


class Trajectory(Part, frozen=True):
    """The curve along which an edge is driven."""

    knot_vector: list[float]
    control_points: list[ControlPoint]
    degree: float = 1.0


class LoadRestriction(Part, frozen=True):
    """Which robots may drive along an edge."""

    unloaded: bool = True
    loaded: bool = True


class EdgeProperties(Part, frozen=True):
    """How an edge is driven by one type, or by several; speeds in m/s."""

    vehicle_type_id: str | None = None
    mobile_robot_types: list[RobotSeries] = []
    max_speed: float | None = None
    maximum_speed: float | None = None
    load_restriction: LoadRestriction | None = None
    trajectory: Trajectory | None = None


class LifEdge(Part, frozen=True):
    """An edge."""

    edge_id: str
    start_node_id: str
    end_node_id: str
    vehicle_type_edge_properties: list[EdgeProperties] = []
    mobile_robot_type_edge_properties: list[EdgeProperties] = []


class LifStation(Part, frozen=True):
    """A station."""

    station_id: str
    interaction_node_ids: list[str]


class LifLayout(Part, frozen=True):
    """A layout; the main parts are read one by one, so that errors can name them."""

    layout_id: str
    nodes: list[Any]
    edges: list[Any]
    stations: list[Any] = []


PROPERTIES: Final[dict[str, Any]] = {
    "vehicleTypeId": None,
    "mobileRobotTypes": {"manufacturer": None, "seriesName": None},
}
NODE_PROPERTY_KEYS: Final[dict[str, Any]] = {
    **PROPERTIES,
    **dict.fromkeys(("actions", "feasibleActions")),
}
NODE_KEYS: Final[dict[str, Any]] = {
    "nodeId": None,
    "nodePosition": {"x": None, "y": None},
    "vehicleTypeNodeProperties": NODE_PROPERTY_KEYS,
    "mobileRobotTypeNodeProperties": NODE_PROPERTY_KEYS,
}
EDGE_PROPERTY_KEYS: Final[dict[str, Any]] = {
    **PROPERTIES,
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
