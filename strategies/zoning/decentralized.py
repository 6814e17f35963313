"""Decentralized dynamic zoning (Keith & La, Algorithms 3 and 4): robots negotiate with whom they reach.

Each robot looks at its own load every now and then. From time to time all agree on the mean of their
loads by consensus, one step in a tick. A robot that has been out of tolerance for long signals; the
signal spreads from robot to robot. The first leader tries exchanges of stations with its neighbours,
then names the next leader, until everybody has led often enough. Meanwhile robots stand still as long
as the scenario says.

A robot uses nothing but its own memory, what it sees, and what those in range tell it (`said`). With
`information: {radius: ..., shape: circle, orders: zones}` the view holds nothing else.
"""

import numpy as np

from automaton.strategy.kernels import draw_between, kernel, position
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.partition import SAID
from automaton.world.state import CARRIED, NIL, TICK, WAITING
from automaton.zoning.annealing import repair
from automaton.zoning.negotiation import lead, loads_of_queues
from automaton.zoning.paths import copy_design
from automaton.zoning.routing import NEIGHBOURS
from automaton.zoning.space import ADJACENT, RULES
from automaton.zoning.transfer import find_transfers
from strategies.zoning.charging_load import charging_minutes
from strategies.zoning.parameters import Decentralized
from strategies.zoning.queues import (
    enter,
    first_for,
    is_running,
    queue_length,
    queue_orders_of,
    slot_at,
)
from strategies.zoning.units import cells, rules_of_zones, ticks

NANO = 1_000_000_000  # loads are told in this part of a minute
BIAS = NANO // 10  # that consensus begins with

# memory.own
LOOK = 0  # tick of the next look
AVERAGE = 1  # tick of the next consensus
ROUND = 2  # step of the consensus that goes on, or NIL
MEAN = 3  # of the last one, in nano-minutes; NIL: none yet
IN = 4  # 1 in tolerance, 0 out of it, NIL unknown
SINCE = 5  # tick since which that is so
CALM = 6  # tick of the last calm, or of the last redesign
LED = 7  # turns led in this redesign
SHARE = 8  # tick of the next sharing
REDESIGNS = 9  # counters
SHARES = 10
MESSAGES = 11
OWN = 12

# words of `said`
VALUE = 0  # and 1: what consensus has come to, by even and odd steps
DEGREE = 2
REDESIGN = 3  # tick in which the redesign began, 0 before the first
LEADER = 4  # who leads next, as far as this robot knows
TURN = 5  # the number of that turn
TURNS = 6  # turns that this robot led
DONE = 7  # 1: the redesign is over

# memory.parameters, after the rules of zones in millionths
RANGE = 0  # cells
TOLERANCE = 1  # nano-minutes
PATIENCE = 2  # ticks
HYSTERESIS = 3
LOOK_EVERY = 4
AVERAGE_EVERY = 5
ROUNDS = 6
MOST_TURNS = 7
ITERATIONS = 8
HOT = 9  # millionths
COLD = 10
SCALE = 11
PAUSE = 12  # ticks
SHARING = 13
NEAR = 14  # cells
SHARE_EVERY = 15
FIRST_RULE = 16
MILLION = 1_000_000

LEADERS = 33  # stream of the draws of the next leader


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
def find_reach(view, reach, i, far):
    """Mark the zones of a robot and of those in range; returns how many of these there are."""
    count = 0
    for zone in range(reach.shape[0]):
        reach[zone] = 0
        server = np.int64(view.zoning.server[zone])
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
def fill_parts(view, parts):
    """List the parts that wait in queues, and those that robots have or fetch: these keep their way."""
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
        parts.carried[count] = 1 if state == CARRIED or orders.by[order] != NIL else 0
        count += 1
    parts.count[0] = count


