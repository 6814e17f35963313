"""Decentralized dynamic zoning (Keith & La, Algorithms 3 and 4): robots negotiate with whom they reach.

Each robot looks at its own load every now and then. From time to time all agree on the mean of their
loads by consensus, one step in a tick. A robot that has been out of tolerance for long signals; the
signal spreads from robot to robot. The first leader tries exchanges of stations with its neighbours,
then names the next leader, until all robots have led often enough. Meanwhile robots stand still as
long as the scenario says.

A robot uses nothing but its own memory, what it sees, and what those in range tell it (`said`). With
`information: {radius: ..., shape: circle, orders: zones}` the view holds nothing else.
"""

from typing import ClassVar

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import kernel
from automaton.strategy.layer import Strategy
from automaton.units import SECONDS_PER_UNIT
from strategies.zoning.annealing.annealing import first_zones
from strategies.zoning.decentralized.consensus_load import (
    average,
    next_multiple,
    own_load,
    update_tolerance_state,
)
from strategies.zoning.decentralized.negotiation import parts_for
from strategies.zoning.decentralized.negotiation_messages import (
    NANO,
    NegotiatorState,
    find_robots_in_range,
    is_near,
)
from strategies.zoning.decentralized.redesign_turns import negotiate
from strategies.zoning.design.part_routing import ROUTING_NEIGHBOURS
from strategies.zoning.design.transfer_stations import find_transfers
from strategies.zoning.design.zone_paths import copy_design
from strategies.zoning.queues.initial_zones import (
    FINAL_TEMPERATURE,
    INITIAL_TEMPERATURE,
    STEPS,
    space_of,
    try_first_zones,
)
from strategies.zoning.queues.reassignment import (
    enter,
    is_running,
    queue_length,
    reassign_orders,
    serves_all,
    set_zone_move_time_factors,
)
from strategies.zoning.queues.zone_queues import first_for, queue_orders_of
from strategies.zoning.queues.zone_units import cells, order_weights, rules_of_zones, ticks
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
def share_near(view, out, workspace, state, i):
    """Out of tolerance, robot i gives an order that lies near a neighbour's zone to that neighbour."""
    now = view.clock[CLOCK_TICK]
    state.next_share[i] = now + state.share_every
    identity = np.int64(view.robots.identity[i])
    mine = queue_length(view, identity)
    near = np.int64(state.rules.adjacent // 2)
    for zone in range(view.service_zones.server.shape[0]):
        server = np.int64(view.service_zones.server[zone])
        if server == NIL or server == identity or queue_length(view, zone) >= mine:
            continue
        if not is_near(view, i, np.int64(view.robots.at_index[server]), state.range):
            continue
        order = first_for(view, out, workspace, identity, zone, zone, 1, near, state.age, state.job)
        if order != NIL:
            enter(out, order, zone, np.int64(view.orders.target[order]), 1)
            state.shared_orders[i] += 1
            mine -= 1


@kernel
def is_blank(design):
    """Whether no station has a zone, not even one out of sight."""
    for point in range(design.held.shape[0]):
        if design.held[point] != NIL:
            return False
    return True


@kernel
def begin(view, out, state, k, i):
    """The first call for robot i: its timers, its zone, and the transfer stations to its neighbours."""
    now = view.clock[CLOCK_TICK]
    identity = np.int64(view.robots.identity[i])
    out.service_zone[k] = identity
    state.next_look[i] = now + state.look_every
    state.next_average[i] = next_multiple(now, state.average_every)
    state.next_share[i] = now + state.share_every
    state.step[i] = NIL
    state.mean[i] = NIL
    state.in_tolerance[i] = NIL
    state.calm[i] = now
    zones, design = state.zones, out.design
    reach = zones.reach
    if identity == 0 and is_blank(design):
        reach[:] = 1
        first_zones(
            view.service_zones.roads, state.rules, INITIAL_TEMPERATURE, FINAL_TEMPERATURE, STEPS,
            state.first_try, design, zones, reach, view.rules.seed, 0,
        )  # fmt: skip
        out.redesigned[0] = 1
        return
    find_robots_in_range(view, reach, i, state.range)
    for station in range(design.zone.shape[0]):
        for zone in range(reach.shape[0]):
            if reach[zone] and design.transfer[identity, zone, station]:
                return  # the scenario's design has them
    zones.load[:] = 0.0
    find_transfers(view.service_zones.roads, state.rules, design, zones, reach)
    out.redesigned[0] = 1


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, state = decisions.zoning, NegotiatorState.of(memory)
    zones, now = state.zones, view.clock[CLOCK_TICK]
    copy_design(view.service_zones.design, out.design)
    set_zone_move_time_factors(view, zones)
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        identity = np.int64(view.robots.identity[i])
        if state.next_look[i] == 0:
            begin(view, out, state, k, i)
        replace_broken(view, out, i, state.range)
        if not is_running(view, i):
            out.again[k] = state.look_every
            continue
        busy = negotiate(view, out, state, k, i)
        queue_orders_of(view, out.design, zones, out, ROUTING_NEIGHBOURS, identity, state.drop_near)
        reassign_orders(view, out, identity)
        looks = now >= state.next_look[i]
        averages = not busy and (now >= state.next_average[i] or state.step[i] != NIL)
        if looks or averages:
            degree = find_robots_in_range(view, zones.reach, i, state.range)
            load = np.int64(0)
            if looks or state.step[i] == NIL:  # further steps of a consensus need no load
                load = np.int64(NANO * own_load(view, state, out.design, i))
            if looks:
                update_tolerance_state(view, state, i, load)
            if averages:
                average(view, out, state, k, i, degree, load)
        if state.sharing and state.in_tolerance[i] == 0 and now >= state.next_share[i] and not busy:
            share_near(view, out, workspace, state, i)
        soon = min(state.next_look[i], state.next_average[i])
        out.again[k] = 1 if busy or state.step[i] != NIL else max(1, soon - now)


class DecentralizedZones(Strategy):
    """Robots that talk within a range agree on zones that balance their queues."""

    layer = "zoning"
    Parameters = Decentralized
    compiled = decide
    counters: ClassVar = {name: name for name in ("redesigns", "shared_orders", "messages")}

    def reset(self, view):
        """Nothing is remembered yet; the parameters in ticks, cells and nano-minutes."""
        parameters = self.parameters
        average_every = max(1, ticks(view, parameters.average_every))
        rules = rules_of_zones(view, parameters.adjacency, parameters.tip_pairs, decentralized=True)
        blank = (view.service_zones.design.held == NIL).all()
        return NegotiatorState.sized(
            {"n": len(view.robots.cell)},
            rules=rules,
            range=int(cells(view, parameters.range)),
            tolerance=round(NANO * parameters.tolerance),
            patience=ticks(view, SECONDS_PER_UNIT["min"] * parameters.patience),
            hysteresis=ticks(view, SECONDS_PER_UNIT["min"] * parameters.hysteresis),
            look_every=max(1, ticks(view, parameters.look)),
            average_every=average_every,
            rounds=min(parameters.rounds, max(1, average_every // 2)),
            turns=parameters.turns,
            iterations=parameters.iterations,
            hot=parameters.hot,
            cold=parameters.cold,
            scale=parameters.scale,
            pause=ticks(view, parameters.pause),
            sharing=parameters.sharing,
            share_every=max(1, ticks(view, parameters.share_every)),
            drop_near=int(cells(view, parameters.drop_near)) if parameters.drop_near else 0,
            **order_weights(self.other_layers.get("allocation")),
            first_try=try_first_zones(view, rules) if blank else 0,
            zones=space_of(view),
            parts=parts_for(len(view.service_zones.queue)),
        )
