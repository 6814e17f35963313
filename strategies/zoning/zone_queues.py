"""Which robot's queue an order comes into, and how queues share orders.

An order that waits at a station belongs to the zone of that station; one that was dropped on its
way still belongs to the zone whose robot brought it, and is routed on from there (Keith & La).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.strategy.api import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    BATTERY_FULL,
    KEEP,
    NIL,
    ORDER_WAITING,
    STATUS_EXHAUSTED,
    UNREACHABLE,
    Strategy,
    World,
    can_bring,
    charging_ticks,
    distance,
    dropoff_cell,
    kernel,
    pickup_cell,
    position,
    types_of_robots,
    with_load,
    without_load,
)
from automaton.units import SECONDS_PER_UNIT
from strategies.zoning.loads_and_transfers import route
from strategies.zoning.zone_workspace import ZoneRules, typical_distance, zone_rules

MILLION: Final = 1_000_000
ALL_PAIRS: Final = "all"  # tip_pairs of annealing and decentralized
FORMER = -2  # queue: FORMER - zone, of a part that a robot of that zone dropped on its way


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
                target = np.int64(view.orders.target[order])
                enqueue_with_capable_zone(view, out, order, zone, target, 1)
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
def enter(out, order, queue, stop, direct):
    """One more decision: an order comes into a queue."""
    k = out.queued
    if k < out.order.shape[0]:
        out.order[k] = order
        out.queue[k] = queue
        out.next_slot[k] = stop
        out.skips_transfer[k] = direct
        out.queued = k + 1


@kernel
def is_free(view, order):
    """Whether an order waits and no robot has it."""
    return view.orders.state[order] == ORDER_WAITING and view.orders.reserved_by[order] == NIL


@kernel
def is_running(view, i):
    """Whether robot i is in order, or still does what it began."""
    return view.robots.status[i] <= STATUS_EXHAUSTED


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
    for k in range(out.queued):
        count += out.queue[k] == zone
        count -= view.service_zones.queue[out.order[k]] == zone
    return count


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
def serves_all(view, robot, zone):
    """Whether a robot, by identity, serves all stations of a zone."""
    for station in range(view.service_zones.design.zone.shape[0]):
        if view.service_zones.design.zone[station] == zone:
            if not view.service_zones.accessible[robot, station]:
                return False
    return True


# Orders that the robot of their zone cannot do, too heavy or out of its reach, go to one that can.


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
    for k in range(out.queued):
        if out.order[k] == order:
            return True
    return False


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
def can_zone_deliver(view, out, zone, order, slot):
    """Whether the robot that serves a zone can bring an order to a slot."""
    i = server_of(view, out, zone)
    return i != NIL and can_bring(view, np.int64(view.robots.type[i]), order, slot)


@kernel
def server_of(view, out, zone):
    """The robot that serves a zone from now on, NIL if it is not known."""
    server = np.int64(
        view.service_zones.server[zone] if out.server[zone] == KEEP else out.server[zone]
    )
    return server if server == NIL else np.int64(view.robots.at_index[server])


@kernel
def are_several(view):
    """Whether there are robots of several types."""
    return types_of_robots(view) > 1


# Sharing.


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
def first_for(view, out, workspace, zone, other, taker, direct, near, age, job):
    """The first order in the queue of a zone, by its score, whose next station is in the other zone.

    It is one that the robot of the zone `taker` can bring to its target, and the robot of its own zone
    to its next stop. Of those not direct yet, if direct = 0; of those that lie within `near` cells of
    a station of the other zone, if near > 0. NIL if there is none.
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
        if to == NIL or design.zone[to] != other:
            continue
        if direct == 0 and view.service_zones.skips_transfer[order]:
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
        worth = age * (view.clock.tick - view.orders.release_tick[order]) - job * ticks
        if worth > highest:
            found, highest = order, worth
    return found


@kernel
def lies_near(view, order, zone, near):
    """Whether an order waits within so many cells of a station of a zone."""
    at = np.int64(view.service_zones.station_of[view.orders.current_slot[order]])
    for station in range(view.service_zones.design.zone.shape[0]):
        if view.service_zones.design.zone[station] == zone and at != NIL:
            if view.service_zones.roads.between[at, station] <= near:
                return True
    return False


