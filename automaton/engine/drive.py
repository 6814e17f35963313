"""What each free robot tries in a tick, and the outcome: the phases before and after motion.

`leave_parking_bays` and `drive` turn goals and routes into intents and begin operations;
`apply_move_outcomes` reads the outcomes of the moves and runs the waits and retries that right of
way defines.
"""

import numpy as np

from automaton.engine.energy import charge_up, has_energy_for
from automaton.engine.fulfilment import pick_up, serve, set_down
from automaton.engine.gates import (
    ask_gates_of_bays,
    enter_from_bay,
    has_gates,
    is_cabin_move,
    note_closing,
)
from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import (
    ARRIVED,
    AT_GATE,
    ENTERED,
    HELD,
    LIVE,
    MOVED,
    NO_TURN,
    POD_AHEAD,
    TOWARDS,
    is_empty,
    occupy,
    vacate,
)
from automaton.engine.operations import (
    begin,
    clear_right_of_way,
    clear_route_request,
    consume_energy,
    count_following,
    count_lost_tick,
    drop_route,
    energy_cost,
    entry_heading,
    headings_of,
    is_facing,
    limited_ticks,
    note_move,
    note_turn,
    record_change,
    replan,
    request_allocation,
    request_right_of_way,
    request_route,
)
from automaton.engine.random_numbers import (
    STREAM_EXTRA_TICKS,
    STREAM_HANDLING,
    STREAM_WAITS,
    random_bits,
    random_ticks,
)
from automaton.engine.record_codes import (
    CHANGE_DURATION,
    DROPPED_ON_ARRIVAL,
    ENTERED_PARKING_BAY,
    EXECUTED_BAY_BLOCKED,
    EXECUTED_BLOCKED,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_TRY_DROP,
    EXECUTED_WAIT,
    LEFT_PARKING_BAY,
    MOVE_EAST,
    PICKED_ON_ARRIVAL,
    TURN_LEFT,
    TURN_RIGHT,
)
from automaton.engine.state import (
    ACTION_BAY_BLOCKED,
    ACTION_BLOCKED,
    ACTION_DROP,
    ACTION_GATE,
    ACTION_HELD_BACK,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_STATION_QUEUE,
    ACTION_TRY_DROP,
    ACTION_TURN,
    ACTION_WAIT,
    FOLLOWING_CONVOY,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    HOLD,
    MAX_BUSY,
    NEED_ALLOCATION,
    NEED_ROUTE,
    NIL,
    NO_STEP,
    REASON_AROUND_CLOSED,
    REASON_IDLE,
    REASON_NEW_GOAL,
    RETRY_EXHAUSTED,
    RETRY_NONE,
    RETRY_WAITED,
    STATUS_EXHAUSTED,
)
from automaton.engine.trips import has_trips, is_in_own_queue, is_queueing_at_station


@kernel
def leave_parking_bays(world):
    """Place parked robots with a task on their home cells if these had room at the start of the
    tick."""
    robots, tick = world.robots, world.clock.tick
    gated = has_gates(world)
    if gated:
        ask_gates_of_bays(world)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.parked[i] == 0 or robots.busy[i] or robots.goal_type[i] in (GOAL_NONE, GOAL_PARK):
            continue
        if world.clock.halted_until >= tick and world.service_zones.halt[i] >= tick:
            continue
        if not may_leave_bay(world, i):
            continue
        if robots.cell[i] == NIL:
            home = np.int64(robots.home[i])
            heading = entry_heading(world.grid, robots.type[i], home)
            is_held = gated and world.gates.held[i] != NIL
            if is_held or not is_empty(world.traffic, home, heading, tick):
                count_lost_tick(world, i, ACTION_BAY_BLOCKED)
                robots.executed[i] = EXECUTED_BAY_BLOCKED
                continue
            occupy(world.traffic.occupancy, home, heading)
            robots.cell[i] = home
            world.tally.active[i] = tick
            robots.heading[i] = heading
            robots.travel[i] = heading
            robots.executed[i] = LEFT_PARKING_BAY
            if gated:
                enter_from_bay(world, home)
        robots.parked[i] = 0
        world.clock.unparked += 1


