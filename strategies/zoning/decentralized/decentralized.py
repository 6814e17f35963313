"""Decentralized dynamic zoning (Keith & La, Algorithms 3 and 4): robots negotiate with whom they reach.

Each robot looks at its own load every now and then. From time to time all agree on the mean of their
loads by consensus, one step in a tick. A robot that has been out of tolerance for long signals; the
signal spreads from robot to robot. The first leader tries exchanges of stations with its neighbours,
then names the next leader, until all robots have led often enough. Meanwhile robots stand still as
long as the scenario says.

A robot uses nothing but its own memory, what it sees, and what those in range tell it (`said`). With
`information: {radius: ..., shape: circle, orders: zones}` the view holds nothing else.
"""

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import kernel
from automaton.strategy.layer import Strategy, memory_of
from automaton.units import SECONDS_PER_UNIT
from strategies.zoning.annealing.annealing import (
    ANNEALING_STEPS,
    DEFAULT_FINAL_TEMPERATURE,
    DEFAULT_INITIAL_TEMPERATURE,
    first_zones,
)
from strategies.zoning.decentralized.consensus_load import (
    average,
    next_multiple,
    own_load,
    update_tolerance_state,
)
from strategies.zoning.decentralized.negotiation_messages import (
    AGE,
    AVERAGE,
    AVERAGE_EVERY,
    CALM,
    FIRST_RULE,
    FIRST_TRY,
    IN,
    JOB,
    LOOK,
    LOOK_EVERY,
    MEAN,
    MESSAGES,
    MILLION,
    NANO,
    NEAR,
    OWN,
    RANGE,
    REDESIGNS,
    ROUND,
    SHARE,
    SHARE_EVERY,
    SHARES,
    SHARING,
    find_robots_in_range,
    is_near,
)
from strategies.zoning.decentralized.redesign_turns import negotiate
from strategies.zoning.design.part_routing import ROUTING_NEIGHBOURS
from strategies.zoning.design.transfer_stations import find_transfers
from strategies.zoning.design.zone_paths import copy_design
from strategies.zoning.design.zone_workspace import ZONE_RULE_ADJACENT, ZONE_RULE_COUNT
from strategies.zoning.queues.initial_zones import try_first_zones
from strategies.zoning.queues.reassignment import (
    enter,
    is_running,
    queue_length,
    reassign_orders,
    serves_all,
    set_zone_move_time_factors,
)
from strategies.zoning.queues.zone_queues import first_for, queue_orders_of
from strategies.zoning.queues.zone_units import cells, rules_of_zones, ticks
from strategies.zoning.zoning_parameters import Decentralized


@kernel
def replace_broken(view, out, i, far):
    """Robot i serves its own zone, and that of one that it sees down and unreplaced."""
    identity = np.int64(view.robots.identity[i])
    for zone in range(view.service_zones.server.shape[0]):
        server = np.int64(view.service_zones.server[zone])
        base = np.int64(view.robots.at_index[zone])
        if zone == identity and server != identity and is_running(view, i):
            out.server[zone] = identity
        elif server != NIL and zone != identity and not is_running(view, base):
            holder = np.int64(view.robots.at_index[server])
            if not is_running(view, holder) and is_running(view, i):
                if serves_all(view, identity, zone) or not others_can(view, i, zone, far):
                    out.server[zone] = identity


@kernel
def others_can(view, i, zone, far):
    """Whether a running robot in range of robot i serves all stations of a zone."""
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, far) and serves_all(view, np.int64(view.robots.identity[j]), zone):
            return True
    return False


@kernel
def share_near(view, out, workspace, memory, i, p, age, job):
    """Out of tolerance, robot i gives an order that lies near a neighbour's zone to that neighbour."""
    per_robot, now = memory.per_robot, view.clock[CLOCK_TICK]
    per_robot[i, SHARE] = now + p[SHARE_EVERY]
    identity = np.int64(view.robots.identity[i])
    mine = queue_length(view, identity)
    near = p[FIRST_RULE + ZONE_RULE_ADJACENT] // (2 * MILLION)
    for zone in range(view.service_zones.server.shape[0]):
        server = np.int64(view.service_zones.server[zone])
        if server == NIL or server == identity or queue_length(view, zone) >= mine:
            continue
        if not is_near(view, i, np.int64(view.robots.at_index[server]), p[RANGE]):
            continue
        order = first_for(view, out, workspace, identity, zone, zone, 1, near, age, job)
        if order != NIL:
            enter(out, order, zone, np.int64(view.orders.target[order]), 1)
            per_robot[i, SHARES] += 1
            mine -= 1


@kernel
def is_blank(design):
    """Whether no station has a zone, not even one out of sight."""
    for point in range(design.held.shape[0]):
        if design.held[point] != NIL:
            return False
    return True


