"""Section 4 of De Ryck et al.: two robots with lists, and a new task at position 14.

Robot 1 is at 3 with 100 %, robot 2 at 1 with 45 %; driving takes 0.5 % a second, charging gives 5 %.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from automaton.engine.robot_states import BATTERY_FULL
from automaton.papers.auctions.auction_floor import (
    PERCENT,
    fleet_at,
    give,
    rules,
    scratch_of,
    seconds,
    work_of,
)
from strategies.allocation.auction import sequential
from strategies.allocation.auction.market import (
    BID_SCALE,
    INF_COST,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_NO_CHARGING,
    Scratch,
)
from strategies.allocation.auction.quotes import settle_all
from strategies.allocation.auction.sequential import BID_MIXED

STARTS: Final = (3, 1)
CHARGES: Final = (BATTERY_FULL, 45 * PERCENT)
LISTS: Final = ((7, 8, 13), (5, 4, 9))
NEW: Final = 14
DRAIN: Final = PERCENT // 2  # a second
RATE: Final = 5 * PERCENT  # a second
HALF: Final = BID_SCALE // 2  # epsilon

SETTINGS: Final[Mapping[str, Mapping[str, Any]]] = {
    "as printed": {},
    "charging ignored": {"policy": POLICY_NO_CHARGING},
    "reserve 10 %": {"reserve": 10 * PERCENT},
    "reserve 20 %": {"reserve": 20 * PERCENT},
    "never strand": {"end_reach": True},
    "chargers 1, 2, 3": {"chargers": (1, 2, 3)},
    "joint": {"policy": POLICY_JOINT},
    "comb floor": {"lanes": "comb"},
}


@dataclass(frozen=True)
class Bid:
    """What one robot computes for the new task; costs in seconds, levels in units."""

    before: int | None  # c1; None: its own list is not feasible
    cost: float | None  # c2 and the MiniMax bid; None: there is no feasible plan
    added: float | None  # the MiniSum bid
    mixed: float | None
    order: tuple[int, ...]  # positions in the order of driving, chargers included
    arrival: int | None  # level on arrival at the first charger
    charging: int  # seconds
    end: int  # level


def bids_for(setting: str) -> list[Bid]:
    """The bids of both robots."""
    chosen: dict[str, Any] = {"policy": POLICY_HIERARCHICAL, "chargers": (2,), "lanes": "full"}
    chosen |= SETTINGS[setting]
    between = seconds(chosen.pop("lanes"))
    tasks = [*LISTS[0], *LISTS[1], NEW]
    task_costs = work_of(tasks, between, DRAIN)
    battery = rules(between, DRAIN, RATE, **chosen)
    fleet = fleet_at(STARTS, len(tasks), CHARGES)
    scratch = scratch_of(fleet, len(tasks), len(battery.charger))
    give(fleet, 0, (0, 1, 2))
    give(fleet, 1, (3, 4, 5))
    settle_all(task_costs, battery, fleet, scratch)
    market = (task_costs, battery, fleet, scratch)
    found = []
    for r in range(2):
        offers = [
            sequential.bid(*market, r, len(tasks) - 1, BID_MIXED, epsilon)
            for epsilon in (0, BID_SCALE, HALF)
        ]
        cost, added, mixed = (None if offer >= INF_COST else offer / BID_SCALE for offer in offers)
        before = int(fleet.cost[r]) if fleet.cost[r] < INF_COST else None
        if cost is None:
            found.append(Bid(before, None, None, None, (), None, 0, 0))
            continue
        sequential.award(*market, r, len(tasks) - 1)
        plan = scratch.plan
        order = [tasks[task] for task in fleet.order[r, : fleet.length[r]]]
        for position, charger in reversed(stops_of(scratch)):
            order.insert(position, chosen["chargers"][charger])
        arrival = int(scratch.plan.arrival[0]) if scratch.plan.stops[0] else None
        charged, end = int(plan.charging[0]), int(plan.end_charge[0])
        found.append(Bid(before, cost, added, mixed, tuple(order), arrival, charged, end))
    return found


def stops_of(scratch: Scratch) -> list[tuple[int, int]]:
    """(position in the list, number of the charger) of the plan's stops."""
    plan = scratch.plan
    return [(int(plan.position[k]), int(plan.charger[k])) for k in range(plan.stops[0])]


def winner(offers: list[Bid]) -> int | None:
    """The number of the robot with the lowest bid, from 1."""
    made = [(one.mixed, r) for r, one in enumerate(offers, 1) if one.mixed is not None]
    return min(made)[1] if made else None


def steps() -> Iterator[str]:
    """The example as printed, step by step."""
    offers, free = bids_for("as printed"), bids_for("charging ignored")
    for r, (one, direct) in enumerate(zip(offers, free, strict=True)):
        path = (STARTS[r], *LISTS[r])
        yield (
            f"robot {r + 1} at {STARTS[r]} with {CHARGES[r] // PERCENT} %: "
            f"{listed(path[1:])}: c1 = {legs(path)} = {one.before} s"
        )
        with_it = (STARTS[r], *direct.order)
        yield (
            f"  with {NEW}: {listed(direct.order)}: {legs(with_it)} = {direct.cost:g} s; "
            f"{direct.end / PERCENT:g} % at the end"
        )
        if one.arrival is not None:
            at = one.order.index(2) + 1
            there, onward = (STARTS[r], *one.order[:at]), one.order[at - 1 :]
            yield (
                f"  charging: {listed(one.order)}: to the charger {legs(there)} = "
                f"{driven(there)} s, arriving with {one.arrival / PERCENT:g} %; "
                f"on from it {legs(onward)} = {driven(onward)} s; "
                f"{one.charging} s of charging; c2 = {one.cost:g} s"
            )
        yield (
            f"  bids: MiniSum {one.added:g}, MiniMax {one.cost:g}, "
            f"with epsilon 0.5: {one.mixed:g} (charging ignored: {direct.mixed:g})"
        )
    yield f"robot {winner(offers)} wins; with charging ignored it would be robot {winner(free)}"


def listed(path: tuple[int, ...]) -> str:
    return "[" + ", ".join(map(str, path)) + "]"


def legs(path: tuple[int, ...]) -> str:
    """The seconds of each leg, added up."""
    return " + ".join(str(driven(path[i : i + 2])) for i in range(len(path) - 1))


def driven(path: tuple[int, ...]) -> int:
    """Seconds along these positions."""
    return sum(int(seconds()[a - 1, b - 1]) for a, b in itertools.pairwise(path))
