"""The load of a robot, the mean of all by consensus (Algorithm 3), and whether it is in tolerance."""

import numpy as np

from automaton.strategy.kernels import kernel
from automaton.world.state import (
    CARRIED,
    NIL,
    TICK,
    WAITING,
)
from automaton.zoning.consensus import moved
from automaton.zoning.negotiation import loads_of_queues
from strategies.zoning.charging_load import charging_minutes
from strategies.zoning.talk import (
    AVERAGE,
    AVERAGE_EVERY,
    BIAS,
    CALM,
    DEGREES,
    HYSTERESIS,
    IN,
    LOOK,
    LOOK_EVERY,
    MEAN,
    MESSAGES,
    PATIENCE,
    RANGE,
    ROUND,
    ROUNDS,
    SINCE,
    TOLERANCE,
    VALUE,
    is_near,
    tell,
)


@kernel
def fill_parts(view, parts):
    """List the parts that wait in queues, and those that robots have or fetch: these keep their way.

    So do those that are too heavy for the robot of the zone in which they wait.
    """
    orders, zoning = view.orders, view.zoning
    count = 0
    for order in range(orders.state.shape[0]):
        state = orders.state[order]
        if state != WAITING and state != CARRIED:
            continue
        slot = np.int64(orders.place[order] if state == WAITING else zoning.leg[order])
        stop = np.int64(zoning.stop[order])
        if zoning.queue[order] < 0 or slot == NIL or stop == NIL:
            continue
        at, to = (
            np.int64(zoning.station_of[slot]),
            np.int64(zoning.station_of[orders.target[order]]),
        )
        if at == NIL or to == NIL:
            continue
        parts.order[count] = order
        parts.at[count] = at
        parts.to[count] = to
        parts.zone[count] = zoning.queue[order]
        parts.stop[count] = zoning.station_of[stop]
        fixed = state == CARRIED or orders.by[order] != NIL or is_handed_on(view, order, at)
        parts.carried[count] = 1 if fixed else 0
        count += 1
    parts.count[0] = count


@kernel
def is_handed_on(view, order, at):
    """Whether an order at a station is too heavy for the robot of its zone, so that another has it."""
    zone = np.int64(view.zoning.design.zone[at])
    if zone == NIL or view.zoning.direct[order] == 0:
        return False
    kind = np.int64(view.robots.type[view.robots.at_index[zone]])
    return view.orders.weight[order] > view.rules.payload[kind]


@kernel
def own_load(view, rules, design, space, parts, i):
    """Minutes of work of robot i: what lies in the queues of the zones that it serves, and charging."""
    reach, identity = space.reach, view.robots.identity[i]
    for zone in range(reach.shape[0]):
        reach[zone] = 1 if view.zoning.server[zone] == identity else 0
    fill_parts(view, parts)
    loads_of_queues(view.zoning.roads, rules, design, space, parts, parts.zone, parts.stop, reach)
    total = 0.0
    for zone in range(reach.shape[0]):
        if reach[zone]:
            total += space.load[zone]
    return total + charging_minutes(view, rules, i)


@kernel
def next_multiple(now, every):
    """The next tick at which all robots begin to reckon their mean: their clocks agree."""
    return (now // every + 1) * every


@kernel
def average(view, given, memory, k, i, p, degree, load):
    """Consensus with Metropolis weights: its beginning, or one more step.

    All robots reckon with what was told in the step before, degrees too, so that the sum is preserved.
    """
    own, now = memory.own, view.clock[TICK]
    if own[i, ROUND] == NIL:
        own[i, AVERAGE] = next_multiple(now, p[AVERAGE_EVERY])
        if degree == 0:
            return  # alone it keeps the mean that it has
        tell(view, given, k, i)
        own[i, ROUND] = 0
        given.said[k, VALUE] = (load + BIAS) * DEGREES + min(degree, DEGREES - 1)
        return
    step = own[i, ROUND]
    mine = view.zoning.said[i, VALUE + (step & 1)]
    total = mine // DEGREES
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, p[RANGE]):
            told = view.zoning.said[j, VALUE + (step & 1)]
            total += moved(mine // DEGREES, told // DEGREES, mine % DEGREES, told % DEGREES)
            own[i, MESSAGES] += 1
    tell(view, given, k, i)
    given.said[k, VALUE + ((step + 1) & 1)] = total * DEGREES + min(degree, DEGREES - 1)
    own[i, ROUND] = step + 1
    if step + 1 >= p[ROUNDS]:
        own[i, ROUND] = NIL
        own[i, MEAN] = total


@kernel
def look(view, memory, i, p, load):
    """In or out of tolerance, and since when; long in tolerance it is calm."""
    own, now = memory.own, view.clock[TICK]
    own[i, LOOK] = now + p[LOOK_EVERY]
    if own[i, MEAN] == NIL:
        return
    inside = 1 if abs(load - own[i, MEAN]) < p[TOLERANCE] else 0
    if own[i, IN] != inside:
        own[i, IN] = inside
        own[i, SINCE] = now
    elif inside and now - own[i, SINCE] >= p[HYSTERESIS]:
        own[i, CALM] = now


@kernel
def wants_redesign(view, memory, i, p):
    """Whether robot i is out of tolerance, and has not been calm for long."""
    own, now = memory.own, view.clock[TICK]
    out = own[i, IN] == 0 and now - own[i, SINCE] >= p[HYSTERESIS]
    return out and now - own[i, CALM] > p[PATIENCE]
