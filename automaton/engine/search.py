"""Shortest paths over poses (cell, heading) with the costs of moving and turning in ticks.

    pose = cell * headings + heading

Robots of a type share the ticks of their moves and the exits open to them. A robot moves along its
heading (a rail robot both ways along its axis) and turns by 90 degrees where the floor allows it;
each type has its own headings (automaton.engine.operations). Ties are broken by rule, so a search
gives the same path on every machine: poses leave the queue by (cost, pose); a path along a distance
table prefers a move to a turn, then the lowest direction (E, S, W, N).
"""

import numpy as np

from automaton.engine.distance_tables import (
    FAR_WORD,
    JOINT,
    POSE16,
    UNREACHABLE,
    WEIGHT_UNIT,
)
from automaton.engine.gates import closed_until
from automaton.engine.jit.kernel import U, kernel, prefetch
from automaton.engine.motion import has_room
from automaton.engine.operations import heading_towards, headings_of, limited_ticks
from automaton.engine.state import (
    ACTION_MOVE,
    ACTION_TURN,
    MAY_TURN,
    NIL,
    NO_WAY_THROUGH,
)
from automaton.engine.table_rows import cost_in, has_room_for, row_to, ticks_in

POSE_MASK = (1 << 32) - 1


@kernel
def push(heap, size, key):
    """Insert a key into a binary heap with `size` keys."""
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
    """Remove the least key from a binary heap with `size` keys."""
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
def table_of(view, workspace, robot_type, goal_cell):
    """The table with the costs of a robot type to a goal cell, for `cost_at`; NIL: the run is
    aborted.

    It is valid for the rest of the tick. All tables of one tick must fit world.distance_tables.
    """
    return row_to(workspace.tables, robot_type, goal_cell, view.clock.tick, True)


@kernel
def cost_at(view, workspace, table, cell, heading):
    """Ticks from a pose to the goal cell of a table on the empty floor; UNREACHABLE if no way."""
    return cost_in(workspace.tables, table, cell, heading)


@kernel
def fetch_costs(tables, row, cell):
    """Prefetch the entries of a row that `cost_in` will read up to two cells from a drivable cell."""
    if row < 0:
        return
    fetch_cost(tables, row, cell)
    for direction in range(4):
        to = cell + tables.offset[U(direction)]
        if tables.number[U(to)] >= 0:
            to += tables.offset[U(direction)]
        fetch_cost(tables, row, to)


@kernel
def fetch_cost(tables, row, cell):
    """Prefetch the entry of a cell."""
    number = np.int64(tables.number[U(cell)])
    if number >= 0:
        per_cell = tables.headings if tables.status.encoding >= POSE16 else 1
        prefetch(tables.pool, U(row * tables.status.words + number * per_cell))


@kernel
def weighted_table_of(view, tables, cost_set, goal_cell):
    """The table in a strategy's own tables (automaton.strategy.weighted_tables), for `cost_in`.

    NIL: the run is aborted. It is valid for the rest of the tick.
    """
    return row_to(tables, cost_set, goal_cell, view.clock.tick, True)


@kernel
def passing_table(view, workspace, robot_type, goal_cell):
    """Like table_of, but valid only until the next table is requested; there is always room for it."""
    return row_to(workspace.tables, robot_type, goal_cell, view.clock.tick, False)


@kernel
def tables_fit(workspace, more):
    """Whether this number of further tables fits world.distance_tables, besides those that exist."""
    return has_room_for(workspace.tables, more)


@kernel
def distance(view, workspace, robot_type, cell, heading, target):
    """Ticks of a robot of a type from a pose to a target cell on the empty floor; UNREACHABLE if there is
    no way.

    They are those of the way that the weights of streets make the cheapest.
    """
    tables = guiding_tables(workspace)
    row = row_to(tables, robot_type, target, view.clock.tick, False)
    if tables.step_ticks.shape[0]:
        return ticks_in(tables, row, cell, heading)
    return cost_in(tables, row, cell, heading)