@kernel
def may_leave_bay(world, i):
    """Whether robot i, parked with a goal, drives now: it has a route, or right of way says so."""
    robots = world.robots
    if world.rules.steered[0] == 0:
        has_route = robots.route_index[i] < robots.route_length[i]
        return has_route or robots.goal_cell[i] == robots.home[i]
    if robots.cell[i] != NIL:
        return robots.goal_cell[i] == robots.cell[i]
    step = np.int64(robots.step[i])
    robots.step[i] = NO_STEP
    if step & HOLD:
        count_lost_tick(world, i, ACTION_BAY_BLOCKED)
        robots.executed[i] = EXECUTED_BAY_BLOCKED
    return step < NO_STEP


@kernel
def halt_robots(world, record):
    """Robots that zoning halts wait until it releases them; robots that are down do not."""
    robots, tick = world.robots, world.clock.tick
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.status[i] > STATUS_EXHAUSTED:
            continue
        ticks = world.service_zones.halt[i] - tick + 1
        if ticks > 0 and robots.busy[i] == 0 and robots.parked[i] == 0 and robots.cell[i] != NIL:
            begin(world, i, ACTION_WAIT, ticks)
            robots.executed[i] = EXECUTED_WAIT
            record_change(world.clock, record, CHANGE_DURATION, identity, ticks)
            if robots.need[i] & NEED_ALLOCATION:  # it is asked again when it is free
                request_allocation(world, i, np.int64(robots.reason[i]))


@kernel
def drive(world, record):
    """Set traffic.intent and begin the operations of every robot that is free and on the floor."""
    robots, traffic = world.robots, world.traffic
    several = world.rules.duration.shape[0] > 1  # reading a robot's costs takes 1 ns
    span = world.rules.duration[0, ACTION_MOVE]
    heading_mask = headings_of(world.grid, 0) - 1
    for i in range(robots.cell.shape[0]):
        traffic.intent[U(i)] = 0
        if robots.busy[U(i)]:
            continue
        route_index = robots.route_index[U(i)]
        if route_index < robots.route_length[U(i)]:
            if robots.parked[U(i)]:
                continue
            direction = np.int64(robots.route[U(i), U(route_index)])
            if several:
                heading_mask = headings_of(world.grid, robots.type[U(i)]) - 1
            if direction & heading_mask == robots.heading[U(i)]:
                if several:
                    span = world.rules.duration[U(robots.type[U(i)]), U(ACTION_MOVE)]
                traffic.move_ticks[U(i)] = span
                entered = ENTERED if robots.executed[U(i)] == LEFT_PARKING_BAY else 0
                traffic.intent[U(i)] = LIVE | direction | entered
            else:
                turn(world, i, direction)
        elif robots.parked[U(i)] == 0:
            drive_without_route(world, record, i)


@kernel
def drive_without_route(world, record, i):
    """The rarer cases: a step of right of way, arrival at the goal cell, nothing to do."""
    robots = world.robots
    direction = np.int64(robots.step[i])
    if direction & HOLD:
        robots.step[i] = NO_STEP
        hold_back(world, i, direction & ~HOLD)
    elif direction != NO_STEP:
        robots.step[i] = NO_STEP
        if is_facing(world, i, direction):
            world.traffic.move_ticks[i] = world.rules.duration[robots.type[i], ACTION_MOVE]
            world.traffic.intent[i] = LIVE | direction
        else:
            turn(world, i, direction)
            if robots.retreat_moves[i] == 0 and world.rules.steered[0] == 0:
                replan(world, i)
    elif robots.try_drop[i]:
        if not has_energy_for(world, i, ACTION_TRY_DROP):
            return
        robots.try_drop[i] = 0
        begin(world, i, ACTION_TRY_DROP, world.rules.duration[robots.type[i], ACTION_TRY_DROP])
        robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_TRY_DROP
    elif robots.retreat_moves[i] == 0 and robots.cell[i] == robots.goal_cell[i]:
        do_goal(world, record, i)
    elif world.rules.steered[0] and is_in_own_queue(world, i):
        move_up(world, i)
    elif robots.retreat_moves[i] == 0 and robots.goal_cell[i] != NIL:
        if robots.need[i] & NEED_ROUTE == 0:  # the route ended early: continue on a new one
            request_route(world, i, REASON_NEW_GOAL)


