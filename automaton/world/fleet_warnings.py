"""Warnings about robots that wait, jam or run out of charge: dead ends, crowds, rules, gates, stations,
pods.

Each warning is a sentence; `scenario_warnings` lists them all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np

from automaton.engine.state import GATE_CLOSING
from automaton.floor.floor_plan import CHARGER, STATION, STORAGE, FloorPlan
from automaton.floor.reachability import DeadEnds, Mask, dead_ends_of, reached, to_and_from
from automaton.scenario.changing_floor import Lift
from automaton.scenario.order_lines import carries_pods
from automaton.scenario.pods import PodStation
from automaton.strategy.lookup import ROUTED, STEERS, declares, default_for
from automaton.units import count
from automaton.world.capabilities import default_right_of_way, has_ringless_part, why_not_steered
from automaton.world.floor_parts import queue_path
from automaton.world.gate_cells import Gate, cells_of, gates_of, mouths_of, moves_between, shares
from automaton.world.resolved import Resolved

# Both from `automaton sweep crowds`, as shares of the cells for one robot each.
JAM_SHARE: Final = 0.06  # half of 12 %, at which retreat delivers 23 to 36 % of the orders of pibt
# From `automaton sweep goods-fleet`: shares of the cells outside storage, 3 % with retreat, 4 % with
# wait.
POD_JAM_SHARE: Final = 0.03
CROWD_SHARE: Final = 0.9  # at 98 % pibt and epibt deliver fewer orders than at 50 %, on all floors
FEW_ROBOTS: Final = 10
MOST_NAMED: Final = 3
MOST_GATES: Final = 100  # each examined separately
FULL_BATTERY: Final = 100 + 1e-9  # percent


def fleet_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence for each warning about the size of a fleet and its right of way."""
    ends = dead_ends_of(resolved.floor_plan)
    if resolved.scenario.fleet.robots < 2:
        return []
    sentences = (
        has_stations_in_dead_ends(resolved, ends),
        has_homes_behind_others(resolved, ends),
        is_crowded(resolved, ends),
        jams_under_retreat(resolved),
        has_no_ring(resolved),
    )
    return [sentence for sentence in sentences if sentence]


def size_warnings(resolved: Resolved) -> list[str]:
    """Warn about robots that are longer or wider than a cell; each type once."""
    scenario = resolved.scenario
    fleet, cell = scenario.fleet, scenario.units.cell
    side = None if cell is None else float(scenario.units.scale.cell_metres)
    sentences = []
    for kind in fleet.types or (None,):
        name = "robots" if kind is None else f"robots of the type {kind.name}"
        length = (kind and kind.length) or fleet.length
        width = (kind and kind.width) or fleet.width
        largest = max(length or 0.0, width or 0.0)
        if side is None or largest <= side:
            continue
        what = "long" if length is not None and length > side else "wide"
        size = length if what == "long" else width
        sentences.append(
            f"{name} are {size:g} m {what}, but a cell is {side:g} m: a robot takes one cell, so "
            "they drive and queue closer together than such robots can; set units.cell to "
            f"{largest:g} m or more"
        )
    return sentences


def has_stations_in_dead_ends(resolved: Resolved, ends: DeadEnds) -> str:
    """Warn about stations and chargers in dead ends."""
    kinds = resolved.floor_plan.kind.reshape(-1)
    inside = np.flatnonzero((ends.number >= 0) & ((kinds == STATION) | (kinds == CHARGER)))
    if not len(inside) or resolved.scenario.fleet.robots <= FEW_ROBOTS:
        return ""
    named = ", ".join(str(list(resolved.floor_plan.xy(int(c)))) for c in inside[:MOST_NAMED])
    more = f" and {len(inside) - MOST_NAMED} more" if len(inside) > MOST_NAMED else ""
    return (
        f"stations or chargers in dead ends ({named}{more}): they serve one robot at a time, "
        "which must come out before the next goes in; a second way out lets robots pass through"
    )


