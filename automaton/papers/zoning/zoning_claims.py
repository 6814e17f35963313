"""What Keith & La say of zones, read as figures that runs can decide."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from automaton.papers.claims import Claim, Figure, Mean
from automaton.papers.zoning.zoning_cases import (
    DDZ,
    DROPS,
    FREE,
    GA,
    GA_STARTS,
    NEAR,
    NEAR_DROPS,
    NEAR_STOPS,
    NO_SHARING,
    SA,
    UNMATCHED,
)
from automaton.papers.zoning.zoning_evenness import SMALLER

MEASURED: Final = {
    "hours": "hours",
    "mean_ft": "mean feet",
    "sigma_ft": "feet of sigma",
    "in_balance": "points of time",
}
HOUR: Final = "`much lower`, read as an hour: in print it is 2.49 and 2.68"
SIMILAR: Final = "`similar`, read as within half an hour: in print it is 0.19"
LARGER: Final = "the larger part"
LESS: Final = 0.687  # by so much is the printed sigma of DDZ below that of SA


def more(metric: str, one: str, other: str) -> Callable[[Mean], float]:
    """By how much one configuration's mean is above another's."""
    return lambda mean: mean(metric, one) - mean(metric, other)


def beyond(metric: str, one: str, other: str, **given: Any) -> Figure:
    """A figure: by how much one configuration's mean is above another's."""
    what = f"{MEASURED[metric]}, {one} beyond {other}"
    unit, digits = "points" if metric == "in_balance" else "", 2 if metric == "hours" else 0
    return Figure(what, more(metric, one, other), unit=unit, digits=digits, **given)


def above(metric: str, one: str, other: str) -> Figure:
    """A figure: one configuration's mean is greater than another's."""
    return beyond(metric, one, other, at_least=0, strict=True)


def below(metric: str, one: str, other: str) -> Figure:
    """A figure: one configuration's mean is less than another's."""
    return beyond(metric, one, other, at_most=0, strict=True)


def smaller(one: str, other: str) -> Figure:
    """A figure: of all pairs of runs, the first one's sigma is the smaller in more than half."""
    return Figure(
        f"pairs in which sigma of {one} is below that of {other}",
        lambda mean: mean(SMALLER, one, other),
        at_least=0.5,
        strict=True,
        unit="%",
    )


def redesigns(name: str) -> Callable[[Mean], float]:
    """How often a configuration came to new zones."""
    return lambda mean: mean("redesigns", name)


def decrease(mean: Mean) -> float:
    return 1 - mean("sigma_ft", DDZ) / mean("sigma_ft", SA)


def part_of_gap(one: str, other: str) -> Callable[[Mean], float]:
    """Hours between two configurations as a share of those between DDZ as published and SA."""
    gap = more("hours", DDZ, SA)
    return lambda mean: more("hours", one, other)(mean) / gap(mean)