@kernel
def move_up(world, i):
    """Robot i is steered and in the queue of its station: it tries the next cell in each tick."""
    robots = world.robots
    direction = np.int64(world.pod_stations.queue_way[robots.cell[i]])
    if is_facing(world, i, direction):
        world.traffic.move_ticks[i] = world.rules.duration[robots.type[i], ACTION_MOVE]
        world.traffic.intent[i] = LIVE | direction
    else:
        turn(world, i, direction)


@kernel
def hold_back(world, i, direction):
    """Right of way holds robot i back for this tick."""
    count_lost_tick(world, i, ACTION_HELD_BACK)
    world.robots.executed[i] = np.int64(world.robots.executed[i]) | EXECUTED_BLOCKED
    world.traffic.intent[i] = HELD if direction == NO_STEP else HELD | TOWARDS | direction


@kernel
def do_goal(world, record, i):
    """At its goal cell, robot i begins its task."""
    robots = world.robots
    flags = np.int64(robots.executed[i])
    goal_type = robots.goal_type[i]
    if goal_type == GOAL_PICK and has_energy_for(world, i, ACTION_PICK):
        robots.failed_retries[i] = 0
        pick_up(world, record, i, handling_time(world, record, i, ACTION_PICK))
        robots.executed[i] = flags | EXECUTED_PICK
    elif goal_type == GOAL_DROP and has_energy_for(world, i, ACTION_DROP):
        robots.failed_retries[i] = 0
        set_down(world, record, i, handling_time(world, record, i, ACTION_DROP))
        robots.executed[i] = flags | EXECUTED_DROP
    elif goal_type == GOAL_STOP:
        serve(world, record, i)
    elif goal_type == GOAL_PARK:
        world.traffic.intent[i] = ARRIVED
    elif goal_type == GOAL_CHARGE:
        charge_up(world, i)


@kernel
def handling_time(world, record, i, action):
    """Ticks of a pick or a drop that begins now, including the random delay."""
    ticks = max(np.int64(world.rules.duration[world.robots.type[i], action]), 1)
    if world.rules.handling_jitter:
        identity = np.int64(world.robots.identity[i])
        ticks += random_ticks(world, 0, world.rules.handling_jitter, STREAM_HANDLING, identity)
        record_change(world.clock, record, CHANGE_DURATION, identity, ticks)
    return ticks


@kernel
def turn(world, i, direction):
    """Turn robot i by 90 degrees towards a direction, clockwise for a half turn.

    In a cell of capacity 2 a turning robot needs both lanes; it claims its own cell meanwhile.
    """
    robots, grid = world.robots, world.grid
    if not has_energy_for(world, i, ACTION_TURN):
        return
    cell = np.int64(robots.cell[i])
    if np.int64(grid.cell_flags[cell]) >> 5 & 3 == 2:
        other_lane = np.int64(robots.travel[i]) ^ 2
        if not is_empty(world.traffic, cell, other_lane, world.clock.tick):
            world.traffic.intent[i] = NO_TURN
            return
        occupy(world.traffic.occupancy, cell, other_lane)
        robots.claim[i] = cell
    note_turn(world, i, np.int64(world.rules.duration[robots.type[i], ACTION_TURN]))
    heading, headings = np.int64(robots.heading[i]), headings_of(grid, robots.type[i])
    left = headings == 4 and (direction - heading) & 3 == 3
    robots.heading[i] = (heading + (3 if left else 1)) & (headings - 1)
    robots.failed_retries[i] = 0
    begin(world, i, ACTION_TURN, world.rules.duration[robots.type[i], ACTION_TURN])
    robots.executed[i] = np.int64(robots.executed[i]) | (TURN_LEFT if left else TURN_RIGHT)


