"""Reassign orders that the robot of their zone cannot do, too heavy or out of its reach."""

import numpy as np

from automaton.engine.robot_states import STATUS_EXHAUSTED
from automaton.engine.state import ACTION_MOVE, KEEP, NIL, ORDER_WAITING
from automaton.strategy.kernels import can_bring, kernel, types_of_robots, with_load


@kernel
def is_running(view, i):
    """Whether robot i is in order, or still does what it began."""
    return view.robots.status[i] <= STATUS_EXHAUSTED


@kernel
def is_free(view, order):
    """Whether an order waits and no robot has it."""
    return view.orders.state[order] == ORDER_WAITING and view.orders.reserved_by[order] == NIL


@kernel
def queue_length(view, zone):
    """How many orders wait in the queue of a zone."""
    count = 0
    for order in range(view.orders.state.shape[0]):
        if is_free(view, order) and view.service_zones.queue[order] == zone:
            count += 1
    return count


@kernel
def length_then(view, out, zone):
    """The same after the decisions of this batch so far."""
    count = queue_length(view, zone)
    for k in range(out.queued[0]):
        count += out.queue[k] == zone
        count -= view.service_zones.queue[out.order[k]] == zone
    return count


@kernel
def enter(out, order, queue, stop, direct):
    """One more decision: an order comes into a queue."""
    k = out.queued[0]
    if k < out.order.shape[0]:
        out.order[k] = order
        out.queue[k] = queue
        out.next_slot[k] = stop
        out.skips_transfer[k] = direct
        out.queued[0] = k + 1


@kernel
def are_several(view):
    """Whether there are robots of several types."""
    return types_of_robots(view) > 1


@kernel
def set_zone_move_time_factors(view, workspace):
    """workspace.move_time_factor: how many times as long moves take as those of the first type."""
    for zone in range(workspace.move_time_factor.shape[0]):
        server = np.int64(view.service_zones.server[zone])
        i = np.int64(view.robots.at_index[zone if server == NIL else server])
        robot_type = with_load(view, np.int64(view.robots.type[i]))
        first = view.rules.duration[view.rules.loaded_types, ACTION_MOVE]
        workspace.move_time_factor[zone] = float(
            view.rules.duration[robot_type, ACTION_MOVE]
        ) / float(first)


@kernel
def server_of(view, out, zone):
    """The robot that serves a zone from now on, NIL if it is not known."""
    server = np.int64(
        view.service_zones.server[zone] if out.server[zone] == KEEP else out.server[zone]
    )
    return server if server == NIL else np.int64(view.robots.at_index[server])


@kernel
def can_zone_deliver(view, out, zone, order, slot):
    """Whether the robot that serves a zone can bring an order to a slot."""
    i = server_of(view, out, zone)
    return i != NIL and can_bring(view, np.int64(view.robots.type[i]), order, slot)


@kernel
def serves_all(view, robot, zone):
    """Whether a robot, by identity, serves all stations of a zone."""
    for station in range(view.service_zones.design.zone.shape[0]):
        if (
            view.service_zones.design.zone[station] == zone
            and not view.service_zones.accessible[robot, station]
        ):
            return False
    return True


@kernel
def capable_zone(view, out, order):
    """The zone whose running robot can bring an order all the way; NIL if there is none.

    Priority at its station comes first, then the shortest queue, then the lowest number.
    """
    best, least = np.int64(NIL), np.int64(1) << 60
    target = np.int64(view.orders.target[order])
    at = np.int64(view.service_zones.station_of[view.orders.current_slot[order]])
    for zone in range(view.service_zones.server.shape[0]):
        if not can_zone_deliver(view, out, zone, order, target):
            continue
        if not is_running(view, server_of(view, out, zone)):
            continue
        waiting = np.int64(length_then(view, out, zone))
        if at == NIL or view.service_zones.has_priority[zone, at] == 0:
            waiting += 1 << 40
        if waiting < least:
            best, least = np.int64(zone), waiting
    return best


@kernel
def enqueue_with_capable_zone(view, out, order, queue, stop, direct):
    """An order comes into a queue, or if its robot cannot bring it to its stop, into an able one's."""
    if are_several(view) and not can_zone_deliver(view, out, queue, order, stop):
        other = capable_zone(view, out, order)
        if other != NIL:
            enter(out, order, other, np.int64(view.orders.target[order]), 1)
            return
    enter(out, order, queue, stop, direct)


@kernel
def reassign_orders(view, out, robot):
    """Orders in queues whose robot cannot do them go to one that can; robot: whose queues, NIL: all."""
    if not are_several(view):
        return
    for order in range(view.orders.state.shape[0]):
        zone = np.int64(view.service_zones.queue[order])
        if zone < 0 or not is_free(view, order) or is_entered(out, order):
            continue
        i = server_of(view, out, zone)
        if i == NIL or (robot != NIL and view.robots.identity[i] != robot):
            continue
        if can_zone_deliver(view, out, zone, order, np.int64(view.service_zones.next_slot[order])):
            continue
        other = capable_zone(view, out, order)
        if other != NIL and other != zone:
            enter(out, order, other, np.int64(view.orders.target[order]), 1)
        elif other == zone and view.service_zones.next_slot[order] != view.orders.target[order]:
            enter(out, order, zone, np.int64(view.orders.target[order]), 1)


@kernel
def is_entered(out, order):
    """Whether a decision of this batch has put an order into a queue."""
    for k in range(out.queued[0]):
        if out.order[k] == order:
            return True
    return False
