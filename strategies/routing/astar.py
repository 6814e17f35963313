"""A* over poses with the Manhattan estimate; a tie rule selects one of several shortest paths.

The selection matters where robots slow each other down. Routes ignore other robots at first, and avoid
them after a retreat. The estimate is consistent: a move changes h by its least cost, and a turn does
not change it. Costs are ticks, or ticks times the weights of streets.

    f = g + h        h = least cost of a move x (|x - x*| + |y - y*|)

Neighbours are found in the order north, south, east, west, then turns; the first pose to find the least
g becomes the parent. Zones may be closed: a robot must not enter a cell in a direction whose zone is
marked.
"""

from __future__ import annotations

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    ACTION_TURN,
    MAY_TURN,
    NIL,
    SCRATCH,
    STARTED,
    STOP,
    Array,
    Grid,
    NamedNumbers,
    Strategy,
    Struct,
    cost_unit,
    field,
    find_path,
    headings_of,
    how_turned,
    kernel,
    least_move_cost,
    move_cost,
    number,
    parent_of,
    position,
    random_bits,
    splitmix64,
    ways_on,
)
from strategies.routing.routing_parameters import TieBreaking
from strategies.routing.shortest import around_closed, around_what

FIFO = 0
LARGER_G = 1
RANDOM = 2
# As LARGER_G, but without the lane, which cannot order equal g; they occur if turns take 0 ticks.
LARGER_G_HEAP = 3
TIES = ("fifo", "larger_g", "random")  # names of the rules, by their numbers

POSE_MASK = (1 << 32) - 1  # items: row << 32 | pose (lane), number << 32 | pose (heap)
STREAM_ROUTE_TIES = 10  # of random draws; each stream has a number of its own

NORTH_SOUTH_EAST_WEST = 0x2013  # directions, four bits each, the first one lowest


class SearchState(NamedNumbers):
    """Numbers of one search, and of the heap and the lane of its open poses."""

    stamp: int = number(
        "counts down, so that labels of earlier searches are worse than any new one"
    )
    level: int = number("the f being expanded")
    heap: int = number("items in the heap")
    head: int = number("the lane's first item: queues only")
    tail: int = number("one past its last item")
    discovered: int = number("poses discovered in this search")
    expanded: int = number("poses expanded in all searches")
    cost: int = number("of the last path found")


class RouteSpace(Struct, role=SCRATCH):
    """Scratch of A*, replays and avoidance, for P poses and Z zones; it never affects decisions."""

    label: Array = field("(P,) int64", "stamp << 32 | cost of the best path found to a pose")
    came: Array = field("(P,) uint8", "the step to the pose: a direction, a turn, or the start")
    # Each of the four steps into a pose may push it again.
    key: Array = field("(4P + 1,) int64", "heap: f << 32 | tie")
    item: Array = field("(4P + 1,) int64", "heap: number << 32 | pose")
    lane: Array = field("(4P + 1,) int64", "row << 32 | pose of the level being expanded")
    state: SearchState = field(SearchState)
    stop: Array = field("(1,) int64", "not 0 = searches must fail", role=STOP)
    closed: Array = field("(Z,) uint8", "1 = no robot may enter")
    count: Array = field("(Z,) int32", "other robots predicted in each zone")


def route_space(grid: Grid) -> RouteSpace:
    """Scratch for searches on a floor; the system allocates only memory pages that searches use."""
    return RouteSpace.sized({"P": grid.kind.size * grid.headings, "Z": grid.traffic_zone_count})


class AStarState(Struct):
    """Parameters and scratch; nothing persists between calls."""

    tie_rule: int = field("int64", "an index of TIES")
    routes: RouteSpace


