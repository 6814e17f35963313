"""Zone repair by simulated annealing (Ho & Liao, modified): phases 1, 2 and 3.

Phase 2 moves random tips from busier to idler zones, accepts worse designs with probability
exp(-worsening / T), and keeps the best design. Since SVp is within [0, 1] and T from 4.5 to 0.35,
it accepts most moves: it is a random walk that keeps the best design.
"""

import numpy as np

from automaton.strategy.api import NIL, kernel
from strategies.zoning.designs import first_design, give, random_design
from strategies.zoning.loads_and_transfers import (
    UNDEFINED,
    connect_cut_off,
    connected,
    find_loads,
    find_tips,
    find_transfers,
)
from strategies.zoning.zone_workspace import (
    DRAWS_ANNEALING,
    below,
    block_others,
    chance,
    copy_design,
    may_take,
    spread,
    whole_cells,
)

MAX_REPAIRS = 3  # attempts to make a design without an isolated zone
MIN_ZONE_STATIONS = 2  # minimum stations of a zone
MAX_TRIES_PER_MOVE = 6  # limit of tries, as a multiple of the moves
FIRST_TRIES = 20  # repairs to find the first zones of a run
LN2 = 0.6931471805599453
EXP_UNDERFLOW = -700.0  # exp of smaller values is 0


@kernel
def first_zones(roads, rules, hot, cold, steps, begin, design, workspace, reach, seed, tick):
    """First zones without a measured flow: assume one load between any two stations; 0 if none are found.

    Each try has its own draws. Returns the number of the successful try, from 1. The first `begin` tries
    are skipped. reach: (Z,) ones. `design` is invalid after a failure.
    """
    legs = workspace.legs
    for a in range(legs.shape[0]):
        for b in range(legs.shape[0]):
            legs[a, b] = 0.0 if a == b else 1.0
    for again in range(begin, FIRST_TRIES):
        found = repair(
            roads, rules, legs, hot, cold, steps, MAX_REPAIRS, design, workspace, reach, seed,
            tick + (again << 32),
        )  # fmt: skip
        if found == 1:
            return again + 1
    return 0


@kernel
def repair(roads, rules, flow, hot, cold, steps, repairs, design, workspace, reach, seed, tick):
    """A new design by phases 1 to 3 from one flow, repeated until no zone is isolated.

    The last attempt joins isolated zones at any distance. reach: (Z,) ones. Returns 0 if this fails,
    too; `design` is then invalid.
    """
    workspace.drawn = DRAWS_ANNEALING
    for _ in range(repairs):
        found = first_design(roads, flow, design, workspace)
        if found == 0:
            found = random_design(roads, rules, design, workspace, seed, tick)
        if found == 0:
            return 0
        improve(roads, rules, flow, hot, cold, steps, design, workspace, seed, tick)
        find_loads(roads, rules, flow, 0, design, workspace)
        find_transfers(roads, rules, design, workspace, reach)
        if connected(design, workspace) == 1:
            return 1
    return connect_cut_off(roads, design, workspace)


@kernel
def improve(roads, rules, flow, hot, cold, steps, design, workspace, seed, tick):
    """Phase 2: leave the best design found in `design`; return its balance.

    Ends after `steps` (M of eq. 6) accepted or infeasible moves, after six times as many tries, or
    if no zone has a tip for an idler zone.
    """
    copy_design(design, workspace.now)
    value = judged(find_loads(roads, rules, flow, 0, workspace.now, workspace))
    best = value
    forget_tips(roads, workspace.now, workspace)
    moves, tries = np.int64(0), np.int64(0)
    while moves < steps and tries < MAX_TRIES_PER_MOVE * steps:
        tries += 1
        pair = busier_pair(roads, rules, workspace.now, workspace, seed, tick)
        if pair == NIL:
            break
        a, b = np.int64(workspace.zones[pair, 0]), np.int64(workspace.zones[pair, 1])
        if give_random_tip(roads, rules, workspace.now, workspace, a, b, seed, tick) == 0:
            moves += 1
            continue
        tried = judged(find_loads(roads, rules, flow, 0, workspace.trial, workspace))
        heat = temperature(hot, cold, steps, moves)
        if tried > value and chance(workspace, seed, tick) > exponential((value - tried) / heat):
            find_loads(roads, rules, flow, 0, workspace.now, workspace)
            continue
        moves += 1
        value = tried
        copy_design(workspace.trial, workspace.now)
        forget_tips(roads, workspace.now, workspace)
        if value < best:
            best = value
            copy_design(workspace.now, design)
    return best


@kernel
def judged(value):
    """The balance; zones without any load get the worst value."""
    return 1.0 if value == UNDEFINED else value


@kernel
def forget_tips(roads, design, workspace):
    """Update the tips after a change of the design, and clear the table of near tips."""
    workspace.fresh[:] = 0
    find_tips(roads, design, workspace)


