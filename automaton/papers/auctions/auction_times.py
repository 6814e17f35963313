"""Figures 5 and 6c of De Ryck et al.: computing time, measured on this machine.

The printed curves are lost and the text gives no seconds, so none stand beside ours. What the text says
of the curves is judged. Times are CPU times of this process: they differ from machine to machine and
from run to run, and nothing else of the reproduction does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Final

import numpy as np

from automaton.engine.robot_states import BATTERY_FULL
from automaton.papers.auctions.auction_charging import (
    DRAIN,
    battery,
    single_scratch,
    start_of,
    tour,
)
from automaton.papers.auctions.auction_floor import NO_BATTERY, empty, seconds, work_of
from automaton.papers.auctions.auction_trials import METHODS, OPTIMUM, instance, task_set
from automaton.papers.claims import Claim, Figure, Quantity, above, claim, exponent, mean_of
from automaton.papers.reproduction_study import Case, Table, crossed, each_seed
from strategies.allocation.auction import quotes

FIGURE_5: Final = "Figure 5"
FIGURE_6C: Final = "Figure 6c"
SOLVERS: Final = {
    "optimum ms": OPTIMUM,
    "m^n ms": "m^n",
    "GA ms": "GA",
    "auction ms": "LB",
}
CHARGERS: Final = (1, 2, 3)
RULES: Final = {"as needed us": "r20", "threshold us": "look"}
QUOTES: Final = 100  # of a quote, which takes microseconds
TIMED_TRIES: Final = 3  # the shortest counts: other processes only add
PRINTED_SEEDS: Final = 5  # as many as in print


def cpu_seconds(work: Callable[[], object]) -> float:
    """The least CPU time of some tries."""
    spent = []
    for _ in range(TIMED_TRIES):
        begun = time.process_time_ns()
        work()
        spent.append(time.process_time_ns() - begun)
    return min(spent) * 1e-9


def solving_times(case: Case, seed: int) -> list[Mapping[str, float]]:
    """Milliseconds of each method for two robots and the task set of a seed."""
    n = int(case.labels["tasks"])
    figures = {}
    for name, method in SOLVERS.items():
        one = instance("full", 2, n, seed)

        def solve(one: object = one, method: str = method) -> None:
            empty(*one.market)  # type: ignore[attr-defined]
            METHODS[method](one)  # type: ignore[arg-type]

        solve()  # compiled, and in the cache
        figures[name] = 1e3 * cpu_seconds(solve)
    return [figures]


def charging_times(case: Case, seed: int) -> list[Mapping[str, float]]:
    """Microseconds of the charging plan of one tour by two rules, and of the tour without a battery."""
    n = int(case.labels["tasks"])
    start = start_of(seed, n, 0)
    stations = tour(task_set(seed, n), start)
    task_costs, order = work_of(stations, seconds(), DRAIN), np.arange(n, dtype=np.int32)
    rules = {name: battery(rule, CHARGERS) for name, rule in RULES.items()}
    figures = {}
    for name, rule in (rules | {"no battery us": NO_BATTERY["full"]}).items():
        scratch = single_scratch(n, max(1, len(rule.charger)))

        def quote(rule: object = rule, scratch: object = scratch) -> None:
            for _ in range(QUOTES):
                quotes.quote(task_costs, rule, scratch, start - 1, 0, BATTERY_FULL, order, n)

        quote()
        figures[name] = 1e6 * cpu_seconds(quote) / QUOTES
    return [figures]


TIME_TABLES: Final = (
    Table(
        title="Figure 5: milliseconds for two robots, on this machine (optimum: an exact search; m^n: "
        "all allotments; no printed seconds are left)",
        cases=crossed(computing=(FIGURE_5,), tasks=range(1, 11)),
        panels=(tuple(SOLVERS),),
        run=each_seed(solving_times),
        repetition="task set",
        digits=3,
        seeds=PRINTED_SEEDS,
    ),
    Table(
        title="Figure 6c: microseconds of one robot's charging plan, on this machine, chargers 1, 2, 3 "
        "(a call from Python included; no printed seconds are left)",
        cases=crossed(computing=(FIGURE_6C,), tasks=range(1, 11)),
        panels=((*RULES, "no battery us"),),
        run=each_seed(charging_times),
        repetition="tour",
        digits=1,
        seeds=PRINTED_SEEDS,
    ),
)


def spent(name: str, tasks: int, computing: str = FIGURE_5) -> Quantity:
    """The mean time of a method for so many tasks."""
    return mean_of(name, computing, tasks)


def about_times() -> Iterator[Claim]:
    """What the text says of the curves of Figures 5 and 6c."""
    for name in ("optimum ms", "m^n ms"):
        yield claim(
            f"Figure 5: the computing time of the optimum grows exponentially ({name[:-3]})",
            Figure(
                "time of 10 tasks for one of 8",
                spent(name, 10) / spent(name, 8),
                at_least=4,
                digits=1,
                why="doubled by each task",
            ),
        )
    for name, other in (
        ("optimum", "optimum ms"),
        ("m^n", "m^n ms"),
        ("genetic algorithm", "GA ms"),
    ):
        yield claim(
            f"Figure 5: the auction takes far less computing time ({name}, 10 tasks)",
            Figure(
                "times that of the auction",
                spent(other, 10) / spent("auction ms", 10),
                at_least=10,
                why="`far less`, read as a tenth",
            ),
        )
    yield claim(
        "Figure 5: the auction scales more linearly with the tasks than the genetic algorithm",
        above(
            "exponent of the genetic algorithm less that of the auction, 5 to 10 tasks",
            exponent(spent("GA ms", 10), spent("GA ms", 5), 10, 5)
            - exponent(spent("auction ms", 10), spent("auction ms", 5), 10, 5),
            digits=2,
        ),
    )
    yield claim(
        "Figure 6c: optimal charging takes more computing time than the threshold (10 tasks)",
        above(
            "microseconds more",
            spent("as needed us", 10, FIGURE_6C) - spent("threshold us", 10, FIGURE_6C),
            digits=1,
        ),
        source="We see that our optimal approach needs more computation time due to the optimization "
        "processes",
    )
