"""A* over poses with the Manhattan estimate, its ties settled by a rule that the caller names.

    f = g + h        h = least ticks of a move x (|x - x*| + |y - y*|)

It is consistent: a move changes h by the ticks of one move, a turn by nothing. Neighbours are found
in the order north, south, east, west, then turns; a pose belongs to whoever first found the least g.
Zones may be closed: a robot may not enter a cell in a direction whose zone is marked.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import ROUTE_TIES, draw
from automaton.kernels.routes.frontier import (
    COST,
    EXPANDED,
    LARGER_G,
    LARGER_G_HEAP,
    LEVEL,
    POSE,
    TAIL,
    begin,
    put,
    take,
)
from automaton.kernels.search import STARTED, TURNED_AHEAD, TURNED_BEHIND, parent_of
from automaton.world.state import MOVE, NIL, TURN

NORTH_SOUTH_EAST_WEST = 0x2013  # directions, four bits each, the first one lowest


@kernel
def astar(grid, kind, duration, space, ties, seed, start, target, closing, steps):
    """Write the directions of a least path, or as much of it as fits; its length, or NIL.

    The arguments are those of `search`.
    """
    pose = search(grid, kind, duration, space, ties, seed, start, target, closing)
    if pose == NIL:
        return pose
    return write_steps(grid, space, pose, steps)


@kernel
def search(grid, kind, duration, space, ties, seed, start, target, closing):
    """The pose in which a least path from a pose reaches a cell; NIL if there is none.

    `kind`: the type of the robot; `duration`: (A,) its ticks of each action. `ties`: FIFO, LARGER_G
    or RANDOM; random ties are drawn by (seed, start, target), so a path is a pure function of those.
    `closing`: zones z with space.closed[z] may not be entered. The path is left in space.came,
    backwards, and its ticks in space.state[COST].
    """
    width, mask, shift = grid.width, grid.headings - 1, grid.headings >> 1
    move, turn = np.int64(duration[MOVE]), np.int64(duration[TURN])
    if mask and turn == 0 and ties == LARGER_G:
        ties = LARGER_G_HEAP
    label, state, ways = space.label, space.state, grid.ways[kind]
    goal_x, goal_y = target % width, target // width
    fresh = begin(space)
    salt = draw(seed, ROUTE_TIES, start, target)
    row = (start >> shift) // width
    h = move * (abs((start >> shift) - row * width - goal_x) + abs(row - goal_y))
    label[start] = fresh
    space.came[start] = STARTED
    put(space, ties, salt, start, row, h, h)
    while space.stop[0] == 0:
        item = take(space, ties, width, shift)
        if item == NIL:
            break
        pose, row = item & POSE, item >> 32
        cell = pose >> shift
        column = cell - row * width
        g = state[LEVEL] - move * (abs(column - goal_x) + abs(row - goal_y))
        if label[pose] != fresh | g:
            continue  # a better way to this pose was found meanwhile
        state[EXPANDED] += 1
        if cell == target:
            state[COST] = g
            return pose
        rule, heading, before = np.int64(ways[cell]), pose & mask, state[TAIL]
        for k in range(0, 16, 4):
            way = (NORTH_SOUTH_EAST_WEST >> k) & 3
            if (rule >> way) & 1 == 0 or way & mask != heading:
                continue
            after = cell + grid.offset[way]
            if closing and is_closed(grid, space, after, way):
                continue
            to, cost = (after << shift) | heading, fresh | (g + move)
            if cost < label[to]:
                label[to] = cost
                space.came[to] = way
                y = row + ((way == 1) - (way == 3))
                x = column + ((way == 0) - (way == 2))
                h = move * (abs(x - goal_x) + abs(y - goal_y))
                put(space, ties, salt, to, y, g + move + h, h)
        if mask and rule & 16:
            find_turns(space, ties, salt, mask, pose, row, fresh, g + turn, state[LEVEL] + turn)
        if ties == LARGER_G and state[TAIL] - before == 2:
            swap_last(space.lane, state[TAIL])  # the one found first is expanded first
    return np.int64(NIL)


@kernel
def is_closed(grid, space, cell, way):
    """Whether the zone of a robot that enters a cell in a direction is closed."""
    zone = np.int64(grid.zone[cell, way >> 1])
    return zone != NIL and space.closed[zone] != 0


@kernel
def find_turns(space, ties, salt, mask, pose, row, fresh, g, f):
    """Find the poses after a turn by 90 degrees, clockwise first."""
    for k in range(2):
        to = (pose & ~mask) | ((pose + 1 - 2 * k) & mask)
        if fresh | g < space.label[to]:
            space.label[to] = fresh | g
            space.came[to] = TURNED_BEHIND if k else TURNED_AHEAD
            put(space, ties, salt, to, row, f, f - g)


@kernel
def swap_last(lane, tail):
    last = lane[tail - 1]
    lane[tail - 1] = lane[tail - 2]
    lane[tail - 2] = last


@kernel
def write_steps(grid, space, pose, steps):
    """Directions from the start of the search to a pose; returns how many were written."""
    length = 0
    at = pose
    while space.came[at] != STARTED:
        how = np.int64(space.came[at])
        length += how < 4
        at = parent_of(grid, at, how)
    at, k = pose, length
    while space.came[at] != STARTED:
        how = np.int64(space.came[at])
        if how < 4:
            k -= 1
            if k < steps.shape[0]:
                steps[k] = how
        at = parent_of(grid, at, how)
    return np.int64(min(length, steps.shape[0]))
