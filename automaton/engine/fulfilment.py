"""How robots fulfil orders: reserved, picked up, taken from stop to stop, dropped.

An order is released, reserved by a robot, and done leg by leg; a leg ends when the load is dropped
or the robot returns the order. A load is on its robot from the first tick of the pick, and on its
slot from the first tick of the drop.

The robot of an order does its stops one after another. A stop of 0 ticks is done in the tick at
whose end the robot stands in its cell, however it came there; a robot does at most one stop per
tick. At a longer stop the robot does SERVE for its number of ticks, and the stop is done in the
last of them. The world itself sets the next stop as the robot's goal and asks routing. After the
last stop an order without a load is delivered, and allocation is asked what the robot does next;
for an order with a load, allocation is asked where the load goes.

Until its first stop is begun, an order without a load may be given to another robot; after that it
stays with its robot until it ends. If that robot goes down, the order waits again with its
remaining stops.
"""

import numpy as np

from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import put_pod_into, take_pod_out
from automaton.engine.operations import (
    begin,
    clear_right_of_way,
    clear_route_request,
    drive_on_with_load,
    drop_route,
    next_stop,
    next_stop_cell,
    put_off,
    record_change,
    request_allocation,
    request_zoning,
    set_goal,
    take_on,
)
from automaton.engine.record_codes import (
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_SLOT_RESERVED,
    CHANGE_VISITED,
    EXECUTED_SERVE,
)
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_IDLE,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_SERVE,
    ACTION_STATION_QUEUE,
    ACTION_TURN,
    GOAL_NONE,
    GOAL_STOP,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_STARTED,
    ORDER_WAITING,
    REASON_IDLE,
    REASON_PICKED,
    REASON_SERVED,
    RETRY_NONE,
    STATUS_EXHAUSTED,
)
from automaton.engine.trips import (
    end_visit,
    give_place_back,
    has_break,
    has_lines,
    has_trips,
    lift_pod,
    store_pod,
)

# Orders: released, reserved, returned, done.


@kernel
def release_orders(world):
    """Release orders that are due; in a closed loop, one for each delivered order.

    If orders are assigned to robots in advance, a robot's next one is released when the previous is
    done.
    """
    orders, clock = world.orders, world.clock
    while clock.next_release < orders.release_sequence.shape[0]:
        order = np.int64(orders.release_sequence[clock.next_release])
        if order == NIL:
            return
        if world.rules.in_system:
            delivered = orders.release_sequence.shape[0] - clock.undelivered
            if clock.next_release - delivered >= world.rules.in_system:
                return
            orders.release_tick[order] = clock.tick
        elif orders.release_tick[order] > clock.tick:
            return
        orders.state[order] = ORDER_WAITING
        clock.known_orders = max(clock.known_orders, order + 1)
        clock.next_release += 1
        clock.revision += 1
        request_zoning(world)


@kernel
def announce_next(world, i, order):
    """Robot i has done an order assigned to it; its next order is released in the next tick."""
    orders, clock, robots = world.orders, world.clock, world.robots.cell.shape[0]
    following = order + robots
    while following < orders.state.shape[0]:
        cell = world.stops.cell[orders.first_stop[following]]
        if world.rules.skip_reached == 0 or cell != world.robots.cell[i]:
            orders.release_tick[following] = clock.tick + 1
            orders.release_sequence[clock.sequenced] = following
            clock.sequenced += 1
            return
        following += robots


@kernel
def reserve_order(world, record, order, identity):
    """Assign an order to a robot, or return it (NIL)."""
    world.orders.reserved_by[order] = identity
    world.clock.revision += 1
    record_change(world.clock, record, CHANGE_ORDER_RESERVED, order, identity)


@kernel
def reserve_slot(world, record, slot, identity):
    """Reserve a shelf for a robot's load, or free it (NIL); other slots hold any number."""
    if world.slots.unbounded[slot]:
        return
    world.slots.reserved_by[slot] = identity
    world.clock.revision += 1
    record_change(world.clock, record, CHANGE_SLOT_RESERVED, slot, identity)


@kernel
def has_started(world, i):
    """Whether robot i has an order that no other robot can get."""
    order = world.robots.order[i]
    return order != NIL and world.orders.state[order] == ORDER_STARTED


