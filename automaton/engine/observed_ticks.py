"""Ticks of an observed run: the state of the world is set from what real robots did.

Nothing is decided and no rule of motion applies: two robots may stand in one cell, or swap. Moves,
turns, picks, drops and stops begin as recorded; changes hold cells, headings, loads, orders and charge.
All else follows from these, so that observations and counters are those of a simulated run.
"""

import numpy as np

from automaton.engine.events import action_of, find_cycles, max_events, note_events
from automaton.engine.fulfilment import release_orders
from automaton.engine.jit.kernel import kernel
from automaton.engine.motion import ARRIVED, HELD, LIVE, MOVED, TOWARDS
from automaton.engine.observe import observe
from automaton.engine.operations import note_goal, note_move, note_time, note_turn, put_off, take_on
from automaton.engine.random_numbers import next_tick
from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_DURATION,
    CHANGE_SEEN_CELL,
    CHANGE_SEEN_CHARGE,
    CHANGE_SEEN_GOAL,
    CHANGE_SEEN_HEADING,
    CHANGE_SEEN_LOAD,
    CHANGE_SEEN_ORDER,
    CHANGE_STATUS,
    DROPPED_ON_ARRIVAL,
    EXECUTED_BLOCKED,
    EXECUTED_CHARGE,
    EXECUTED_DROP,
    EXECUTED_NOTHING,
    EXECUTED_PICK,
    EXECUTED_SERVE,
    MOVE_EAST,
    MOVE_NORTH,
    PICKED_ON_ARRIVAL,
    TURN_LEFT,
    TURN_RIGHT,
    WAY_MASK,
    WAY_SHIFT,
)
from automaton.engine.state import (
    ACTION_BLOCKED,
    ACTION_CHARGE,
    ACTION_DOWN,
    ACTION_DROP,
    ACTION_IDLE,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_SERVE,
    ACTION_TURN,
    GOAL_CHARGE,
    GOAL_NONE,
    GOAL_STOP,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_STARTED,
    STATUS_DEPLETED,
    STATUS_UP,
)

KNOWN_BITS = ACTION_MASK | WAY_MASK | PICKED_ON_ARRIVAL | DROPPED_ON_ARRIVAL


@kernel
def show_ticks(world, observation, executed, changes, first, until):
    """Go to tick `until`, or to the tick in which the buffers of the observation are full.

    executed: (T, n) actions from tick `first` on, by identity. changes: rows (tick, code, identity,
    value), sorted by tick. With `first` 0, only the changes of tick 0 are entered.
    """
    clock, robots, traffic = world.clock, world.robots, world.traffic
    if first == 0:
        enter_changes(world, changes, 0)
        return
    row = np.int64(0)
    while row < changes.shape[0] and changes[row, 0] <= clock.tick:
        row += 1
    while clock.tick < until and not is_observation_full(world, observation):
        next_tick(world)
        release_orders(world)
        traffic.move_ticks[:] = 1
        traffic.intent[:] = 0
        acts = executed[clock.tick - first]
        for identity in range(acts.shape[0]):
            i = np.int64(robots.at_index[identity])
            robots.executed[i] = acts[identity] & KNOWN_BITS
        begin = row
        row = enter_changes(world, changes, row)
        for i in range(robots.cell.shape[0]):
            show(world, observation, i)
        for k in range(begin, row):  # a turn begins with the heading before it
            if changes[k, 1] == CHANGE_SEEN_HEADING:
                robots.heading[robots.at_index[changes[k, 2]]] = changes[k, 3]
        if clock.observing:
            observe(world, observation)
            find_cycles(world, observation)
            note_events(world, observation)


@kernel
def is_observation_full(world, observation):
    """Whether the next tick may exceed the buffers of the observation."""
    if world.clock.observing == 0:
        return False
    if observation.count.curve_rows >= observation.curve.shape[0]:
        return True
    return observation.count.events + max_events(world) > observation.events.shape[0]


