"""Robots with a list of orders ahead of them: what each does next."""

import numpy as np

from automaton.engine.robot_states import STATUS_UP
from automaton.engine.state import (
    CLOCK_NEXT_RELEASE,
    CLOCK_TICK,
    CMD_PARK,
    KEEP,
    NIL,
    ORDER_WAITING,
    REASON_PERIODIC,
)
from automaton.strategy.kernels import (
    allocation_of,
    can_do,
    has_place,
    is_open,
    kernel,
    place_load,
    places_load,
    take_order,
    types_of_robots,
)
from strategies.allocation.auction.floor_market import (
    count_queues,
    enter_robot,
    enter_task,
    enter_waits,
    measure_distances,
)
from strategies.allocation.auction.market import INF_COST
from strategies.allocation.auction.quotes import settle_all


@kernel
def planned_count(view, out, i):
    """How many orders robot i has ahead of it, by the decisions if they say so."""
    return np.int64(
        view.robots.order_queue_length[i]
        if out.order_queue_length[i] == KEEP
        else out.order_queue_length[i]
    )


@kernel
def copy_plan(view, out, i):
    """Let the decisions begin with the plan that robot i has."""
    if out.order_queue_length[i] != KEEP:
        return
    out.order_queue_length[i] = view.robots.order_queue_length[i]
    for k in range(view.robots.order_queue_length[i]):
        out.order_queue[i, k] = view.robots.order_queue[i, k]


@kernel
def drop_lost_orders(view, out, strategy):
    """Strike off the lists of a strategy's robots what robots of other strategies have taken."""
    if view.rules.allocations == 1:
        return
    orders = view.orders
    for i in range(view.robots.cell.shape[0]):
        if allocation_of(view, i) != strategy:
            continue
        count, remaining = np.int64(view.robots.order_queue_length[i]), 0
        for p in range(count):
            order = np.int64(view.robots.order_queue[i, p])
            if orders.state[order] == ORDER_WAITING and orders.reserved_by[order] == NIL:
                out.order_queue[i, remaining] = order
                remaining += 1
        if remaining < count:
            out.order_queue_length[i] = remaining


@kernel
def take_next(view, out, k, i):
    """Decision k: robot i takes the first order of its list that still waits; False if none does."""
    copy_plan(view, out, i)
    count = np.int64(out.order_queue_length[i])
    for p in range(count):
        order = np.int64(out.order_queue[i, p])
        waits = view.orders.state[order] == ORDER_WAITING and view.orders.reserved_by[order] == NIL
        if waits and can_do(view, i, order):
            take_order(view, out, k, i, order)
            for q in range(p + 1, count):
                out.order_queue[i, q - p - 1] = out.order_queue[i, q]
            out.order_queue_length[i] = count - p - 1
            return True
    out.order_queue_length[i] = 0
    return False


@kernel
def take_next_trip(view, out, k, i):
    """Decision k, where orders are trips of pods: robot i takes one, or waits; False if it has none.

    The one of the pod above it is reserved for it, and comes first. Then the first one of its list to
    whose station it may come; those before it stay in the list.
    """
    offered = np.int64(view.trips.offered[view.robots.identity[i]])
    if offered != NIL and is_open(view, out, i, offered):
        take_order(view, out, k, i, offered)
        return True
    copy_plan(view, out, i)
    count, remaining, taken = np.int64(out.order_queue_length[i]), 0, False
    for p in range(count):
        order = np.int64(out.order_queue[i, p])
        if view.orders.state[order] != ORDER_WAITING or view.orders.reserved_by[order] != NIL:
            continue
        if not taken and has_place(view, order) and can_do(view, i, order):
            take_order(view, out, k, i, order)
            taken = True
            continue
        out.order_queue[i, remaining] = order
        remaining += 1
    out.order_queue_length[i] = remaining
    return taken or remaining > 0


@kernel
def serve(view, batch, out, workspace, due, policy):
    """Decide for a batch: loads go to their targets, free robots take the next order of their lists.

    due[i] = 0 where robot i's list is done; (n,) int64. `policy`: of storage, its place among POLICIES.
    """
    carries_pods = view.trips.pod.shape[0] > 0
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        if places_load(batch.reason[k]):
            place_load(view, out, workspace, k, i, policy)
            continue
        if batch.reason[k] == REASON_PERIODIC:
            continue
        if not (take_next_trip(view, out, k, i) if carries_pods else take_next(view, out, k, i)):
            out.command[k] = CMD_PARK
            due[i] = 0


@kernel
def has_empty_list(view, batch, out):
    """Whether a robot that is asked what to do next has nothing ahead of it."""
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        if not places_load(batch.reason[k]) and batch.reason[k] != REASON_PERIODIC:
            if planned_count(view, out, i) == 0:
                return True
    return False


