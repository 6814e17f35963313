"""From order lines to trips of pods, by fixed rules that do not depend on strategies.

A released line gets a station. It joins the trip of its pod if the trip has a stop there that has
not begun. Otherwise the trip gets one more stop, if its last stop is not done. Otherwise a new trip
begins, if the pod is stored and has no trip. Remaining lines wait until the tick after the pod has
been stored.

Each trip needs a place at the station of its next stop. The robot gets it with the trip and returns
it when it has left the station's cell. After a stop, the robot gets the place for the next stop at
once, or the trip ends in storage. So no robot waits for a place while it carries a pod.
"""

import numpy as np

from automaton.engine.facilities import MICRO
from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import next_stop_cell, record_change, request_allocation
from automaton.engine.record_codes import CHANGE_ORDER_RESERVED
from automaton.engine.state import (
    ACTION_SERVE,
    GOAL_PARK,
    GOAL_STOP,
    MAX_BUSY,
    NIL,
    ORDER_UNRELEASED,
    ORDER_WAITING,
    REASON_REPLAN,
)


@kernel
def has_trips(world):
    """Whether orders of this world carry pods: all orders are trips, or orders of a list have pods."""
    return world.trips.pod.shape[0] > 0


@kernel
def has_lines(world):
    """Whether trips are made from lines; otherwise orders of a list carry pods."""
    return world.lines.order.shape[0] > 0


@kernel
def plan_trips(world, record):
    """Make new trips for pods stored in the last tick, then process the released lines."""
    clock, lines = world.clock, world.lines
    for k in range(clock.stored_pods):
        take_waiting_lines(world, record, np.int64(world.pods.stored[k]))
    clock.stored_pods = 0
    while clock.next_line < lines.sequence.shape[0]:
        line = np.int64(lines.sequence[clock.next_line])
        if lines.release_tick[line] > clock.tick:
            return
        clock.next_line += 1
        choose_station(world, line)
        choose_pod(world, line)
        take_line(world, record, line)


@kernel
def choose_station(world, line):
    """The station of a line: its own, that of its order, or the one with the fewest open lines."""
    lines, stations = world.lines, world.pod_stations
    order = lines.order[line]
    station = np.int64(lines.station[line])
    if station == NIL:
        station = np.int64(lines.order_station[order])
    if station == NIL:
        station = np.int64(0)
        for k in range(1, stations.cell.shape[0]):
            if stations.open_lines[k] < stations.open_lines[station]:
                station = np.int64(k)
    lines.served_at[line] = station
    lines.order_station[order] = station
    stations.open_lines[station] += 1


@kernel
def choose_pod(world, line):
    """The pod of a line: its own, or one with its SKU."""
    lines = world.lines
    pod = np.int64(lines.pod[line])
    if pod == NIL:
        pod = pod_with_sku(world, np.int64(lines.sku[line]), np.int64(lines.served_at[line]))
    lines.taken_from[line] = pod
    world.pods.open_lines[pod] += 1


@kernel
def pod_with_sku(world, sku, station):
    """The pod for a SKU: one whose trip can be joined at a station; else the stored pod without a
    trip nearest to it; else the one with the fewest open lines; ties: lowest number."""
    pods, nearest, fewest = world.pods, np.int64(NIL), np.int64(NIL)
    ticks = np.int64(0)
    for k in range(pods.sku_first[sku], pods.sku_first[sku + 1]):
        pod = np.int64(pods.sku_pod[k])
        trip, slot = np.int64(pods.trip[pod]), np.int64(pods.slot[pod])
        if trip != NIL:
            if world.rules.join and has_stop_at(world, find_stop(world, trip, station), station):
                return pod
        elif slot != NIL:
            away = np.int64(world.pod_stations.ticks_from[station, slot])
            if nearest == NIL or away < ticks:
                nearest, ticks = pod, away
        if fewest == NIL or pods.open_lines[pod] < pods.open_lines[fewest]:
            fewest = pod
    return fewest if nearest == NIL else nearest


