"""Which robot's queue an order comes into, and how queues share orders.

An order that waits at a station belongs to the zone of that station; one that was set down on its way
still belongs to the zone whose robot brought it, and is routed on from there (Keith & La).
"""

import numpy as np

from automaton.strategy.kernels import (
    FAR,
    can_bring,
    distance,
    drop_stand,
    kernel,
    pick_stand,
    position,
)
from automaton.world.state import NIL, TICK
from automaton.zoning.routing import route
from strategies.zoning.able import (
    enter,
    enter_able,
    is_free,
    is_running,
    length_then,
    queue_length,
    serves_all,
    zone_can,
)

FORMER = -2  # queue: FORMER - zone, of a part that a robot of that zone set down on its way


@kernel
def slot_at(view, station):
    """Where a load may lie at a station on its way: the station itself, or a free shelf; NIL: nowhere."""
    if view.stations.slot.shape[0]:
        return np.int64(view.stations.slot[station])
    for slot in range(view.slots.spare):
        if view.zoning.station_of[slot] != station or view.slots.endless[slot]:
            continue
        if view.slots.content[slot] == NIL and view.slots.by[slot] == NIL:
            return np.int64(slot)
    return np.int64(NIL)


@kernel
def owner_of(view, design, order, again):
    """The zone that has to say where an order goes; NIL: none. again: forget who brought it."""
    slot = np.int64(view.orders.place[order])
    if slot == NIL:
        return np.int64(NIL)
    former = np.int64(view.zoning.queue[order])
    if former <= FORMER and again == 0:
        return FORMER - former
    station = np.int64(view.zoning.station_of[slot])
    return np.int64(NIL) if station == NIL else np.int64(design.zone[station])


@kernel
def queue_order(view, design, space, given, rule, order, zone):
    """Route an order of a zone; enters its queue and its next stop."""
    at = np.int64(view.zoning.station_of[view.orders.place[order]])
    target = np.int64(view.orders.target[order])
    to = np.int64(view.zoning.station_of[target])
    if at == NIL or to == NIL or design.zone[to] == NIL:
        enter_able(view, given, order, zone, target, 0)
        return
    queue, station, _ = route(view.zoning.roads, design, space, rule, zone, at, to)
    stop = target if station == to else slot_at(view, station)
    enter_able(view, given, order, queue, target if stop == NIL else stop, 0)


@kernel
def queue_orders_of(view, design, space, given, rule, robot, near):
    """Queue the orders that are in no queue and belong to the zones that a robot serves.

    near: cells; an order whose next station is so near a transfer station is brought there directly.
    """
    for order in range(view.orders.state.shape[0]):
        if not is_free(view, order) or view.zoning.queue[order] >= 0:
            continue
        zone = owner_of(view, design, order, 0)
        if zone != NIL and view.zoning.server[zone] == robot:
            if near > 0 and is_near_transfer(view, design, order, zone, near):
                enter_able(view, given, order, zone, np.int64(view.orders.target[order]), 1)
            else:
                queue_order(view, design, space, given, rule, order, zone)


@kernel
def is_near_transfer(view, design, order, zone, near):
    """Whether the next station of an order lies near one where it would leave the zone."""
    to = np.int64(view.zoning.station_of[view.orders.target[order]])
    if to == NIL or design.zone[to] == NIL or design.zone[to] == zone:
        return False
    for station in range(design.zone.shape[0]):
        if design.transfer[zone, design.zone[to], station]:
            if view.zoning.roads.between[station, to] <= near:
                return True
    return False


@kernel
def queue_orders(view, design, space, given, rule, again):
    """Queue all orders that are in no queue; again = 1: all that wait, from where they are."""
    for order in range(view.orders.state.shape[0]):
        if not is_free(view, order) or (view.zoning.queue[order] >= 0 and again == 0):
            continue
        zone = owner_of(view, design, order, again)
        if zone != NIL:
            queue_order(view, design, space, given, rule, order, zone)


@kernel
def lies_near(view, order, zone, near):
    """Whether an order waits within so many cells of a station of a zone."""
    at = np.int64(view.zoning.station_of[view.orders.place[order]])
    for station in range(view.zoning.design.zone.shape[0]):
        if view.zoning.design.zone[station] == zone and at != NIL:
            if view.zoning.roads.between[at, station] <= near:
                return True
    return False


