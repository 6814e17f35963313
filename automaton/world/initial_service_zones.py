"""The partition of a world at tick 0: its stations and roads, with nothing designed yet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from automaton.engine.facilities import Roads, ServiceZones, Slots, Stations, design_for
from automaton.engine.state import NIL, Array
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.reachability import grouped
from automaton.floor.roads import road_network
from automaton.scenario.floor_section import point_names
from automaton.strategy.lookup import zone_design_reader
from automaton.units import count

if TYPE_CHECKING:
    from automaton.world.prepared_floor import Floor
    from automaton.world.resolve import Resolved

NO_STRATEGY = "none"


class ZoneDesignError(InputError):
    """A zone design that the fleet cannot serve."""


def build_service_zones(
    resolved: Resolved, floor: Floor, slots: Slots, stations: Stations, orders: int
) -> ServiceZones:
    """Stations and roads where the scenario has a zoning strategy, one zone for each robot."""
    choice = resolved.strategies.get("zoning")  # a story has no strategies
    robots = resolved.scenario.fleet.robots
    if choice is None or choice.name == NO_STRATEGY:
        return service_zones_of(no_roads(), 0, np.zeros(0, np.int32), 0, 0)

    parameters = resolved.zoning
    station_of = np.full(len(slots.cell), NIL, np.int32)
    if len(stations.slot):
        cells = floor.slot_cell[stations.slot]
        station_of[: slots.first_spare] = stations.at[: slots.first_spare]
    else:
        cells, groups = grouped(resolved.floor_plan, parameters.groups)
        station_of[: slots.first_spare] = groups
    roads = roads_of(resolved.floor_plan, cells)
    serves = served_stations(resolved, slots, station_of, len(cells))
    # Room for one order at least: without any, there are zones all the same.
    service_zones = service_zones_of(roads, robots, station_of, max(orders, 1), robots).replaced(
        accessible=serves, has_priority=priorities(resolved, parameters.priority, len(cells))
    )
    if parameters.design is None:
        return service_zones
    names = point_names(resolved.scenario.layout)
    design = zone_design_reader()(resolved.floor_plan, roads, parameters.design, names)
    if len(design.transfer) != robots:
        zones = count(len(design.transfer), "zone")
        raise ZoneDesignError(
            f"the zone design has {zones}, one for each robot; there are {robots}"
        )
    for station, zone in enumerate(design.zone.tolist()):
        if not serves[zone, station]:
            name = resolved.fleet.types[resolved.fleet.type_of[zone]].name
            raise ZoneDesignError(
                f"station {station + 1} is in zone {zone + 1} of the zone design, "
                f"but robot {zone} ({name}) does not get there"
            )
    return service_zones.replaced(design=design)


def roads_of(floor_plan: FloorPlan, station_cells: Sequence[int] | Array) -> Roads:
    """station_cells: the drivable flat cell of each station. Raises InputError."""
    return Roads(**road_network(floor_plan, station_cells)._asdict())


def served_stations(resolved: Resolved, slots: Slots, station_of: Array, count: int) -> Array:
    """(n, S) uint8: 1 = a robot gets to all slots of a station, of those to which any robot gets."""
    by_type = np.ones((len(slots.accessible), count), np.uint8)
    anybody = np.logical_or.reduce(slots.accessible)
    for kind, serves in enumerate(slots.accessible):
        out = station_of[anybody & (serves == 0)]
        by_type[kind, out[out != NIL]] = 0
    found: Array = by_type[resolved.fleet.type_of]
    return found


def priorities(resolved: Resolved, priority: dict[str, tuple[int, ...]], count: int) -> Array:
    """(n, S) uint8: 1 = the type of a robot has priority at a station."""
    kinds = resolved.fleet.types
    by_type = np.zeros((len(kinds), count), np.uint8)
    for number, robot_type in enumerate(kinds):
        by_type[number, [station - 1 for station in priority.get(robot_type.name, ())]] = 1
    found: Array = by_type[resolved.fleet.type_of]
    return found


def service_zones_of(
    roads: Roads, zones: int, station_of: Array, orders: int, robots: int
) -> ServiceZones:
    """A partition over some roads in which no station has a zone."""

    return ServiceZones.sized(
        {"Z": zones, "S": len(roads.point), "m": orders, "n": robots},
        roads=roads,
        design=design_for(roads, zones),
        station_of=station_of,
        server=np.arange(zones, dtype=np.int32),
    )


def no_roads() -> Roads:
    """The roads of a world without zoning."""
    return Roads.sized({"P": 0, "S": 0})
