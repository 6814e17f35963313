"""What is to be decided: the layers that are asked about a robot, and why."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import (
    CLOCK_FRESH_ALLOCATION,
    CLOCK_NEEDING_CHARGING,
    CLOCK_NEEDING_RIGHT_OF_WAY,
    CLOCK_NEEDING_ROUTE,
    CLOCK_TICK,
    CLOCK_UNQUEUED_ORDERS,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    REASON_IDLE,
    REASON_NEW_GOAL,
)


@kernel
def request_zoning(world):
    """Something happened: zoning is asked in this tick, or in the next one."""
    if world.service_zones.wake.shape[0]:
        world.clock[CLOCK_UNQUEUED_ORDERS] += 1


@kernel
def request_allocation(world, i, reason):
    robots, clock = world.robots, world.clock
    if robots.need[i] & NEED_ALLOCATION == 0 or robots.seen_revision[i] >= 0:
        clock[CLOCK_FRESH_ALLOCATION] += 1
    robots.need[i] |= np.uint8(NEED_ALLOCATION)
    robots.reason[i] = reason
    robots.seen_revision[i] = NIL
    if reason == REASON_IDLE:
        request_charging(world, i, REASON_IDLE)


@kernel
def clear_allocation_request(world, i):
    robots = world.robots
    if robots.need[i] & NEED_ALLOCATION:
        if robots.seen_revision[i] == NIL:
            world.clock[CLOCK_FRESH_ALLOCATION] -= 1
        else:
            world.tally.progress[i] = world.clock[CLOCK_TICK]  # it had nothing to do up to now
        robots.need[i] &= np.uint8(255 - NEED_ALLOCATION)
    robots.seen_revision[i] = NIL


@kernel
def request_charging(world, i, reason):
    """Charging is to be asked about robot i, which has a battery."""
    robots = world.robots
    if world.rules.battery == 0:
        return
    if robots.need[i] & NEED_CHARGING == 0:
        world.clock[CLOCK_NEEDING_CHARGING] += 1
    robots.need[i] |= np.uint8(NEED_CHARGING)
    robots.charging_reason[i] = reason


@kernel
def request_route(world, i, reason):
    """Routing is to be asked about robot i; where right of way steers, there is none to ask."""
    robots = world.robots
    drop_route(robots, i)
    if world.rules.steered[0]:
        return
    if robots.need[i] & NEED_ROUTE == 0:
        world.clock[CLOCK_NEEDING_ROUTE] += 1
    robots.need[i] |= np.uint8(NEED_ROUTE)
    robots.route_reason[i] = reason


@kernel
def request_right_of_way(world, i):
    if world.robots.need[i] & NEED_RIGHT_OF_WAY == 0:
        world.clock[CLOCK_NEEDING_RIGHT_OF_WAY] += 1
    world.robots.need[i] |= np.uint8(NEED_RIGHT_OF_WAY)


@kernel
def clear_route_request(world, i):
    if world.robots.need[i] & NEED_ROUTE:
        world.clock[CLOCK_NEEDING_ROUTE] -= 1
        world.robots.need[i] &= np.uint8(255 - NEED_ROUTE)


@kernel
def clear_right_of_way(world, i):
    if world.robots.need[i] & NEED_RIGHT_OF_WAY:
        world.clock[CLOCK_NEEDING_RIGHT_OF_WAY] -= 1
        world.robots.need[i] &= np.uint8(255 - NEED_RIGHT_OF_WAY)


@kernel
def drop_route(robots, i):
    """Forget the route: a stale plan must never be resumed."""
    robots.route_length[i] = 0
    robots.route_index[i] = 0
    robots.route_hash[i] = 0


@kernel
def first_cell(robots, i):
    """Where a new route of robot i begins: the cell that it enters, stands in, or leaves its
    parking bay by."""
    if robots.claim[i] != NIL:
        return np.int64(robots.claim[i])
    return np.int64(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])


@kernel
def set_goal(world, i, goal, goal_cell):
    world.robots.goal_type[i] = goal
    world.robots.goal_cell[i] = goal_cell
    request_route(world, i, REASON_NEW_GOAL)
