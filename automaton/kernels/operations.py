"""What robots begin: operations with their ticks, reservations, needs; and the notes kept of them."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.news import tell_zoning
from automaton.kernels.stations import deliver
from automaton.recording.codes import DID_ILLEGAL, ORDER_BY, PICKED_UP, SET_AT, SLOT_BY
from automaton.world.condition import EXHAUSTED, RUNNING
from automaton.world.state import (
    CARRIED,
    CHANGED,
    CHANGES,
    DELIVERED,
    DROP,
    FREE,
    FRESH_ALLOCATION,
    GOAL_NONE,
    ILLEGAL,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_ROUTE,
    NEED_WAY,
    NEEDING_CHARGING,
    NEEDING_ROUTE,
    NEEDING_WAY,
    NIL,
    OUT,
    PICK,
    PICKED,
    PLAN,
    RECORDING,
    TICK,
    UNDELIVERED,
    WAITING,
)

MOST_CHANGES = 12  # rows that a robot may add in a tick


@kernel
def note(clock, record, code, subject, value):
    """Append a row of changes if the run is recorded."""
    if clock[RECORDING]:
        row = clock[CHANGED]
        record.changes[row, 0] = clock[TICK]
        record.changes[row, 1] = code
        record.changes[row, 2] = subject
        record.changes[row, 3] = value
        clock[CHANGED] = row + 1


@kernel
def price(world, i, action, ticks):
    """Units of charge that an operation of robot i takes."""
    loaded = 1 if world.robots.load[i] != NIL else 0
    return ticks * np.int64(world.rules.drain[action, loaded])


@kernel
def exhaust(world, i):
    """The battery of robot i lacks what it needs: it is out of order from the next tick on."""
    if world.robots.status[i] == RUNNING:
        world.clock[OUT] += 1
    if world.robots.status[i] <= EXHAUSTED:
        world.robots.status[i] = EXHAUSTED


@kernel
def pay(world, i, units):
    """Take units from the battery of robot i; one that cannot pay is empty and exhausted."""
    robots = world.robots
    taken = min(units, np.int64(robots.charge[i]))
    robots.charge[i] -= taken
    world.tally.spent[i] += taken
    if taken < units:
        exhaust(world, i)


@kernel
def begin(world, i, action, ticks):
    """Robot i begins an operation of so many ticks, the current one included; motion counts them."""
    if world.rules.battery:
        pay(world, i, price(world, i, action, ticks))
    loaded = 1 if world.robots.load[i] != NIL else 0
    world.robots.action[i] = action
    world.robots.busy[i] = ticks
    world.tally.times[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += ticks


@kernel
def lose_tick(world, i, action):
    """Count a tick in which robot i executes nothing, and why."""
    if world.rules.battery:
        pay(world, i, price(world, i, action, 1))
    loaded = 1 if world.robots.load[i] != NIL else 0
    world.robots.action[i] = action
    world.tally.times[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += 1


@kernel
def need_allocation(world, i, reason):
    robots, clock = world.robots, world.clock
    if robots.need[i] & NEED_ALLOCATION == 0 or robots.asked_at[i] >= 0:
        clock[FRESH_ALLOCATION] += 1
    robots.need[i] |= np.uint8(NEED_ALLOCATION)
    robots.reason[i] = reason
    robots.asked_at[i] = NIL
    if reason == FREE:
        need_charging(world, i, FREE)


@kernel
def allocation_done(world, i):
    robots = world.robots
    if robots.need[i] & NEED_ALLOCATION:
        if robots.asked_at[i] == NIL:
            world.clock[FRESH_ALLOCATION] -= 1
        robots.need[i] &= np.uint8(255 - NEED_ALLOCATION)
    robots.asked_at[i] = NIL


@kernel
def need_charging(world, i, reason):
    """Charging is to be asked about robot i, which has a battery."""
    robots = world.robots
    if world.rules.battery == 0:
        return
    if robots.need[i] & NEED_CHARGING == 0:
        world.clock[NEEDING_CHARGING] += 1
    robots.need[i] |= np.uint8(NEED_CHARGING)
    robots.charging_reason[i] = reason


@kernel
def need_route(world, i, reason):
    robots = world.robots
    drop_route(robots, i)
    if robots.need[i] & NEED_ROUTE == 0:
        world.clock[NEEDING_ROUTE] += 1
    robots.need[i] |= np.uint8(NEED_ROUTE)
    robots.route_reason[i] = reason


@kernel
def need_way(world, i):
    if world.robots.need[i] & NEED_WAY == 0:
        world.clock[NEEDING_WAY] += 1
    world.robots.need[i] |= np.uint8(NEED_WAY)


@kernel
def no_route_needed(world, i):
    if world.robots.need[i] & NEED_ROUTE:
        world.clock[NEEDING_ROUTE] -= 1
        world.robots.need[i] &= np.uint8(255 - NEED_ROUTE)


@kernel
def no_way_needed(world, i):
    if world.robots.need[i] & NEED_WAY:
        world.clock[NEEDING_WAY] -= 1
        world.robots.need[i] &= np.uint8(255 - NEED_WAY)


@kernel
def drop_route(robots, i):
    """Forget the route: a stale plan must never be resumed."""
    robots.length[i] = 0
    robots.at[i] = 0
    robots.route_sum[i] = 0


@kernel
def first_cell(robots, i):
    """Where a new route of robot i begins: the cell that it enters, stands in, or leaves its bay by."""
    if robots.claim[i] != NIL:
        return np.int64(robots.claim[i])
    return np.int64(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])


@kernel
def reserve_order(world, record, order, identity):
    """Give an order to a robot, or back (NIL)."""
    world.orders.by[order] = identity
    world.clock[CHANGES] += 1
    note(world.clock, record, ORDER_BY, order, identity)


@kernel
def reserve_slot(world, record, slot, identity):
    """Reserve a shelf for a robot's load, or free it (NIL); other slots take any number."""
    if world.slots.endless[slot]:
        return
    world.slots.by[slot] = identity
    world.clock[CHANGES] += 1
    note(world.clock, record, SLOT_BY, slot, identity)