# One auction over a running world: which orders are for sale, what robots have, and what they get.
#
# Lists are those of the world (robots.order_queue). `out` are allocation's decisions, which take new
# lists; what an earlier session of the same tick has put there counts.


ORDER_PLANNED = 2  # in given.order_taken: it is in a robot's plan


@kernel
def planned_order(view, out, i, k):
    if out.order_queue_length[i] != KEEP:
        return np.int64(out.order_queue[i, k])
    return np.int64(view.robots.order_queue[i, k])


@kernel
def mark_planned(view, out):
    """Mark the orders that are in plans."""
    for i in range(view.robots.cell.shape[0]):
        for k in range(planned_count(view, out, i)):
            out.order_taken[planned_order(view, out, i, k)] = ORDER_PLANNED


@kernel
def is_for_sale(view, out, order):
    """Whether an order waits, and no robot has it or plans to do it."""
    orders = view.orders
    return (
        orders.state[order] == ORDER_WAITING
        and orders.reserved_by[order] == NIL
        and out.order_taken[order] == 0
    )


@kernel
def find_items(view, allocation, since, out):
    """Orders for sale, in release order, into out; returns (how many, where to begin next time).

    `since`: entries of orders.release_sequence before it are all delivered.
    """
    found = np.int64(0)
    first = np.int64(since)
    done = True
    for k in range(since, view.clock[CLOCK_NEXT_RELEASE]):
        order = np.int64(view.orders.release_sequence[k])
        done = done and view.orders.delivered[order] != NIL
        first = k + 1 if done else first
        if is_for_sale(view, allocation, order):
            out[found] = order
            found += 1
            if found == out.shape[0]:
                break
    return found, first


@kernel
def open_auction(view, out, workspace, market, strategy, sellable, count):
    """Fill the market: the strategy's robots in order, their plans as lists, sellable[:count] as items.

    Returns how many robots take part.
    """
    robots, fleet = view.robots, market.fleet
    taking_part = np.int64(0)
    tasks = np.int64(0)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        hidden = robots.cell[i] == NIL and robots.home[i] == NIL  # beyond what may be seen
        if robots.status[i] != STATUS_UP or hidden or allocation_of(view, i) != strategy:
            continue
        r = taking_part
        enter_robot(view, workspace, market, r, i)
        for k in range(planned_count(view, out, i)):
            for robot_type in range(types_of_robots(view)):
                enter_task(
                    view, workspace, market, robot_type, tasks, planned_order(view, out, i, k)
                )
            fleet.order[r, k] = tasks
            fleet.length[r] = k + 1
            tasks += 1
        taking_part += 1
    for r in range(taking_part, fleet.place.shape[0]):  # down: no list, no bids
        fleet.length[r] = 0
        fleet.ready[r] = 0
        fleet.may_bid[r, :] = 0
    for k in range(count):
        for robot_type in range(types_of_robots(view)):
            enter_task(view, workspace, market, robot_type, tasks, np.int64(sellable[k]))
        market.item[k] = tasks
        tasks += 1
    for r in range(taking_part):
        for task in range(tasks):
            fleet.may_bid[r, task] = can_do(view, market.robot[r], market.order[task])
    for robot_type in range(types_of_robots(view)):
        measure_distances(view, workspace, market, robot_type, taking_part, tasks)
    count_queues(view, market)
    enter_waits(view, market)
    settle_all(market.costs, market.battery, fleet, market.scratch)
    return taking_part


@kernel
def enter_plans(view, out, market, robots, due):
    """Write the lists of the market into the plans, and when each is to be done; due: (n,) int64."""
    fleet = market.fleet
    for r in range(robots):
        i = np.int64(market.robot[r])
        length = np.int64(fleet.length[r])
        out.order_queue_length[i] = length
        for k in range(length):
            order = np.int64(market.order[fleet.order[r, k]])
            out.order_queue[i, k] = order
            out.order_taken[order] = ORDER_PLANNED
        known = length > 0 and fleet.cost[r] < INF_COST
        due[i] = view.clock[CLOCK_TICK] + fleet.cost[r] if known else 0


@kernel
def announce_items(view, market, robots, count, center, radius):
    """Announce each item to robots within so many cells of its center; NIL: of where it lies.

    radius NIL: all robots. Distances are Chebyshev's, from where robots are.
    """
    width = view.grid.width
    for r in range(robots):
        i = market.robot[r]
        cell = np.int64(view.robots.cell[i])
        cell = np.int64(view.robots.home[i]) if cell == NIL else cell
        for k in range(count):
            task = market.item[k]
            at = center
            if center == NIL:
                at = np.int64(market.cell[market.fleet.robot_type[r], market.costs.begin[task]])
            across, down = abs(cell % width - at % width), abs(cell // width - at // width)
            near = radius == NIL or max(across, down) <= radius
            able = can_do(view, i, market.order[task])
            market.fleet.may_bid[r, task] = 1 if near and able else 0
