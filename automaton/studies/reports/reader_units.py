"""Metrics in the units of the reader: minutes instead of ticks, where a tick is a time.

Runs count in ticks and cells. A report multiplies what it prints of a metric by one number, which
changes no comparison. Where the points of a study disagree about what a tick is, it stays a tick.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from automaton.runs.metric_catalogue import METRIC_CATALOGUE, PER_1000_TICKS, units_of
from automaton.studies.inference.intervals import Interval
from automaton.studies.sweeps.result_columns import RUN_METRICS
from automaton.units import SECONDS_PER_UNIT, Unit, duration
from automaton.world.resolve import Resolved

TICK: Final = Unit(1.0, "tick")
PER_HOUR: Final = "orders/h"


class Scale(NamedTuple):
    """What a metric of the runs is multiplied by, and its unit then."""

    factor: float
    unit: str

    def of(self, interval: Interval) -> Interval:
        """An interval in this unit."""
        low, high = interval.low, interval.high
        return interval._replace(
            value=interval.value * self.factor,
            low=None if low is None else low * self.factor,
            high=None if high is None else high * self.factor,
        )


class Units(NamedTuple):
    """What a tick and a cell's side are at all points of a study."""

    tick: Unit = TICK
    cell: Unit | None = None

    def scale(self, metric: str, largest: float) -> Scale:
        """The scale of a metric of which `largest` is the largest mean, in the unit of the runs."""
        unit, _ = described(metric)
        seconds = self.tick.seconds
        if unit == "ticks":
            amount, name = duration(largest or 1.0, self.tick)
            return Scale(amount / (largest or 1.0), name)
        if unit.startswith(PER_1000_TICKS) and seconds:
            factor = SECONDS_PER_UNIT["h"] / (1000 * seconds)
            return Scale(factor, unit.replace(PER_1000_TICKS, PER_HOUR))
        if unit == "cells" and self.cell is not None:
            return Scale(self.cell.size, self.cell.name)
        return Scale(1.0, unit)


def units_of_points(scenarios: Iterable[Resolved], points: int) -> Units:
    """The units of a study of so many points: those that all of its scenarios share, else ticks."""
    units = [units_of(resolved.unrefined) for resolved in scenarios]
    if len(units) < points:  # the scenario of a point is not known
        return Units()
    ticks, cells = {tick for tick, _ in units}, {cell for _, cell in units}
    return Units(ticks.pop() if len(ticks) == 1 else TICK, cells.pop() if len(cells) == 1 else None)


def described(metric: str) -> tuple[str, str]:
    """Unit and meaning of a metric, as runs count it."""
    known = METRIC_CATALOGUE.get(metric) or RUN_METRICS.get(metric)
    return known or ("times", "counted by a strategy")
