"""Random situations for auctions and charging, on the depots floor and its variants."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
from reference_charging import Situation

from automaton.engine.state import BATTERY_FULL, Array
from automaton.papers.auction_trials import seconds
from layouts.depots import NEEDED_LANES, OPTIONAL_LANES, metres
from strategies.allocation.auction import quotes
from strategies.allocation.auction.market import (
    POLICY_HIERARCHICAL,
    AuctionScratch,
    BatteryRules,
    FleetLists,
    TaskCosts,
    battery_of,
    fleet_of,
    scratch_for,
    visits,
)

FAR = 100_000  # ticks between places that no lane connects
TAPER = ((0, 10_000_000), (800_000_000, 5_000_000), (950_000_000, 2_000_000))


def between_with(lanes: Any) -> list[list[int]]:
    """Ticks between positions 1..17 with the needed lanes and these."""
    found = metres(NEEDED_LANES | frozenset(lanes))
    return [[int(value) if value >= 0 else FAR for value in row] for row in found]


def random_situation(rng: random.Random, curve: Any = None, chargers: int = 3) -> Situation:
    """A list of 1 to 9 visits on a random variant of the floor, with a battery that may be short."""
    lanes = [lane for lane in sorted(OPTIONAL_LANES) if rng.random() < 0.7]
    at = tuple(rng.sample(range(17), rng.randint(1, chargers)))
    return Situation(
        between=between_with(lanes),
        drain=rng.choice((2_000_000, 3_000_000, 5_000_000)),
        curve=curve or ((0, rng.choice((5_000_000, 10_000_000, 50_000_000, 7_300_000))),),
        chargers=at,
        wait=tuple(rng.choice((0, 0, 15, 40)) for _ in at),
        reserve=rng.choice((0, 100_000_000, 200_000_000)),
        end_reach=rng.random() < 0.5,
        start=rng.randrange(17),
        charge=rng.choice((BATTERY_FULL, rng.randrange(250_000_000, BATTERY_FULL))),
        stops=tuple(rng.sample(range(3, 16), rng.randint(1, 9))),
    )


def market_of(
    case: Situation, policy: int = POLICY_HIERARCHICAL, **rules: Any
) -> tuple[TaskCosts, BatteryRules, FleetLists, AuctionScratch]:
    """The same for the kernels, all tasks on the list of robot 0, settled."""
    ticks = np.array(case.between)
    energy = ticks * case.drain
    task_costs = visits(ticks, energy, case.stops)
    rules = {"reserve": case.reserve, "end_reach": case.end_reach} | rules
    battery = battery_of(energy, case.chargers, case.curve, policy=policy, **rules)
    battery.wait[:] = case.wait
    count = len(case.stops)
    fleet = fleet_of([case.start], count, case.charge)
    scratch = scratch_for(1, count, count, len(case.chargers))
    fleet.order[0, :count] = range(count)
    fleet.length[0] = count
    quotes.settle_all(task_costs, battery, fleet, scratch)
    return task_costs, battery, fleet, scratch


def stops_of(scratch: AuctionScratch) -> tuple[tuple[int, int], ...]:
    """The stops of the plan: (position, number of the charger)."""
    plan = scratch.plan
    return tuple((int(plan.position[k]), int(plan.charger[k])) for k in range(plan.stops))


def random_auction(
    rng: random.Random, robots: int, tasks: int, policy: int = 0, **rules: Any
) -> tuple[TaskCosts, BatteryRules, FleetLists, AuctionScratch, Array]:
    """Robots at random places with lists, and tasks to be sold: the market and the items.

    Some tasks are pairs (pick up here, deliver there), some robots hear only of some.
    """
    ticks = np.array(seconds())
    energy = ticks * 3_000_000
    listed = rng.randint(0, min(robots, 3))
    task_costs = visits(ticks, energy, [rng.randrange(3, 16) for _ in range(tasks + listed)])
    for task in range(tasks + listed):
        if rng.random() < 0.3:
            task_costs.end[task] = rng.randrange(3, 16)
            task_costs.inside[0, task] = ticks[task_costs.begin[task], task_costs.end[task]] + 4
            task_costs.use[0, task] = energy[task_costs.begin[task], task_costs.end[task]]
    chargers = (1, 7)
    battery = battery_of(energy, chargers, ((0, 10_000_000),), policy=policy, **rules)
    charge = [rng.choice((BATTERY_FULL, 600_000_000, 450_000_000)) for _ in range(robots)]
    places = [rng.choice((0, 1, 2, 16)) for _ in range(robots)]
    fleet = fleet_of(places, tasks + listed, charge)
    scratch = scratch_for(robots, tasks + listed, tasks + listed, len(chargers))
    for r in range(listed):
        fleet.order[r, 0], fleet.length[r] = tasks + r, 1
        fleet.first[r] = rng.randint(0, 1)
        fleet.ready[r] = rng.choice((0, 25))
    for r in range(robots):
        for task in range(tasks):
            fleet.may_bid[r, task] = rng.random() < 0.9
    quotes.settle_all(task_costs, battery, fleet, scratch)
    return task_costs, battery, fleet, scratch, np.arange(tasks, dtype=np.int32)


def lists_of(fleet: FleetLists) -> list[list[int]]:
    """The tasks of each robot."""
    return [row[:length].tolist() for row, length in zip(fleet.order, fleet.length, strict=True)]
