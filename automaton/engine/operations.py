"""What robots begin: operations, with the ticks and the charge that they take."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.record_codes import EXECUTED_ILLEGAL
from automaton.engine.robot_status import STATUS_EXHAUSTED, STATUS_UP
from automaton.engine.state import ACTION_FOLLOWING, ACTION_ILLEGAL, CLOCK_ROBOTS_DOWN, NIL


@kernel
def energy_cost(world, i, action, ticks):
    """Units of charge that an operation of robot i takes."""
    loaded = 1 if world.robots.load[i] != NIL else 0
    return ticks * np.int64(world.rules.drain[world.robots.type[i], action, loaded])


@kernel
def exhaust(world, i):
    """The battery of robot i lacks what it needs: it is down from the next tick on."""
    if world.robots.status[i] == STATUS_UP:
        world.clock[CLOCK_ROBOTS_DOWN] += 1
    if world.robots.status[i] <= STATUS_EXHAUSTED:
        world.robots.status[i] = STATUS_EXHAUSTED


@kernel
def consume_energy(world, i, units):
    """Take units from the battery of robot i; one that cannot pay is empty and exhausted."""
    robots = world.robots
    taken = min(units, np.int64(robots.charge[i]))
    robots.charge[i] -= taken
    world.tally.energy_used[i] += taken
    if taken < units:
        exhaust(world, i)


@kernel
def take_on(world, i, order):
    """Robot i carries a load from now on, and drives as such robots do."""
    world.robots.load[i] = order
    world.robots.type[i] += np.uint8(world.rules.loaded_types)


@kernel(inline=True)
def with_load(world, robot_type):
    """The type that robots have with a load: where loads are handled, both have to get there."""
    more = world.rules.loaded_types
    return robot_type + more if robot_type < more else robot_type


@kernel(inline=True)
def without_load(world, robot_type):
    """The type that robots of a type have without a load."""
    more = world.rules.loaded_types
    return robot_type - more if more and robot_type >= more else robot_type


@kernel
def types_of_robots(world):
    """How many types of robots there are, those with a load left out."""
    return world.rules.loaded_types or world.rules.duration.shape[0]


@kernel
def put_off(world, i):
    """Robot i carries its load no longer."""
    world.robots.load[i] = NIL
    world.robots.type[i] -= np.uint8(world.rules.loaded_types)


@kernel
def begin(world, i, action, ticks):
    """Robot i begins an operation of so many ticks, the current one included; motion counts them."""
    if world.rules.battery:
        consume_energy(world, i, energy_cost(world, i, action, ticks))
    loaded = 1 if world.robots.load[i] != NIL else 0
    world.robots.action[i] = action
    world.robots.busy[i] = ticks
    world.tally.operations[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += ticks


@kernel
def count_lost_tick(world, i, action):
    """Count a tick in which robot i executes nothing, and why; it begins nothing for a stride."""
    ticks = world.rules.stride
    if world.rules.battery:
        consume_energy(world, i, energy_cost(world, i, action, ticks))
    loaded = 1 if world.robots.load[i] != NIL else 0
    world.robots.action[i] = action
    world.tally.operations[i, action, loaded] += 1
    world.tally.ticks[i, action, loaded] += ticks


@kernel
def count_following(world, i, ticks):
    """Count ticks of a move that lasts longer because of the robot ahead.

    They take charge as waiting does, at most what is there: the move has begun, and ends.
    """
    loaded = 1 if world.robots.load[i] != NIL else 0
    if world.rules.battery:
        units = energy_cost(world, i, ACTION_FOLLOWING, ticks)
        consume_energy(world, i, min(units, np.int64(world.robots.charge[i])))
    world.tally.ticks[i, ACTION_FOLLOWING, loaded] += ticks


@kernel
def refuse(world, layer, i):
    """An illegal decision: the robot waits for one tick, unless an operation runs anyway."""
    world.tally.illegal[layer] += 1
    if world.robots.busy[i] == 0:
        count_lost_tick(world, i, ACTION_ILLEGAL)
        world.robots.busy[i] = 1  # motion takes it away again in this tick
        world.robots.executed[i] = EXECUTED_ILLEGAL
