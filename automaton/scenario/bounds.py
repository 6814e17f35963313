"""What a fleet cannot do better, whatever its strategies: bounds that need no run.

work       each order is taken, carried over the shortest way without turns, and set down: N robots
           need work / N ticks
stations   a station holds one robot: picks and drops at stations, shared evenly among them
chargers   energy that orders take beyond what batteries hold at the start comes from chargers, or
           from repairs

Orders that are drawn count as the shortest that could be drawn, so the bounds hold for every seed.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from automaton.scenario.resolve import Resolved
from automaton.scenario.schema import DRAWN, Battery, ChargeRange
from automaton.world.cells import CHARGER, DESTINATION, DOCK, RACK, SHELF, STATION
from automaton.world.reach import slot_access, steps_from
from automaton.world.state import NIL, Array

MOST_TARGETS: Final = 200  # of a list, each with a search of its own; beyond: the nearest of all
ENDS: Final = {  # generator: kinds of slots where its orders begin and end
    "full-shelves": (SHELF, DESTINATION),
    "drawn-loads": (SHELF, DESTINATION),
    "dock-to-rack": (DOCK, RACK),
    "stations": (STATION, STATION),
}


class Bounds(NamedTuple):
    """What all orders of a scenario take at least."""

    orders: int
    work: float  # robot ticks of all orders
    least_order: float  # robot ticks of the shortest
    longest_order: float  # robot ticks of the longest
    station_ticks: float  # of each station, if they share the work evenly
    energy: float  # percent of a battery, all orders
    held: float  # the same, in each battery at the start
    given: float  # the same, by all chargers in a tick
    mended: float  # the same, by each robot and tick, if it is towed and comes back full


def bounds(resolved: Resolved) -> Bounds:
    """The bounds of a scenario; they do not depend on the number of robots."""
    scenario = resolved.scenario
    moves, picks, drops = least_moves(resolved)
    durations, battery = scenario.durations, scenario.battery
    handling = durations.pick + durations.drop
    ticks = handling + durations.move * moves
    if scenario.orders.generator == "visits" or _visits(resolved):
        ticks = np.zeros(len(moves))  # a visit may take no operation at all
    busy = picks * durations.pick + drops * durations.drop
    stations = int(np.count_nonzero(resolved.plan.kind == STATION))
    return Bounds(
        orders=len(moves),
        work=float(ticks.sum()),
        least_order=float(ticks.min(initial=math.inf)),
        longest_order=float(ticks.max(initial=0)),
        station_ticks=busy / stations if stations else 0.0,
        energy=_energy(resolved, moves),
        held=_held(battery),
        given=_given(resolved),
        mended=_mended(resolved),
    )


def least_ticks(found: Bounds, robots: int) -> tuple[float, str]:
    """Ticks in which so many robots cannot do all orders faster, and why."""
    lacking = found.energy - robots * found.held
    income = found.given + robots * found.mended
    charging = (lacking / income if income else math.inf) if lacking > 0 else 0.0
    return max(
        (found.work / robots, f"work of {found.work:,.0f} robot ticks shared by {robots}"),
        (found.longest_order, "the longest order alone"),
        (found.station_ticks, "stations hold one robot each"),
        (charging, "chargers give no more energy"),
    )


def most_throughput(found: Bounds, robots: int) -> tuple[float, str]:
    """Orders by 1000 ticks that so many robots cannot exceed, and why."""
    if not 0 < found.least_order < math.inf:
        return math.inf, ""
    return (
        1000 * robots / found.least_order,
        f"the shortest order takes a robot {found.least_order:,.0f} ticks",
    )


def least_moves(resolved: Resolved) -> tuple[Array, int, int]:
    """(m,) moves of each order with its load at least; picks at stations, and drops there."""
    scenario, plan = resolved.scenario, resolved.plan
    orders, kinds = scenario.orders, plan.kind.reshape(-1)
    if orders.listed is not None:
        pairs = [(plan.cell(*line.source), plan.cell(*line.target)) for line in orders.listed]
        picks, drops = (sum(kinds[pair[end]] == STATION for pair in pairs) for end in (0, 1))
        return _listed_moves(resolved, pairs), int(picks), int(drops)
    if orders.generator not in ENDS:
        return np.zeros(orders.count or 0), 0, 0
    begin, end = ENDS[orders.generator]
    slots = plan.slots()
    source, target = slots[kinds[slots] == begin], slots[kinds[slots] == end]
    if orders.generator == "drawn-loads":
        source = source[plan.loads.reshape(-1)[source] == 1]
    if orders.generator in DRAWN:
        count = orders.count or 0
        if begin == end:  # from a station to another one
            return np.ones(count), count, count
        return np.full(count, _nearest(resolved, source, target).min()), 0, 0
    return _nearest(resolved, source, target), 0, 0


def _listed_moves(resolved: Resolved, pairs: list[tuple[int, int]]) -> Array:
    targets = sorted({target for _, target in pairs})
    if len(targets) > MOST_TARGETS:
        return _nearest(resolved, np.array([a for a, _ in pairs]), np.array(targets))
    moves = np.zeros(len(pairs))
    for cell in targets:
        rows = [row for row, (_, target) in enumerate(pairs) if target == cell]
        sources = np.array([pairs[row][0] for row in rows])
        moves[rows] = _nearest(resolved, sources, np.array([cell]))
    return moves


def _nearest(resolved: Resolved, source: Array, target: Array) -> Array:
    """(m,) moves from each slot to the nearest of the targets; 0 without a way."""
    plan = resolved.plan
    index = {cell: row for row, cell in enumerate(plan.slots().tolist())}
    access = slot_access(plan)
    goals = access[[index[cell] for cell in target.tolist()]].reshape(-1)
    steps = steps_from(plan, goals[goals != NIL].tolist(), backwards=True).astype(np.float64)
    around = access[[index[cell] for cell in source.tolist()]]
    ways = np.where((around != NIL) & (steps[around] >= 0), steps[around], np.inf)
    found: Array = ways.min(axis=1, initial=np.inf)
    return np.where(np.isfinite(found), found, 0.0)


def _visits(resolved: Resolved) -> bool:
    listed = resolved.scenario.orders.listed
    return listed is not None and any(line.source == line.target for line in listed)


def _energy(resolved: Resolved, moves: Array) -> float:
    scenario = resolved.scenario
    if scenario.battery is None:
        return 0.0
    drain, durations = scenario.battery.drain, scenario.durations
    return float(drain.move * drain.loaded * durations.move * moves.sum())


def _held(battery: Battery | None) -> float:
    start = 0.0 if battery is None else battery.start
    if isinstance(start, ChargeRange):
        return start.most
    return max(start) if isinstance(start, tuple) else start


def _given(resolved: Resolved) -> float:
    battery = resolved.scenario.battery
    if battery is None:
        return 0.0
    charge = battery.charge
    rate = max(step[1] for step in charge) if isinstance(charge, tuple) else charge
    return float(rate * np.count_nonzero(resolved.plan.kind == CHARGER))


def _mended(resolved: Resolved) -> float:
    faults = resolved.scenario.faults
    if resolved.scenario.battery is None or faults.tow_after is None or faults.repair is None:
        return 0.0
    return 100.0 / max(1, faults.tow_after + faults.repair)
