"""Pods, the lines of orders that they are carried to stations for, and the trips that follow.

p pods, k stations, l lines of q orders. A *trip* is one pod lifted, carried to some stations and stored
again: an order of the world, which is known from the tick in which a line asks for it. There are as many
numbers of trips as lines, w = l times the stops that a trip may have. Orders of a list may carry pods
without lines: then the arrays of trips go by order and stop of the list, those of lines are empty.
NIL (-1) means none.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from automaton.engine.jit.fields import DERIVED, MEASURED, NIL, SCRATCH, STATIC, field
from automaton.engine.jit.structs import Struct

Array = NDArray[Any]


class Pods(Struct, role=STATIC):
    """Pods. One is in a slot or on a robot, never elsewhere."""

    slot: Array = field(
        "(p,) int32", "where it stands, NIL: on a robot", default=NIL, digest=61, header=True
    )
    home: Array = field("(p,) int32", "the slot in which it stood first")
    pod_class: Array = field("(p,) int16", "its class, from 0")
    trip: Array = field("(p,) int32", "its trip that is not over, or NIL", default=NIL, digest=62)
    first_line: Array = field(
        "(p,) int32",
        "the first line, or order of a list, that waits for its next trip, or NIL",
        default=NIL,
        digest=63,
    )
    last_line: Array = field("(p,) int32", "the last of them", default=NIL, role=DERIVED)
    stored: Array = field(
        "(p,) int32", "those stored in this tick that lines wait for", role=DERIVED
    )
    slot_class: Array = field("(s,) int16", "the class of a storage cell, from 0; other slots: NIL")
    weight: Array = field(
        "(p,) int32", "what a robot must be able to carry", default=1, header=True
    )
    open_lines: Array = field(
        "(p,) int32", "lines for it that are known and not done", role=DERIVED
    )
    sku_first: Array = field(
        "(skus + 1,) int32",
        "sku_pod[sku_first[u]: sku_first[u + 1]] are the pods with SKU u",
        header=True,
    )
    sku_pod: Array = field("(held,) int32", "pods, by SKU and number", header=True)


class Lines(Struct, role=STATIC):
    """What orders want of pods at stations."""

    order: Array = field("(l,) int32", "the order that it belongs to", header=True)
    pod: Array = field(
        "(l,) int32", "the pod that it asks for; NIL: any with its SKU", default=NIL, header=True
    )
    sku: Array = field(
        "(l,) int32", "the SKU that is wanted of any pod, or NIL", default=NIL, header=True
    )
    taken_from: Array = field(
        "(l,) int32", "the pod that has it, NIL: not known yet", default=NIL, role=DERIVED
    )
    station: Array = field(
        "(l,) int32", "the station that it asks for; NIL: any", default=NIL, header=True
    )
    release_tick: Array = field("(l,) int32", "tick from which it is known", header=True)
    due: Array = field("(l,) int32", "tick in which it is due, or NEVER", header=True)
    priority: Array = field("(l,) int16", "the larger one comes first", header=True)
    sequence: Array = field("(l,) int32", "the lines, in the sequence in which they are known")
    handling: Array = field(
        "(h, l) int64", "millionths of a tick that it takes, by rule of handling", header=True
    )
    served_at: Array = field(
        "(l,) int32", "the station where it is done, NIL: not known yet", default=NIL, digest=64
    )
    following: Array = field(
        "(l,) int32",
        "the next line of the same stop, or that waits for the same pod, or NIL",
        default=NIL,
        role=DERIVED,
    )
    trip: Array = field("(l,) int32", "its trip, NIL: none yet", default=NIL, digest=65)
    done: Array = field("(l,) int32", "tick in which it was done, or NIL", default=NIL, digest=66)
    left: Array = field("(q,) int32", "lines of an order that are not done", role=DERIVED)
    order_station: Array = field(
        "(q,) int32", "the station of an order's latest line, or NIL", default=NIL, role=DERIVED
    )
    order_done: Array = field(
        "(q,) int32", "tick in which the last line was done, or NIL", default=NIL, role=DERIVED
    )


class Trips(Struct, role=DERIVED):
    """Trips, beside what is kept of every order; and what robots hold for them, by identity."""

    pod: Array = field("(l,) int32", "its pod, NIL: not known yet", default=NIL)
    following: Array = field(
        "(listed,) int32",
        "of an order of a list: the next one that waits for the same pod, or NIL",
        default=NIL,
    )
    begun: Array = field("(l,) int32", "how many of its stops were begun", digest=67)
    station: Array = field("(w,) int32", "the station of a stop, or NIL", default=NIL, digest=68)
    handling: Array = field("(w,) int64", "millionths of a tick that its lines take")
    first_line: Array = field("(w,) int32", "the first line of a stop, or NIL", default=NIL)
    last_line: Array = field("(w,) int32", "the last of them", default=NIL)
    place: Array = field(
        "(r,) int32", "the station at which a robot has a place, or NIL", default=NIL, digest=69
    )
    leaving: Array = field(
        "(r,) int32",
        "a station at which it has another one until it has left the cell, or NIL",
        default=NIL,
        digest=70,
    )
    offered: Array = field(
        "(r,) int32",
        "the trip of the pod above it, which is reserved for it, or NIL",
        default=NIL,
        digest=71,
    )


class PodStations(Struct, role=STATIC):
    """The stations to which pods are carried, in the sequence of their numbers."""

    cell: Array = field("(k,) int32", "where it is", header=True)
    places: Array = field("(k,) int32", "trips that it lets come, NIL: any number", header=True)
    taken: Array = field("(k,) int32", "how many have a place", digest=72)
    open_lines: Array = field("(k,) int32", "lines that are known and not done", digest=73)
    rule: Array = field("(k,) int32", "its rule of handling: a row of lines.handling", header=True)
    visit: Array = field("(k,) int64", "millionths of a tick that a visit takes", header=True)
    station_at: Array = field("(c,) int32", "the station in a cell, or NIL")
    queue_at: Array = field("(c,) int32", "the station whose queue a cell belongs to, or NIL")
    queue_way: Array = field("(c,) uint8", "direction from a cell of a queue to the next one")
    held_back: Array = field(
        "(c,) uint8", "1 = its holder queues there, or is at the station", role=SCRATCH
    )
    ticks_from: Array = field(
        "(d, s) int32",
        "least ticks with a load from a slot to each station; no rows where no line has a SKU",
        header=True,
    )
    breaks: Array = field("(b, 3) int64", "station, first tick, tick after the last; by tick")
    served_ticks: Array = field("(k,) int64", "ticks in which it served a robot", role=MEASURED)
    starved_ticks: Array = field(
        "(k,) int64",
        "ticks with lines open for it, no break, and no robot in its cell or queue",
        role=MEASURED,
    )
    visited_at: Array = field(
        "(k,) int64", "the last tick in which a robot was in its cell or queue", role=MEASURED
    )
