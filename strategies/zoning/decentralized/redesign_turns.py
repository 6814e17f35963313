"""A redesign (Algorithm 4): who takes part, who leads, and how it ends."""

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL
from automaton.strategy.kernels import kernel, random_between
from strategies.zoning.decentralized.consensus_load import fill_parts, next_multiple, wants_redesign
from strategies.zoning.decentralized.negotiation import lead
from strategies.zoning.decentralized.negotiation_messages import (
    AVERAGE,
    AVERAGE_EVERY,
    CALM,
    COLD,
    DONE,
    HOT,
    IN,
    ITERATIONS,
    LEADER,
    LEADERS,
    LED,
    LOOK,
    LOOK_EVERY,
    MEAN,
    MESSAGES,
    MILLION,
    MOST_TURNS,
    NANO,
    PAUSE,
    RANGE,
    REDESIGN,
    REDESIGNS,
    ROUND,
    SCALE,
    SINCE,
    TURN,
    TURNS,
    begin_message,
    find_robots_in_range,
    is_near,
)
from strategies.zoning.queues.reassignment import enqueue_with_capable_zone
from strategies.zoning.queues.zone_queues import slot_at


@kernel
def join(view, out, memory, k, i, p, began):
    """Robot i takes part in the redesign that began in a tick, and stands still."""
    per_robot, now = memory.per_robot, view.clock[CLOCK_TICK]
    begin_message(view, out, k, i)
    out.messages[k, REDESIGN] = began
    out.messages[k, LEADER] = NIL
    out.messages[k, TURN] = 0
    out.messages[k, TURNS] = 0
    out.messages[k, DONE] = 0
    per_robot[i, LED] = 0
    per_robot[i, ROUND] = NIL
    left = p[PAUSE] - (now - began)
    if left > 0:
        out.halt[k] = min(left, 60_000)


@kernel
def leave(view, out, memory, k, i, p):
    """The redesign is over for robot i; it looks and reckons again when it drives again."""
    per_robot = memory.per_robot
    begin_message(view, out, k, i)
    out.messages[k, DONE] = 1
    goes_on = max(np.int64(view.clock[CLOCK_TICK]), out.messages[k, REDESIGN] + p[PAUSE])
    per_robot[i, CALM] = goes_on
    per_robot[i, SINCE] = goes_on
    per_robot[i, LOOK] = goes_on + p[LOOK_EVERY]
    per_robot[i, AVERAGE] = next_multiple(goes_on, p[AVERAGE_EVERY])
    per_robot[i, IN] = NIL


@kernel
def take_turn(view, out, memory, workspace, parts, rules, k, i, p, turn):
    """Robot i leads: exchanges about the mean, then the next leader is named, or the end."""
    per_robot, now = memory.per_robot, view.clock[CLOCK_TICK]
    identity = np.int64(view.robots.identity[i])
    reach = workspace.reach
    find_robots_in_range(view, reach, i, p[RANGE])
    seed = view.rules.seed
    if per_robot[i, LED] < p[MOST_TURNS]:
        fill_parts(view, parts)
        mean = max(per_robot[i, MEAN], 0) / NANO
        before = per_robot[i, LED] * p[ITERATIONS]
        hot, cold, scale = p[HOT] / MILLION, p[COLD] / MILLION, p[SCALE] / MILLION
        steps = p[MOST_TURNS] * p[ITERATIONS]
        lead(
            view.service_zones.roads, rules, parts, hot, cold, steps, scale, before, p[ITERATIONS],
            out.design, workspace, identity, reach, mean, seed, now,
        )  # fmt: skip
        out.redesigned[0] = 1
        enter_parts(view, out, parts, reach)
        per_robot[i, LED] += 1
    begin_message(view, out, k, i)
    out.messages[k, TURNS] = per_robot[i, LED]
    waiting = per_robot[i, LED] < p[MOST_TURNS]
    near = 0
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, p[RANGE]):
            near += 1
            waiting = waiting or view.service_zones.messages[j, TURNS] < p[MOST_TURNS]
            per_robot[i, MESSAGES] += 1
    if not waiting or near == 0:
        per_robot[i, REDESIGNS] += 1
        leave(view, out, memory, k, i, p)
        return
    chosen = random_between(0, near - 1, seed, LEADERS, now, identity)
    for other in range(view.robots.cell.shape[0]):
        j = np.int64(view.robots.at_index[other])
        if is_near(view, i, j, p[RANGE]):
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
def negotiate(view, out, memory, workspace, parts, rules, k, i, p):
    """What robot i does in a redesign, or to begin one; returns whether it takes part."""
    now, messages = view.clock[CLOCK_TICK], view.service_zones.messages
    identity = np.int64(view.robots.identity[i])
    active = messages[i, REDESIGN] > 0 and messages[i, DONE] == 0
    over, newest = False, np.int64(0)
    turn, leader = messages[i, TURN], messages[i, LEADER]
    for j in range(view.robots.cell.shape[0]):
        if not is_near(view, i, j, p[RANGE]):
            continue
        if messages[j, DONE] == 0:
            newest = max(newest, messages[j, REDESIGN])
        if active and messages[j, REDESIGN] == messages[i, REDESIGN]:
            over = over or messages[j, DONE] == 1
            if messages[j, TURN] > turn:
                turn, leader = messages[j, TURN], messages[j, LEADER]
    if active:
        if over or now - messages[i, REDESIGN] > p[PAUSE] + 100 * (1 + p[MOST_TURNS]):
            leave(view, out, memory, k, i, p)
            return False
        if leader == identity and (messages[i, TURN] < turn or turn == 1):
            take_turn(view, out, memory, workspace, parts, rules, k, i, p, turn)
        return True
    if newest > messages[i, REDESIGN]:
        join(view, out, memory, k, i, p, newest)
        return True
    if wants_redesign(view, memory, i, p) and find_robots_in_range(
        view, workspace.reach, i, p[RANGE]
    ):
        join(view, out, memory, k, i, p, now)
        out.messages[k, LEADER] = identity
        out.messages[k, TURN] = 1
        return True
    return False