@kernel
def enter_changes(world, changes, row):
    """Enter the changes of this tick, from a row on; returns the first row of a later tick."""
    robots = world.robots
    while row < changes.shape[0] and changes[row, 0] <= world.clock.tick:
        code, value = changes[row, 1], changes[row, 3]
        i = np.int64(robots.at_index[changes[row, 2]])
        row += 1
        if code == CHANGE_DURATION:
            world.traffic.move_ticks[i] = value
        elif code == CHANGE_SEEN_CELL:
            robots.cell[i], robots.claim[i] = value, NIL
            robots.busy[i] = 0
            robots.parked[i] = 1 if value == NIL else 0
        elif code == CHANGE_SEEN_HEADING:
            if not is_turn(np.int64(robots.executed[i]) & ACTION_MASK):
                robots.heading[i] = value
        elif code == CHANGE_SEEN_CHARGE:
            robots.charge[i] = value
        elif code == CHANGE_SEEN_ORDER:
            change_order(world, i, value)
        elif code == CHANGE_SEEN_LOAD:
            change_load(world, i, value)
        elif code == CHANGE_SEEN_GOAL:
            note_goal(world, i)
            robots.goal_cell[i] = value
        elif code == CHANGE_STATUS:
            world.clock.robots_down += (value != STATUS_UP) - (robots.status[i] != STATUS_UP)
            robots.status[i] = value
    return row


@kernel
def change_order(world, i, order):
    """Robot i now works on another order, or on none; the one before is done."""
    robots, orders = world.robots, world.orders
    before = np.int64(robots.order[i])
    if before != NIL and before != order:
        deliver(world, before)
        if action_of(np.int64(robots.executed[i])) != EXECUTED_DROP:
            world.tally.visits[i] += 1
            world.tally.visited[i] = before
    robots.order[i] = order
    if order == NIL or order == before:
        return
    if orders.state[order] == ORDER_DELIVERED:  # it was handed over
        world.clock.undelivered += 1
        orders.delivered[order] = NIL
    orders.state[order] = ORDER_STARTED
    orders.reserved_by[order] = robots.identity[i]
    orders.dispatched[order] = world.clock.tick
    orders.dispatched_to[order] = robots.identity[i]
    orders.legs[order] += 1


@kernel
def change_load(world, i, order):
    """Robot i now carries another load, or none."""
    before = np.int64(world.robots.load[i])
    if before != NIL:
        put_off(world, i)
        if before != world.robots.order[i] and before != order:
            deliver(world, before)
    if order != NIL:
        take_on(world, i, order)
        world.orders.picked[order] = world.clock.tick
        if world.orders.state[order] != ORDER_DELIVERED:
            world.orders.state[order] = ORDER_CARRIED
            world.orders.reserved_by[order] = world.robots.identity[i]


@kernel
def deliver(world, order):
    """An order is done."""
    if world.orders.state[order] != ORDER_DELIVERED:
        world.orders.state[order] = ORDER_DELIVERED
        world.orders.delivered[order] = world.clock.tick
        world.orders.reserved_by[order] = NIL
        world.clock.undelivered -= 1