@kernel
def return_order(world, record, i):
    """The order of robot i, which carries no load, waits again with its remaining stops."""
    order = np.int64(world.robots.order[i])
    world.robots.order[i] = NIL
    if world.orders.state[order] == ORDER_STARTED:
        world.orders.state[order] = ORDER_WAITING
    if has_trips(world):
        give_place_back(world, np.int64(world.robots.identity[i]))
    reserve_order(world, record, order, NIL)


@kernel
def lose_order(world, record, i):
    """The order of robot i goes to another robot; robot i has nothing to do."""
    robots = world.robots
    return_order(world, record, i)
    end_goal(world, i)
    if robots.retreat_moves[i] == 0:
        robots.retry_state[i] = RETRY_NONE
        clear_right_of_way(world, i)
    request_allocation(world, i, REASON_IDLE)


@kernel
def end_goal(world, i):
    """Robot i has no goal and no route."""
    world.robots.goal_type[i] = GOAL_NONE
    world.robots.goal_cell[i] = NIL
    drop_route(world.robots, i)
    clear_route_request(world, i)


@kernel
def complete_order(world, order):
    """An order is done in this tick."""
    orders, clock = world.orders, world.clock
    orders.state[order] = ORDER_DELIVERED
    orders.delivered[order] = clock.tick
    clock.undelivered -= 1
    first = clock.first_open
    while first < orders.state.shape[0] and orders.state[first] == ORDER_DELIVERED:
        first += 1
    clock.first_open = first


@kernel
def leave_queue(world, order):
    """An order waits again somewhere; zoning must assign it to a queue."""
    request_zoning(world)
    if world.service_zones.queue.shape[0]:
        former = np.int64(world.service_zones.queue[order])
        if former >= 0:
            # It stays with that zone until zoning decides otherwise.
            world.service_zones.queue[order] = -2 - former
        world.service_zones.next_slot[order] = NIL
        world.service_zones.skips_transfer[order] = 0
        world.service_zones.picked_from[order] = NIL


@kernel
def begin_leg(world, i):
    """Robot i begins a leg of an order: with its load, or empty when it takes the order."""
    tally = world.tally
    tally.leg_moves[i] = both(tally.operations, i, ACTION_MOVE)
    tally.leg_driven[i] = driven_ticks(tally, i)
    tally.leg_queued[i] = both(tally.ticks, i, ACTION_STATION_QUEUE)


@kernel
def end_leg(world, i, order):
    """Robot i ends its leg of an order."""
    tally, orders = world.tally, world.orders
    orders.moves[order] += both(tally.operations, i, ACTION_MOVE) - tally.leg_moves[i]
    orders.driven[order] += driven_ticks(tally, i) - tally.leg_driven[i]
    orders.queued[order] += both(tally.ticks, i, ACTION_STATION_QUEUE) - tally.leg_queued[i]


@kernel
def driven_ticks(tally, i):
    """Ticks of the moves and turns that robot i has begun."""
    return both(tally.ticks, i, ACTION_MOVE) + both(tally.ticks, i, ACTION_TURN)


@kernel
def both(counts, i, action):
    """The count of an action of robot i, loaded and empty together."""
    return counts[i, action, 0] + counts[i, action, 1]


# Loads: picked up and dropped.


