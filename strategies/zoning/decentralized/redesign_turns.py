"""A redesign (Algorithm 4): who takes part, who leads, and how it ends."""

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import kernel, random_between
from strategies.zoning.decentralized.consensus_load import fill_parts, next_multiple, wants_redesign
from strategies.zoning.decentralized.negotiation import lead
from strategies.zoning.decentralized.negotiation_messages import (
    DONE,
    LEADER,
    LEADERS,
    NANO,
    REDESIGN,
    TURN,
    TURNS,
    begin_message,
    find_robots_in_range,
    is_near,
)
from strategies.zoning.queues.reassignment import enqueue_with_capable_zone
from strategies.zoning.queues.zone_queues import slot_at


@kernel
def join(view, out, state, k, i, began):
    """Robot i takes part in the redesign that began in a tick, and stands still."""
    now = view.clock[CLOCK_TICK]
    begin_message(view, out, k, i)
    out.messages[k, REDESIGN] = began
    out.messages[k, LEADER] = NIL
    out.messages[k, TURN] = 0
    out.messages[k, TURNS] = 0
    out.messages[k, DONE] = 0
    state.led[i] = 0
    state.step[i] = NIL
    left = state.pause - (now - began)
    if left > 0:
        out.halt[k] = min(left, 60_000)


@kernel
def leave(view, out, state, k, i):
    """The redesign is over for robot i; it looks and reckons again when it drives again."""
    begin_message(view, out, k, i)
    out.messages[k, DONE] = 1
    goes_on = max(np.int64(view.clock[CLOCK_TICK]), out.messages[k, REDESIGN] + state.pause)
    state.calm[i] = goes_on
    state.since[i] = goes_on
    state.next_look[i] = goes_on + state.look_every
    state.next_average[i] = next_multiple(goes_on, state.average_every)
    state.in_tolerance[i] = NIL


@kernel
def take_turn(view, out, state, k, i, turn):
    """Robot i leads: exchanges about the mean, then the next leader is named, or the end."""
    now = view.clock[CLOCK_TICK]
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
        out.redesigned[0] = 1
        enter_parts(view, out, parts, reach)
        state.led[i] += 1
    begin_message(view, out, k, i)
    out.messages[k, TURNS] = state.led[i]
    waiting = state.led[i] < state.turns
    near = 0
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, state.range):
            near += 1
            waiting = waiting or view.service_zones.messages[j, TURNS] < state.turns
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
                out.messages[k, TURN] = turn + 1
            chosen -= 1


@kernel
def enter_parts(view, out, parts, reach):
    """Decide where the parts of a negotiation wait now, and where they are brought."""
    service_zones = view.service_zones
    for n in range(parts.count[0]):
        order = np.int64(parts.order[n])
        if parts.carried[n] or reach[parts.zone[n]] == 0:
            continue
        queue, station = np.int64(parts.zone[n]), np.int64(parts.stop[n])
        if (
            queue == service_zones.queue[order]
            and station == service_zones.station_of[service_zones.next_slot[order]]
        ):
            continue
        target = np.int64(view.orders.target[order])
        stop = target if station == parts.to[n] else slot_at(view, station)
        enqueue_with_capable_zone(view, out, order, queue, target if stop == NIL else stop, 0)


@kernel
def negotiate(view, out, state, k, i):
    """What robot i does in a redesign, or to begin one; returns whether it takes part."""
    now, messages = view.clock[CLOCK_TICK], view.service_zones.messages
    identity = np.int64(view.robots.identity[i])
    active = messages[i, REDESIGN] > 0 and messages[i, DONE] == 0
    over, newest = False, np.int64(0)
    turn, leader = messages[i, TURN], messages[i, LEADER]
    for j in range(view.robots.cell.shape[0]):
        if not is_near(view, i, j, state.range):
            continue
        if messages[j, DONE] == 0:
            newest = max(newest, messages[j, REDESIGN])
        if active and messages[j, REDESIGN] == messages[i, REDESIGN]:
            over = over or messages[j, DONE] == 1
            if messages[j, TURN] > turn:
                turn, leader = messages[j, TURN], messages[j, LEADER]
    if active:
        if over or now - messages[i, REDESIGN] > state.pause + 100 * (1 + state.turns):
            leave(view, out, state, k, i)
            return False
        if leader == identity and (messages[i, TURN] < turn or turn == 1):
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
        out.messages[k, TURN] = 1
        return True
    return False
