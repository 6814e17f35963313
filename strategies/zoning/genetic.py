"""Zone repair by a genetic algorithm: designs are bred from whole zones.

A child takes random disjoint zones of good designs. Each remaining station joins the zone of a random
adjacent station. Zones are matched one to one to robots that serve them; a child without a matching is
dropped. Then tips mutate. Fitness is 1 / SVp (here, a smaller SVp is better) of the flow, including
loads that pass a tip. A balance of 0 or undefined counts as 1.
"""

from __future__ import annotations

import numpy as np

from automaton.strategy.api import NIL, SCRATCH, Array, Roads, Struct, field, kernel
from strategies.linear_sum_assignment import INF_COST, linear_sum_assignment
from strategies.zoning.designs import connect, give, random_design
from strategies.zoning.loads_and_transfers import connected, find_loads, find_tips, find_transfers
from strategies.zoning.zone_workspace import (
    DRAWS_GENETIC,
    below,
    chance,
    clear_design,
    copy_design,
    may_take,
    preference,
    size,
)

MAX_FAILURES = 60  # misfit zones before a child is restarted
MAX_MUTATION_TRIES = 500  # tries to mutate a child
MAX_CHILD_TRIES = 100  # restarts of a child
MAX_JOIN_TRIES = 20  # tries per remaining station
MIN_ZONE_STATIONS = 2  # minimum stations of a zone
# Cost of a station in a zone whose robot has no priority there while another robot has.
MISPLACED = 1 << 30


class Individuals(Struct, role=SCRATCH):
    """N designs in rows; fields as in Design."""

    zone: Array = field("(N, S) int32")
    segments: Array = field("(N,) int64")
    owner: Array = field("(N, S) int32")
    ends: Array = field("(N, S, 2) int32")
    points: Array = field("(N, S) int32")
    path: Array = field("(N, S, P) int32")
    held: Array = field("(N, P) int32")
    value: Array = field("(N,) float64", "balance; smaller is better")
    tips: Array = field("(N,) int64", "number of tips; breaks ties of designs, more is better")


class ZonePopulation(Struct, role=SCRATCH):
    """The last row of `now` is the best design so far."""

    now: Individuals  # N + 1 rows
    next: Individuals  # N rows
    rank: Array = field("(N,) int32", "rows from the best to the worst")
    pool: Array = field("(N + 1,) int32", "rows from which zones are taken")


def population_for(roads: Roads, individuals: int = 60) -> ZonePopulation:
    """Scratch for a population on these roads."""
    points, stations = len(roads.cell), len(roads.point)
    return ZonePopulation.sized(
        {"N": individuals},
        now=individuals_of(individuals + 1, points, stations),
        next=individuals_of(individuals, points, stations),
    )


@kernel
def evolve(
    roads, rules, flow, generations, selected, mutation, population, design, workspace, reach,
    seed, tick,
):  # fmt: skip
    """The best design without isolated zones: the best of all generations, or one of the last.

    reach: (Z,) ones. Returns 0 if there is none; `design` is then invalid.
    """
    workspace.drawn = DRAWS_GENETIC
    rows = population.rank.shape[0]
    individuals = population.now
    for row in range(rows):
        if random_design(roads, rules, workspace.trial, workspace, seed, tick) == 0:
            return 0
        keep(workspace.trial, individuals, row)
    for generation in range(generations + 1):
        if generation > 0:
            breed(roads, rules, selected, mutation, population, workspace, seed, tick)
        judge(roads, rules, flow, population, design, workspace)
        best = np.int64(population.rank[0])
        if generation == 0 or better(individuals, best, rows):
            move_row(individuals, best, individuals, rows)
    for place in range(-1, rows):
        take(individuals, rows if place < 0 else np.int64(population.rank[place]), design)
        find_loads(roads, rules, flow, 0, design, workspace)
        find_transfers(roads, rules, design, workspace, reach)
        if connected(design, workspace) == 1:
            return 1
    return 0


@kernel
def better(individuals, a, b):
    """Whether row a is better than row b: balance, then more tips."""
    if individuals.value[a] != individuals.value[b]:
        return individuals.value[a] < individuals.value[b]
    return individuals.tips[a] > individuals.tips[b]


@kernel
def judge(roads, rules, flow, population, design, workspace):
    """value, tips and rank of all rows; ties: the lower row."""
    individuals = population.now
    for row in range(population.rank.shape[0]):
        take(individuals, row, design)
        value = find_loads(roads, rules, flow, 1, design, workspace)
        individuals.value[row] = value if value > 0.0 else 1.0
        individuals.tips[row] = 0
        for s in range(workspace.tip.shape[0]):
            individuals.tips[row] += workspace.tip[s]
        at = row
        while at > 0 and better(individuals, row, population.rank[at - 1]):
            population.rank[at] = population.rank[at - 1]
            at -= 1
        population.rank[at] = row