@kernel
def own_load(view, rules, design, space, parts, identity):
    """Minutes of work of a robot: what lies in the queues of the zones that it serves, and charging."""
    space.leg_flow[:] = 0.0
    reach = space.reach
    for zone in range(reach.shape[0]):
        reach[zone] = 1 if view.zoning.server[zone] == identity else 0
    fill_parts(view, parts)
    loads_of_queues(view.zoning.roads, rules, design, space, parts, parts.zone, parts.stop, reach)
    total = 0.0
    for zone in range(reach.shape[0]):
        if reach[zone]:
            total += space.load[zone]
    return total + charging_minutes(view, rules, identity)


@kernel
def tell(view, given, k, i):
    """Begin to say something new: what robot i says stays as it is but for what is changed now."""
    if given.tells[k] == 0:
        given.tells[k] = 1
        for word in range(SAID):
            given.said[k, word] = view.zoning.said[i, word]


@kernel
def average(view, given, memory, k, i, p, degree, load):
    """Consensus with Metropolis weights: its beginning, or one more step."""
    own, now = memory.own, view.clock[TICK]
    if own[i, ROUND] == NIL:
        own[i, AVERAGE] = now + p[AVERAGE_EVERY]
        if degree == 0:
            return  # alone it keeps the mean that it has
        tell(view, given, k, i)
        own[i, ROUND] = 0
        given.said[k, VALUE] = load + BIAS
        given.said[k, DEGREE] = degree
        return
    step = own[i, ROUND]
    value = view.zoning.said[i, VALUE + (step & 1)]
    total = value
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, p[RANGE]):
            weight = 1 + max(degree, view.zoning.said[j, DEGREE])
            total += (view.zoning.said[j, VALUE + (step & 1)] - value) // weight
            own[i, MESSAGES] += 1
    tell(view, given, k, i)
    given.said[k, VALUE + ((step + 1) & 1)] = total
    given.said[k, DEGREE] = degree
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
    own, now = memory.own, view.clock[TICK]
    out = own[i, IN] == 0 and now - own[i, SINCE] >= p[HYSTERESIS]
    return out and now - own[i, CALM] > p[PATIENCE]


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
    own[i, AVERAGE] = goes_on + p[AVERAGE_EVERY]
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
        enter(given, order, queue, target if stop == NIL else stop, 0)


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


@kernel
def replace_broken(view, given, i, far):
    """Robot i serves its own zone, and that of one in range that is out of order and unreplaced."""
    identity = np.int64(view.robots.identity[i])
    for zone in range(view.zoning.server.shape[0]):
        server = np.int64(view.zoning.server[zone])
        base = np.int64(view.robots.at_index[zone])
        if zone == identity and server != identity and is_running(view, i):
            given.server[zone] = identity
        elif server != NIL and zone != identity and not is_running(view, base):
            holder = np.int64(view.robots.at_index[server])
            if not is_running(view, holder) and is_running(view, i):
                given.server[zone] = identity


@kernel
def share_near(view, given, space, memory, i, p, age, job):
    """Out of tolerance, robot i gives an order that lies near a neighbour's zone to that neighbour."""
    own, now = memory.own, view.clock[TICK]
    own[i, SHARE] = now + p[SHARE_EVERY]
    identity = np.int64(view.robots.identity[i])
    mine = queue_length(view, identity)
    near = p[FIRST_RULE + ADJACENT] // (2 * MILLION)
    for zone in range(view.zoning.server.shape[0]):
        server = np.int64(view.zoning.server[zone])
        if server == NIL or server == identity or queue_length(view, zone) >= mine:
            continue
        if not is_near(view, i, np.int64(view.robots.at_index[server]), p[RANGE]):
            continue
        order = first_for(view, space, identity, zone, 1, near, age, job)
        if order != NIL:
            enter(given, order, zone, np.int64(view.orders.target[order]), 1)
            own[i, SHARES] += 1
            mine -= 1


@kernel
def is_blank(design):
    """Whether no station has a zone, not even one out of sight."""
    for point in range(design.held.shape[0]):
        if design.held[point] != NIL:
            return False
    return True


