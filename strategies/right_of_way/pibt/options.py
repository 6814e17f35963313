"""The options of a robot in order of preference, including detours."""

import numpy as np

from automaton.strategy.api import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_TURN,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    MAY_TURN,
    NIL,
    STATUS_EXHAUSTED,
    UNREACHABLE,
    closed_until,
    cost_in,
    cost_unit,
    find_step_costs,
    guiding_table_of,
    guiding_tables,
    has_gates,
    has_room_for,
    headings_of,
    kernel,
    limited_ticks,
    move_cost,
    splitmix64,
    weighted_table_of,
    with_load,
)
from strategies.right_of_way.pibt.pibt_state import (
    LONG_WAIT,
    MODE_DECIDED,
    MODE_LEAVING,
    MODE_UNDECIDED,
    NO_OPTION,
    OPTION_BITS,
    STAY_OPTION,
    U,
    clears_aisle,
    has_to_leave,
    holder_of,
    is_for_two,
    resource_in,
)
from strategies.right_of_way.pibt.ways_back import price_ways_back
from strategies.right_of_way.steering import (
    AGAINST_STREET,
    is_needed,
    may_not_go_home,
    steps_aside,
    way_to_make_room,
)

KEY_SHIFT = 8  # ticks are above the tie-breaking bits
TURN_BIT = 128
STAY_BITS = 192
FIXED_TIES = 0x3021  # ranks of east (lowest digit), south, west, north: west comes first
NO_KEY = (1 << 62) - 1  # the key of an unavailable option


@kernel
def rank_all_options(view, state, workspace):
    """Set the options of all robots that choose."""
    mark_fixed(view, state, 1)
    price_all_steps(view, state, workspace)
    price_ways_back(view, state)
    for i in range(view.robots.cell.shape[0]):
        if state.mode[U(i)] == MODE_UNDECIDED and view.robots.cell[U(i)] != NIL:
            rank_options(view, state, workspace, i)
    mark_fixed(view, state, 0)


@kernel
def mark_fixed(view, state, value):
    """Write a value at the cells of all robots that do not choose."""
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        if state.mode[U(i)] <= MODE_LEAVING and robots.cell[U(i)] != NIL:
            state.holds_fixed[U(robots.cell[U(i)])] = value
            if robots.claim[U(i)] != NIL:
                state.holds_fixed[U(robots.claim[U(i)])] = value


@kernel
def price_all_steps(view, state, workspace):
    """Set the costs of the steps of robots that choose.

    Distance tables are far apart in memory, so the costs of a robot are cached while it stands: half of
    10,000 robots do (`automaton bench --only steering`). If tables can be replaced, all are requested in
    each tick, so that a lack of room for tables shows at once.
    """
    robots = view.robots
    n, count = robots.cell.shape[0], 0
    tables = tables_in_use(state, workspace)
    keeps_all = has_room_for(tables, n)
    for i in range(n):
        cell, goal = robots.cell[U(i)], robots.goal_cell[U(i)]
        chooses = (state.mode[U(i)] == MODE_UNDECIDED) & (cell != NIL)
        known = (state.priced_cell[U(i)] == cell) & (state.priced_goal[U(i)] == goal)
        has_goal = robots.goal_type[U(i)] != GOAL_NONE
        state.unpriced[U(count)] = i
        count += np.int64(chooses) & (1 - np.int64(known & keeps_all & has_goal))
    for k in range(count):
        find_table(view, state, workspace, np.int64(state.unpriced[U(k)]))
    find_step_costs(view, tables, state.unpriced, count, state.table, state.costs)
    for k in range(count):
        i = np.int64(state.unpriced[U(k)])
        if robots.goal_type[U(i)] == GOAL_NONE:
            price_idle_steps(view, state, i)
        elif state.guided:
            add_street_costs(view, state, i)
    if state.dead_ends or state.service_areas.callers.shape[0] or state.aisle.shape[0]:
        price_ways_out(view, state)


