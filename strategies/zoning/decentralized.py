"""Decentralized dynamic zoning (Keith & La, Algorithms 3 and 4): robots negotiate with robots in range.

Each robot measures its own load periodically. Periodically all robots find the mean of their loads by
consensus, one step per tick. A robot that has long been out of tolerance signals, and the signal
spreads from robot to robot. The first leader tries exchanges of stations with its neighbours, then
names the next leader, until each robot has led often enough. Meanwhile robots stand still for the time
set in the scenario.

A robot uses only its own memory, its view, and the messages of robots in range (`messages`). With
`information: {radius: ..., shape: circle, orders: zones}` the view contains nothing else.
"""

from typing import ClassVar

import numpy as np

from automaton.strategy.api import (
    NIL,
    ORDER_CARRIED,
    ORDER_WAITING,
    Array,
    Strategy,
    Struct,
    field,
    kernel,
    position,
    random_between,
)
from strategies.zoning.annealing import first_zones
from strategies.zoning.loads_and_transfers import ROUTING_NEIGHBOURS, find_transfers
from strategies.zoning.monitored import (
    ANNEALING_STEPS,
    FINAL_TEMPERATURE,
    INITIAL_TEMPERATURE,
    space_of,
    try_first_zones,
)
from strategies.zoning.negotiation import NegotiatedParts, lead, loads_of_queues, parts_for
from strategies.zoning.zone_queues import (
    cells,
    charging_minutes,
    enqueue_with_capable_zone,
    enter,
    first_for,
    is_running,
    order_weights,
    queue_length,
    queue_orders_of,
    reassign_orders,
    rules_of_zones,
    serves_all,
    set_zone_move_time_factors,
    slot_at,
    ticks,
    ticks_of_minutes,
)
from strategies.zoning.zone_workspace import ZoneRules, ZoneSpace, copy_design
from strategies.zoning.zoning_parameters import Decentralized

NANO = 1_000_000_000  # unit of loads in messages, as a fraction of a minute
DEGREES = 1 << 12  # upper bound of the robots in range of a robot
BIAS = NANO // 10  # initial degree in a consensus
# Words of a message.
VALUE = 0  # and 1: state of the consensus after even and odd steps: value * DEGREES + degree
REDESIGN = 2  # tick at which the redesign began, 0 before the first
LEADER = 3  # the next leader, as known to this robot
TURN_NUMBER = 4  # the number of that turn
TURNS_LED = 5  # turns led by this robot
DONE = 6  # 1: the redesign is over
LEADERS = 33  # stream of the draws of the next leader


class NegotiatorState(Struct):
    """Parameters of negotiating robots, and the memory of each."""

    rules: ZoneRules
    range: int = field("int64", "cells: range of messages")
    tolerance: int = field("int64", "nano-minutes: tolerated difference of a load from the mean")
    patience: int = field("int64", "ticks without calm before a redesign")
    hysteresis: int = field("int64", "ticks in or out of tolerance before this counts")
    look_every: int = field("int64", "ticks")
    average_every: int = field("int64", "ticks")
    rounds: int = field("int64", "steps of a consensus")
    turns: int = field("int64", "turns that each robot leads in a redesign")
    iterations: int = field("int64", "exchanges in a turn")
    hot: float = field("float64", "initial temperature of a redesign")
    cold: float = field("float64", "final temperature")
    scale: float = field("float64", "minutes, k of Algorithm 4")
    pause: int = field("int64", "ticks for which robots stand still in a redesign")
    sharing: int = field("int64", "1: robots out of tolerance share orders")
    share_every: int = field("int64", "ticks")
    drop_near: int = field(
        "int64", "cells: orders go directly to stations this near a transfer station; 0: none"
    )
    age: int = field("int64", "weights of Algorithm 2, in thousandths")
    job: int = field("int64")
    first_try: int = field("int64", "failed tries before the first zones are found")

    next_look: Array = field("(n,) int64", "tick of the next measurement; 0: not started")
    next_average: Array = field("(n,) int64", "tick of the next consensus")
    next_share: Array = field("(n,) int64", "tick of the next sharing")
    step: Array = field("(n,) int64", "step of the current consensus, or NIL")
    mean: Array = field(
        "(n,) int64", "result of the last consensus, in nano-minutes; NIL: none yet"
    )
    in_tolerance: Array = field("(n,) int64", "1 in tolerance, 0 out of tolerance, NIL unknown")
    since: Array = field("(n,) int64", "tick of the last change of this")
    calm: Array = field("(n,) int64", "tick of the last calm, or of the last redesign")
    led: Array = field("(n,) int64", "turns led in this redesign")
    redesigns: Array = field("(n,) int64", "redesigns that it completed")
    shared_orders: Array = field("(n,) int64", "orders that it gave away")
    messages: Array = field("(n,) int64", "messages that it received")

    zones: ZoneSpace
    parts: NegotiatedParts


