"""De Ryck et al., sections 4 and 5: sequential auctions with the cost of charging in the bids.

M. De Ryck, D. Pissoort, T. Holvoet, E. Demeester: Decentral task allocation for industrial AGV-systems
with resource constraints. Its figures show curves without numbers, so only the worked example can be
compared with printed numbers. Its conclusions are read as quantities that runs decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from automaton.engine.state import BATTERY_FULL
from automaton.papers.auction_charging import (
    CHARGING_POLICIES,
    TIME_TABLES,
    about_times,
    charging_costs,
    rolling,
    whole_objective,
)
from automaton.papers.auction_trials import (
    AGAIN,
    EXAMPLE_SETTINGS,
    METHODS,
    MOST_TASKS,
    OPTIMUM,
    bids_for,
    pictures,
    ratio,
    sequences,
    solve,
    steps,
)
from automaton.papers.claims import Claim, Figure, MeanQuantity, above, claim, exponent, mean_of
from automaton.papers.reproduction_study import (
    Case,
    Cases,
    Headline,
    Key,
    PublishedTable,
    Reproduction,
    crossed,
    each_seed,
    fixed,
)

Figures = Mapping[str, float]

SEVERAL_ROBOTS: Final = (2, 3, 4)
LINEAR: Final[dict[str, Any]] = {
    "at_least": 0.8,
    "at_most": 1.2,
    "digits": 2,
    "why": "`linearly`, read as an exponent of 1, give or take 0.2",
}
SCALES: Final = (
    "our solution outputs near-optimal performance with a computation time that scales linearly with "
    "the amount of tasks and amount of robots"
)
COMPARED_METHODS: Final = tuple(method for method in METHODS if method not in (OPTIMUM, AGAIN))
POOLED: Final = tuple(range(2, MOST_TASKS + 1))
FLOORS: Final = (("full", 6), ("comb", 4))  # floor, largest fleet
SHOWN_METHODS: Final = (OPTIMUM, "LB", "LB+search", "GA", "GA each gene")
TOURS_PER_SEED: Final = 10
TOUR_CHARGERS: Final = (("2", 1), ("1,2,3", 8))  # chargers, least number of tasks in a tour
CHARGING_SHARES: Final = (
    ("charges r0", "charges r20", "empty look", "end r20", "end look", "end safe"),
    ("gross worse", "time worse", "time worse, floor kept"),
)
ROLLING: Final = ("r0", "r0 reach", "thr0 safe", "thr20 safe", "fill-up", "fill to 80")

PRINTED_EXAMPLE: Final[Mapping[Key, Figures]] = {
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
    """The bids of section 4, which are deterministic."""
    one = bids_for(str(case.labels["setting"]))[int(case.labels["robot"]) - 1]
    found: dict[str, float] = {} if one.before is None else {"c1": one.before}
    if one.cost is not None and one.added is not None and one.mixed is not None:
        found |= {"c2": one.cost, "MiniSum": one.added, "bid": one.mixed}
        found |= {"charging": one.charging, "end %": 100 * one.end / BATTERY_FULL}
    return [found]


def ratio_table(
    title: str, cases: Cases, methods: tuple[str, ...], tasks: Sequence[int], epsilon: int = 0
) -> PublishedTable:
    """Objectives as multiples of the optimum; a seed has a task set for each number of tasks."""

    def of(case: Case, seed: int) -> list[Figures]:
        lanes, robots = str(case.labels.get("floor", "full")), int(case.labels["robots"])
        return [
            {method: ratio(lanes, robots, n, seed, method, epsilon) for method in methods}
            for n in tasks
        ]

    return PublishedTable(
        title=title,
        cases=cases,
        panels=(methods,),
        run=each_seed(of),
        repetition="task set",
        per_seed=len(tasks),
        digits=3,
        spread="se",
    )


def epsilon_table(name: str, epsilon: int, tasks: Sequence[int]) -> PublishedTable:
    """Ratios of the objective with a share of the sum."""
    title = f"Section 5.1 with {name}: objective as a multiple of the optimum"
    cases = crossed(objective=(name,), robots=(2, 3))
    return ratio_table(title, cases, ("LB", "BD", "regret", "GA"), tasks, epsilon)


def makespans(case: Case, seed: int) -> list[Figures]:
    """Seconds until all tasks are done."""
    robots, n = int(case.labels["robots"]), int(case.labels["tasks"])
    return [
        {method: solve("full", robots, n, seed, method, 0).objective for method in SHOWN_METHODS}
    ]


def efforts(case: Case, seed: int) -> list[Figures]:
    """The work for two robots: bids, and tried places in lists."""
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
    """The work for ten tasks, if only the winner or every robot bids again after a sale."""
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
    return [charging_costs(seed, n, number, chargers) for number in range(TOURS_PER_SEED)]


def objectives(case: Case, seed: int) -> list[Figures]:
    """Tours of one robot, charging in the bids or by threshold."""
    n = int(case.labels["tasks"])
    return [whole_objective(seed, n, number) for number in range(TOURS_PER_SEED)]


def horizon(case: Case, seed: int) -> list[Figures]:
    """Consecutive batches with each policy."""
    size, taper = int(case.labels["batch"]), case.labels["curve"] == "taper"
    found: dict[str, float] = {}
    for name in ROLLING:
        found[name], found[f"stuck {name}"] = rolling(seed, size, name, taper)
    return [found]


EXAMPLE: Final = PublishedTable(
    title="Section 4: the worked example (s; no bid where there is no feasible plan)",
    cases=crossed(setting=EXAMPLE_SETTINGS, robot=(1, 2)),
    panels=(("c1", "c2", "MiniSum", "bid"), ("charging", "end %")),
    published=lambda key, metric: PRINTED_EXAMPLE.get(key, {}).get(metric),
    run=each_seed(example_figures),
    repetition="example",
    grouped=1,
)
RATIOS: Final = ratio_table(
    "Section 5.1: makespan as a multiple of the optimum, 2 to 10 tasks pooled",
    fixed([{"floor": floor, "robots": m} for floor, most in FLOORS for m in range(1, most + 1)]),
    COMPARED_METHODS,
    POOLED,
)
MAKESPANS: Final = PublishedTable(
    title="Figure 4: makespan in seconds by the number of tasks",
    cases=crossed(robots=range(1, 7), tasks=range(1, 11)),
    panels=(SHOWN_METHODS,),
    run=each_seed(makespans),
    repetition="task set",
    digits=1,
    grouped=1,
    spread="se",
)
EFFORTS: Final = PublishedTable(
    title="Figure 5: work for two robots, counted (times: `automaton bench --only auctions`)",
    cases=crossed(tasks=range(1, 11)),
    panels=(("LB bids", "LB places", "arrival places"), ("GA places", "allotments", "sequences")),
    run=each_seed(efforts),
    repetition="task set",
)
EFFORTS_BY_ROBOTS: Final = PublishedTable(
    title="Work for ten tasks by the number of robots, counted (all: everybody bids again after a sale)",
    cases=crossed(tasks=("ten",), robots=range(1, 7)),
    panels=(("LB bids", "LB places", "all bids", "all places"),),
    run=each_seed(efforts_by_robots),
    repetition="task set",
)
CHARGING_TABLE: Final = PublishedTable(
    title="Section 5.2: seconds spent on charging by one robot (gross: to the charger, charging, on; "
    "net: less the leg that this replaces)",
    cases=fixed(
        [{"chargers": at, "tasks": n} for at, few in TOUR_CHARGERS for n in range(few, 11)]
    ),
    panels=(
        ("tour", "gross r0", "gross r20", "gross look", "gross safe"),
        ("net r0", "net r20", "net look", "net safe"),
        *CHARGING_SHARES,
    ),
    run=each_seed(charging),
    repetition="tour",
    per_seed=TOURS_PER_SEED,
    shares=tuple(share for panel in CHARGING_SHARES for share in panel),
    grouped=1,
    spread="se",
)
OBJECTIVE: Final = PublishedTable(
    title="Figure 6a: seconds with charging in the bids, or by threshold after the genetic tour",
    cases=crossed(**{"robots with a battery": ("one",), "tasks": (6, 8, 10)}),
    panels=(("SSI r0", "SSI r20", "GA look", "GA safe"),),
    run=each_seed(objectives),
    repetition="tour",
    per_seed=TOURS_PER_SEED,
    spread="se",
)
HORIZON: Final = PublishedTable(
    title="Beyond the paper: batch after batch, one robot, seconds per task (200 batches a run; "
    "stuck: share of batches without a plan)",
    cases=crossed(curve=("linear", "taper"), batch=(2, 4, 8)),
    panels=(ROLLING, ("stuck r0", "stuck r0 reach", "stuck thr20 safe", "stuck fill-up")),
    run=each_seed(horizon),
    shares=tuple(f"stuck {name}" for name in CHARGING_POLICIES),
    digits=1,
    grouped=1,
    spread="se",
)


def growth(name: str) -> MeanQuantity:
    """The exponent with which a count grows from 5 to 10 tasks."""
    return exponent(mean_of(name, 10), mean_of(name, 5), 10, 5)


def by_robots(name: str) -> MeanQuantity:
    """The exponent with which a count for ten tasks grows from 2 to 6 robots."""
    return exponent(mean_of(name, "ten", 6), mean_of(name, "ten", 2), 6, 2)


def about_the_example() -> Iterator[Claim]:
    """Section 4."""

    def lead(setting: str, **bounds: Any) -> Figure:
        less = mean_of("bid", setting, 2) - mean_of("bid", setting, 1)
        return Figure("bid of robot 2 less that of robot 1", less, certain=True, **bounds)

    yield claim(
        "Robot 1 wins the task with 145 against 154, though it is nearer to robot 2's route",
        lead("as printed", at_least=9, at_most=9),
    )
    yield claim(
        "Without resource constraints robot 2 would have obtained the task",
        lead("charging ignored", at_most=0, strict=True),
    )
    yield claim(
        "... also with chargers at depots 1, 2 and 3, as section 3.2.1 has them",
        lead("chargers 1, 2, 3", at_least=0, strict=True),
    )


def about_quality() -> Iterator[Claim]:
    """Section 5.1: makespans."""
    for floor in ("full", "comb"):
        for m in SEVERAL_ROBOTS:
            for genetic, name in (("GA", "one gene"), ("GA each gene", "each gene")):
                yield claim(
                    f"The auction lies between the optimum and the genetic algorithm ({m} robots, "
                    f"floor {floor}, mutation of {name})",
                    Figure(
                        "ratio of the genetic algorithm less that of the auction",
                        mean_of(genetic, floor, m) - mean_of("LB", floor, m),
                        at_least=0,
                        digits=3,
                    ),
                )
    yield claim(
        "Fewest bids is identical to lowest bid where all robots can do all tasks",
        *(
            Figure(
                f"ratio by fewest bids less that by the lowest, {m} robots",
                mean_of("FB", "full", m) - mean_of("LB", "full", m),
                at_least=0,
                at_most=0,
                digits=3,
            )
            for m in SEVERAL_ROBOTS
        ),
    )
    yield claim(
        "With one robot all methods perform equally, because only one solution is possible",
        *(
            Figure(
                f"ratio of {name}",
                mean_of(method, "full", 1),
                at_most=1,
                why="as good as the optimum",
                digits=3,
            )
            for method, name in (("LB", "the auction"), ("GA", "the genetic algorithm"))
        ),
    )
    yield claim(
        "More than four robots bring no gain (10 tasks)",
        Figure(
            "optimal makespan of five robots, as a share of that of four",
            mean_of("optimum", 5, 10) / mean_of("optimum", 4, 10),
            at_least=0.95,
            unit="%",
            why="`roughly the same`, read as within 5 %",
        ),
    )


def about_work() -> Iterator[Claim]:
    """Section 5.1: computing effort.

    For 10 tasks and m robots, the number of bids is 55 m if every robot bids again after a sale, and
    10 m + 45 if only the winner does. Tried places depend on the tours.
    """
    yield claim(
        "The auction's work grows linearly with the tasks",
        Figure("exponent of places tried, 5 to 10 tasks", growth("LB places"), **LINEAR),
        Figure("exponent of bids, 5 to 10 tasks", growth("LB bids"), **LINEAR, certain=True),
        source=SCALES,
    )
    yield claim(
        "... if each task is auctioned as it arrives (Algorithm 2)",
        Figure("exponent of places tried", growth("arrival places"), **LINEAR),
    )
    bids, places = (f"exponent of {what}, 2 to 6 robots" for what in ("bids", "places"))
    for who, name in (("all", "everybody bids again"), ("LB", "only the winner bids again")):
        yield claim(
            f"The auction's work grows linearly with the robots ({name} after a sale)",
            Figure(bids, by_robots(f"{who} bids"), **LINEAR, certain=True),
            Figure(places, by_robots(f"{who} places"), **LINEAR),
            source=SCALES,
        )
    yield claim(
        "The auction needs far less work than the genetic algorithm (10 tasks)",
        Figure(
            "places tried by the genetic algorithm for one of the auction",
            mean_of("GA places", 10) / mean_of("LB places", 10),
            at_least=100,
            why="`far less`, read as a hundredth",
        ),
    )
    yield claim(
        "The optimum's work grows exponentially with the tasks",
        *(
            Figure(
                f"{what} of 10 tasks for one of 9",
                mean_of(what, 10) / mean_of(what, 9),
                at_least=2,
                why="doubled by each task",
                certain=True,
            )
            for what in ("sequences", "allotments")
        ),
    )


def saving(label: str, ours: str, theirs: str) -> Figure:
    """A figure: the relative saving of one cost of ten tasks against another."""
    return above(label, 1 - mean_of(ours, "2", 10) / mean_of(theirs, "2", 10), unit="%")


def never(what: str, name: str, tasks: int = 10) -> Figure:
    """A figure: the share of tours with a number of tasks, which must be 0."""
    label = f"share of tours of {tasks} tasks {what}"
    return Figure(label, mean_of(name, "2", tasks), at_most=0, unit="%")


def about_charging() -> Iterator[Claim]:
    """Section 5.2."""
    for reserve in ("r0", "r20"):
        yield claim(
            f"With fewer than six tasks no charging is needed (reserve {reserve[1:]} %)",
            *(never("with charging", f"charges {reserve}", n) for n in (4, 5)),
        )
    yield claim(
        "Charging just as much as needed costs less than threshold-100 (10 tasks, reserve 20 %)",
        saving("gross saving", "gross r20", "gross look"),
        saving("net saving", "net r20", "net look"),
        saving("net saving, safe", "net r20", "net safe"),
    )
    yield claim(
        "... always, in every single tour",
        never("whose charging is dearer than by threshold", "gross worse"),
        never("that take longer in all", "time worse"),
    )
    yield claim(
        "... in every tour in which the threshold rule keeps the 20 %",
        never("that take longer in all", "time worse, floor kept"),
    )
    yield claim(
        "With 0.3 % a second every robot reaches a charger from anywhere (threshold 20 %)",
        never("that run empty", "empty look"),
    )
    yield claim(
        "Optimal charging needs more work than the threshold (10 tasks, chargers 1, 2, 3)",
        above(
            "states looked at, for each leg that the threshold rule looks at",
            mean_of("states r20", "1,2,3", 10) / mean_of("states look", "1,2,3", 10),
            bound=1,
            digits=1,
            why="as many",
        ),
    )


def about_the_horizon() -> Iterator[Claim]:
    """The results for consecutive batches."""
    for curve in ("linear", "taper"):
        for size in (2, 4, 8):
            yield claim(
                f"Just enough beats threshold-100 at equal safety, batch after batch ({curve} curve, "
                f"batches of {size})",
                above(
                    "seconds per task saved against thr20 safe",
                    mean_of("thr20 safe", curve, size) - mean_of("r0 reach", curve, size),
                    digits=1,
                ),
            )


AUCTION_CLAIMS: Final = (
    *about_the_example(),
    *about_quality(),
    *about_work(),
    *about_charging(),
    *about_the_horizon(),
)

AUCTION_REMARKS: Final = (
    "The figures with the layout and the curves are lost, and the text gives no seconds: our floor has "
    "all lengths that the text states, and ratios, Figure 5 and Figure 6c have no printed counterparts. "
    "These lengths need nine lanes; eight more may exist or not (`comb` omits four of them).",
    "In the worked example robots can charge only at position 2. Section 3.2.1 places chargers at the "
    "depots: then robot 2 charges for a second at its place, bids 66 and wins.",
    "[2, 5, 4, 9, 14] and [5, 2, 4, 9, 14] are charging stops with equal cost; in the printed one the "
    "robot is nearer to the charger when it leaves its route.",
    "The winner of the example ends 120 m from the charger with 10 % left and would need 60 % to reach "
    "it. If a charger must stay in reach (never strand), neither robot can bid.",
    "Equation 7 prints an intersection instead of the insertion of the charging stop.",
    "With one robot `only one solution is possible` if every method inserts tasks in the same order; "
    "the auction picks the order itself.",
    "For two robots, the m^n allotments are fewer than the solutions that the genetic algorithm tries; "
    "the optimum is slower (Figure 5) only if it tries all (n + m - 1)! / (m - 1)! sequences.",
    "Robots 5 and 6 share depots 1 and 2 with robots 1 and 2; robot 4 starts at an added depot 17.",
    "Ratios from different sets of 20 seeds differ by about 0.02; the standard error is beside each. "
    "100 seeds give 900 task sets for each number of robots.",
    "In the last table a robot without a plan is towed to the charger at driving speed and charged "
    "fully, which is an optimistic model of a rescue.",
    "With a tapering curve single stops are exact; if one stop is not enough, several are planned as for "
    "a linear curve.",
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
        CHARGING_TABLE,
        OBJECTIVE,
        HORIZON,
    ),
    claims=(*AUCTION_CLAIMS, *about_times()),
    remarks=AUCTION_REMARKS,
    headlines=AUCTION_HEADLINES,
    seeds=20,
    claims_title="Paper's claims",
    texts=texts,
)
