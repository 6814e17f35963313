"""Runs of the factory for `zoning`: what is run for a case, and what is read off it.

Travel is what robots drive between the stations to which they are sent; the first leg of each, from
where it starts to the station of its first order, does not count (it does not in the publication).
The time to complete ends with the last work at a station.

Figure 5 shows finished parts over time, the printed curves beside ours. The printed ones are read off
the authors' series every quarter of an hour, the last sample before it. That of DDZ ends at 8.36 h
with 98 parts; the last two are told in Table 5 alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from automaton.engine.state import ACTION_MOVE, ACTION_PICK, NIL, Array
from automaton.papers.reproduction_study import Reproduced
from automaton.papers.zoning.zoning_balance import run_watched
from automaton.papers.zoning.zoning_cases import DDZ, FREE, GA, SA
from automaton.runs.headless import run_to_end
from automaton.runs.simulation import Simulation
from automaton.units import SECONDS_PER_UNIT, unit

CURVE_EVERY: Final = 0.25  # hours between two points of a throughput curve
CURVE_UNTIL: Final = 12.0
PUBLISHED: Final[Mapping[str, str]] = {  # parts at 0 h, 0.25 h, 0.5 h ...
    SA: "0 0 0 0 3 6 10 13 15 20 23 26 33 38 43 52 57 62 69 73 80 89 94 97 99 100",
    GA: "0 0 0 3 5 9 12 16 18 21 27 34 39 42 49 55 58 63 68 74 79 87 92 95 97 100",
    DDZ: "0 0 0 0 0 0 1 2 3 4 7 7 7 7 9 14 17 24 29 37 39 41 42 42 49 56 65 73 80 85 89 91 94 96 98",
}
DRAWN: Final = (SA, GA, DDZ, FREE)
BAND: Final = (5, 95)  # percent of our runs
ALL: Final = 100  # parts
LINES_EVERY: Final = 2  # points of time
CURVE: Final = "parts at "  # and the hour: how a point is called

Figures = dict[str, float | int]


def hours_of(simulation: Simulation, ticks: float) -> float:
    """Ticks in hours; a scenario's ticks are in seconds."""
    return unit(simulation.resolved.scenario.units.tick).of(ticks) / SECONDS_PER_UNIT["h"]


def first_legs(simulation: Simulation) -> Array:
    """(n,) cells that each stored robot drives until it picks up its first load.

    Runs the simulation up to the last of these. A robot that never picks anything up has none.
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
    assert cell is not None, "the scenario says what a cell is"
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
    """A run to its end: the columns of Table 5, the curve of Figure 5, and what zoning did."""
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
    """A run to its end: only how evenly its robots drove."""
    figures = completed(simulation)
    return {"sigma_ft": figures["sigma_ft"]}


class Curve(NamedTuple):
    """A throughput curve: at each point of time the printed parts, and our runs'."""

    name: str
    hours: Sequence[float]
    published: Sequence[int | None]
    median: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]

    def within(self) -> tuple[int, int]:
        """At how many points of time the printed curve lies in our band, and of how many.

        Points at which nothing is finished yet, or everything, in print and in ours do not count.
        """
        points = [
            (low <= printed <= high)
            for printed, low, high in zip(self.published, self.low, self.high, strict=True)
            if printed is not None and (low, high, printed) not in ((0, 0, 0), (ALL, ALL, ALL))
        ]
        return sum(points), len(points)


def curves(made: Reproduced) -> list[Curve]:
    """The curves of all drawn configurations that were run."""
    return [
        curve(str(case.key[0]), [run.metrics for run in batch])
        for table in made.tables
        for case, batch in zip(table.cases, table.results, strict=True)
        if case.key in [(name,) for name in DRAWN]
    ]


def curve(name: str, runs: Sequence[Mapping[str, float]]) -> Curve:
    """The curve of a configuration from its runs."""
    hours = curve_hours()
    parts = np.array([[run[point(hour)] for hour in hours] for run in runs])
    low, median, high = np.percentile(parts, (BAND[0], 50, BAND[1]), axis=0).tolist()
    printed: list[int | None] = [int(text) for text in PUBLISHED.get(name, "").split()]
    printed += [None] * (len(hours) - len(printed))
    return Curve(name, hours, printed, median, low, high)


def curve_text(one: Curve) -> str:
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
