"""Wait, retry, retreat (Grzejszczak & Nocon's WITHDRAWL_MOVE): how two robots resolve a deadlock.

The world performs the waits and retries that `wait_ranges` sets. After a failed retry the robot
retreats if the other robot needs its cell (head-on), or after `max_retries` failures. Otherwise it
keeps its plan, or plans again (`after_wait: replan`, the printed "go to 1"). A retreat is a random
number of moves away from the target, followed by a new plan. With `idle_give_way` an idle robot makes
room for a robot that needs its cell.
"""

import numpy as np

from automaton.strategy.api import (
    CMD_RETREAT,
    CMD_STEP,
    CMD_WAIT,
    CONSTANT,
    GOAL_NONE,
    MAY_TURN,
    NIL,
    NO_WAY_THROUGH,
    REASON_PERIODIC,
    REASON_RETREATING,
    REASON_RETRIES_EXHAUSTED,
    SCRATCH,
    STREAM_ABORTS,
    STREAM_RETREATS,
    UNREACHABLE,
    Array,
    Strategy,
    Struct,
    distance,
    field,
    gate_before,
    has_room,
    heading_towards,
    is_facing,
    kernel,
    lane_of,
    random_between,
    random_ticks,
)
from strategies.right_of_way.right_of_way_parameters import RetreatParameters, Waits

LINK_FREE = 1
LINK_PRESSED = 2
NEVER_ASKED = 256  # failed retries are counted up to 255


class RetreatState(Struct):
    """Parameters, and scratch of a call about adjacent robots."""

    max_retries: int = field("int64", "failed retries after which a robot always retreats")
    moves: Array = field("(2,) int64", "minimum and maximum moves of a retreat", role=CONSTANT)
    abort_wait: Array = field(
        "(2,) int64", "minimum and maximum ticks to wait if no retreat is possible", role=CONSTANT
    )
    replans: int = field("int64", "1: plan again after a failed retry")
    calls: int = field("() int64", "number of calls", role=SCRATCH)
    queues: Array = field(
        "(q,) int64",
        "call << 2 | LINK_*: result of that call for two robots, one behind the other (link_of)",
        role=SCRATCH,
    )
    # Cells without limit: robots in such a cell have places 1 to n, robots that enter it the next n.
    crowd_call: Array = field(
        "(c,) int64", "last call that listed the robots of a cell", role=SCRATCH
    )
    crowd_first: Array = field("(c,) int32", "the first place in a cell", role=SCRATCH)
    crowd_next: Array = field("(p,) int32", "the next place after each; 0: none", role=SCRATCH)


@kernel
def decide(view, batch, decisions, memory, workspace):
    out = decisions.right_of_way
    seed, tick = view.rules.seed, view.clock.coarse_tick
    state = RetreatState.of(memory)
    state.calls += 1
    list_crowds(view, state)
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        identity = np.int64(view.robots.identity[i])
        if batch.reason[k] == REASON_PERIODIC:
            waiting = robot_to_yield_to(view, state, i) if is_idle(view, i) else NIL
            direction = yield_direction(view, i, waiting) if waiting != NIL else NIL
            if direction != NIL:
                out.command[k] = CMD_STEP
                out.value[k] = direction
        elif batch.reason[k] == REASON_RETRIES_EXHAUSTED:
            if view.robots.failed_retries[i] >= state.max_retries or is_head_on(view, state, i):
                out.command[k] = CMD_RETREAT
                out.value[k] = random_between(
                    state.moves[0], state.moves[1], seed, STREAM_RETREATS, tick, identity
                )
                out.return_order[k] = 1
            elif state.replans:
                out.command[k] = CMD_RETREAT
                out.value[k] = 0
                out.return_order[k] = 1
        elif batch.reason[k] == REASON_RETREATING:
            direction = retreat_direction(view, workspace, i)
            if direction == NIL:
                out.command[k] = CMD_WAIT
                low, high = np.int64(state.abort_wait[0]), np.int64(state.abort_wait[1])
                out.value[k] = random_ticks(view, low, high, STREAM_ABORTS, identity)
            else:
                out.command[k] = CMD_STEP
                out.value[k] = direction


