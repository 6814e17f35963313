"""One robot that serves lines one by one is an M/G/1 queue, whose mean wait is known exactly.

Lines arrive singly, in each tick with probability p; each needs a trip of 32 ticks plus its handling. The
mean wait from release to start in whole ticks is p E[S (S - 1)] / (2 (1 - p E[S])) for trips of S ticks
(Pollaczek and Khinchine in discrete time). Each wait follows from the previous wait W as the larger of 0
and W + S - A, with A ticks between the releases (Lindley).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from automaton.engine.state import Array, World
from automaton.papers.claims import Claim, Figure, claim, mean_of
from automaton.papers.reproduction_study import (
    Headline,
    Key,
    PublishedTable,
    Reproduction,
    RunCase,
    each_seed,
    fixed,
)
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.world.resolve import resolve

QUEUE_LINES: Final = 20_000
INTERARRIVAL: Final = 65  # mean ticks between two lines
DRIVE: Final = 32  # ticks of a trip without its handling: 26 moves, a pick and a drop
MEAN, SD = 20.0, 10.0  # ticks of handling
WITHIN: Final = 3  # standard errors of the mean of the runs

FIXED, EXPONENTIAL, LOGNORMAL = "20 ticks", "exponential, mean 20", "lognormal, mean 20, sd 10"
HANDLING_TIMES: Final = {
    FIXED: MEAN,
    EXPONENTIAL: {"exponential": MEAN},
    LOGNORMAL: {"lognormal": {"mean": MEAN, "sd": SD}},
}
ONE_RUN_SD: Final = {FIXED: 4.9, EXPONENTIAL: 6.6, LOGNORMAL: 5.2}  # of the mean wait, in ticks
QUEUE_RUNS: Final = 24

# Second moments of the handling in whole ticks; rounding the lognormal one adds 1/12.
VARIANCE: Final = {FIXED: 0.0, EXPONENTIAL: MEAN * (MEAN - 1), LOGNORMAL: SD * SD + 1 / 12}

PICTURE: Final = """\
>>>>>>>>>v
^#pqqq#q#v
^########v
^<<<<t<<<<"""


def scenario_of(handling: str) -> dict[str, object]:
    """The scenario of one robot and one pod with this handling."""
    return {
        "name": "queue",
        "layout": {"picture": PICTURE},
        "fleet": {"robots": 1, "kinematics": "omni", "start": [[2, 1]]},
        "durations": {"pick": 3, "drop": 3, "handling": {"line": HANDLING_TIMES[handling]}},
        "pods": {"join": False},
        "orders": {"lines": {"count": QUEUE_LINES, "mean_interarrival_time": INTERARRIVAL}},
        "strategy": {"allocation": "first-come", "right_of_way": "wait"},
        "stop": {"when": "delivered", "max_duration": 100_000_000},
    }


def exact_wait(handling: str) -> float:
    """The mean wait in ticks."""
    p, mean = 1 / INTERARRIVAL, DRIVE + MEAN
    second = VARIANCE[handling] + mean * mean - mean  # E[S (S - 1)]
    return p * second / (2 * (1 - p * mean))


class QueueCase(RunCase):
    """A case with a distribution of the handling time."""

    @property
    def own_settings(self) -> tuple[str, ...]:
        return (f"durations.handling.line={HANDLING_TIMES[str(self.key[0])]}",)

    def check(self) -> None:
        resolve(queue_scenario(self), self.settings)


def queue_scenario(case: RunCase) -> Scenario:
    """The scenario of a case without further settings."""
    import msgspec

    return msgspec.convert(scenario_of(str(case.key[0])), Scenario)


def waits(case: RunCase, seed: int) -> Sequence[Mapping[str, float]]:
    """The mean wait of a run, and the number of lines whose wait violates Lindley's recursion."""
    simulation = Simulation(resolve(queue_scenario(case), case.settings, seed))
    simulation.run()
    released, taken, service = times_of(simulation.world)
    wait = taken - released
    expected = np.maximum(0, wait[:-1] + service[:-1] - np.diff(released))
    return [{"wait": float(wait.mean()), "wrong_lines": int((wait[1:] != expected).sum())}]


def times_of(world: World) -> tuple[Array, Array, Array]:
    """The ticks in which each line was released and taken, and the ticks of its trip."""
    orders = world.orders
    first = orders.first_stop[:-1]
    service = DRIVE + world.stops.ticks[first].astype(np.int64)
    return orders.release_tick.astype(np.int64), orders.dispatched.astype(np.int64), service


def published(key: Key, metric: str) -> float | None:
    """The theoretical values."""
    return exact_wait(str(key[0])) if metric == "wait" else 0.0


def as_computed() -> Claim:
    """The claim that mean waits agree with the formula."""
    return claim(
        "The mean wait is that of an M/G/1 queue",
        *(
            Figure(
                f"mean wait - formula, handling {name}",
                mean_of("wait", name) - exact_wait(name),
                at_least=-WITHIN * spread,
                at_most=WITHIN * spread,
                digits=1,
                why="three standard errors of six runs",
            )
            for name, spread in ((name, sd / math.sqrt(6)) for name, sd in ONE_RUN_SD.items())
        ),
    )


def line_by_line() -> Claim:
    """The claim that each wait follows from the one before."""
    return claim(
        "Each wait follows from the one before",
        *(
            Figure(
                f"lines with another wait, handling {name}",
                mean_of("wrong_lines", name),
                at_most=0,
                certain=True,
            )
            for name in HANDLING_TIMES
        ),
    )


REPRODUCTION: Final = Reproduction(
    name="queues",
    title=f"One robot, one pod, {QUEUE_LINES:,} lines: an M/G/1 queue at a load of 0.8",
    source="Pollaczek and Khinchine's formula in discrete time; Lindley's recursion",
    strategies=(),
    tables=(
        PublishedTable(
            title="Ticks from release to taken, and lines that waited otherwise than Lindley says",
            cases=fixed([QueueCase({"handling": name}) for name in HANDLING_TIMES]),
            panels=(("wait", "wrong_lines"),),
            run=each_seed(waits),
            published=published,
        ),
    ),
    averaged=("wait", "wrong_lines"),
    headlines=(
        *(Headline(name, cell=("wait", (name,)), digits=1) for name in HANDLING_TIMES),
        Headline("wait - formula, 20 ticks", "The mean wait"),
        Headline("lines with another wait", "Each wait follows"),
    ),
    seeds=QUEUE_RUNS,
    claims=(as_computed(), line_by_line()),
    remarks=(
        "The handling is rounded to whole ticks, which adds a variance of 1/12 tick squared to the "
        "lognormal one.",
    ),
    remarks_title="What is computed",
)