@kernel
def begin(view, given, memory, space, rules, k, i, p):
    """The first call for robot i: its timers, its zone, and the transfer stations to its neighbours."""
    own, now = memory.own, view.clock[TICK]
    identity = np.int64(view.robots.identity[i])
    given.zone[k] = identity
    own[i, LOOK] = now + p[LOOK_EVERY]
    own[i, AVERAGE] = now + p[AVERAGE_EVERY]
    own[i, SHARE] = now + p[SHARE_EVERY]
    own[i, ROUND] = NIL
    own[i, MEAN] = NIL
    own[i, IN] = NIL
    own[i, CALM] = now
    reach = space.reach
    design = given.design
    if identity == 0 and is_blank(design):
        reach[:] = 1
        legs = space.legs
        for a in range(legs.shape[0]):
            for b in range(legs.shape[0]):
                legs[a, b] = 0.0 if a == b else 1.0
        repair(
            view.zoning.roads, rules, legs, 4.5, 0.35, 500, 500, 3,
            design, space, reach, view.rules.seed, now,
        )  # fmt: skip
        given.redesigned[0] = 1
        return
    find_reach(view, reach, i, p[RANGE])
    for station in range(design.zone.shape[0]):
        for zone in range(reach.shape[0]):
            if reach[zone] and design.transfer[identity, zone, station]:
                return  # the scenario's design has them
    space.load[:] = 0.0
    find_transfers(view.zoning.roads, rules, design, space, reach)
    given.redesigned[0] = 1


@kernel
def decide(view, asked, answers, memory, space):
    given, zones, parts = answers.zoning, space.zoning, space.parts
    own, p, now = memory.own, memory.parameters, view.clock[TICK]
    rules = zones.rules
    for column in range(RULES):
        rules[column] = p[FIRST_RULE + column] / MILLION
    copy_design(view.zoning.design, given.design)
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        identity = np.int64(view.robots.identity[i])
        if own[i, LOOK] == 0:
            begin(view, given, memory, zones, rules, k, i, p)
        replace_broken(view, given, i, p[RANGE])
        if not is_running(view, i):
            given.again[k] = p[LOOK_EVERY]
            continue
        busy = negotiate(view, given, memory, zones, parts, rules, k, i, p)
        queue_orders_of(view, given.design, zones, given, NEIGHBOURS, identity, p[NEAR])
        looks = now >= own[i, LOOK]
        averages = not busy and (now >= own[i, AVERAGE] or own[i, ROUND] != NIL)
        if looks or averages:
            degree = find_reach(view, zones.reach, i, p[RANGE])
            load = np.int64(0)
            if looks or own[i, ROUND] == NIL:  # further steps of a consensus need no load
                load = np.int64(NANO * own_load(view, rules, given.design, zones, parts, identity))
            if looks:
                look(view, memory, i, p, load)
            if averages:
                average(view, given, memory, k, i, p, degree, load)
        if p[SHARING] and own[i, IN] == 0 and now >= own[i, SHARE] and not busy:
            age, job = p[FIRST_RULE + RULES], p[FIRST_RULE + RULES + 1]
            share_near(view, given, space, memory, i, p, age, job)
        soon = min(own[i, LOOK], own[i, AVERAGE])
        given.again[k] = 1 if busy or own[i, ROUND] != NIL else max(1, soon - now)


class DecentralizedZones(Strategy):
    """Robots that talk within a range agree on zones that balance their queues."""

    layer = "zoning"
    Parameters = Decentralized
    compiled = decide
    counters = {"redesigns": REDESIGNS, "load_shares": SHARES, "messages": MESSAGES}  # noqa: RUF012

    def reset(self, view):
        """What each robot remembers; the parameters in ticks, cells and nano-minutes."""
        given = self.parameters
        allocation = getattr(self.colleagues.get("allocation"), "parameters", None)
        every = max(1, ticks(view, given.average_every))
        numbers = (
            int(cells(view, given.range)),
            round(NANO * given.tolerance),
            ticks(view, 60 * given.patience),
            ticks(view, 60 * given.hysteresis),
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
        weights = (
            round(1000 * getattr(allocation, "age", 0.5)),
            round(1000 * getattr(allocation, "job", 10.0)),
        )
        return memory_of(view, own=OWN, parameters=(*numbers, *rounded, *weights))
