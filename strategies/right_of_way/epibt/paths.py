"""The cells of operations tick by tick, where moves and turns take ticks of their own.

A robot that begins a move holds the cell that it leaves and the one that it enters, by the rule of
following: under `none` to the end of the move; under `handover` in its last tick the new one alone; under
`convoy` the new one alone from the first tick on, as another robot may follow at once. What is begun goes
on before a plan: so a plan begins `delay` ticks from now, with the pose to which that leads. A wait
lasts until robots are asked again, mostly one tick, and a plan that is done waits on.
"""

import numpy as np

from automaton.engine.state import ACTION_TURN, NIL
from automaton.strategy.kernels import kernel
from strategies.right_of_way.epibt.operations import FORWARD, RIGHT, WAIT


def paths_of(offsets, operations, paces, ticks, late):
    """Return twice (4 B, O, T): the cell after each tick, and the one that is still held.

    Both as offsets, by pace and first heading. `paces`: (move, turn, wait) in ticks; `offsets`: of a
    move, by heading; `late`: 1 where the cell that is left is held in the last tick, too.
    """
    shape = 4 * len(paces), len(operations.actions), ticks
    offset, left = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    for b, pace in enumerate(paces):
        for first in range(4):
            for number, actions in enumerate(operations.actions):
                here, held = path_of(offsets, actions, first, pace, late)
                rest = [here[-1]] * (ticks - len(here))
                offset[4 * b + first, number] = here + rest
                left[4 * b + first, number] = held + rest
    return offset, left


def path_of(offsets, actions, heading, pace, late):
    """Return the cells of one operation, and those still held, as lists of offsets by tick."""
    here, held, cell = [], [], 0
    move, turn, wait = pace
    for action in actions:
        before = cell
        if action == FORWARD:
            cell += int(offsets[heading])
        elif action != WAIT:
            heading = heading + (1 if action == RIGHT else 3) & 3
        span = move if action == FORWARD else wait if action == WAIT else turn
        here += [cell] * span
        held += [before] * (span - 1 + late) + [cell] * (1 - late)
    return here, held


@kernel
def look_where_it_is(view, state, i):
    """Enter pose, delay and origin of robot i, which stands, or moves or turns already."""
    robots = view.robots
    cell = np.int64(robots.cell[i])
    state.pose[i] = NIL
    state.delay[i] = 0
    state.origin[i] = cell
    if cell == NIL:
        return
    if robots.claim[i] != NIL or robots.action[i] == ACTION_TURN:
        state.delay[i] = min(np.int64(robots.busy[i]), state.ticks)
    if robots.claim[i] != NIL:
        cell = np.int64(robots.claim[i])
    heading = np.int64(robots.heading[i])
    state.row[i] = 4 * np.int64(state.pace[robots.type[i]]) + heading
    state.pose[i] = cell * 4 + heading


@kernel
def cell_after(state, i, operation, tick):
    """Return the cell of robot i after a tick, if it does an operation next."""
    pose, done = np.int64(state.pose[i]), tick - np.int64(state.delay[i])
    if done < 0:
        return pose >> 2
    return (pose >> 2) + np.int64(state.offset[state.row[i], operation, done])


@kernel
def cell_held(state, i, operation, tick):
    """Return the cell that robot i leaves and still holds after a tick, or the one in which it is."""
    pose, done = np.int64(state.pose[i]), tick - np.int64(state.delay[i])
    if done < 0:
        return np.int64(state.origin[i]) if done + 1 < state.holds_late else pose >> 2
    return (pose >> 2) + np.int64(state.left[state.row[i], operation, done])


@kernel
def enter_path(state, i, robot):
    """Write `robot` (or NIL) wherever the plan of robot i leads."""
    plan = np.int64(state.plan[i])
    for tick in range(state.ticks):
        state.occupied[cell_after(state, i, plan, tick), tick] = robot
        if state.holds_two:
            state.occupied[cell_held(state, i, plan, tick), tick] = robot