@kernel
def begin(view, out, memory, workspace, rules, k, i, p):
    """The first call for robot i: its timers, its zone, and the transfer stations to its neighbours."""
    per_robot, now = memory.per_robot, view.clock[CLOCK_TICK]
    identity = np.int64(view.robots.identity[i])
    out.service_zone[k] = identity
    per_robot[i, LOOK] = now + p[LOOK_EVERY]
    per_robot[i, AVERAGE] = next_multiple(now, p[AVERAGE_EVERY])
    per_robot[i, SHARE] = now + p[SHARE_EVERY]
    per_robot[i, ROUND] = NIL
    per_robot[i, MEAN] = NIL
    per_robot[i, IN] = NIL
    per_robot[i, CALM] = now
    reach = workspace.reach
    design = out.design
    if identity == 0 and is_blank(design):
        reach[:] = 1
        first_zones(
            view.service_zones.roads, rules, DEFAULT_INITIAL_TEMPERATURE,
            DEFAULT_FINAL_TEMPERATURE, ANNEALING_STEPS, p[FIRST_TRY], design, workspace, reach,
            view.rules.seed, 0,
        )  # fmt: skip
        out.redesigned[0] = 1
        return
    find_robots_in_range(view, reach, i, p[RANGE])
    for station in range(design.zone.shape[0]):
        for zone in range(reach.shape[0]):
            if reach[zone] and design.transfer[identity, zone, station]:
                return  # the scenario's design has them
    workspace.load[:] = 0.0
    find_transfers(view.service_zones.roads, rules, design, workspace, reach)
    out.redesigned[0] = 1


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, zones, parts = decisions.zoning, workspace.zoning, workspace.parts
    per_robot, p, now = memory.per_robot, memory.parameters, view.clock[CLOCK_TICK]
    rules = zones.rules
    for column in range(ZONE_RULE_COUNT):
        rules[column] = p[FIRST_RULE + column] / MILLION
    copy_design(view.service_zones.design, out.design)
    set_zone_move_time_factors(view, zones)
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        identity = np.int64(view.robots.identity[i])
        if per_robot[i, LOOK] == 0:
            begin(view, out, memory, zones, rules, k, i, p)
        replace_broken(view, out, i, p[RANGE])
        if not is_running(view, i):
            out.again[k] = p[LOOK_EVERY]
            continue
        busy = negotiate(view, out, memory, zones, parts, rules, k, i, p)
        queue_orders_of(view, out.design, zones, out, ROUTING_NEIGHBOURS, identity, p[NEAR])
        reassign_orders(view, out, identity)
        looks = now >= per_robot[i, LOOK]
        averages = not busy and (now >= per_robot[i, AVERAGE] or per_robot[i, ROUND] != NIL)
        if looks or averages:
            degree = find_robots_in_range(view, zones.reach, i, p[RANGE])
            load = np.int64(0)
            if looks or per_robot[i, ROUND] == NIL:  # further steps of a consensus need no load
                load = np.int64(NANO * own_load(view, rules, out.design, zones, parts, i))
            if looks:
                update_tolerance_state(view, memory, i, p, load)
            if averages:
                average(view, out, memory, k, i, p, degree, load)
        if p[SHARING] and per_robot[i, IN] == 0 and now >= per_robot[i, SHARE] and not busy:
            share_near(view, out, workspace, memory, i, p, p[AGE], p[JOB])
        soon = min(per_robot[i, LOOK], per_robot[i, AVERAGE])
        out.again[k] = 1 if busy or per_robot[i, ROUND] != NIL else max(1, soon - now)


class DecentralizedZones(Strategy):
    """Robots that talk within a range agree on zones that balance their queues."""

    layer = "zoning"
    Parameters = Decentralized
    compiled = decide
    counters = {"redesigns": REDESIGNS, "shared_orders": SHARES, "messages": MESSAGES}  # noqa: RUF012

    def reset(self, view):
        """What each robot remembers; the parameters in ticks, cells and nano-minutes."""
        given = self.parameters
        allocation = getattr(self.other_layers.get("allocation"), "parameters", None)
        every = max(1, ticks(view, given.average_every))
        numbers = (
            int(cells(view, given.range)),
            round(NANO * given.tolerance),
            ticks(view, SECONDS_PER_UNIT["min"] * given.patience),
            ticks(view, SECONDS_PER_UNIT["min"] * given.hysteresis),
            max(1, ticks(view, given.look)),
            every,
            min(given.rounds, max(1, every // 2)),
            given.turns,
            given.iterations,
            round(MILLION * given.hot),
            round(MILLION * given.cold),
            round(MILLION * given.scale),
            ticks(view, given.pause),
            int(given.sharing),
            int(cells(view, given.drop_near)) if given.drop_near else 0,
            max(1, ticks(view, 60.0)),
        )
        rules = rules_of_zones(view, given.adjacency, decentralized=True)
        rounded = tuple(min(round(MILLION * rule), 1 << 60) for rule in rules)
        blank = (view.service_zones.design.held == NIL).all()
        tries = try_first_zones(view, np.array(rounded) / MILLION) if blank else 0
        weights = (
            round(1000 * getattr(allocation, "age", 0.5)),
            round(1000 * getattr(allocation, "job", 10.0)),
        )
        return memory_of(view, per_robot=OWN, parameters=(*numbers, *rounded, *weights, tries))
