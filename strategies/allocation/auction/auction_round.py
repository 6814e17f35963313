"""One auction over a running world: which orders are for sale, what robots have, and what they get.

Lists are those of the world (robots.order_queue). `out` are allocation's decisions, which take new
lists; what an earlier session of the same tick has put there counts.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.robot_states import STATUS_UP
from automaton.engine.state import CLOCK_NEXT_RELEASE, CLOCK_TICK, KEEP, NIL, ORDER_WAITING
from automaton.strategy.kernels import allocation_of, can_do, types_of_robots
from strategies.allocation.auction.floor_market import (
    count_queues,
    enter_robot,
    enter_task,
    enter_waits,
    measure_distances,
)
from strategies.allocation.auction.market import INF_COST
from strategies.allocation.auction.quotes import settle_all
from strategies.allocation.order_queues import planned_count

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
