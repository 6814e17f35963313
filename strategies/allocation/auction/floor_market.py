"""The floor of a run as a market: the places where robots will be free, and all distances.

Places, in this order: for each robot the cell where it is free next; the chargers; for each task the
cells where it begins and ends. Paths are those on the empty floor. A path between two tasks starts in
the worst heading, and each of its ticks costs the maximum energy of driving and turning, so energy is
never underestimated.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from automaton.strategy.api import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_TURN,
    BATTERY_FULL,
    DERIVED,
    GOAL_CHARGE,
    GOAL_PICK,
    NIL,
    SCRATCH,
    STATUS_UP,
    Array,
    Struct,
    charging_ticks,
    distance,
    dropoff_cell,
    end_of_stops,
    field,
    first_cell,
    headings_of,
    kernel,
    pickup_cell,
    with_load,
    without_load,
)
from strategies.allocation.auction.market import (
    INF_COST,
    AuctionScratch,
    BatteryRules,
    FleetLists,
    TaskCosts,
    battery_of,
    deliveries,
    fleet_of,
    scratch_for,
)

CAPPED = 1 << 29  # ticks to an unreachable place; the sum of two fits an int32
CAPPED_ENERGY = 1 << 50  # units of charge to an unreachable place


class FloorMarket(Struct, role=SCRATCH):
    """A market over a world: R robots, T tasks, C chargers, K types; P = R + C + 2 T places."""

    costs: TaskCosts
    battery: BatteryRules
    fleet: FleetLists
    scratch: AuctionScratch
    robot: Array = field("(R,) int32", "storage index of each robot")
    cell: Array = field(
        "(K, P) int32", "cells of the places, which differ between robot types", role=DERIVED
    )
    order: Array = field("(T,) int32", "the order of each task")
    item: Array = field("(T,) int32", "tasks that are for sale")
    queues: int = field(
        "int64", "1: robots wait for robots that were sent to a charger before them"
    )
    # For each charger:
    sent: Array = field("(C,) int32", "all robots that were sent there")
    before: Array = field("(C,) int32", "those of them that will not leave for an order")
    ticks: Array = field("(C,) int64", "charging ticks of the latter")


def make_floor_market(
    view: Any, robots: int, tasks: int, longest: int, policy: dict[str, int], queues: bool = True
) -> FloorMarket:
    """Scratch for this number of robots and tasks; `policy`: policy, end_reach, threshold and target."""
    chargers = view.chargers.cell
    places = robots + len(chargers) + 2 * tasks
    types = len(view.grid.type_cell_flags)
    nothing, none = np.zeros((types, places, places), np.int32), np.zeros((types, tasks), np.int32)
    battery = battery_of(
        nothing,
        np.arange(robots, robots + len(chargers)),
        curve=view.rules.curve,
        reserve=view.rules.reserve,
        end_reach=bool(policy["end_reach"]),
        policy=policy["policy"],
        threshold=policy["threshold"],
        target=policy["target"],
    )
    cell = np.full((types, places), NIL, np.int32)
    cell[:, robots : robots + len(chargers)] = chargers
    begin = robots + len(chargers) + 2 * np.arange(tasks)
    return FloorMarket.sized(
        {"R": robots, "T": tasks, "C": len(chargers)},
        costs=deliveries(nothing, nothing, begin, begin + 1, none, none),
        battery=battery,
        fleet=fleet_of(np.arange(robots), tasks, longest=longest),
        scratch=scratch_for(robots, tasks, longest, len(chargers)),
        cell=cell,
        queues=int(queues),
    )


# Robots and tasks.


@kernel
def enter_robot(view, workspace, market, r, i):
    """Make robot i (storage index) number r of the site: set the place and tick where it is free next."""
    robots, fleet, rules = view.robots, market.fleet, view.rules
    robot_type = without_load(view, np.int64(robots.type[i]))
    carrying = with_load(view, robot_type)
    duration, drain = rules.duration[robot_type], rules.drain[robot_type]
    empty = rate_of_driving(view, robot_type, 0)
    loaded = rate_of_driving(view, robot_type, 1)
    place, ready = first_cell(robots, i), np.int64(robots.busy[i])
    charge = np.int64(robots.charge[i])
    order = np.int64(robots.order[i])
    if robots.goal_type[i] == GOAL_CHARGE and robots.charging_interruptible[i] == 0:
        place = np.int64(robots.goal_cell[i])
        drive = way_from(view, workspace, i, place)
        charge -= drive * empty
        charge_target = np.int64(robots.charge_target[i])
        ready += drive + charging_ticks(rules.curve[robot_type], charge, charge_target)
        if market.queues:
            ready += max(np.int64(0), charging_queue_ticks(view, i) - drive)
        charge = max(charge, np.int64(robots.charge_target[i]))
    elif robots.load[i] != NIL:
        order = np.int64(robots.load[i])
        place = dropoff_cell(view, robot_type, destination(view, order), first_cell(robots, i))
        if place == NIL:
            place = first_cell(robots, i)
        drive = way_from(view, workspace, i, place)
        if view.trips.pod.shape[0]:
            here = first_cell(robots, i)
            drive = way_with_load(view, workspace, carrying, order, here, place)
        ready += drive + duration[ACTION_DROP]
        charge -= drive * loaded + max(np.int64(duration[ACTION_DROP]), 1) * drain[ACTION_DROP, 1]
    elif order != NIL and robots.goal_type[i] == GOAL_PICK:
        slot, target = np.int64(view.orders.current_slot[order]), destination(view, order)
        drops = slot != target or view.trips.pod.shape[0] > 0
        begin = np.int64(robots.goal_cell[i])
        drive = way_from(view, workspace, i, begin)
        place = dropoff_cell(view, robot_type, target, begin) if drops else begin
        inside = way_with_load(view, workspace, carrying, order, begin, place) if drops else 0
        ready += drive + inside + duration[ACTION_PICK] + duration[ACTION_DROP]
        charge -= drive * empty + inside * loaded
        charge -= max(np.int64(duration[ACTION_PICK]), 1) * drain[ACTION_PICK, 0]
        charge -= max(np.int64(duration[ACTION_DROP]), 1) * drain[ACTION_DROP, 1]
    market.robot[r] = i
    fleet.robot_type[r] = robot_type
    market.cell[robot_type, r] = place
    fleet.ready[r] = min(ready, CAPPED)
    fleet.charge[r] = max(charge, -BATTERY_FULL)  # any value, since the path does not exist
    fleet.first[r] = 0
    fleet.length[r] = 0


@kernel
def enter_task(view, workspace, market, robot_type, task, order):
    """Define task `task` of the site: carry this order to its target, by robots of a type."""
    costs = market.costs
    duration, drain = view.rules.duration[robot_type], view.rules.drain[robot_type]
    slot, target = np.int64(view.orders.current_slot[order]), destination(view, order)
    drops = slot != target or view.trips.pod.shape[0] > 0  # a visit ends where it begins
    if view.service_zones.queue.shape[0] and dropoff_cell(view, robot_type, target, NIL) == NIL:
        target = np.int64(view.service_zones.next_slot[order])  # the robot hands it over there
    begin = pickup_cell(view, robot_type, slot, NIL)  # the robot's origin is still unknown
    end = begin
    if slot != target and target != NIL:
        end = dropoff_cell(view, robot_type, target, begin)
    market.order[task] = order
    market.cell[robot_type, costs.begin[task]] = begin
    market.cell[robot_type, costs.end[task]] = end
    if begin == NIL or end == NIL:
        costs.inside[robot_type, task] = CAPPED
        costs.use[robot_type, task] = CAPPED_ENERGY
        return
    carrying = with_load(view, robot_type)
    drive = way_with_load(view, workspace, carrying, order, begin, end) if drops else 0
    loaded = rate_of_driving(view, robot_type, 1)
    picking, dropping = np.int64(duration[ACTION_PICK]), np.int64(duration[ACTION_DROP])
    costs.inside[robot_type, task] = min(drive + picking + (dropping if drops else 0), CAPPED)
    energy = drive * loaded + max(picking, 1) * drain[ACTION_PICK, 0]
    if drops:
        energy += max(dropping, 1) * drain[ACTION_DROP, 1]
    costs.use[robot_type, task] = min(energy, CAPPED_ENERGY)


@kernel
def destination(view, order):
    """The target slot of an order; a pod returns to its current or first cell."""
    target = np.int64(view.orders.target[order])
    if view.trips.pod.shape[0] == 0:
        return target
    slot = np.int64(view.orders.current_slot[order])
    return np.int64(view.pods.home[view.trips.pod[order]]) if slot == NIL else slot


@kernel
def rate_of_driving(view, robot_type, loaded):
    """The maximum energy, in units, of a driving tick of a robot type."""
    rate = np.int64(view.rules.drain[robot_type, ACTION_MOVE, loaded])
    if headings_of(view.grid, robot_type) > 1:
        rate = max(rate, np.int64(view.rules.drain[robot_type, ACTION_TURN, loaded]))
    return rate


# Paths.


@kernel
def measure_distances(view, workspace, market, robot_type, robots, tasks):
    """Measure a type's paths between the places of the first robots, the chargers, and the first tasks.

    Places that robots of the type cannot reach are unreachable.
    """
    costs, battery = market.costs, market.battery
    chargers = view.chargers.cell.shape[0]
    first_task = market.fleet.place.shape[0] + chargers
    rate = rate_of_driving(view, robot_type, 0)
    places = first_task + 2 * tasks
    cell, ticks, energy = market.cell[robot_type], costs.ticks[robot_type], costs.energy[robot_type]
    for b in range(market.fleet.place.shape[0], places):  # one distance field after another
        end = np.int64(cell[b])
        # From a charger a robot must also reach its home.
        served = end != NIL and (b >= first_task or view.slots.reachable[robot_type, end] != 0)
        for a in range(places):
            if a < robots or a >= market.fleet.place.shape[0]:
                known = cell[a] != NIL and served
                way = longest_way(view, workspace, robot_type, cell[a], end) if known else CAPPED
                ticks[a, b] = way
                energy[a, b] = min(way * rate, CAPPED_ENERGY)
    for a in range(places):
        battery.nearest[robot_type, a] = NIL
        battery.reach[robot_type, a] = INF_COST
        if robots <= a < market.fleet.place.shape[0]:
            continue
        for c in range(chargers):
            units = np.int64(energy[a, battery.charger[c]])
            if units < battery.reach[robot_type, a] and units < CAPPED_ENERGY:
                battery.nearest[robot_type, a] = c
                battery.reach[robot_type, a] = units


@kernel
def way_from(view, workspace, i, end):
    """Ticks from the current pose of robot i."""
    robots = view.robots
    start, heading = first_cell(robots, i), np.int64(robots.heading[i])
    return min(distance(view, workspace, robots.type[i], start, heading, end), CAPPED)


@kernel
def way_with_load(view, workspace, robot_type, order, start, end):
    """Ticks of a robot type, with the load of an order, over the remaining stops to a cell."""
    ticks, here = np.int64(0), start
    if view.trips.pod.shape[0]:
        first = np.int64(view.orders.first_stop[order]) + np.int64(view.orders.stops_done[order])
        for stop in range(first, end_of_stops(view, order)):
            to = np.int64(view.stops.cell[stop])
            ticks += longest_way(view, workspace, robot_type, here, to) + view.stops.ticks[stop]
            here = to
    return min(ticks + longest_way(view, workspace, robot_type, here, end), CAPPED)


@kernel
def longest_way(view, workspace, robot_type, start, end):
    """Ticks of a robot type from one cell to another, from the worst initial heading."""
    most = 0
    for heading in range(view.grid.headings):
        most = max(most, distance(view, workspace, robot_type, start, heading, end))
    return min(most, CAPPED)


# Queues at chargers.


@kernel
def count_queues(view, market):
    """Count the robots already sent to each charger, and their charging ticks."""
    robots = view.robots
    market.sent[:] = 0
    market.before[:] = 0
    market.ticks[:] = 0
    for j in range(robots.cell.shape[0]):
        if robots.goal_type[j] != GOAL_CHARGE or robots.goal_cell[j] == NIL:
            continue
        charger = view.chargers.charger_at[robots.goal_cell[j]]
        market.sent[charger] += 1
        if robots.charging_interruptible[j] == 0 and robots.status[j] == STATUS_UP:
            count_before(market, charger, ticks_to_level(view, j))


@kernel
def count_before(market, charger, ticks):
    """Add a robot that will charge there for this number of ticks before robots that are sent now."""
    if market.queues:
        market.before[charger] += 1
        market.ticks[charger] += ticks


@kernel
def enter_waits(view, market):
    """Set the wait at each charger for robots that were sent there before."""
    for c in range(market.battery.wait.shape[0]):
        places = np.int64(view.chargers.places[c])
        market.battery.wait[c] = shared_wait(market.ticks[c], market.before[c], places)


@kernel
def shared_wait(ticks, robots, places):
    """The wait for this number of robots, which need these ticks in total and share places."""
    return np.int64(0) if robots < places else ticks // places


@kernel
def charging_queue_ticks(view, i):
    """The wait of robot i for robots that charge at its charger or queue ahead of it."""
    robots = view.robots
    charger = view.chargers.charger_at[robots.goal_cell[i]]
    ticks, before = np.int64(0), 0
    for j in range(robots.cell.shape[0]):
        if j == i or robots.goal_type[j] != GOAL_CHARGE:
            continue
        if robots.goal_cell[j] != robots.goal_cell[i]:
            continue
        there = robots.cell[j] == robots.goal_cell[j]
        earlier = robots.ticket[j] != 0 and (
            robots.ticket[i] == 0 or robots.ticket[j] < robots.ticket[i]
        )
        if robots.charging_interruptible[j] == 0 and (there or earlier):
            ticks += ticks_to_level(view, j)
            before += 1
    return shared_wait(ticks, before, np.int64(view.chargers.places[charger]))


@kernel
def ticks_to_level(view, j):
    """Ticks at a charger until robot j reaches its target charge."""
    robots = view.robots
    return charging_ticks(
        view.rules.curve[robots.type[j]],
        np.int64(robots.charge[j]),
        np.int64(robots.charge_target[j]),
    )