@kernel
def take_line(world, record, line):
    """A line joins the trip of its pod, starts one, or waits for the next trip."""
    pods = world.pods
    pod = np.int64(world.lines.taken_from[line])
    trip = np.int64(pods.trip[pod])
    if trip == NIL and pods.slot[pod] != NIL and pods.first_line[pod] == NIL:
        add_to_trip(world, new_trip(world, record, pod), line)
    elif trip == NIL or world.rules.join == 0 or not add_to_trip(world, trip, line):
        append_waiting(world, pod, line)


@kernel
def append_waiting(world, pod, line):
    """A line queues for the pod's next trip."""
    pods, lines = world.pods, world.lines
    lines.following[line] = NIL
    if pods.first_line[pod] == NIL:
        pods.first_line[pod] = line
    else:
        lines.following[pods.last_line[pod]] = line
    pods.last_line[pod] = line


@kernel
def take_waiting_lines(world, record, pod):
    """A new trip of a stored pod takes the waiting lines, as far as it has stops for them."""
    pods = world.pods
    line = np.int64(pods.first_line[pod])
    pods.first_line[pod] = NIL
    trip = new_trip(world, record, pod)
    joins = True
    while line != NIL:
        following = np.int64(world.lines.following[line])
        if not joins or not add_to_trip(world, trip, line):
            append_waiting(world, pod, line)
        joins = world.rules.join != 0
        line = following


@kernel
def new_trip(world, record, pod):
    """Release a trip of a stored pod; a robot beneath the pod may get it."""
    orders, clock, pods = world.orders, world.clock, world.pods
    trip = np.int64(clock.next_release)
    slot = np.int64(pods.slot[pod])
    world.trips.pod[trip] = pod
    pods.trip[pod] = trip
    orders.weight[trip] = pods.weight[pod]
    orders.source[trip] = slot
    orders.current_slot[trip] = slot
    orders.state[trip] = ORDER_WAITING
    orders.release_sequence[trip] = trip
    clock.next_release += 1
    clock.known_orders = trip + 1
    clock.undelivered += 1
    clock.revision += 1
    offer(world, record, trip, np.int64(world.slots.cell[slot]))
    return trip


@kernel
def find_stop(world, trip, station):
    """The first stop of a trip at a station that has not begun, else its first free stop, or NIL."""
    orders, trips = world.orders, world.trips
    end = np.int64(orders.first_stop[trip + 1])
    stop = np.int64(orders.first_stop[trip]) + trips.begun[trip]
    while stop < end and world.stops.cell[stop] != NIL and trips.station[stop] != station:
        stop += 1
    return stop if stop < end else np.int64(NIL)


@kernel
def has_stop_at(world, stop, station):
    """Whether `stop` exists and is at a station."""
    return stop != NIL and world.trips.station[stop] == station


@kernel
def add_to_trip(world, trip, line):
    """Serve a line at a stop that has not begun, or at a new stop; False: no stop is possible."""
    orders, stops, trips = world.orders, world.stops, world.trips
    station = np.int64(world.lines.served_at[line])
    first = np.int64(orders.first_stop[trip])
    stop = find_stop(world, trip, station)
    if stop == NIL:
        return False
    if stops.cell[stop] == NIL:
        if stop > first and orders.stops_done[trip] == stop - first:
            return False  # the last stop is done
        stops.cell[stop] = world.pod_stations.cell[station]
        trips.station[stop] = station
        trips.handling[stop] = world.pod_stations.visit[station]
    add_to_stop(world, trip, stop, line)
    return True


