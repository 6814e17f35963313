"""Runs of the factory of Keith & La: configurations, printed figures, and metrics of a run.

Travel is the distance that robots drive between stations. The first leg of each robot, from its start to
the station of its first order, does not count, as in the publication. The time to complete ends with the
last work at a station.

The paper prints a share of time in balance for SA and GA, and "NA" for DDZ, whose robots compare their
own loads. Here an observer examines the zones of DDZ once a minute and computes the same SVp from the
same flow of the last 20 minutes: 0 < SVp <= 0.2 is in balance, as in SA and GA. Each observation counts
up to the next one. The observer does not affect the run.

Figure 5 compares finished parts over time with the printed curves. The latter are the authors' series,
sampled every quarter of an hour (the last value before it). The series of DDZ ends at 8.36 h with 98
parts; only Table 5 includes the last two parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import ACTION_MOVE, ACTION_PICK, NIL, Array
from automaton.papers.reproduction_study import (
    Cases,
    Key,
    MeasuredRepetition,
    Reproduced,
    ScenarioCase,
    fixed,
)
from automaton.runs.headless import run_to_end
from automaton.runs.simulation import Simulation
from automaton.units import SECONDS_PER_UNIT, unit
from strategies.zoning.loads_and_transfers import find_loads
from strategies.zoning.monitored import space_of
from strategies.zoning.zone_queues import record_flow, rules_of_zones, ticks

SA: Final = "SA"
GA: Final = "GA"
GA_PRINTED: Final = "GA, 100 x 60 as printed"
GA_STARTS: Final = "GA, zones near the starts"
UNMATCHED: Final = "GA, zones to any robot"
DDZ: Final = "DDZ, stops of 862 s"
DDZ_LIMITED: Final = "DDZ, stops, limited view"
DDZ_FREE: Final = "DDZ, no stops"
DDZ_FREE_SA_DESIGN: Final = "DDZ, no stops, SA's design"
NO_SHARING: Final = "SA, no load sharing"
SA_DDZ_DESIGN: Final = "SA, DDZ's design"
ZONES_FIXED_SHARING: Final = "zones fixed, load sharing"
ZONES_FIXED: Final = "zones fixed"
DDZ_FIXED: Final = "DDZ, zones fixed"
DDZ_NEAR: Final = "DDZ, no stops, shares near"
DDZ_NEAR_STOPS: Final = "DDZ, stops, shares near"
DDZ_DROPS: Final = "DDZ, no stops, drops near"
DDZ_NEAR_DROPS: Final = "DDZ, no stops, both"

FACTORY: Final = "factory"
LOGGED: Final = "design: factory-logged, adjacency: 243.6437908496732"
NEGOTIATED_ZONING: Final = "strategy.zoning={{name: decentralized, design: {}, adjacency: 300{}}}"
GENETIC: Final = "strategy.zoning={{name: genetic, " + LOGGED + ", {}}}"
QUICK: Final = "generations: 12, population: 30"  # reduces the time of a run to a third
PUBLISHED_SIZE: Final = "generations: 100, population: 60"
# The authors' robots start at (72, 10), (30, 276) and (230, 10) ft from the lower left. These points lie
# on no aisle, so our robots start at stations 11, 1 and 18.
POSES: Final = "[[29, 152], [12, 46], [92, 152]]"
DESIGN_STOPS: Final = ", pause: 862"
DROP_NEAR: Final = ", drop_near: 150"  # feet: half of what is adjacent
MANY: Final = "many"  # label of the runs that the main claim is judged by
FACTORY_SINGLE: Final = "factory-single"


def negotiated(more: str = "", design: str = "factory-ddz") -> tuple[str, ...]:
    """Decentralized zones; robots talk within 328 ft, but see everything (LIMITED: what is near)."""
    return (NEGOTIATED_ZONING.format(design, more),)


ZONING_SETTINGS: Final[Mapping[str, tuple[str, ...]]] = {
    SA: (),
    GA: (GENETIC.format(f"{QUICK}, poses: {POSES}"),),
    GA_PRINTED: (GENETIC.format(f"{PUBLISHED_SIZE}, poses: {POSES}"),),
    GA_STARTS: (GENETIC.format(QUICK),),
    UNMATCHED: (GENETIC.format(f"{QUICK}, matched: false"),),
    DDZ: negotiated(DESIGN_STOPS),
    DDZ_FREE: negotiated(),
    DDZ_FREE_SA_DESIGN: negotiated(design="factory-logged"),
    NO_SHARING: ("strategy.zoning.sharing=false",),
    SA_DDZ_DESIGN: ("strategy.zoning.design=factory-ddz",),
    ZONES_FIXED_SHARING: (f"strategy.zoning={{name: static, {LOGGED}}}",),
    ZONES_FIXED: (f"strategy.zoning={{name: static, {LOGGED}, sharing: false}}",),
    DDZ_FIXED: negotiated(", patience: 100000"),
    DDZ_NEAR: negotiated(", sharing: true"),
    DDZ_NEAR_STOPS: negotiated(f"{DESIGN_STOPS}, sharing: true"),
    DDZ_DROPS: negotiated(DROP_NEAR),
    DDZ_NEAR_DROPS: negotiated(f", sharing: true{DROP_NEAR}"),
    DDZ_LIMITED: (
        *negotiated(DESIGN_STOPS),
        "information={radius: 131, shape: circle, orders: zones}",
    ),
}
JUDGED: Final = (
    SA,
    NO_SHARING,
    DDZ,
    DDZ_FREE,
    DDZ_NEAR,
    DDZ_NEAR_STOPS,
)  # by how evenly robots drive

GENETIC_IN_PRINT: Final = {
    "hours": 6.13,
    "in_balance": 0.2371,
    "mean_ft": 54454.17,
    "sigma_ft": 3678.93,
}
# Table 5; redesigns: from the log of the run.
PRINTED_FIGURES: Final[Mapping[str, Mapping[str, float]]] = {
    SA: {"hours": 5.94, "in_balance": 0.3932, "mean_ft": 56220.83, "sigma_ft": 4145.01},
    GA: GENETIC_IN_PRINT,
    GA_PRINTED: GENETIC_IN_PRINT,
    DDZ: {"hours": 8.62, "mean_ft": 66250.67, "sigma_ft": 1295.22, "redesigns": 9},
}


class Reference(NamedTuple):
    """Results of an independent event-driven program with the same rules: means and sds over runs."""

    runs: int
    hours: tuple[float, float]
    mean_ft: tuple[float, float]
    sigma_ft: tuple[float, float]
    redesigns: tuple[float, float]


REFERENCE_MEANS: Final[Mapping[str, Reference]] = {
    SA: Reference(24, (5.67, 0.30), (55676, 2022), (2295, 1263), (10.9, 1.6)),
    GA: Reference(10, (5.69, 0.50), (54079, 1609), (2250, 1445), (11.0, 1.3)),
    DDZ: Reference(24, (7.49, 1.00), (59212, 4257), (4262, 1605), (5.5, 2.2)),
    DDZ_FREE: Reference(24, (5.77, 0.38), (59196, 4207), (3801, 1699), (6.0, 1.9)),
    DDZ_FREE_SA_DESIGN: Reference(24, (5.77, 0.38), (57894, 3289), (4082, 1421), (5.5, 1.8)),
    NO_SHARING: Reference(24, (6.52, 0.33), (60702, 3237), (3614, 2124), (12.9, 1.5)),
    SA_DDZ_DESIGN: Reference(24, (5.78, 0.29), (55285, 1773), (1956, 1133), (11.2, 1.3)),
    ZONES_FIXED_SHARING: Reference(3, (5.76, 0.02), (48523, 229), (20101, 188), (0.0, 0.0)),
    ZONES_FIXED: Reference(3, (9.54, 0.02), (57043, 123), (36846, 163), (0.0, 0.0)),
    DDZ_FIXED: Reference(3, (7.78, 0.06), (53931, 241), (22455, 238), (0.0, 0.0)),
}

LOOK_S: Final = 60.0
WINDOW_MIN: Final = 20.0
IN_BALANCE: Final = 0.2
ADJACENCY_FT: Final = 243.6437908496732  # of SA and GA; loads do not depend on this or on tip_pairs
CURVE_EVERY: Final = 0.25  # hours between two points of a throughput curve
CURVE_UNTIL: Final = 12.0
PUBLISHED_CURVES: Final[Mapping[str, str]] = {  # parts at 0 h, 0.25 h, 0.5 h ...
    SA: "0 0 0 0 3 6 10 13 15 20 23 26 33 38 43 52 57 62 69 73 80 89 94 97 99 100",
    GA: "0 0 0 3 5 9 12 16 18 21 27 34 39 42 49 55 58 63 68 74 79 87 92 95 97 100",
    DDZ: "0 0 0 0 0 0 1 2 3 4 7 7 7 7 9 14 17 24 29 37 39 41 42 42 49 56 65 73 80 85 89 91 94 96 98",
}
DRAWN_CURVES: Final = (SA, GA, DDZ, DDZ_FREE)
BAND: Final = (5, 95)  # percent of our runs
ALL: Final = 100  # parts
LINES_EVERY: Final = 2  # points of time per line
CURVE: Final = "parts at "  # prefix of a point's name, before the hour

SIGMA: Final = "sigma_ft"
SMALLER: Final = "P(sigma smaller)"
BOOTSTRAPS: Final = 2000
WIDEST: Final = 0.05  # largest half-width of an interval that counts as precise

PAIRS: Final = (  # pairs whose sigmas are compared
    (DDZ_FREE, NO_SHARING),  # without load sharing and without stops
    (DDZ, SA),  # as published
    (DDZ_FREE, SA),
    (DDZ_NEAR, NO_SHARING),
    (DDZ_NEAR, SA),
    (DDZ_NEAR, DDZ_FREE),
    (DDZ_NEAR_STOPS, SA),
    (DDZ_NEAR_STOPS, DDZ),
)

Figures = dict[str, float | int]
Pair = tuple[str, str, tuple[Sequence[float], Sequence[float]]]


def cases_named(names: Iterable[str], scenario: str = FACTORY, **labels: str) -> Cases:
    """The configurations with these names, with further labels."""
    return fixed(
        [
            ScenarioCase({"configuration": name, **labels}, scenario, ZONING_SETTINGS[name])
            for name in names
        ]
    )


def printed(key: Key, metric: str) -> float | None:
    """The printed figure of a configuration."""
    return PRINTED_FIGURES.get(str(key[0]), {}).get(metric)


# The metrics of a run.


def run_watched(simulation: Simulation) -> float:
    """Run to the end; return the share of time in which the zones were in balance."""
    view, limit = simulation.view, simulation.resolved.scenario.stop.max_duration
    rules, workspace = rules_of_zones(view, ADJACENCY_FT, "last"), space_of(view)
    flow = np.zeros((len(view.service_zones.roads.point),) * 2)
    every = ticks(view, LOOK_S)
    window = ticks(view, SECONDS_PER_UNIT["min"] * WINDOW_MIN)
    watched = balanced = 0
    while not simulation.finished and simulation.tick < limit:
        now = simulation.tick
        good = False
        if record_flow(view, window, now, flow) and view.service_zones.design.zone[0] != NIL:
            design = view.service_zones.design
            svp = find_loads(view.service_zones.roads, rules, flow, 0, design, workspace)
            good = 0.0 < svp <= IN_BALANCE
        simulation.run(until=now + every)
        watched += simulation.tick - now
        balanced += good * (simulation.tick - now)
    return balanced / watched if watched else 0.0


def hours_of(simulation: Simulation, ticks: float) -> float:
    """Convert ticks to hours; a tick of the scenario is in seconds."""
    return unit(simulation.resolved.scenario.units.tick).of(ticks) / SECONDS_PER_UNIT["h"]


def first_legs(simulation: Simulation) -> Array:
    """(n,) cells that each stored robot drives until its first pick; 0 for robots that never pick.

    Runs the simulation up to the last of these picks.
    """
    limit = simulation.resolved.scenario.stop.max_duration
    operations = simulation.world.tally.operations
    legs = np.full(len(operations), NIL, np.int64)
    while not simulation.finished and simulation.tick < limit and (legs == NIL).any():
        simulation.run(until=simulation.tick + 1)
        begun = (legs == NIL) & (operations[:, ACTION_PICK].sum(1) > 0)
        legs[begun] = operations[begun, ACTION_MOVE].sum(1)
    legs[legs == NIL] = 0
    return legs


def feet_by_robot(simulation: Simulation, legs: Array) -> Array:
    """(n,) feet that each robot drove, by identity, without its first leg."""
    cell = simulation.resolved.scenario.units.cell
    assert cell is not None, "the scenario gives the size of a cell"
    moves = simulation.world.tally.operations[:, ACTION_MOVE].sum(1) - legs
    feet: Array = unit(cell).size * moves[simulation.world.robots.at_index]
    return feet


def finished_parts(simulation: Simulation) -> Array:
    """(p,) ticks in which parts were finished, in order."""
    stations = simulation.world.stations
    return np.sort(
        stations.completion_tick[
            (stations.releases_order == NIL) & (stations.completion_tick != NIL)
        ]
    )


def completed(simulation: Simulation) -> Figures:
    """The metrics of a completed run: columns of Table 5, curve of Figure 5, and counts of zoning."""
    legs = first_legs(simulation)
    watched = None
    if "ticks_watched" in simulation.counted:
        run_to_end(simulation)
    else:
        watched = run_watched(simulation)
    feet = feet_by_robot(simulation, legs)
    done, counted = finished_parts(simulation), simulation.counted
    figures: Figures = {
        "hours": hours_of(simulation, float(simulation.world.stations.completion_tick.max())),
        "mean_ft": float(feet.mean()),
        "sigma_ft": float(feet.std()),
        "parts": len(done),
        "illegal": int(simulation.world.tally.illegal.sum()),
        **{
            published: counted[name]
            for published, name in (("redesigns", "redesigns"), ("load_shares", "shared_orders"))
            if name in counted
        },
    }
    if watched is not None:
        figures["in_balance"] = watched
    elif counted.get("ticks_watched"):
        figures["in_balance"] = counted["ticks_in_balance"] / counted["ticks_watched"]
    return figures | curve_of(simulation, done)


def curve_of(simulation: Simulation, done: Array) -> Figures:
    """Finished parts at each point of time of a throughput curve."""
    seconds = unit(simulation.resolved.scenario.units.tick).size
    at = np.array(curve_hours()) * SECONDS_PER_UNIT["h"] / seconds
    counts = np.searchsorted(done, at, side="right").tolist()
    return {point(hour): count for hour, count in zip(curve_hours(), counts, strict=True)}


def curve_hours() -> list[float]:
    """The points of time of a throughput curve."""
    return np.arange(0.0, CURVE_UNTIL + 1e-9, CURVE_EVERY).tolist()


def point(hour: float) -> str:
    """The name of a point of a throughput curve."""
    return f"{CURVE}{hour:g} h"


def travelled(simulation: Simulation) -> Figures:
    """The spread of travel in a completed run only."""
    figures = completed(simulation)
    return {"sigma_ft": figures["sigma_ft"]}


# Figure 5: throughput curves.


class ThroughputCurve(NamedTuple):
    """A throughput curve: finished parts at each point of time, printed and in our runs."""

    name: str
    hours: Sequence[float]
    published: Sequence[int | None]
    median: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]

    def within(self) -> tuple[int, int]:
        """Number of points at which the printed curve lies in our band, and number of all points.

        Points at which nothing or everything is finished, both in print and in ours, do not count.
        """
        points = [
            (low <= printed <= high)
            for printed, low, high in zip(self.published, self.low, self.high, strict=True)
            if printed is not None and (low, high, printed) not in ((0, 0, 0), (ALL, ALL, ALL))
        ]
        return sum(points), len(points)


def curves(made: Reproduced) -> list[ThroughputCurve]:
    """The curves of all configurations in DRAWN_CURVES that were run."""
    return [
        curve(str(case.key[0]), [run.metrics for run in batch])
        for table in made.tables
        for case, batch in zip(table.cases, table.results, strict=True)
        if case.key in [(name,) for name in DRAWN_CURVES]
    ]


def curve(name: str, runs: Sequence[Mapping[str, float]]) -> ThroughputCurve:
    """The curve of a configuration, from its runs."""
    hours = curve_hours()
    parts = np.array([[run[point(hour)] for hour in hours] for run in runs])
    low, median, high = np.percentile(parts, (BAND[0], 50, BAND[1]), axis=0).tolist()
    printed: list[int | None] = [int(text) for text in PUBLISHED_CURVES.get(name, "").split()]
    printed += [None] * (len(hours) - len(printed))
    return ThroughputCurve(name, hours, printed, median, low, high)


def curve_text(one: ThroughputCurve) -> str:
    """A line for every half hour: the band (-), our median (o) and the printed curve (x; * both)."""
    lines = []
    for k in range(0, len(one.hours), LINES_EVERY):
        low, median, high, printed = one.low[k], one.median[k], one.high[k], one.published[k]
        line = [" "] * (ALL // 2 + 1)
        line[round(low / 2) : round(high / 2) + 1] = "-" * (round(high / 2) + 1 - round(low / 2))
        line[round(median / 2)] = "o"
        if printed is not None:
            at = round(printed / 2)
            line[at] = "*" if line[at] == "o" else "x"
        beside = "" if printed is None else f", {printed} in print"
        lines.append(f"{one.hours[k]:4.1f} h |{''.join(line)}| {median:.0f}{beside}")
        if low >= ALL and printed in (None, ALL):
            break
    inside, points = one.within()
    if points:
        lines.append(
            f"The printed curve lies in our {BAND[0]} to {BAND[1]} % band at {inside} of {points} "
            f"points of time, {60 * CURVE_EVERY:.0f} minutes apart."
        )
    return "\n".join(lines)


# Comparison of spread: the probability that the sigma of travel of one method is smaller than another's.
#
# It is estimated by the share of pairs, of a run of one method and a run of the other, in which the first
# has the smaller sigma (ties count half). The interval is a bootstrap interval over seeds. Claims use the
# jackknife on placements: for each seed, the share of the other method's runs that it beats, and the
# share of the first method's runs that beat it. Both resample a seed for both methods together.


class Evenness(NamedTuple):
    """An estimate of P(sigma of one < sigma of the other), and its 95 % interval."""

    one: str
    other: str
    share: float
    low: float
    high: float
    seeds: int

    @property
    def half_width(self) -> float:
        return (self.high - self.low) / 2


def wins(one: Sequence[float], other: Sequence[float]) -> NDArray[np.float64]:
    """(n, m): 1 where a value of `one` is below one of `other`, 1/2 where they are equal."""
    a, b = np.array(one)[:, None], np.array(other)[None]
    found: NDArray[np.float64] = (a < b) + 0.5 * (a == b)
    return found


def placements(one: Sequence[float], other: Sequence[float]) -> list[float]:
    """One value for each seed, with the share of all pairs as their mean."""
    beats = wins(one, other)
    found: list[float] = (beats.mean(1) + beats.mean(0) - beats.mean()).tolist()
    return found


def pairs_run(sigmas: Mapping[str, Sequence[float]]) -> Iterator[Pair]:
    """Names and sigmas of each pair of configurations that were both run."""
    for one, other in PAIRS:
        if one in sigmas and other in sigmas:
            yield one, other, (sigmas[one], sigmas[other])


def together(
    found: Mapping[Key, Sequence[MeasuredRepetition]],
) -> Iterator[tuple[tuple[str, Key], Any]]:
    """The placements of all pairs, as samples for claims."""
    sigmas = {
        str(key[0]): [run.metrics[SIGMA] for run in batch]
        for key, batch in found.items()
        if key[1:] == (MANY,)
    }
    for one, other, values in pairs_run(sigmas):
        yield (SMALLER, (one, other)), placements(*values)


def evenness(one: str, other: str, values: Sequence[Sequence[float]]) -> Evenness:
    """The share of all pairs of runs, with a bootstrap interval over seeds."""
    beats = wins(*values)
    n = len(beats)
    rng = np.random.default_rng(1)
    # Counts of seeds, so that sums consist of whole and half numbers and are exact on any machine.
    drawn = rng.multinomial(n, np.full(n, 1 / n), size=BOOTSTRAPS).astype(np.float64)
    shares = ((drawn @ beats) * drawn).sum(1) / n**2
    low, high = np.percentile(shares, (2.5, 97.5)).tolist()
    return Evenness(one, other, float(beats.mean()), low, high, n)


def all_evenness(made: Reproduced) -> list[Evenness]:
    """The comparisons of all pairs of configurations that were both run."""
    sigmas = {
        str(key[0]): values
        for (metric, key), values in made.samples().items()
        if metric == SIGMA and key[1:] == (MANY,)
    }
    return [evenness(*pair) for pair in pairs_run(sigmas)]


def evenness_text(found: Sequence[Evenness]) -> str:
    """A line for each pair."""
    lines = [f"{'sigma of':<28}{'is below that of':<22}{'in pairs':>8}   95 % interval"]
    for pair in found:
        wide = "" if pair.half_width <= WIDEST else " (too wide)"
        lines.append(
            f"{pair.one:<28}{pair.other:<22}{100 * pair.share:>6.1f} %   "
            f"{100 * pair.low:.1f} to {100 * pair.high:.1f} %{wide}"
        )
    if found:
        seeds = found[0].seeds
        lines.append(
            f"All {seeds * seeds:,} pairs of {seeds} runs each; bootstrap over seeds, "
            f"{BOOTSTRAPS:,} draws. Intervals beyond +-5 % are too wide."
        )
    return "\n".join(lines)
