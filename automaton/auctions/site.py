"""The floor of a run as a market: where robots will be free, and how far everything is from there.

Places, in this order: one for each robot, where it is free next; the chargers; for each task the cells
where it begins and ends. Ways are those of the empty floor. A way between two tasks begins in the
worst heading, so that energy is never counted too low; every tick of it is paid as the dearest of
driving and turning.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from automaton.auctions.market import INF, Battery, Fleet, Scratch, Work
from automaton.auctions.preparation import battery_of, deliveries, fleet_of, scratch_for
from automaton.compiled import kernel
from automaton.kernels.charging_curve import charging_ticks
from automaton.kernels.operations import first_cell
from automaton.kernels.search import distance
from automaton.kernels.stands import drop_stand, pick_stand
from automaton.struct import Struct
from automaton.world.condition import RUNNING
from automaton.world.state import DROP, GOAL_CHARGE, GOAL_PICK, MOVE, NIL, PICK, TURN

Array = NDArray[Any]

CAPPED = 1 << 29  # ticks or units of what cannot be reached: two of them still fit an int32


class Site(Struct):
    """A market over a world: R robots, T tasks, C chargers, K types; P = R + C + 2 T places."""

    work: Work
    battery: Battery
    fleet: Fleet
    scratch: Scratch
    robot: Array  # (R,) int32: storage index of each robot
    cell: Array  # (K, P) int32: places are served from other cells by other types of robots
    order: Array  # (T,) int32: the order of each task
    item: Array  # (T,) int32: tasks that are for sale
    queues: int  # 1: robots wait for those that were sent to a charger before


def site_for(
    view: Any, robots: int, tasks: int, longest: int, policy: dict[str, int], queues: bool = True
) -> Site:
    """Room for so many robots and tasks; `policy`: policy, end_reach, threshold and target."""
    chargers = view.chargers.cell
    places = robots + len(chargers) + 2 * tasks
    types = len(view.grid.ways)
    nothing, none = np.zeros((types, places, places), np.int32), np.zeros((types, tasks), np.int32)
    curve = tuple((int(since), int(rate)) for since, rate in view.rules.curve)
    battery = battery_of(
        nothing,
        np.arange(robots, robots + len(chargers)),
        curve=curve,
        reserve=int(view.rules.reserve),
        end_reach=bool(policy["end_reach"]),
        policy=policy["policy"],
        threshold=policy["threshold"],
        target=policy["target"],
    )
    cell = np.full((types, places), NIL, np.int32)
    cell[:, robots : robots + len(chargers)] = chargers
    begin = robots + len(chargers) + 2 * np.arange(tasks)
    return Site(
        work=deliveries(nothing, nothing, begin, begin + 1, none, none),
        battery=battery,
        fleet=fleet_of(np.arange(robots), tasks, longest=longest),
        scratch=scratch_for(robots, tasks, longest, len(chargers)),
        robot=np.zeros(robots, np.int32),
        cell=cell,
        order=np.zeros(tasks, np.int32),
        item=np.zeros(tasks, np.int32),
        queues=int(queues),
    )


@kernel
def longest_way(view, space, kind, start, end):
    """Ticks of robots of a type from one cell to another in the worst heading at the start."""
    most = 0
    for heading in range(view.grid.headings):
        most = max(most, distance(view, space, kind, start, heading, end))
    return min(most, CAPPED)


@kernel
def way_from(view, space, i, end):
    """Ticks from where robot i is, as it stands there."""
    robots = view.robots
    start, heading = first_cell(robots, i), np.int64(robots.heading[i])
    return min(distance(view, space, robots.type[i], start, heading, end), CAPPED)


@kernel
def rate_of_driving(rules, headings, loaded):
    """Units that a tick on the way takes at most."""
    rate = np.int64(rules.drain[MOVE, loaded])
    if headings > 1:
        rate = max(rate, np.int64(rules.drain[TURN, loaded]))
    return rate


@kernel
def enter_task(view, space, site, kind, task, order):
    """Task number `task` of the site is to carry this order to its target, by robots of a type."""
    work, duration, drain = site.work, view.rules.duration[kind], view.rules.drain
    slot, target = np.int64(view.orders.place[order]), np.int64(view.orders.target[order])
    if view.zoning.queue.shape[0] and drop_stand(view, kind, target) == NIL:
        target = np.int64(view.zoning.stop[order])  # the robot hands it over there
    begin = pick_stand(view, kind, slot)
    end = begin if slot == target or target == NIL else drop_stand(view, kind, target)
    site.order[task] = order
    site.cell[kind, work.begin[task]] = begin
    site.cell[kind, work.end[task]] = end
    if begin == NIL or end == NIL:
        work.inside[kind, task] = CAPPED
        work.use[kind, task] = CAPPED
        return
    drive = longest_way(view, space, kind, begin, end) if slot != target else 0
    loaded = rate_of_driving(view.rules, view.grid.headings, 1)
    picking, dropping = np.int64(duration[PICK]), np.int64(duration[DROP])
    work.inside[kind, task] = min(drive + picking + (dropping if slot != target else 0), CAPPED)
    energy = drive * loaded + max(picking, 1) * drain[PICK, 0]
    if slot != target:
        energy += max(dropping, 1) * drain[DROP, 1]
    work.use[kind, task] = min(energy, CAPPED)


@kernel
def enter_robot(view, space, site, r, i):
    """Robot i, stored at that index, is number r of the site: where it is free next, and then."""
    robots, fleet, rules = view.robots, site.fleet, view.rules
    kind = np.int64(robots.type[i])
    duration = rules.duration[kind]
    empty = rate_of_driving(rules, view.grid.headings, 0)
    loaded = rate_of_driving(rules, view.grid.headings, 1)
    place, ready = first_cell(robots, i), np.int64(robots.busy[i])
    charge = np.int64(robots.charge[i])
    order = np.int64(robots.order[i])
    if robots.goal[i] == GOAL_CHARGE and robots.yields[i] == 0:
        place = np.int64(robots.stand[i])
        drive = way_from(view, space, i, place)
        charge -= drive * empty
        ready += drive + charging_ticks(rules.curve, charge, np.int64(robots.level[i]))
        if site.queues:
            ready += max(np.int64(0), line_ahead(view, i) - drive)
        charge = max(charge, np.int64(robots.level[i]))
    elif robots.load[i] != NIL:
        place = drop_stand(view, kind, np.int64(view.orders.target[robots.load[i]]))
        if place == NIL:
            place = first_cell(robots, i)
        drive = way_from(view, space, i, place)
        ready += drive + duration[DROP]
        charge -= drive * loaded + max(np.int64(duration[DROP]), 1) * rules.drain[DROP, 1]
    elif order != NIL and robots.goal[i] == GOAL_PICK:
        slot, target = np.int64(view.orders.place[order]), np.int64(view.orders.target[order])
        begin = np.int64(robots.stand[i])
        drive = way_from(view, space, i, begin)
        place = begin if slot == target else drop_stand(view, kind, target)
        inside = longest_way(view, space, kind, begin, place) if slot != target else 0
        ready += drive + inside + duration[PICK] + duration[DROP]
        charge -= drive * empty + inside * loaded
        charge -= max(np.int64(duration[PICK]), 1) * rules.drain[PICK, 0]
        charge -= max(np.int64(duration[DROP]), 1) * rules.drain[DROP, 1]
    site.robot[r] = i
    fleet.kind[r] = kind
    site.cell[kind, r] = place
    fleet.ready[r] = min(ready, CAPPED)
    fleet.charge[r] = charge
    fleet.first[r] = 0
    fleet.length[r] = 0


@kernel
def ticks_to_level(view, j):
    """Ticks at a charger until robot j has the charge that it was sent there for."""
    robots = view.robots
    return charging_ticks(view.rules.curve, np.int64(robots.charge[j]), np.int64(robots.level[j]))


@kernel
def line_ahead(view, i):
    """Ticks of charging of those that charge at the charger of robot i, or stand in line before it."""
    robots = view.robots
    ticks = np.int64(0)
    for j in range(robots.cell.shape[0]):
        if j == i or robots.goal[j] != GOAL_CHARGE or robots.stand[j] != robots.stand[i]:
            continue
        there = robots.cell[j] == robots.stand[j]
        before = robots.ticket[j] != 0 and (
            robots.ticket[i] == 0 or robots.ticket[j] < robots.ticket[i]
        )
        if robots.yields[j] == 0 and (there or before):
            ticks += ticks_to_level(view, j)
    return ticks


@kernel
def survey(view, space, site, kind, robots, tasks):
    """Measure a type's ways between the first so many robots' places, the chargers, and so many tasks'.

    Places that robots of the type do not get to are out of reach.
    """
    work, battery = site.work, site.battery
    chargers = view.chargers.cell.shape[0]
    first_task = site.fleet.place.shape[0] + chargers
    rate = rate_of_driving(view.rules, view.grid.headings, 0)
    places = first_task + 2 * tasks
    cell, ticks, energy = site.cell[kind], work.ticks[kind], work.energy[kind]
    for b in range(site.fleet.place.shape[0], places):  # one distance field after another
        end = np.int64(cell[b])
        for a in range(places):
            if a < robots or a >= site.fleet.place.shape[0]:
                known = cell[a] != NIL and end != NIL
                way = longest_way(view, space, kind, cell[a], end) if known else CAPPED
                ticks[a, b] = way
                energy[a, b] = min(way * rate, CAPPED)
    for a in range(places):
        battery.nearest[kind, a] = NIL
        battery.reach[kind, a] = INF
        if robots <= a < site.fleet.place.shape[0]:
            continue
        for c in range(chargers):
            units = np.int64(energy[a, battery.charger[c]])
            if units < battery.reach[kind, a] and units < CAPPED:
                battery.nearest[kind, a] = c
                battery.reach[kind, a] = units


@kernel
def count_queues(view, site, besides):
    """How long a robot waits at each charger for those that were sent there before, but for one."""
    wait, robots = site.battery.wait, view.robots
    for c in range(wait.shape[0]):
        wait[c] = 0
    if site.queues == 0:
        return
    for j in range(robots.cell.shape[0]):
        if j == besides or robots.goal[j] != GOAL_CHARGE or robots.status[j] != RUNNING:
            continue
        stand = np.int64(robots.stand[j])
        if stand != NIL and robots.yields[j] == 0:
            wait[view.chargers.at[stand]] += ticks_to_level(view, j)
