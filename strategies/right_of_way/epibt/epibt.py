"""Enhanced priority inheritance with backtracking, EPIBT (Yukhnevich & Andreychuk, AAAI-26).

In each tick every robot has a plan of D actions without conflicts with other plans, and does the first
action. The rest of each plan carries over to the next tick. Then robots choose again in order: robots
nearest to their goals first, or to the ends of their orders, or robots that have gone longest without
finishing a goal; robots that drive home last. A robot may push another one out of its way, which must
choose another plan at once (`build`). Afterwards some robots try further pushes regardless of the order
(repair, large neighbourhood search). Effort is counted in pushes and tries, never in time, so runs are
reproducible.
"""

from typing import ClassVar

import numpy as np

from automaton.strategy.api import (
    CMD_GO,
    CMD_HOLD,
    GOAL_NONE,
    GOAL_PARK,
    NIL,
    STATUS_UP,
    STOP_ON_TARGETS,
    STREAM_STRATEGY,
    Strategy,
    gate_before,
    has_gates,
    is_empty,
    is_in_own_queue,
    kernel,
    prefetch,
    random_between,
)
from strategies.right_of_way.epibt.candidates import (
    CANDIDATE_MASK,
    LAST_KEY,
    MEETS_NONE,
    ask_idle_robot_ahead,
    build,
    end_of,
    find_goal,
    is_kept,
    limit_drivers,
    nth_key,
    rank_candidates,
    rest_of_order,
    robot_met,
    settle_ties,
    sort_by_key,
)
from strategies.right_of_way.epibt.epibt_state import (
    FORWARD,
    FULL_WAIT,
    LEFT,
    NO_AIM,
    RIGHT,
    WAIT,
    EpibtState,
    cell_after,
    cell_held,
    enter_path,
    epibt_state,
    look_where_it_is,
)
from strategies.right_of_way.right_of_way_parameters import EpibtParameters
from strategies.right_of_way.steering import (
    COUNTERS,
    break_deadlocks,
    count_callers,
    has_stood_long,
    is_at_goal,
    is_given_up,
    is_time_to_look,
    note_progress,
    round_of_stall,
)

STREAM_PLAN_REPAIRS = STREAM_STRATEGY + 40
POWER_BITS = 10
PREFETCH_DISTANCE = 8  # robots in the sequence


@kernel
def decide(view, batch, decisions, memory, workspace):
    state = EpibtState.of(memory)
    count_callers(view, state.service_areas)
    count = steer_robots(view, batch, state)
    if state.rest_weight:
        weigh_rest_of_orders(view, workspace, state, count)
    inherit_plans(view, state)
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        if waits_in_bay(view, i):
            enter_floor(view, state, i)
    stall = np.int64(0)
    if state.takes_time:
        note_progress(view, state.deadlocks)
        stall = round_of_stall(view, state.deadlocks)
    rank_all_candidates(view, workspace, state, count, stall)
    sort_by_key(state, count)
    # Robots of equal age could not push each other.
    if state.oldest_first or stall or state.starved_after != NIL:
        settle_ties(state, count)
    if state.drivers != NIL and stall == 0:
        limit_drivers(state, count)
    choose_plans(state, count)
    if state.repair_tries:
        repair_plans(view, state, count)
    give_commands(view, batch, decisions, state)
    if is_time_to_look(view, state.deadlocks):
        look_for_deadlocks(view, state, count)
    clear_paths(view, state)


class Epibt(Strategy):
    """Robots plan a few actions ahead and push each other in order (EPIBT), with optional repairs."""

    layer = "right_of_way"
    Parameters = EpibtParameters
    compiled = decide
    counters: ClassVar = COUNTERS
    steers = True
    period = 1

    def reset(self, view):
        """Return a state with the operations on this floor and no plans."""
        return epibt_state(view, self.parameters)


# Plans from tick to tick: robots that continue, and robots that stay.
#
# A robot that is where its plan led it continues the plan; all others plan to wait. Robots whose plans
# lead into the cells of waiting robots also wait, and so on. All other plans remain free of conflicts,
# except where a move takes longer than planned, in a slow zone: then the later robot waits.


@kernel
def steer_robots(view, batch, state):
    """List the robots that plan in this tick, by identity; return their number.

    These are the robots of the batch, and robots that already move or turn, for their next action. The
    others are fixed: robots that work, are down, have reached the cell of their work, or are in the queue
    there.
    """
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        look_where_it_is(view, state, i)
        state.is_fixed[i] = state.delay[i] == 0 or robots.status[i] != STATUS_UP
    for k in range(batch.count):
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
    """Return whether robot i is off the floor, begins its work, or is in the queue for it."""
    robots = view.robots
    if robots.cell[i] == NIL or is_in_own_queue(view, i):
        return True
    if state.delay[i] == 0:
        return is_at_goal(view, i)
    cell = np.int64(state.pose[i]) >> 2
    return robots.goal_type[i] != GOAL_NONE and cell == robots.goal_cell[i]


