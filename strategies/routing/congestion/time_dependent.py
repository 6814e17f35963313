"""Search in time: the route of least cost through zones that others will be in.

A move from a cell whose zone others are in at tick T costs 1 + beta * others of its durations, and
takes 1 + others of them where zones slow robots down; a turn costs and takes its ticks.
Label-setting A*: each pose is expanded once, with the label of least cost, which carries its tick of
arrival. (With beta > 1 a way that is dearer but earlier may lose to one that is cheaper but later.)
The estimate is the Manhattan distance; ties go to the pose nearer to the target, then to the lowest.
"""

import numpy as np

from automaton.engine.facilities import MAY_TURN
from automaton.engine.jit.kernel import kernel
from automaton.engine.state import ACTION_MOVE, ACTION_TURN, NIL
from automaton.strategy.kernels import (
    STARTED,
    begin_search,
    headings_of,
    how_turned,
    is_closed,
    limited_ticks,
    pop,
    push,
    ways_on,
    write_path,
)
from strategies.routing.congestion.known_plans import begin_plan, zone_of
from strategies.routing.congestion.plan_forecast import ticks_of_move
from strategies.routing.congestion.zone_forecast import occupancy

UNIT = 1000  # cost of a tick; beta is given in the same unit
MAX_COST = (1 << 31) - 1  # what costs more cannot be reached
EXPANDED = NIL  # tick of a pose that was expanded

# Keys of the heap: cost 31 bits, Manhattan distance 32 - b bits, pose b bits.
BOTH = 32


@kernel
def time_dependent_path(view, workspace, state, i, around, steps):
    """Write the route of least cost of robot i to its goal cell, or as much as fits; its length, or
    NIL.

    `around`: cells without room now, the goal cell excepted, are removed from the floor.
    """
    robot_type, grid, target = view.robots.type[i], view.grid, np.int64(view.robots.goal_cell[i])
    duration, type_cell_flags = view.rules.duration[robot_type], grid.type_cell_flags[robot_type]
    begin_plan(view, state, i)
    headings, apart = grid.headings, headings_of(grid, robot_type)
    bits = bits_for(workspace.cost.shape[0])
    move, turn = np.int64(duration[ACTION_MOVE]), np.int64(duration[ACTION_TURN]) * UNIT
    search = begin_search(workspace)
    start, free = state.place[i] * headings + state.heading[i], state.free[i]
    size = label(view, state, move, workspace, search, bits, 0, start, 0, free, target, STARTED)
    while size > 0 and workspace.stop[0] == 0:
        pose = pop(workspace.heap, size) & ((1 << bits) - 1)
        size -= 1
        now = np.int64(state.arrival[pose])
        if now == EXPANDED:
            continue
        state.arrival[pose] = EXPANDED
        workspace.generation[1] += 1
        cell, heading, cost = pose // headings, pose % headings, np.int64(workspace.cost[pose])
        if cell == target:
            return write_path(grid, workspace, pose, steps)
        flags = np.int64(type_cell_flags[cell])
        ways = ways_on(flags, cell == state.place[i])
        for way in range(heading, 4, apart):
            after = cell + grid.offset[way]
            if (ways >> way) & 1 == 0 or is_closed(view, after, way, target, around):
                continue
            others = occupancy(state, zone_of(grid, cell, way), now)  # in thousandths
            own = limited_ticks(grid, move, cell, way)
            dearer = cost + own * (UNIT + state.beta * others // 1000)
            later = now + ticks_of_move(view, own, others // 1000)
            to = after * headings + heading
            size = label(
                view, state, move, workspace, search, bits, size, to, dearer, later, target, way
            )
        if apart > 1 and flags & MAY_TURN:
            dearer, later = cost + turn, now + np.int64(duration[ACTION_TURN])
            for turned in (1, -1):
                to = cell * headings + ((heading + turned) & (apart - 1))
                how = how_turned(pose, to)
                size = label(
                    view, state, move, workspace, search, bits, size, to, dearer, later, target, how
                )
    return np.int64(NIL)


@kernel
def bits_for(count):
    """Bits that tell so many things apart."""
    bits = 1
    while (1 << bits) < count:
        bits += 1
    return bits


@kernel
def label(view, state, move, workspace, search, bits, size, pose, cost, tick, target, how):
    """Label a pose with a cost and a tick of arrival if that is its best label; the queue's size.

    `move`: ticks of a move of the robot.
    """
    arrival = state.arrival
    if workspace.stamp[pose] == search:
        if arrival[pose] == EXPANDED or cost > workspace.cost[pose]:
            return size
        if cost == workspace.cost[pose] and tick >= arrival[pose]:
            return size
    width, cell = view.grid.width, pose // view.grid.headings
    left = abs(cell // width - target // width) + abs(cell % width - target % width)
    total = cost + left * move * UNIT
    if total > MAX_COST:
        return size
    workspace.stamp[pose] = search
    workspace.cost[pose] = cost
    arrival[pose] = tick
    workspace.parent[pose] = how
    nearer = min(left, (1 << (BOTH - bits)) - 1)
    push(workspace.heap, size, (total << BOTH) | (nearer << bits) | pose)
    return size + 1