@kernel
def find_table(view, state, workspace, i):
    """Set the distance table to the goal of robot i."""
    robots = view.robots
    state.priced_cell[U(i)] = robots.cell[U(i)]
    state.priced_goal[U(i)] = robots.goal_cell[U(i)]
    table = np.int64(NIL)
    if robots.goal_type[U(i)] != GOAL_NONE:
        goal = np.int64(robots.goal_cell[U(i)])
        robot_type = with_load(view, np.int64(robots.type[U(i)]))  # no path through storage
        if state.guided:
            table = weighted_table_of(view, state.tables, robot_type, goal)
        else:
            table = guiding_table_of(view, workspace, robot_type, goal)
    state.table[U(i)] = table


@kernel
def tables_in_use(state, workspace):
    return state.tables if state.guided else guiding_tables(workspace)


@kernel
def add_street_costs(view, state, i):
    """Add the extra costs of robot i's steps against streets."""
    cell = np.int64(view.robots.cell[U(i)])
    for direction in range(4):
        if state.costs[U(i), U(direction)] < UNREACHABLE:
            state.costs[U(i), U(direction)] += street_cost(view, state, i, cell, direction)


@kernel
def street_cost(view, state, i, cell, direction):
    """The extra cost of a move of robot i out of a cell; 0 along streets."""
    if not state.guided or not state.against[U(cell), U(direction)]:
        return np.int64(0)
    usual = view.rules.duration[U(view.robots.type[U(i)])][U(ACTION_MOVE)]
    return (AGAINST_STREET - 1) * limited_ticks(view.grid, usual, cell, direction)


@kernel
def price_ways_out(view, state):
    """Robots that drive home into a needed area have no goal in this tick."""
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        if robots.goal_type[U(i)] != GOAL_PARK or robots.cell[U(i)] == NIL:
            continue
        leaves = has_to_leave(view, state, i) or clears_aisle(view, state, i)
        if leaves or has_to_make_room(view, state, i):
            price_idle_steps(view, state, i)
            state.priced_cell[U(i)] = NIL


@kernel
def has_to_make_room(view, state, i):
    """Return whether robot i, driving home, is in a needed area or would park in one."""
    areas, cell = state.service_areas, np.int64(view.robots.cell[U(i)])
    return may_not_go_home(view, areas, i) or way_to_make_room(view, areas, i, cell) != NIL


@kernel
def price_idle_steps(view, state, i):
    """Set the costs of steps without a goal.

    All are equal, except the exit from a needed area, and steps into cells that others need.
    """
    cell, robot_type = np.int64(view.robots.cell[U(i)]), np.int64(view.robots.type[U(i)])
    flags = np.int64(view.grid.type_cell_flags[U(robot_type), U(cell)])
    unit, way_out = (
        cost_unit(view.grid),
        way_to_make_room(view, state.service_areas, i, cell),
    )
    if way_out == NIL and has_to_leave(view, state, i):
        way_out = np.int64(state.way_out[U(cell)])
    elif way_out == NIL and clears_aisle(view, state, i):
        way_out = np.int64(state.aisle_way_out[U(cell)])
    for direction in range(4):
        cost = unit if (flags >> direction) & 1 else UNREACHABLE
        if direction == way_out and cost == unit:
            cost = -cost_of_step(view, i, direction)
        elif cost == unit and is_needed(state.service_areas, cell + view.grid.offset[U(direction)]):
            cost = unit * LONG_WAIT
        state.costs[U(i), U(direction)] = cost


@kernel
def rank_options(view, state, workspace, i):
    """Set the options of robot i, best first; the one that it has turned to is always first.

    Staying costs the best step plus the ticks until the robot may choose again. Each key ends with its
    option. The five keys are sorted without branches, since the processor cannot predict the best one.
    """
    robots = view.robots
    state.asks[U(i)] = 0
    draws = splitmix64(
        np.uint64(view.rules.seed)
        ^ (np.uint64(view.clock.coarse_tick) << np.uint64(32) | np.uint64(robots.identity[U(i)]))
    )
    east, a = key_of(view, state, i, 0, draws)
    south, b = key_of(view, state, i, 1, draws)
    west, c = key_of(view, state, i, 2, draws)
    north, d = key_of(view, state, i, 3, draws)
    has_goal = robots.goal_type[U(i)] != GOAL_NONE
    here = min(min(a, b), min(c, d)) if has_goal else np.int64(0)
    if is_beside_fixed(view, state, i) or is_on_detour(view, state, i):
        if has_goal and here < UNREACHABLE:
            enter_waits(view, state, i, here)
            here = compare_detours(view, state, workspace, i, here, (a, b, c, d))
        else:
            enter_waits(view, state, i, UNREACHABLE)
        waits = state.waits
        east, south = with_wait(east, waits[0]), with_wait(south, waits[1])
        west, north = with_wait(west, waits[2]), with_wait(north, waits[3])
    stay = (
        (((here + cost_of_staying(view, i, has_goal)) << KEY_SHIFT) | STAY_BITS) << OPTION_BITS
    ) | STAY_OPTION
    if state.deadlocks.aside[U(i)] and steps_aside(view, state.deadlocks, i):
        barred, stay = np.int64(state.deadlocks.aside[U(i)]) - 1, np.int64(NO_KEY)
        east, south = without(east, 0, barred), without(south, 1, barred)
        west, north = without(west, 2, barred), without(north, 3, barred)
    state.options[U(i)] = sorted_options(east, south, west, north, stay)
    state.option_next[U(i)] = 0