def has_homes_behind_others(resolved: Resolved, ends: DeadEnds) -> str:
    """Warn about homes in dead ends that another robot's home blocks.

    Random homes differ from seed to seed, and parking bays are off the floor.
    """
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    if not ends.total or scenario.stop.when != "parked" or scenario.fleet.when_idle == "leave":
        return ""
    if isinstance(resolved.start, str):
        return ""
    taken = set(resolved.start)
    walked: set[int] = set()
    blocking = []
    for home in sorted(cell for cell in taken if ends.number[cell] >= 0):
        cell = home
        while ends.number[cell] >= 0 and cell not in walked:
            walked.add(cell)
            cell += floor_plan.offsets[ends.way_out[cell]]
            if cell in taken and ends.number[cell] >= 0:
                blocking.append(cell)
                break
    if not blocking:
        return ""
    named = ", ".join(str(list(floor_plan.xy(cell))) for cell in blocking[:MOST_NAMED])
    return (
        f"homes of robots on the way into dead ends ({named}): robots whose homes lie deeper cannot get "
        "past one that is parked there; give each dead end one home at most"
    )


def is_crowded(resolved: Resolved, ends: DeadEnds) -> str:
    """Warn about more robots than the floor has room for."""
    floor_plan, robots = resolved.floor_plan, resolved.scenario.fleet.robots
    drivable = floor_plan.drivable.reshape(-1)
    if (floor_plan.capacity.reshape(-1)[drivable] != 1).any():
        return ""
    cells = int((drivable & (ends.number < 0)).sum())
    if robots <= CROWD_SHARE * cells or resolved.start == "parking-bays":
        return ""
    return (
        f"{count(robots, 'robot')} on {count(cells, 'cell')} for one robot each (dead ends aside) "
        "leave almost no room to move; half as many robots may finish more orders (study crowds)"
    )


def jams_under_retreat(resolved: Resolved) -> str:
    """Warn about a right of way that follows routes if many robots share cells for one robot."""
    floor_plan, robots = resolved.floor_plan, resolved.scenario.fleet.robots
    name = resolved.strategies["right_of_way"].name
    drivable = floor_plan.drivable & (floor_plan.kind != STORAGE)  # no way leads through storage
    share = POD_JAM_SHARE if carries_pods(resolved.scenario, resolved.floor_plan) else JAM_SHARE
    cells = int(drivable.sum())
    single = int((floor_plan.capacity[drivable] == 1).sum())
    if (
        declares("right_of_way", name, STEERS)
        or 2 * single < cells
        or robots <= max(FEW_ROBOTS, share * cells)
    ):
        return ""
    way_out = ""  # robots cannot be steered there
    if not why_not_steered(resolved.scenario, resolved.fleet):
        better = default_right_of_way(resolved.scenario, resolved.fleet).name
        way_out = f"; right_of_way {better} handles such fleets"
    return (
        f"right_of_way {name} jams with {count(robots, 'robot')} on {count(cells, 'cell')}, most of them "
        f"for one robot{way_out}"
    )


def has_no_ring(resolved: Resolved) -> str:
    """Warn about a right of way that deadlocks where robots cannot pass each other."""
    name = resolved.strategies["right_of_way"].name
    if not declares("right_of_way", name, STEERS) or not has_ringless_part(resolved.fleet):
        return ""
    routed = default_for("right_of_way", ROUTED)
    return (
        "the floor has no ring of cells, so two robots that meet cannot pass each other, and "
        f"right_of_way {name} deadlocks; choose {routed}, or connect the ends of the tracks"
    )


# Fleets that can never move, because a rule of the world refuses the first move.
#
# Robots that fill cells from which all ways lead into each other's cells form rings and files without
# a gap. A full ring rotates under `convoy`, and under `handover` if its moves take one tick. Under
# `none`, and under `handover` with longer moves, one robot would have to move first, and none can.


def standstill_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence if robots can never leave their start cells."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    rule, least = scenario.world.following, resolved.fleet.least_move
    refuses = rule == "none" or (rule == "handover" and least >= 2)
    if not refuses or scenario.fleet.when_idle == "leave":
        return []  # robots that leave the floor leave a gap
    from automaton.world.rules import may_fail  # needs Numba, unlike most checks

    if may_fail(scenario):
        return []  # so do towed robots
    held = full_cells(floor_plan, filled_at_the_start(resolved))
    cells = int(held.sum())
    if cells < 2:
        return []
    x, y = floor_plan.xy(int(np.flatnonzero(held)[0]))
    of_moves = "" if rule == "none" else f" of moves longer than one tick (here {least:g})"
    most = count(cells - 1, "robot")
    return [
        f"stands still: {count(cells, 'robot')} fill the {count(cells, 'cell')} around [{x}, {y}], and "
        f"under world.following: {rule} a full ring{of_moves} cannot start; at most {most} "
        "can move there at all, or set world.following: convoy"
    ]