@kernel
def breed(roads, rules, selected, mutation, population, workspace, seed, tick):
    """The next generation, bred from the best rows and the best design so far."""
    rows = population.rank.shape[0]
    parents = min(selected, rows)
    for k in range(parents):
        population.pool[k] = population.rank[k]
    population.pool[parents] = rows
    for row in range(rows):
        made = np.int64(0)
        for _ in range(MAX_CHILD_TRIES):
            if made == 0:
                made = make_child(
                    roads, rules, mutation, population, parents + 1, workspace, seed, tick
                )
        if made == 0:
            take(population.now, rows, workspace.trial)
        keep(workspace.trial, population.next, row)
    for row in range(rows):
        move_row(population.next, row, population.now, row)


@kernel
def make_child(roads, rules, mutation, population, parents, workspace, seed, tick):
    """A child in workspace.trial; 0 if it failed."""
    if combine(population, parents, workspace, seed, tick) == 0:
        return 0
    if attach_rest(roads, rules, workspace.trial, workspace, seed, tick) == 0:
        return 0
    if may_give(workspace.trial) == 0:
        return 0
    if not are_alike(workspace) and match(workspace.trial, workspace) == 0:
        return 0
    tries = np.int64(0)
    while True:
        done = np.int64(0)
        while done == 0:
            if tries >= MAX_MUTATION_TRIES:
                return 0
            tries += 1
            done = mutate(roads, rules, workspace, seed, tick)
        copy_design(workspace.now, workspace.trial)
        if chance(workspace, seed, tick) >= mutation:
            return 1


@kernel
def may_give(design):
    """1 if a zone has more stations than the minimum."""
    for zone in range(design.transfer.shape[0]):
        if size(design, zone) > MIN_ZONE_STATIONS:
            return 1
    return 0


@kernel
def combine(population, parents, workspace, seed, tick):
    """Fill workspace.trial with random disjoint zones; 0 on failure."""
    design, individuals = workspace.trial, population.now
    zones = design.transfer.shape[0]
    clear_design(design)
    failures = np.int64(0)
    found = np.int64(0)
    while found < zones:
        row = np.int64(population.pool[below(workspace, parents, seed, tick)])
        zone = below(workspace, zones, seed, tick)
        if fits(individuals, row, zone, design) == 1:
            take_zone(individuals, row, zone, design, found)
            found += 1
        else:
            failures += 1
            if failures == MAX_FAILURES:
                return 0
    return 1


@kernel
def attach_rest(roads, rules, design, workspace, seed, tick):
    """Join each station without a zone to that of a random adjacent one; 0 on failure."""
    stations = design.zone.shape[0]
    for _ in range(MAX_JOIN_TRIES * stations):
        count = np.int64(0)
        for s in range(stations):
            if design.zone[s] == NIL:
                workspace.listed[count] = s
                count += 1
        if count == 0:
            return 1
        station = np.int64(workspace.listed[below(workspace, count, seed, tick)])
        near = adjacent_to(roads, rules, design, workspace, station, NIL)
        if near > 0:
            other = np.int64(workspace.listed[below(workspace, near, seed, tick)])
            connect(roads, design, workspace, station, other, rules.adjacent)
    return 0


@kernel
def adjacent_to(roads, rules, design, workspace, station, but):
    """workspace.listed: adjacent stations in zones other than `but`; return their number."""
    count = np.int64(0)
    for t in range(design.zone.shape[0]):
        zone = design.zone[t]
        if zone == NIL or zone == but or t == station:
            continue
        if roads.between[station, t] < rules.adjacent:
            workspace.listed[count] = t
            count += 1
    return count


@kernel
def mutate(roads, rules, workspace, seed, tick):
    """workspace.now: the child after a random tip has moved to another zone; 0 on failure."""
    design = workspace.trial
    zone = below(workspace, design.transfer.shape[0], seed, tick)
    find_tips(roads, design, workspace)
    count = np.int64(0)
    for s in range(design.zone.shape[0]):
        if design.zone[s] == zone and workspace.tip[s] == 1:
            workspace.listed[count] = s
            count += 1
    if count == 0:
        return 0
    tip = np.int64(workspace.listed[below(workspace, count, seed, tick)])
    near = adjacent_to(roads, rules, design, workspace, tip, zone)
    if near == 0:
        return 0
    through = np.int64(workspace.listed[below(workspace, near, seed, tick)])
    if not may_take(workspace, zone, design.zone[through], tip):
        return 0
    copy_design(design, workspace.now)
    return give(roads, workspace.now, workspace, tip, through, rules.adjacent, MIN_ZONE_STATIONS)


# Assignment of zones to robots: zone numbers are robot numbers.


@kernel
def are_alike(workspace):
    """Whether any robot may get any zone."""
    for z in range(workspace.serves.shape[0]):
        if workspace.move_time_factor[z] != workspace.move_time_factor[0]:
            return False
        for s in range(workspace.serves.shape[1]):
            if workspace.serves[z, s] == 0 or workspace.first[z, s] == 1:
                return False
    return True


