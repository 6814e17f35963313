"""What De Ryck et al. conclude, read as figures that runs decide."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Final

from automaton.papers.claims import Claim, Figure, Mean

SEVERAL: Final = (2, 3, 4)  # robots
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

REMARKS: Final = (
    "The figures with the layout and the curves are lost: the floor is one that has every length of the "
    "text, and ratios stand beside no printed number. Nine lanes are needed for those lengths, eight may "
    "be there or not (`comb` leaves out four of them).",
    "Only position 2 may charge in the worked example. Section 3.2.1 puts chargers at the depots: then "
    "robot 2 charges for a second where it stands, bids 66 and wins.",
    "Among the places for the charger with equal cost, [2, 5, 4, 9, 14] and [5, 2, 4, 9, 14] tie; the "
    "printed one is nearer to the charger when it leaves its route.",
    "The winner of the example ends 120 m from the charger with 10 % left and needs 60 %. If a charger "
    "must stay in reach (never strand), neither robot can bid.",
    "Equation 7 prints an intersection where the charging stop is inserted.",
    "With one robot `only one solution is possible` if every method inserts tasks in the same order; "
    "the auction picks the order itself.",
    "For two robots, m^n allotments are fewer than what the genetic algorithm tries; that the optimum is "
    "slower (Figure 5) needs all (n + m - 1)! / (m - 1)! sequences.",
    "Robots 5 and 6 share depots 1 and 2 with robots 1 and 2; robot 4 starts at an added depot 17.",
    "Ratios of 20 seeds differ by about 0.02 from those of others; the standard error is beside each. "
    "100 seeds are 900 task sets for each number of robots.",
    "In the last table a robot without a plan is towed to the charger, at driving speed, and charged "
    "fully, which is a rosy view of a rescue.",
    "With a tapering curve single stops are exact; where one stop cannot do, several are placed as for a "
    "linear curve.",
)


def value(metric: str, *key: str | int) -> Callable[[Mean], float]:
    """The mean of a metric of a case."""
    return lambda mean: mean(metric, *key)


def paired(metric: str, other: str, *key: str | int) -> Callable[[Mean], float]:
    """How much larger the first metric of a case is."""
    return lambda mean: mean(metric, *key) - mean(other, *key)


def share_of(metric: str, of: str, *key: str | int) -> Callable[[Mean], float]:
    """How much less the first is than the second, as a share of the second."""
    return lambda mean: 1 - mean(metric, *key) / mean(of, *key)


def growth(metric: str, low: int = 5, high: int = 10) -> Callable[[Mean], float]:
    """The exponent with which a count grows from `low` to `high` tasks."""
    return lambda mean: math.log(mean(metric, high) / mean(metric, low)) / math.log(high / low)


def by_robots(metric: str, low: int = 2, high: int = 6) -> Callable[[Mean], float]:
    """The exponent with which a count for ten tasks grows from `low` to `high` robots."""
    return lambda mean: (
        math.log(mean(metric, "ten", high) / mean(metric, "ten", low)) / math.log(high / low)
    )


def about_the_example() -> Iterator[Claim]:
    """Section 4."""
    yield Claim(
        "Robot 1 wins the task with 145 against 154, though it is nearer to robot 2's route",
        (
            Figure(
                "bid of robot 2 less that of robot 1",
                lambda mean: mean("bid", "as printed", 2) - mean("bid", "as printed", 1),
                9,
                9,
                certain=True,
            ),
        ),
    )
    yield Claim(
        "Without resource constraints robot 2 would have obtained the task",
        (
            Figure(
                "bid of robot 2 less that of robot 1",
                lambda mean: (
                    mean("bid", "charging ignored", 2) - mean("bid", "charging ignored", 1)
                ),
                at_most=0,
                strict=True,
                certain=True,
            ),
        ),
    )
    yield Claim(
        "... also with chargers at depots 1, 2 and 3, as section 3.2.1 has them",
        (
            Figure(
                "bid of robot 2 less that of robot 1",
                lambda mean: (
                    mean("bid", "chargers 1, 2, 3", 2) - mean("bid", "chargers 1, 2, 3", 1)
                ),
                at_least=0,
                strict=True,
                certain=True,
            ),
        ),
    )


def about_quality() -> Iterator[Claim]:
    """Section 5.1: makespans."""
    for floor in ("full", "comb"):
        for m in SEVERAL:
            for metric, name in (("GA", "one gene"), ("GA each gene", "each gene")):
                yield Claim(
                    f"The auction lies between the optimum and the genetic algorithm ({m} robots, "
                    f"floor {floor}, mutation of {name})",
                    (
                        Figure(
                            "ratio of the genetic algorithm less that of the auction",
                            paired(metric, "LB", floor, m),
                            at_least=0,
                            digits=3,
                        ),
                    ),
                )
    yield Claim(
        "Fewest bids is identical to lowest bid where all robots can do all tasks",
        tuple(
            Figure(
                f"ratio by fewest bids less that by the lowest, {m} robots",
                paired("FB", "LB", "full", m),
                0,
                0,
                digits=3,
            )
            for m in SEVERAL
        ),
    )
    yield Claim(
        "With one robot all methods perform equally, because only one solution is possible",
        tuple(
            Figure(
                f"ratio of {name}",
                value(metric, "full", 1),
                at_most=1,
                why="as good as the optimum",
                digits=3,
            )
            for metric, name in (("LB", "the auction"), ("GA", "the genetic algorithm"))
        ),
    )
    yield Claim(
        "More than four robots bring no gain (10 tasks)",
        (
            Figure(
                "optimal makespan of five robots, as a share of that of four",
                lambda mean: mean("optimum", 5, 10) / mean("optimum", 4, 10),
                at_least=0.95,
                unit="%",
                why="`roughly the same`, read as within 5 %",
            ),
        ),
    )


def about_work() -> Iterator[Claim]:
    """Section 5.1: computing. Bids are counted: of 10 tasks and m robots 55 m if everybody bids again,
    10 m + 45 if the winner does. Places depend on the tours.
    """
    yield Claim(
        "The auction's work grows linearly with the tasks",
        (
            Figure("exponent of places tried, 5 to 10 tasks", growth("LB places"), **LINEAR),
            Figure("exponent of bids, 5 to 10 tasks", growth("LB bids"), **LINEAR, certain=True),
        ),
        SCALES,
    )
    yield Claim(
        "... if each task is auctioned as it arrives (Algorithm 2)",
        (Figure("exponent of places tried", growth("arrival places"), **LINEAR),),
    )
    bids, places = (f"exponent of {what}, 2 to 6 robots" for what in ("bids", "places"))
    for who, name in (("all", "everybody bids again"), ("LB", "only the winner bids again")):
        yield Claim(
            f"The auction's work grows linearly with the robots ({name} after a sale)",
            (
                Figure(bids, by_robots(f"{who} bids"), **LINEAR, certain=True),
                Figure(places, by_robots(f"{who} places"), **LINEAR),
            ),
            SCALES,
        )
    yield Claim(
        "The auction needs far less work than the genetic algorithm (10 tasks)",
        (
            Figure(
                "places tried by the genetic algorithm for one of the auction",
                lambda mean: mean("GA places", 10) / mean("LB places", 10),
                at_least=100,
                why="`far less`, read as a hundredth",
            ),
        ),
    )
    yield Claim(
        "The optimum's work grows exponentially with the tasks",
        (
            Figure(
                "sequences of 10 tasks for one of 9",
                lambda mean: mean("sequences", 10) / mean("sequences", 9),
                at_least=2,
                why="doubled by each task",
                certain=True,
            ),
            Figure(
                "allotments of 10 tasks for one of 9",
                lambda mean: mean("allotments", 10) / mean("allotments", 9),
                at_least=2,
                why="doubled by each task",
                certain=True,
            ),
        ),
    )


def saving(label: str, of: Callable[[Mean], float]) -> Figure:
    """A share of costs that is saved."""
    return Figure(label, of, at_least=0, strict=True, unit="%")


def about_charging() -> Iterator[Claim]:
    """Section 5.2."""
    for reserve in ("r0", "r20"):
        yield Claim(
            f"With fewer than six tasks no charging is needed (reserve {reserve[1:]} %)",
            tuple(
                Figure(
                    f"share of tours of {n} tasks with charging",
                    value(f"charges {reserve}", "2", n),
                    at_most=0,
                    unit="%",
                )
                for n in (4, 5)
            ),
        )
    yield Claim(
        "Charging just as much as needed costs less than threshold-100 (10 tasks, reserve 20 %)",
        (
            saving("gross saving", share_of("gross r20", "gross look", "2", 10)),
            saving("net saving", share_of("net r20", "net look", "2", 10)),
            saving("net saving, safe", share_of("net r20", "net safe", "2", 10)),
        ),
    )
    yield Claim(
        "... always, in every single tour",
        (
            Figure(
                "share of tours of 10 tasks whose charging is dearer than by threshold",
                value("gross worse", "2", 10),
                at_most=0,
                unit="%",
            ),
            Figure(
                "share of tours of 10 tasks that take longer in all",
                value("time worse", "2", 10),
                at_most=0,
                unit="%",
            ),
        ),
    )
    yield Claim(
        "... in every tour in which the threshold rule keeps the 20 %",
        (
            Figure(
                "share of tours of 10 tasks that take longer in all",
                value("time worse, floor kept", "2", 10),
                at_most=0,
                unit="%",
            ),
        ),
    )
    yield Claim(
        "With 0.3 % a second every robot reaches a charger from anywhere (threshold 20 %)",
        (
            Figure(
                "share of tours of 10 tasks that run empty",
                value("empty look", "2", 10),
                at_most=0,
                unit="%",
            ),
        ),
    )
    yield Claim(
        "Optimal charging needs more work than the threshold (10 tasks, chargers 1, 2, 3)",
        (
            Figure(
                "states looked at, for each leg that the threshold rule looks at",
                lambda mean: mean("states r20", "1,2,3", 10) / mean("states look", "1,2,3", 10),
                at_least=1,
                strict=True,
                digits=1,
                why="as many",
            ),
        ),
    )


def about_the_horizon() -> Iterator[Claim]:
    """What changes when batch follows on batch."""
    for curve in ("linear", "taper"):
        for size in (2, 4, 8):
            yield Claim(
                f"Just enough beats threshold-100 at equal safety, batch after batch ({curve} curve, "
                f"batches of {size})",
                (
                    Figure(
                        "seconds per task saved against thr20 safe",
                        paired("thr20 safe", "r0 reach", curve, size),
                        at_least=0,
                        strict=True,
                        digits=1,
                    ),
                ),
            )


CLAIMS: Final = (
    *about_the_example(),
    *about_quality(),
    *about_work(),
    *about_charging(),
    *about_the_horizon(),
)
