"""Read a plant model of openTCS, versions 6.0.0 and 7.0.0; its lengths are mm, its speeds mm/s.

A DOCTYPE is refused before anything in it is expanded, so no entity is read.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from xml.parsers import expat

from automaton.errors import InputError, nearest
from automaton.exchange.graphs.graph import (
    FARTHEST_NODE,
    MAX_LENGTH,
    MAX_SPEED,
    Edge,
    Graph,
    GraphStation,
    Node,
    NodeBlock,
    Vehicle,
    checked_graph,
    single_line,
)
from automaton.exchange.imported_floor import read_bytes

MAX_ELEMENTS: Final = 1_000_000
MAX_XML_DEPTH: Final = 32
CHUNK: Final = 2**20  # bytes parsed at a time

# Elements that are read: attributes and inner elements.
LOCATION_LAYOUT: Final[dict[str, Any]] = {"": ("locationRepresentation",)}
NAMED: Final[dict[str, Any]] = {"": ("name",)}
MODEL: Final[dict[str, Any]] = {
    "": ("version", "name"),
    "point": {
        "": ("name", "positionX", "positionY", "type"),
        "outgoingPath": {"": ("name",)},
    },
    "path": {
        "": (
            "name",
            "sourcePoint",
            "destinationPoint",
            "length",
            "maxVelocity",
            "maxReverseVelocity",
            "locked",
        ),
    },
    "vehicle": {"": ("name", "maxVelocity"), "boundingBox": {"": ("length", "width")}},
    "locationType": {
        "": ("name",),
        "allowedOperation": NAMED,
        "locationTypeLayout": LOCATION_LAYOUT,
    },
    "location": {
        "": ("name", "type", "locked"),
        "link": {"": ("point",), "allowedOperation": NAMED},
        "locationLayout": LOCATION_LAYOUT,
    },
    "block": {"": ("name", "type"), "member": NAMED},
}

OPENTCS_VERSIONS: Final = ("6.0.0", "7.0.0")
RECHARGE: Final = "RECHARGE_"
CHARGE: Final = "Charge"
SAME_DIRECTION: Final = "SAME_DIRECTION_ONLY"
BLOCK_TYPES: Final = ("SINGLE_VEHICLE_ONLY", SAME_DIRECTION)
MM_PER_M: Final = 1000
MAX_VEHICLE: Final = 100.0  # metres


@dataclass
class Element:
    """An element that is read."""

    name: str
    attributes: dict[str, str]
    line: int
    parts: list[Element] = field(default_factory=list)

    def of(self, name: str) -> list[Element]:
        """The inner elements with a given name."""
        return [part for part in self.parts if part.name == name]


def read_elements(path: Path, lost: Counter[str]) -> Element:
    """Return the element `model` with its known parts; count the rest. Raises InputError."""
    file, content = str(path), read_bytes(path)
    handlers = _Handlers(file, lost)
    parser = handlers.parser
    try:
        for first in range(0, len(content), CHUNK):
            parser.Parse(content[first : first + CHUNK], False)
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        text = expat.ErrorString(error.code) or "error"
        raise InputError(f"is not XML: {text}", file, error.lineno) from None
    except (LookupError, ValueError) as error:
        raise InputError(f"is not XML: {error}", file) from None
    assert handlers.root is not None  # XML has at least one element
    return handlers.root


class _Handlers:
    """The callbacks of the parser."""

    def __init__(self, file: str, lost: Counter[str]) -> None:
        self.file, self.lost = file, lost
        self.root: Element | None = None
        self.open: list[tuple[Element, dict[str, Any]]] = []
        self.depth = self.count = self.unread = 0
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self.doctype
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end

    def error(self, text: str) -> InputError:
        """An error at the current line of the parser."""
        return InputError(text, self.file, self.parser.CurrentLineNumber)

    def doctype(self, *_: Any) -> None:
        """Refuse a DOCTYPE."""
        raise self.error("has a DOCTYPE, which is not allowed: remove it")

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Read an element, or count it."""
        self.count += 1
        self.depth += 1
        if self.count > MAX_ELEMENTS:
            raise self.error(f"has more than {MAX_ELEMENTS:,} elements, the limit")
        if self.depth > MAX_XML_DEPTH:
            raise self.error(f"is nested more than {MAX_XML_DEPTH} levels deep")
        name = tag.rpartition(":")[2]
        if self.depth == 1 and name != "model":
            raise self.error(f"is XML, but not a plant model: it begins with <{single_line(name)}>")
        known = {"model": MODEL} if self.depth == 1 else self.open[-1][1]
        if self.unread or name not in known:
            if not self.unread:
                self.lost[single_line(name)] += 1
            self.unread += 1
            return
        element = Element(name, attributes, self.parser.CurrentLineNumber)
        for key in attributes:
            if key not in known[name][""] and not key.startswith("xml"):
                self.lost[f"{name} {single_line(key)}"] += 1
        if self.open:
            self.open[-1][0].parts.append(element)
        else:
            self.root = element
        self.open.append((element, known[name]))

    def end(self, _: str) -> None:
        """Close an element."""
        self.depth -= 1
        if self.unread:
            self.unread -= 1
        else:
            self.open.pop()


