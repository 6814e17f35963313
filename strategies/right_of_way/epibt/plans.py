"""Plans from tick to tick: what robots go on with, and who stays where it is.

A robot that is where its plan led it goes on with the rest of it; all others plan to wait. So do robots
whose plans lead into the cells of these, and so on. All other plans are free of conflicts as they were,
but where a move takes longer than planned, in a slow zone: then who comes later waits.
"""

import numpy as np

from automaton.engine.robot_states import STATUS_UP
from automaton.engine.state import CLOCK_TICK, GOAL_NONE, GOAL_PARK, NIL
from automaton.strategy.kernels import gate_before, has_gates, is_empty, is_in_own_queue, kernel
from strategies.right_of_way.arrivals import is_at_goal
from strategies.right_of_way.epibt.candidates import is_kept
from strategies.right_of_way.epibt.chains import FREE, robot_met
from strategies.right_of_way.epibt.operations import FORWARD, FULL_WAIT
from strategies.right_of_way.epibt.paths import cell_after, cell_held, enter_path, look_where_it_is


@kernel
def steer_robots(view, batch, state):
    """Note which robots plan in this tick, by identity; return their number.

    They are those of the batch, and those that move or turn already, for what comes then. The others
    are fixed: those that do something else, are down, at the cells where they begin what they came for,
    or in the queue there.
    """
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        look_where_it_is(view, state, i)
        state.is_fixed[i] = state.delay[i] == 0 or robots.status[i] != STATUS_UP
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        note_finished_goal(view, state, i)
        state.is_fixed[i] = 0
    count = 0
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if state.is_fixed[i] == 0 and has_arrived(view, state, i):
            state.is_fixed[i] = 1
        if state.is_fixed[i] == 0:
            state.steered[count] = i
            count += 1
    return count


@kernel
def has_arrived(view, state, i):
    """Return whether robot i is off the floor, comes to its goal, or is in the queue there."""
    robots = view.robots
    if robots.cell[i] == NIL or is_in_own_queue(view, i):
        return True
    if state.delay[i] == 0:
        return is_at_goal(view, i)
    cell = np.int64(state.pose[i]) >> 2
    return robots.goal_type[i] != GOAL_NONE and cell == robots.goal_cell[i]


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
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        pose = np.int64(state.pose[i])
        expected = np.int64(state.expected_pose[i])
        goes_on = not state.is_fixed[i] and abs(expected) == pose + 1
        state.expected_pose[i] = -(pose + 1) if state.delay[i] else 0
        if not goes_on:
            state.plan[i] = FULL_WAIT
        elif expected > 0:
            state.plan[i] = state.following[state.plan[i]]
        if pose == NIL:
            continue
        may_be_kept = has_gates(view) or view.rules.battery
        if may_be_kept and state.action[state.plan[i]] == FORWARD:
            if is_kept(view, state, i):
                state.plan[i] = FULL_WAIT
        if state.plan[i] != FULL_WAIT and robot_met(state, i, np.int64(state.plan[i])) == FREE:
            enter_path(state, i, i)
        else:
            state.plan[i] = FULL_WAIT
            state.chain_robot[waiting] = i
            waiting += 1
    while waiting:
        waiting -= 1
        i = np.int64(state.chain_robot[waiting])
        for tick in range(state.ticks):
            waiting = hold(state, i, cell_after(state, i, FULL_WAIT, tick), tick, waiting)
            if state.holds_two:
                waiting = hold(state, i, cell_held(state, i, FULL_WAIT, tick), tick, waiting)


@kernel
def hold(state, i, cell, tick, waiting):
    """Robot i holds a cell after a tick; a robot that planned to be there waits, too.

    It comes onto the list of robots that wait; returns its length.
    """
    other = np.int64(state.occupied[cell, tick])
    if other != NIL and other != i:
        enter_path(state, other, NIL)
        if state.plan[other] != FULL_WAIT:  # else it is on the list
            state.plan[other] = FULL_WAIT
            state.chain_robot[waiting] = other
            waiting += 1
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
    if not is_empty(view.traffic, home, 0, view.clock[CLOCK_TICK]):
        return False
    for tick in range(state.ticks):
        if state.occupied[home, tick] != NIL:
            return False
    state.pose[i] = home * 4
    state.row[i] = 4 * np.int64(state.pace[robots.type[i]])
    enter_path(state, i, i)
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
        if state.pose[i] != NIL:
            enter_path(state, i, NIL)