class Retreat(Strategy):
    """Wait, retry, and then retreat by a random number of moves."""

    layer = "right_of_way"
    Parameters = RetreatParameters
    compiled = decide
    holders = True

    def __init__(self, parameters=None):
        super().__init__(parameters)
        self.period = int(self.parameters.idle_give_way)

    def wait_ranges(self):
        p = self.parameters
        return (*p.wait_empty, *p.wait_loaded, p.retries)

    def reset(self, view):
        """Set the parameters; if idle robots give way, the batch has all robots in every tick."""
        p, cell_flags, n = self.parameters, view.grid.cell_flags, len(view.robots.cell)
        unlimited = bool(np.any((cell_flags & 15 != 0) & (cell_flags >> 5 & 3 == 0)))
        return RetreatState.sized(
            {
                "q": 8 * n if p.idle_give_way else 0,
                "c": len(cell_flags) if unlimited else 0,
                "p": 2 * n if unlimited else 0,
            },
            max_retries=p.max_retries,
            moves=p.retreat_moves,
            abort_wait=p.abort_wait,
            replans=int(p.after_wait == "replan"),
        )


# Only wait and retry: the simplest right of way; any head-on meeting is a deadlock.


@kernel
def decide_to_wait(view, batch, decisions, memory, workspace):
    """Leave every decision at KEEP."""


class Wait(Strategy):
    """Wait and retry for ever; robots that meet head-on never move again."""

    layer = "right_of_way"
    Parameters = Waits
    compiled = decide_to_wait

    def wait_ranges(self):
        p = self.parameters
        return (*p.wait_empty, *p.wait_loaded, NEVER_ASKED)


# Retreats.


@kernel(inline=True)
def is_head_on(view, state, i):
    """Whether the robot ahead plans to enter robot i's cell next, and is not retreating."""
    robots, grid = view.robots, view.grid
    if robots.route_index[i] >= robots.route_length[i]:
        return False
    way = np.int64(robots.route[i, robots.route_index[i]])
    j = holder_of_cell(view, state, robots.cell[i] + grid.offset[way], way)
    if j == NIL or robots.retreat_moves[j] or robots.route_index[j] >= robots.route_length[j]:
        return False
    direction = np.int64(robots.route[j, robots.route_index[j]])
    if not is_facing(view, j, direction):
        return False  # it turns first
    return robots.cell[j] + grid.offset[direction] == robots.cell[i]


@kernel(inline=True)
def retreat_direction(view, workspace, i):
    """Return the direction of a retreat's next move, or NIL if no move is possible.

    Prefers a straight move that raises the path cost to the target, else the move to the highest cost.
    """
    robots, grid = view.robots, view.grid
    cell, heading = np.int64(robots.cell[i]), np.int64(robots.heading[i])
    target = np.int64(robots.home[i] if robots.goal_cell[i] == NIL else robots.goal_cell[i])
    robot_type = np.int64(robots.type[i])
    here = distance(view, workspace, robot_type, cell, heading, target)
    best, best_cost, best_raises = NIL, NIL, False
    for direction in range(4):
        straight = is_facing(view, i, direction)
        flags = np.int64(grid.type_cell_flags[robot_type, cell])
        if (flags >> direction) & 1 == 0 or not (straight or can_turn(view, i, flags)):
            continue
        to = cell + grid.offset[direction]
        if not has_room(view.traffic.occupancy, to, direction) or gate_before(view, i, to) != NIL:
            continue
        if np.int64(grid.type_cell_flags[robot_type, to]) & NO_WAY_THROUGH and to != target:
            continue  # storage: closed to pods; an empty robot would block exits
        cost = distance(
            view, workspace, robot_type, to, heading_towards(grid, robot_type, direction), target
        )
        if cost >= UNREACHABLE:
            continue  # no path leads back
        raises = straight and cost > here
        if (raises and not best_raises) or (raises == best_raises and cost > best_cost):
            best, best_cost, best_raises = direction, cost, raises
    return best


@kernel
def can_turn(view, i, flags):
    """Whether robot i can turn in its cell; in a cell of capacity 2 a turn needs both lanes."""
    if flags & MAY_TURN == 0:
        return False
    if (flags >> 5) & 3 != 2:
        return True
    return has_room(view.traffic.occupancy, view.robots.cell[i], view.robots.travel[i] ^ 2)


# Idle robots give way.


@kernel(inline=True)
def robot_to_yield_to(view, state, i):
    """Return the robot to which idle robot i yields, or NIL.

    This is the robot of lowest identity whose route enters the cell of robot i next, or else an
    adjacent robot that must leave its own cell and has no room.
    """
    j = robot_entering_cell_of(view, state, i)
    return j if j != NIL else boxed_in_neighbour(view, state, i)