@kernel
def decide(view, batch, decisions, memory, workspace):
    seed, state = view.rules.seed, AStarState.of(memory)
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        steps = decisions.routing.steps[k]
        length = around_robots(view, workspace, i, batch.reason[k], steps)
        if length == NIL:
            start, goal_cell = start_pose(view, i), np.int64(view.robots.goal_cell[i])
            robot_type, routes, ties = view.robots.type[i], state.routes, state.tie_rule
            duration = view.rules.duration[robot_type]
            length = astar(
                view.grid, robot_type, duration, routes, ties, seed, start, goal_cell, False, steps
            )
            length = around_closed(view, workspace, i, steps, length)
        if length != NIL:
            decisions.routing.route_length[k] = length


class AStar(Strategy):
    """A shortest path by A*; a tie rule selects one of several."""

    layer = "routing"
    Parameters = TieBreaking
    compiled = decide

    def reset(self, view):
        tie_rule = TIES.index(self.parameters.tie_break)
        return AStarState(tie_rule=tie_rule, routes=route_space(view.grid))


@kernel
def around_robots(view, workspace, i, reason, steps):
    """The length of a detour around other robots after a retreat, around closed cells after a long wait.

    NIL if no detour is needed or none exists.
    """
    around = around_what(reason)
    if around == 0:
        return NIL
    heading, goal_cell = np.int64(view.robots.heading[i]), np.int64(view.robots.goal_cell[i])
    robot_type = view.robots.type[i]
    return find_path(
        view, workspace, robot_type, position(view, i), heading, goal_cell, around, steps
    )


@kernel
def start_pose(view, i):
    """The pose of robot i where its route begins."""
    return position(view, i) * view.grid.headings + np.int64(view.robots.heading[i])


@kernel
def astar(grid, robot_type, duration, workspace, ties, seed, start, target, avoid_zones, steps):
    """Write the directions of a shortest path, as many as fit; return its length or NIL.

    The arguments are those of `search`.
    """
    pose = search(grid, robot_type, duration, workspace, ties, seed, start, target, avoid_zones)
    if pose == NIL:
        return pose
    return write_steps(grid, workspace, pose, steps)


@kernel
def search(grid, robot_type, duration, workspace, ties, seed, start, target, avoid_zones):
    """The pose in which a shortest path from a pose reaches a cell; NIL if there is none.

    `duration`: (A,) ticks of each action of the robot's type. `ties`: FIFO, LARGER_G or RANDOM;
    random ties are drawn by (seed, start, target), so a path is a pure function of these.
    `avoid_zones`: zones z with workspace.closed[z] must not be entered. Leaves the path backwards
    in workspace.came and its cost in workspace.state.cost.
    """
    width, shift, headings = grid.width, grid.headings >> 1, headings_of(grid, robot_type)
    mask = headings - 1
    usual, turn = duration[ACTION_MOVE], cost_unit(grid) * np.int64(duration[ACTION_TURN])
    move = least_move_cost(grid, usual)
    if mask and turn == 0 and ties == LARGER_G:
        ties = LARGER_G_HEAP
    label, state = workspace.label, workspace.state
    type_cell_flags = grid.type_cell_flags[robot_type]
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
        g = state.level - move * (abs(column - goal_x) + abs(row - goal_y))
        if label[pose] != fresh | g:
            continue  # stale: a better path to this pose was found meanwhile
        state.expanded += 1
        if cell == target:
            state.cost = g
            return pose
        flags, heading, before = np.int64(type_cell_flags[cell]), pose & mask, state.tail
        ways = ways_on(flags, cell == start >> shift)
        for k in range(0, 16, 4):
            way = (NORTH_SOUTH_EAST_WEST >> k) & 3
            if (ways >> way) & 1 == 0 or way & mask != heading:
                continue
            after = cell + grid.offset[way]
            if avoid_zones and is_closed(grid, workspace, after, way):
                continue
            moved = g + move_cost(grid, usual, cell, way)
            to, cost = (after << shift) | heading, fresh | moved
            if cost < label[to]:
                label[to] = cost
                workspace.came[to] = way
                y = row + ((way == 1) - (way == 3))
                x = column + ((way == 0) - (way == 2))
                h = move * (abs(x - goal_x) + abs(y - goal_y))
                put(workspace, ties, salt, to, y, moved + h, h)
        if mask and flags & MAY_TURN:
            find_turns(workspace, ties, salt, mask, pose, row, fresh, g + turn, state.level + turn)
        if ties == LARGER_G and state.tail - before == 2:
            swap_last(workspace.lane, state.tail)  # first found, first expanded
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
    """Write the directions from the start of the search to a pose; return their number."""
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


