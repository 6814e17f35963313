"""The partition of a world at tick 0: its stations and roads, with nothing designed yet."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from automaton.errors import InputError
from automaton.scenario.floors import point_names
from automaton.units import count
from automaton.world.partition import SAID, Partition, Roads
from automaton.world.places import Slots, Stations
from automaton.world.plan import FloorPlan
from automaton.world.reach import slot_access, steps_from
from automaton.world.state import NIL, Array, Workspace, World
from automaton.world.types import type_of_each, types_of
from automaton.zoning.designs import read_design
from automaton.zoning.negotiation import parts_for
from automaton.zoning.roads import roads_of
from automaton.zoning.space import design_for, space_for

if TYPE_CHECKING:
    from automaton.scenario.resolve import Resolved
    from automaton.world.floor import Floor

NO_STRATEGY = "none"
GROUPS = 18  # stations that the slots of a floor without stations are grouped into


def build_partition(
    resolved: Resolved, floor: Floor, slots: Slots, stations: Stations, orders: int
) -> Partition:
    """Stations and roads where the scenario has a zoning strategy, one zone for each robot."""
    pick = resolved.picks.get("zoning")  # a story has no strategies
    robots = resolved.scenario.fleet.robots
    if pick is None or pick.name == NO_STRATEGY:
        return partition_of(no_roads(), 0, np.zeros(0, np.int32), 0, 0)

    station_of = np.full(len(slots.cell), NIL, np.int32)
    if len(stations.slot):
        cells = floor.slot_cell[stations.slot]
        station_of[: slots.spare] = stations.at[: slots.spare]
    else:
        cells, groups = grouped(resolved.plan, int(getattr(pick.parameters, "groups", GROUPS)))
        station_of[: slots.spare] = groups
    roads = roads_of(resolved.plan, cells)
    serves = served_stations(resolved, slots, station_of, len(cells))
    priority = getattr(pick.parameters, "priority", {})
    # Room for one order at least: without any, there are zones all the same.
    partition = partition_of(roads, robots, station_of, max(orders, 1), robots).replaced(
        serves=serves, first=priorities(resolved, priority, len(cells))
    )
    data = getattr(pick.parameters, "design", None)
    if data is None:
        return partition
    names = point_names(resolved.scenario.layout)
    design = read_design(resolved.plan, roads, data, names)
    if len(design.transfer) != robots:
        zones = count(len(design.transfer), "zone")
        raise InputError(f"the zone design has {zones}, one for each robot; there are {robots}")
    for station, zone in enumerate(design.zone.tolist()):
        if not serves[zone, station]:
            name = types_of(resolved.scenario)[type_of_each(resolved.scenario.fleet)[zone]].name
            raise InputError(
                f"station {station + 1} is in zone {zone + 1} of the zone design, "
                f"but robot {zone} ({name}) does not get there"
            )
    return partition.replaced(design=design)


def served_stations(resolved: Resolved, slots: Slots, station_of: Array, count: int) -> Array:
    """(n, S) uint8: 1 = a robot gets to all slots of a station, of those to which any robot gets."""
    by_type = np.ones((len(slots.serves), count), np.uint8)
    anybody = np.logical_or.reduce(slots.serves)
    for kind, serves in enumerate(slots.serves):
        out = station_of[anybody & (serves == 0)]
        by_type[kind, out[out != NIL]] = 0
    found: Array = by_type[type_of_each(resolved.scenario.fleet)]
    return found


def priorities(resolved: Resolved, priority: dict[str, tuple[int, ...]], count: int) -> Array:
    """(n, S) uint8: 1 = the type of a robot has priority at a station."""
    kinds = types_of(resolved.scenario)
    by_type = np.zeros((len(kinds), count), np.uint8)
    for number, kind in enumerate(kinds):
        by_type[number, [station - 1 for station in priority.get(kind.name, ())]] = 1
    found: Array = by_type[type_of_each(resolved.scenario.fleet)]
    return found


def with_zones(space: Workspace, world: World) -> Workspace:
    """A workspace with scratch for the zones of a world."""
    zoning = world.zoning
    if not len(zoning.queue):
        return space
    return space.replaced(
        zoning=space_for(zoning.roads, len(zoning.server)).replaced(
            serves=zoning.serves, first=zoning.first
        ),
        parts=parts_for(len(zoning.queue)),
    )


def partition_of(
    roads: Roads, zones: int, station_of: Array, orders: int, robots: int
) -> Partition:
    """A partition over some roads in which no station has a zone."""

    def nil(count: int) -> Array:
        return np.full(count, NIL, np.int32)

    return Partition(
        roads=roads,
        design=design_for(roads, zones),
        station_of=station_of,
        serves=np.ones((zones, len(roads.point)), np.uint8),
        first=np.zeros((zones, len(roads.point)), np.uint8),
        server=np.arange(zones, dtype=np.int32),
        queue=nil(orders),
        stop=nil(orders),
        direct=np.zeros(orders, np.uint8),
        leg=nil(orders),
        halt=np.full(robots, NIL, np.int64),
        wake=np.full(robots, NIL, np.int64),
        said=np.zeros((robots, SAID), np.int64),
    )


def no_roads() -> Roads:
    """The roads of a world without zoning."""
    nothing = np.zeros(0, np.int32)
    return Roads(
        cell=nothing.copy(),
        next=np.zeros((0, 4), np.int32),
        step=np.zeros((0, 4), np.int32),
        station=nothing.copy(),
        point=nothing.copy(),
        hop=np.zeros((0, 0), np.int32),
        between=np.zeros((0, 0), np.int32),
    )


@lru_cache(maxsize=8)
def grouped(plan: FloorPlan, most: int) -> tuple[Array, Array]:
    """Slots grouped as stations: cells of the stations, and the station of each slot or NIL.

    The stations stand where slots are served from, far from each other: the first slot's cell, then
    again and again the cell that is farthest from all so far. A slot counts to the nearest station.
    """
    access = slot_access(plan)
    stand = access.max(axis=1)
    served = np.flatnonzero(stand != NIL)
    chosen: list[int] = []
    best = np.full(len(served), np.iinfo(np.int32).max, np.int64)
    group = np.full(len(access), NIL, np.int32)
    while len(chosen) < most and len(served) and best.max() > 0:
        cell = int(stand[served[0 if not chosen else int(np.argmax(best))]])
        steps = steps_from(plan, [cell])[stand[served]].astype(np.int64)
        steps[steps == NIL] = np.iinfo(np.int32).max
        nearer = steps < best
        best[nearer] = steps[nearer]
        group[served[nearer]] = len(chosen)
        chosen.append(cell)
    return np.array(chosen, np.int32), group
