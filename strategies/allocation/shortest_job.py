"""Shortest job first with aging (Keith & La, Algorithm 2).

A free robot takes the order of highest score: C_A times its age minus C_D times the ticks to drive to it
and to carry it to its next drop. With `per_line` these ticks are divided by the number of order lines
that a trip of a pod serves, so pods with many open lines at their stations come first. The age counts
from the release of the order, and continues when it is dropped at a transfer station. Ties: the lowest
number. With zones a robot takes orders from the queues of its zones, and drops them where zoning
decides. Without zones it takes any order and carries it to its target.
"""

import numpy as np

from automaton.strategy.api import (
    CMD_PARK,
    LEAST_PRIORITY,
    NIL,
    REASON_PERIODIC,
    STORAGE_POLICIES,
    UNREACHABLE,
    Strategy,
    Struct,
    begin_cell,
    can_bring,
    distance,
    dropoff_cell,
    end_of_stops,
    field,
    has_load,
    is_open,
    kernel,
    place_load,
    places_load,
    position,
    set_down,
    take_order,
    takes_load,
)
from strategies.allocation.allocation_parameters import ShortestJobParameters

WORST = -(1 << 62)


class ShortestJobState(Struct):
    """Parameters; nothing persists between calls."""

    age: int = field("int64", "weight of an order's age, in thousandths")
    job: int = field("int64", "weight of its duration, in thousandths")
    per_line: int = field("int64", "1: the duration of a trip is divided by its order lines")
    parks: int = field("int64", "1: robots without an order drive home")
    storage: int = field("int64", "where pods are stored: its place among STORAGE_POLICIES")


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, state = decisions.allocation, ShortestJobState.of(memory)
    for k in range(batch.count):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            bring(view, out, workspace, k, i, state.storage)
        elif batch.reason[k] != REASON_PERIODIC:
            order = best_order(view, out, state, workspace, i)
            if order != NIL:
                take_order(view, out, k, i, order)
            elif state.parks:
                out.command[k] = CMD_PARK


class ShortestJob(Strategy):
    """Take the order with the shortest job, unless another one has waited long."""

    layer = "allocation"
    Parameters = ShortestJobParameters
    compiled = decide

    def reset(self, view):
        parameters = self.parameters
        return ShortestJobState(
            age=round(1000 * parameters.age),
            job=round(1000 * parameters.job),
            per_line=int(parameters.per_line),
            parks=int(parameters.idle == "park"),
            storage=STORAGE_POLICIES.index(parameters.storage),
        )


@kernel
def best_order(view, out, state, workspace, i):
    """The open order of highest score among those of the highest priority for robot i; or NIL."""
    found, highest, first = NIL, WORST, LEAST_PRIORITY
    identity = view.robots.identity[i]
    for order in range(view.clock.first_open, view.clock.known_orders):
        priority = np.int64(view.orders.priority[order])
        if priority < first or not is_open(view, out, i, order):
            continue
        if is_mine(view, order, identity):
            least = WORST if priority > first else highest
            worth = score(view, workspace, state, i, order, least)
            if worth > least:
                found, highest, first = order, worth, priority
    return found


@kernel
def is_mine(view, order, identity):
    """Whether an order is in a queue that this robot serves; always true without zones."""
    service_zones = view.service_zones
    if service_zones.queue.shape[0] == 0:
        return True
    queue = service_zones.queue[order]
    return queue >= 0 and service_zones.server[queue] == identity


@kernel
def score(view, workspace, state, i, order, least):
    """The score of an order for robot i, in thousandths of ticks; WORST if it cannot do it.

    Also WORST if the drive to its start already lowers the score to `least` or less.
    """
    slot, robot_type = next_stop(view, order), view.robots.type[i]
    if not can_bring(view, robot_type, order, slot):
        return WORST
    here, heading = position(view, i), np.int64(view.robots.heading[i])
    begin = begin_cell(view, robot_type, order, here)
    age = state.age * (view.clock.tick - view.orders.release_tick[order])
    lines = number_of_lines(view, order) if state.per_line else np.int64(1)
    job = distance(view, workspace, robot_type, here, heading, begin)
    if age - state.job * job // lines <= least:
        return WORST
    job += job_ticks(view, workspace, robot_type, order, slot, begin, heading)
    if job >= UNREACHABLE:
        return WORST
    return age - state.job * job // lines


@kernel
def number_of_lines(view, order):
    """The number of order lines that a trip of a pod serves; 1 for orders without lines."""
    lines = np.int64(0)
    if view.lines.order.shape[0]:
        for stop in range(view.orders.first_stop[order], end_of_stops(view, order)):
            line = np.int64(view.trips.first_line[stop])
            while line != NIL:
                lines += 1
                line = np.int64(view.lines.following[line])
    return max(lines, np.int64(1))


@kernel
def job_ticks(view, workspace, robot_type, order, slot, begin, heading):
    """Ticks from the start of an order over its stops to a slot; UNREACHABLE or more: no path.

    Each leg is counted from its first heading; without a load the last stop is the end.
    """
    orders, stops = view.orders, view.stops
    if has_load(orders, order):
        robot_type += view.rules.loaded_types
    ticks, here = np.int64(0), begin
    first = np.int64(orders.first_stop[order]) + np.int64(orders.stops_done[order])
    for stop in range(first, end_of_stops(view, order)):
        to = np.int64(stops.cell[stop])
        way = distance(view, workspace, robot_type, here, heading, to)
        ticks = min(ticks + way + stops.ticks[stop], 2 * UNREACHABLE)
        here = to
    if has_load(orders, order):
        if slot == NIL:  # estimate: the pod returns to its current cell
            slot = np.int64(orders.current_slot[order])
        drop = dropoff_cell(view, robot_type, slot, here)
        ticks += distance(view, workspace, robot_type, here, heading, drop)
    return ticks


@kernel
def next_stop(view, order):
    """The slot of the next drop of an order, as decided by zoning, or its target."""
    if view.service_zones.queue.shape[0] and view.service_zones.next_slot[order] != NIL:
        return np.int64(view.service_zones.next_slot[order])
    return np.int64(view.orders.target[order])


@kernel
def bring(view, out, workspace, k, i, policy):
    """Decision k: carry the load of robot i to its next stop, or to its target if that is full."""
    order = np.int64(view.robots.load[i])
    stop = next_stop(view, order)
    if stop != NIL and stop != view.orders.target[order] and takes_load(view, out, stop):
        set_down(view, out, k, i, stop)
    else:
        place_load(view, out, workspace, k, i, policy)
