"""Orders that the robot of their zone cannot do, too heavy or out of its reach, go to one that can."""

import numpy as np

from automaton.strategy.kernels import can_bring, kernel
from automaton.world.condition import EXHAUSTED
from automaton.world.state import KEEP, MOVE, NIL, WAITING


@kernel
def is_running(view, i):
    """Whether robot i is in order, or still does what it began."""
    return view.robots.status[i] <= EXHAUSTED


@kernel
def is_free(view, order):
    """Whether an order waits and nobody has it."""
    return view.orders.state[order] == WAITING and view.orders.by[order] == NIL


@kernel
def queue_length(view, zone):
    """How many orders wait in the queue of a zone."""
    count = 0
    for order in range(view.orders.state.shape[0]):
        if is_free(view, order) and view.zoning.queue[order] == zone:
            count += 1
    return count


@kernel
def length_then(view, given, zone):
    """The same after the answers of this batch so far."""
    count = queue_length(view, zone)
    for k in range(given.queued[0]):
        count += given.queue[k] == zone
        count -= view.zoning.queue[given.order[k]] == zone
    return count


@kernel
def enter(given, order, queue, stop, direct):
    """One more answer: an order comes into a queue."""
    k = given.queued[0]
    if k < given.order.shape[0]:
        given.order[k] = order
        given.queue[k] = queue
        given.stop[k] = stop
        given.direct[k] = direct
        given.queued[0] = k + 1


@kernel
def are_several(view):
    """Whether there are robots of several types."""
    return view.grid.ways.shape[0] > 1


@kernel
def heed_servers(view, space):
    """space.pace: how many times as long moves take in each zone as those of the first type."""
    for zone in range(space.pace.shape[0]):
        server = np.int64(view.zoning.server[zone])
        i = np.int64(view.robots.at_index[zone if server == NIL else server])
        ticks = float(view.rules.duration[view.robots.type[i], MOVE])
        space.pace[zone] = ticks / float(view.rules.duration[0, MOVE])


@kernel
def server_of(view, given, zone):
    """The robot that serves a zone from now on, NIL if it is not known."""
    server = np.int64(
        view.zoning.server[zone] if given.server[zone] == KEEP else given.server[zone]
    )
    return server if server == NIL else np.int64(view.robots.at_index[server])


@kernel
def zone_can(view, given, zone, order, slot):
    """Whether the robot that serves a zone can bring an order to a slot."""
    i = server_of(view, given, zone)
    return i != NIL and can_bring(view, np.int64(view.robots.type[i]), order, slot)


@kernel
def serves_all(view, robot, zone):
    """Whether a robot, by identity, serves all stations of a zone."""
    for station in range(view.zoning.design.zone.shape[0]):
        if view.zoning.design.zone[station] == zone and not view.zoning.serves[robot, station]:
            return False
    return True


@kernel
def able_zone(view, given, order):
    """The zone whose running robot can bring an order all the way; NIL if there is none.

    Priority at its station comes first, then the shortest queue, then the lowest number.
    """
    best, least = np.int64(NIL), np.int64(1) << 60
    target = np.int64(view.orders.target[order])
    at = np.int64(view.zoning.station_of[view.orders.place[order]])
    for zone in range(view.zoning.server.shape[0]):
        if not zone_can(view, given, zone, order, target):
            continue
        if not is_running(view, server_of(view, given, zone)):
            continue
        waiting = np.int64(length_then(view, given, zone))
        if at == NIL or view.zoning.first[zone, at] == 0:
            waiting += 1 << 40
        if waiting < least:
            best, least = np.int64(zone), waiting
    return best


@kernel
def enter_able(view, given, order, queue, stop, direct):
    """An order comes into a queue, or if its robot cannot bring it to its stop, into an able one's."""
    if are_several(view) and not zone_can(view, given, queue, order, stop):
        other = able_zone(view, given, order)
        if other != NIL:
            enter(given, order, other, np.int64(view.orders.target[order]), 1)
            return
    enter(given, order, queue, stop, direct)


@kernel
def hand_on(view, given, robot):
    """Orders in queues whose robot cannot do them go to one that can; robot: whose queues, NIL: all."""
    if not are_several(view):
        return
    for order in range(view.orders.state.shape[0]):
        zone = np.int64(view.zoning.queue[order])
        if zone < 0 or not is_free(view, order) or is_entered(given, order):
            continue
        i = server_of(view, given, zone)
        if i == NIL or (robot != NIL and view.robots.identity[i] != robot):
            continue
        if zone_can(view, given, zone, order, np.int64(view.zoning.stop[order])):
            continue
        other = able_zone(view, given, order)
        if other != NIL and other != zone:
            enter(given, order, other, np.int64(view.orders.target[order]), 1)
        elif other == zone and view.zoning.stop[order] != view.orders.target[order]:
            enter(given, order, zone, np.int64(view.orders.target[order]), 1)


@kernel
def is_entered(given, order):
    """Whether an answer of this batch has put an order into a queue."""
    for k in range(given.queued[0]):
        if given.order[k] == order:
            return True
    return False
