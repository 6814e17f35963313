"""Where a robot would go: its options in the order in which it prefers them."""

import numpy as np

from automaton.engine.facilities import MAY_TURN
from automaton.engine.robot_status import STATUS_EXHAUSTED
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_TURN,
    CLOCK_TICK,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PICK,
    NIL,
)
from automaton.strategy.kernels import (
    UNREACHABLE,
    cost_at,
    fetch_cost,
    kernel,
    lane_of,
    splitmix64,
    table_of,
)
from strategies.right_of_way.pibt.pibt_state import LEAVING, STAY, UNDECIDED

KEY_SHIFT = 8  # ticks stand above the bits that settle ties
TURN_BIT = 128
STAY_BITS = 192
AHEAD = 8  # robots
LONG = 100_000  # ticks: of a robot that stands for longer than one waits


@kernel
def turns_to(headings, heading, direction):
    """Turns of 90 degrees from a heading to a direction."""
    difference = (direction - heading) & (headings - 1)
    return 1 if difference == 3 else difference


@kernel
def resource_in(view, cell, direction):
    """What a robot travelling in a direction takes of a cell, NIL where there is no limit."""
    lane = lane_of(np.int64(view.grid.cell_flags[cell]), direction)
    return NIL if lane == NIL else cell + lane * view.grid.cell_flags.shape[0]


@kernel
def holder_of(view, cell, direction):
    """The robot that holds this resource now, or NIL."""
    lane = lane_of(np.int64(view.grid.cell_flags[cell]), direction)
    if lane == NIL:
        return np.int64(NIL)
    identity = np.int64(view.traffic.holder[cell, lane])
    return np.int64(NIL) if identity == NIL else np.int64(view.robots.at_index[identity])


@kernel
def remaining_ticks(view, state, u):
    """Ticks until robot u, which does not take part in this tick's decisions, leaves its cell."""
    robots = view.robots
    if robots.status[u] > STATUS_EXHAUSTED:
        until = np.int64(robots.status_until[u]) - view.clock[CLOCK_TICK]
        return until if 0 < until < LONG else LONG
    if robots.busy[u] or state.mode[u] == LEAVING:
        return np.int64(robots.busy[u])
    duration = view.rules.duration[robots.type[u]]
    if robots.goal_type[u] == GOAL_PICK:
        return np.int64(duration[ACTION_PICK])
    if robots.goal_type[u] == GOAL_DROP:
        return np.int64(duration[ACTION_DROP])
    return np.int64(LONG if robots.goal_type[u] == GOAL_CHARGE else 1)


@kernel
def is_lane_free(view, state, i):
    """Whether robot i can turn where it is: in a cell for two it takes both lanes."""
    cell, travel = np.int64(view.robots.cell[i]), np.int64(view.robots.travel[i])
    if (np.int64(view.grid.cell_flags[cell]) >> 5) & 3 != 2:
        return True
    if holder_of(view, cell, travel ^ 2) != NIL:
        return False
    word = state.reserved[resource_in(view, cell, travel ^ 2)]
    return word >> 32 != view.clock[CLOCK_TICK]


@kernel
def waits_in_vain_to_turn(view, state, i):
    """Whether robot i cannot turn in a cell for two because another robot will not leave it.

    Two that both want to turn there would wait for each other for ever: they drive on and turn later.
    """
    cell, travel = np.int64(view.robots.cell[i]), np.int64(view.robots.travel[i])
    if (np.int64(view.grid.cell_flags[cell]) >> 5) & 3 != 2:
        return False
    u = holder_of(view, cell, travel ^ 2)
    if u == NIL or u == i:
        return False
    if state.mode[u] <= LEAVING:
        return remaining_ticks(view, state, u) >= LONG
    first = np.int64(state.options[u, 0])
    heading = np.int64(view.robots.heading[u])
    return first == STAY or turns_to(view.grid.headings, heading, first) > 0


