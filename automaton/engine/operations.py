"""What robots begin: operations with their ticks, reservations, needs; and the notes kept of them."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.record_codes import (
    CHANGE_DROPPED,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_SLOT_RESERVED,
    EXECUTED_ILLEGAL,
)
from automaton.engine.robot_status import STATUS_EXHAUSTED, STATUS_UP
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_ILLEGAL,
    ACTION_PICK,
    CLOCK_CHANGE_ROWS,
    CLOCK_FRESH_ALLOCATION,
    CLOCK_NEEDING_CHARGING,
    CLOCK_NEEDING_RIGHT_OF_WAY,
    CLOCK_NEEDING_ROUTE,
    CLOCK_RECORDING,
    CLOCK_REVISION,
    CLOCK_ROBOTS_DOWN,
    CLOCK_TICK,
    CLOCK_UNDELIVERED,
    GOAL_NONE,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_WAITING,
    REASON_IDLE,
    REASON_NEW_GOAL,
    REASON_PICKED,
)
from automaton.engine.stations import deliver
from automaton.engine.zoning_requests import request_zoning

MAX_CHANGES = 12  # rows that a robot may add in a tick


@kernel
def record_change(clock, record, code, subject, value):
    """Append a row of changes if the run is recorded."""
    if clock[CLOCK_RECORDING]:
        row = clock[CLOCK_CHANGE_ROWS]
        record.changes[row, 0] = clock[CLOCK_TICK]
        record.changes[row, 1] = code
        record.changes[row, 2] = subject
        record.changes[row, 3] = value
        clock[CLOCK_CHANGE_ROWS] = row + 1


@kernel
def energy_cost(world, i, action, ticks):
    """Units of charge that an operation of robot i takes."""
    loaded = 1 if world.robots.load[i] != NIL else 0
    return ticks * np.int64(world.rules.drain[action, loaded])


@kernel
def exhaust(world, i):
    """The battery of robot i lacks what it needs: it is down from the next tick on."""
    if world.robots.status[i] == STATUS_UP:
        world.clock[CLOCK_ROBOTS_DOWN] += 1
    if world.robots.status[i] <= STATUS_EXHAUSTED:
        world.robots.status[i] = STATUS_EXHAUSTED


@kernel
def consume_energy(world, i, units):
    """Take units from the battery of robot i; one that cannot pay is empty and exhausted."""
    robots = world.robots
    taken = min(units, np.int64(robots.charge[i]))
    robots.charge[i] -= taken
    world.tally.energy_used[i] += taken
    if taken < units:
        exhaust(world, i)


@kernel
def begin(world, i, action, ticks):
    """Robot i begins an operation of so many ticks, the current one included; motion counts them."""
    if world.rules.battery:
        consume_energy(world, i, energy_cost(world, i, action, ticks))
    loaded = 1 if world.robots.load[i] != NIL else 0
    world.robots.action[i] = action
    world.robots.busy[i] = ticks
    world.tally.operations[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += ticks


@kernel
def count_lost_tick(world, i, action):
    """Count a tick in which robot i executes nothing, and why."""
    if world.rules.battery:
        consume_energy(world, i, energy_cost(world, i, action, 1))
    loaded = 1 if world.robots.load[i] != NIL else 0
    world.robots.action[i] = action
    world.tally.operations[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += 1


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
    robots = world.robots
    drop_route(robots, i)
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
def reserve_order(world, record, order, identity):
    """Give an order to a robot, or back (NIL)."""
    world.orders.reserved_by[order] = identity
    world.clock[CLOCK_REVISION] += 1
    record_change(world.clock, record, CHANGE_ORDER_RESERVED, order, identity)


@kernel
def reserve_slot(world, record, slot, identity):
    """Reserve a shelf for a robot's load, or free it (NIL); other slots take any number."""
    if world.slots.unbounded[slot]:
        return
    world.slots.reserved_by[slot] = identity
    world.clock[CLOCK_REVISION] += 1
    record_change(world.clock, record, CHANGE_SLOT_RESERVED, slot, identity)


@kernel
def handle(world, i, action, ticks):
    """Count a pick or drop; one of 0 ticks is part of the move that it follows."""
    if ticks:
        begin(world, i, action, ticks)
    else:
        loaded = 1 if world.robots.load[i] != NIL else 0
        world.tally.operations[i, action, loaded] += 1


