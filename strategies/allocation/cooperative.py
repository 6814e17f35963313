"""Cooperative planning (Grzejszczak & Nocon, Algorithm 2): a bucket brigade across the tables.

An *alley* is a column of the floor from which loads are picked up to its left. A robot reserves an
alley and moves the loads of its left table one table to the right, where the robot of the next alley
finds them; only what finds no empty shelf goes to its destination. Alley reservations are kept here,
in the strategy's memory; everything else is read off the order list.
"""

import numpy as np

from automaton.engine.state import (
    CMD_PARK,
    NIL,
    REASON_ORDER_RETURNED,
    REASON_PERIODIC,
    REASON_PICKED,
)
from automaton.strategy.kernels import (
    can_do,
    dropoff_cell,
    find_path,
    kernel,
    pickup_cell,
    position,
)
from automaton.strategy.layer import Strategy, memory_of
from strategies.allocation.independent import deliver, set_down, take_order, takes_load
from strategies.allocation.open_orders import is_open

ALLEY = 0  # memory.per_robot: the column of the alley that a robot has reserved, or 0
FROM = 1  # the column of the shelf from which it takes its load

# memory.shared: for each column of the grid
TABLE_OPEN = 0  # open orders to its left
TABLE_LEFT = 1  # loads on its left table
TABLE_RIGHT = 2  # loads on its right table


@kernel
def count_tables(view, out, i, count):
    """count: (3 * width,) becomes the TABLE_* numbers of every column as robot i can serve them."""
    width, robot_type = view.grid.width, view.robots.type[i]
    count[:] = 0
    for slot in range(view.slots.cell.shape[0]):
        order = np.int64(view.slots.content[slot])
        if view.slots.unbounded[slot] or order == NIL:
            continue
        access_cell = pickup_cell(view, robot_type, slot, NIL)
        if access_cell == NIL:
            continue
        column = access_cell % width
        count[TABLE_LEFT * width + column] += 1
        if is_open(view, out, order) and can_do(view, i, order):
            count[TABLE_OPEN * width + column] += 1
        from_left = view.slots.access[slot, 2]
        if from_left != NIL:
            count[TABLE_RIGHT * width + from_left % width] += 1


@kernel
def choose_alley(view, memory, i):
    """The free alley with open orders and the most loads left less right; NIL if there is none.

    Ties: nearest in x, then the lowest.
    """
    width = view.grid.width
    x = position(view, i) % width
    best, best_score, best_way = NIL, 0, 0
    for column in range(width):
        if memory.shared[TABLE_OPEN * width + column] == 0 or is_reserved(memory, i, column):
            continue
        score = (
            memory.shared[TABLE_LEFT * width + column] - memory.shared[TABLE_RIGHT * width + column]
        )
        way = abs(column - x)
        if best == NIL or score > best_score or (score == best_score and way < best_way):
            best, best_score, best_way = column, score, way
    return best


@kernel
def is_reserved(memory, i, column):
    """Whether another robot has this alley."""
    for j in range(memory.per_robot.shape[0]):
        if j != i and memory.per_robot[j, ALLEY] == column:
            return True
    return False


@kernel
def first_order(view, out, workspace, i, column, around):
    """The open order of lowest y in an alley; `around`: the first that is reachable now."""
    here, robot_type = position(view, i), view.robots.type[i]
    heading = np.int64(view.robots.heading[i])
    first = NIL
    for slot in range(view.slots.cell.shape[0]):
        order = np.int64(view.slots.content[slot])
        if view.slots.unbounded[slot] or order == NIL or not is_open(view, out, order):
            continue
        access_cell = pickup_cell(view, robot_type, slot, NIL)
        if access_cell % view.grid.width != column or not can_do(view, i, order):
            continue
        if first == NIL:
            first = order
        if not around:
            return order
        if (
            find_path(
                view, workspace, robot_type, here, heading, access_cell, True, workspace.steps
            )
            != NIL
        ):
            return order
    return first


@kernel
def take_in_alley(view, out, memory, workspace, k, i, released):
    """Decision k: the first open order of the robot's alley, of a better one, or home."""
    width = view.grid.width
    count_tables(view, out, i, memory.shared)
    column = np.int64(memory.per_robot[i, ALLEY])
    if column == 0 or memory.shared[TABLE_OPEN * width + column] == 0:
        memory.per_robot[i, ALLEY] = 0
        column = choose_alley(view, memory, i)
        if column == NIL:
            out.command[k] = CMD_PARK
            return
        memory.per_robot[i, ALLEY] = column
    order = first_order(view, out, workspace, i, column, released)
    memory.per_robot[i, FROM] = view.slots.cell[view.orders.current_slot[order]] % width
    take_order(view, out, k, i, order)


@kernel
def pass_right(view, out, memory, k, i):
    """Decision k: the empty shelf of the next table to the right, nearest in y; else deliver.

    A load is never passed beyond its own target, and always to the right of where it lay, on
    whichever side of its shelf the robot stands: so it arrives after finitely many passes.
    """
    width = view.grid.width
    here, robot_type = position(view, i), view.robots.type[i]
    x, y = max(here % width, memory.per_robot[i, FROM]), here // width
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


@kernel
def decide(view, batch, decisions, memory, workspace):
    out = decisions.allocation
    for k in range(batch.count[0]):
        if workspace.stop[0]:
            return
        i = np.int64(batch.robot[k])
        reason = batch.reason[k]
        if reason == REASON_PICKED:
            pass_right(view, out, memory, k, i)
        elif reason != REASON_PERIODIC:
            take_in_alley(view, out, memory, workspace, k, i, reason == REASON_ORDER_RETURNED)


class Cooperative(Strategy):
    """Bucket brigade: robots reserve alleys and pass loads to the next table on the right."""

    layer = "allocation"
    compiled = decide

    def reset(self, view):
        return memory_of(view, per_robot=2, shared=3 * view.grid.width)