@kernel
def note_finished_goal(view, state, i):
    """Note finished goals: a robot is at its previous goal and now has another one."""
    goal = np.int64(view.robots.goal_cell[i]) + 1
    if goal == state.last_goal[i]:
        return
    if state.last_goal[i] == 0 or state.last_goal[i] == view.robots.cell[i] + 1:
        state.idle_since[i] = view.clock.tick
    state.last_goal[i] = goal


@kernel
def weigh_rest_of_orders(view, workspace, state, count):
    """Weigh the rest of the order of each robot that has a new goal or a new order."""
    robots = view.robots
    for k in range(count):
        i = np.int64(state.steered[k])
        order = np.int64(robots.order[i] if robots.order[i] != NIL else robots.load[i])
        if state.rest_goal[i] != robots.goal_cell[i] or state.rest_order[i] != order:
            state.rest_goal[i] = robots.goal_cell[i]
            state.rest_order[i] = order
            state.rest[i] = state.rest_weight * rest_of_order(view, workspace, i, order)


@kernel
def inherit_plans(view, state):
    """Add the paths of all robots on the floor: the rest of their plans, or a wait."""
    robots = view.robots
    waiting = 0
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        pose = np.int64(state.pose[i])
        expected = np.int64(state.expected_pose[i])
        goes_on = not state.is_fixed[i] and abs(expected) == pose + 1
        goes_on = goes_on and not stands_on_target(view, i)
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
        plan = np.int64(state.plan[i])
        if plan != FULL_WAIT and robot_met(state, i, plan) == MEETS_NONE:
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
def stands_on_target(view, i):
    """Return whether robot i has come to its target in a one-shot problem, where its plan ends."""
    robots = view.robots
    is_there = robots.goal_type[i] == GOAL_NONE and robots.cell[i] == robots.home[i]
    return is_there and view.rules.stop == STOP_ON_TARGETS


@kernel
def hold(state, i, cell, tick, waiting):
    """Let robot i occupy a cell after a tick; a robot that planned to be there must wait.

    Such a robot is added to the list of waiting robots. Returns the length of the list.
    """
    other = np.int64(state.occupied[cell, tick])
    if other != NIL and other != i:
        enter_path(state, other, NIL)
        if state.plan[other] != FULL_WAIT:  # else it is already on the list
            state.plan[other] = FULL_WAIT
            state.chain_robot[waiting] = other
            waiting += 1
    state.occupied[cell, tick] = i
    return waiting


@kernel
def enter_floor(view, state, i):
    """Return whether robot i may leave its parking bay; if so, reserve its home cell.

    It may if the home cell is empty and no robot has planned to be there.
    """
    robots = view.robots
    home = np.int64(robots.home[i])
    if gate_before(view, i, home) != NIL:
        return False
    if not is_empty(view.traffic, home, 0, view.clock.tick):
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
    """Return whether robot i is in its parking bay and has a goal."""
    goal_type = view.robots.goal_type[i]
    return view.robots.cell[i] == NIL and goal_type != GOAL_NONE and goal_type != GOAL_PARK


# New plans.


@kernel
def rank_all_candidates(view, workspace, state, count, stall):
    """Rank the operations of all robots; if actions take several ticks, ask idle robots to make room.

    A robot that must first turn cannot leave in time for any plan of the robot behind it, so pushing it
    fails in every tick. If asked, it begins to leave by itself, and may ask another idle robot.
    """
    for k in range(count + PREFETCH_DISTANCE):
        if k < count:
            i = np.int64(state.steered[k])
            state.asked[i] = 0
            find_goal(view, workspace, state, i)
        if k >= PREFETCH_DISTANCE:
            i = np.int64(state.steered[k - PREFETCH_DISTANCE])
            rank_candidates(view, workspace, state, i, stall)
    if state.takes_time:
        asked = 0  # in the list chain_robot
        for k in range(count):
            i = np.int64(state.steered[k])
            if state.sequence_key[i] != LAST_KEY and state.asked[i] == 0:
                asked = ask_idle_robot_ahead(view, state, i, asked)
        place = 0
        while place < asked:
            i = np.int64(state.chain_robot[place])
            rank_candidates(view, workspace, state, i, stall)
            asked = ask_idle_robot_ahead(view, state, i, asked)
            place += 1


