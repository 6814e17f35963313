"""Bounds on the performance of a fleet under any strategies, computed without a run.

work       each order needs a pick, the cheapest drive with its turns, and a drop: N robots need
           work / N ticks. A load may be dropped on the way and picked up from another side (a bucket
           brigade): that is a way through a slot, at the cost of handling
stations   a station holds one robot: picks and drops at stations are shared evenly among them
parts      a station works on one part at a time: all its jobs count, except those at the end of a
           route, since a run may end with the last delivery. One part goes through its whole route:
           its jobs except the last, and the drives between them
chargers   chargers or repairs supply the energy that orders need beyond the charge at the start

The bounds hold for every seed: random orders count as the cheapest possible ones, a random number of
orders as one, random processing times as one tick, and parts with random arrivals as if all came with
the first. Every robot does each operation as fast as the fastest type and reaches every cell; with a
load it drives as robots with a load do. Loads are assumed to move only with robots: no load passes from
one side to the other when its robot breaks down.
"""

from __future__ import annotations

import heapq
import itertools
import math
from functools import lru_cache
from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.engine.state import NIL, Array
from automaton.floor.floor_plan import STATION, STORAGE, FloorPlan, may_turn
from automaton.floor.reachability import (
    NO_WAY,
    Driving,
    backward_exits,
    slot_access,
    ticks_between,
)
from automaton.scenario.durations import Distribution, Handling
from automaton.scenario.order_lines import line_column, listed_lines, pod_cells, transports_of
from automaton.scenario.orders import DRAWN_GENERATORS, ENDS, Orders, Parts
from automaton.scenario.robot_types import RobotType
from automaton.scenario.schema import Battery, ChargeRange, Scenario
from automaton.units import count, percent, ticks_and_time
from automaton.world.capabilities import loaded_driving
from automaton.world.floor_parts import handling_rules, places_of_chargers
from automaton.world.resolved import Resolved

MOST_TARGETS: Final = 200  # listed targets with separate searches; beyond: the nearest of all
LEAST_DRAWN: Final = 1  # ticks of work
EMPTY_WAYS: Final = 16  # pods from which the ways to all others are measured
LOADLESS: Final = ("visits", "tours")  # generators of orders without a load

Ticks = npt.NDArray[np.int64]


class Bounds(NamedTuple):
    """Lower bounds on the effort of all orders of a scenario."""

    orders: int
    work: float  # robot ticks of all orders
    least_order: float  # robot ticks of the shortest
    longest_order: float  # robot ticks of the longest
    station_ticks: float  # of each station with picks and drops, if they share them evenly
    busiest: float  # ticks of work on parts at the station with the most work
    longest_part: float  # ticks of the part with the longest time
    energy: float  # percent of a battery, all orders
    held: float  # percent in each battery at the start
    given: float  # percent per tick from all chargers
    mended: float  # percent per robot and tick, if it is towed and comes back full


class Price(NamedTuple):
    """The cost of operations with a load, in ticks or in energy."""

    move: float
    turn: float
    handling: float  # a pick and a drop


def bounds(resolved: Resolved) -> Bounds:
    """The bounds of a scenario; they do not depend on the number of robots."""
    scenario = resolved.scenario
    fleet, battery = resolved.fleet, scenario.battery
    turn = fleet.least_loaded_turn
    handling = fleet.least_pick + fleet.least_drop
    drives, picks, drops = min_drive_cost(resolved, Price(fleet.least_loaded_move, turn, handling))
    ticks = handling + drives
    if scenario.orders.generator in LOADLESS or _visits(resolved):
        ticks = np.zeros(len(drives))  # a visit may need no operation
    stations = int(np.count_nonzero(resolved.floor_plan.kind == STATION))
    busy = picks * fleet.least_pick + drops * fleet.least_drop
    parts = part_bounds(scenario.orders, ticks)
    energy = 0.0
    if battery is not None:
        turns = 0.0 if turn == 0 else min(drained(one, "turn") for one in fleet.types)
        price = Price(min(drained(one, "move") for one in fleet.types), turns, 0.0)
        energy = float(min_drive_cost(resolved, price)[0].sum())
    return Bounds(
        orders=len(drives),
        work=float(ticks.sum()),
        least_order=float(ticks.min(initial=math.inf)),
        longest_order=float(ticks.max(initial=0)),
        station_ticks=busy / stations if stations else 0.0,
        busiest=parts.busiest,
        longest_part=parts.longest,
        energy=energy,
        held=max(_held(one.battery) for one in fleet.types),
        given=_given(resolved),
        mended=_mended(resolved),
    )