@kernel
def cost_of_staying(view, i, has_goal):
    """The cost of the ticks until robot i may choose again; without a goal it waits at no extra cost."""
    grid, stride = view.grid, np.int64(view.rules.stride)
    if grid.wait_weight.shape[0] == 0 or not has_goal:
        return stride * cost_unit(grid)
    return stride * np.int64(grid.wait_weight[U(view.robots.cell[U(i)])])


@kernel
def key_of(view, state, i, direction, draws):
    """The key of a step of robot i, NO_KEY if it is unavailable; and its cost."""
    robots, grid = view.robots, view.grid
    cell, robot_type = np.int64(robots.cell[U(i)]), np.int64(robots.type[U(i)])
    may_turn = np.int64(grid.type_cell_flags[U(robot_type), U(cell)]) & MAY_TURN != 0
    turns = turns_to(view, i, direction)
    after = np.int64(state.costs[U(i), U(direction)])
    is_open = (after < UNREACHABLE) & ((turns == 0) | may_turn)
    to = cell + grid.offset[U(direction)] * np.int64(is_open)
    cost = after + cost_of_step(view, i, direction)
    is_limited = resource_in(view, to, direction) != NIL
    tie = np.int64((draws >> np.uint64(8 * direction)) & np.uint64(63))
    tie = tie if is_limited else direction  # in cells with room for all, as routes do
    if state.fixed_ties:
        tie = np.int64((FIXED_TIES >> (4 * direction)) & 15)
    key = (cost << KEY_SHIFT) | tie | (TURN_BIT * np.int64(turns != 0))
    is_begun = state.begun[U(i)] == direction + 1
    key = ((NIL if is_begun else key) << OPTION_BITS) | direction
    return key if is_open else NO_KEY, cost if is_open else np.int64(UNREACHABLE)


@kernel
def cost_of_step(view, i, direction):
    """The cost of a step of robot i in a direction, and of the turns before it."""
    robots = view.robots
    duration = view.rules.duration[U(robots.type[U(i)])]
    turns = turns_to(view, i, direction)
    cell = np.int64(robots.cell[U(i)])
    move = move_cost(view.grid, duration[U(ACTION_MOVE)], cell, direction)
    return turns * cost_unit(view.grid) * np.int64(duration[U(ACTION_TURN)]) + move


@kernel
def turns_to(view, i, direction):
    """The number of 90-degree turns of robot i before it moves in a direction."""
    robots = view.robots
    mask = headings_of(view.grid, robots.type[U(i)]) - 1
    difference = (direction - np.int64(robots.heading[U(i)])) & mask
    return 1 if difference == 3 else difference


@kernel
def with_wait(key, wait):
    """The key of a step with the cost of waiting before it, unless the robot has turned to it."""
    if key < 0 or key == NO_KEY:
        return key
    return key + (wait << (KEY_SHIFT + OPTION_BITS))


@kernel
def without(key, direction, barred):
    """The key of a step, or NO_KEY in the forbidden direction."""
    return NO_KEY if direction == barred else key


