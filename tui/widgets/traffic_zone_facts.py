"""What the inspector says about zones: who is in them, and how long a move takes there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.floor.cells import DIRECTIONS
from automaton.floor.floor_plan import DRIVABLE
from automaton.floor.traffic_zones import TrafficZones, traffic_zones_of
from automaton.units import count
from tui.playback.panel_view import View
from tui.widgets.service_zone_facts import checked_served, partition_of, served_zone_lines
from tui.widgets.styled_lines import Line, Span, cell_link, dim, fact, line, robot_link, title

Parts = list[str | Span]
MAX_ROBOTS_LISTED = 24  # robots that are named one by one


def zones_in(view: View) -> TrafficZones:
    """The zones of the floor, as the rules have them by now."""
    return traffic_zones_of(view.floor_plan, view.run.resolved.scenario.world.traffic_zones)


def checked_zone(view: View, zone: int) -> int:
    """A zone of this floor, or by its number one that robots serve. Raises InputError."""
    service_zones = partition_of(view)
    if service_zones is not None:
        return checked_served(service_zones, zone)
    many = zones_in(view).count
    if zone >= many:
        numbers = f"zones are numbered from 0 to {many - 1}" if many else "this floor has none"
        raise InputError(f"there is no zone {zone}; {numbers}")
    return zone


def zone_link(zone: int) -> Span:
    """Its number, under which the inspector tells of it."""
    return Span(str(zone), "link", ("zone", zone))


def robots_in(view: View, zone: int) -> NDArray[np.intp]:
    """The robots that count as being in a zone: where they stand or leave, as they came."""
    fleet, of = view.snapshot.robots, zones_in(view).of
    there = of[fleet.cell, fleet.travel >> 1] == zone
    return np.flatnonzero(there & (fleet.cell != NIL))


def zone_facts(view: View, cell: int) -> list[tuple[str, Parts]]:
    """The zones of a cell, how many robots are in each, and what a move from here takes.

    Where robots serve zones, those of the floor are told of only if they slow robots down.
    """
    if partition_of(view) is not None and not _slow(view):
        return []
    if not DRIVABLE[view.floor_plan.kind.reshape(-1)[cell]]:
        return []
    traffic_zones = zones_in(view)
    numbers = sorted({int(zone) for zone in traffic_zones.of[cell] if zone != NIL})
    if not numbers:
        crossing = "none: an intersection" if traffic_zones.intersection[cell] else "none"
        return [("zone", [crossing, *_free(view)])]
    facts: list[tuple[str, Parts]] = []
    for zone in numbers:
        ways = [f" ({way})" for way in _ways(view, traffic_zones, cell, zone)]
        now = f" with {count(len(robots_in(view, zone)), 'robot')} now"
        served = partition_of(view) is not None
        parts: Parts = [str(zone) if served else zone_link(zone), *ways, now]
        facts += [("stretch" if served else "zone", parts), ("a move", _pace(view, zone))]
    return facts


def _ways(view: View, traffic_zones: TrafficZones, cell: int, zone: int) -> Parts:
    """In which directions a zone is driven, where the opposite ones have another."""
    if traffic_zones.of[cell, 0] == traffic_zones.of[cell, 1]:
        return []
    exits, column = (
        int(view.floor_plan.exits.reshape(-1)[cell]),
        int(traffic_zones.of[cell, 1] == zone),
    )
    pair = (2 * column, 2 * column + 1)
    ways = [DIRECTIONS[d] for d in pair if exits >> d & 1 or exits >> (d ^ 2) & 1]
    return [" and ".join(ways)]


def _slow(view: View) -> bool:
    return view.run.resolved.scenario.world.slowdown == "zones"


def pace_words(many: int, move: int) -> str:
    """What a move of so many ticks takes in a zone with so many robots."""
    return f"{many} x {move} = {many * move} ticks" if move != 1 else count(many, "tick")


def _free(view: View) -> Parts:
    return [", which slows no robot down"] if _slow(view) else []


def _pace(view: View, zone: int) -> Parts:
    """How long a move takes that begins now in a zone; nothing to say where zones slow no robot."""
    if not _slow(view):
        return []
    moves = view.run.resolved.scenario.durations.moves
    many = max(1, len(robots_in(view, zone)))
    ticks = pace_words(many, moves.empty)
    if moves.differ:
        ticks += f", with a load {pace_words(many, moves.loaded)}"
    types = view.run.resolved.scenario.fleet.types
    slower = (
        ", times the move_time_factor of its type"
        if any(kind.move_time_factor > 1 for kind in types)
        else ""
    )
    return [f"from here takes {ticks}{slower}"]


def _cost(view: View, zone: int) -> Parts:
    """What the zone has cost; nothing to say where zones slow no robot and never did."""
    lost = int(view.snapshot.lost_in_zone[zone])
    return [f"moves from here took {count(lost, 'tick')} longer"] if lost or _slow(view) else []


def zone_lines(view: View, zone: int, width: int) -> list[Line]:
    """Everything about one zone: of those that robots serve, if they do."""
    service_zones = partition_of(view)
    if service_zones is not None:
        return served_zone_lines(view, service_zones, zone, width)
    traffic_zones = zones_in(view)
    if zone >= traffic_zones.count:  # of the other of two runs
        return [line(title(f"zone {zone} "), "is not on this floor")]
    cells = np.flatnonzero((traffic_zones.of == zone).any(axis=1))
    robots = robots_in(view, zone)
    ends: Parts = [cell_link(view.floor_plan, int(cells[0]))]
    ends += [" to ", cell_link(view.floor_plan, int(cells[-1]))] if len(cells) > 1 else []
    named: Parts = []
    for robot in robots[:MAX_ROBOTS_LISTED].tolist():
        named += [", "] * bool(named) + [robot_link(robot)]
    named += (
        [f" and {len(robots) - MAX_ROBOTS_LISTED:,} more"]
        if len(robots) > MAX_ROBOTS_LISTED
        else []
    )
    lines = [line(title(f"zone {zone} "), dim(f"of {traffic_zones.count:,}, {traffic_zones.mode}"))]
    crossing = bool(traffic_zones.intersection[cells[0]])
    for name, parts in (
        ("is", ["an intersection" if crossing else "a stretch between intersections"]),
        ("cells", [f"{len(cells):,}, ", *ends]),
        ("driven", _ways(view, traffic_zones, int(cells[0]), zone)),
        ("a move", _pace(view, zone)),
        ("so far", _cost(view, zone)),
        ("robots", [f"{len(robots):,}"]),
        ("here", named),
    ):
        lines += fact(name, *parts, width=width) if parts else []
    return lines
