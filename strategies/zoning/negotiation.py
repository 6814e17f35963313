"""Weighted average consensus with Metropolis weights (Algorithm 3), and the spread about it (eq. 5).

x_i <- W_ii x_i + sum W_ij x_j over neighbours j,  W_ij = 1 / (1 + max(d_i, d_j)),  W_ii = 1 - sum.

Values are whole numbers, such as billionths of a minute, and what two neighbours exchange is rounded
towards zero: what one gains the other loses, so that every step preserves the sum to the last digit.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from automaton.engine.facilities import MESSAGE_WORDS
from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.engine.state import NIL, Array
from automaton.strategy.kernels import kernel, position
from strategies.zoning.annealing import facing_tips, forget_tips, give_random_tip
from strategies.zoning.transfer_stations import (
    ROUTING_NEIGHBOURS,
    find_transfers,
    joined,
    reach_connected,
    route,
)
from strategies.zoning.zone_load import load_of, members
from strategies.zoning.zone_queues import is_running
from strategies.zoning.zone_workspace import (
    DRAWS_NEGOTIATION,
    ZoneRules,
    ZoneSpace,
    below,
    chance,
    copy_design,
    exponential,
    temperature,
)


@kernel
def moved(value, other, degree, other_degree):
    """How far a value moves towards that of a neighbour in a step."""
    gap = other - value
    weight = 1 + max(degree, other_degree)
    return gap // weight if gap >= 0 else -(-gap // weight)


@kernel
def sigma_about(load, reach, mean):
    """Eq. 5: spread of the loads with reach[z] = 1 about `mean`.

    The paper prints (L_i + x_i)^2 for the robot's own load; the authors' code has the minus.
    """
    count = np.int64(0)
    total = 0.0
    for z in range(load.shape[0]):
        if reach[z] == 1:
            total += (load[z] - mean) * (load[z] - mean)
            count += 1
    return sqrt(total / count) if count > 0 else 0.0


# Decentralized dynamic zoning (Algorithm 4): a leader tries exchanges with whom it can reach.
#
# Zones stand for their robots. `reach` (Z,) uint8 marks the leader's zone and those of its
# neighbours. Parts outside these zones are not known to it.


class NegotiatedParts(Struct, role=SCRATCH):
    """Parts in the queues or hands of robots; room for K."""

    count: Array = field("(1,) int64", "how many there are")
    order: Array = field("(K,) int32", "the order of each, whatever that is to the caller")
    at: Array = field("(K,) int32", "the station where it is, or was picked up")
    to: Array = field("(K,) int32", "the next station of its route")
    carried: Array = field("(K,) uint8", "1 = in a robot's hands; it keeps its zone and stop")
    zone: Array = field("(K,) int32", "the zone in whose queue it is")
    stop: Array = field("(K,) int32", "the station where it is dropped")
    proposed_zone: Array = field("(K,) int32", "what they would be in another design")
    proposed_slot: Array = field("(K,) int32")


def parts_for(room: int) -> NegotiatedParts:
    """No parts, and room for some."""
    return NegotiatedParts.sized({"K": room})


@kernel
def lead(
    roads, rules, parts, hot, cold, steps, scale, before, iterations, design, workspace, leader, reach,
    mean, seed, tick,
):  # fmt: skip
    """A turn of the leader: `iterations` exchanges about its consensus `mean` (minutes).

    Leaves the best design of the turn, that at its start included, and the parts queued by it;
    returns its sigma. before: iterations that this robot led in earlier turns.
    """
    workspace.drawn[0] = DRAWS_NEGOTIATION + (leader << 32)
    loads_of_queues(roads, rules, design, workspace, parts, parts.zone, parts.stop, reach)
    sigma = sigma_about(workspace.load, reach, mean)
    best = sigma
    copy_design(design, workspace.best)
    for k in range(iterations):
        heat = temperature(hot, cold, steps, before + k) * scale
        tried = exchange(
            roads, rules, parts, heat, sigma, design, workspace, leader, reach, mean, seed, tick
        )
        if tried < 0.0:
            continue
        sigma = tried
        if sigma < best:
            best = sigma
            copy_design(design, workspace.best)
    copy_design(workspace.best, design)
    requeue(roads, design, workspace, parts, reach)
    adopt(parts)
    return best


@kernel
def exchange(roads, rules, parts, heat, sigma, design, workspace, leader, reach, mean, seed, tick):
    """One iteration: changes design, parts and workspace.load if it is accepted.

    Returns the new sigma, or -1 when there was nothing to exchange or it was refused. Refused are
    also designs that leave the leader without a transfer station, or zones cut off.
    """
    if propose(roads, rules, design, workspace, leader, reach, seed, tick) == 0:
        return -1.0
    find_transfers(roads, rules, workspace.trial, workspace, reach)
    if has_transfer(workspace.trial, leader) == 0:
        return -1.0
    if reach_connected(workspace.trial, workspace, reach) == 0:
        return -1.0
    requeue(roads, workspace.trial, workspace, parts, reach)
    loads_of_queues(
        roads,
        rules,
        workspace.trial,
        workspace,
        parts,
        parts.proposed_zone,
        parts.proposed_slot,
        reach,
    )
    tried = sigma_about(workspace.load, reach, mean)
    if tried <= sigma or chance(workspace, seed, tick) < exponential((sigma - tried) / heat):
        copy_design(workspace.trial, design)
        adopt(parts)
        return tried
    loads_of_queues(roads, rules, design, workspace, parts, parts.zone, parts.stop, reach)
    return -1.0


@kernel
def propose(roads, rules, design, workspace, leader, reach, seed, tick):
    """workspace.trial: the busier of leader and random neighbour gives the other a tip; or 0."""
    count = np.int64(0)
    for z in range(reach.shape[0]):
        if z != leader and reach[z] == 1:
            workspace.frontier[count] = z
            count += 1
    if count == 0:
        return 0
    a, b = leader, np.int64(workspace.frontier[below(workspace, count, seed, tick)])
    if workspace.load[a] < workspace.load[b]:
        a, b = b, a
    forget_tips(roads, design, workspace)
    if facing_tips(roads, rules, design, workspace, a, b) == 0:
        return 0
    return give_random_tip(roads, rules, design, workspace, a, b, seed, tick)


@kernel
def has_transfer(design, zone):
    """1 if a zone has a transfer station."""
    for z in range(design.transfer.shape[0]):
        if z != zone and joined(design, zone, z) == 1:
            return 1
    return 0


@kernel
def requeue(roads, design, workspace, parts, reach):
    """parts.proposed_zone and proposed_slot: queued parts of zones in reach, from where they are."""
    for k in range(parts.count[0]):
        parts.proposed_zone[k] = parts.zone[k]
        parts.proposed_slot[k] = parts.stop[k]
        if parts.carried[k] == 1 or reach[parts.zone[k]] == 0:
            continue
        at, to = np.int64(parts.at[k]), np.int64(parts.to[k])
        if design.zone[at] == NIL or design.zone[to] == NIL:
            continue  # in a zone out of sight
        zone, stop, _ = route(roads, design, workspace, ROUTING_NEIGHBOURS, design.zone[at], at, to)
        parts.proposed_zone[k] = zone
        parts.proposed_slot[k] = stop


@kernel
def adopt(parts):
    """What was tried becomes what is."""
    for k in range(parts.count[0]):
        parts.zone[k] = parts.proposed_zone[k]
        parts.stop[k] = parts.proposed_slot[k]


@kernel
def loads_of_queues(roads, rules, design, workspace, parts, zone, stop, reach):
    """workspace.load of the zones in reach, each from the legs in its own queue; others stay."""
    workspace.leg_flow[:] = 0.0
    for k in range(parts.count[0]):
        if parts.at[k] != stop[k]:
            workspace.leg_flow[zone[k], parts.at[k], stop[k]] += 1.0
    for z in range(reach.shape[0]):
        if reach[z] == 1:
            members(design, workspace, z, rules.shared)
            workspace.load[z] = load_of(roads, rules, workspace.leg_flow[z], workspace, z)


# What robots that negotiate remember, tell each other, and reckon with; and who hears whom.


NANO = 1_000_000_000  # loads are told in this part of a minute
DEGREES = 1 << 12  # more robots than any robot has in range
BIAS = NANO // 10  # that consensus begins with

# Words of a message.
VALUE = 0  # and 1: what consensus has come to, by even and odd steps: value * DEGREES + degree
REDESIGN = 2  # tick in which the redesign began, 0 before the first
LEADER = 3  # who leads next, as far as this robot knows
TURN = 4  # the number of that turn
TURNS = 5  # turns that this robot led
DONE = 6  # 1: the redesign is over

LEADERS = 33  # stream of the draws of the next leader


class NegotiatorState(Struct):
    """Parameters of robots that negotiate, and what each of them remembers."""

    rules: ZoneRules
    range: int = field("int64", "cells: how far messages reach")
    tolerance: int = field("int64", "nano-minutes that a load may be from the mean")
    patience: int = field("int64", "ticks since the last calm before a redesign")
    hysteresis: int = field("int64", "ticks in or out of tolerance until that counts")
    look_every: int = field("int64", "ticks")
    average_every: int = field("int64", "ticks")
    rounds: int = field("int64", "steps of a consensus")
    turns: int = field("int64", "turns that each robot leads in a redesign")
    iterations: int = field("int64", "exchanges in a turn")
    hot: float = field("float64", "temperature at the beginning of a redesign")
    cold: float = field("float64", "and at its end")
    scale: float = field("float64", "minutes, k of Algorithm 4")
    pause: int = field("int64", "ticks that robots stand still in a redesign")
    sharing: int = field("int64", "1: robots out of tolerance share orders")
    share_every: int = field("int64", "ticks")
    drop_near: int = field(
        "int64", "cells: an order whose station is so near a transfer station goes there; 0: none"
    )
    age: int = field("int64", "weights of Algorithm 2, in thousandths")
    job: int = field("int64")
    first_try: int = field("int64", "tries in which the first zones are not found")

    next_look: Array = field("(n,) int64", "tick of the next look; 0: robot has not begun")
    next_average: Array = field("(n,) int64", "tick of the next consensus")
    next_share: Array = field("(n,) int64", "tick of the next sharing")
    step: Array = field("(n,) int64", "of the consensus that goes on, or NIL")
    mean: Array = field("(n,) int64", "of the last consensus, in nano-minutes; NIL: none yet")
    in_tolerance: Array = field("(n,) int64", "1 in tolerance, 0 out of it, NIL unknown")
    since: Array = field("(n,) int64", "tick since which that is so")
    calm: Array = field("(n,) int64", "tick of the last calm, or of the last redesign")
    led: Array = field("(n,) int64", "turns led in this redesign")
    redesigns: Array = field("(n,) int64", "redesigns that it ended")
    shared_orders: Array = field("(n,) int64", "orders that it gave away")
    messages: Array = field("(n,) int64", "messages that it heard")

    zones: ZoneSpace
    parts: NegotiatedParts


@kernel
def is_near(view, i, j, far):
    """Whether two robots are at most so many cells apart, as the crow flies, and both in order."""
    if i == j or not is_running(view, j):
        return False
    here, there = position(view, i), position(view, j)
    if there == NIL:
        return False
    width = view.grid.width
    across, down = here % width - there % width, here // width - there // width
    return across * across + down * down <= far * far


@kernel
def find_robots_in_range(view, reach, i, far):
    """Mark the zones of a robot and of those in range; returns how many of these there are."""
    count = 0
    for zone in range(reach.shape[0]):
        reach[zone] = 0
        server = np.int64(view.service_zones.server[zone])
        if server == NIL:
            continue
        j = np.int64(view.robots.at_index[server])
        if j == i or is_near(view, i, j, far):
            reach[zone] = 1
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, far):
            count += 1
    return count


@kernel
def begin_message(view, out, k, i):
    """Begin to say something new: what robot i says stays as it is but for what is changed now."""
    if out.sends_message[k] == 0:
        out.sends_message[k] = 1
        for word in range(MESSAGE_WORDS):
            out.messages[k, word] = view.service_zones.messages[i, word]
