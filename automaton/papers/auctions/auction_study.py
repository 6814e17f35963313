"""De Ryck et al., sections 4 and 5: sequential auctions with the cost of charging in the bids.

M. De Ryck, D. Pissoort, T. Holvoet, E. Demeester: Decentral task allocation for industrial
AGV-systems with resource constraints. Its figures hold curves, no numbers: only the worked example
stands beside printed ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from automaton.engine.robot_states import BATTERY_FULL
from automaton.papers.auctions.auction_charging import (
    POLICIES,
    charging_costs,
    rolling,
    whole_objective,
)
from automaton.papers.auctions.auction_claims import CLAIMS, REMARKS
from automaton.papers.auctions.auction_example import SETTINGS, bids_for, steps
from automaton.papers.auctions.auction_pictures import pictures
from automaton.papers.auctions.auction_times import TIME_TABLES, about_times
from automaton.papers.auctions.auction_trials import (
    AGAIN,
    METHODS,
    MOST_TASKS,
    OPTIMUM,
    ratio,
    sequences,
    solve,
)
from automaton.papers.reproduction_study import (
    Case,
    Cases,
    Headline,
    Key,
    Reproduction,
    Table,
    crossed,
    each_seed,
    fixed,
)

Figures = Mapping[str, float]
COMPARED: Final = tuple(method for method in METHODS if method not in (OPTIMUM, AGAIN))
POOLED: Final = tuple(range(2, MOST_TASKS + 1))
FLOORS: Final = (("full", 6), ("comb", 4))  # and the most robots there
SHOWN: Final = (OPTIMUM, "LB", "LB+search", "GA", "GA each gene")
TOURS: Final = 10  # of a seed
CHARGERS: Final = (("2", 1), ("1,2,3", 8))  # and the fewest tasks of a tour
CHARGING_SHARES: Final = (
    ("charges r0", "charges r20", "empty look", "end r20", "end look", "end safe"),
    ("gross worse", "time worse", "time worse, floor kept"),
)
ROLLING: Final = ("r0", "r0 reach", "thr0 safe", "thr20 safe", "fill-up", "fill to 80")

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


def example_figures(case: Case, seed: int) -> list[Figures]:
    """The bids of section 4; nothing about it is random."""
    one = bids_for(str(case.labels["setting"]))[int(case.labels["robot"]) - 1]
    found: dict[str, float] = {} if one.before is None else {"c1": one.before}
    if one.cost is not None and one.added is not None and one.mixed is not None:
        found |= {"c2": one.cost, "MiniSum": one.added, "bid": one.mixed}
        found |= {"charging": one.charging, "end %": 100 * one.end / BATTERY_FULL}
    return [found]


def ratio_table(
    title: str, cases: Cases, methods: tuple[str, ...], tasks: Sequence[int], epsilon: int = 0
) -> Table:
    """Objectives as multiples of the optimum; a seed has a task set for each number of tasks."""

    def of(case: Case, seed: int) -> list[Figures]:
        lanes, robots = str(case.labels.get("floor", "full")), int(case.labels["robots"])
        return [
            {method: ratio(lanes, robots, n, seed, method, epsilon) for method in methods}
            for n in tasks
        ]

    return Table(
        title=title,
        cases=cases,
        panels=(methods,),
        run=each_seed(of),
        repetition="task set",
        per_seed=len(tasks),
        digits=3,
        spread="se",
    )


def epsilon_table(name: str, epsilon: int, tasks: Sequence[int]) -> Table:
    """Ratios of the objective that mixes the sum into it."""
    title = f"Section 5.1 with {name}: objective as a multiple of the optimum"
    cases = crossed(objective=(name,), robots=(2, 3))
    return ratio_table(title, cases, ("LB", "BD", "regret", "GA"), tasks, epsilon)


def makespans(case: Case, seed: int) -> list[Figures]:
    """Seconds until all tasks are done."""
    robots, n = int(case.labels["robots"]), int(case.labels["tasks"])
    return [{method: solve("full", robots, n, seed, method, 0).objective for method in SHOWN}]


def efforts(case: Case, seed: int) -> list[Figures]:
    """What is computed for two robots: bids, and places in lists that are tried."""
    n = int(case.labels["tasks"])
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


def efforts_by_robots(case: Case, seed: int) -> list[Figures]:
    """What is computed for ten tasks: if only the winner bids again after a sale, or everybody does."""
    robots = int(case.labels["robots"])
    by = {
        name: solve("full", robots, MOST_TASKS, seed, method, 0)
        for name, method in (("LB", "LB"), ("all", AGAIN))
    }
    return [
        {f"{name} bids": one.bids for name, one in by.items()}
        | {f"{name} places": one.positions for name, one in by.items()}
    ]


def charging(case: Case, seed: int) -> list[Figures]:
    """Tours of one robot by four rules of charging."""
    chargers = tuple(int(charger) for charger in str(case.labels["chargers"]).split(","))
    n = int(case.labels["tasks"])
    return [charging_costs(seed, n, number, chargers) for number in range(TOURS)]


def objectives(case: Case, seed: int) -> list[Figures]:
    """Tours of one robot, charging in the bids or by threshold."""
    n = int(case.labels["tasks"])
    return [whole_objective(seed, n, number) for number in range(TOURS)]


def horizon(case: Case, seed: int) -> list[Figures]:
    """Batches back to back, by each policy."""
    size, taper = int(case.labels["batch"]), case.labels["curve"] == "taper"
    found: dict[str, float] = {}
    for name in ROLLING:
        found[name], found[f"stuck {name}"] = rolling(seed, size, name, taper)
    return [found]


EXAMPLE: Final = Table(
    title="Section 4: the worked example (s; no bid where there is no feasible plan)",
    cases=crossed(setting=SETTINGS, robot=(1, 2)),
    panels=(("c1", "c2", "MiniSum", "bid"), ("charging", "end %")),
    published=lambda key, metric: PRINTED.get(key, {}).get(metric),
    run=each_seed(example_figures),
    repetition="example",
    grouped=1,
)
RATIOS: Final = ratio_table(
    "Section 5.1: makespan as a multiple of the optimum, 2 to 10 tasks pooled",
    fixed([{"floor": floor, "robots": m} for floor, most in FLOORS for m in range(1, most + 1)]),
    COMPARED,
    POOLED,
)
MAKESPANS: Final = Table(
    title="Figure 4: makespan in seconds by the number of tasks",
    cases=crossed(robots=range(1, 7), tasks=range(1, 11)),
    panels=(SHOWN,),
    run=each_seed(makespans),
    repetition="task set",
    digits=1,
    grouped=1,
    spread="se",
)
EFFORTS: Final = Table(
    title="Figure 5: work for two robots, counted (times: `automaton bench --only auctions`)",
    cases=crossed(tasks=range(1, 11)),
    panels=(
        ("LB bids", "LB places", "arrival places"),
        ("GA places", "allotments", "sequences"),
    ),
    run=each_seed(efforts),
    repetition="task set",
)
EFFORTS_BY_ROBOTS: Final = Table(
    title="Work for ten tasks by the number of robots, counted (all: everybody bids again after a sale)",
    cases=crossed(tasks=("ten",), robots=range(1, 7)),
    panels=(("LB bids", "LB places", "all bids", "all places"),),
    run=each_seed(efforts_by_robots),
    repetition="task set",
)
CHARGING: Final = Table(
    title="Section 5.2: seconds spent on charging by one robot (gross: to the charger, charging, on; "
    "net: less the leg that this replaces)",
    cases=fixed([{"chargers": at, "tasks": n} for at, few in CHARGERS for n in range(few, 11)]),
    panels=(
        ("tour", "gross r0", "gross r20", "gross look", "gross safe"),
        ("net r0", "net r20", "net look", "net safe"),
        *CHARGING_SHARES,
    ),
    run=each_seed(charging),
    repetition="tour",
    per_seed=TOURS,
    shares=tuple(share for panel in CHARGING_SHARES for share in panel),
    grouped=1,
    spread="se",
)
OBJECTIVE: Final = Table(
    title="Figure 6a: seconds with charging in the bids, or by threshold after the genetic tour",
    cases=crossed(**{"robots with a battery": ("one",), "tasks": (6, 8, 10)}),
    panels=(("SSI r0", "SSI r20", "GA look", "GA safe"),),
    run=each_seed(objectives),
    repetition="tour",
    per_seed=TOURS,
    spread="se",
)
HORIZON: Final = Table(
    title="Beyond the paper: batch after batch, one robot, seconds per task (200 batches a run; "
    "stuck: share of batches without a plan)",
    cases=crossed(curve=("linear", "taper"), batch=(2, 4, 8)),
    panels=(ROLLING, ("stuck r0", "stuck r0 reach", "stuck thr20 safe", "stuck fill-up")),
    run=each_seed(horizon),
    shares=tuple(f"stuck {name}" for name in POLICIES),
    digits=1,
    grouped=1,
    spread="se",
)


AUCTION_HEADLINES: Final = (
    Headline("example: bid of robot 1, s", cell=("bid", ("as printed", 1))),
    Headline("example: bid of robot 2, s", cell=("bid", ("as printed", 2))),
    Headline(
        "2 robots: GA less auction",
        "The auction lies between the optimum and the genetic algorithm (2",
    ),
    Headline("work with tasks: exponent", "The auction's work grows linearly with the tasks"),
    Headline("work: GA for one of auction", "The auction needs far less work"),
    Headline(
        "Figure 5: time, m^n / auction", "Figure 5: the auction takes far less computing time (m^n"
    ),
    Headline(
        "Figure 5: time, GA / auction", "Figure 5: the auction takes far less computing time (gen"
    ),
    Headline("Figure 6b: charging saved", "Charging just as much as needed costs less"),
    Headline("... dearer in tours of 10", "... always, in every single tour"),
    Headline("Figure 6c: us beyond threshold", "Figure 6c: optimal charging"),
    Headline(
        "batches of 2: s saved a task",
        "Just enough beats threshold-100 at equal safety, batch after batch "
        "(linear curve, batches of 2)",
    ),
)


def texts() -> list[tuple[str, str]]:
    """The worked example step by step, and the assigned routes."""
    return [("Section 4, step by step", "\n".join(steps())), *pictures()]


REPRODUCTION: Final = Reproduction(
    name="auctions",
    title="Sequential auctions of tasks, with charging in the bids",
    source="De Ryck, Pissoort, Holvoet & Demeester, Decentral task allocation for industrial "
    "AGV-systems with resource constraints",
    tables=(
        EXAMPLE,
        RATIOS,
        epsilon_table("epsilon 1", 1000, (4, 6, 8, 10)),
        epsilon_table("epsilon 0.5", 500, (4, 6, 7)),
        MAKESPANS,
        EFFORTS,
        EFFORTS_BY_ROBOTS,
        *TIME_TABLES,
        CHARGING,
        OBJECTIVE,
        HORIZON,
    ),
    claims=(*CLAIMS, *about_times()),
    remarks=REMARKS,
    headlines=AUCTION_HEADLINES,
    seeds=20,
    claims_title="Paper's claims",
    texts=texts,
)