@kernel
def pick_up(world, record, i, ticks):
    """The shelf is empty from the first tick of the pick; the destination is known in the next tick."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.order[i])
    handle(world, i, ACTION_PICK, ticks)
    slot = np.int64(orders.current_slot[order])
    robots.goal_type[i] = GOAL_NONE
    robots.goal_cell[i] = NIL
    drop_route(robots, i)
    orders.legs[order] += 1
    orders.picked[order] = world.clock.tick
    begin_leg(world, i)
    record_change(world.clock, record, CHANGE_PICKED, robots.identity[i], order)
    if slot == orders.target[order] and not has_trips(world):
        world.tally.visited[i] = order
        visit(world, record, i, order, ticks)
        return
    empty_slot(world, slot)
    if world.service_zones.queue.shape[0]:
        world.service_zones.picked_from[order] = slot
    orders.current_slot[order] = NIL
    orders.state[order] = ORDER_CARRIED
    take_on(world, i, order)
    if has_trips(world):
        lift_pod(world, order)
        take_pod_out(world.traffic.occupancy, world.slots.cell[slot])
    world.clock.revision += 1
    drive_on_with_load(world, i, REASON_PICKED)


@kernel
def visit(world, record, i, order, ticks):
    """The load already lies at its target: the order is done when the robot arrives."""
    world.robots.order[i] = NIL
    complete_order(world, order)
    deliver(world, order, ticks)
    reserve_order(world, record, order, NIL)
    request_allocation(world, i, REASON_IDLE)


@kernel
def empty_slot(world, slot):
    """A load is taken from a slot; a spare slot becomes unused."""
    slots = world.slots
    slots.content[slot] = NIL
    if slot >= slots.first_spare:
        slots.cell[slot] = NIL
        slots.unbounded[slot] = 1  # not a shelf, so no robot drops a load there
        for direction in range(4):
            slots.access[slot, direction] = NIL


@kernel
def set_down(world, record, i, ticks):
    """The load is on the slot, available to others, from the first tick of the drop."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.load[i])
    slot = np.int64(robots.slot[i])
    handle(world, i, ACTION_DROP, ticks)
    end_leg(world, i, order)
    put_off(world, i)
    robots.order[i] = NIL
    robots.slot[i] = NIL
    robots.goal_type[i] = GOAL_NONE
    robots.goal_cell[i] = NIL
    drop_route(robots, i)
    record_change(world.clock, record, CHANGE_DROPPED, robots.identity[i], slot)
    orders.current_slot[order] = slot
    is_over = slot == orders.target[order] or orders.target[order] == NIL
    if is_over:
        complete_order(world, order)
        deliver(world, order, ticks)
    else:
        orders.state[order] = ORDER_WAITING
        leave_queue(world, order)
    if has_trips(world):
        store_pod(world, order, slot, is_over)
        put_pod_into(world.traffic.occupancy, world.slots.cell[slot])
    elif world.slots.unbounded[slot] == 0:
        world.slots.content[slot] = order
    reserve_order(world, record, order, NIL)
    reserve_slot(world, record, slot, NIL)
    request_allocation(world, i, REASON_IDLE)


@kernel
def handle(world, i, action, ticks):
    """Count a pick or drop; one of 0 ticks is part of the move that it follows."""
    world.tally.progress[i] = world.clock.tick
    if ticks:
        begin(world, i, action, ticks)
    else:
        loaded = 1 if world.robots.load[i] != NIL else 0
        world.tally.operations[i, action, loaded] += 1


# Stops, which are done one after another.


@kernel
def serve(world, record, i):
    """Robot i, which stands at the next stop of its order, begins to serve it."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.order[i])
    stop = next_stop(world, order)
    ticks = np.int64(world.stops.ticks[stop])
    if ticks == 0:
        return
    note_arrival(world, order, stop, np.int64(world.clock.tick) - 1)
    if has_trips(world):
        if has_break(world, order):
            return
        world.trips.begun[order] = orders.stops_done[order] + 1
    start(orders, order)
    robots.failed_retries[i] = 0
    begin(world, i, ACTION_SERVE, ticks)
    robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_SERVE
    record_change(world.clock, record, CHANGE_DURATION, robots.identity[i], ticks)


@kernel
def note_arrival(world, order, stop, tick):
    """Note that the robot that last took an order has arrived at a stop of it."""
    taken = np.int64(world.orders.dispatched[order])
    if world.stops.arrived[stop] < taken:
        world.stops.arrived[stop] = max(tick, taken)


@kernel
def start(orders, order):
    """The first stop of an order is begun: an order without a load now stays with its robot."""
    if orders.state[order] == ORDER_WAITING:
        orders.state[order] = ORDER_STARTED
        orders.legs[order] += 1


@kernel
def complete_visits(world, record):
    """At the end of a tick: robots that have served the next stop of their orders complete it."""
    robots, in_sequence = world.robots, has_trips(world)
    for k in range(robots.cell.shape[0]):
        # Robots get places in order of identity.
        i = np.int64(robots.at_index[U(k)]) if in_sequence else k
        if robots.goal_type[U(i)] != GOAL_STOP or robots.cell[U(i)] != robots.goal_cell[U(i)]:
            continue
        entering = robots.claim[U(i)]  # a robot that turns in a passing aisle claims its own cell
        if (entering == NIL or entering == robots.cell[U(i)]) and has_served(world, i):
            complete_visit(world, record, i)


@kernel
def has_served(world, i):
    """Whether robot i, at the next stop of its order, has served it."""
    robots = world.robots
    if robots.status[i] > STATUS_EXHAUSTED:
        return False  # it is down
    stop = next_stop(world, np.int64(robots.order[i]))
    if world.stops.ticks[stop]:
        return robots.action[i] == ACTION_SERVE and robots.busy[i] == 0
    if has_trips(world) and has_break(world, np.int64(robots.order[i])):
        return False
    return robots.busy[i] == 0 or robots.action[i] != ACTION_PICK


@kernel
def complete_visit(world, record, i):
    """Robot i has done the next stop of its order."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.order[i])
    stop = next_stop(world, order)
    world.stops.done[stop] = world.clock.tick
    note_arrival(world, order, stop, np.int64(world.clock.tick))
    orders.stops_done[order] += 1
    world.tally.visits[i] += 1
    world.tally.progress[i] = world.clock.tick
    world.tally.visited[i] = order
    record_change(world.clock, record, CHANGE_VISITED, robots.identity[i], order)
    if robots.action[i] == ACTION_SERVE:
        robots.action[i] = ACTION_IDLE  # the next stop may be in the same cell
    start(orders, order)
    cell = next_stop_cell(world, order)
    if has_lines(world):
        cell = end_visit(world, np.int64(robots.identity[i]), order, stop)
    if cell != NIL:
        set_goal(world, i, GOAL_STOP, cell)
        return
    end_goal(world, i)
    if robots.load[i] != NIL:
        request_allocation(world, i, REASON_SERVED)
        return
    robots.order[i] = NIL
    end_leg(world, i, order)
    complete_order(world, order)
    if world.rules.assigned:
        announce_next(world, i, order)
    reserve_order(world, record, order, NIL)
    request_allocation(world, i, REASON_IDLE)


