"""Auctions on random points in the plane (Manhattan distances), and reference methods.

With charging, robots begin half charged and a list of four or five tasks empties a battery, so many
bids need a charging plan. Exponents are slopes of log time between two sizes.
"""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from automaton.bench.measurement import EXPONENT, MS, US, Measurement, Sample, cpu_seconds, slope
from automaton.engine.state import BATTERY_FULL
from automaton.papers.auction_trials import AGAIN, METHODS, Instance, Method, empty
from strategies.allocation.auction import bundles, metaheuristics, quotes
from strategies.allocation.auction.bundles import bundles_for
from strategies.allocation.auction.market import (
    POLICY_FILL_UP,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_NO_CHARGING,
    POLICY_THRESHOLD_REACHABLE,
    battery_of,
    fleet_of,
    scratch_for,
    visits,
)
from strategies.allocation.auction.metaheuristics import generations, population_for

PLANE_SIDE: Final = 100  # ticks
PLANE_CHARGERS: Final = 4
PLANE_DRAIN: Final = BATTERY_FULL // 250  # units per tick: a full battery lasts 250 ticks
PLANE_RATE: Final = BATTERY_FULL // 50
SMALL_AUCTION: Final = (8, 80)  # robots, tasks
LARGE_AUCTION: Final = (100, 1000)
SELL: Final = METHODS["LB"]  # a sequential auction of all items


def market(robots: int, tasks: int, policy: int = POLICY_NO_CHARGING, seed: int = 1) -> Instance:
    """Robots, tasks and chargers at random places."""
    rng = np.random.default_rng(seed)
    at = rng.integers(0, PLANE_SIDE, (robots + tasks + PLANE_CHARGERS, 2))
    ticks = np.abs(at[:, None] - at[None]).sum(2)
    chargers = np.arange(robots + tasks, len(at))
    rules = {
        "policy": policy,
        "end_reach": policy != POLICY_NO_CHARGING,
        "threshold": BATTERY_FULL // 5,
    }
    battery = battery_of(ticks * PLANE_DRAIN, chargers, ((0, PLANE_RATE),), **rules)  # type: ignore[arg-type]
    fleet = fleet_of(np.arange(robots), tasks, BATTERY_FULL // 2)
    scratch = scratch_for(robots, tasks, tasks, PLANE_CHARGERS)
    task_costs = visits(ticks, ticks * PLANE_DRAIN, np.arange(robots, robots + tasks))
    items = np.arange(tasks, dtype=np.int32)
    return Instance(task_costs, battery, fleet, scratch, items, epsilon=0, seed=seed)


def seconds_of(one: Instance, method: Method, repeat: int) -> float:
    """CPU seconds of an auction from empty lists."""
    total = 0.0
    for _ in range(repeat):
        empty(*one.market)
        total += cpu_seconds(lambda: method(one))
    return total / repeat


def timed(size: tuple[int, int], policy: int, method: Method, repeat: int) -> Sample:
    """A sampler in milliseconds."""
    one = market(*size, policy)
    return lambda: 1e3 * seconds_of(one, method, repeat)


def measurements() -> list[Measurement]:
    """Auctions with and without charging, their growth, reference methods, charging plans."""
    found = []
    small, large = (
        f"auction, {robots} robots, {tasks:,} tasks"
        for robots, tasks in (SMALL_AUCTION, LARGE_AUCTION)
    )
    for name, size, repeat in ((small, SMALL_AUCTION, 20), (large, LARGE_AUCTION, 1)):
        for label, policy in (
            ("", POLICY_NO_CHARGING),
            (", charging in the bids", POLICY_HIERARCHICAL),
        ):
            found.append(Measurement(name + label, MS, partial(timed, size, policy, SELL, repeat)))
    for label, policy in (
        ("joint charging", POLICY_JOINT),
        ("fill-up", POLICY_FILL_UP),
        ("threshold", POLICY_THRESHOLD_REACHABLE),
    ):
        found.append(
            Measurement(f"{small}, {label}", MS, partial(timed, SMALL_AUCTION, policy, SELL, 20))
        )
    prepare = partial(timed, LARGE_AUCTION, POLICY_NO_CHARGING, METHODS["BD"], 1)
    found.append(Measurement(f"{large}, biggest difference", MS, prepare))
    prepare = partial(timed, SMALL_AUCTION, POLICY_NO_CHARGING, METHODS["LB+search"], 1)
    found.append(Measurement(f"{small}, then local search", MS, prepare))
    return found + growth() + others() + plans()


def growth() -> list[Measurement]:
    """Exponents of time by tasks (80 to 320, 8 robots) and by robots (8 to 32, 320 tasks)."""
    ways = {
        "only the winner bids again": SELL,
        "everybody bids again": METHODS[AGAIN],
        "by arrival": METHODS["arrival"],
    }
    found = []
    for name, method in ways.items():
        for what, sizes in (("tasks", ((8, 80), (8, 320))), ("robots", ((8, 320), (32, 320)))):
            prepare = partial(prepare_growth, sizes, method)
            found.append(Measurement(f"growth with the {what}, {name}", EXPONENT, prepare))
    return found


def prepare_growth(sizes: tuple[tuple[int, int], tuple[int, int]], method: Method) -> Sample:
    """A sampler of the slope between two sizes that differ by a factor of four."""
    few, many = (market(*size) for size in sizes)

    def sample() -> float:
        return slope((1, 4), (seconds_of(few, method, 12), seconds_of(many, method, 3)))

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
            partial(timed, (2, 10), POLICY_NO_CHARGING, SELL, 200),
        ),
    ]


def prepare_optimum(robots: int) -> Sample:
    """A sampler: milliseconds to find the optimum for ten tasks."""
    workspace = bundles_for(robots, 10)

    def work(one: Instance) -> None:
        bundles.exact(*one.market, workspace, one.items, one.tasks, one.epsilon)

    return timed((robots, 10), POLICY_NO_CHARGING, work, 5)


def prepare_genetic() -> Sample:
    """A sampler: milliseconds of the paper's genetic algorithm, 1,000 generations of 20."""
    population = population_for(2, 10, 10)

    def work(one: Instance) -> None:
        arguments = (one.items, 10, 0, generations(2, 10), 0, np.uint64(1), 0)
        metaheuristics.genetic(*one.market, population, *arguments)

    return timed((2, 10), POLICY_NO_CHARGING, work, 1)


def plans() -> list[Measurement]:
    """Microseconds of a quote for one list of ten tasks, including a call from Python."""
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
    """A sampler: repeated quotes for the same list."""
    one = market(1, 10, policy)
    order = np.arange(10, dtype=np.int32)

    def quote_often() -> None:
        for _ in range(calls):
            quotes.quote(one.task_costs, one.battery, one.scratch, 0, 0, BATTERY_FULL, order, 10)

    return lambda: 1e6 * cpu_seconds(quote_often) / calls