@kernel
def handle(world, i, action, ticks):
    """Count a pick or drop; one of 0 ticks is part of the move that it follows."""
    if ticks:
        begin(world, i, action, ticks)
    else:
        loaded = 1 if world.robots.load[i] != NIL else 0
        world.tally.times[i, action, loaded] += 1


@kernel
def pick_up(world, record, i, ticks):
    """The shelf empties in the first tick of the pick; allocation says next tick where to go."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.order[i])
    handle(world, i, PICK, ticks)
    slot = np.int64(orders.place[order])
    robots.goal[i] = GOAL_NONE
    robots.stand[i] = NIL
    drop_route(robots, i)
    orders.legs[order] += 1
    note(world.clock, record, PICKED_UP, robots.identity[i], order)
    if slot == orders.target[order]:
        visit(world, record, i, order, ticks)
        return
    empty_slot(world, slot)
    if world.zoning.queue.shape[0]:
        world.zoning.leg[order] = slot
    orders.place[order] = NIL
    orders.state[order] = CARRIED
    robots.load[i] = order
    world.clock[CHANGES] += 1
    need_allocation(world, i, PICKED)


@kernel
def leave_queue(world, order):
    """An order waits anew somewhere: zoning is to say in whose queue it is."""
    tell_zoning(world)
    if world.zoning.queue.shape[0]:
        former = np.int64(world.zoning.queue[order])
        if former >= 0:
            world.zoning.queue[order] = -2 - former  # it is that zone's until zoning says otherwise
        world.zoning.stop[order] = NIL
        world.zoning.direct[order] = 0
        world.zoning.leg[order] = NIL


@kernel
def visit(world, record, i, order, ticks):
    """The order lies where it has to go: with the robot's coming it is done."""
    world.robots.order[i] = NIL
    world.orders.state[order] = DELIVERED
    world.orders.delivered[order] = world.clock[TICK]
    world.clock[UNDELIVERED] -= 1
    deliver(world, order, ticks)
    reserve_order(world, record, order, NIL)
    need_allocation(world, i, FREE)


@kernel
def empty_slot(world, slot):
    """A load is taken from a slot; a spare one is put away."""
    slots = world.slots
    slots.content[slot] = NIL
    if slot >= slots.spare:
        slots.cell[slot] = NIL
        slots.endless[slot] = 1  # no shelf: nobody sets a load down there
        for direction in range(4):
            slots.access[slot, direction] = NIL


@kernel
def set_down(world, record, i, ticks):
    """The load is on the slot, and there for others, in the first tick of the drop."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.load[i])
    slot = np.int64(robots.slot[i])
    handle(world, i, DROP, ticks)
    robots.load[i] = NIL
    robots.order[i] = NIL
    robots.slot[i] = NIL
    robots.goal[i] = GOAL_NONE
    robots.stand[i] = NIL
    drop_route(robots, i)
    note(world.clock, record, SET_AT, robots.identity[i], slot)
    orders.place[order] = slot
    if slot == orders.target[order]:
        orders.state[order] = DELIVERED
        orders.delivered[order] = world.clock[TICK]
        world.clock[UNDELIVERED] -= 1
        deliver(world, order, ticks)
    else:
        orders.state[order] = WAITING
        leave_queue(world, order)
    if world.slots.endless[slot] == 0:
        world.slots.content[slot] = order
    reserve_order(world, record, order, NIL)
    reserve_slot(world, record, slot, NIL)
    need_allocation(world, i, FREE)


@kernel
def refuse(world, layer, i):
    """An illegal answer: the robot waits for one tick, unless an operation runs anyway."""
    world.tally.illegal[layer] += 1
    if world.robots.busy[i] == 0:
        lose_tick(world, i, ILLEGAL)
        world.robots.busy[i] = 1  # motion takes it away again in this tick
        world.robots.did[i] = DID_ILLEGAL


@kernel
def set_goal(world, i, goal, stand):
    world.robots.goal[i] = goal
    world.robots.stand[i] = stand
    need_route(world, i, PLAN)


@kernel
def entry_heading(grid, cell):
    """Heading of a robot placed on the floor: vertical if the cell leads north or south."""
    rule = np.int64(grid.rule[cell])
    for direction in (1, 3, 0, 2):
        if (rule >> direction) & 1:
            return direction & (grid.headings - 1)
    return 0
