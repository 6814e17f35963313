"""Shortest paths over poses (cell, heading) with the costs of moving and turning in ticks.

    pose = cell * headings + heading

Robots of a type share the ticks of their moves, and the exits that are open to them.
A robot moves along its heading (a rail robot both ways along its axis) and turns by 90 degrees
where the floor allows it. Ties are settled by rule, so every search gives the same path on every
machine: poses leave the queue by (cost, pose); a path down a distance field prefers a move to a
turn, then the lowest direction (E, S, W, N).
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.motion import has_room
from automaton.world.state import MOVE, NIL, TURN

FAR = 1 << 30  # cost of what cannot be reached
_POSE_MASK = (1 << 32) - 1


@kernel
def push(heap, size, key):
    """Put a key into the binary heap of that size."""
    at = size
    while at > 0:
        above = (at - 1) >> 1
        if heap[above] <= key:
            break
        heap[at] = heap[above]
        at = above
    heap[at] = key


@kernel
def pop(heap, size):
    """Take the least key out of the binary heap of that size."""
    least = heap[0]
    last = heap[size - 1]
    size -= 1
    at = 0
    below = 1
    while below < size:
        if below + 1 < size and heap[below + 1] < heap[below]:
            below += 1
        if heap[below] >= last:
            break
        heap[at] = heap[below]
        at = below
        below = 2 * at + 1
    heap[at] = last
    return least


@kernel
def fill_field(grid, kind, duration, target, field, heap, stop):
    """field[pose] = least cost from the pose to the target cell in any heading; FAR if there is none.

    `duration`: (A,) ticks of each action of robots of the type `kind`. Dijkstra from the target
    against the direction of travel. False if it was given up, since stop[0] is set.
    """
    field[:] = FAR
    ways = grid.ways[kind]
    size = 0
    for heading in range(grid.headings):
        pose = target * grid.headings + heading
        field[pose] = 0
        push(heap, size, np.int64(pose))
        size += 1
    while size > 0 and stop[0] == 0:
        key = pop(heap, size)
        size -= 1
        pose = key & _POSE_MASK
        cost = key >> 32
        if cost > field[pose]:
            continue
        cell = pose // grid.headings
        heading = pose % grid.headings
        for direction in range(heading, 4, grid.headings):
            before = cell - grid.offset[direction]
            if 0 <= before < ways.shape[0] and (np.int64(ways[before]) >> direction) & 1:
                size = relax(
                    field, heap, size, before * grid.headings + heading, cost + duration[MOVE]
                )
        if grid.headings > 1 and np.int64(ways[cell]) & 16:
            ahead = (heading + 1) & (grid.headings - 1)
            size = relax(field, heap, size, cell * grid.headings + ahead, cost + duration[TURN])
            behind = (heading - 1) & (grid.headings - 1)
            size = relax(field, heap, size, cell * grid.headings + behind, cost + duration[TURN])
    return stop[0] == 0


@kernel
def relax(field, heap, size, pose, cost):
    if cost < field[pose]:
        field[pose] = cost
        push(heap, size, (np.int64(cost) << 32) | np.int64(pose))
        return size + 1
    return size


@kernel
def field_to(view, space, kind, target):
    """The row of space.field with the costs of a type to a target cell; NIL once space.stop is set.

    It is computed if it is not there.
    """
    entry = np.int64(kind) * view.grid.ways.shape[1] + target
    row = np.int64(space.field_of[entry])
    if row != NIL or space.stop[0]:
        return row
    row = np.int64(space.field_next[0])
    space.field_next[0] = (row + 1) % space.field.shape[0]
    if space.field_owner[row] != NIL:
        space.field_of[space.field_owner[row]] = NIL
    space.field_owner[row] = NIL
    duration = view.rules.duration[kind]
    if not fill_field(view.grid, kind, duration, target, space.field[row], space.heap, space.stop):
        return np.int64(NIL)
    space.field_owner[row] = entry
    space.field_of[entry] = row
    return row


@kernel
def distance(view, space, kind, cell, heading, target):
    """Ticks of a robot of a type from a pose to a target cell on the empty floor, FAR: no way."""
    row = field_to(view, space, kind, target)
    if row == NIL:
        return np.int64(FAR)
    return np.int64(space.field[row, cell * view.grid.headings + heading])


@kernel
def descend(view, space, kind, cell, heading, target, steps):
    """Write the shortest path on the empty floor, or as much as fits, into steps; NIL if none."""
    grid, duration, ways = view.grid, view.rules.duration[kind], view.grid.ways[kind]
    row = field_to(view, space, kind, target)
    field = space.field[row]
    length = 0
    if row == NIL or field[cell * grid.headings + heading] >= FAR:
        return NIL
    while cell != target:
        cost = np.int64(field[cell * grid.headings + heading])
        found = False
        for direction in range(heading, 4, grid.headings):
            if (np.int64(ways[cell]) >> direction) & 1 == 0:
                continue
            after = cell + grid.offset[direction]
            if field[after * grid.headings + heading] == cost - duration[MOVE]:
                if length == steps.shape[0]:
                    return length  # as much as fits; the robot asks again at its end
                steps[length] = direction
                length += 1
                cell = after
                found = True
                break
        if not found:
            ahead = (heading + 1) & (grid.headings - 1)
            if field[cell * grid.headings + ahead] != cost - duration[TURN]:
                ahead = (heading - 1) & (grid.headings - 1)
            heading = ahead
    return length


@kernel
def begin_search(space):
    space.generation[0] += 1
    return space.generation[0]


@kernel
def reach(space, search, size, pose, cost, estimate, how):
    """Enter a pose into the search's queue if this cost is better; returns the queue's size."""
    if space.stamp[pose] != search or cost < space.cost[pose]:
        space.stamp[pose] = search
        space.cost[pose] = cost
        space.parent[pose] = how
        push(space.heap, size, (np.int64(cost + estimate) << 32) | np.int64(pose))
        return size + 1
    return size


TURNED_AHEAD = 4  # parents: 0..3 a move in that direction, else a turn
TURNED_BEHIND = 5
STARTED = 6


@kernel
def is_closed(view, cell, direction, target, around):
    """Whether a search around the robots may not enter a cell; its own target is always open."""
    if not around or cell == target:
        return False
    return not has_room(view.traffic.occupancy, cell, direction)


@kernel
def find_path(view, space, kind, cell, heading, target, around, steps):
    """A* from a pose to a target cell; writes directions into steps, returns the length or NIL.

    `around`: cells without room now, the target excepted, are removed from the floor. The estimate
    is the exact cost on the empty floor (a cached distance field).
    """
    grid, duration, ways = view.grid, view.rules.duration[kind], view.grid.ways[kind]
    row = field_to(view, space, kind, target)
    if row == NIL or space.field[row, cell * grid.headings + heading] >= FAR:
        return NIL
    search = begin_search(space)
    start = cell * grid.headings + heading
    size = reach(space, search, 0, start, 0, space.field[row, start], STARTED)
    while size > 0 and space.stop[0] == 0:
        key = pop(space.heap, size)
        size -= 1
        pose = key & _POSE_MASK
        cost = np.int64(space.cost[pose])
        if (key >> 32) != cost + space.field[row, pose]:
            continue  # a better way to this pose was found meanwhile
        space.generation[1] += 1
        here = pose // grid.headings
        if here == target:
            return write_path(grid, space, pose, steps)
        h = pose % grid.headings
        for direction in range(h, 4, grid.headings):
            if (np.int64(ways[here]) >> direction) & 1:
                after = here + grid.offset[direction]
                to = after * grid.headings + h
                if not is_closed(view, after, direction, target, around):
                    size = reach(
                        space,
                        search,
                        size,
                        to,
                        cost + duration[MOVE],
                        space.field[row, to],
                        direction,
                    )
        if grid.headings > 1 and np.int64(ways[here]) & 16:
            to = here * grid.headings + ((h + 1) & (grid.headings - 1))
            size = reach(
                space, search, size, to, cost + duration[TURN], space.field[row, to], TURNED_AHEAD
            )
            to = here * grid.headings + ((h - 1) & (grid.headings - 1))
            size = reach(
                space, search, size, to, cost + duration[TURN], space.field[row, to], TURNED_BEHIND
            )
    return NIL


@kernel
def write_path(grid, space, pose, steps):
    """Directions from the start of the search to a pose, read backwards from the parents."""
    length = 0
    at = pose
    while space.parent[at] != STARTED:
        how = np.int64(space.parent[at])
        if how < 4:
            length += 1
        at = parent_of(grid, at, how)
    at = pose
    k = length
    while space.parent[at] != STARTED:
        how = np.int64(space.parent[at])
        if how < 4:
            k -= 1
            if k < steps.shape[0]:
                steps[k] = how
        at = parent_of(grid, at, how)
    return min(length, steps.shape[0])


@kernel
def parent_of(grid, pose, how):
    heading = pose % grid.headings
    if how < 4:
        return pose - grid.offset[how] * grid.headings
    turned = heading - 1 if how == TURNED_AHEAD else heading + 1
    return pose - heading + (turned & (grid.headings - 1))


@kernel
def mark_goal(space, search, cell, value):
    """Make a cell a goal of nearest_mark; the lowest value of a cell counts."""
    if space.mark_stamp[cell] != search or value < space.mark[cell]:
        space.mark_stamp[cell] = search
        space.mark[cell] = value


@kernel
def nearest_mark(view, space, search, kind, cell, heading, around):
    """The value of the marked cell of least cost from a pose, ties to the lowest value; NIL if none.

    Dijkstra that ends with the first cost at which a mark was found. `around` as in find_path.
    """
    grid, duration, ways = view.grid, view.rules.duration[kind], view.grid.ways[kind]
    size = reach(space, search, 0, cell * grid.headings + heading, 0, 0, STARTED)
    best = NIL
    best_cost = FAR
    while size > 0 and space.stop[0] == 0:
        key = pop(space.heap, size)
        size -= 1
        pose = key & _POSE_MASK
        cost = key >> 32
        if cost > best_cost:
            break
        if cost != space.cost[pose]:
            continue
        space.generation[1] += 1
        here = pose // grid.headings
        if space.mark_stamp[here] == search and (best == NIL or space.mark[here] < best):
            best = np.int64(space.mark[here])
            best_cost = cost
        h = pose % grid.headings
        for direction in range(h, 4, grid.headings):
            if (np.int64(ways[here]) >> direction) & 1:
                after = here + grid.offset[direction]
                if not is_closed(view, after, direction, NIL, around):
                    to = after * grid.headings + h
                    size = reach(space, search, size, to, cost + duration[MOVE], 0, direction)
        if grid.headings > 1 and np.int64(ways[here]) & 16:
            to = here * grid.headings + ((h + 1) & (grid.headings - 1))
            size = reach(space, search, size, to, cost + duration[TURN], 0, TURNED_AHEAD)
            to = here * grid.headings + ((h - 1) & (grid.headings - 1))
            size = reach(space, search, size, to, cost + duration[TURN], 0, TURNED_BEHIND)
    return best
