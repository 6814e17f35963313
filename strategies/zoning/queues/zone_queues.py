"""Which robot's queue an order comes into, and how queues share orders.

An order that waits at a station belongs to the zone of that station; one that was dropped on its
way still belongs to the zone whose robot brought it, and is routed on from there (Keith & La).
"""

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import (
    UNREACHABLE,
    can_bring,
    distance,
    dropoff_cell,
    kernel,
    pickup_cell,
    position,
    with_load,
    without_load,
)
from strategies.zoning.design.part_routing import route
from strategies.zoning.queues.reassignment import (
    can_zone_deliver,
    enqueue_with_capable_zone,
    enter,
    is_free,
    is_running,
    length_then,
    queue_length,
    serves_all,
)

FORMER = -2  # queue: FORMER - zone, of a part that a robot of that zone dropped on its way


@kernel
def slot_at(view, station):
    """Where a load may lie at a station on its way: the station itself, or a free shelf; NIL: nowhere."""
    if view.stations.slot.shape[0]:
        return np.int64(view.stations.slot[station])
    for slot in range(view.slots.first_spare):
        if view.service_zones.station_of[slot] != station or view.slots.unbounded[slot]:
            continue
        if view.slots.content[slot] == NIL and view.slots.reserved_by[slot] == NIL:
            return np.int64(slot)
    return np.int64(NIL)


@kernel
def owner_of(view, design, order, again):
    """The zone that has to say where an order goes; NIL: none. again: forget who brought it."""
    slot = np.int64(view.orders.current_slot[order])
    if slot == NIL:
        return np.int64(NIL)
    former = np.int64(view.service_zones.queue[order])
    if former <= FORMER and again == 0:
        return FORMER - former
    station = np.int64(view.service_zones.station_of[slot])
    return np.int64(NIL) if station == NIL else np.int64(design.zone[station])


@kernel
def queue_order(view, design, workspace, out, rule, order, zone):
    """Route an order of a zone; enters its queue and its next stop."""
    at = np.int64(view.service_zones.station_of[view.orders.current_slot[order]])
    target = np.int64(view.orders.target[order])
    to = np.int64(view.service_zones.station_of[target])
    if at == NIL or to == NIL or design.zone[to] == NIL:
        enqueue_with_capable_zone(view, out, order, zone, target, 0)
        return
    queue, station, _ = route(view.service_zones.roads, design, workspace, rule, zone, at, to)
    stop = target if station == to else slot_at(view, station)
    enqueue_with_capable_zone(view, out, order, queue, target if stop == NIL else stop, 0)


@kernel
def queue_orders_of(view, design, workspace, out, rule, robot, near):
    """Queue the orders that are in no queue and belong to the zones that a robot serves.

    near: cells; an order whose next station is so near a transfer station is brought there directly.
    """
    for order in range(view.orders.state.shape[0]):
        if not is_free(view, order) or view.service_zones.queue[order] >= 0:
            continue
        zone = owner_of(view, design, order, 0)
        if zone != NIL and view.service_zones.server[zone] == robot:
            if near > 0 and is_near_transfer(view, design, order, zone, near):
                enqueue_with_capable_zone(
                    view, out, order, zone, np.int64(view.orders.target[order]), 1
                )
            else:
                queue_order(view, design, workspace, out, rule, order, zone)


@kernel
def is_near_transfer(view, design, order, zone, near):
    """Whether the next station of an order lies near one where it would leave the zone."""
    to = np.int64(view.service_zones.station_of[view.orders.target[order]])
    if to == NIL or design.zone[to] == NIL or design.zone[to] == zone:
        return False
    for station in range(design.zone.shape[0]):
        if design.transfer[zone, design.zone[to], station]:
            if view.service_zones.roads.between[station, to] <= near:
                return True
    return False


@kernel
def queue_orders(view, design, workspace, out, rule, again):
    """Queue all orders that are in no queue; again = 1: all that wait, from where they are."""
    for order in range(view.orders.state.shape[0]):
        if not is_free(view, order) or (view.service_zones.queue[order] >= 0 and again == 0):
            continue
        zone = owner_of(view, design, order, again)
        if zone != NIL:
            queue_order(view, design, workspace, out, rule, order, zone)


@kernel
def lies_near(view, order, zone, near):
    """Whether an order waits within so many cells of a station of a zone."""
    at = np.int64(view.service_zones.station_of[view.orders.current_slot[order]])
    for station in range(view.service_zones.design.zone.shape[0]):
        if view.service_zones.design.zone[station] == zone and at != NIL:
            if view.service_zones.roads.between[at, station] <= near:
                return True
    return False