@kernel
def distances(view, workspace, robots, cells, out):
    """Set out[k] to the ticks of robot robots[k], free or at the end of its move, to cell cells[k].

    Robots are storage indices; one in its parking bay begins in its home cell.
    """
    at = view.robots
    for k in range(robots.shape[0]):
        i = np.int64(robots[k])
        cell = np.int64(at.cell[i] if at.claim[i] == NIL else at.claim[i])
        cell = np.int64(at.home[i]) if cell == NIL else cell
        robot_type, heading = np.int64(at.type[i]), np.int64(at.heading[i])
        out[k] = distance(view, workspace, robot_type, cell, heading, np.int64(cells[k]))


@kernel
def shortest_distance(view, workspace, robot_type, cell, heading, target):
    """Ticks of the shortest way from a pose to a cell, whatever the weights of streets."""
    table = passing_table(view, workspace, robot_type, target)
    return cost_in(workspace.tables, table, cell, heading)


@kernel
def guided_heading(view, workspace, robot_type, cell, target):
    """The heading from which the way from a cell to a target costs least; of several the first."""
    tables, best, least = guiding_tables(workspace), np.int64(0), np.int64(UNREACHABLE)
    row = row_to(tables, robot_type, target, view.clock.tick, False)
    for heading in range(view.grid.headings):
        cost = cost_in(tables, row, cell, heading)
        if cost < least:
            best, least = np.int64(heading), cost
    return best


# The costs by which ways are chosen: ticks, or with streets ticks times weights, in 1 / WEIGHT_UNIT.


@kernel(inline=True)
def guiding_tables(workspace):
    """The tables of the costs by which ways are chosen."""
    return workspace.streets if workspace.streets.number.shape[0] else workspace.tables


@kernel
def guiding_table_of(view, workspace, robot_type, goal_cell):
    """The table of the costs by which ways are chosen, for `cost_in` and `guiding_tables`."""
    return row_to(guiding_tables(workspace), robot_type, goal_cell, view.clock.tick, True)


@kernel(inline=True)
def cost_unit(grid):
    """The cost of a tick of the weight 1."""
    return np.int64(WEIGHT_UNIT if grid.move_weight.shape[0] else 1)


@kernel(inline=True)
def least_move_cost(grid, usual):
    """The least cost of a move that takes `usual` ticks without a limit."""
    if grid.move_weight.shape[0] == 0:
        return np.int64(usual)
    return np.int64(usual) * grid.least_weight


@kernel
def move_cost(grid, usual, cell, direction):
    """The cost of a move out of a cell that takes `usual` ticks without a limit."""
    ticks = limited_ticks(grid, usual, cell, direction)
    if grid.move_weight.shape[0] == 0:
        return ticks
    return ticks * np.int64(grid.move_weight[np.uint64(4 * cell + direction)])


@kernel
def follow_gradient(view, workspace, robot_type, cell, heading, target, steps):
    """Write the path of least cost on the empty floor, as far as it fits, into steps; NIL if none."""
    grid, duration, type_cell_flags = (
        view.grid,
        view.rules.duration[robot_type],
        view.grid.type_cell_flags[robot_type],
    )
    tables, headings = guiding_tables(workspace), headings_of(grid, robot_type)
    table = row_to(tables, robot_type, target, view.clock.tick, False)
    turn = cost_unit(grid) * np.int64(duration[ACTION_TURN])
    length = 0
    if cost_in(tables, table, cell, heading) >= UNREACHABLE:
        return NIL
    while cell != target:
        cost = cost_in(tables, table, cell, heading)
        found = False
        for direction in range(heading, 4, headings):
            if (np.int64(type_cell_flags[cell]) >> direction) & 1 == 0:
                continue
            after = cell + grid.offset[direction]
            if np.int64(type_cell_flags[after]) & NO_WAY_THROUGH and after != target:
                continue
            if cost_in(tables, table, after, heading) == cost - move_cost(
                grid, duration[ACTION_MOVE], cell, direction
            ):
                if length == steps.shape[0]:
                    return length  # it is full; the robot asks again at the end of its route
                steps[length] = direction
                length += 1
                cell = after
                found = True
                break
        if not found:
            ahead = (heading + 1) & (headings - 1)
            if cost_in(tables, table, cell, ahead) != cost - turn:
                ahead = (heading - 1) & (headings - 1)
            heading = ahead
    return length