@kernel
def rank_all_options(view, state, workspace):
    """Enter the options of all robots that choose; tables are looked for a little ahead of their use."""
    n = view.robots.cell.shape[0]
    for i in range(min(AHEAD, n)):
        find_table(view, state, workspace, i)
    for i in range(n):
        if i + AHEAD < n:
            find_table(view, state, workspace, i + AHEAD)
        if state.mode[i] == UNDECIDED and view.robots.cell[i] != NIL:
            rank_options(view, state, workspace, i)


@kernel
def find_table(view, state, workspace, i):
    """Enter the table to the goal of robot i, if it chooses, and ask for what will be read of it."""
    robots = view.robots
    if state.mode[i] != UNDECIDED or robots.cell[i] == NIL:
        return
    state.table[i] = NIL
    if robots.goal_type[i] == GOAL_NONE:
        return
    cell, goal = np.int64(robots.cell[i]), np.int64(robots.goal_cell[i])
    table = table_of(view, workspace, np.int64(robots.type[i]), goal)
    state.table[i] = table
    for direction in range(1, 4, 2):  # those to the east and west lie beside its own
        fetch_cost(view, workspace, table, cell + view.grid.offset[direction])
    fetch_cost(view, workspace, table, cell)


@kernel
def rank_options(view, state, workspace, i):
    """Enter the options of robot i, best first; the one that it has turned to is the first of all."""
    robots, grid = view.robots, view.grid
    cell, heading = np.int64(robots.cell[i]), np.int64(robots.heading[i])
    robot_type, mask = np.int64(robots.type[i]), grid.headings - 1
    duration = view.rules.duration[robot_type]
    flags = np.int64(grid.type_cell_flags[robot_type, cell])
    goal = np.int64(robots.goal_cell[i]) if robots.goal_type[i] != GOAL_NONE else np.int64(NIL)
    draws = splitmix64(
        np.uint64(view.rules.seed)
        ^ (np.uint64(view.clock[CLOCK_TICK]) << np.uint64(32) | np.uint64(robots.identity[i]))
    )
    leaves = goal == NIL and has_to_leave(state, cell)
    may_turn = flags & MAY_TURN != 0
    table = np.int64(state.table[i])
    here = np.int64(0) if table == NIL else cost_at(view, workspace, table, cell, heading)
    state.keys[0] = ((here + 1) << KEY_SHIFT) | STAY_BITS
    state.options[i, 0] = STAY
    count = 1
    for direction in range(4):
        turns = turns_to(grid.headings, heading, direction)
        if (flags >> direction) & 1 == 0 or (turns and not may_turn):
            continue
        to = cell + grid.offset[direction]
        cost = turns * np.int64(duration[ACTION_TURN]) + np.int64(duration[ACTION_MOVE])
        if table != NIL:
            cost += cost_at(view, workspace, table, to, direction & mask)
        elif not (leaves and direction == state.way_out[cell]):
            cost += 1
        else:
            cost = np.int64(0)
        if cost >= UNREACHABLE:
            continue
        u = holder_of(view, to, direction)
        if u != NIL and u != i and state.mode[u] <= LEAVING:
            cost += remaining_ticks(view, state, u)
        tie = np.int64(direction)  # where there is room for all, as routes do
        if resource_in(view, to, direction) != NIL:
            tie = np.int64((draws >> np.uint64(8 * direction)) & np.uint64(63))
        key = (cost << KEY_SHIFT) | tie | (TURN_BIT if turns else 0)
        if state.turning[i] and to == state.next[i]:
            key = np.int64(NIL)
        count = insert_option(state, i, count, key, direction)
    state.option_count[i] = count
    state.option_next[i] = 0


@kernel
def has_to_leave(state, cell):
    """Whether a robot without a goal stands in a dead end that others want into."""
    return state.dead_end[cell] != NIL and state.callers[state.dead_end[cell]] > 0


@kernel
def insert_option(state, i, count, key, option):
    """Insert an option by its key; returns how many there are."""
    at = count
    while at > 0 and state.keys[at - 1] > key:
        state.keys[at] = state.keys[at - 1]
        state.options[i, at] = state.options[i, at - 1]
        at -= 1
    state.keys[at] = key
    state.options[i, at] = option
    return count + 1
