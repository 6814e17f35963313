"""Search in time: the route of least cost through zones that others will be in.

A move from a cell whose zone others are in at tick T costs 1 + beta * others of its durations, and
takes 1 + others of them where zones slow robots down; a turn costs and takes its ticks.
Label-setting A*: each pose is expanded once, with the label of least cost, which carries its tick of
arrival. (With beta > 1 a way that is dearer but earlier may lose to one that is cheaper but later.)
The estimate is the Manhattan distance; ties go to the pose nearer to the target, then to the lowest.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.routes.forecast import ticks_of_move
from automaton.kernels.routes.plans import begin_plan, zone_of
from automaton.kernels.routes.presence import FREE, HEADING, PLACE, occupancy
from automaton.kernels.search import (
    STARTED,
    TURNED_AHEAD,
    TURNED_BEHIND,
    begin_search,
    is_closed,
    pop,
    push,
    write_path,
)
from automaton.world.state import MOVE, NIL, TURN

UNIT = 1000  # cost of a tick; beta is given in the same unit
MOST_COST = (1 << 31) - 1  # what costs more cannot be reached
EXPANDED = NIL  # tick of a pose that was expanded

# Keys of the heap: cost 31 bits, Manhattan distance 32 - b bits, pose b bits.
BOTH = 32


@kernel
def find_in_time(view, space, memory, beta, i, around, steps):
    """Write the route of least cost of robot i to its stand, or as much as fits; its length, or NIL.

    `beta`: cost of another robot in thousandths of a move. `around`: cells without room now, the
    stand excepted, are removed from the floor.
    """
    kind, grid, target = view.robots.type[i], view.grid, np.int64(view.robots.stand[i])
    duration, ways = view.rules.duration[kind], grid.ways[kind]
    begin_plan(view, memory, i)
    row = memory.own[i]
    headings, bits = grid.headings, bits_for(space.cost.shape[0])
    move, turn = np.int64(duration[MOVE]), np.int64(duration[TURN]) * UNIT
    search = begin_search(space)
    start = row[PLACE] * headings + row[HEADING]
    size = label(view, move, space, search, bits, 0, start, 0, row[FREE], target, STARTED)
    while size > 0 and space.stop[0] == 0:
        pose = pop(space.heap, size) & ((1 << bits) - 1)
        size -= 1
        now = np.int64(space.routes.tick[pose])
        if now == EXPANDED:
            continue
        space.routes.tick[pose] = EXPANDED
        space.generation[1] += 1
        cell, heading, cost = pose // headings, pose % headings, np.int64(space.cost[pose])
        if cell == target:
            return write_path(grid, space, pose, steps)
        rule = np.int64(ways[cell])
        for way in range(heading, 4, headings):
            after = cell + grid.offset[way]
            if (rule >> way) & 1 == 0 or is_closed(view, after, way, target, around):
                continue
            others = occupancy(memory, zone_of(grid, cell, way), now)  # in thousandths
            dearer = cost + move * (UNIT + beta * others // 1000)
            later = now + ticks_of_move(view, i, others // 1000)
            to = after * headings + heading
            size = label(view, move, space, search, bits, size, to, dearer, later, target, way)
        if headings > 1 and rule & 16:
            dearer, later = cost + turn, now + np.int64(duration[TURN])
            to = cell * headings + ((heading + 1) & (headings - 1))
            size = label(
                view, move, space, search, bits, size, to, dearer, later, target, TURNED_AHEAD
            )
            to = cell * headings + ((heading - 1) & (headings - 1))
            size = label(
                view, move, space, search, bits, size, to, dearer, later, target, TURNED_BEHIND
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
def label(view, move, space, search, bits, size, pose, cost, tick, target, how):
    """Label a pose with a cost and a tick of arrival if that is its best label; the queue's size.

    `move`: ticks of a move of the robot.
    """
    arrival = space.routes.tick
    if space.stamp[pose] == search:
        if arrival[pose] == EXPANDED or cost > space.cost[pose]:
            return size
        if cost == space.cost[pose] and tick >= arrival[pose]:
            return size
    width, cell = view.grid.width, pose // view.grid.headings
    left = abs(cell // width - target // width) + abs(cell % width - target % width)
    total = cost + left * move * UNIT
    if total > MOST_COST:
        return size
    space.stamp[pose] = search
    space.cost[pose] = cost
    arrival[pose] = tick
    space.parent[pose] = how
    nearer = min(left, (1 << (BOTH - bits)) - 1)
    push(space.heap, size, (total << BOTH) | (nearer << bits) | pose)
    return size + 1