def filled_at_the_start(resolved: Resolved) -> Mask:
    """(C,) bool: cells for one robot that are held at the start with every seed."""
    floor_plan, start = resolved.floor_plan, resolved.start
    drivable = floor_plan.drivable.reshape(-1)
    filled = np.zeros(drivable.size, np.bool_)
    if isinstance(start, tuple):
        filled[list(start)] = True
    elif start == "random" and resolved.scenario.fleet.robots >= drivable.sum():
        filled[drivable] = True
    single: Mask = filled & (floor_plan.capacity.reshape(-1) == 1)
    return single


def full_cells(floor_plan: FloorPlan, filled: Mask) -> Mask:
    """(C,) bool: the largest set of filled cells whose exits, at least one each, lead into the set."""
    exits = floor_plan.exits.reshape(-1)
    full: Mask = filled & (exits != 0)
    while True:
        leads_out = np.zeros(full.size, np.bool_)
        for direction, offset in enumerate(floor_plan.offsets):
            leads_out |= (exits >> direction & 1 != 0) & ~np.roll(full, -offset)
        if not (full & leads_out).any():
            return full
        full = full & ~leads_out


# Gates between robots and what they need.


def gate_warnings(resolved: Resolved) -> list[str]:
    """Return sentences about a lift that empties batteries, and gates on the only way to chargers."""
    return [*dear_rides(resolved), *gated_chargers(resolved)]


def dear_rides(resolved: Resolved) -> list[str]:
    """Return a sentence for the first lift that takes more charge than a battery holds."""
    for gate in gates_of(resolved.scenario.floor):
        if not isinstance(gate.section, Lift):
            continue
        shaft = cells_of(gate, resolved.floor_plan)
        ticks, how = longest_ride(gate.section, shaft, resolved.floor_plan)
        for one in resolved.fleet.types:
            if one.battery is None:
                continue
            drain, robots = (
                one.battery.drain,
                f"robots of type {one.name}" if one.name else "robots",
            )
            for factor, load in ((1.0, ""), (drain.loaded_factor, " with a load")):
                price = drain.move * factor * ticks
                if price > FULL_BATTERY:
                    taken = f"{gate.name} takes {price:,.6g} % of a battery {how}"
                    return [f"{taken}, more than it holds: {robots}{load} run out of charge there"]
    return []


def longest_ride(lift: Lift, shaft: list[int], floor_plan: FloorPlan) -> tuple[int, str]:
    """The most ticks of moves in a lift without a charger on the way, and a description of the way."""
    mouths = mouths_of(shaft, floor_plan)
    if any(floor_plan.kind.flat[cell] == CHARGER for cell in set(shaft) - set(mouths)):
        moves = moves_between(shaft, mouths)
        return max(shares(lift.travel_time, count)[1] for count in moves), "in one move"
    return lift.travel_time, "from one mouth to the next"


def gated_chargers(resolved: Resolved) -> list[str]:
    """Return a sentence for the first door, block or lift on the only way to a charger."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    gates = [gate for gate in gates_of(scenario.floor) if gate.kind != GATE_CLOSING]
    if scenario.battery is None or not gates or not (floor_plan.kind == CHARGER).any():
        return []
    everywhere = reach_chargers(resolved, ())
    chargers = set(np.flatnonzero(floor_plan.kind == CHARGER).tolist())
    gated = [cells_of(gate, floor_plan) for gate in gates]
    gated = [[] if set(cells) <= chargers else cells for cells in gated]  # a block at a charger
    inside = sorted({cell for cells in gated for cell in cells})
    if not is_cut_off(everywhere, reach_chargers(resolved, inside), inside):
        return []
    for gate, cells in list(zip(gates, gated, strict=True))[:MOST_GATES]:
        if is_cut_off(everywhere, reach_chargers(resolved, cells), cells):
            return [sentence_about(gate)]
    return [
        "all routes to a charger lead through doors, blocks or lifts: robots may run out of "
        "charge while they wait"
    ]


def sentence_about(gate: Gate) -> str:
    """The warning about one gate."""
    return (
        f"{gate.name} is on the only route to a charger: robots may run out of charge while they "
        "wait for it"
    )


def reach_chargers(resolved: Resolved, closed: Iterable[int]) -> Mask:
    """(k, C) bool: cells from which robots reach a charger without these cells, on rails or not."""
    floor_plan, cells = resolved.floor_plan, np.array(list(closed), np.int64)
    exits = floor_plan.exits.copy()
    exits.reshape(-1)[cells] = 0
    chargers = np.setdiff1d(np.flatnonzero(floor_plan.kind == CHARGER), cells)
    ways, plan = sorted({one.rail for one in resolved.fleet.types}), floor_plan.with_exits(exits)
    if not len(chargers):
        return np.zeros((len(ways), exits.size), np.bool_)
    return np.stack([reached(plan, chargers.tolist(), rail, backwards=True) for rail in ways])


def is_cut_off(before: Mask, after: Mask, inside: Iterable[int]) -> bool:
    """Whether a cell outside `inside` lost all ways to chargers."""
    lost = before & ~after
    lost[:, np.array(list(inside), np.int64)] = False
    return bool(lost.any())


# Stations and pods that keep robots waiting.


def pod_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence for each warning; none if orders are not lines."""
    if resolved.scenario.orders.lines is None:
        return []
    return [*too_many_trips(resolved), *crossed_queues(resolved), *robots_that_wait(resolved)]


