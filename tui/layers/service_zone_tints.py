"""Which of six tints each zone has that robots serve: zones between which a way leads differ.

Up to six zones have a tint each, by their numbers. Of more, each has its own number's tint where it can:
zones are coloured in the order that the one with fewest neighbours left is the last (Matula & Beck), so
that on a floor without bridges six are enough.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from automaton.engine.facilities import ServiceZones
from automaton.engine.state import NIL
from automaton.floor.floor_plan import FloorPlan
from strategies.zoning.service_zone_lines import stations_of, ways_of
from tui.render.tints import TINTS


def tints_shared(zones: int) -> bool:
    """Whether some zones have the same tint."""
    return zones > len(TINTS)


def service_zone_tints(service_zones: ServiceZones) -> NDArray[np.int8]:
    """(Z,) the tint of each zone, an index of TINTS."""
    zones = len(service_zones.server)
    if not tints_shared(zones):
        return np.arange(zones, dtype=np.int8)
    ways = np.ascontiguousarray(service_zones.roads.next, np.int32).tobytes()
    held = np.ascontiguousarray(service_zones.design.held, np.int32).tobytes()
    return _tints_of(ways, held, zones)


def design_tints(
    floor_plan: FloorPlan, slots_cell: NDArray[np.int32], service_zones: ServiceZones
) -> NDArray[np.int8]:
    """(C,) the tint of each cell: of ways, of stations, and of slots that belong to one."""
    tints = np.full(floor_plan.kind.size, NIL, np.int8)
    tint = service_zone_tints(service_zones)
    cells, zones = ways_of(service_zones.roads, service_zones.design, floor_plan.stride)
    tints[cells] = tint[zones]
    for cells, zones in (
        _slots(slots_cell, service_zones),
        stations_of(service_zones.roads, service_zones.design)[:2],
    ):
        tints[cells[zones != NIL]] = tint[zones[zones != NIL]]
    return tints


def _slots(
    cells: NDArray[np.int32], service_zones: ServiceZones
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Cells of slots that count to a station, and its zone."""
    station = service_zones.station_of[: len(cells)]
    there = station != NIL
    return cells[there], service_zones.design.zone[station[there]]


def zone_cells_of(
    floor_plan: FloorPlan, service_zones: ServiceZones, zone: int
) -> NDArray[np.int32]:
    """(k,) the cells of one zone's ways and stations."""
    ways, ways_zone = ways_of(service_zones.roads, service_zones.design, floor_plan.stride)
    cells, cells_zone, _ = stations_of(service_zones.roads, service_zones.design)
    found = np.concatenate((ways[ways_zone == zone], cells[cells_zone == zone]))
    return np.unique(found).astype(np.int32)


@lru_cache(maxsize=8)  # a design stays for many frames
def _tints_of(ways: bytes, held: bytes, zones: int) -> NDArray[np.int8]:
    ahead = np.frombuffer(ways, np.int32).reshape(-1, 4)
    near = neighbours(ahead, np.frombuffer(held, np.int32), zones)
    tint = np.full(zones, NIL, np.int8)
    for zone in reversed(sparest_first(near)):
        taken = {int(tint[other]) for other in near[zone]}
        own = zone % len(TINTS)
        wanted = [own, *range(len(TINTS))]
        tint[zone] = next((one for one in wanted if one not in taken), own)
    tint.setflags(write=False)
    return tint


def neighbours(ahead: NDArray[np.int32], held: NDArray[np.int32], zones: int) -> list[set[int]]:
    """Zones between whose points a way leads through points of no zone, or of none.

    ahead: (P, 4) the next points; held: (P,) the zone of each point, or NIL. A point of no zone counts
    to the zone that is fewest points away.
    """
    nearest = held.copy()
    while True:
        grown = nearest.copy()
        for there in ahead.T:
            free = (nearest == NIL) & (there != NIL)
            grown[free] = np.where(grown[free] == NIL, nearest[there[free]], grown[free])
        if np.array_equal(grown, nearest):
            break
        nearest = grown
    near: list[set[int]] = [set() for _ in range(zones)]
    for there in ahead.T:
        a, b = nearest[there != NIL], nearest[there[there != NIL]]
        apart = (a != NIL) & (b != NIL) & (a != b)
        for one, other in np.unique(np.column_stack((a[apart], b[apart])), axis=0).tolist():
            near[one].add(other)
            near[other].add(one)
    return near


def sparest_first(near: list[set[int]]) -> list[int]:
    """All zones; each in turn has the fewest neighbours among those that are left (ties: the last)."""
    left, order = set(range(len(near))), []
    while left:
        zone = min(left, key=lambda one: (len(near[one] & left), -one))
        left.remove(zone)
        order.append(zone)
    return order