@kernel
def apply_move_outcomes(world, record):
    """Read the outcome of the moves: count them, run waits and retries, park robots at home."""
    robots, traffic = world.robots, world.traffic
    several = world.rules.duration.shape[0] > 1
    convoy = world.rules.following == FOLLOWING_CONVOY
    usual = np.int64(world.rules.duration[0, ACTION_MOVE])
    for i in range(robots.cell.shape[0]):
        intent = np.int64(traffic.intent[U(i)])
        if intent & MOVED:
            loaded = 1 if robots.load[U(i)] != NIL else 0
            move_ticks = np.int64(traffic.move_ticks[U(i)])
            own_ticks = np.int64(traffic.own_ticks[U(i)]) if convoy else move_ticks
            if several:
                usual = np.int64(world.rules.duration[U(robots.type[U(i)]), U(ACTION_MOVE)])
            world.tally.operations[U(i), U(ACTION_MOVE), U(loaded)] += 1
            world.tally.ticks[U(i), U(ACTION_MOVE), U(loaded)] += own_ticks
            world.tally.active[U(i)] = world.clock.tick + move_ticks - 1
            note_move(world, i, intent & 3, own_ticks)
            if own_ticks != usual:
                if not has_gates(world) or not is_cabin_move(world, i, intent & 3):
                    world.tally.slowdown_ticks[U(i)] += own_ticks - usual
            if move_ticks != usual:
                record_change(
                    world.clock, record, CHANGE_DURATION, robots.identity[U(i)], move_ticks
                )
            if world.rules.battery:
                consume_energy(world, i, energy_cost(world, i, ACTION_MOVE, own_ticks))
            if move_ticks > own_ticks:
                count_following(world, i, move_ticks - own_ticks)
            robots.action[U(i)] = ACTION_MOVE
            robots.executed[U(i)] = (np.int64(robots.executed[U(i)]) & LEFT_PARKING_BAY) | (
                MOVE_EAST + (intent & 3)
            )
            route_index = robots.route_index[U(i)]
            if route_index < robots.route_length[U(i)]:
                robots.route_index[U(i)] = route_index + 1
                robots.failed_retries[U(i)] = 0
                robots.retry_state[U(i)] = RETRY_NONE
                if route_index + 1 == robots.route_length[U(i)]:
                    park_if_home(world, i)
                    handle_at_once(world, record, i)
            else:
                after_step(world, i)
                handle_at_once(world, record, i)
        elif intent & AT_GATE == AT_GATE and intent & LIVE == 0:
            stop_at_gate(world, i)
        elif intent & POD_AHEAD and intent & LIVE == 0:
            stop_before_pod(world, i)
        elif intent & LIVE or intent == NO_TURN:
            refused(world, record, i)
        elif intent & ARRIVED:
            park_if_home(world, i)
            handle_at_once(world, record, i)


@kernel
def park_if_home(world, i):
    """A robot at home with nothing to do is now in its parking bay, off the floor, or parked."""
    robots = world.robots
    home = np.int64(robots.home[i])
    if robots.goal_type[i] != GOAL_PARK or robots.cell[i] != home or robots.retreat_moves[i]:
        return
    if robots.busy[i] or robots.route_index[i] < robots.route_length[i]:
        return
    robots.parked[i] = 1
    robots.goal_type[i] = GOAL_NONE
    robots.goal_cell[i] = NIL
    drop_route(robots, i)
    clear_route_request(world, i)
    robots.executed[i] = np.int64(robots.executed[i]) | ENTERED_PARKING_BAY
    world.clock.unparked -= 1
    if world.rules.steered[0] == 0 or robots.need[i] & NEED_ALLOCATION == 0:
        # A robot pushed from its place already has its request.
        request_allocation(world, i, REASON_IDLE)
    if robots.bay[i] != NIL or world.rules.leave:
        vacate(world.traffic.occupancy, home, np.int64(robots.travel[i]))
        robots.cell[i] = NIL
        robots.heading[i] = entry_heading(world.grid, robots.type[i], home)