@kernel
def decide(view, batch, decisions, memory, workspace):
    out, state = decisions.zoning, NegotiatorState.of(memory)
    zones, now = state.zones, view.clock.tick
    copy_design(view.service_zones.design, out.design)
    set_zone_move_time_factors(view, zones)
    for k in range(batch.count):
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
    """Robots communicate within a range and agree on zones that balance their queues."""

    layer = "zoning"
    Parameters = Decentralized
    compiled = decide
    counters: ClassVar = {name: name for name in ("redesigns", "shared_orders", "messages")}

    def reset(self, view):
        """Return an empty memory, and the parameters in ticks, cells and nano-minutes."""
        parameters = self.parameters
        average_every = max(1, ticks(view, parameters.average_every))
        rules = rules_of_zones(view, parameters.adjacency, parameters.tip_pairs, decentralized=True)
        blank = (view.service_zones.design.held == NIL).all()
        return NegotiatorState.sized(
            {"n": len(view.robots.cell)},
            rules=rules,
            range=int(cells(view, parameters.range)),
            tolerance=round(NANO * parameters.tolerance),
            patience=ticks_of_minutes(view, parameters.patience),
            hysteresis=ticks_of_minutes(view, parameters.hysteresis),
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


@kernel
def begin(view, out, state, k, i):
    """Initialize robot i: its timers, its zone, and the transfer stations to its neighbours."""
    now = view.clock.tick
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
            view.service_zones.roads, state.rules, INITIAL_TEMPERATURE, FINAL_TEMPERATURE,
            ANNEALING_STEPS, state.first_try, design, zones, reach, view.rules.seed, 0,
        )  # fmt: skip
        out.redesigned = 1
        return
    find_robots_in_range(view, reach, i, state.range)
    for station in range(design.zone.shape[0]):
        for zone in range(reach.shape[0]):
            if reach[zone] and design.transfer[identity, zone, station]:
                return  # the scenario's design has transfer stations
    zones.load[:] = 0.0
    find_transfers(view.service_zones.roads, state.rules, design, zones, reach)
    out.redesigned = 1


@kernel
def is_blank(design):
    """Whether no station has a zone, including stations out of sight."""
    for point in range(design.held.shape[0]):
        if design.held[point] != NIL:
            return False
    return True


@kernel
def is_near(view, i, j, far):
    """Whether two robots are within this straight-line distance in cells, and neither is down."""
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
    """Mark the zones of a robot and of the robots in range; return the number of the latter."""
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
    """Begin a new message of robot i: it keeps all values that are not changed now."""
    if out.sends_message[k] == 0:
        out.sends_message[k] = 1
        for word in range(out.messages.shape[1]):
            out.messages[k, word] = view.service_zones.messages[i, word]


@kernel
def replace_broken(view, out, i, far):
    """Let robot i serve its own zone, and the zone of a visible robot that is down and not replaced."""
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
    """If robot i is out of tolerance, give an order near a neighbour's zone to that neighbour."""
    now = view.clock.tick
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


# The load of a robot, the mean of all by consensus (Algorithm 3), and whether it is in tolerance.
#
# Weighted average consensus with Metropolis weights:
#
#     x_i <- W_ii x_i + sum W_ij x_j over neighbours j,  W_ij = 1 / (1 + max(d_i, d_j)),  W_ii = 1 - sum
#
# Values are in billionths of a minute. An exchange of two neighbours is rounded towards zero: one gains
# exactly what the other loses, so every step preserves the sum exactly.


