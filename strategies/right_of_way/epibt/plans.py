"""Plans from tick to tick: what robots go on with, and who stays where it is.

A robot that is where its plan led it goes on with the rest of it; all others plan to wait. So do robots
whose plans lead into the cells of these, and so on; all other plans are free of conflicts, as they were.
"""

import numpy as np

from automaton.engine.state import CLOCK_TICK, GOAL_NONE, GOAL_PARK, NIL
from automaton.strategy.kernels import gate_before, has_gates, has_room, kernel
from strategies.right_of_way.arrivals import is_at_goal
from strategies.right_of_way.epibt.candidates import is_kept_by_gate
from strategies.right_of_way.epibt.chains import enter_path
from strategies.right_of_way.epibt.operations import FORWARD, FULL_WAIT


@kernel
def steer_robots(view, batch, state):
    """Note which robots of the batch plan in this tick, by identity; return their number.

    The others are fixed: those that are busy, down, or at the cells where they begin what they came for.
    """
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        state.is_fixed[i] = 1
        state.pose[i] = NIL
        if robots.cell[i] != NIL:
            state.pose[i] = np.int64(robots.cell[i]) * 4 + np.int64(robots.heading[i])
    count = 0
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        note_finished_goal(view, state, i)
        if robots.cell[i] != NIL and not is_at_goal(view, i):
            state.is_fixed[i] = 0
            state.steered[count] = i
            count += 1
    return count


@kernel
def note_finished_goal(view, state, i):
    """A robot that has another goal than before, and is where it had to go, has finished a goal."""
    goal = np.int64(view.robots.goal_cell[i]) + 1
    if goal == state.last_goal[i]:
        return
    if state.last_goal[i] == 0 or state.last_goal[i] == view.robots.cell[i] + 1:
        state.idle_since[i] = view.clock[CLOCK_TICK]
    state.last_goal[i] = goal


@kernel
def inherit_plans(view, state):
    """Enter the paths of all robots on the floor: the rest of their plans, or a wait."""
    robots = view.robots
    waiting = 0
    for i in range(robots.cell.shape[0]):
        pose = np.int64(state.pose[i])
        goes_on = not state.is_fixed[i] and state.expected_pose[i] == pose + 1
        state.expected_pose[i] = 0
        state.plan[i] = state.following[state.plan[i]] if goes_on else FULL_WAIT
        if pose == NIL:
            continue
        if has_gates(view) and state.action[state.plan[i]] == FORWARD:
            goes_on = goes_on and not is_kept_by_gate(view, state, i)
            state.plan[i] = state.plan[i] if goes_on else FULL_WAIT
        if goes_on and state.plan[i] != FULL_WAIT:
            enter_path(state, i, i)
        else:
            state.chain_robot[waiting] = i
            waiting += 1
    while waiting:
        waiting -= 1
        i = np.int64(state.chain_robot[waiting])
        waiting = hold_cell(state, i, np.int64(state.pose[i]) >> 2, waiting)
        if robots.claim[i] != NIL:
            waiting = hold_cell(state, i, np.int64(robots.claim[i]), waiting)


@kernel
def hold_cell(state, i, cell, waiting):
    """Robot i holds a cell in all ticks; robots that planned to be there wait, too.

    These come onto the list of robots that wait; returns its length.
    """
    for tick in range(state.depth):
        other = np.int64(state.occupied[cell, tick])
        if other != NIL and other != i:
            enter_path(state, other, NIL)
            state.plan[other] = FULL_WAIT
            state.chain_robot[waiting] = other
            waiting += 1
    for tick in range(state.depth):
        state.occupied[cell, tick] = i
    return waiting


@kernel
def enter_floor(view, state, i):
    """Return whether robot i may leave its parking bay; its home cell is then held for it.

    It may if that cell is empty, and no robot has planned to be there.
    """
    robots = view.robots
    home = np.int64(robots.home[i])
    if gate_before(view, i, home) != NIL:
        return False
    if not has_room(view.traffic.occupancy, home, 0):
        return False
    for tick in range(state.depth):
        if state.occupied[home, tick] != NIL:
            return False
    state.pose[i] = home * 4
    hold_cell(state, i, home, 0)
    return True


@kernel
def waits_in_bay(view, i):
    """Return whether robot i is in its parking bay and has somewhere to go."""
    goal_type = view.robots.goal_type[i]
    return view.robots.cell[i] == NIL and goal_type != GOAL_NONE and goal_type != GOAL_PARK


@kernel
def clear_paths(view, state):
    """Leave `occupied` as empty as it was."""
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        if state.pose[i] == NIL:
            continue
        enter_path(state, i, NIL)
        if robots.claim[i] != NIL:
            for tick in range(state.depth):
                state.occupied[robots.claim[i], tick] = NIL
