"""One-shot problems: robots that were pushed off their targets return to them.

The tables of distances do not contain robots, so the way back is searched in each tick, from the target
over all cells: to push a robot from its target costs PUSH_MOVES moves more, in addition to the move. With
two lengths of steps, two queues keep the cells in the order of their costs (Dijkstra's method without a
heap).

Robots whose targets are in one narrow aisle, and that entered it in the wrong order, would still push
each other for ever. So the robot with the innermost target goes first: robots whose targets are nearer
to an end of the aisle leave for it, and wait outside. Dead ends have the same rule (pibt_state).

Where a few robots still block each other, a robot that is off its target RETURN_TICKS after its first
arrival drives to the target of a random robot for ROAMING_TICKS, and then returns.
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
    splitmix64,
)
from strategies.right_of_way.pibt.pibt_state import MODE_UNDECIDED, U, clears_aisle

PUSH_MOVES = 64
RETURN_TICKS = 192
ROAMING_TICKS = 32  # of these
MAX_ROAMING = 4  # robots off their targets with which robots may roam, or a share of the robots
ROAMING_SHARE = 64
MAX_MOVES_BACK = (
    1 << 14
)  # moves from a cell without a way, into which the robot may still be pushed
ON_TARGET = 2  # in holds_fixed, next to 1 for robots that do not choose


@kernel
def price_ways_back(view, state):
    """Set the costs of the steps of robots that were pushed off their targets."""
    if view.rules.stop != STOP_ON_TARGETS:
        return
    robots = view.robots
    away = robots.cell.shape[0] - mark_standing(view, state, ON_TARGET)
    may_roam = away <= max(MAX_ROAMING, robots.cell.shape[0] // ROAMING_SHARE)
    for i in range(robots.cell.shape[0]):
        if robots.goal_type[U(i)] != GOAL_PARK or robots.cell[U(i)] == NIL:
            continue
        is_away = robots.cell[U(i)] != robots.goal_cell[U(i)] and not clears_aisle(view, state, i)
        if state.mode[U(i)] == MODE_UNDECIDED and is_away:
            home = np.int64(robots.home[U(i)])
            target = roaming_target(view, i) if may_roam else np.int64(NIL)
            if target != NIL:
                search_way_back(view, state, i, target, np.int64(NIL))
            else:
                search_way_back(view, state, i, home, np.int64(state.aisle[U(home)]))
            if state.moves_back[U(robots.cell[U(i)])] == UNREACHABLE:
                search_way_back(view, state, i, home, np.int64(NIL))
            price_steps_back(view, state, i)
    mark_standing(view, state, 0)


@kernel
def roaming_target(view, i):
    """The cell to which robot i drives meanwhile, if it has returned in vain for long; else NIL."""
    robots = view.robots
    identity = np.int64(robots.identity[U(i)])
    if identity >= view.orders.state.shape[0]:
        return np.int64(NIL)
    arrival = np.int64(view.stops.done[view.orders.first_stop[identity + 1] - 1])
    ticks = view.clock.coarse_tick + identity * 37 % RETURN_TICKS
    if arrival == NIL or view.clock.tick - arrival < RETURN_TICKS:
        return np.int64(NIL)
    if ticks % RETURN_TICKS >= ROAMING_TICKS:
        return np.int64(NIL)
    number = np.uint64(ticks // RETURN_TICKS << 32 | identity)
    draw = splitmix64(np.uint64(view.rules.seed) ^ number)
    other = robots.at_index[np.int64(draw % np.uint64(robots.cell.shape[0]))]
    return np.int64(robots.home[other])


@kernel
def mark_standing(view, state, value):
    """Write a value at the cells of robots that stand on their targets; return their number."""
    robots, standing = view.robots, 0
    for i in range(robots.cell.shape[0]):
        cell = robots.cell[U(i)]
        stands = robots.goal_type[U(i)] == GOAL_NONE and cell != NIL and cell == robots.home[U(i)]
        if stands and state.mode[U(i)] == MODE_UNDECIDED:
            state.holds_fixed[U(cell)] = value
        standing += np.int64(stands)
    return standing


@kernel
def search_way_back(view, state, i, target, own_aisle):
    """Set `moves_back`: the moves of robot i from each cell to its target, or UNREACHABLE.

    No way leads through robots on their targets in the aisle of its target: they entered it first.
    """
    grid, moves, first, later = view.grid, state.moves_back, state.next_cells, state.later_cells
    flags = grid.type_cell_flags[U(view.robots.type[U(i)])]
    moves[:] = UNREACHABLE
    first[0] = target
    moves[U(first[0])] = 0
    popped, listed, pushed, waiting = 0, 1, 0, 0
    while popped < listed or pushed < waiting:
        if popped == listed or (
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
            is_pushed = state.holds_fixed[U(before)] == ON_TARGET
            if is_pushed and own_aisle != NIL and state.aisle[U(before)] == own_aisle:
                continue
            moves[U(before)] = moves[U(cell)] + 1
            if is_pushed:
                moves[U(before)] += PUSH_MOVES
                later[U(waiting)] = before
                waiting += 1
            else:
                first[U(listed)] = before
                listed += 1


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
        state.costs[U(i), U(direction)] = (
            ticks * min(moves, MAX_MOVES_BACK) if is_open else UNREACHABLE
        )
    state.priced_cell[U(i)] = NIL