@kernel
def own_load(view, state, design, i):
    """Minutes of work of robot i: the queues of the zones that it serves, and charging."""
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
def fill_parts(view, parts):
    """List the parts in queues, and the parts that robots carry or fetch, which keep their routes.

    Parts that are too heavy for the robot of the zone in which they wait also keep theirs.
    """
    orders, service_zones = view.orders, view.service_zones
    count = 0
    for order in range(orders.state.shape[0]):
        state = orders.state[order]
        if state != ORDER_WAITING and state != ORDER_CARRIED:
            continue
        waits = state == ORDER_WAITING
        slot = np.int64(orders.current_slot[order] if waits else service_zones.picked_from[order])
        next_slot = np.int64(service_zones.next_slot[order])
        if service_zones.queue[order] < 0 or slot == NIL or next_slot == NIL:
            continue
        at = np.int64(service_zones.station_of[slot])
        to = np.int64(service_zones.station_of[orders.target[order]])
        if at == NIL or to == NIL:
            continue
        parts.order[count] = order
        parts.at[count] = at
        parts.to[count] = to
        parts.zone[count] = service_zones.queue[order]
        parts.stop[count] = service_zones.station_of[next_slot]
        taken = state == ORDER_CARRIED or orders.reserved_by[order] != NIL
        fixed = taken or is_reassigned(view, order, at)
        parts.carried[count] = 1 if fixed else 0
        count += 1
    parts.count = count


@kernel
def is_reassigned(view, order, at):
    """Whether an order is too heavy for the robot of its zone, so that another robot serves it."""
    zone = np.int64(view.service_zones.design.zone[at])
    if zone == NIL or view.service_zones.skips_transfer[order] == 0:
        return False
    robot_type = np.int64(view.robots.type[view.robots.at_index[zone]])
    return view.orders.weight[order] > view.rules.payload[robot_type]


@kernel
def average(view, out, state, k, i, degree, load):
    """Consensus with Metropolis weights: begin it, or do one more step.

    All robots use values and degrees from messages of the previous step, so the sum is preserved.
    """
    now = view.clock.tick
    if state.step[i] == NIL:
        state.next_average[i] = next_multiple(now, state.average_every)
        if degree == 0:
            return  # without neighbours it keeps its last mean
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
def moved(value, other, degree, other_degree):
    """The change of a value towards a neighbour's value in a step."""
    gap = other - value
    weight = 1 + max(degree, other_degree)
    return gap // weight if gap >= 0 else -(-gap // weight)


