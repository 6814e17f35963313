"""Zone designs: from file data to arrays.

    zones:
      - {stations: [9, 10, 7], segments: [qr, rQOo]}
    transfers:            # optional: by default they are found at the start of a run
      - {zones: [1, 2], stations: [7]}

Stations are counted from 1. A segment is a path from one station of the zone to another: a list of
[x, y] cells, or a word of point names if the floor has names. Points on a straight line between two
given points may be left out. Without segments, shortest paths join the stations of a zone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from automaton.floor.floor_plan import FloorPlan
from automaton.strategy.api import NIL, Design, InputError, Roads, design_for
from strategies.zoning.designs import join, label_parts
from strategies.zoning.zone_workspace import hold, space_for

Names = Mapping[str, tuple[int, int]]  # name of a point: its cell


def design_arrays(roads: Roads, zones: int) -> Design:
    """An empty design for this number of zones. Raises InputError if there are too many zones."""
    if not 1 <= zones <= len(roads.point):
        raise InputError(f"{len(roads.point)} stations allow at most as many zones, found {zones}")
    return design_for(roads, zones)


def read_design(
    floor_plan: FloorPlan, roads: Roads, data: Any, names: Names | None = None
) -> Design:
    """A design from its data. Each station must be in one zone, no point in two. Raises InputError."""
    zones = _zones(data)
    design = design_arrays(roads, len(zones))
    for zone, entry in enumerate(zones):
        _read_stations(roads, design, zone, entry)
    missing = [s + 1 for s in range(len(roads.point)) if design.zone[s] == NIL]
    if missing:
        every = f"each of the stations 1 to {len(roads.point)} is in one zone"
        raise InputError(f"no zone has station {missing[0]}; {every}")
    for zone, entry in enumerate(zones):
        for number, segment in enumerate(entry.get("segments") or (), 1):
            where = f"segment {number} of zone {zone + 1}"
            points = [
                _point(floor_plan, roads, where, one, names) for one in _cells(where, segment)
            ]
            _read_segment(
                floor_plan, roads, design, zone, where, _whole(floor_plan, roads, where, points)
            )
    _check_points(floor_plan, roads, design)
    _join(roads, design, [not entry.get("segments") for entry in zones])
    _read_transfers(design, data.get("transfers") or [])
    return design


def _read_transfers(design: Design, entries: Any) -> None:
    """Read the transfer stations of pairs of zones, counted from 1."""
    if not isinstance(entries, list):
        raise InputError(
            f"transfers are a list of {{zones: [1, 2], stations: [...]}}, found {entries!r}"
        )
    zones, stations = len(design.transfer), len(design.zone)
    for entry in entries:
        try:
            (a, b), listed = (int(zone) for zone in entry["zones"]), list(entry["stations"])
        except (TypeError, KeyError, ValueError):
            raise InputError(
                f"transfers are {{zones: [1, 2], stations: [...]}}, found {entry!r}"
            ) from None
        if not (1 <= a <= zones and 1 <= b <= zones and a != b):
            raise InputError(f"transfers name two of the zones 1 to {zones}, found {a} and {b}")
        for number in listed:
            if not isinstance(number, int) or not 1 <= number <= stations:
                raise InputError(f"there is no station {number}; there are 1 to {stations}")
            if design.zone[number - 1] + 1 not in (a, b):
                raise InputError(f"station {number} is in neither zone {a} nor zone {b}")
            design.transfer[a - 1, b - 1, number - 1] = 1
            design.transfer[b - 1, a - 1, number - 1] = 1


def _zones(data: Any) -> list[dict[str, Any]]:
    zones = data.get("zones") if isinstance(data, dict) else None
    if not isinstance(zones, list) or not zones:
        raise InputError("a zone design has a list `zones`, such as zones: [{stations: [1, 4]}, …]")
    for key in data:
        if key not in ("zones", "transfers"):
            raise InputError(f"a zone design has zones and transfers, found '{key}'")
    for number, entry in enumerate(zones, 1):
        if not isinstance(entry, dict) or not isinstance(entry.get("stations"), list):
            raise InputError(f"zone {number} has no list `stations`, such as stations: [1, 4]")
        for key in entry:
            if key not in ("stations", "segments"):
                raise InputError(f"zone {number} has stations and segments, found '{key}'")
        if not entry["stations"]:
            raise InputError(f"zone {number} has no station")
        if not isinstance(entry.get("segments") or [], list):
            raise InputError(f"the segments of zone {number} are not a list")
    return zones


def _read_stations(roads: Roads, design: Design, zone: int, entry: dict[str, Any]) -> None:
    count = len(roads.point)
    for number in entry["stations"]:
        if type(number) is not int or not 1 <= number <= count:
            raise InputError(f"zone {zone + 1}: stations are 1 to {count}, found {number}")
        before = int(design.zone[number - 1])
        if before != NIL:
            raise InputError(f"station {number} is in zone {before + 1} and in zone {zone + 1}")
        design.zone[number - 1] = zone


def _cells(where: str, segment: Any) -> Sequence[Any]:
    if not isinstance(segment, str | list) or len(segment) < 2:
        raise InputError(f"{where} is a list of cells [x, y] or a word of point names")
    return segment


def _point(floor_plan: FloorPlan, roads: Roads, where: str, one: Any, names: Names | None) -> int:
    if isinstance(one, str):
        if names is None or one not in names:
            raise InputError(f"{where}: no point of this floor is called '{one}'")
        x, y = names[one]
    elif isinstance(one, list) and len(one) == 2 and all(type(value) is int for value in one):
        x, y = one
    else:
        raise InputError(f"{where}: a point is [x, y], found {one}")
    cell = floor_plan.cell(x, y) if floor_plan.holds(x, y) else NIL
    for p, critical in enumerate(roads.cell):
        if critical == cell:
            return p
    raise InputError(
        f"{where}: ({x}, {y}) is not a station, crossing, corner or dead end of this floor"
    )


def _whole(floor_plan: FloorPlan, roads: Roads, where: str, points: list[int]) -> list[int]:
    """The path completed by the points on straight lines between its points; each point once."""
    path = points[:1]
    for there in points[1:]:
        between = _straight(roads, path[-1], there)
        if not between:
            a, b = (floor_plan.xy(roads.cell[p]) for p in (path[-1], there))
            raise InputError(f"{where} is not a path: no straight line leads from {a} to {b}")
        path += between
    if len(set(path)) < len(path):
        raise InputError(f"{where} passes a point twice")
    return path


def _straight(roads: Roads, start: int, end: int) -> list[int]:
    for direction in range(4):
        here, found = start, []
        while roads.next[here, direction] != NIL and here != end:
            here = int(roads.next[here, direction])
            found.append(here)
        if here == end:
            return found
    return []


def _read_segment(
    floor_plan: FloorPlan, roads: Roads, design: Design, zone: int, where: str, path: list[int]
) -> None:
    ends = [int(roads.station[p]) for p in (path[0], path[-1])]
    for end, p in zip(ends, (path[0], path[-1]), strict=True):
        if end == NIL or design.zone[end] != zone:
            raise InputError(
                f"{where} ends at {floor_plan.xy(roads.cell[p])}, not a station of the zone"
            )
    if design.segments == len(design.owner):
        raise InputError(f"{where} is one too many: a zone has one segment fewer than stations")
    m = int(design.segments)
    design.owner[m], design.ends[m] = zone, ends
    design.points[m], design.path[m, : len(path)] = len(path), path
    design.segments = m + 1


def _check_points(floor_plan: FloorPlan, roads: Roads, design: Design) -> None:
    """Check that no point is in two zones."""
    owner = {int(roads.point[s]): int(design.zone[s]) for s in range(len(design.zone))}
    for m in range(int(design.segments)):
        zone = int(design.owner[m])
        for p in design.path[m, : design.points[m]].tolist():
            if owner.setdefault(p, zone) != zone:
                x, y = floor_plan.xy(roads.cell[p])
                raise InputError(
                    f"the point ({x}, {y}) is in zone {owner[p] + 1} and in zone {zone + 1}"
                )


def _join(roads: Roads, design: Design, free: list[bool]) -> None:
    """Join zones without segments; the segments of other zones must be trees."""
    hold(roads, design)
    workspace = space_for(roads, len(free))
    for zone, left_open in enumerate(free):
        if left_open:
            if not join(roads, design, workspace, zone, NIL):
                raise InputError(f"zone {zone + 1} can be joined only by points of other zones")
            continue
        stations = int((design.zone == zone).sum())
        segments = int((design.owner[: design.segments] == zone).sum())
        if label_parts(design, workspace, zone) > 1:
            own = [s for s in range(len(design.zone)) if design.zone[s] == zone]
            apart = next(s for s in own if workspace.part[s] != workspace.part[own[0]])
            raise InputError(
                f"the segments of zone {zone + 1} do not join its stations {own[0] + 1} and "
                f"{apart + 1}; without `segments` shortest paths join all of them"
            )
        if segments != stations - 1:
            raise InputError(
                f"zone {zone + 1} has {segments} segments for {stations} stations: "
                f"{stations - 1} join them without a ring"
            )
