"""Energy: the charge used by operations, charging, and the queues before chargers.

An operation uses its charge when it begins. A robot without enough charge for its next operation is
exhausted: it does nothing in this tick and is down from the next tick on (automaton.engine.faults).
"""

import numpy as np

from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import LIVE, has_room
from automaton.engine.operations import (
    charger_of,
    consume_energy,
    count_lost_tick,
    energy_cost,
    exhaust,
    request_allocation,
    request_charging,
)
from automaton.engine.record_codes import EXECUTED_BLOCKED, EXECUTED_CHARGE
from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_DROP,
    ACTION_IDLE,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_QUEUE,
    BATTERY_FULL,
    GOAL_CHARGE,
    GOAL_NONE,
    LOST_ACTIONS,
    NIL,
    REASON_IDLE,
    STATUS_EXHAUSTED,
    STATUS_UP,
)


@kernel
def has_energy_for(world, i, action):
    """Whether robot i has enough charge for an operation; if not, it is exhausted."""
    if world.rules.battery == 0:
        return True
    ticks = max(np.int64(world.rules.duration[world.robots.type[i], action]), 1)
    if action == ACTION_PICK or action == ACTION_DROP:
        ticks += world.rules.handling_jitter
    if world.robots.charge[i] < energy_cost(world, i, action, ticks):
        exhaust(world, i)
        return False
    return True


@kernel
def charge_gain(world, i):
    """Units of charge that robot i gains in one tick (or stride) at a charger."""
    charge = np.int64(world.robots.charge[i])
    rate = rate_at(world.rules.curve[world.robots.type[i]], charge)
    return min(world.rules.stride * rate, BATTERY_FULL - charge)


@kernel
def charge_up(world, i):
    """One tick of charging at the robot's goal cell; the robot is free when its level is reached."""
    robots = world.robots
    first = robots.action[i] != ACTION_CHARGE
    robots.ticket[i] = 0
    world.tally.progress[i] = world.clock.tick
    count_lost_tick(world, i, ACTION_CHARGE)
    robots.busy[i] = 1  # motion counts it down in this tick
    world.tally.operations[i, ACTION_CHARGE, 0] -= 0 if first else 1
    robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_CHARGE
    charger = charger_of(world, i)
    if charger != NIL:
        world.chargers.busy_ticks[U(charger)] += world.rules.stride
    more = charge_gain(world, i)
    robots.charge[i] += more
    world.tally.charged[i] += more
    if robots.charge[i] >= robots.charge_target[i]:
        end_charging(world, i)
        request_allocation(world, i, REASON_IDLE)


@kernel
def end_charging(world, i):
    """Robot i is done at its charger."""
    robots = world.robots
    if robots.goal_type[i] == GOAL_CHARGE:
        offer_charger(world, i)
    robots.goal_type[i] = GOAL_NONE
    robots.goal_cell[i] = NIL
    robots.charge_target[i] = 0
    robots.charging_interruptible[i] = 0
    robots.ticket[i] = 0


@kernel
def offer_charger(world, besides):
    """A robot leaves its place at a charger: charging is asked about all other idle robots."""
    if world.rules.watches_chargers[0] == 0:
        return
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        idle = robots.order[i] == NIL and robots.load[i] == NIL and robots.status[i] == STATUS_UP
        if idle and i != besides and robots.goal_type[i] != GOAL_CHARGE:
            request_charging(world, i, REASON_IDLE)


@kernel
def has_line(world, i):
    """Whether robots queue before the charger where robot i is to charge: its places may run out."""
    places = world.chargers.places[world.chargers.charger_at[world.robots.goal_cell[i]]]
    return places == 1 or places < world.robots.cell.shape[0]


@kernel
def cancel_infeasible_moves(world):
    """Cancel moves without enough charge, or out of turn in a charger queue; subtract idle charge.

    Call between `drive` and motion. Robots before their charger wait for their turn: they do not
    try to enter while it is occupied or others came first.
    """
    robots, chargers = world.robots, world.chargers
    count_waiting_for_chargers(world)
    for charger in range(chargers.cell.shape[0]):
        chargers.first_ticket[charger] = 0
        chargers.exit_cell[charger] = NIL
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.cell[U(i)] == NIL or robots.status[U(i)] > STATUS_EXHAUSTED:
            continue
        record_exit_cell(world, i)
        if robots.busy[U(i)]:
            continue
        live = np.int64(world.traffic.intent[U(i)]) & LIVE
        if live and robots.charge[i] < energy_cost(
            world, i, ACTION_MOVE, np.int64(world.traffic.move_ticks[i])
        ):
            world.traffic.intent[i] = 0
            exhaust(world, i)
        if world.traffic.intent[U(i)] == 0:
            consume_energy(world, i, energy_cost(world, i, ACTION_IDLE, world.rules.stride))
        elif live and is_entering_charger(world, i) and has_line(world, i):
            join_charger_queue(world, i)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.ticket[U(i)] and robots.busy[U(i)] == 0 and world.traffic.intent[U(i)] & LIVE:
            block_unless_first(world, i)


