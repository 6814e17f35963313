"""Energy: what operations take from batteries, charging, and the lines before chargers.

An operation is paid when it begins. A robot that lacks what its next one takes is exhausted: it
does nothing in this tick and is out of order from the next one on (automaton.kernels.faults).
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.charging_curve import rate_at
from automaton.kernels.motion import LIVE, U, has_room
from automaton.kernels.operations import exhaust, lose_tick, need_allocation, pay, price
from automaton.recording.codes import DID_BLOCKED, DID_CHARGE
from automaton.world.condition import EXHAUSTED, FULL
from automaton.world.state import (
    CHARGE,
    DROP,
    FREE,
    GOAL_CHARGE,
    GOAL_NONE,
    IDLE,
    IN_LINE,
    MOVE,
    NIL,
    PICK,
    TICKETS,
)


@kernel
def affords(world, i, action):
    """Whether the battery of robot i holds what an operation takes; else it is exhausted."""
    if world.rules.battery == 0:
        return True
    ticks = max(np.int64(world.rules.duration[world.robots.type[i], action]), 1)
    if action == PICK or action == DROP:
        ticks += world.rules.delay
    if world.robots.charge[i] < price(world, i, action, ticks):
        exhaust(world, i)
        return False
    return True


@kernel
def gain(world, charge):
    """Units that a tick at a charger gives at this charge."""
    return min(rate_at(world.rules.curve, charge), FULL - charge)


@kernel
def charge_up(world, i):
    """One tick of charging at the robot's stand; it is free when its level is reached."""
    robots = world.robots
    first = robots.action[i] != CHARGE
    robots.ticket[i] = 0
    lose_tick(world, i, CHARGE)
    robots.busy[i] = 1  # motion takes it away again in this tick
    world.tally.times[i, CHARGE, 0] -= 0 if first else 1
    robots.did[i] = np.int64(robots.did[i]) | DID_CHARGE
    more = gain(world, np.int64(robots.charge[i]))
    robots.charge[i] += more
    world.tally.charged[i] += more
    if robots.charge[i] >= robots.level[i]:
        end_charging(robots, i)
        need_allocation(world, i, FREE)


@kernel
def end_charging(robots, i):
    """Robot i has nothing to do at a charger any more."""
    robots.goal[i] = GOAL_NONE
    robots.stand[i] = NIL
    robots.level[i] = 0
    robots.yields[i] = 0
    robots.ticket[i] = 0


@kernel
def hold_back(world):
    """Take back the moves that robots cannot pay, or that would jump a line; idle ticks are paid.

    Call between `drive` and motion. Robots before their charger wait for their turn: while it is
    held, or others came before them, they do not try.
    """
    robots, chargers = world.robots, world.chargers
    for charger in range(chargers.cell.shape[0]):
        chargers.first[charger] = 0
        chargers.way_out[charger] = NIL
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.cell[U(i)] == NIL or robots.status[U(i)] > EXHAUSTED:
            continue
        note_way_out(world, i)
        if robots.busy[U(i)]:
            continue
        live = np.int64(world.traffic.want[U(i)]) & LIVE
        if live and robots.charge[i] < price(world, i, MOVE, np.int64(world.traffic.span[i])):
            world.traffic.want[i] = 0
            exhaust(world, i)
        if world.traffic.want[U(i)] == 0:
            pay(world, i, price(world, i, IDLE, 1))
        elif live and is_at_door(world, i):
            stand_in_line(world, i)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.ticket[U(i)] and robots.busy[U(i)] == 0 and world.traffic.want[U(i)] & LIVE:
            wait_for_turn(world, i)


@kernel
def note_way_out(world, i):
    """A robot in a charger, with its charging done, is about to drive out into this cell."""
    robots, chargers = world.robots, world.chargers
    charger = np.int64(chargers.at[U(robots.cell[U(i)])])
    if charger == NIL or robots.goal[U(i)] == GOAL_CHARGE or robots.claim[U(i)] != NIL:
        return
    if robots.at[U(i)] < robots.length[U(i)]:
        direction = np.int64(robots.route[U(i), U(robots.at[U(i)])])
        chargers.way_out[charger] = robots.cell[U(i)] + world.grid.offset[U(direction)]


@kernel
def is_at_door(world, i):
    """Whether the move that robot i wants leads into the charger where it is to charge."""
    robots = world.robots
    if robots.goal[U(i)] != GOAL_CHARGE:
        return False
    direction = np.int64(world.traffic.want[U(i)]) & 3
    return robots.cell[U(i)] + world.grid.offset[U(direction)] == robots.stand[U(i)]


@kernel
def stand_in_line(world, i):
    """Robot i keeps its place in the line before its charger, or gets the last one."""
    robots, chargers = world.robots, world.chargers
    if robots.ticket[i] == 0:
        world.clock[TICKETS] += 1
        robots.ticket[i] = world.clock[TICKETS]
    charger = chargers.at[robots.stand[i]]
    if chargers.first[charger] == 0 or robots.ticket[i] < chargers.first[charger]:
        chargers.first[charger] = robots.ticket[i]


@kernel
def wait_for_turn(world, i):
    """Robot i does not move into its charger unless it is first and there is room.

    A holder that wants out through robot i's own cell is met head-on: right of way must decide.
    """
    robots, chargers = world.robots, world.chargers
    if not is_at_door(world, i):
        return
    charger = chargers.at[robots.stand[i]]
    direction = np.int64(world.traffic.want[i]) & 3
    room = has_room(world.traffic.occupancy, np.int64(robots.stand[i]), direction)
    one = np.int64(world.grid.rule[robots.cell[i]]) >> 5 & 3 == 1
    head_on = one and chargers.way_out[charger] == robots.cell[i]
    if head_on or (room and robots.ticket[i] == chargers.first[charger]):
        return
    world.traffic.want[i] = 0
    lose_tick(world, i, IN_LINE)
    robots.did[i] = np.int64(robots.did[i]) | DID_BLOCKED