def read_opentcs(path: Path) -> Graph:
    """Read a plant model. Raises InputError."""
    return _ModelReader(path).graph()


class _ModelReader:
    """The points, paths, locations, blocks and vehicles of a plant model."""

    def __init__(self, path: Path) -> None:
        self.file = str(path)
        out = Graph(self.file, "", path.stem)
        self.out, self.root = out, read_elements(path, out.lost)
        version = self.root.attributes.get("version", "")
        if version.split(".")[0] not in [one.split(".")[0] for one in OPENTCS_VERSIONS]:
            text = (
                f"version {single_line(version)!r} is not read; "
                f"{' and '.join(OPENTCS_VERSIONS)} are"
            )
            raise self.error(text, self.root)
        out.format = f"openTCS plant model {single_line(version)}"
        out.name = single_line(self.root.attributes.get("name") or path.stem)
        self.points: dict[str, int] = {}
        self.paths: dict[str, tuple[int, ...]] = {}  # edges of the path; (): locked

    def graph(self) -> Graph:
        """Return the model as a graph. Raises InputError."""
        for point in self.root.of("point"):
            self.add_point(point)
        for path in self.root.of("path"):
            self.add_path(path)
        for location in self.root.of("location"):
            self.add_location(location)
        for block in self.root.of("block"):
            self.add_block(block)
        for vehicle in self.root.of("vehicle"):
            speed = self.speed(vehicle, "maxVelocity") if "maxVelocity" in vehicle.attributes else 0
            name = single_line(self.text(vehicle, "name"))
            self.out.vehicles.append(Vehicle(name, speed or None, *self.size(vehicle)))
        return checked_graph(self.out)

    def size(self, vehicle: Element) -> tuple[float | None, float | None]:
        """Return length and width of a vehicle in metres; None: not given. Raises InputError."""
        for box in vehicle.of("boundingBox"):
            length, width = (
                self.number(box, key, MAX_VEHICLE) if key in box.attributes else 0.0
                for key in ("length", "width")
            )
            return (length if length > 0 else None), (width if width > 0 else None)
        return None, None

    def error(self, text: str, element: Element) -> InputError:
        """An error about an element, with its line."""
        return InputError(text, self.file, element.line)

    def text(self, element: Element, key: str) -> str:
        """Return an attribute. Raises InputError where it is missing."""
        value = element.attributes.get(key)
        if value is None:
            raise self.error(f"<{element.name}> has no attribute {key}", element)
        return value

    def number(self, element: Element, key: str, most: float) -> float:
        """Return an attribute as a number of m or m/s. Raises InputError."""
        text = self.text(element, key)
        try:
            value = float(text) / MM_PER_M
        except ValueError:
            value = float("nan")
        if not abs(value) <= most:  # nan, too
            name = single_line(element.attributes.get("name", ""))
            text = f"<{element.name}> {name}: {key} must be a number, found {single_line(text)!r}"
            raise self.error(f"{text}; up to {most * MM_PER_M:.0e} is allowed", element)
        return value

    def speed(self, element: Element, key: str) -> float:
        """Return a speed in m/s; 0: not driven in this direction. Raises InputError."""
        return max(0.0, self.number(element, key, MAX_SPEED))

    def is_locked(self, element: Element) -> bool:
        """Whether robots must not use a path or a location."""
        return element.attributes.get("locked", "false").strip() in ("true", "1")

    def add_point(self, point: Element) -> None:
        """Add a node."""
        name, place = self.text(point, "name"), len(self.out.nodes)
        if self.points.setdefault(name, place) != place:
            raise self.error(f"the point {single_line(name)} appears twice", point)
        x, y = (self.number(point, key, FARTHEST_NODE) for key in ("positionX", "positionY"))
        self.out.nodes.append(Node(name, x, y))
        if point.attributes.get("type") == "PARK_POSITION":
            self.out.parking.append(place)

    def point(self, name: str, element: Element, what: str) -> int:
        """Return the node with a name. Raises InputError."""
        if name not in self.points:
            text = f"{what} names the point {single_line(name)}, which does not exist"
            raise self.error(text + nearest(name, self.points), element)
        return self.points[name]

    def add_path(self, path: Element) -> None:
        """Add the edges of a path: forwards, and backwards if it is also driven backwards."""
        name = single_line(self.text(path, "name"))
        if name in self.paths:
            raise self.error(f"the path {name} appears twice", path)
        ends = (self.text(path, key) for key in ("sourcePoint", "destinationPoint"))
        start, end = (self.point(one, path, f"the path {name}") for one in ends)
        self.paths[name] = ()
        if self.is_locked(path) or start == end:
            locked = "locked paths" if start != end else "paths from a point to itself"
            self.out.lost[locked] += 1
            return
        metres = self.number(path, "length", MAX_LENGTH) if "length" in path.attributes else 0.0
        if metres <= 0:
            self.out.lost["path length that is not above 0 (straight instead)"] += 1
            metres = self.out.straight(start, end)
        ways = [
            (name, start, end, "maxVelocity"),
            (f"{name} backwards", end, start, "maxReverseVelocity"),
        ]
        for edge, one, other, key in ways:
            speed = self.speed(path, key) if key in path.attributes else 0.0
            if speed > 0:
                self.paths[name] += (len(self.out.edges),)
                self.out.edges.append(Edge(edge, one, other, metres, speed))
        if not self.paths[name]:
            self.out.lost["paths without a speed"] += 1

    def add_location(self, location: Element) -> None:
        """Make a station or a charger of a location and its linked points."""
        name, links = self.text(location, "name"), location.of("link")
        what = f"the location {single_line(name)}"
        nodes = [self.point(self.text(link, "point"), link, what) for link in links]
        if self.is_locked(location) or not nodes:
            self.out.lost["locked locations" if nodes else "locations without a link"] += 1
            return
        self.out.stations.append(GraphStation(single_line(name), tuple(dict.fromkeys(nodes))))
        own = self.operations([location, *links])
        kind = location.attributes.get("type")
        types = [one for one in self.root.of("locationType") if one.attributes.get("name") == kind]
        offered = own | self.operations(types)
        if CHARGE in offered or any(one.startswith(RECHARGE) for one in offered):
            self.out.chargers.update(nodes)
        else:
            self.out.lost["operation of a location"] += len(offered)

    def operations(self, elements: list[Element]) -> set[str]:
        """Return the operations and the symbols of a location, its links and its type."""
        parts = [part for element in elements for part in element.parts]
        names = {
            part.attributes.get("name", "") for part in parts if part.name == "allowedOperation"
        }
        shown = {part.attributes.get("locationRepresentation", "") for part in parts}
        return (names | {one for one in shown if one.startswith(RECHARGE)}) - {""}

    def add_block(self, block: Element) -> None:
        """Add a block of points and paths; other members are counted as lost."""
        name, kind = single_line(self.text(block, "name")), block.attributes.get("type")
        if kind not in BLOCK_TYPES:
            allowed = " or ".join(BLOCK_TYPES)
            text = f"the block {name} must have the type {allowed}"
            raise self.error(f"{text}, found {single_line(kind or '')}", block)
        members = [self.text(member, "name") for member in block.of("member")]
        nodes = tuple(self.points[one] for one in members if one in self.points)
        edges = [edge for one in members for edge in self.paths.get(single_line(one), ())]
        others = [
            one for one in members if one not in self.points and single_line(one) not in self.paths
        ]
        if others:
            self.out.lost["block members that are neither point nor path"] += len(others)
        self.out.blocks.append(NodeBlock(name, nodes, tuple(edges), kind == SAME_DIRECTION))
