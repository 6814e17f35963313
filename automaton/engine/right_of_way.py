"""How decisions of right of way enter the world: steps, waits, retreats, and steering."""

import numpy as np

from automaton.engine.decisions import (
    CMD_GO,
    CMD_HOLD,
    CMD_RETREAT,
    CMD_STEP,
    CMD_TURN,
    CMD_WAIT,
)
from automaton.engine.fulfilment import has_started, return_order
from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import (
    begin,
    clear_right_of_way,
    clear_route_request,
    count_lost_tick,
    drop_route,
    headings_of,
    is_facing,
    note_refusal,
    record_change,
    refuse,
    replan,
    request_allocation,
    request_right_of_way,
    set_goal,
)
from automaton.engine.record_codes import (
    CHANGE_DURATION,
    EXECUTED_BLOCKED,
    EXECUTED_RETREAT,
    EXECUTED_WAIT,
)
from automaton.engine.refusals import (
    RULE_GO_BAY,
    RULE_HOLD,
    RULE_PARKED,
    RULE_PRIORITY,
    RULE_RETREAT,
    RULE_RIGHT_OF_WAY,
    RULE_STEERING,
    RULE_STEP_BAY,
    RULE_STEP_DIRECTION,
    RULE_STEP_EXIT,
    RULE_STEP_TURN,
    RULE_TURN,
    RULE_TURN_CELL,
    RULE_WAIT,
    RULE_WAIT_PARKED,
)
from automaton.engine.state import (
    ACTION_BLOCKED,
    ACTION_RETREAT,
    ACTION_WAIT,
    GOAL_CHARGE,
    GOAL_NONE,
    GOAL_PARK,
    HOLD,
    KEEP,
    MAY_TURN,
    NIL,
    NO_STEP,
    REASON_ORDER_RETURNED,
    RETRY_EXHAUSTED,
    RETRY_NONE,
)

MAX_COMMAND_TICKS = 10_000  # of one wait or retreat


@kernel
def commit_right_of_way(world, record, batch, decisions):
    robots = world.robots
    out = decisions.right_of_way
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        command, value = np.int64(out.command[k]), np.int64(out.value[k])
        if world.rules.steered[0]:
            robots.step[i] = NO_STEP
        if out.priority[k] != KEEP:
            if -32768 <= out.priority[k] <= 32767:
                robots.priority[i] = out.priority[k]
            else:
                identity = np.int64(robots.identity[i])
                note_refusal(world, identity, RULE_PRIORITY, np.int64(out.priority[k]), 0)
        if command == KEEP:
            if robots.retry_state[i] == RETRY_EXHAUSTED:
                robots.retry_state[i] = RETRY_NONE
                clear_right_of_way(world, i)
        elif world.rules.steered[0]:
            commit_steering(world, record, i, command, value)
        elif robots.parked[i] and command != CMD_STEP:
            refuse(world, i, RULE_PARKED, command)
        elif command == CMD_STEP:
            step(world, i, value, bar_to_step(world, i, value), value)
        elif command == CMD_TURN:
            direction = direction_of_turn(world, i, value)
            step(world, i, value, bar_to_turn(world, i, value), direction)
        elif command == CMD_WAIT and 1 <= value <= MAX_COMMAND_TICKS:
            pause(world, record, i, value)
        elif command == CMD_RETREAT and value == 0:
            plan_again(world, record, i, out.return_order[k])
        elif command == CMD_RETREAT and 1 <= value <= MAX_COMMAND_TICKS:
            retreat(world, record, i, value, out.return_order[k])
        elif command == CMD_WAIT or command == CMD_RETREAT:
            refuse(world, i, RULE_WAIT if command == CMD_WAIT else RULE_RETREAT, value)
        else:
            refuse(world, i, RULE_RIGHT_OF_WAY, command)


@kernel
def commit_steering(world, record, i, command, value):
    """What a steering right of way may ask of robot i, in its parking bay or on the floor."""
    robots = world.robots
    in_bay = robots.cell[i] == NIL
    waits_in_bay = in_bay and robots.goal_type[i] != GOAL_NONE and robots.goal_type[i] != GOAL_PARK
    if command == CMD_GO and waits_in_bay and 0 <= value < 4:
        robots.step[i] = value  # out of its parking bay, in whatever direction
    elif command == CMD_GO:
        bar = bar_to_step(world, i, value)
        if bar != NIL:
            refuse(world, i, bar + (RULE_GO_BAY - RULE_STEP_BAY), value)
        else:
            steer(world, i, value)
    elif command == CMD_TURN:
        bar = bar_to_turn(world, i, value)
        if bar != NIL:
            refuse(world, i, bar, value)
        else:
            steer(world, i, direction_of_turn(world, i, value))
    elif command == CMD_HOLD and -1 <= value < 4:
        if robots.parked[i] and in_bay == 0 and robots.goal_type[i] != GOAL_NONE:
            robots.parked[i] = 0  # it has work: its lost ticks count from now on
            world.clock.unparked += 1
        if waits_in_bay or robots.parked[i] == 0:
            robots.step[i] = HOLD | (NO_STEP if value == NIL else value)
    elif command == CMD_WAIT and 1 <= value <= MAX_COMMAND_TICKS and robots.parked[i] == 0:
        pause(world, record, i, value)
    elif command == CMD_HOLD:
        refuse(world, i, RULE_HOLD, value)
    elif command == CMD_WAIT:
        refuse(world, i, RULE_WAIT_PARKED if robots.parked[i] else RULE_WAIT, value)
    else:
        refuse(world, i, RULE_STEERING, command)


