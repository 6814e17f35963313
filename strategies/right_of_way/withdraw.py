"""Wait, retry, withdraw (Grzejszczak & Nocon's WITHDRAWL_MOVE): how two robots get out of a deadlock.

The world runs the waits and retries that `waits` sets. After a failed retry the robot withdraws if
the other one wants its cell (head-on), or when it failed `limit` times; else it keeps its plan.
A withdrawal is a random number of moves away from the target; the plan is made anew after it.
With `give_way` a robot that has nothing to do makes room for one that wants its cell.
"""

import numpy as np

from automaton.strategy.kernels import (
    ABORTS,
    FAR,
    WITHDRAWALS,
    distance,
    draw_between,
    has_room,
    kernel,
)
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.state import (
    GOAL_NONE,
    NIL,
    PAUSE,
    PERIODIC,
    RETREAT,
    STEP,
    STUCK,
    TICK,
    WITHDRAWING,
)

# memory.parameters
LIMIT = 0
MOVES = 1  # and 2: range
ABORT = 3  # and 4: range


@kernel
def holder_of(view, cell, direction):
    """The robot that holds what one travelling in `direction` needs of a cell; NIL if there is none.

    Of several, the one of lowest identity: the order of storage must not matter.
    """
    robots = view.robots
    lanes = (np.int64(view.grid.rule[cell]) >> 5) & 3 == 2
    for identity in range(robots.cell.shape[0]):
        j = np.int64(robots.at_index[identity])
        if robots.cell[j] == cell and (not lanes or robots.travel[j] >> 1 == direction >> 1):
            return j
        if robots.claim[j] == cell:
            return j
    return NIL


@kernel
def is_head_on(view, i):
    """Whether the robot ahead plans to move into robot i's cell next, and is not withdrawing."""
    robots, grid = view.robots, view.grid
    if robots.at[i] >= robots.length[i]:
        return False
    way = np.int64(robots.route[i, robots.at[i]])
    j = holder_of(view, robots.cell[i] + grid.offset[way], way)
    if j == NIL or robots.withdrawing[j] or robots.at[j] >= robots.length[j]:
        return False
    direction = np.int64(robots.route[j, robots.at[j]])
    if direction & (grid.headings - 1) != robots.heading[j]:
        return False  # it turns first
    return robots.cell[j] + grid.offset[direction] == robots.cell[i]


@kernel
def may_turn(view, i, rule):
    """Whether robot i can turn where it is: in a cell of capacity 2 that takes both lanes."""
    if rule & 16 == 0:
        return False
    if (rule >> 5) & 3 != 2:
        return True
    return has_room(view.traffic.occupancy, view.robots.cell[i], view.robots.travel[i] ^ 2)


@kernel
def step_away(view, space, i):
    """The direction of a withdrawal's next move, NIL if every way is closed.

    A straight move that raises the path cost to the target, else the one of largest cost.
    """
    robots, grid = view.robots, view.grid
    mask = grid.headings - 1
    cell, heading = np.int64(robots.cell[i]), np.int64(robots.heading[i])
    target = np.int64(robots.home[i] if robots.stand[i] == NIL else robots.stand[i])
    kind = np.int64(robots.type[i])
    here = distance(view, space, kind, cell, heading, target)
    best, best_cost, best_raises = NIL, NIL, False
    for direction in range(4):
        straight = direction & mask == heading
        rule = np.int64(grid.ways[kind, cell])
        if (rule >> direction) & 1 == 0 or not (straight or may_turn(view, i, rule)):
            continue
        to = cell + grid.offset[direction]
        if not has_room(view.traffic.occupancy, to, direction):
            continue
        cost = distance(view, space, kind, to, direction & mask, target)
        if cost >= FAR:
            continue  # there is no way back
        raises = straight and cost > here
        if (raises and not best_raises) or (raises == best_raises and cost > best_cost):
            best, best_cost, best_raises = direction, cost, raises
    return best


@kernel
def is_idle(view, i):
    """Whether robot i stands on the floor with nothing to do, parked there or not."""
    robots = view.robots
    free = robots.goal[i] == GOAL_NONE and robots.load[i] == NIL
    return robots.cell[i] != NIL and free


@kernel
def are_beside(view, i, j):
    """Whether a way leads from the cell of robot j to that of robot i."""
    cell = np.int64(view.robots.cell[j])
    for direction in range(4):
        if (np.int64(view.grid.ways[view.robots.type[j], cell]) >> direction) & 1:
            if cell + view.grid.offset[direction] == view.robots.cell[i]:
                return True
    return False


@kernel
def wants(view, j, i):
    """Whether the route of robot j, which is on the floor, leads into the cell of robot i next."""
    robots = view.robots
    if robots.at[j] >= robots.length[j]:
        return False
    direction = np.int64(robots.route[j, robots.at[j]])
    return robots.cell[j] + view.grid.offset[direction] == robots.cell[i]


@kernel
def is_wanted(view, i):
    """Whether the route of any robot leads into the cell of robot i next."""
    for j in range(view.robots.cell.shape[0]):
        if j != i and view.robots.cell[j] != NIL and wants(view, j, i):
            return True
    return False


