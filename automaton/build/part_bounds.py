"""What parts take at least, whatever the fleet: work that stations do one part after another.

    busiest   a station works on one part at a time: all its works, but for those that end a route,
              since a run may end when the last load is delivered
    longest   one part goes through its whole route: its works but the last, and the ways between

Work that is drawn counts as one tick, the least that can be drawn; parts that come at drawn ticks, as
if they all came with the first.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

from automaton.engine.state import Array
from automaton.scenario.orders import Orders, Parts

LEAST_DRAWN = 1


class PartBounds(NamedTuple):
    """Ticks in which the parts of a scenario cannot be done faster."""

    busiest: float  # the work of the station that has most
    longest: float  # the route that takes longest, when its last part has come


def ways(orders: Orders) -> list[tuple[int, int]]:
    """The stations, from 1, between which each order of the parts leads; order by order."""
    return [
        way
        for kind in orders.parts or ()
        for way in list(itertools.pairwise(kind.route)) * kind.count
    ]


def part_bounds(orders: Orders, ticks: Array) -> PartBounds:
    """The bounds of parts, of which each order takes a robot at least so many ticks."""
    busiest: dict[int, float] = {}
    longest, first = 0.0, 0
    for kind in orders.parts or ():
        worked = kind.route[:-1]
        for number in worked:
            busiest[number] = busiest.get(number, 0.0) + kind.count * least_work(orders, number)
        on_its_way = float(ticks[first : first + len(worked)].sum())
        own_work = sum(least_work(orders, number) for number in worked)
        longest = max(longest, last_comes(kind) + own_work + on_its_way)
        first += kind.count * len(worked)
    return PartBounds(max(busiest.values(), default=0.0), longest)


def least_work(orders: Orders, number: int) -> int:
    """Ticks that a station, by number from 1, needs at least for a part."""
    time = (
        orders.processing_time[number - 1]
        if isinstance(orders.processing_time, tuple)
        else orders.processing_time
    )
    return time if isinstance(time, int) else LEAST_DRAWN


def last_comes(kind: Parts) -> int:
    """The earliest tick in which the last part of a type can come."""
    return (
        kind.first_release + (kind.count - 1) * kind.interarrival_time
        if isinstance(kind.interarrival_time, int)
        else kind.first_release
    )
