"""Operations of robots and requests to layers: the small steps used in every phase.

Operations with their ticks and charge; requests to the layers; routes and headings; progress of
orders; the rows of changes in a recording.
"""

import numpy as np

from automaton.engine.jit.kernel import U, kernel
from automaton.engine.record_codes import EXECUTED_ILLEGAL
from automaton.engine.refusals import (
    FIRST_REFUSALS,
    LATEST_REFUSALS,
    REFUSED_LOST,
    REFUSED_ROBOT,
    REFUSED_RULE,
    REFUSED_TICK,
    REFUSED_VALUE,
    RULE_BITS,
    RULE_ROUTE_DIRECTION,
    RULE_ROUTE_EXIT,
    RULE_ROUTE_LENGTH,
    RULE_ROUTE_TURN,
    STEP_BITS,
)
from automaton.engine.state import (
    ACTION_DELAYED,
    ACTION_FOLLOWING,
    ACTION_ILLEGAL,
    ACTION_MOVE,
    ACTION_TURN,
    ACTION_WAIT,
    GOAL_CHARGE,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_STOP,
    LOST_ACTIONS,
    MAY_TURN,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    PURPOSE_ASIDE,
    PURPOSE_CHARGER,
    PURPOSE_MAKING_WAY,
    PURPOSE_ORDER,
    REASON_AROUND_ROBOTS,
    REASON_IDLE,
    REASON_NEW_GOAL,
    REASON_PICKED,
    REASON_REPLAN,
    STATUS_EXHAUSTED,
    STATUS_UP,
    TRAIL_MOVES,
)


@kernel
def energy_cost(world, i, action, ticks):
    """Units of charge that an operation of robot i uses."""
    loaded = 1 if world.robots.load[i] != NIL else 0
    return ticks * np.int64(world.rules.drain[world.robots.type[i], action, loaded])


@kernel
def exhaust(world, i):
    """The battery of robot i is too low for its operation: it is down from the next tick on."""
    if world.robots.status[i] == STATUS_UP:
        world.clock.robots_down += 1
    if world.robots.status[i] <= STATUS_EXHAUSTED:
        world.robots.status[i] = STATUS_EXHAUSTED


@kernel
def consume_energy(world, i, units):
    """Take charge from the battery of robot i; if there is too little, it is empty and exhausted."""
    robots = world.robots
    taken = min(units, np.int64(robots.charge[i]))
    robots.charge[i] -= taken
    world.tally.energy_used[i] += taken
    if taken < units:
        exhaust(world, i)


@kernel
def take_on(world, i, order):
    """Robot i now carries a load, and drives as the loaded type."""
    world.robots.load[i] = order
    world.robots.type[i] += np.uint8(world.rules.loaded_types)


@kernel(inline=True)
def with_load(world, robot_type):
    """The loaded type of a robot type; to handle a load somewhere, both types must reach the cell."""
    more = world.rules.loaded_types
    return robot_type + more if robot_type < more else robot_type


@kernel(inline=True)
def without_load(world, robot_type):
    """The unloaded type of a robot type."""
    more = world.rules.loaded_types
    return robot_type - more if more and robot_type >= more else robot_type


@kernel
def types_of_robots(world):
    """Number of robot types, without the loaded types."""
    return world.rules.loaded_types or world.rules.duration.shape[0]


@kernel
def put_off(world, i):
    """Robot i no longer carries a load."""
    world.robots.load[i] = NIL
    world.robots.type[i] -= np.uint8(world.rules.loaded_types)