@kernel
def steer(world, i, direction):
    """Robot i moves in a direction, or turns towards it; a parked robot leaves its place."""
    robots = world.robots
    robots.step[i] = direction
    if robots.parked[i]:
        robots.parked[i] = 0
        world.clock.unparked += 1
        if robots.goal_type[i] == GOAL_NONE:  # pushed from its place: it returns by itself
            set_goal(world, i, GOAL_PARK, np.int64(robots.home[i]))


@kernel
def direction_of_turn(world, i, quarters):
    """The direction that robot i faces after a quarter turn: 1 clockwise, 3 to the left."""
    robots = world.robots
    headings = headings_of(world.grid, robots.type[i])
    return (np.int64(robots.heading[i]) + quarters) & (headings - 1)


@kernel
def bar_to_turn(world, i, quarters):
    """The rule of CMD_TURN that keeps robot i from turning, or NIL."""
    robots = world.robots
    if quarters != 1 and quarters != 3:
        return RULE_TURN
    if robots.cell[i] == NIL or headings_of(world.grid, robots.type[i]) == 1:
        return RULE_TURN_CELL
    flags = np.int64(world.grid.type_cell_flags[robots.type[i], robots.cell[i]])
    return NIL if flags & MAY_TURN else RULE_TURN_CELL


@kernel
def bar_to_step(world, i, direction):
    """The rule of CMD_STEP that keeps robot i from moving in a direction or turning towards it, or
    NIL; the rules of CMD_GO follow in the same order."""
    robots = world.robots
    if direction < 0 or direction > 3:
        return RULE_STEP_DIRECTION
    if robots.cell[i] == NIL:
        return RULE_STEP_BAY
    flags = np.int64(world.grid.type_cell_flags[robots.type[i], robots.cell[i]])
    if (flags >> direction) & 1 == 0:
        return RULE_STEP_EXIT
    return NIL if flags & MAY_TURN or is_facing(world, i, direction) else RULE_STEP_TURN


@kernel
def step(world, i, value, bar, direction):
    """Execute one move in a direction, or the turn towards it, unless a rule bars the command's value;
    outside a retreat the route is then planned again.

    A robot that is parked on the floor leaves its place.
    """
    robots = world.robots
    if bar != NIL:
        refuse(world, i, bar, value)
        return
    if robots.retreat_moves[i] == 0:
        drop_route(robots, i)
        robots.retry_state[i] = RETRY_NONE
        clear_right_of_way(world, i)
    if robots.parked[i]:
        robots.parked[i] = 0
        world.clock.unparked += 1
    robots.step[i] = direction


@kernel
def pause(world, record, i, ticks):
    """Wait; in a retreat this ends it, and the plan is made again around the robots."""
    robots = world.robots
    begin(world, i, ACTION_WAIT, ticks)
    robots.executed[i] = EXECUTED_WAIT
    record_change(world.clock, record, CHANGE_DURATION, robots.identity[i], ticks)
    clear_right_of_way(world, i)
    robots.retry_state[i] = RETRY_NONE
    if robots.retreat_moves[i]:
        robots.retreat_moves[i] = 0
        replan(world, i)


@kernel
def retreat(world, record, i, moves, returns):
    """Begin a retreat; the tick of the decision executes nothing."""
    robots = world.robots
    count_lost_tick(world, i, ACTION_RETREAT)
    robots.busy[i] = 1
    robots.executed[i] = EXECUTED_RETREAT
    robots.retreat_moves[i] = moves
    robots.failed_retries[i] = 0
    robots.retry_state[i] = RETRY_NONE
    drop_route(robots, i)
    request_right_of_way(world, i)
    if returns:
        choose_again(world, record, i)


@kernel
def plan_again(world, record, i, returns):
    """A retreat of 0 moves: robot i plans again where it stands; this tick executes nothing.

    Its failed retries still count: the next one may lead to a retreat.
    """
    robots = world.robots
    count_lost_tick(world, i, ACTION_BLOCKED)
    robots.busy[i] = 1
    robots.executed[i] = EXECUTED_BLOCKED
    robots.retreat_moves[i] = 0
    robots.retry_state[i] = RETRY_NONE
    clear_right_of_way(world, i)
    drop_route(robots, i)
    if not (returns and choose_again(world, record, i)):
        replan(world, i)


@kernel
def choose_again(world, record, i):
    """Robot i returns an order that it has not begun and asks for another one; else returns False."""
    robots = world.robots
    if robots.load[i] != NIL or has_started(world, i) or robots.goal_type[i] == GOAL_CHARGE:
        return False
    if robots.order[i] != NIL:
        return_order(world, record, i)
    robots.goal_type[i] = GOAL_NONE
    robots.goal_cell[i] = NIL
    clear_route_request(world, i)
    request_allocation(world, i, REASON_ORDER_RETURNED)
    return True
