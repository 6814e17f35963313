"""The stops of orders: they are done one after another, by the robot of the order, which stands there.

A stop that takes no time is done in the tick at whose end that robot stands in its cell, however it
came there; at most one is done by a robot in a tick. At another one the robot does SERVE for as many
ticks, and the stop is done in the last of them. The world itself sets the next stop as the robot's goal
and asks routing. After the last one an order without a load is delivered, and allocation is asked what
the robot does next; of one with a load it is asked where that goes.

Until its first stop is begun an order without a load may be given to another robot; from then on it is
its robot's until it ends. If that robot goes down, the order waits again with the stops that are left.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.loads import complete_order, end_leg, reserve_order
from automaton.engine.motion import U
from automaton.engine.operations import (
    begin,
    clear_right_of_way,
    clear_route_request,
    drop_route,
    next_stop,
    next_stop_cell,
    record_change,
    request_allocation,
    set_goal,
)
from automaton.engine.record_codes import CHANGE_DURATION, CHANGE_VISITED, EXECUTED_SERVE
from automaton.engine.robot_states import STATUS_EXHAUSTED
from automaton.engine.state import (
    ACTION_IDLE,
    ACTION_PICK,
    ACTION_SERVE,
    CLOCK_SEQUENCED,
    CLOCK_TICK,
    GOAL_NONE,
    GOAL_STOP,
    NIL,
    ORDER_STARTED,
    ORDER_WAITING,
    REASON_IDLE,
    REASON_SERVED,
    RETRY_NONE,
)
from automaton.engine.trips import (
    end_visit,
    give_place_back,
    has_break,
    has_lines,
    has_trips,
    is_in_break,
)


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
    if has_trips(world):
        give_place_back(world, np.int64(world.robots.identity[i]))
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
def serve(world, record, i):
    """Robot i, which stands at the next stop of its order, begins what it does there."""
    robots, orders = world.robots, world.orders
    order = np.int64(robots.order[i])
    stop = next_stop(world, order)
    ticks = np.int64(world.stops.ticks[stop])
    if ticks == 0:
        return
    note_arrival(world, order, stop, np.int64(world.clock[CLOCK_TICK]) - 1)
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
    """The robot that last took an order stands at a stop of it since the end of a tick."""
    taken = np.int64(world.orders.dispatched[order])
    if world.stops.arrived[stop] < taken:
        world.stops.arrived[stop] = max(tick, taken)


@kernel
def start(orders, order):
    """The first stop of an order is begun: one without a load is its robot's from now on."""
    if orders.state[order] == ORDER_WAITING:
        orders.state[order] = ORDER_STARTED
        orders.legs[order] += 1


@kernel
def complete_visits(world, record):
    """At the end of a tick: robots that stand at the next stop of their orders have done it."""
    robots, in_sequence = world.robots, has_trips(world)
    for k in range(robots.cell.shape[0]):
        # Places are given to robots in the sequence of their identities.
        i = np.int64(robots.at_index[U(k)]) if in_sequence else k
        if robots.goal_type[U(i)] != GOAL_STOP or robots.cell[U(i)] != robots.goal_cell[U(i)]:
            continue
        entering = robots.claim[U(i)]  # one that turns in a passing aisle claims its own cell
        if (entering == NIL or entering == robots.cell[U(i)]) and has_served(world, i):
            complete_visit(world, record, i)


@kernel
def has_served(world, i):
    """Whether robot i, at the next stop of its order, has done there what it came for."""
    robots = world.robots
    if robots.status[i] > STATUS_EXHAUSTED:
        return False  # it is down, and does nothing
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
    world.stops.done[stop] = world.clock[CLOCK_TICK]
    note_arrival(world, order, stop, np.int64(world.clock[CLOCK_TICK]))
    orders.stops_done[order] += 1
    world.tally.visits[i] += 1
    world.tally.progress[i] = world.clock[CLOCK_TICK]
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


# Queues of stations: who stands in one, who is held up by it, and what stations did in each tick.


@kernel
def mark_queues(world):
    """After motion: which cells of stations and queues are held by robots that go there, or are there."""
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        cell = robots.cell[i]
        if cell == NIL:
            continue
        mark_if_queueing(world, i, cell)
        if robots.action[i] == ACTION_SERVE and world.pod_stations.station_at[cell] != NIL:
            world.pod_stations.served_ticks[world.pod_stations.station_at[cell]] += 1
        if robots.claim[i] != NIL:
            mark_if_queueing(world, i, robots.claim[i])


@kernel
def count_starved(world):
    """After `mark_queues`: count the tick for stations that could serve, and have no robot."""
    stations, tick = world.pod_stations, world.clock[CLOCK_TICK]
    for k in range(stations.cell.shape[0]):
        if stations.open_lines[k] and stations.visited_at[k] != tick and not is_in_break(world, k):
            stations.starved_ticks[k] += 1


@kernel
def mark_if_queueing(world, i, cell):
    """Mark a cell that robot i holds, if that is a station, or in the queue of the one it goes to."""
    robots, stations = world.robots, world.pod_stations
    station = stations.queue_at[cell]
    own = station if station != NIL else stations.station_at[cell]
    if own != NIL:
        stations.visited_at[own] = world.clock[CLOCK_TICK]
    queues = robots.goal_type[i] == GOAL_STOP and station != NIL
    if stations.station_at[cell] != NIL or (
        queues and robots.goal_cell[i] == stations.cell[station]
    ):
        stations.held_back[cell] = 1


@kernel
def clear_queues(world):
    robots, stations = world.robots, world.pod_stations
    for i in range(robots.cell.shape[0]):
        if robots.cell[i] != NIL:
            stations.held_back[robots.cell[i]] = 0
            if robots.claim[i] != NIL:
                stations.held_back[robots.claim[i]] = 0


@kernel
def is_in_own_queue(view, i):
    """Whether robot i stands in the queue of the station to which it goes: the queue alone moves it."""
    if view.trips.pod.shape[0] == 0 or view.robots.goal_type[i] != GOAL_STOP:
        return False
    station = view.pod_stations.queue_at[view.robots.cell[i]]
    return station != NIL and view.pod_stations.cell[station] == view.robots.goal_cell[i]


@kernel
def is_queueing_at_station(world, i, ahead):
    """Whether robot i, whose stop is a station, finds its place in the queue, or the station, held."""
    robots, stations = world.robots, world.pod_stations
    if robots.goal_type[i] != GOAL_STOP or stations.held_back[ahead] == 0:
        return False
    station = stations.station_at[robots.goal_cell[i]]
    if station == NIL:
        return False
    return ahead == robots.goal_cell[i] or stations.queue_at[ahead] == station
