"""A redesign (Algorithm 4): who takes part, who leads, and how it ends."""

import numpy as np

from automaton.strategy.kernels import draw_between, kernel
from automaton.world.state import NIL, TICK
from automaton.zoning.negotiation import lead
from strategies.zoning.able import enter_able
from strategies.zoning.averaging import fill_parts, next_multiple, wants_redesign
from strategies.zoning.queues import slot_at
from strategies.zoning.talk import (
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
    find_reach,
    is_near,
    tell,
)


@kernel
def join(view, given, memory, k, i, p, began):
    """Robot i takes part in the redesign that began in a tick, and stands still."""
    own, now = memory.own, view.clock[TICK]
    tell(view, given, k, i)
    given.said[k, REDESIGN] = began
    given.said[k, LEADER] = NIL
    given.said[k, TURN] = 0
    given.said[k, TURNS] = 0
    given.said[k, DONE] = 0
    own[i, LED] = 0
    own[i, ROUND] = NIL
    left = p[PAUSE] - (now - began)
    if left > 0:
        given.halt[k] = min(left, 60_000)


@kernel
def leave(view, given, memory, k, i, p):
    """The redesign is over for robot i; it looks and reckons again when it drives again."""
    own = memory.own
    tell(view, given, k, i)
    given.said[k, DONE] = 1
    goes_on = max(np.int64(view.clock[TICK]), given.said[k, REDESIGN] + p[PAUSE])
    own[i, CALM] = goes_on
    own[i, SINCE] = goes_on
    own[i, LOOK] = goes_on + p[LOOK_EVERY]
    own[i, AVERAGE] = next_multiple(goes_on, p[AVERAGE_EVERY])
    own[i, IN] = NIL


@kernel
def take_turn(view, given, memory, space, parts, rules, k, i, p, turn):
    """Robot i leads: exchanges about the mean, then the next leader is named, or the end."""
    own, now = memory.own, view.clock[TICK]
    identity = np.int64(view.robots.identity[i])
    reach = space.reach
    find_reach(view, reach, i, p[RANGE])
    seed = view.rules.seed
    if own[i, LED] < p[MOST_TURNS]:
        fill_parts(view, parts)
        mean = max(own[i, MEAN], 0) / NANO
        before = own[i, LED] * p[ITERATIONS]
        hot, cold, scale = p[HOT] / MILLION, p[COLD] / MILLION, p[SCALE] / MILLION
        steps = p[MOST_TURNS] * p[ITERATIONS]
        lead(
            view.zoning.roads, rules, parts, hot, cold, steps, scale, before, p[ITERATIONS],
            given.design, space, identity, reach, mean, seed, now,
        )  # fmt: skip
        given.redesigned[0] = 1
        enter_parts(view, given, parts, reach)
        own[i, LED] += 1
    tell(view, given, k, i)
    given.said[k, TURNS] = own[i, LED]
    waiting = own[i, LED] < p[MOST_TURNS]
    near = 0
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, p[RANGE]):
            near += 1
            waiting = waiting or view.zoning.said[j, TURNS] < p[MOST_TURNS]
            own[i, MESSAGES] += 1
    if not waiting or near == 0:
        own[i, REDESIGNS] += 1
        leave(view, given, memory, k, i, p)
        return
    chosen = draw_between(0, near - 1, seed, LEADERS, now, identity)
    for other in range(view.robots.cell.shape[0]):
        j = np.int64(view.robots.at_index[other])
        if is_near(view, i, j, p[RANGE]):
            if chosen == 0:
                given.said[k, LEADER] = other
                given.said[k, TURN] = turn + 1
            chosen -= 1


@kernel
def enter_parts(view, given, parts, reach):
    """Answer where the parts of a negotiation wait now, and where they are brought."""
    zoning = view.zoning
    for n in range(parts.count[0]):
        order = np.int64(parts.order[n])
        if parts.carried[n] or reach[parts.zone[n]] == 0:
            continue
        queue, station = np.int64(parts.zone[n]), np.int64(parts.stop[n])
        if queue == zoning.queue[order] and station == zoning.station_of[zoning.stop[order]]:
            continue
        target = np.int64(view.orders.target[order])
        stop = target if station == parts.to[n] else slot_at(view, station)
        enter_able(view, given, order, queue, target if stop == NIL else stop, 0)


@kernel
def negotiate(view, given, memory, space, parts, rules, k, i, p):
    """What robot i does in a redesign, or to begin one; returns whether it takes part."""
    now, said = view.clock[TICK], view.zoning.said
    identity = np.int64(view.robots.identity[i])
    active = said[i, REDESIGN] > 0 and said[i, DONE] == 0
    over, newest = False, np.int64(0)
    turn, leader = said[i, TURN], said[i, LEADER]
    for j in range(view.robots.cell.shape[0]):
        if not is_near(view, i, j, p[RANGE]):
            continue
        if said[j, DONE] == 0:
            newest = max(newest, said[j, REDESIGN])
        if active and said[j, REDESIGN] == said[i, REDESIGN]:
            over = over or said[j, DONE] == 1
            if said[j, TURN] > turn:
                turn, leader = said[j, TURN], said[j, LEADER]
    if active:
        if over or now - said[i, REDESIGN] > p[PAUSE] + 100 * (1 + p[MOST_TURNS]):
            leave(view, given, memory, k, i, p)
            return False
        if leader == identity and (said[i, TURN] < turn or turn == 1):
            take_turn(view, given, memory, space, parts, rules, k, i, p, turn)
        return True
    if newest > said[i, REDESIGN]:
        join(view, given, memory, k, i, p, newest)
        return True
    if wants_redesign(view, memory, i, p) and find_reach(view, space.reach, i, p[RANGE]):
        join(view, given, memory, k, i, p, now)
        given.said[k, LEADER] = identity
        given.said[k, TURN] = 1
        return True
    return False
