"""Figure 5 of Keith & La: finished parts over time, the printed curves beside ours.

The printed ones are read off the authors' series every quarter of an hour, the last sample before
it. That of DDZ ends at 8.36 h with 98 parts; the last two are told in Table 5 alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.papers.reproduction_study import Reproduced
from automaton.papers.zoning.zoning_cases import DDZ, FREE, GA, SA
from automaton.papers.zoning.zoning_runs import CURVE_EVERY, curve_hours, point

PUBLISHED: Final[Mapping[str, str]] = {  # parts at 0 h, 0.25 h, 0.5 h ...
    SA: "0 0 0 0 3 6 10 13 15 20 23 26 33 38 43 52 57 62 69 73 80 89 94 97 99 100",
    GA: "0 0 0 3 5 9 12 16 18 21 27 34 39 42 49 55 58 63 68 74 79 87 92 95 97 100",
    DDZ: "0 0 0 0 0 0 1 2 3 4 7 7 7 7 9 14 17 24 29 37 39 41 42 42 49 56 65 73 80 85 89 91 94 96 98",
}
DRAWN: Final = (SA, GA, DDZ, FREE)
BAND: Final = (5, 95)  # percent of our runs
ALL: Final = 100  # parts
LINES_EVERY: Final = 2  # points of time


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


def as_data(found: Sequence[Curve]) -> list[dict[str, Any]]:
    """The curves for --json."""
    return [one._asdict() for one in found]