@kernel
def show(world, observation, i):
    """Enter what robot i does in this tick."""
    robots = world.robots
    executed = np.int64(robots.executed[i])
    # A pick or a drop is an event only if the load comes or goes now.
    handles = action_of(executed)
    had = world.clock.observing and observation.load_before[i] != NIL
    if (handles == EXECUTED_PICK and robots.load[i] == NIL) or (
        handles == EXECUTED_DROP and not had
    ):
        robots.executed[i] = EXECUTED_SERVE
    act, ticks = executed & ACTION_MASK, np.int64(world.traffic.move_ticks[i])
    loaded = np.int64(1 if robots.load[i] != NIL else 0)
    is_busy = robots.busy[i] > 0
    if is_busy:
        robots.busy[i] -= 1
    if robots.claim[i] != NIL and (robots.busy[i] == 0 or act != EXECUTED_NOTHING):
        robots.cell[i], robots.claim[i] = robots.claim[i], NIL
        world.traffic.intent[i] = ARRIVED
    set_goal_of(world, i, act)
    if MOVE_EAST <= act and act <= MOVE_NORTH:
        show_move(world, i, act - MOVE_EAST, loaded, ticks)
    elif is_turn(act):
        count_action(world, i, ACTION_TURN, loaded, ticks)
        note_turn(world, i, ticks)
    elif act == EXECUTED_CHARGE:
        if robots.action[i] != ACTION_CHARGE:
            world.tally.operations[i, ACTION_CHARGE, 0] += 1
        robots.action[i] = ACTION_CHARGE
        world.tally.ticks[i, ACTION_CHARGE, 0] += 1
    elif act == EXECUTED_BLOCKED:
        count_action(world, i, ACTION_BLOCKED, loaded, 1)
        note_time(world, i, ACTION_BLOCKED, 1)
        way = (executed >> WAY_SHIFT) & 3
        if has_neighbour(world, i, way):
            world.traffic.intent[i] = HELD | TOWARDS | way
    elif act != EXECUTED_NOTHING:
        action = np.int64(ACTION_SERVE)
        if act == EXECUTED_PICK:
            action, loaded = np.int64(ACTION_PICK), np.int64(0)
        elif act == EXECUTED_DROP:
            action, loaded = np.int64(ACTION_DROP), np.int64(1)
        count_action(world, i, action, loaded, ticks)
        note_time(world, i, action, ticks)
    elif robots.status[i] >= STATUS_DEPLETED:
        robots.action[i] = ACTION_DOWN
        world.tally.ticks[i, ACTION_DOWN, 0] += 1 if robots.cell[i] != NIL else 0
    elif not is_busy:
        robots.action[i] = ACTION_IDLE


@kernel
def is_turn(act):
    return act == TURN_LEFT or act == TURN_RIGHT


@kernel
def set_goal_of(world, i, act):
    """The goal of robot i: charging, its order or load, the charger that it drives to, or none."""
    robots = world.robots
    if act == EXECUTED_CHARGE:
        robots.goal_type[i] = GOAL_CHARGE
        robots.goal_cell[i] = robots.cell[i]
    elif robots.order[i] != NIL or robots.load[i] != NIL:
        robots.goal_type[i] = GOAL_STOP
    elif robots.goal_cell[i] != NIL:
        robots.goal_type[i] = GOAL_CHARGE
    else:
        robots.goal_type[i] = GOAL_NONE


@kernel
def show_move(world, i, way, loaded, ticks):
    """Robot i begins a move; one of a single tick also ends."""
    robots = world.robots
    if not has_neighbour(world, i, way):
        return
    to = np.int64(robots.cell[i]) + world.grid.offset[way]
    count_action(world, i, ACTION_MOVE, loaded, ticks)
    if ticks > 1:
        robots.claim[i] = to
    else:
        robots.cell[i] = to
    robots.travel[i] = way
    world.traffic.own_ticks[i] = ticks
    world.traffic.intent[i] = LIVE | MOVED | way
    note_move(world, i, way, ticks)


@kernel
def has_neighbour(world, i, way):
    """Whether there is a cell next to robot i in a direction."""
    to = np.int64(world.robots.cell[i]) + world.grid.offset[way]
    return world.robots.cell[i] != NIL and 0 <= to and to < world.grid.cell_flags.shape[0]


@kernel
def count_action(world, i, action, loaded, ticks):
    """Count an action of robot i that begins; it takes `ticks` ticks, this one included."""
    world.robots.action[i] = action
    world.robots.busy[i] = ticks - 1
    world.tally.active[i] = world.clock.tick + ticks - 1
    world.tally.operations[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += ticks