@kernel
def is_idle(view, i):
    """Whether robot i is on the floor and idle, parked or not."""
    robots = view.robots
    free = robots.goal_type[i] == GOAL_NONE and robots.load[i] == NIL
    return robots.cell[i] != NIL and free


@kernel
def robot_entering_cell_of(view, state, i):
    """The robot of lowest identity whose route enters the cell of robot i next, or NIL."""
    robots = view.robots
    best = np.int64(NIL)
    for direction in range(4):
        cell = robots.cell[i] - view.grid.offset[direction]
        place = next_place(view, state, cell, 0)
        while place:
            j = robot_at(view, cell, place)
            if j != NIL and robots.cell[j] == cell and is_entering_cell_of(view, j, i):
                best = of_lower_identity(robots, best, j)
            place = next_place(view, state, cell, place)
    return best


@kernel(inline=True)
def is_entering_cell_of(view, j, i):
    """Return whether the route of robot j, which is on the floor, enters the cell of robot i next."""
    robots = view.robots
    if robots.route_index[j] >= robots.route_length[j]:
        return False
    direction = np.int64(robots.route[j, robots.route_index[j]])
    return robots.cell[j] + view.grid.offset[direction] == robots.cell[i]


@kernel(inline=True)
def boxed_in_neighbour(view, state, i):
    """Return the adjacent robot of lowest identity that must leave its cell but cannot, or NIL.

    The search uses only visible robots: it follows a queue of boxed-in robots to one that retreats or
    whose cell another robot needs.
    """
    robots = view.robots
    best = np.int64(NIL)
    for direction in range(4):
        cell = robots.cell[i] - view.grid.offset[direction]
        place = next_place(view, state, cell, 0)
        while place:
            j = robot_at(view, cell, place)
            if j != NIL and can_leave_towards(view, j, cell, direction):
                if of_lower_identity(robots, best, j) == j and is_pressed_by_queue(
                    view, state, i, j
                ):
                    best = j
            place = next_place(view, state, cell, place)
    return best


@kernel(inline=True)
def is_pressed_by_queue(view, state, i, first):
    """Return whether the queue from robot `first`, next to robot i, ends at a robot that must move.

    Queues merge, so the result is stored for every link of the queue and no link is visited twice.
    """
    behind, at = np.int64(i), np.int64(first)
    found = LINK_FREE
    queues, call = state.queues, state.calls
    walked = 0
    while at != NIL and walked < view.robots.cell.shape[0]:
        link = link_of(view, behind, at)
        if link != NIL and queues[link] >> 2 == call and queues[link] & 3:
            found = queues[link] & 3
            break  # a queue that returns to itself is a ring: no robot in it must move
        if not is_boxed_in(view, at):
            break
        if view.robots.retreat_moves[at] or robot_entering_cell_of(view, state, at) != NIL:
            found = LINK_PRESSED
            break
        if link != NIL:
            queues[link] = call << 2 | LINK_FREE
        behind, at = at, next_in_queue(view, state, behind, at)
        walked += 1
    if found == LINK_PRESSED:
        behind, at = np.int64(i), np.int64(first)
        for _ in range(walked):
            link = link_of(view, behind, at)
            if link != NIL:
                queues[link] = call << 2 | LINK_PRESSED
            behind, at = at, next_in_queue(view, state, behind, at)
    return found == LINK_PRESSED


@kernel(inline=True)
def is_boxed_in(view, i):
    """Return whether idle or retreating robot i has no free exit from its cell."""
    robots, grid = view.robots, view.grid
    if not is_idle(view, i) and not robots.retreat_moves[i]:
        return False
    cell = np.int64(robots.cell[i])
    for direction in range(4):
        if (np.int64(grid.type_cell_flags[robots.type[i], cell]) >> direction) & 1:
            if has_room(view.traffic.occupancy, cell + grid.offset[direction], direction):
                return False
    return True


@kernel
def can_leave_towards(view, j, cell, direction):
    """Whether robot j is in a cell and may leave it in this direction."""
    way = np.int64(view.grid.type_cell_flags[view.robots.type[j], cell]) >> direction
    return view.robots.cell[j] == cell and way & 1 != 0


@kernel
def next_in_queue(view, state, behind, at):
    """Return the robot of lowest identity next to another one, except the one behind it; or NIL."""
    robots = view.robots
    best = np.int64(NIL)
    for direction in range(4):
        cell = robots.cell[at] - view.grid.offset[direction]
        place = next_place(view, state, cell, 0)
        while place:
            j = robot_at(view, cell, place)
            if j != NIL and j != behind and can_leave_towards(view, j, cell, direction):
                best = of_lower_identity(robots, best, j)
            place = next_place(view, state, cell, place)
    return best