@kernel
def handle_at_once(world, record, i):
    """A robot whose move ends at its goal cell handles its load in the same tick if that takes 0
    ticks."""
    robots, duration = world.robots, world.rules.duration[world.robots.type[i]]
    picks = robots.goal_type[i] == GOAL_PICK and duration[ACTION_PICK] == 0
    drops = robots.goal_type[i] == GOAL_DROP and duration[ACTION_DROP] == 0
    if (
        not (picks or drops)
        or robots.cell[i] != robots.goal_cell[i]
        or robots.action[i] != ACTION_MOVE
    ):
        return
    if robots.busy[i] or robots.route_index[i] < robots.route_length[i]:
        return
    if robots.retreat_moves[i] or robots.try_drop[i]:
        return
    clear_route_request(world, i)  # a step of right of way may have asked for one
    robots.failed_retries[i] = 0
    if picks:
        pick_up(world, record, i, 0)
    else:
        set_down(world, record, i, 0)
    robots.executed[i] = np.int64(robots.executed[i]) | (
        PICKED_ON_ARRIVAL if picks else DROPPED_ON_ARRIVAL
    )


@kernel
def after_step(world, i):
    """A step that right of way asked for is done; after the last step of a retreat, plan again."""
    robots = world.robots
    if world.rules.steered[0]:
        park_if_home(world, i)
        return
    if robots.retreat_moves[i]:
        robots.retreat_moves[i] -= 1
        if robots.retreat_moves[i]:
            return
        clear_right_of_way(world, i)
    replan(world, i)


@kernel
def stop_before_pod(world, i):
    """Robot i carries a load and would drive under a pod: it loses the tick and plans again."""
    robots = world.robots
    count_lost_tick(world, i, ACTION_BLOCKED)
    robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_BLOCKED
    if robots.retreat_moves[i] == 0 and world.rules.steered[0] == 0:
        replan(world, i)


@kernel
def stop_at_gate(world, i):
    """A gate blocks robot i: it loses the tick and tries again in the next one."""
    robots = world.robots
    count_lost_tick(world, i, ACTION_GATE)
    robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_BLOCKED
    robots.retry_state[i] = RETRY_NONE
    if world.rules.steered[0]:
        return
    if robots.route_index[i] >= robots.route_length[i]:
        if robots.retreat_moves[i] == 0:
            replan(world, i)
    elif note_closing(world, i):
        request_route(world, i, REASON_AROUND_CLOSED)


@kernel
def stands_in_queue(world, i):
    """Whether robot i is blocked by the queue of its station or by the station; then no wait
    begins.

    A robot that only the queue moves counts as queueing, whatever the robot ahead does there.
    """
    if not has_trips(world) or world.traffic.intent[i] == NO_TURN:
        return False
    if world.rules.steered[0] and is_in_own_queue(world, i):
        return True
    direction = np.int64(world.traffic.intent[i]) & 3
    return is_queueing_at_station(world, i, world.robots.cell[i] + world.grid.offset[direction])


@kernel
def count_in_station_queue(world, i):
    """Robot i loses this tick in the queue of its station."""
    stations, tick = world.pod_stations, world.clock.tick
    station = np.int64(stations.station_at[world.robots.goal_cell[i]])
    if station == NIL:
        return
    if stations.waiting_at[station] != tick:
        stations.waiting_at[station] = tick
        stations.waiting[station] = 0
    stations.waiting[station] += 1
    stations.queue_ticks[station] += world.rules.stride
    stations.longest_queue[station] = max(
        stations.longest_queue[station], stations.waiting[station]
    )