def least_ticks(found: Bounds, robots: int) -> tuple[float, str]:
    """A lower bound on the ticks in which this number of robots does all orders, and the reason."""
    lacking = found.energy - robots * found.held
    income = found.given + robots * found.mended
    charging = (lacking / income if income else math.inf) if lacking > 0 else 0.0
    return max(
        (found.work / robots, f"work of {found.work:,.0f} robot ticks shared by {robots}"),
        (found.longest_order, "the longest order alone"),
        (found.station_ticks, "stations hold one robot each"),
        (found.busiest, "the busiest station works on one part at a time"),
        (found.longest_part, "one part on its whole route"),
        (charging, "chargers give no more energy"),
    )


def most_throughput(found: Bounds, robots: int, ticks: float = math.inf) -> tuple[float, str]:
    """An upper bound on the throughput of robots, in orders per 1000 ticks, and the reason.

    `ticks`: length of an interval of a run; the first order that a robot delivers in it may have begun
    before.
    """
    if not 0 < found.least_order < math.inf:
        return math.inf, ""
    return (
        1000 * robots * (1 / found.least_order + 1 / ticks),
        f"the shortest order takes a robot {found.least_order:,.0f} ticks",
    )


def min_drive_cost(resolved: Resolved, price: Price) -> tuple[Array, int, int]:
    """(m,) the cost of driving each order with its load; picks at stations, and drops there."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    orders, kinds = scenario.orders, floor_plan.kind.reshape(-1)
    if orders.listed is not None:
        pairs = [
            (floor_plan.cell(*line.ends[0]), floor_plan.cell(*line.ends[1]))
            for _, line in transports_of(scenario, floor_plan)
        ]
        if len(pairs) < len(orders.listed):  # legs between stops count as 0
            return np.zeros(len(orders.listed)), 0, 0
        picks, drops = (sum(kinds[pair[end]] == STATION for pair in pairs) for end in (0, 1))
        return _listed_drives(resolved, pairs, price), int(picks), int(drops)
    if orders.parts is not None:
        cells = floor_plan.stations.tolist()
        pairs = [(cells[here - 1], cells[then - 1]) for here, then in ways(orders)]
        return _listed_drives(resolved, pairs, price), len(pairs), len(pairs)
    if orders.tasks is not None:
        return np.zeros(len(orders.tasks)), 0, 0
    if orders.generator not in ENDS or orders.generator in LOADLESS:
        return np.zeros(orders.least_count), 0, 0
    begin, end = ENDS[orders.generator]
    slots = floor_plan.slots
    source, target = slots[kinds[slots] == begin], slots[kinds[slots] == end]
    if orders.generator == "picture-loads":
        source = source[floor_plan.loads.reshape(-1)[source] == 1]
    if orders.generator in DRAWN_GENERATORS:
        count = orders.least_count
        if begin == end:  # from a station to another one
            return np.full(count, float(price.move)), count, count
        return np.full(count, cheapest(resolved, source, target, price).min()), 0, 0
    return cheapest(resolved, source, target, price), 0, 0


def _listed_drives(resolved: Resolved, pairs: list[tuple[int, int]], price: Price) -> Array:
    targets = sorted({target for _, target in pairs})
    if len(targets) > MOST_TARGETS:
        return cheapest(resolved, np.array([a for a, _ in pairs]), np.array(targets), price)
    drive: dict[tuple[int, int], float] = {}
    for cell in targets:
        sources = sorted({source for source, target in pairs if target == cell})
        found = cheapest(resolved, np.array(sources), np.array([cell]), price)
        drive |= {(source, cell): one for source, one in zip(sources, found.tolist(), strict=True)}
    return np.array([drive[pair] for pair in pairs])


def cheapest(resolved: Resolved, source: Array, target: Array, price: Price) -> Array:
    """(m,) the cost of the drive from each slot to the cheapest of the targets; 0 without a way."""
    floor_plan = resolved.floor_plan
    index = {cell: row for row, cell in enumerate(floor_plan.slots.tolist())}
    access = slot_access(floor_plan).tolist()
    goals = {cell for slot in target.tolist() for cell in access[index[slot]] if cell != NIL}
    cost = _costs(resolved, goals, access, price)
    found = [
        min((cost[axis][c] for c in access[index[slot]] if c != NIL for axis in (0, 1)), default=0)
        for slot in source.tolist()
    ]
    return np.array([one if math.isfinite(one) else 0.0 for one in found])


def _costs(
    resolved: Resolved, goals: set[int], access: list[list[int]], price: Price
) -> list[list[float]]:
    """By axis of travel and flat cell: the cost of the way to the cheapest goal (Dijkstra)."""
    floor_plan = resolved.floor_plan
    back, offsets = backward_exits(floor_plan).tolist(), floor_plan.offsets
    kind = floor_plan.kind.reshape(-1)
    turns = may_turn(kind, resolved.fleet.rail).tolist()
    beside: dict[int, list[int]] = {}  # cell: slots that are served from it
    for slot, cells in enumerate(access):
        for cell in cells:
            beside.setdefault(cell, []).append(slot)
    limits = floor_plan.min_move_ticks.tolist() if len(floor_plan.min_move_ticks) else None
    least = resolved.fleet.least_loaded_move
    cost = [[math.inf] * kind.size for _ in (0, 1)]
    front = [(0.0, cell, axis) for cell in goals for axis in (0, 1)]
    through: set[int] = set()
    while front:
        so_far, cell, axis = heapq.heappop(front)
        if so_far >= cost[axis][cell]:
            continue
        cost[axis][cell] = so_far
        for direction in (axis, axis + 2):
            if back[cell] >> direction & 1:
                before = cell + offsets[direction]
                slower = 0.0 if limits is None else slowness(limits[before][direction ^ 2], least)
                heapq.heappush(front, (so_far + price.move * (1 + slower), before, axis))
        if turns[cell]:
            heapq.heappush(front, (so_far + price.turn, cell, 1 - axis))
        for slot in beside.get(cell, ()):
            if slot not in through:  # a drop there, then a pick from any side
                through.add(slot)
                for other in access[slot]:
                    if other != NIL:
                        both = ((so_far + price.handling, other, one) for one in (0, 1))
                        for state in both:
                            heapq.heappush(front, state)
    return cost


def slowness(limit: int, ticks: int) -> float:
    """The relative delay of a move of these ticks under a speed limit."""
    return max(limit / ticks - 1, 0.0)


def _visits(resolved: Resolved) -> bool:
    listed = resolved.scenario.orders.listed
    return listed is not None and any(line.source == line.target for line in listed)  # or has stops


def drained(robot_type: RobotType, operation: Literal["move", "turn"]) -> float:
    """Percent of the battery that a move or a turn with a load takes from a robot of a type."""
    assert robot_type.battery is not None
    drain = robot_type.battery.drain
    if operation == "move":
        return drain.loaded_factor * drain.move * robot_type.moves.loaded
    return drain.loaded_factor * drain.turn * robot_type.turns.loaded


def _held(battery: Battery | None) -> float:
    start = 0.0 if battery is None else battery.initial_charge
    if isinstance(start, ChargeRange):
        return start.most
    return max(start) if isinstance(start, tuple) else start


def _given(resolved: Resolved) -> float:
    if resolved.scenario.battery is None:
        return 0.0
    charges = [one.battery.charge_rate for one in resolved.fleet.types if one.battery is not None]
    rate = max(
        max(step[1] for step in charge) if isinstance(charge, tuple) else charge
        for charge in charges
    )
    return float(rate * sum(places_of_chargers(resolved.scenario, resolved.floor_plan).values()))


def _mended(resolved: Resolved) -> float:
    faults = resolved.scenario.faults
    if resolved.scenario.battery is None or faults.tow_after is None or faults.repair_time is None:
        return 0.0
    reserves = [one.battery.reserve for one in resolved.fleet.types if one.battery is not None]
    added = max(reserves) if faults.charge == "kept" else faults.charge
    return added / max(1, faults.tow_after + faults.repair_time)


class PartBounds(NamedTuple):
    """Lower bounds, in ticks, on the time for all parts of a scenario."""

    busiest: float  # work of the station with the most work
    longest: float  # longest route, begun when its last part arrives


def ways(orders: Orders) -> list[tuple[int, int]]:
    """The two stations, from 1, of each order of the parts, in the sequence of the orders."""
    return [
        way
        for kind in orders.parts or ()
        for way in list(itertools.pairwise(kind.route)) * kind.count
    ]


def part_bounds(orders: Orders, ticks: Array) -> PartBounds:
    """The bounds of parts; `ticks`: least ticks of a robot for each order."""
    busiest: dict[int, float] = {}
    longest, first = 0.0, 0
    for kind in orders.parts or ():
        worked = kind.route[:-1]
        for number in worked:
            busiest[number] = busiest.get(number, 0.0) + kind.count * least_work(orders, number)
        on_its_way = float(ticks[first : first + len(worked)].sum())
        own_work = sum(least_work(orders, number) for number in worked)
        longest = max(longest, last_comes(kind) + own_work + on_its_way)
        first += kind.count * len(worked)
    return PartBounds(max(busiest.values(), default=0.0), longest)


def least_work(orders: Orders, number: int) -> int:
    """Least ticks that a station, by number from 1, needs for a part."""
    time = (
        orders.processing_time[number - 1]
        if isinstance(orders.processing_time, tuple)
        else orders.processing_time
    )
    return time if isinstance(time, int) else LEAST_DRAWN


def last_comes(kind: Parts) -> int:
    """The earliest tick in which the last part of a type can arrive."""
    return (
        kind.first_release + (kind.count - 1) * kind.interarrival_time
        if isinstance(kind.interarrival_time, int)
        else kind.first_release
    )


# The flow of pods: an estimate of the visits of robots, stations and chargers, and bounds on them.
#
# A trip consists of the way to the pod, the pick, the drive with the pod to the station and back to the
# same cell, the handling and the drop, and of the charging for all these. If robots enter and leave a
# station over different cells, a full queue passes it at intervals of handling + turns in its cell +
# 2 d - 1 ticks, with moves of d.


class PodFlow(NamedTuple):
    """Visits per tick of all robots, all stations and all chargers, each without the others."""

    trip: float  # mean ticks of a trip, without charging
    to_pod: float  # of these, ticks of the way to the pod
    robots: float
    stations: float
    chargers: float  # infinite without batteries
    robots_begin: float  # as `robots`, over the longest run and with the charge at its start
    chargers_begin: float  # likewise
    most_robots: float  # a bound for any demand and any strategies
    most_stations: float  # likewise


class PodWays(NamedTuple):
    """Ticks of the ways of robots with one kind of driving."""

    loaded: Ticks  # (pods, stations) least ticks with a pod to a station and back
    least: int  # from any storage cell to a station and back to any
    empty: float  # mean ticks from one pod to another


def pod_ways(resolved: Resolved, robot_type: RobotType) -> PodWays:
    """The ways of robots of a type, turns included; the mean of empty ways is that of some pods."""
    floor_plan, driving = resolved.floor_plan, loaded_driving(robot_type)
    empty = driving._replace(
        move=robot_type.moves.empty,
        turn=robot_type.turns.empty,
        loaded=resolved.scenario.pods.under == "none",
    )
    pods = tuple(pod_cells(resolved.scenario, floor_plan).tolist())
    return _pod_ways(floor_plan, pods, driving, empty)


@lru_cache(maxsize=8)  # scenarios that are compared often have one floor
def _pod_ways(
    floor_plan: FloorPlan, cells: tuple[int, ...], driving: Driving, empty: Driving
) -> PodWays:
    pods = np.array(cells, np.int64)
    stored = np.union1d(pods, np.flatnonzero(floor_plan.kind == STORAGE))
    loaded = np.zeros((len(pods), len(floor_plan.stations)), np.int64)
    least = NO_WAY
    for number, cell in enumerate(floor_plan.stations.tolist()):
        there, back = (
            np.array(
                [
                    ticks_between(floor_plan, driving, cell, backwards, heading).min(axis=1)
                    for heading in range(driving.headings)
                ]
            )
            for backwards in (True, False)
        )
        loaded[:, number] = (there + back)[:, pods].min(axis=0)
        both = there[:, stored].min(axis=1) + back[:, stored].min(axis=1)
        least = min(least, int(both.min()))
    some = pods[:: math.ceil(len(pods) / EMPTY_WAYS)]
    ways = np.array([ticks_between(floor_plan, empty, int(cell), False)[pods] for cell in some])
    ways = ways.min(axis=2)
    others = (ways < NO_WAY) & (some[:, None] != pods)
    loaded.setflags(write=False)
    return PodWays(loaded, least, float(ways[others].mean()) if others.any() else 0.0)


def pod_flow(resolved: Resolved) -> PodFlow | None:
    """The flow of a scenario; None without pods that are carried for lines."""
    scenario, fleet, floor_plan = resolved.scenario, resolved.fleet, resolved.floor_plan
    if scenario.orders.lines is None:
        return None
    rules = handling_rules(scenario, floor_plan)
    units = mean_units(scenario)
    means, leasts = [mean_handling(one, units) for one in rules], [*map(least_handling, rules)]
    handling, least = sum(means) / len(means), min(leasts)
    stops = scenario.pods.max_stops
    turns = least_turns(resolved) * fleet.least_loaded_turn
    passing = turns + 2 * fleet.least_loaded_move - 1
    length = scenario.stop.max_duration
    ways: dict[RobotType, PodWays] = {}
    trip = to_pod = robots = begin = most = energy = supply = stock = 0.0
    for kind, many in zip(fleet.types, fleet.counts, strict=True):
        own = ways.get(kind.driving) or pod_ways(resolved, kind)
        ways[kind.driving] = own
        operations = kind.durations.pick + kind.durations.drop
        drive = float(own.loaded.mean())
        ticks = own.empty + drive + operations + handling
        used, rate = energy_of_trip(kind.battery, own.empty, drive, handling)
        trip, to_pod = trip + many * ticks, to_pod + many * own.empty
        charging, held = (used / rate if used and rate else 0.0), spare_charge(kind.battery)
        robots += many / (ticks + charging)
        most_held = (1 + held / rate / length) / (ticks + charging) if charging else math.inf
        begin += many * min(1 / ticks, most_held)
        energy, supply, stock = (
            energy + many * used,
            supply + many * rate,
            stock + many * held,
        )
        most += many * stops / max(operations + own.least + stops * least, 1)
    n = sum(fleet.counts)
    places = sum(places_of_chargers(scenario, floor_plan).values())
    charges = bool(energy and places)
    return PodFlow(
        trip / n,
        to_pod / n,
        robots,
        sum(1 / max(one + passing, 1) for one in means),
        supply * places / energy if charges else math.inf,
        begin,
        (supply * places + n * stock / length) / energy if charges else math.inf,
        most,
        sum(1 / max(one + passing, 1) for one in leasts),
    )


def energy_of_trip(
    battery: Battery | None, empty: float, loaded: float, handling: float
) -> tuple[float, float]:
    """Percent of a battery that a trip takes, and the mean percent per tick at a charger."""
    if battery is None:
        return 0.0, 0.0
    drain = battery.drain
    used = drain.move * (empty + drain.loaded_factor * loaded)
    used += drain.wait * drain.loaded_factor * handling
    charging = battery.charge_rate
    curve = charging if isinstance(charging, tuple) else ((0.0, charging),)
    ends = [*(begin for begin, _ in curve[1:]), 100.0]
    parts = [
        (max(end - max(begin, battery.reserve), 0.0), rate)
        for (begin, rate), end in zip(curve, ends, strict=True)
    ]
    ticks = sum(part / rate for part, rate in parts if rate)
    return used, sum(part for part, _ in parts) / ticks if ticks else 0.0


def spare_charge(battery: Battery | None) -> float:
    """Mean percent of a battery above the reserve when a run begins."""
    if battery is None:
        return 0.0
    start = battery.initial_charge
    if isinstance(start, ChargeRange):
        start = (start.least, start.most)
    mean = float(np.mean(start))
    return max(mean - battery.reserve, 0.0)


def least_turns(resolved: Resolved) -> int:
    """The fewest quarter turns that a robot makes in the cell of a station on its way through."""
    floor_plan = resolved.floor_plan
    least = 2
    for cell in floor_plan.stations.tolist():
        exits = int(floor_plan.exits.flat[cell])
        for way, offset in enumerate(floor_plan.offsets):
            if not int(floor_plan.exits.flat[cell - offset]) >> way & 1:
                continue  # no robot arrives in this direction
            for out in range(4):
                if exits >> out & 1:
                    turns = (out - way) % 4
                    least = min(least, 1 if turns == 3 else turns)
    return least


def mean_units(scenario: Scenario) -> float:
    """The mean number of units of a line."""
    lines = listed_lines(scenario.orders)
    return float(line_column(lines, "units").mean()) if lines else 1.0


def mean_handling(handling: Handling, units: float) -> float:
    """Mean ticks of a visit for one line."""
    line = mean_of(handling.line) if isinstance(handling.line, Distribution) else handling.line
    return handling.visit + line + units * handling.unit


def least_handling(handling: Handling) -> float:
    """Least ticks of a visit."""
    line = handling.line
    if isinstance(line, Distribution):
        line = line.uniform.least if line.uniform is not None else 0
    return handling.visit + line + handling.unit


def mean_of(distribution: Distribution) -> float:
    """The mean of a distribution, in ticks."""
    if distribution.uniform is not None:
        return (distribution.uniform.least + distribution.uniform.most) / 2
    if distribution.lognormal is not None:
        return distribution.lognormal.mean
    if distribution.exponential is not None:
        return distribution.exponential
    assert isinstance(distribution.empirical, tuple), "its file has been read"
    return float(np.mean(distribution.empirical))


def bounds_in_words(resolved: Resolved) -> list[str]:
    """The sentences of `check` about the flow of pods: an estimate and a bound."""
    flow = pod_flow(resolved)
    if flow is None:
        return []
    scenario, unit = resolved.scenario, resolved.scenario.units.scale.unit
    per = (1000.0, "in 1,000 ticks") if unit.seconds is None else (3600 / unit.seconds, "an hour")
    ticks, each = per
    shares = (flow.robots, flow.stations, flow.chargers)
    least, limit = limited(resolved, shares, ticks)
    estimate = f"{least} visits {each}, limited by {limit}"
    sentences = [f"estimate without traffic: {estimate}"]
    if flow.chargers < math.inf and scenario.ends_at_limit:
        length = scenario.stop.max_duration
        shares = (flow.robots_begin, flow.stations, flow.chargers_begin)
        first, limit = limited(resolved, shares, ticks)
        sentences = [
            f"estimate without traffic, for a run of {ticks_and_time(length, unit)} that begins with the "
            f"initial charge: {first} visits {each}, limited by {limit}",
            f"estimate without traffic, in the long run: {estimate}",
        ]
    empty = flow.to_pod / flow.trip
    most, why = min((flow.most_robots, "robots"), (flow.most_stations, "stations"))
    return [
        *sentences,
        "assumptions: uniform pod demand, one line per trip, fixed storage; the way to the pod "
        f"({percent(empty, 0)} of a trip) is the mean way between two pods",
        f"upper bound for any strategy: {most * ticks:,.0f} visits {each}, limited by {why}",
    ]


def limited(resolved: Resolved, rates: tuple[float, float, float], ticks: float) -> tuple[str, str]:
    """Visits in some ticks, and by what they are limited; `rates`: robots, stations, chargers."""
    places = places_of_chargers(resolved.scenario, resolved.floor_plan)
    names = (
        (count(resolved.scenario.fleet.robots, "robot"), "robots"),
        (count(len(resolved.floor_plan.stations), "station"), "stations"),
        (count(len(places), "charger"), "chargers"),
    )
    parts = sorted((rate, *who) for rate, who in zip(rates, names, strict=True) if rate < math.inf)
    by = ", ".join(f"{name}: {rate * ticks:,.0f}" for rate, name, _ in parts)
    return f"{parts[0][0] * ticks:,.0f}", f"{parts[0][2]} ({by})"
