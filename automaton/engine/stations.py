"""Stations that work on parts, one at a time, in arrival order.

A part comes to a station when its order is delivered there; the order for its next way is released
in the tick in which its job is done.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.requests import request_zoning
from automaton.engine.state import (
    CLOCK_KNOWN_ORDERS,
    CLOCK_NEXT_PART,
    CLOCK_NEXT_RELEASE,
    CLOCK_OPEN_JOBS,
    CLOCK_REVISION,
    CLOCK_TICK,
    NIL,
    ORDER_WAITING,
)


@kernel
def come(world, work, tick):
    """A part comes to the station of this work; it can be worked on from a tick on.

    It stands behind those that came before; of those that come in one tick the lowest number is first,
    so that the sequence in which robots are stored decides nothing.
    """
    stations = world.stations
    k = np.int64(stations.station[work])
    stations.arrival_tick[work] = tick
    ahead, at = np.int64(NIL), np.int64(stations.in_service[k])
    while at != NIL and (
        stations.arrival_tick[at] < tick or (stations.arrival_tick[at] == tick and at < work)
    ):
        ahead, at = at, np.int64(stations.next_in_queue[at])
    stations.next_in_queue[work] = at
    if ahead == NIL:
        stations.in_service[k] = work
        stations.job_done_tick[k] = tick + stations.processing_time[work]
    else:
        stations.next_in_queue[ahead] = work
    if at == NIL:
        stations.queue_tail[k] = work


@kernel
def work_at_stations(world):
    """Parts enter that come in this tick; jobs that are done end, and the next ones begin."""
    stations, clock = world.stations, world.clock
    while clock[CLOCK_NEXT_PART] < stations.part_arrivals.shape[0]:
        work = np.int64(stations.part_arrivals[clock[CLOCK_NEXT_PART]])
        if stations.arrival_tick[work] > clock[CLOCK_TICK]:
            break
        come(world, work, clock[CLOCK_TICK])
        clock[CLOCK_NEXT_PART] += 1
    for k in range(stations.slot.shape[0]):
        work = np.int64(stations.in_service[k])
        if work == NIL or stations.job_done_tick[k] > clock[CLOCK_TICK]:
            continue
        stations.completion_tick[work] = clock[CLOCK_TICK]
        clock[CLOCK_OPEN_JOBS] -= 1
        if stations.releases_order[work] != NIL:
            make_known(world, np.int64(stations.releases_order[work]))
        following = np.int64(stations.next_in_queue[work])
        stations.in_service[k] = following
        if following == NIL:
            stations.queue_tail[k] = NIL
        else:
            begin = max(clock[CLOCK_TICK], np.int64(stations.arrival_tick[following]))
            stations.job_done_tick[k] = begin + stations.processing_time[following]


@kernel
def make_known(world, order):
    """The order waits at its station from now on."""
    orders, clock = world.orders, world.clock
    orders.state[order] = ORDER_WAITING
    orders.release_tick[order] = clock[CLOCK_TICK]
    clock[CLOCK_KNOWN_ORDERS] = max(clock[CLOCK_KNOWN_ORDERS], order + 1)
    orders.release_sequence[clock[CLOCK_NEXT_RELEASE]] = order
    clock[CLOCK_NEXT_RELEASE] += 1
    clock[CLOCK_REVISION] += 1
    request_zoning(world)


@kernel
def deliver(world, order, ticks):
    """A load is where it has to go when its robot has dropped it, in so many ticks.

    The station begins to work on its part, or lines it up.
    """
    if world.stations.job_of_order.shape[0]:
        work = np.int64(world.stations.job_of_order[order])
        if work != NIL:
            come(world, work, world.clock[CLOCK_TICK] + ticks)