@kernel
def link_of(view, behind, at):
    """The index in `queues` of two robots, one behind the other; NIL in a cell without limit."""
    cell = np.int64(view.robots.cell[behind])
    lane = lane_of(np.int64(view.grid.cell_flags[cell]), np.int64(view.robots.travel[behind]))
    if lane == NIL:
        return np.int64(NIL)
    direction = np.int64(0)
    while cell + view.grid.offset[direction] != view.robots.cell[at]:
        direction += 1
    return 8 * np.int64(at) + 2 * direction + lane


@kernel(inline=True)
def yield_direction(view, i, j):
    """Return the direction in which idle robot i yields to robot j: off its route if possible; or NIL."""
    grid, cell = view.grid, np.int64(view.robots.cell[i])
    best = NIL
    for direction in range(4):
        flags = np.int64(grid.type_cell_flags[view.robots.type[i], cell])
        straight = is_facing(view, i, direction)
        if (flags >> direction) & 1 == 0 or not (straight or can_turn(view, i, flags)):
            continue
        to = cell + grid.offset[direction]
        if not has_room(
            view.traffic.occupancy, to, direction
        ):  # in an aisle robot i may pass robot j
            continue
        if gate_before(view, i, to) != NIL:
            continue
        if not is_on_route(view, j, to):
            return direction
        best = direction
    return best


@kernel(inline=True)
def is_on_route(view, j, cell):
    """Whether the rest of the route of robot j leads through a cell."""
    here = np.int64(view.robots.cell[j])
    for s in range(view.robots.route_index[j], view.robots.route_length[j]):
        here += view.grid.offset[np.int64(view.robots.route[j, s])]
        if here == cell:
            return True
    return False


# Lookup of robots by cell: in `traffic.holder`, or in a list for each cell without limit.


@kernel(inline=True)
def holder_of_cell(view, state, cell, direction):
    """The robot in the cell, or in the lane of it for `direction`; NIL if there is none.

    In a cell without limit, the robot of lowest identity: the order of storage must not matter.
    """
    lane = lane_of(np.int64(view.grid.cell_flags[cell]), direction)
    if lane != NIL:
        identity = np.int64(view.traffic.holder[cell, lane])
        return np.int64(NIL) if identity == NIL else np.int64(view.robots.at_index[identity])
    place = next_place(view, state, cell, 0)
    return robot_at(view, cell, place) if place else np.int64(NIL)


@kernel
def of_lower_identity(robots, best, j):
    """The robot of lower identity: `lowest` (or NIL) or robot j."""
    return j if best == NIL or robots.identity[j] < robots.identity[best] else best


@kernel
def robot_at(view, cell, place):
    """The robot at a place of a cell, or NIL."""
    robots = view.robots
    if capacity_of(view, cell) == 0:
        return (place - 1) % robots.cell.shape[0]
    identity = np.int64(view.traffic.holder[cell, place - 1])
    return np.int64(NIL) if identity == NIL else np.int64(robots.at_index[identity])


@kernel
def next_place(view, state, cell, place):
    """The next place in a cell; 0 stands before the first and after the last place."""
    capacity = capacity_of(view, cell)
    if capacity:
        return place + 1 if place < capacity else 0
    if state.crowd_call.shape[0] == 0:
        return 0
    return first_place(state, cell) if place == 0 else np.int64(state.crowd_next[place - 1])


@kernel
def first_place(state, cell):
    """The first place in a cell without limit, 0 unless this call has listed it."""
    return np.int64(state.crowd_first[cell] if state.crowd_call[cell] == state.calls else 0)


@kernel(inline=True)
def list_crowds(view, state):
    """List the robots that are in, or enter, each cell without limit, by identity."""
    robots = view.robots
    if state.crowd_call.shape[0] == 0:
        return
    n = robots.cell.shape[0]
    for back in range(n):
        i = np.int64(robots.at_index[n - 1 - back])
        for place, cell in ((1 + i, robots.cell[i]), (1 + n + i, robots.claim[i])):
            if cell != NIL and capacity_of(view, cell) == 0:
                state.crowd_next[place - 1] = first_place(state, cell)
                state.crowd_call[cell] = state.calls
                state.crowd_first[cell] = place


@kernel
def capacity_of(view, cell):
    """The capacity of a cell in robots; 0: unlimited."""
    return (np.int64(view.grid.cell_flags[cell]) >> 5) & 3
