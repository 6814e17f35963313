"""Section 5.2 of De Ryck et al. and what follows it: one robot that charges by several rules.

A robot starts at depot 1, 2 or 3 with a full battery, drives its tour (the sequential auction's,
without regard to charging) and charges at position 2 or at positions 1, 2 and 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.engine.random_numbers import STREAM_STARTS, random_between
from automaton.engine.robot_states import BATTERY_FULL
from automaton.papers.auctions.auction_floor import (
    NO_BATTERY,
    PERCENT,
    empty,
    fleet_at,
    listed,
    rules,
    scratch_of,
    seconds,
    work_of,
)
from automaton.papers.auctions.auction_trials import task_set
from strategies.allocation.auction import quotes, sequential
from strategies.allocation.auction.market import (
    INF_COST,
    POLICY_FILL_UP,
    POLICY_HIERARCHICAL,
    POLICY_THRESHOLD,
    POLICY_THRESHOLD_REACHABLE,
    Battery,
    Scratch,
    TaskCosts,
    scratch_for,
)
from strategies.allocation.auction.sequential import BID_MIXED
from strategies.allocation.auction.sequential import WINNER_LOWEST_BID as LOWEST_BID

DRAIN: Final = 3 * PERCENT // 10  # a second
RATE: Final = PERCENT  # a second
TAPER: Final = (
    (0, PERCENT),
    (80 * PERCENT, PERCENT // 2),
    (95 * PERCENT, PERCENT // 5),
)
THRESHOLD: Final = 20 * PERCENT

POLICIES: Final[Mapping[str, Mapping[str, Any]]] = {
    "r0": {"policy": POLICY_HIERARCHICAL},
    "r20": {"policy": POLICY_HIERARCHICAL, "reserve": THRESHOLD},
    "look": {"policy": POLICY_THRESHOLD, "threshold": THRESHOLD},
    "safe": {"policy": POLICY_THRESHOLD_REACHABLE, "threshold": THRESHOLD},
    "r0 reach": {"policy": POLICY_HIERARCHICAL, "end_reach": True},
    "thr0 safe": {"policy": POLICY_THRESHOLD_REACHABLE, "threshold": 0},
    "thr20 safe": {"policy": POLICY_THRESHOLD_REACHABLE, "threshold": THRESHOLD},
    "fill-up": {"policy": POLICY_FILL_UP, "end_reach": True},
    "fill to 80": {"policy": POLICY_FILL_UP, "end_reach": True, "target": 80 * PERCENT},
}


@cache
def battery(name: str, chargers: tuple[int, ...] = (2,), taper: bool = False) -> Battery:
    """The rules of a policy."""
    curve = TAPER if taper else RATE
    return rules(seconds(), DRAIN, curve, chargers, **POLICIES[name])


class Driven(NamedTuple):
    """A tour with its charging."""

    cost: float  # seconds
    gross: float  # seconds spent on charging, with the ways there and on
    net: float  # less the legs that were replaced
    end: int  # units at the end
    lowest: int  # units, the least on the way
    stops: int
    feasible: bool
    states: int  # looked at by the plan


@cache
def tour(stations: tuple[int, ...], start: int) -> tuple[int, ...]:
    """The stations in the order in which the sequential auction puts them into one list."""
    task_costs = work_of(stations, seconds(), DRAIN)
    fleet = fleet_at((start,), len(stations))
    market = (task_costs, NO_BATTERY["full"], fleet, scratch_of(fleet, len(stations)))
    empty(*market)
    items = np.arange(len(stations), dtype=np.int32)
    sequential.sequential(*market, items, len(stations), BID_MIXED, 0, LOWEST_BID, 0)
    return tuple(stations[task] for task in listed(fleet, 0))


@cache
def driven_work(stations: tuple[int, ...]) -> TaskCosts:
    """Stations to be driven to."""
    return work_of(stations, seconds(), DRAIN)


@cache
def single_scratch(tasks: int, chargers: int) -> Scratch:
    """Scratch for the list of one robot."""
    return scratch_for(1, tasks, tasks, chargers)


def drive(stations: tuple[int, ...], start: int, charge: int, rule: Battery) -> Driven:
    """Drive these stations in this order."""
    task_costs = driven_work(stations)
    scratch = single_scratch(len(stations), len(rule.charger))
    quotes.clear_counts(scratch)
    order = np.arange(len(stations), dtype=np.int32)
    cost = quotes.quote(task_costs, rule, scratch, start - 1, 0, charge, order, len(stations))
    plan = scratch.plan
    return Driven(
        cost=float(plan.cost[0]),
        gross=float(plan.gross[0]),
        net=float(plan.net[0]),
        end=int(plan.end_charge[0]),
        lowest=int(plan.lowest_charge[0]),
        stops=int(scratch.plan.stops[0]),
        feasible=bool(cost < INF_COST),
        states=int(scratch.count.states[0]),
    )


def start_of(seed: int, n: int, number: int) -> int:
    """A depot, drawn from 1 to 3."""
    with np.errstate(over="ignore"):
        return int(random_between(1, 3, np.uint64(seed), STREAM_STARTS, n, number))


def charging_costs(seed: int, n: int, number: int, chargers: tuple[int, ...]) -> dict[str, float]:
    """The figures of one tour of n tasks by the four rules of the comparison."""
    start = start_of(seed, n, number)
    stations = tour(task_set(seed, n, number), start)
    by = {
        name: drive(stations, start, BATTERY_FULL, battery(name, chargers))
        for name in ("r0", "r20", "look", "safe")
    }
    direct = by["r0"].cost - by["r0"].net
    found = {"tour": direct}
    for name in ("r0", "r20"):
        found[f"charges {name}"] = float(by[name].stops > 0)
    for name, one in by.items():
        found[f"gross {name}"] = one.gross
        found[f"net {name}"] = one.net
    found["empty look"] = float(by["look"].lowest < 0)
    found["below 20 look"] = float(by["look"].lowest < THRESHOLD and by["look"].stops > 0)
    found["end r20"], found["end look"], found["end safe"] = (
        by[name].end / BATTERY_FULL for name in ("r20", "look", "safe")
    )
    # Per instance: where anything is charged, is the plan dearer than the threshold's?
    found["gross worse"] = float(by["r20"].gross > by["look"].gross)
    found["time worse"] = float(by["r20"].cost > by["look"].cost)
    keeps = by["look"].lowest >= THRESHOLD
    found["time worse, floor kept"] = float(keeps and by["r20"].cost > by["look"].cost)
    found["states r20"], found["states look"] = by["r20"].states, by["look"].states
    return found


def whole_objective(seed: int, n: int, number: int) -> dict[str, float]:
    """One robot: charging in the bids of the auction, or the threshold after the genetic tour."""
    start = start_of(seed, n, number)
    stations = task_set(seed, n, number)
    found = {}
    for name in ("r0", "r20"):
        task_costs = work_of(stations, seconds(), DRAIN)
        fleet = fleet_at((start,), n)
        market = (task_costs, battery(name), fleet, scratch_of(fleet, n))
        empty(*market)
        items = np.arange(n, dtype=np.int32)
        sold = sequential.sequential(*market, items, n, BID_MIXED, 0, LOWEST_BID, 0)
        if sold == n:
            found[f"SSI {name}"] = float(fleet.cost[0])
    inserted = inserted_by_arrival(stations, start)
    for name in ("look", "safe"):
        found[f"GA {name}"] = drive(inserted, start, BATTERY_FULL, battery(name)).cost
    return found


def inserted_by_arrival(stations: tuple[int, ...], start: int) -> tuple[int, ...]:
    """The only list that the genetic algorithm can make for a single robot."""
    task_costs = work_of(stations, seconds(), DRAIN)
    fleet = fleet_at((start,), len(stations))
    market = (task_costs, NO_BATTERY["full"], fleet, scratch_of(fleet, len(stations)))
    empty(*market)
    items = np.arange(len(stations), dtype=np.int32)
    sequential.by_arrival(*market, items, len(stations), BID_MIXED, 0)
    return tuple(stations[task] for task in listed(fleet, 0))


BATCHES: Final = 200


def rolling(seed: int, size: int, name: str, taper: bool) -> tuple[float, float]:
    """(seconds per task, share of batches without a plan) of batches driven back to back.

    Where there is no plan the robot is towed to the charger, at driving speed, and charged fully.
    """
    rule = battery(name, (2,), taper)
    charger = 2
    here, charge, total, stuck = start_of(seed, size, 0), BATTERY_FULL, 0.0, 0
    for number in range(BATCHES):
        stations = task_set(seed, size, number)
        driven = drive(tour(stations, here), here, charge, rule)
        if not driven.feasible:
            stuck += 1
            total += float(seconds()[here - 1, charger - 1]) + full_charge(charge, taper)
            here, charge = charger, BATTERY_FULL
            driven = drive(tour(stations, here), here, charge, rule)
        total += driven.cost
        here, charge = tour(stations, here)[-1], driven.end
    return total / (BATCHES * size), stuck / BATCHES


def full_charge(level: int, taper: bool) -> float:
    """Seconds from this level to a full battery."""
    ticks = 0
    pieces = TAPER if taper else ((0, RATE),)
    for k, (_, rate) in enumerate(pieces):
        until = pieces[k + 1][0] if k + 1 < len(pieces) else BATTERY_FULL
        if level < until:
            needed = -(-(until - level) // rate)
            ticks, level = ticks + needed, level + needed * rate
    return float(ticks)
