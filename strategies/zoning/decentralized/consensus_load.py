"""The load of a robot, the mean of all by consensus (Algorithm 3), and whether it is in tolerance."""

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL, ORDER_CARRIED, ORDER_WAITING
from automaton.strategy.kernels import kernel
from strategies.zoning.decentralized.consensus import moved
from strategies.zoning.decentralized.negotiation import loads_of_queues
from strategies.zoning.decentralized.negotiation_messages import (
    BIAS,
    DEGREES,
    VALUE,
    begin_message,
    is_near,
)
from strategies.zoning.queues.charging_load import charging_minutes


@kernel
def fill_parts(view, parts):
    """List the parts that wait in queues, and those that robots have or fetch: these keep their way.

    So do those that are too heavy for the robot of the zone in which they wait.
    """
    orders, service_zones = view.orders, view.service_zones
    count = 0
    for order in range(orders.state.shape[0]):
        state = orders.state[order]
        if state != ORDER_WAITING and state != ORDER_CARRIED:
            continue
        slot = np.int64(
            orders.current_slot[order]
            if state == ORDER_WAITING
            else service_zones.picked_from[order]
        )
        next_slot = np.int64(service_zones.next_slot[order])
        if service_zones.queue[order] < 0 or slot == NIL or next_slot == NIL:
            continue
        at, to = (
            np.int64(service_zones.station_of[slot]),
            np.int64(service_zones.station_of[orders.target[order]]),
        )
        if at == NIL or to == NIL:
            continue
        parts.order[count] = order
        parts.at[count] = at
        parts.to[count] = to
        parts.zone[count] = service_zones.queue[order]
        parts.stop[count] = service_zones.station_of[next_slot]
        fixed = (
            state == ORDER_CARRIED
            or orders.reserved_by[order] != NIL
            or is_reassigned(view, order, at)
        )
        parts.carried[count] = 1 if fixed else 0
        count += 1
    parts.count[0] = count


@kernel
def is_reassigned(view, order, at):
    """Whether an order at a station is too heavy for the robot of its zone, so that another has it."""
    zone = np.int64(view.service_zones.design.zone[at])
    if zone == NIL or view.service_zones.skips_transfer[order] == 0:
        return False
    robot_type = np.int64(view.robots.type[view.robots.at_index[zone]])
    return view.orders.weight[order] > view.rules.payload[robot_type]


@kernel
def own_load(view, state, design, i):
    """Minutes of work of robot i: what lies in the queues of the zones that it serves, and charging."""
    zones, parts, identity = state.zones, state.parts, view.robots.identity[i]
    reach = zones.reach
    for zone in range(reach.shape[0]):
        reach[zone] = 1 if view.service_zones.server[zone] == identity else 0
    fill_parts(view, parts)
    loads_of_queues(
        view.service_zones.roads, state.rules, design, zones, parts, parts.zone, parts.stop, reach
    )
    total = 0.0
    for zone in range(reach.shape[0]):
        if reach[zone]:
            total += zones.load[zone]
    return total + charging_minutes(view, state.rules, i)


@kernel
def next_multiple(now, every):
    """The next tick at which all robots begin to reckon their mean: their clocks agree."""
    return (now // every + 1) * every


@kernel
def average(view, out, state, k, i, degree, load):
    """Consensus with Metropolis weights: its beginning, or one more step.

    All robots reckon with what was told in the step before, degrees too, so that the sum is preserved.
    """
    now = view.clock[CLOCK_TICK]
    if state.step[i] == NIL:
        state.next_average[i] = next_multiple(now, state.average_every)
        if degree == 0:
            return  # alone it keeps the mean that it has
        begin_message(view, out, k, i)
        state.step[i] = 0
        out.messages[k, VALUE] = (load + BIAS) * DEGREES + min(degree, DEGREES - 1)
        return
    step = state.step[i]
    mine = view.service_zones.messages[i, VALUE + (step & 1)]
    total = mine // DEGREES
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, state.range):
            told = view.service_zones.messages[j, VALUE + (step & 1)]
            total += moved(mine // DEGREES, told // DEGREES, mine % DEGREES, told % DEGREES)
            state.messages[i] += 1
    begin_message(view, out, k, i)
    out.messages[k, VALUE + ((step + 1) & 1)] = total * DEGREES + min(degree, DEGREES - 1)
    state.step[i] = step + 1
    if step + 1 >= state.rounds:
        state.step[i] = NIL
        state.mean[i] = total


@kernel
def update_tolerance_state(view, state, i, load):
    """In or out of tolerance, and since when; long in tolerance it is calm."""
    now = view.clock[CLOCK_TICK]
    state.next_look[i] = now + state.look_every
    if state.mean[i] == NIL:
        return
    inside = 1 if abs(load - state.mean[i]) < state.tolerance else 0
    if state.in_tolerance[i] != inside:
        state.in_tolerance[i] = inside
        state.since[i] = now
    elif inside and now - state.since[i] >= state.hysteresis:
        state.calm[i] = now


@kernel
def wants_redesign(view, state, i):
    """Whether robot i is out of tolerance, and has not been calm for long."""
    now = view.clock[CLOCK_TICK]
    out = state.in_tolerance[i] == 0 and now - state.since[i] >= state.hysteresis
    return out and now - state.calm[i] > state.patience
