"""Bhattathiri, Li & Kuhl, Tables 1 to 5: a network, and a robot dispatched among five others.

S. Shaji Bhattathiri, M. P. Li, M. E. Kuhl: A Traffic Avoidance Path Planning Method for Autonomous
Vehicles in a Warehouse Environment. The paper leaves open how a slow zone is read and what its
network really foresees, so the printed rows stand beside several readings. The same trials (start,
pick-up and drop-off of all robots) serve every line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from automaton.papers.reproduction_study import Case, Key, Reproduction, Table
from automaton.papers.traffic.traffic_claims import CLAIMS, REMARKS
from automaton.papers.traffic.traffic_network import DEPTHS, TABLES_1_TO_4, network
from automaton.papers.traffic.traffic_trials import TRIALS, Setting, exact, noisy, run_seeds
from automaton.runs.process_pool import OnDone

A_STAR: Final = "A*"
AVOIDANCE: Final = "avoidance"
CAUTIOUS: Final = "most cautious"

TABLE_5: Final = {  # as printed, the last two columns from the text
    A_STAR: {"time": 229.97, "distance": 160.25},
    AVOIDANCE: {"time": 180.53, "distance": 214.34, "taken": 0.39, "saving": 126.76},
}

# Precision and recall of two rows of the paper's Tables 3 and 4: training and testing.
TRAINED: Final = noisy(precision=0.40, recall=0.84)
TESTED: Final = noisy(precision=0.05, recall=0.75)


@dataclass(frozen=True)
class TrialCase(Case):
    """A line of the table: the robot of these trials, by plain A* or by the path it chose."""

    setting: Setting
    plain: bool = False


def line(slowdown: str, path: str, counts: str, setting: Setting) -> TrialCase:
    """A case with its labels; `counts` is what the dispatched robot foresees."""
    labels = {"slowdown": slowdown, "path": path, "counts": counts}
    return TrialCase(labels, setting, plain=path == A_STAR)


LINES: Final = (
    line("static", A_STAR, "-", Setting(exact)),
    line("static", AVOIDANCE, "exact", Setting(exact)),
    line("static", AVOIDANCE, ".40/.84", Setting(TRAINED)),
    line("static", CAUTIOUS, ".40/.84", Setting(TRAINED, cautious=True)),
    line("static", AVOIDANCE, ".05/.75", Setting(TESTED)),
    line("static", AVOIDANCE, "network", Setting(network)),
    line("dynamic", A_STAR, "-", Setting(exact, "dynamic")),
    line("dynamic", AVOIDANCE, "exact", Setting(exact, "dynamic")),
)


@dataclass(frozen=True)
class Figures:
    """The figures of one trial."""

    metrics: Mapping[str, float]
    finished: bool = True


def run_lines(
    cases: Sequence[TrialCase],
    seeds: Sequence[int],
    workers: int | None = None,
    on_done: OnDone | None = None,
) -> list[list[Figures]]:
    """The trials of each line. They take tenths of a second, so one process does them all."""
    found = []
    for case in cases:
        trials = run_seeds(case.setting, seeds)
        found.append([Figures(one.plain if case.plain else one.chosen) for one in trials])
        if on_done is not None:
            on_done(len(trials))
    return found


def published(key: Key, metric: str) -> float | None:
    """The printed figure; each reading stands beside the same printed row."""
    path = A_STAR if key[1] == A_STAR else AVOIDANCE
    return TABLE_5[path].get(metric)


REPRODUCTION: Final = Reproduction(
    name="traffic",
    title="Warehouse with slow zones, Tables 1 to 5",
    source="Shaji Bhattathiri, Li & Kuhl, A traffic avoidance path planning method for autonomous "
    "vehicles in a warehouse environment",
    strategies=(),
    tables=(
        Table(
            title="Table 5: travel time and distance",
            cases=lambda strategies: LINES,
            panels=(("time", "distance"), ("taken", "saving", "encounters")),
            published=published,
            run=run_lines,
            repetition="trial",
            per_seed=TRIALS,
            shares=("taken",),
            digits=1,
            grouped=1,
        ),
        TABLES_1_TO_4,
        DEPTHS,
    ),
    averaged=(),
    claims=CLAIMS,
    remarks=REMARKS,
    seeds=10,
)