@kernel
def begin_search(workspace):
    """Begin a search; returns its number, which marks the poses that it reaches."""
    workspace.generation[0] += 1
    return workspace.generation[0]


@kernel
def reach(workspace, search, size, pose, cost, estimate, how):
    """Enter a pose into the search's queue if this cost is better; returns the queue's size."""
    if workspace.stamp[pose] != search or cost < workspace.cost[pose]:
        workspace.stamp[pose] = search
        workspace.cost[pose] = cost
        workspace.parent[pose] = how
        push(workspace.heap, size, (np.int64(cost + estimate) << 32) | np.int64(pose))
        return size + 1
    return size


TURNED_AHEAD = 4  # parents: 0..3 a move in that direction, else a turn
TURNED_BEHIND = 5
STARTED = 6

AROUND_ROBOTS = 1  # search around cells that have no room now
AROUND_CLOSED = 2  # search around closed cells
AROUND_KNOWN = 3  # search around closed cells whose duration routing may know


@kernel
def is_closed(view, cell, direction, target, around):
    """Whether a search must avoid a cell; its own target is always open."""
    if not around or cell == target:
        return False
    if around > AROUND_ROBOTS:
        return closed_until(view, cell, around == AROUND_KNOWN) > 0
    return not has_room(view.traffic.occupancy, cell, direction)


@kernel
def find_path(view, workspace, robot_type, cell, heading, target, around, steps):
    """A* from a pose to a target cell; writes directions into steps, returns the length or NIL.

    `around`: 0, or AROUND_*: remove these cells from the floor, except the target. The estimate is
    the exact cost on the empty floor (a distance table).
    """
    grid, duration, type_cell_flags = (
        view.grid,
        view.rules.duration[robot_type],
        view.grid.type_cell_flags[robot_type],
    )
    tables, headings = guiding_tables(workspace), headings_of(grid, robot_type)
    table = row_to(tables, robot_type, target, view.clock.tick, False)
    turn = cost_unit(grid) * np.int64(duration[ACTION_TURN])
    estimate = cost_in(tables, table, cell, heading)
    if estimate >= UNREACHABLE:
        return NIL
    search = begin_search(workspace)
    start = cell * grid.headings + heading
    size = reach(workspace, search, 0, start, 0, estimate, STARTED)
    while size > 0 and workspace.stop[0] == 0:
        key = pop(workspace.heap, size)
        size -= 1
        pose = key & POSE_MASK
        cost = np.int64(workspace.cost[pose])
        here, h = pose // grid.headings, pose % grid.headings
        if (key >> 32) != cost + cost_in(tables, table, here, h):
            continue  # a better path to this pose was found meanwhile
        workspace.generation[1] += 1
        if here == target:
            return write_path(grid, workspace, pose, steps)
        ways = ways_on(np.int64(type_cell_flags[here]), here == cell)
        for direction in range(h, 4, headings):
            if (ways >> direction) & 1:
                after = here + grid.offset[direction]
                to = after * grid.headings + h
                if not is_closed(view, after, direction, target, around):
                    size = reach(
                        workspace,
                        search,
                        size,
                        to,
                        cost + move_cost(grid, duration[ACTION_MOVE], here, direction),
                        cost_in(tables, table, after, h),
                        direction,
                    )
        if headings > 1 and np.int64(type_cell_flags[here]) & MAY_TURN:
            for k in range(2):
                turned = (h + 1 - 2 * k) & (headings - 1)
                size = reach(
                    workspace,
                    search,
                    size,
                    here * grid.headings + turned,
                    cost + turn,
                    cost_in(tables, table, here, turned),
                    how_turned(h, turned),
                )
    return NIL