# The open list: the order in which poses of least f are expanded.
#
# A *level* is the set of poses with one f. Poses found while their level is expanded go to a lane, a
# plain array; poses of later levels go to a binary heap. With a consistent estimate no pose is found
# below the current level, so the order equals that of one heap of all poses:
#
#     fifo       the pose found first                lane = queue, after the heap's poses
#     larger_g   the pose farthest from the start    lane = stack, before the heap's; then first found
#     random     a random pose                       no lane


@kernel
def begin(workspace):
    """Empty the open list for a new search; return the label of its poses at cost 0."""
    state = workspace.state
    if state.stamp == 0:
        workspace.label[:] = np.iinfo(np.int64).max
        state.stamp = (1 << 31) - 1
    state.stamp -= 1
    state.level = NIL
    state.heap = 0
    state.head = 0
    state.tail = 0
    state.discovered = 0
    return state.stamp << 32


@kernel
def put(workspace, ties, salt, pose, row, f, h):
    """Add a pose with this f and h; `row` is its y, `salt` (uint64) addresses the draws of ties."""
    state = workspace.state
    if f == state.level and ties < RANDOM:
        workspace.lane[state.tail] = (row << 32) | pose
        state.tail += 1
        return
    number = state.discovered
    state.discovered = number + 1
    tie = number
    if ties == LARGER_G or ties == LARGER_G_HEAP:
        tie = h
    elif ties == RANDOM:
        tie = np.int64(splitmix64(salt + np.uint64(number)) >> np.uint64(33))
    sift_up(workspace, state.heap, (f << 32) | tie, (number << 32) | pose)
    state.heap += 1


@kernel
def take(workspace, ties, width, shift):
    """Remove and return the next item, row << 32 | pose, or NIL; set the level."""
    state = workspace.state
    waiting = state.tail > state.head
    if waiting and ties == LARGER_G:
        state.tail -= 1
        return workspace.lane[state.tail]
    if waiting and (state.heap == 0 or workspace.key[0] >> 32 > state.level):
        state.head += 1
        return workspace.lane[state.head - 1]
    if state.heap == 0:
        return np.int64(NIL)
    f = workspace.key[0] >> 32
    if f > state.level:
        state.level = f
        state.head = 0
        state.tail = 0
    pose = workspace.item[0] & POSE_MASK
    state.heap -= 1
    sift_down(workspace, state.heap)
    return (((pose >> shift) // width) << 32) | pose


@kernel
def sift_up(workspace, at, key, item):
    """Push (key, item) onto the heap of `at` items, ordered by key, then by item."""
    keys, items = workspace.key, workspace.item
    while at > 0:
        above = (at - 1) >> 1
        if keys[above] < key or (keys[above] == key and items[above] < item):
            break
        keys[at] = keys[above]
        items[at] = items[above]
        at = above
    keys[at] = key
    items[at] = item


@kernel
def sift_down(workspace, size):
    """Move the item behind the last place to the root and sift it down; `size` items remain."""
    keys, items = workspace.key, workspace.item
    key, item = keys[size], items[size]
    at = 0
    below = 1
    while below < size:
        other = below + 1
        if other < size and (
            keys[other] < keys[below]
            or (keys[other] == keys[below] and items[other] < items[below])
        ):
            below = other
        if keys[below] > key or (keys[below] == key and items[below] > item):
            break
        keys[at] = keys[below]
        items[at] = items[below]
        at = below
        below = 2 * at + 1
    keys[at] = key
    items[at] = item