@kernel
def add_to_stop(world, trip, stop, line):
    """A stop of a trip serves one more line; the trip is as urgent as its most urgent line."""
    lines, orders, trips = world.lines, world.orders, world.trips
    lines.trip[line] = trip
    lines.following[line] = NIL
    is_first = trips.first_line[orders.first_stop[trip]] == NIL
    if trips.first_line[stop] == NIL:
        trips.first_line[stop] = line
    else:
        lines.following[trips.last_line[stop]] = line
    trips.last_line[stop] = line
    rule = world.pod_stations.rule[trips.station[stop]]
    trips.handling[stop] += lines.handling[rule, line]
    ticks = ticks_of(np.int64(trips.handling[stop]))
    world.stops.ticks[stop] = min(world.rules.refinement * ticks, MAX_BUSY)
    if is_first or lines.priority[line] > orders.priority[trip]:
        orders.priority[trip] = lines.priority[line]
    orders.due[trip] = min(np.int64(orders.due[trip]), np.int64(lines.due[line]))
    orders.release_tick[trip] = min(
        np.int64(orders.release_tick[trip]), np.int64(lines.release_tick[line])
    )


@kernel
def ticks_of(handling):
    """Round millionths of a tick to ticks: half up, at least 1 unless there is nothing to do."""
    if handling == 0:
        return np.int64(0)
    return min(max((handling + MICRO // 2) // MICRO, 1), MAX_BUSY)


@kernel
def offer(world, record, trip, cell):
    """Reserve a trip for the robot beneath its pod, if the robot is free and can carry the weight."""
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        if robots.cell[i] != cell or robots.claim[i] != NIL or robots.order[i] != NIL:
            continue
        if robots.status[i] != 0 or robots.load[i] != NIL:
            continue
        if world.orders.weight[trip] <= world.rules.payload[robots.type[i]]:
            world.trips.offered[robots.identity[i]] = trip
            reserve(world, record, trip, np.int64(robots.identity[i]))
            if robots.goal_type[i] == GOAL_PARK:  # the robot must not leave before it is asked
                request_allocation(world, i, REASON_REPLAN)
        return


@kernel
def reserve(world, record, trip, identity):
    world.orders.reserved_by[trip] = identity
    world.clock.revision += 1
    record_change(world.clock, record, CHANGE_ORDER_RESERVED, trip, identity)


@kernel
def withdraw_offer(world, record, identity):
    """Release the trip that is offered to a robot: any robot may take it."""
    trip = np.int64(world.trips.offered[identity])
    world.trips.offered[identity] = NIL
    if world.orders.reserved_by[trip] == identity:
        i = world.robots.at_index[identity]
        if world.robots.order[i] != trip:
            reserve(world, record, trip, NIL)


@kernel
def leave_stations_and_pods(world, record):
    """After motion: robots that left a station return the place, and robots that left a pod its
    trip."""
    robots, trips = world.robots, world.trips
    for identity in range(trips.place.shape[0]):
        leaving, offered = trips.leaving[identity], trips.offered[identity]
        if leaving == NIL and offered == NIL:
            continue
        cell = robots.cell[robots.at_index[identity]]
        if leaving != NIL and cell != world.pod_stations.cell[leaving]:
            world.pod_stations.taken[leaving] -= 1
            world.clock.revision += 1
            trips.leaving[identity] = NIL
        if offered != NIL:
            slot = world.orders.current_slot[offered]
            if slot == NIL or world.slots.cell[slot] != cell:
                withdraw_offer(world, record, identity)


@kernel
def next_station(world, trip):
    """The station of a trip's next stop, NIL if no stop is left."""
    stop = np.int64(world.orders.first_stop[trip]) + np.int64(world.orders.stops_done[trip])
    if stop == world.orders.first_stop[trip + 1] or world.stops.cell[stop] == NIL:
        return np.int64(NIL)
    return np.int64(world.trips.station[stop])


@kernel
def has_place(view, trip):
    """Whether the station of a trip's next stop has a free place."""
    station = next_station(view, trip)
    if station == NIL:
        return True
    stations = view.pod_stations
    return stations.places[station] == NIL or stations.taken[station] < stations.places[station]


@kernel
def take_place(world, identity, trip):
    """A robot gets a place at the station of a trip's next stop."""
    station = next_station(world, trip)
    world.trips.place[identity] = station
    if station != NIL:
        world.pod_stations.taken[station] += 1


@kernel
def give_place_back(world, identity):
    station = world.trips.place[identity]
    world.trips.place[identity] = NIL
    if station != NIL:
        world.pod_stations.taken[station] -= 1
        world.clock.revision += 1


@kernel
def has_break(world, trip):
    """Whether the next stop of an order is at a station that has a break."""
    return is_in_break(world, world.pod_stations.station_at[next_stop_cell(world, trip)])


@kernel
def is_in_break(world, station):
    """Whether a station (or NIL) has a break now."""
    tick, breaks = world.clock.tick, world.pod_stations.breaks
    for row in range(breaks.shape[0]):
        if station != NIL and breaks[row, 0] == station and breaks[row, 1] <= tick < breaks[row, 2]:
            return True
    return False


@kernel
def end_visit(world, identity, trip, stop):
    """The lines of a stop are done; its robot continues to the next stop if it gets a place there.

    Returns the cell of that stop, or NIL: the pod goes into storage, and remaining lines wait.
    """
    station = np.int64(world.trips.station[stop])
    world.trips.begun[trip] = world.orders.stops_done[trip]
    line = np.int64(world.trips.first_line[stop])
    while line != NIL:
        complete_line(world, line)
        line = np.int64(world.lines.following[line])
    following = next_station(world, trip)
    if following == station:
        return np.int64(world.pod_stations.cell[station])  # it keeps its place
    world.trips.leaving[identity] = station
    world.trips.place[identity] = NIL
    if following == NIL:
        return np.int64(NIL)
    if has_place(world, trip):
        take_place(world, identity, trip)
        return np.int64(world.pod_stations.cell[following])
    drop_stops(world, trip)
    return np.int64(NIL)


@kernel
def complete_line(world, line):
    lines, tick = world.lines, world.clock.tick
    order = lines.order[line]
    lines.done[line] = tick
    lines.left[order] -= 1
    if lines.left[order] == 0:
        lines.order_done[order] = tick
        world.clock.orders_done += 1
    world.pod_stations.open_lines[lines.served_at[line]] -= 1
    world.pods.open_lines[lines.taken_from[line]] -= 1
    world.clock.undelivered -= 1


@kernel
def drop_stops(world, trip):
    """Cancel the remaining stops of a trip: their lines wait, ahead of the others."""
    orders, stops, trips, lines, pods = (
        world.orders,
        world.stops,
        world.trips,
        world.lines,
        world.pods,
    )
    pod = np.int64(trips.pod[trip])
    waiting = np.int64(pods.first_line[pod])
    pods.first_line[pod] = NIL
    first = np.int64(orders.first_stop[trip]) + np.int64(orders.stops_done[trip])
    for stop in range(first, orders.first_stop[trip + 1]):
        line = np.int64(trips.first_line[stop])
        while line != NIL:
            following = np.int64(lines.following[line])
            lines.trip[line] = NIL
            append_waiting(world, pod, line)
            line = following
        stops.cell[stop] = NIL
        trips.station[stop] = NIL
        trips.first_line[stop] = NIL
        trips.handling[stop] = 0
    while waiting != NIL:
        following = np.int64(lines.following[waiting])
        append_waiting(world, pod, waiting)
        waiting = following


@kernel
def lift_pod(world, trip):
    """The pod of a trip is now on its robot: its cell is free."""
    pods, pod = world.pods, np.int64(world.trips.pod[trip])
    pods.slot[pod] = NIL


@kernel
def store_pod(world, trip, slot, is_over):
    """The pod of a trip is now in a slot; if the trip is done, waiting lines or orders are next."""
    pods, pod = world.pods, np.int64(world.trips.pod[trip])
    pods.slot[pod] = slot
    world.slots.content[slot] = pod
    if not is_over:
        return
    pods.trip[pod] = NIL
    if pods.first_line[pod] != NIL:
        place = world.clock.stored_pods
        while place > 0 and pods.stored[place - 1] > pod:  # robots store pods in any order
            pods.stored[place] = pods.stored[place - 1]
            place -= 1
        pods.stored[place] = pod
        world.clock.stored_pods += 1


# Orders of a list that carry pods: each waits until its pod has no other order.
#
# Strategies know an order when its pod is stored without another order. Until then it queues for
# the pod, in sequence of release. In the tick after the pod was stored the next order becomes
# known; it begins where the pod stands then.


@kernel
def take_turns(world, record, first):
    """Make known the orders of pods stored in the last tick, and the orders released in this tick.

    `first`: the place of the latter in the sequence of releases.
    """
    clock, pods, orders = world.clock, world.pods, world.orders
    for k in range(clock.stored_pods):
        pod = np.int64(pods.stored[k])
        order = np.int64(pods.first_line[pod])
        pods.first_line[pod] = world.trips.following[order]
        begin_turn(world, record, pod, order)
    clock.stored_pods = 0
    for k in range(first, clock.next_release):
        order = np.int64(orders.release_sequence[k])
        pod = np.int64(world.trips.pod[order])
        if pod == NIL:
            continue
        if pods.trip[pod] == NIL:
            begin_turn(world, record, pod, order)
        else:
            await_turn(world, pod, order)


@kernel
def await_turn(world, pod, order):
    """An order queues until its pod has no order."""
    pods, following = world.pods, world.trips.following
    world.orders.state[order] = ORDER_UNRELEASED
    following[order] = NIL
    if pods.first_line[pod] == NIL:
        pods.first_line[pod] = order
    else:
        following[pods.last_line[pod]] = order
    pods.last_line[pod] = order


@kernel
def begin_turn(world, record, pod, order):
    """Release the order of a stored pod; a robot beneath the pod may get it."""
    orders, slot = world.orders, np.int64(world.pods.slot[pod])
    world.pods.trip[pod] = order
    orders.source[order] = slot
    orders.current_slot[order] = slot
    orders.state[order] = ORDER_WAITING
    world.clock.revision += 1
    offer(world, record, order, np.int64(world.slots.cell[slot]))


# Queues of stations: which robots stand in them or are blocked by them, and starved stations.


@kernel
def mark_queues(world):
    """Mark the cells of stations and queues held by robots that go to these stations or are there."""
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
    """After `mark_queues`: count the tick for stations that could serve but have no robot."""
    stations, tick = world.pod_stations, world.clock.tick
    for k in range(stations.cell.shape[0]):
        if stations.open_lines[k] and stations.visited_at[k] != tick and not is_in_break(world, k):
            stations.starved_ticks[k] += 1


@kernel
def mark_if_queueing(world, i, cell):
    """Mark a cell held by robot i if it is its station, or in the queue of the station it goes to."""
    robots, stations = world.robots, world.pod_stations
    station = stations.queue_at[cell]
    own = station if station != NIL else stations.station_at[cell]
    if own != NIL:
        stations.visited_at[own] = world.clock.tick
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
    """Whether robot i is in the queue of its destination station, so only the queue moves it."""
    if view.trips.pod.shape[0] == 0 or view.robots.goal_type[i] != GOAL_STOP:
        return False
    station = view.pod_stations.queue_at[view.robots.cell[i]]
    return station != NIL and view.pod_stations.cell[station] == view.robots.goal_cell[i]


@kernel
def is_queueing_at_station(world, i, ahead):
    """Whether robot i, bound for a station, is blocked by its queue or by the station."""
    robots, stations = world.robots, world.pod_stations
    if robots.goal_type[i] != GOAL_STOP or stations.held_back[ahead] == 0:
        return False
    station = stations.station_at[robots.goal_cell[i]]
    if station == NIL:
        return False
    return ahead == robots.goal_cell[i] or stations.queue_at[ahead] == station
