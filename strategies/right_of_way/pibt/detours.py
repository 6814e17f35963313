"""When a robot goes round one that does not make way, instead of standing behind it.

Distances to a goal know no robots. Where the next cell of a robot's best way is held by one that works,
is down or charges, both staying and going on cost the ticks until that one is gone, and a step to the
side is better if it costs less. A step after which the best way leads back here only postpones the wait:
it costs as much, unless the wait is long (LONG), and any other way out is worth a try.

What a robot went round is not in the distances, so the cell that it came from costs the rest of the wait
until it is nearer to its goal than where it stood, or the wait is over: it does not turn back and forth.
"""

import numpy as np

from automaton.engine.state import ACTION_MOVE, ACTION_TURN, CLOCK_TICK
from automaton.strategy.kernels import UNREACHABLE, cost_in, headings_of, kernel, limited_ticks
from strategies.right_of_way.lattice import AGAINST_STREET
from strategies.right_of_way.pibt.pibt_state import LONG, U


@kernel
def is_on_detour(view, state, i):
    return state.detour_until[U(i)] > view.clock[CLOCK_TICK]


@kernel
def follow_detour(view, state, i, cost):
    """Note where robot i, on a detour, came from; or end it. `cost`: ticks to its goal."""
    robots = view.robots
    cell, goal = robots.cell[U(i)], robots.goal_cell[U(i)]
    if goal != state.detour_goal[U(i)] or cost < state.detour_cost[U(i)]:
        state.detour_until[U(i)] = 0
    elif cell != state.detour_cell[U(i)]:
        state.detour_from[U(i)] = state.detour_cell[U(i)]
        state.detour_cell[U(i)] = cell


@kernel
def begin_detour(view, state, i, cost, wait):
    """Robot i goes another way, as `wait` ticks on its best one, of `cost` ticks, are too many."""
    if not is_on_detour(view, state, i):
        state.detour_from[U(i)] = view.robots.cell[U(i)]
        state.detour_cell[U(i)] = view.robots.cell[U(i)]
        state.detour_goal[U(i)] = view.robots.goal_cell[U(i)]
        state.detour_cost[U(i)] = cost
    until = view.clock[CLOCK_TICK] + wait
    state.detour_until[U(i)] = max(np.int64(state.detour_until[U(i)]), until)


@kernel
def wait_for_return(view, state, i, to):
    """Ticks that going back to the cell that robot i left on a detour costs it."""
    if not is_on_detour(view, state, i) or to != state.detour_from[U(i)]:
        return np.int64(0)
    return state.detour_until[U(i)] - view.clock[CLOCK_TICK]


@kernel
def tables_in_use(state, workspace):
    return state.tables if state.guided else workspace.tables


@kernel
def street_cost(view, state, i, cell, direction):
    """What a move of robot i out of a cell costs beyond its ticks; 0 along streets."""
    if not state.guided or not state.against[U(cell), U(direction)]:
        return np.int64(0)
    usual = view.rules.duration[U(view.robots.type[U(i)])][U(ACTION_MOVE)]
    return (AGAINST_STREET - 1) * limited_ticks(view.grid, usual, cell, direction)


@kernel
def leads_on(view, state, workspace, i, direction):
    """Whether a best way of robot i, after a step in a direction, goes on without coming back."""
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
        step = turns * np.int64(duration[ACTION_TURN])
        step += limited_ticks(grid, duration[ACTION_MOVE], cell, other)
        step += street_cost(view, state, i, cell, other)
        if after + step <= best:
            return True
    return False


@kernel
def is_long(wait):
    return wait >= LONG // 2