@kernel
def begin(world, i, action, ticks):
    """Robot i begins an operation of `ticks` ticks, including the current one; motion counts them
    down."""
    if world.rules.battery:
        consume_energy(world, i, energy_cost(world, i, action, ticks))
    loaded = 1 if world.robots.load[i] != NIL else 0
    world.robots.action[i] = action
    world.robots.busy[i] = ticks
    if action != ACTION_WAIT:
        world.tally.active[i] = world.clock.tick + ticks - 1
    world.tally.operations[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += ticks
    if action != ACTION_TURN:
        note_time(world, i, action, ticks)


@kernel
def count_lost_tick(world, i, action):
    """Count a tick in which robot i executes nothing, by reason; it begins nothing for a stride."""
    ticks = world.rules.stride
    if world.rules.battery:
        consume_energy(world, i, energy_cost(world, i, action, ticks))
    loaded = 1 if world.robots.load[i] != NIL else 0
    world.robots.action[i] = action
    world.tally.operations[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += ticks
    if world.robots.goal_type[i] == GOAL_CHARGE:
        note_time(world, i, action, ticks)


@kernel
def count_following(world, i, ticks):
    """Count ticks by which a robot ahead extends a move.

    They use charge like waiting, at most the remaining charge: a move that has begun is completed.
    """
    loaded = 1 if world.robots.load[i] != NIL else 0
    if world.rules.battery:
        units = energy_cost(world, i, ACTION_FOLLOWING, ticks)
        consume_energy(world, i, min(units, np.int64(world.robots.charge[i])))
    world.tally.ticks[i, ACTION_FOLLOWING, loaded] += ticks
    if world.robots.goal_type[i] == GOAL_CHARGE:
        world.time_use.to_charger[i, ACTION_FOLLOWING] += ticks


@kernel
def is_held_up(world, i):
    """Whether a delay stops robot i, between two operations or during one."""
    delays, robots = world.delays, world.robots
    if delays.until.shape[0] == 0 or robots.parked[U(i)]:
        return False
    if delays.until[U(robots.identity[U(i)])] < world.clock.tick:
        return False
    action = np.int64(robots.action[U(i)])
    return action == ACTION_DELAYED or delays.lengthens[U(action)] != 0


@kernel
def note_refusal(world, identity, rule, value, lost):
    """Count an illegal decision about a robot, or about none (NIL)."""
    refusals = world.refusals
    world.tally.illegal[rule >> RULE_BITS] += 1
    refusals.by_rule[rule] += 1
    total = refusals.count.total
    note_row(world, refusals.latest[total % LATEST_REFUSALS], identity, rule, value, lost)
    if total < FIRST_REFUSALS:
        note_row(world, refusals.first[total], identity, rule, value, lost)
    refusals.count.total = total + 1


@kernel
def note_row(world, row, identity, rule, value, lost):
    row[REFUSED_TICK] = world.clock.tick
    row[REFUSED_ROBOT] = identity
    row[REFUSED_RULE] = rule
    row[REFUSED_VALUE] = value
    row[REFUSED_LOST] = lost


@kernel
def refuse(world, i, rule, value):
    """An illegal decision: the robot waits for one tick, unless an operation is under way."""
    is_free = world.robots.busy[i] == 0
    note_refusal(world, np.int64(world.robots.identity[i]), rule, value, 1 if is_free else 0)
    if is_free:
        count_lost_tick(world, i, ACTION_ILLEGAL)
        world.robots.busy[i] = 1  # motion counts it down in this tick
        world.robots.executed[i] = EXECUTED_ILLEGAL


# Requests: which layers are asked about a robot, and why.


@kernel
def request_zoning(world):
    """An event for zoning: it is asked in this tick or the next one."""
    if world.service_zones.wake.shape[0]:
        world.clock.unqueued_orders += 1


@kernel
def request_allocation(world, i, reason):
    robots, clock = world.robots, world.clock
    if robots.need[i] & NEED_ALLOCATION == 0 or robots.seen_revision[i] >= 0:
        clock.fresh_allocation += 1
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
            world.clock.fresh_allocation -= 1
        else:
            world.tally.progress[i] = world.clock.tick  # it had nothing to do until now
        robots.need[i] &= np.uint8(255 - NEED_ALLOCATION)
    robots.seen_revision[i] = NIL


@kernel
def request_charging(world, i, reason):
    """Ask charging about robot i, if it has a battery."""
    robots = world.robots
    if world.rules.battery == 0:
        return
    if robots.need[i] & NEED_CHARGING == 0:
        world.clock.needing_charging += 1
    robots.need[i] |= np.uint8(NEED_CHARGING)
    robots.charging_reason[i] = reason


@kernel
def request_route(world, i, reason):
    """Ask routing about robot i; if right of way steers, there is no routing."""
    robots = world.robots
    drop_route(robots, i)
    if world.rules.steered[0]:
        return
    if robots.need[i] & NEED_ROUTE == 0:
        world.clock.needing_route += 1
    robots.need[i] |= np.uint8(NEED_ROUTE)
    robots.route_reason[i] = reason


@kernel
def request_right_of_way(world, i):
    if world.robots.need[i] & NEED_RIGHT_OF_WAY == 0:
        world.clock.needing_right_of_way += 1
    world.robots.need[i] |= np.uint8(NEED_RIGHT_OF_WAY)


@kernel
def clear_route_request(world, i):
    if world.robots.need[i] & NEED_ROUTE:
        world.clock.needing_route -= 1
        world.robots.need[i] &= np.uint8(255 - NEED_ROUTE)


@kernel
def clear_right_of_way(world, i):
    if world.robots.need[i] & NEED_RIGHT_OF_WAY:
        world.clock.needing_right_of_way -= 1
        world.robots.need[i] &= np.uint8(255 - NEED_RIGHT_OF_WAY)


@kernel
def drop_route(robots, i):
    """Delete the route: a stale plan must never be resumed."""
    robots.route_length[i] = 0
    robots.route_index[i] = 0
    robots.route_hash[i] = 0


@kernel
def first_cell(robots, i):
    """First cell of a new route of robot i: the cell that it enters, stands in, or through which it
    leaves its parking bay."""
    if robots.claim[i] != NIL:
        return np.int64(robots.claim[i])
    return np.int64(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])


@kernel
def replan(world, i):
    """Plan the same task again around the other robots; look for work if there is no task."""
    goal_type = world.robots.goal_type[i]
    if goal_type == GOAL_NONE or goal_type == GOAL_PARK:
        request_allocation(
            world, i, REASON_PICKED if world.robots.load[i] != NIL else REASON_REPLAN
        )
    if goal_type != GOAL_NONE:
        request_route(world, i, REASON_AROUND_ROBOTS)


@kernel
def set_goal(world, i, goal, goal_cell):
    note_goal(world, i)
    world.robots.goal_type[i] = goal
    world.robots.goal_cell[i] = goal_cell
    request_route(world, i, REASON_NEW_GOAL)


# Headings: each robot type distinguishes its own number of them.
#
#     omni           1: always heading 0; it moves in any direction at once
#     rail           2: its axis, 0 east and west, 1 south and north; it reverses freely
#     differential   4: the direction in which it moves, E S W N
#
# A robot can move in a direction that equals its heading, modulo its number of headings. On a floor
# with several kinematics the finest one numbers the poses: cell * grid.headings + heading.


@kernel
def headings_of(grid, robot_type):
    """How many headings robots of a type distinguish."""
    return np.int64(grid.type_headings[U(robot_type)])


@kernel
def heading_towards(grid, robot_type, direction):
    """The heading that a robot of a type needs to move in a direction."""
    return direction & (np.int64(grid.type_headings[U(robot_type)]) - 1)


@kernel
def is_facing(view, i, direction):
    """Whether robot i can move in a direction without a turn."""
    robots = view.robots
    return heading_towards(view.grid, robots.type[U(i)], direction) == robots.heading[U(i)]


@kernel
def entry_heading(grid, robot_type, cell):
    """Heading of a robot placed on the floor: vertical if the cell has an exit north or south."""
    cell_flags = np.int64(grid.cell_flags[cell])
    for direction in (1, 3, 0, 2):
        if (cell_flags >> direction) & 1:
            return heading_towards(grid, robot_type, direction)
    return np.int64(0)


@kernel
def route_flaw(world, i, steps, route_length):
    """The rule that a route breaks, or NIL, and a value: it starts at robot i, uses only exits open
    to it, and turns only where allowed."""
    grid, robots = world.grid, world.robots
    if route_length < 0 or route_length > steps.shape[0]:
        return np.int64(RULE_ROUTE_LENGTH), np.int64(route_length)
    type_cell_flags = grid.type_cell_flags[robots.type[i]]
    cell = first_cell(robots, i)
    heading = np.int64(robots.heading[i])
    for s in range(route_length):
        direction = np.int64(steps[s])
        flags = np.int64(type_cell_flags[cell])
        value = np.int64(s << STEP_BITS) | direction
        if direction > 3:
            return np.int64(RULE_ROUTE_DIRECTION), value
        if (flags >> direction) & 1 == 0:
            return np.int64(RULE_ROUTE_EXIT), value
        towards = heading_towards(grid, robots.type[i], direction)
        if towards != heading:
            if flags & MAY_TURN == 0:
                return np.int64(RULE_ROUTE_TURN), value
            heading = towards
        cell += grid.offset[direction]
    return np.int64(NIL), np.int64(0)


# Ticks of a move where the floor limits the speed of all robots.


@kernel(inline=True)
def limited_ticks(grid, usual, cell, direction):
    """Ticks of a move out of a cell in a direction that takes `usual` ticks without a limit."""
    limits = grid.min_move_ticks
    if limits.shape[0] == 0:
        return np.int64(usual)
    return max(np.int64(usual), np.int64(limits[np.uint64(4 * cell + direction)]))


# Progress of an order: its load, if any, and the remaining stops.


@kernel
def has_load(orders, order):
    """Whether an order has a load, which is picked up before its stops and dropped after them."""
    return orders.source[order] != NIL


@kernel
def is_assigned(view, i, order):
    """Whether robot i may do an order, if orders are assigned in advance."""
    if view.rules.assigned == 0:
        return True
    return order % view.robots.cell.shape[0] == view.robots.identity[i]


@kernel
def next_stop(world, order):
    """The next stop of an order among all stops, NIL if none is left."""
    stop = np.int64(world.orders.first_stop[order]) + np.int64(world.orders.stops_done[order])
    if stop == world.orders.first_stop[order + 1] or world.stops.cell[stop] == NIL:
        return np.int64(NIL)
    return stop


@kernel
def end_of_stops(world, order):
    """The end of the stops of an order, exclusive."""
    end = np.int64(world.orders.first_stop[order + 1])
    if world.trips.pod.shape[0]:
        stop = np.int64(world.orders.first_stop[order])
        while stop < end and world.stops.cell[stop] != NIL:
            stop += 1
        return stop
    return end


@kernel
def next_stop_cell(world, order):
    """The cell of the next stop of an order, NIL if none is left."""
    stop = next_stop(world, order)
    return np.int64(NIL) if stop == NIL else np.int64(world.stops.cell[stop])


@kernel
def drive_on_with_load(world, i, reason):
    """Robot i has a load: it drives to the next stop; after the last stop, allocation decides where."""
    cell = next_stop_cell(world, np.int64(world.robots.load[i]))
    if cell == NIL:
        request_allocation(world, i, reason)
    else:
        set_goal(world, i, GOAL_STOP, cell)


# The rows of changes in a recorded run.


MAX_CHANGES_PER_ROBOT = 13  # most rows that a robot may add in a tick


@kernel
def record_change(clock, record, code, subject, value):
    """Append a row of changes if the run is recorded."""
    if clock.recording:
        row = clock.change_rows
        record.changes[row, 0] = clock.tick
        record.changes[row, 1] = code
        record.changes[row, 2] = subject
        record.changes[row, 3] = value
        clock.change_rows = row + 1


# What robots use their time for: orders, the way to chargers, other ways, and making way for others.
#
# A move that leads back to the cell that the last moves came from undoes them, and a turn that the next
# move does not need leads nowhere: both are driven to make way, whatever right of way calls them. They
# are looked for among the last moves for one goal.


@kernel
def note_time(world, i, action, ticks):
    """Enter what ticks of an action are for; moves and turns for an order are not entered here."""
    goal, use = world.robots.goal_type[U(i)], world.time_use
    purpose = PURPOSE_ORDER
    if goal == GOAL_CHARGE:
        purpose = PURPOSE_CHARGER
        use.to_charger[U(i), U(action)] += ticks
        charger = charger_of(world, i)
        if charger != NIL and (LOST_ACTIONS >> action) & 1:
            world.chargers.queue_ticks[U(charger)] += ticks
    elif (goal == GOAL_NONE or goal == GOAL_PARK) and (
        action == ACTION_MOVE or action == ACTION_TURN
    ):
        purpose = PURPOSE_ASIDE
        use.aside[U(i)] += ticks
    use.purpose[U(i)] = purpose


@kernel
def charger_of(world, i):
    """The charger that is the goal of robot i, or NIL."""
    goal = np.int64(world.robots.goal_cell[U(i)])
    return np.int64(NIL) if goal == NIL else np.int64(world.chargers.charger_at[U(goal)])


@kernel
def note_move(world, i, direction, ticks):
    """Enter what a move of robot i is for, which has begun or, of one tick, is over."""
    robots, use = world.robots, world.time_use
    goal = robots.goal_type[U(i)]
    if goal == GOAL_CHARGE or goal == GOAL_NONE or goal == GOAL_PARK:
        note_time(world, i, ACTION_MOVE, ticks)
        return
    if use.turned[U(i)]:
        settle_turns(world, i)
    entered = np.int64(robots.cell[U(i)] if robots.claim[U(i)] == NIL else robots.claim[U(i)])
    top, depth = np.int64(use.trail_top[U(i)]), np.int64(use.trail_depth[U(i)])
    if depth and use.trail[U(i), U(top)] == entered:
        there = np.int64(use.trail_ticks[U(i), U(top)])
        use.making_way[U(i)] += there + ticks
        use.undone[U(use.trail_period[U(i), U(top)])] += there
        use.purpose[U(i)] = PURPOSE_MAKING_WAY
        use.trail_top[U(i)] = (top - 1) & (TRAIL_MOVES - 1)
        use.trail_depth[U(i)] = depth - 1
        return
    top = (top + 1) & (TRAIL_MOVES - 1)
    use.purpose[U(i)] = PURPOSE_ORDER
    use.trail[U(i), U(top)] = entered - world.grid.offset[U(direction)]
    use.trail_ticks[U(i), U(top)] = ticks
    use.trail_period[U(i), U(top)] = use.period[U(0)]
    use.trail_top[U(i)] = top
    use.trail_depth[U(i)] = min(depth + 1, TRAIL_MOVES)


@kernel
def note_turn(world, i, ticks):
    """Enter what a turn of robot i is for; call before it has another heading."""
    note_time(world, i, ACTION_TURN, ticks)
    use = world.time_use
    if use.purpose[U(i)] == PURPOSE_ORDER:
        if use.turned[U(i)] == 0:
            use.turned_from[U(i)] = world.robots.heading[U(i)]
        use.turned[U(i)] += ticks


@kernel
def settle_turns(world, i):
    """Of the turns since the last move, those beyond the change of heading were made to make way."""
    robots, use = world.robots, world.time_use
    if use.turned[U(i)] == 0:
        return
    headings = np.int64(world.grid.type_headings[U(robots.type[U(i)])])
    change = (np.int64(robots.heading[U(i)]) - np.int64(use.turned_from[U(i)])) & (headings - 1)
    turns = min(change, headings - change)
    needed = turns * np.int64(world.rules.duration[U(robots.type[U(i)]), U(ACTION_TURN)])
    use.making_way[U(i)] += max(np.int64(use.turned[U(i)]) - needed, 0)
    use.turned[U(i)] = 0


@kernel
def note_goal(world, i):
    """Robot i gets another goal: no move for it undoes one for the goal before."""
    settle_turns(world, i)
    world.time_use.trail_depth[U(i)] = 0


@kernel
def note_delay(world, i, ticks):
    """What robot i is doing takes longer, for the same purpose."""
    use, purpose = world.time_use, world.time_use.purpose[U(i)]
    if purpose == PURPOSE_CHARGER:
        use.to_charger[U(i), U(world.robots.action[U(i)])] += ticks
    elif purpose == PURPOSE_ASIDE:
        use.aside[U(i)] += ticks
    elif purpose == PURPOSE_MAKING_WAY:
        use.making_way[U(i)] += ticks
    world.tally.active[U(i)] += ticks
