"""The assignment of orders to the queues of robots, and sharing between queues.

An order that waits at a station belongs to the zone of this station. An order dropped on its way still
belongs to the zone whose robot brought it, and is routed on from there (Keith & La).
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
FORMER = -2  # queue = FORMER - zone: a part that a robot of this zone dropped on its way


@kernel
def queue_orders(view, design, workspace, out, rule, again):
    """Queue all orders without a queue; again = 1: all waiting orders, from where they are."""
    for order in range(view.orders.state.shape[0]):
        if not is_free(view, order) or (view.service_zones.queue[order] >= 0 and again == 0):
            continue
        zone = owner_of(view, design, order, again)
        if zone != NIL:
            queue_order(view, design, workspace, out, rule, order, zone)


@kernel
def queue_orders_of(view, design, workspace, out, rule, robot, near):
    """Queue the orders without a queue that belong to the zones of a robot.

    near: cells; an order whose next station is this near its transfer station goes there directly.
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
    """Whether the next station of an order is near the transfer station where it would leave the zone."""
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
    """The zone that routes an order, or NIL. again: ignore the zone whose robot brought it."""
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
    """Route an order of a zone: set its queue and its next stop."""
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
    """The place for a load at a station on its way: the station itself, or a free shelf; or NIL."""
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
    """Add a decision that puts an order into a queue."""
    k = out.queued
    if k < out.order.shape[0]:
        out.order[k] = order
        out.queue[k] = queue
        out.next_slot[k] = stop
        out.skips_transfer[k] = direct
        out.queued = k + 1


@kernel
def is_free(view, order):
    """Whether an order waits and is not reserved by a robot."""
    return view.orders.state[order] == ORDER_WAITING and view.orders.reserved_by[order] == NIL


@kernel
def is_running(view, i):
    """Whether robot i is not down, or still finishes its action."""
    return view.robots.status[i] <= STATUS_EXHAUSTED


@kernel
def queue_length(view, zone):
    """The number of waiting orders in the queue of a zone."""
    count = 0
    for order in range(view.orders.state.shape[0]):
        if is_free(view, order) and view.service_zones.queue[order] == zone:
            count += 1
    return count


@kernel
def length_then(view, out, zone):
    """The same number, including the decisions of this batch so far."""
    count = queue_length(view, zone)
    for k in range(out.queued):
        count += out.queue[k] == zone
        count -= view.service_zones.queue[out.order[k]] == zone
    return count


@kernel
def take_over(view, out):
    """Replace a robot that is down by a running robot until it is back.

    Prefers a robot that serves all its stations, then the one with the shortest queue.
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


# Orders that the robot of their zone cannot do (too heavy or out of reach) go to a robot that can.


@kernel
def reassign_orders(view, out, robot):
    """Move orders from robots that cannot do them to others; robot: only its queues, NIL: all."""
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
    """Put an order into a queue, or that of an able robot if the queue's own robot cannot do it."""
    if are_several(view) and not can_zone_deliver(view, out, queue, order, stop):
        other = capable_zone(view, out, order)
        if other != NIL:
            enter(out, order, other, np.int64(view.orders.target[order]), 1)
            return
    enter(out, order, queue, stop, direct)


@kernel
def capable_zone(view, out, order):
    """The zone whose running robot can bring an order to its target, or NIL.

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
    """The robot that serves a zone from now on, or NIL if unknown."""
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
    """One round of load sharing: at most two orders per pair of zones; return their number.

    The first order of the longer queue with a target in the other zone moves to that zone's robot. The
    first order of the shorter queue with a target in the busier zone skips the transfer station.
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
    """The first order in the queue of a zone, by score, whose next station is in the other zone; or NIL.

    The robot of the zone `taker` must be able to bring it to its target, and the robot of its own zone
    to its next stop. With direct = 0, only orders that are not direct yet; with near > 0, only orders
    within `near` cells of a station of the other zone.
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
    """Whether an order waits within this many cells of a station of a zone."""
    at = np.int64(view.service_zones.station_of[view.orders.current_slot[order]])
    for station in range(view.service_zones.design.zone.shape[0]):
        if view.service_zones.design.zone[station] == zone and at != NIL:
            if view.service_zones.roads.between[at, station] <= near:
                return True
    return False


# The flow between stations, and the speeds of robots. Charging counts as work: a robot that must charge
# has less time for its zone.


@kernel
def record_flow(view, window, now, flow):
    """flow[i, j] = known orders from i to j, open or delivered within the last `window` ticks.

    Returns their number. An order that begins and ends at the same station is not a flow.
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
    """workspace.move_time_factor: duration of a move relative to the first robot type."""
    for zone in range(workspace.move_time_factor.shape[0]):
        server = np.int64(view.service_zones.server[zone])
        i = np.int64(view.robots.at_index[zone if server == NIL else server])
        robot_type = with_load(view, np.int64(view.robots.type[i]))
        first = view.rules.duration[view.rules.loaded_types, ACTION_MOVE]
        ticks = view.rules.duration[robot_type, ACTION_MOVE]
        workspace.move_time_factor[zone] = float(ticks) / float(first)


@kernel
def charging_minutes(view, rules, i):
    """Minutes for robot i to charge its battery fully; 0 without batteries."""
    if view.rules.battery == 0:
        return 0.0
    curve = view.rules.curve[view.robots.type[i]]
    ticks = charging_ticks(curve, np.int64(view.robots.charge[i]), BATTERY_FULL)
    return ticks / (rules.speed * view.rules.duration[view.rules.loaded_types, ACTION_MOVE])


@kernel
def add_charging(view, workspace, rules):
    """Add the charging minutes of each zone's robot to workspace.load."""
    for zone in range(workspace.load.shape[0]):
        server = view.service_zones.server[zone]
        if server != NIL:
            i = np.int64(view.robots.at_index[server])
            workspace.load[zone] += charging_minutes(view, rules, i)


# Parameters in the units of kernels: ticks, cells, thousandths.


def seconds_of_tick(view: World) -> float:
    """Seconds per tick; 1 if the scenario does not define it."""
    return view.rules.tick_us / 1e6 if view.rules.tick_us else 1.0


def ticks(view: World, seconds: float) -> int:
    """Seconds in ticks, at least 1 unless 0."""
    found = round(seconds / seconds_of_tick(view))
    return max(1, found) if seconds > 0 else 0


def ticks_of_minutes(view: World, minutes: float) -> int:
    """Minutes in ticks."""
    return ticks(view, SECONDS_PER_UNIT["min"] * minutes)


def cells(view: World, length: float) -> float:
    """A length in the scenario's unit, in cells."""
    return 1000 * length / view.rules.cell_milli if view.rules.cell_milli else length


def order_weights(allocation: Strategy | None) -> dict[str, int]:
    """`age` and `job` of shortest job first, in thousandths; those of the allocation if it has them."""
    # Local import: otherwise an edit there would also recompile the kernels of zones.
    from strategies.allocation.allocation_parameters import ShortestJobParameters

    own, usual = getattr(allocation, "parameters", None), ShortestJobParameters()
    return {
        name: round(1000 * getattr(own, name, default))
        for name, default in (("age", usual.age), ("job", usual.job))
    }


def rules_of_zones(
    view: World, adjacency: float | None, tip_pairs: str, decentralized: bool = False
) -> ZoneRules:
    """The numbers for making zones; for negotiating robots they are whole millionths."""
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
