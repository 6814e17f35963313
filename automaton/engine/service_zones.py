"""Zones that robots serve: the roads between stations, a zone design, and who does what in it.

P critical points, S stations, Z zones, M segments (at most one for each station), s slots, m orders,
n robots. A station is a slot of its own, or a group of slots (shelves, racks) that are served from
near the same point. NIL (-1) means none. Without a zoning strategy all arrays are empty.
Source of the terms: Keith & La, "Dynamic Zoning of Industrial Environments with Autonomous Mobile
Robots", after Ho & Liao.
"""

from __future__ import annotations

from typing import Any, Final

from numpy.typing import NDArray

from automaton.engine.jit.fields import DERIVED, NIL, STATE, STATIC, field, nested
from automaton.engine.jit.structs import Struct

Array = NDArray[Any]

MESSAGE_WORDS: Final = 8  # numbers in the message that a robot sends to those in range


class Roads(Struct, role=STATIC):
    """Critical points (stations, crossings, corners, dead ends) and the straight ways between them."""

    cell: Array = field("(P,) int32", "flat cell")
    next: Array = field("(P, 4) int32", "the point that driving E, S, W, N leads to, or NIL")
    step: Array = field("(P, 4) int32", "cells to it")
    station: Array = field("(P,) int32", "the station at the point, or NIL")
    point: Array = field("(S,) int32", "the point of each station")
    hop: Array = field("(P, P) int32", "the next point on the shortest way to another one, or NIL")
    between: Array = field("(S, S) int32", "cells of the shortest way, whatever the zones are")


class Design(Struct, role=STATE):
    """A zone design; a segment is a path of points from one station of its zone to another."""

    zone: Array = field("(S,) int32", "the zone of each station", default=NIL)
    segments: Array = field("(1,) int64", "how many are in use; the first ones")
    owner: Array = field("(M,) int32", "zone of a segment", default=NIL)
    ends: Array = field("(M, 2) int32", "the stations that it joins", default=NIL)
    points: Array = field("(M,) int32", "how many points it has, both ends included")
    path: Array = field("(M, P) int32", "its points", default=NIL)
    held: Array = field(
        "(P,) int32", "the zone whose stations or segments a point belongs to, or NIL", default=NIL
    )
    transfer: Array = field(
        "(Z, Z, S) uint8", "1 = a transfer station between two zones; symmetric"
    )


class ServiceZones(Struct):
    """The service zones of a world."""

    roads: Roads
    design: Design = nested(digest=50, by="hash_of_design")
    station_of: Array = field("(s,) int32", "the station of a slot, or NIL", role=DERIVED)
    accessible: Array = field(
        "(Z, S) uint8",
        "1 = the robot with the number of the zone gets to the station",
        default=1,
        role=STATIC,
    )
    has_priority: Array = field("(Z, S) uint8", "1 = its type has priority there", role=STATIC)
    server: Array = field(
        "(Z,) int32", "identity of the robot that serves a zone", hidden=NIL, digest=55
    )
    queue: Array = field(
        "(m,) int32",
        "the zone in whose queue an order is; NIL: none yet; "
        "-2 - zone: none any more, since a robot of that zone dropped it on its way",
        default=NIL,
        digest=51,
    )
    next_slot: Array = field(
        "(m,) int32", "the slot where it is dropped next, or NIL", default=NIL, digest=52
    )
    skips_transfer: Array = field(
        "(m,) uint8", "1 = past the transfer stations, by load sharing", digest=53
    )
    picked_from: Array = field(
        "(m,) int32",
        "the slot from which it was picked up last, or NIL",
        default=NIL,
        digest=54,
        recorded=False,
    )
    halt: Array = field(
        "(n,) int64", "a robot stands still up to this tick", default=NIL, digest=56
    )
    wake: Array = field(
        "(n,) int64",
        "zoning is asked about a robot from this tick on, or NIL",
        default=NIL,
        digest=57,
        recorded=False,
    )
    messages: Array = field(
        f"(n, {MESSAGE_WORDS}) int64",
        "what each robot sends to those in range",
        digest=58,
        recorded=False,
    )


def empty_design(points: int, stations: int, zones: int) -> Design:
    """A design in which no station has a zone."""
    return Design.sized({"P": points, "S": stations, "Z": zones, "M": stations})


def design_for(roads: Roads, zones: int) -> Design:
    """An empty design for these roads."""
    return empty_design(len(roads.cell), len(roads.point), zones)