@kernel
def refused(world, record, i):
    """A planned move, or the turn before it, was refused: wait, then retry, then ask right of way."""
    robots, wait = world.robots, world.rules.wait
    if stands_in_queue(world, i):
        count_lost_tick(world, i, ACTION_STATION_QUEUE)
        count_in_station_queue(world, i)
        robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_BLOCKED
        robots.retry_state[i] = RETRY_NONE
    elif robots.route_index[i] >= robots.route_length[i]:
        count_lost_tick(world, i, ACTION_BLOCKED)  # a refused step costs the tick
        robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_BLOCKED
        if robots.retreat_moves[i] == 0 and world.rules.steered[0] == 0:
            replan(world, i)
    elif robots.retry_state[i] == RETRY_WAITED:
        count_lost_tick(world, i, ACTION_BLOCKED)
        robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_BLOCKED
        robots.failed_retries[i] = min(np.int64(robots.failed_retries[i]) + 1, 255)
        robots.retry_state[i] = RETRY_NONE
        if robots.failed_retries[i] >= wait[4]:
            robots.retry_state[i] = RETRY_EXHAUSTED
            request_right_of_way(world, i)
    else:
        first = 2 if robots.load[i] != NIL else 0
        identity = np.int64(robots.identity[i])
        low, high = np.int64(wait[first]), np.int64(wait[first + 1])
        ticks = random_ticks(world, low, high, STREAM_WAITS, identity)
        begin(world, i, ACTION_WAIT, ticks)
        robots.busy[i] = ticks - 1  # motion of this tick is over
        robots.retry_state[i] = RETRY_WAITED
        robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_WAIT
        record_change(world.clock, record, CHANGE_DURATION, identity, ticks)


# How long a move takes where zones, speed limits or random delays slow robots down.
#
# A MOVE that starts in a zone with m robots takes m times as long (Bhattathiri, Li & Kuhl). m is
# the number of robots in the zone when the tick began; each robot counts in the cell where it
# stands or that it leaves, and the mover always counts. Cells outside zones do not slow robots
# down. A speed limit applies before the zone multiplies; a random extra tick is added last.


@kernel
def count_robots(grid, robots, zone_occupancy):
    """crowd[zone] = robots in it; call before anything moves or leaves its parking bay."""
    zone_occupancy[:] = 0
    for i in range(robots.cell.shape[0]):
        cell = np.int64(robots.cell[U(i)])
        if cell != NIL:
            traffic_zone = np.int64(
                grid.traffic_zone[U(cell), U(np.int64(robots.travel[U(i)]) >> 1)]
            )
            if traffic_zone != NIL:
                zone_occupancy[U(traffic_zone)] += 1


@kernel
def set_move_ticks(world):
    """Set traffic.move_ticks of every move intended in this tick."""
    traffic = world.traffic
    for i in range(world.robots.cell.shape[0]):
        intent = np.int64(traffic.intent[U(i)])
        if intent & LIVE:
            traffic.move_ticks[U(i)] = min(ticks_of_move(world, i, intent), MAX_BUSY)


@kernel
def ticks_of_move(world, i, intent):
    """Ticks of a move of robot i that starts now."""
    rules = world.rules
    usual = np.int64(rules.duration[U(world.robots.type[U(i)]), U(ACTION_MOVE)])
    ticks = limited_ticks(world.grid, usual, np.int64(world.robots.cell[U(i)]), intent & 3)
    if rules.slowdown:
        ticks *= robots_in_zone(world, i, intent)
    if rules.extra_tick:
        identity = world.robots.identity[U(i)]
        tick = world.clock.coarse_tick
        bits = random_bits(rules.seed, STREAM_EXTRA_TICKS, tick, identity)
        ticks += rules.refinement if np.int64(bits >> np.uint64(32)) < rules.extra_tick else 0
    return ticks


@kernel
def robots_in_zone(world, i, intent):
    """Number of robots that slow a move of robot i out of its cell, including itself; 1 outside
    zones."""
    cell = np.int64(world.robots.cell[U(i)])
    traffic_zone = np.int64(world.grid.traffic_zone[U(cell), U((intent & 3) >> 1)])
    if traffic_zone == NIL:
        return 1
    came = np.int64(world.grid.traffic_zone[U(cell), U(np.int64(world.robots.travel[U(i)]) >> 1)])
    counted = came == traffic_zone and intent & ENTERED == 0
    return np.int64(world.traffic.zone_occupancy[U(traffic_zone)]) + (0 if counted else 1)
