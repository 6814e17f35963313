"""What auctions and batteries show in the living world, read as figures that runs can decide."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from automaton.papers.claims import Claim, Figure, Mean

# Nothing is gained by more robots than energy can be bought for: 80 % of kr / (kc + kr), with the
# percent that a tick of charging gives (1) and one of driving takes (0.3).
LEAST_SHARE: Final = 0.8 * 1 / (0.3 + 1)
LEAST: Final = "0.8 kr / (kc + kr)"
OURS: Final = "a bound of ours"
WAITS: Final = ("0.01", "0.05", "0.1")  # percent in a tick
SAFE: Final = ("insertion", "insertion, joint", "fill-up", "opportunity")  # never strand


def of(metric: str, *key: str | int) -> Callable[[Mean], float]:
    """A metric of a case."""
    return lambda mean: mean(metric, *key)


def more(metric: str, one: str, other: str) -> Callable[[Mean], float]:
    """By how much a metric of one case is above that of another."""
    return lambda mean: mean(metric, one) - mean(metric, other)


def empty(wait: str, reserve: int, **bounds: Any) -> Figure:
    """A figure: the share of runs with an empty robot, by what waits take and plans keep."""
    label = f"runs with an empty robot, {wait} % a tick, reserve {reserve} %"
    return Figure(label, of("stranded", wait, reserve), unit="%", **bounds)


def slower(one: str, other: str) -> Figure:
    """A figure: one kind of auction has longer lead times than another."""
    label = f"ticks of lead time, {one} beyond {other}"
    return Figure(label, more("lead_time", one, other), at_least=0, strict=True)


CLAIMS: Final = (
    Claim(
        "With never-strand no robot runs empty",
        tuple(
            Figure(f"runs with an empty robot, {name}", of("stranded", name), at_most=0, unit="%")
            for name in SAFE
        ),
    ),
    Claim(
        "and every order is delivered",
        tuple(
            Figure(f"runs, {name}", of("all_delivered", name), at_least=1, unit="%")
            for name in SAFE
        ),
    ),
    Claim(
        "at 0.8 kr / (kc + kr) of the throughput of infinite batteries at least",
        tuple(Figure(name, of("share", name), LEAST_SHARE, unit="%", why=LEAST) for name in SAFE),
    ),
    Claim(
        "Without it robots run empty",
        (Figure("robots in a run", of("ran_empty", "insertion, may strand"), 0, strict=True),),
    ),
    Claim(
        "Where waits take energy, robots run empty in most runs if plans keep no reserve",
        tuple(empty(wait, 0, at_least=0.5, why=OURS) for wait in WAITS),
    ),
    Claim(
        "and in one run of twenty at most if they keep 20 %",
        tuple(empty(wait, 20, at_most=0.05, why=OURS) for wait in WAITS),
    ),
    Claim(
        "With one charger and five robots, two or more stand in line in a tenth of all ticks",
        (Figure("ticks", of("in_line", "in the bids"), at_least=0.1, unit="%", why=OURS),),
    ),
    Claim(
        "Robots wait longer for the charger if bids leave its line out",
        (
            Figure(
                "ticks more per stay",
                more("wait", "left out", "in the bids"),
                at_least=0,
                strict=True,
                digits=1,
            ),
        ),
    ),
    Claim(
        "Local search after the auction shortens lead times, parallel sale lengthens them",
        (
            slower("sequential, lowest bid", "sequential, local search"),
            slower("parallel", "sequential, lowest bid"),
        ),
    ),
    Claim(
        "Regions of announcement, widened until somebody bids, save no messages, and orders wait longer",
        (
            Figure(
                "messages more",
                more("messages", "two fixed auctioneers, radius 4", "two fixed auctioneers"),
                at_least=0,
                strict=True,
            ),
            slower("two fixed auctioneers, radius 4", "two fixed auctioneers"),
        ),
    ),
    Claim(
        "If a robot fails, all orders are delivered",
        tuple(
            Figure(f"runs, {name}", of("all_delivered", name), at_least=1, unit="%")
            for name in ("gone for good", "back after 600 ticks")
        ),
    ),
)

REMARKS: Final = (
    "Here opportunity charging is insertion: no robot is ever idle. Every station is within 20 % of "
    "a charger, so both readings of the threshold agree, too.",
    "A reserve is what plans keep. What a robot spends in line, or behind others, no plan foresees.",
)