@kernel(inline=True)
def ways_on(flags, is_start):
    """The directions in which a path may continue from a cell with these flags; none from a storage cell,
    unless the path starts there."""
    return flags & 15 if is_start or flags & NO_WAY_THROUGH == 0 else 0


@kernel
def write_path(grid, workspace, pose, steps):
    """Directions from the start of the search to a pose, read backwards from the parents."""
    length = 0
    at = pose
    while workspace.parent[at] != STARTED:
        how = np.int64(workspace.parent[at])
        if how < 4:
            length += 1
        at = parent_of(grid, at, how)
    at = pose
    k = length
    while workspace.parent[at] != STARTED:
        how = np.int64(workspace.parent[at])
        if how < 4:
            k -= 1
            if k < steps.shape[0]:
                steps[k] = how
        at = parent_of(grid, at, how)
    return min(length, steps.shape[0])


@kernel
def how_turned(pose, to):
    """How a search came from a pose to one beside it in the same cell: TURNED_*."""
    return TURNED_AHEAD if (to - pose) & 3 == 1 else TURNED_BEHIND


@kernel
def parent_of(grid, pose, how):
    """The pose from which a search came to this one; `how`: workspace.parent, a direction or TURNED_*."""
    heading = pose % grid.headings
    if how < 4:
        return pose - grid.offset[how] * grid.headings
    turned = heading - 1 if how == TURNED_AHEAD else heading + 1
    return pose - heading + (turned & (grid.headings - 1))


@kernel
def mark_goal(workspace, search, cell, value):
    """Make a cell a goal of nearest_mark; the lowest value of a cell counts."""
    if workspace.mark_stamp[cell] != search or value < workspace.mark[cell]:
        workspace.mark_stamp[cell] = search
        workspace.mark[cell] = value


@kernel
def nearest_mark(view, workspace, search, robot_type, cell, heading, around):
    """The value of the marked cell of least cost from a pose, ties to the lowest value; NIL if none.

    Dijkstra's algorithm, until the first cost at which it finds a mark. `around` as in find_path.
    """
    grid, duration, type_cell_flags = (
        view.grid,
        view.rules.duration[robot_type],
        view.grid.type_cell_flags[robot_type],
    )
    headings = headings_of(grid, robot_type)
    size = reach(workspace, search, 0, cell * grid.headings + heading, 0, 0, STARTED)
    best = NIL
    best_cost = UNREACHABLE
    while size > 0 and workspace.stop[0] == 0:
        key = pop(workspace.heap, size)
        size -= 1
        pose = key & POSE_MASK
        cost = key >> 32
        if cost > best_cost:
            break
        if cost != workspace.cost[pose]:
            continue
        workspace.generation[1] += 1
        here = pose // grid.headings
        if workspace.mark_stamp[here] == search and (best == NIL or workspace.mark[here] < best):
            best = np.int64(workspace.mark[here])
            best_cost = cost
        h = pose % grid.headings
        ways = ways_on(np.int64(type_cell_flags[here]), here == cell)
        for direction in range(h, 4, headings):
            if (ways >> direction) & 1:
                after = here + grid.offset[direction]
                if not is_closed(view, after, direction, NIL, around):
                    to = after * grid.headings + h
                    ticks = limited_ticks(grid, duration[ACTION_MOVE], here, direction)
                    size = reach(workspace, search, size, to, cost + ticks, 0, direction)
        if headings > 1 and np.int64(type_cell_flags[here]) & MAY_TURN:
            to = here * grid.headings + ((h + 1) & (headings - 1))
            size = reach(workspace, search, size, to, cost + duration[ACTION_TURN], 0, TURNED_AHEAD)
            to = here * grid.headings + ((h - 1) & (headings - 1))
            size = reach(
                workspace, search, size, to, cost + duration[ACTION_TURN], 0, TURNED_BEHIND
            )
    return best


# Remaining cost after a step in each direction, for many robots at once, each with its own table.
#
# Tables are far apart in memory, so nearly every look-up is a cache miss. The first pass only
# reads: it is short enough for the processor to overlap ten robots. The second pass computes.