def places_of(floor_plan: FloorPlan, station: PodStation) -> int | None:
    """The trip limit of a station; None: no limit."""
    if station.max_trips == "queue":
        return len(queue_path(floor_plan, station.at, station.queue)) + 1
    return station.max_trips


def too_many_trips(resolved: Resolved) -> Iterator[str]:
    """Warn about stations with a trip limit above the room in their queues."""
    for name, station in resolved.scenario.stations.items():
        room = len(queue_path(resolved.floor_plan, station.at, station.queue)) + 1
        most = places_of(resolved.floor_plan, station)
        if most is not None and most > room:
            yield (
                f"station {name} admits {most:,} trips (max_trips) but has room for "
                f"{count(room, 'robot')}, in its queue and itself: the others wait in the aisles"
            )


def crossed_queues(resolved: Resolved) -> Iterator[str]:
    """Warn about queues that robots with pods must cross on the way to another station."""
    floor_plan, fleet = resolved.floor_plan, resolved.fleet
    kinds = floor_plan.kind.reshape(-1)
    used: Mask = (kinds == STORAGE) & (floor_plan.loads.reshape(-1) != 0) | (kinds == CHARGER)
    used[floor_plan.stations] = True
    names = resolved.station_names
    for name, station in resolved.scenario.stations.items():
        own = [floor_plan.cell(*station.at)]
        own += queue_path(floor_plan, station.at, station.queue)
        others = [cell for cell in floor_plan.stations.tolist() if cell not in own]
        if len(own) == 1 or not others:
            continue
        around, lost = without(floor_plan, own), np.zeros_like(used)
        for rail in {one.rail for one in fleet.types}:
            before = to_and_from(floor_plan, others[0], rail)
            lost |= used & before & ~to_and_from(around, others[0], rail)
        lost[own] = False
        if lost.any():
            x, y = floor_plan.xy(int(np.argmax(lost)))
            other = names[floor_plan.stations.tolist().index(others[0])]
            yield (
                f"the queue of station {name} is on the only route between [{x}, {y}] and station "
                f"{other}: robots on their way there must wait in it"
            )


def without(floor_plan: FloorPlan, cells: list[int]) -> FloorPlan:
    """The floor without ways into some cells and out of them."""
    exits = floor_plan.exits.reshape(-1).copy()
    closed = np.zeros(exits.size, np.bool_)
    closed[cells] = True
    exits[closed] = 0
    for direction, offset in enumerate(floor_plan.offsets):
        exits[np.roll(closed, -offset)] &= np.uint8(15 ^ (1 << direction))
    return floor_plan.with_exits(exits.reshape(floor_plan.exits.shape))


def robots_that_wait(resolved: Resolved) -> Iterator[str]:
    """Warn about robots without work, or under pods that other robots cannot lift."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    named = [places_of(floor_plan, station) for station in scenario.stations.values()]
    places = [1] * (len(floor_plan.stations) - len(named)) + [one or 0 for one in named]
    robots = scenario.fleet.robots
    if None not in named and robots > sum(places):
        yield (
            f"{count(robots, 'robot')}, but stations admit {count(sum(places), 'trip')} at a "
            "time: the other robots stay idle"
        )
    stays = resolved.may_stay
    if stays and scenario.pods.under == "none" and robots > 1:
        yield (
            "idle robots stay under the pods that they stored (idle: stay), so no other robot can "
            "lift those pods (pods.under: none); set idle: park"
        )
