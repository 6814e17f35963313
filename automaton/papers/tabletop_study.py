"""Table 3 of Grzejszczak & Nocoń: two warehouses, two strategies, one to five robots.

T. Grzejszczak, W. Nocoń: Cooperative and individual planning strategies for autonomous robots in
warehouse parcel transportation. The figures are the printed ones. Those of empty runs (Figure 11) are
lost, so E_U has no printed figure, and its definition is open: all three readings are reported.

The paper forbids robots to communicate: each knows its own position and the list of orders. The runs
therefore use `information: orders`; a second table has robots that see the whole state.

A claim about "less" means a difference above zero; a claim with a number is compared with this number.
If a word needs a range ("the same", "rapidly"), the range is ours, and the figure says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import Final

from automaton.engine.state import ACTION_PICK
from automaton.errors import InputError
from automaton.papers.claims import Claim, Figure, MeanQuantity, above, below, claim, least, mean_of
from automaton.papers.reproduction_study import (
    Cases,
    Headline,
    Key,
    Label,
    PublishedTable,
    Reproduction,
    ScenarioCase,
    scenario_runs,
)
from automaton.runs.simulation import Simulation
from automaton.strategy import lookup
from automaton.studies.process_pool import run_and_measure

CONFIGURATIONS: Final = (1, 2)
INDEPENDENT: Final = "independent"
COOPERATIVE: Final = "cooperative"
TABLETOP_STRATEGIES: Final = (INDEPENDENT, COOPERATIVE)
TABLETOP_ROBOTS: Final = (1, 2, 3, 4, 5)

# (configuration, strategy): the printed figure for each number of robots.
T_TOTAL: Final = {
    (1, INDEPENDENT): (5145, 3441, 3000, 2756, 2820),
    (1, COOPERATIVE): (4621, 2961, 2364, 1853, 1957),
    (2, INDEPENDENT): (5657, 3776, 3285, 3172, 3134),
    (2, COOPERATIVE): (9436, 4670, 3764, 2944, 2736),
}
T_R: Final = {
    (1, INDEPENDENT): (1156, 867, 887, 906, 1198),
    (1, COOPERATIVE): (1130, 834, 593, 531, 671),
    (2, INDEPENDENT): (1443, 966, 873, 875, 1041),
    (2, COOPERATIVE): (1848, 1097, 864, 708, 787),
}
T_R_TOTAL: Final = {
    (1, INDEPENDENT): (1156, 1734, 2661, 3624, 5990),
    (1, COOPERATIVE): (1130, 1668, 1779, 2124, 3355),
    (2, INDEPENDENT): (1443, 1932, 2619, 3500, 5205),
    (2, COOPERATIVE): (1848, 2194, 2592, 2832, 3935),
}
TABLE_3: Final = {"T_total": T_TOTAL, "T_R": T_R, "T_Rtotal": T_R_TOTAL}

SEE_ORDERS: Final = "orders"  # what robots know: as published
SEE_EVERYTHING: Final = "everything"

E_U: Final = {"E_U_moves": "moves", "E_U_operations": "operations", "E_U_cycles": "cycles"}

SAME: Final = 0.02  # shares this close count as the same
FROM_TWO: Final = "from 2 robots on, since a single robot meets none; the paper gives no start"

TABLETOP_REMARKS: Final = (
    "Robots know the list of orders and the adjacent cells (information: orders), because in the paper "
    "they neither communicate nor see each other from afar. With information: everything they plan "
    "around all robots after a retreat; the crossover of configuration 2 then comes one robot earlier "
    "than in the paper.",
    "If the next cell is still occupied after a wait, a robot keeps its plan for one more try. The "
    "printed `Go to: 1` is `--set strategy.right_of_way.after_wait=replan`.",
    "T_Rtotal equals N times T_R in every printed cell: it was computed from the rounded T_R and is not "
    "an independent figure.",
    "The text states a shorter T_total of the independent strategy for few robots in configuration 1; "
    "the table shows this for configuration 2, and the opposite for configuration 1.",
    "According to the text, independent robots finish earlier with five robots in configuration 2; "
    "according to the table they finish later in both configurations.",
    "The reduction of 30 % at four robots is 32.8 % in the table.",
    "According to the text, cooperation needs four robots for a smaller T_Rtotal in configuration 2; in "
    "the table three robots are enough.",
    "The printed size of the floor leaves no column for the destinations, and configuration 2 has 6 "
    "destinations for 7 rows.",
    "After a wait the pseudo-code always replans, the text only if the cell is still occupied; without "
    "a retreat neither resolves a head-on meeting.",
    "The paper does not state when a robot begins to retreat, or what ends the search for a free shelf "
    "to the right (x_a + 2).",
    "Empty runs are introduced as moves without cargo, and then discussed as cycles and as time.",
    "No reading that we tried explains T_Rtotal at five robots in configuration 1 (5990 and 3355), or "
    "the rise of the cooperative T_total there from four robots to five.",
)


def cases(strategies: Sequence[str]) -> list[ScenarioCase]:
    """The cells of the table for these allocation strategies. Raises InputError."""
    for strategy in strategies:
        try:
            lookup.load("allocation", strategy)
        except InputError as error:
            raise InputError(f"--strategies: {error}") from error
    return [
        ScenarioCase(
            labels={"configuration": configuration, "strategy": strategy, "robots": robots},
            scenario=f"tabletop-{configuration}",
            overrides=(
                f"fleet.robots={robots}",
                f"strategy.allocation={strategy}",
                f"information={SEE_ORDERS}",
            ),
        )
        for configuration in CONFIGURATIONS
        for strategy in strategies
        for robots in TABLETOP_ROBOTS
    ]


def sixth(strategies: Sequence[str]) -> list[ScenarioCase]:
    """Six cooperative robots in configuration 1, which the publication did not run."""
    overrides = (
        "fleet.robots=6",
        f"strategy.allocation={COOPERATIVE}",
        f"information={SEE_ORDERS}",
    )
    labels: dict[str, Label] = {"configuration": 1, "strategy": COOPERATIVE, "robots": 6}
    return [ScenarioCase(labels, "tabletop-1", overrides)] if COOPERATIVE in strategies else []


def seeing_everything(cases: Cases) -> Cases:
    """The cases of Table 3 with robots that see the whole state."""

    def changed(strategies: Sequence[str]) -> list[ScenarioCase]:
        return [
            ScenarioCase(
                {**case.labels, "information": SEE_EVERYTHING},
                case.scenario,
                (*case.overrides[:-1], f"information={SEE_EVERYTHING}"),
            )
            for case in cases(strategies)
            if isinstance(case, ScenarioCase)
        ]

    return changed


def with_least_busy(simulation: Simulation) -> dict[str, float | int]:
    """The metrics of a run: number of picks of its least busy robot, and whether it never picked."""
    figures = run_and_measure(simulation)
    picks = int(simulation.world.tally.operations[:, ACTION_PICK].sum(1).min())
    return figures | {"least_picks": picks, "sixth_idle": float(picks == 0)}


def published(key: Key, metric: str) -> float | None:
    """The printed figure of (configuration, strategy, robots, ...), or None."""
    configuration, strategy, robots = key[:3]
    table = TABLE_3.get(metric, {})
    line = table.get((int(configuration), str(strategy)))
    return (
        None
        if line is None or robots not in TABLETOP_ROBOTS
        else line[TABLETOP_ROBOTS.index(int(robots))]
    )


def saved(name: str, configuration: int, robots: int) -> MeanQuantity:
    """The relative saving of cooperative robots against independent ones."""
    alone, together = (
        mean_of(name, configuration, strategy, robots) for strategy in TABLETOP_STRATEGIES
    )
    return alone - together


def rises(name: str, configuration: int, strategy: str) -> list[MeanQuantity]:
    """The change of a metric by each robot after the first."""
    by_robots = [mean_of(name, configuration, strategy, robots) for robots in TABLETOP_ROBOTS]
    return [after - before for before, after in pairwise(by_robots)]


def congestion(configuration: int, strategy: str, robots: int) -> MeanQuantity:
    """The robot cycles of a fleet beyond those of a single robot, relative to the latter."""
    alone = mean_of("T_total", configuration, strategy, 1)
    return robots * mean_of("T_total", configuration, strategy, robots) / alone - 1


def later_congestion(configuration: int, strategy: str) -> MeanQuantity:
    """The rise of congestion from two robots to five."""
    return congestion(configuration, strategy, 5) - congestion(configuration, strategy, 2)


def signed(
    name: str, configuration: int, fewer: tuple[int, ...] = (), more: tuple[int, ...] = ()
) -> Iterator[Figure]:
    """Figures: cooperation needs less than independence for N in `fewer`, and more for N in `more`."""
    for robots in sorted((*fewer, *more)):
        label = f"{name} saved by cooperation, N = {robots}"
        yield (above if robots in fewer else below)(label, saved(name, configuration, robots))


def by_curve(what: str, make: Callable[[int, str], MeanQuantity]) -> Iterator[Figure]:
    """Figures for each strategy and configuration, which must be above zero."""
    for c, s in product(CONFIGURATIONS, TABLETOP_STRATEGIES):
        yield above(f"{what}, {s}, cfg {c}", make(c, s))


def empty_runs() -> Iterator[Claim]:
    """The claims about empty runs, for each reading of their definition."""
    same = "read as within 2 points, for Figure 11 is lost"
    for name, reading in E_U.items():
        yield claim(
            f"Configuration 2: cooperative robots run empty less at every N (E_U by {reading})",
            *(
                above(f"less by, N = {n}", saved(name, 2, n), unit="points")
                for n in TABLETOP_ROBOTS
            ),
        )
        yield claim(
            f"Configuration 1: empty runs are the same with 3 to 5 robots (E_U by {reading})",
            *(
                Figure(f"less by, N = {n}", saved(name, 1, n), -SAME, SAME, unit="points", why=same)
                for n in TABLETOP_ROBOTS[2:]
            ),
        )


TABLETOP_CLAIMS: Final = (
    claim(
        "Configuration 1: cooperation cuts T_total by 30 % with 4 robots",
        Figure(
            "cut",
            saved("T_total", 1, 4) / mean_of("T_total", 1, INDEPENDENT, 4),
            at_least=0.3,
            unit="%",
            why="as the text says",
        ),
        source="In the optimal case of 4 robots in Configuration 1, the cooperative strategy resulted "
        "in a 30% decrease of the time needed for the completion of the whole task.",
    ),
    claim(
        "Configuration 1: cooperation shortens T_total at every N",
        *signed("T_total", 1, fewer=TABLETOP_ROBOTS),
    ),
    claim(
        "Configuration 1: 4 cooperative robots are the optimum, a fifth makes T_total longer",
        above("change by the fifth", rises("T_total", 1, COOPERATIVE)[-1]),
    ),
    claim(
        "Each robot added shortens T_total by less than the one before",
        *by_curve(
            "smallest drop of the gain",
            lambda c, s: least(b - a for a, b in pairwise(rises("T_total", c, s))),
        ),
    ),
    claim(
        "Congestion grows faster in configuration 2 (from 2 robots to 5)",
        *(
            above(
                f"more than in configuration 1, {s}",
                later_congestion(2, s) - later_congestion(1, s),
                unit="points",
                why=FROM_TWO,
            )
            for s in TABLETOP_STRATEGIES
        ),
        source="However, the greater the number of robots, the smaller the gain from addition of "
        "another robot. This congestion effect increases faster with the number of robots in "
        "Configuration 2, where for 5 robots T_total time is smaller if robots work in the "
        "independent mode.",
    ),
    claim(
        "Configuration 1: a sixth cooperative robot stays idle for good",
        Figure(
            "runs in which one of six never picks anything up",
            mean_of("sixth_idle", 1, COOPERATIVE, 6),
            at_least=1,
            unit="%",
        ),
        source="because in Configuration 1 only 5 corridors are available for the robots working in a "
        "cooperative mode, a greater number of robots was not tested, as it would result in a "
        "permanent inactivity of the \u201csixth\u201d robot.",
    ),
    claim(
        "Configuration 1: few robots (N = 1) finish earlier if independent",
        *signed("T_total", 1, more=(1,)),
    ),
    claim(
        "The same read for configuration 2, few robots: N = 1 and 2",
        *signed("T_total", 2, more=(1, 2)),
    ),
    claim(
        "Configuration 2: with many robots (N = 4 and 5) cooperation finishes earlier",
        *signed("T_total", 2, fewer=(4, 5)),
    ),
    claim(
        "Configuration 2: the crossover lies between 3 and 4 robots",
        *signed("T_total", 2, fewer=(4,), more=(3,)),
    ),
    claim(
        "Configuration 2: 5 independent robots finish before 5 cooperative ones",
        *signed("T_total", 2, more=(5,)),
    ),
    claim(
        "T_R of independent robots has an optimum: it is higher with 5 than with some fewer",
        *(
            above(
                f"above the least, cfg {c}",
                mean_of("T_R", c, INDEPENDENT, 5)
                - least(mean_of("T_R", c, INDEPENDENT, robots) for robots in TABLETOP_ROBOTS[:-1]),
            )
            for c in CONFIGURATIONS
        ),
    ),
    claim(
        "Configuration 1: T_R of independent robots rises rapidly from 2 robots to 5",
        Figure(
            "rise",
            mean_of("T_R", 1, INDEPENDENT, 5) / mean_of("T_R", 1, INDEPENDENT, 2) - 1,
            at_least=0.25,
            unit="%",
            why="`rapidly`, read as by a quarter",
        ),
        source="Configuration 1 also seems to be unfavorable for the independent strategy, as the "
        "average robot cycles usage increases rapidly with the number of robots.",
    ),
    claim(
        "T_Rtotal rises with every robot added",
        *by_curve("smallest rise", lambda c, s: least(rises("T_Rtotal", c, s))),
    ),
    claim(
        "T_Rtotal rises faster for independent robots (from 1 robot to 5)",
        *(
            above(
                f"difference of the rises, cfg {c}",
                saved("T_Rtotal", c, 5) - saved("T_Rtotal", c, 1),
            )
            for c in CONFIGURATIONS
        ),
    ),
    claim(
        "Configuration 2: cooperation needs 4 robots to have the smaller T_Rtotal",
        *signed("T_Rtotal", 2, fewer=(4, 5), more=(1, 2, 3)),
    ),
    *empty_runs(),
)

TABLE_OF_ORDERS: Final = PublishedTable(
    title="Table 3: robots know the list of orders",
    cases=cases,
    panels=(("T_total", "T_R", "T_Rtotal"), tuple(E_U)),
    published=published,
    shares=tuple(E_U),
)
SIXTH_ROBOT: Final = PublishedTable(
    title="A sixth robot, which has no alley of its own",
    cases=sixth,
    panels=(("T_total", "T_R", "least_picks", "sixth_idle"),),
    published=published,
    run=scenario_runs(with_least_busy),
    shares=("sixth_idle",),
)


def with_everything(table: PublishedTable, title: str) -> PublishedTable:
    """A table with robots that see the whole state."""
    cases = seeing_everything(table.cases)
    return replace(
        table, title=title, cases=cases, premise=f"information: {SEE_EVERYTHING}", grouped=2
    )


TABLETOP_HEADLINES: Final = (  # "saved" and "cut" denote reductions by cooperation.
    Headline("cfg 1: T_total cut, N = 4", "Configuration 1: cooperation cuts T_total"),
    Headline("cfg 1: change by a fifth", "Configuration 1: 4 cooperative"),
    Headline("cfg 1: T_total saved, N = 1", "Configuration 1: few robots"),
    Headline("cfg 2: T_total saved, N = 2", "The same read for configuration 2", figure=1),
    Headline("cfg 2: crossover (N = 3)", "Configuration 2: the crossover"),
    Headline("cfg 2: T_total saved, N = 5", "Configuration 2: 5 independent"),
    Headline("cfg 1: T_R rise, N = 2 to 5", "Configuration 1: T_R of independent"),
    Headline("cfg 2: T_Rtotal saved, N = 3", "Configuration 2: cooperation needs 4", figure=2),
    Headline("cfg 1: a sixth stays idle", "Configuration 1: a sixth"),
)

REPRODUCTION: Final = Reproduction(
    name="tabletop",
    title="Table-top warehouse, Table 3",
    source="Grzejszczak & Nocoń, Cooperative and individual planning strategies for autonomous "
    "robots in warehouse parcel transportation",
    strategies=TABLETOP_STRATEGIES,
    tables=(
        TABLE_OF_ORDERS,
        SIXTH_ROBOT,
        with_everything(
            TABLE_OF_ORDERS, "Table 3: robots see the whole state, which the paper forbids"
        ),
        with_everything(SIXTH_ROBOT, "A sixth robot, all of them seeing the whole state"),
    ),
    averaged=("T_total", "T_Rtotal"),
    premise=f"information: {SEE_ORDERS}",
    headlines=TABLETOP_HEADLINES,
    claims=TABLETOP_CLAIMS,
    remarks=TABLETOP_REMARKS,
)
