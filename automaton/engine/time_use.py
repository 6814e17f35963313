"""What robots use their time for: orders, the way to chargers, other ways, and making way for others.

A move that leads back to the cell that the last moves came from undoes them, and a turn that the next
move does not need leads nowhere: both are driven to make way, whatever right of way calls them. They
are looked for among the last moves for one and the same goal.
"""

import numpy as np

from automaton.engine.jit.kernel import U, kernel
from automaton.engine.state import (
    ACTION_MOVE,
    ACTION_TURN,
    GOAL_CHARGE,
    GOAL_NONE,
    GOAL_PARK,
    LOST_ACTIONS,
    NIL,
    PURPOSE_ASIDE,
    PURPOSE_CHARGER,
    PURPOSE_MAKING_WAY,
    PURPOSE_ORDER,
    TRAIL_MOVES,
)


@kernel
def note_time(world, i, action, ticks):
    """Enter what ticks of an action are for; moves and turns for an order are not entered here."""
    goal, use = world.robots.goal_type[U(i)], world.time_use
    purpose = PURPOSE_ORDER
    if goal == GOAL_CHARGE:
        purpose = PURPOSE_CHARGER
        use.to_charger[U(i), U(action)] += ticks
        if (LOST_ACTIONS >> action) & 1:
            charger = world.chargers.charger_at[U(world.robots.goal_cell[U(i)])]
            world.chargers.queue_ticks[charger] += ticks
    elif (goal == GOAL_NONE or goal == GOAL_PARK) and (
        action == ACTION_MOVE or action == ACTION_TURN
    ):
        purpose = PURPOSE_ASIDE
        use.aside[U(i)] += ticks
    use.purpose[U(i)] = purpose


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
        use.making_way[U(i)] += 2 * ticks  # there and back
        use.purpose[U(i)] = PURPOSE_MAKING_WAY
        use.trail_top[U(i)] = (top - 1) & (TRAIL_MOVES - 1)
        use.trail_depth[U(i)] = depth - 1
        return
    top = (top + 1) & (TRAIL_MOVES - 1)
    use.purpose[U(i)] = PURPOSE_ORDER
    use.trail[U(i), U(top)] = entered - world.grid.offset[U(direction)]
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


@kernel
def count_waiting_for_chargers(world):
    """Enter the longest queue of each charger: robots that stand on the way to it, wherever."""
    robots, chargers = world.robots, world.chargers
    chargers.waiting[:] = 0
    for i in range(robots.cell.shape[0]):
        if robots.goal_type[U(i)] == GOAL_CHARGE and robots.cell[U(i)] != robots.goal_cell[U(i)]:
            if (LOST_ACTIONS >> np.int64(robots.action[U(i)])) & 1:
                chargers.waiting[chargers.charger_at[U(robots.goal_cell[U(i)])]] += 1
    for charger in range(chargers.cell.shape[0]):
        longest = max(chargers.longest_queue[charger], chargers.waiting[charger])
        chargers.longest_queue[charger] = longest


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