@kernel
def sorted_options(a, b, c, d, e):
    """The options of five keys, that of the least key in the lowest bits; NO_OPTION after the last."""
    a, b = min(a, b), max(a, b)
    d, e = min(d, e), max(d, e)
    c, e = min(c, e), max(c, e)
    c, d = min(c, d), max(c, d)
    b, e = min(b, e), max(b, e)
    a, d = min(a, d), max(a, d)
    a, c = min(a, c), max(a, c)
    b, d = min(b, d), max(b, d)
    b, c = min(b, c), max(b, c)
    options = np.int64(NO_OPTION) << (5 * OPTION_BITS)
    options |= (a & NO_OPTION) | ((b & NO_OPTION) << OPTION_BITS)
    options |= ((c & NO_OPTION) << (2 * OPTION_BITS)) | ((d & NO_OPTION) << (3 * OPTION_BITS))
    return options | ((e & NO_OPTION) << (4 * OPTION_BITS))


@kernel
def option_of(state, i, place):
    """The option of robot i at a place, from 0; NO_OPTION after the last."""
    return (np.int64(state.options[U(i)]) >> (OPTION_BITS * place)) & NO_OPTION


@kernel
def waits_in_vain_to_turn(view, state, i):
    """Whether robot i wants to turn in a cell for two that another robot will not leave.

    Two robots that both want to turn there would wait for each other for ever, so they drive on and turn
    later.
    """
    cell, travel = np.int64(view.robots.cell[i]), np.int64(view.robots.travel[i])
    if not is_for_two(view, cell) or turns_to(view, i, option_of(state, i, 0)) == 0:
        return False
    u = holder_of(view, cell, travel ^ 2)
    if u == NIL or u == i:
        return False
    if state.mode[u] <= MODE_LEAVING:
        return remaining_ticks(view, state, u) >= LONG_WAIT
    if state.mode[u] == MODE_DECIDED:
        return state.next[u] == cell
    first = option_of(state, u, 0)
    return first >= STAY_OPTION or turns_to(view, u, first) > 0


@kernel
def is_beside_fixed(view, state, i):
    """Whether a cell next to robot i is closed or has a robot that does not choose."""
    cell, offset, fixed = np.int64(view.robots.cell[U(i)]), view.grid.offset, state.holds_fixed
    east, south = fixed[U(cell + offset[0])], fixed[U(cell + offset[1])]
    if has_gates(view):
        for direction in range(4):
            if closed_until(view, cell + offset[U(direction)], True):
                return True
    return east | south | fixed[U(cell + offset[2])] | fixed[U(cell + offset[3])] != 0


@kernel
def ticks_until_free(view, state, i, cell, direction):
    """Ticks until a robot that does not choose leaves a cell to robot i; 0 without such a robot."""
    if has_gates(view) and closed_until(view, cell, True):
        return closed_until(view, cell, True) - view.clock.tick
    if state.holds_fixed[U(cell)] == 0:
        return np.int64(0)
    u = holder_of(view, cell, direction)
    if u == NIL or u == i or state.mode[U(u)] > MODE_LEAVING:
        return np.int64(0)
    return remaining_ticks(view, state, u)


@kernel
def remaining_ticks(view, state, u):
    """Ticks until robot u, which does not decide in this tick, leaves its cell."""
    robots = view.robots
    if robots.status[u] > STATUS_EXHAUSTED:
        until = np.int64(robots.status_until[u]) - view.clock.tick
        return until if 0 < until < LONG_WAIT else LONG_WAIT
    if robots.busy[u] or state.mode[u] == MODE_LEAVING:
        return np.int64(robots.busy[u])
    duration = view.rules.duration[robots.type[u]]
    if robots.goal_type[u] == GOAL_PICK:
        return np.int64(duration[ACTION_PICK])
    if robots.goal_type[u] == GOAL_DROP:
        return np.int64(duration[ACTION_DROP])
    return np.int64(LONG_WAIT if robots.goal_type[u] == GOAL_CHARGE else view.rules.stride)


# Detours around robots that do not make way, instead of waiting behind them.
#
# Distances to a goal ignore robots. If the next cell of a robot's best path is held by a robot that
# works, is down or charges, both staying and going on cost the ticks until that robot leaves. A step to
# the side is better if it costs less. A step whose best path leads back here only postpones the wait, so
# it costs as much as the wait, unless the wait is long: then any other exit is worth a try.
#
# The distances do not contain the obstacle. So the cell that the robot came from costs the rest of the
# wait, until the robot is nearer to its goal than before or the wait is over: it does not oscillate.


