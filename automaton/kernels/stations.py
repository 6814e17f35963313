"""Stations that work on parts, one at a time, in the sequence of their coming.

A part comes to a station when its order is delivered there; the order for its next way becomes known
in the tick in which the work on it is done.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.news import tell_zoning
from automaton.world.state import (
    CHANGES,
    NEXT_ORDER,
    NEXT_PART,
    NIL,
    TICK,
    UNWORKED,
    WAITING,
)


@kernel
def come(world, work, tick):
    """A part comes to the station of this work; it can be worked on from a tick on.

    It stands behind those that came before; of those that come in one tick the lowest number is first,
    so that the sequence in which robots are stored decides nothing.
    """
    stations = world.stations
    k = np.int64(stations.station[work])
    stations.came[work] = tick
    ahead, at = np.int64(NIL), np.int64(stations.first[k])
    while at != NIL and (stations.came[at] < tick or (stations.came[at] == tick and at < work)):
        ahead, at = at, np.int64(stations.behind[at])
    stations.behind[work] = at
    if ahead == NIL:
        stations.first[k] = work
        stations.until[k] = tick + stations.ticks[work]
    else:
        stations.behind[ahead] = work
    if at == NIL:
        stations.last[k] = work


@kernel
def work_at_stations(world):
    """Parts enter that come in this tick; work that is done ends, and the next one begins."""
    stations, clock = world.stations, world.clock
    while clock[NEXT_PART] < stations.entering.shape[0]:
        work = np.int64(stations.entering[clock[NEXT_PART]])
        if stations.came[work] > clock[TICK]:
            break
        come(world, work, clock[TICK])
        clock[NEXT_PART] += 1
    for k in range(stations.slot.shape[0]):
        work = np.int64(stations.first[k])
        if work == NIL or stations.until[k] > clock[TICK]:
            continue
        stations.done[work] = clock[TICK]
        clock[UNWORKED] -= 1
        if stations.frees[work] != NIL:
            make_known(world, np.int64(stations.frees[work]))
        following = np.int64(stations.behind[work])
        stations.first[k] = following
        if following == NIL:
            stations.last[k] = NIL
        else:
            begin = max(clock[TICK], np.int64(stations.came[following]))
            stations.until[k] = begin + stations.ticks[following]


@kernel
def make_known(world, order):
    """The order waits at its station from now on."""
    orders, clock = world.orders, world.clock
    orders.state[order] = WAITING
    orders.released[order] = clock[TICK]
    orders.coming[clock[NEXT_ORDER]] = order
    clock[NEXT_ORDER] += 1
    clock[CHANGES] += 1
    tell_zoning(world)


@kernel
def deliver(world, order, ticks):
    """A load is where it has to go when its robot has set it down, in so many ticks.

    The station begins to work on its part, or lines it up.
    """
    if world.stations.arrives.shape[0]:
        work = np.int64(world.stations.arrives[order])
        if work != NIL:
            come(world, work, world.clock[TICK] + ticks)