@kernel
def busier_pair(roads, rules, design, workspace, seed, tick):
    """A random row of workspace.zones: a busier zone with a tip to give, and an idler zone; or NIL."""
    zones = design.transfer.shape[0]
    count = np.int64(0)
    for a in range(zones):
        for b in range(zones):
            if workspace.load[a] > workspace.load[b]:
                workspace.zones[count, 0] = a
                workspace.zones[count, 1] = b
                count += 1
    while count > 0:
        k = below(workspace, count, seed, tick)
        a, b = np.int64(workspace.zones[k, 0]), np.int64(workspace.zones[k, 1])
        if facing_tips(roads, rules, design, workspace, a, b) > 0:
            return k
        count -= 1
        workspace.zones[k, 0] = workspace.zones[count, 0]
        workspace.zones[k, 1] = workspace.zones[count, 1]
    return NIL


@kernel
def facing_tips(roads, rules, design, workspace, a, b):
    """workspace.via_station[a, b]: for each tip that a may give to b, the last tip of b in reach.

    Returns the number of these tips of a. In reach: the union path is shorter than the distance of
    adjacent stations. Needs workspace.tip.
    """
    stations = design.zone.shape[0]
    if workspace.fresh[a, b] == 0:
        workspace.fresh[a, b] = 1
        block_others(design, workspace, a, b)
        for s in range(stations):
            workspace.via_station[a, b, s] = NIL
            if design.zone[s] != a or workspace.tip[s] == 0 or not may_take(workspace, a, b, s):
                continue
            spread(roads, workspace, roads.point[s], NIL, whole_cells(rules.adjacent))
            for t in range(stations):
                near = workspace.distance[roads.point[t]] < rules.adjacent
                if near and design.zone[t] == b and workspace.tip[t] == 1:
                    workspace.via_station[a, b, s] = t
    count = np.int64(0)
    for s in range(stations):
        if workspace.via_station[a, b, s] != NIL:
            count += 1
    return count


@kernel
def give_random_tip(roads, rules, design, workspace, a, b, seed, tick):
    """workspace.trial: the design after a random tip moves from a to b; return 0 if this is impossible.

    The tip is one that `facing_tips` found. It is joined to the last tip of b in reach, or with
    rules.all_pairs to the first possible one of all tips in reach, in random order.
    """
    tip = random_tip(workspace, a, b, seed, tick)
    if not rules.all_pairs:
        through = np.int64(workspace.via_station[a, b, tip])
        return give_through(roads, rules, design, workspace, tip, through)
    count = list_partners(roads, rules, design, workspace, tip, a, b)
    while count > 0:
        k = below(workspace, count, seed, tick)
        if give_through(roads, rules, design, workspace, tip, np.int64(workspace.listed[k])) == 1:
            return 1
        count -= 1
        workspace.listed[k] = workspace.listed[count]
    return 0


@kernel
def give_through(roads, rules, design, workspace, tip, through):
    """workspace.trial: the design after a tip joins the zone of `through`; or return 0."""
    copy_design(design, workspace.trial)
    return give(roads, workspace.trial, workspace, tip, through, rules.adjacent, MIN_ZONE_STATIONS)


@kernel
def list_partners(roads, rules, design, workspace, tip, a, b):
    """workspace.listed: the tips of b in reach of a tip of a; return their number."""
    block_others(design, workspace, a, b)
    spread(roads, workspace, roads.point[tip], NIL, whole_cells(rules.adjacent))
    count = np.int64(0)
    for t in range(design.zone.shape[0]):
        near = workspace.distance[roads.point[t]] < rules.adjacent
        if near and design.zone[t] == b and workspace.tip[t] == 1:
            workspace.listed[count] = t
            count += 1
    return count


@kernel
def random_tip(workspace, a, b, seed, tick):
    """A random tip of those that `facing_tips` found."""
    count = np.int64(0)
    for s in range(workspace.tip.shape[0]):
        if workspace.via_station[a, b, s] != NIL:
            workspace.listed[count] = s
            count += 1
    return np.int64(workspace.listed[below(workspace, count, seed, tick)])


# Eq. 6, with exp and ln in basic arithmetic only, so that every machine gets the same bits.


@kernel
def temperature(hot, cold, steps, done):
    """Eq. 6: hot (cold / hot) ^ (done / steps)."""
    ratio = logarithm(cold / hot) * done / steps
    if ratio > 0.0:
        return hot / exponential(-ratio)
    return hot * exponential(ratio)


@kernel
def exponential(x):
    """e to the power of x, for x <= 0; relative error below 1e-14."""
    if x < EXP_UNDERFLOW:
        return 0.0
    halvings = int(-x / LN2 + 0.5)
    rest = x + halvings * LN2
    term = 1.0
    total = 1.0
    for k in range(1, 15):
        term = term * rest / k
        total += term
    for _ in range(halvings):
        total *= 0.5
    return total


@kernel
def logarithm(x):
    """The natural logarithm of x > 0."""
    doublings = 0
    while x < 0.75:
        x *= 2.0
        doublings -= 1
    while x > 1.5:
        x *= 0.5
        doublings += 1
    ratio = (x - 1.0) / (x + 1.0)
    square = ratio * ratio
    total = 0.0
    for k in range(20, -1, -1):
        total = total * square + 1.0 / (2 * k + 1)
    return 2.0 * ratio * total + doublings * LN2
