"""Bhattathiri, Li & Kuhl, Tables 1 to 5: a network, and a robot dispatched among five others.

S. Shaji Bhattathiri, M. P. Li, M. E. Kuhl: A Traffic Avoidance Path Planning Method for Autonomous
Vehicles in a Warehouse Environment. The paper does not define the effect of slow zones and the
predictions of its network completely, so the printed rows are compared with several readings. All lines
use the same trials (start, pick-up and drop-off of all robots).

Each claim is judged for each reading of the experiment. A printed mean over 100 trials is itself an
estimate, so the range is two standard errors around it; "less" means a difference above zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from automaton.papers.claims import Claim, Figure, Mean, MeanQuantity, above, below, claim, mean_of
from automaton.papers.reproduction_study import (
    Case,
    Headline,
    Key,
    PublishedTable,
    Reproduction,
    each_seed,
    fixed,
)
from automaton.papers.traffic_trials import (
    DEPTHS_TABLE,
    TABLES_1_TO_4,
    TRIALS,
    Setting,
    exact,
    network,
    noisy,
    run_seed,
)

A_STAR: Final = "A*"
AVOIDANCE: Final = "avoidance"
CAUTIOUS: Final = "most cautious"
MORE_THAN: Final = "more than A"

PRINTED_TIMES: Final = {  # as printed, the last two columns from the text
    A_STAR: {"time": 229.97, "distance": 160.25},
    AVOIDANCE: {"time": 180.53, "distance": 214.34, "taken": 0.39, "saving": 126.76},
}

PRINTED_TIMES_SD: Final = {  # printed in brackets, and that of the saving in the text
    A_STAR: {"time": 77.60, "distance": 46.96},
    AVOIDANCE: {"time": 59.81, "distance": 104.26, "saving": 70.35},
}

# Precision and recall of two rows of the paper's Tables 3 and 4: training and testing.
AS_TRAINED: Final = noisy(precision=0.40, recall=0.84)
AS_TESTED: Final = noisy(precision=0.05, recall=0.75)


@dataclass(frozen=True)
class TrialCase(Case):
    """A line of the table: the dispatched robot, with plain A* or with the path that it chooses."""

    setting: Setting
    plain: bool = False


def line(slowdown: str, path: str, counts: str, setting: Setting) -> TrialCase:
    """A case with its labels; `counts`: the predictions of the dispatched robot."""
    labels = {"slowdown": slowdown, "path": path, "counts": counts}
    return TrialCase(labels, setting, plain=path == A_STAR)


TRIAL_LINES: Final = (
    line("static", A_STAR, "-", Setting(exact)),
    line("static", AVOIDANCE, "exact", Setting(exact)),
    line("static", MORE_THAN, "exact", Setting(exact, more_than=True)),
    line("static", AVOIDANCE, ".40/.84", Setting(AS_TRAINED)),
    line("static", CAUTIOUS, ".40/.84", Setting(AS_TRAINED, cautious=True)),
    line("static", AVOIDANCE, ".05/.75", Setting(AS_TESTED)),
    line("static", AVOIDANCE, "network", Setting(network)),
    line("dynamic", A_STAR, "-", Setting(exact, "dynamic")),
    line("dynamic", AVOIDANCE, "exact", Setting(exact, "dynamic")),
)


def trials(case: TrialCase, seed: int) -> list[Mapping[str, float]]:
    """The trials of a line for a seed."""
    return [one.plain if case.plain else one.chosen for one in run_seed(case.setting, seed)]


def published(key: Key, metric: str) -> float | None:
    """The printed figure; all readings are compared with the same printed row."""
    path = A_STAR if key[1] == A_STAR else AVOIDANCE
    return PRINTED_TIMES[path].get(metric)


def published_sd(key: Key, metric: str) -> float | None:
    """The printed standard deviation over trials in these rows."""
    path = A_STAR if key[1] == A_STAR else AVOIDANCE
    return PRINTED_TIMES_SD[path].get(metric)


Reading = tuple[str, str, str]  # the labels of a case

PLAIN_A_STAR: Final = (A_STAR, "-")  # path and counts
PRINTED_TRIALS: Final = 100
# Standard deviation of the saving over all trials: 126.76 +- 70.35 in 39 of 100, else 0.
SAVING_SD: Final = (0.39 * (126.76**2 + 70.35**2) - (0.39 * 126.76) ** 2) ** 0.5

READINGS: Final = {  # (slowdown, path, counts): name
    ("static", AVOIDANCE, "exact"): "static, exact counts",
    ("static", MORE_THAN, "exact"): "static, exact counts, zones with more than A",
    ("static", AVOIDANCE, ".40/.84"): "static, counts with precision .40 and recall .84",
    ("static", CAUTIOUS, ".40/.84"): "the same counts, most cautious path",
    ("static", AVOIDANCE, ".05/.75"): "static, precision .05 and recall .75 as tested",
    ("static", AVOIDANCE, "network"): "static, our network's counts",
    ("dynamic", AVOIDANCE, "exact"): "dynamic, exact counts",
}


def saved(name: str, reading: Reading) -> Callable[[Mean], float]:
    """The reduction of a metric by avoidance."""
    return mean_of(name, reading[0], *PLAIN_A_STAR) - mean_of(name, *reading)


def per_alternative(reading: Reading) -> Callable[[Mean], float]:
    """Ticks saved per trial with an alternative route; 0 without such trials."""

    def ticks(mean: Mean) -> float:
        taken = mean("taken", *reading)
        return mean("saved", *reading) / taken if taken else 0.0

    return ticks


def around(label: str, of: Callable[[Mean], float], printed: float, sd: float) -> Figure:
    """A figure that agrees with a printed mean over 100 trials."""
    margin = 2 * sd / PRINTED_TRIALS**0.5
    why = f"the printed {printed} +- two standard errors of {PRINTED_TRIALS} trials"
    return Figure(label, of, printed - margin, printed + margin, digits=1, why=why)


def about_plain_a_star() -> Iterator[Claim]:
    """The claims about the printed line of plain A*, for both readings of slow zones."""
    for slowdown in ("static", "dynamic"):
        yield claim(
            f"Plain A* takes 229.97 steps over 160.25 cells ({slowdown})",
            around("time", mean_of("time", slowdown, *PLAIN_A_STAR), 229.97, 77.60),
            around("distance", mean_of("distance", slowdown, *PLAIN_A_STAR), 160.25, 46.96),
        )


STATEMENTS: Final[dict[str, Callable[[Reading], Figure]]] = {
    "Avoidance shortens the travel time": lambda reading: above(
        "saved", saved("time", reading), digits=1
    ),
    "It does so by 49.44 of 229.97 steps": lambda reading: around(
        "saved", saved("time", reading), 49.44, SAVING_SD
    ),
    "Plain A* has the shorter distance": lambda reading: below(
        "saved", saved("distance", reading), digits=1
    ),
    "An alternative is taken in less than half of the trials": lambda reading: below(
        "taken", mean_of("taken", *reading), 0.5, unit="%"
    ),
    "Where an alternative is taken it saves 126.76 steps": lambda reading: around(
        "saving", per_alternative(reading), 126.76, 70.35 / 0.39**0.5
    ),
    "The robot uses fewer zones together with others": lambda reading: above(
        "fewer encounters", saved("encounters", reading), digits=1
    ),
}


def spread(name: str, *key: str) -> MeanQuantity:
    """The standard deviation of a metric over trials."""
    square, mean = mean_of(f"{name}_squared", *key), mean_of(name, *key)
    return MeanQuantity(lambda of: max(0.0, square(of) - mean(of) ** 2) ** 0.5)


def about_spreads() -> Iterator[Claim]:
    """The claims about the printed standard deviations, whose standard errors are about 7 %."""
    error = 1 / (2 * (PRINTED_TRIALS - 1)) ** 0.5
    readings: dict[Reading, str] = {
        (slowdown, *PLAIN_A_STAR): f"plain A*, {slowdown}" for slowdown in ("static", "dynamic")
    }
    for reading, name in (readings | READINGS).items():
        printed = PRINTED_TIMES_SD[A_STAR if reading[1] == A_STAR else AVOIDANCE]
        yield claim(
            f"Times spread by {printed['time']:.2f} and distances by {printed['distance']:.2f} ({name})",
            *(
                Figure(
                    f"sd of {metric}",
                    spread(metric, *reading),
                    printed[metric] * (1 - 2 * error),
                    printed[metric] * (1 + 2 * error),
                    digits=1,
                    why=f"the printed {printed[metric]:.2f} +- two of its standard errors",
                )
                for metric in ("time", "distance")
            ),
        )


def about_avoidance() -> Iterator[Claim]:
    """The claims about traffic avoidance, for each reading."""
    for statement, figure in STATEMENTS.items():
        for reading, name in READINGS.items():
            yield claim(f"{statement} ({name})", figure(reading))


def about_depth() -> Iterator[Claim]:
    """The claims about the number of hidden layers.

    They rest on one stored training each. Other initial weights and orders of legs may give other
    results, so a single training decides nothing.
    """
    for loss, name in (("hinge", "the printed hinge loss"), ("cross-entropy", "cross-entropy")):
        yield claim(
            f"Deeper networks do not converge ({name})",
            *(
                Figure(
                    f"least loss beyond that of a constant answer, {hidden} hidden layers",
                    mean_of("beyond", "depth", loss, hidden),
                    at_least=0,
                    digits=5,
                )
                for hidden in (6, 12)
            ),
            source="The deeper neural networks did not converge, so a shallow network was employed.",
        )


TRAFFIC_REMARKS: Final = (
    "The paper reports 180.53 steps over 214.34 cells for traffic avoidance, but every cell takes at "
    "least one step. 180.53 = 229.97 - 0.39 x 126.76, so it is the mean over all trials.",
    "The reported network (precision 0.05, recall 0.75 in testing) predicts robots in nearly all zones: "
    "with such counts avoidance gains next to nothing.",
    "The biases start at log(N1/N0), which favours empty zones; the text says the opposite.",
    "Equation 7 (Matthews' correlation) lacks the factor TN + FP and its parentheses.",
    "Zones with more than A robots are obstacles, with A = 1 to 6, and A = 6 is meant to equal plain A*; "
    "with five other robots A = 5 would, too. Here zones with A or more robots are closed, and plain A* "
    "is an additional candidate; the line `more than A` closes zones with more than A (in a scenario "
    "`closed_from: more than A`).",
    "All cells that are not zero are obstacles: this would close the intersections.",
    "At most two robots can pass in an aisle, but up to six robots in a zone slow it down.",
    "The hinge loss as printed, with y of 0 or 1, is constant for y = 0: nothing lowers an output, so "
    "training ends with every zone predicted (Tables 1 to 4: loss hinge).",
    "Hamming loss is 1 - accuracy, so the rows that monitor accuracy, Hamming loss, or both must be "
    "equal, but they are printed with different values.",
    "The paper reports zero training accuracy of other classifiers. On single legs each has some "
    "(`automaton train traffic --classifiers`), if accuracy means that every zone is right.",
    "Tables 2 to 4 have impossible lines, such as accuracy 1.00 with precision and recall 0.",
    "With the printed loss, networks with three, six and twelve hidden layers all converge to the "
    "constant answer; with cross-entropy six and twelve layers learn more slowly than three (one "
    "training each, five epochs).",
    "The paper does not state how long other robots stay in a zone. If every planned use of a zone "
    "counts (static), we reproduce the printed A* time; if only robots that are there at the time count "
    "(dynamic), A* loses next to nothing, and avoidance has nothing to gain.",
    "No reading that we tried reproduces both the printed share of alternatives and the printed saving "
    "per alternative.",
)

TRAFFIC_CLAIMS: Final = (
    *about_plain_a_star(),
    *about_avoidance(),
    *about_spreads(),
    *about_depth(),
)

STATIC_CASE: Final = ("static", AVOIDANCE, "exact")
PLAIN_LINE: Final = "Plain A* takes 229.97 steps over 160.25 cells (static)"
SPREAD_LINE: Final = "Times spread by 59.81 and distances by 104.26 (static, exact counts)"
TAKEN_LINE: Final = "An alternative is taken in less than half of the trials (static, "
TRAFFIC_HEADLINES: Final = (
    Headline("A*: time", PLAIN_LINE),
    Headline("A*: distance", PLAIN_LINE, figure=1),
    Headline("A*: sd of time", "Times spread by 77.60", printed=77.60),
    Headline("avoidance: time", cell=("time", STATIC_CASE), digits=1),
    Headline("avoidance: distance", cell=("distance", STATIC_CASE), digits=1),
    Headline("avoidance: sd of time", SPREAD_LINE, printed=59.81),
    Headline("avoidance: sd of distance", SPREAD_LINE, figure=1, printed=104.26),
    Headline(
        "steps saved by avoidance", "It does so by 49.44 of 229.97 steps (static, exact counts)"
    ),
    Headline("alternative taken", f"{TAKEN_LINE}exact counts)"),
    Headline("... by counts of .40/.84", f"{TAKEN_LINE}counts"),
    Headline(
        "saved where it is taken",
        "Where an alternative is taken it saves 126.76 steps (static, exact counts)",
        printed=126.76,
    ),
    Headline("dynamic: steps saved", "Avoidance shortens the travel time (dynamic"),
)

REPRODUCTION: Final = Reproduction(
    name="traffic",
    title="Warehouse with slow zones, Tables 1 to 5",
    source="Shaji Bhattathiri, Li & Kuhl, A traffic avoidance path planning method for autonomous "
    "vehicles in a warehouse environment",
    tables=(
        PublishedTable(
            title="Table 5: travel time and distance",
            cases=fixed(TRIAL_LINES),
            panels=(("time", "distance"), ("taken", "saving", "encounters")),
            published=published,
            printed_sd=published_sd,
            run=each_seed(trials),
            repetition="trial",
            per_seed=TRIALS,
            shares=("taken",),
            digits=1,
            grouped=1,
        ),
        TABLES_1_TO_4,
        DEPTHS_TABLE,
    ),
    claims=TRAFFIC_CLAIMS,
    remarks=TRAFFIC_REMARKS,
    headlines=TRAFFIC_HEADLINES,
    seeds=10,
)
