"""A* over poses with the Manhattan estimate, its ties settled by a rule that the caller names.

    f = g + h        h = least ticks of a move x (|x - x*| + |y - y*|)

It is consistent: a move changes h by its ticks where no speed limit holds, a turn by nothing. Neighbours
are found in the order north, south, east, west, then turns; a pose belongs to whoever first found the
least g.
Zones may be closed: a robot may not enter a cell in a direction whose zone is marked.
"""

import numpy as np

from automaton.engine.facilities import MAY_TURN
from automaton.engine.jit.kernel import kernel
from automaton.engine.state import ACTION_MOVE, ACTION_TURN, NIL
from automaton.strategy.kernels import (
    STARTED,
    headings_of,
    how_turned,
    limited_ticks,
    parent_of,
    random_bits,
    ways_on,
)
from strategies.routing.astar.frontier import (
    LARGER_G,
    LARGER_G_HEAP,
    OPEN_COST,
    OPEN_EXPANDED,
    OPEN_LEVEL,
    OPEN_TAIL,
    POSE_MASK,
    begin,
    put,
    take,
)

STREAM_ROUTE_TIES = 10  # of random draws; each stream has a number of its own

NORTH_SOUTH_EAST_WEST = 0x2013  # directions, four bits each, the first one lowest


@kernel
def astar(grid, robot_type, duration, workspace, ties, seed, start, target, avoid_zones, steps):
    """Write the directions of a least path, or as much of it as fits; its length, or NIL.

    The arguments are those of `search`.
    """
    pose = search(grid, robot_type, duration, workspace, ties, seed, start, target, avoid_zones)
    if pose == NIL:
        return pose
    return write_steps(grid, workspace, pose, steps)


@kernel
def search(grid, robot_type, duration, workspace, ties, seed, start, target, avoid_zones):
    """The pose in which a least path from a pose reaches a cell; NIL if there is none.

    `duration`: (A,) ticks of each action of the robot's type. `ties`: FIFO, LARGER_G or RANDOM;
    random ties are drawn by (seed, start, target), so a path is a pure function of those.
    `avoid_zones`: zones z with workspace.closed[z] may not be entered. The path is left in
    workspace.came, backwards, and its ticks in workspace.state[OPEN_COST].
    """
    width, shift, headings = grid.width, grid.headings >> 1, headings_of(grid, robot_type)
    mask = headings - 1
    move, turn = np.int64(duration[ACTION_MOVE]), np.int64(duration[ACTION_TURN])
    if mask and turn == 0 and ties == LARGER_G:
        ties = LARGER_G_HEAP
    label, state, type_cell_flags = (
        workspace.label,
        workspace.state,
        grid.type_cell_flags[robot_type],
    )
    goal_x, goal_y = target % width, target // width
    fresh = begin(workspace)
    salt = random_bits(seed, STREAM_ROUTE_TIES, start, target)
    row = (start >> shift) // width
    h = move * (abs((start >> shift) - row * width - goal_x) + abs(row - goal_y))
    label[start] = fresh
    workspace.came[start] = STARTED
    put(workspace, ties, salt, start, row, h, h)
    while workspace.stop[0] == 0:
        item = take(workspace, ties, width, shift)
        if item == NIL:
            break
        pose, row = item & POSE_MASK, item >> 32
        cell = pose >> shift
        column = cell - row * width
        g = state[OPEN_LEVEL] - move * (abs(column - goal_x) + abs(row - goal_y))
        if label[pose] != fresh | g:
            continue  # a better way to this pose was found meanwhile
        state[OPEN_EXPANDED] += 1
        if cell == target:
            state[OPEN_COST] = g
            return pose
        flags, heading, before = np.int64(type_cell_flags[cell]), pose & mask, state[OPEN_TAIL]
        ways = ways_on(flags, cell == start >> shift)
        for k in range(0, 16, 4):
            way = (NORTH_SOUTH_EAST_WEST >> k) & 3
            if (ways >> way) & 1 == 0 or way & mask != heading:
                continue
            after = cell + grid.offset[way]
            if avoid_zones and is_closed(grid, workspace, after, way):
                continue
            moved = g + limited_ticks(grid, move, cell, way)
            to, cost = (after << shift) | heading, fresh | moved
            if cost < label[to]:
                label[to] = cost
                workspace.came[to] = way
                y = row + ((way == 1) - (way == 3))
                x = column + ((way == 0) - (way == 2))
                h = move * (abs(x - goal_x) + abs(y - goal_y))
                put(workspace, ties, salt, to, y, moved + h, h)
        if mask and flags & MAY_TURN:
            find_turns(
                workspace, ties, salt, mask, pose, row, fresh, g + turn, state[OPEN_LEVEL] + turn
            )
        if ties == LARGER_G and state[OPEN_TAIL] - before == 2:
            swap_last(workspace.lane, state[OPEN_TAIL])  # the one found first is expanded first
    return np.int64(NIL)


@kernel
def is_closed(grid, workspace, cell, way):
    """Whether the zone of a robot that enters a cell in a direction is closed."""
    traffic_zone = np.int64(grid.traffic_zone[cell, way >> 1])
    return traffic_zone != NIL and workspace.closed[traffic_zone] != 0


@kernel
def find_turns(workspace, ties, salt, mask, pose, row, fresh, g, f):
    """Find the poses after a turn by 90 degrees, clockwise first."""
    for k in range(2):
        to = (pose & ~mask) | ((pose + 1 - 2 * k) & mask)
        if fresh | g < workspace.label[to]:
            workspace.label[to] = fresh | g
            workspace.came[to] = how_turned(pose, to)
            put(workspace, ties, salt, to, row, f, f - g)


@kernel
def swap_last(lane, tail):
    last = lane[tail - 1]
    lane[tail - 1] = lane[tail - 2]
    lane[tail - 2] = last


@kernel
def write_steps(grid, workspace, pose, steps):
    """Directions from the start of the search to a pose; returns how many were written."""
    length = 0
    at = pose
    while workspace.came[at] != STARTED:
        how = np.int64(workspace.came[at])
        length += how < 4
        at = parent_of(grid, at, how)
    at, k = pose, length
    while workspace.came[at] != STARTED:
        how = np.int64(workspace.came[at])
        if how < 4:
            k -= 1
            if k < steps.shape[0]:
                steps[k] = how
        at = parent_of(grid, at, how)
    return np.int64(min(length, steps.shape[0]))