@kernel
def first_for(view, given, space, zone, other, taker, direct, near, age, job):
    """The first order in the queue of a zone, by its score, whose next station is in the other zone.

    It is one that the robot of the zone `taker` can bring to its target.

    Of those not direct yet, if direct = 0; of those that lie within `near` cells of a station of the
    other zone, if near > 0. NIL if there is none.
    """
    design, found, highest = view.zoning.design, NIL, -(1 << 62)
    server = np.int64(view.zoning.server[zone])
    if server == NIL:
        return found
    i = np.int64(view.robots.at_index[server])
    kind, heading = np.int64(view.robots.type[i]), np.int64(view.robots.heading[i])
    for order in range(view.orders.state.shape[0]):
        if not is_free(view, order) or view.zoning.queue[order] != zone:
            continue
        to = np.int64(view.zoning.station_of[view.orders.target[order]])
        if to == NIL or design.zone[to] != other or (direct == 0 and view.zoning.direct[order]):
            continue
        if near > 0 and not lies_near(view, order, other, near):
            continue
        if not zone_can(view, given, taker, order, np.int64(view.orders.target[order])):
            continue
        stop = np.int64(view.zoning.stop[order])
        if not can_bring(view, kind, order, stop):
            continue
        pick = pick_stand(view, kind, np.int64(view.orders.place[order]))
        ticks = distance(view, space, kind, position(view, i), heading, pick)
        ticks += distance(view, space, kind, pick, heading, drop_stand(view, kind, stop))
        if ticks >= FAR:
            continue
        worth = age * (view.clock[TICK] - view.orders.released[order]) - job * ticks
        if worth > highest:
            found, highest = order, worth
    return found


@kernel
def share(view, space, given, age, job):
    """Load sharing, once: at most two orders for each pair of zones; returns how many.

    The first order of the longer queue that goes into the other zone moves to that zone's robot; the
    first one of the shorter queue that goes into the busy zone skips the transfer station.
    """
    zones = view.zoning.server.shape[0]
    shared = 0
    for a in range(zones):
        for b in range(a + 1, zones):
            here, there = length_then(view, given, a), length_then(view, given, b)
            if here == there:
                continue
            busy, idle = (a, b) if here > there else (b, a)
            moved = first_for(view, given, space, busy, idle, idle, 1, 0, age, job)
            if moved != NIL:
                enter(given, moved, idle, np.int64(view.orders.target[moved]), 1)
                shared += 1
            skipped = first_for(view, given, space, idle, busy, idle, 0, 0, age, job)
            if skipped != NIL:
                enter(given, skipped, idle, np.int64(view.orders.target[skipped]), 1)
                shared += 1
    return shared


@kernel
def take_over(view, given):
    """Who is out of order is replaced by a running robot until it is back.

    By one that serves all its stations if there is any, then by that with the shortest queue.
    """
    zones = view.zoning.server.shape[0]
    for zone in range(zones):
        best, least = zone, 1 << 60
        if not is_running(view, np.int64(view.robots.at_index[zone])):
            for other in range(zones):
                waiting = queue_length(view, other)
                waiting += 0 if serves_all(view, other, zone) else 1 << 40
                if is_running(view, np.int64(view.robots.at_index[other])) and waiting < least:
                    best, least = other, waiting
        if view.zoning.server[zone] != best:
            given.server[zone] = best


@kernel
def record_flow(view, window, now, flow):
    """flow[i, j] = orders from i to j that are known and not delivered longer than `window` ticks ago.

    Returns how many there are. An order that begins and ends at one station is no flow.
    """
    flow[:] = 0.0
    total = 0
    orders = view.orders
    for order in range(orders.state.shape[0]):
        if orders.released[order] > now:
            continue
        gone = np.int64(orders.delivered[order])
        start = np.int64(view.zoning.station_of[orders.source[order]])
        end = np.int64(view.zoning.station_of[orders.target[order]])
        if start == NIL or end == NIL or start == end or (gone != NIL and now - gone >= window):
            continue
        flow[start, end] += 1.0
        total += 1
    return total
