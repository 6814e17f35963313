"""What Grzejszczak & Nocoń conclude from their runs, read as figures that runs can decide.

A claim about "less" is a difference above zero, one with a number is compared with that number. Where
a word needs a range ("the same", "rapidly"), the range is ours and the figure says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Final

from automaton.papers.claims import Claim, Figure, Mean

INDEPENDENT: Final = "independent"
COOPERATIVE: Final = "cooperative"
CURVES: Final = tuple((c, s) for c in (1, 2) for s in (INDEPENDENT, COOPERATIVE))
ROBOTS: Final = (1, 2, 3, 4, 5)
E_U: Final = {
    "E_U_moves": "moves",
    "E_U_operations": "operations",
    "E_U_cycles": "cycles",
}

SAME: Final = 0.02  # shares this close count as the same
FROM_TWO: Final = "from 2 robots on, for one alone meets nobody; the paper names no first number"

Of = Callable[[Mean], float]


def saved(metric: str, configuration: int, robots: int) -> Of:
    """How much less cooperative robots need than independent ones."""
    return lambda mean: (
        mean(metric, configuration, INDEPENDENT, robots)
        - mean(metric, configuration, COOPERATIVE, robots)
    )


def shortened(mean: Mean) -> float:
    """The share of T_total that cooperation saves with 4 robots in configuration 1."""
    return saved("T_total", 1, 4)(mean) / mean("T_total", 1, INDEPENDENT, 4)


def added(metric: str, configuration: int, strategy: str, robots: int) -> Of:
    """What the last of `robots` robots adds to a metric."""
    return lambda mean: (
        mean(metric, configuration, strategy, robots)
        - mean(metric, configuration, strategy, robots - 1)
    )


def least_rise(metric: str, configuration: int, strategy: str) -> Of:
    """The smallest rise of a metric from a number of robots to the next."""
    rises = [added(metric, configuration, strategy, robots) for robots in ROBOTS[1:]]
    return lambda mean: min(rise(mean) for rise in rises)


def least_loss_of_gain(configuration: int, strategy: str) -> Of:
    """How much less T_total each robot saves than the one before it: the smallest such figure."""
    rises = [added("T_total", configuration, strategy, robots) for robots in ROBOTS[1:]]
    return lambda mean: min(
        after - before for before, after in pairwise(rise(mean) for rise in rises)
    )


def rise_after_least(configuration: int, strategy: str) -> Of:
    """T_R with five robots above its least value with fewer."""
    return lambda mean: (
        mean("T_R", configuration, strategy, 5)
        - min(mean("T_R", configuration, strategy, robots) for robots in ROBOTS[:-1])
    )


def steeper(configuration: int) -> Of:
    """Rise of T_Rtotal from one robot to five: independent above cooperative."""
    return lambda mean: (
        saved("T_Rtotal", configuration, 5)(mean) - saved("T_Rtotal", configuration, 1)(mean)
    )


def congestion(configuration: int, strategy: str, robots: int) -> Of:
    """Robot cycles that a fleet takes beyond those of a lone robot, as a share of these."""
    return lambda mean: (
        robots
        * mean("T_total", configuration, strategy, robots)
        / mean("T_total", configuration, strategy, 1)
        - 1
    )


def steeper_congestion(strategy: str) -> Of:
    """Rise of the congestion from two robots to five: configuration 2 above configuration 1."""

    def rise(configuration: int, mean: Mean) -> float:
        last, first = (congestion(configuration, strategy, robots)(mean) for robots in (5, 2))
        return last - first

    return lambda mean: rise(2, mean) - rise(1, mean)


def signed(
    metric: str, configuration: int, fewer: tuple[int, ...], more: tuple[int, ...]
) -> Iterator[Figure]:
    """Cooperation needs less than independence for these `fewer` N, and more for these `more` N."""
    for robots in sorted((*fewer, *more)):
        of = saved(metric, configuration, robots)
        label = f"{metric} saved by cooperation, N = {robots}"
        if robots in fewer:
            yield Figure(label, of, at_least=0, strict=True)
        else:
            yield Figure(label, of, at_most=0, strict=True)


def by_curve(what: str, make: Callable[[int, str], Of]) -> tuple[Figure, ...]:
    """A figure for each strategy and configuration, which must be above zero."""
    return tuple(
        Figure(f"{what}, {s}, cfg {c}", make(c, s), at_least=0, strict=True) for c, s in CURVES
    )


def empty_runs() -> Iterator[Claim]:
    """The claims about empty runs, by each reading of their definition."""
    for metric, name in E_U.items():
        yield Claim(
            f"Configuration 2: cooperative robots run empty less at every N (E_U by {name})",
            tuple(
                Figure(
                    f"less by, N = {n}", saved(metric, 2, n), at_least=0, strict=True, unit="points"
                )
                for n in ROBOTS
            ),
        )
        yield Claim(
            f"Configuration 1: empty runs are the same with 3 to 5 robots (E_U by {name})",
            tuple(
                Figure(
                    f"less by, N = {n}",
                    saved(metric, 1, n),
                    -SAME,
                    SAME,
                    unit="points",
                    why="read as within 2 points, for Figure 11 is lost",
                )
                for n in ROBOTS[2:]
            ),
        )


CLAIMS: Final = (
    Claim(
        "Configuration 1: cooperation cuts T_total by 30 % with 4 robots",
        (Figure("cut", shortened, at_least=0.3, unit="%", why="as the text says"),),
        "In the optimal case of 4 robots in Configuration 1, the cooperative strategy resulted in a 30% "
        "decrease of the time needed for the completion of the whole task.",
    ),
    Claim(
        "Configuration 1: cooperation shortens T_total at every N",
        tuple(signed("T_total", 1, fewer=ROBOTS, more=())),
    ),
    Claim(
        "Configuration 1: 4 cooperative robots are the optimum, a fifth makes T_total longer",
        (
            Figure(
                "change by the fifth", added("T_total", 1, COOPERATIVE, 5), at_least=0, strict=True
            ),
        ),
    ),
    Claim(
        "Each robot added shortens T_total by less than the one before",
        by_curve("smallest drop of the gain", least_loss_of_gain),
    ),
    Claim(
        "Congestion grows faster in configuration 2 (from 2 robots to 5)",
        tuple(
            Figure(
                f"more than in configuration 1, {s}",
                steeper_congestion(s),
                at_least=0,
                strict=True,
                unit="points",
                why=FROM_TWO,
            )
            for s in (INDEPENDENT, COOPERATIVE)
        ),
        "However, the greater the number of robots, the smaller the gain from addition of another robot. "
        "This congestion effect increases faster with the number of robots in Configuration 2, where for "
        "5 robots T_total time is smaller if robots work in the independent mode.",
    ),
    Claim(
        "Configuration 1: a sixth cooperative robot stays idle for good",
        (
            Figure(
                "runs in which one of six never picks anything up",
                lambda mean: mean("sixth_idle", 1, COOPERATIVE, 6),
                at_least=1,
                unit="%",
            ),
        ),
        "because in Configuration 1 only 5 corridors are available for the robots working in a "
        "cooperative mode, a greater number of robots was not tested, as it would result in a permanent "
        "inactivity of the \u201csixth\u201d robot.",
    ),
    Claim(
        "Configuration 1: few robots (N = 1) finish earlier if independent",
        tuple(signed("T_total", 1, fewer=(), more=(1,))),
    ),
    Claim(
        "The same read for configuration 2, few robots: N = 1 and 2",
        tuple(signed("T_total", 2, fewer=(), more=(1, 2))),
    ),
    Claim(
        "Configuration 2: with many robots (N = 4 and 5) cooperation finishes earlier",
        tuple(signed("T_total", 2, fewer=(4, 5), more=())),
    ),
    Claim(
        "Configuration 2: the crossover lies between 3 and 4 robots",
        tuple(signed("T_total", 2, fewer=(4,), more=(3,))),
    ),
    Claim(
        "Configuration 2: 5 independent robots finish before 5 cooperative ones",
        tuple(signed("T_total", 2, fewer=(), more=(5,))),
    ),
    Claim(
        "T_R of independent robots has an optimum: it is higher with 5 than with some fewer",
        tuple(
            Figure(
                f"above the least, cfg {c}",
                rise_after_least(c, INDEPENDENT),
                at_least=0,
                strict=True,
            )
            for c in (1, 2)
        ),
    ),
    Claim(
        "Configuration 1: T_R of independent robots rises rapidly from 2 robots to 5",
        (
            Figure(
                "rise",
                lambda mean: mean("T_R", 1, INDEPENDENT, 5) / mean("T_R", 1, INDEPENDENT, 2) - 1,
                at_least=0.25,
                unit="%",
                why="`rapidly`, read as by a quarter",
            ),
        ),
        "Configuration 1 also seems to be unfavorable for the independent strategy, as the average robot "
        "cycles usage increases rapidly with the number of robots.",
    ),
    Claim(
        "T_Rtotal rises with every robot added",
        by_curve("smallest rise", lambda c, s: least_rise("T_Rtotal", c, s)),
    ),
    Claim(
        "T_Rtotal rises faster for independent robots (from 1 robot to 5)",
        tuple(
            Figure(f"difference of the rises, cfg {c}", steeper(c), at_least=0, strict=True)
            for c in (1, 2)
        ),
    ),
    Claim(
        "Configuration 2: cooperation needs 4 robots to have the smaller T_Rtotal",
        tuple(signed("T_Rtotal", 2, fewer=(4, 5), more=(1, 2, 3))),
    ),
    *empty_runs(),
)
