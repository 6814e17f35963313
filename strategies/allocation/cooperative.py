"""Bucket brigades across the tables (Grzejszczak & Nocon): cooperative and adaptive planning.

An *alley* is a column of the floor from which robots pick up loads on its left. In cooperative planning
(Algorithm 2) a robot reserves an alley and moves the loads of its left table one table to the right,
where the robot of the next alley finds them. Only loads without an empty shelf there go to their
destinations. The strategy's state holds the reservations of alleys; all else is in the order list.
"""

import numpy as np

from automaton.strategy.api import (
    ACTION_BLOCKED,
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_RETREAT,
    ACTION_TRY_DROP,
    ACTION_TURN,
    ACTION_WAIT,
    AROUND_ROBOTS,
    CMD_PARK,
    NIL,
    REASON_ORDER_RETURNED,
    REASON_PERIODIC,
    SCRATCH,
    Array,
    Strategy,
    Struct,
    can_do,
    deliver,
    distance,
    dropoff_cell,
    field,
    find_path,
    is_open,
    kernel,
    pickup_cell,
    places_load,
    position,
    set_down,
    take_order,
    takes_load,
)
from strategies.allocation.allocation_parameters import Alleys

MOVES_PER_PASS = 4  # moves along the alley, from one load to the next
PRIOR_TICKS = 200  # initial value of a robot's driven ticks


class AlleyState(Struct):
    """The alleys of robots, and the work in each column."""

    alley: Array = field("(n,) int32", "the column of the alley reserved by a robot, or 0")
    picked_from: Array = field("(n,) int32", "the column of the shelf from which it takes its load")
    # For each column of the grid:
    open_orders: Array = field("(w,) int32", "open orders to its left", role=SCRATCH)
    loads_left: Array = field("(w,) int32", "loads on its left table", role=SCRATCH)
    loads_right: Array = field("(w,) int32", "loads on its right table", role=SCRATCH)


def alley_state(view):
    """The state at the beginning of a run."""
    return AlleyState.sized({"n": len(view.robots.cell), "w": view.grid.width})


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, state = decisions.allocation, AlleyState.of(memory)
    for k in range(batch.count):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        reason = batch.reason[k]
        if places_load(reason):
            pass_right(view, out, state, k, i)
        elif reason != REASON_PERIODIC:
            take_in_alley(view, out, state, workspace, k, i, reason == REASON_ORDER_RETURNED)


class Cooperative(Strategy):
    """Bucket brigade: robots reserve alleys and pass loads to the next table on the right."""

    layer = "allocation"
    Parameters = Alleys
    compiled = decide

    def reset(self, view):
        return alley_state(view)


@kernel(inline=True)
def take_in_alley(view, out, state, workspace, k, i, released):
    """Decision k: take the first open order of the robot's alley or of a better one, or go home."""
    width = view.grid.width
    count_tables(view, out, i, state)
    column = np.int64(state.alley[i])
    if column == 0 or state.open_orders[column] == 0:
        state.alley[i] = 0
        column = choose_alley(view, state, i)
        if column == NIL:
            out.command[k] = CMD_PARK
            return
        state.alley[i] = column
    order = first_order(view, out, workspace, i, column, released)
    state.picked_from[i] = view.slots.cell[view.orders.current_slot[order]] % width
    take_order(view, out, k, i, order)


@kernel(inline=True)
def count_tables(view, out, i, state):
    """Count the orders and loads of every column that robot i can serve."""
    width, robot_type = view.grid.width, view.robots.type[i]
    state.open_orders[:] = 0
    state.loads_left[:] = 0
    state.loads_right[:] = 0
    for slot in range(view.slots.cell.shape[0]):
        order = np.int64(view.slots.content[slot])
        if view.slots.unbounded[slot] or order == NIL:
            continue
        access_cell = pickup_cell(view, robot_type, slot, NIL)
        if access_cell == NIL:
            continue
        column = access_cell % width
        state.loads_left[column] += 1
        if is_open(view, out, i, order) and can_do(view, i, order):
            state.open_orders[column] += 1
        from_left = view.slots.access[slot, 2]
        if from_left != NIL:
            state.loads_right[from_left % width] += 1


@kernel(inline=True)
def choose_alley(view, state, i):
    """The free alley with open orders and the largest surplus of loads (left minus right); or NIL.

    Ties: nearest in x, then the lowest.
    """
    width = view.grid.width
    x = position(view, i) % width
    best, best_score, best_way = NIL, 0, 0
    for column in range(width):
        if state.open_orders[column] == 0 or is_reserved(state, i, column):
            continue
        score = np.int64(state.loads_left[column]) - np.int64(state.loads_right[column])
        way = abs(column - x)
        if best == NIL or score > best_score or (score == best_score and way < best_way):
            best, best_score, best_way = column, score, way
    return best


@kernel(inline=True)
def is_reserved(state, i, column):
    """Whether another robot has reserved this alley."""
    for j in range(state.alley.shape[0]):
        if j != i and state.alley[j] == column:
            return True
    return False