# The flow between stations, and how fast robots are. Charging counts as work: what is missing in a
# battery is time that its zone has not.


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


@kernel
def set_zone_move_time_factors(view, workspace):
    """workspace.move_time_factor: how many times as long moves take as those of the first type."""
    for zone in range(workspace.move_time_factor.shape[0]):
        server = np.int64(view.service_zones.server[zone])
        i = np.int64(view.robots.at_index[zone if server == NIL else server])
        robot_type = with_load(view, np.int64(view.robots.type[i]))
        first = view.rules.duration[view.rules.loaded_types, ACTION_MOVE]
        ticks = view.rules.duration[robot_type, ACTION_MOVE]
        workspace.move_time_factor[zone] = float(ticks) / float(first)


@kernel
def charging_minutes(view, rules, i):
    """Minutes that robot i needs at a charger until its battery is full; 0 without batteries."""
    if view.rules.battery == 0:
        return 0.0
    curve = view.rules.curve[view.robots.type[i]]
    ticks = charging_ticks(curve, np.int64(view.robots.charge[i]), BATTERY_FULL)
    return ticks / (rules.speed * view.rules.duration[view.rules.loaded_types, ACTION_MOVE])


@kernel
def add_charging(view, workspace, rules):
    """Add the minutes that the server of each zone charges to the zone's workspace.load."""
    for zone in range(workspace.load.shape[0]):
        server = view.service_zones.server[zone]
        if server != NIL:
            i = np.int64(view.robots.at_index[server])
            workspace.load[zone] += charging_minutes(view, rules, i)


# Parameters in the units of kernels: ticks, cells, thousandths.


def seconds_of_tick(view: World) -> float:
    """Seconds in a tick; 1 where the scenario does not say."""
    return view.rules.tick_us / 1e6 if view.rules.tick_us else 1.0


def ticks(view: World, seconds: float) -> int:
    """Seconds in ticks, at least 1 if they are any."""
    found = round(seconds / seconds_of_tick(view))
    return max(1, found) if seconds > 0 else 0


def ticks_of_minutes(view: World, minutes: float) -> int:
    """Minutes in ticks."""
    return ticks(view, SECONDS_PER_UNIT["min"] * minutes)


def cells(view: World, length: float) -> float:
    """A length in the scenario's unit, in cells."""
    return 1000 * length / view.rules.cell_milli if view.rules.cell_milli else length


def order_weights(allocation: Strategy | None) -> dict[str, int]:
    """`age` and `job` of shortest job first, in thousandths: as the allocation has them, if it does."""
    # Not above: after an edit there the kernels of zones would be compiled again, too.
    from strategies.allocation.allocation_parameters import ShortestJobParameters

    own, usual = getattr(allocation, "parameters", None), ShortestJobParameters()
    return {
        name: round(1000 * getattr(own, name, default))
        for name, default in (("age", usual.age), ("job", usual.job))
    }


def rules_of_zones(
    view: World, adjacency: float | None, tip_pairs: str, decentralized: bool = False
) -> ZoneRules:
    """The numbers by which zones are made; those of robots that negotiate are whole millionths."""
    all_pairs = tip_pairs == ALL_PAIRS
    tick = seconds_of_tick(view)
    duration = view.rules.duration[view.rules.loaded_types]  # of the first type, with its loads
    between = view.service_zones.roads.between
    adjacent = typical_distance(between) if adjacency is None else cells(view, adjacency)
    speed = SECONDS_PER_UNIT["min"] / (tick * float(duration[ACTION_MOVE]))
    work_ticks = float(duration[ACTION_PICK] + duration[ACTION_DROP])
    handling = tick * work_ticks / SECONDS_PER_UNIT["min"]
    if not decentralized:
        return zone_rules(speed, adjacent, handling=handling, all_pairs=all_pairs)
    speed, adjacent, handling = (
        round(MILLION * one) / MILLION for one in (speed, adjacent, handling)
    )
    return zone_rules(
        speed, adjacent, base=0.0, handling=handling, limit=adjacent, blocks=False, shared=True,
        all_pairs=all_pairs,
    )  # fmt: skip
