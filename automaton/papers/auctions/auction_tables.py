"""The tables of the reproduction: what is run for each case, and which figures it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from automaton.papers.auctions.auction_charging import (
    POLICIES,
    charging_costs,
    rolling,
    whole_objective,
)
from automaton.papers.auctions.auction_example import SETTINGS, bids_for
from automaton.papers.auctions.auction_trials import (
    AGAIN,
    METHODS,
    MOST_TASKS,
    OPTIMUM,
    ratio,
    sequences,
    solve,
)
from automaton.papers.reproduction_study import Case, Key, Label, Runner, Table
from automaton.runs.process_pool import OnDone
from strategies.allocation.auction.market import BATTERY_FULL

Figures = Mapping[str, float]
COMPARED: Final = tuple(method for method in METHODS if method not in (OPTIMUM, AGAIN))
POOLED: Final = tuple(range(2, MOST_TASKS + 1))
ROLLING: Final = ("r0", "r0 reach", "thr0 safe", "thr20 safe", "fill-up", "fill to 80")


@dataclass(frozen=True)
class Once:
    """One repetition of a case."""

    metrics: Figures
    finished: bool = True


def runner(of: Callable[[Mapping[str, Label], int], Sequence[Figures]]) -> Runner:
    """Run a table whose cases give some repetitions for each seed."""

    def run(
        cases: Sequence[Case],
        seeds: Sequence[int],
        workers: int | None = None,
        on_done: OnDone | None = None,
    ) -> list[list[Once]]:
        found: list[list[Once]] = [[] for _ in cases]
        for seed in seeds:
            for case, batch in zip(cases, found, strict=True):
                done = [Once(figures) for figures in of(case.labels, seed)]
                batch += done
                if on_done is not None:
                    on_done(len(done))
        return found

    return run


def nothing_printed(key: Key, metric: str) -> float | None:
    """The figures of the paper hold curves, no numbers."""
    return None


def cases(labels: Sequence[Mapping[str, Label]]) -> Callable[[Sequence[str]], Sequence[Case]]:
    """The same cases whatever the strategies."""
    return lambda strategies: [Case(one) for one in labels]


PRINTED: Final[Mapping[Key, Figures]] = {
    ("as printed", 1): {
        "c1": 70,
        "c2": 180,
        "MiniSum": 110,
        "bid": 145,
        "charging": 0,
        "end %": 10,
    },
    ("as printed", 2): {"c1": 70, "c2": 189, "MiniSum": 119, "bid": 154, "charging": 9, "end %": 0},
    ("charging ignored", 2): {"c2": 100, "end %": -5},
}


def example_figures(labels: Mapping[str, Label], seed: int) -> list[Figures]:
    """The bids of section 4; nothing about it is random."""
    one = bids_for(str(labels["setting"]))[int(labels["robot"]) - 1]
    found: dict[str, float] = {} if one.before is None else {"c1": one.before}
    if one.cost is not None and one.added is not None and one.mixed is not None:
        found |= {"c2": one.cost, "MiniSum": one.added, "bid": one.mixed}
        found |= {"charging": one.charging, "end %": 100 * one.end / BATTERY_FULL}
    return [found]


EXAMPLE: Final = Table(
    title="Section 4: the worked example (s; no bid where there is no feasible plan)",
    cases=cases([{"setting": name, "robot": robot} for name in SETTINGS for robot in (1, 2)]),
    panels=(("c1", "c2", "MiniSum", "bid"), ("charging", "end %")),
    published=lambda key, metric: PRINTED.get(key, {}).get(metric),
    run=runner(example_figures),
    repetition="example",
    grouped=1,
)


def ratios(labels: Mapping[str, Label], seed: int) -> list[Figures]:
    """A repetition for each number of tasks."""
    lanes, robots = str(labels["floor"]), int(labels["robots"])
    return [{method: ratio(lanes, robots, n, seed, method) for method in COMPARED} for n in POOLED]


FLOORS: Final = (("full", 6), ("comb", 4))  # and the most robots there

RATIOS: Final = Table(
    title="Section 5.1: makespan as a multiple of the optimum, 2 to 10 tasks pooled",
    cases=cases(
        [{"floor": floor, "robots": m} for floor, most in FLOORS for m in range(1, most + 1)]
    ),
    panels=(COMPARED,),
    published=nothing_printed,
    run=runner(ratios),
    repetition="task set",
    per_seed=len(POOLED),
    digits=3,
    grouped=1,
    spread="se",
)


def epsilon_table(name: str, epsilon: int, tasks: Sequence[int]) -> Table:
    """Ratios of the objective that mixes the sum into it."""
    compared = ("LB", "BD", "regret", "GA")

    def of(labels: Mapping[str, Label], seed: int) -> list[Figures]:
        robots = int(labels["robots"])
        return [
            {method: ratio("full", robots, n, seed, method, epsilon) for method in compared}
            for n in tasks
        ]

    return Table(
        title=f"Section 5.1 with {name}: objective as a multiple of the optimum",
        cases=cases([{"objective": name, "robots": m} for m in (2, 3)]),
        panels=(compared,),
        published=nothing_printed,
        run=runner(of),
        repetition="task set",
        per_seed=len(tasks),
        digits=3,
        spread="se",
    )


def makespans(labels: Mapping[str, Label], seed: int) -> list[Figures]:
    """Seconds until all tasks are done."""
    robots, n = int(labels["robots"]), int(labels["tasks"])
    shown = (OPTIMUM, "LB", "LB+search", "GA", "GA each gene")
    return [{method: solve("full", robots, n, seed, method, 0).objective for method in shown}]


MAKESPANS: Final = Table(
    title="Figure 4: makespan in seconds by the number of tasks",
    cases=cases([{"robots": m, "tasks": n} for m in range(1, 7) for n in range(1, 11)]),
    panels=((OPTIMUM, "LB", "LB+search", "GA", "GA each gene"),),
    published=nothing_printed,
    run=runner(makespans),
    repetition="task set",
    digits=1,
    grouped=1,
    spread="se",
)


def efforts(labels: Mapping[str, Label], seed: int) -> list[Figures]:
    """What is computed for two robots: bids, and places in lists that are tried."""
    n = int(labels["tasks"])
    by = {method: solve("full", 2, n, seed, method, 0) for method in ("LB", "arrival", "GA")}
    return [
        {
            "LB bids": by["LB"].bids,
            "LB places": by["LB"].positions,
            "arrival places": by["arrival"].positions,
            "GA places": by["GA"].positions,
            "allotments": 2**n,
            "sequences": sequences(2, n),
        }
    ]


EFFORTS: Final = Table(
    title="Figure 5: work for two robots, counted (times: `automaton bench --only auctions`)",
    cases=cases([{"tasks": n} for n in range(1, 11)]),
    panels=(
        ("LB bids", "LB places", "arrival places"),
        ("GA places", "allotments", "sequences"),
    ),
    published=nothing_printed,
    run=runner(efforts),
    repetition="task set",
)


def efforts_by_robots(labels: Mapping[str, Label], seed: int) -> list[Figures]:
    """What is computed for ten tasks: if only the winner bids again after a sale, or everybody does."""
    robots = int(labels["robots"])
    by = {
        name: solve("full", robots, MOST_TASKS, seed, method, 0)
        for name, method in (("LB", "LB"), ("all", AGAIN))
    }
    return [
        {f"{name} bids": one.bids for name, one in by.items()}
        | {f"{name} places": one.positions for name, one in by.items()}
    ]


EFFORTS_BY_ROBOTS: Final = Table(
    title="Work for ten tasks by the number of robots, counted (all: everybody bids again after a sale)",
    cases=cases([{"tasks": "ten", "robots": m} for m in range(1, 7)]),
    panels=(("LB bids", "LB places", "all bids", "all places"),),
    published=nothing_printed,
    run=runner(efforts_by_robots),
    repetition="task set",
)

TOURS: Final = 10  # of a seed
CHARGERS: Final = (("2", 1), ("1,2,3", 8))  # and the fewest tasks of a tour


def charging(labels: Mapping[str, Label], seed: int) -> list[Figures]:
    """Tours of one robot by four rules of charging."""
    chargers = tuple(int(charger) for charger in str(labels["chargers"]).split(","))
    n = int(labels["tasks"])
    return [charging_costs(seed, n, number, chargers) for number in range(TOURS)]


CHARGING: Final = Table(
    title="Section 5.2: seconds spent on charging by one robot (gross: to the charger, charging, on; "
    "net: less the leg that this replaces)",
    cases=cases([{"chargers": at, "tasks": n} for at, few in CHARGERS for n in range(few, 11)]),
    panels=(
        ("tour", "gross r0", "gross r20", "gross look", "gross safe"),
        ("net r0", "net r20", "net look", "net safe"),
        ("charges r0", "charges r20", "empty look", "end r20", "end look", "end safe"),
        ("gross worse", "time worse", "time worse, floor kept"),
    ),
    published=nothing_printed,
    run=runner(charging),
    repetition="tour",
    per_seed=TOURS,
    shares=(
        *("charges r0", "charges r20", "empty look", "end r20", "end look", "end safe"),
        *("gross worse", "time worse", "time worse, floor kept"),
    ),
    grouped=1,
    spread="se",
)

OBJECTIVE: Final = Table(
    title="Figure 6a: seconds with charging in the bids, or by threshold after the genetic tour",
    cases=cases([{"robots with a battery": "one", "tasks": n} for n in (6, 8, 10)]),
    panels=(("SSI r0", "SSI r20", "GA look", "GA safe"),),
    published=nothing_printed,
    run=runner(
        lambda labels, seed: [
            whole_objective(seed, int(labels["tasks"]), number) for number in range(TOURS)
        ]
    ),
    repetition="tour",
    per_seed=TOURS,
    spread="se",
)


def horizon(labels: Mapping[str, Label], seed: int) -> list[Figures]:
    """Batches back to back, by each policy."""
    size, taper = int(labels["batch"]), labels["curve"] == "taper"
    found: dict[str, float] = {}
    for name in ROLLING:
        found[name], found[f"stuck {name}"] = rolling(seed, size, name, taper)
    return [found]


HORIZON: Final = Table(
    title="Beyond the paper: batch after batch, one robot, seconds per task (200 batches a run; "
    "stuck: share of batches without a plan)",
    cases=cases(
        [{"curve": curve, "batch": size} for curve in ("linear", "taper") for size in (2, 4, 8)]
    ),
    panels=(ROLLING, ("stuck r0", "stuck r0 reach", "stuck thr20 safe", "stuck fill-up")),
    published=nothing_printed,
    run=runner(horizon),
    repetition="run",
    shares=tuple(f"stuck {name}" for name in POLICIES),
    digits=1,
    grouped=1,
    spread="se",
)

TABLES: Final = (
    EXAMPLE,
    RATIOS,
    epsilon_table("epsilon 1", 1000, (4, 6, 8, 10)),
    epsilon_table("epsilon 0.5", 500, (4, 6, 7)),
    MAKESPANS,
    EFFORTS,
    EFFORTS_BY_ROBOTS,
    CHARGING,
    OBJECTIVE,
    HORIZON,
)