@kernel
def pick_up(world, record, i, ticks):
    """The shelf empties in the first tick of the pick; allocation says next tick where to go."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.order[i])
    handle(world, i, ACTION_PICK, ticks)
    slot = np.int64(orders.current_slot[order])
    robots.goal_type[i] = GOAL_NONE
    robots.goal_cell[i] = NIL
    drop_route(robots, i)
    orders.legs[order] += 1
    record_change(world.clock, record, CHANGE_PICKED, robots.identity[i], order)
    if slot == orders.target[order]:
        visit(world, record, i, order, ticks)
        return
    empty_slot(world, slot)
    if world.service_zones.queue.shape[0]:
        world.service_zones.picked_from[order] = slot
    orders.current_slot[order] = NIL
    orders.state[order] = ORDER_CARRIED
    robots.load[i] = order
    world.clock[CLOCK_REVISION] += 1
    request_allocation(world, i, REASON_PICKED)


@kernel
def leave_queue(world, order):
    """An order waits again somewhere: zoning is to say in whose queue it is."""
    request_zoning(world)
    if world.service_zones.queue.shape[0]:
        former = np.int64(world.service_zones.queue[order])
        if former >= 0:
            world.service_zones.queue[order] = (
                -2 - former
            )  # it is that zone's until zoning says otherwise
        world.service_zones.next_slot[order] = NIL
        world.service_zones.skips_transfer[order] = 0
        world.service_zones.picked_from[order] = NIL


@kernel
def visit(world, record, i, order, ticks):
    """The order lies where it has to go: it is done when the robot arrives."""
    world.robots.order[i] = NIL
    world.orders.state[order] = ORDER_DELIVERED
    world.orders.delivered[order] = world.clock[CLOCK_TICK]
    world.clock[CLOCK_UNDELIVERED] -= 1
    deliver(world, order, ticks)
    reserve_order(world, record, order, NIL)
    request_allocation(world, i, REASON_IDLE)


@kernel
def empty_slot(world, slot):
    """A load is taken from a slot; a spare one is put away."""
    slots = world.slots
    slots.content[slot] = NIL
    if slot >= slots.first_spare:
        slots.cell[slot] = NIL
        slots.unbounded[slot] = 1  # no shelf: no robot drops a load there
        for direction in range(4):
            slots.access[slot, direction] = NIL


@kernel
def set_down(world, record, i, ticks):
    """The load is on the slot, and there for others, in the first tick of the drop."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.load[i])
    slot = np.int64(robots.slot[i])
    handle(world, i, ACTION_DROP, ticks)
    robots.load[i] = NIL
    robots.order[i] = NIL
    robots.slot[i] = NIL
    robots.goal_type[i] = GOAL_NONE
    robots.goal_cell[i] = NIL
    drop_route(robots, i)
    record_change(world.clock, record, CHANGE_DROPPED, robots.identity[i], slot)
    orders.current_slot[order] = slot
    if slot == orders.target[order]:
        orders.state[order] = ORDER_DELIVERED
        orders.delivered[order] = world.clock[CLOCK_TICK]
        world.clock[CLOCK_UNDELIVERED] -= 1
        deliver(world, order, ticks)
    else:
        orders.state[order] = ORDER_WAITING
        leave_queue(world, order)
    if world.slots.unbounded[slot] == 0:
        world.slots.content[slot] = order
    reserve_order(world, record, order, NIL)
    reserve_slot(world, record, slot, NIL)
    request_allocation(world, i, REASON_IDLE)


@kernel
def refuse(world, layer, i):
    """An illegal decision: the robot waits for one tick, unless an operation runs anyway."""
    world.tally.illegal[layer] += 1
    if world.robots.busy[i] == 0:
        count_lost_tick(world, i, ACTION_ILLEGAL)
        world.robots.busy[i] = 1  # motion takes it away again in this tick
        world.robots.executed[i] = EXECUTED_ILLEGAL


@kernel
def set_goal(world, i, goal, goal_cell):
    world.robots.goal_type[i] = goal
    world.robots.goal_cell[i] = goal_cell
    request_route(world, i, REASON_NEW_GOAL)


@kernel
def entry_heading(grid, cell):
    """Heading of a robot placed on the floor: vertical if the cell leads north or south."""
    cell_flags = np.int64(grid.cell_flags[cell])
    for direction in (1, 3, 0, 2):
        if (cell_flags >> direction) & 1:
            return direction & (grid.headings - 1)
    return 0