@kernel
def is_hemmed_in(view, i):
    """Whether robot i, which is idle or withdraws, has no room on any way out of its cell."""
    robots, grid = view.robots, view.grid
    if not is_idle(view, i) and not robots.withdrawing[i]:
        return False
    cell = np.int64(robots.cell[i])
    for direction in range(4):
        if (np.int64(grid.ways[robots.type[i], cell]) >> direction) & 1:
            if has_room(view.traffic.occupancy, cell + grid.offset[direction], direction):
                return False
    return True


@kernel
def who_presses(view, i):
    """A robot beside robot i that has to leave its cell and cannot, NIL if none is seen.

    Found by what is seen alone: along a file of robots that are hemmed in, up to one that withdraws or
    whose cell is wanted.
    """
    robots = view.robots
    n = robots.cell.shape[0]
    for identity in range(n):
        first = np.int64(robots.at_index[identity])
        if first == i or robots.cell[first] == NIL or not are_beside(view, i, first):
            continue
        behind, at = np.int64(i), first
        for _ in range(n):
            if at == NIL or not is_hemmed_in(view, at):
                break
            if robots.withdrawing[at] or is_wanted(view, at):
                return first
            behind, at = at, next_in_file(view, behind, at)
    return NIL


@kernel
def next_in_file(view, behind, at):
    """The robot of lowest identity beside another one, but for the one behind; NIL if there is none."""
    for identity in range(view.robots.cell.shape[0]):
        j = np.int64(view.robots.at_index[identity])
        if j != behind and j != at and view.robots.cell[j] != NIL and are_beside(view, at, j):
            return j
    return np.int64(NIL)


@kernel
def who_wants(view, i):
    """A robot that idle robot i makes room for, NIL if there is none.

    The one of lowest identity whose route leads into the cell of robot i next, or else one beside it
    that has to leave its own cell and has no room.
    """
    robots = view.robots
    for identity in range(robots.cell.shape[0]):
        j = np.int64(robots.at_index[identity])
        if j != i and robots.cell[j] != NIL and wants(view, j, i):
            return j
    return who_presses(view, i)


@kernel
def is_on_route(view, j, cell):
    """Whether the rest of the route of robot j leads through a cell."""
    here = np.int64(view.robots.cell[j])
    for s in range(view.robots.at[j], view.robots.length[j]):
        here += view.grid.offset[np.int64(view.robots.route[j, s])]
        if here == cell:
            return True
    return False


@kernel
def step_aside(view, i, j):
    """The way on which idle robot i makes room for robot j: off its route if there is one; or NIL."""
    grid, cell = view.grid, np.int64(view.robots.cell[i])
    best = NIL
    for direction in range(4):
        rule = np.int64(grid.ways[view.robots.type[i], cell])
        straight = direction & (grid.headings - 1) == view.robots.heading[i]
        if (rule >> direction) & 1 == 0 or not (straight or may_turn(view, i, rule)):
            continue
        to = cell + grid.offset[direction]
        if not has_room(view.traffic.occupancy, to, direction):  # in an aisle it may pass robot j
            continue
        if not is_on_route(view, j, to):
            return direction
        best = direction
    return best


@kernel
def decide(view, asked, answers, memory, space):
    given = answers.right_of_way
    seed, tick = view.rules.seed, view.clock[TICK]
    p = memory.parameters
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        who = np.int64(view.robots.identity[i])
        if asked.reason[k] == PERIODIC:
            waiting = who_wants(view, i) if is_idle(view, i) else NIL
            direction = step_aside(view, i, waiting) if waiting != NIL else NIL
            if direction != NIL:
                given.verb[k] = STEP
                given.value[k] = direction
        elif asked.reason[k] == STUCK:
            if view.robots.blocked[i] >= p[LIMIT] or is_head_on(view, i):
                given.verb[k] = RETREAT
                given.value[k] = draw_between(p[MOVES], p[MOVES + 1], seed, WITHDRAWALS, tick, who)
                given.release[k] = 1
        elif asked.reason[k] == WITHDRAWING:
            direction = step_away(view, space, i)
            if direction == NIL:
                given.verb[k] = PAUSE
                given.value[k] = draw_between(p[ABORT], p[ABORT + 1], seed, ABORTS, tick, who)
            else:
                given.verb[k] = STEP
                given.value[k] = direction


class Withdraw(Strategy):
    """Wait, retry, and withdraw by a random number of moves when that does not help."""

    layer = "right_of_way"
    compiled = decide

    def __init__(self, parameters=None):
        super().__init__(parameters)
        self.every = int(self.parameters.give_way)

    def waits(self):
        p = self.parameters
        return (*p.wait_empty, *p.wait_loaded, p.retries)

    def reset(self, view):
        """The parameters; where idle robots give way, all robots are asked about in every tick."""
        p = self.parameters
        return memory_of(view, parameters=(p.limit, *p.withdraw, *p.abort_wait))