@kernel
def find_step_costs(view, tables, robots, count, table, out):
    """Enter the costs after a step E, S, W, N for the first `count` listed robots, which are on the
    floor.

    `table`: by robot, rows of `tables`. out[i, d]: the cost from the next cell of robot i, with the
    heading of direction d, to the goal cell of its table; UNREACHABLE: no way, or the exit is not open.
    """
    if tables.status.encoding == JOINT:
        read_words(view, tables, robots, count, table, out)
        decode_words(view, tables, robots, count, out)
        close_storage(view, robots, count, out)
        return
    for k in range(count):
        i = np.int64(robots[U(k)])
        for direction in range(4):
            out[U(i), U(direction)] = step_cost(view, tables, i, direction, table[U(i)])
    close_storage(view, robots, count, out)


@kernel
def close_storage(view, robots, count, out):
    """Exclude steps into cells that loaded robots cannot cross, unless the cell is the goal.

    Unloaded robots could cross them, but could not make way there for loaded robots.
    """
    grid, first_loaded = view.grid, view.rules.loaded_types
    for k in range(count if first_loaded else 0):
        i = np.int64(robots[U(k)])
        robot_type = np.int64(view.robots.type[U(i)])
        if robot_type < first_loaded:
            robot_type += first_loaded
        for direction in range(4):
            to = np.int64(view.robots.cell[U(i)]) + grid.offset[direction]
            is_barred = np.int64(grid.type_cell_flags[robot_type, to]) & NO_WAY_THROUGH
            if is_barred and to != view.robots.goal_cell[U(i)]:
                out[U(i), U(direction)] = UNREACHABLE


@kernel
def step_cost(view, tables, i, direction, row):
    """The cost after a step of one robot, for any encoding."""
    grid, robot_type = view.grid, np.int64(view.robots.type[U(i)])
    cell = np.int64(view.robots.cell[U(i)])
    if (np.int64(grid.type_cell_flags[U(robot_type), U(cell)]) >> direction) & 1 == 0:
        return np.int64(UNREACHABLE)
    heading = heading_towards(grid, robot_type, direction)
    return cost_in(tables, row, cell + grid.offset[direction], heading)


@kernel
def read_words(view, tables, robots, count, table, out):
    """Enter the words of the next cells, FAR if an exit is closed; branch-free."""
    cells, types, flags_of = view.robots.cell, view.robots.type, view.grid.type_cell_flags
    pool, number, offset = tables.pool, tables.number, tables.offset
    east, south, west, north = offset[0], offset[1], offset[2], offset[3]
    words = U(tables.status.words)
    for k in range(count):
        i = U(robots[U(k)])
        cell = np.int64(cells[i])
        flags = np.int64(flags_of[U(types[i]), U(cell)])
        begin = U(max(np.int64(table[i]), 0)) * words
        e, s, w, n = flags & 1, (flags >> 1) & 1, (flags >> 2) & 1, (flags >> 3) & 1
        out[i, U(0)] = np.int64(pool[begin + U(number[U(cell + east * e)])]) | FAR_WORD * (1 - e)
        out[i, U(1)] = np.int64(pool[begin + U(number[U(cell + south * s)])]) | FAR_WORD * (1 - s)
        out[i, U(2)] = np.int64(pool[begin + U(number[U(cell + west * w)])]) | FAR_WORD * (1 - w)
        out[i, U(3)] = np.int64(pool[begin + U(number[U(cell + north * n)])]) | FAR_WORD * (1 - n)


@kernel
def decode_words(view, tables, robots, count, out):
    """Replace the words by costs."""
    excess, reciprocal, patterns = tables.excess, tables.reciprocal, tables.patterns
    unit = tables.unit
    for k in range(count):
        i = U(robots[U(k)])
        for direction in range(4):
            word = np.int64(out[i, U(direction)])
            least = (word * reciprocal) >> 32
            more = np.int64(excess[U(((word - least * patterns) << 2) + direction)])
            cost = (least + more) * unit
            out[i, U(direction)] = cost if word != FAR_WORD else UNREACHABLE
