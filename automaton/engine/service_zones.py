"""Zones that robots serve: the roads between stations, a zone design, and who does what in it.

P critical points, S stations, Z zones, M segments (at most one for each station), s slots, m orders,
n robots. A station is a slot of its own, or a group of slots (shelves, racks) that are served from
near the same point. NIL (-1) means none. Without a zoning strategy all arrays are empty.
Source of the terms: Keith & La, "Dynamic Zoning of Industrial Environments with Autonomous Mobile
Robots", after Ho & Liao.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.facilities import NIL
from automaton.engine.jit.structs import Struct

Array = NDArray[Any]

MESSAGE_WORDS: Final = 8  # numbers in the message that a robot sends to those in range


class Roads(Struct):
    """Critical points (stations, crossings, corners, dead ends) and the straight ways between them."""

    cell: Array  # (P,) int32: flat cell
    next: Array  # (P, 4) int32: the point that driving E, S, W, N leads to, or NIL
    step: Array  # (P, 4) int32: cells to it
    station: Array  # (P,) int32: the station at the point, or NIL
    point: Array  # (S,) int32: the point of each station
    hop: Array  # (P, P) int32: the next point on the shortest way to another one, or NIL
    between: Array  # (S, S) int32: cells of the shortest way, whatever the zones are


class Design(Struct):
    """A zone design; a segment is a path of points from one station of its zone to another."""

    zone: Array  # (S,) int32: the zone of each station
    segments: Array  # (1,) int64: how many are in use; the first ones
    owner: Array  # (M,) int32: zone of a segment
    ends: Array  # (M, 2) int32: the stations that it joins
    points: Array  # (M,) int32: how many points it has, both ends included
    path: Array  # (M, P) int32: its points
    held: Array  # (P,) int32: the zone whose stations or segments a point belongs to, or NIL
    transfer: Array  # (Z, Z, S) uint8: 1 = a transfer station between two zones; symmetric


class ServiceZones(Struct):
    """The service zones of a world."""

    roads: Roads
    design: Design
    station_of: Array  # (s,) int32: the station of a slot, or NIL
    accessible: Array  # (Z, S) uint8: 1 = the robot with the number of the zone gets to the station
    has_priority: Array  # (Z, S) uint8: 1 = its type has priority there
    server: Array  # (Z,) int32: identity of the robot that serves a zone
    queue: Array  # (m,) int32: the zone in whose queue an order is; NIL: none yet; -2 - zone: none
    #   any more, since a robot of that zone dropped it on its way
    next_slot: Array  # (m,) int32: the slot where it is dropped next, or NIL
    skips_transfer: Array  # (m,) uint8: 1 = past the transfer stations, by load sharing
    picked_from: Array  # (m,) int32: the slot from which it was picked up last, or NIL
    halt: Array  # (n,) int64: a robot stands still up to this tick
    wake: Array  # (n,) int64: zoning is asked about a robot from this tick on, or NIL
    messages: Array  # (n, MESSAGE_WORDS) int64: what each robot tells those in range


def empty_design(points: int, stations: int, zones: int) -> Design:
    """A design in which no station has a zone."""
    return Design(
        zone=np.full(stations, NIL, np.int32),
        segments=np.zeros(1, np.int64),
        owner=np.full(stations, NIL, np.int32),
        ends=np.full((stations, 2), NIL, np.int32),
        points=np.zeros(stations, np.int32),
        path=np.full((stations, points), NIL, np.int32),
        held=np.full(points, NIL, np.int32),
        transfer=np.zeros((zones, zones, stations), np.uint8),
    )


def design_for(roads: Roads, zones: int) -> Design:
    """An empty design for these roads."""
    return empty_design(len(roads.cell), len(roads.point), zones)
