"""Auctions on random places in the plane (Manhattan distances), and what they are compared with.

With charging, robots begin half full and a list of four or five tasks empties a battery, so that many
bids need a charging plan. Exponents are slopes of log time between two sizes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from automaton.bench.measurement import EXPONENT, MS, US, Measurement, Sample, cpu_seconds, slope
from strategies.allocation.auction import exact, genetic_auction, local_search, quotes, sequential
from strategies.allocation.auction.bids import BID_MIXED
from strategies.allocation.auction.bundle_workspace import bundles_for, generations, population_for
from strategies.allocation.auction.market import (
    BATTERY_FULL,
    POLICY_FILL_UP,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_NO_CHARGING,
    POLICY_THRESHOLD_REACHABLE,
    Array,
    Battery,
    Fleet,
    Scratch,
    TaskCosts,
)
from strategies.allocation.auction.market_preparation import (
    battery_of,
    fleet_of,
    scratch_for,
    visits,
)
from strategies.allocation.auction.winners import WINNER_DIFFERENCE, WINNER_LOWEST_BID

SIDE: Final = 100  # ticks
CHARGERS: Final = 4
DRAIN: Final = 4_000  # units per tick: 250 ticks on a full battery
RATE: Final = 20_000
SMALL: Final = (8, 80)  # robots, tasks
LARGE: Final = (100, 1000)


class Market(NamedTuple):
    """A market with empty lists, and its items."""

    task_costs: TaskCosts
    battery: Battery
    fleet: Fleet
    scratch: Scratch
    items: Array


Auction = Callable[[Market], object]


def market(robots: int, tasks: int, policy: int = POLICY_NO_CHARGING, seed: int = 1) -> Market:
    """Robots, tasks and chargers at random places."""
    rng = np.random.default_rng(seed)
    at = rng.integers(0, SIDE, (robots + tasks + CHARGERS, 2))
    ticks = np.abs(at[:, None] - at[None]).sum(2)
    chargers = np.arange(robots + tasks, len(at))
    rules = {
        "policy": policy,
        "end_reach": policy != POLICY_NO_CHARGING,
        "threshold": BATTERY_FULL // 5,
    }
    battery = battery_of(ticks * DRAIN, chargers, ((0, RATE),), **rules)  # type: ignore[arg-type]
    fleet = fleet_of(np.arange(robots), tasks, BATTERY_FULL // 2)
    scratch = scratch_for(robots, tasks, tasks, CHARGERS)
    task_costs = visits(ticks, ticks * DRAIN, np.arange(robots, robots + tasks))
    return Market(task_costs, battery, fleet, scratch, np.arange(tasks, dtype=np.int32))


def sell(one: Market, winner: int = WINNER_LOWEST_BID, everybody: int = 0) -> None:
    """A sequential auction of all items."""
    *rest, items = one
    sequential.sequential(*rest, items, len(items), BID_MIXED, 0, winner, everybody)


def sell_by_arrival(one: Market) -> None:
    """Item by item as they come."""
    *rest, items = one
    sequential.by_arrival(*rest, items, len(items), BID_MIXED, 0)


def seconds_of(one: Market, auction: Auction, repeat: int) -> float:
    """CPU seconds of an auction from empty lists."""
    *rest, _ = one
    total = 0.0
    for _ in range(repeat):
        one.fleet.length[:] = 0
        quotes.settle_all(*rest)
        total += cpu_seconds(lambda: auction(one))
    return total / repeat


def timed(size: tuple[int, int], policy: int, auction: Auction, repeat: int) -> Sample:
    """A sampler in milliseconds."""
    one = market(*size, policy)
    return lambda: 1e3 * seconds_of(one, auction, repeat)


def measurements() -> list[Measurement]:
    """Auctions with and without charging, their growth, the optimum and others, charging plans."""
    found = []
    small, large = (
        f"auction, {robots} robots, {tasks:,} tasks" for robots, tasks in (SMALL, LARGE)
    )
    for name, size, repeat in ((small, SMALL, 20), (large, LARGE, 1)):
        for label, policy in (
            ("", POLICY_NO_CHARGING),
            (", charging in the bids", POLICY_HIERARCHICAL),
        ):
            found.append(Measurement(name + label, MS, partial(timed, size, policy, sell, repeat)))
    for label, policy in (
        ("joint charging", POLICY_JOINT),
        ("fill-up", POLICY_FILL_UP),
        ("threshold", POLICY_THRESHOLD_REACHABLE),
    ):
        found.append(Measurement(f"{small}, {label}", MS, partial(timed, SMALL, policy, sell, 20)))
    prepare = partial(timed, LARGE, POLICY_NO_CHARGING, partial(sell, winner=WINNER_DIFFERENCE), 1)
    found.append(Measurement(f"{large}, biggest difference", MS, prepare))
    found.append(Measurement(f"{small}, then local search", MS, prepare_search))
    return found + growth() + others() + plans()


def prepare_search() -> Sample:
    """Milliseconds of an auction and the search after it."""

    def work(one: Market) -> None:
        sell(one)
        local_search.improve(one.task_costs, one.battery, one.fleet, one.scratch, 0)

    return timed(SMALL, POLICY_NO_CHARGING, work, 1)


def growth() -> list[Measurement]:
    """Exponents of time in the tasks (80 to 320, 8 robots) and in the robots (8 to 32, 320 tasks)."""
    ways: dict[str, Auction] = {
        "only the winner bids again": sell,
        "everybody bids again": partial(sell, everybody=1),
        "by arrival": sell_by_arrival,
    }
    found = []
    for name, auction in ways.items():
        for what, sizes in (("tasks", ((8, 80), (8, 320))), ("robots", ((8, 320), (32, 320)))):
            prepare = partial(prepare_growth, sizes, auction)
            found.append(Measurement(f"growth with the {what}, {name}", EXPONENT, prepare))
    return found


def prepare_growth(sizes: tuple[tuple[int, int], tuple[int, int]], auction: Auction) -> Sample:
    """A sampler of the slope between two sizes that differ by a factor of four."""
    few, many = (market(*size) for size in sizes)

    def sample() -> float:
        return slope((1, 4), (seconds_of(few, auction, 12), seconds_of(many, auction, 3)))

    return sample


def others() -> list[Measurement]:
    """The optimum and the genetic algorithm, for ten tasks."""
    return [
        Measurement("optimum, 3 robots, 10 tasks", MS, partial(prepare_optimum, 3)),
        Measurement("optimum, 2 robots, 10 tasks", MS, partial(prepare_optimum, 2)),
        Measurement("genetic algorithm, 2 robots, 10 tasks", MS, prepare_genetic),
        Measurement(
            "auction, 2 robots, 10 tasks",
            MS,
            partial(timed, (2, 10), POLICY_NO_CHARGING, sell, 200),
        ),
    ]


def prepare_optimum(robots: int) -> Sample:
    """Milliseconds of the optimum of ten tasks."""
    workspace = bundles_for(robots, 10)

    def work(one: Market) -> None:
        *rest, items = one
        exact.exact(*rest, workspace, items, len(items), 0)

    return timed((robots, 10), POLICY_NO_CHARGING, work, 5)


def prepare_genetic() -> Sample:
    """Milliseconds of the paper's genetic algorithm: 1,000 generations of 20."""
    population = population_for(2, 10, 10)

    def work(one: Market) -> None:
        *rest, items = one
        arguments = (items, 10, 0, generations(2, 10), 0, np.uint64(1), 0)
        genetic_auction.genetic(*rest, population, *arguments)

    return timed((2, 10), POLICY_NO_CHARGING, work, 1)


def plans() -> list[Measurement]:
    """Microseconds of a quote for one list of ten tasks, a call from Python included."""
    kinds = (
        ("as much as needed", POLICY_HIERARCHICAL),
        ("fill-up", POLICY_FILL_UP),
        ("threshold", POLICY_THRESHOLD_REACHABLE),
    )
    return [
        Measurement(f"charging of a list of 10, {name}", US, partial(prepare_plan, policy))
        for name, policy in kinds
    ]


def prepare_plan(policy: int, calls: int = 200) -> Sample:
    """A sampler: the same list, quoted again and again."""
    one = market(1, 10, policy)
    order = np.arange(10, dtype=np.int32)

    def quote_often() -> None:
        for _ in range(calls):
            quotes.quote(one.task_costs, one.battery, one.scratch, 0, 0, BATTERY_FULL, order, 10)

    return lambda: 1e6 * cpu_seconds(quote_often) / calls