CLAIMS: Final = (
    Claim(
        "Abstract: DDZ has a much lower throughput than SA and GA (read as an hour more at least)",
        tuple(
            Figure(f"hours more than {name}", more("hours", DDZ, name), 1, digits=2, why=HOUR)
            for name in (SA, GA)
        ),
    ),
    Claim(
        "and so it has if robots do not stand still in redesigns, which the paper does not mention",
        tuple(above("hours", FREE, name) for name in (SA, GA)),
    ),
    Claim(
        "Abstract, Discussion: DDZ has a lower sigma of travel than SA and GA",
        tuple(below("sigma_ft", DDZ, name) for name in (SA, GA)),
    ),
    Claim(
        "Abstract: its sigma is 68.7 % less than that of SA",
        (Figure("less than SA", decrease, at_least=LESS, unit="%", why="as printed"),),
    ),
    Claim("The main claim in pairs of runs, as published: stops, SA shares", (smaller(DDZ, SA),)),
    Claim(
        "The same like for like: nobody stands still, nobody shares load",
        (smaller(FREE, NO_SHARING),),
    ),
    Claim("The same without stops, SA shares load", (smaller(FREE, SA),)),
    Claim(
        "Results: every method came to new zones",
        tuple(
            Figure(f"redesigns, {name}", redesigns(name), 1, why="`new zones`: once at least")
            for name in (SA, GA, DDZ)
        ),
    ),
    Claim(
        "Results: SA is done sooner than GA (12 minutes)",
        (above("hours", GA, SA),),
    ),
    Claim(
        "Discussion: the throughput of GA is similar to that of SA (read as within half an hour)",
        (beyond("hours", GA, SA, at_least=-0.5, at_most=0.5, why=SIMILAR),),
    ),
    Claim(
        "Results: SA is in balance for longer than GA",
        (above("in_balance", SA, GA),),
    ),
    Claim("Results: GA drives less than SA", (below("mean_ft", GA, SA),)),
    Claim(
        "Results, Discussion: GA has less sigma than SA",
        (below("sigma_ft", GA, SA),),
    ),
    Claim(
        "Beyond the paper: GA has less sigma if its zones go to any robot than to those that start near",
        (below("sigma_ft", UNMATCHED, GA_STARTS),),
    ),
    Claim("Table 5: DDZ drives more than SA", (above("mean_ft", DDZ, SA),)),
    Claim(
        "Results: DDZ takes about 3 hours more than SA (2.68)",
        (Figure("hours more", more("hours", DDZ, SA), 2.5, 3.5, digits=2, why="what rounds to 3"),),
    ),
    Claim(
        "Results: that is because DDZ shares no load (read as half of the gap to SA at least)",
        (
            Figure(
                "of the gap, what sharing saves SA",
                part_of_gap(NO_SHARING, SA),
                at_least=0.5,
                unit="%",
                why=LARGER,
            ),
        ),
    ),
    Claim(
        "Not in the paper: it is because its robots stand still in redesigns (half at least)",
        (Figure("of the gap, the stops", part_of_gap(DDZ, FREE), 0.5, unit="%", why=LARGER),),
    ),
    Claim(
        "Future work: sharing load near the own zone shortens DDZ",
        (
            below("hours", NEAR, FREE),
            below("hours", NEAR_STOPS, DDZ),
        ),
    ),
    Claim(
        "Future work: so does setting down at the next station if it is near a transfer station",
        (below("hours", DROPS, FREE),),
    ),
    Claim("and both together", (below("hours", NEAR_DROPS, FREE),)),
    Claim(
        "Beyond the paper: DDZ that shares near drives more evenly than SA, with sharing and without",
        (smaller(NEAR, SA), smaller(NEAR, NO_SHARING)),
    ),
    Claim(
        "Beyond the paper: and more evenly than DDZ as it is",
        (smaller(NEAR, FREE), smaller(NEAR_STOPS, DDZ)),
    ),
)

REMARKS: Final = (
    "Every figure of Table 5 is one run for each method; sigma is that of three robots of it "
    "(population sd). rank: share of our runs below the printed figure.",
    "The abstract's 2874.7 ft are not the difference of Table 5, 4145.01 - 1295.22 = 2849.79 ft; the "
    "68.7 % are.",
    "Eq. 5 prints (L_i + x_i)^2 where the deviation from the mean, (L_i - x_i)^2, is meant and computed.",
    "Eq. 4 prints the same sum twice; the loads brought to i and those taken from j are meant.",
    "In the authors' log of DDZ all robots stand still in each of its 9 redesigns, 862 s on average, "
    "2.16 h of 8.62 h. The paper does not mention it and explains the low throughput otherwise.",
    "The shipped series of DDZ ends at 8.36 h with 98 parts: 8.62 h cannot be checked.",
    "The formula of the time in balance is not published: here each look counts up to the next one. "
    "From the authors' series it is 42.4 % for SA and 24.2 % for GA so, not 39.32 % and 23.71 %.",
    "GA has 12 generations of 30 here (the paper's: 100 of 60), to save time.",
    "Limits of this floor: robots pass each other and legs are those of the graph (the aisles are 9.5 "
    "to 30 ft wide); `--tables lanes` puts one robot in a cell.",
)
