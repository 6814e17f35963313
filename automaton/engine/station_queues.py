"""Queues of stations: who stands in one, who is held up by it, and what stations did in each tick."""

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import ACTION_SERVE, CLOCK_TICK, GOAL_STOP, NIL
from automaton.engine.trips import is_in_break


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