@kernel
def enter_waits(view, state, i, here):
    """Set the extra costs of robot i's steps; `here`: the cost of the best one."""
    follow_detour(view, state, i, here)
    cell = np.int64(view.robots.cell[U(i)])
    for direction in range(4):
        to = cell + view.grid.offset[U(direction)]
        state.waits[direction] = cost_unit(view.grid) * max(
            ticks_until_free(view, state, i, to, direction), wait_for_return(view, state, i, to)
        )


@kernel
def compare_detours(view, state, workspace, i, here, costs):
    """Rank steps off the best path of cost `here` by the wait they save; return the least cost."""
    wait = np.int64(UNREACHABLE)
    for direction in range(4):
        if costs[direction] == here:
            wait = min(wait, state.waits[direction])
    best = here + wait
    for direction in range(4):
        cost = costs[direction] + state.waits[direction]
        if costs[direction] > here and cost < here + wait:
            if is_long(view, wait) or leads_on(view, state, workspace, i, direction):
                best = min(best, cost)
            else:
                state.waits[direction] += wait
    if best < here + wait:
        begin_detour(view, state, i, here, wait)
    return best


@kernel
def is_on_detour(view, state, i):
    return state.detour_until[U(i)] > view.clock.tick


@kernel
def follow_detour(view, state, i, cost):
    """Store the cell that robot i left on a detour, or end the detour. `cost`: ticks to its goal."""
    robots = view.robots
    cell, goal = robots.cell[U(i)], robots.goal_cell[U(i)]
    if goal != state.detour_goal[U(i)] or cost < state.detour_cost[U(i)]:
        state.detour_until[U(i)] = 0
    elif cell != state.detour_cell[U(i)]:
        state.detour_from[U(i)] = state.detour_cell[U(i)]
        state.detour_cell[U(i)] = cell


@kernel
def begin_detour(view, state, i, cost, wait):
    """Begin a detour of robot i, since its best path costs `cost`, and the wait on it `wait` more."""
    if not is_on_detour(view, state, i):
        state.detour_from[U(i)] = view.robots.cell[U(i)]
        state.detour_cell[U(i)] = view.robots.cell[U(i)]
        state.detour_goal[U(i)] = view.robots.goal_cell[U(i)]
        state.detour_cost[U(i)] = cost
    until = view.clock.tick + wait // cost_unit(view.grid)
    state.detour_until[U(i)] = max(np.int64(state.detour_until[U(i)]), until)


@kernel
def wait_for_return(view, state, i, to):
    """The cost, in ticks, of robot i's return to the cell that it left on a detour."""
    if not is_on_detour(view, state, i) or to != state.detour_from[U(i)]:
        return np.int64(0)
    return state.detour_until[U(i)] - view.clock.tick


@kernel
def leads_on(view, state, workspace, i, direction):
    """Whether a best path of robot i, after a step in a direction, does not lead back."""
    grid, robot_type = view.grid, np.int64(view.robots.type[U(i)])
    duration = view.rules.duration[U(robot_type)]
    cell = np.int64(view.robots.cell[U(i)]) + grid.offset[U(direction)]
    if cell == view.robots.goal_cell[U(i)]:
        return True
    best = np.int64(state.costs[U(i), U(direction)])
    best -= street_cost(view, state, i, np.int64(view.robots.cell[U(i)]), direction)
    tables = tables_in_use(state, workspace)
    flags = np.int64(grid.type_cell_flags[U(robot_type), U(cell)])
    mask = headings_of(grid, robot_type) - 1
    for other in range(4):
        to = cell + grid.offset[U(other)]
        if other == direction ^ 2 or (flags >> other) & 1 == 0 or state.holds_fixed[U(to)]:
            continue
        after = np.int64(cost_in(tables, state.table[U(i)], to, other & mask))
        if after >= UNREACHABLE:
            continue
        turns = (other - direction) & mask
        turns = 1 if turns == 3 else turns
        step = turns * cost_unit(grid) * np.int64(duration[ACTION_TURN])
        step += move_cost(grid, duration[ACTION_MOVE], cell, other)
        step += street_cost(view, state, i, cell, other)
        if after + step <= best:
            return True
    return False


@kernel
def is_long(view, wait):
    return wait >= cost_unit(view.grid) * (LONG_WAIT // 2)