@kernel
def first_for(view, out, workspace, zone, other, taker, direct, near, age, job):
    """The first order in the queue of a zone, by its score, whose next station is in the other zone.

    It is one that the robot of the zone `taker` can bring to its target.

    Of those not direct yet, if direct = 0; of those that lie within `near` cells of a station of the
    other zone, if near > 0. NIL if there is none.
    """
    design, found, highest = view.service_zones.design, NIL, -(1 << 62)
    server = np.int64(view.service_zones.server[zone])
    if server == NIL:
        return found
    i = np.int64(view.robots.at_index[server])
    robot_type = without_load(view, np.int64(view.robots.type[i]))
    heading = np.int64(view.robots.heading[i])
    for order in range(view.orders.state.shape[0]):
        if not is_free(view, order) or view.service_zones.queue[order] != zone:
            continue
        to = np.int64(view.service_zones.station_of[view.orders.target[order]])
        if (
            to == NIL
            or design.zone[to] != other
            or (direct == 0 and view.service_zones.skips_transfer[order])
        ):
            continue
        if near > 0 and not lies_near(view, order, other, near):
            continue
        if not can_zone_deliver(view, out, taker, order, np.int64(view.orders.target[order])):
            continue
        next_slot = np.int64(view.service_zones.next_slot[order])
        if not can_bring(view, robot_type, order, next_slot):
            continue
        here = position(view, i)
        pick = pickup_cell(view, robot_type, np.int64(view.orders.current_slot[order]), here)
        drop = dropoff_cell(view, robot_type, next_slot, pick)
        ticks = distance(view, workspace, robot_type, here, heading, pick)
        ticks += distance(view, workspace, with_load(view, robot_type), pick, heading, drop)
        if ticks >= UNREACHABLE:
            continue
        worth = age * (view.clock[CLOCK_TICK] - view.orders.release_tick[order]) - job * ticks
        if worth > highest:
            found, highest = order, worth
    return found


@kernel
def share(view, workspace, out, age, job):
    """Load sharing, once: at most two orders for each pair of zones; returns how many.

    The first order of the longer queue that goes into the other zone moves to that zone's robot; the
    first one of the shorter queue that goes into the busy zone skips the transfer station.
    """
    zones = view.service_zones.server.shape[0]
    shared = 0
    for a in range(zones):
        for b in range(a + 1, zones):
            here, there = length_then(view, out, a), length_then(view, out, b)
            if here == there:
                continue
            busy, idle = (a, b) if here > there else (b, a)
            moved = first_for(view, out, workspace, busy, idle, idle, 1, 0, age, job)
            if moved != NIL:
                enter(out, moved, idle, np.int64(view.orders.target[moved]), 1)
                shared += 1
            skipped = first_for(view, out, workspace, idle, busy, idle, 0, 0, age, job)
            if skipped != NIL:
                enter(out, skipped, idle, np.int64(view.orders.target[skipped]), 1)
                shared += 1
    return shared


@kernel
def take_over(view, out):
    """Who is down is replaced by a running robot until it is back.

    By one that serves all its stations if there is any, then by that with the shortest queue.
    """
    zones = view.service_zones.server.shape[0]
    for zone in range(zones):
        best, least = zone, 1 << 60
        if not is_running(view, np.int64(view.robots.at_index[zone])):
            for other in range(zones):
                waiting = queue_length(view, other)
                waiting += 0 if serves_all(view, other, zone) else 1 << 40
                if is_running(view, np.int64(view.robots.at_index[other])) and waiting < least:
                    best, least = other, waiting
        if view.service_zones.server[zone] != best:
            out.server[zone] = best


@kernel
def record_flow(view, window, now, flow):
    """flow[i, j] = orders from i to j that are known and not delivered longer than `window` ticks ago.

    Returns how many there are. An order that begins and ends at one station is not a flow.
    """
    flow[:] = 0.0
    total = 0
    orders = view.orders
    for order in range(orders.state.shape[0]):
        if orders.release_tick[order] > now:
            continue
        gone = np.int64(orders.delivered[order])
        start = np.int64(view.service_zones.station_of[orders.source[order]])
        end = np.int64(view.service_zones.station_of[orders.target[order]])
        if start == NIL or end == NIL or start == end or (gone != NIL and now - gone >= window):
            continue
        flow[start, end] += 1.0
        total += 1
    return total
