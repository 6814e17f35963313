"""Table 3 of Grzejszczak & Nocoń: two warehouses, two strategies, one to five robots.

T. Grzejszczak, W. Nocoń: Cooperative and individual planning strategies for autonomous robots in
warehouse parcel transportation. The figures are the printed ones; those of empty runs (Figure 11)
are lost, so E_U has no printed figure, and its definition is open: all three readings are reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from automaton.engine.state import ACTION_PICK
from automaton.errors import InputError
from automaton.papers.reproduction_study import Key, Label, Reproduction, ScenarioCase, Table
from automaton.papers.scenario_runs import Figures, conduct_all
from automaton.papers.tabletop.tabletop_claims import CLAIMS
from automaton.runs.process_pool import run_and_measure
from automaton.runs.simulation import Simulation
from automaton.strategy import lookup

CONFIGURATIONS: Final = (1, 2)
STRATEGIES: Final = ("independent", "cooperative")
ROBOTS: Final = (1, 2, 3, 4, 5)

# (configuration, strategy): one figure for each number of robots, as printed.
T_TOTAL: Final = {
    (1, "independent"): (5145, 3441, 3000, 2756, 2820),
    (1, "cooperative"): (4621, 2961, 2364, 1853, 1957),
    (2, "independent"): (5657, 3776, 3285, 3172, 3134),
    (2, "cooperative"): (9436, 4670, 3764, 2944, 2736),
}
T_R: Final = {
    (1, "independent"): (1156, 867, 887, 906, 1198),
    (1, "cooperative"): (1130, 834, 593, 531, 671),
    (2, "independent"): (1443, 966, 873, 875, 1041),
    (2, "cooperative"): (1848, 1097, 864, 708, 787),
}
T_R_TOTAL: Final = {
    (1, "independent"): (1156, 1734, 2661, 3624, 5990),
    (1, "cooperative"): (1130, 1668, 1779, 2124, 3355),
    (2, "independent"): (1443, 1932, 2619, 3500, 5205),
    (2, "cooperative"): (1848, 2194, 2592, 2832, 3935),
}
EMPTY_RUNS: Final = ("E_U_moves", "E_U_operations", "E_U_cycles")
TABLE_3: Final = {"T_total": T_TOTAL, "T_R": T_R, "T_Rtotal": T_R_TOTAL}

REMARKS: Final = (
    "T_Rtotal is N times T_R in every printed cell, to the unit: it was computed from a rounded "
    "T_R and is no figure of its own.",
    "The text credits the independent strategy with the shorter T_total for few robots in "
    "configuration 1; the table shows that for configuration 2, and the opposite for 1.",
    "The text has independent robots finish earlier with five robots in configuration 2; the "
    "table has them finish later, there and in configuration 1.",
    "The reduction of 30 % at four robots is 32.8 % in the table.",
    "Cooperation is said to need four robots before its T_Rtotal is the smaller one in "
    "configuration 2; in the table three are enough.",
    "The floor's printed size leaves no column for the destinations, and configuration 2 has 6 "
    "destinations beside 7 rows.",
    "After a wait the pseudo-code always plans anew, the text only if the cell is still held; "
    "without a withdrawal neither resolves a head-on meeting.",
    "Nothing says when a robot begins to withdraw, nor what ends the search for a free shelf to "
    "the right (x_a + 2).",
    "Empty runs are introduced as moves without cargo and then discussed as cycles and as time.",
    "Unexplained by any reading tried: T_Rtotal at five robots in configuration 1 (5990 and "
    "3355), and the cooperative T_total that rises there from four robots to five.",
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
            overrides=(f"fleet.robots={robots}", f"strategy.allocation={strategy}"),
        )
        for configuration in CONFIGURATIONS
        for strategy in strategies
        for robots in ROBOTS
    ]


def sixth(strategies: Sequence[str]) -> list[ScenarioCase]:
    """Six cooperative robots in configuration 1, which the publication did not run."""
    overrides = "fleet.robots=6", "strategy.allocation=cooperative"
    labels: dict[str, Label] = {"configuration": 1, "strategy": "cooperative", "robots": 6}
    return [ScenarioCase(labels, "tabletop-1", overrides)] if "cooperative" in strategies else []


def with_least_busy(simulation: Simulation) -> Figures:
    """A run to its end: how often its least busy robot picked up something, and whether it never did."""
    figures = run_and_measure(simulation)
    least = int(simulation.world.tally.operations[:, ACTION_PICK].sum(1).min())
    return figures | {"least_picks": least, "sixth_idle": float(least == 0)}


def published(key: Key, metric: str) -> float | None:
    """The printed figure of (configuration, strategy, robots); None where there is none."""
    configuration, strategy, robots = key
    table = TABLE_3.get(metric, {})
    line = table.get((int(configuration), str(strategy)))
    return None if line is None or robots not in ROBOTS else line[ROBOTS.index(int(robots))]


REPRODUCTION: Final = Reproduction(
    name="tabletop",
    title="Table-top warehouse, Table 3",
    source="Grzejszczak & Nocoń, Cooperative and individual planning strategies for autonomous "
    "robots in warehouse parcel transportation",
    strategies=STRATEGIES,
    tables=(
        Table(
            cases=cases,
            panels=(("T_total", "T_R", "T_Rtotal"), EMPTY_RUNS),
            published=published,
            shares=EMPTY_RUNS,
        ),
        Table(
            title="A sixth robot, which has no alley of its own",
            cases=sixth,
            panels=(("T_total", "T_R", "least_picks", "sixth_idle"),),
            published=published,
            run=conduct_all(with_least_busy),
            shares=("sixth_idle",),
        ),
    ),
    averaged=("T_total", "T_Rtotal"),
    claims=CLAIMS,
    remarks=REMARKS,
)