@kernel(inline=True)
def first_order(view, out, workspace, i, column, around):
    """The open order of lowest y in an alley; `around`: only orders that are reachable now."""
    here, robot_type = position(view, i), view.robots.type[i]
    heading = np.int64(view.robots.heading[i])
    first = NIL
    for slot in range(view.slots.cell.shape[0]):
        order = np.int64(view.slots.content[slot])
        if view.slots.unbounded[slot] or order == NIL or not is_open(view, out, i, order):
            continue
        access_cell = pickup_cell(view, robot_type, slot, NIL)
        if access_cell % view.grid.width != column or not can_do(view, i, order):
            continue
        if first == NIL:
            first = order
        if not around:
            return order
        steps = workspace.steps
        length = find_path(
            view, workspace, robot_type, here, heading, access_cell, AROUND_ROBOTS, steps
        )
        if length != NIL:
            return order
    return first


@kernel(inline=True)
def pass_right(view, out, state, k, i):
    """Decision k: drop at the empty shelf of the next table to the right, nearest in y; else deliver.

    A load is never passed beyond its target, and always to the right of its shelf, regardless of the
    side on which the robot is. So it arrives after finitely many passes.
    """
    width = view.grid.width
    here, robot_type = position(view, i), view.robots.type[i]
    x, y = max(here % width, np.int64(state.picked_from[i])), here // width
    target = np.int64(view.slots.cell[view.orders.target[view.robots.load[i]]])
    best, best_column, best_way = NIL, target % width, 0
    for slot in range(view.slots.cell.shape[0]):
        column = view.slots.cell[slot] % width
        if column <= x or column > best_column or view.slots.unbounded[slot]:
            continue
        if not takes_load(view, out, slot):
            continue
        if dropoff_cell(view, robot_type, slot, NIL) == NIL:
            continue
        way = abs(view.slots.cell[slot] // width - y)
        if column < best_column or (best != NIL and way < best_way):
            best, best_column, best_way = slot, column, way
    if best == NIL:
        deliver(view, out, k, i)
    else:
        set_down(view, out, k, i, np.int64(best))
    out.try_drop[k] = 1


# Adaptive planning: carry a load or pass it on, decided for each load from the robot's observations.
#
# Grzejszczak & Nocon suggest, as future work, robots that switch between the two strategies by their
# own observations. Here a robot works in an alley as in the cooperative strategy. A robot without an
# alley stays at home and adds no traffic. With each load that it picks up, a robot takes the option of
# fewer ticks:
#
#     carry (independent)  2 * path length to the load's target * (1 + lost / driven)
#     pass (cooperative)   tables before the target * (pick + try + drop + a few moves)
#
# Carrying means driving there and back. Passing means that a robot handles the load once more at each
# table before its target. `lost / driven` is the ratio of the robot's ticks lost to others (waits,
# refused moves, retreats) to its ticks driven (moves, turns) since the start; 200 driven ticks are
# added as a prior. The robots need no communication except the order list.
#
# Reason: passing costs the same for each table, while carrying has a cost per cell. Far from the target
# the brigade handles a load too often (so it needs 9,400 ticks for one robot and ten tables); near the
# target carrying turns too often. The rule combines the advantages of both.


@kernel
def decide_adaptive(view, batch, decisions, memory, workspace):
    out, state = decisions.allocation, AlleyState.of(memory)
    for k in range(batch.count):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        reason = batch.reason[k]
        if places_load(reason) and is_carrying_cheaper(view, workspace, i):
            deliver(view, out, k, i)
        elif places_load(reason):
            pass_right(view, out, state, k, i)
        elif reason != REASON_PERIODIC:
            take_in_alley(view, out, state, workspace, k, i, reason == REASON_ORDER_RETURNED)


class Adaptive(Strategy):
    """Each robot carries a load or passes it on, whichever has cost it less so far."""

    layer = "allocation"
    Parameters = Alleys
    compiled = decide_adaptive

    def reset(self, view):
        return alley_state(view)


@kernel
def is_carrying_cheaper(view, workspace, i):
    """Whether carrying the load to its target costs fewer ticks than passing it on."""
    here = position(view, i)
    width = view.grid.width
    target = np.int64(view.orders.target[view.robots.load[i]])
    tables = tables_between(view, here % width, view.slots.cell[target] % width)
    if tables == 0:
        return True
    robot_type = view.robots.type[i]
    duration = view.rules.duration[robot_type]
    handling = duration[ACTION_PICK] + duration[ACTION_TRY_DROP] + duration[ACTION_DROP]
    passing = tables * (handling + MOVES_PER_PASS * duration[ACTION_MOVE])
    heading = np.int64(view.robots.heading[i])
    way = distance(
        view, workspace, robot_type, here, heading, dropoff_cell(view, robot_type, target, here)
    )
    lost = (
        ticks_of(view, i, ACTION_WAIT)
        + ticks_of(view, i, ACTION_BLOCKED)
        + ticks_of(view, i, ACTION_RETREAT)
    )
    driven = PRIOR_TICKS + ticks_of(view, i, ACTION_MOVE) + ticks_of(view, i, ACTION_TURN)
    return 2 * way * (driven + lost) < passing * driven


@kernel
def tables_between(view, x, target):
    """The number of shelf columns between x and the target's column."""
    width = view.grid.width
    count, last = 0, NIL
    for slot in range(view.slots.cell.shape[0]):
        column = view.slots.cell[slot] % width
        if x < column < target and column != last and view.slots.unbounded[slot] == 0:
            count += 1
            last = column
    return count


@kernel
def ticks_of(view, i, action):
    """Ticks that robot i has spent in an action, with and without load."""
    return view.tally.ticks[i, action, 0] + view.tally.ticks[i, action, 1]