@kernel
def match(design, workspace):
    """Match the zones one to one to robots that serve them; return 0 if there is no matching.

    The matching has the fewest stations without the robots that have priority there; ties go to
    larger zones for faster robots (linear sum assignment).
    """
    zones = workspace.serves.shape[0]
    cost = workspace.matching.cost
    for z in range(zones):
        for robot in range(zones):
            cost[z, robot] = cost_of(design, workspace, z, robot)
    linear_sum_assignment(cost, zones, zones, workspace.matching)
    workspace.frontier[:] = NIL
    for robot in range(zones):
        z = np.int64(workspace.matching.row_of[robot])
        if z == NIL:
            return 0
        workspace.frontier[z] = robot
    rename(design, workspace.frontier)
    return 1


@kernel
def cost_of(design, workspace, zone, robot):
    """The cost of a zone for a robot; INF_COST if the robot cannot serve all its stations."""
    cost = np.int64(0)
    for s in range(design.zone.shape[0]):
        if design.zone[s] != zone:
            continue
        if workspace.serves[robot, s] == 0:
            return np.int64(INF_COST)
        cost += np.int64(1000 * workspace.move_time_factor[robot])
        if preference(workspace, robot, s) < 0:
            cost += MISPLACED
    return cost


@kernel
def rename(design, name):
    """Renumber zone z to name[z]; the design must not have transfer stations yet."""
    for s in range(design.zone.shape[0]):
        if design.zone[s] != NIL:
            design.zone[s] = name[design.zone[s]]
    for m in range(design.segments):
        design.owner[m] = name[design.owner[m]]
    for p in range(design.held.shape[0]):
        if design.held[p] >= 0:
            design.held[p] = name[design.held[p]]


# Rows of populations.


@kernel
def keep(design, individuals, row):
    """Write a design to a row."""
    for s in range(design.zone.shape[0]):
        individuals.zone[row, s] = design.zone[s]
    for p in range(design.held.shape[0]):
        individuals.held[row, p] = design.held[p]
    individuals.segments[row] = design.segments
    for m in range(design.segments):
        individuals.owner[row, m] = design.owner[m]
        individuals.ends[row, m, 0] = design.ends[m, 0]
        individuals.ends[row, m, 1] = design.ends[m, 1]
        individuals.points[row, m] = design.points[m]
        for k in range(design.points[m]):
            individuals.path[row, m, k] = design.path[m, k]


@kernel
def take(individuals, row, design):
    """Read a design from a row."""
    design.transfer[:] = 0
    for s in range(design.zone.shape[0]):
        design.zone[s] = individuals.zone[row, s]
    for p in range(design.held.shape[0]):
        design.held[p] = individuals.held[row, p]
    design.segments = 0
    for m in range(individuals.segments[row]):
        take_segment(individuals, row, m, design, individuals.owner[row, m])


@kernel
def take_segment(individuals, row, m, design, owner):
    """Copy a segment of a row to the end of a design."""
    at = design.segments
    design.owner[at] = owner
    design.ends[at, 0] = individuals.ends[row, m, 0]
    design.ends[at, 1] = individuals.ends[row, m, 1]
    design.points[at] = individuals.points[row, m]
    for k in range(individuals.points[row, m]):
        design.path[at, k] = individuals.path[row, m, k]
    design.segments = at + 1


@kernel
def fits(individuals, row, zone, design):
    """1 if a zone of a row shares no station and no point with the design."""
    for s in range(design.zone.shape[0]):
        if individuals.zone[row, s] == zone and design.zone[s] >= 0:
            return 0
    for p in range(design.held.shape[0]):
        if individuals.held[row, p] == zone and design.held[p] >= 0:
            return 0
    return 1


@kernel
def take_zone(individuals, row, zone, design, owner):
    """Add a zone of a row to a design as its zone `owner`."""
    for s in range(design.zone.shape[0]):
        if individuals.zone[row, s] == zone:
            design.zone[s] = owner
    for p in range(design.held.shape[0]):
        if individuals.held[row, p] == zone:
            design.held[p] = owner
    for m in range(individuals.segments[row]):
        if individuals.owner[row, m] == zone:
            take_segment(individuals, row, m, design, owner)


@kernel
def move_row(source, row, individuals, to):
    """Copy a row with its value."""
    individuals.segments[to] = source.segments[row]
    individuals.value[to] = source.value[row]
    individuals.tips[to] = source.tips[row]
    for s in range(source.zone.shape[1]):
        individuals.zone[to, s] = source.zone[row, s]
    for p in range(source.held.shape[1]):
        individuals.held[to, p] = source.held[row, p]
    for m in range(source.segments[row]):
        individuals.owner[to, m] = source.owner[row, m]
        individuals.ends[to, m, 0] = source.ends[row, m, 0]
        individuals.ends[to, m, 1] = source.ends[row, m, 1]
        individuals.points[to, m] = source.points[row, m]
        for k in range(source.points[row, m]):
            individuals.path[to, m, k] = source.path[row, m, k]


def individuals_of(rows: int, points: int, stations: int) -> Individuals:
    """Scratch for a number of designs."""
    return Individuals.sized({"N": rows, "P": points, "S": stations})
