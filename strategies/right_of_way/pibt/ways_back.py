"""One-shot problems: robots that were pushed off their targets return to them.

The tables of distances do not contain robots, so the way back is searched in each tick, from the target
over all cells: to push a robot from its target costs PUSH_MOVES moves more, in addition to the move. With
two lengths of steps, two queues keep the cells in the order of their costs (Dijkstra's method without a
heap).

Robots whose targets are in one narrow aisle, and that entered it in the wrong order, would still push
each other for ever. So the robot with the innermost target goes first: robots whose targets are nearer
to an end of the aisle leave for it, and wait outside. Dead ends have the same rule (pibt_state).
"""

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    GOAL_NONE,
    GOAL_PARK,
    NIL,
    STOP_ON_TARGETS,
    UNREACHABLE,
    cost_unit,
    kernel,
)
from strategies.right_of_way.pibt.pibt_state import MODE_UNDECIDED, U, clears_aisle

PUSH_MOVES = 64
FAR = 1 << 14  # moves from a cell without a way, into which the robot may still be pushed
STANDS = 2  # in holds_fixed, next to 1 for robots that do not choose


@kernel
def price_ways_back(view, state):
    """Set the costs of the steps of robots that were pushed off their targets."""
    if view.rules.stop != STOP_ON_TARGETS:
        return
    robots = view.robots
    mark_standing(view, state, STANDS)
    for i in range(robots.cell.shape[0]):
        if robots.goal_type[U(i)] != GOAL_PARK or robots.cell[U(i)] == NIL:
            continue
        is_away = robots.cell[U(i)] != robots.goal_cell[U(i)] and not clears_aisle(view, state, i)
        if state.mode[U(i)] == MODE_UNDECIDED and is_away:
            search_way_back(view, state, i, np.int64(state.aisle[U(robots.home[U(i)])]))
            if state.moves_back[U(robots.cell[U(i)])] == UNREACHABLE:
                search_way_back(view, state, i, np.int64(NIL))
            price_steps_back(view, state, i)
    mark_standing(view, state, 0)


@kernel
def mark_standing(view, state, value):
    """Write a value at the cells of robots that stand on their targets, and may be pushed."""
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        cell = robots.cell[U(i)]
        stands = robots.goal_type[U(i)] == GOAL_NONE and cell != NIL and cell == robots.home[U(i)]
        if stands and state.mode[U(i)] == MODE_UNDECIDED:
            state.holds_fixed[U(cell)] = value


@kernel
def search_way_back(view, state, i, own_aisle):
    """Set `moves_back`: the moves from each cell to the target of robot i, or UNREACHABLE.

    No way leads through robots on their targets in the aisle of its target: they entered it first.
    """
    grid, moves, first, later = view.grid, state.moves_back, state.next_cells, state.later_cells
    flags = grid.type_cell_flags[U(view.robots.type[U(i)])]
    moves[:] = UNREACHABLE
    first[0] = view.robots.goal_cell[U(i)]
    moves[U(first[0])] = 0
    popped, found, pushed, waiting = 0, 1, 0, 0
    while popped < found or pushed < waiting:
        if popped == found or (
            pushed < waiting and moves[U(later[U(pushed)])] <= moves[U(first[U(popped)])]
        ):
            cell = np.int64(later[U(pushed)])
            pushed += 1
        else:
            cell = np.int64(first[U(popped)])
            popped += 1
        for direction in range(4):
            before = cell - grid.offset[U(direction)]
            leads = (np.int64(flags[U(before)]) >> direction) & 1
            if leads == 0 or moves[U(before)] != UNREACHABLE:
                continue
            is_pushed = state.holds_fixed[U(before)] == STANDS
            if is_pushed and own_aisle != NIL and state.aisle[U(before)] == own_aisle:
                continue
            moves[U(before)] = moves[U(cell)] + 1
            if is_pushed:
                moves[U(before)] += PUSH_MOVES
                later[U(waiting)] = before
                waiting += 1
            else:
                first[U(found)] = before
                found += 1


@kernel
def price_steps_back(view, state, i):
    """Set the costs of the steps of robot i from the moves that are left after them."""
    grid, robots = view.grid, view.robots
    cell, robot_type = np.int64(robots.cell[U(i)]), np.int64(robots.type[U(i)])
    ticks = cost_unit(grid) * np.int64(view.rules.duration[U(robot_type), U(ACTION_MOVE)])
    flags = np.int64(grid.type_cell_flags[U(robot_type), U(cell)])
    for direction in range(4):
        moves = np.int64(state.moves_back[U(cell + grid.offset[U(direction)])])
        is_open = (flags >> direction) & 1 != 0
        state.costs[U(i), U(direction)] = ticks * min(moves, FAR) if is_open else UNREACHABLE
    state.priced_cell[U(i)] = NIL
