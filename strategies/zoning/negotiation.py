"""A turn of a negotiation about zones (Algorithm 4): a leader tries exchanges with robots in range.

Zones stand for their robots. `reach` (Z,) uint8 marks the zones of the leader and its neighbours. The
leader does not know parts outside these zones.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from automaton.strategy.api import NIL, SCRATCH, Array, Struct, field, kernel
from strategies.zoning.annealing import (
    exponential,
    facing_tips,
    forget_tips,
    give_random_tip,
    temperature,
)
from strategies.zoning.loads_and_transfers import (
    ROUTING_NEIGHBOURS,
    find_transfers,
    joined,
    load_of,
    members,
    reach_connected,
    route,
)
from strategies.zoning.zone_workspace import DRAWS_NEGOTIATION, below, chance, copy_design


class NegotiatedParts(Struct, role=SCRATCH):
    """Parts in queues or on robots; K: capacity."""

    count: int = field("() int64", "number of parts")
    order: Array = field("(K,) int32", "the order of each part, as defined by the caller")
    at: Array = field("(K,) int32", "the station where the part is or was picked up")
    to: Array = field("(K,) int32", "the next station of its route")
    carried: Array = field("(K,) uint8", "1 = on a robot; the part keeps its zone and stop")
    zone: Array = field("(K,) int32", "the zone whose queue it is in")
    stop: Array = field("(K,) int32", "the station where it is dropped")
    proposed_zone: Array = field("(K,) int32", "its zone in the proposed design")
    proposed_slot: Array = field("(K,) int32")


def parts_for(room: int) -> NegotiatedParts:
    """An empty list with this capacity."""
    return NegotiatedParts.sized({"K": room})


@kernel
def lead(
    roads, rules, parts, hot, cold, steps, scale, before, iterations, design, workspace, leader, reach,
    mean, seed, tick,
):  # fmt: skip
    """A turn of the leader: `iterations` exchanges for its consensus `mean` (minutes).

    Leaves the best design of the turn, or the initial one if that is best, with its queues of parts;
    returns its sigma. before: iterations that this robot led in earlier turns.
    """
    workspace.drawn = DRAWS_NEGOTIATION + (leader << 32)
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
    """One iteration: try an exchange; if accepted, update design, parts and workspace.load.

    Returns the new sigma, or -1 if there is nothing to exchange or the design is rejected. Designs
    that leave the leader without a transfer station, or zones isolated, are always rejected.
    """
    if propose(roads, rules, design, workspace, leader, reach, seed, tick) == 0:
        return -1.0
    find_transfers(roads, rules, workspace.trial, workspace, reach)
    if has_transfer(workspace.trial, leader) == 0:
        return -1.0
    if reach_connected(workspace.trial, workspace, reach) == 0:
        return -1.0
    requeue(roads, workspace.trial, workspace, parts, reach)
    zone, slot = parts.proposed_zone, parts.proposed_slot
    loads_of_queues(roads, rules, workspace.trial, workspace, parts, zone, slot, reach)
    tried = sigma_about(workspace.load, reach, mean)
    if tried <= sigma or chance(workspace, seed, tick) < exponential((sigma - tried) / heat):
        copy_design(workspace.trial, design)
        adopt(parts)
        return tried
    loads_of_queues(roads, rules, design, workspace, parts, parts.zone, parts.stop, reach)
    return -1.0


@kernel
def sigma_about(load, reach, mean):
    """Eq. 5: deviation of the loads with reach[z] = 1 from `mean`.

    The paper prints (L_i + x_i)^2 for the robot's own load; the authors' code has a minus sign.
    """
    count = np.int64(0)
    total = 0.0
    for z in range(load.shape[0]):
        if reach[z] == 1:
            total += (load[z] - mean) * (load[z] - mean)
            count += 1
    return sqrt(total / count) if count > 0 else 0.0


@kernel
def propose(roads, rules, design, workspace, leader, reach, seed, tick):
    """workspace.trial: the busier of the leader and a random neighbour gives a tip to the other; or 0."""
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
    """parts.proposed_zone and proposed_slot, for queued parts of zones in reach."""
    for k in range(parts.count):
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
    """Accept the trial."""
    for k in range(parts.count):
        parts.zone[k] = parts.proposed_zone[k]
        parts.stop[k] = parts.proposed_slot[k]


@kernel
def loads_of_queues(roads, rules, design, workspace, parts, zone, stop, reach):
    """workspace.load of the zones in reach, from the legs in their queues; others stay."""
    workspace.leg_flow[:] = 0.0
    for k in range(parts.count):
        if parts.at[k] != stop[k]:
            workspace.leg_flow[zone[k], parts.at[k], stop[k]] += 1.0
    for z in range(reach.shape[0]):
        if reach[z] == 1:
            members(design, workspace, z, rules.shared)
            workspace.load[z] = load_of(roads, rules, workspace.leg_flow[z], workspace, z)