@kernel
def record_exit_cell(world, i):
    """Record the cell into which a robot that has finished charging is about to drive out."""
    robots, chargers = world.robots, world.chargers
    charger = np.int64(chargers.charger_at[U(robots.cell[U(i)])])
    if charger == NIL or robots.goal_type[U(i)] == GOAL_CHARGE or robots.claim[U(i)] != NIL:
        return
    if world.rules.steered[0]:
        direction = np.int64(world.traffic.intent[U(i)])
        if direction & LIVE:
            chargers.exit_cell[charger] = robots.cell[U(i)] + world.grid.offset[U(direction & 3)]
    elif robots.route_index[U(i)] < robots.route_length[U(i)]:
        direction = np.int64(robots.route[U(i), U(robots.route_index[U(i)])])
        chargers.exit_cell[charger] = robots.cell[U(i)] + world.grid.offset[U(direction)]


@kernel
def is_entering_charger(world, i):
    """Whether the intended move of robot i leads into the charger where it is to charge."""
    robots = world.robots
    if robots.goal_type[U(i)] != GOAL_CHARGE:
        return False
    direction = np.int64(world.traffic.intent[U(i)]) & 3
    return robots.cell[U(i)] + world.grid.offset[U(direction)] == robots.goal_cell[U(i)]


@kernel
def join_charger_queue(world, i):
    """Robot i keeps its place in the queue before its charger, or joins at the end."""
    robots, chargers = world.robots, world.chargers
    if robots.ticket[i] == 0:
        world.clock.tickets_issued += 1
        robots.ticket[i] = world.clock.tickets_issued
    charger = chargers.charger_at[robots.goal_cell[i]]
    if chargers.first_ticket[charger] == 0 or robots.ticket[i] < chargers.first_ticket[charger]:
        chargers.first_ticket[charger] = robots.ticket[i]


@kernel
def block_unless_first(world, i):
    """Robot i does not move into its charger unless it is first and there is room.

    If the occupant must leave through robot i's cell, the two meet head-on: right of way must
    decide.
    """
    robots, chargers = world.robots, world.chargers
    if not is_entering_charger(world, i):
        return
    charger = chargers.charger_at[robots.goal_cell[i]]
    direction = np.int64(world.traffic.intent[i]) & 3
    room = has_room(world.traffic.occupancy, np.int64(robots.goal_cell[i]), direction)
    one = np.int64(world.grid.cell_flags[robots.cell[i]]) >> 5 & 3 == 1
    head_on = one and chargers.exit_cell[charger] == robots.cell[i]
    if head_on or (room and robots.ticket[i] == chargers.first_ticket[charger]):
        return
    world.traffic.intent[i] = 0
    count_lost_tick(world, i, ACTION_QUEUE)
    robots.executed[i] = np.int64(robots.executed[i]) | EXECUTED_BLOCKED


@kernel
def count_waiting_for_chargers(world):
    """Enter the longest queue of each charger: robots that stand on the way to it, wherever."""
    robots, chargers = world.robots, world.chargers
    chargers.waiting[:] = 0
    for i in range(robots.cell.shape[0]):
        if robots.goal_type[U(i)] != GOAL_CHARGE or robots.cell[U(i)] == robots.goal_cell[U(i)]:
            continue
        charger = charger_of(world, i)
        if charger != NIL and (LOST_ACTIONS >> np.int64(robots.action[U(i)])) & 1:
            chargers.waiting[U(charger)] += 1
    for charger in range(chargers.cell.shape[0]):
        longest = max(chargers.longest_queue[charger], chargers.waiting[charger])
        chargers.longest_queue[charger] = longest


# The charging curve, a step function: units per tick by the level at the start of the tick.
#
# A curve is (K, 2) int32: the level from which each piece applies (the first one from 0), and its
# rate. A single piece is linear charging. Further pieces make a taper; the time to charge from a to
# b is then the sum over the pieces in between, each in whole ticks.


# Columns of a curve.
CURVE_FROM = 0
CURVE_RATE = 1


@kernel
def rate_at(curve, level):
    """Units that a tick of charging gives at this level."""
    k = curve.shape[0] - 1
    while k > 0 and curve[k, CURVE_FROM] > level:
        k -= 1
    return np.int64(curve[k, CURVE_RATE])


@kernel
def charging_ticks(curve, low, high):
    """Ticks of charging from level `low` until the level is at least `high`."""
    ticks = np.int64(0)
    level = np.int64(low)
    last = curve.shape[0] - 1
    for k in range(last + 1):
        until = high if k == last else min(high, np.int64(curve[k + 1, CURVE_FROM]))
        if level < until:
            rate = np.int64(curve[k, CURVE_RATE])
            needed = (until - level + rate - 1) // rate
            level += needed * rate
            ticks += needed
    return ticks


@kernel
def level_after(curve, low, ticks, full):
    """The level after a number of ticks of charging; never above `full`."""
    level = np.int64(low)
    left = np.int64(ticks)
    last = curve.shape[0] - 1
    for k in range(last + 1):
        rate = np.int64(curve[k, CURVE_RATE])
        if k < last:
            until = np.int64(curve[k + 1, CURVE_FROM])
            used = min(left, max((until - level + rate - 1) // rate, np.int64(0)))
        else:
            used = left
        level += used * rate
        left -= used
    return min(level, np.int64(full))