@kernel
def next_multiple(now, every):
    """The next tick at which all robots begin a consensus: their clocks agree."""
    return (now // every + 1) * every


@kernel
def update_tolerance_state(view, state, i, load):
    """Update whether robot i is in tolerance, and since when; it is calm after long in tolerance."""
    now = view.clock.tick
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
    """Whether robot i is out of tolerance, and its last calm is long ago."""
    now = view.clock.tick
    out = state.in_tolerance[i] == 0 and now - state.since[i] >= state.hysteresis
    return out and now - state.calm[i] > state.patience


# A redesign (Algorithm 4): participants, leaders, and its end.


@kernel
def negotiate(view, out, state, k, i):
    """Do robot i's part in a redesign, or begin one; return whether it takes part."""
    now, messages = view.clock.tick, view.service_zones.messages
    identity = np.int64(view.robots.identity[i])
    active = messages[i, REDESIGN] > 0 and messages[i, DONE] == 0
    over, newest = False, np.int64(0)
    turn, leader = messages[i, TURN_NUMBER], messages[i, LEADER]
    for j in range(view.robots.cell.shape[0]):
        if not is_near(view, i, j, state.range):
            continue
        if messages[j, DONE] == 0:
            newest = max(newest, messages[j, REDESIGN])
        if active and messages[j, REDESIGN] == messages[i, REDESIGN]:
            over = over or messages[j, DONE] == 1
            if messages[j, TURN_NUMBER] > turn:
                turn, leader = messages[j, TURN_NUMBER], messages[j, LEADER]
    if active:
        if over or now - messages[i, REDESIGN] > state.pause + 100 * (1 + state.turns):
            leave(view, out, state, k, i)
            return False
        if leader == identity and (messages[i, TURN_NUMBER] < turn or turn == 1):
            take_turn(view, out, state, k, i, turn)
        return True
    if newest > messages[i, REDESIGN]:
        join(view, out, state, k, i, newest)
        return True
    if wants_redesign(view, state, i) and find_robots_in_range(
        view, state.zones.reach, i, state.range
    ):
        join(view, out, state, k, i, now)
        out.messages[k, LEADER] = identity
        out.messages[k, TURN_NUMBER] = 1
        return True
    return False


@kernel
def join(view, out, state, k, i, began):
    """Let robot i join the redesign that began at this tick, and stand still."""
    now = view.clock.tick
    begin_message(view, out, k, i)
    out.messages[k, REDESIGN] = began
    out.messages[k, LEADER] = NIL
    out.messages[k, TURN_NUMBER] = 0
    out.messages[k, TURNS_LED] = 0
    out.messages[k, DONE] = 0
    state.led[i] = 0
    state.step[i] = NIL
    left = state.pause - (now - began)
    if left > 0:
        out.halt[k] = min(left, 60_000)


@kernel
def leave(view, out, state, k, i):
    """End the redesign for robot i; it measures and averages again once it drives."""
    begin_message(view, out, k, i)
    out.messages[k, DONE] = 1
    goes_on = max(np.int64(view.clock.tick), out.messages[k, REDESIGN] + state.pause)
    state.calm[i] = goes_on
    state.since[i] = goes_on
    state.next_look[i] = goes_on + state.look_every
    state.next_average[i] = next_multiple(goes_on, state.average_every)
    state.in_tolerance[i] = NIL


@kernel
def take_turn(view, out, state, k, i, turn):
    """Lead a turn with robot i: try exchanges, then name the next leader or end the redesign."""
    now = view.clock.tick
    identity = np.int64(view.robots.identity[i])
    parts, reach = state.parts, state.zones.reach
    find_robots_in_range(view, reach, i, state.range)
    seed = view.rules.seed
    if state.led[i] < state.turns:
        fill_parts(view, parts)
        mean = max(state.mean[i], 0) / NANO
        before = state.led[i] * state.iterations
        steps = state.turns * state.iterations
        lead(
            view.service_zones.roads, state.rules, parts, state.hot, state.cold, steps, state.scale,
            before, state.iterations, out.design, state.zones, identity, reach, mean, seed, now,
        )  # fmt: skip
        out.redesigned = 1
        enter_parts(view, out, parts, reach)
        state.led[i] += 1
    begin_message(view, out, k, i)
    out.messages[k, TURNS_LED] = state.led[i]
    waiting = state.led[i] < state.turns
    near = 0
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, state.range):
            near += 1
            waiting = waiting or view.service_zones.messages[j, TURNS_LED] < state.turns
            state.messages[i] += 1
    if not waiting or near == 0:
        state.redesigns[i] += 1
        leave(view, out, state, k, i)
        return
    chosen = random_between(0, near - 1, seed, LEADERS, now, identity)
    for other in range(view.robots.cell.shape[0]):
        j = np.int64(view.robots.at_index[other])
        if is_near(view, i, j, state.range):
            if chosen == 0:
                out.messages[k, LEADER] = other
                out.messages[k, TURN_NUMBER] = turn + 1
            chosen -= 1


@kernel
def enter_parts(view, out, parts, reach):
    """Assign the parts of a negotiation to their new queues and stops."""
    service_zones = view.service_zones
    for n in range(parts.count):
        order = np.int64(parts.order[n])
        if parts.carried[n] or reach[parts.zone[n]] == 0:
            continue
        queue, station = np.int64(parts.zone[n]), np.int64(parts.stop[n])
        now_to = service_zones.station_of[service_zones.next_slot[order]]
        if queue == service_zones.queue[order] and station == now_to:
            continue
        target = np.int64(view.orders.target[order])
        stop = target if station == parts.to[n] else slot_at(view, station)
        enqueue_with_capable_zone(view, out, order, queue, target if stop == NIL else stop, 0)