# Stations that work on parts, one at a time, in arrival order.
#
# A part comes to a station when its order is delivered there; the order for its next way is released
# in the tick in which its job is done.


@kernel
def deliver(world, order, ticks):
    """A load is delivered; its part, if any, reaches the station after `ticks` ticks, with the
    drop.
    """
    if world.stations.job_of_order.shape[0]:
        work = np.int64(world.stations.job_of_order[order])
        if work != NIL:
            come(world, work, world.clock.tick + ticks)


@kernel
def come(world, work, tick):
    """A part arrives at the station of this job; processing can start from a given tick on.

    It queues behind parts that arrived earlier. Among parts of one tick the lowest number is first,
    so the storage order of robots has no effect.
    """
    stations = world.stations
    k = np.int64(stations.station[work])
    stations.arrival_tick[work] = tick
    ahead, at = np.int64(NIL), np.int64(stations.in_service[k])
    while at != NIL and (
        stations.arrival_tick[at] < tick or (stations.arrival_tick[at] == tick and at < work)
    ):
        ahead, at = at, np.int64(stations.next_in_queue[at])
    stations.next_in_queue[work] = at
    if ahead == NIL:
        stations.in_service[k] = work
        stations.job_done_tick[k] = tick + stations.processing_time[work]
    else:
        stations.next_in_queue[ahead] = work
    if at == NIL:
        stations.queue_tail[k] = work


@kernel
def work_at_stations(world):
    """Parts arrive; finished jobs end, and the next ones begin."""
    stations, clock = world.stations, world.clock
    while clock.next_part < stations.part_arrivals.shape[0]:
        work = np.int64(stations.part_arrivals[clock.next_part])
        if stations.arrival_tick[work] > clock.tick:
            break
        come(world, work, clock.tick)
        clock.next_part += 1
    for k in range(stations.slot.shape[0]):
        work = np.int64(stations.in_service[k])
        if work == NIL or stations.job_done_tick[k] > clock.tick:
            continue
        stations.completion_tick[work] = clock.tick
        clock.open_jobs -= 1
        if stations.releases_order[work] != NIL:
            make_known(world, np.int64(stations.releases_order[work]))
        following = np.int64(stations.next_in_queue[work])
        stations.in_service[k] = following
        if following == NIL:
            stations.queue_tail[k] = NIL
        else:
            begin = max(clock.tick, np.int64(stations.arrival_tick[following]))
            stations.job_done_tick[k] = begin + stations.processing_time[following]


@kernel
def make_known(world, order):
    """The order waits at its station."""
    orders, clock = world.orders, world.clock
    orders.state[order] = ORDER_WAITING
    orders.release_tick[order] = clock.tick
    clock.known_orders = max(clock.known_orders, order + 1)
    orders.release_sequence[clock.next_release] = order
    clock.next_release += 1
    clock.revision += 1
    request_zoning(world)
