"""Orders without a load: their stops are done one after another, by a robot that stands there.

A stop is done in the tick at whose end the robot of the order stands in its cell, however it came
there, and at most one by a robot in a tick. The world itself sets the next one as the robot's goal and
asks routing; after the last one the order is delivered, and allocation is asked what the robot does
next. Until its first stop is done an order may be given to another robot; from then on it is its
robot's until it ends. If that robot goes down, the order waits again with the stops that are left.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.loads import reserve_order
from automaton.engine.motion import U
from automaton.engine.record_changes import record_change
from automaton.engine.record_codes import CHANGE_VISITED
from automaton.engine.requests import (
    clear_right_of_way,
    clear_route_request,
    drop_route,
    request_allocation,
    set_goal,
)
from automaton.engine.state import (
    CLOCK_SEQUENCED,
    CLOCK_TICK,
    CLOCK_UNDELIVERED,
    GOAL_NONE,
    GOAL_STOP,
    NIL,
    ORDER_DELIVERED,
    ORDER_STARTED,
    ORDER_WAITING,
    REASON_IDLE,
    RETRY_NONE,
)


@kernel
def has_stops(orders, order):
    """Whether an order is one without a load."""
    return orders.first_stop[order] < orders.first_stop[order + 1]


@kernel
def next_stop_cell(world, order):
    """The cell of the next stop of an order, NIL if there is none."""
    orders = world.orders
    stop = np.int64(orders.first_stop[order]) + np.int64(orders.stops_done[order])
    if stop >= orders.first_stop[order + 1]:
        return np.int64(NIL)
    return np.int64(world.stops.cell[stop])


@kernel
def has_started(world, i):
    """Whether robot i has an order that no other robot may get."""
    order = world.robots.order[i]
    return order != NIL and world.orders.state[order] == ORDER_STARTED


@kernel
def return_order(world, record, i):
    """The order of robot i, which carries no load, waits again with the stops that are left."""
    order = np.int64(world.robots.order[i])
    world.robots.order[i] = NIL
    if world.orders.state[order] == ORDER_STARTED:
        world.orders.state[order] = ORDER_WAITING
    reserve_order(world, record, order, NIL)


@kernel
def lose_order(world, record, i):
    """The order of robot i is given to another one: it has nothing to do."""
    robots = world.robots
    return_order(world, record, i)
    end_goal(world, i)
    if robots.retreat_moves[i] == 0:
        robots.retry_state[i] = RETRY_NONE
        clear_right_of_way(world, i)
    request_allocation(world, i, REASON_IDLE)


@kernel
def end_goal(world, i):
    """Robot i drives nowhere."""
    world.robots.goal_type[i] = GOAL_NONE
    world.robots.goal_cell[i] = NIL
    drop_route(world.robots, i)
    clear_route_request(world, i)


@kernel
def is_assigned(view, i, order):
    """Whether robot i may do an order, as far as orders are dealt out."""
    if view.rules.assigned == 0:
        return True
    return order % view.robots.cell.shape[0] == view.robots.identity[i]


@kernel
def announce_next(world, i, order):
    """Robot i has done an order that was its own: its next one is known from the next tick on."""
    orders, clock, robots = world.orders, world.clock, world.robots.cell.shape[0]
    following = order + robots
    while following < orders.state.shape[0]:
        cell = world.stops.cell[orders.first_stop[following]]
        if world.rules.skip_reached == 0 or cell != world.robots.cell[i]:
            orders.release_tick[following] = clock[CLOCK_TICK] + 1
            orders.release_sequence[clock[CLOCK_SEQUENCED]] = following
            clock[CLOCK_SEQUENCED] += 1
            return
        following += robots


@kernel
def complete_visits(world, record):
    """At the end of a tick: robots that stand at the next stop of their orders have done it."""
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        if robots.goal_type[U(i)] != GOAL_STOP or robots.cell[U(i)] != robots.goal_cell[U(i)]:
            continue
        entering = robots.claim[U(i)]  # one that turns in a passing aisle claims its own cell
        if entering == NIL or entering == robots.cell[U(i)]:
            complete_visit(world, record, i)


@kernel
def complete_visit(world, record, i):
    """Robot i has done the next stop of its order."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.order[i])
    world.stops.done[orders.first_stop[order] + orders.stops_done[order]] = world.clock[CLOCK_TICK]
    orders.stops_done[order] += 1
    world.tally.visits[i] += 1
    world.tally.progress[i] = world.clock[CLOCK_TICK]
    world.tally.visited[i] = order
    record_change(world.clock, record, CHANGE_VISITED, robots.identity[i], order)
    if orders.state[order] == ORDER_WAITING:
        orders.state[order] = ORDER_STARTED
        orders.legs[order] += 1
    cell = next_stop_cell(world, order)
    if cell != NIL:
        set_goal(world, i, GOAL_STOP, cell)
        return
    robots.order[i] = NIL
    end_goal(world, i)
    orders.state[order] = ORDER_DELIVERED
    orders.delivered[order] = world.clock[CLOCK_TICK]
    world.clock[CLOCK_UNDELIVERED] -= 1
    if world.rules.assigned:
        announce_next(world, i, order)
    reserve_order(world, record, order, NIL)
    request_allocation(world, i, REASON_IDLE)