@kernel
def choose_plans(state, count):
    """Let robots with goals choose in order; robots already visited by a chain are skipped.

    If actions take several ticks, a robot whose push failed still chooses: it may be on its way out, but
    too late for the robot that pushed it.
    """
    state.stamp += 1
    stamp = state.stamp
    for place in range(count):
        if place + PREFETCH_DISTANCE < count:
            fetch_robot(state, np.int64(state.sequence[place + PREFETCH_DISTANCE]))
        i = np.int64(state.sequence[place])
        if state.sequence_key[i] == LAST_KEY:
            break  # robots without goals only make room
        visited = state.visit_stamp[i] == stamp
        if not visited or (state.takes_time and state.settled[i] != stamp):
            build(state, i, False)


@kernel
def fetch_robot(state, i):
    """Prefetch the candidates of robot i, and who is in its cell."""
    prefetch(state.key, np.uint64(i * state.key.shape[1]))
    prefetch(state.occupied, np.uint64((np.int64(state.pose[i]) >> 2) * state.occupied.shape[1]))


@kernel
def repair_plans(view, state, count):
    """Let random robots push others regardless of the order, if this lowers the total cost.

    The power of a robot falls from 1 to 0 with the square of its place in the order.
    """
    for place in range(count):
        i = np.int64(state.sequence[place])
        power = ((count - place) << POWER_BITS) // count
        state.power[i] = power * power if state.sequence_key[i] != LAST_KEY else 0
    seed, tick = view.rules.seed, view.clock.coarse_tick
    for number in range(count * state.repair_tries):
        place = random_between(0, count - 1, seed, STREAM_PLAN_REPAIRS, tick, number)
        i = np.int64(state.steered[place])
        if state.sequence_key[i] != LAST_KEY:
            state.stamp += 1
            build(state, i, True)


# Commands, and wait cycles.


@kernel
def give_commands(view, batch, decisions, state):
    """Write the first actions of all plans as commands."""
    out, robots = decisions.right_of_way, view.robots
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        if waits_in_bay(view, i):
            at_gate = gate_before(view, i, np.int64(robots.home[i])) != NIL
            holds = state.pose[i] == NIL and not at_gate
            out.command[k] = CMD_HOLD if holds else CMD_GO
            out.value[k] = NIL if holds else 0
        elif not state.is_fixed[i]:
            out.value[k] = begin_action(view, state, i)
            asks = out.value[k] == robots.heading[i] and is_kept(view, state, i)
            if asks or state.action[state.plan[i]] != WAIT:
                out.command[k] = CMD_GO
            elif robots.goal_type[i] != GOAL_NONE:
                out.command[k] = CMD_HOLD


@kernel
def begin_action(view, state, i):
    """Return the direction in which robot i goes, or would go if it did not wait; or NIL.

    Stores the pose to which its action leads.
    """
    pose, plan = np.int64(state.pose[i]), np.int64(state.plan[i])
    cell, heading = pose >> 2, pose & 3
    action, aim = state.action[plan], np.int64(state.aim[plan])
    if action == FORWARD:
        cell += view.grid.offset[heading]
    elif action == RIGHT:
        heading = (heading + 1) & 3
    elif action == LEFT:
        heading = (heading + 3) & 3
    elif state.key_count[i]:
        best = nth_key(state, i, 0) & CANDIDATE_MASK
        aim = np.int64(state.aim[state.candidate[best]])
    state.expected_pose[i] = cell * 4 + heading + 1
    return np.int64(NIL) if aim == NO_AIM else (pose + aim) & 3


@kernel
def look_for_deadlocks(view, state, count):
    """Find the blockers of robots that have stood for long, and break wait cycles."""
    deadlocks = state.deadlocks
    for k in range(count):
        i = np.int64(state.steered[k])
        if state.delay[i] or not has_stood_long(view, deadlocks, i):
            continue
        leaves = end_of(state, i, np.int64(state.plan[i])) >> 2 != state.pose[i] >> 2
        if deadlocks.aside[i] and leaves and not is_given_up(view, deadlocks, i):
            continue
        enter_blocker(view, state, i)
        deadlocks.aside[i] = 0
    break_deadlocks(view, deadlocks)


@kernel
def enter_blocker(view, state, i):
    """Store the robot, if any, in the cell that robot i wants to enter."""
    pose, direction = np.int64(state.pose[i]), np.int64(state.deadlocks.aside[i]) - 1
    if direction == NIL:
        aim = np.int64(NO_AIM)
        if state.key_count[i]:
            best = nth_key(state, i, 0) & CANDIDATE_MASK
            aim = np.int64(state.aim[state.candidate[best]])
        if aim == NO_AIM:
            return
        direction = (pose + aim) & 3
    u = np.int64(state.occupied[(pose >> 2) + view.grid.offset[direction], 0])
    if u != NIL and u != i:
        state.deadlocks.blocker[i] = view.robots.identity[u]
        state.deadlocks.first_choice[i] = direction + 1


@kernel
def clear_paths(view, state):
    """Clear `occupied`."""
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        if state.pose[i] != NIL:
            enter_path(state, i, NIL)
